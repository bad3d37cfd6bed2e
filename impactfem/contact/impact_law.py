"""Impacts and lasting contact of systems with few degrees of freedom, in the metric of M.

With W = J M^-1 J^T of the closed constraints and normal velocities w = J v - b', an impact changes
v by M^-1 J^T p with impulses p >= 0. The laws:

- "simultaneous": 0 <= p _|_ w_after + e w_before >= 0, one complementarity problem for all closed
  constraints. For e = 0 this is Moreau's projection of v on the tangent cone; for one e it is
  v_after = -e v_before + (1 + e) P_T(v_before), the law of the position-level scheme.
- "sequential": two-body impacts one after the other, the fastest approach first, until none
  approaches.

Both agree for one constraint. For several they differ, and no law is right for all bodies: Newton's
cradle is the known example. Source: Moreau, Unilateral contact and dry friction in finite freedom
dynamics (1988); Brogliato, Nonsmooth Mechanics (2016), chapter 6.
"""

import contextlib
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import cho_solve

from impactfem.arrays import Floats, Integers
from impactfem.contact.complementarity import solve_by_active_set
from impactfem.errors import ConvergenceError

Law = Literal["simultaneous", "sequential"]

_MAX_BINARY = 100_000
_WRONG = 1e-10  # share of the largest offset by which a solution may miss
_COMPLIANCE = 1e-12  # of constraints with unit diagonal
_AT_REST = 1e-13  # share of the largest normal velocity that counts as none
_TOGETHER = 1e-9  # of a time step: contacts that close within it close together


@dataclass(frozen=True)
class Impact:
    """What an impact does.

    Attributes:
        velocity: v after the impact, shape (d,).
        impulse: p [N s], >= 0, shape (closed constraints,).
        before: Normal velocities before, < 0 approaching, shape (closed constraints,).
        after: Normal velocities after, shape (closed constraints,).
    """

    velocity: Floats
    impulse: Floats
    before: Floats
    after: Floats


def complementarity(matrix: Floats, offset: Floats, scale: float | None = None) -> Floats:
    """Solve 0 <= x _|_ matrix x + offset >= 0 by the primal-dual active set.

    Args:
        matrix: Symmetric positive semidefinite, positive diagonal, shape (n, n).
        offset: Shape (n,).
        scale: Size of offsets; values below 1e-14 of it count as rounding. The largest if None.

    Returns:
        x >= 0, shape (n,).

    Raises:
        ConvergenceError: No active set was found.
    """
    if not len(offset):
        return np.zeros(0)
    # Rows scaled to a unit diagonal: mass ratios of 1e6 would spoil the choice of the set.
    root = 1.0 / np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    scaled = offset * root
    size = float(np.abs(scaled).max()) if scale is None else scale * float(root.max())
    if size == 0.0:
        return np.zeros(len(offset))
    limit = 50 + 10 * len(offset)
    even = root[:, None] * matrix * root
    found: Floats | None = None
    with contextlib.suppress(ConvergenceError):
        found, _ = solve_by_active_set(1e-14 * size, limit)(even, scaled, scaled < 0.0)
    if found is None or (even @ found + scaled).min() < -_WRONG * size:
        # More constraints than directions: active sets are singular, and the least squares of an
        # inconsistent one may pass for a solution. A little compliance gives each set one answer.
        even[np.diag_indices_from(even)] += _COMPLIANCE
        solver = solve_by_active_set(_WRONG * size, limit)
        found, _ = solver(even, scaled, np.zeros(len(scaled), dtype=bool))
    return found * root


def delassus(factor: Floats, jacobian: Floats) -> tuple[Floats, Floats]:
    """W = J M^-1 J^T (n, n) and M^-1 J^T (d, n), from the lower Cholesky factor of M."""
    answers: Floats = cho_solve((factor, True), jacobian.T)
    return jacobian @ answers, answers


def resolve_impact(
    factor: Floats,
    jacobian: Floats,
    velocity: Floats,
    rate: Floats,
    restitution: Floats,
    law: Law = "simultaneous",
) -> Impact:
    """Apply an impact law to the closed constraints.

    Args:
        factor: Lower Cholesky factor of M, shape (d, d).
        jacobian: Rows of the closed constraints, shape (n, d).
        velocity: v before, shape (d,).
        rate: b' of the closed constraints, shape (n,).
        restitution: e of the closed constraints, shape (n,).
        law: How several constraints share the impact.

    Raises:
        ConvergenceError: The complementarity problem was not solved, or two-body impacts did not
            come to an end.
    """
    before = jacobian @ velocity - rate
    matrix, answers = delassus(factor, jacobian)
    if law == "sequential" and len(before) > 1:
        impulse = _sequential(matrix, before, restitution)
    else:
        impulse = complementarity(matrix, (1.0 + restitution) * before)
    after = velocity + answers @ impulse
    return Impact(after, impulse, before, jacobian @ after - rate)


def _sequential(matrix: Floats, before: Floats, restitution: Floats) -> Floats:
    """Impulses of two-body impacts, the fastest approach first."""
    none = np.zeros(len(before))
    bodies = Approach(before[:, None], none, restitution, none, none)
    return in_turn(matrix, bodies, 0.0)[0][:, 0]


@dataclass(frozen=True)
class Approach:
    """Contacts that an impact reaches, before it; what is along normals first, then tangents.

    Attributes:
        speed: In units in which the matrix answers, < 0 approaching, shape (n, ways).
        gap: In these units times that of ``span``, shape (n,); closed ones may be negative.
        restitution: Of normal speeds, shape (n,).
        rebound: Of slips, as far as friction allows, shape (n,).
        friction: Coulomb's coefficients, shape (n,).
    """

    speed: Floats
    gap: Floats
    restitution: Floats
    rebound: Floats
    friction: Floats

    def strike(self, matrix: Floats, speed: Floats, rows: Integers) -> Floats:
        """Impulses of some contacts at once, by Moreau's law with Coulomb's, (rows, ways).

        Args:
            matrix: Answers of speeds to impulses, shape (n ways, n ways).
            speed: Before, shape (n, ways).
            rows: The contacts.
        """
        ways = speed.shape[1]
        wide = (ways * rows[:, None] + np.arange(ways)).ravel()
        own = matrix[np.ix_(wide, wide)]
        offset = (1.0 + self.rebound[rows, None]) * speed[rows]
        offset[:, 0] = (1.0 + self.restitution[rows]) * speed[rows, 0]
        found = np.zeros_like(offset)
        if self.friction[rows].any():
            from impactfem.contact.friction_newton import ConeProblem  # noqa: PLC0415  (rare)
            from impactfem.contact.friction_solver import Solving, solve  # noqa: PLC0415

            law = ConeProblem(own, offset, self.friction[rows], np.zeros(len(rows)))
            how = Solving.to(_WRONG * float(np.abs(offset).max()))
            return solve(law, found, how)[0]
        if len(rows) == 1:
            found[0, 0] = max(0.0, -offset[0, 0] / own[0, 0])
        else:
            found[:, 0] = complementarity(own[::ways, ::ways], offset[:, 0])
        return found


def in_turn(
    matrix: Floats,
    bodies: Approach,
    span: float,
    rest: float = _AT_REST,
    most: int = _MAX_BINARY,
) -> tuple[Floats, Floats]:
    """Two-body impacts one after the other, until none approaches within a time.

    That which closes first comes first, and of those that close together the fastest.

    Args:
        matrix: Answers of speeds to impulses, shape (n ways, n ways).
        bodies: Before the first.
        span: The time.
        rest: Share of the fastest approach that counts as none.
        most: Number of impacts up to which that is waited for.

    Returns:
        Impulses and speeds after, shape (n, ways) each.

    Raises:
        ConvergenceError: The impacts did not come to an end.
    """
    speed, total = bodies.speed.copy(), np.zeros_like(bodies.speed)
    gap, ways, left = np.maximum(bodies.gap, 0.0), speed.shape[1], span
    least = -rest * float(np.abs(speed[:, 0]).max(initial=0.0))
    for _ in range(most):
        coming = np.flatnonzero(speed[:, 0] < least)
        after = gap[coming] / -speed[coming, 0]
        first = float(after.min(initial=np.inf))
        if first > left + _TOGETHER * span:
            return total, speed
        gap, left = np.maximum(gap + first * speed[:, 0], 0.0), left - first
        soon = coming[after <= first + _TOGETHER * span]
        one = soon[[np.argmin(speed[soon, 0])]]
        impulse = bodies.strike(matrix, speed, one)[0]
        total[one] += impulse
        own = slice(ways * one[0], ways * (one[0] + 1))
        speed += (matrix[:, own] @ impulse).reshape(speed.shape)
    raise ConvergenceError(
        f"contact: {most} two-body impacts at one instant did not separate "
        f'{len(speed)} constraints; use impact_law = "simultaneous"'
    )


def resting_forces(
    factor: Floats, jacobian: Floats, acceleration: Floats, curvature: Floats
) -> Floats:
    """Contact forces of lasting contact: 0 <= lambda _|_ J a + curvature >= 0 [N], shape (n,).

    Args:
        factor: Lower Cholesky factor of M, shape (d, d).
        jacobian: Rows of the constraints that are closed and do not move, shape (n, d).
        acceleration: M^-1 f without contact [m/s^2], shape (d,).
        curvature: (dJ/dt) v - b'' of these constraints, shape (n,).
    """
    matrix, _ = delassus(factor, jacobian)
    return complementarity(matrix, jacobian @ acceleration + curvature)
