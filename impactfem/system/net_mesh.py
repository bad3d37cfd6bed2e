"""Masses and springs of a net: nodes, edges and cells of patterns and of mesh files."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.errors import MeshError, SceneError
from impactfem.mesh.body_files import read_body
from impactfem.scene.shapes import Block, Disc, Ring
from impactfem.scene.springs import SpringNet

_ROUNDING = 1e-9  # share of an edge by which cells may lie outside their shape
_MOST = 20_000  # nodes
# Edges of cells by places among their corners; crossed squares have diagonals besides.
_EDGES: Mapping[str, tuple[tuple[int, int], ...]] = {
    "triangle": tuple(combinations(range(3), 2)),
    "tetrahedron": tuple(combinations(range(4), 2)),
    "quadrilateral": ((0, 1), (1, 3), (3, 2), (2, 0)),  # corners as DOLFINx numbers them
    "hexahedron": (
        (0, 1), (1, 3), (3, 2), (2, 0), (4, 5), (5, 7), (7, 6), (6, 4), (0, 4), (1, 5), (2, 6),
        (3, 7),
    ),
}  # fmt: skip
_DIAGONALS = ((0, 3), (1, 2))


@dataclass(frozen=True)
class NetMesh:
    """A net at rest.

    Attributes:
        points: Nodes [m], (nodes, dim).
        cells: Corners of the cells, (cells, corners).
        edges: Nodes of each spring, (springs, 2).
        stiffness: Of each spring [N/m], (springs,).
        weights: Share of the mass at each node, (nodes,).
        size: Area or volume [m^2, m^3].
        surfaces: Nodes on named parts of the outline.
    """

    points: Floats
    cells: Integers
    edges: Integers
    stiffness: Floats
    weights: Floats
    size: float
    surfaces: Mapping[str, Integers]

    @property
    def lengths(self) -> Floats:
        """Of the springs at rest [m], (springs,)."""
        ways = self.points[self.edges[:, 1]] - self.points[self.edges[:, 0]]
        return np.asarray(np.linalg.norm(ways, axis=1))

    def moduli(self) -> Floats:
        """C_ijkl of strains that are the same at all nodes [N/m, in space Pa].

        Sum of k L^2 n_i n_j n_k n_l over the springs by the area (in space: volume): exact for
        patterns whose cells are alike, too stiff for irregular ones. It is symmetric in all its
        indices (Cauchy's relations): Poisson's ratio is 1/3 in the plane, 1/4 in space.
        """
        ways = self.points[self.edges[:, 1]] - self.points[self.edges[:, 0]]
        weight = self.stiffness / self.lengths**2
        found = np.einsum("e,ei,ej,ek,el->ijkl", weight, ways, ways, ways, ways)
        return np.asarray(found / self.size)


def net_mesh(body: SpringNet, folder: Path) -> NetMesh:
    """The net of a body, the same on every rank (collective).

    Raises:
        SceneError: No cell fits into the shape, or there are too many.
        MeshError: A mesh file cannot be used.
    """
    if body.shape is None:
        return _of_file(body, folder)
    pattern = body.pattern or "triangles"
    size = body.mesh_size or 0.0
    if body.shape.volume / size**2 > _MOST:
        raise SceneError(
            f"body {body.name}: mesh_size = {size:g} makes about "
            f"{body.shape.volume / size**2:.2g} masses, more than {_MOST:g}: give a larger one"
        )
    points, cells, cell = _filled(body.shape, pattern, size)
    if not len(cells):
        raise SceneError(
            f"body {body.name}: no cell of mesh_size = {size:g} fits into its shape: give a "
            "smaller one"
        )
    used, places = np.unique(cells, return_inverse=True)
    points, cells = points[used], places.reshape(cells.shape)
    found = _sprung(body, points, cells, cell)
    return _named(found, body.shape, 0.51 * size if pattern == "triangles" else 1e-6 * size)


def _filled(shape: Block | Disc | Ring, pattern: str, size: float) -> tuple[Floats, Integers, str]:
    """Nodes, and cells that lie in a shape before it is turned, turned then."""
    half = 0.5 * np.asarray(shape.size) if isinstance(shape, Block) else np.full(2, shape.radius)
    triangles = pattern == "triangles"
    step = np.array([size, size * (math.sqrt(0.75) if triangles else 1.0)])
    if isinstance(shape, Block):
        counts = np.maximum(1, np.round(2.0 * half / step)).astype(int)
        step = 2.0 * half / counts
    else:
        counts = 2 * np.ceil(half / step).astype(int)
    i, j = np.meshgrid(np.arange(counts[0] + 1), np.arange(counts[1] + 1))
    x = (i - 0.5 * counts[0] + (0.5 * (j % 2) if triangles else 0.0)) * step[0]
    y = (j - 0.5 * counts[1]) * step[1]
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    number = i + j * (counts[0] + 1)
    a, b, c, d = (
        number[rows, columns].ravel()
        for rows in (slice(None, -1), slice(1, None))
        for columns in (slice(None, -1), slice(1, None))
    )
    if triangles:
        odd = (j[:-1, :-1] % 2 == 1).ravel()
        first = np.where(odd[:, None], np.stack([a, b, d], 1), np.stack([a, b, c], 1))
        second = np.where(odd[:, None], np.stack([a, d, c], 1), np.stack([b, d, c], 1))
        cells, cell = np.concatenate([first, second]), "triangle"
    else:
        cells, cell = np.stack([a, b, c, d], 1), "quadrilateral"
    inside = _inside(shape, points, half, _ROUNDING * size)
    kept = cells[inside[cells].all(axis=1)]
    if isinstance(shape, Ring):  # no edge through the hole
        middle = np.linalg.norm(points[kept].mean(axis=1), axis=1)
        kept = kept[middle >= shape.inner_radius]
    cosine, sine = math.cos(shape.angle), math.sin(shape.angle)
    turned = points @ np.array([[cosine, sine], [-sine, cosine]])
    return np.asarray(shape.centre) + turned, kept, cell


def _inside(
    shape: Block | Disc | Ring, points: Floats, half: Floats, room: float
) -> NDArray[np.bool_]:
    if isinstance(shape, Block):
        return np.asarray((np.abs(points) <= half + room).all(axis=1))
    away = np.linalg.norm(points, axis=1)
    least = shape.inner_radius if isinstance(shape, Ring) else 0.0
    return np.asarray((away <= shape.radius + room) & (away >= least - room))


def _sprung(body: SpringNet, points: Floats, cells: Integers, cell: str) -> NetMesh:
    """SpringNet on the edges of cells, and the mass of the cells at their corners."""
    pairs = np.sort(np.concatenate([cells[:, list(pair)] for pair in _EDGES[cell]]), axis=1)
    edges, count = np.unique(pairs, axis=0, return_counts=True)
    stiffness = np.full(len(edges), body.stiffness)
    if points.shape[1] == 2:
        stiffness *= 0.5 * count
    if body.pattern == "crossed":
        across = np.concatenate([cells[:, list(pair)] for pair in _DIAGONALS])
        given = body.diagonal_stiffness or 0.5 * body.stiffness
        edges = np.concatenate([edges, across])
        stiffness = np.concatenate([stiffness, np.full(len(across), given)])
    sizes = _sizes(points[cells], cell)
    weights = np.zeros(len(points))
    np.add.at(weights, cells, (sizes / cells.shape[1])[:, None])
    whole = float(sizes.sum())
    return NetMesh(points, cells, edges, stiffness, weights / whole, whole, {})


def _sizes(corners: Floats, cell: str) -> Floats:
    """Areas or volumes of cells, (cells,), from their corners (cells, corners, dim)."""
    if cell == "quadrilateral":
        one, two = corners[:, 3] - corners[:, 0], corners[:, 2] - corners[:, 1]
        return np.asarray(0.5 * np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]))
    dim = corners.shape[2]
    if cell == "hexahedron":
        edges = corners[:, [1, 2, 4]] - corners[:, :1]
        return np.asarray(np.abs(np.linalg.det(edges)))
    edges = corners[:, 1:] - corners[:, :1]
    return np.asarray(np.abs(np.linalg.det(edges)) / math.factorial(dim))


def _named(net: NetMesh, shape: Block | Disc | Ring, room: float) -> NetMesh:
    """The same with the nodes of the surfaces of its shape."""
    arms = net.points - np.asarray(shape.centre)
    cosine, sine = math.cos(shape.angle), math.sin(shape.angle)
    x, y = (arms @ np.array([[cosine, -sine], [sine, cosine]])).T
    if isinstance(shape, Block):
        fine = 1e-6 * shape.size[1]
        found = {
            "left": x <= x.min() + room, "right": x >= x.max() - room,
            "bottom": y <= y.min() + fine, "top": y >= y.max() - fine,
        }  # fmt: skip
    else:
        rim, away = _rim(net), np.hypot(x, y)
        half = 0.5 * (shape.radius + shape.inner_radius) if isinstance(shape, Ring) else 0.0
        names = shape.surface_names()
        found = dict(zip(names, (rim & (away >= half), rim & (away < half)), strict=False))
    surfaces = {name: np.flatnonzero(each) for name, each in found.items()}
    return NetMesh(net.points, net.cells, net.edges, net.stiffness, net.weights, net.size, surfaces)


def _rim(net: NetMesh) -> NDArray[np.bool_]:
    """Nodes of edges with cells on one side only, (nodes,)."""
    cell = "triangle" if net.cells.shape[1] == 3 else "quadrilateral"
    pairs = np.sort(np.concatenate([net.cells[:, list(p)] for p in _EDGES[cell]]), axis=1)
    edges, count = np.unique(pairs, axis=0, return_counts=True)
    found = np.zeros(len(net.points), dtype=bool)
    found[edges[count == 1]] = True
    return found


def _of_file(body: SpringNet, folder: Path) -> NetMesh:
    path = Path(folder, body.mesh or "")
    used = {support.surface for support in body.supports}
    raw = fem.on_root(
        fem.MPI.COMM_WORLD,
        lambda: read_body(path, body.model or "2d", 1, mesh_size=body.mesh_size, used=sorted(used)),
    )
    if len(raw.points) > _MOST:
        raise MeshError(
            f"mesh file {path}: {len(raw.points)} masses, more than {_MOST:g}: give a coarser mesh"
        )
    found = _sprung(body, raw.points, raw.vertices, raw.cell)
    surfaces = {name: np.unique(facets) for name, facets in raw.surfaces.items()}
    return NetMesh(
        found.points, found.cells, found.edges, found.stiffness, found.weights, found.size,
        surfaces,
    )  # fmt: skip
