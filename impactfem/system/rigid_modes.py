"""How a body can move without strain and against no support."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.fem import MPI
from impactfem.system.elastic import ElasticSystem

_HELD = 1e-12  # share of the largest hold below which supports do not hold a motion
_PLAIN = 0.999  # share of a direction from which it is named by a single axis
_AXES = "xyz"


@dataclass(frozen=True)
class RigidModes:
    """Rigid motions that supports leave free, orthonormal by mass.

    Attributes:
        comm: MPI communicator.
        fields: Of the owned dofs, shape (modes, dofs).
        weights: Mass of each dof [kg], (dofs,), or of all of them, (dofs, dofs).
        loads: Forces [N] along the axes and moments [N m] about the centre of mass that work on
            each mode as much as on all of them, (motions, modes).
        mass: Of the body [kg].
        dim: Number of coordinates.
    """

    comm: Any
    fields: Floats
    weights: Floats
    loads: Floats
    mass: float
    dim: int

    @classmethod
    def of(cls, system: ElasticSystem, place: Floats | None = None) -> "RigidModes":
        """Find those of a body; an axisymmetric one moves along its axis only (collective).

        Args:
            system: The body.
            place: Displacement of the owned dofs [m] with which it moves on; None: undeformed.
        """
        comm, size = system.comm, system.nodes.size
        arms = (system.positions - system.center_of_mass) / size
        if place is not None:
            arms = arms + place.reshape(arms.shape) / size
        axes = range(1, 2) if system.axisymmetric else range(system.dim)
        motions = [np.tile(np.eye(system.dim)[axis], len(arms)) for axis in axes]
        if not system.axisymmetric:
            motions += [spin.ravel() for spin in unit_spins(arms)]
        raw = np.array(motions)
        held = np.where(system.constrained, raw, 0.0)
        hold, ways = np.linalg.eigh(comm.allreduce(held @ held.T, op=MPI.SUM))
        loose = ways[:, hold <= _HELD * max(hold[-1], 1.0)].T
        weights = np.where(system.constrained, 0.0, np.repeat(system.node_mass, system.dim))
        fields = loose @ raw
        fields[:, system.constrained] = 0.0  # but for rounding
        gram = np.asarray(comm.allreduce((fields * weights) @ fields.T, op=MPI.SUM))
        turn = np.linalg.inv(np.linalg.cholesky(gram)) if len(loose) else np.zeros((0, 0))
        fields = turn @ fields
        scale = np.where(np.arange(len(raw)) < len(axes), 1.0, size)
        loads = scale[:, None] * comm.allreduce((raw * weights) @ fields.T, op=MPI.SUM)
        return cls(comm, fields, weights, loads, system.total_mass, system.dim)

    @classmethod
    def none(cls, dofs: int) -> "RigidModes":
        """Of a body that supports hold, all of it on each rank."""
        return cls(MPI.COMM_SELF, np.zeros((0, dofs)), np.zeros(dofs), np.zeros((0, 0)), 0.0, 3)

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.fields)

    def _times_mass(self, values: Floats) -> Floats:
        diagonal = self.weights.ndim == 1
        return np.asarray(self.weights * values if diagonal else self.weights @ values)

    def along(self, forces: Floats) -> Floats:
        """Parts of forces on the owned dofs that work on each mode, (modes,) (collective)."""
        return np.asarray(self.comm.allreduce(self.fields @ forces, op=MPI.SUM))

    def moved(self, displacement: Floats) -> Floats:
        """How far a displacement of the owned dofs is one along each mode (collective)."""
        return self.along(self._times_mass(displacement))

    def of_displacement(self, displacement: Floats) -> Floats:
        """Rigid part of a displacement of the owned dofs, (dofs,) (collective)."""
        return np.asarray(self.moved(displacement) @ self.fields)

    def forces(self, along: Floats) -> Floats:
        """Forces on the owned dofs that accelerate the body along the modes, (dofs,)."""
        return self._times_mass(along @ self.fields)

    def push(self, along: Floats) -> float:
        """Force that would accelerate all of the body as much [N]: `along` as of that method."""
        return float(np.linalg.norm(along) * np.sqrt(self.mass))

    def words(self, along: Floats) -> str:
        """The motion that forces drive and how hard, in words."""
        loads = self.loads @ along
        count = self.dim if len(loads) > 1 else 1
        force, moment = loads[:count], loads[count:]
        turning = self.push(along) - float(np.linalg.norm(force)) > 0.5 * self.push(along)
        if turning:
            axis = _named(moment, "z" if self.dim == 2 else _AXES)
            size = float(np.linalg.norm(moment))
            return f"rotation about {axis} through its centre of mass, driven by {size:.4g} N m"
        axis = _named(force, "y" if count < self.dim else _AXES)
        return f"translation along {axis}, driven by {float(np.linalg.norm(force)):.4g} N"


def unit_spins(arms: Floats) -> list[Floats]:
    """Velocities (nodes, dim) of places that turn with 1 rad/s, in the plane or about each axis."""
    if arms.shape[1] == 2:
        return [np.stack([-arms[:, 1], arms[:, 0]], axis=1)]
    return [np.cross(axis, arms) for axis in np.eye(3)]


def spun(arms: Floats, spin: Floats) -> Floats:
    """Velocities (nodes, dim) of places that turn, by their arms; spin [rad/s] (1,) or (3,)."""
    found: Floats = np.einsum("k,kij->ij", spin, np.array(unit_spins(arms)))
    return found


def _named(vector: Floats, axes: str) -> str:
    """An axis, or a direction."""
    way = vector / np.linalg.norm(vector)
    largest = int(np.argmax(np.abs(way)))
    if abs(way[largest]) > _PLAIN:
        return axes[largest]
    return "(" + ", ".join(f"{value + 0.0:.2g}" for value in way) + ")"
