"""Points as systems: gaps, springs and loads against closed forms and energies."""

import numpy as np
import pytest

from impactfem.errors import SceneError
from impactfem.scene import Contact, HalfSpace, Point, RigidCylinder, RigidSphere, Scene, Spring
from impactfem.system.derivatives import differentiate
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.system.points import points_system, start_state
from impactfem.system.start_checks import check_start


def scene_of(points, obstacles=(), contacts=(), **more):
    return Scene(
        title="t", duration=1.0, bodies=points, obstacles=obstacles, contacts=contacts, **more
    )


FLOOR = HalfSpace(name="floor", point=[0.0, 0.0], normal=[0.0, 2.0])


def ball(**changes):
    return Point(**{"name": "ball", "mass": 2.0, "position": [0.5, 1.5], **changes})


def test_linear_scene_gives_matrices():
    scene = scene_of(
        [ball(radius=0.1, force=["-3*vx + cos(2*t)", "-4*y"], springs=[Spring(anchor=[1.0, 0.0],
              stiffness=5.0, damping=0.5)])],
        [FLOOR], gravity=[0.0, -10.0],
    )  # fmt: skip
    system = points_system(scene).system
    assert isinstance(system, LinearSystem)
    assert system.is_exact
    assert system.stiffness == pytest.approx(np.diag([5.0, 9.0]))
    assert system.damping == pytest.approx(np.diag([3.5, 0.5]))
    assert system.load_at(0.3) == pytest.approx([5.0 + np.cos(0.6), -20.0])
    assert system.gap(0.0, np.array([0.5, 1.5])) == pytest.approx([1.4])


@pytest.mark.parametrize("rest_length", [0.0, 0.7])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_springs_push_as_their_energy_falls(dim, rest_length):
    rng = np.random.default_rng(dim)
    spring = Spring(to="b", stiffness=3.0, rest_length=rest_length)
    held = Spring(anchor=rng.uniform(2, 3, dim).tolist(), stiffness=2.0, rest_length=rest_length)
    points = [
        Point(name="a", mass=1.0, position=[0.0] * dim, springs=[spring, held]),
        Point(name="b", mass=1.0, position=[1.0] * dim),
    ]
    wall = HalfSpace(name="wall", point=[-9.0] * dim, normal=[1.0] + [0.0] * (dim - 1))
    found = points_system(scene_of(points, [wall]))
    u = start_state(scene_of(points, [wall]))[0] + rng.uniform(-0.2, 0.2, 2 * dim)
    force = found.system.force(0.0, u, np.zeros(2 * dim))
    slope = [
        (found.elastic(u + step) - found.elastic(u - step)) / 2e-6
        for step in 1e-6 * np.eye(2 * dim)
    ]
    assert force == pytest.approx(-np.array(slope), abs=1e-8)
    assert isinstance(found.system, LinearSystem) is (dim == 1 or rest_length == 0.0)
    assert found.conservative


def test_dampers_take_the_power_of_their_stretch_rate():
    points = [
        Point(name="a", mass=1.0, position=[0.0, 0.0],
              springs=[Spring(to="b", damping=2.0, rest_length=0.5)]),
        Point(name="b", mass=1.0, position=[3.0, 4.0]),
    ]  # fmt: skip
    found = points_system(scene_of(points, contacts=[Contact(between=["a", "b"])]))
    u, v = np.array([0.0, 0, 3, 4]), np.array([1.0, 2.0, -0.5, 1.0])
    rate = np.array([0.6, 0.8]) @ (v[2:] - v[:2])
    assert found.system.force(0.0, u, v) @ v == pytest.approx(-2.0 * rate**2)


CURVED = {
    "outside a circle": (RigidSphere(center=[0.0, 0.0], radius=1.0), np.sqrt(2.5) - 1.1),
    "inside a circle": (RigidSphere(center=[0.0, 0.0], radius=3.0, side="inside"),
                        2.9 - np.sqrt(2.5)),
    "cylinder": (RigidCylinder(point=[0.0, 0.0], radius=1.0), np.sqrt(2.5) - 1.1),
}  # fmt: skip


@pytest.mark.parametrize(("obstacle", "gap"), CURVED.values(), ids=CURVED)
def test_gap_of_curved_obstacles(obstacle, gap):
    scene = scene_of([ball(radius=0.1)], [obstacle])
    system = points_system(scene).system
    u, v = start_state(scene)
    assert system.gap(0.0, u) == pytest.approx([gap])
    check_start(system, u, v)  # its gradient agrees with differences


def test_cylinder_in_space_has_no_gap_along_its_axis():
    bore = RigidCylinder(point=[0.0, 0.0, 0.0], axis=[0.0, 0.0, 1.0], radius=2.0, side="inside")
    scene = scene_of([Point(name="ball", mass=1.0, position=[1.0, 0.5, 7.0])], [bore])
    system = points_system(scene).system
    u, v = start_state(scene)
    assert system.gap(0.0, u) == pytest.approx([2.0 - np.sqrt(1.25)])
    assert system.jacobian(u)[0, 2] == 0.0
    check_start(system, u, v)


def test_gap_of_two_balls():
    points = [ball(radius=0.2), Point(name="b", mass=1.0, position=[0.5, 3.0], radius=0.3)]
    scene = scene_of(points, contacts=[Contact(between=["ball", "b"])])
    system = points_system(scene).system
    u, v = start_state(scene)
    assert system.gap(0.0, u) == pytest.approx([1.0])
    assert system.jacobian(u) == pytest.approx(np.array([[0.0, -1.0, 0.0, 1.0]]))
    check_start(system, u, v)


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-3, 1.0, 1e4])
def test_gaps_are_as_curved_as_the_balls_whatever_their_size(size):
    other = Point(name="b", mass=1.0, position=[0.3 * size, 2.0 * size], radius=0.15 * size)
    points = [ball(position=[0.0, 1.6 * size], radius=0.1 * size), other]
    scene = scene_of(points, [FLOOR], [Contact(between=["ball", "b"])])
    system = points_system(scene).system
    u, v = start_state(scene)[0], size * np.array([0.4, 0.1, -0.2, 0.5])
    check_start(system, u, v)  # once: jacobian ... but differences give ...
    found = differentiate(lambda u: system.constraint_function(np.real(u)), u)
    assert found == pytest.approx(system.jacobian(u), abs=1e-7)
    way, across = v[:2] - v[2:], np.array([0.8, -0.6])
    bend = (way @ across) ** 2 / (0.5 * size)
    assert system.gap_curvature(0.0, u, v) == pytest.approx([bend], rel=1e-6)


def test_moving_plane_is_followed_along_its_normal():
    table = HalfSpace(name="t", point=[0.0, 0.0], normal=[0.6, 0.8], motion=["t", "sin(3*t)"])
    system = points_system(scene_of([ball()], [table])).system
    assert system.motion_at(0.4) == pytest.approx([0.6 * 0.4 + 0.8 * np.sin(1.2)])
    assert system.motion_rate(0.4) == pytest.approx([0.6 + 2.4 * np.cos(1.2)])
    assert system.motion_curvature(0.4) == pytest.approx([-7.2 * np.sin(1.2)])


# What a user's own system may have wrong.


def own(**changes):
    given = {
        "mass": np.eye(2),
        "force": lambda _t, _u, _v: np.zeros(2),
        "constraints": lambda u: np.array([u[0] ** 2 + u[1] - 1.0]),
    }
    return GeneralizedSystem(**(given | changes))


U, V = np.array([0.3, 1.2]), np.array([0.1, 0.2])


def test_jacobian_by_complex_steps_is_exact():
    assert own().jacobian(U) == pytest.approx(np.array([[0.6, 1.0]]), abs=1e-16)
    # Also where one of its entries vanishes and differences find their rounding instead.
    bottom = differentiate(lambda u: 1.0 - np.sqrt(u[0] ** 2 + u[1] ** 2), np.array([0.0, -1.0]))
    assert (bottom == [[0.0, 1.0]]).all()


def test_jacobian_by_differences_where_complex_numbers_lose_their_part():
    def bent(u):
        return np.array([abs(u[0]) + max(float(np.real(u[1])), 0.0)])

    assert differentiate(bent, U) == pytest.approx(np.array([[1.0, 1.0]]), abs=1e-9)


MISTAKES = {
    "asymmetric mass": ({"mass": [[1.0, 0.5], [0.0, 1.0]]}, "not symmetric"),
    "indefinite mass": ({"mass": [[1.0, 2.0], [2.0, 1.0]]}, "not positive definite.*-1"),
    "shape of mass": ({"mass": lambda _: np.eye(3), "dofs": 2}, "must be"),
    "jacobian": (
        {"jacobian": lambda u: np.array([[2 * u[0], 1.5]])},
        r"jacobian\[0, 1\] = 1.5 .* give 1",
    ),
    "shape of jacobian": ({"jacobian": lambda _: np.eye(2)}, r"shape \(2, 2\).*must be \(1, 2\)"),
    "gradient": (
        {"constraints": lambda u: np.array([(u[0] - 0.3) ** 2 + (u[1] - 1.2) ** 2])},
        "gradient of constraint 0 vanishes",
    ),
    "start": ({"constraints": lambda u: np.array([u[0] - 1.0])}, "outside constraint 0.*-0.7"),
    "force": ({"force": lambda _t, _u, _v: np.array([np.nan, 0.0])}, "must give 2 finite"),
    "length of force": ({"force": lambda _t, _u, _v: np.zeros(3)}, "must give 2 finite"),
}


@pytest.mark.parametrize(("changes", "text"), MISTAKES.values(), ids=MISTAKES)
def test_mistake_in_a_system_is_explained(changes, text):
    with pytest.raises(SceneError, match=text):
        check_start(own(**changes), U, V)


@pytest.mark.parametrize("e", [-0.1, 1.1, np.nan])
def test_restitution_outside_its_range(e):
    with pytest.raises(SceneError, match=r"restitution = .*from 0"):
        own(restitution=e)


def test_counts_that_do_not_fit():
    with pytest.raises(SceneError, match="2 entries for 1 constraints"):
        own(restitution=[0.1, 0.2])
    with pytest.raises(SceneError, match="give dofs"):
        own(mass=lambda _: np.eye(2))
    with pytest.raises(SceneError, match="one for each of"):
        check_start(own(), np.zeros(3), V)
