"""Search by Ipopt's interior point method, through CasADi (extra ``optimise``)."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any, Protocol

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError

_ACCEPTED = {"Solve_Succeeded", "Solved_To_Acceptable_Level"}


class Minimised(Protocol):
    """An objective and terms with limits, of unknowns s in their sizes."""

    def value(self, s: Floats) -> tuple[float, Floats]:
        """J and its derivatives (P,)."""
        ...

    def limited(self, s: Floats) -> Floats:
        """What stays within limits (m,)."""
        ...

    def limited_slope(self, s: Floats) -> Floats:
        """Its derivatives (m, P)."""
        ...


def by_ipopt(
    problem: Minimised, bounds: Floats, limits: Floats, most: int, tolerance: float
) -> tuple[Floats, bool, str]:
    """Minimise from s = 0 on.

    Second derivatives are approximated by limited memory (Waechter and Biegler, On the
    implementation of an interior-point filter line-search algorithm, 2006).

    Args:
        problem: What becomes least.
        bounds: Least and largest unknowns, (2, P).
        limits: Least and largest values of the terms with limits, (2, m).
        most: Largest number of iterations.
        tolerance: Of the first-order conditions, relative.

    Returns:
        The unknowns, whether the search succeeded, and what Ipopt said.

    Raises:
        SceneError: CasADi is not installed.
    """
    try:
        casadi: Any = import_module("casadi")  # an extra, 277 MB
    except ImportError as error:
        raise SceneError(
            f'objective.solver = "ipopt" needs CasADi ({error}): pip install '
            'impactfem[optimise], or give "slsqp"'
        ) from None
    size, terms = bounds.shape[1], 1 + limits.shape[1]
    failures: list[BaseException] = []
    told = _told(casadi, problem, size, terms, failures)
    unknowns = casadi.MX.sym("s", size)
    all_of = told(unknowns)
    options = {
        "ipopt": {
            "hessian_approximation": "limited-memory", "max_iter": most, "tol": tolerance,
            "print_level": 0, "sb": "yes",
        },
        "print_time": False,
    }  # fmt: skip
    parts = {"x": unknowns, "f": all_of[0], "g": all_of[1:]}
    search = casadi.nlpsol("search", "ipopt", parts, options)
    found = search(
        x0=np.zeros(size), lbx=bounds[0], ubx=bounds[1], lbg=limits[0], ubg=limits[1]
    )  # fmt: skip
    if failures:
        raise failures[0]
    said = str(search.stats()["return_status"])
    return np.asarray(found["x"], dtype=float).ravel(), said in _ACCEPTED, said


@contextmanager
def _kept(failures: list[BaseException]) -> Iterator[None]:
    """Keep what is raised: CasADi takes it for a step that cannot be."""
    try:
        yield
    except BaseException as error:
        failures.append(error)
        raise


def _told(
    casadi: Any, problem: Minimised, size: int, terms: int, failures: list[BaseException]
) -> Any:
    """J and the terms with limits as a function of CasADi, with its Jacobian."""

    class Values(casadi.Callback):
        """J and the terms (1 + m,)."""

        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self._slopes: list[Any] = []  # CasADi keeps no reference of its own
            self.construct("told", {})

        def get_sparsity_in(self, _: int) -> Any:
            return casadi.Sparsity.dense(size, 1)

        def get_sparsity_out(self, _: int) -> Any:
            return casadi.Sparsity.dense(terms, 1)

        def has_jacobian(self) -> bool:
            return True

        def get_jacobian(self, name: str, *_: Any) -> Any:
            self._slopes.append(_slopes(casadi, problem, (size, terms), name, failures))
            return self._slopes[-1]

        def eval(self, given: Any) -> list[Any]:
            with _kept(failures):
                s = np.asarray(given[0], dtype=float).ravel()
                return [casadi.DM(np.append(problem.value(s)[0], problem.limited(s)))]

    return Values()


def _slopes(
    casadi: Any, problem: Minimised, shape: tuple[int, int], name: str,
    failures: list[BaseException],
) -> Any:  # fmt: skip
    """The Jacobian (1 + m, P) of J and the terms, as a function of CasADi."""
    size, terms = shape

    class Slopes(casadi.Callback):
        """Its second argument are the values, which it does not need."""

        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self.construct(name, {})

        def get_n_in(self) -> int:
            return 2

        def get_sparsity_in(self, which: int) -> Any:
            return casadi.Sparsity.dense(terms if which else size, 1)

        def get_sparsity_out(self, _: int) -> Any:
            return casadi.Sparsity.dense(terms, size)

        def eval(self, given: Any) -> list[Any]:
            with _kept(failures):
                s = np.asarray(given[0], dtype=float).ravel()
                slope = problem.value(s)[1][None]
                return [casadi.DM(np.concatenate([slope, problem.limited_slope(s)]))]

    return Slopes()
