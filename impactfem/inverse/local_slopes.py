"""Derivatives of arrays, made of a scene, by what varies: many values of a control at once.

What a run is made of, as loads of layers and masses of elements, each belongs to an interval of
time or of a bar. A value of a control changes only what meets its piece, so that values far enough
apart are changed together, and each change is given to the one that it belongs to (Curtis, Powell
and Reid, *On the estimation of sparse Jacobian matrices*, 1974).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from impactfem.arrays import Floats, Integers
from impactfem.errors import SceneError
from impactfem.inverse.steps import Changes
from impactfem.scene import Control, Scene

_STEP = 1e-3  # share of an unknown, the longer of two central differences
_ROUNDING = 1e-13  # of an array, as a share of its largest value
_STRAIGHT = 1e-11  # likewise: bend within a step that leaves central differences right
_BESIDE = 1e-8  # share of a piece by which means may see it beside what it borders on


@dataclass(frozen=True)
class Local:
    """An array of a scene whose entries belong to intervals.

    Attributes:
        values: Of any shape.
        spans: By "t" and "x": where the interval of each entry begins and ends [s, m], in shapes
            that broadcast to that of the values.
    """

    values: Floats
    spans: dict[str, tuple[Floats, Floats]]


@dataclass(frozen=True)
class _Group:
    """Unknowns that are changed together; of one its interval does not matter."""

    members: Integers
    along: str
    begin: Floats
    end: Floats

    def owners(self, arrays: Sequence[Local]) -> Integers:
        """Member to which each entry of all arrays belongs; -1: to none, (entries,)."""
        found = []
        for each in arrays:
            shape, owner = each.values.shape, np.full(each.values.shape, -1)
            if len(self.members) == 1:
                owner = np.full(shape, self.members[0])
            elif self.along in each.spans:
                low, high = each.spans[self.along]
                room = _BESIDE * float(np.min(self.end - self.begin))
                k = np.searchsorted(self.begin, high + room) - 1
                meets = (k >= 0) & (self.end[k] > low - room)
                owner = np.broadcast_to(np.where(meets, self.members[k], -1), shape)
            found.append(owner.ravel())
        return np.concatenate(found)


def slopes(
    changes: Changes, arrays: Callable[[Scene], Sequence[Local]]
) -> tuple[csr_array, NDArray[np.bool_]]:
    """Derivatives of all entries of some arrays by all unknowns.

    Central differences, extrapolated over two steps of what is not straight: right to about 1e-11
    of their size.

    Args:
        changes: The place, and the sizes of steps.
        arrays: What a scene is made into; those of neighbours have the same shapes.

    Returns:
        (entries, P), and whether each unknown is known, (P,): not if there are no neighbours on
        both sides.
    """
    base = arrays(changes.scene)
    count = len(changes.values)
    known = np.ones(count, dtype=bool)
    none = np.zeros(0, dtype=np.int64)
    parts: list[tuple[Integers, Integers, Floats]] = [(none, none, np.zeros(0))]
    waiting = list(_groups(changes.scene, base))
    while waiting:
        group = waiting.pop()
        try:
            change = _change(changes, arrays, group, base)
        except SceneError:
            known[group.members] = False
            continue
        rows = np.flatnonzero(change)
        owner = group.owners(base)[rows]
        if (owner < 0).any():  # what changes as a whole, as the mass: one by one
            waiting += [_Group(np.array([k]), "", *np.zeros((2, 1))) for k in group.members]
            continue
        parts.append((rows, owner, change[rows] / changes.scales[owner]))
    rows, columns, values = (np.concatenate(each) for each in zip(*parts, strict=True))
    size = sum(each.values.size for each in base)
    return csr_array((values, (rows, columns)), shape=(size, count)), known


def _change(
    changes: Changes, arrays: Callable[[Scene], Sequence[Local]], group: _Group,
    base: Sequence[Local],
) -> Floats:  # fmt: skip
    """Derivative of all entries by a common share of the sizes of a group, (entries,)."""
    way = np.zeros(len(changes.values))
    way[group.members] = changes.scales[group.members]

    def at(h: float) -> Floats:
        return _flat(arrays(changes.at(changes.values + h * way)))

    now = _flat(base)
    size = np.repeat(
        [np.abs(each.values).max(initial=0.0) for each in base],
        [each.values.size for each in base],
    )
    above, below = at(_STEP), at(-_STEP)
    found = (above - below) / (2.0 * _STEP)
    if (np.abs(above + below - 2.0 * now) > _STRAIGHT * size).any():
        found = (4.0 * (at(0.5 * _STEP) - at(-0.5 * _STEP)) / _STEP - found) / 3.0
    found[np.abs(above - below) <= _ROUNDING * size] = 0.0
    return found


def _flat(arrays: Sequence[Local]) -> Floats:
    return np.concatenate([each.values.ravel() for each in arrays])


def _groups(scene: Scene, arrays: Sequence[Local]) -> Iterator[_Group]:
    """Parameters one by one; values of controls that no entry meets two of."""
    first = len(scene.parameters)
    for k in range(first):
        yield _Group(np.array([k]), "", *np.zeros((2, 1)))
    for control in scene.controls:
        begin, end = _pieces(control, scene.duration)
        spans = [each.spans[control.along] for each in arrays if control.along in each.spans]
        each = (float(np.max(high - low, initial=0.0)) for low, high in spans)
        reach = max(each, default=0.0)
        shortest = float(np.diff(control.times(scene.duration)).min())
        apart = int(np.ceil((reach + float((end - begin).max())) / shortest))
        for offset in range(min(apart, control.count)):
            own = slice(offset, None, apart)
            yield _Group(first + np.arange(control.count)[own], control.along, begin[own], end[own])
        first += control.count


def _pieces(control: Control, duration: float) -> tuple[Floats, Floats]:
    """Where each value of a control begins and ends to act, (count,) each."""
    times = control.times(duration)
    if not control.is_linear:
        return times[:-1], times[1:]
    return np.append(times[:1], times[:-1]), np.append(times[1:], times[-1:])
