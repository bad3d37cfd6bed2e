"""Gaps between a rigid body with edges in the plane and an obstacle that is not convex.

Two polygons touch where a corner of one lies on a side of the other. Corners of the body are held
off the obstacle by its distance, its sides off the obstacle's own corners, *ridges*. Either way the
direction lies between the normals of the two sides that meet at the corner: what is nearest across
another direction is passed, not struck. So a body that slides over a seam of two faces does not
catch on the end of the next one.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.convex_pairs import Marked, Placed, Shaped
from impactfem.contact.followed_pair import FAR
from impactfem.contact.meeting import Meeting, Turning
from impactfem.scene.obstacles import Rigid
from impactfem.scene.obstacles.base import Ridges
from impactfem.system.rigid import in_space

_WIDER = 0.02  # sine by which directions may lie beside the normals: bodies turn in a layer


@dataclass(frozen=True)
class OnRidges(Shaped):
    """A body on an obstacle: two gaps of each of its corners, one of each ridge.

    Attributes:
        one: The body that the forces act on.
        other: Where the obstacle is, as a convex body would be.
        obstacle: The obstacle at rest.
        ridges: What sticks out of it.
        total: Number of all contact nodes.
        touch: Distance [m] below which they touch: rounding of places.
        led: How far the obstacle goes from where forces act to where places are [m].
    """

    one: Marked
    other: Placed
    obstacle: Rigid
    ridges: Ridges
    total: int
    touch: float
    led: float = 0.0

    @property
    def count(self) -> int:
        """Number of gaps."""
        return 2 * len(self.one.shape.vertices) + len(self.ridges.places)

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """How they meet with all contact nodes at some places (nodes, 2).

        As of `ConvexPair` contact points are those where forces act, and gaps change with their
        material from there on.
        """
        shape, pose = self.one.shape, self.one.pose(acting, np.zeros(3))
        corners, outer = (each[:, :2] for each in shape.placed(*pose)[:2])
        sides = shape.loop.reshape(-1, 2)
        each = (*self._corners(corners, outer, sides), self._sides(corners, outer, sides))
        gap, normal, on = (np.concatenate(parts) for parts in zip(*each, strict=True))
        there = np.flatnonzero(gap < 2.0 * shape.reach + self.led)
        gap = gap - self.touch
        n = normal[there]
        weights = self.one.weights(in_space(on[there]), in_space(n), pose, acting)
        way = weights @ (places - acting)[self.nodes]
        gap[there] += np.einsum("ij,ij->i", way, n)
        gap[np.setdiff1d(np.arange(len(gap)), there)] = FAR
        at = np.repeat(there, len(self.nodes)), np.tile(self.nodes, len(there))
        found = csr_matrix((weights.ravel(), at), shape=(self.count, self.total))
        return Meeting(found, gap, normal, np.zeros(self.count), lambda: Turning(None))

    def _corners(
        self, corners: Floats, outer: Floats, sides: Integers
    ) -> list[tuple[Floats, Floats, Floats]]:
        """Gaps of corners to the nearest face and another one, normals, places on the body."""
        at, radius = self.other.at, self.one.shape.radius
        before, after = np.zeros_like(corners), np.zeros_like(corners)
        before[sides[:, 1]], after[sides[:, 0]] = outer, outer
        rest, found = at.back(corners), []
        for field in (self.obstacle.gap(rest), self.obstacle.other_gap(rest)):
            if field is None:
                raise TypeError(f"obstacle {self.obstacle.name} has one face only")
            n = at.turned(field[1])
            met = _between(before, -n, after)
            found.append((np.where(met, field[0] - radius, FAR), n, corners - radius * n))
        return found

    def _sides(
        self, corners: Floats, outer: Floats, sides: Integers
    ) -> tuple[Floats, Floats, Floats]:
        """The same of ridges to the side that looks at each."""
        at, radius = self.other.at, self.one.shape.radius
        ridges, first, last = at.moved(self.ridges.places), *map(at.turned, self.ridges[1:])
        start, end = corners[sides[:, 0]], corners[sides[:, 1]]
        arms, along = ridges[:, None] - start, end - start
        heights = np.einsum("rfd,fd->rf", arms, outer) - radius
        share = np.einsum("rfd,fd->rf", arms, along) / (along**2).sum(axis=1)
        # What lies before one side is not behind another one.
        met = (share >= 0.0) & (share <= 1.0)
        met &= (heights > 0.0) | (heights.max(axis=1) <= 0.0)[:, None]
        met &= _between(last[:, None], -outer[None], first[:, None])
        side = np.argmax(np.where(met, heights, -np.inf), axis=1)
        rows, n = np.arange(len(ridges)), -outer[side]
        gap = np.where(met[rows, side], heights[rows, side], FAR)
        return gap, n, ridges + heights[rows, side][:, None] * n


def _between(one: Floats, directions: Floats, two: Floats) -> Booleans:
    """Whether directions lie between others, from one to two by less than half a turn left."""

    def cross(a: Floats, b: Floats) -> Floats:
        return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

    found = (cross(one, directions) >= -_WIDER) & (cross(directions, two) >= -_WIDER)
    return np.asarray(found & (((one + two) * directions).sum(axis=-1) >= -_WIDER))
