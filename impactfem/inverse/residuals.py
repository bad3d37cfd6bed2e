"""Residuals of misfits, and the two ways in which their squares become least."""

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from impactfem.arrays import Floats
from impactfem.inverse.search import Search

_FAILED = 1e6  # times the largest misfit so far: what a run that fails counts as
_HALVINGS = 30  # of a Gauss-Newton step that makes nothing less


class Residuals:
    """Weighted misfits (measure - data) / sigma of a search, whose squares become least.

    Args:
        search: Of a scene whose objective has misfits only.

    Raises:
        SceneError: It has other terms.
    """

    def __init__(self, search: Search) -> None:
        self.search, self.misfits = search, search.varied.quantities.misfits
        self.count, self.size = 0, 0.0

    def values(self, values: Floats) -> Floats:
        """Residuals (n,) of a run; where there is none, so large that the step is taken back."""
        told = self.search.run(values)
        if told is None:
            return np.full(self.count, _FAILED * self.size / np.sqrt(self.count))
        quantities = self.search.varied.quantities
        found = self._weighted([quantities.residuals(i, told.numbers) for i, _ in self.misfits])
        self.count, self.size = len(found), max(self.size, float(np.linalg.norm(found)))
        slope = self._slopes(told.jacobian).T @ found
        self.search.note(values, 0.5 * float(found @ found), slope)
        return found

    def jacobian(self, values: Floats) -> Floats:
        """Their derivatives (n, P)."""
        return self._slopes(self.search.varied.jacobian(values).jacobian)

    def _slopes(self, jacobian: Floats) -> Floats:
        quantities = self.search.varied.quantities
        return self._weighted([
            jacobian[quantities.slices[i]] / quantities.sigma(i)[:, None] for i, _ in self.misfits
        ])  # fmt: skip

    def _weighted(self, each: list[Floats]) -> Floats:
        return np.concatenate([w * part for (_, w), part in zip(self.misfits, each, strict=True)])

    def fitted(self, tolerance: float, most: int, solver: str | None = None) -> OptimizeResult:
        """Unknowns with which the squares are least.

        Args:
            tolerance: Relative, of the squares and the unknowns.
            most: Runs at most.
            solver: "gauss_newton" for plain steps, halved where they make nothing less; else
                SciPy's trust region reflective method.
        """
        if solver == "gauss_newton":
            return self._gauss_newton(tolerance, most)
        varied = self.search.varied
        start, scales, (low, high) = varied.start, varied.scales, varied.limits

        def values_of(sized: Floats) -> Floats:  # at the start it is the same to the bit
            return np.clip(start + scales * (sized - start / scales), low, high)

        # In sizes of the unknowns: what SciPy takes for a bound or a small step is absolute.
        found = least_squares(
            lambda sized: self.values(values_of(sized)), start / scales,
            lambda sized: self.jacobian(values_of(sized)) * scales,
            bounds=(low / scales, high / scales),
            ftol=tolerance, xtol=tolerance, gtol=1e-12, max_nfev=most,
        )  # fmt: skip
        found.x = values_of(found.x)
        return found

    def _gauss_newton(self, tolerance: float, most: int) -> OptimizeResult:
        varied = self.search.varied
        (low, high), scales = varied.limits, varied.scales
        at = varied.start
        left = self.values(at)
        for _ in range(most):
            step = -scales * np.linalg.lstsq(self.jacobian(at) * scales, left)[0]
            for _ in range(_HALVINGS):
                trial = np.clip(at + step, low, high)
                found = self.values(trial)
                if found @ found <= left @ left:
                    break
                step = 0.5 * step
            else:  # as near as rounding lets it
                trial, found = at, left
            moved, gained = np.abs((trial - at) / scales).max(), left @ left - found @ found
            at, before, left = trial, left, found
            if moved <= tolerance or gained <= tolerance**2 * (before @ before):
                return self._ended(at, left, 1, "nothing becomes less")
        return self._ended(at, left, 0, f"{most} steps did not end")

    def _ended(self, at: Floats, left: Floats, status: int, message: str) -> OptimizeResult:
        low, high = self.search.varied.limits
        mask = np.where(at <= low, -1, np.where(at >= high, 1, 0))
        return OptimizeResult(
            x=at, fun=left, cost=0.5 * float(left @ left), active_mask=mask, status=status,
            success=status > 0, message=message,
        )  # fmt: skip
