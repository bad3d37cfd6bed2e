"""The start of schemes with time steps: impacts and lasting contact at t = 0."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve

from impactfem.arrays import Floats
from impactfem.contact.impact_law import delassus, resolve_impact, resting_forces
from impactfem.system.generalized import GeneralizedSystem
from impactfem.system.joined import Forced, Room, advanced

_CLOSED = 1e-12  # share of the largest coordinate below which a gap counts as closed
_AT_REST = 1e-12  # share of the largest velocity that counts as none


@dataclass(frozen=True)
class Start:
    """What the first step needs: U^0, U^0 - U^{-1}, the gaps at both, and impacts at t = 0 (n, 5).

    U^{-1} = u0 - h v0 + h^2 a0 / 2 is the free motion back, so that U^1 = u0 + h v0 + h^2 a0 / 2
    unless something is hit in the first step; then it is hit with restitution. v0 is taken after
    the impact of constraints that are closed and approach; a0 contains the forces of those that
    rest.
    """

    position: Floats
    change: Floats
    gap: Floats
    before: Floats
    impacts: Floats


def start_positions(
    system: GeneralizedSystem, u: Floats, v: Floats, h: float, weight: Floats
) -> Start:
    """The start of the scheme.

    Args:
        system: The system.
        u: u0, shape (d,).
        v: v0, shape (d,).
        h: Time step [s].
        weight: M + beta h^2 K, shape (d, d).
    """
    gap = system.gap(0.0, u)
    closed = np.flatnonzero(gap <= _CLOSED * max(float(np.abs(u).max()), 1e-300))
    jacobian = system.jacobian(u)[closed]
    rate = system.motion_rate(0.0)[closed]
    room, impacts = Room.at(system, u), np.zeros((0, 5))
    own = room.rows(jacobian)
    if len(closed) and ((jacobian @ v - rate) < 0.0).any():
        e = system.restitution[closed]
        hit = resolve_impact(room.factor, own, room.own(v), rate, e)
        v = room.full(hit.velocity)
        table = np.stack([0.0 * rate, closed, hit.before, hit.after, hit.impulse], axis=1)
        impacts = table[hit.impulse > 0.0]
    factor: Floats = np.linalg.cholesky(room.load(room.rows(weight)))
    forced = Forced.at(system, 0.0, u, v, room)
    acceleration = cho_solve((factor, True), forced.load)
    speed = jacobian @ v - rate
    size = float(np.abs(v).max(initial=0.0))
    rests = speed <= _AT_REST * size
    if rests.any():
        curvature = (system.gap_curvature(0.0, u, v)[closed] + jacobian @ forced.drift)[rests]
        force = resting_forces(factor, own[rests], acceleration, curvature)
        acceleration += delassus(factor, own[rests])[1] @ force
    change = h * v - 0.5 * h * h * forced.full(acceleration)
    wall = system.motion_at(-h)
    if not np.isfinite(wall).all():  # a motion that is not known before t = 0
        wall = 2.0 * system.motion_at(0.0) - system.motion_at(h)
    before = system.gap(0.0, advanced(system, u, -change)) + system.motion_at(0.0) - wall
    return Start(u, change, gap, before, impacts)
