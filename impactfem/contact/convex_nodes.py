"""Gaps between a rigid body with edges and faces and the contact nodes of one that deforms.

Nodes are held off the body, wherever they touch it, and the corners of the body off the faces or
the axis between these nodes. Forces act along the way between both, or where it is closed across
the face, so that they have no moment.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix, eye_array, vstack

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.ball_pairs import BallPair, Target, carried, pushed_back
from impactfem.contact.convex_pairs import Marked, Pose
from impactfem.contact.followed_pair import FAR
from impactfem.contact.meeting import Anew, Meeting, Turning, patch_of, weights_on
from impactfem.system.closest import closest_shares, distances
from impactfem.system.convex import Convex
from impactfem.system.rigid import in_space

_SAME = 1e-9  # share of a size that is none
_FLUSH = 1e-4  # share of a size by which a node beside a face is held by it, if by no other
_LIKE = 0.5  # cosine of directions that belong to one face or to neighbours that hardly bend
_ALONG = np.stack([1.0 - np.arange(1, 8) / 8.0, np.arange(1, 8) / 8.0], axis=1)
"""Weights of the corners at places along an edge."""


@dataclass(frozen=True)
class NodesOnConvex(Anew):
    """Contact nodes that are held off a rigid body, as `impactfem.contact.pairs` takes them.

    Attributes:
        target: The nodes, and what is between them.
        body: What they are held off.
        total: Number of all contact nodes.
    """

    target: Target
    body: Marked
    total: int

    touch = 0.0

    @property
    def nodes(self) -> Integers:
        """Places of all its nodes among all contact nodes."""
        return np.concatenate([self.target.nodes, self.body.nodes])

    @property
    def thickness(self) -> float:
        """Way [m] to the middle of the body, from which on nodes would be pushed out elsewhere."""
        return 0.5 * self.body.shape.thickness + float(self.target.radius.min())

    @property
    def count(self) -> int:
        """Number of gaps, one of each node."""
        return len(self.target.nodes)

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """How they meet with all contact nodes at some places (nodes, dim); see `BallPair`."""
        still = np.zeros(3)
        now, pose = (self.body.pose(each, still) for each in (places, acting))
        gap, on, across = self._looks(places, now)
        _, at, normal = self._looks(acting, pose)
        across, on = across @ now[1] @ pose[1].T, pose[0] + (on - now[0]) @ now[1] @ pose[1].T
        # What slides past an edge is pushed out by the face it is behind, not by that before it.
        past = (gap < 0.0) & (np.einsum("pd,pd->p", across, normal) < _LIKE)
        past |= self._behind(acting, normal) & ~self._behind(places, across)
        height = np.einsum("pd,pd->p", in_space(acting[self.target.nodes]) - on, across)
        normal = np.where(past[:, None], across, normal)
        foot = in_space(acting[self.target.nodes]) - height[:, None] * across
        at = np.where(past[:, None], foot, at)
        own = self.body.weights(at, -normal, pose, acting)
        values = np.hstack([np.ones((self.count, 1)), -own])
        beside = np.broadcast_to(self.body.nodes, own.shape)
        nodes = np.hstack([self.target.nodes[:, None], beside])
        weights = weights_on(values, nodes, self.total)
        normal = normal[:, : places.shape[1]]

        def turning() -> Turning:
            return Turning(patch_of(weights, self.body.nodes), -own @ self.body.arms)

        return Meeting(weights, gap - self.target.radius, normal, np.zeros(self.count), turning)

    def _looks(self, places: Floats, pose: Pose) -> tuple[Floats, Floats, Floats]:
        """Gaps [m], nearest places on the body [m] and directions from there, in space."""
        centre, turn = pose
        shape, points = self.body.shape, (in_space(places[self.target.nodes]) - centre) @ turn
        gap, at, normal = self._facing(places, turn, points, *nearest(shape, points))
        return gap, centre + at @ turn.T, normal @ turn.T

    def _facing(
        self, places: Floats, turn: Floats, points: Floats, gap: Floats, at: Floats, normal: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """What `nearest` has found, but of nodes at edges by faces that look at each other.

        Where edges lie on each other, rounding tells which of them is outside. What is clearly
        before an edge is met by what is beside the node.
        """
        shape = self.body.shape
        behind = self._behind(places, normal @ turn.T)
        if shape.radius or not len(shape.normals) or not behind.any():
            return gap, at, normal
        faces, first = shape.normals[shape.flat], shape.starts[:-1][shape.flat]
        arms = points[:, None] - shape.vertices[shape.loop[first]]
        heights = np.einsum("pfd,fd->pf", arms, faces)
        for face, height in zip(faces @ turn.T, heights.T, strict=True):
            height[self._behind(places, np.broadcast_to(face, normal.shape))] = -np.inf
        best = heights.argmax(axis=1)
        height = heights[np.arange(len(gap)), best]
        on = gap <= _FLUSH * shape.reach
        other = behind & on & np.isfinite(height)
        height = np.where(other, height, 0.0)
        flat = (normal @ faces.T > 1.0 - _SAME).any(axis=1)
        gap = np.where(other, height, np.where(behind & ~on & ~flat, FAR, gap))
        normal = np.where(other[:, None], faces[best], normal)
        return gap, np.where(other[:, None], points - height[:, None] * normal, at), normal

    def _behind(self, places: Floats, normal: Floats) -> Booleans:
        """Which nodes directions (nodes, 3) push against their own faces."""
        return self.target.behind(places, normal[:, : places.shape[1]])


@dataclass(frozen=True)
class CornersOnFaces(Anew):
    """Corners of a rigid body that are held off what is between nodes.

    Corners are affine sums of the body's nodes: `BallPair` takes them as nodes after all others. Of
    a cylinder they are places around its rims, one of which looks at the face that is nearest.

    Attributes:
        pair: Their gaps, with corners for balls.
        body: Whose corners they are.
    """

    pair: BallPair
    body: Marked

    touch = 0.0

    @classmethod
    def of(cls, body: Marked, target: Target, total: int) -> "CornersOnFaces":
        """Of all corners of a body, beside so many contact nodes."""
        count = len(body.shape.vertices)
        radius = np.full(count, body.shape.radius)
        return cls(BallPair(total + np.arange(count), radius, target, total + count), body)

    @property
    def nodes(self) -> Integers:
        """Places of all its nodes among all contact nodes."""
        return np.concatenate([self.body.nodes, self.pair.target.nodes])

    @property
    def thickness(self) -> float:
        """See `BallPair.thickness`."""
        return self.pair.thickness

    @property
    def count(self) -> int:
        """Number of gaps."""
        return self.pair.count

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """How they meet with all contact nodes at some places (nodes, dim); see `BallPair`."""
        total, nodes, shape = len(places), self.body.nodes, self.body.shape
        beside, arms = csr_matrix(vstack([eye_array(total), self._corners(acting)])), 0.0 * places
        arms[nodes] = self.body.arms
        there = beside @ (acting + arms)
        met = self.pair(beside @ (places + arms), there)
        weights, gap = met.weights @ beside, np.where(self._aside(met, there), FAR, met.gap)
        if shape.radius:
            ways, followers = self.pair.target.ways(met, there), nodes[self.body.dim + 1 :]
            weights = weights + carried(ways, followers, int(nodes[0]), self.body.unit, total)

        def turning() -> Turning:
            patch = patch_of(met.weights, self.pair.target.nodes)[:, :total]
            return Turning(patch, weights @ arms)

        return replace(met, weights=csr_matrix(weights), gap=gap, turning=turning)

    def _aside(self, met: Meeting, there: Floats) -> Booleans:
        """Which gaps are of corners with sides nearer than they are, off the middles of faces."""
        shape, slots = self.body.shape, self.pair.slots
        found = np.zeros((len(shape.vertices), slots), dtype=bool)
        if shape.radius or not len(shape.normals) or self.pair.target.signs is None:
            return found.ravel()
        sides = np.concatenate([shape.edges, shape.edges[:, ::-1]])
        for slot in range(slots):
            corners, ways = there[-len(found) :], met.normal[slot::slots]
            found[:, slot] = pushed_back(corners, sides, ways)
        amid = np.asarray((abs(met.weights) > _SAME).sum(axis=1)).ravel() > there.shape[1]
        return np.asarray(found.ravel() & ~(amid & (met.gap > 0.0)))

    @cached_property
    def between(self) -> Floats:
        """Places along its edges in space, along its axes [m]; in the plane corners are all."""
        shape = self.body.shape
        corners = shape.vertices[shape.edges if self.body.dim == 3 else []]
        found: Floats = np.einsum("pk,ekd->epd", _ALONG, corners.reshape(-1, 2, 3))
        return found.reshape(-1, 3)

    def least_between(self, places: Floats) -> float:
        """Least gap along its edges [m], with all contact nodes at places (nodes, dim)."""
        centre, turn = self.body.pose(places, np.zeros(3))
        total, count = len(places), len(self.between)
        radius = np.full(count, self.body.shape.radius)
        there = np.vstack([places, centre + self.between @ turn.T])
        edges = BallPair(total + np.arange(count), radius, self.pair.target, len(there))
        return float(edges(there, there).gap.min())

    def _corners(self, acting: Floats) -> csr_matrix:
        """Weights of all contact nodes in the corners, (corners, nodes)."""
        body, shape = self.body, self.body.shape
        pose, n = body.pose(acting, np.zeros(3)), np.zeros(3)
        centre, turn = pose
        if shape.axis is not None:
            faces = acting[self.pair.target.nodes[self.pair.target.simplices]]
            middle = shape.vertices.mean(axis=0) @ turn.T + centre
            arms, length = distances(middle[None], faces, closest_shares(middle[None], faces))
            n = arms[0, np.argmin(length[0])] @ turn / length.min()
        at = shape.placed(centre, turn, shape.aim(n))[0]
        return weights_on(body.weights(at, turn @ n, pose, acting), body.nodes, len(acting))


def nearest(shape: Convex, points: Floats) -> tuple[Floats, Floats, Floats]:
    """Signed distances of points from a body, places on it that are nearest, and directions.

    Args:
        shape: The body.
        points: Along its axes [m], (points, 3).

    Returns:
        Distances [m], negative inside, (points,); places [m] and unit normals there, (points, 3).
    """
    found = _from_cylinder if shape.axis is not None else _from_hull
    gap, normal = found(shape, points)
    gap = gap - shape.radius
    return gap, points - gap[:, None] * normal, normal


def _from_hull(shape: Convex, points: Floats) -> tuple[Floats, Floats]:
    """Distances from a hull of corners, and directions."""
    corners = shape.vertices[shape.simplices]
    arms, length = distances(points, corners, closest_shares(points, corners))
    each, best = np.arange(len(points)), np.argmin(length, axis=1)
    gap, arm = length[each, best], arms[each, best]
    normal = arm / np.maximum(gap, np.finfo(float).tiny)[:, None]
    if len(shape.normals) and not shape.radius:
        outer = shape.vertices[shape.loop[shape.starts[:-1]]]
        heights = np.einsum("pfd,fd->pf", points[:, None] - outer, shape.normals)
        face = np.argmax(heights, axis=1)
        height = heights[each, face]
        # Inside the nearest face counts; so it does on it, where the way is rounding.
        flat = height <= _SAME * shape.reach
        flat &= (height <= 0.0) | (gap <= 2.0 * _SAME * shape.reach)
        gap, normal = (
            np.where(flat, height, gap),
            np.where(flat[:, None], shape.normals[face], normal),
        )
    return gap, normal


def _from_cylinder(shape: Convex, points: Floats) -> tuple[Floats, Floats]:
    """Distances from a round cylinder, and directions."""
    middle, axis = shape.vertices.mean(axis=0), np.asarray(shape.axis)
    along = (points - middle) @ axis
    across = points - middle - along[:, None] * axis
    off = np.linalg.norm(across, axis=1)
    tiny = np.finfo(float).tiny
    out = across / np.maximum(off, tiny)[:, None]
    end = np.where(along < 0.0, -1.0, 1.0)[:, None] * axis
    half = float(((shape.vertices - middle) @ axis).max())
    beyond, beside = np.abs(along) - half, off - shape.girth
    # Off the rim there are both ways, else the one that is longer.
    a, b = np.maximum(beyond, 0.0), np.maximum(beside, 0.0)
    rim = (a > 0.0) & (b > 0.0)
    gap = np.where(rim, np.hypot(a, b), np.maximum(beyond, beside))
    slant = (a[:, None] * end + b[:, None] * out) / np.maximum(np.hypot(a, b), tiny)[:, None]
    flat = np.where((beyond >= beside)[:, None], end, out)
    return gap, np.where(rim[:, None], slant, flat)
