"""The surface of a body on every rank: its faces, their normals and the areas of their nodes."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Booleans, Floats, Integers
from impactfem.fem import MPI, dolfinx_mesh

_FACETS = {
    "triangle": "interval",
    "quadrilateral": "interval",
    "tetrahedron": "triangle",
    "hexahedron": "quadrilateral",
}
_POINTS = 4  # Gauss points in each direction: degree 7 on a straight side


class Body(Protocol):
    """A mesh with named surfaces and node numbers that do not depend on the number of ranks."""

    @property
    def mesh(self) -> Any:
        """DOLFINx mesh whose geometry has the degree of the elements."""

    @property
    def surfaces(self) -> Mapping[str, NDArray[np.int32]]:
        """Local facets of each named surface, the same names on every rank."""

    @property
    def numbers(self) -> Integers:
        """Canonical number of each local geometry node."""


@dataclass(frozen=True)
class Boundary:
    """Faces of a body with their nodes, the same on every rank and in the same order.

    Attributes:
        numbers: Canonical numbers of the nodes, increasing, shape (nodes,).
        points: Their places in the mesh [m], shape (nodes, dim).
        faces: Nodes of each face, as places in ``numbers``, shape (faces, nodes per face).
        normals: Mean outward unit normal of each face, shape (faces, dim).
        shares: Outward normals times area, by nodes [m^2; m per unit thickness in the plane],
            shape (faces, nodes per face, dim).
        areas: Areas by nodes [m^2], positive, shape (faces, nodes per face).
        names: Names of surfaces, in alphabetical order.
        members: Which face belongs to which of them, shape (faces, names).
    """

    numbers: Integers
    points: Floats
    faces: Integers
    normals: Floats
    shares: Floats
    areas: Floats
    names: tuple[str, ...]
    members: Booleans

    @property
    def size(self) -> float:
        """Diagonal of the body's bounding box [m]."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0))) if len(self.points) else 0.0

    @property
    def area(self) -> float:
        """Of the faces by their corners, without thickness or revolution [m^2; m in the plane]."""
        a, b, c = (self.points[self.faces[:, min(k, self.faces.shape[1] - 1)]] for k in range(3))
        if self.points.shape[1] == 2:
            return float(np.linalg.norm(b - a, axis=1).sum())
        share = 1.0 if self.faces.shape[1] in {4, 9} else 0.5
        return share * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    def on(self, surfaces: Collection[str]) -> Booleans:
        """Which faces belong to one of some surfaces, shape (faces,); none to unknown ones."""
        columns = [k for k, name in enumerate(self.names) if name in surfaces]
        return np.asarray(self.members[:, columns].any(axis=1))

    def total(self, values: Floats, faces: Booleans) -> Floats:
        """Sum values by faces and nodes, (faces, nodes per face), over some faces; (nodes,)."""
        return np.bincount(
            self.faces[faces].ravel(), values[faces].ravel(), minlength=len(self.numbers)
        )

    def touched(self, faces: Booleans) -> Booleans:
        """Which nodes lie on some faces, shape (nodes,)."""
        found = np.zeros(len(self.numbers), dtype=bool)
        found[self.faces[faces]] = True
        return found


def boundary(body: Body, *, thickness: float = 1.0, axisymmetric: bool = False) -> Boundary:
    """Collect the outside of a body on every rank (collective).

    The area of a node is the integral of its shape function, of degree 1. For degree 2 that is
    zero at the corners of triangles; the area of a face then goes to its nodes in proportion to
    the integral of the square of their shape functions (diagonal scaling: Hinton, Rock,
    Zienkiewicz, Earthq. Eng. Struct. Dyn. 4 (1976) 245-249), which is Simpson's rule on sides and
    quadrilaterals and always positive.

    Args:
        body: The mesh with its surfaces and numbers.
        thickness: Thickness of a plane body [m]; areas are multiplied by it.
        axisymmetric: Whether the first coordinate is the radius; areas then are those of the full
            turn, and faces on the axis are left out.
    """
    mesh = body.mesh
    topology, dim = mesh.topology, mesh.geometry.dim
    cell_dim = topology.dim
    topology.create_connectivity(cell_dim - 1, cell_dim)
    topology.create_connectivity(cell_dim, cell_dim - 1)
    facets = dolfinx_mesh.exterior_facet_indices(topology)  # each on one rank
    behind = topology.connectivity(cell_dim - 1, cell_dim)
    cells = behind.array[behind.offsets[facets]]
    around = topology.connectivity(cell_dim, cell_dim - 1).array
    around = around.reshape(topology.index_map(cell_dim).size_local
                            + topology.index_map(cell_dim).num_ghosts, -1)  # fmt: skip
    place = np.argmax(around[cells] == facets[:, None], axis=1)

    cell = topology.cell_name()
    nodes = fem.cell_nodes(mesh)[cells]
    degree = 1 if nodes.shape[1] == fem.num_vertices(cell) else 2
    on_facet = fem.facet_nodes(cell, degree)[place]
    local = np.take_along_axis(nodes, on_facet, axis=1)
    x = mesh.geometry.x[:, :dim]
    inner = x[nodes].mean(axis=1)
    names = tuple(sorted(body.surfaces))
    members = np.zeros((len(facets), len(names)), dtype=bool)
    for k, surface in enumerate(names):
        members[:, k] = np.isin(facets, body.surfaces[surface])

    numbers, points, inner, members = (
        np.concatenate(mesh.comm.allgather(part))
        for part in (body.numbers[local], x[local], inner, members)
    )
    order = np.lexsort(np.sort(numbers, axis=1).T)
    numbers, points, inner, members = (part[order] for part in (numbers, points, inner, members))
    if axisymmetric:
        extent = float(np.abs(points).max(initial=0.0))
        real = np.abs(points[:, :, 0]).max(axis=1, initial=0.0) > 1e-9 * extent
        numbers, points, inner, members = (part[real] for part in (numbers, points, inner, members))
    normals, shares, areas = _measures(
        points, inner, _FACETS[cell], degree, thickness=thickness, axisymmetric=axisymmetric
    )
    found, first, faces = np.unique(numbers, return_index=True, return_inverse=True)
    return Boundary(
        found,
        points.reshape(-1, dim)[first],
        faces.reshape(numbers.shape),
        normals,
        shares,
        areas,
        names,
        members,
    )


def everywhere(comm: Any, boundary_numbers: Integers, numbers: Integers, values: Floats) -> Floats:
    """Values of the boundary's nodes on every rank, from the ranks that own them (collective).

    Args:
        comm: MPI communicator.
        boundary_numbers: Canonical numbers, increasing, the same on every rank.
        numbers: Canonical numbers of the nodes this rank owns, shape (owned nodes,).
        values: Values at those, shape (owned nodes, components).
    """
    found = np.zeros((len(boundary_numbers), values.shape[1]))
    own = np.flatnonzero(np.isin(numbers, boundary_numbers))
    found[np.searchsorted(boundary_numbers, numbers[own])] = values[own]
    comm.Allreduce(MPI.IN_PLACE, found)
    return found


def _measures(
    points: Floats,
    inner: Floats,
    kind: str,
    degree: int,
    *,
    thickness: float,
    axisymmetric: bool,
) -> tuple[Floats, Floats, Floats]:
    """Normals, shares and areas of faces from the places of their nodes and a point inside."""
    places, weights = _quadrature(kind)
    values, gradients = fem.coordinate_basis(kind, degree, places)
    tangents = np.einsum("aqk,fkd->afqd", gradients, points)
    if len(tangents) == 1:
        across = np.stack([tangents[0][..., 1], -tangents[0][..., 0]], axis=-1)
    else:
        across = np.cross(tangents[0], tangents[1])
    outwards = np.einsum("fd,fqd->f", points.mean(axis=1) - inner, across)
    across *= np.where(outwards < 0.0, -1.0, 1.0)[:, None, None]
    stretch = np.linalg.norm(across, axis=2) * weights
    if points.shape[2] == 2:
        radius = np.einsum("qk,fk->fq", values, points[:, :, 0])
        stretch = stretch * (2 * np.pi * radius if axisymmetric else thickness)
    part = values if degree == 1 else values**2
    shares = np.einsum("q,qk,fqd->fkd", weights, part, across)
    areas = stretch @ part
    if degree > 1:
        areas *= (stretch.sum(axis=1) / areas.sum(axis=1))[:, None]
    normals = np.einsum("q,fqd->fd", weights, across)
    return normals / np.linalg.norm(normals, axis=1)[:, None], shares, areas


def _quadrature(kind: str) -> tuple[Floats, Floats]:
    """Gauss points and weights on the reference interval, triangle or quadrilateral."""
    s, w = np.polynomial.legendre.leggauss(_POINTS)
    s, w = (s + 1) / 2, w / 2
    if kind == "interval":
        return s[:, None], w
    x, y = (grid.ravel() for grid in np.meshgrid(s, s, indexing="ij"))
    weights = np.outer(w, w).ravel()
    if kind == "triangle":  # the square with one side drawn together
        return np.stack([x, y * (1 - x)], axis=1), weights * (1 - x)
    return np.stack([x, y], axis=1), weights
