"""Times of a step between which gaps are cubics, so that none closes and opens unseen.

A flight that no force bends is exact at any length: the integrator's steps grow, and a rod turns
many times in one. Where the cubic through two looks, by the gaps and their rates, misses what is
seen between them, there are more. Looks are at odd shares of a step: a motion that repeats itself
between even ones would look like rest.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from impactfem.arrays import Booleans, Floats

_SHARES = (0.0, 0.11, 0.26, 0.37, 0.49, 0.63, 0.74, 0.89)
_SPLIT = 0.47  # share of an interval at which it is looked at again
_MISS = 1e-3  # of the way of a gap, by which a cubic may miss it
_FAR = 8.0  # times what a cubic misses: gaps that large do not close between looks
_MOST = 10_000  # looks at a step, about
_LEAST = 1e-7  # of a step: kinks are not looked at more closely


class Look(NamedTuple):
    """What is seen at a time.

    Attributes:
        time: [s].
        gaps: (J,).
        rates: Of the gaps (J,).
        guards: What must not fall below 0 in lasting contact.
    """

    time: float
    gaps: Floats
    rates: Floats
    guards: Floats


@dataclass
class Looking:
    """How a step is looked at.

    Attributes:
        look: Looks at a time.
        watched: Which gaps may close (J,).
        doubt: Of the gaps, what they are wrong by anyway (J,).
        least: Shortest interval that is looked at [s].
        left: How many more looks there may be: a function that is rough everywhere has no end.
    """

    look: Callable[[float], Look]
    watched: Booleans
    doubt: Floats
    least: float = 0.0
    left: int = _MOST

    def over(self, start: float, end: float) -> list[Look]:
        """Looks at a step, up to its end or to the first gap that is seen to be closed."""
        first = [self.look(start + s * (end - start)) for s in _SHARES] + [self.look(end)]
        self.least, found = _LEAST * (end - start), first[:1]
        for k in range(0, len(first) - 1, 2):
            for seen in self._between(*first[k : k + 3]):
                found.append(seen)
                if (seen.gaps < 0.0)[self.watched].any():
                    return found
        return found

    def _between(self, one: Look, middle: Look, last: Look) -> Iterator[Look]:
        """Looks behind the first of three, up to the last."""
        short = last.time - one.time <= self.least or self.left <= 0
        if short or self._is_cubic(one, middle, last):
            yield middle
            yield last
            return
        for a, b in ((one, middle), (middle, last)):
            self.left -= 1
            yield from self._between(a, self.look(a.time + _SPLIT * (b.time - a.time)), b)

    def _is_cubic(self, one: Look, middle: Look, last: Look) -> bool:
        """Whether the cubics between two looks tell enough of what is between them."""
        h = last.time - one.time
        s, begin, stop = (middle.time - one.time) / h, h * one.rates, h * last.rates
        rise = last.gaps - one.gaps
        bend, twist = 3.0 * rise - 2.0 * begin - stop, begin + stop - 2.0 * rise
        gap = one.gaps + s * (begin + s * (bend + s * twist))
        rate = begin + s * (2.0 * bend + 3.0 * s * twist)
        wrong = np.abs(rate - h * middle.rates)
        miss = np.maximum(np.abs(gap - middle.gaps), 0.125 * wrong) - self.doubt
        three = np.stack([one.gaps, middle.gaps, last.gaps])
        way = np.maximum(np.ptp(three, axis=0), h * np.abs(middle.rates))
        fits = (miss <= _MISS * way) | (_FAR * miss < three.min(axis=0))
        return bool(fits[self.watched].all())
