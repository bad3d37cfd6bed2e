"""Bilateral rows and coordinates that are no velocities, in schemes of the textbooks."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import impactfem
from impactfem import SceneError
from impactfem.studies.schemes import period

CRANK, COUPLER, ROCKER, GROUND = 1.0, 2.5, 2.0, 2.2
BARS = (CRANK, COUPLER, ROCKER)


def loop(u):
    """Three rods as x, y, angle each: their joints, one of them twice."""
    ends = []
    for k, length in enumerate(BARS):
        half = 0.5 * length * np.array([np.cos(u[3 * k + 2]), np.sin(u[3 * k + 2])])
        ends.append((u[3 * k : 3 * k + 2] - half, u[3 * k : 3 * k + 2] + half))
    (foot, crank), (one, two), (rocker, top) = ends[0], ends[1], ends[2][::-1]
    joints = [foot, one - crank, two - rocker, top - np.array([GROUND, 0.0])]
    return np.concatenate([*joints, joints[1] + joints[2]])


def four_bar(angle):
    """Places of the rods with the crank at an angle."""
    crank = CRANK * np.array([np.cos(angle), np.sin(angle)])
    way = np.array([GROUND, 0.0]) - crank
    far = np.linalg.norm(way)
    lean = np.arccos((COUPLER**2 + far**2 - ROCKER**2) / (2.0 * COUPLER * far))
    second = np.arctan2(way[1], way[0]) + lean
    joint = crank + COUPLER * np.array([np.cos(second), np.sin(second)])
    third = np.arctan2(*(joint - [GROUND, 0.0])[::-1])
    middle = 0.5 * (joint + np.array([GROUND, 0.0]))
    return np.array([*0.5 * crank, angle, *0.5 * (crank + joint), second, *middle, third])


LINKAGE = impactfem.systems.GeneralizedSystem(
    mass=np.concatenate([[1.0, 1.0, length**2 / 12.0] for length in BARS]),
    force=lambda *_: np.zeros(9), bilateral=loop,
)  # fmt: skip


@pytest.mark.parametrize(("start", "reach"), [(3.2, COUPLER - CRANK), (0.55, COUPLER + CRANK)])
def test_rocker_of_a_four_bar_linkage_turns_where_geometry_says(start, reach):
    """Where crank and coupler lie in line, by the law of cosines; rows depend on each other."""
    limit = np.pi - np.arccos((ROCKER**2 + GROUND**2 - reach**2) / (2.0 * ROCKER * GROUND))
    place = four_bar(start)
    way = np.linalg.svd(LINKAGE.joined(place))[2][-1]
    motion = impactfem.integrate(LINKAGE, place, 2.0 * way / way[2], 0.6, method="rk4", dt=4e-3)
    assert max(np.abs(loop(u)).max() for u in motion.position) < 1e-14
    curve = CubicHermiteSpline(motion.times, motion.position[:, 8], motion.velocity[:, 8])
    (turn,) = curve.derivative().roots(extrapolate=False)
    assert curve(turn) == pytest.approx(limit, abs=1e-9)
    assert np.ptp(motion.kinetic) < 1e-6 * motion.kinetic[0]


def bob(**more):
    """A pendulum of 1 m as a point on a rod."""
    return impactfem.systems.GeneralizedSystem(
        mass=[1.0, 1.0], force=lambda *_: [0.0, -9.81],
        bilateral=lambda u: [np.sqrt(u[0] ** 2 + u[1] ** 2) - 1.0],
        potential=lambda _, u: 9.81 * float(u[1]), **more,
    )  # fmt: skip


@pytest.mark.parametrize(("name", "error"), [("rk4", 1e-8), ("midpoint", 2e-4)])
def test_point_on_a_rod_is_a_pendulum(name, error):
    start, whole = [np.sin(1.0), -np.cos(1.0)], period(1.0)
    motion = impactfem.integrate(bob(), start, [0.0, 0.0], whole, method=name, dt=whole / 400)
    assert motion.position[-1] == pytest.approx(start, abs=error)
    assert motion.velocity[-1] == pytest.approx([0.0, 0.0], abs=4.0 * error)
    assert np.linalg.norm(motion.position, axis=1) == pytest.approx(1.0, abs=1e-15)


def test_pendulum_on_a_rod_rebounds_from_a_wall():
    wall = bob(constraints=lambda u: u[:1], restitution=1.0)
    start, half = [np.sin(1.0), -np.cos(1.0)], 0.5 * period(1.0)
    motion = impactfem.integrate(wall, start, [0.0, 0.0], half, method="rk4", dt=half / 400)
    assert motion.impacts.time == pytest.approx([0.5 * half], abs=half / 400)
    assert motion.position[-1] == pytest.approx(start, abs=1e-4)
    assert np.ptp(motion.total) < 1e-8


def top(**more):
    """A free body of inertia (1, 2, 3): quaternion, and spin along its axes."""
    inertia = np.array([1.0, 2.0, 3.0])

    def rates(q, w):
        return 0.5 * np.concatenate([[-q[1:] @ w], q[0] * np.asarray(w) + np.cross(q[1:], w)])

    return impactfem.systems.GeneralizedSystem(
        mass=inertia, force=lambda _t, _q, w: np.cross(inertia * w, w), rates=rates, coordinates=4,
        **more,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("given", "more", "lost"),
    [
        ({}, {"method": "rk4", "dt": 0.02}, 1e-8),
        ({"unit_vectors": [range(4)]}, {"method": "rk4", "dt": 0.02}, 1e-15),
        ({"unit_vectors": [range(4)]}, {"rows": 800}, 1e-15),
    ],
)
def test_free_top_with_quaternions(given, more, lost):
    """Half a turn of its middle axis later, w2 is zero: 14.90593888 s for I = (1, 2, 3)."""
    body = top(**given)
    motion = impactfem.integrate(body, [1.0, 0.0, 0.0, 0.0], [1e-3, 1.0, 1e-3], 16.0, **more)
    spin = motion.velocity[:, 1]
    k = int(np.flatnonzero((spin[:-1] > 0.0) & (spin[1:] <= 0.0))[0])
    rate = [body.force(0.0, motion.position[0], w)[1] / 2.0 for w in motion.velocity[k : k + 2]]
    curve = CubicHermiteSpline(motion.times[k : k + 2], spin[k : k + 2], rate)
    assert curve.roots(extrapolate=False)[0] == pytest.approx(14.90593888, abs=2e-6)
    assert np.linalg.norm(motion.position, axis=1) == pytest.approx(1.0, abs=lost)
    assert np.ptp(motion.kinetic) < 1e-8


def test_what_cannot_be_is_refused():
    with pytest.raises(SceneError, match='"energy_momentum" knows no bilateral: give method = "e'):
        impactfem.integrate(bob(), [0.0, -1.0], [0.0] * 2, 1.0, method="energy_momentum", dt=0.1)
    with pytest.raises(SceneError, match="bilateral row 0"):
        impactfem.integrate(bob(), [0.0, -1.1], [0.0, 0.0], 1.0, method="rk4", dt=0.1)
    with pytest.raises(SceneError, match="opens bilateral row 0"):
        impactfem.integrate(bob(), [0.0, -1.0], [0.0, 1.0], 1.0, method="rk4", dt=0.1)
    with pytest.raises(SceneError, match=r"unit_vectors = \[\[4\]\].*from 0 to 3"):
        top(unit_vectors=[[4]])
    with pytest.raises(SceneError, match=r"entries \[0, 1, 2, 3\] are a unit vector"):
        impactfem.integrate(top(unit_vectors=[range(4)]), [1.1, 0, 0, 0], [0.0] * 3, 1.0)
    with pytest.raises(SceneError, match="rates and coordinates"):
        impactfem.systems.GeneralizedSystem(mass=1.0, force=lambda *_: [0.0], coordinates=4)
