"""Bodies that are too stiff for careless elements: Cook's membrane, nearly incompressible, slender.

Each runs with the elements that the plan chooses, and once with others, which lock.
"""

import math
from pathlib import Path

import numpy as np
import pytest

import impactfem

MESHES = Path(__file__).parents[2] / "meshes"


def solve(body, obstacle, duration, *, gravity=None, every=0, **solve):
    """Run a scene of one body; ``every`` > 0 keeps fields."""
    given = {"name": "body", "kind": "solid", "density": 1.0, "youngs_modulus": 1.0}
    tables = {
        "title": "locking", "duration": duration, "gravity": gravity,
        "body": [given | body], "obstacle": [{"name": "obstacle", "kind": "half_space"} | obstacle],
        "solve": {"estimate": False} | solve,
        "output": {"fields": ["vtkhdf"] if every else [], "every": every or 1},
    }  # fmt: skip
    return impactfem.solve(impactfem.Scene.from_dict(tables))


def deflection(result, place):
    """Vertical displacement of a node at all times that were kept."""
    points, fields = result.fields.points, result.fields
    distance = np.linalg.norm(points[:, : len(place)] - place, axis=1)
    assert distance.min() < 1e-9
    node = int(distance.argmin())
    return np.array(
        [fields.read(k, "displacement")["displacement"][node, 1] for k in range(len(fields))]
    )


def cook(**given):
    """Cook's membrane from its file, at rest in the end."""
    body = {
        "model": "plane_stress", "mesh": str(MESHES / "cook.geo"), "poisson_ratio": 1 / 3,
        "rayleigh_mass": 0.025, "contact_surfaces": ["top"],
        "supports": [{"surface": "left", "kind": "fixed"}],
        "tractions": [{"surface": "right", "value": ["0", "1/16"]}],
    }  # fmt: skip
    ceiling = {"point": [0.0, 100.0], "normal": [0.0, -1.0]}
    run = solve(body | given, ceiling, 960.0, every=20, method="massless", dt=6.0)
    return run.summary["plan"]["degree"], deflection(run, [48.0, 52.0])


@pytest.mark.parametrize(("given", "degree", "error"), [({}, 1, 0.01), ({"degree": 2}, 2, 1e-3)])
def test_cooks_membrane_from_its_file(given, degree, error):
    chosen, tip = cook(**given)
    assert chosen == degree
    assert tip[-1] == pytest.approx(23.96, rel=error)
    assert tip[-1] == pytest.approx(tip[-2], rel=1e-3)  # has come to rest there
    assert tip[0] == 0.0


TIGHT = {
    "model": "plane_strain", "shape": {"kind": "disc", "radius": 0.5, "center": [0.0, 0.52]},
    "youngs_modulus": 0.5 * 1.4999, "poisson_ratio": 0.4999, "velocity": [0.0, -0.1],
}  # fmt: skip
FLOOR = {"point": [0.0, 0.0], "normal": [0.0, 1.0]}


class Rebound:
    """Force and speed of a nearly incompressible disc; its shear waves have the speed .5."""

    def __init__(self, size, **given):
        solving = {"method": "massless"} if given.get("degree") == 1 else {}
        run = solve(TIGHT | {"mesh_size": size} | given, FLOOR, 4.0, **solving)
        history, self.plan = run.history, run.summary["plan"]
        force, energy = history["contact_force"].values, history["total_energy"].values
        self.largest, self.speed = force.max(), float(history["body.vy"][-1])
        self.variation = np.abs(np.diff(force)).sum() / force.max()
        self.gain = energy.max() / energy[0] - 1.0


def test_nearly_incompressible_disc_does_not_lock():
    coarse, fine = Rebound(1 / 16), Rebound(1 / 32)
    assert coarse.plan["degree"] == fine.plan["degree"] == 2
    assert coarse.speed == pytest.approx(fine.speed, rel=3e-3)
    assert coarse.largest == pytest.approx(fine.largest, rel=0.03)
    locked = Rebound(1 / 16, degree=1)
    assert locked.largest > 1.5 * fine.largest
    assert any("lock" in found["text"] for found in locked.plan["findings"])
    # Quadrilaterals of degree 1 keep their volume in the mean and need no second degree.
    other = Rebound(1 / 16, cells="hexahedron")
    assert other.plan["degree"] == 1
    assert other.speed == pytest.approx(fine.speed, rel=2e-3)
    # Their force is the smoothest known of this disc.
    assert coarse.variation <= 1.3 * other.variation
    assert max(run.gain for run in (coarse, fine, locked, other)) <= 1e-9


def test_damping_as_the_plan_says_smooths_the_force():
    free = Rebound(1 / 16)
    (text,) = (f["remedy"] for f in free.plan["findings"] if "rayleigh_stiffness = " in f["remedy"])
    damping = float(text.split("rayleigh_stiffness = ")[1].split()[0])
    damped = Rebound(1 / 16, rayleigh_stiffness=damping)
    assert damped.variation <= 0.9 * free.variation
    assert damped.speed == pytest.approx(free.speed, rel=0.006)


LENGTH, THICK = 1.0, 0.02
BEAM = {
    "model": "3d", "mesh_size": THICK, "poisson_ratio": 0.3,
    "shape": {"kind": "block", "size": [LENGTH, THICK, THICK], "corner": [0.0, 0.0, 0.0]},
    "supports": [{"surface": "left", "kind": "fixed"}],
}  # fmt: skip
FAR = {"point": [0.0, -9.0, 0.0], "normal": [0.0, 1.0, 0.0]}
INERTIA, AREA = THICK**4 / 12, THICK**2
ROOT = 1.8751040687
PERIOD = 2 * math.pi / (ROOT**2 * math.sqrt(INERTIA / AREA))  # of the first mode, E = rho = 1
RATIO = (math.cosh(ROOT) + math.cos(ROOT)) / (math.sinh(ROOT) + math.sin(ROOT))
MODE = f"cosh({ROOT}*x) - cos({ROOT}*x) - {RATIO}*(sinh({ROOT}*x) - sin({ROOT}*x))"


def first_period(**given):
    body = BEAM | {"velocity": ["0", f"1e-5*({MODE})", "0"]} | given
    run = solve(body, FAR, 0.6 * PERIOD, method="massless", dt=PERIOD / 200)
    centre, times = run.history["body.y"].values - 0.5 * THICK, run.history["time"].values
    k = int(np.flatnonzero((centre[1:] <= 0.0) & (centre[:-1] > 1e-9))[0])
    half = times[k] + (times[k + 1] - times[k]) * centre[k] / (centre[k] - centre[k + 1])
    return 2.0 * half, run.summary["plan"]


def test_slender_bar_vibrates_as_a_beam():
    period, plan = first_period()
    assert plan["degree"] == 2
    assert "50 times as long" in plan["reasons"]["degree"]
    # Clamped faces cannot contract: shorter by .2 %; shear and rotation: longer by .1 %.
    assert period == pytest.approx(PERIOD, rel=5e-3)
    locked, plan = first_period(degree=1)
    assert locked < 0.65 * PERIOD
    assert any("lock" in found["text"] for found in plan["findings"])


EDGE = {"kind": "cylinder", "axis": [0.0, 0.0, 1.0], "radius": 0.05}


def propped(**given):
    """A cantilever that comes to rest on an edge: its reaction and deflection over the beam's."""
    gravity, arm = 1e-6, LENGTH - 0.01
    run = solve(
        BEAM | {"rayleigh_mass": 16 * math.pi / PERIOD, "contact_surfaces": ["bottom"]} | given,
        EDGE | {"point": [arm, -0.05, 0.0]}, 4.0 * PERIOD, gravity=[0.0, -gravity, 0.0],
        every=160, method="massless", dt=PERIOD / 40,
    )  # fmt: skip
    load, x = AREA * gravity, 0.5
    reaction = load * (6 * LENGTH**2 - 4 * arm * LENGTH + arm**2) / (8 * arm)
    own = load * x**2 * (6 * LENGTH**2 - 4 * x * LENGTH + x**2) / (24 * INERTIA)
    lifted = reaction * x**2 * (3 * arm - x) / (6 * INERTIA)
    force = float(run.history["contact_force"][-1])
    return force / reaction, -deflection(run, [x, 0.0, 0.0])[-1] / (own - lifted)


def test_slender_bar_rests_on_an_edge_as_a_beam():
    reaction, sag = propped()
    assert reaction == pytest.approx(1.0, abs=5e-3)
    assert sag == pytest.approx(1.0, abs=5e-3)
    assert propped(degree=1)[1] < 0.35  # as its period, .56 of the beam's, whose square is .31


def bounced(**given):
    """A cantilever whose first mode throws it on an edge; height of its centre, energy."""
    run = solve(
        BEAM | {"velocity": ["0", f"-1e-5*({MODE})", "0"]} | given,
        EDGE | {"point": [LENGTH - 0.02, -0.0501, 0.0]}, 0.55 * PERIOD,
        method="conserving", dt=PERIOD / 400,
    )  # fmt: skip
    history = run.history
    assert history["contact_force"].values.max() > 0.0
    energy = history["total_energy"].values
    return history["body.y"].values - 0.5 * THICK, np.abs(energy / energy[0] - 1.0).max()


@pytest.mark.slow
def test_slender_bar_bounces_on_an_edge_without_locking():
    chosen, drift = bounced()
    other, _ = bounced(cells="hexahedron")
    locked, _ = bounced(degree=1)
    scale = np.abs(other).max()
    assert np.abs(chosen - other).max() <= 0.03 * scale
    assert np.abs(locked - other).max() >= 0.3 * scale
    # The energy of bending is 1e-7 of the sums whose differences it is: rounding shows.
    assert drift <= 1e-8
