"""Mortar contact between two meshed surfaces: who meets whom, weighted gaps, normals and forces.

One surface, the carrier, has a multiplier at each corner node i whose linear function psi_i meets
the other surface. Over the overlap, with the surfaces' own shape functions phi,

    a_i = int psi_i dA,   Wc_ij = int psi_i phi_j dA / a_i,   Wo_ik = int psi_i phi_k dA / a_i,

where phi_k is taken at the point opposite. The rows of both sum to 1. The psi_i are >= 0 and sum to
1, also on faces of degree 2. Normal and gap are

    n_i = - int psi_i m dA / |...|,   gap_i = n_i . (sum_j Wc_ij x_j - sum_k Wo_ik x_k),

with the carrier's outward normals m: n_i points from the other surface to the carrier, and gap_i
is the mean, with weight psi_i, of the way from each point to that opposite, measured along n_i.
That way runs along the normal of the carrier (`mortar_lines`, `mortar_faces`) and is g long, so
that gap_i is the mean of g cos(angle between that normal and -n_i), to rounding on flat faces of
degree 1: less than the mean of g by g angle^2 / 2, nothing where the carrier is flat. On curved
faces points are matched above the chord, which shifts them sideways by the square of the size of a
face; the gap feels that times the slope of one surface against the other.

A force lambda_i >= 0 [N] puts Wc_ij lambda_i n_i on the carrier's nodes and -Wo_ik lambda_i n_i on
the other's: equal and opposite. Their moments differ by

    sum_i lambda_i (Wc_i x - Wo_i x) x n_i,

which vanishes where n_i is the normal at all points of its overlap (flat carriers) or where the
mean way is 0 (surfaces that touch), and is of the order g angle otherwise.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from impactfem.arrays import Floats, Integers
from impactfem.contact.broad_phase import candidates
from impactfem.contact.line_kernels import summed_blocks, summed_vectors
from impactfem.contact.mortar_faces import face_overlaps, face_ways
from impactfem.contact.mortar_lines import line_overlaps, line_ways
from impactfem.contact.mortar_surface import Overlap, Surface, unit
from impactfem.contact.sparse_kernels import scaled_rows, times_rows

_CHUNK = 10_000  # pairs of faces integrated at once: bounds the memory
_ROUNDING = 1e-10  # share of coordinates that counts as nothing
_FULL = 1e-6  # share of a face beyond which more overlap lies behind other faces

type Rows = tuple[Integers, Integers, Floats]
"""Ends of the rows of a sparse matrix, columns and values."""


@dataclass(frozen=True)
class MortarPairs:
    """Multipliers of one surface against another, the same on every rank.

    Attributes:
        nodes: Node of the carrier of each multiplier, increasing, shape (count,).
        here: Wc, ends of its rows, columns and values: arrays cost far less than what SciPy asks.
        there: Wo, likewise.
        sizes: Numbers of nodes of carrier and other.
        area: a_i [m^2; times the thickness, or of the full turn], shape (count,).
        normal: n_i, from the other surface to the carrier, shape (count, dim).
        gap: Mean distance along n_i [m], shape (count,).
        faces: Faces of carrier and other that overlap, shape (overlaps, 2).
    """

    nodes: Integers
    here: Rows
    there: Rows
    sizes: tuple[int, int]
    area: Floats
    normal: Floats
    gap: Floats
    faces: Integers

    @property
    def count(self) -> int:
        """Number of multipliers."""
        return len(self.nodes)

    @cached_property
    def carrier_weights(self) -> csr_array:
        """Wc, shape (count, carrier's nodes)."""
        return _sparse(self.here, (self.count, self.sizes[0]))

    @cached_property
    def other_weights(self) -> csr_array:
        """Wo, shape (count, other's nodes)."""
        return _sparse(self.there, (self.count, self.sizes[1]))

    def gaps(self, carrier_points: ArrayLike, other_points: ArrayLike) -> Floats:
        """Gaps [m] of nodes elsewhere, with the same weights and normals, shape (count,)."""
        way = self.carrier_weights @ np.asarray(carrier_points, dtype=np.float64)
        way -= self.other_weights @ np.asarray(other_points, dtype=np.float64)
        return np.asarray(np.einsum("id,id->i", self.normal, way))

    def forces(self, multipliers: ArrayLike) -> tuple[Floats, Floats]:
        """Forces on the nodes of carrier and other [N], shapes (nodes, dim).

        Args:
            multipliers: Normal forces [N] (pressure times area), shape (count,).
        """
        pushes = np.asarray(multipliers, dtype=np.float64)[:, None] * self.normal
        return self.carrier_weights.T @ pushes, -(self.other_weights.T @ pushes)


def mortar(
    carrier: Surface,
    other: Surface,
    reach: float,
    *,
    depth: float | None = None,
    thickness: float = 1.0,
    axisymmetric: bool = False,
    least: float = 1e-9,
    points: int | None = None,
    pairs: Integers | None = None,
    full: bool = False,
) -> MortarPairs:
    """Match two surfaces at the present places of their nodes.

    Faces meet if their normals are opposed (cosine below -0.2) and their distance lies between
    -depth and reach. Where several lie behind one another, the nearest counts.

    Args:
        carrier: The surface with the multipliers.
        other: The surface it meets.
        reach: Largest distance [m].
        depth: Largest penetration [m]; by default the size of the carrier's face, at most reach.
        thickness: Thickness of plane bodies [m].
        axisymmetric: Whether the first coordinate is the radius; areas are those of the full turn.
        least: Share of the area of a corner's function below which it has no multiplier.
        points: Gauss points in each direction of a segment; by default as many as are exact for
            parallelograms, triangles and lines with straight sides, and two more if there are
            quadrilaterals of other shapes.
        pairs: Faces that can meet, if they are known: `faces_in_reach`, with a reach that covers
            the way since. Shape (pairs, 2), sorted.
        full: Whether every node of faces of degree 2 has a multiplier: beside the linear functions
            of corners, which they span all of that degree with, the shape functions of the others.
    """
    inwards = _inwards(carrier, reach, depth)
    if pairs is None:
        pairs = _in_reach(carrier, other, reach, inwards)
    rule = points or _points(carrier, other, axisymmetric=axisymmetric, full=full)

    parts: list[tuple[Integers, Overlap]] = []
    for begin in range(0, max(1, len(pairs)), _CHUNK):
        some = pairs[begin : begin + _CHUNK]
        if carrier.dim == 2:
            overlap = line_overlaps(
                carrier, other, some, reach, inwards, rule,
                thickness=thickness, axisymmetric=axisymmetric, full=full,
            )  # fmt: skip
        else:
            overlap = face_overlaps(carrier, other, some, reach, inwards, rule, full=full)
        met = np.flatnonzero(overlap.cover > 0.0)
        parts.append((some[met], _select(overlap, met)))
    return _gather(carrier, other, parts, least, thickness=thickness, axisymmetric=axisymmetric)


def faces_in_reach(
    carrier: Surface, other: Surface, reach: float, *, depth: float | None = None
) -> Integers:
    """Pairs of faces that can meet, sorted, shape (pairs, 2); see `mortar` for the arguments."""
    return _in_reach(carrier, other, reach, _inwards(carrier, reach, depth))


def _in_reach(carrier: Surface, other: Surface, reach: float, inwards: Floats) -> Integers:
    ways = line_ways if carrier.dim == 2 else face_ways
    return candidates(carrier, other, reach, inwards, (ways(carrier), ways(other)))


def _inwards(carrier: Surface, reach: float, depth: float | None) -> Floats:
    """How far each face looks inwards [m]."""
    if depth is not None:
        return np.full(len(carrier.faces), float(depth))
    x = carrier.points[carrier.faces]
    size = np.linalg.norm(x.max(axis=1) - x.min(axis=1), axis=1)
    return np.minimum(size, reach)


def _points(carrier: Surface, other: Surface, *, axisymmetric: bool, full: bool) -> int:
    """Gauss points that integrate psi phi exactly, but for quadrilaterals of any shape."""
    degree = max(carrier.degree, other.degree)
    own = carrier.degree if full else 1
    if carrier.dim == 2:
        top = own + degree + (carrier.degree if axisymmetric else 0)
        return (top + 2) // 2
    several = carrier.bilinear or other.bilinear
    top = own * (1 + carrier.bilinear) + degree * (2 if several else 1)
    return (top + 2) // 2 + (0 if _parallel(carrier) and _parallel(other) else 2)


def _parallel(side: Surface) -> bool:
    """Whether all quadrilaterals are parallelograms."""
    if not side.bilinear:
        return True
    x = side.points[side.corners]
    skew = np.abs(x[:, 0] - x[:, 1] - x[:, 2] + x[:, 3]).max(initial=0.0)
    return bool(skew <= _ROUNDING * np.abs(side.points).max(initial=0.0))


def _select(overlap: Overlap, some: NDArray[Any]) -> Overlap:
    return Overlap(*(each[some] for each in overlap))


def _sparse(rows: Rows, shape: tuple[int, int]) -> csr_array:
    ends, columns, values = rows
    return csr_array((values, columns, ends), shape=shape)


def _visible(pairs: Integers, cover: Floats, gap: Floats) -> NDArray[np.bool_]:
    """Pairs that are not behind others: the nearest, until the carrier's face is covered."""
    kept = np.ones(len(pairs), dtype=bool)
    if not len(pairs):
        return kept
    face = pairs[:, 0]
    total = np.bincount(face, cover)
    crowded = np.flatnonzero(total[face] > 1.0 + _FULL)
    if not len(crowded):
        return kept
    order = crowded[np.lexsort((np.abs(gap[crowded]), face[crowded]))]
    starts = np.flatnonzero(np.diff(face[order], prepend=-1))
    before = np.cumsum(cover[order]) - cover[order]
    before -= np.repeat(before[starts], np.diff(starts, append=len(order)))
    kept[order] = before < 1.0 - _FULL
    return kept


def _gather(
    carrier: Surface,
    other: Surface,
    parts: list[tuple[Integers, Overlap]],
    least: float,
    *,
    thickness: float,
    axisymmetric: bool,
) -> MortarPairs:
    """Sum the integrals over pairs of faces into rows of the carrier's corners."""
    pairs, overlap = parts[0]
    if len(parts) > 1:
        pairs = np.concatenate([some for some, _ in parts])
        overlap = Overlap(*map(np.concatenate, zip(*(own for _, own in parts), strict=True)))
    visible = _visible(pairs, overlap.cover, overlap.gap)
    if not visible.all():
        pairs, overlap = pairs[visible], _select(overlap, visible)
    own, opposite = carrier.faces[pairs[:, 0]], other.faces[pairs[:, 1]]
    rows = np.ascontiguousarray(own[:, : overlap.carrier.shape[1]])
    sizes = len(carrier.points), len(other.points)
    here = summed_blocks(rows, own, overlap.carrier, sizes[0], sizes[0])
    there = summed_blocks(rows, opposite, overlap.other, *sizes)
    area = times_rows(*here, np.ones((sizes[0], 1)))[:, 0]
    full = _corner_areas(carrier, thickness=thickness, axisymmetric=axisymmetric)
    chosen = np.flatnonzero(area > least * full)
    here, there = (scaled_rows(*part, chosen, 1.0 / area[chosen]) for part in (here, there))
    normal = -unit(summed_vectors(rows, overlap.vectors, sizes[0])[chosen])
    way = times_rows(*here, carrier.points) - times_rows(*there, other.points)
    gap = np.einsum("id,id->i", normal, way)
    return MortarPairs(chosen, here, there, sizes, area[chosen], normal, gap, pairs)


def _corner_areas(carrier: Surface, *, thickness: float, axisymmetric: bool) -> Floats:
    """Areas of the corners' functions, roughly: equal parts of the flat parts."""
    area = np.linalg.norm(carrier.vectors, axis=2).sum(axis=1)
    if axisymmetric:
        area *= 2.0 * np.pi * np.abs(carrier.points[carrier.faces][:, :, 0]).mean(axis=1)
    elif carrier.dim == 2:
        area *= thickness
    corners = carrier.corners
    share = np.repeat(area / corners.shape[1], corners.shape[1])
    return np.bincount(corners.ravel(), share, minlength=len(carrier.points))
