"""Intervals of shooting through impacts, whose derivatives are exact: saltation.

An interval with impacts is flights by Runge and Kutta's method, each as long as until its gap
closes, and the jumps between. When an impact takes place follows from where its flight begins, by
two of Newton's iterates from the time that was found: at a root they change nothing, but their
derivatives are those of the root, up to the second (the first iterate has the first ones right, the
next one those of twice the order). Chain rules of all this are saltation matrices and their
derivatives, with which Ipopt converges as if there were no impacts.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.trajectory.impacts import LOOKS, MOST, first_impact
from impactfem.trajectory.problem import Problem, expanded
from impactfem.trajectory.symbols import loaded
from impactfem.trajectory.transcriptions import runge_kutta

_NEWTON = 2  # iterates, for derivatives up to the second
_KEPT = 4096  # places at which impacts are known


class Struck:
    """Intervals through impacts: (t, x, control at both ends, p, h) to the end, and the cost.

    The number of impacts of each gap is told too: slopes know only of motions that strike alike,
    so that a search is kept to these.

    Args:
        problem: The motion, with its impacts.
    """

    def __init__(self, problem: Problem) -> None:
        casadi = loaded()
        self.problem = problem
        flow = runge_kutta(problem.rate)
        self.sizes = [flow.numel_in(i) for i in range(flow.n_in())]
        t, x, u, slope, p, length = _symbols(self.sizes)
        end = u + length * slope
        self.fly = casadi.Function(
            "fly", [t, x, u, slope, p, length], list(flow(t, x, u, end, p, length))
        )
        gaps = problem.gaps(t + length, flow(t, x, u, end, p, length)[0], end, p)
        self.look = expanded(
            "look", [t, x, u, slope, p, length], [gaps, casadi.jacobian(gaps, length)]
        )
        self.looks = self.look.map("looks", "serial", LOOKS, [0, 1, 2, 3, 4], [])
        self._known: dict[bytes, tuple[Any, Floats] | None] = {}
        self._frozen: dict[tuple[int, ...], list[Any]] = {}
        self.rows = self.sizes[1] + 1 + len(problem.impacts)
        self.counts: list[Any] = []
        self.levels = [_level(self, order) for order in range(3)]

    def __call__(self, *given: Any) -> tuple[Any, Any]:
        """The end and the cost, in symbols."""
        n = self.sizes[1]
        told = self.levels[0](loaded().vertcat(*given))
        self.counts.append(told[n + 1 :])
        return told[:n], told[n]

    def unlike(self, counts: Floats) -> Any:
        """0 where impacts are as many as given (J,) in all intervals, else NaN, in symbols."""
        casadi = loaded()
        off = casadi.sumsqr(sum(self.counts) - counts)
        return casadi.if_else(off > 0.5, np.nan, 0.0)

    def value(self, z: Floats, order: int) -> Any:
        """End, cost and counts (rows,), derivatives of these, or of these by rows; NaN: none.

        Args:
            z: All that is given (k,).
            order: 0, 1 or 2.
        """
        key = z.tobytes()
        if key not in self._known:
            if len(self._known) >= _KEPT:
                self._known.clear()
            self._known[key] = self._located(z)
        found = self._known[key]
        if found is None:
            count = self.rows
            return np.full([(count, 1), (count, len(z)), (count * len(z), len(z))][order], np.nan)
        functions, lengths = found
        return functions(order)(z, lengths)

    def events(self, z: Floats) -> tuple[tuple[int, ...], Floats] | None:
        """What is struck in an interval, and how long the flights before are [s]."""
        t, x, u, ends, p, h = np.split(z, np.cumsum(self.sizes)[:-1])
        slope, rest, struck = (ends - u) / h, float(h[0]), -1
        sequence: list[int] = []
        lengths: list[float] = []
        while len(sequence) <= MOST:

            def look(length: Floats, at: Any = (t, x, u)) -> tuple[Floats, Floats]:
                of = self.look if len(length) == 1 else self.looks
                gaps, rates = of(*at, slope, p, length[None])
                return np.asarray(gaps), np.asarray(rates)

            found = first_impact(look, rest, struck)
            if found is None:
                return tuple(sequence), np.array(lengths)
            length, struck = found
            x = self.fly(t, x, u, slope, p, length)[0]
            t, u, rest = t + length, u + length * slope, rest - length
            x = self.problem.jumps[struck](t, x, u, p)
            if not np.isfinite(np.asarray(x)).all():
                return None
            sequence.append(struck)
            lengths.append(length)
        return None

    def _located(self, z: Floats) -> tuple[Any, Floats] | None:
        found = self.events(z) if np.isfinite(z).all() else None
        if found is None:
            return None
        sequence, lengths = found
        return (lambda order: self._function(sequence, order)), lengths

    def _function(self, sequence: tuple[int, ...], order: int) -> Any:
        """(z, lengths of flights) to what `value` tells, with what is struck as it is."""
        made = self._frozen.setdefault(sequence, [])
        casadi = loaded()
        while len(made) <= order:
            z, lengths = casadi.MX.sym("z", sum(self.sizes)), casadi.MX.sym("s", len(sequence))
            told = self._through(z, lengths, sequence) if not made else made[-1](z, lengths)
            if made:
                told = casadi.jacobian(casadi.vec(told), z)
            made.append(casadi.Function(f"through_{len(made)}", [z, lengths], [told]))
        return made[order]

    def _through(self, z: Any, lengths: Any, sequence: Sequence[int]) -> Any:
        casadi = loaded()
        t, x, u, ends, p, rest = casadi.vertsplit(z, np.cumsum([0, *self.sizes]).tolist())
        slope, cost = (ends - u) / rest, 0
        for place, struck in enumerate(sequence):
            length = lengths[place]
            for _ in range(_NEWTON):
                gaps, rates = self.look(t, x, u, slope, p, length)
                length = length - gaps[struck] / rates[struck]
            x, own = self.fly(t, x, u, slope, p, length)
            t, u, rest, cost = t + length, u + length * slope, rest - length, cost + own
            x = self.problem.jumps[struck](t, x, u, p)
        x, own = self.fly(t, x, u, slope, p, rest)
        counts = np.bincount(np.array(sequence, dtype=int), minlength=len(self.problem.impacts))
        return casadi.vertcat(x, cost + own, casadi.DM(counts.astype(float)))


def _level(struck: Struck, order: int) -> Any:
    """A function of CasADi that finds impacts and asks for derivatives of an order."""
    casadi = loaded()
    count, size = struck.rows, sum(struck.sizes)
    shapes = [(size, 1), (count, 1), (count, size), (count * size, size)]

    class Level(casadi.Callback):  # type: ignore[name-defined]
        """As CasADi wants it: derivatives take what the function below has told, too."""

        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self.construct(f"struck_{order}", {})

        def get_n_in(self) -> int:
            return order + 1

        def get_n_out(self) -> int:
            return max(1, order)

        def get_sparsity_in(self, i: int) -> Any:
            return casadi.Sparsity.dense(*shapes[i])

        def get_sparsity_out(self, i: int) -> Any:
            if i == 0:
                return casadi.Sparsity.dense(*shapes[order + 1])
            return casadi.Sparsity(shapes[2][0] * shapes[2][1], shapes[1][0])  # by what it was told

        def eval(self, given: Sequence[Any]) -> Sequence[Any]:
            told = struck.value(np.asarray(given[0], dtype=float).ravel(), order)
            none = [casadi.DM(self.sparsity_out(1))] if order == 2 else []
            return [casadi.DM(told), *none]

        def has_jacobian(self) -> bool:
            return order < 2

        def get_jacobian(self, *_: Any) -> Any:
            return struck.levels[order + 1]

    return Level()


def _symbols(sizes: Sequence[int]) -> list[Any]:
    return [loaded().MX.sym(name, size) for name, size in zip("txuvph", sizes, strict=True)]
