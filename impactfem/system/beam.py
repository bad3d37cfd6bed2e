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

from impactfem.errors import SceneError
from impactfem.scene.beams import Beam
from impactfem.scene.obstacles import HalfSpace
from impactfem.system.beam_matrices import BeamMatrices, beam_matrices
from impactfem.system.generalized import LinearSystem
from impactfem.system.rod import planes

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FreeBeam:
    """A discretised beam at its place at t = 0.

    Attributes:
        beam: The beam.
        matrices: Mass and stiffness in its own frame.
    """

    beam: Beam
    matrices: BeamMatrices

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
        return np.asarray(field @ projection.T)

    def angle(self, positions: Floats) -> float:
        """Largest change of the rigid angle in a motion, which the model neglects [rad]."""
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

    @property
    def damping(self) -> Floats:
        """C = alpha M + beta K, shape (d, d)."""
        alpha, beta = self.beam.rayleigh_damping
        return alpha * self.matrices.mass + beta * self.matrices.stiffness

    def points(self, displacement: Floats) -> Floats:
        """Places of the nodes of the axis [m], shape (..., n + 1, 2), of coordinates (..., d)."""
        along, across = self.axes
        first = 3 * np.arange(len(self.matrices.nodes))
        a, w = displacement[..., first, None], displacement[..., first + 1, None]
        offset = (self.matrices.nodes[:, None] + a) * along + w * across
        return np.asarray(self.beam.center, dtype=float) + offset

    @property
    def start(self) -> tuple[Floats, Floats]:
        """Displacement (zero) and velocity (rigid) of the coordinates at t = 0, each (d,)."""
        return np.zeros(len(self.rigid_modes)), self.rigid_modes @ self.beam.rates

    def system(
        self,
        half_spaces: HalfSpace | Sequence[HalfSpace],
        gravity: Sequence[float] = (0.0, 0.0),
        restitution: float | Sequence[float] = 0.0,
    ) -> LinearSystem:
        """Let the beam meet half-spaces; see `beam_system`."""
        normals, levels = planes(half_spaces)
        pull = np.asarray(gravity, dtype=float)
        if pull.shape != (2,) or not np.isfinite(pull).all():
            raise SceneError(f"beam: gravity = {gravity} is not allowed: give two numbers")
        nodes, size = self.matrices.nodes, len(self.matrices.mass)
        touching = np.arange(len(nodes)) if self.beam.touches_along else [0, len(nodes) - 1]
        along, across = self.axes
        places = self.points(np.zeros(size))
        rows, offsets = [], []
        for normal, level in zip(normals, levels, strict=True):
            for k in touching:
                row = np.zeros(size)
                row[3 * k], row[3 * k + 1] = normal @ along, normal @ across
                rows.append(row)
                offsets.append(normal @ places[k] - level)
        weight = self.matrices.mass @ self.rigid_modes[:, :2] @ pull
        return LinearSystem(
            mass=self.matrices.mass,
            stiffness=self.matrices.stiffness,
            damping=self.damping,
            load=weight.tolist(),
            normals=rows,
            offsets=offsets,
            restitution=restitution,
            names=self._names(size),
        )

    def _names(self, size: int) -> tuple[str, ...]:
        words = ("axial", "deflection", "rotation")
        names = [f"{word}[{k}]" for k in range(len(self.matrices.nodes)) for word in words]
        return (*names, *(f"inner[{k}]" for k in range(size - len(names))))


def free_beam(beam: Beam) -> FreeBeam:
    """Discretise a beam by its theory and number of elements."""
    return FreeBeam(beam, beam_matrices(beam))
