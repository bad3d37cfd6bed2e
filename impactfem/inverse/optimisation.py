"""Parameters and controls with which an objective becomes least, by gradients of ours."""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.inverse.gradients import TaylorCheck, check_as_dict, kinks, taylor_check
from impactfem.inverse.search import Iteration, begun
from impactfem.inverse.solvers import CONSTRAINED, Problem, searched
from impactfem.inverse.varied import Varied
from impactfem.scene import Scene

_AGREES = 1e-6  # share of J by which a plan of the answer's own may tell another
_STATIONARY = 1e-4  # of the first gradient, below which the last one counts as none


@dataclass(frozen=True)
class Optimised:
    """What was optimised.

    Attributes:
        status: "converged", "not_converged".
        parameters: Of each unknown its value and its start, by name.
        objective: J at the start and the end, and with a plan of its own.
        terms: Each term at the end, with its weight.
        constraints: What stays within limits, at the end.
        gradient: dJ/dp at the end, by name.
        multipliers: Of the limits of terms.
        kkt_residual: Largest entry of the gradient of the Lagrangian that bounds do not hold, by
            parameters in their sizes [J].
        iterations: The search.
        check: Taylor remainders of the gradient at the answer.
        doubts: Why the answer may be wrong, in words.
        notes: What makes the search difficult, in words.
        forward_runs: Runs without derivatives.
        gradient_runs: Runs with them.
        resumed: Runs taken from a search before.
        seconds: Of all [s].
        method, searched_by: Of runs, and of the search.
        scene: The scene with the answer.
    """

    status: str
    parameters: dict[str, dict[str, float]]
    objective: dict[str, float]
    terms: tuple[float, ...]
    constraints: tuple[float, ...]
    gradient: dict[str, float]
    multipliers: tuple[float, ...]
    kkt_residual: float
    iterations: tuple[Iteration, ...]
    check: TaylorCheck
    doubts: tuple[str, ...]
    forward_runs: int
    gradient_runs: int
    resumed: int
    seconds: float
    method: str
    searched_by: str
    scene: Scene
    notes: tuple[str, ...] = ()

    @property
    def trusted(self) -> bool:
        """Whether the search converged and nothing speaks against its answer."""
        return self.status == "converged" and self.check.passed and not self.doubts

    def as_dict(self) -> dict[str, Any]:
        """Plain data of ``summary.json``."""
        return {
            "status": self.status,
            "objective": self.objective,
            "terms": list(self.terms),
            "constraints": list(self.constraints),
            "parameters": self.parameters,
            "gradient": self.gradient,
            "multipliers": list(self.multipliers),
            "kkt_residual": self.kkt_residual,
            "notes": list(self.notes),
            "check": check_as_dict(self.check, self.doubts),
            "method": self.method,
            "solver": self.searched_by,
            "cost": {
                "forward_runs": self.forward_runs,
                "gradient_runs": self.gradient_runs,
                "resumed_runs": self.resumed,
                "seconds": self.seconds,
            },
        }


def optimise(
    scene: Scene | str | Path, *, folder: Path | None = None, restart: Path | None = None
) -> Optimised:
    """Find the parameters and controls of a scene with which its objective becomes least.

    Terms with limits (``constraints``) are kept within them. The plan of the start holds for the
    whole search; the answer is run once more with a plan of its own. What is found is a local
    minimum: begin elsewhere to look for others.

    Args:
        scene: A scene with parameters or controls, and an objective; or its file.
        folder: Where evaluations are kept, so that the search can go on after an interruption.
        restart: Folder of a search to go on with.

    Raises:
        SceneError: The scene cannot work, or its method has no right derivatives.
        ConvergenceError: The run at the start failed, or has no derivative.
        FolderError: There is no search to go on with, or it is of another scene.
    """
    search = begun(scene, folder, restart)
    varied = search.varied
    told = varied.jacobian(varied.start)
    varied.check_moves(told.numbers, told.jacobian)
    wanted = varied.scene.objective
    solver = _solver(varied)
    problem = Problem(search)
    best, success, message = searched(problem, solver)
    told = varied.jacobian(best)
    doubts = [*told.doubts, *kinks(varied, told, valley=True)]
    q, slope = told.numbers, varied.quantities.slope(told.numbers) @ told.jacobian
    seed = 0 if wanted is None else wanted.seed
    check = replace(taylor_check(varied, best, q, slope, seed), margin=told.margin)
    limited, kkt, multipliers = _stationarity(problem, best, q, told.jacobian, slope)
    first, last = search.tried[0], varied.quantities.objective(q)
    size = max(abs(first.objective), abs(last), 1e-300)
    verified, others = varied.verified(best, (first.objective, last), _AGREES * size)
    doubts += others
    doubts += _passed(problem, limited)
    if search.failures and not success:
        doubts.append(f"{len(search.failures)} runs failed, the last one: {search.failures[-1]}")
    if not success:
        doubts.append(f"the search ended without success: {message}")
    elif kkt > _STATIONARY * max(first.gradient_norm, size) and not problem.settled:
        doubts.append(
            f"the search ended, but the objective still falls: its gradient is {kkt:.3g}, "
            f"{first.gradient_norm:.3g} at the start; at a kink of it there is no smaller one"
        )
    names = [each.name for each in varied.unknowns]
    return Optimised(
        status="converged" if success else "not_converged",
        parameters={
            name: {"value": float(value), "start": float(start)}
            for name, value, start in zip(names, best, varied.start, strict=True)
        },
        objective={"initial": first.objective, "final": last, "verified": verified},
        terms=tuple(varied.quantities.parts(q)),
        constraints=tuple(limited.tolist()),
        gradient=dict(zip(names, slope.tolist(), strict=True)),
        multipliers=tuple(multipliers.tolist()),
        kkt_residual=kkt,
        iterations=tuple(search.tried),
        check=check,
        doubts=tuple(doubts),
        notes=(
            *varied.quantities.notes,
            *_plateau(varied, best, q, told.jacobian),
            *filter(None, [problem.settled]),
        ),
        forward_runs=varied.forward - varied.sloped,
        gradient_runs=varied.sloped,
        resumed=0 if varied.kept is None else varied.kept.taken,
        seconds=time.perf_counter() - search.begun,
        method=varied.chosen.method,
        searched_by=solver,
        scene=varied.at(best),
    )


def _solver(varied: Varied) -> str:
    """The solver that is asked for, or that fits.

    Raises:
        SceneError: It knows no constraints.
    """
    wanted, limited = varied.scene.objective, bool(varied.quantities.limits)
    given = None if wanted is None else wanted.searched_by
    if given is None:
        return "trust_constr" if limited else "lbfgs"
    if limited and given not in CONSTRAINED:
        fitting = " or ".join(f'"{name}"' for name in CONSTRAINED)
        raise SceneError(
            f'objective.solver = "{given}" knows no constraints: give {fitting}, or leave it out'
        )
    return given


def _stationarity(
    problem: Problem, at: Floats, q: Floats, jacobian: Floats, slope: Floats
) -> tuple[Floats, float, Floats]:
    """Limited terms, what is left of the Lagrangian's gradient, and multipliers of the limits.

    Multipliers are those with which least is left, of the sign that their limit asks for.
    """
    varied = problem.varied
    limited, slopes = varied.quantities.limited(q)
    scaled, count = slope * varied.scales, len(varied.quantities.limits)
    low, high = varied.limits
    near = 1e-8 * varied.scales
    free = ~((at <= low + near) & (scaled > 0.0)) & ~((at >= high - near) & (scaled < 0.0))
    multipliers = np.zeros(count)
    if not count:
        return limited, float(np.abs(scaled[free]).max(initial=0.0)), multipliers
    rows = slopes @ jacobian * varied.scales
    at_least, at_most = (room <= 1.0 for room in problem.room(limited))
    # L = J + sum of multipliers times terms: >= 0 at an upper limit, <= 0 at a lower one.
    bounds = np.where(at_least, -np.inf, 0.0), np.where(at_most, np.inf, 0.0)
    held = at_most | at_least
    inside = ~((at <= low + near) | (at >= high - near))
    if held.any() and inside.any():
        own = bounds[0][held], bounds[1][held]
        multipliers[held] = lsq_linear(rows[held][:, inside].T, -scaled[inside], own).x
    total = scaled + multipliers @ rows
    free = ~((at <= low + near) & (total > 0.0)) & ~((at >= high - near) & (total < 0.0))
    return limited, float(np.abs(total[free]).max(initial=0.0)), multipliers


def _plateau(varied: Varied, at: Floats, q: Floats, jacobian: Floats) -> list[str]:
    """A note where a parameter moves nothing that is looked at, as a pulse after the end."""
    still = [each.name for each in varied.still(at, q, jacobian)]
    if not still:
        return []
    what = f"{still[0]} moves" if len(still) == 1 else f"{' and '.join(still)} move"
    text = f"at the answer {what} nothing that is looked at: there may be less "
    return [f"{text}elsewhere; begin there"]


def _passed(problem: Problem, limited: Floats) -> list[str]:
    """Limits that the answer passes, in words."""
    each = zip(problem.varied.quantities.limits, limited, *problem.room(limited), strict=True)
    return [
        f"{limit.term} = {value:.6g} passes its limits {limit.limits[0]:g} and {limit.limits[1]:g}"
        for limit, value, below, above in each
        if min(below, above) < -1.0
    ]
