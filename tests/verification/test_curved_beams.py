"""Beams that are curved at rest: Bathe's bend, an arc by Castigliano, what steps keep, refusals."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

from impactfem import Beam, Joint, Output, Probe, Scene, Solve, solve
from impactfem.errors import SceneError
from impactfem.system.beam_parts import torsion_constant

CLAMPED = {"end": "first", "kind": "clamped"}
BEND = {
    "height": 1.0, "width": 1.0, "density": 1.0, "youngs_modulus": 1e7, "poisson_ratio": 0.0,
    "theory": "timoshenko", "center": [0.0, 0.0, 0.0], "supports": [CLAMPED],
    "centerline": ["100*(1 - cos(s*pi/4))", "100*sin(s*pi/4)", "0"],
}  # fmt: skip
THIN = {"height": 0.005, "width": 0.01, "density": 1000.0, "youngs_modulus": 1e9}


def run(beam, duration=1e-3, dt=1e-3, end=None, **others):
    probes = [] if end is None else [Probe(name="tip", body="beam", point=end)]
    scene = Scene(
        title="beam", duration=duration, gravity=others.pop("gravity", [0.0] * beam.dim),
        bodies=[beam], solve=Solve(dt=dt, estimate=False), output=Output(fields=[]),
        probes=probes, **others,
    )  # fmt: skip
    return solve(scene)


def tip(beam, **others):
    end = beam.centreline()[-1]
    found = run(beam, end=end.tolist(), start="static", **others).history
    return end + [found[f"tip.u{axis}"].values[0] for axis in "xyz"[: beam.dim]]


def bend_by_shooting(force, guess):
    """Tip of Bathe's bend: the rod of Simo and Reissner, integrated from its root.

    Forces are the same all along, the moment at the root is that of the force at the tip.
    """
    push = np.array([0.0, 0.0, force])
    shear, twist = 5.0 / 6.0 * 5e6, 5e6 * torsion_constant(1.0, 1.0)
    soft = 1.0 / np.array([[1e7, shear, shear], [twist, 1e7 / 12.0, 1e7 / 12.0]])

    def rates(_, state):
        frame, moment = state[3:12].reshape(3, 3), state[12:]
        strain = soft[0] * (push @ frame) + [1.0, 0.0, 0.0]
        bent = soft[1] * (moment @ frame) + [0.0, 0.0, -0.01]
        along = frame @ strain
        turning = np.cross(frame, bent)  # R skew(K) = rows of R x K
        return np.concatenate([along, turning.ravel(), -np.cross(along, push)])

    def missed(place):
        frame = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        start = np.concatenate([np.zeros(3), frame.ravel(), np.cross(place, push)])
        found = solve_ivp(rates, (0.0, 25.0 * np.pi), start, rtol=1e-9, atol=1e-9)
        return found.y[:3, -1] - place

    return root(missed, guess, tol=1e-9).x


@pytest.mark.parametrize("force", [300.0, 600.0])
def test_bathes_bend_is_the_rod_integrated_and_within_what_is_published(force):
    published = {300.0: [22.5, 59.2, 39.5], 600.0: [15.9, 47.2, 53.4]}[force]
    load = [{"end": "last", "force": ["0", "0", repr(force)]}]
    coarse, fine = (tip(Beam(**BEND, elements=n, end_loads=load)) for n in (8, 16))
    known = bend_by_shooting(force, fine)
    off = [np.linalg.norm(found - known) / 60.0 for found in (coarse, fine)]
    assert off[1] < 4e-5
    assert off[0] / off[1] > 3.5  # the second order
    # Bathe and Bolourchi, Int. J. Numer. Methods Eng. 14 (1979) 961-986; others of the literature
    # are as far from these.
    assert fine == pytest.approx(published, abs=1.1 if force == 300.0 else 0.4)


def test_quarter_of_a_ring_gives_way_as_by_castigliano():
    radius, load = 0.4, 1e-4
    beam = Beam(
        **THIN, center=[0.0, 0.0], elements=32, supports=[CLAMPED],
        centerline=["0.4*sin(s*pi/2)", "0.4*(1 - cos(s*pi/2))"],
        end_loads=[{"end": "last", "force": ["0", repr(load)]}],
    )  # fmt: skip
    moved = tip(beam) - [radius, radius]
    unit = load * radius**3 / (1e9 * 0.01 * 0.005**3 / 12.0)
    # Moment P R (1 - sin(a)) of a load along the last tangent, a from the root.
    assert moved / unit == pytest.approx([-0.5, 0.75 * np.pi - 2.0], rel=2e-3)


@pytest.mark.parametrize("dim", [2, 3])
def test_free_curved_beam_rests_without_stresses_and_keeps_what_it_has(dim):
    beam = Beam(
        **THIN, center=[0.1, 0.2, 0.3][:dim], elements=8, velocity=[1.0, 0.5, -0.2][:dim],
        centerline=["0.3*cos(3*s)", "0.3*sin(3*s)", "0.1*s"][:dim],
        angular_velocity=12.0 if dim == 2 else [4.0, 12.0, -5.0],
    )  # fmt: skip
    found = run(beam, 0.3, 5e-3).history
    assert found["elastic_energy"].values[0] < 1e-20
    assert found["elastic_energy"].values.max() > 1e-3 * found["total_energy"].values[0]
    for name in ("total_energy", *(n for n in found if "momentum" in n)):
        values = found[name].values
        assert np.ptp(values) <= 1e-11 * max(1.0, np.abs(values).max()), name
    s = np.linspace(0.0, 1.0, 20001)
    middle = [0.1 + 0.3 * np.cos(3 * s).mean(), 0.2 + 0.3 * np.sin(3 * s).mean()]
    start = [found[f"beam.{axis}"].values[0] for axis in "xy"]
    assert start == pytest.approx(middle, abs=2e-4)  # of nodes, to the fourth order


def test_straight_centerline_is_a_straight_beam_and_joints_find_their_place():
    load = [{"end": "last", "force": ["0.1", "0.2", "0.3"]}]
    common = {**THIN, "elements": 6, "end_loads": load}
    holds = {"end": "first", "kind": "elastic", "stiffness": 1e3, "rotational_stiffness": 1.0}
    straight = Beam(
        **common, length=1.0, center=[0.5, 0.0, 0.0], strain="finite", supports=[holds],
    )  # fmt: skip
    said = Beam(**common, center=[0.0, 0.0, 0.0], centerline=["s", "0", "0"], supports=[holds])
    assert tip(said) == pytest.approx(tip(straight), abs=1e-9)
    held = Beam(**{**BEND, "supports": []}, end_loads=[{"end": "last", "force": ["0", "0", "9"]}])
    fixed = Joint(name="root", kind="fixed", between=["ground", "beam"], point=[0.0, 0.0, 0.0])
    clamped = Beam(**BEND, end_loads=held.end_loads)
    assert tip(held, joints=[fixed]) == pytest.approx(tip(clamped), abs=1e-6)


def test_springs_that_hold_turns_of_a_curved_end_are_at_rest():
    holds = {"end": "last", "kind": "elastic", "stiffness": 1e3, "rotational_stiffness": 5.0}
    beam = Beam(**{**BEND, "supports": [CLAMPED, holds]})
    found = run(beam, 1e-2, start="static").history
    assert found["elastic_energy"].values.max() < 1e-16


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"centerline": ["s", "0"]}, r"centerline has 2 entries, center has 3"),
        ({"strain": "small"}, r"strain.*straight axes"),
        ({"axis": [1.0, 0.0, 0.0]}, r"axis.*contradicts centerline"),
        ({"length": 3.0}, r"length = 3 is not that of centerline, 78\.53981634"),
        ({"centerline": ["0", "0", "1"]}, r"stands still"),
        ({"centerline": ["1/(s-0.5)", "s", "0"]}, r"centerline.*is no axis"),
        ({"height": 30.0, "theory": "timoshenko"}, r"height.*0\.3 of the least radius"),
        ({"centerline": None}, r"length is missing"),
        ({"width_axis": [0.0, 1.0, 0.0]}, r"begins along width_axis"),
    ],
)
def test_a_curved_beam_says_what_is_wrong(given, why):
    with pytest.raises(SceneError, match=why):
        Beam(**{**BEND, **given})
