"""A motion that was found: numbers at nodes, and the control between them."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from impactfem.arrays import Floats


@dataclass(frozen=True)
class Motion:
    """States at nodes, controls between them.

    Attributes:
        fractions: Nodes as shares of the duration, from 0 to 1, (N + 1,).
        duration: T [s].
        states: (N + 1, n).
        rates: Of states at nodes, as the left interval's end and the right one's beginning have
            them, (N, 2, n).
        controls: At the beginning, middle and end of each interval, (N, 3, m): a parabola.
        parameters: (q,).
        middles: States amid intervals (N, n); None where the transcription has none.
    """

    fractions: Floats
    duration: float
    states: Floats
    rates: Floats
    controls: Floats
    parameters: Floats
    middles: Floats | None = None

    @property
    def times(self) -> Floats:
        """Of nodes [s], (N + 1,)."""
        return self.duration * self.fractions

    @property
    def intervals(self) -> int:
        """Number N."""
        return len(self.fractions) - 1

    def spans(self) -> Floats:
        """How far each state moves, (n,)."""
        return np.ptp(self.states, axis=0)

    def control_at(self, shares: Floats) -> Floats:
        """Controls (k, m) at shares of the duration (k,); at a jump, after it."""
        nodes = self.fractions
        which = np.clip(np.searchsorted(nodes, shares, side="right") - 1, 0, self.intervals - 1)
        place = (shares - nodes[which]) / (nodes[which + 1] - nodes[which])
        return parabola(self.controls[which], place[:, None])

    def state_at(self, shares: Floats) -> Floats:
        """States (k, n) at shares of the duration (k,), by cubics."""
        nodes, found = self.fractions, np.empty((len(shares), self.states.shape[1]))
        which = np.clip(np.searchsorted(nodes, shares, side="right") - 1, 0, self.intervals - 1)
        for interval in np.unique(which):
            ends = nodes[interval : interval + 2]
            values = self.states[interval : interval + 2]
            cubic = CubicHermiteSpline(ends, values, self.duration * self.rates[interval])
            found[which == interval] = cubic(shares[which == interval])
        return found


def parabola(controls: Floats, place: Floats) -> Floats:
    """Controls (..., m) at a place in [0, 1] of intervals, from three values (..., 3, m)."""
    left, middle, right = controls[..., 0, :], controls[..., 1, :], controls[..., 2, :]
    bulge = 4.0 * (middle - 0.5 * (left + right))
    return np.asarray(left + place * (right - left) + place * (1.0 - place) * bulge)
