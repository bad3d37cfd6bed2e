"""Meshes of plates: triangles of the mid-surface, edges by name, and which vertices may touch."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.spatial import Delaunay

from impactfem import fem
from impactfem.arrays import Booleans, Floats, Integers
from impactfem.errors import MeshError, SceneError
from impactfem.mesh.body_files import read_body
from impactfem.mesh.checks import check_body
from impactfem.mesh.outline import NEAR, Frame, Outline, Plane, Polygon
from impactfem.mesh.raw import RawMesh
from impactfem.mesh.shapes import drawn_mesh, shape_mesh
from impactfem.scene import Formula
from impactfem.scene.plate import Plate
from impactfem.scene.plate_outlines import PolygonOutline

_MOST = 40_000  # vertices: each rank holds all of them and its factors


@dataclass(frozen=True)
class PlateMesh:
    """The mid-surface, in the frame of the plate.

    Attributes:
        points: Vertices [m], (vertices, 2).
        cells: Triangles, (cells, 3).
        edges: Pairs of vertices on each named edge, (pairs, 2).
    """

    points: Floats
    cells: Integers
    edges: Mapping[str, Integers]

    @cached_property
    def areas(self) -> Floats:
        """Of the triangles [m^2], (cells,)."""
        one, two = (self.points[self.cells[:, k]] - self.points[self.cells[:, 0]] for k in (1, 2))
        return np.asarray(0.5 * np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]))

    def _coupled(self, each: Floats) -> csr_matrix:
        """Sums of what each triangle has of its corners, (cells, 3, 3): (vertices, vertices)."""
        rows = np.repeat(self.cells, 3, axis=1).ravel()
        columns = np.tile(self.cells, (1, 3)).ravel()
        count = len(self.points)
        return csr_matrix(coo_matrix((each.ravel(), (rows, columns)), shape=(count, count)))

    def cells_of(self, chosen: Integers) -> Integers:
        """Triangles between some vertices, by their places among them, (several, 3)."""
        place = np.full(len(self.points), -1, dtype=np.int64)
        place[chosen] = np.arange(len(chosen))
        found = place[self.cells]
        return found[(found >= 0).all(axis=1)]

    @cached_property
    def shares(self) -> csr_matrix:
        """Integrals of products of linear functions [m^2], (vertices, vertices)."""
        return self._coupled(self.areas[:, None, None] * (np.ones((3, 3)) + np.eye(3)) / 12.0)

    def lumped(self, values: Floats) -> Floats:
        """Values of the triangles by area, a third to each corner [m^2], (vertices,)."""
        each = np.repeat(values * self.areas / 3.0, 3)
        return np.bincount(self.cells.ravel(), each, len(self.points))

    @cached_property
    def neighbours(self) -> csr_matrix:
        """How many triangles each two vertices share, without themselves, (vertices, vertices)."""
        found = self._coupled(np.ones((len(self.cells), 3, 3)))
        found.setdiag(0.0)
        found.eliminate_zeros()
        found.sort_indices()
        return found

    @cached_property
    def rim(self) -> Integers:
        """Vertices of the outline: on sides that one triangle has alone."""
        sides = np.sort(np.concatenate([self.cells[:, [k, k - 1]] for k in range(3)]), axis=1)
        pairs, count = np.unique(sides, axis=0, return_counts=True)
        return np.unique(pairs[count == 1])

    @property
    def spacing(self) -> float:
        """Longest edge [m]: what is smaller may slip through between vertices."""
        corners = self.points[self.cells]
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())


def plate_mesh(plate: Plate, folder: Path) -> PlateMesh:
    """Mesh the mid-surface of a plate or read it, the same on every rank (collective).

    Raises:
        MeshError: It cannot be meshed or read, or has too many vertices.
    """
    raw = fem.on_root(fem.MPI.COMM_WORLD, lambda: _made(plate, folder))
    if len(raw.points) > _MOST:
        raise MeshError(
            f"body {plate.name}: {len(raw.points)} vertices, more than {_MOST:g}: give a larger "
            "mesh_size"
        )
    edges = {name: np.asarray(pairs, dtype=np.int64) for name, pairs in raw.surfaces.items()}
    return PlateMesh(raw.points, np.asarray(raw.cells, dtype=np.int64), edges)


def _made(plate: Plate, folder: Path) -> RawMesh:
    if plate.outline is None:
        path = Path(folder, plate.mesh or "")
        used = [support.edge for support in plate.supports]
        raw = read_body(path, "plane_stress", 1, mesh_size=plate.mesh_size, used=used)
        where = f"mesh file {path}"
        if raw.cell != "triangle":
            raise MeshError(f"{where}: plates take triangles, it has {raw.cell}s; mesh it anew")
    else:
        raw, where = _drawn(plate.outline, plate.mesh_size or 0.0), f"body {plate.name!r}"
    check_body(raw, where, axisymmetric=False)
    return raw


def _drawn(outline: Any, size: float) -> RawMesh:
    """Triangles in an outline about the origin."""
    if outline.shape is None:
        return drawn_mesh(_polygon(outline), size)
    return shape_mesh(outline.shape, size)


@dataclass(frozen=True)
class _Segment(Plane):
    """A part of a line; edges of a polygon may lie on the same one."""

    first: Floats
    last: Floats

    def holds(self, points: Floats) -> Booleans:
        """Which points lie on it."""
        way = self.last - self.first
        share = (points - self.first) @ way / (way @ way)
        return super().holds(points) & (share > -NEAR) & (share < 1.0 + NEAR)


def _polygon(outline: PolygonOutline) -> Outline:
    corners = outline.corners
    largest = float(np.ptp(corners, axis=0).max())
    scale = 2.0 ** round(math.log2(largest))
    corners = corners / scale
    places = []
    for name, a, b in zip(outline.edges, corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([b[1] - a[1], a[0] - b[0]]) / np.linalg.norm(b - a)
        places.append((name, _Segment(normal, float(normal @ a), a, b)))
    around = corners if outline.signed_area > 0.0 else corners[::-1]
    frame = Frame(scale, np.zeros(2), np.zeros(2), 0.0)
    return Outline(frame, largest / scale, Polygon(around, None), tuple(places), ())


def held_slopes(mesh: PlateMesh, plate: Plate) -> tuple[Booleans, list[list[Floats]]]:
    """Which vertices do not move, and the directions in which each does not turn.

    Where an edge is simply supported w is 0 along it, and with it the slope in its own direction.
    On a curve that is the mean of the directions of the pairs beside a vertex: those of each pair
    would hold both slopes, and the polygon would be clamped however fine it is.

    Raises:
        MeshError: There is no such edge.
    """
    still = np.zeros(len(mesh.points), dtype=bool)
    ways: list[list[Floats]] = [[] for _ in mesh.points]
    for support in plate.supports:
        if support.edge not in mesh.edges:
            raise MeshError(
                f"body {plate.name}: its mesh has no edge {support.edge}; it has "
                f"{', '.join(mesh.edges) or 'none with a name'}"
            )
        if (held := _HELD.get(support.kind)) is None:
            continue
        pairs = mesh.edges[support.edge]
        still[np.unique(pairs)] = True
        for vertex, along in held(mesh, pairs).items():
            ways[vertex] += along
    return still, ways


def led_vertices(
    mesh: PlateMesh, plate: Plate, still: Booleans
) -> tuple[list[tuple[Integers, Formula]], Booleans]:
    """Vertices of edges that move and their displacements in t [m]; which vertices move at all.

    Raises:
        SceneError: Two edges move a vertex unlike.
    """
    by: dict[int, str] = {}
    found, edges = [], dict(plate.led_edges)
    for support in plate.supports if edges else ():
        moved = edges.get(support.edge)
        own = np.unique(mesh.edges[support.edge])
        own = own[still[own]]
        text = "" if moved is None else moved.text
        if any(by.setdefault(vertex, text) != text for vertex in own.tolist()):
            raise SceneError(
                f"body {plate.name}: edge {support.edge} shares a corner with one that does not "
                "move alike; give both the same motion, or leave an edge between them free"
            )
        if moved is not None:
            found.append((own, moved))
    moves = ~still
    for vertices, _ in found:
        moves[vertices] = True
    return found, moves


def held_in_plane(mesh: PlateMesh, plate: Plate) -> Booleans:
    """Which vertices do not move in the plane of a plate, (vertices,)."""
    held = np.zeros(len(mesh.points), dtype=bool)
    for support in plate.supports:
        if support.stays:
            held[np.unique(mesh.edges[support.edge])] = True
    return held


_KINK = math.cos(math.radians(45.0))  # directions of pairs farther apart meet in a corner


def _directions(mesh: PlateMesh, pairs: Integers) -> dict[int, list[Floats]]:
    """Directions of an edge at its vertices: one, or two at a corner."""
    found: dict[int, list[Floats]] = {}
    for one, two in pairs.tolist():
        way = mesh.points[two] - mesh.points[one]
        way = way / np.linalg.norm(way)
        for vertex in (one, two):
            found.setdefault(vertex, []).append(way)
    for vertex, ways in found.items():
        if len(ways) == 2:
            cosine = float(ways[0] @ ways[1])
            if abs(cosine) > _KINK:
                mean = ways[0] + math.copysign(1.0, cosine) * ways[1]
                found[vertex] = [mean / np.linalg.norm(mean)]
    return found


_HELD: Mapping[str, Callable[[PlateMesh, Integers], dict[int, list[Floats]]]] = {
    "clamped": lambda _, pairs: {v: list(np.eye(2)) for v in np.unique(pairs).tolist()},
    "simply_supported": _directions,
    "soft_support": lambda _, pairs: {},  # noqa: ARG005  (as the others)
}
"""Directions in which vertices of an edge do not turn; those of a free one move."""


def apart_from_others(mesh: PlateMesh, able: Booleans) -> Integers:
    """Vertices of which no two are neighbours and that no others could join, by their numbers.

    Args:
        mesh: The plate.
        able: Which vertices may be among them, (vertices,).
    """
    free, beside = able.copy(), mesh.neighbours
    found = []
    for vertex in np.flatnonzero(able).tolist():
        if free[vertex]:
            found.append(vertex)
            free[beside.indices[beside.indptr[vertex] : beside.indptr[vertex + 1]]] = False
    return np.array(found, dtype=np.int64)


def net_between(mesh: PlateMesh, chosen: Integers) -> Integers:
    """Triangles between some vertices that lie in the plate, by their places among them, (n, 3)."""
    places = mesh.points[chosen]
    if len(chosen) < 3 or np.linalg.matrix_rank(places - places[0], tol=NEAR * mesh.spacing) < 2:
        return np.zeros((0, 3), dtype=np.int64)
    net = np.asarray(Delaunay(places).simplices, dtype=np.int64)
    # The middle of one that spans a hole or a bay lies in no triangle of the mesh.
    corners = mesh.points[mesh.cells]
    edges = np.linalg.inv((corners[:, 1:] - corners[:, :1]).swapaxes(1, 2))
    inside = []
    for middle in places[net].mean(axis=1):
        others = np.einsum("cij,cj->ci", edges, middle - corners[:, 0])
        least = np.minimum(others.min(axis=1), 1.0 - others.sum(axis=1))
        inside.append(bool(least.max() >= -NEAR))
    return np.asarray(net[np.array(inside)])


def mass_to_neighbours(mesh: PlateMesh, light: Integers) -> csr_matrix:
    """P: w of all vertices by w of those with mass, (vertices, vertices), columns of `light` empty.

    A neighbour counts once for every triangle it shares with the vertex.
    """
    count = len(mesh.points)
    heavy = np.ones(count)
    heavy[light] = 0.0
    beside = mesh.neighbours[light]
    weights = csr_matrix(beside.multiply(heavy[None, :]))
    sums = np.asarray(weights.sum(axis=1)).ravel()
    entries = coo_matrix(weights)
    rows = np.concatenate([np.flatnonzero(heavy), light[entries.row]])
    columns = np.concatenate([np.flatnonzero(heavy), entries.col])
    values = np.concatenate([np.ones(int(heavy.sum())), entries.data / sums[entries.row]])
    return csr_matrix(coo_matrix((values, (rows, columns)), shape=(count, count)))
