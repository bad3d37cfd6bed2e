"""Masses and springs at rest: what loads leave unbalanced, and what forces do to them.

Places are those of the free masses, less where they are given. What moves freely is held by mass,
as in `impactfem.marching.few_start`.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import diags
from scipy.sparse.linalg import splu

from impactfem.arrays import Floats
from impactfem.fem import MPI
from impactfem.marching.few_start import BOUND, FewAtRest, extent
from impactfem.system.rigid_modes import RigidModes, unit_spins

if TYPE_CHECKING:
    from impactfem.marching.net import NetMidpoint

_HELD = 1e-12  # share of a motion below which no support holds it
_UPRIGHT = 10.0  # times the mass that holds what is free, so that what stands does not turn
_LIGHT = 1e-9  # share of the stiffness by mass that holds what no spring does


class NetAtRest(FewAtRest):
    """Masses and springs; see `impactfem.marching.resting.Resting`."""

    _march: "NetMidpoint"  # type: ignore[assignment]
    patience = 40  # what bends far takes passes

    def __init__(self, march: "NetMidpoint") -> None:
        """Take them where they are."""
        bodies = march.bodies
        self._march, self._q = march, march.coordinates.copy()
        self.name, self.start = bodies.names[0], np.zeros(len(self._q))
        places, free, dim = bodies.places(self._q), bodies.free, bodies.dim
        self.size = extent(places, bodies.radius)
        mass = np.repeat(bodies.node_mass[free], dim)
        arms = (places - bodies.node_mass @ places / bodies.masses[0]) / self.size
        raw = np.array([np.broadcast_to(axis, arms.shape) for axis in np.eye(dim)])
        raw = np.concatenate([raw, unit_spins(arms)])
        held = np.delete(raw, free, axis=1).reshape(len(raw), -1)
        hold, ways = np.linalg.eigh(held @ held.T)
        every = raw[:, free].reshape(len(raw), -1)
        fields = ways[:, hold <= _HELD].T @ every
        if len(fields):
            fields = np.linalg.inv(np.linalg.cholesky((fields * mass) @ fields.T)) @ fields
        scale = np.where(np.arange(len(raw)) < dim, 1.0, self.size)
        loads = scale[:, None] * ((every * mass) @ fields.T)
        self.modes = RigidModes(MPI.COMM_SELF, fields, mass, loads, bodies.masses[0], dim)
        driven = np.abs(self.modes.along(self.residual(self.start)) @ fields).max(initial=0.0)
        stiffest = float((march.stiffness_at(self._q).tocsr().diagonal() / mass).max())
        self._light = _LIGHT * stiffest
        # Springs that bear weight would have what stands turn, by 6 / size of it at most.
        self._shift = max(_UPRIGHT * BOUND * driven / self.size, float(np.finfo(float).tiny))
        self._weights, self._eased = mass, 1.0
        self._answer: Callable[[Floats], Floats] | None = None

    def residual(self, place: Floats) -> Floats:
        """Loads less internal forces at t = 0, without contact."""
        return self._march.unbalanced_at(self._q + place)

    def tangent(self, place: Floats) -> Callable[[Floats], Floats]:
        """What forces on the coordinates do, with mass that holds what is free."""
        held = self._light + (self._eased * self._shift if self.modes.count else 0.0)
        matrix = self._march.stiffness_at(self._q + place) + diags(held * self._weights)
        factor = splu(matrix.tocsc())
        return lambda forces: np.asarray(factor.solve(np.ascontiguousarray(forces)))

    def contact(self, place: Floats) -> Floats:
        """Displacements of the contact nodes [m], (count, dim)."""
        return self._march.displaced(self._q + place)

    def moved(self, place: Floats, change: Floats) -> Floats:  # noqa: ARG002  (masses touch)
        """How they move by a change of the coordinates from a place [m], (count, dim)."""
        return self._march.spread(change)

    def pulled(self, forces: Floats, place: Floats) -> Floats:  # noqa: ARG002  (masses touch)
        """Forces on the coordinates by those on the contact nodes (count, dim)."""
        return np.asarray(forces[self._march.bodies.free].ravel())

    def turned(self, place: Floats) -> Floats:  # noqa: ARG002  (sums tell how it lies)
        """Nothing: sums tell how it lies."""
        return np.zeros(2 * self._march.bodies.dim - 3)

    def settle(self, place: Floats) -> Floats:
        """Begin at a place; mass times the way there [kg m], (dim,)."""
        march = self._march
        march.put(self._q + place)
        return np.asarray(march.bodies.node_mass @ march.spread(place))
