"""What drives a body besides its inertia: gravity, loads and moved supports, for time schemes."""

from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.fem import MPI
from impactfem.system.elastic import ElasticSystem
from impactfem.system.massless import transferred


class Drive:
    """Forces on the free dofs of this rank, those of massless nodes moved to their neighbours.

    Attributes:
        is_active: Whether there is anything but gravity, on any rank.
        moved: Owned dofs that supports move, shape (moved,).
        has_moved: Whether supports move any dof, on any rank.
    """

    def __init__(self, system: ElasticSystem, transfer: Any) -> None:
        """Look what there is (collective)."""
        self._system, self._transfer = system, transfer
        self._none = np.zeros(system.dim)
        self._load = np.zeros(len(system.constrained))
        self.moved = system.supports.moved
        self.has_moved = bool(system.supports.formulas)
        loads = system.loads
        steady = loads.is_steady and not loads.at(0.0, self._load, self._none).any()
        self._has_loads = bool(system.comm.allreduce(not steady, op=MPI.LOR))
        self.is_active = self._has_loads or self.has_moved

    def gravity(self, start: float, end: float) -> Floats:
        """Mean gravity between two times [m/s^2], shape (dim,)."""
        return self._system.loads.mean_gravity(start, end)

    def load(self, start: float, end: float) -> Floats:
        """Mean tractions and pressures [N], shape (owned dofs,): a new array (collective)."""
        if not self._has_loads:
            return np.zeros(len(self._load))
        self._system.loads.mean(start, end, self._load, self._none)
        self._load[self._system.constrained] = 0.0
        return transferred(self._transfer, self._load)

    def lift(self, time: float) -> Floats:
        """Elastic and damping forces of moved supports on the rest [N], (owned dofs,)."""
        if self._system.matrices.moved_stiffness is None:
            return np.zeros(len(self._load))
        place, speed, _ = self._system.supports.motion(time)
        return self.lifted(place + self._system.rayleigh_stiffness * speed)

    def lifted(self, place: Floats) -> Floats:
        """Elastic forces on the rest by places (moved,) of moved supports [N], (owned dofs,)."""
        matrix = self._system.matrices.moved_stiffness
        if matrix is None:
            return np.zeros(len(self._load))
        source, image = matrix.createVecs()
        source.setArray(place)
        matrix.mult(source, image)
        found: Floats = -image.getArray()
        found[self._system.constrained] = 0.0
        source.destroy()
        image.destroy()
        return found

    def pull(self, time: float, share: float = 1.0, held: Floats | None = None) -> Floats | None:
        """What moves contact nodes without mass in their equilibrium, (owned dofs,); None: nothing.

        Elastic forces of moved supports, and on dofs that these move themselves their place: such
        rows have 1 on the diagonal.

        Args:
            time: [s].
            share: Times which what moved supports do counts.
            held: Places of the owned dofs that count besides [m]; None: none.
        """
        if not self.has_moved:
            return None
        found = self.lift(time)
        found[self.moved] = self._system.supports.motion(time)[0]
        if held is not None:
            found *= share
            found += self.lifted(held[self.moved])
            found[self.moved] += held[self.moved]
        return found

    def moments(self, field: Floats) -> Floats:
        """Mass times a field of the owned dofs, on this rank, (dim,).

        With what supports hold: schemes have no mass there.
        """
        return np.asarray(self._system.node_mass @ field.reshape(-1, self._system.dim))

    def elastic(self, displacement: Floats, other: Floats) -> float:
        """Elastic energy that moved supports add to u K u / 2 of the free dofs, on this rank [J].

        Args:
            displacement: One factor u [m], shape (owned dofs,).
            other: The other one.
        """
        matrix = self._system.matrices.moved_stiffness
        if matrix is None:
            return 0.0
        source, image = matrix.createVecs()
        found = 0.0
        for first, second in ((displacement, other), (other, displacement)):
            source.setArray(second[self.moved])
            matrix.mult(source, image)
            shares = np.where(self._system.constrained, 0.5 * first, first)
            found += 0.5 * float(shares @ image.getArray())
        source.destroy()
        image.destroy()
        return found

    def reaction(self, displacement: Floats) -> Floats:
        """Elastic forces of the body on moved supports, reversed, on this rank [N], (moved,).

        Args:
            displacement: Shape (owned dofs,).
        """
        matrix = self._system.matrices.moved_stiffness
        if matrix is None:
            return np.zeros(len(self.moved))
        source, image = matrix.createVecs()
        image.setArray(displacement)
        matrix.multTranspose(image, source)
        found: Floats = source.getArray().copy()
        source.destroy()
        image.destroy()
        return found
