"""Gaps between two convex bodies, or one and an obstacle, as `impactfem.contact.pairs` takes them.

A place q of a rigid body is an affine sum of a few of its nodes, its *markers* at the centre and at
a unit along each axis: a force there is that sum of forces on the markers, in total and in moment.
So the contact points of `convex_kernels`, which are elsewhere in each layer, are gaps that weigh
markers. What rolls touches below a place q of its core, at an arm that does not turn with it: nodes
that follow the centre with arms along the axes of space, *followers*, carry that part. Both bodies
are pushed at one point, so that friction too keeps their angular momentum.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.contact.convex_kernels import inverted, nearest_rotation, separate, touching
from impactfem.contact.followed_pair import FAR
from impactfem.contact.meeting import Anew, Edges, Meeting, Turning, patch_of
from impactfem.scene.obstacles.rotation import AT_REST, Placement, placement
from impactfem.system.convex import Carrier, Convex
from impactfem.system.rigid import in_space

type Pose = tuple[Floats, Floats]
"""Centre (3,) and rotation (3, 3) of a body."""

_DEEP = 0.25  # of its thickness: what lies deeper behind an edge is on another side
_ROUNDS, _SETTLED = 300, 1e-13  # looks for where ellipsoids touch, and a change that ends them
_MOST = 8  # gaps of two bodies with faces in space


@dataclass(frozen=True)
class Marked:
    """A rigid body with its markers.

    Attributes:
        shape: The body along its axes from the first marker.
        nodes: Its markers and then its followers, if it rolls, among all contact nodes.
        unit: Arm of markers and followers [m].
        dim: Number of coordinates.
    """

    shape: Convex
    nodes: Integers
    unit: float
    dim: int

    @classmethod
    def of(cls, carrier: Carrier, start: int, dim: int) -> "Marked":
        """Of a body whose contact nodes begin at a place among all."""
        return cls(carrier.shape, start + carrier.markers, carrier.unit, dim)

    def middle(self, places: Floats, near: Floats) -> Floats:  # noqa: ARG002  (it has one)
        """Where it is with all nodes at some places [m], (3,)."""
        return in_space(places[self.nodes[0]])

    def pose(self, places: Floats, near: Floats) -> Pose:  # noqa: ARG002  (it has one)
        """Its centre and rotation with all nodes at some places."""
        centre, frame = self._frame(places)
        return centre, np.asarray(nearest_rotation(frame))

    def _frame(self, places: Floats) -> Pose:
        """Its centre and axes; amid a way, a mean of two rotations, these are a little short."""
        dim, own = self.dim, places[self.nodes[: self.dim + 1]]
        centre, axes = np.zeros(3), np.eye(3)
        centre[:dim] = own[0]
        axes[:dim, :dim] = ((own[1:] - own[0]) / self.unit).T
        return centre, axes

    def weights(self, at: Floats, n: Floats, pose: Pose, places: Floats) -> Floats:
        """Of its nodes in forces at places of its surface, (places, nodes).

        Args:
            at: The places [m], (places, 3).
            n: Directions across which they touch, towards the body, (3,) or (places, 3).
            pose: Of the body.
            places: Of all contact nodes [m], (nodes, dim).
        """
        dim, (centre, turn), (_, axes) = self.dim, pose, self._frame(places)
        core = centre + self.shape.core((at - centre) @ turn, n @ turn) @ turn.T
        found = np.zeros((len(at), len(self.nodes)))
        found[:, 1 : dim + 1] = ((core - centre) @ inverted(axes).T)[:, :dim] / self.unit
        if len(self.nodes) > dim + 1:
            found[:, dim + 1 :] = (at - core)[:, :dim] / self.unit
        found[:, 0] = 1.0 - found[:, 1:].sum(axis=1)
        return found

    def edges(self, places: Floats) -> Edges:
        """Its edges with all contact nodes at some places; of a cylinder its axis."""
        shape, pose = self.shape, self.pose(places, np.zeros(3))
        round_ = shape.axis is not None
        corners = shape.spine(*pose)[0] if round_ else shape.placed(*pose)[0]
        pairs = np.array([[0, 1]]) if round_ else shape.edges
        curves = np.zeros((len(pairs), 4, 3))
        curves[:, 0] = corners[pairs[:, 0]]
        curves[:, 1] = corners[pairs[:, 1]] - curves[:, 0]
        radius = np.full(len(pairs), shape.radius + shape.girth)
        if round_ or not len(shape.normals):
            return Edges(curves, radius, pairs - 2 * round_, np.zeros((len(pairs), 2, 3)))
        return Edges(curves, radius, pairs, shape.beside @ pose[1].T, _DEEP * shape.thickness)

    def pushed(
        self,
        edges: Integers,  # noqa: ARG002  (places tell)
        shares: Floats,  # noqa: ARG002
        at: Floats,
        n: Floats,
        places: Floats,
    ) -> tuple[Floats, Integers, Floats]:
        """Weights of its nodes in forces where edges are crossed, these, and what they do not tell.

        Args:
            edges: Which are crossed, (crossings,).
            shares: Of these up to the crossing, (crossings,).
            at: Places of its surface there [m], (crossings, 3).
            n: Directions from it, (crossings, 3).
            places: Of all contact nodes [m], (nodes, 3).

        Returns:
            Shapes (crossings, k) twice, and (crossings, 3) [m] as `Turning.beyond` has it.
        """
        own = self.weights(at, -n, self.pose(places, np.zeros(3)), places)
        return own, np.broadcast_to(self.nodes, own.shape), -own @ self.arms

    @cached_property
    def arms(self) -> Floats:
        """What told places of its nodes lack: the arms of followers [m], (nodes, dim)."""
        found = np.zeros((len(self.nodes), self.dim))
        followers = found[self.dim + 1 :]
        followers[:] = self.unit * np.eye(self.dim)[: len(followers)]
        return found


@dataclass(frozen=True)
class Placed:
    """An obstacle, where it is at a time.

    Attributes:
        shape: The obstacle at rest from its centre.
        centre: At rest [m], (3,).
        along: Of an endless one its directions, (1 or 2, 3): what is near is met; None if it ends.
        at: How it has moved and turned.
    """

    shape: Convex
    centre: Floats
    along: Floats | None = None

    at: Placement = AT_REST

    nodes = np.zeros(0, dtype=np.int64)

    def middle(self, places: Floats, near: Floats) -> Floats:
        """Where its middle is, near some place [m], (3,)."""
        return self.pose(places, near)[0]

    def pose(self, places: Floats, near: Floats) -> Pose:
        """Where it is met near some place."""
        dim, centre, turn = places.shape[1], self.centre.copy(), np.eye(3)
        if self.along is not None:
            near = in_space(self.at.back(near[:dim]))
            centre += ((near - centre) @ self.along.T) @ self.along
        centre[:dim] = self.at.moved(centre[:dim])
        turn[:dim, :dim] = self.at.turned(np.eye(dim)).T
        return centre, turn

    def weights(self, at: Floats, n: Floats, pose: Pose, places: Floats) -> Floats:  # noqa: ARG002
        """None: it takes any force."""
        return np.zeros((len(at), 0))


def facing(
    first: Convex, second: Convex, one: Pose, other: Pose, most: int
) -> tuple[Floats, Floats, Floats]:
    """The direction to a body from another one, and places on both cores, (places, 3) each.

    Args:
        first: The body.
        second: The other one.
        one: Where the body is.
        other: Where the other one is.
        most: Number of places at most.
    """
    hint, size = np.zeros(3), min(first.reach, second.reach)
    if first.radii is not None or second.radii is not None:
        return _settled(first, second, one, other, most)
    aims: tuple[Floats | None, Floats | None] = (None, None)
    if first.axis is not None or second.axis is not None:
        hint, _, _ = separate(first.spine(*one), second.spine(*other), hint, size)
        aims = first.aim(hint @ one[1]), second.aim(-hint @ other[1])
    a, b = first.placed(*one, aims[0]), second.placed(*other, aims[1])
    n, kind, index = separate(a, b, hint, size)
    x, y, count = touching(a, b, n, kind, index, size, most)
    return n, x[:count], y[:count]


def _settled(
    first: Convex, second: Convex, one: Pose, other: Pose, most: int
) -> tuple[Floats, Floats, Floats]:
    """The same of an ellipsoid, and another one or any body; see `facing`."""
    size, start = min(first.reach, second.reach), one[0] - other[0]
    start = start / max(float(np.linalg.norm(start)), np.finfo(float).tiny)

    def look(aims: Floats, begins: bool) -> tuple[Floats, tuple[Floats, Floats, Floats]]:
        """Where both are to be met next, and what separates them; a flat face at once."""
        down = first.placed(*one, aims[0] @ one[1]), second.placed(*other, aims[1] @ other[1])
        n, kind, index = separate(*down, np.zeros(3), size)
        x, y, count = touching(*down, n, kind, index, size, most)
        found = np.array([-n, n])
        for k, (shape, (_, turn)) in enumerate(((first, one), (second, other))):
            if shape.radii is not None and not (kind < 2 and begins):
                found[k] = turn @ shape.seen(aims[k] @ turn, found[k] @ turn)
        return found, (n, x[:count], y[:count])

    return settled(look, np.array([-start, start]))


def settled[Found](look: Callable[[Floats, bool], tuple[Floats, Found]], aims: Floats) -> Found:
    """What is found where directions (several, 3) stay as they are.

    Each look shortens the way there by a share: what two have in common is taken to go on (Aitken).

    Args:
        look: Directions that follow from these, and what is found; told whether it begins.
        aims: Directions to begin with.
    """
    last = np.zeros_like(aims)
    following, found = look(aims, True)
    for count in range(_ROUNDS):
        change = following - aims
        if np.abs(change).max() <= _SETTLED:
            break
        share = float((change * last).sum()) / max(float((last * last).sum()), 1e-300)
        aims, last = following, change
        if count % 3 == 2 and 0.0 < share < 1.0:
            aims = aims + share / (1.0 - share) * change
            aims /= np.linalg.norm(aims, axis=1)[:, None]
        following, found = look(aims, False)
    return found


class Shaped(Anew):
    """A shape `one` that is held off something."""

    one: Marked

    @property
    def nodes(self) -> Integers:
        """Places of all its nodes among all contact nodes."""
        return self.one.nodes

    def behind(self, places: Floats) -> float:  # noqa: ARG002
        """0: gaps tell."""
        return 0.0

    @property
    def thickness(self) -> float:
        """Way [m] to the middle of the body, from which on it would be pushed out elsewhere."""
        return 0.5 * self.one.shape.thickness


@dataclass(frozen=True)
class ConvexPair(Shaped):
    """Two convex bodies that are held off each other.

    Attributes:
        one: The body that the forces act on.
        other: What it meets.
        total: Number of all contact nodes.
        touch: Distance [m] below which they touch: rounding of places.
        led: How far an obstacle goes from where forces act to where places are [m].
    """

    one: Marked
    other: Marked | Placed
    total: int
    touch: float
    led: float = 0.0

    @cached_property
    def nodes(self) -> Integers:
        """Places of all its nodes among all contact nodes."""
        return np.concatenate([self.one.nodes, self.other.nodes])

    @property
    def thickness(self) -> float:
        """Way [m] to the middle of both, from which on they would be pushed out elsewhere."""
        return 0.5 * (self.one.shape.thickness + self.other.shape.thickness)

    @cached_property
    def count(self) -> int:
        """Number of gaps: one of a ball, two of lines and in the plane, else up to eight."""
        corners = self.one.shape.corners, self.other.shape.corners
        return min(corners) if min(corners) < 3 else min(_MOST, sum(corners))

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """How they meet with all contact nodes at some places (nodes, dim).

        Contact points are those where forces act, amid the way; gaps change with their material
        from there on.
        """
        first, second = self.one.shape, self.other.shape
        own, centre = self.nodes, self.one.middle(acting, np.zeros(3))
        moved = places[own] - acting[own]
        way = float(np.sqrt((moved * moved).sum(axis=1).max()))
        between = centre - self.other.middle(acting, centre)
        apart = float(np.sqrt(between @ between)) - first.reach - second.reach
        if apart > 2.0 * way + self.led:
            return self._open
        one, other = self.one.pose(acting, centre), self.other.pose(acting, centre)
        n, places_one, places_two = facing(first, second, one, other, self.count)
        count, dim = len(places_one), places.shape[1]
        gap, normal = np.full(self.count, FAR), np.zeros((self.count, dim))
        normal[:] = n[:dim]
        between = (places_one - places_two) @ n - first.radius - second.radius
        # Amid their surfaces; of obstacles, which take any moment, on that of the body.
        share = 0.5 if len(self.other.nodes) else 0.0
        at = places_one - first.radius * n - share * between[:, None] * n
        own_weights = self.one.weights(at, n, one, acting)
        weights = np.hstack([own_weights, -self.other.weights(at, -n, other, acting)])
        gap[:count] = between + weights @ (moved @ n[:dim]) - self.touch
        ends = len(own) * np.minimum(np.arange(self.count + 1), count)
        found = csr_matrix(
            (weights.ravel(), np.tile(own, count), ends), shape=(self.count, self.total)
        )

        def turning() -> Turning:
            if isinstance(self.other, Placed):
                return Turning(None)
            beyond = np.zeros_like(normal)
            beyond[:count] = weights @ np.vstack([self.one.arms, self.other.arms])
            return Turning(patch_of(found, self.one.nodes), beyond)

        return Meeting(found, gap, normal, np.zeros(self.count), turning)

    @cached_property
    def _open(self) -> Meeting:
        """No gap that could close."""
        count, dim = self.count, self.one.dim
        normal = np.zeros((count, dim))
        normal[:, -1] = 1.0
        none = csr_matrix((count, self.total))
        return Meeting(none, np.full(count, FAR), normal, np.zeros(count))


class LedPair(Anew):
    """A convex body and an obstacle that moves or turns, as `impactfem.contact.meeting.Led` says.

    Args:
        pair: Both, the obstacle at rest: a `ConvexPair`, `impactfem.contact.ridges.OnRidges` or
            `impactfem.contact.terrain.OnTerrain`.
        other: The obstacle of the pair.
        obstacle: What says how it moves.
    """

    def __init__(self, pair: Any, other: Placed, obstacle: Any) -> None:
        self._pair, self._other, self._obstacle = pair, other, obstacle
        self._time = self._acting = self.speed = 0.0
        self._facing = np.zeros((pair.count, pair.one.dim))
        self.count, self.thickness, self.touch = pair.count, pair.thickness, pair.touch
        self.nodes = pair.nodes

    def tell(self, time: float, acting: float) -> None:
        """At which times the next answer's places are, and forces act [s]."""
        self._time, self._acting = time, acting

    def behind(self, places: Floats) -> float:
        """How deep a body's middle lies behind a surface at t = 0 [m]; see `OnTerrain`."""
        first = replace(self._other, at=placement(self._obstacle, 0.0))
        return float(replace(self._pair, other=first).behind(places))

    def shift(self, time: float) -> Floats:
        """How far what each gap faces has moved with the obstacle since t = 0 [m], (gaps, dim)."""
        now, first = placement(self._obstacle, time), placement(self._obstacle, 0.0)
        return np.zeros_like(self._facing) + now.since(first, self._facing)

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """As of `ConvexPair`: contact points where forces act, gaps where all has gone from there.

        The obstacle's way is that of what each gap faces, as that of the body is of its material.
        """
        obstacle, dim = self._obstacle, self._facing.shape[1]
        then, now = placement(obstacle, self._acting), placement(obstacle, self._time)
        reach = self._other.shape.reach
        corners = self._other.centre[:dim] + reach * np.concatenate([np.eye(dim), -np.eye(dim)])
        way = np.zeros_like(corners) + now.since(then, corners)
        led = 2.0 * dim * float(np.linalg.norm(way, axis=1).max())
        pair = replace(self._pair, other=replace(self._other, at=then), led=led)
        met: Meeting = pair(places, acting)
        there = met.gap < 0.5 * FAR
        along = met.normal * (met.gap + self.touch)[:, None]
        own = met.weights @ (places - acting)
        along -= met.normal * np.einsum("ij,ij->i", met.normal, own)[:, None]
        self._facing[there] = then.back(met.weights @ acting - along)[there]
        moved = np.zeros_like(self._facing) + now.since(then, self._facing)
        met.gap[there] -= np.einsum("ij,ij->i", met.normal, moved)[there]
        if there.any() and self._time > self._acting:
            fast = float(np.linalg.norm(moved[there], axis=1).max()) / (self._time - self._acting)
            self.speed = max(self.speed, fast)
        return met
