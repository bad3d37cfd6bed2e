"""The projection of a step on the constraints, in the metric of M, where they may be curved.

For one restitution e the step of Paoli and Schatzman keeps Z = (U_new + e U_old) / (1 + e) in
K = {phi >= b}: U_new = U_free + (1 + e) M^-1 J(Z)^T mu is the condition that Z is the projection
of (U_free + e U_old) / (1 + e) in the metric of M. Several e_j have a point Z_j each, and
0 <= P_j _|_ phi_j(Z_j) - b_j >= 0 with U_new = U_free + M^-1 sum J_j(Z_j)^T P_j; near flat parts
this is 0 <= P _|_ w_new + e w_old >= 0, the law of simultaneous impacts.
"""

from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.impact_law import complementarity, delassus
from impactfem.errors import ConvergenceError
from impactfem.system.generalized import GeneralizedSystem
from impactfem.system.joined import Room, advanced

_MAX_LINEARISATIONS = 60
_EPS = np.finfo(float).eps
_STALLED = 1e-12  # share of the lengths below which a change that no longer shrinks is rounding


@dataclass(frozen=True)
class Projected:
    """A projection.

    Attributes:
        change: What is added to the way of the step without contact, shape (d,).
        impulse: P = h^2 lambda, >= 0, shape (J,).
        linearisations: Complementarity problems solved.
    """

    change: Floats
    impulse: Floats
    linearisations: int


def project(room: Room, u: Floats, free: Floats, old: Floats, wall: Floats) -> Projected:
    """Change the way of a step so that the points Z_j obey their constraints.

    By successive linearisation: the error falls by a factor of the order of curvature times
    penetration, O(h), at each. Bilateral rows hold at U_new, by multipliers along the rows at U.

    Args:
        room: Mass and rows at U.
        u: U, shape (coordinates,).
        free: Way from U without contact, in velocities times h, shape (d,).
        old: Way to U, shape (d,).
        wall: (b_new + e b_old) / (1 + e), shape (J,).

    Raises:
        ConvergenceError: The linearisations do not settle.
    """
    system, e = room.system, room.system.restitution
    held, pushed, impulse = np.zeros_like(free), np.zeros_like(free), np.zeros(len(e))
    length = float(np.abs(u).max(initial=0.0))
    settled = 1e-13 * float(np.abs(free + old).max(initial=0.0)) + 8.0 * _EPS * length
    done, last = 0, np.inf
    for _ in range(_MAX_LINEARISATIONS):
        new = free + held + pushed
        following, closing = np.zeros_like(free), np.zeros_like(free)
        gap, jacobian = _at_points(system, u, new, old, wall, need=bool(done))
        if jacobian is not None:
            offset = (1.0 + e) * gap - jacobian @ pushed  # without contact, linearised
            coupling, answers = delassus(room.factor, room.rows(jacobian))
            impulse, done = complementarity(coupling, offset), done + 1
            following = room.full(answers @ impulse)
        if system.bilateral is not None and room.back is not None:
            way = room.back @ np.atleast_1d(system.bilateral(advanced(system, u, new)))
            closing = way - room.full(room.own(way))
        moved = float(np.abs(following - pushed - closing).max(initial=0.0))
        held, pushed = held - closing, following
        if moved <= settled or (moved <= _STALLED * length and moved >= 0.5 * last):
            return Projected(held + pushed, impulse, done)
        last = moved
    raise ConvergenceError(
        f"contact: the projection on the constraints did not settle in {_MAX_LINEARISATIONS} "
        f"linearisations (last change {moved:.1e}); use a smaller dt"
    )


def _at_points(
    system: GeneralizedSystem, u: Floats, new: Floats, old: Floats, wall: Floats, *, need: bool
) -> tuple[Floats, Floats | None]:
    """phi_j(Z_j) - b_j (J,) and J_j(Z_j) (J, d); None if all are >= 0 and it is not needed."""
    e = system.restitution
    first = float(e[0]) if len(e) else 0.0
    if not need and (e == first).all():  # one point, in most steps far from any wall
        point = advanced(system, u, (new - first * old) / (1.0 + first))
        gap = system.gap(0.0, point) + system.motion_at(0.0) - wall
        if not (gap < 0.0).any():
            return gap, None
    groups = [(float(value), np.flatnonzero(e == value)) for value in np.unique(e)]
    points = [advanced(system, u, (new - value * old) / (1.0 + value)) for value, _ in groups]
    gap = -wall
    for (_, rows), point in zip(groups, points, strict=True):
        gap[rows] += system.gap(0.0, point)[rows] + system.motion_at(0.0)[rows]
    if not need and not (gap < 0.0).any():
        return gap, None
    jacobian = np.zeros((len(e), len(new)))
    for (_, rows), point in zip(groups, points, strict=True):
        jacobian[rows] = system.jacobian(point)[rows]
    return gap, jacobian
