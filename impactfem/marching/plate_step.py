"""The factored equations of a step of a plate by the midpoint rule, with its damping.

Over a step of length dt, with d the difference of both ends and damping C = a M + b K + C_m (see
`impactfem.system.plate_damping`), tau = 2 b / dt,

    M (2 (d / dt - v_a) / dt) + C d / dt + K (q_a + d / 2) = f

is with the place w = q_a + (1 + tau) d / 2, at which K acts with what it damps,

    (K + mu M + nu C_m) w = f + M (mu q_a + 2 v_a / dt) + nu C_m q_a,
    nu = 2 / (dt (1 + tau)),    mu = nu (2 / dt + a).

Modes make K + mu M diagonal, so that those damped one by one cost no factors of their own: with x
the solution without C_m they shrink by nu g / (w^2 + mu + nu g).
"""

from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import SuperLU, splu

from impactfem.arrays import Floats
from impactfem.system.plate import PlateSystem
from impactfem.system.plate_rows import pinned
from impactfem.system.surface import CHOLESKY


class PlateStep:
    """Steps of one length.

    Attributes:
        mu: See above [1/s^2].
        advance: d over w - q_a.
    """

    def __init__(self, bodies: PlateSystem, step: float) -> None:
        """Take the length of steps [s]."""
        damping = bodies.damping
        lag = 1.0 + 2.0 * damping.stiffness / step
        nu = 2.0 / (step * lag)
        self.mu, self.advance, self._nu = nu * (2.0 / step + damping.mass), 2.0 / lag, nu
        self._bodies, self._damping = bodies, damping
        slowed = nu * damping.rates
        self._shrink = slowed / (damping.squares + self.mu + slowed)

    @property
    def _matrix(self) -> csr_matrix:
        """K + mu M."""
        return csr_matrix(self._bodies.stiffness + self.mu * diags(self._bodies.weight))

    @property
    def tangent(self) -> csr_matrix:
        """Derivative of forces by d, without that of C_m."""
        return self._matrix / self.advance

    @cached_property
    def _factor(self) -> SuperLU:
        return splu(pinned(self._matrix, self._bodies.led).tocsc(), **CHOLESKY)

    def solve(self, right: Floats, there: Floats | None = None) -> Floats:
        """W by the right-hand side, (d,) each.

        Args:
            right: The right-hand side.
            there: Places of what is led, 0 of all else; None: it stays.
        """
        led, damping = self._bodies.led, self._damping
        if len(self._bodies.motions):
            right = right if there is None else right - self._matrix @ there
            right = np.where(led, 0.0 if there is None else there, right.T).T
        found = self._factor.solve(right)
        if len(self._shrink):
            found -= damping.modes @ (self._shrink * (damping.momenta.T @ found))
        return np.asarray(found)

    def motion(self, place: Floats, speed: Floats, step: float) -> Floats:
        """Right-hand side of the motion at the start."""
        pushed = self._bodies.weight * (self.mu * place + (2.0 / step) * speed)
        if len(self._shrink):
            pushed = pushed + self._nu * self._damping.force(place)
        return np.asarray(pushed)
