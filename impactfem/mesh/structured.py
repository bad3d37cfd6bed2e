"""Quadrilaterals and hexahedra of named shapes, mapped from lattices: no generator is needed.

Blocks and rings are one lattice. Discs, cylinders and balls have a square or cube in the middle
and layers from its sides to the rim, as a single lattice would fold at the corners.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.errors import MeshError
from impactfem.mesh.outline import NEAR, Ball, Polygon, Sector, outline
from impactfem.mesh.raw import Cell, RawMesh
from impactfem.mesh.shapes import check_count, placed

# The middle of a disc or ball: half the width of the square or cube, and how round it is (0 to 1).
# Chosen for the largest smallest angle.
_MIDDLE, _ROUNDNESS = 0.55, 0.45


@dataclass(frozen=True)
class _Grid:
    """Cells on lattices that share nodes.

    Attributes:
        points: Nodes, shape (nodes, dim).
        cells: Nodes of each cell, shape (cells, nodes of one lattice direction, ...).
    """

    points: Floats
    cells: Integers


def structured_mesh(
    shape: Any, size: float, *, degree: int = 1, axisymmetric: bool = False
) -> RawMesh:
    """Mesh a shape with quadrilaterals or hexahedra, on this rank.

    Args:
        shape: A shape of `impactfem.scene.shapes`.
        size: Largest length of edges [m], to a tenth; near the rims of round bodies some are
            shorter.
        degree: Degree of the geometry; 2 follows curved surfaces.
        axisymmetric: Whether x is the radius r >= 0.

    Raises:
        MeshError: The mesh would be too large, or the shape has no such mesh.
    """
    plan = outline(shape, axisymmetric=axisymmetric)
    check_count(plan, size)
    scaled = size / plan.frame.scale
    drawing = plan.drawing
    if isinstance(drawing, Polygon):
        grid = _box(drawing, scaled, degree)
    elif isinstance(drawing, Ball):
        counts = _round_counts(drawing.radius, scaled)
        grid = _o_grid(3, drawing.radius, counts, degree)
        for axis, sign in enumerate(drawing.signs):
            grid = _half(grid, axis, sign)
    else:
        grid = _sector(drawing, scaled, degree)
    return placed(_finished(grid, degree), plan)


def _pieces(length: float, size: float) -> int:
    """Number of equal edges of a length, none longer than the size but for rounding."""
    return max(1, math.ceil(length / size * (1.0 - 1e-9)))


def _box(drawing: Polygon, size: float, degree: int) -> _Grid:
    """A rectangle or box."""
    low, high = drawing.corners.min(axis=0), drawing.corners.max(axis=0)
    at_corner = (np.abs(drawing.corners - low) < NEAR) | (np.abs(drawing.corners - high) < NEAR)
    if len(drawing.corners) != 4 or not at_corner.all():
        raise MeshError(
            "a block turned by half a right angle and cut is a triangle, which has no lattice of "
            'quadrilaterals; use cells = "simplex"'
        )
    if drawing.heights:
        low, high = np.append(low, drawing.heights[0]), np.append(high, drawing.heights[1])
    counts = [_pieces(float(edge), size) for edge in high - low]
    lines = [np.linspace(a, b, degree * n + 1) for a, b, n in zip(low, high, counts, strict=True)]
    return _joined(
        [_lattice(counts, degree)],
        lambda key: np.stack([line[key[:, k]] for k, line in enumerate(lines)], axis=1),
    )


def _sector(sector: Sector, size: float, degree: int) -> _Grid:
    """A disc, ring or cylinder, or what is left of it."""
    if sector.inner:
        grid = _ring(sector, size, degree)
    else:
        grid = _o_grid(2, sector.radius, _round_counts(sector.radius, size), degree)
        if sector.count < 4:
            # The kept quarters lie on one side of their first edge and, if one, of their second.
            for turn in range(3 - sector.count):
                quarter = (sector.first + (0 if turn == 0 else sector.count)) % 4
                inward = ((0, 1), (-1, 0), (0, -1), (1, 0))[quarter]
                axis = 0 if inward[0] else 1
                sign = inward[axis] if turn == 0 else -inward[axis]
                grid = _half(grid, axis, sign)
    return grid if sector.heights is None else _extruded(grid, sector.heights, size, degree)


def _ring(sector: Sector, size: float, degree: int) -> _Grid:
    """Quarters of a ring, on a polar lattice."""
    around = _pieces(0.5 * math.pi * sector.radius, size)
    across = _pieces(sector.radius - sector.inner, size)
    counts = [across, around * sector.count]
    keys = _lattice(counts, degree)
    if sector.count == 4:
        keys[..., 1] %= degree * counts[1]
    radii = np.linspace(sector.inner, sector.radius, degree * across + 1)

    def place(key: Integers) -> Floats:
        steps = degree * around
        quarter = (sector.first + key[:, 1] // steps) % 4
        # Turned by whole quarters: nodes on the axes lie there exactly.
        angle = 0.5 * math.pi * (key[:, 1] % steps) / steps
        c, s = np.cos(angle), np.sin(angle)
        x = np.choose(quarter, [c, -s, -c, s])
        y = np.choose(quarter, [s, c, -s, -c])
        points: Floats = radii[key[:, 0], None] * np.stack([x, y], axis=1)
        return points

    return _joined([keys], place)


def _round_counts(radius: float, size: float) -> tuple[int, int]:
    """Cells along a side of the middle square, even so that halves can be cut, and layers."""
    along = 2 * _pieces(0.25 * math.pi * radius, size)
    return along, _pieces((1.0 - _MIDDLE) * radius, size)


def _o_grid(dim: int, radius: float, counts: tuple[int, int], degree: int) -> _Grid:
    """A disc or ball; its nodes have a lattice of the middle as key, and their layer."""
    along, layers = counts
    width = degree * along
    middle = _lattice([along] * dim, degree)
    blocks = [np.concatenate([middle, np.zeros_like(middle[..., :1])], axis=-1)]
    shell = _lattice([along] * (dim - 1) + [layers], degree)
    for axis, side in product(range(dim), (0, width)):
        block = np.insert(shell, axis, side, axis=-1)
        blocks.append(block)

    def place(key: Integers) -> Floats:
        w = 2.0 * key[:, :dim] / width - 1.0
        share = key[:, dim:] / (degree * layers)
        tangents = np.tan(0.25 * math.pi * w)
        rim = tangents / np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-300)
        core = _MIDDLE * ((1.0 - _ROUNDNESS) * w + _ROUNDNESS * _rounded(w))
        return radius * ((1.0 - share) * core + share * rim)

    return _joined(blocks, place)


def _rounded(w: Floats) -> Floats:
    """The smooth map of the cube (-1, 1)^dim to the unit ball that takes sides to the rim."""
    squares = w**2
    dim = w.shape[1]
    out = np.empty_like(w)
    for k in range(dim):
        others = [squares[:, j] for j in range(dim) if j != k]
        inside = 1.0 - sum(others) / 2.0
        if dim == 3:
            inside = inside + others[0] * others[1] / 3.0
        out[:, k] = w[:, k] * np.sqrt(inside)
    return out


def _half(grid: _Grid, axis: int, sign: int) -> _Grid:
    """The cells on one side of the plane through the centre; all for sign 0."""
    if not sign:
        return grid
    flat = grid.cells.reshape(len(grid.cells), -1)
    kept = grid.cells[sign * grid.points[flat][:, :, axis].mean(axis=1) > 0.0]
    used, cells = np.unique(kept, return_inverse=True)
    return _Grid(grid.points[used], cells.reshape(kept.shape).astype(np.int64))


def _extruded(grid: _Grid, heights: tuple[float, float], size: float, degree: int) -> _Grid:
    """A plane grid (z, x) drawn along y: points (x, y, z)."""
    count = _pieces(heights[1] - heights[0], size)
    levels = np.linspace(*heights, degree * count + 1)
    base = len(grid.points)
    points = np.empty((len(levels), base, 3))
    points[:, :, 0], points[:, :, 2] = grid.points[:, 1], grid.points[:, 0]
    points[:, :, 1] = levels[:, None]
    steps = degree * np.arange(count)[:, None] + np.arange(degree + 1)
    cells = grid.cells[None, :, :, :, None] + base * steps[:, None, None, None, :]
    return _Grid(points.reshape(-1, 3), cells.reshape(-1, *cells.shape[2:]))


def _lattice(counts: Sequence[int], degree: int) -> Integers:
    """Lattice coordinates of the nodes of a block of cells.

    Returns:
        Shape (cells, degree + 1, ..., degree + 1, dim): a cell, a node of it in each direction.
    """
    dim = len(counts)
    corners = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
    local = np.stack(np.meshgrid(*[np.arange(degree + 1)] * dim, indexing="ij"), axis=-1)
    keys = degree * corners.reshape(-1, *[1] * dim, dim) + local
    return keys.astype(np.int64)


def _joined(blocks: Sequence[Integers], place: Callable[[Integers], Floats]) -> _Grid:
    """Join blocks of cells at the nodes of equal keys, and place the nodes."""
    size = blocks[0].shape[-1]
    keys = np.concatenate(blocks)
    rows = keys.reshape(-1, size)
    base = int(rows.max()) + 1
    packed = rows @ base ** np.arange(size)[::-1]
    _, first, cells = np.unique(packed, return_index=True, return_inverse=True)
    return _Grid(place(rows[first]), cells.reshape(keys.shape[:-1]).astype(np.int64))


def _finished(grid: _Grid, degree: int) -> RawMesh:
    """Cells in DOLFINx's order, all of the same orientation."""
    dim = grid.points.shape[1]
    cells = grid.cells
    corners = grid.points[cells.reshape(len(cells), -1)]
    strides = [degree * (degree + 1) ** (dim - 1 - axis) for axis in range(dim)]
    edges = [corners[:, stride] - corners[:, 0] for stride in strides]
    mirrored = np.linalg.det(np.stack(edges, axis=1)) < 0.0
    cells = cells.copy()
    cells[mirrored] = cells[mirrored].swapaxes(1, 2)
    cell: Cell = "quadrilateral" if dim == 2 else "hexahedron"
    places = np.rint(degree * fem.reference_nodes(cell, degree)).astype(np.int64)
    order = np.ravel_multi_index(tuple(places.T), [degree + 1] * dim)
    return RawMesh(grid.points, cells.reshape(len(cells), -1)[:, order], cell, degree)
