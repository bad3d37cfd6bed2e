"""The distributed mesh of a solid body, whose boundary is known by name."""

import resource
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.errors import MeshError
from impactfem.mesh.body_files import read_body
from impactfem.mesh.checks import check_body, check_names
from impactfem.mesh.raw import Cell, RawMesh, Source, facet_keys
from impactfem.mesh.shapes import shape_mesh
from impactfem.mesh.structured import structured_mesh

Integers = NDArray[np.int32]


@dataclass(frozen=True)
class MeshCost:
    """What rank 0 spent on a mesh before it was distributed.

    Attributes:
        seconds: Wall time [s].
        peak_memory: Largest memory of rank 0 so far [MiB].
    """

    seconds: float
    peak_memory: float


@dataclass(frozen=True)
class BodyMesh:
    """A distributed mesh of a body.

    Attributes:
        mesh: DOLFINx mesh, its geometry of the degree of the elements; ghost cells behind the
            facets that two ranks share.
        surfaces: Local facets (ghosts included, increasing) of each named part of the boundary,
            shape (facets,).
        numbers: Number of each local geometry node, the same for any number of ranks, shape
            (local nodes,): its row in the mesh as rank 0 made it.
        gdim: Dimension of space, 2 or 3.
        cell: Kind of the cells.
        degree: Degree of the geometry, 1 or 2.
        num_nodes: Nodes of the whole mesh.
        num_cells: Cells of the whole mesh.
        volume: Area [m^2] (2D) or volume [m^3] of the mesh, without thickness or revolution.
        cost: What it took to make.
        source: The file it comes from; None for shapes.
        groups: Local cells (ghosts included) of each material, if the body has several.
    """

    mesh: Any
    surfaces: Mapping[str, Integers]
    numbers: NDArray[np.int64]
    gdim: int
    cell: Cell
    degree: int
    num_nodes: int
    num_cells: int
    volume: float
    cost: MeshCost
    source: Source | None = None
    groups: Mapping[str, Integers] = field(default_factory=dict)

    def facets(self, name: str) -> Integers:
        """Local facets of a surface.

        Raises:
            MeshError: There is no such surface.
        """
        try:
            return self.surfaces[name]
        except KeyError:
            raise MeshError(
                f"the mesh has no surface {name!r}; it has {', '.join(self.surfaces) or 'none'}"
            ) from None


def build_body_mesh(comm: Any, solid: Any, degree: int, folder: Path) -> BodyMesh:
    """Make or read the mesh of a solid, check it and distribute it.

    Args:
        comm: MPI communicator; the mesh is made on rank 0.
        solid: `impactfem.scene.solids.Solid`, with a shape or a mesh file.
        degree: Degree of the geometry, that of the elements.
        folder: Where a relative path of a mesh file begins.

    Raises:
        MeshError: The mesh cannot be made or does not fit the body; on every rank.
        MissingDependencyError: Gmsh is needed and cannot be loaded.
    """
    found: list[RawMesh] = []

    def make() -> tuple[Any, ...]:
        begin = time.perf_counter()
        raw, volume = _made(solid, degree, folder)
        found.append(raw)
        cost = MeshCost(time.perf_counter() - begin, _peak_memory())
        sizes = raw.dim, raw.cells.shape[1], len(raw.points), len(raw.cells)
        named = dict(raw.surfaces), dict(raw.groups)
        return (raw.cell, *sizes, volume, cost, *named, raw.source)

    cell, dim, nodes, num_nodes, num_cells, volume, cost, surfaces, groups, source = fem.on_root(
        comm, make
    )
    raw = found.pop() if found else None
    points = raw.points if raw else np.empty((0, dim))
    cells = raw.cells if raw else np.empty((0, nodes), dtype=np.int64)
    mesh = fem.global_mesh(comm, points, cells, cell, degree)
    numbers = fem.input_numbers(mesh)
    return BodyMesh(
        mesh=mesh,
        surfaces=MappingProxyType(_local_facets(mesh, cell, numbers, surfaces)),
        numbers=numbers,
        gdim=dim,
        cell=cell,
        degree=degree,
        num_nodes=num_nodes,
        num_cells=num_cells,
        volume=volume,
        cost=cost,
        source=source,
        groups=MappingProxyType({name: _local_cells(mesh, own) for name, own in groups.items()}),
    )


def _local_cells(mesh: Any, cells: NDArray[np.int64]) -> Integers:
    """Cells of the whole mesh as they are numbered on this rank, ghosts included."""
    return np.flatnonzero(np.isin(mesh.topology.original_cell_index, cells)).astype(np.int32)


def _made(solid: Any, degree: int, folder: Path) -> tuple[RawMesh, float]:
    """The whole mesh and its volume, on this rank."""
    axisymmetric = solid.model == "axisymmetric"
    if solid.shape is None:
        path = Path(folder, solid.mesh)
        where = f"mesh file {path}"
        at = np.zeros(solid.dim) if solid.position is None else np.array(solid.position)
        turn = solid.turn
        balls = [replace(ball, point=((ball.point - at) @ turn).tolist()) for ball in solid.refine]
        raw = read_body(
            path, solid.model, degree, mesh_size=solid.mesh_size, refine=balls,
            cells=solid.cells, used=_used(solid), materials=solid.materials,
            part=solid.part,
        )  # fmt: skip
        check_names(raw.surfaces, _used(solid), where)
        points = raw.points if solid.orientation is None else raw.points @ turn.T
        raw = replace(raw, points=points + at)
    elif solid.cells == "hexahedron":
        where = _of_shape(solid)
        if solid.refine:
            raise MeshError(
                f'{where}: refine works with cells = "simplex" only; remove it, or use simplices'
            )
        raw = structured_mesh(
            solid.shape, solid.mesh_size, degree=degree, axisymmetric=axisymmetric
        )
    else:
        where = _of_shape(solid)
        raw = shape_mesh(
            solid.shape, solid.mesh_size, solid.refine, degree=degree, axisymmetric=axisymmetric
        )
    return raw, check_body(raw, where, axisymmetric=axisymmetric)


def _of_shape(solid: Any) -> str:
    return f"body {solid.name!r}: the mesh of its {solid.shape.kind}"


def _used(solid: Any) -> list[str]:
    """Names of surfaces that the solid speaks of."""
    named = [*solid.supports, *solid.tractions, *solid.pressures]
    return [*dict.fromkeys([*(entry.surface for entry in named), *(solid.contact_surfaces or ())])]


def _local_facets(
    mesh: Any, cell: Cell, numbers: NDArray[np.int64], surfaces: Mapping[str, NDArray[np.int64]]
) -> dict[str, Integers]:
    """Find the facets of named surfaces, given by the numbers of their vertices, on this rank."""
    tdim = mesh.topology.dim
    mesh.topology.create_connectivity(tdim, tdim - 1)
    to_facets = mesh.topology.connectivity(tdim, tdim - 1).array.astype(np.int64)
    corners = np.array(fem.facet_vertices(cell))
    rows = numbers[fem.cell_nodes(mesh)][:, corners].reshape(-1, corners.shape[1])
    if not surfaces:
        return {}
    # Only facets all of whose vertices lie on the surfaces can belong to them.
    near = np.isin(rows, np.unique(np.concatenate([np.ravel(v) for v in surfaces.values()])))
    rows, to_facets = rows[near.all(axis=1)], to_facets[near.all(axis=1)]
    keys, *wanted = facet_keys(rows, *surfaces.values())
    return {
        name: np.unique(to_facets[np.isin(keys, own)]).astype(np.int32)
        for name, own in zip(surfaces, wanted, strict=True)
    }


def _peak_memory() -> float:
    """Largest memory of this process [MiB]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak) / (2**20 if sys.platform == "darwin" else 2**10)
