"""Functions of time in pieces: loads constant, waves linear between breakpoints; integrals."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

type Array = NDArray[np.float64]

_BATCH = 64  # times whose integrals over the bar are formed together
_ALWAYS, _ZERO = np.array([-np.inf]), np.zeros(1)


@dataclass(frozen=True, slots=True)
class Load:
    """Acceleration p(t) towards the wall, constant between jumps and 0 before t = 0.

    Attributes:
        times: (n,) jumps [s], the first -inf.
        values: (n,) value from each time on [m/s^2], the first 0.
    """

    times: Array
    values: Array

    @classmethod
    def from_steps(cls, times: Array, values: Array) -> "Load":
        """Load with `values` from `times` on (the first 0.0); jumps of nothing are left out."""
        t, p = np.r_[-np.inf, times], np.r_[0.0, values]
        keep = np.r_[True, np.diff(p) != 0.0]
        return cls(t[keep], p[keep])

    def moments(self, start: Array, width: Array) -> tuple[Array, Array]:
        """Integrals of p and of (start + width - t) p over [start, start + width], elementwise.

        They are summed from jump to jump: differences of antiderivatives would lose the digits
        of (T / transit time)^2.
        """
        start, width = np.broadcast_arrays(start, width)
        last = len(self.times) - 1
        if last == 0:
            return self.values[0] * width, 0.5 * self.values[0] * width * width
        zeroth, first = np.zeros(start.shape), np.zeros(start.shape)
        i, low = np.searchsorted(self.times, start, side="right") - 1, np.zeros(start.shape)
        until = np.r_[self.times[1:], np.inf]
        while True:
            high = np.minimum(width, until[i] - start)
            part = self.values[i] * (high - low)
            zeroth = zeroth + part
            first = first + part * (width - 0.5 * (low + high))
            if np.all(high >= width):
                return zeroth, first
            low, i = high, np.minimum(i + 1, last)

    def around(self, start: float, end: float, origin: float) -> "Load":
        """The part that matters in [start, end], with times counted from `origin`."""
        low = int(self.times.searchsorted(start, side="right")) - 1
        high = int(self.times.searchsorted(end))
        if high <= low + 1:
            return Load(_ALWAYS, self.values[low : low + 1])
        return Load(
            np.concatenate([_ALWAYS, self.times[low + 1 : high] - origin]), self.values[low:high]
        )


@dataclass(slots=True)
class Line:
    """Piecewise linear function over one window: borders (n+1), values right and left of them.

    Lists: most windows have a few pieces, for which arrays take ten times as long.
    """

    border: list[float]
    left: list[float]
    right: list[float]

    def split(self, cuts: Array, snap: float) -> "Line":
        """The same function with further breakpoints, save those next to present ones."""
        x = np.array(self.border)
        cuts = np.sort(cuts)
        cuts = cuts[np.diff(cuts, prepend=-np.inf) > snap]
        i = np.searchsorted(x, cuts)
        inside = (i > 0) & (i < len(x))
        cuts, i = cuts[inside], i[inside]
        cuts = cuts[(cuts - x[i - 1] > snap) & (x[i] - cuts > snap)]
        if len(cuts) == 0:
            return self
        border = np.sort(np.r_[x, cuts])
        i = np.searchsorted(x, border[:-1], side="right") - 1
        low, width = x[i], np.diff(x)[i]
        a, b = (border[:-1] - low) / width, (border[1:] - low) / width
        left, right = np.array(self.left)[i], np.array(self.right)[i]
        first, last = (1 - a) * left + a * right, (1 - b) * left + b * right
        return Line(border.tolist(), first.tolist(), last.tolist())

    def merge(self, tolerance: float) -> "Line":
        """Without breakpoints at which neither value nor slope jumps.

        Of neighbouring breakpoints one stays (until the next window), so that deviations
        below the tolerance cannot add up along a smooth curve.
        """
        x, left, right = self.border, self.left, self.right
        dropped: list[int] = []
        for j in range(1, len(left)):
            share = (x[j] - x[j - 1]) / (x[j + 1] - x[j - 1])
            chord = (1 - share) * left[j - 1] + share * right[j]
            off = max(abs(right[j - 1] - chord), abs(left[j] - chord))
            if off <= tolerance and (not dropped or dropped[-1] != j - 1):
                dropped.append(j)
        if not dropped:
            return self
        x, left, right = x.copy(), left.copy(), right.copy()
        for j in reversed(dropped):
            del x[j], left[j], right[j - 1]
        return Line(x, left, right)

    def coarsen(self, limit: int) -> "Line":
        """At most `limit` pieces: neighbours that differ least become one linear piece.

        It has the integral of both (so the momentum stays) and that of their square (so does
        the energy), and rises as their L2 mean line does.
        """
        x, left, right = np.array(self.border), np.array(self.left), np.array(self.right)
        while (excess := len(left) - limit) > 0:
            h, m, d = np.diff(x), 0.5 * (left + right), right - left
            share = h[1:] / (h[:-1] + h[1:])
            rest = 1.0 - share
            mean = rest * m[:-1] + share * m[1:]
            fitted = 6 * share * rest * np.diff(m) + rest**2 * d[:-1] + share**2 * d[1:]
            variance = rest * ((m[:-1] - mean) ** 2 + d[:-1] ** 2 / 12)
            variance += share * ((m[1:] - mean) ** 2 + d[1:] ** 2 / 12)
            loss = (h[:-1] + h[1:]) * (variance - fitted**2 / 12)
            rise = np.copysign(np.sqrt(12 * variance), fitted)
            least = np.r_[True, loss[1:] < loss[:-1]] & np.r_[loss[:-1] <= loss[1:], True]
            pairs = np.flatnonzero(least)
            pairs = pairs[np.argsort(loss[pairs], kind="stable")[:excess]]
            left, right = left.copy(), right.copy()
            left[pairs], right[pairs + 1] = (mean - rise / 2)[pairs], (mean + rise / 2)[pairs]
            left, right = np.delete(left, pairs + 1), np.delete(right, pairs)
            x = np.delete(x, pairs + 1)
        return Line(x.tolist(), left.tolist(), right.tolist())


def integrate(
    times: Array,
    breaks: Array,
    reach: float,
    integrands: Callable[[Array, Array], tuple[Array, ...]],
) -> Array:
    """Integrals over y in [0, reach] of functions f(t, y), for each of (n,) times, n > 0.

    Exact (two Gauss points a piece) if they are cubic in y wherever neither t + y nor t - y
    passes one of the sorted `breaks`. Returns one row per function.
    """
    at = np.searchsorted(breaks, np.stack([times - reach, times + reach]))
    sums: list[Array] = []
    for first in range(0, len(times), _BATCH):
        places: list[Array] = []
        for k in range(first, min(first + _BATCH, len(times))):
            cut = np.abs(breaks[at[0, k] : at[1, k]] - times[k])
            places.append(np.sort(np.concatenate([_ZERO, cut[cut < reach], [reach]])))
        counts = np.array([len(p) - 1 for p in places])
        width = np.concatenate([np.diff(p) for p in places])
        middle = np.concatenate([0.5 * (p[1:] + p[:-1]) for p in places])
        when = np.repeat(times[first : first + _BATCH], counts)
        shift = width / np.sqrt(12.0)
        values = np.array(integrands(when, middle - shift))
        values += np.array(integrands(when, middle + shift))
        starts = np.r_[0, np.cumsum(counts)[:-1]]
        sums.append(np.add.reduceat(0.5 * width * values, starts, axis=1))
    return np.concatenate(sums, axis=1)
