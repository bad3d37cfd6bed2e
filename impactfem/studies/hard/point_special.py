"""Hard cases of several points, of stiff springs, and of the founding paper's oscillator."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from impactfem.arrays import Floats
from impactfem.methods import METHODS
from impactfem.studies.hard.board import Case, Facts
from impactfem.studies.hard.gradients import beside_graze, restitution
from impactfem.studies.hard.point_facts import facts_of, run, solved
from impactfem.studies.hard.points import (
    G,
    bounces,
    bowl,
    corner,
    forces,
    graze,
    kick,
    table,
    zeno,
)
from impactfem.studies.hard.rows import Row, load
from impactfem.system.generalized import GeneralizedSystem, LinearSystem

_AREA = float(quad(lambda s: math.exp(-0.25 / ((s - 0.5) * (1.0 - s))), 0.5, 1.0)[0])
_DEAD = 1e-3  # [s] before which the force is below 1e-170 N

_LAWS: Mapping[str, tuple[dict[str, Any], tuple[float, float, float]]] = {
    "simultaneous": ({}, (-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0)),
    "plastic": ({"restitution": 0.0}, (1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0)),
    "sequential": ({"impact_law": "sequential"}, (0.0, 0.0, 1.0)),
}


def cradle(method: str, row: Row) -> Facts:
    """The first of three balls hits two that touch: velocities after it, by the laws."""
    facts: dict[str, float] = {}
    silent = False
    for law, (settings, exact) in _LAWS.items():
        if law == "sequential" and not METHODS[method].locates:
            continue
        result = solved(method, "cradle", row.sizes, **settings)
        last = [float(result.history[f"{n}.vx"][-1]) for n in ("first", "second", "third")]
        facts[law] = float(np.abs(np.subtract(last, exact)).max())
        codes = {finding["code"] for finding in result.summary["verdict"]["findings"]}
        silent |= "impact_law" not in codes
    return facts | {"unwarned": float(silent)}


def stack(method: str, row: Row) -> Facts:
    """A mass of 1 bears one of 1e6: put down, and dropped from 0.1 m."""
    masses = (1.0, 1e6)
    system = LinearSystem(
        mass=masses, normals=[[1.0, 0.0], [-1.0, 1.0]], offsets=[0.0, 0.0],
        load=[-G * m for m in masses], restitution=0.3,
    )  # fmt: skip
    facts: dict[str, float] = {}
    for name, height, duration in (("put down", 0.0, 0.2), ("dropped", 0.1, 2.0)):
        motion = run(method, system, [0.0, height], [0.0, 0.0], duration, row.sizes)
        facts[name] = abs(float(motion.contact_force[-1, 0]) / (G * sum(masses)) - 1.0)
        for key, value in facts_of(motion, 0.1 * G * masses[1]).items():
            facts[key] = max(value, facts.get(key, 0.0))
    return facts


def spring(method: str, row: Row) -> Facts:
    """A light and a heavy mass, 1 kg, on a stiff spring; the light one meets the wall.

    Args:
        method: Name of the method.
        row: ``general`` gives the spring as a force that nothing is known of.
    """
    light = 1e-3
    stiffness = 1e8 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    system: GeneralizedSystem
    if row.given.get("general"):
        system = GeneralizedSystem(
            mass=[light, 1.0], force=lambda _t, u, _v: -stiffness @ u, constraints=lambda u: u[:1]
        )
    else:
        system = LinearSystem(
            mass=[light, 1.0], stiffness=stiffness, normals=[[1.0, 0.0]], offsets=[0.0]
        )
    motion = run(method, system, [1e-3, 1e-3], [-1.0, -1.0], 3e-3, row.sizes)
    momentum = float(motion.velocity[-1] @ [light, 1.0])
    return facts_of(motion, 0.5 * (1.0 + light), 1e-3) | {"momentum": abs(momentum - 1.0)}


_DRIVE, _STOP, _LAST = 50.0, 0.8, 2.5


def hop_height() -> float:
    """Height [m] of a hop from rest of x'' = -x' - x + cos(50 t) on a stop at 0.8.

    The stop lets go where cos(50 t) rises through 0.8. From there the motion is harmonic plus a
    decaying one; its first maximum is found by Newton's method.
    """
    size = (1.0 - _DRIVE**2) ** 2 + _DRIVE**2
    a, b = (1.0 - _DRIVE**2) / size, _DRIVE / size
    begin = -math.acos(_STOP) / _DRIVE
    w = complex(-0.5, math.sqrt(0.75))
    forced = complex(a, -b) * np.exp(1j * _DRIVE * begin)
    # x = Re(forced e^{50 i s} + free e^{w s}), x(0) = 0.8, x'(0) = 0
    rest, rate = _STOP - forced.real, -(1j * _DRIVE * forced).real
    free = complex(rest, (w.real * rest - rate) / w.imag)

    def part(order: int, s: float) -> float:
        swing = (1j * _DRIVE) ** order * forced * np.exp(1j * _DRIVE * s)
        return float((swing + w**order * free * np.exp(w * s)).real)

    samples = np.linspace(0.0, 2.0 * math.pi / _DRIVE, 1001)[1:]
    s = float(samples[np.argmax([part(0, t) for t in samples])])
    for _ in range(20):
        s -= part(1, s) / part(2, s)
    return part(0, s) - _STOP


def hop(method: str, row: Row) -> Facts:
    """The founding paper's driven oscillator: height of its last hops."""
    history = solved(method, "oscillator", replace(row.sizes, row=1e-4)).history
    times, place = history["time"].values, history["mass.x"].values
    place = place[times >= _LAST - 6.0 * 2.0 * math.pi / _DRIVE]
    k = int(np.argmax(place[1:-1])) + 1  # the vertex of a parabola through three rows
    left, top, right = place[k - 1 : k + 2]
    bend = left - 2.0 * top + right
    highest = top - (right - left) ** 2 / (8.0 * bend) if bend < 0.0 else top
    return {"hop": abs(float(highest - _STOP) / hop_height() - 1.0)}


def bump(share: float) -> float:
    """A smooth push in the second half of an interval [0, 1], of integral 1 and mean 3/4."""
    room = (share - 0.5) * (1.0 - share)
    return math.exp(-0.25 / room) / _AREA if room > 0.0 else 0.0


def pressing(begin: float = 0.0) -> GeneralizedSystem:
    """A ball on a floor, e = 1/2, pressed by a smooth force under which it rests or hops.

    Between t = 1/(n + 1) and 1/n the push has the impulse F_n = 1.5^-n. A ball launched there with
    F_n / 4 lands after the push with 3/4 F_n and rebounds with 3/8 F_n, which is F_(n - 1) / 4: it
    hops at all times t > 0 from the same start, u = u' = 0, from which it may rest. M. Schatzman
    (Nonlinear Anal. 2 (1978) 355-373) has an example of this kind.

    Args:
        begin: When time starts [s], <= 1.
    """

    def force(t: float, _u: Floats, _v: Floats) -> Floats:
        if t + begin < _DEAD:
            return np.zeros(1)
        n = math.floor(1.0 / (t + begin))
        rate = n * (n + 1.0)
        return np.array([-(1.5**-n) * rate * bump((t + begin - 1.0 / (n + 1.0)) * rate)])

    return GeneralizedSystem(
        mass=1.0, force=force, constraints=lambda u: u, jacobian=lambda _: np.eye(1),
        restitution=0.5,
    )  # fmt: skip


def highest_hop() -> float:
    """Top [m] of the hop from 1/2 to 1, launched with F_1 / 4: where the push has taken this."""

    def taken(share: float) -> float:
        return float(quad(bump, 0.5, share)[0])

    top = float(brentq(lambda share: taken(share) - 0.25, 0.6, 0.9, xtol=1e-12))
    fall = float(quad(lambda share: (top - share) * bump(share), 0.5, top)[0])
    return 0.5 * (0.25 * top - fall) / 1.5


def several(method: str, row: Row) -> Facts:
    """The ball that may rest or hop: from rest, from a start 1e-9 above, and launched at t = 1/8.

    All methods take rest; the slightest change of the start ends in the hops.
    """
    rest, beside = (
        run(method, pressing(), [height], [0.0], 1.0, row.sizes) for height in (0.0, 1e-9)
    )
    hops = run(method, pressing(0.125), [0.0], [0.25 * 1.5**-7], 0.875, row.sizes)
    top = highest_hop()
    return {
        "rest": float(np.abs(rest.position).max()),
        "left": abs(float(beside.position.max()) / top - 1.0),
        "hops": abs(float(hops.position.max()) / top - 1.0),
    }


CASES: tuple[Case, ...] = load(
    "points",
    (
        zeno, bounces, graze, corner, table, bowl, forces, kick, cradle, stack, spring, hop,
        several, beside_graze, restitution,
    ),
)  # fmt: skip
"""Hard cases of points."""
