"""Lines of a space-time mesh: characteristics through events, and times at which a load jumps."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from impactfem.arrays import Floats
from impactfem.errors import MeshError
from impactfem.mesh.unstructured import Lines

MERGED = 1e-9
"""Dimensionless distance within which characteristics, times and points are taken for one."""

MAX_LINES = 4000
"""Most straight lines that are put into a mesh."""

_PERIOD = 2.0  # dimensionless time from the wall to the far end and back


@dataclass(frozen=True)
class Front:
    """Origin of a characteristic (c t / L, x / L), and whether it leaves the wall (1) or not (-1).

    From there it runs to and fro between the ends of the bar.
    """

    time: float
    position: float
    direction: int = 1

    @property
    def phase(self) -> float:
        """Its times at the wall modulo the period."""
        return (self.time - self.direction * self.position) % _PERIOD


def distinct(fronts: list[Front]) -> list[Front]:
    """Of fronts that run on the same characteristic keep the one that starts first."""
    kept: list[Front] = []
    for front in sorted(fronts, key=lambda f: f.time):
        if not any(same_phase(front.phase, other.phase) for other in kept):
            kept.append(front)
    return kept


def same_phase(a: float, b: float) -> bool:
    """Whether two phases agree but for rounding."""
    apart = abs(a - b) % _PERIOD
    return min(apart, _PERIOD - apart) <= MERGED


def time_lines(times: Floats, end: float) -> Lines:
    """Lines t = const inside the rectangle."""
    return fitted_lines([], times, end)


def fitted_lines(fronts: list[Front], times: Floats, end: float) -> Lines:
    """Characteristics from fronts and lines t = const, cut at all their crossings.

    Args:
        fronts: Where characteristics start.
        times: Dimensionless times of lines t = const; those outside (0, end) are left out.
        end: Dimensionless duration.

    Raises:
        MeshError: There are too many lines.
    """
    straight = np.array(_straight(distinct(fronts), end)).reshape(-1, 4)
    cuts = np.unique(times[(times > MERGED) & (times < end - MERGED)])
    if len(straight) + len(cuts) > MAX_LINES:
        raise MeshError(
            f"{len(straight)} characteristics of impacts and releases up to the end of the scene "
            f"are too many for a fitted mesh (limit {MAX_LINES}); shorten the duration, or use "
            "fitted = false or a layered method"
        )
    places = [_crossings(straight, cuts, k) for k in range(len(straight))]
    kind, offset, low, high = straight.T
    for cut in cuts:
        at = kind * (cut - offset)
        at = at[(at >= low - MERGED) & (at <= high + MERGED)]
        x = np.unique(np.concatenate([[0.0, 1.0], np.clip(at, 0.0, 1.0)]))
        places.append(np.stack([np.full(len(x), cut), x], axis=1))
    return _graph(places, end)


def _straight(fronts: list[Front], end: float) -> list[tuple[int, float, float, float]]:
    """Straight parts (direction, t - direction x, smallest and largest x) of fronts."""
    parts = []
    for front in fronts:
        direction, offset = front.direction, front.time - front.direction * front.position
        begin = front.position
        while True:
            stop = 1.0 if direction == 1 else 0.0
            if offset + direction * stop > end:
                stop = direction * (end - offset)
            if direction * (stop - begin) > MERGED:
                parts.append((direction, offset, min(begin, stop), max(begin, stop)))
            if offset + direction * (1.0 if direction == 1 else 0.0) >= end - MERGED:
                break
            # From the far end at offset + 1 back to the wall at offset + 2, and on from there.
            offset, begin = (offset + _PERIOD, 1.0) if direction == 1 else (offset, 0.0)
            direction = -direction
    return parts


def _crossings(straight: Floats, cuts: Floats, k: int) -> Floats:
    """Points on one straight part: its ends and its crossings, in the order of x."""
    direction, offset, low, high = straight[k]
    other = straight[straight[:, 0] != direction]
    at = direction * 0.5 * (other[:, 1] - offset)
    meets = (at >= np.maximum(low, other[:, 2]) - MERGED) & (
        at <= np.minimum(high, other[:, 3]) + MERGED
    )
    at_cuts = direction * (cuts - offset)
    inside = at_cuts[(at_cuts > low) & (at_cuts < high)]
    places = np.unique(np.concatenate([[low, high], np.clip(at[meets], low, high), inside]))
    return np.stack([offset + direction * places, places], axis=1)


def _graph(places: list[Floats], end: float) -> Lines:
    """Join points that coincide and number the pieces between neighbours on each line."""
    if not places:
        return Lines(np.empty((0, 2)), np.empty((0, 2), dtype=np.int64))
    points = np.concatenate(places)
    for axis, value in ((0, 0.0), (0, end), (1, 0.0), (1, 1.0)):
        points[np.abs(points[:, axis] - value) <= 2.0 * MERGED, axis] = value
    same = np.arange(len(points))
    pairs = np.sort(cKDTree(points).query_pairs(4.0 * MERGED, output_type="ndarray"), axis=1)
    for a, b in pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]:
        same[b] = min(same[a], same[b])
    for _ in range(4):
        same = same[same]
    used, number = np.unique(same, return_inverse=True)
    segments, first = [], 0
    for part in places:
        chain = number[first : first + len(part)]
        segments.append(np.stack([chain[:-1], chain[1:]], axis=1))
        first += len(part)
    pairs = np.sort(np.concatenate(segments), axis=1)
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    place = points[used]
    a, b = place[pairs[:, 0]], place[pairs[:, 1]]
    on_side = ((a[:, 0] == b[:, 0]) & np.isin(a[:, 0], (0.0, end))) | (
        (a[:, 1] == b[:, 1]) & np.isin(a[:, 1], (0.0, 1.0))
    )
    return Lines(place, pairs[~on_side].astype(np.int64))
