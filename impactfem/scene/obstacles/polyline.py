"""A chain of straight pieces in the plane, extruded in space."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, ClassVar, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.given import MaybeFormulas, MaybeTable
from impactfem.scene.inline import ListOf, Vector
from impactfem.scene.kinds import Name
from impactfem.scene.obstacles.base import (
    MOTION,
    MOTION_KIND,
    NAME,
    ROUNDING,
    Field,
    Indices,
    Ridges,
    RigidObstacle,
)
from impactfem.scene.obstacles.faces import HIGH, facing, patches
from impactfem.scene.obstacles.mirror import Mirror
from impactfem.scene.obstacles.rotation import ROTATION, ROTATION_KIND, Rotation
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

_ALIKE = 0.9  # cosine between normals from which two segments look the same way
_BEYOND = 0.1  # of the shorter segment at an inward corner by which parts go on behind the other
_DEEP = 0.5  # share of a segment by which a point may lie behind it and still touch it


@table('[[obstacle]] with kind = "polyline"')
class RigidPolyline(RigidObstacle):
    """A chain of straight pieces in the plane, extruded along z in 3D.

    The body is on the left of someone who walks from the first point to the last. A chain that
    ends where it began is closed.

    Raises:
        SceneError: a value is not allowed, or the chain has pieces without length or crosses
            itself.
    """

    kind: ClassVar[str] = "polyline"
    is_smooth: ClassVar[bool] = False

    name: str = key(Name(), NAME, default="polyline")
    points: Sequence[Sequence[float]] = key(
        ListOf(Vector((2,)), at_least=2), "corners [x, y], the body on the left", unit="m"
    )
    motion: MaybeFormulas = key(MOTION_KIND, MOTION, unit="m", default=None, absent="at rest")
    rotation: MaybeTable[Rotation] = key(ROTATION_KIND, ROTATION, default=None, absent="none")

    def _check(self) -> None:
        for index, (start, end) in enumerate(pairwise(self.points)):
            if tuple(start) == tuple(end):
                text = f" = {show(list(end))} repeats the point before it: remove it."
                raise KeyedError(self.kind, f"points[{index + 1}]", text)
        pair = _crossing(np.array(self.points))
        if pair is not None:
            text = f": pieces {pair[0]} and {pair[1]} (from 0 on) cross: the chain has no left side"
            raise KeyedError(self.kind, "points", f"{text}; move its points.")

    @property
    def features(self) -> float:
        """Its shortest piece [m]."""
        return min(math.dist(a, b) for a, b in pairwise(self.points))

    @property
    def is_flat(self) -> bool:
        """Whether all its pieces have one normal."""
        way = np.diff(np.asarray(self.points, dtype=np.float64), axis=0)
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        return bool(np.abs(way - way[0]).max() <= ROUNDING)

    @property
    def ridges(self) -> Ridges:
        """Corners that bend outwards, and ends: a body may lie over them."""
        chain = np.asarray(self.points, dtype=np.float64)
        along = np.diff(chain, axis=0)
        along /= np.linalg.norm(along, axis=1)[:, None]
        if (chain[0] == chain[-1]).all():
            places, before, after = chain[:-1], np.roll(along, 1, axis=0), along
        else:  # at an end the body is all around
            places = chain
            before = np.concatenate([_left(along[:1]), along])
            after = np.concatenate([along, -_left(along[-1:])])
        first, last = _left(before), _left(after)
        bends = _cross(before, after)
        out = (bends < -ROUNDING) | ((np.abs(bends) <= ROUNDING) & ((before * after).sum(1) < 0.0))
        return Ridges(places[out], first[out], last[out])

    def runs_along_z(self, low: float, high: float) -> bool:  # noqa: ARG002  (it has no end)
        """Always."""
        return True

    def gap(self, points: Floats) -> Field:
        """Chain of segments with the body on its left; in space extended along z.

        Inside is what lies right of the nearest segment. At a corner the sum of both normals tells
        the side (the pseudonormal of Baerentzen and Aanaes, IEEE Trans. Vis. Comput. Graph. 11
        (2005) 243-253). Beyond the ends of an open chain there is no obstacle: the gap is the
        distance from the end, whichever side the point lies on. A chain that returns to its first
        point is closed.
        """
        chain = np.asarray(self.points, dtype=np.float64)
        chain = chain[np.r_[True, np.any(np.diff(chain, axis=0) != 0.0, axis=1)]]
        edges = np.diff(chain, axis=0)
        lengths = np.sqrt(np.einsum("ij,ij->i", edges, edges))
        along = edges / lengths[:, None]
        left = np.stack([-along[:, 1], along[:, 0]], axis=1)
        closed = bool((chain[0] == chain[-1]).all())
        size = float(np.ptp(chain, axis=0).max())
        # Faces are reached a little beyond the open ends, lest rounding decide what is inside.
        low, high = np.zeros(len(edges)), lengths.copy()
        if not closed:
            low[0] -= ROUNDING * size
            high[-1] += ROUNDING * size

        plane = points[:, :2]
        segment, place = _nearest_segments(plane, chain, along, low, high)
        on_face = (place > low[segment]) & (place < high[segment])
        normal = np.zeros_like(points)
        normal[:, :2] = left[segment]
        gap = np.einsum("ij,ij->i", plane - chain[segment], left[segment])

        corner = np.flatnonzero(~on_face)
        vertex = segment[corner] + (place[corner] >= high[segment[corner]])
        sums = np.zeros_like(chain)
        sums[:-1] += left
        sums[1:] += left
        ends = np.zeros(len(chain), dtype=bool)
        if closed:
            sums[0] = sums[-1] = left[0] + left[-1]
        else:
            ends[[0, -1]] = True
        arms = plane[corner] - chain[vertex]
        distance = np.sqrt(np.einsum("ij,ij->i", arms, arms))
        folded = np.hypot(*sums.T) <= ROUNDING  # there and back: the body is all around
        always = (ends | folded)[vertex]
        sign = np.where(always | (np.einsum("ij,ij->i", arms, sums[vertex]) >= 0.0), 1.0, -1.0)
        gap[corner] = sign * distance
        clear = distance > ROUNDING * size
        normal[corner[clear], :2] = sign[clear, None] * arms[clear] / distance[clear, None]
        touching = ~clear & ~folded[vertex]
        middle = sums[vertex[touching]]
        normal[corner[touching], :2] = middle / np.hypot(*middle.T)[:, None]
        return gap, normal

    def other_gap(self, points: Floats) -> Field | None:
        """Distances from the nearest segment that looks elsewhere than the nearest one.

        Seen are segments with the foot of the point's normal between their ends and the point on
        their left: a ball in a corner that bends inwards touches two. What lies behind the nearest
        one, as over an edge, it cannot touch.
        """
        chain = np.asarray(self.points, dtype=np.float64)
        first, found = self.gap(points)
        nearest = found[:, :2].copy()
        foot = points[:, :2] - first[:, None] * nearest
        gap = np.full_like(first, np.inf)
        for start, end in pairwise(chain[np.r_[True, np.any(np.diff(chain, axis=0), axis=1)]]):
            length = math.dist(start, end)
            along = (end - start) / length
            left = np.array([-along[1], along[0]])
            arms = points[:, :2] - start
            place, height = arms @ along, arms @ left
            seen = (place > 0.0) & (place < length) & (height >= -_DEEP * length)
            seen &= ((0.5 * (start + end) - foot) * nearest).sum(axis=1) > 0.0
            closer = seen & (found[:, :2] @ left < _ALIKE) & (height < gap)
            gap[closer] = height[closer]
            found[closer, :2] = left
        return gap, found

    def parts(self) -> "Sequence[RigidPolyline]":
        """The chain cut where it bends inwards; parts go on behind each other a little."""
        chain = np.asarray(self.points, dtype=np.float64)
        closed = len(chain) > 2 and bool((chain[0] == chain[-1]).all())
        edges = np.diff(chain, axis=0)
        lengths = np.linalg.norm(edges, axis=1)
        along = edges / lengths[:, None]
        before, after = (np.roll(along, 1, axis=0), along) if closed else (along[:-1], along[1:])
        sharp = (_cross(before, after) > 0.0) & ((before * after).sum(axis=1) < _ALIKE)
        cuts = np.flatnonzero(sharp) + (not closed)
        if not len(cuts):
            return (self,)
        count = len(edges)
        starts = cuts if closed else [0, *cuts]
        stops = [*cuts[1:], cuts[0] + count] if closed else [*cuts, count]
        found = []
        for start, stop in zip(starts, stops, strict=True):
            own = chain[np.arange(start, stop + 1) % (count if closed else count + 1)]
            first, last = start % count, (stop - 1) % count
            if closed or start:
                own[0] -= _BEYOND * min(lengths[first], lengths[first - 1]) * along[first]
            if closed or stop < count:
                own[-1] += _BEYOND * min(lengths[last], lengths[stop % count]) * along[last]
            found.append(replace(self, points=tuple(map(tuple, own.tolist()))))
        return found

    def is_image(self, other: Self, mirror: Mirror) -> bool:
        """Whether it, at rest, is the mirror image of another one of its kind."""
        if mirror.axis == 2:  # extruded along z
            return bool(self.points == other.points)
        if len(self.points) != len(other.points):
            return False
        # A mirrored chain has its left on the right: it is walked backwards.
        image = np.array([mirror.point(point) for point in self.points])[::-1]
        return mirror.near(image, np.array([list(point) for point in other.points]))

    def faces(self, centre: Floats, reach: float) -> Floats:
        """The chain extruded along z; the body is on its left."""
        faces = []
        heights = centre[2] + np.linspace(-reach, reach, HIGH + 1)
        for start, end in zip(self.points[:-1], self.points[1:], strict=True):
            places = np.empty((9, HIGH + 1, 3))
            places[:, :, :2] = np.linspace(start, end, 9)[:, None]
            places[:, :, 2] = heights
            left = np.array([start[1] - end[1], end[0] - start[0], 0.0])
            parts = patches(places)
            faces.append(facing(parts, np.tile(left, (len(parts), 1))))
        return np.concatenate(faces)

    def outline(self) -> dict[str, Any]:
        """Its outline in the plane at rest, as moving pictures take it."""
        places = np.array(self.points)
        closed = bool((places[0] == places[-1]).all())
        x, y = places.T
        turning = float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))  # > 0: the left is inside
        inside = closed and turning > 0.0
        return {"shape": "chain", "points": places, "closed": closed, "inside": inside}


def _left(ways: Floats) -> Floats:
    """Directions to the left of others, (n, 2)."""
    return np.stack([-ways[:, 1], ways[:, 0]], axis=1)


def _nearest_segments(
    points: Floats, chain: Floats, along: Floats, low: Floats, high: Floats
) -> tuple[Indices, Floats]:
    """Nearest segment of each point and the point's place along its line [m], not clipped."""
    best = np.full(len(points), np.inf)
    segment = np.zeros(len(points), dtype=np.int64)
    place = np.zeros(len(points))
    x, y = np.ascontiguousarray(points.T)
    for k, (ax, ay) in enumerate(chain[:-1]):
        cos, sin = along[k]
        rx, ry = x - ax, y - ay
        s = rx * cos + ry * sin
        h = ry * cos - rx * sin
        excess = s - np.clip(s, low[k], high[k])
        distance = h * h + excess * excess
        closer = distance < best
        np.copyto(best, distance, where=closer)
        np.copyto(place, s, where=closer)
        segment[closer] = k
    return segment, place


def _crossing(points: Floats) -> tuple[int, int] | None:
    """Indices of two pieces of a chain (n, 2) that share more than a corner between neighbours."""
    a, b = points[:-1], points[1:]
    last, closed = len(a) - 1, bool((points[0] == points[-1]).all())
    for i in range(len(a)):
        rest = np.arange(i + 2, len(a))
        if closed and i == 0:
            rest = rest[rest != last]
        sides = [
            np.sign(_cross(b[i] - a[i], a[rest] - a[i])),
            np.sign(_cross(b[i] - a[i], b[rest] - a[i])),
            np.sign(_cross(b[rest] - a[rest], a[i] - a[rest])),
            np.sign(_cross(b[rest] - a[rest], b[i] - a[rest])),
        ]
        near = (np.minimum(a[rest], b[rest]) <= np.maximum(a[i], b[i])) & (
            np.maximum(a[rest], b[rest]) >= np.minimum(a[i], b[i])
        )
        crosses = (sides[0] * sides[1] <= 0) & (sides[2] * sides[3] <= 0) & near.all(axis=1)
        if crosses.any():
            return i, int(rest[np.argmax(crosses)])
    return None


def _cross(u: Floats, v: Floats) -> Floats:
    product: Floats = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return product
