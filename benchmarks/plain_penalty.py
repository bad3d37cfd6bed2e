"""The penalty method as it was used: LSODA over the whole motion, blind to the switch.

    from plain_penalty import integrate_plainly

As Scilab's ``ode`` runs: LSODA chooses its steps freely, and output times are interpolated
(``itask = 1``). The impulses ride along with a tolerance that keeps them out of the step control.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from penalty import PenaltySettings, begin, trajectory
from penalty_legs import Record
from penalty_projection import Projector
from scipy.integrate import LSODA
from scipy.optimize import brentq

from impactfem.errors import ConvergenceError
from impactfem.result.trajectory import Trajectory
from impactfem.system.generalized import GeneralizedSystem

Floats = NDArray[np.float64]

_SAMPLES = 4
_IGNORED = 1e30  # absolute tolerance of quantities that must not steer the steps


def integrate_plainly(
    system: GeneralizedSystem,
    position: ArrayLike,
    velocity: ArrayLike,
    duration: float,
    settings: PenaltySettings,
    *,
    restarted: bool = False,
) -> Trajectory:
    """Integrate the penalised motion with LSODA.

    Args:
        system: The system.
        position: Position at t = 0, shape (d,).
        velocity: Velocity at t = 0, shape (d,).
        duration: End of the motion [s].
        settings: As of the penalty method; its tolerances are 1e-5 and 1e-7 if not given.
        restarted: Start anew at every output time.

    Raises:
        ConvergenceError: LSODA failed.
    """
    projector, record, u, v = begin(system, position, velocity, duration, settings)
    d, count = projector.system.dofs, projector.system.num_constraints
    rtol, atol = settings.rtol or 1e-5, settings.atol or 1e-7
    steering = np.concatenate([np.full(2 * d, atol), np.full(count, _IGNORED)])

    def fun(t: float, y: Floats) -> Floats:
        a, force = projector.acceleration(t, y[:d], y[d : 2 * d])
        return np.concatenate([y[d : 2 * d], a, force])

    ends = record.times[1:] if restarted else record.times[-1:]
    t, y = 0.0, np.concatenate([u, v, np.zeros(count)])
    watch = _Watch(projector, record, t, y)
    for end in ends:
        solver = LSODA(fun, t, y, float(end), rtol=rtol, atol=steering)
        while solver.status == "running":
            message = solver.step()
            if solver.status == "failed":
                raise ConvergenceError(f"penalty: LSODA failed at t = {solver.t:g}: {message}")
            record.steps += 1
            dense = solver.dense_output()
            watch.step(dense, solver.t_old, solver.t)
            record.fill(
                solver.t,
                lambda s: (dense(s)[:d], dense(s)[d : 2 * d], dense(s)[2 * d :]),  # noqa: B023
            )
        record.evaluations += solver.nfev
        t, y = solver.t, solver.y
    return trajectory(projector, record)


class _Watch:
    """Notes when constraints start and stop acting, without interfering."""

    def __init__(self, projector: Projector, record: Record, t: float, y: Floats) -> None:
        self._projector, self._record = projector, record
        self._d = projector.system.dofs
        self._last = self._sign(t, y)
        for j in np.flatnonzero(self._last <= 0.0):
            if projector.system.gap_rate(t, y[: self._d], y[self._d : 2 * self._d])[j] < 0.0:
                self._change(t, y, int(j), acts=True)

    def step(self, dense: LSODA, begin: float, end: float) -> None:
        times = np.linspace(begin, end, _SAMPLES + 1)
        for a, b in pairwise(times):
            new = self._sign(b, dense(b))
            for j in (int(j) for j in np.flatnonzero((new < 0.0) != (self._last < 0.0))):
                first = self._sign(a, dense(a))[j]
                at = b
                if first * new[j] < 0.0:
                    at = brentq(lambda s, j=j: self._sign(s, dense(s))[j], a, b, xtol=1e-15)
                elif first == 0.0:
                    at = a
                self._change(at, dense(at), j, acts=bool(new[j] < 0.0))
            self._last = new
            gap = self._projector.system.gap(b, dense(b)[: self._d])
            self._record.penetration = max(self._record.penetration, -float(gap.min()))

    def _sign(self, t: float, y: Floats) -> Floats:
        """Gap of the projection, or minus the multiplier's share of the penetration."""
        found = self._projector.project(t, y[: self._d])
        share: Floats = found.slack - found.multiplier * np.diag(found.delassus)
        return share

    def _change(self, t: float, y: Floats, j: int, *, acts: bool) -> None:
        d = self._d
        if j in self._record.open and acts:
            return
        rate = float(self._projector.system.gap_rate(t, y[:d], y[d : 2 * d])[j])
        if acts:
            self._record.begin(t, j, rate, float(y[2 * d + j]))
        else:
            self._record.finish(t, j, rate, float(y[2 * d + j]))
