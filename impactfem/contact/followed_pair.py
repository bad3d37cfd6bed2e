"""Gaps between two surfaces in terms of all contact nodes, and pairs that follow their bodies."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from impactfem.arrays import Floats, Integers
from impactfem.contact.line_kernels import met_normals
from impactfem.contact.meeting import Meeting, Turning
from impactfem.contact.mortar import MortarPairs
from impactfem.contact.mortar_surface import Surface, unit
from impactfem.contact.sparse_kernels import spread_rows, times_rows
from impactfem.contact.sparse_rows import times

FAR = 1e30
"""Gap of a multiplier whose part of the surface has nothing before it [m]."""

_CLOSED = 1e-9  # share of the largest gap that counts as closed
_ALIGNED = 0.8  # least cosine between the mean way and the normal for the way to be the normal
_ROUNDING = 1e-12  # share of coordinates


class Opposite(Protocol):
    """Two surfaces that may strike each other, with the distance from which they are looked at."""

    @property
    def surfaces(self) -> tuple[Surface, Surface]:
        """Both at t = 0; the first carries the multipliers."""

    @property
    def reach(self) -> float:
        """The distance [m]."""

    def roles(self) -> Integers:
        """Which faces carry before any contact, where a body may meet itself."""

    def met(
        self, points: Sequence[Floats], reach: float | None = None, roles: Integers | None = None
    ) -> MortarPairs:
        """Weighted gaps with the nodes of both at some places (nodes, dim) [m]."""


class FollowedPair:
    """A pair of surfaces that follows its bodies: a fixed number of gaps, found where these are.

    There is a gap for each corner of the carrier, open by `FAR` where nothing is opposite. Bodies
    close to each other are looked at anew each time, no further than two faces away. While they are
    apart they keep weights and normals until they have moved by a quarter of their distance: all
    pairs of faces of two bodies cost far more than those near each other.
    """

    follows = True

    def __init__(self, pair: Opposite, rows: Sequence[Integers], total: int) -> None:
        """Begin; see `SurfacePair.meeting`."""
        self._pair, self._rows, self._total = pair, tuple(rows), total
        self._corners = np.unique(pair.surfaces[0].corners)
        self._near = 2.0 * max(map(_largest, pair.surfaces))
        self._shape = total, pair.surfaces[0].dim
        self._roles = pair.roles()
        self._last: tuple[Floats, Meeting, float] | None = None

    @property
    def memory(self) -> Floats:
        """Where the bodies were looked at while apart, else NaN; which faces carried last."""
        places = np.full(self._shape, np.nan) if self._last is None else self._last[0]
        return np.concatenate([places.ravel(), self._roles])

    def recall(self, memory: Floats) -> None:
        """Look again from where the bodies were looked at."""
        places = memory[: math.prod(self._shape)].reshape(self._shape)
        self._last = None
        if not np.isnan(places).any():
            self(places, places)
        self._roles[:] = memory[places.size :]

    def __call__(self, places: Floats, acting: Floats) -> Meeting:  # noqa: ARG002  (first order)
        """How the surfaces meet with all contact nodes at some places (nodes, dim)."""
        if self._last is not None:
            begin, met, distance = self._last
            moved = places - begin
            way = sum(np.linalg.norm(moved[own], axis=1).max(initial=0.0) for own in self._rows)
            if 4.0 * way < distance:
                change = np.einsum("ij,ij->i", met.normal, met.weights @ moved)
                return replace(met, gap=met.gap + change)
        points = [places[own] for own in self._rows]
        found = self._pair.met(points, self._near, self._roles)
        self._last = None
        if not len(found.gap):
            found = self._pair.met(points, None, self._roles)
            # Faces that do not look at each other yet may be nearer than those that do.
            nodes = cKDTree(points[1]).query(points[0])[0].min() - 0.5 * self._near
            distance = float(found.gap.min(initial=nodes))
            if distance > self._near:
                self._last = places.copy(), self._spread(found, places), distance
                return self._last[1]
        return self._spread(found, places)

    def _spread(self, found: MortarPairs, places: Floats) -> Meeting:
        """Rows for all corners."""
        at, count = np.searchsorted(self._corners, found.nodes), len(self._corners)
        gap, area = np.full(count, FAR), np.zeros(count)
        normal = np.zeros((count, found.normal.shape[1]))
        normal[:, -1] = 1.0
        area[at] = found.area
        weights = pair_weights(found, self._rows, at, (count, self._total))
        other = self._pair.surfaces[1].moved(places[self._rows[1]])
        ways, opposite = times(weights, places)[at], opposite_normals(other, found)
        along = np.einsum("ij,ij->i", opposite, ways)
        # Far off, what is seen aslant may turn its back to the way.
        turned = (along < 0.0) & (found.gap > self._near)
        normal[at] = np.where(turned[:, None], found.normal, opposite)
        gap[at] = np.where(turned, found.gap, along)
        return Meeting(weights, gap, normal, area, lambda: Turning(self._patch(found, at)))

    def _patch(self, found: MortarPairs, at: Integers) -> csr_matrix:
        """Nodes of the carrier by their weights: its faces have the size of what they see."""
        ends, columns, values = found.here
        counts = np.zeros(len(self._corners) + 1, dtype=np.int32)
        counts[at + 1] = np.diff(ends)
        shape = len(self._corners), self._total
        return csr_matrix((np.abs(values), self._rows[0][columns], np.cumsum(counts)), shape=shape)


def opposite_normals(other: Surface, found: MortarPairs) -> Floats:
    """Mean normals of the surface opposite each multiplier, towards the carrier, (pairs, dim).

    A gap seen along the carrier's normal m changes with the speed n_o . (v_c - v_o) / (m . n_o) of
    what slides along a surface with the normal n_o: forces along n_o do no work in sliding. n_o is
    interpolated between nodes, whose normals are the means over the faces that are met.
    """
    met = np.ascontiguousarray(found.faces[:, 1])
    normals = met_normals(met, other.faces, other.vectors, len(other.points))
    return unit(times_rows(*found.there, normals))


def along_ways(way: Floats, normal: Floats, size: float) -> tuple[Floats, Floats]:
    """Gaps and normals along the mean ways across open gaps, (pairs, dim) each.

    The way and the mean normal are both means of the carrier's normals, the way's weighted with
    the gap. Forces along the way have no moment, so small sliding keeps the angular momentum. Where
    the gap is closed the way has no direction, and no moment either.

    Args:
        way: Means of the places of the other side less those of the carrier [m], (pairs, dim).
        normal: Mean normals, (pairs, dim).
        size: Largest coordinate [m], whose rounding is no way.
    """
    length = np.linalg.norm(way, axis=1)
    along = np.einsum("ij,ij->i", way, normal)
    closed = max(_CLOSED * length.max(initial=0.0), _ROUNDING * size)
    open_ = along > np.maximum(closed, _ALIGNED * length)
    gap, direction = along.copy(), normal.copy()
    gap[open_], direction[open_] = length[open_], way[open_] / length[open_, None]
    return gap, direction


def pair_weights(
    found: MortarPairs, rows: Sequence[Integers], at: Integers, shape: tuple[int, int]
) -> csr_matrix:
    """Weights of a meeting over all contact nodes, carrier minus other.

    Args:
        found: The meeting.
        rows: Places of both sides' nodes among all contact nodes.
        at: Row of each multiplier.
        shape: Of the result: rows and all contact nodes.
    """
    entries = spread_rows(found.here, found.there, at, (rows[0], rows[1]), shape[0])
    return csr_matrix(entries, shape=shape)


def _largest(side: Surface) -> float:
    """Largest extent of a face [m]."""
    x = side.points[side.faces]
    return float(np.linalg.norm(np.ptp(x, axis=1), axis=1).max(initial=0.0))
