"""How far a body has turned and been stretched: what linear elasticity takes to be small.

Linear elasticity takes x = X + u with the strain sym(grad u). A body that turns keeps no strain in
it but grows: u = a J (X - c), J a quarter turn, is free of strain and stretches all lengths in the
plane by sqrt(1 + a^2). So its strain says nothing of this fault. What is measured here comes from
the places of the body instead, as one would see them:

- its rotation, the best fit of the places by a rigid motion, weighted by mass (W. Kabsch, Acta
  Cryst. A 32 (1976) 922-923): the polar factor of sum m x (X - c)^T, atan a for the above;
- principal stretches, the singular values of F = I + grad u, less 1 (Biot's principal strains):
  0 for true rotations, sqrt(1 + a^2) - 1 for the above, and the engineering strain for stretches;
- the ratio of volumes, det F.

With an axis of symmetry F has the hoop stretch 1 + u_r / r, in plane stress the stretch of the
thickness that follows from those in the plane.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.fem import MPI, dolfinx_fem
from impactfem.system.elastic import ElasticSystem
from impactfem.system.materials import law_rows, materials_of
from impactfem.system.stretch_kernels import in_plane, in_space

_CHUNK = 10000
"""Cells whose moments of mass are found at once."""

SHARE = 0.01
"""Part of the volume that may exceed the strain that counts: peaks at corners grow with meshes."""


@dataclass(frozen=True)
class Look:
    """A body at one time, on all ranks together.

    Attributes:
        rotation: See `angle_of` [rad].
        strain_max: Largest principal strain, by amount.
        strain_99: The same that 1 % of the volume exceeds, or the known one if that is larger.
        volume_ratio_min: Least det F.
    """

    rotation: float
    strain_max: float
    strain_99: float
    volume_ratio_min: float


def angle_of(fit: Floats) -> float:
    """Angle [rad] of the rotation that is nearest to a matrix: with sign in 2D, >= 0 in space.

    Args:
        fit: Sum of m x (X - c)^T, shape (dim, dim): its polar factor is the best rigid rotation.
    """
    if len(fit) == 2:
        return math.atan2(fit[1, 0] - fit[0, 1], fit[0, 0] + fit[1, 1])
    left, _, right = np.linalg.svd(fit)
    left[:, -1] *= np.sign(np.linalg.det(left @ right))
    turn = left @ right
    skew = turn[[2, 0, 1], [1, 2, 0]] - turn[[1, 2, 0], [2, 0, 1]]
    return math.atan2(float(np.linalg.norm(skew)), float(np.trace(turn)) - 1.0)


class Stretches:
    """Measures rotation and stretches of a body from its displacement, on all ranks together.

    Attributes:
        comm: MPI communicator.
        mass: Of the whole body, whatever planes of symmetry cut away [kg].
        inertia: Of the whole body about its centre of mass [kg m^2]: shape (1, 1) in the plane,
            else (3, 3); with an axis that of the whole turn.
    """

    def __init__(self, system: ElasticSystem, solid: Any) -> None:
        """Prepare (collective).

        Args:
            system: The body, discretised.
            solid: `impactfem.scene.solids.Solid`.
        """
        nodes = system.nodes
        mesh = nodes.space.mesh
        self._system, self.comm = system, system.comm
        self._displacement = dolfinx_fem.Function(nodes.space)
        owned = mesh.topology.index_map(mesh.topology.dim).size_local
        self._cells = np.ascontiguousarray(nodes.space.dofmap.list[:owned])
        made, flat = materials_of(nodes, solid).at(slice(owned)), solid.model == "plane_stress"
        self._across = -made.ratio / (1.0 - made.ratio) * flat
        self._material = np.zeros((0, 0))
        if flat and solid.is_finite:
            self._material = law_rows(made, solid, made.lame)
        self._order = int(nodes.space.ufl_element().degree)
        self._simple = fem.is_simplex(mesh) and self._order == 1
        values, self._table, jacobian, weights = self._points(self._cells, 1 if self._simple else 2)
        self._inverse = np.linalg.inv(jacobian)
        self._hoop = np.zeros((0, 0, 0))
        if system.axisymmetric:
            radius = np.einsum("pk,ck->cp", values, nodes.positions[self._cells, 0])
            self._hoop = values / radius[:, :, None]
        self._weights, self._above = weights, (np.zeros(weights.size), np.zeros(weights.size))
        self._volume = self._sum(weights.sum())
        # What a mirrored half does, the other half undoes: none of it turns the whole.
        planes = dict(system.supports.planes)
        axes = [*planes, *((0,) if system.axisymmetric else ())]
        self._whole = ~np.logical_xor.outer(*[np.isin(np.arange(nodes.dim), axes)] * 2)
        if len(axes) > 1:
            self._whole &= np.eye(nodes.dim, dtype=bool)
        self.mass = system.total_mass * 2 ** len(planes)
        self._fit, self._moment, self.inertia = self._moments(planes)

    def look(self, displacement: Floats, known: float = 0.0) -> Look:
        """Measure the body (collective).

        Args:
            displacement: Owned degrees of freedom [m].
            known: Strain up to which nothing needs to be known, but that it is not more.
        """
        values = self._displacement.x.array
        values[: len(displacement)] = displacement
        self._displacement.x.scatter_forward()
        moved = values.reshape(self._moment.shape)
        cells = self._cells, self._table, self._inverse
        within = self._weights, known, *self._above
        largest, least, above, count = (
            in_space(moved, *cells, *within)
            if moved.shape[1] == 3
            else in_plane(moved, *cells, self._hoop, self._across, self._material, *within)
        )
        sums, ends = np.append(moved.T @ self._moment, above), np.array([largest, -least])
        self.comm.Allreduce(MPI.IN_PLACE, sums, op=MPI.SUM)
        self.comm.Allreduce(MPI.IN_PLACE, ends, op=MPI.MAX)
        fit = np.where(self._whole, self._fit + sums[:-1].reshape(self._fit.shape), 0.0)
        exceeded = self._exceeded(float(sums[-1]), known, count)
        return Look(angle_of(fit), float(ends[0]), exceeded, -float(ends[1]))

    def _exceeded(self, volume: float, known: float, count: int) -> float:
        """The strain that 1 % of the volume exceeds, if it is above one that is known (collective).

        A rank holds what may count among its largest strains, as much as makes 1 % of the volume:
        those of all ranks together hold the answer.

        Args:
            volume: In which the known one is exceeded.
            known: The answer, if that is no more than 1 %.
            count: Number of strains above it on this rank.
        """
        limit = SHARE * self._volume * (1.0 + 1e-9)  # equal cells on any number of ranks
        if not volume > limit:
            return known
        strain, weights = (part[:count] for part in self._above)
        order, place = self._within(strain, weights, limit)
        largest = order[: place + 1]
        parts = self.comm.allgather((strain[largest], weights[largest]))
        values, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
        order, place = self._within(values, weights, limit)
        return float(values[order[min(place, len(order) - 1)]])

    @staticmethod
    def _within(values: Floats, weights: Floats, limit: float) -> tuple[Integers, int]:
        """Order of falling values, and how many of the first weigh no more than a limit."""
        order = np.argsort(-values, kind="stable")
        return order, int(np.searchsorted(np.cumsum(weights[order]), limit, side="right"))

    def _points(self, cells: Any, degree: int) -> tuple[Floats, Floats, Floats, Floats]:
        """Points of a quadrature rule in cells.

        Returns:
            Shape functions (points, corners), their reference gradients (points, corners, dim),
            the Jacobian (cells, points, dim, dim) and weights (cells, points), which with an axis
            hold the distance from it.
        """
        nodes = self._system.nodes
        name = nodes.space.mesh.topology.cell_type.name
        places, parts = fem.cell_quadrature(name, degree)
        values, grads = fem.coordinate_basis(name, self._order, places)
        table = np.ascontiguousarray(np.moveaxis(grads, 0, -1))
        corners = nodes.positions[cells]
        jacobian = np.einsum("cki,pkj->cpij", corners, table)
        weights = np.abs(np.linalg.det(jacobian)) * parts
        if self._system.axisymmetric:
            weights = weights * np.einsum("pk,ck->cp", values, corners[:, :, 0])
        return values, table, jacobian, weights

    def _moments(self, planes: dict[int, float]) -> tuple[Floats, Floats, Floats]:
        """Moments of mass about the centre of what is modelled, and the inertia of the whole body.

        Returns:
            Second moments, shape (dim, dim), what each local node adds to them by its place, shape
            (nodes, dim), and the inertia.
        """
        system, dim = self._system, self._system.dim
        positions, mass, centre = system.nodes.positions, system.total_mass, system.center_of_mass
        second, moment, total = np.zeros((dim, dim)), np.zeros((len(positions), dim)), 0.0
        degree = (2 if self._simple else 5) + system.axisymmetric
        for first in range(0, len(self._cells), _CHUNK):
            cells = self._cells[first : first + _CHUNK]
            values, _, _, weights = self._points(cells, degree)
            arm = np.einsum("pk,cki->cpi", values, positions[cells]) - centre
            second += np.einsum("cp,cpi,cpj->ij", weights, arm, arm)
            np.add.at(moment, cells, np.einsum("cp,pk,cpi->cki", weights, values, arm))
            total += weights.sum()
        density = mass / self._sum(total)
        second, moment = density * self._sum(second), density * moment
        whole = second * self.mass / mass
        for axis, level in planes.items():  # the whole is centred there, mixed moments cancel
            square = whole[axis, axis] + self.mass * (centre[axis] - level) ** 2
            whole[axis, :] = whole[:, axis] = 0.0
            whole[axis, axis] = square
        if system.axisymmetric:  # x is the distance from the axis: half its square along x and z
            whole = np.diag([0.5 * whole[0, 0], whole[1, 1], 0.5 * whole[0, 0]])
        inertia = np.trace(whole) * np.eye(len(whole)) - whole
        return second, moment, inertia if len(whole) == 3 else np.trace(whole).reshape(1, 1)

    def _sum(self, value: Any) -> Any:
        return self.comm.allreduce(value, op=MPI.SUM)
