"""Hard cases of one point, each against a closed form."""

import math

import numpy as np

from impactfem.exact.vibro import ZenoBall, elastic_corner, grazing_impact
from impactfem.methods import METHODS
from impactfem.scene import Formula
from impactfem.scene.signal import Signal
from impactfem.studies.hard.board import Facts
from impactfem.studies.hard.point_facts import away_from_impacts, facts_of, run, solved, unwarned
from impactfem.studies.hard.rows import Row, Sizes
from impactfem.system.generalized import GeneralizedSystem, LinearSystem

G = 9.81
_FLIGHT = 2.0 * math.sqrt(2.0 * G) / G  # [s] of a ball that falls 1 m, from one bounce to the next


def _ball(restitution: float, table: Signal | None = None, load: float = -G) -> LinearSystem:
    return LinearSystem(
        mass=1.0, normals=[[1.0]], offsets=[0.0], load=[load], restitution=restitution,
        motion=None if table is None else [table],
    )  # fmt: skip


def zeno(method: str, row: Row) -> Facts:
    """Infinitely many bounces, then rest."""
    result = solved(method, "bouncing_ball", row.sizes)
    history = result.history
    times, force = history["time"].values, history["contact_force"].values
    if METHODS[method].locates:
        stop = result.summary["details"]["sticking"][0][0]
    else:
        pushed = force[1:] * np.diff(times) + history["contact_impulse"].values[1:]
        stop = times[1 + np.flatnonzero(np.abs(pushed / np.diff(times) / G - 1.0) > 1e-6)[-1]]
    total = history["total_energy"].values
    return {
        "stop": abs(stop - ZenoBall(1.0, 0.8, G).stopping_time),
        "weight": abs(force[-1] / G - 1.0),
        "penetration": max(0.0, -float(history["gap"].values.min())),
        "growth": max(0.0, float((total - total[0]).max())) / G,
    }


def bounces(method: str, row: Row) -> Facts:
    """Elastic bounces for a long time: 1e5 if they are located, else 1e4."""
    count = 100_000 if METHODS[method].locates else 10_000
    motion = run(method, _ball(1.0), [1.0], [0.0], (count + 0.25) * _FLIGHT, row.sizes)
    kept = slice(None) if METHODS[method].locates else away_from_impacts(motion)
    drift = motion.total[kept] / G - 1.0
    return facts_of(motion, G) | {
        "growth": max(0.0, float(drift.max())),
        "drift": float(np.abs(drift).max()),
        "lost": abs(len(motion.impacts or ()) / count - 1.0),
    }


def graze(method: str, row: Row) -> Facts:
    """Three impacts of x'' = -x, from x = 1, on a wall at -(1 - 1e-6)."""
    depth = 1e-6
    speed, period = grazing_impact(depth)
    wall = LinearSystem(
        mass=1.0, stiffness=1.0, normals=[[1.0]], offsets=[1.0 - depth], restitution=1.0
    )
    motion = run(method, wall, [1.0], [0.0], 2.75 * period, row.sizes)
    impacts = motion.impacts
    if impacts is None or len(impacts) != 3:
        return facts_of(motion, 0.5) | {"speed": math.inf, "period": math.inf}
    return facts_of(motion, 0.5) | {
        "speed": float(np.abs(-impacts.before / speed - 1.0).max()),
        "period": float(np.abs(np.diff(impacts.time) - period).max()),
    }


def corner(method: str, row: Row) -> Facts:
    """The worst of rays that pass the vertex at a distance (> 0 on the left of their way)."""
    angle = float(Formula(row.given["angle"], ())())
    psi = math.pi + 0.62 * angle
    v = np.array([math.cos(psi), math.sin(psi)])
    walls = np.array([[0.0, 1.0], [math.sin(angle), -math.cos(angle)]])
    system = LinearSystem(mass=[1.0, 1.0], normals=walls, offsets=[0.0, 0.0], restitution=1.0)
    worst: dict[str, float] = {}
    for offset in row.given["beside"]:
        start = -v + offset * np.array([-v[1], v[0]])
        motion = run(method, system, start, v, 2.5, row.sizes)
        exact = -v  # into the vertex: P_T v = 0 in corners up to pi/2
        if offset != 0.0:
            first = int(np.argmin((walls @ start) / -(walls @ v)))
            exact = elastic_corner(angle, v, first).velocity
        found = {"direction": float(np.abs(motion.velocity[-1] - exact).max())}
        found |= facts_of(motion, 0.5) | {"unwarned": unwarned(motion)}
        worst |= {name: max(value, worst.get(name, 0.0)) for name, value in found.items()}
    return {name: value for name, value in worst.items() if name not in row.without}


def table(method: str, row: Row) -> Facts:
    """A ball rests on a table that moves by A sin(w t), until it falls faster than the ball."""
    high, turn = 0.3, 2.0 * math.pi
    ball = _ball(0.5, Signal(harmonics=((turn, 0.0, high),)))
    motion = run(method, ball, [0.0], [high * turn], 0.5, row.sizes)
    leaving = math.asin(G / (high * turn**2)) / turn
    if METHODS[method].locates:
        found = motion.effort.details["sticking"][0][1]
    else:
        found = motion.times[np.flatnonzero(motion.impulse[:, 0] > 0.0)[-1]]
    rest = 0.5 - leaving
    speed = high * turn * math.cos(turn * leaving)
    place = high * math.sin(turn * leaving) + speed * rest - 0.5 * G * rest**2
    return {
        "penetration": facts_of(motion, 1.0)["penetration"],
        "release": abs(float(found) - leaving),
        "flight": abs(float(motion.position[-1, 0]) - place),
    }


def bowl(method: str, row: Row) -> Facts:
    """Four chords of a circle: curved and nonlinear, with equal times between impacts."""
    system = GeneralizedSystem(
        mass=[1.0, 1.0], force=lambda *_: np.zeros(2), restitution=1.0,
        constraints=lambda u: 1.0 - (u[0] * u[0] + u[1] * u[1]) ** 0.5,
    )  # fmt: skip
    motion = run(method, system, [0.5, 0.0], [0.3, 1.0], 6.0, row.sizes)
    u, v = motion.position, motion.velocity
    energy, turning = 0.545, 0.5
    free = away_from_impacts(motion)
    spin = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])[free]
    times = motion.impacts.time if motion.impacts is not None else np.zeros(0)
    facts = facts_of(motion, energy)
    return {
        "penetration": facts["penetration"],
        "pull": facts["pull"],
        "energy": float(np.abs(motion.total[free] / energy - 1.0).max()),
        "spin": float(np.abs(spin / turning - 1.0).max()),
        "chords": float(np.ptp(np.diff(times))) if len(times) == 4 else math.inf,
    }


def forces(method: str, row: Row) -> Facts:
    """A ball falls 1 m and stays: its weight and its impulse, also by a tenth of the step."""
    sizes = row.sizes
    fine = Sizes(sizes.dt / 10.0, sizes.row / 10.0)
    runs = [run(method, _ball(0.0), [1.0], [0.0], 1.0, each) for each in (sizes, fine)]
    speed = math.sqrt(2.0 * G)
    return {
        "weight": max(abs((motion.peak or math.inf) / G - 1.0) for motion in runs),
        "impulse": max(
            abs(float(motion.impacts.impulse.max()) / speed - 1.0) if motion.impacts else math.inf
            for motion in runs
        ),
        "total": max(abs(float(motion.impulse.sum()) / G - 1.0) for motion in runs),
    }


def kick(method: str, row: Row) -> Facts:
    """A wall that starts at once, at 2 m/s after 0.3 s, strikes the ball that lies on it."""
    wall = Signal(formulas=((1.0, Formula("where(t < 0.3, 0, 2*(t - 0.3))", ("t",))),))
    motion = run(method, _ball(0.5, wall, load=0.0), [0.0], [0.0], 0.4, row.sizes)
    speed = (1.0 + 0.5) * 2.0
    return {
        "speed": abs(float(motion.velocity[-1, 0]) / speed - 1.0),
        "place": abs(float(motion.position[-1, 0]) - speed * (0.4 - 0.3)),
    }
