"""States of a bar at chosen times, by exact integration of discontinuous fields along slices."""

from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.spacetime.waves import Field

_ON_NODE = 16.0 * float(np.finfo(float).eps)  # share of the duration: nodes so near lie on a slice
_CHUNK = 400_000  # pieces of slices that are treated together


@dataclass(frozen=True)
class Slices:
    """States of the bar at some times, dimensionless t and x, displacements in metres.

    Attributes:
        stretch: u(t, x_j) - u(t, 0) [m], shape (kept, positions).
        velocity: V(t, x_j) [m], shape (kept, positions).
        kinetic: Integral of V^2 / 2 over x [m^2], shape (times,).
        elastic: Integral of S^2 / 2.
        mean_stretch: Mean of u(t, x) - u(t, 0) [m].
        mean_velocity: Mean of V [m].
    """

    stretch: Floats
    velocity: Floats
    kinetic: Floats
    elastic: Floats
    mean_stretch: Floats
    mean_velocity: Floats


def slice_states(
    field: Field, arriving: Floats, leaving: Floats, times: Floats, kept: Integers,
    positions: Floats,
) -> Slices:  # fmt: skip
    """Integrate along slices t = const, at t just before each time.

    u(t, x) - u(t, 0) is the integral of S from 0 to x. All integrals are exact for the discrete
    fields (Gauss's rule on each piece of a slice in a triangle).

    Args:
        field: The polynomials.
        arriving: r = V + S, shape (cells, dofs).
        leaving: q = V - S.
        times: Increasing, > 0, shape (times,).
        kept: Rows of ``times`` for which fields are wanted.
        positions: Increasing, in [0, 1].
    """
    sums = np.zeros((4, len(times)))
    stretch = np.zeros((len(kept), len(positions)))
    velocity = np.zeros_like(stretch)
    wanted = np.full(len(times), -1)
    wanted[kept] = np.arange(len(kept))
    waves = np.stack([arriving, leaving])
    corners = _on_slices(field, times)
    # Rows of the times in (earliest corner, latest corner] of each cell.
    first = np.searchsorted(times, corners[:, :, 0].min(axis=1), side="right")
    last = np.searchsorted(times, corners[:, :, 0].max(axis=1), side="right")
    crossed = np.cumsum(np.bincount(first, minlength=len(times) + 1)) - np.cumsum(
        np.bincount(last, minlength=len(times) + 1)
    )
    bounds = np.concatenate([[0], np.cumsum(crossed[: len(times)])])
    start = 0
    while start < len(times):
        stop = int(np.searchsorted(bounds, bounds[start] + _CHUNK))
        stop = max(start + 1, min(stop, len(times)))
        chunk = _Pieces.cut(corners, times, first, last, start, stop)
        sums[:, start:stop] = chunk.integrals(field, waves, stop - start)
        rows = np.flatnonzero(wanted[start:stop] >= 0)
        if len(rows):
            at = wanted[start + rows]
            stretch[at], velocity[at] = chunk.fields(field, waves, rows, positions)
        start = stop
    return Slices(stretch, velocity, sums[0], sums[1], sums[2], sums[3])


def _on_slices(field: Field, times: Floats) -> Floats:
    """Corners of the cells, those beside a slice put on it, shape (cells, 3, 2).

    All cells that share a node then agree on which side of a slice it lies.
    """
    corners: Floats = field.corners.copy()
    t = corners[:, :, 0]
    after = np.searchsorted(times, t)
    for slot in (np.maximum(after - 1, 0), np.minimum(after, len(times) - 1)):
        near = np.abs(t - times[slot]) <= _ON_NODE * field.duration
        t[near] = times[slot][near]
    return corners


@dataclass(frozen=True)
class _Pieces:
    """Pieces of slices, ordered by slice and then by position.

    Attributes:
        row: Slice of each piece, from 0 on.
        cell: Triangle.
        time: Its time.
        low: Smaller x of the piece.
        high: Larger x.
    """

    row: Integers
    cell: Integers
    time: Floats
    low: Floats
    high: Floats

    @classmethod
    def cut(
        cls, corners: Floats, times: Floats, first: Integers, last: Integers, start: int, stop: int
    ) -> "_Pieces":
        """Cut the triangles at the times of some rows."""
        begin, end = np.maximum(first, start), np.minimum(last, stop)
        count = np.maximum(end - begin, 0)
        cell = np.repeat(np.arange(len(count)), count)
        offset = np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
        row = begin[cell] + offset
        time = times[row]
        corner = corners[cell]
        above = corner[:, :, 0] - time[:, None]
        low, high = np.full(len(cell), np.inf), np.full(len(cell), -np.inf)
        for a, b in ((0, 1), (1, 2), (2, 0)):
            ta, tb, xa, xb = above[:, a], above[:, b], corner[:, a, 1], corner[:, b, 1]
            # Always from the same end, so that both triangles of an edge find the same point.
            swap = (xa > xb) | ((xa == xb) & (ta > tb))
            ta, tb = np.where(swap, tb, ta), np.where(swap, ta, tb)
            xa, xb = np.where(swap, xb, xa), np.where(swap, xa, xb)
            with np.errstate(divide="ignore", invalid="ignore"):
                x = np.where(
                    ta == 0.0, xa, np.where(tb == 0.0, xb, xa - ta * (xb - xa) / (tb - ta))
                )
            meets = ta * tb <= 0.0
            both = (ta == 0.0) & (tb == 0.0)
            low = np.where(meets, np.minimum(low, x), low)
            high = np.where(meets, np.maximum(high, np.where(both, xb, x)), high)
        order = np.lexsort((high, low, row))
        return cls(row[order] - start, cell[order], time[order], low[order], high[order])

    def _values(
        self, field: Field, waves: Floats, pieces: Integers, low: Floats, high: Floats
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Positions, weights, V and S at Gauss points of parts of pieces, (pieces, points)."""
        nodes, weights = np.polynomial.legendre.leggauss(field.degree + 2)
        half = 0.5 * (high - low)[:, None]
        x = low[:, None] + half * (1.0 + nodes)
        points = np.stack([np.broadcast_to(self.time[pieces, None], x.shape), x], axis=2)
        cells = self.cell[pieces]
        phi = field.basis(cells, points)
        r, q = (np.einsum("epd,ed->ep", phi, wave[cells]) for wave in waves)
        return x, half * weights, 0.5 * (r + q), 0.5 * (r - q)

    def integrals(self, field: Field, waves: Floats, rows: int) -> Floats:
        """Kinetic and elastic energy, mean stretch and mean velocity, shape (4, rows)."""
        every = np.arange(len(self.row))
        x, weights, v, s = self._values(field, waves, every, self.low, self.high)
        integrands = (0.5 * v * v, 0.5 * s * s, (1.0 - x) * s, v)
        return np.stack(
            [
                np.bincount(self.row, weights=(weights * f).sum(axis=1), minlength=rows)
                for f in integrands
            ]
        )

    def fields(
        self, field: Field, waves: Floats, rows: Integers, positions: Floats
    ) -> tuple[Floats, Floats]:
        """Stretch and velocity at positions in some rows, each (rows, positions)."""
        every = np.arange(len(self.row))
        _, weights, _, s = self._values(field, waves, every, self.low, self.high)
        total = (weights * s).sum(axis=1)
        begins = np.searchsorted(self.row, rows)
        ends = np.searchsorted(self.row, rows, side="right")
        stretch = np.empty((len(rows), len(positions)))
        velocity = np.empty_like(stretch)
        for k, (begin, end) in enumerate(zip(begins, ends, strict=True)):
            # Sums per slice, not differences of one long sum: they keep their digits.
            before = np.concatenate([[0.0], np.cumsum(total[begin:end])])
            inside = np.searchsorted(self.low[begin:end], positions, side="right") - 1
            inside = np.clip(inside, 0, end - begin - 1)
            piece = begin + inside
            _, part, _, s = self._values(field, waves, piece, self.low[piece], positions)
            stretch[k] = before[inside] + (part * s).sum(axis=1)
            velocity[k] = self._at(field, waves, piece, positions)
        return stretch, velocity

    def _at(self, field: Field, waves: Floats, pieces: Integers, positions: Floats) -> Floats:
        """V at one position in each piece."""
        cells = self.cell[pieces]
        points = np.stack([self.time[pieces], positions], axis=1)[:, None]
        phi = field.basis(cells, points)[:, 0]
        return np.asarray(0.5 * np.einsum("ed,wed->e", phi, waves[:, cells]))
