"""What drives the far end of an exact bar: a force on it, or a motion that it is given.

A wave q = u_t - c u_x that runs to the free end of a bar with the force F comes back as
r = u_t + c u_x = q + 2 f, f = F / (rho A c); from an end that moves with U(t) as r = -q + 2 f,
f = U'.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from impactfem.exact.initial import sample
from impactfem.exact.pieces import Array

_PIECES = 8  # of a smooth part in a transit, to begin with
_LEAST, _MOST = 4, 512


@dataclass(frozen=True, slots=True)
class EndDrive:
    """Speed f(t) that a driven end gives to the waves: linear in pieces, 0 before them.

    It stays what it is at their end, which is the last time asked for: waves are told right of a
    time, where they jump.

    Attributes:
        times: (n + 1,) borders of the pieces, from 0 on [s].
        values: (n, 2) speed at both ends of each piece [m/s].
        error: estimate of the largest error that the pieces leave of its integral [m].
    """

    times: Array
    values: Array
    error: float = 0.0

    @classmethod
    def sampled(
        cls,
        speed: Callable[[Array], ArrayLike],
        stops: Sequence[tuple[float, float]],
        *,
        duration: float,
        transit: float,
        tolerance: float,
    ) -> "EndDrive":
        """Take a function in pieces: linear ones as they are, others as short as it needs.

        Args:
            speed: f(t) [m/s], of arrays.
            stops: times just before and just after each jump or kink [s], in order.
            duration: end of the last piece [s].
            transit: L/c [s].
            tolerance: error of the integral in each smooth part, relative to the largest speed
                over a transit.
        """
        starts = np.array([0.0, *(after for _, after in stops)])
        ends = np.array([*(before for before, _ in stops), duration])
        apart = ends > starts
        starts, ends = starts[apart], ends[apart]
        places = starts[:, None] + (ends - starts)[:, None] * np.linspace(0.0, 1.0, _PIECES + 1)
        values = np.asarray(speed(np.minimum(places, ends[:, None])), dtype=float)
        sizes = np.abs(values + np.zeros_like(places)).max(axis=1)
        parts, error = [], 0.0
        for start, end, size in zip(starts, ends, sizes, strict=True):
            width = end - start

            def within(x: Array, start: float = start, end: float = end) -> ArrayLike:
                return speed(np.minimum(start + x, end))

            count = min(_MOST, max(_LEAST, round(_PIECES * width / transit)))
            allowed = tolerance * min(1.0, transit / width) * (sizes.max() / size if size else 1.0)
            part = sample(width, 1.0, np.zeros_like, within, count, allowed)
            parts.append((start + part.nodes[:-1], part.velocity))
            error = max(error, part.error)
        times = np.concatenate([*(nodes for nodes, _ in parts), [duration]])
        return cls(times, np.concatenate([values for _, values in parts]), error)

    def around(self, start: float, end: float, origin: float) -> "EndDrive":
        """The pieces that matter in [start, end], with times counted from `origin`."""
        low = max(int(self.times.searchsorted(start, side="right")) - 1, 0)
        high = min(int(self.times.searchsorted(end)), len(self.values))
        return EndDrive(self.times[low : high + 1] - origin, self.values[low:high])

    def ends(self, borders: Array) -> Array:
        """Values at both ends of pieces between (m + 1,) borders that hold all its own, (m, 2)."""
        if not len(self.values):
            return np.zeros((len(borders) - 1, 2))
        middle = 0.5 * (borders[1:] + borders[:-1])
        i = np.clip(np.searchsorted(self.times, middle) - 1, 0, len(self.values) - 1)
        inside = middle > self.times[0]
        share = np.stack([borders[:-1], borders[1:]], axis=-1) - self.times[i, None]
        share = np.clip(share / (self.times[i + 1] - self.times[i])[:, None], 0.0, 1.0)
        first, last = self.values[i, :1], self.values[i, 1:]
        found: Array = np.where(inside[:, None], first + share * (last - first), 0.0)
        return found
