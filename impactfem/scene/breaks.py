"""Where a motion given by a formula in time jumps or changes its velocity at once."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.formula import Formula
from impactfem.scene.jets import motion_at
from impactfem.scene.ranges import rough_on
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

_FINE = 2.0**-48  # width of a break, as a share of its time
_EARLIEST = 2.0**-100  # and of the duration, for breaks at t = 0
_MOST = 100_000  # intervals that are looked at together
_WIDEST = 1e-9  # break that still counts as one, as a share of the duration
_ROUNDING = 1e-9  # share of the motion's range, and of its mean speed, that is no jump
_SINGULAR = 8.0  # growth of the speed towards a break within which it stays finite
_SAMPLES = 1001


@dataclass(frozen=True)
class Break:
    """A change of branch between two times that are equal up to a few roundings.

    Attributes:
        before: Time just before [s].
        after: Time just after [s].
    """

    before: float
    after: float

    @classmethod
    def at(cls, time: float) -> "Break":
        """A change whose time is a number: what follows holds from there on [s]."""
        return cls(float(np.nextafter(time, -np.inf)), time)


@dataclass(frozen=True)
class Kick:
    """A constraint whose motion b(t) changes its velocity at once, from before to after [m/s]."""

    at: Break
    constraint: int
    before: float
    after: float


@lru_cache(maxsize=256)
def find_breaks(formula: Formula, end: float) -> tuple[Break, ...]:
    """Breaks of a formula in t, 0 <= t <= end [s], in the order of time; kinks are among them.

    Intervals that may hold one are halved until they are as short as rounding allows. They begin
    as those between the numbers with which time is compared, which most breaks are.
    """
    told = formula.compared("t")
    told = told[(told >= 0.0) & (told <= end)]
    beside = np.concatenate([np.nextafter(told, 0.0), np.nextafter(told, end)])
    edges = np.unique(np.concatenate([[0.0], beside, [end]]))
    low, high = edges[:-1], edges[1:]
    found: list[tuple[Floats, Floats]] = []
    while len(low):
        rough = rough_on(formula, low, high)
        low, high = low[rough], high[rough]
        fine = high - low <= np.maximum(_FINE * high, _EARLIEST * end)
        if len(low) > _MOST:
            fine[:] = True
        found.append((low[fine], high[fine]))
        low, high = low[~fine], high[~fine]
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    starts, ends = (np.concatenate(side) for side in zip(*found, strict=True))
    breaks: list[Break] = []
    for k in np.argsort(starts):
        first, last = float(starts[k]), float(ends[k])
        if breaks and first <= breaks[-1].after:  # one break, seen from both sides
            breaks[-1] = Break(breaks[-1].before, max(last, breaks[-1].after))
        else:
            breaks.append(Break(first, last))
    return tuple(breaks)


def finite_values(where: str, name: str, formula: Formula, end: float) -> Floats:
    """Samples of a formula in t up to an end [s].

    Args:
        where: Table of the formula, for messages.
        name: Its key.
        formula: In t.
        end: Duration [s].

    Raises:
        KeyedError: One of them is not finite.
    """
    times = np.linspace(0.0, end, _SAMPLES)
    values: Floats = formula(t=times) + np.zeros_like(times)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        text = f" = {show(formula.text)} has no finite value at t = {times[bad[0]]:.6g}: give one "
        raise KeyedError(where, name, f"{text}for 0 <= t <= {end:g}.")
    return values


def check_motion(
    where: str, name: str, formulas: Sequence[Formula | None], end: float, unit: str = "m",
    *, from_zero: bool = False,
) -> None:  # fmt: skip
    """Refuse motions of obstacles and supports that jump, or whose velocity is not finite.

    Args:
        where: Table of the motion, for messages.
        name: Its key.
        formulas: Displacements in t [m], or angles [rad]; None where there is none.
        end: Duration [s].
        unit: Of the formulas.
        from_zero: Whether what moves is at 0 before, so that another value at t = 0 is a jump.

    Raises:
        KeyedError: Naming the key, the value, the time and the remedy.
    """
    for formula in formulas:
        if formula is None:
            continue
        values = finite_values(where, name, formula, end)
        why = remedy = ""
        if from_zero and values[0] != 0.0:
            why = f"jumps from 0 to {values[0]:.6g} {unit} at t = 0 s, at an infinite speed"
            begun = formula.text if formula.is_constant else f"({formula.text})"
            remedy = f"let it move in a finite time, as by {begun}*min(1, t/{0.01 * end:g}), or "
            remedy += 'begin in equilibrium with it by start = "static"'
        if not why:
            scale = float(np.ptp(values)), float(np.abs(values).max())
            for at in find_breaks(formula, end):
                why, remedy = _fault(formula, at, end, scale, unit)
                if why:
                    break
        if why:
            raise KeyedError(where, name, f" = {show(formula.text)} {why}: {remedy}.")


def _fault(
    formula: Formula, at: Break, end: float, scale: tuple[float, float], unit: str
) -> tuple[str, str]:
    """What is wrong with a break, and what to do; empty if nothing is."""
    span, when = at.after - at.before, f"{at.after:.6g}" if at.after > 1e-12 * end else "0"
    if span > _WIDEST * end:
        return (
            f"changes its branch near t = {when} s too often, or at times lost in rounding",
            f"compare t with numbers, as where(t < {when}, a, b)",
        )
    one, two = float(formula(t=at.before)), float(formula(t=at.after))
    for t, way in ((at.before, -1.0), (at.after, 1.0)):
        away = t + way * 1e3 * span
        if not 0.0 <= away <= end:
            continue
        speed, usual = (abs(float(motion_at(formula, time).rate)) for time in (t, away))
        if not speed <= _SINGULAR * usual + _ROUNDING * scale[0] / end:
            return (
                f"has no finite velocity at t = {when} s",
                "give a formula whose velocity is finite there",
            )
    if not abs(two - one) <= _ROUNDING * scale[0] + 1e3 * np.finfo(float).eps * scale[1]:
        ramp = f"{two - one:.6g}*max(0, min(1, (t - {when})/{0.01 * end:g}))"
        return (
            f"jumps from {one:.6g} to {two:.6g} {unit} at t = {when} s, at an infinite speed",
            f"let it move in a finite time, as by {ramp}",
        )
    return "", ""
