"""A point in a corner: where the model is well posed, where it jumps, and what penalties choose."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from penalty import PenaltySettings, integrate_penalty
from scipy.integrate import solve_ivp

from impactfem.system.generalized import LinearSystem
from impactfem.vibro.event_driven import EventSettings, integrate_events
from impactfem.vibro.position_level import PositionSettings, integrate_positions
from impactfem.vibro.velocity_level import VelocitySettings, integrate_velocities

METHODS = {
    "event driven": (integrate_events, EventSettings(rows=10)),
    "position level": (integrate_positions, PositionSettings(dt=0.01)),
    "Moreau-Jean": (integrate_velocities, VelocitySettings(dt=0.01)),
    "penalty": (integrate_penalty, PenaltySettings(1e6, 0.1)),
}


def normals(theta):
    return np.array([[-1.0, 0.0], [math.cos(theta), -math.sin(theta)]])


def corner(theta):
    return LinearSystem(
        mass=[1.0, 1.0], normals=normals(theta), offsets=[0.0, 0.0], restitution=1.0
    )


def axes(theta):
    """Outward normal of wall 2, and the direction along it out of the vertex."""
    return (
        np.array([-math.cos(theta), math.sin(theta)]),
        np.array([-math.sin(theta), -math.cos(theta)]),
    )


def unfolded(theta, v, first):
    """Specular reflections at one wall and the other in turn, until the point leaves."""
    walls, out = normals(theta), np.array(v)
    for hit in range(100):
        if (walls @ out).min() > -1e-13:
            return out
        n = walls[(first + hit) % 2]
        out = out - 2.0 * min(n @ out, 0.0) * n
    raise AssertionError


def throw(theta, share=0.12):
    """Direction of a ray into the vertex, and its normal."""
    heading = -math.pi / 2 - theta / 2 + share * theta
    v = -np.array([math.cos(heading), math.sin(heading)])
    return v, np.array([-v[1], v[0]])


def first_wall(theta, start, v):
    walls = normals(theta)
    times = [-(n @ start) / (n @ v) if n @ v < 0 else math.inf for n in walls]
    return int(np.argmin(times))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("theta", [math.pi / 2, math.pi / 3, 2 * math.pi / 5])
@pytest.mark.parametrize("offset", [-0.2, -0.1, 0.1, 0.2])
def test_off_the_vertex_all_methods_reflect_as_light(method, theta, offset):
    v, n = throw(theta)
    start = -v + offset * n
    integrate, chosen = METHODS[method]
    found = integrate(corner(theta), start, v, 4.0, chosen).velocity[-2]
    exact = unfolded(theta, v, first_wall(theta, start, v))
    assert found == pytest.approx(exact, abs=1e-7 if method == "penalty" else 1e-11)


@settings(max_examples=50, deadline=None)
@given(st.integers(2, 9), st.floats(-0.45, 0.45))
def test_the_motion_is_continuous_at_angles_that_divide_pi(n, share):
    theta = math.pi / n
    v, _ = throw(theta, share)
    assert unfolded(theta, v, 0) == pytest.approx(unfolded(theta, v, 1), abs=1e-12)


def test_at_two_fifths_of_pi_the_outgoing_direction_jumps_for_event_detection_too():
    theta = 2 * math.pi / 5
    v, n = throw(theta)
    sides = [
        integrate_events(corner(theta), -v + s * n, v, 2.5, EventSettings(rows=10)).velocity[-1]
        for s in (-1e-9, 1e-9)
    ]
    jump = math.degrees(math.acos(sides[0] @ sides[1]))
    exact = math.degrees(math.acos(unfolded(theta, v, 0) @ unfolded(theta, v, 1)))
    assert exact > 50.0
    assert jump == pytest.approx(exact, abs=1e-6)


@pytest.mark.parametrize("method", ["event driven", "position level", "Moreau-Jean"])
def test_the_vertex_itself_follows_the_law_of_simultaneous_impacts(method):
    # An acute corner sends the point back, v+ = -v + 2 P_T v with P_T v = 0; at pi/3 the rays
    # beside it leave in another direction, so that this law is not the limit of its neighbours.
    theta = math.pi / 3
    v, _ = throw(theta)
    integrate, chosen = METHODS[method]
    found = integrate(corner(theta), -v, v, 2.5, chosen).velocity[-2]
    assert found == pytest.approx(-v, abs=1e-9)
    assert np.linalg.norm(unfolded(theta, v, 0) + v) > 0.2


def limit_of_arc(theta, v, beta):
    """Closed form of the undamped penalty from (0, -beta v2) / sqrt(k), theta >= pi/2.

    A half swing cut off at beta against wall 1, an isotropic oscillator in the normal cone of the
    vertex until its direction is the normal i of wall 2, then a swing against wall 2.
    """
    i, j = axes(theta)
    place, rate = np.array([v[0] * math.sin(beta), 0.0]), np.array([v[0] * math.cos(beta), v[1]])
    turn = math.atan2(-(place @ j), rate @ j)
    end = place * math.cos(turn) + rate * math.sin(turn)
    speed = rate * math.cos(turn) - place * math.sin(turn)
    return -math.hypot(end @ i, speed @ i) * i + (speed @ j) * j


def limit_by_polar_coordinates(theta, v, beta):
    """The same by the paper's equations (14) to (17)."""
    i, j = axes(theta)
    gamma = v[0] * v[1] * math.sin(beta)

    def leaves(_, y):
        return y[2] - (math.pi - theta)

    leaves.terminal = True
    found = solve_ivp(
        lambda _, y: [y[1], gamma**2 / y[0] ** 3 - y[0], gamma / y[0] ** 2], (0.0, 10.0),
        [v[0] * math.sin(beta), v[0] * math.cos(beta), 0.0],
        events=leaves, rtol=1e-11, atol=1e-13,
    )  # fmt: skip
    r, speed, angle = found.y[:, -1]
    radial, across = (
        np.array([math.cos(angle), math.sin(angle)]),
        np.array([-math.sin(angle), math.cos(angle)]),
    )
    place, rate = r * radial, speed * radial + gamma / r * across
    return -math.hypot(place @ i, rate @ i) * i + (rate @ j) * j


@settings(max_examples=8, deadline=None)
@given(st.floats(math.pi / 2, 2.6), st.floats(0.1, 3.0), st.sampled_from([1e4, 1e10]))
def test_the_undamped_penalty_has_an_arc_of_limits(theta, beta, k):
    v = np.array([0.6, 0.8])
    exact = limit_of_arc(theta, v, beta)
    assert limit_by_polar_coordinates(theta, v, beta) == pytest.approx(exact, abs=1e-7)
    root = math.sqrt(k)
    found = integrate_penalty(
        corner(theta), [0.0, -beta * v[1] / root], v, 40.0 / root,
        PenaltySettings(k, 10.0 / root, rtol=1e-10),
    )  # fmt: skip
    assert found.velocity[-1] == pytest.approx(exact, abs=1e-7)  # at every k: there is no limit


def test_the_arc_joins_two_motions_that_the_rigid_corner_allows():
    theta, v = 2 * math.pi / 3, np.array([0.6, 0.8])
    assert limit_of_arc(theta, v, math.pi - 1e-9) == pytest.approx(unfolded(theta, v, 0), abs=1e-7)
    assert limit_of_arc(theta, v, 1e-9) == pytest.approx(-v, abs=1e-7)
    assert np.linalg.norm(unfolded(theta, v, 0) + v) > 0.5


@pytest.mark.parametrize("theta", [math.pi / 3, math.pi / 2, 2 * math.pi / 3])
def test_the_over_damped_penalty_tends_to_projection_on_the_tangent_cone(theta):
    # Beside wall 1 first: P1 v, and at the vertex its projection on the corner: P2 P1 v in an
    # obtuse corner, rest in an acute one.
    v = np.array([0.6, 0.8])
    _, j = axes(theta)
    exact = max(v[1] * j[1], 0.0) * j
    errors = []
    for k in (1e2, 1e4, 1e6):
        settings = PenaltySettings(k, 0.05, damping=1.5)
        found = integrate_penalty(corner(theta), [0.0, -0.2], v, 2.0, settings)
        errors.append(np.linalg.norm(found.velocity[-1] - exact))
        early = found.velocity[found.times < 0.19]
        assert early[-1] == pytest.approx([0.0, 0.8], abs=3.0 / math.sqrt(k))
    assert errors[0] > 10.0 * errors[1] > 100.0 * errors[2]
    assert errors[2] < 1e-6
