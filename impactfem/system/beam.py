"""The free elastic beam in the plane as a linear system with contact of its axis.

The beam bends and stretches in the frame of its place at t = 0, at the angle alpha to the x axis:
a point s of its axis lies at c + (s + a) t + w n, with t = (cos alpha, sin alpha), n = t turned by
90 degrees, and M u'' + C u' + K u = M R g. Rotations, also those of the rigid body, are linearised
about that place: the change of angle during the motion is neglected, which holds for one short
contact (`FreeBeam.angle` tells how well). Half-spaces give G u + c0 >= 0 with rows N . (a t + w n).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene.beams import Beam
from impactfem.scene.obstacles import HalfSpace
from impactfem.system.beam_load import BeamForces, BeamLoad
from impactfem.system.beam_matrices import BeamMatrices, beam_matrices
from impactfem.system.beam_parts import BeamParts, beam_parts
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.system.rod import planes


@dataclass(frozen=True)
class FreeBeam:
    """A discretised beam at its place at t = 0.

    Attributes:
        beam: The beam.
        matrices: Mass and stiffness in its own frame.
    """

    beam: Beam
    matrices: BeamMatrices

    @cached_property
    def parts(self) -> BeamParts:
        """It as its ends are held."""
        return beam_parts(self.beam)

    @property
    def kept(self) -> NDArray[np.int64]:
        """Coordinates that are not held, among all."""
        return self.parts.kept

    def spread(self, field: Floats) -> Floats:
        """All coordinates (..., d) of those that are not held: 0 where they are."""
        found = np.zeros((*field.shape[:-1], len(self.matrices.mass)), dtype=field.dtype)
        found[..., self.kept] = field
        return found

    def elastic(self, u: Floats) -> float:
        """Energy of it and its springs [J]."""
        return self.parts.elastic(u)

    @property
    def axes(self) -> tuple[Floats, Floats]:
        """Unit vectors t along the axis and n across it, each (2,)."""
        along, across = self.beam.frame
        return along, across

    @cached_property
    def rigid_modes(self) -> Floats:
        """R: coordinates of unit motions along x and y, and about the centre, shape (d, 3)."""
        modes = np.zeros((len(self.matrices.mass), 3))
        (tx, ty), (nx, ny) = self.axes
        axial = 3 * np.arange(len(self.matrices.nodes))
        modes[axial, :2] = tx, ty
        modes[self.matrices.deflections, :2] = nx, ny
        modes[self.matrices.deflections, 2] = self.matrices.places
        modes[self.matrices.rotations, 2] = 1.0
        return modes

    @property
    def rigid_mass(self) -> Floats:
        """R^T M R: diag(m, m, J), shape (3, 3)."""
        found: Floats = self.rigid_modes.T @ self.matrices.mass @ self.rigid_modes
        return found

    def rigid_part(self, field: Floats) -> Floats:
        """Rigid motion (x, y, angle) with the same momentum and moment of momentum.

        Args:
            field: Displacements or velocities, shape (..., d).

        Returns:
            Shape (..., 3).
        """
        projection = np.linalg.solve(self.rigid_mass, self.rigid_modes.T @ self.matrices.mass)
        return np.asarray(self.spread(field) @ projection.T)

    def angle(self, positions: Floats) -> float:
        """Largest change of the rigid angle in a motion, which the model neglects [rad].

        Where ends are held, that of the steepest section.
        """
        if self.beam.supports:
            slopes = self.spread(np.atleast_2d(positions))[:, self.matrices.rotations]
            return float(np.abs(slopes).max())
        return float(np.abs(self.rigid_part(np.atleast_2d(positions))[:, 2]).max())

    def frequencies(self, count: int) -> Floats:
        """The first angular frequencies, the three zeros of the free beam included [rad/s]."""
        squares = eigh(
            self.matrices.stiffness,
            self.matrices.mass,
            eigvals_only=True,
            subset_by_index=(0, count - 1),
        )
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))

    def points(self, displacement: Floats) -> Floats:
        """Places of the nodes of the axis [m], shape (..., n + 1, 2), of coordinates (..., d)."""
        along, across = self.axes
        first = 3 * np.arange(len(self.matrices.nodes))
        moved = self.spread(displacement)
        a, w = moved[..., first, None], moved[..., first + 1, None]
        offset = (self.matrices.nodes[:, None] + a) * along + w * across
        return np.asarray(self.beam.center, dtype=float) + offset

    @property
    def start(self) -> tuple[Floats, Floats]:
        """Displacement (zero) and velocity of the coordinates at t = 0, each (d,).

        The velocity is rigid but where ends are held.
        """
        return np.zeros(len(self.kept)), (self.rigid_modes @ self.beam.rates)[self.kept]

    @property
    def touching(self) -> NDArray[np.int64]:
        """Nodes that may touch half-spaces."""
        return np.flatnonzero(self.parts.touching)

    def system(
        self,
        half_spaces: HalfSpace | Sequence[HalfSpace],
        gravity: Sequence[float] = (0.0, 0.0),
        restitution: float | Sequence[float] = 0.0,
    ) -> GeneralizedSystem:
        """Let the beam meet half-spaces: linear, unless its load is none that stays."""
        normals, levels = planes(half_spaces)
        pull = np.asarray(gravity, dtype=float)
        if pull.shape != (2,) or not np.isfinite(pull).all():
            raise SceneError(f"beam: gravity = {gravity} is not allowed: give two numbers")
        size, kept, own = len(self.matrices.mass), self.kept, self.matrices
        along, across = self.axes
        places = self.points(np.zeros(len(kept)))
        rows, offsets = [], []
        for normal, level in zip(normals, levels, strict=True):
            for k in self.touching:
                row = np.zeros(size)
                row[3 * k], row[3 * k + 1] = normal @ along, normal @ across
                rows.append(row[kept])
                offsets.append(normal @ places[k] - level)
        steady = (own.mass @ self.rigid_modes[:, :2] @ pull)[kept]
        mass, stiffness, damping = self.parts.mass, self.parts.stiffness, self.parts.damping
        load = BeamLoad.of(self.parts)
        if load is not None and load.is_dead:
            steady = steady + load.mean(0.0, 0.0, np.zeros(len(kept)))
        names = [self._names(size)[k] for k in kept]
        jacobian, offset = np.array(rows).reshape(-1, len(kept)), np.array(offsets)
        if load is None or load.is_dead:
            return LinearSystem(
                mass=mass, stiffness=stiffness, damping=damping, load=steady.tolist(),
                normals=jacobian, offsets=offset, restitution=restitution, names=names,
            )  # fmt: skip
        return GeneralizedSystem(
            mass=mass, force=BeamForces(load, stiffness, damping, steady),
            constraints=lambda u: jacobian @ u + offset, jacobian=jacobian,
            restitution=restitution, names=names,
            potential=lambda _, u: float(0.5 * u @ (stiffness @ u) - steady @ u),
        )  # fmt: skip

    def _names(self, size: int) -> tuple[str, ...]:
        words = ("axial", "deflection", "rotation")
        names = [f"{word}[{k}]" for k in range(len(self.matrices.nodes)) for word in words]
        return (*names, *(f"inner[{k}]" for k in range(size - len(names))))


def free_beam(beam: Beam) -> FreeBeam:
    """Discretise a beam by its theory and number of elements."""
    return FreeBeam(beam, beam_matrices(beam))
