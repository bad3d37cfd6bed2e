"""Hard cases of several points, of stiff springs, and of the founding paper's oscillator."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.studies.hard.board import Case, Claim, Facts
from impactfem.studies.hard.vibro_facts import (
    LOCATED,
    STEPPED,
    VIBRO,
    WARNED,
    Sizes,
    basic_claims,
    facts_of,
    run,
    solved,
)
from impactfem.system.generalized import GeneralizedSystem, LinearSystem

Floats = NDArray[np.float64]

G = 9.81

_CRADLE = Sizes(dt=1e-3)
_LAWS: Mapping[str, tuple[dict[str, Any], tuple[float, float, float]]] = {
    "simultaneous": ({}, (-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0)),
    "plastic": ({"restitution": 0.0}, (1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0)),
    "sequential": ({"impact_law": "sequential"}, (0.0, 0.0, 1.0)),
}


def _cradle(method: str) -> Facts:
    """The first of three balls hits two that touch: velocities after it, by the laws."""
    facts: dict[str, float] = {}
    silent = False
    for law, (settings, exact) in _LAWS.items():
        if law == "sequential" and method != "event_driven":
            continue
        result = solved(method, "cradle", _CRADLE, **settings)
        last = [float(result.history[f"{n}.vx"][-1]) for n in ("first", "second", "third")]
        facts[law] = float(np.abs(np.subtract(last, exact)).max())
        codes = {finding["code"] for finding in result.summary["verdict"]["findings"]}
        silent |= "impact_law" not in codes
    return facts | {"unwarned": float(silent)}


def _cradle_claims(method: str) -> Sequence[Claim]:
    limit = 1e-6 if method == "penalty" else 1e-9
    laws = _LAWS if method == "event_driven" else ("simultaneous", "plastic")
    return [WARNED, *(Claim(law, limit, "the closed form of the law") for law in laws)]


_STACK = Sizes(dt=1e-3, stiffness=1e6)
_MASSES = (1.0, 1e6)


def _stack(method: str) -> Facts:
    """A mass of 1 bears one of 1e6: put down, and (by all but penalty) dropped from 0.1 m."""
    stack = LinearSystem(
        mass=_MASSES, normals=[[1.0, 0.0], [-1.0, 1.0]], offsets=[0.0, 0.0],
        load=[-G * m for m in _MASSES], restitution=0.3,
    )  # fmt: skip
    facts: dict[str, float] = {}
    for name, height, duration in (("put down", 0.0, 0.2), ("dropped", 0.1, 2.0)):
        if height and method == "penalty":
            continue
        motion = run(method, stack, [0.0, height], [0.0, 0.0], duration, _STACK)
        facts[name] = abs(float(motion.contact_force[-1, 0]) / (G * sum(_MASSES)) - 1.0)
        for key, value in facts_of(motion, 0.1 * G * _MASSES[1]).items():
            facts[key] = max(value, facts.get(key, 0.0))
    return facts


def _stack_claims(method: str) -> Sequence[Claim]:
    speed = math.sqrt(2.0 * G * 0.1)
    ways = ["put down"] if method == "penalty" else ["put down", "dropped"]
    return [
        *(Claim(way, 1e-8, "at rest the floor bears the whole weight") for way in ways),
        *basic_claims(_STACK, method, speed, speed / 0.1),
    ]


_STIFF = Sizes(dt=2e-5, row=1e-5)
_LIGHT, _SPRING = 1e-3, 1e8  # [kg, N/m]: explicit schemes need dt < 6.3e-6 s


def _stiff_system(*, general: bool) -> GeneralizedSystem:
    """A light and a heavy mass, 1 kg, on a stiff spring; the light one meets the wall."""
    stiffness = _SPRING * np.array([[1.0, -1.0], [-1.0, 1.0]])
    if not general:
        return LinearSystem(
            mass=[_LIGHT, 1.0], stiffness=stiffness, normals=[[1.0, 0.0]], offsets=[0.0]
        )
    return GeneralizedSystem(
        mass=[_LIGHT, 1.0], force=lambda _t, u, _v: -stiffness @ u, constraints=lambda u: u[:1]
    )


def _stiff(*, general: bool) -> Callable[[str], Facts]:
    def thrown(method: str) -> Facts:
        system = _stiff_system(general=general)
        motion = run(method, system, [1e-3, 1e-3], [-1.0, -1.0], 3e-3, _STIFF)
        momentum = float(motion.velocity[-1] @ [_LIGHT, 1.0])
        facts = facts_of(motion, 0.5 * (1.0 + _LIGHT), 1e-3)
        return facts | {"momentum": abs(momentum - 1.0)}

    return thrown


def _stiff_claims(method: str) -> Sequence[Claim]:
    # The light mass stops, the heavy one swings for half a period on the spring and is back with
    # its speed as the wall lets go: momentum 1. Steps stop and let go up to tau late, cos(W tau).
    pulse = math.sqrt(_SPRING)
    late = (pulse * _STIFF.time(method)) ** 2
    momentum = Claim("momentum", max(1e-9, late), "(W tau)^2 with W^2 = k / M of the heavy mass")
    return [*basic_claims(_STIFF, method, 1e3, pulse), momentum]


_DRIVE, _STOP, _LAST = 50.0, 0.8, 2.5
_FINE, _SOFT = Sizes(stiffness=1e6, row=2.5e-3), Sizes(stiffness=1e4, row=2.5e-3)


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


def _oscillator(sizes: Sizes) -> Callable[[str], Facts]:
    def driven(method: str) -> Facts:
        rows = sizes if method == "penalty" else replace(sizes, row=1e-4)
        history = solved(method, "oscillator", rows).history
        times, place = history["time"].values, history["mass.x"].values
        place = place[times >= _LAST - 6.0 * 2.0 * math.pi / _DRIVE]
        k = int(np.argmax(place[1:-1])) + 1  # the vertex of a parabola through three rows
        left, top, right = place[k - 1 : k + 2]
        bend = left - 2.0 * top + right
        highest = top - (right - left) ** 2 / (8.0 * bend) if bend < 0.0 else top
        return {"hop": abs(float(highest - _STOP) / hop_height() - 1.0)}

    return driven


def _hop_claims(method: str) -> Sequence[Claim]:
    why = "w tau: a hop begins late by tau"
    if method == "event_driven":  # its top is that of a parabola through rows
        return [Claim("hop", 1e-6, why)]
    return [_FINE.claim("hop", method, _DRIVE, why)]


SPECIAL: tuple[Case, ...] = (
    Case("cradle of three", _cradle, _cradle_claims, VIBRO, body="point"),
    Case("stack 1 : 10^6", _stack, _stack_claims, VIBRO, body="point"),
    Case("stiff spring, step of 3.2 stable ones", _stiff(general=False), _stiff_claims, LOCATED,
         body="point"),
    Case("stiff spring, explicit forces", _stiff(general=True), lambda _: (), STEPPED,
         frozenset(STEPPED), body="point"),
    Case("driven oscillator: hops of 74 micrometres", _oscillator(_FINE), _hop_claims, VIBRO,
         body="point"),
    Case("driven oscillator, k = 1e4", _oscillator(_SOFT), _hop_claims, ("penalty",),
         body="point"),
)  # fmt: skip
"""Cases of several points, of stiff springs, and of the oscillator."""
