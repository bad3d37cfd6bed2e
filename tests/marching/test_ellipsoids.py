"""Ellipsoids: closed forms of their mass and rocking, a ball for equal radii, distances."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from surfaces import box, write_stl

import impactfem
from impactfem import RigidBody, Scene, SceneError
from impactfem.contact.convex_pairs import facing
from impactfem.system.convex import Convex

_G = 9.81
_FLOOR = {
    "kind": "half_space",
    "name": "floor",
    "point": [0.0, 0.0, 0.0],
    "normal": [0.0, 1.0, 0.0],
}
_BOX = {"kind": "box", "name": "floor", "size": [1.0, 1.0, 1.0], "center": [0.0, -0.5, 0.0]}
_RADII = [0.2, 0.1, 0.15]


def shape(radii=_RADII, **more):
    return {"kind": "ellipsoid", "radii": radii, "center": [0.0, radii[1], 0.0]} | more


def solve(body, *floors, duration=0.2, dt=1e-3, folder=None, friction=0.3, **law):
    given = {
        "title": "ellipsoid", "duration": duration, "gravity": [0.0, -_G, 0.0],
        "body": [{"kind": "rigid", "name": "b", "density": 1000.0} | body],
        "obstacle": list(floors),
        "contact": [{"between": ["b", "floor"], "friction_coefficient": friction} | law],
        "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
    }  # fmt: skip
    return impactfem.solve(Scene.from_dict(given, base=folder))


def differences(one, two):
    names = [name for name in one.history if name.startswith("b.")]
    return max(np.abs(one.history[n].values - two.history[n].values).max() for n in names)


def test_mass_and_inertia_are_closed_forms():
    body = RigidBody(shape=shape(), density=3.0)
    mass = 3.0 * 4.0 / 3.0 * np.pi * np.prod(_RADII)
    a, b, c = np.square(_RADII)
    assert body.total_mass == pytest.approx(mass, rel=1e-14)
    expected = mass / 5.0 * np.diag([b + c, a + c, a + b])
    assert body.moments == pytest.approx(expected, rel=1e-14, abs=1e-18)


@pytest.mark.parametrize("floor", [_FLOOR, _BOX, "mesh"], ids=["half_space", "box", "mesh"])
def test_equal_radii_are_a_ball(tmp_path, floor):
    if floor == "mesh":
        write_stl(tmp_path / "box.stl", box((1.0, 1.0, 1.0), (-0.5, -1.0, -0.5)))
        floor = {"kind": "mesh", "name": "floor", "mesh": "box.stl"}
    moving = {"velocity": [1.0, 0.0, 0.5], "angular_velocity": [0.0, 2.0, 5.0]}
    rolls = {"rolling_resistance": 1e-3, "spinning_resistance": 1e-3}
    ball = {"kind": "sphere", "radius": 0.1, "center": [0.0, 0.1, 0.0]}
    both = [
        solve(moving | {"shape": each}, floor, folder=tmp_path, **rolls)
        for each in (ball, shape([0.1] * 3))
    ]
    assert differences(*both) < 1e-10


@pytest.mark.parametrize("rolls", [True, False])
def test_small_rocking_has_its_period(rolls):
    """About z: R = a^2 / b below, J = I + m b^2 where it rolls, I where it slides.

    J w'' = -m g (R - b) w; the period grows with the square of the angle, here of 2e-4 rad.
    """
    a, b, _ = _RADII
    own = (a**2 + b**2) / 5.0 + rolls * b**2
    period = 2.0 * np.pi * np.sqrt(own / (_G * (a**2 / b - b)))
    moving = {"velocity": [-2e-3 * b * rolls, 0.0, 0.0], "angular_velocity": [0.0, 0.0, 2e-3]}
    found = solve(
        {"shape": shape()} | moving, _FLOOR, duration=1.3 * period, dt=2e-3, friction=5.0 * rolls
    )
    spin, time = found.history["b.wz"].values, found.history["time"].values
    falls = np.flatnonzero((spin[:-1] > 0.0) & (spin[1:] <= 0.0))
    zero = time[falls] + np.diff(time)[falls] * spin[falls] / (spin[falls] - spin[falls + 1])
    assert np.diff(zero) == pytest.approx([period], rel=1e-4)
    assert spin.max() == pytest.approx(2e-3, rel=1e-4)


def test_distances_are_least():
    rng = np.random.default_rng(2)
    radii = np.array([[0.3, 0.2, 0.1], [0.15, 0.25, 0.2]])
    for kind in range(2):
        turns = Rotation.random(2, random_state=kind).as_matrix()
        place = rng.normal(size=3)
        place *= 0.75 / np.linalg.norm(place)
        poses = (place, turns[0]), (np.zeros(3), turns[1])
        corners = np.array(list(np.ndindex(2, 2, 2))) * 0.3 - 0.15
        shapes = Convex.ellipsoid(radii[0]), (Convex.ellipsoid(radii[1]), Convex.of(corners))[kind]
        n, x, y = facing(*shapes, *poses, 8)
        gap = float(((x - y) @ n).min()) - shapes[0].radius - shapes[1].radius

        def apart(q, k=kind, turns=turns, place=place):
            one = place + turns[0] @ (radii[0] * q[:3])
            two = turns[1] @ (q[3:] * (radii[1] if k == 0 else 0.15))
            return ((one - two) ** 2).sum()

        ball = {"type": "ineq", "fun": lambda q: 1.0 - q[:3] @ q[:3]}
        other = {"type": "ineq", "fun": lambda q: 1.0 - q[3:] @ q[3:]}
        best = minimize(
            apart, np.zeros(6), constraints=[ball, other] if kind == 0 else [ball],
            bounds=[(-1.0, 1.0)] * 6, options={"ftol": 1e-16, "maxiter": 500},
        )  # fmt: skip
        assert gap == pytest.approx(np.sqrt(best.fun), abs=1e-7)


def test_it_falls_over_an_edge_of_a_mesh_as_of_a_box(tmp_path):
    write_stl(tmp_path / "box.stl", box((1.0, 1.0, 1.0), (-0.5, -1.0, -0.5)))
    mesh = {"kind": "mesh", "name": "floor", "mesh": "box.stl"}
    moving = {"shape": shape(center=[0.45, 0.11, 0.0]), "velocity": [1.0, 0.0, 0.2]}
    both = [solve(moving, f, folder=tmp_path, friction=0.0) for f in (_BOX, mesh)]
    assert differences(*both) < 1e-9
    assert both[0].history["b.wz"].values[-1] < -0.5


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"shape": shape([0.1, 0.0, 0.1])}, "radii = .* are not all above 0"),
        ({"shape": shape([0.1, 0.1])}, "radii"),
        ({"shape": shape([1.0, 0.01, 1.0])}, "more than 20 times"),
        ({"shapes": [shape([0.1, -0.1, 0.1])]}, "are not all above 0"),
    ],
)
def test_bad_radii_are_refused(given, message):
    with pytest.raises(SceneError, match=message):
        solve(given, _FLOOR)


def test_what_is_soft_does_not_meet_it():
    point = {"kind": "point", "name": "p", "mass": 1.0, "position": [0.0, 1.0, 0.0], "radius": 0.1}
    body = {"kind": "rigid", "name": "b", "density": 1.0, "shape": shape()}
    with pytest.raises(SceneError, match="b is an ellipsoid, which meets rigid bodies"):
        Scene.from_dict({"title": "t", "duration": 1.0, "body": [body, point]})
