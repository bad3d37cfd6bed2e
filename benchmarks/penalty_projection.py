"""Penalty forces: the projection on the constraints in the metric of M(u), and its active set.

P_K u is the nearest point of K = {phi(u) >= b(t)} in the metric of M(u). With the multipliers mu of
this projection

    u - P_K u = -M^-1 J^T mu,   0 <= mu _|_ y >= 0,   y = phi(P_K u) - b,   W = J M^-1 J^T,

where J is taken at P_K u. With w = u - P_K u one has |w|_M^2 = mu . W mu and, the constraints
themselves moving, w . M (u' - (P_K u)') = -mu . g' with the normal velocities g' = J u' - b'. So

    G = (w . M u') w / |w|_M^2 = (mu . g') / (mu . W mu) M^-1 J^T mu,

and the penalty forces 2 alpha sqrt(k) G + k w become contact forces, M u'' = f + J^T lambda,

    lambda = (k - 2 alpha sqrt(k) (mu . g') / (mu . W mu)) mu.

For one constraint lambda = k mu - 2 alpha sqrt(k) g' / W. It pulls at the end of a damped contact:
this is the model, and the closed form of its restitution needs it. Equation (9) of Paoli and
Schatzman (2000) writes G with M^-1 because its factors are impulses, M u' and M (u - P_K u); for
velocities it is the orthogonal projection of u' on w above.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve

from impactfem.contact.impact_law import complementarity, delassus
from impactfem.errors import ConvergenceError
from impactfem.system.generalized import GeneralizedSystem, LinearSystem, factor_mass

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

_MAX_LINEARISATIONS = 50
_ROUNDING = 4.0 * np.finfo(float).eps  # of gaps, over the size of positions
_SETTLED = 1e-14  # change of the multipliers, as a share of them, that counts as rounding


@dataclass(frozen=True)
class Projection:
    """The projection of a position on the constraints.

    Attributes:
        multiplier: mu, shape (J,); 0 of constraints that do not act.
        slack: y, gaps of the projected position, shape (J,); 0 of constraints that act.
        jacobian: J at the projected position, shape (J, d).
        delassus: W, shape (J, J).
        answers: M^-1 J^T, shape (d, J).
    """

    multiplier: Floats
    slack: Floats
    jacobian: Floats
    delassus: Floats
    answers: Floats

    @property
    def squared_distance(self) -> float:
        """|u - P_K u|_M^2 = mu . W mu [kg m^2]."""
        return float(self.multiplier @ (self.delassus @ self.multiplier))

    def margin(self, active: Booleans) -> Floats:
        """The mu of active constraints, y of the others: >= 0 while the active set is right."""
        return np.where(active, self.multiplier * np.diag(self.delassus), self.slack)


class Projector:
    """Projects on the constraints of a system, and gives the penalty forces.

    Args:
        system: The system.
        stiffness: k [1/s^2].
        damping: alpha, a number >= 0.
    """

    def __init__(self, system: GeneralizedSystem, stiffness: float, damping: float) -> None:
        self.system = system
        self.stiffness = stiffness
        self.damping = damping
        self._factor = None if system.constant_mass is None else factor_mass(system, np.zeros(0))
        self._flat: tuple[Floats, Floats, Floats] | None = None
        if isinstance(system, LinearSystem) and self._factor is not None:
            self._flat = (system.normals, *delassus(self._factor, system.normals))

    def factor(self, t: float, u: Floats) -> Floats:
        """Lower Cholesky factor of M(u), shape (d, d)."""
        return self._factor if self._factor is not None else factor_mass(self.system, u, t)

    def project(
        self, t: float, u: Floats, active: Booleans | None = None, factor: Floats | None = None
    ) -> Projection:
        """Project u on K, or on the boundary y = 0 of the active constraints whatever their sign.

        The second continues the motion smoothly across a change of the active set.

        Args:
            t: Time [s].
            u: Position, shape (d,).
            active: The constraints that act, shape (J,); None to find them.
            factor: Cholesky factor of M(u), if known.

        Raises:
            ConvergenceError: Successive linearisations of phi did not settle.
        """
        gap = self.system.gap(t, u)
        if self._flat is not None:
            jacobian, matrix, answers = self._flat
            multiplier = _multiplier(matrix, gap, active)
            slack = gap + matrix @ multiplier
            return _tidy(multiplier, slack, jacobian, matrix, answers, active)
        lower = self.factor(t, u) if factor is None else factor
        point, last = u, np.zeros(len(gap))
        for _ in range(_MAX_LINEARISATIONS):
            jacobian = self.system.jacobian(point)
            matrix, answers = delassus(lower, jacobian)
            offset = self.system.gap(t, point) + jacobian @ (u - point)
            multiplier = _multiplier(matrix, offset, active)
            change = float(np.abs(multiplier - last).max(initial=0.0))
            point = u + answers @ multiplier
            # At the border of K multipliers are rounding of phi, which goes on changing.
            rounding = _ROUNDING * float(np.abs(u).max()) / float(matrix.diagonal().min())
            if change <= _SETTLED * float(np.abs(multiplier).max(initial=0.0)) + rounding:
                slack = self.system.gap(t, point)
                return _tidy(multiplier, slack, jacobian, matrix, answers, active)
            last = multiplier
        # Rounding of phi may keep the last digits moving; more than that is a failure.
        if change <= 1e-9 * float(np.abs(multiplier).max()):
            slack = self.system.gap(t, point)
            return _tidy(multiplier, slack, jacobian, matrix, answers, active)
        raise ConvergenceError(
            f"penalty: the projection on the constraints did not settle at t = {t:g}, u = "
            f"{u.tolist()}: the penetration reaches the radius of curvature; use a larger stiffness"
        )

    def forces(self, t: float, v: Floats, projection: Projection) -> Floats:
        """Contact forces lambda [N], shape (J,), from the velocity and the projection."""
        mu = projection.multiplier
        if self.damping == 0.0:
            elastic: Floats = self.stiffness * mu
            return elastic
        viscosity = 2.0 * self.damping * np.sqrt(self.stiffness)
        rate = projection.jacobian @ v - self.system.motion_rate(t)
        square = projection.squared_distance
        if square > np.finfo(float).tiny:
            mu = (1.0 - viscosity / self.stiffness * float(mu @ rate) / square) * mu
        force: Floats = self.stiffness * mu
        return force

    def forces_of_set(
        self, t: float, v: Floats, projection: Projection, active: Booleans
    ) -> Floats:
        """As `forces`; for one active constraint also where mu vanishes or changes its sign."""
        rows = np.flatnonzero(active)
        if len(rows) != 1 or self.damping == 0.0:
            return self.forces(t, v, projection)
        j = rows[0]
        rate = float(projection.jacobian[j] @ v) - self.system.motion_rate(t)[j]
        force = np.zeros(len(active))
        force[j] = self.stiffness * projection.multiplier[j]
        force[j] -= 2.0 * self.damping * np.sqrt(self.stiffness) * rate / projection.delassus[j, j]
        return force

    def acceleration(
        self, t: float, u: Floats, v: Floats, active: Booleans | None = None
    ) -> tuple[Floats, Floats]:
        """Acceleration (d,) and contact forces (J,), of a given active set or of the one found."""
        factor = self.factor(t, u)
        free: Floats = cho_solve((factor, True), self.system.force(t, u, v), check_finite=False)
        if active is not None and not active.any():
            return free, np.zeros(len(active))
        projection = self.project(t, u, active, factor)
        # The model's damping jumps at the boundary of K, where the sets found and given agree.
        acting = active if active is not None else projection.multiplier > 0.0
        force = self.forces_of_set(t, v, projection, acting)
        return free + projection.answers @ force, force


def _multiplier(matrix: Floats, gap: Floats, active: Booleans | None) -> Floats:
    """The mu >= 0 with y >= 0, or with y = 0 on a given set."""
    if active is None:
        if gap.min(initial=0.0) >= 0.0:
            return np.zeros(len(gap))
        if len(gap) == 1:
            return np.array([-gap[0] / matrix[0, 0]])
        return complementarity(matrix, gap)
    found = np.zeros(len(gap))
    rows = np.flatnonzero(active)
    if len(rows) == 1:
        found[rows] = -gap[rows] / matrix[rows[0], rows[0]]
    elif len(rows):
        found[rows] = np.linalg.lstsq(matrix[np.ix_(rows, rows)], -gap[rows])[0]
    return found


def _tidy(
    multiplier: Floats,
    slack: Floats,
    jacobian: Floats,
    matrix: Floats,
    answers: Floats,
    active: Booleans | None,
) -> Projection:
    acting = multiplier > 0.0 if active is None else active
    return Projection(multiplier, np.where(acting, 0.0, slack), jacobian, matrix, answers)
