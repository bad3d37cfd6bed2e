"""Impacts and friction of systems with bilateral rows and quaternions, by all methods with laws."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from test_joined import BARS, COUPLER, CRANK, GROUND, ROCKER, four_bar, loop

import impactfem

G = 9.81


def bob(size=1.0, mass=1.0, restitution=0.8, wall=-0.2):
    """A pendulum before a wall, as a point on a rod that is said twice."""
    return impactfem.systems.GeneralizedSystem(
        mass=[mass, mass], force=lambda *_: [0.0, -mass * G],
        bilateral=lambda u: np.array([1.0, 2.0]) * (np.sqrt(u[0] ** 2 + u[1] ** 2) - size),
        constraints=lambda u: u[:1] - wall * size, restitution=restitution,
    )  # fmt: skip


def swing(size=1.0, mass=1.0, restitution=0.8, wall=-0.2):
    """The same in its angle."""
    return impactfem.systems.GeneralizedSystem(
        mass=mass * size**2, force=lambda _t, u, _v: -mass * G * size * np.sin(u),
        constraints=lambda u: size * (np.sin(u) - wall), restitution=restitution,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("size", "mass", "restitution", "wall"),
    [(1.0, 1.0, 0.8, -0.2), (1e-3, 1e-6, 1.0, -0.2), (1.0, 1.0, 0.3, 0.2)],
)
def test_point_on_a_rod_strikes_a_wall_when_the_angle_does(size, mass, restitution, wall):
    """The last one comes to rest against the wall."""
    start = size * np.array([np.sin(1.0), -np.cos(1.0)])
    duration, case = 5.0 * np.sqrt(size), (size, mass, restitution, wall)
    rod = impactfem.integrate(bob(*case), start, [0.0, 0.0], duration, rows=40)
    angle = impactfem.integrate(swing(*case), [1.0], [0.0], duration, rows=40)
    assert len(rod.impacts) == len(angle.impacts) >= 3
    assert rod.impacts.time == pytest.approx(angle.impacts.time, abs=1e-9 * np.sqrt(size))
    pushed = angle.impacts.impulse  # along the wall, as the gap is measured in both
    assert rod.impacts.impulse == pytest.approx(pushed, abs=1e-8 * pushed.max())
    ends = size * np.array([np.sin(angle.position[-1, 0]), -np.cos(angle.position[-1, 0])])
    assert rod.position[-1] == pytest.approx(ends, abs=2e-9 * size)
    assert rod.contact_force[-1] == pytest.approx(angle.contact_force[-1], abs=1e-8 * mass * G)
    assert np.linalg.norm(rod.position, axis=1) == pytest.approx(size, abs=1e-15 * size)
    along = np.abs(np.einsum("ij,ij->i", rod.position, rod.velocity)).max()
    assert along < 1e-14 * size * np.abs(rod.velocity).max()


@pytest.mark.slow
@pytest.mark.parametrize("method", ["moreau_jean", "paoli_schatzman"])
def test_steps_of_a_point_on_a_rod(method):
    """Order 2 without impacts, 1 with them; the rod to rounding."""
    start, missed = [np.sin(1.0), -np.cos(1.0)], []
    for wall, duration, steps in ((-3.0, 1.5, (8e-3, 4e-3)), (-0.2, 1.2, (4e-3, 2e-3))):
        exact = impactfem.integrate(swing(wall=wall), [1.0], [0.0], duration, rows=2)
        angle = exact.position[-1, 0]
        end = np.array([np.sin(angle), -np.cos(angle)])
        for dt in steps:
            motion = impactfem.integrate(
                bob(wall=wall), start, [0.0, 0.0], duration, method=method, dt=dt
            )
            missed.append(float(np.abs(motion.position[-1] - end).max()))
            assert np.linalg.norm(motion.position, axis=1) == pytest.approx(1.0, abs=1e-15)
    assert missed[0] / missed[1] == pytest.approx(4.0, rel=0.05)
    assert missed[1] < 1e-4
    assert missed[2] < 10.0 * 4e-3
    assert missed[3] < 10.0 * 2e-3


def crank_mass(angle):
    """Twice the kinetic energy of the linkage by the spin of its crank, by angular rates."""
    first, place = angle, four_bar(angle)
    second, joint = place[5], 2.0 * place[3:5] - CRANK * np.array([np.cos(angle), np.sin(angle)])
    third = np.arctan2(joint[1], joint[0] - GROUND)
    coupler = CRANK * np.sin(third - first) / (COUPLER * np.sin(second - third))
    rocker = CRANK * np.sin(first - second) / (ROCKER * np.sin(third - second))
    speed = CRANK * np.exp(1j * first) + 0.5 * COUPLER * coupler * np.exp(1j * second)
    turning = CRANK**2 / 3.0 + COUPLER**2 / 12.0 * coupler**2 + ROCKER**2 / 3.0 * rocker**2
    return turning + abs(speed) ** 2


@pytest.mark.slow
def test_four_bar_linkage_between_stops_of_its_rocker():
    """Nine coordinates and ten rows, two of them redundant, against the time of one coordinate."""
    low, high, e = 0.9, 2.3, 0.8
    stops = four_bar(low)[8], four_bar(high)[8]
    linkage = impactfem.systems.GeneralizedSystem(
        mass=np.concatenate([[1.0, 1.0, length**2 / 12.0] for length in BARS]),
        force=lambda *_: np.zeros(9), bilateral=loop, restitution=e,
        constraints=lambda u: np.stack([u[8] - stops[0], stops[1] - u[8]]),
    )  # fmt: skip
    place = four_bar(1.5)
    way = np.linalg.svd(linkage.joined(place))[2][-1]
    way = way / way[2]
    energy = 0.5 * crank_mass(1.5)
    assert linkage.kinetic_energy(place, way) == pytest.approx(energy, rel=1e-13)

    def time(begin, end):
        slow = quad(lambda x: np.sqrt(crank_mass(x)), begin, end, epsabs=1e-13, epsrel=1e-13)
        return slow[0] / np.sqrt(2.0 * energy)

    spans = [time(1.5, high), *(time(low, high) / e**k for k in (1, 2, 3))]
    motion = impactfem.integrate(linkage, place, way, sum(spans) + 0.1, rows=20)
    assert motion.impacts.constraint.tolist() == [1, 0, 1, 0]
    assert motion.impacts.time == pytest.approx(np.cumsum(spans), abs=1e-9)
    assert motion.kinetic[-1] == pytest.approx(energy * e**8, rel=1e-9)
    assert max(np.abs(loop(u)).max() for u in motion.position) < 1e-13
    for method in ("moreau_jean", "paoli_schatzman"):
        steps = impactfem.integrate(linkage, place, way, spans[0] + 0.1, method=method, dt=4e-3)
        assert steps.impacts.time[0] == pytest.approx(spans[0], abs=8e-3)
        assert max(np.abs(loop(u)).max() for u in steps.position) < 1e-13


def turned(q):
    """Rotation matrix of a quaternion."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rates(u, v):
    """Of centre and quaternion, by the velocity of the centre and the spin along own axes."""
    q, v = u[3:], np.asarray(v)
    spin = [[-q[1:] @ v[3:]], q[0] * v[3:] + np.cross(q[1:], v[3:])]
    return np.concatenate([v[:3], 0.5 * np.concatenate(spin)])


HALF, MASS = np.array([0.1, 0.2, 0.3]), 2.0
INERTIA = MASS / 3.0 * (HALF @ HALF - HALF**2)
CORNERS = HALF * [[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]


def block(**more):
    """A block above a floor, with its eight corners."""
    return impactfem.systems.GeneralizedSystem(
        mass=np.concatenate([[MASS] * 3, INERTIA]), rates=rates, coordinates=7,
        force=lambda _t, _u, v: np.concatenate(
            [[0.0, 0.0, -MASS * G], np.cross(INERTIA * v[3:], v[3:])]
        ),
        constraints=lambda u: u[2] + CORNERS @ turned(u[3:])[2], unit_vectors=[range(3, 7)],
        potential=lambda _, u: MASS * G * float(u[2]), **more,
    )  # fmt: skip


def spun(t, rate=4.0):
    """Quaternion of a tilted block that spins about its third axis."""
    tilt = np.array([np.cos(0.25), 0.8 * np.sin(0.25), 0.6 * np.sin(0.25), 0.0])
    way = np.array([np.cos(0.5 * rate * t), 0.0, 0.0, np.sin(0.5 * rate * t)])
    vector = tilt[0] * way[1:] + way[0] * tilt[1:] + np.cross(tilt[1:], way[1:])
    return np.concatenate([[tilt[0] * way[0] - tilt[1:] @ way[1:]], vector])


def test_block_in_quaternions_lands_on_a_corner():
    """The flight, the impulse and the spin after it in closed form."""
    low = brentq(lambda t: 1.0 - 0.5 * G * t * t + (CORNERS @ turned(spun(t))[2]).min(), 0, 1)
    heights = CORNERS @ turned(spun(low))[2]
    corner = int(np.argmin(heights))
    time = brentq(
        lambda t: 1.0 - 0.5 * G * t * t + CORNERS[corner] @ turned(spun(t))[2], 0, 1, xtol=1e-15
    )
    arm = np.cross(CORNERS[corner], turned(spun(time))[2])
    approach = -G * time + 4.0 * arm[2]
    push = -1.5 * approach / (1.0 / MASS + arm @ (arm / INERTIA))
    start = np.concatenate([[0.0, 0.0, 1.0], spun(0.0)]), [0.0, 0.0, 0.0, 0.0, 0.0, 4.0]
    motion = impactfem.integrate(block(restitution=0.5), *start, time + 0.05, rows=200)
    first = motion.impacts
    assert first.constraint.tolist() == [corner]
    assert first.time == pytest.approx([time], abs=1e-11)
    assert first.impulse == pytest.approx([push], rel=1e-9)
    after = np.flatnonzero(motion.times > time)
    lost = 0.5 * push * -approach * 0.5
    assert motion.total[after] == pytest.approx(motion.total[0] - lost, rel=1e-9)
    u, v = motion.position[-1], motion.velocity[-1]
    assert v[2] == pytest.approx(push / MASS - G * motion.times[-1], abs=1e-9)
    turning = turned(spun(time)) @ (INERTIA * [0.0, 0.0, 4.0] + push * arm)
    assert turned(u[3:]) @ (INERTIA * v[3:]) == pytest.approx(turning, abs=1e-8)
    assert np.linalg.norm(motion.position[:, 3:], axis=1) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    ("method", "more"),
    [("event_driven", {}), ("moreau_jean", {"dt": 1e-3}), ("paoli_schatzman", {"dt": 1e-3})],
)
def test_block_in_quaternions_lands_flat(method, more):
    """Four corners at once, one of which the others imply."""
    start = [0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0], [0.0] * 6
    with pytest.warns(impactfem.ImpactWarning, match="two constraints meet"):
        motion = impactfem.integrate(block(), *start, 0.4, method=method, **more)
    assert motion.position[-1, :3] == pytest.approx([0.0, 0.0, 0.3], abs=3e-3)
    assert np.abs(motion.velocity[-1]).max() < 1e-9
    struck = MASS * np.sqrt(2.0 * G * 0.2)
    rested = MASS * G * (0.4 - np.sqrt(0.4 / G))
    assert motion.impulse.sum() == pytest.approx(struck + rested, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["event_driven", "moreau_jean"])
def test_ball_in_quaternions_slides_then_rolls(method):
    """From 2 v / (7 mu g) on, with 5/7 of the speed; its contact sees the turned axes."""
    radius, mu, speed = 0.1, 0.2, 3.0
    inertia = np.full(3, 0.4 * radius**2)

    def slip(u):
        return [[[1.0, 0.0, 0.0, *-radius * turned(u[3:])[1]]]]

    ball = impactfem.systems.GeneralizedSystem(
        mass=np.concatenate([[1.0] * 3, inertia]), rates=rates, coordinates=7,
        force=lambda *_: [0.0, 0.0, -G, 0.0, 0.0, 0.0], constraints=lambda u: u[2:3] - radius,
        jacobian=lambda _: np.eye(7)[2:3], friction=mu, slip=slip, unit_vectors=[range(3, 7)],
    )  # fmt: skip
    steps = {} if method == "event_driven" else {"dt": 2e-3}
    start = [0.0, 0.0, radius, *spun(0.0)], [speed, *np.zeros(5)]
    motion = impactfem.integrate(ball, *start, 1.0, method=method, **steps)
    error = 1e-9 if method == "event_driven" else 1e-5
    assert motion.velocity[-1, 0] == pytest.approx(5.0 / 7.0 * speed, abs=error)
    if method == "event_driven":
        (_, _, first), (time, _, then) = motion.effort.details["friction_changes"]
        assert (first, then) == ("slides", "sticks")
        assert time == pytest.approx(2.0 * speed / (7.0 * mu * G), abs=1e-10)


def test_two_sledges_on_a_bar_stop_as_one():
    """Thrown up a slope; once they stick, bar and floor hold them twice."""
    slope, mu = 0.3, 0.5
    down = np.array([np.sin(slope), np.cos(slope)])
    masses = np.array([1.0, 3.0])
    pair = impactfem.systems.GeneralizedSystem(
        mass=np.repeat(masses, 2), force=lambda *_: -G * np.outer(masses, down).ravel(),
        constraints=lambda u: u[1::2], friction=mu,
        slip=lambda _: [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        bilateral=lambda u: [np.sqrt((u[2] - u[0]) ** 2 + (u[3] - u[1]) ** 2) - 2.0],
    )  # fmt: skip
    motion = impactfem.integrate(pair, [0.0, 0.0, 2.0, 0.0], [3.0, 0.0, 3.0, 0.0], 1.0, rows=20)
    stop = 3.0 / (G * (np.sin(slope) + mu * np.cos(slope)))
    assert motion.position[-1] == pytest.approx([1.5 * stop, 0, 2 + 1.5 * stop, 0], abs=1e-9)
    assert motion.contact_force[-1] == pytest.approx(masses * G * np.cos(slope), rel=1e-9)
    sticks = [t for t, _, what in motion.effort.details["friction_changes"] if what == "sticks"]
    assert sticks == pytest.approx([stop, stop], abs=1e-9)
