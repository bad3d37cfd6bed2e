"""A nonlinear program, collected piece by piece, and its solution by Ipopt."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.trajectory.symbols import loaded

_ACCEPTABLE = "Solved_To_Acceptable_Level"
_DONE = {"Solve_Succeeded", _ACCEPTABLE}
_TOLERANCE = 1e-9  # of first-order conditions, in the sizes of unknowns, rows and cost
_MET = 1e-6  # rows off by more are not met


@dataclass(frozen=True)
class Answer:
    """What Ipopt found.

    Attributes:
        unknowns: In their sizes (w,).
        cost: Its value.
        kkt: Largest of: gradient of the Lagrangian, rows off their limits, and multiplier times
            distance from the limit; in the sizes of unknowns, rows and cost.
        off: Largest distance of a row from its limits, in its size.
        worst: Name of that row.
        iterations: Of Ipopt.
        said: What it returned.
    """

    unknowns: Floats
    cost: float
    kkt: float
    off: float
    worst: str
    iterations: int
    said: str

    @property
    def status(self) -> str:
        """Converged, infeasible, not_converged."""
        if self.said in _DONE and self.off <= _MET:
            return "converged"
        infeasible = "Infeasible" in self.said or "Restoration" in self.said
        return "infeasible" if infeasible or self.off > _MET else "not_converged"

    @property
    def in_words(self) -> str:
        """What Ipopt returned; of an answer that it took for want of a better one, why."""
        if self.said != _ACCEPTABLE:
            return self.said
        return (
            f"Ipopt ended at its acceptable level (optimality {self.kkt:.2g}), as where conditions "
            "are degenerate: hold the answer against another start or more nodes"
        )


@dataclass
class Program:
    """Unknowns with bounds, rows with limits, a cost.

    Attributes:
        unknowns: Symbols, one each of a size of its own.
        rows: Expressions, in their sizes.
        cost: What becomes least.
    """

    unknowns: list[Any] = field(default_factory=list)
    rows: list[Any] = field(default_factory=list)
    cost: Any = 0
    _given: list[Floats] = field(default_factory=list)  # low, high, guess, in sizes (3, n)
    _limits: list[Floats] = field(default_factory=list)  # (2, r)
    _names: list[Callable[[int], str]] = field(default_factory=list)
    _lengths: list[int] = field(default_factory=list)

    def unknown(self, bounds: Floats, guess: ArrayLike, size: Floats) -> Any:
        """A column of unknowns, as an expression in their units.

        Args:
            bounds: Least and largest values (n, 2).
            guess: To begin from (n,), moved inside.
            size: How large they are (n,).
        """
        symbol = loaded().MX.sym(f"w{len(self.unknowns)}", len(size))
        low, high = bounds.T / size
        self.unknowns.append(symbol)
        inside = np.clip(np.asarray(guess, dtype=float) / size, low, high)
        self._given.append(np.array([low, high, inside]))
        return symbol * size

    def row(
        self, expression: Any, low: ArrayLike, high: ArrayLike, name: Callable[[int], str]
    ) -> None:
        """A column of expressions that stays within limits, in its size; named for messages."""
        count = expression.numel()
        if not count:
            return
        self.rows.append(expression)
        self._limits.append(np.array([np.broadcast_to(low, count), np.broadcast_to(high, count)]))
        self._names.append(name)
        self._lengths.append(count)

    def solve(self, size: float, most: int) -> Answer:
        """Minimise, by Ipopt (Waechter and Biegler 2006) with exact second derivatives.

        Args:
            size: Of the cost.
            most: Largest number of iterations.
        """
        casadi = loaded()
        parts = {
            "x": casadi.vertcat(*self.unknowns), "f": self.cost / size,
            "g": casadi.vertcat(*self.rows),
        }  # fmt: skip
        low, high, guess = np.concatenate(self._given, axis=1)
        limits = np.concatenate(self._limits, axis=1) if self._limits else np.zeros((2, 0))
        quiet = {"print_level": 0, "sb": "yes", "max_iter": most, "tol": _TOLERANCE}
        # Rows and bounds are met as said, not to 1e-8 of the bounds more.
        quiet |= {"constr_viol_tol": 1e-9, "bound_relax_factor": 0.0, "dual_inf_tol": 1e-6}
        options = {
            "ipopt": quiet, "print_time": False, "error_on_fail": False,
            "show_eval_warnings": False,
        }  # fmt: skip
        # Functions called for each interval stay calls: written out, derivatives take four times
        # as long.
        search = casadi.nlpsol("search", "ipopt", parts, options)
        found = search(x0=guess, lbx=low, ubx=high, lbg=limits[0], ubg=limits[1])
        stats = search.stats()
        w, values, of_rows, of_bounds = (
            np.asarray(found[name], dtype=float).ravel() for name in ("x", "g", "lam_g", "lam_x")
        )
        slope = casadi.Function(
            "slope", [parts["x"]],
            [casadi.gradient(parts["f"], parts["x"]), casadi.jacobian(parts["g"], parts["x"])],
        )  # fmt: skip
        gradient, jacobian = slope(w)
        pull = np.asarray(gradient).ravel() + np.asarray(jacobian.T @ of_rows).ravel() + of_bounds
        off = np.maximum(np.maximum(limits[0] - values, values - limits[1]), 0.0)
        kkt = max(
            float(np.abs(pull[low < high]).max(initial=0.0)), float(off.max(initial=0.0)),
            _slack(values, of_rows, limits), _slack(w, of_bounds, np.array([low, high])),
        )  # fmt: skip
        worst = self._named(int(off.argmax())) if len(off) else ""
        return Answer(
            w, float(found["f"]) * size, kkt, float(off.max(initial=0.0)), worst,
            int(stats["iter_count"]), str(stats["return_status"]),
        )  # fmt: skip

    def values(self, expressions: Sequence[Any], unknowns: Floats) -> list[Floats]:
        """Expressions of the unknowns at some of their values, each as a column."""
        casadi = loaded()
        told = casadi.Function("told", [casadi.vertcat(*self.unknowns)], list(expressions))
        found = told(unknowns)
        found = found if isinstance(found, tuple | list) else (found,)
        return [np.asarray(each, dtype=float).ravel(order="F") for each in found]

    def _named(self, row: int) -> str:
        for name, length in zip(self._names, self._lengths, strict=True):
            if row < length:
                return name(row)
            row -= length
        return ""


def _slack(values: Floats, multipliers: Floats, limits: Floats) -> float:
    """Largest multiplier times the distance from its limit: both cannot be there."""
    low, high = limits
    free = low < high
    far = np.where(multipliers < 0.0, values - low, high - values)[free]
    pulls = np.abs(multipliers[free])
    far = np.where(np.isfinite(far), np.abs(far), 1.0)  # no limit there: the multiplier is wrong
    return float((pulls * far).max(initial=0.0))
