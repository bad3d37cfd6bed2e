"""Means over time of formulas, as steps need them: what happens within a step is not missed.

Gauss's rules on intervals that are cut where a formula has kinks or jumps, where two rules differ,
and where the formula may take values that no sample saw (interval arithmetic tells). So a pulse
that is far shorter than a step has its whole impulse, wherever it lies.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats, Integers
from impactfem.scene.breaks import Break, find_breaks
from impactfem.scene.formula import Formula
from impactfem.scene.ranges import range_on

_PARTS = 8  # into which an interval is cut
_CUTS = 10  # one after the other: kinks are found to 8^-10 = 1e-9 of a step
_MOST = 200_000  # intervals that are looked at together
_ACCURACY = 1e-11  # share of the largest value in the step by which two rules may differ
_UNSEEN = 1e-3  # share of it that may hide between samples
_WIDER = 8.0  # than what samples show may be the bounds of what is smooth
_NEAR_ZERO = 1e-9
_BESIDE = 1e-12  # share of a run by which smooth parts keep off breaks
_GRADED = 7.0  # times as long as the next: intervals between which a formula begins to change


def _gauss(points: int) -> tuple[Floats, Floats]:
    nodes, weights = np.polynomial.legendre.leggauss(points)
    return 0.5 * (1.0 + nodes), 0.5 * weights


(_FEW, _FEW_WEIGHTS), (_MANY, _MANY_WEIGHTS) = _gauss(4), _gauss(8)
_NODES = np.concatenate([_FEW, _MANY])


class _Parts(NamedTuple):
    """Parts of intervals on which Gauss's rule holds, (parts,) each.

    Attributes:
        of: Which interval.
        low, width: Where it begins, and how long it is [s].
        share: Of the interval.
        mean: Of the formula.
        doubt: By how much two rules for it differ.
    """

    of: Integers
    low: Floats
    width: Floats
    share: Floats
    mean: Floats
    doubt: Floats


def mean_of(
    formula: Formula, start: ArrayLike, end: ArrayLike, **others: ArrayLike
) -> Any:  # float or array of floats
    """Mean of a formula in t from one time to another.

    Args:
        formula: In t and others.
        start: [s]; a number or an array.
        end: [s]; where it is the start, the value there is taken.
        others: Its other variables, which stay.

    Returns:
        Floats in the shape to which all arguments broadcast; inf or nan where the formula has no
        finite value.
    """
    if formula.table is not None:
        return formula.table.mean(*np.broadcast_arrays(start, end, *others.values())[:2])[()]
    known = {name: value for name, value in others.items() if name in formula.used}
    if "t" not in formula.used:
        value = formula(**known)
        return value + np.zeros(np.broadcast_shapes(np.shape(start), np.shape(end)))
    arrays = np.broadcast_arrays(
        *(np.asarray(value, dtype=np.float64) for value in (start, end, *known.values()))
    )
    low, high, *values = (array.ravel() for array in arrays)
    still = dict(zip(known, values, strict=True))
    found = formula(t=low, **still)
    if (moving := np.flatnonzero(high > low)).size:
        found = np.array(found)
        of, begin, stop = _cut_at_numbers(formula, low[moving], high[moving])
        own = {name: value[moving][of] for name, value in still.items()}
        parts = _resolved(formula, begin, stop, own)
        share = ((stop - begin) / (high - low)[moving][of])[parts.of] * parts.share
        found[moving] = np.bincount(of[parts.of], share * parts.mean, len(moving))
    return np.reshape(found, arrays[0].shape)[()]


def _cut_at_numbers(formula: Formula, low: Floats, high: Floats) -> tuple[Integers, Floats, Floats]:
    """Intervals cut at the numbers with which time is compared, which most breaks are.

    Returns:
        Of each part its interval, where it begins and where it ends, (parts,) each.
    """
    told = formula.compared("t")
    first, last = np.searchsorted(told, low, side="right"), np.searchsorted(told, high, side="left")
    counts = np.maximum(last - first, 0) + 1
    if not len(told) or counts.sum() > max(_MOST, 4 * len(low)):
        return np.arange(len(low)), low, high
    of = np.arange(len(low)).repeat(counts)
    place = np.arange(len(of)) - (np.cumsum(counts) - counts)[of]
    at = first[of] + place
    begin = np.where(place == 0, low[of], told[np.maximum(at - 1, 0)])
    stop = np.where(place == counts[of] - 1, high[of], told[np.minimum(at, len(told) - 1)])
    inside = 4.0 * np.spacing(stop)  # at the numbers themselves both branches may hold
    begin, stop = (
        np.where(told[np.searchsorted(told[:-1], edge)] == edge, edge + away * inside, edge)
        for edge, away in ((begin, 1.0), (stop, -1.0))
    )
    return of, begin, np.maximum(stop, begin)


class StepMean:
    """A formula in t and the state of a body, as its mean over a step at a state that may change.

    What changes in time within the step is found once, where it begins.

    Args:
        formula: In t and others.
    """

    def __init__(self, formula: Formula) -> None:
        self._formula, self._used = formula, formula.used - {"t"}
        self._value = formula.number
        # What controllers hold stays within a step.
        self._varies = formula.fixed(t=0.0).tree != formula.tree
        self._at = (np.nan, np.nan)
        self._times = self._weights = np.zeros(0)

    def __call__(self, start: float, end: float, **state: float) -> float:
        """Mean from one time to another [s]; ``state`` may have more than the formula uses."""
        if not self._varies:
            return self._value({"t": start, **state})
        if self._formula.table is not None:
            return float(self._formula.table.mean(np.array(start), np.array(end)))
        if not end > start:
            return self._value({"t": start, **state})
        formula, own = self._formula, {name: state[name] for name in self._used}
        if (start, end) != self._at:
            # A product with a state that is 0 just now would hide when it changes.
            of, low, high = _cut_at_numbers(formula, np.full(1, start), np.full(1, end))
            still = {name: np.full(len(of), value or _NEAR_ZERO) for name, value in own.items()}
            parts = _resolved(formula, low, high, still)
            share = ((high - low) / (end - start))[parts.of] * parts.share
            self._times = (parts.low + parts.width * _MANY[:, None]).ravel()
            self._weights = (share * _MANY_WEIGHTS[:, None]).ravel()
            self._at = start, end
        return float(self._weights @ formula(t=self._times, **own))


class Within(NamedTuple):
    """What a formula does within steps, at times that miss nothing, (times,) each.

    Attributes:
        of: Which step.
        times: [s], in no order.
        weights: Gauss's, whose sum is 1 in each step.
        values: Of the formula.
        unsure: Largest share by which two rules for a mean still differ.
    """

    of: Integers
    times: Floats
    weights: Floats
    values: Floats
    unsure: float


def within(formula: Formula, levels: Floats, **others: float) -> Within:
    """Look at a formula in t between levels [s], (steps + 1,), with numbers for other variables."""
    still = {name: np.full(len(levels) - 1, others[name]) for name in formula.used - {"t"}}
    parts = _resolved(formula, levels[:-1], levels[1:], still)
    of = parts.of.repeat(len(_MANY))
    times = (parts.low[:, None] + parts.width[:, None] * _MANY).ravel()
    weights = (parts.share[:, None] * _MANY_WEIGHTS).ravel()
    values = formula(t=times, **{name: others[name] for name in still})
    largest = np.abs(values).max(initial=0.0)
    unsure = np.bincount(parts.of, parts.share * parts.doubt).max(initial=0.0)
    return Within(of, times, weights, values, float(unsure / largest) if largest else 0.0)


def stops_of(formula: Formula, end: float) -> list[Break]:
    """Where an integrator with its own steps should stop, up to an end [s].

    At jumps and kinks of a formula in t; and, as breaks of no width, where it begins or ends to
    change much faster.
    """
    if "t" not in formula.used:
        return []
    breaks, of, low, width = _smooth(formula, end)
    ratio = width[1:] / width[:-1]
    graded = (of[1:] == of[:-1]) & ((ratio > _GRADED) | (ratio < 1.0 / _GRADED))
    return [*breaks, *(Break(time, time) for time in low[1:][graded].tolist())]


def cuts_of(formula: Formula, end: float) -> list[Break]:
    """Where a formula in t has to be cut so that a few samples of each part miss nothing.

    At jumps and kinks up to an end [s]; and, as breaks of no width, between parts on which Gauss's
    rules agree.
    """
    if "t" not in formula.used:
        return []
    breaks, of, low, _ = _smooth(formula, end)
    inner = low[1:][of[1:] == of[:-1]]
    return [*breaks, *(Break(time, time) for time in inner.tolist())]


def _smooth(formula: Formula, end: float) -> tuple[Sequence[Break], Integers, Floats, Floats]:
    """Breaks of a formula in t, and its parts between them in order: between which, low, width."""
    breaks, room = find_breaks(formula, end), _BESIDE * end
    starts = np.array([0.0, *(at.after + room for at in breaks)])
    ends = np.array([*(at.before - room for at in breaks), end])
    apart = ends > starts
    parts = _resolved(formula, starts[apart], ends[apart], {})
    order = np.lexsort((parts.low, parts.of))
    return breaks, parts.of[order], parts.low[order], parts.width[order]


def _resolved(formula: Formula, start: Floats, end: Floats, still: Mapping[str, Floats]) -> _Parts:
    """Parts of the intervals from start to end, (intervals,) each, start < end."""
    largest = np.zeros(len(start))
    of, low, width = np.arange(len(start)), start, end - start
    share = np.ones(len(start))
    found: list[_Parts] = []
    for cut in range(_CUTS + 1):
        values = {name: value[of] for name, value in still.items()}
        seen = formula(t=low + width * _NODES[:, None], **values)
        few, many = _FEW_WEIGHTS @ seen[:4], _MANY_WEIGHTS @ seen[4:]
        least, most = seen.min(axis=0), seen.max(axis=0)
        np.fmax.at(largest, of, np.maximum(np.abs(least), np.abs(most)))
        below, above, rough = range_on(formula, low, low + width, values)
        scale, bounds = largest[of], above - below
        with np.errstate(invalid="ignore"):
            fine = ~rough & (share * np.abs(many - few) <= _ACCURACY * scale)
            fine &= (bounds <= _WIDER * (most - least)) | (share * bounds <= _UNSEEN * scale)
        fine |= (bounds == 0.0) | ~np.isfinite(many)
        if cut == _CUTS or _PARTS * np.count_nonzero(~fine) > max(_MOST, 4 * len(start)):
            fine[:] = True
        found.append(
            _Parts(*(each[fine] for each in (of, low, width, share, many, np.abs(many - few))))
        )
        rest = np.flatnonzero(~fine).repeat(_PARTS)
        if not rest.size:
            break
        of, share, width = of[rest], share[rest] / _PARTS, width[rest] / _PARTS
        low = low[rest] + np.tile(np.arange(_PARTS), rest.size // _PARTS) * width
    return _Parts(*(np.concatenate(each) for each in zip(*found, strict=True)))
