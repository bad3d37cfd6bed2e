"""Tables in formulas: straight pieces one after the other, of which there may be thousands."""

from bisect import bisect_right
from functools import cached_property
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats


class Table:
    """A function in straight pieces, one more than the places between them.

    A place belongs to the piece that begins there. Tables of the same pieces are equal.

    Attributes:
        places: Where one piece ends and the next begins, ascending (n,).
        values, slopes: Of the pieces at their origins (n + 1,).
        origins: (n + 1,).
    """

    def __init__(self, places: Floats, values: Floats, slopes: Floats, origins: Floats) -> None:
        """Take them."""
        self.places, self.values, self.slopes, self.origins = places, values, slopes, origins
        self._key = b"".join(each.tobytes() for each in (places, values, slopes, origins))

    @classmethod
    def of(cls, places: Floats, values: Floats, slopes: Floats, origins: Floats) -> "Table":
        """A table without places at which nothing changes."""
        flat = (slopes[1:] == 0.0) & (slopes[:-1] == 0.0)
        changes = ~flat | (values[1:] != values[:-1])
        kept = np.append(True, changes)
        return cls(places[changes], values[kept], slopes[kept], origins[kept])

    @classmethod
    def through(cls, places: Floats, values: Floats) -> "Table":
        """Straight from each of (n,) values to the next; the outer pieces go on outside."""
        slopes = np.diff(values) / np.diff(places)
        return cls.of(places[1:-1], values[:-1], slopes, places[:-1])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Table) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)  # which bytes keep

    def __call__(self, x: Any) -> Any:
        """Values at some places, of their shape."""
        piece = np.searchsorted(self.places, x, side="right")
        return self.values[piece] + self.slopes[piece] * (x - self.origins[piece])

    def at(self, x: float) -> float:
        """Value at one place."""
        places, values, slopes, origins = self._lists
        piece = bisect_right(places, x)
        return values[piece] + slopes[piece] * (x - origins[piece])

    @cached_property
    def _lists(self) -> tuple[list[float], list[float], list[float], list[float]]:
        """The numbers for `at`, which is faster with lists."""
        return (
            self.places.tolist(), self.values.tolist(), self.slopes.tolist(), self.origins.tolist()
        )  # fmt: skip

    def slope(self, x: Any) -> Any:
        """Slopes at some places, of their shape."""
        return self.slopes[np.searchsorted(self.places, x, side="right")]

    # Intervals

    def breaks(self, low: Floats, high: Floats) -> Booleans:
        """On which closed intervals (k,) there is a place between pieces."""
        first, last = self._touched(low, high)
        return np.asarray(last > first)

    def bounds(self, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """Least and largest values on closed intervals (k,)."""
        first, last = self._touched(low, high)
        edges = np.concatenate([self.places, [np.inf]])
        ends = np.minimum(high, edges[first])
        begins = np.maximum(low, np.append(-np.inf, edges)[last])
        sides = np.array([
            self.values[piece] + self.slopes[piece] * (x - self.origins[piece])
            for piece, x in ((first, low), (first, ends), (last, begins), (last, high))
        ])  # fmt: skip
        least, most = sides.min(axis=0), sides.max(axis=0)
        inner = last - first - 1
        if (wide := inner > 0).any():
            # The least of a row of pieces is that of two rows of 2**k that cover it.
            level = np.frexp(inner[wide])[1] - 1
            one, other = first[wide] + 1, last[wide] - (1 << level)
            for k in np.unique(level):
                these = np.flatnonzero(wide)[level == k]
                lows, highs = self._rows[k]
                for at in (one[level == k], other[level == k]):
                    least[these] = np.minimum(least[these], lows[at])
                    most[these] = np.maximum(most[these], highs[at])
        return least, most

    def mean(self, low: Floats, high: Floats) -> Floats:
        """Means from some places to others, of their shape; where these are one, the value."""
        # A place at the end of an interval counts for nothing, that of an empty one does.
        first = np.searchsorted(self.places, low, side="right")
        last = np.maximum(np.searchsorted(self.places, high, side="left"), first)
        whole = self._amid(first, low, high)
        if not (last > first).any():
            return whole
        edges = np.append(self.places, np.inf)
        ends, begins = edges[first], edges[last - 1]
        with np.errstate(invalid="ignore", divide="ignore"):  # of intervals in one piece
            inner = self._sums[last - 1] - self._sums[np.minimum(first, len(self.places) - 1)]
            sides = (ends - low) * self._amid(first, low, ends)
            sides = sides + (high - begins) * self._amid(last, begins, high)
            return np.asarray(np.where(last > first, (sides + inner) / (high - low), whole))

    def _amid(self, piece: Any, low: Floats, high: Floats) -> Floats:
        """Values of pieces amid two places."""
        middle = 0.5 * (low - self.origins[piece]) + 0.5 * (high - self.origins[piece])
        return np.asarray(self.values[piece] + self.slopes[piece] * middle)

    @cached_property
    def _sums(self) -> Floats:
        """Integrals from the first place to each (n,)."""
        ends = self.places[:-1], self.places[1:]
        each = (ends[1] - ends[0]) * self._amid(np.arange(1, len(self.places)), *ends)
        return np.append(0.0, np.cumsum(each))[: len(self.places)]

    def _touched(self, low: Floats, high: Floats) -> tuple[Any, Any]:
        """First and last piece on closed intervals."""
        first = np.searchsorted(self.places, low, side="left")
        return first, np.searchsorted(self.places, high, side="right")

    @cached_property
    def _rows(self) -> list[tuple[Floats, Floats]]:
        """Least and largest values of each 2**k pieces in a row, by k and the first of them."""
        edges = np.array([self.places[:-1], self.places[1:]])
        inner = slice(1, -1)
        sides = self.values[inner] + self.slopes[inner] * (edges - self.origins[inner])
        # The outer pieces, which have one end only, are never inner ones.
        low = np.concatenate([[np.inf], sides.min(axis=0), [np.inf]])
        high = np.concatenate([[-np.inf], sides.max(axis=0), [-np.inf]])
        found, width = [(low, high)], 1
        while 2 * width <= len(self.values):
            low = np.minimum(low[:-width], low[width:])
            high = np.maximum(high[:-width], high[width:])
            found.append((low, high))
            width *= 2
        return found

    # Other libraries

    def compared(self, operand: Any) -> Any:
        """The same as a node of comparisons that halve the pieces, for libraries without tables."""

        def halved(first: int, last: int) -> Any:
            if last == first:
                return self._piece(first, operand)
            middle = (first + last) // 2
            test = ("call", "lt", (operand, float(self.places[middle])))
            return ("call", "where", (test, halved(first, middle), halved(middle + 1, last)))

        return halved(0, len(self.places))

    def _piece(self, index: int, operand: Any) -> Any:
        value, slope, origin = (
            float(each[index]) for each in (self.values, self.slopes, self.origins)
        )
        if slope == 0.0:
            return value
        since = ("chain", operand, (("Sub", origin),))
        return ("chain", value, (("Add", ("chain", slope, (("Mult", since),))),))
