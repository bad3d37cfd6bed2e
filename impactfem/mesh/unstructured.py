"""Unstructured triangles of the space-time rectangle, with chosen lines among their edges."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.errors import MeshError
from impactfem.mesh.raw import numbering
from impactfem.mesh.session import gmsh_session
from impactfem.mesh.spacetime import SpaceTimeMesh

MAX_TRIANGLES = 4_000_000
"""Largest mesh that is built."""

_SIDE = 1e-6  # share of a side by which a boundary node of a user's mesh may miss it
# Frontal-Delaunay makes the best triangles; the others take over where lines are too close for it.
_ALGORITHMS = (6, 5, 1)


@dataclass(frozen=True)
class Triangulation:
    """Triangles of (0, c T / L) x (0, 1), the same on every rank.

    Attributes:
        points: Dimensionless (t, x) of each node, shape (nodes, 2).
        cells: Nodes of each triangle, shape (cells, 3).
    """

    points: Floats
    cells: Integers

    @property
    def duration(self) -> float:
        """Dimensionless duration c T / L."""
        return float(self.points[:, 0].max())


@dataclass(frozen=True)
class Lines:
    """Straight lines that the triangles must not cross, as a planar graph.

    Attributes:
        points: Their ends and crossings, shape (points, 2); all of them become nodes.
        segments: Ends of each piece; pieces meet at their ends only, shape (segments, 2).
    """

    points: Floats
    segments: Integers


NO_LINES = Lines(np.empty((0, 2)), np.empty((0, 2), dtype=np.int64))


def gathered(space: SpaceTimeMesh) -> Triangulation:
    """Collect a distributed mesh on every rank; nodes beside a side are put on it."""
    mesh = space.mesh
    index_map = mesh.geometry.index_map()
    owned_nodes = index_map.size_local
    points = fem.gather(mesh.comm, mesh.geometry.x[:owned_nodes, :2])
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    nodes = fem.cell_nodes(mesh)[:owned].ravel()
    cells = fem.gather(mesh.comm, index_map.local_to_global(nodes.astype(np.int32)))
    duration = points[:, 0].max()
    for axis, value in ((0, 0.0), (0, duration), (1, 0.0), (1, 1.0)):
        size = duration if axis == 0 else 1.0
        points[np.abs(points[:, axis] - value) < _SIDE * size, axis] = value
    return Triangulation(points, cells.reshape(-1, 3))


def triangulate(comm: Any, duration: float, size: float, lines: Lines = NO_LINES) -> Triangulation:
    """Mesh the rectangle (0, duration) x (0, 1) with triangles of about one size.

    Args:
        comm: MPI communicator; Gmsh runs on rank 0.
        duration: Dimensionless duration c T / L.
        size: Dimensionless length of the edges, h / L.
        lines: Lines that become edges.

    Raises:
        MeshError: Too many triangles would result, or Gmsh failed.
    """
    expected = 2.4 * duration / size**2
    if expected > MAX_TRIANGLES:
        raise MeshError(
            f"a space-time mesh of about {expected:.1e} triangles is too large (limit "
            f"{MAX_TRIANGLES:.1e}); use fewer elements, a shorter duration or a layered method"
        )

    def build() -> Triangulation:
        with gmsh_session() as gmsh:
            for algorithm in _ALGORITHMS:
                gmsh.model.add(f"lines {algorithm}")
                try:
                    return _build(gmsh, duration, size, lines, algorithm)
                except MeshError:
                    raise
                except Exception as error:  # noqa: BLE001  (Gmsh raises nothing finer)
                    failure = error
                finally:
                    gmsh.model.remove()
        raise MeshError(
            f"Gmsh could not mesh {len(lines.segments)} lines with elements of {size:g} of the "
            f"length ({failure}); use other `elements`, or fitted = false"
        )

    return fem.on_root(comm, build)


def _build(gmsh: Any, duration: float, size: float, lines: Lines, algorithm: int) -> Triangulation:
    """Mesh the rectangle in the current model."""
    corners = np.array([[0.0, 0.0], [duration, 0.0], [duration, 1.0], [0.0, 1.0]])
    points = np.concatenate([corners, lines.points])
    at_corner = (np.abs(points[4:, None] - corners).max(axis=2) == 0.0) if len(lines.points) else []
    same = np.arange(len(points))
    for k, row in enumerate(at_corner, start=4):
        if row.any():
            same[k] = int(np.argmax(row))
    geo = gmsh.model.geo
    tags = {k: geo.addPoint(*points[k], 0.0) for k in np.unique(same)}
    border: list[int] = []
    for k in range(4):
        on_side = _on_side(points, same, corners[k], corners[(k + 1) % 4], (k, (k + 1) % 4))
        border += [geo.addLine(tags[a], tags[b]) for a, b in pairwise(on_side)]
    surface = geo.addPlaneSurface([geo.addCurveLoop(border)])
    inner = {
        geo.addLine(tags[same[a + 4]], tags[same[b + 4]]): (same[a + 4], same[b + 4])
        for a, b in lines.segments
    }
    geo.synchronize()
    if inner:
        gmsh.model.mesh.embed(1, list(inner), 2, surface)
    options = {
        "Mesh.Algorithm": algorithm,
        # Sizes taken from borders would fill the strips between near lines with tiny triangles.
        "Mesh.MeshSizeExtendFromBoundary": 0 if inner else 1,
        "Mesh.MeshSizeMin": size,
        "Mesh.MeshSizeMax": size,
    }
    before = {name: gmsh.option.getNumber(name) for name in options}
    try:
        for name, value in options.items():
            gmsh.option.setNumber(name, value)
        gmsh.model.mesh.generate(2)
    finally:
        for name, value in before.items():
            gmsh.option.setNumber(name, value)
    return _read(gmsh, points, tags, inner, duration)


def _on_side(
    points: Floats, same: Integers, start: Floats, end: Floats, corners: tuple[int, int]
) -> list[int]:
    """Points of one side in the order from its start to its end."""
    axis = 0 if start[1] == end[1] else 1
    inside = np.flatnonzero(
        (points[:, 1 - axis] == start[1 - axis]) & (same == np.arange(len(same)))
    )
    inside = inside[inside >= 4]
    order = np.argsort(points[inside, axis])
    found = inside[order if start[axis] < end[axis] else order[::-1]]
    return [corners[0], *found.tolist(), corners[1]]


def _read(
    gmsh: Any, points: Floats, tags: dict[int, int], inner: dict[int, tuple[int, int]],
    duration: float,
) -> Triangulation:  # fmt: skip
    """Take the mesh out of Gmsh, with the nodes exactly on sides and lines.

    Gmsh places nodes to about 1e-11, which would be the error of a solution with jumps on lines.
    """
    node_tags, coordinates, _ = gmsh.model.mesh.getNodes()
    place = np.reshape(coordinates, (-1, 3))[:, :2].copy()
    number = numbering(node_tags)
    for axis, value in ((0, 0.0), (0, duration), (1, 0.0), (1, 1.0)):
        place[np.abs(place[:, axis] - value) < 1e-9, axis] = value
    for curve, (a, b) in inner.items():
        found, _, _ = gmsh.model.mesh.getNodes(1, curve)
        nodes = number(found)
        along = points[b] - points[a]
        share = (place[nodes] - points[a]) @ along / (along @ along)
        place[nodes] = points[a] + share[:, None] * along
    for k, tag in tags.items():
        found, _, _ = gmsh.model.mesh.getNodes(0, tag)
        place[number(found)] = points[k]
    kinds, _, lists = gmsh.model.mesh.getElements(2)
    if list(kinds) != [2]:
        raise RuntimeError("no triangles")
    cells = number(lists[0]).reshape(-1, 3)
    used, cells = np.unique(cells, return_inverse=True)
    return _checked(place[used], cells.reshape(-1, 3), duration)


def _checked(points: Floats, cells: Integers, duration: float) -> Triangulation:
    """Turn all triangles the same way and see that they cover the rectangle."""
    a, b, c = (points[cells[:, k]] for k in range(3))
    area = 0.5 * np.linalg.det(np.stack([b - a, c - a], axis=1))
    if area.min() <= 0.0 and area.max() > 0.0:
        keep = np.abs(area) > 0.0
        cells, area = cells[keep], area[keep]
        if area.min() < 0.0:
            raise RuntimeError("overlapping triangles")
    if abs(np.abs(area).sum() - duration) > 1e-9 * duration:
        raise RuntimeError("holes in the mesh")
    return Triangulation(points, cells)
