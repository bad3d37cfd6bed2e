"""Parameters from measurements, by nonlinear least squares with gradients of ours."""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2, t

from impactfem.arrays import Floats
from impactfem.inverse.data import Data
from impactfem.inverse.gradients import TaylorCheck, check_as_dict, kinks, taylor_check
from impactfem.inverse.residuals import Residuals
from impactfem.inverse.search import Iteration, begun
from impactfem.inverse.varied import Varied
from impactfem.scene import Scene

_UNLIKELY = 1e-3  # probability below which misfits do not fit their standard deviations
_FLAT = 1e-12  # least share of a singular value of a direction that the data determine
_AGREES = 1e-6  # share of J by which a plan of the answer's own may tell another
_NOTICED = 0.05  # of a unit of chi^2 / 2, less than which speaks for no other answer: .3 sigma


@dataclass(frozen=True)
class Estimate:
    """A parameter that was found.

    Attributes:
        value: Its value.
        start: Where the search began.
        sigma: Its standard deviation, the Cramer-Rao bound of the data's; None if unknown.
        interval95: Where it lies with 95 % probability; None if unknown.
    """

    value: float
    start: float
    sigma: float | None
    interval95: tuple[float, float] | None


@dataclass(frozen=True)
class Fit:
    """A measure at its times: measured, and in the runs of the search.

    Attributes:
        of: What it is of.
        data: What was measured.
        start: At the start, (times,).
        answer: At the answer, (times,).
    """

    of: str
    data: Data
    start: Floats
    answer: Floats


@dataclass(frozen=True)
class Identified:
    """What was identified.

    Attributes:
        status: "converged", "not_converged".
        parameters: By name.
        correlation: Of the parameters, (P, P); None if it is unknown.
        objective: J at the start and the end, and with a plan of its own.
        sigma_of_data: "given", or the standard deviation that the misfits tell.
        chi2_probability: Of misfits as large as these, if the standard deviations given are right;
            None if none were.
        iterations: The search.
        fits: Measures whose misfits became least.
        check: Taylor remainders of the gradient at the answer.
        doubts: Why the answer or its intervals may be wrong, in words.
        notes: What makes the search difficult, in words.
        forward_runs: Runs without derivatives.
        gradient_runs: Runs with them.
        seconds: Of all [s].
        method: The method of the search.
        scene: The scene with the answer.
    """

    status: str
    parameters: dict[str, Estimate]
    correlation: Floats | None
    objective: dict[str, float]
    sigma_of_data: float | str
    chi2_probability: float | None
    iterations: tuple[Iteration, ...]
    fits: tuple[Fit, ...]
    check: TaylorCheck
    doubts: tuple[str, ...]
    forward_runs: int
    gradient_runs: int
    seconds: float
    method: str
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
            "parameters": {
                name: {
                    "value": found.value,
                    "start": found.start,
                    "sigma": found.sigma,
                    "interval95": None if found.interval95 is None else list(found.interval95),
                }
                for name, found in self.parameters.items()
            },
            "correlation": None if self.correlation is None else self.correlation.tolist(),
            "sigma_of_data": self.sigma_of_data,
            "chi2_probability": self.chi2_probability,
            "notes": list(self.notes),
            "check": check_as_dict(self.check, self.doubts),
            "method": self.method,
            "cost": {
                "forward_runs": self.forward_runs,
                "gradient_runs": self.gradient_runs,
                "seconds": self.seconds,
            },
        }


def identify(
    scene: Scene | str | Path, *, folder: Path | None = None, restart: Path | None = None
) -> Identified:
    """Find the parameters with which a scene is nearest to what was measured.

    The sum of ((measure - data) / sigma)^2 / 2 becomes least, by SciPy's trust region reflective
    method. The plan of the start holds for the whole search; the answer is run once more with a
    plan of its own. Standard deviations are those of the linearised problem, (J^T J)^-1: the
    Cramer-Rao bound where the data's are given.

    Args:
        scene: A scene with parameters and measures with data; or its file.
        folder: Where evaluations are kept, so that the search can go on after an interruption.
        restart: Folder of a search to go on with.

    Raises:
        SceneError: The scene cannot work, or its method has no right derivatives.
        ConvergenceError: The run at the start failed, or has no derivative.
        FolderError: There is no search to go on with, or it is of another scene.
    """
    search = begun(scene, folder, restart)
    varied, residuals = search.varied, Residuals(search)
    scene = varied.scene
    at_start, jacobian = varied.jacobian(varied.start)[:2]
    varied.check_moves(at_start, jacobian)
    objective = scene.objective
    tolerance = 1e-8 if objective is None else objective.tolerance
    found = residuals.fitted(
        tolerance, 100 if objective is None else objective.max_iterations,
        None if objective is None else objective.searched_by,
    )  # fmt: skip
    told = varied.jacobian(found.x)
    q, jacobian = told.numbers, told.jacobian
    doubts = [*told.doubts, *kinks(varied, told, valley=True)]
    slopes, left = residuals.jacobian(found.x), found.fun
    held = [bool(side) for side in found.active_mask]
    sigmas, correlation, spread, probability = _spread(varied, slopes, left, held, doubts)
    seed = 0 if objective is None else objective.seed
    check = taylor_check(varied, found.x, q, varied.quantities.slope(q) @ jacobian, seed)
    check = replace(check, margin=told.margin)
    first, last = search.tried[0].objective, float(found.cost)
    # J = chi^2 / 2: a parameter that is off by its standard deviation adds half of a unit.
    unit = 1.0 if spread == "given" else 2.0 * last / max(1, len(left) - len(slopes.T))
    least = max(_AGREES * max(first, last), _NOTICED * unit)
    verified, others = varied.verified(found.x, (first, last), least)
    doubts += others
    if search.failures and not found.success:
        doubts.append(f"{len(search.failures)} runs failed, the last one: {search.failures[-1]}")
    width = 1.96 if spread == "given" else float(t.ppf(0.975, max(1, len(left) - len(slopes.T))))
    parameters = {}
    for k, parameter in enumerate(varied.unknowns):
        value, sigma = float(found.x[k]), sigmas[k]
        around = None if sigma is None else (value - width * sigma, value + width * sigma)
        parameters[parameter.name] = Estimate(value, float(varied.start[k]), sigma, around)
        if held[k]:
            doubts.append(f"{parameter.name} is held at its bound {value:g}: it has no interval")
    return Identified(
        status="converged" if found.status > 0 else "not_converged",
        parameters=parameters,
        correlation=correlation,
        objective={"initial": first, "final": last, "verified": verified},
        sigma_of_data=spread,
        chi2_probability=probability,
        iterations=tuple(search.tried),
        fits=tuple(
            Fit(scene.measures[i].of, varied.quantities.data[i], at_start[own], q[own])
            for i, own in ((i, varied.quantities.slices[i]) for i, _ in residuals.misfits)
        ),
        check=check,
        doubts=tuple(doubts),
        notes=varied.quantities.notes,
        forward_runs=varied.forward - varied.sloped,
        gradient_runs=varied.sloped,
        seconds=time.perf_counter() - search.begun,
        method=varied.chosen.method,
        scene=varied.at(found.x),
    )


def _spread(
    varied: Varied, slopes: Floats, residuals: Floats, held: list[bool], doubts: list[str]
) -> tuple[list[float | None], Floats | None, float | str, float | None]:
    """Standard deviations and correlation of the parameters, and what is known of the data's.

    Args:
        varied: The scene.
        slopes: Derivatives of the residuals (n, P).
        residuals: At the answer (n,).
        held: Which parameters are held at a bound (P,).
        doubts: Gets what speaks against intervals.
    """
    scaled = slopes * varied.scales
    free = [k for k, stays in enumerate(held) if not stays]
    left = len(residuals) - len(free)
    known = all(varied.quantities.data[i].sigma is not None for i, _ in varied.quantities.misfits)
    none: list[float | None] = [None] * len(held)
    if not free:
        return none, None, "given" if known else float("nan"), None
    _, sizes, right = np.linalg.svd(scaled[:, free], full_matrices=False)
    if len(residuals) < len(free) or not sizes[-1] > _FLAT * sizes[0]:
        weak = varied.unknowns[free[int(np.abs(right[-1]).argmax())]].name
        doubts.append(f"the data do not determine all parameters: {weak} may change for nothing")
        return none, None, "given" if known else float("nan"), None
    inverse = (right.T / sizes**2) @ right
    cost, probability = float(residuals @ residuals), None
    spread: float | str = "given"
    if known:
        probability = float(chi2.sf(cost, left)) if left else None
        if probability is not None and probability < _UNLIKELY:
            doubts.append(
                f"misfits are {np.sqrt(cost / left):.3g} times the standard deviations given (a "
                f"chance of {probability:.2g}): these are too small, or the model is wrong, and "
                "intervals are too narrow"
            )
    elif left:
        spread = float(np.sqrt(cost / left))
        inverse = spread**2 * inverse
    else:
        doubts.append("as many data as parameters and no sigma: there are no intervals")
        return none, None, float("nan"), None
    root = np.sqrt(np.diag(inverse))
    found = none.copy()
    for place, k in enumerate(free):
        found[k] = float(root[place] * varied.scales[k])
    correlation = np.full((len(held), len(held)), np.nan)
    correlation[np.ix_(free, free)] = inverse / np.outer(root, root)
    return found, correlation if len(free) == len(held) else None, spread, probability
