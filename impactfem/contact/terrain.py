"""Gaps between a convex shape of a rigid body and a surface of triangles, closed or as terrain.

Two polyhedra touch where a corner of one lies on a face of the other, or where two edges cross, and
the direction lies among the normals of both there. So faces of the surface are met by corners of
the shape only, along their own normals, and only edges and corners of it that stick out meet faces
and edges of the shape. A flat surface has none of these: what slides over it meets no seams.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.convex_pairs import Marked, Placed, Pose, Shaped, settled
from impactfem.contact.followed_pair import FAR
from impactfem.contact.meeting import Meeting, Turning
from impactfem.contact.terrain_kernels import struck
from impactfem.scene.closed_surface import ClosedSurface
from impactfem.scene.surface_kernels import triangles_in

type Points = tuple[Floats, Floats, Floats]
"""Places on the core of a shape and on a surface [m], and directions, (places, 3) each."""

_MOST = 24  # gaps of a shape
_ROOM = 0.1  # of its reach around it, within which triangles are looked at
_STRAIGHT = 1e-6  # sine of the angle below which a surface is flat at an edge
_EDGE = 1e-9  # share of a triangle's size within which places are on its edges
_ON = 1e-6  # the same of contact points, and of a body's size within which they are one
_WIDE = 0.5  # sine by which a direction may lie beside the normals at a corner of the shape
_BESIDE = 0.02  # the same at edges and corners of the surface
_LEVEL = 1e-6  # the same where what is round looks from the face beside, on which it stands
_DIGITS = 12  # of normals that differ
_DEEP = 3  # of which one of so many gaps is for the deepest places, where there are too many


@dataclass(frozen=True)
class Terrain:
    """A surface and how its triangles stand to each other.

    Attributes:
        surface: It.
    """

    surface: ClosedSurface

    @cached_property
    def sides(self) -> Floats:
        """From each corner of the triangles to the next [m], (triangles, 3, 3)."""
        return np.roll(self.surface.corners, -1, axis=1) - self.surface.corners

    @cached_property
    def normals(self) -> Floats:
        """Of the triangles, (triangles, 3)."""
        found = np.cross(self.sides[:, 0], self.sides[:, 1])
        return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])

    @cached_property
    def out(self) -> Floats:
        """Directions in the planes of the triangles out of each side, (triangles, 3, 3)."""
        found = np.cross(self.sides, self.normals[:, None])
        return np.asarray(found / np.linalg.norm(found, axis=2)[:, :, None])

    @cached_property
    def across(self) -> Floats:
        """Ways over each side to the far corner, without any to the own, (triangles, 3, 3)."""
        numbers, beside = self.surface.simplices, self.surface.beside
        sums, ends = numbers.sum(axis=1), numbers + np.roll(numbers, -1, axis=1)
        far = np.where(beside < 0, sums[:, None], sums[beside]) - ends
        return np.asarray(self.surface.points[far] - self.surface.corners)

    @cached_property
    def rise(self) -> Floats:
        """Sines of the angles by which the surface rises over each side, (triangles, 3)."""
        rise = np.einsum("tkd,td->tk", self.across, self.normals)
        return np.asarray(rise / np.linalg.norm(self.across, axis=2))

    @cached_property
    def sharp(self) -> Booleans:
        """Which sides stick out, those of a border among them, (triangles, 3)."""
        return (self.surface.beside < 0) | (self.rise < -_STRAIGHT)

    @cached_property
    def peaks(self) -> Booleans:
        """Whether corners are ends of sides that stick out, (triangles, 3)."""
        numbers, found = self.surface.simplices, np.zeros(len(self.surface.points), dtype=bool)
        found[numbers[self.sharp]] = True
        found[np.roll(numbers, -1, axis=1)[self.sharp]] = True
        return np.asarray(found[numbers])

    @cached_property
    def _ring(self) -> tuple[Integers, Integers]:
        """Where neighbours of each corner start, and these, by their numbers."""
        numbers = self.surface.simplices
        pairs = [numbers[:, [i, j]] for i, j in np.ndindex(3, 3) if i != j]
        found = np.unique(np.concatenate(pairs), axis=0)
        return np.searchsorted(found[:, 0], np.arange(len(self.surface.points) + 1)), found[:, 1]

    def standing(self, corners: Floats, edges: Integers, radius: float, near: Integers) -> Points:
        """Corners of a shape that stand on triangles, corner by corner, and below them.

        Args:
            corners: Of its core [m], as each triangle sees them, (near or 1, corners, 3).
            edges: Pairs of them.
            radius: Around the core [m].
            near: Triangles that are looked at.
        """
        normals, start = self.normals[near], self.surface.corners[near]
        height = np.einsum("td,tkd->tk", normals, corners - start[:, :1])
        depth, found = height - radius, np.ones(height.shape, dtype=bool)
        behind = depth < 0.0
        for side in range(3):
            arms, rise = corners - start[:, side, None], self.rise[near, side, None]
            size = np.linalg.norm(self.sides[near, side], axis=1)[:, None]
            beyond = np.einsum("td,tkd->tk", self.out[near, side], arms)
            # Below a valley it lies behind both; below a ridge behind what it is less deep in.
            found &= beyond <= _EDGE * size - np.where((rise > 0.0) & behind, depth, 0.0)
            other = self.normals[self.surface.beside[near, side]]
            less = np.einsum("td,tkd->tk", other, arms) - radius > depth
            found &= ~(less & behind & (rise < -_STRAIGHT))
        for one, two in edges.tolist():
            way = np.broadcast_to(corners[:, two] - corners[:, one], normals.shape)
            up = np.einsum("td,td->t", normals, way) / np.linalg.norm(way, axis=1)
            found[:, one] &= up >= -_WIDE
            found[:, two] &= up <= _WIDE
        corner, place = np.nonzero(found.T)
        x, n = np.broadcast_to(corners, (*height.shape, 3))[place, corner], normals[place]
        return x, x - height[place, corner, None] * n, n

    def sticks_out(self, at: Floats, n: Floats, of: Integers, beside: float) -> Booleans:
        """Whether places on triangles are on sides or corners that do, along a direction.

        Args:
            at: The places [m], (places, 3).
            n: Directions, (places, 3).
            of: Triangles.
            beside: Sine by which directions may lie beside the normals.
        """
        arms, sides = at[:, None] - self.surface.corners[of], self.sides[of]
        size = np.einsum("pkd,pkd->pk", sides, sides)
        share = np.einsum("pkd,pkd->pk", arms, sides) / size
        off = arms - share[:, :, None] * sides
        on = np.einsum("pkd,pkd->pk", off, off) <= _ON**2 * size
        near, side, each = on.sum(axis=1), np.argmax(on, axis=1), np.arange(len(at))
        up = np.einsum("pkd,pd->pk", sides, n) / np.sqrt(size)
        over = self.across[of, side]
        rise = np.einsum("pd,pd->p", over, n) <= beside * np.linalg.norm(over, axis=1)
        # Of its own triangle the side before goes down to the one that is asked for.
        edge = (near == 1) & self.sharp[of, side] & (np.abs(up[each, side]) <= beside) & rise
        edge &= up[each, side - 1] >= -beside
        corner = (near > 1) & self.peaks[
            of, (side := np.where(on[:, 0] & on[:, 2], 0, side + 1) % 3)
        ]
        starts, ring = self._ring
        for k in np.flatnonzero(corner).tolist():
            number = self.surface.simplices[of[k], side[k]]
            ways = self.surface.points[ring[starts[number] : starts[number + 1]]]
            ways = ways - self.surface.points[number]
            corner[k] = (ways @ n[k] <= beside * np.linalg.norm(ways, axis=1)).all()
        return np.asarray(edge | corner)


@dataclass(frozen=True)
class OnTerrain(Shaped):
    """A shape on a surface.

    Attributes:
        one: The shape that the forces act on.
        other: Where the surface is, as a box around it would be.
        terrain: The surface at rest.
        total: Number of all contact nodes.
        touch: Distance [m] below which they touch: rounding of places.
        led: How far the surface goes from where forces act to where places are [m].
    """

    one: Marked
    other: Placed
    terrain: Terrain
    total: int
    touch: float
    led: float = 0.0

    @property
    def count(self) -> int:
        """Number of gaps."""
        return min(_MOST, 8 + 2 * len(self.one.shape.vertices))

    def behind(self, places: Floats) -> float:
        """How deep its middle lies behind the surface, with all nodes at some places [m]."""
        centre, turn = self.one.pose(places, np.zeros(3))
        middle = centre + turn @ self.one.shape.vertices.mean(axis=0)
        return max(0.0, -float(self.terrain.surface.gap(self.other.at.back(middle[None]))[0][0]))

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """How they meet with all contact nodes at some places (nodes, 3).

        As of `ConvexPair` contact points are those where forces act, and gaps change with their
        material from there on.
        """
        shape, at = self.one.shape, self.other.at
        centre, turn = pose = self.one.pose(acting, np.zeros(3))
        moved = (places - acting)[self.nodes]
        way = float(np.sqrt((moved * moved).sum(axis=1).max())) + self.led
        rest = at.back(centre), turn if at.turn is None else at.turn.T @ turn
        bulge = shape.radius if shape.radii is None else shape.reach
        x, y, n = self._touching(rest, bulge + 2.0 * way + _ROOM * shape.reach)
        between = np.einsum("ij,ij->i", x - y, n) - shape.radius
        some = _chosen(x, n, between, shape.reach, self.count)
        n, between, count = at.turned(n[some]), between[some], len(some)
        gap, normal = np.full(self.count, FAR), np.zeros((self.count, 3))
        normal[:, 2] = 1.0
        weights = self.one.weights(at.moved(x[some]) - shape.radius * n, n, pose, acting)
        gap[:count] = between + np.einsum("ij,ij->i", weights @ moved, n) - self.touch
        normal[:count] = n
        ends = len(self.nodes) * np.minimum(np.arange(self.count + 1), count)
        columns = np.tile(self.nodes, count)
        found = csr_matrix((weights.ravel(), columns, ends), shape=(self.count, self.total))
        return Meeting(found, gap, normal, np.zeros(self.count), lambda: Turning(None))

    def _touching(self, pose: Pose, room: float) -> Points:
        """Where they touch, or may soon, with the surface at rest; room around the core [m]."""
        shape, terrain, tree = self.one.shape, self.terrain, self.terrain.surface.tree
        body = shape.placed(*pose)
        corners, middle = body[0], body[0].mean(axis=0)
        least, most = corners.min(axis=0) - room, corners.max(axis=0) + room
        near = triangles_in(least, most, tree.order, tree.low, tree.high, tree.starts)
        faced = np.einsum(
            "td,td->t", terrain.normals[near], middle - terrain.surface.corners[near, 0]
        )
        up = near[faced > 0.0]
        seen = corners[None]
        if shape.aims and len(up):
            ways, which = np.unique(terrain.normals[up].round(_DIGITS), axis=0, return_inverse=True)
            aims = map(shape.aim, ways @ pose[1])
            seen = np.array([shape.placed(*pose, aim)[0] for aim in aims])[which.ravel()]
        found = [terrain.standing(seen, body[5], shape.radius, up)]
        if len(some := near[terrain.peaks[near].any(axis=1)]):
            (x, y, n), of = self._struck(pose, some)
            # Ends of edges that do not cross are apart across the direction.
            aside = x - y - np.einsum("pd,pd->p", x - y, n)[:, None] * n
            kept = np.linalg.norm(aside, axis=1) <= _BESIDE * shape.reach
            kept &= terrain.sticks_out(y, n, of, _LEVEL if shape.radius else _BESIDE)
            found.append((x[kept], y[kept], n[kept]))
        x, y, n = (np.concatenate(each) for each in zip(*found, strict=True))
        soon = np.einsum("ij,ij->i", x - y, n) < shape.radius + room
        return x[soon], y[soon], n[soon]

    def _struck(self, pose: Pose, near: Integers) -> tuple[Floats, Integers]:
        """See `impactfem.contact.terrain_kernels.struck`; of an ellipsoid until it settles."""
        shape, terrain, turn = self.one.shape, self.terrain, pose[1]
        axis = np.zeros(3) if shape.axis is None else pose[1] @ shape.axis
        beside = axis, shape.reach
        of = terrain.surface.corners, terrain.normals
        body = shape.placed(*pose)
        found, triangles = struck(body, shape.spine(*pose), *beside, near, *of)
        if shape.radii is None:
            return found, triangles

        def look(aims: Floats, _: bool) -> tuple[Floats, Floats]:
            body = shape.placed(*pose, aims[0] @ turn)
            met = struck(body, body, *beside, triangles[k : k + 1], *of)[0][:, 0]
            return (turn @ shape.seen(aims[0] @ turn, -met[2] @ turn))[None], met

        near_enough = terrain.sticks_out(found[1], found[2], triangles, _WIDE)
        for k in np.flatnonzero(near_enough):  # a ball has one place on each triangle
            found[:, k] = settled(look, -found[2, k][None])
        return found, triangles


def _chosen(x: Floats, n: Floats, gap: Floats, size: float, most: int) -> Integers:
    """Some contact points: none twice, and of too many the deepest and the outermost ones.

    Args:
        x: Places on the shape, (places, 3).
        n: Directions, (places, 3).
        gap: [m], (places,).
        size: Of the shape [m].
        most: Number at most.
    """
    order = np.argsort(gap, kind="stable")
    apart = np.linalg.norm(x[order, None] - x[order], axis=2) > _ON * size
    apart |= np.linalg.norm(n[order, None] - n[order], axis=2) > _BESIDE
    kept = order[(apart | (np.arange(len(x)) >= np.arange(len(x))[:, None])).all(axis=1)]
    if len(kept) > most:
        deep = most // _DEEP
        first = np.cross(n[kept[0]], np.eye(3)[int(np.argmin(np.abs(n[kept[0]])))])
        angles = 2.0 * np.pi * np.arange(most - deep) / (most - deep)
        second = np.cross(n[kept[0]], first)
        ways = np.outer(np.cos(angles), first) + np.outer(np.sin(angles), second)
        outer = np.argmax(x[kept] @ ways.T, axis=0)
        kept = kept[np.union1d(np.arange(deep), outer)]
    return np.sort(kept)
