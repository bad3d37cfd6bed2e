"""Bars by characteristics: outcomes, and their derivatives by differences on both sides."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.exact.row_bar import PIECES
from impactfem.inverse.outcomes import Outcome
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.steps import Changes, Slopes
from impactfem.planning import BarNumbers, Plan, RowNumbers
from impactfem.reference.bar import exact_bar, exact_motion
from impactfem.reference.bar_row import exact_row
from impactfem.reference.rounding import OTHER_ROW
from impactfem.result.bar_row_motion import RowMotion, pair_names, row_history
from impactfem.runs.bar_rows import exact_row_motion, of_pairs
from impactfem.runs.line_probes import bar_probes
from impactfem.scene import Scene
from impactfem.sizing import DEFAULT_ELEMENTS

_STEP = 1e-4  # share of a parameter, the longer of two differences
_FEW = 4  # unknowns whose neighbours are compared one by one
_KINK = 1e-6  # share by which slopes on both sides may differ before both are told


class _Followed(NamedTuple):
    """An exact motion of bars as outcomes see it.

    Attributes:
        row: The motion at the times that are asked for.
        contacts: Intervals of contact of each pair [s].
        pushed: Impulse of each pair up to each time [N s], (times, pairs).
        largest: Largest force of each pair [N].
        speed: Velocity of the centre of a bar at a time [m/s].
        driven: Work of what drives ends [J], (times,) or 0.
    """

    row: RowMotion
    contacts: Sequence[Sequence[tuple[float, float]]]
    pushed: Floats
    largest: Sequence[float]
    speed: Callable[[int, float], float]
    driven: Floats | float


@dataclass(frozen=True)
class BarRuns:
    """Exact runs of a bar or of bars in a row, as planned.

    Attributes:
        chosen: The plan.
        pieces: Into which starts of bars in a row are cut that are no lines: their slopes jump at
            the ends of pieces, so that derivatives are off by some of a piece.
    """

    chosen: Plan[BarNumbers] | Plan[RowNumbers]
    pieces: int = PIECES

    def outcome(self, scene: Scene, times: Floats) -> Outcome:
        """A run, known at some times."""
        numbers = self.chosen.numbers
        if isinstance(numbers, RowNumbers):
            found = _row(scene, times, numbers.elements, self.pieces)
        else:
            found = _one(scene, times, numbers.elements or DEFAULT_ELEMENTS)
        history = row_history(found.row, scene.bars, bar_probes(scene, found.row))
        pairs = pair_names(found.row.labels, scene.bars)
        lasting = [sum(end - start for start, end in spells) for spells in found.contacts]
        return Outcome(
            history,
            dict(zip(pairs, found.pushed.T, strict=True)),
            dict(zip(pairs, map(float, lasting), strict=True)),
            {bar.name: _rebound(scene, found, k) for k, bar in enumerate(scene.bars)},
            {bar.name: bar.mass for bar in scene.bars},
            found.driven,
            dict(zip(pairs, found.largest, strict=True)),
            {
                pair: float(spells[0][0]) if spells else float("nan")
                for pair, spells in zip(pairs, found.contacts, strict=True)
            },
        )

    def jacobian(self, changes: Changes, quantities: Quantities) -> Slopes:
        """Numbers of a run and their derivatives, by differences over neighbours."""
        found = differences(changes, reader(self.outcome, changes, quantities))
        other = self.reference(changes.scene) if found.sides else None
        if other is not None:  # what jumps at the end of a piece has no kink where others end
            sides = differences(changes, reader(other.outcome, changes, quantities)).sides
            if sides is None:
                return Slopes(found.numbers, found.jacobian, [], found.margin)
        return found

    def reference(self, scene: Scene) -> "BarRuns | None":
        """The same by other pieces, where a start is cut; else they have no error but rounding."""
        row = isinstance(self.chosen.numbers, RowNumbers)
        return replace(self, pieces=OTHER_ROW) if row and exact_row(scene).sampled else None


def _one(scene: Scene, times: Floats, elements: int) -> _Followed:
    """A bar before a wall."""
    bar, exact = scene.bar, exact_bar(scene)
    positions = np.linspace(0.0, bar.length, elements + 1)
    motion = exact_motion(exact, bar, scene.axial_gravity, times, positions, 1)
    (wall,) = scene.obstacles
    section = bar.section
    pushed = [-section * float(exact.force_integral(0.0, t)) for t in times]
    return _Followed(
        RowMotion.of_one(motion, bar, wall.name), [exact.contacts], np.array(pushed)[:, None],
        [section * exact.largest_force],
        lambda _, t: float(exact.mean_velocity(np.array([0.0, t]))[-1]),
        section * motion.end_work,
    )  # fmt: skip


def _row(scene: Scene, times: Floats, elements: Sequence[int], cut: int) -> _Followed:
    """Bars in a row, with starts that are no lines in so many pieces."""
    exact = exact_row(scene, pieces=cut)
    pairs = range(len(exact.contacts))
    return _Followed(
        exact_row_motion(scene, exact, times, elements, 1), exact.contacts,
        of_pairs([exact.impulse(j, times) for j in pairs], len(times)),
        [exact.largest_force(j) for j in pairs],
        lambda k, t: float(exact.mean_velocity(k, t)),
        0.0,
    )  # fmt: skip


def _rebound(scene: Scene, found: _Followed, k: int) -> float:
    """Speed of a bar's centre where its last contact ends; NaN if there was none, or it lasts."""
    before = k - 1 if len(found.contacts) < len(scene.bars) else k  # pair at its near end
    spells = [found.contacts[j] for j in (before, before + 1) if 0 <= j < len(found.contacts)]
    ends = [end for each in spells for _, end in each]
    last = max(ends, default=scene.duration)
    return abs(found.speed(k, last)) if last < scene.duration else float("nan")


def reader(
    outcome: Callable[[Scene, Floats], Outcome], changes: Changes, quantities: Quantities
) -> Callable[[Floats], Floats]:
    """What reads the numbers of runs from values of the unknowns."""

    def read(values: Floats) -> Floats:
        scene = changes.at(values)
        return quantities.read(outcome(scene, quantities.times), scene)

    return read


def differences(changes: Changes, read: Callable[[Floats], Floats]) -> Slopes:
    """Numbers of a run and their derivatives, by differences over neighbours on both sides.

    Of many unknowns both sides are compared along one direction in which all of them change, and
    one by one only where they disagree.

    Args:
        changes: The place, and the sizes of steps.
        read: Numbers of the run at some values.
    """
    beside = _Beside(changes, read)
    count = len(changes.values)
    if count > _FEW:
        way = np.random.default_rng(0).standard_normal(count) * changes.scales
        both, size = beside.sides(way / np.sqrt(count))
        slopes = None if len(both) < 2 or apart(both, size) else beside.central()
        if slopes is not None:
            return Slopes(beside.numbers, slopes, [])
    below, above = np.zeros((2, len(beside.numbers), count))
    kinked = False
    for k, size in enumerate(changes.scales):
        sides, moved = beside.sides(size * np.eye(count)[k])
        if not sides:
            why = f"{changes.names[k]}: there is no scene beside its value, so no derivative: "
            raise SceneError(f"{why}{beside.refused}")
        above[:, k], below[:, k] = sides[0] / size, sides[-1] / size
        kinked |= len(sides) == 2 and apart(sides, moved)
    return Slopes.of_sides(beside.numbers, below, above, kinked=kinked)


class _Beside:
    """Numbers of neighbours of a run, and differences over them.

    Attributes:
        numbers: Of the run itself.
        refused: Why the last neighbour that is none cannot be.
    """

    def __init__(self, changes: Changes, read: Callable[[Floats], Floats]) -> None:
        self._changes, self._read = changes, read
        self.numbers, self.refused = read(changes.values), ""

    def _at(self, change: Floats) -> Floats | None:
        """Numbers of a neighbour; None where there is none."""
        try:
            return self._read(self._changes.values + change)
        except SceneError as error:
            self.refused = str(error)
            return None

    def sides(self, way: Floats) -> tuple[list[Floats], float]:
        """Derivatives along a direction on each of its sides where there are neighbours.

        Differences over a step and its half, extrapolated; and the largest of those over a step,
        to whose rounding derivatives that vanish are known.
        """
        found, largest = [], 0.0
        for sign in (1.0, -1.0):
            h = sign * _STEP
            far, near = self._at(h * way), self._at(0.5 * h * way)
            if far is not None and near is not None:
                found.append((4.0 * near - far - 3.0 * self.numbers) / h)
                largest = max(largest, float(np.abs(far - self.numbers).max() / _STEP))
        return found, largest

    def central(self) -> Floats | None:
        """Derivatives (n, P) by one neighbour on each side; None where one is missing."""
        slopes = np.zeros((len(self.numbers), len(self._changes.values)))
        for k, size in enumerate(self._changes.scales):
            way = np.zeros(slopes.shape[1])
            way[k] = _STEP * size
            far, near = self._at(way), self._at(-way)
            if far is None or near is None:
                return None
            slopes[:, k] = (far - near) / (2.0 * way[k])
        return slopes


def apart(sides: Sequence[Floats], size: float = 0.0) -> bool:
    """Whether derivatives on both sides disagree, beyond the rounding of differences of a size."""
    one, other = sides
    return bool(np.abs(one - other).max() > _KINK * max(size, np.abs(sides).max()))
