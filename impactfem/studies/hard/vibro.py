"""Hard cases of few degrees of freedom, each against a closed form."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from impactfem.exact.vibro import ZenoBall, grazing_impact
from impactfem.scene.signal import Signal
from impactfem.studies.hard.board import Case, Claim, Facts
from impactfem.studies.hard.vibro_corner import CORNERS
from impactfem.studies.hard.vibro_facts import (
    LOCATED,
    PULL,
    STEPPED,
    VIBRO,
    Sizes,
    away_from_impacts,
    basic_claims,
    facts_of,
    run,
    solved,
)
from impactfem.studies.hard.vibro_forces import FORCES
from impactfem.studies.hard.vibro_special import SPECIAL
from impactfem.system.generalized import GeneralizedSystem, LinearSystem

G = 9.81
_IMPACT = math.sqrt(2.0 * G)  # [m/s] speed of a ball that has fallen 1 m
_FLIGHT = 2.0 * _IMPACT / G  # [s] from one elastic bounce to the next


def _ball(restitution: float, table: Signal | None = None) -> LinearSystem:
    return LinearSystem(
        mass=1.0, normals=[[1.0]], offsets=[0.0], load=[-G], restitution=restitution,
        motion=None if table is None else [table],
    )  # fmt: skip


_ZENO, _ZENO_E = Sizes(dt=5e-5, row=5e-3), 0.8


def _zeno(method: str) -> Facts:
    """Infinitely many bounces, then rest."""
    result = solved(method, "bouncing_ball", _ZENO)
    history = result.history
    times, force = history["time"].values, history["contact_force"].values
    if method == "event_driven":
        stop = result.summary["details"]["sticking"][0][0]
    else:
        pushed = force[1:] * np.diff(times) + history["contact_impulse"].values[1:]
        stop = times[1 + np.flatnonzero(np.abs(pushed / np.diff(times) / G - 1.0) > 1e-6)[-1]]
    total = history["total_energy"].values
    return {
        "stop": abs(stop - ZenoBall(1.0, _ZENO_E, G).stopping_time),
        "weight": abs(force[-1] / G - 1.0),
        "penetration": max(0.0, -float(history["gap"].values.min())),
        "growth": max(0.0, float((total - total[0]).max())) / G,
    }


def _zeno_claims(method: str) -> Sequence[Claim]:
    # Each of the bounces longer than tau, N, comes up to tau late and g tau too slow or too fast,
    # of which e is left: the stopping time changes by tau + 2 e tau / (1 - e).
    tau = _ZENO.time(method)
    bounces = math.log(2.0 * _IMPACT / (G * tau)) / -math.log(_ZENO_E) if tau else 0.0
    slope = bounces * (1.0 + 2.0 * _ZENO_E / (1.0 - _ZENO_E))
    basic = basic_claims(_ZENO, method, _IMPACT, _IMPACT)
    return [
        _ZENO.claim("stop", method, slope, "N (1 + 2e/(1-e)) tau for N bounces longer than tau"),
        Claim("weight", 1e-8, "at rest the floor bears the weight"),
        *(c for c in basic if c is not PULL),
    ]


_MANY = Sizes(dt=_FLIGHT / 100.3, row=_FLIGHT)
_RESONANT = Sizes(dt=_FLIGHT / 100.0)


def _many(sizes: Sizes) -> Callable[[str], Facts]:
    """Elastic bounces for a long time: 1e5 if they are located, else 1e4."""

    def bounce(method: str) -> Facts:
        count = 100_000 if method == "event_driven" else 10_000
        motion = run(method, _ball(1.0), [1.0], [0.0], (count + 0.25) * _FLIGHT, sizes)
        kept = slice(None) if method == "event_driven" else away_from_impacts(motion)
        drift = motion.total[kept] / G - 1.0
        return facts_of(motion, G) | {
            "growth": max(0.0, float(drift.max())),
            "drift": float(np.abs(drift).max()),
            "lost": abs(len(motion.impacts or ()) / count - 1.0),
        }

    return bounce


def _many_claims(method: str) -> Sequence[Claim]:
    tau = _MANY.time(method)
    claims = basic_claims(_MANY, method, _IMPACT, _IMPACT)
    if method != "paoli_schatzman":  # of which the growth says it
        why = "impulses with w^+ = -w^- do no work, in 1e4 impacts or 1e5"
        claims.append(Claim("drift", 1e-10 if method == "event_driven" else 1e-9, why))
    why = "a bounce begins tau late, and lasts 2 tau longer if it is g tau faster"
    return [*claims, Claim("lost", float(f"{3.0 * tau / _FLIGHT:.3g}"), why)]


_GRAZE, _DEPTH = Sizes(dt=2e-5, stiffness=1e10), 1e-6


def _graze(method: str) -> Facts:
    """Three impacts of x'' = -x, from x = 1, on a wall at -(1 - 1e-6)."""
    speed, period = grazing_impact(_DEPTH)
    wall = LinearSystem(
        mass=1.0, stiffness=1.0, normals=[[1.0]], offsets=[1.0 - _DEPTH], restitution=1.0
    )
    motion = run(method, wall, [1.0], [0.0], 2.75 * period, _GRAZE)
    impacts = motion.impacts
    if impacts is None or len(impacts) != 3:
        return facts_of(motion, 0.5) | {"speed": math.inf, "period": math.inf}
    return facts_of(motion, 0.5) | {
        "speed": float(np.abs(-impacts.before / speed - 1.0).max()),
        "period": float(np.abs(np.diff(impacts.time) - period).max()),
    }


def _graze_claims(method: str) -> Sequence[Claim]:
    speed, _ = grazing_impact(_DEPTH)
    return [
        *basic_claims(_GRAZE, method, speed, speed / 0.5),
        _GRAZE.claim("speed", method, 1.0 / speed, "a tau / v with a = 1"),
        _GRAZE.claim("period", method, 3.0, "tau + 2 a tau with a = 1"),
    ]


_TABLE, _HIGH, _TURN = Sizes(stiffness=1e6, row=1e-3), 0.3, 2.0 * math.pi


def _table(method: str) -> Facts:
    """A ball rests on a table that moves by A sin(w t), until it falls faster than the ball."""
    table = Signal(harmonics=((_TURN, 0.0, _HIGH),))
    motion = run(method, _ball(0.5, table), [0.0], [_HIGH * _TURN], 0.5, _TABLE)
    leaving = math.asin(G / (_HIGH * _TURN**2)) / _TURN
    if method == "event_driven":
        found = motion.effort.details["sticking"][0][1]
    else:
        found = motion.times[np.flatnonzero(motion.impulse[:, 0] > 0.0)[-1]]
    rest = 0.5 - leaving
    speed = _HIGH * _TURN * math.cos(_TURN * leaving)
    place = _HIGH * math.sin(_TURN * leaving) + speed * rest - 0.5 * G * rest**2
    facts = facts_of(motion, 1.0)
    return {
        "penetration": facts["penetration"],
        "release": abs(float(found) - leaving),
        "flight": abs(float(motion.position[-1, 0]) - place),
    }


def _table_claims(method: str) -> Sequence[Claim]:
    speed = _HIGH * _TURN
    return [
        _TABLE.claim("penetration", method, speed, "v tau, the way before an impact acts"),
        _TABLE.claim("release", method, 1.0, "a release is late by tau"),
        _TABLE.claim("flight", method, speed, "v tau of a late release"),
    ]


_BOWL = Sizes(dt=2e-3)
_BOWL_ENERGY, _BOWL_SPIN, _BOWL_HITS = 0.545, 0.5, 4
_BOWL_SPEED = math.sqrt(2.0 * _BOWL_ENERGY - _BOWL_SPIN**2)  # normal, at the rim of radius 1


def _bowl(method: str) -> Facts:
    """Four chords of a circle: curved and nonlinear, with equal times between impacts."""
    bowl = GeneralizedSystem(
        mass=[1.0, 1.0], force=lambda *_: np.zeros(2), restitution=1.0,
        constraints=lambda u: 1.0 - (u[0] * u[0] + u[1] * u[1]) ** 0.5,
    )  # fmt: skip
    motion = run(method, bowl, [0.5, 0.0], [0.3, 1.0], 6.0, _BOWL)
    u, v = motion.position, motion.velocity
    free = away_from_impacts(motion)
    spin = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])[free]
    times = motion.impacts.time if motion.impacts is not None else np.zeros(0)
    chords = float(np.ptp(np.diff(times))) if len(times) == _BOWL_HITS else math.inf
    facts = facts_of(motion, _BOWL_ENERGY)
    del facts["growth"]
    return facts | {
        "energy": float(np.abs(motion.total[free] / _BOWL_ENERGY - 1.0).max()),
        "spin": float(np.abs(spin / _BOWL_SPIN - 1.0).max()),
        "chords": chords,
    }


def _bowl_claims(method: str) -> Sequence[Claim]:
    if method == "paoli_schatzman":
        # A normal taken v_t tau beside the contact turns 2 v_n by v_t tau / R.
        slope = _BOWL_HITS * 2.0 * _BOWL_SPEED * _BOWL_SPIN / (2.0 * _BOWL_ENERGY) ** 0.5
        energy = _BOWL.claim("energy", method, slope, "N 2 v_n v_t tau / v R for N impacts")
    else:
        limit = 1e-6 if method == "penalty" else 1e-9
        energy = Claim("energy", limit, "impulses reverse the normal velocity, or springs give all")
    return [
        _BOWL.claim("penetration", method, _BOWL_SPEED, "v tau, the way before an impact acts"),
        *([] if method == "penalty" else [PULL]),
        energy,
        Claim("spin", 1e-9, "impulses point to the centre"),
        _BOWL.claim("chords", method, 2.0, "tau at both ends"),
    ]


CASES: tuple[Case, ...] = (
    Case("ball bounces until it rests", _zeno, _zeno_claims, VIBRO, body="point"),
    Case("elastic bounces, 1e4 by steps, 1e5 located", _many(_MANY), _many_claims, LOCATED,
         body="point"),
    Case("elastic bounces of exactly 100 steps", _many(_RESONANT), _many_claims, STEPPED,
         body="point"),
    Case("grazing, 1e-6 of the amplitude deep", _graze, _graze_claims, VIBRO, body="point"),
    *CORNERS,
    Case("table leaves a ball that rests on it", _table, _table_claims, VIBRO, body="point"),
    Case("ball in a bowl", _bowl, _bowl_claims, VIBRO, body="point"),
    *FORCES,
    *SPECIAL,
)  # fmt: skip
"""Hard cases of points."""
