"""What a body looks like in files and pictures: points, and cells of any kind between them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactfem.arrays import Floats, Integers

VERTEX, LINE, TRIANGLE, TETRAHEDRON = 1, 3, 5, 10
"""VTK's numbers of straight cells with as few nodes as can be; all others are in `cell_kinds`."""

VECTOR = 3
"""Components of a vector, in the plane and on a line too: the others are 0."""

MOTION: Mapping[str, int] = MappingProxyType({"displacement": VECTOR, "velocity": VECTOR})
"""Fields of every body at its nodes, with their components: [m], [m/s]."""

FLAGS = frozenset({"active"})
"""Fields that are 0 or 1."""


@dataclass(frozen=True)
class Shape:
    """A body: nodes that move, and cells of one kind between them.

    Attributes:
        name: Of the body.
        points: Nodes at rest [m], shape (nodes, 1, 2 or 3).
        cells: Nodes of each cell in VTK's order, shape (cells, nodes of a cell).
        vtk_type: VTK's number of the cells.
        radius: Of points and lines [m], shape () or (nodes,); 0 where they have none.
    """

    name: str
    points: ArrayLike
    cells: ArrayLike
    vtk_type: int
    radius: ArrayLike = 0.0

    @classmethod
    def vertices(cls, name: str, points: ArrayLike, radius: ArrayLike = 0.0) -> Self:
        """Points, each a cell of its own."""
        return cls(name, points, np.arange(len(np.asarray(points)))[:, None], VERTEX, radius)

    @classmethod
    def line(cls, name: str, points: ArrayLike, radius: ArrayLike = 0.0) -> Self:
        """A line through points in their order, as the axis of a bar, rod or beam."""
        first = np.arange(len(np.asarray(points)) - 1)
        return cls(name, points, np.stack([first, first + 1], axis=1), LINE, radius)


@dataclass(frozen=True)
class Layout:
    """Bodies in one file: nodes and cells body after body.

    Attributes:
        names: Of the bodies.
        starts: First node of each body, and the number of all nodes; shape (bodies + 1,).
        points: Nodes at rest [m], shape (nodes, 3).
        radius: Of points and lines [m], shape (nodes,).
        types: VTK's number of each cell, shape (cells,).
        offsets: Where the nodes of each cell begin, and their number; shape (cells + 1,).
        connectivity: Nodes of the cells one after the other.
    """

    names: tuple[str, ...]
    starts: Integers
    points: Floats = field(repr=False)
    radius: Floats = field(repr=False)
    types: NDArray[np.uint8] = field(repr=False)
    offsets: Integers = field(repr=False)
    connectivity: Integers = field(repr=False)

    @classmethod
    def of(cls, shapes: Sequence[Shape]) -> Self:
        """Put bodies one after the other."""
        points = [as_vectors(shape.points) for shape in shapes]
        cells = [np.asarray(shape.cells, dtype=np.int64) for shape in shapes]
        starts = np.cumsum([0, *(len(each) for each in points)])
        widths = np.repeat([each.shape[1] for each in cells], [len(each) for each in cells])
        moved = [own.ravel() + start for own, start in zip(cells, starts, strict=False)]
        types = np.repeat([shape.vtk_type for shape in shapes], [len(each) for each in cells])
        radii = [
            np.broadcast_to(np.asarray(shape.radius, dtype=np.float64), len(own))
            for shape, own in zip(shapes, points, strict=True)
        ]
        return cls(
            tuple(shape.name for shape in shapes),
            starts,
            np.concatenate(points),
            np.concatenate(radii),
            types.astype(np.uint8),
            np.concatenate([[0], np.cumsum(widths)]).astype(np.int64),
            np.concatenate(moved),
        )

    @property
    def body_of_cells(self) -> NDArray[np.int32]:
        """Number of the body of each cell, shape (cells,)."""
        return self.body_of_nodes[self.connectivity[self.offsets[:-1]]]

    @property
    def body_of_nodes(self) -> NDArray[np.int32]:
        """Number of the body of each node, shape (nodes,)."""
        counts = np.diff(self.starts)
        return np.repeat(np.arange(len(counts), dtype=np.int32), counts)

    @property
    def blocks(self) -> dict[int, Integers]:
        """Cells of each kind by VTK's number, shape (cells, nodes of a cell)."""
        found: dict[int, Integers] = {}
        for kind in np.unique(self.types):
            first = self.offsets[:-1][self.types == kind]
            width = int(self.offsets[1:][self.types == kind][0] - first[0])
            found[int(kind)] = self.connectivity[first[:, None] + np.arange(width)]
        return found


def joined(
    each: Sequence[Mapping[str, ArrayLike]], fields: Mapping[str, int]
) -> dict[str, NDArray[Any]]:
    """Values at the nodes of all bodies, one after the other.

    Args:
        each: For each body its values, shape (nodes,) or (nodes, components); each has a
            displacement.
        fields: Components of the fields of all. What a body does not have is NaN, or 0 of `FLAGS`.

    Returns:
        Arrays of shape (nodes,) or (nodes, components).
    """
    found, counts = {}, [len(np.asarray(own["displacement"])) for own in each]
    for name, components in fields.items():
        shape = () if components == 1 else (components,)
        parts = [
            as_components(own[name], components)
            if name in own
            else np.full((count, *shape), 0.0 if name in FLAGS else np.nan)
            for own, count in zip(each, counts, strict=True)
        ]
        found[name] = np.concatenate(parts)
    return found


def as_vectors(values: ArrayLike) -> Floats:
    """Vectors with three components, shape (..., 3), of shape (..., 1, 2 or 3)."""
    given = np.asarray(values, dtype=np.float64)
    missing = VECTOR - given.shape[-1]
    return np.pad(given, [*[(0, 0)] * (given.ndim - 1), (0, missing)]) if missing else given


def as_components(values: ArrayLike, components: int) -> Floats:
    """Values at nodes, (nodes,) or (nodes, components), of these or of vectors of fewer."""
    given = np.asarray(values, dtype=np.float64)
    if components == VECTOR:
        return as_vectors(given)
    return given.reshape(-1, components) if components > 1 else given.ravel()
