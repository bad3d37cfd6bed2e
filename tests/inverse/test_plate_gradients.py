"""Gradients of plates by time steps: a closed form, identities that any has, what is refused."""

import copy
import math

import numpy as np
import pytest

import impactfem
from impactfem import Scene, SceneError
from impactfem.inverse.steps import Changes
from impactfem.inverse.varied import Varied

PLAIN = {"report": False, "pictures": False, "fields": []}
EDGES = ("left", "right", "bottom", "top")
LID = {
    "kind": "plate",
    "name": "lid",
    "outline": {"kind": "rectangle", "size": [0.1, 0.1]},
    "mesh_size": 0.02,
    "thickness": 1e-3,
    "density": 2700.0,
    "youngs_modulus": 70e9,
    "poisson_ratio": 0.3,
    "supports": [{"edge": edge, "kind": "simply_supported"} for edge in EDGES],
}
STOP = {"kind": "half_space", "name": "stop", "point": [0, 0, -0.8e-3], "normal": [0, 0, 1]}


def scene(body=(), **more):
    """A plate that goes down on a stop, its place in the middle measured."""
    return {
        "title": "lid", "duration": 8e-4, "gravity": [0.0, 0.0, 0.0],
        "body": [copy.deepcopy(LID) | {"velocity": -1.0} | dict(body)], "obstacle": [STOP],
        "probe": [{"name": "mid", "body": "lid", "point": [0.0, 0.0, 0.0]}],
        "measure": [{"name": "u", "of": "mid.uz"}],
        "objective": {"minimise": [{"term": "value", "of": "u", "weight": 1e3}]},
        "solve": {"dt": 1e-5}, "output": PLAIN,
    } | more  # fmt: skip


def varied(data, **keys):
    """The same with parameters of some names."""
    parameters = [{"name": name, "key": f"body.lid.{key}"} for name, key in keys.items()]
    return Scene.from_dict(copy.deepcopy(data) | {"parameter": parameters})


def test_slopes_of_a_mode_are_those_of_its_closed_form():
    # w = v sin(omega t) / omega cos cos, omega = 2 (pi / a)^2 sqrt(E h^2 / (12 (1 - nu^2) rho)).
    bending = 70e9 * 1e-3**2 / (12.0 * (1.0 - 0.3**2) * 2700.0)
    omega = 2.0 * (math.pi / 0.1) ** 2 * math.sqrt(bending)
    end = 0.3 * 2.0 * math.pi / omega
    data = scene({"velocity": "v*cos(pi*x/0.1)*cos(pi*y/0.1)", "mesh_size": 0.02},
                 obstacle=[], duration=end, solve={"dt": end / 25})  # fmt: skip
    parameters = [{"name": "v", "start": 1.0}]
    parameters += [{"name": n, "key": f"body.lid.{k}"} for n, k in
                   (("E", "youngs_modulus"), ("h", "thickness"))]  # fmt: skip
    found = impactfem.gradient(Scene.from_dict(data | {"parameter": parameters}))
    assert found.method == "massless"  # not the plan's moreau_jean
    assert found.check.rate == pytest.approx(2.0, abs=0.1)
    slope, phase = found.gradient, omega * end
    by_omega = (phase * math.cos(phase) - math.sin(phase)) / omega  # times omega
    assert 1e-3 * slope["v"] == pytest.approx(math.sin(phase) / omega, rel=0.015)  # five elements
    assert 1e-3 * 70e9 * slope["E"] == pytest.approx(0.5 * by_omega, rel=0.04)
    assert 1e-3 * slope["h"] == pytest.approx(2.0 * 70e9 * slope["E"], rel=1e-6)


@pytest.mark.parametrize("more", [{"membrane": "von_karman"}, {}], ids=["stretches", "on springs"])
def test_modulus_and_density_count_by_their_ratio_and_impacts_too(more):
    # Of lengths in step E / density alone counts, as a stiffness over the density does.
    keys = {"E": "youngs_modulus", "rho": "density"}
    data = scene({"mesh_size": 0.03} | more, duration=5e-4, solve={"dt": 2e-5})
    if not more:
        data["contact"] = [{"between": ["lid", "stop"], "stiffness": 1e5}]
    given = varied(data, **keys).to_dict()
    if not more:
        given["parameter"].append({"name": "k", "key": "contact.0.stiffness"})
    given["measure"].append({"name": "lasted", "of": "duration.lid.stop"})
    given["objective"]["minimise"].append({"term": "value", "of": "lasted", "weight": 1e3})
    found = impactfem.gradient(Scene.from_dict(given))
    assert found.trusted
    assert found.check.rate == pytest.approx(2.0, abs=0.15)
    each = [70e9 * found.gradient["E"], 1e5 * found.gradient.get("k", 0.0)]
    # Rounding of runs over the step of a difference.
    assert 2700.0 * found.gradient["rho"] == pytest.approx(-sum(each), abs=1e-5 * abs(sum(each)))


def test_controls_act_on_pressures_by_their_face_and_on_edges():
    plain = scene({"pressures": [{"face": "top", "value": "push"}]})
    acting = scene()
    for data in (plain, acting):
        data["control"] = [{"name": "push", "pieces": 3, "start": [1e3, -1e3, 5e2]}]
    acting["control"][0]["acts"] = "body.lid.pressure.top"
    found, same = (Scene.from_dict(each).bodies[0].pressures[0] for each in (plain, acting))
    assert (same.face, same.value.text) == (found.face, found.value.text) == ("top", "push")
    edge = {"acts": "body.lid.motion.left", "kind": "linear", "start": [0, 0, 1e-4, 0]}
    acting["control"][0] |= edge
    acting["body"][0]["supports"] = [{"edge": "left", "kind": "clamped", "motion": 0}]
    moved = Scene.from_dict(acting).bodies[0].supports[0].motion
    assert moved.text == "push"
    acting["control"][0]["acts"] = "body.lid.traction.top.x"
    with pytest.raises(SceneError, match=r"no tractions; give body\.lid\.pressure\.top"):
        Scene.from_dict(acting)


@pytest.mark.parametrize(
    ("key", "more", "match"),
    [
        ("mesh_size", {}, r"mesh_size: gradients keep the elements of the start"),
        ("outline.size.0", {}, r"outline: gradients keep the elements.*displacement of lid"),
        ("thickness", {"thickness": 0.05 * 0.1}, r"theory: lid passes from kirchhoff to reissner"),
    ],
)  # fmt: skip
def test_meshes_and_theories_are_kept(key, more, match):
    data = scene(more, duration=2e-5, obstacle=[])
    with pytest.raises(SceneError, match=match):
        impactfem.gradient(varied(data, p=key))


def test_a_ball_on_a_plate_does_not_jump():
    # Where the plate touches it has no mass. The slope is that of a line through runs 3 % apart.
    data = scene({"velocity": 0.0, "mesh_size": 0.034}, obstacle=[], solve={"dt": 2e-5})
    place = {"position": [2e-3, 1e-3, 5.73e-3], "velocity": [0.0, 0.0, -1.0]}
    ball = {"kind": "point", "name": "ball", "mass": 5e-3, "radius": 5e-3}
    data["body"].append(ball | place)
    data["measure"] = [{"name": "u", "of": "ball.z"}]
    data["parameter"] = [{"name": "v", "key": "body.ball.velocity.2"}]
    runs = Varied.of(Scene.from_dict(data))
    low, high = (runs.numbers(np.array([v]))[0] for v in (-1.03, -0.97))
    (slope,) = runs.jacobian(runs.start).jacobian[0]
    assert slope == pytest.approx((high - low) / 0.06, rel=2e-3)


def driven(method, more=()):
    """A tilted plate under a control; its speed, its stop and the control vary."""
    data = scene({
        "mesh_size": 0.034, "normal": [0.0, 0.6, 0.8], "damping_ratio": 0.02,
        "supports": LID["supports"][:2], "pressures": [{"face": "top", "value": "(1+10*x)*push"}],
    } | dict(more), gravity=[0.0, 0.0, -9.81])  # fmt: skip
    data["obstacle"] = [STOP | {"point": [0.0, -0.48e-3, -0.64e-3], "normal": [0.0, 0.6, 0.8]}]
    data["solve"] = {"method": method, "dt": 2.1e-5}
    data["parameter"] = [{"name": "v", "key": "body.lid.velocity"},
                         {"name": "z", "key": "obstacle.stop.point.2"}]  # fmt: skip
    start = [2e3 * math.sin(k) for k in range(7)]
    data["control"] = [{"name": "push", "pieces": 7, "start": start}]
    told = {"u": ("mid.uz", 4.1e-4), "rate": ("mid.vy", 4.2e-4), "gap": ("gap.lid.stop", 2e-4),
            "strained": ("elastic_energy", 4e-4), "moved": ("kinetic_energy", 3e-4),
            "height": ("lid.z", 7e-4), "force": ("force.lid.stop", 4e-4)}  # fmt: skip
    data["measure"] = [{"name": n, "of": of, "at": at} for n, (of, at) in told.items()]
    data["measure"] += [{"name": n, "of": f"{of}.lid.stop"} for n, of in
                        (("pushed", "impulse"), ("lasted", "duration"))]  # fmt: skip
    data["measure"].append({"name": "back", "of": "lid.vz"})
    terms = [{"term": "peak_force", "pair": "lid.stop"}, {"term": "effort", "of": "push"}]
    terms += [{"term": f"{kind}_energy"} for kind in ("vibration", "terminal")]
    if method == "massless":
        data["control"].append({"name": "profile", "along": "x", "from": -0.05, "until": 0.05,
                                "pieces": 4, "start": [1.0, 1.2, 0.9, 1.1]})  # fmt: skip
        keys = {"E": "youngs_modulus", "nu": "poisson_ratio", "rho": "density"}
        data["parameter"] += [{"name": n, "key": f"body.lid.{key}"} for n, key in keys.items()]
        terms = [*terms[:3], {"term": "mass", "body": "lid"}]  # no potential of what changes
    data["objective"] = {"minimise": terms}
    return Scene.from_dict(data)


SHEARS = {
    "theory": "reissner_mindlin", "rayleigh_mass": 99.0, "rayleigh_stiffness": 1e-6,
    "damping_ratio": None, "thickness": "1e-3*(1+2*y)*profile", "displacement": "1e-4*x",
}  # fmt: skip
"""A profile in pieces, which with the material changes how it begins, too."""


@pytest.mark.parametrize(
    ("method", "more"),
    [("conserving", {}), pytest.param("massless", SHEARS, marks=pytest.mark.parallel(2))],
)  # fmt: skip
def test_steps_backwards_are_differences_of_runs(method, more):
    varied = Varied.of(driven(method, more))
    at, names = varied.start, tuple(each.name for each in varied.unknowns)
    changes = Changes(varied.at, at, np.abs(at) + 1e-2 * varied.scales, names)
    numbers, (slopes, known), weak = varied.runs._backwards(changes, varied.quantities)
    assert known.all()
    assert not weak
    assert (np.abs(numbers) > 0.0).all()
    way = np.random.default_rng(1).standard_normal(len(at)) * changes.scales
    way[1] *= 1e-2
    h = 1e-5
    ends = [varied.numbers(at + sign * h * way) for sign in (1.0, -1.0)]
    wanted = (ends[0] - ends[1]) / (2.0 * h)
    # Runs round to some 1e-13 of their numbers, which h makes 1e-8.
    room = 1e-6 * np.abs(wanted) + 1e-8 * np.abs(numbers)
    assert (np.abs(slopes @ way - wanted) <= room).all()
