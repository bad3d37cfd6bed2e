"""Triangulated surfaces, closed ones and open ones: what is wrong with one, distances from it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats, Integers

_LEAF = 4  # triangles in a leaf of the tree, about
_ROUNDING = 1e-9  # share of the size below which a distance says no direction
_LEVEL = 1e-14  # by which the cosine of an angle between faces misses 1 where they are in a plane
_FLAT = 1e-9  # volume, as a share of that of a cube of its size, that counts as none


@dataclass(frozen=True)
class Tree:
    """A balanced tree of boxes around triangles.

    Attributes:
        order: Triangles as the leaves hold them, shape (triangles,).
        low, high: Boxes of the nodes, shape (nodes, 3).
        starts: First place in ``order`` of each node's triangles and the one behind the last, shape
            (nodes, 2).
    """

    order: Integers
    low: Floats
    high: Floats
    starts: Integers

    @classmethod
    def of(cls, corners: Floats) -> "Tree":
        """Of triangles by their corners, shape (triangles, 3, 3)."""
        count, least, most = len(corners), corners.min(axis=1), corners.max(axis=1)
        middle = 0.5 * (least + most)
        depth = max(0, int(np.ceil(np.log2(max(count, 1) / _LEAF))))
        nodes = 2 ** (depth + 1) - 1
        order, starts = np.arange(count), np.zeros((nodes, 2), dtype=np.int64)
        low, high = np.full((nodes, 3), np.inf), np.full((nodes, 3), -np.inf)
        starts[0] = 0, count
        for node in range(nodes):
            begin, end = starts[node]
            mine = order[begin:end]
            if len(mine):
                low[node], high[node] = least[mine].min(axis=0), most[mine].max(axis=0)
            if 2 * node + 1 < nodes:
                half = (begin + end) // 2
                if len(mine) > 1:  # by halves along the longest axis
                    axis = int(np.argmax(np.ptp(middle[mine], axis=0)))
                    order[begin:end] = mine[np.argsort(middle[mine, axis], kind="stable")]
                starts[2 * node + 1], starts[2 * node + 2] = (begin, half), (half, end)
        return cls(order, low, high, starts)


@dataclass(frozen=True)
class ClosedSurface:
    """A closed surface of lines in the plane, or of triangles in space; there it may be open too.

    Behind an open one all is inside; beside it, off its border, nothing is.

    Attributes:
        points: [m], shape (points, dim).
        simplices: Lines or triangles between them, outwards by their order, (simplices, dim).
        cells: Triangles or tetrahedra that fill it, (cells, dim + 1); None if none are known.
    """

    points: Floats
    simplices: Integers
    cells: Integers | None = None

    def reversed(self) -> "ClosedSurface":
        """The same seen from inside: its distance is positive there."""
        return ClosedSurface(self.points, np.ascontiguousarray(self.simplices[:, ::-1]))

    @cached_property
    def corners(self) -> Floats:
        """Places of the corners of the triangles [m], (triangles, 3, 3)."""
        return np.ascontiguousarray(self.points[self.simplices])

    @cached_property
    def tree(self) -> Tree:
        """Boxes around the triangles."""
        return Tree.of(self.corners)

    @cached_property
    def _pseudonormals(self) -> Floats:
        """Normals of the inside, the three edges and the corners of each triangle, (n, 7, 3).

        At an edge that of both triangles, at a corner those of all weighted with their angles:
        their sign tells on which side a point lies that is nearest there. Source: Baerentzen and
        Aanaes, IEEE Trans. Vis. Comput. Graph. 11 (2005) 243-253.
        """
        corners, simplices = self.corners, self.simplices
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        found = np.empty((len(simplices), 7, 3))
        found[:, 0] = normal
        beside = np.where(self.beside < 0, np.arange(len(simplices))[:, None], self.beside)
        found[:, 1:4] = normal[:, None] + normal[beside]
        sums = np.zeros((len(self.points), 3))
        for k in range(3):
            one, two = (corners[:, (k + j) % 3] - corners[:, k] for j in (1, 2))
            sine = np.linalg.norm(np.cross(one, two), axis=1)
            angle = np.arctan2(sine, np.einsum("ij,ij->i", one, two))
            np.add.at(sums, simplices[:, k], angle[:, None] * normal)
        found[:, 4:] = sums[simplices]
        return found

    @cached_property
    def beside(self) -> Integers:
        """The triangle on the other side of each edge, from a corner to the next; -1: none."""
        starts, ends = self.simplices.ravel(), np.roll(self.simplices, -1, axis=1).ravel()
        here, count = starts * (size := len(self.points)) + ends, len(starts)
        order = np.argsort(here)
        back = order[np.minimum(np.searchsorted(here[order], ends * size + starts), count - 1)]
        same = (starts[back] == ends) & (ends[back] == starts)
        return np.where(same, back // 3, -1).reshape(-1, 3)

    @cached_property
    def border(self) -> NDArray[np.bool_]:
        """Which insides, edges and corners of triangles lie on its border, (triangles, 7)."""
        edges, at = self.beside < 0, np.zeros(len(self.points), dtype=bool)
        at[self.simplices[edges]] = True
        at[np.roll(self.simplices, -1, axis=1)[edges]] = True
        inner = np.zeros((len(edges), 1), dtype=bool)
        return np.hstack([inner, edges, at[self.simplices]])

    @cached_property
    def _flat(self) -> NDArray[np.bool_]:
        """Where the surface is flat around insides, edges and corners, (triangles, 7)."""
        unit = self._pseudonormals / np.linalg.norm(self._pseudonormals, axis=2)[:, :, None]
        level = np.einsum("tkd,td->tk", unit, unit[:, 0]) >= 1.0 - _LEVEL
        around = np.ones(len(self.points), dtype=bool)
        np.logical_and.at(around, self.simplices, level[:, 4:])
        level[:, 4:] = around[self.simplices]
        return np.asarray(level & ~self.border)

    @cached_property
    def size(self) -> float:
        """Its largest extent [m]."""
        return float(np.ptp(self.points[np.unique(self.simplices)], axis=0).max())

    def gap(
        self, points: Floats, known: tuple[Floats, Floats] | None = None
    ) -> tuple[Floats, Floats]:
        """Distances [m] of points (points, 3), negative inside, and their gradients.

        Args:
            points: [m].
            known: What is known of them: asked is what looks elsewhere, infinite without any.
        """
        from impactfem.scene.surface_kernels import nearest_faces  # noqa: PLC0415  (compiled)

        count, tree, rounding = len(points), self.tree, _ROUNDING * self.size
        found, feature = (np.zeros(count, dtype=np.int64) for _ in range(2))
        place = np.zeros((count, 3))
        last, normal = known or (np.zeros(count), np.zeros((count, 3)))
        nearest_faces(
            np.ascontiguousarray(points), self.corners, tree.order, tree.low, tree.high,
            tree.starts, np.ascontiguousarray(normal), last < 0.0, found,
            feature, place,
        )  # fmt: skip
        outward, arms = self._pseudonormals[found, feature], points - place
        size = np.linalg.norm(arms, axis=1)
        sign = np.where(np.einsum("ij,ij->i", arms, outward) < 0.0, -1.0, 1.0)
        clear = (size > rounding) & ~self._flat[found, feature]
        sign[clear & self.border[found, feature]] = 1.0
        outward = outward / np.linalg.norm(outward, axis=1)[:, None]
        along = (sign / np.where(clear, size, 1.0))[:, None] * arms
        return np.where(found < 0, np.inf, sign * size), np.where(clear[:, None], along, outward)


def signed_volume(points: Floats, simplices: Integers) -> float:
    """Area [m^2] or volume [m^3] inside, negative if the simplices look inwards."""
    corners = points[simplices] - points[simplices].mean(axis=(0, 1))
    return float(np.linalg.det(corners).sum()) / math.factorial(points.shape[1])


def faults(
    points: Floats, simplices: Integers, *, may_end: bool = False
) -> Iterator[tuple[str, str]]:
    """What is wrong with a surface that should be closed, and what to do; the worst first.

    What follows supposes that nothing before was wrong.

    Args:
        points: [m], (points, dim).
        simplices: Lines or triangles, (simplices, dim).
        may_end: Whether it may be open.
    """
    dim, count = points.shape[1], len(points)
    what, parts = ("lines", "corners") if dim == 2 else ("triangles", "edges")
    if not len(simplices):
        yield f"holds no {what}", "give a closed surface"
    if not np.isfinite(points).all():
        yield "has coordinates that are not finite", "export it again"
    # Sides of simplices, and whether these run them one way: from an end to the next, or out of it.
    starts: Integers = simplices.ravel()
    ends: Integers = starts if dim == 2 else np.roll(simplices, -1, axis=1).ravel()
    key = np.minimum(starts, ends) * count + np.maximum(starts, ends)
    way = np.tile([0.0, 1.0], len(simplices)) if dim == 2 else 1.0 * (starts < ends)
    sides, index, each = np.unique(key, return_inverse=True, return_counts=True)
    runs = np.bincount(index, weights=way, minlength=len(sides))

    def where(bad: NDArray[np.bool_]) -> str:
        place = points[np.array(divmod(int(sides[bad][0]), count))].mean(axis=0)
        return f"{int(bad.sum())} of its {len(sides)} {parts}, one at ({told(place)}),"

    if (bad := each == 1).any() and not may_end:
        text = f"is not closed: {where(bad)} belong to one of the {what} only"
        yield text, "fill its holes, or export it again"
    if (bad := each > 2).any():
        yield (
            f"meets itself: {where(bad)} belong to more than two {what}",
            "repair it",
        )
    if (bad := (runs != 1.0) & (each == 2)).any():
        text = f"is not oriented: {where(bad)} are run the same way by both {what}"
        yield text, "turn all normals outwards"
    if (each == 1).any():
        return  # an open one has no inside
    if (number := _components(simplices)) > 1:
        yield f"has {number} separate parts", "give each a file and a body, without cavities"
    size = float(np.ptp(points[np.unique(simplices)], axis=0).max())
    if not abs(signed_volume(points, simplices)) > _FLAT * size**dim:
        yield f"encloses no {'area' if dim == 2 else 'volume'}", "give a body with an inside"


def told(place: Floats) -> str:
    """Coordinates for a message."""
    return ", ".join(f"{x:.4g}" for x in place)


def _components(simplices: Integers) -> int:
    """Number of connected parts."""
    from scipy.sparse import coo_matrix  # noqa: PLC0415  (slow to load)
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    used, index = np.unique(simplices, return_inverse=True)
    nodes, others = index.reshape(simplices.shape), simplices.shape[1] - 1
    ends = np.repeat(nodes[:, :1], others, axis=1).ravel(), nodes[:, 1:].ravel()
    links = coo_matrix((np.ones(len(ends[0])), ends), shape=(len(used), len(used)))
    return int(connected_components(links, directed=False)[0])


def crossed(surface: ClosedSurface) -> Floats | None:
    """A place [m] where a surface in space crosses itself; None if it does not."""
    from impactfem.scene.surface_kernels import crossing  # noqa: PLC0415  (compiled)

    tree, triangles = surface.tree, np.ascontiguousarray(surface.simplices)
    one, two = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    edges = np.stack([one, two], axis=1)[one < two]
    edge, _ = crossing(
        edges, surface.points, triangles, surface.corners, tree.order, tree.low, tree.high,
        tree.starts,
    )  # fmt: skip
    return None if edge < 0 else np.asarray(surface.points[edges[edge]].mean(axis=0))
