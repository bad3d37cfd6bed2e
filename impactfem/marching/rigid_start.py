"""Rigid bodies at rest: what loads leave unbalanced, and what forces do to them.

Places are the ways of their centres and their rotation vectors in space, these times the radii of
gyration. What moves freely is held by mass, as in `impactfem.marching.few_start`.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from impactfem.arrays import Floats
from impactfem.fem import MPI
from impactfem.marching.few_start import BOUND, PATIENCE, extent
from impactfem.marching.rigid_kernels import carried, gathered
from impactfem.system.rigid_modes import RigidModes

if TYPE_CHECKING:
    from impactfem.marching.rigid import RigidBodies

_SLOW = 1e-6  # by which free motions are held where no load tells, over the step squared


class RigidAtRest:
    """Rigid bodies that are stepped at once; see `impactfem.marching.resting.Resting`."""

    def __init__(self, march: "RigidBodies") -> None:
        """Take them where they are."""
        bodies, masses, turn = march.shapes, march.masses, march.frame[1]
        self._march, self.name, self.dim = march, bodies[0].names[0], bodies[0].dim
        count, dim, each = len(masses), self.dim, np.arange(len(masses))
        inertia = turn @ np.array([body.inertia for body in bodies]) @ turn.swapaxes(1, 2)
        self._gyration = np.sqrt(np.trace(inertia, axis1=1, axis2=2) / masses)[:, None]
        self._kept = np.arange(6) if dim == 3 else np.array([0, 1, 5])
        whole = np.zeros((count, 6, count, 6))
        whole[each, :3, each, :3] = masses[:, None, None] * np.eye(3)
        whole[each, 3:, each, 3:] = inertia / self._gyration[:, :, None] ** 2
        size = count * len(self._kept)
        self._mass = whole[:, self._kept][..., self._kept].reshape(size, size)
        self.start, self.patience = np.zeros(size), PATIENCE
        self._offset = march.offsets(np.zeros_like(march.surface_displacement))
        self.size = max(extent(each.places(each.position), each.radius) for each in bodies)
        fields = np.linalg.inv(np.linalg.cholesky(self._mass))
        unit = np.zeros((count, 6, 6))
        unit[:, :3, :3] = np.eye(3)
        unit[:, 3:, 3:] = self._gyration[:, :, None] * np.eye(3)
        units = unit[:, self._kept][..., self._kept].reshape(size, -1)
        loads = units.T @ self._mass @ fields.T
        total = float(masses.sum())
        self.modes = RigidModes(MPI.COMM_SELF, fields, self._mass, loads, total, dim)
        driven = np.abs(self.modes.along(self.residual(self.start)) @ fields).max(initial=0.0)
        # Where joints alone may push, by the step: what nothing holds is found as well so.
        shift = BOUND * driven / self.size or _SLOW / march.dt**2
        self._inverse, self._eased = np.linalg.inv(self._mass) / shift, 1.0
        self._answer: Callable[[Floats], Floats] = lambda forces: np.asarray(self._inverse @ forces)

    def _at(self, place: Floats) -> tuple[Floats, Floats]:
        """Ways of the centres [m] and rotation vectors [rad] in space, (bodies, 3) each."""
        whole = np.zeros((len(self._gyration), 6))
        whole[:, self._kept] = place.reshape(len(whole), -1)
        return whole[:, :3].copy(), whole[:, 3:] / self._gyration

    def _within(self, wrench: Floats) -> Floats:
        """Forces on the coordinates by forces and moments on bodies, (bodies, 6)."""
        scaled = np.hstack([wrench[:, :3], wrench[:, 3:] / self._gyration])
        return np.asarray(scaled[:, self._kept].ravel())

    def contact(self, place: Floats) -> Floats:
        """Displacements of the contact nodes [m], (count, dim)."""
        return self._march.elsewhere(*self._at(place))[0]

    def touch(self, normals: Floats) -> None:
        """Learn where balls touch, by the normals of their nodes (count, dim)."""
        self._offset = self._march.offsets(normals)

    def touching(self, place: Floats) -> Floats:
        """Displacements of what touches [m], (count, dim): balls roll as far as they turn."""
        none = np.zeros((1, *self._at(place)[0].shape))
        turns, march = self._at(place)[1][None], self._march
        rolled = carried(none, turns, march.apart, self._offset, self.dim)[0]
        return np.asarray(self.contact(place) + rolled)

    def moved(self, place: Floats, change: Floats) -> Floats:
        """How that moves by a change of the coordinates from a place [m], (count, dim)."""
        arms = self._march.elsewhere(*self._at(place))[1] + self._offset
        ways, turns = (each[None] for each in self._at(change))
        return np.asarray(carried(ways, turns, self._march.apart, arms, self.dim)[0])

    def pulled(self, forces: Floats, place: Floats) -> Floats:
        """Forces on the coordinates by those on the contact nodes (count, dim) at a place."""
        arms = self._march.elsewhere(*self._at(place))[1] + self._offset
        count = len(self._gyration)
        return self._within(gathered(forces[None], self._march.apart, arms, count)[0])

    def residual(self, place: Floats) -> Floats:
        """Loads at t = 0, without contact."""
        return self._within(self._march.loads_at_rest(*self._at(place)))

    def tangent(self, place: Floats) -> Callable[[Floats], Floats]:  # noqa: ARG002  (all are free)
        """What forces do to what mass holds."""
        return self._answer

    def frames(self, place: Floats) -> tuple[Floats, Floats]:
        """Centres and rotations at a place, (bodies, 3) and (bodies, 3, 3)."""
        (ways, turns), (centres, frames) = self._at(place), self._march.frame
        return centres + ways, Rotation.from_rotvec(turns).as_matrix() @ frames

    def twists(self, change: Floats) -> Floats:
        """How far the bodies move and turn by a small change, (6 bodies,)."""
        return np.hstack(self._at(change)).ravel()

    def wrung(self, wrenches: Floats) -> Floats:
        """Forces on the coordinates by forces and moments on the bodies, (6 bodies,)."""
        return self._within(wrenches.reshape(-1, 6))

    def ease(self, share: float) -> None:
        """Hold free motions by so much of the mass that holds them at first."""
        if share != self._eased:
            self._eased, inverse = share, self._inverse / share
            self._answer = lambda forces: np.asarray(inverse @ forces)

    def steady(self) -> bool:
        """Nothing to change."""
        return False

    def destroy(self) -> None:
        """Nothing to free."""

    def settle(self, place: Floats) -> Floats:
        """Begin at a place; mass times the way there [kg m], (dim,)."""
        ways, turns = self._at(place)
        self._march.put(ways, turns)
        return np.asarray(self._march.masses @ ways[:, : self.dim])
