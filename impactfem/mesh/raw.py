"""A mesh as plain arrays on one rank: what shapes and files make, and checks and names need."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Floats, Integers

Cell = Literal["triangle", "quadrilateral", "tetrahedron", "hexahedron"]

Numbering = Callable[[NDArray[Any]], Integers]
"""From Gmsh's tags of nodes to their places in a list."""

_PACKED = 2**21  # three node numbers below this fit into one 64-bit integer


@dataclass(frozen=True)
class Source:
    """The file that a mesh comes from, in words.

    Attributes:
        text: What it holds and what of it is used.
        unused: What is left out, one sentence each.
        is_curved: Whether its elements are curved.
    """

    text: str
    unused: tuple[str, ...] = ()
    is_curved: bool = False


@dataclass(frozen=True)
class RawMesh:
    """A whole mesh on this rank.

    Attributes:
        points: Nodes [m], shape (nodes, dim).
        cells: Nodes of each cell, vertices first (DOLFINx's order), shape (cells, nodes per cell).
        cell: Kind of the cells.
        degree: Degree of the geometry, 1 or 2.
        surfaces: Vertices of the facets of each named surface, shape (facets, vertices).
        source: The file it comes from; None for shapes.
        groups: Cells of each material, if the body has several.
    """

    points: Floats
    cells: Integers
    cell: Cell
    degree: int
    surfaces: Mapping[str, Integers] = field(default_factory=dict)
    source: Source | None = None
    groups: Mapping[str, Integers] = field(default_factory=dict)

    @property
    def dim(self) -> int:
        """Dimension of space and of the cells."""
        return int(self.points.shape[1])

    @property
    def vertices(self) -> Integers:
        """Vertices of each cell, shape (cells, vertices per cell)."""
        return self.cells[:, : fem.num_vertices(self.cell)]


def cell_facets(mesh: RawMesh) -> Integers:
    """Vertices of each facet of each cell, shape (cells, facets per cell, vertices per facet)."""
    return mesh.vertices[:, np.array(fem.facet_vertices(mesh.cell))]


def facet_keys(*groups: Integers) -> list[Integers]:
    """Number facets so that two have one key if and only if they have the same vertices.

    Three vertices tell a facet from all others, quadrilaterals included, as two facets of a
    conforming mesh share two at most.

    Args:
        groups: Facets, shape (facets, vertices); keys can be compared among the groups of one call.

    Returns:
        Keys of each group, shape (facets,).
    """
    rows = np.concatenate([np.sort(group, axis=1)[:, :3] for group in groups])
    base = int(rows.max(initial=0)) + 1
    keys = rows[:, 0].copy()
    for column in rows.T[1:]:
        if base > _PACKED:
            keys = np.unique(keys, return_inverse=True)[1].astype(np.int64)
        keys = keys * base + column
    return np.split(keys, np.cumsum([len(group) for group in groups])[:-1])


def outer_facets(mesh: RawMesh) -> Integers:
    """Facets of one cell only, shape (facets, vertices), in the order of the cells."""
    each = cell_facets(mesh)
    facets: Integers = each.reshape(-1, each.shape[2])
    _, first, counts = np.unique(facet_keys(facets)[0], return_index=True, return_counts=True)
    outer: Integers = facets[np.sort(first[counts == 1])]
    return outer


def numbering(tags: NDArray[Any]) -> Numbering:
    """The numbering by these tags, which in a file may be as large as it likes."""
    order = np.argsort(tags)
    known = tags[order]
    return lambda asked: order[np.searchsorted(known, asked)]


def without_loose_nodes(
    points: Floats, cells: Integers, surfaces: Mapping[str, Integers]
) -> tuple[Floats, Integers, dict[str, Integers]]:
    """Drop the nodes of no cell and number the others anew, in their order.

    Returns:
        Points, cells and surfaces; a node of a surface that no cell has becomes -1.
    """
    used = np.zeros(len(points), dtype=bool)
    used[cells] = True
    number = np.where(used, np.cumsum(used) - 1, -1)
    named = {name: number[facets] for name, facets in surfaces.items()}
    return points[used], number[cells], named
