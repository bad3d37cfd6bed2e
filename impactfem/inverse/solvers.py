"""How objectives are searched: solvers of SciPy, PETSc and CasADi, with gradients of ours."""

import warnings
from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from impactfem.arrays import Booleans, Floats
from impactfem.inverse.interior_point import by_ipopt
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.residuals import Residuals
from impactfem.inverse.search import Search

_KEPT = 1e-6  # share of a term, or of its size, by which it may pass its limits
_LATELY, _GAIN = 10, 1e-3  # evaluations that have to add a share of what was won on time steps
_FAILED = 1e6  # times the largest objective so far: what a run that fails counts as
_FLAT = 1e-2  # times the tolerance: share of the first gradient that may be left
_RUNS = 2  # times the iterations: evaluations, of which a line along a kink may take twenty
_BARRIER = 1e-10  # parameter of trust-constr's barrier with which limits are met
_BARRIERS = ("initial_barrier_parameter", "initial_barrier_tolerance", "barrier_tol")
_NOTHING_LESS = 8  # of SLSQP: along its line nothing is less, as rounding lets it see
_NO_LESS = -6  # TAO_DIVERGED_LS_FAILURE


class Settled(Exception):  # noqa: N818  (nothing failed)
    """A search wins nothing that counts any more."""


class Problem:
    """An objective of unknowns s in their sizes, from the start on: p = start + sizes s.

    It is told in the size of its first value or slopes: solvers hold numbers beside 1, to which an
    energy of 1e-12 J would be nothing. Terms within limits likewise, in the size of their slopes.
    """

    def __init__(self, search: Search) -> None:
        self.search, self.varied = search, search.varied
        wanted = self.varied.scene.objective
        self.most = 100 if wanted is None else wanted.max_iterations
        self.tolerance = 1e-8 if wanted is None else wanted.tolerance
        asked = None if wanted is None else wanted.gain
        self.gain = (_GAIN if self.varied.wrinkles else 0.0) if asked is None else asked
        self.settled = ""  # why the search was ended
        self._least = list[float]()  # within limits, so far, after each evaluation
        self.bounds = (self.varied.limits - self.varied.start) / self.varied.scales
        self.best: tuple[float, Floats] = (np.inf, self.varied.start)
        self.size = 0.0
        self._last: tuple[Floats, tuple[float, Floats]] | None = None

    def place(self, s: Floats) -> Floats:
        """P of s, within its bounds in spite of rounding."""
        low, high = self.varied.limits
        return np.clip(self.varied.start + self.varied.scales * s, low, high)

    @property
    def _limits(self) -> Floats:
        limits = self.varied.quantities.limits
        return np.array([each.limits for each in limits], dtype=float).reshape(-1, 2).T

    @property
    def limits(self) -> Floats:
        """Least and largest values of what stays within limits, in its sizes, (2, m)."""
        return self._limits / self.sizes

    @cached_property
    def sizes(self) -> Floats:
        """Of what stays within limits: its steepest slope at the start, (m,)."""
        values, slopes = self._terms(np.zeros(len(self.varied.start)))
        steep = np.abs(slopes).max(axis=1, initial=0.0)
        found = np.where(steep > 0.0, steep, np.abs(values))
        return np.where(found > 0.0, found, 1.0)

    def room(self, limited: Floats) -> tuple[Floats, Floats]:
        """How far values (m,) are from their limits, least and largest, in what may be passed."""
        low, high = self._limits
        most = _KEPT * np.maximum(self.sizes, np.abs(limited))
        return (limited - low) / most, (high - limited) / most

    def value(self, s: Floats) -> tuple[float, Floats]:
        """J and its derivatives; where there is no run, so much that the step is taken back."""
        values, quantities = self.place(s), self.varied.quantities
        if self._last is not None and np.array_equal(self._last[0], values):
            return self._last[1]
        self._last = values, self._valued(values, quantities)
        return self._last[1]

    def _valued(self, values: Floats, quantities: Quantities) -> tuple[float, Floats]:
        told = self.search.run(values)
        if told is None:
            most = max(abs(each.objective) for each in self.search.tried)
            return _FAILED * max(most / (self.size or 1.0), 1.0), np.zeros(len(values))
        found = quantities.objective(told.numbers)
        slope = quantities.slope(told.numbers) @ told.jacobian
        self.search.note(values, found, slope)
        if (
            found < self.best[0]
            and np.min(self.room(quantities.limited(told.numbers)[0]), initial=0.0) >= -1.0
        ):
            self.best = found, values
        self._check_gain()
        scaled = slope * self.varied.scales
        self.size = self.size or max(abs(found), float(np.abs(scaled).max()))
        return found / (self.size or 1.0), scaled / (self.size or 1.0)

    def _check_gain(self) -> None:
        """End a search that goes on from wrinkle to wrinkle.

        Raises:
            Settled: The last evaluations won next to nothing.
        """
        if not np.isfinite(self.best[0]):
            return
        self._least.append(self.best[0])
        before, last = self._least[-1 - _LATELY :][0], self._least[-1]
        won, lately = self._least[0] - last, before - last
        if len(self._least) > _LATELY and lately < self.gain * won:
            self.settled = (
                f"the search was ended: {_LATELY} evaluations won {lately / won:.1g} of what it "
                f"has won, less than objective.gain = {self.gain:g}"
            )
            raise Settled(self.settled)

    def limited(self, s: Floats) -> Floats:
        """What stays within limits, in its sizes (m,)."""
        return np.asarray(self._terms(s)[0] / self.sizes)

    def limited_slope(self, s: Floats) -> Floats:
        """Its derivatives by s, (m, P)."""
        return np.asarray(self._terms(s)[1] / self.sizes[:, None])

    def _terms(self, s: Floats) -> tuple[Floats, Floats]:
        """Both; where there is no run, those of the best one: the objective takes the step back."""
        told = self.search.run(self.place(s)) or self.varied.jacobian(self.best[1])
        values, slopes = self.varied.quantities.limited(told.numbers)
        return values, np.asarray(slopes @ told.jacobian * self.varied.scales)


type Found = tuple[Floats, bool, str]
"""The best parameters, whether the search succeeded, what it said."""


def _by_lbfgs(problem: Problem) -> Found:
    start = np.zeros(len(problem.varied.start))
    steepest = float(np.abs(problem.value(start)[1]).max())
    options = {
        "maxiter": problem.most, "ftol": 1e-3 * problem.tolerance**2,
        "gtol": _FLAT * problem.tolerance * steepest, "maxfun": _RUNS * problem.most,
    }  # fmt: skip
    found = minimize(
        problem.value, start, jac=True, method="L-BFGS-B",
        bounds=Bounds(*problem.bounds), options=options,
    )  # fmt: skip
    # A line search that finds nothing less has come as near as rounding lets it.
    done = found.success or "ABNORMAL" in str(found.message)
    return problem.best[1], bool(done), str(found.message)


def _by_trust_constr(problem: Problem) -> Found:
    low, high = problem.limits
    held = [NonlinearConstraint(problem.limited, low, high, jac=problem.limited_slope)]
    options = {"maxiter": problem.most, "xtol": problem.tolerance, "gtol": problem.tolerance}
    start = np.zeros(len(problem.varied.start))
    with warnings.catch_warnings():
        # SciPy says so of linear terms, whose second derivatives are 0 as it takes them to be.
        warnings.filterwarnings("ignore", message="delta_grad == 0.0")
        # It may end with a barrier that keeps it off its limits: then once more, nearly without.
        for barrier in ({}, dict.fromkeys(_BARRIERS, _BARRIER)):
            found = minimize(
                problem.value, start, jac=True, method="trust-constr",
                bounds=Bounds(*problem.bounds), constraints=held if len(low) else [],
                options=options | barrier,
            )  # fmt: skip
            start = found.x
            if found.status not in {1, 2} or getattr(found, "barrier_parameter", 0.0) <= _BARRIER:
                break
    return problem.place(found.x), found.status in {1, 2}, str(found.message)


def _by_slsqp(problem: Problem) -> Found:
    low, high = problem.limits
    start = np.zeros(len(problem.varied.start))
    equal = low == high
    sides: list[dict[str, Any]] = []
    for kind, rows, sign, side in (
        ("eq", equal, 1.0, low), ("ineq", ~equal & np.isfinite(low), 1.0, low),
        ("ineq", ~equal & np.isfinite(high), -1.0, high),
    ):  # fmt: skip
        if rows.any():
            within = partial(_within, problem, rows, sign, side)
            slope = partial(_within_slope, problem, rows, sign)
            sides.append({"type": kind, "fun": within, "jac": slope})

    found = minimize(
        problem.value, start, jac=True, method="SLSQP", bounds=Bounds(*problem.bounds),
        constraints=sides, options={"maxiter": problem.most, "ftol": _FLAT * problem.tolerance},
    )  # fmt: skip
    return problem.place(found.x), found.status in {0, _NOTHING_LESS}, str(found.message)


def _within(problem: Problem, rows: Booleans, sign: float, side: Floats, s: Floats) -> Floats:
    """How far terms are within one of their limits, in their sizes."""
    return np.asarray(sign * (problem.limited(s) - side)[rows])


def _within_slope(problem: Problem, rows: Booleans, sign: float, s: Floats) -> Floats:
    return np.asarray(sign * problem.limited_slope(s)[rows])


def _by_ipopt(problem: Problem) -> Found:
    limits, bounds = problem.limits, problem.bounds
    s, success, said = by_ipopt(problem, bounds, limits, problem.most, problem.tolerance)
    return problem.place(s), success, f"Ipopt: {said}"


def _by_tao(problem: Problem) -> Found:
    from petsc4py import PETSc  # noqa: PLC0415  (heavy; each rank solves the same problem)

    size = len(problem.varied.start)
    x, gradient = (PETSc.Vec().createSeq(size, comm=PETSc.COMM_SELF) for _ in range(2))
    low, high = x.duplicate(), x.duplicate()
    for bound, values in zip((low, high), problem.bounds, strict=True):
        bound.setArray(np.clip(values, -1e20, 1e20))

    def both(_: Any, at: Any, slope: Any) -> float:
        value, found = problem.value(at.getArray(readonly=True).copy())
        slope.setArray(found)
        return value

    tao = PETSc.TAO().create(PETSc.COMM_SELF)
    tao.setType("blmvm")
    tao.setObjectiveGradient(both, gradient)
    tao.setVariableBounds((low, high))
    tao.setTolerances(gatol=1e-14, grtol=problem.tolerance, gttol=problem.tolerance)
    tao.setMaximumIterations(problem.most)
    tao.solve(x)
    reason: Any = tao.getConvergedReason()
    for each in (tao, x, gradient, low, high):
        each.destroy()
    # As above: no smaller value along the line.
    done = reason > 0 or reason == _NO_LESS
    return problem.best[1], bool(done), f"TAO's reason {reason}"


def _by_squares(problem: Problem) -> Found:
    wanted = problem.varied.scene.objective
    solver = None if wanted is None else wanted.searched_by
    found = Residuals(problem.search).fitted(problem.tolerance, problem.most, solver)
    return np.asarray(found.x), bool(found.success), str(found.message)


SOLVERS: Mapping[str, Callable[[Problem], Found]] = {
    "lbfgs": _by_lbfgs, "trust_constr": _by_trust_constr, "tao": _by_tao,
    "slsqp": _by_slsqp, "ipopt": _by_ipopt,
    "least_squares": _by_squares, "gauss_newton": _by_squares,
}  # fmt: skip
"""Solvers by name."""


def searched(problem: Problem, solver: str) -> Found:
    """Search by one of them, until it ends or wins nothing that counts any more."""
    try:
        return SOLVERS[solver](problem)
    except Settled as settled:
        return problem.best[1], True, str(settled)


CONSTRAINED = ("trust_constr", "slsqp", "ipopt")
"""Those that know limits of terms."""
