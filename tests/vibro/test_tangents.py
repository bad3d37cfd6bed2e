"""Derivatives of motions from event to event against closed forms."""

import numpy as np
import pytest

import impactfem
from impactfem.errors import ConvergenceError
from impactfem.vibro import tangents as module
from impactfem.vibro.bundles import Neighbours
from impactfem.vibro.event_driven import EventSettings, follow
from impactfem.vibro.tangents import tangents

G = 9.81


def slopes(make, values, duration, rows=4, **settings):
    """Position, velocity at the end (d,), and their derivatives (d, P), and all tangents.

    ``make`` gives a system, u and v of keyword parameters.
    """
    given = EventSettings(rows=rows, rtol=1e-12, atol=1e-14, **settings)
    system, u, v = make(**values)
    record, _ = follow(system, u, v, duration, given, [])
    beside = []
    for name, value in values.items():
        h = 1e-5 * (abs(value) or 1.0)
        each = [make(**values | {name: value + side * h}) for side in (1.0, -1.0)]
        starts = tuple((np.array(u), np.array(v)) for _, u, v in each)
        offsets, weights = np.array([h, -h]), np.array([0.5 / h, -0.5 / h])
        beside.append(Neighbours(tuple(s for s, _, _ in each), starts, offsets, weights))
    found = tangents(system, record, beside, duration)
    end = record.position[-1], record.velocity[-1]
    return *end, found.position[-1], found.velocity[-1], found


def ball(h0=1.0, e=0.8, g=G, m=2.0):
    """A ball that falls; flown exactly."""
    system = impactfem.systems.LinearSystem(
        mass=m, normals=[[1.0]], offsets=[0.0], load=[-m * g], restitution=e
    )
    return system, [h0], [0.0]


def ball_in_general(h0=1.0, e=0.8, g=G, m=2.0):
    """The same by the integrator."""
    system = impactfem.systems.GeneralizedSystem(
        mass=m, force=lambda *_: [-m * g], constraints=lambda u: u, restitution=e
    )
    return system, [h0], [0.0]


def bounced(h0, e, g, count, t):
    """Height of the ball after some impacts, also of complex numbers."""
    speed = np.sqrt(2.0 * g * h0)
    at = speed / g + sum(2.0 * e**k * speed / g for k in range(1, count))
    up = e**count * speed
    return up * (t - at) - 0.5 * g * (t - at) ** 2


@pytest.mark.parametrize("make", [ball, ball_in_general])
@pytest.mark.parametrize(("count", "t"), [(1, 0.9), (5, 2.6), (14, 3.9)])
def test_a_bouncing_ball(make, count, t):
    values = {"h0": 1.0, "e": 0.8, "g": G, "m": 2.0}
    x, _, slope, _, found = slopes(make, values, t)
    assert x[0] == pytest.approx(bounced(1.0, 0.8, G, count, t), abs=1e-11)
    h = 1e-30j
    right = [
        bounced(1.0 + h, 0.8, G, count, t), bounced(1.0, 0.8 + h, G, count, t),
        bounced(1.0, 0.8, G + h, count, t), 0.0,
    ]  # fmt: skip
    np.testing.assert_allclose(slope[0], np.imag(right) / 1e-30, rtol=1e-8, atol=1e-9)
    assert not found.doubts
    if count == 1:
        assert slope[0, 0] == pytest.approx(0.98785, abs=5e-6)


def test_without_gravity_a_wall_turns_the_derivative():
    def make(x0=1.0):
        return (
            impactfem.systems.LinearSystem(
                mass=1.0, normals=[[1.0]], offsets=[0.0], restitution=1.0
            ),
            [x0],
            [-1.0],
        )

    assert slopes(make, {"x0": 1.0}, 2.0)[2][0, 0] == pytest.approx(-1.0, abs=1e-9)


def test_two_equal_balls_swap_their_motions():
    def make(a=0.0, b=1.0, va=1.5, vb=0.25):
        system = impactfem.systems.LinearSystem(
            mass=[1.0, 1.0], normals=[[-1.0, 1.0]], offsets=[-0.1], restitution=1.0
        )
        return system, [a, b], [va, vb]

    found = slopes(make, {"a": 0.0, "b": 1.0, "va": 1.5, "vb": 0.25}, 1.0)[2]
    np.testing.assert_allclose(found[1], [1.0, 0.0, 1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(found[0], [0.0, 1.0, 0.0, 1.0], atol=1e-9)


def block(v0=2.0, mu=0.3, g=G):
    """A block that slides on a floor."""
    system = impactfem.systems.GeneralizedSystem(
        mass=[1.5, 1.5], force=lambda *_: [0.0, -1.5 * g], constraints=lambda u: u[1:2],
        friction=mu, slip=lambda _: [[1.0, 0.0]],
    )  # fmt: skip
    return system, [0.0, 0.0], [v0, 0.0]


def test_a_block_that_stops():
    values = {"v0": 2.0, "mu": 0.3, "g": G}
    x, v, slope, _, found = slopes(block, values, 1.0)
    assert x[0] == pytest.approx(4.0 / (0.6 * G), rel=1e-10)
    assert v[0] == 0.0
    right = [2.0 / (0.3 * G), -4.0 / (2.0 * 0.09 * G), -4.0 / (0.6 * G**2)]
    np.testing.assert_allclose(slope[0], right, rtol=1e-9)
    assert found.velocity[-1, 0] == pytest.approx(0.0, abs=1e-12)


def test_a_disc_that_slides_and_then_rolls():
    def make(v0=3.0, mu=0.2, radius=0.1):
        system = impactfem.systems.GeneralizedSystem(
            mass=[1.0, 1.0, 0.5 * radius**2], force=lambda *_: [0.0, -G, 0.0],
            constraints=lambda u: u[1:2] - radius, friction=mu,
            slip=lambda _: [[1.0, 0.0, radius]],
        )  # fmt: skip
        return system, [0.0, radius, 0.0], [v0, 0.0, 0.0]

    x, _, slope, speed, _ = slopes(make, {"v0": 3.0, "mu": 0.2, "radius": 0.1}, 2.0)
    assert x[0] == pytest.approx(4.0 + 9.0 / (18.0 * 0.2 * G), rel=1e-10)
    right = np.array([4.0 / 3.0 + 3.0 / (9.0 * 0.2 * G), -9.0 / (18.0 * 0.04 * G), 0.0])
    # By shares of each parameter: neighbours are 1e-5 of it away, and so their rounding counts.
    shares = np.array([3.0, 0.2, 0.1])
    np.testing.assert_allclose(shares * slope[0], shares * right, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(shares * speed[0], shares * [2.0 / 3.0, 0.0, 0.0], atol=1e-9)


def test_an_impact_with_friction():
    """A disc thrown at a floor leaves it sliding, or as it rolls."""

    def make(u=1.0, w=-2.0, mu=0.1):
        system = impactfem.systems.GeneralizedSystem(
            mass=[1.0, 1.0, 0.005], force=lambda *_: np.zeros(3), restitution=0.5,
            constraints=lambda u: u[1:2] - 0.1, friction=mu, slip=lambda _: [[1.0, 0.0, 0.1]],
        )  # fmt: skip
        return system, [0.0, 0.3, 0.0], [u, w, 0.0]

    # It slides: the impulse along it is mu (1 + e) |w|.
    _, v, _, speed, _ = slopes(make, {"u": 1.0, "w": -2.0, "mu": 0.1}, 0.2)
    assert v[0] == pytest.approx(1.0 - 0.1 * 3.0)
    np.testing.assert_allclose(speed[0], [1.0, 0.15, -3.0], atol=1e-9)
    np.testing.assert_allclose(speed[1], [0.0, -0.5, 0.0], atol=1e-9)
    # It rolls at once, with two thirds of its speed.
    _, v, _, speed, _ = slopes(make, {"u": 1.0, "w": -2.0, "mu": 0.5}, 0.2)
    assert v[0] == pytest.approx(2.0 / 3.0)
    np.testing.assert_allclose(speed[0], [2.0 / 3.0, 0.0, 0.0], atol=1e-9)


def test_a_moving_wall():
    """A ball that a wall b(t) = A sin(w t) strikes: derivatives by the wall's motion too."""

    def make(size=0.1, x0=0.5, v0=-1.0):
        wall = impactfem.bodies.Signal(harmonics=((3.0, 0.0, size),))
        system = impactfem.systems.LinearSystem(
            mass=1.0, normals=[[1.0]], offsets=[0.0], restitution=0.7, motion=[wall]
        )
        return system, [x0], [v0]

    values = {"size": 0.1, "x0": 0.5, "v0": -1.0}
    x, _, slope, _, _ = slopes(make, values, 1.0)

    def struck(size, x0, v0):
        t = 0.4
        for _ in range(60):
            t = t - (x0 + v0 * t - size * np.sin(3.0 * t)) / (v0 - 3.0 * size * np.cos(3.0 * t))
        wall = 3.0 * size * np.cos(3.0 * t)
        return x0 + v0 * t + (wall - 0.7 * (v0 - wall)) * (1.0 - t)

    assert x[0] == pytest.approx(struck(**values), abs=1e-12)
    right = [np.imag(struck(**values | {n: values[n] + 1e-30j})) / 1e-30 for n in values]
    np.testing.assert_allclose(slope[0], right, rtol=1e-9)


def test_a_ball_that_comes_to_rest():
    """It is at rest from t = sqrt(2 h / g) (1 + e) / (1 - e) on, and stays where it is."""

    def make(h0=1.0, e=0.5):
        return ball(h0=h0, e=e)

    x, _, slope, _, found = slopes(make, {"h0": 1.0, "e": 0.5}, 3.0)
    assert x[0] == 0.0
    np.testing.assert_allclose(slope[0], 0.0, atol=1e-12)
    fall = np.sqrt(2.0 / G)
    rest = found.events[-2][0]  # the last event before the end: it lies
    np.testing.assert_allclose(rest, [0.5 * fall * 3.0, fall * 2.0 / 0.25], rtol=1e-5)


def test_contacts_that_close_together_are_told():
    """A body that two walls stop at once parts them when it is changed: no derivative is sure."""

    def make(x=0.5):
        system = impactfem.systems.LinearSystem(
            mass=[1.0, 1.0], normals=[[1.0, 0.0], [0.0, 1.0]], offsets=[0.0, 0.0], restitution=1.0
        )
        return system, [x, 0.5], [-1.0, -1.0]

    assert slopes(make, {"x": 0.5}, 1.0)[4].doubts


def test_impacts_by_turns_are_refused():
    def make(x=0.0):
        system = impactfem.systems.LinearSystem(
            mass=[1.0, 1.0, 1.0], normals=[[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]],
            offsets=[-0.1, -0.1], restitution=1.0,
        )  # fmt: skip
        return system, [x, 0.5, 0.6], [1.0, 0.0, 0.0]

    with pytest.raises(ConvergenceError, match="simultaneous"):
        slopes(make, {"x": 0.0}, 1.0, impact_law="sequential")


def test_a_wrong_saltation_is_wrong(monkeypatch):
    """Without the change of the time of the event the derivative of x is -e, as steps have it."""
    monkeypatch.setattr(module._Run, "_late", lambda self, *_: np.zeros(len(self.bundle.of) // 2))
    found = slopes(ball, {"h0": 1.0, "e": 0.8, "g": G, "m": 2.0}, 0.9)[2]
    assert found[0, 0] == pytest.approx(1.0)


def arm(first=1.2, second=0.4, length=1.0, e=0.6):
    """Two rods without mass, a mass 1 at the end of each, that swing against a wall."""
    turn = length * length

    def mass(u):
        c = np.cos(u[0] - u[1])
        return turn * np.array([[2.0, c], [c, 1.0]])

    def force(_, u, v):
        s = np.sin(u[0] - u[1])
        weight = G * length * np.array([2.0 * np.sin(u[0]), np.sin(u[1])])
        return turn * s * np.array([-(v[1] ** 2), v[0] ** 2]) - weight

    system = impactfem.systems.GeneralizedSystem(
        mass=mass, force=force, dofs=2, restitution=e,
        constraints=lambda u: [length * (np.sin(u[0]) + np.sin(u[1])) + 0.1],
    )  # fmt: skip
    return system, [first, second], [0.0, 0.0]


def by_differences(make, values, duration, step):
    """The same derivatives by runs of their own: central differences, extrapolated."""
    given = EventSettings(rows=4, rtol=1e-12, atol=1e-14)

    def end(**changed):
        system, u, v = make(**values | changed)
        record, _ = follow(system, u, v, duration, given, [])
        return np.concatenate([record.position[-1], record.velocity[-1]])

    found = []
    for name, value in values.items():
        near, far = (
            (end(**{name: value + h}) - end(**{name: value - h})) / (2.0 * h)
            for h in (0.5 * step, step)
        )
        found.append((4.0 * near - far) / 3.0)
    return np.transpose(found)


def test_a_double_pendulum_that_strikes_a_wall():
    values = {"first": 1.2, "second": 0.4, "length": 1.0, "e": 0.6}
    record, _ = follow(*arm(**values), 4.0, EventSettings(rows=4, rtol=1e-12, atol=1e-14), [])
    assert sum(bool(leg.event.strikes) for leg in record.legs) == 3
    *_, dq, dv, _ = slopes(arm, values, 4.0)
    wanted = by_differences(arm, values, 4.0, 2e-4)
    largest = np.abs(wanted).max()
    np.testing.assert_allclose(np.vstack([dq, dv]), wanted, rtol=0.0, atol=1e-8 * largest)
