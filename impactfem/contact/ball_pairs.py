"""Gaps between balls and axes on one side, and points, axes or surfaces on the other.

A ball is a contact node with a radius; an axis is a chain of straight lines between such nodes (a
rod, a beam). Forces act along the line of the closest points, so that pairs keep the momentum and
the moment of momentum. The closest places are found anew in each layer.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.ball_kernels import reached
from impactfem.contact.followed_pair import FAR
from impactfem.contact.meeting import Anew, Edges, Meeting, Turning, patch_of, weights_on
from impactfem.contact.mortar_surface import Surface
from impactfem.system.closest import closest_shares, distances

_SAME = 1e-9  # share of a distance by which two count as the same
_ALIKE = 0.9  # cosine of directions from which two closest places count as one
_RIM = 0.01  # share of a face by which what slides off an open surface is still on it
_TINY = np.finfo(float).tiny
_BEFORE = 0.5  # cosine of ways beside a place from which the next one is met in its stead
_FARTHER = 1.5  # times the distance of the closest place, others that are looked at
_CURVE = 0.5 * np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]])
_FEW = 64  # simplices that are all looked at


@dataclass(frozen=True)
class Target:
    """What balls are held off.

    Attributes:
        nodes: Places of its nodes among all contact nodes, shape (nodes,).
        simplices: Its points, lines or triangles, by numbers of these nodes, (simplices, corners).
        signs: 1 where the normal of a face, from the order of its corners, points outwards and -1
            elsewhere, shape (simplices,); None if there is no inside: points and axes.
        radius: Of the nodes of points and axes [m], shape (nodes,).
        rims: Whether a surface ends at the side opposite each corner, (simplices, corners).
        faces: Whether it is pushed on its faces, a radius off its points, lines or triangles.
    """

    nodes: Integers
    simplices: Integers
    signs: Floats | None
    radius: Floats
    rims: Booleans
    faces: bool = False

    @classmethod
    def of_axis(
        cls, nodes: Integers, lines: Integers, radius: Floats, *, faces: bool = False
    ) -> "Target":
        """Of the lines between nodes, (lines, 2); of the nodes themselves where there are none."""
        simplices = lines if len(lines) else np.arange(len(nodes))[:, None]
        return cls(nodes, simplices, None, radius, np.zeros(simplices.shape, dtype=bool), faces)

    @classmethod
    def of_surface(cls, nodes: Integers, surface: Surface) -> "Target":
        """Of a meshed surface: its faces as lines or triangles between nodes."""
        parts = surface.faces[:, surface.parts]  # (faces, parts, corners)
        signs = np.repeat(surface.sides, parts.shape[1])
        flat = parts.reshape(-1, parts.shape[2])
        if flat.shape[1] == 4:  # quadrilaterals, by the corners around them
            flat = np.stack([flat[:, (0, 1, 2)], flat[:, (0, 2, 3)]], axis=1).reshape(-1, 3)
            signs = np.repeat(signs, 2)
        return cls(nodes, flat, signs, np.zeros(len(nodes)), rims_of(flat))

    def some(self, chosen: Booleans) -> "Target":
        """Some of its simplices, (simplices,)."""
        signs = None if self.signs is None else self.signs[chosen]
        rims, simplices = self.rims[chosen], self.simplices[chosen]
        return Target(self.nodes, simplices, signs, self.radius, rims, self.faces)

    def ways(self, met: Meeting, places: Floats) -> Floats:
        """From where it is pushed to the balls, with all nodes at places (nodes, dim), [m]."""
        found = np.asarray(met.weights @ places)
        if self.faces:
            radius = np.zeros(len(places))
            radius[self.nodes] = self.radius
            found -= (abs(met.weights) @ radius)[:, None] * met.normal
        return found

    def behind(self, places: Floats, ways: Floats) -> Booleans:
        """Which nodes of faces are pushed along ways (nodes, dim) against what is beside them.

        That is nearer, and met in their stead: see `pushed_back`.
        """
        if self.signs is None:
            return np.zeros(len(self.nodes), dtype=bool)
        return pushed_back(places[self.nodes], self.sides, ways)

    @cached_property
    def sides(self) -> Integers:
        """Where the sides of its simplices begin and end, both ways, (sides, 2)."""
        both = permutations(range(self.simplices.shape[1]), 2)
        return np.concatenate([self.simplices[:, two] for two in both])

    def edges(self, places: Floats) -> Edges:
        """Its axis with all contact nodes at some places (nodes, 3)."""
        around, shapes = self.curves
        curves = np.einsum("lpn,lnd->lpd", shapes, places[self.nodes[around]])
        lines, radius = self.simplices, self.radius[self.simplices].mean(axis=1)
        return Edges(curves, radius, lines, np.zeros((len(lines), 2, 3)))

    def weighed(self, lines: Integers, shares: Floats) -> tuple[Floats, Integers]:
        """Weights of its nodes in places on its axis, and these among all, (places, k) each."""
        around, shapes = self.curves
        powers = shares[:, None] ** np.arange(4)
        return np.einsum("cp,cpn->cn", powers, shapes[lines]), self.nodes[around[lines]]

    def pushed(
        self, edges: Integers, shares: Floats, at: Floats, *_: Floats
    ) -> tuple[Floats, Integers, Floats]:
        """Weights of its nodes in forces where its axis is crossed, these, and no more ways.

        See `impactfem.contact.convex_pairs.Marked.pushed`.
        """
        return *self.weighed(edges, shares), np.zeros_like(at)

    @cached_property
    def curves(self) -> tuple[Integers, Floats]:
        """Nodes around each line, (lines, k), and their shapes: coefficients, (lines, 4, k).

        Of a chain of lines they are those of the cubic curve through its nodes whose slope at each
        is that between its neighbours (E. Catmull, R. Rom, Computer aided geometric design (1974)
        317-326): it has no kinks, bends as a parabola does, and moves as the nodes do. Other lines
        are straight.
        """
        lines, count = self.simplices, len(self.simplices)
        straight = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
        if count < 2 or (lines != np.arange(count)[:, None] + [0, 1]).any():
            return lines, np.broadcast_to(straight, (count, 4, 2))
        around = np.clip(np.arange(count) - 1, 0, max(0, count - 3))[:, None] + np.arange(
            min(4, count + 1)
        )
        # Beyond its ends the curve goes on as a parabola.
        beyond = np.eye(count + 3, count + 1, -1)
        beyond[0, :3] = beyond[-1, :-4:-1] = [3.0, -3.0, 1.0]
        each = np.stack([beyond[k : k + count] for k in range(4)], axis=1)
        shapes = _CURVE @ np.take_along_axis(each, around[:, None], axis=2)
        return around, shapes

    def normals(self, places: Floats) -> Floats:
        """Outward normals of its faces, their length that of the areas, (simplices, dim)."""
        corners = places[self.nodes[self.simplices]]
        if corners.shape[2] == 2:
            t = corners[:, 1] - corners[:, 0]
            across = np.stack([t[:, 1], -t[:, 0]], axis=1)
        else:
            across = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        signs = np.ones(len(corners)) if self.signs is None else self.signs
        return np.asarray(across * signs[:, None])


def pushed_back(points: Floats, pairs: Integers, ways: Floats) -> Booleans:
    """Which points are pushed along ways (points, dim) against sides that begin at them.

    Where corners of two bodies meet, the way from one to the other may be any, that along the faces
    which lie on each other too; it is that of a contact only if each body is behind its corner.

    Args:
        points: [m], (points, dim).
        pairs: Where sides begin and end, (sides, 2).
        ways: Unit vectors, (points, dim).
    """
    first, second = pairs.T
    sides = points[second] - points[first]
    along = np.einsum("sd,sd->s", sides, ways[first])
    against = along < -_BEFORE * np.linalg.norm(sides, axis=1)
    return np.bincount(first[against], minlength=len(points)) > 0


def rims_of(simplices: Integers) -> Booleans:
    """Whether a surface ends at the side opposite each corner, (simplices, corners)."""
    corners = simplices.shape[1]
    sides = [np.delete(simplices, k, axis=1) for k in range(corners)]
    flat = np.sort(np.stack(sides, axis=1).reshape(-1, corners - 1), axis=1)
    _, which, count = np.unique(flat, axis=0, return_inverse=True, return_counts=True)
    return np.asarray((count[which.ravel()] == 1).reshape(-1, corners))


@dataclass(frozen=True)
class BallPair(Anew):
    """Balls that are held off a target, as `impactfem.contact.pairs` takes them.

    A ball may touch a surface that bends inwards at several places, at most as many as there are
    dimensions: each has that many gaps, those without a place of their own are open by ``far``.

    Attributes:
        balls: Places of the balls among all contact nodes, shape (balls,).
        radius: Of the balls [m], shape (balls,).
        target: What they are held off.
        total: Number of all contact nodes.
        far: Gap of what meets nothing [m].
    """

    balls: Integers
    radius: Floats
    target: Target
    total: int
    far: float = FAR

    touch = 0.0

    @property
    def nodes(self) -> Integers:
        """Places of all its nodes among all contact nodes."""
        return np.concatenate([self.balls, self.target.nodes])

    @property
    def thickness(self) -> float:
        """Way [m] through both, where nothing tells on which side a ball is; else infinite."""
        if self.target.signs is not None:
            return float("inf")
        if self.single:  # there may be very many
            return float(self.radius[0] + self.target.radius[0])
        return float(self.radius.min() + self.target.radius.min())

    @property
    def slots(self) -> int:
        """Gaps of a ball: one with points and axes, as many as dimensions with surfaces."""
        return 1 if self.target.signs is None else self.target.simplices.shape[1]

    @property
    def single(self) -> bool:
        """Whether it is one ball beside another one."""
        return len(self.balls) == len(self.target.nodes) == 1 and self.target.signs is None

    @property
    def count(self) -> int:
        """Number of gaps."""
        return len(self.balls) * self.slots

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """How they meet with all contact nodes at some places (nodes, dim).

        Gaps are those there, normals and weights those where forces act, amid the way: their work
        then is that of the change of the gap, but for the cube of the way.
        """
        near, reach = self._near(places)
        gaps, there, direction = self._looks(near, places)
        _, shares, amid = self._looks(near, acting)
        amid = self._past(near, acting, there, shares, amid)
        gaps = np.where(gaps <= reach[:, None], gaps, np.inf)
        target, dim, count = near, places.shape[1], self.count
        gap, normal = np.full(count, self.far), np.zeros((count, dim))
        normal[:, -1] = 1.0
        each, rows, columns, values = np.arange(len(self.balls)), [], [], []
        for slot in range(self.slots):
            best = np.argmin(gaps, axis=1)
            known = each[np.isfinite(gaps[each, best])]
            row, at = known * self.slots + slot, best[known]
            gap[row], normal[row] = gaps[known, at], amid[known, at]
            nodes = target.nodes[target.simplices[at]]
            rows += [row, np.repeat(row, nodes.shape[1])]
            columns += [self.balls[known], nodes.ravel()]
            values += [np.ones(len(known)), -shares[known, at].ravel()]
            # Another place is one that looks elsewhere.
            alike = np.einsum("psd,pd->ps", direction, direction[each, best]) > _ALIKE
            gaps = np.where(alike, np.inf, gaps)
        found = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        weights = csr_matrix(found, shape=(count, self.total))

        def turning() -> Turning:
            """Where a point of no radius touches a face, the way to it has no direction."""
            return Turning(patch_of(weights, self.target.nodes))

        sharp = target.signs is not None and not self.radius.all()
        return Meeting(weights, gap, normal, np.zeros(count), turning if sharp else None)

    def _past(
        self, target: Target, acting: Floats, there: Floats, shares: Floats, amid: Floats
    ) -> Floats:
        """Directions amid the way; of a place that slides past an edge that of the face it is on.

        From the edge itself it would be along the way.

        Args:
            target: What is met.
            acting: Places of all nodes amid the way.
            there: Weights of closest points at the end of it, (balls, simplices, corners).
            shares: The same amid it.
            amid: Directions by these, (balls, simplices, dim).
        """
        sharp = self.radius == 0.0
        if target.signs is None or not sharp.any():
            return amid
        passed = (there > _SAME).all(axis=2) & (shares <= _SAME).any(axis=2) & sharp[:, None]
        if not passed.any():
            return amid
        faces = target.normals(acting)
        faces = faces / np.maximum(np.linalg.norm(faces, axis=1), _TINY)[:, None]
        return np.where(passed[..., None], faces, amid)

    def _near(self, places: Floats) -> tuple[Target, Floats]:
        """What of the target may be closest to balls, and gaps up to which nothing is missing [m].

        Other places than the closest one are looked at half as far away again, or as the ball is
        thick: farther ones are not reached while that one is met.
        """
        target, points = self.target, places[self.balls]
        if len(target.simplices) <= _FEW:
            return target, np.full(len(points), np.inf)
        thick = self.radius + float(target.radius.max(initial=0.0))
        reach, chosen = reached(points, thick, _FARTHER, places, target.nodes[target.simplices])
        return target.some(chosen), reach - self.radius

    def _looks(self, target: Target, places: Floats) -> tuple[Floats, Floats, Floats]:
        """Gaps of all balls to all simplices, weights of closest points, directions to the balls.

        Shapes (balls, simplices), (balls, simplices, corners), (balls, simplices, dim).
        """
        points = places[self.balls]
        corners = places[target.nodes[target.simplices]]
        shares = closest_shares(points, corners)
        arms, length = distances(points, corners, shares)
        if target.signs is None:
            away, direction = length, arms / np.maximum(length, _TINY)[..., None]
        else:
            away, direction = _outside(target, places, shares, arms, length)
        radii = np.einsum("psc,sc->ps", shares, target.radius[target.simplices])
        return away - radii - self.radius[:, None], shares, direction


@dataclass(frozen=True, kw_only=True)
class RollingPair(BallPair):
    """A rigid ball on a surface that rubs: it is pushed where they touch.

    What touches is other material of the ball at each time, at an arm from its centre that does not
    turn with it. Nodes that follow the centre with arms along the axes of space carry that arm, as
    in `impactfem.contact.convex_pairs`. Both bodies are pushed at one place, so that friction keeps
    their angular momentum. An arm along the normal changes no gap.

    Attributes:
        followers: What follows its centre among all contact nodes, one along each axis, (dim,).
        unit: Arm of these [m].
    """

    followers: Integers
    unit: float

    @property
    def nodes(self) -> Integers:
        """Places of all its nodes among all contact nodes."""
        return np.concatenate([super().nodes, self.followers])

    def __call__(self, places: Floats, acting: Floats) -> Meeting:
        """How they meet with all contact nodes at some places (nodes, dim); see `BallPair`."""
        met = super().__call__(places, acting)
        ways = self.target.ways(met, acting)
        arms = carried(ways, self.followers, int(self.balls[0]), self.unit, self.total)

        def turning() -> Turning:
            return Turning(patch_of(met.weights, self.target.nodes), -ways)

        return replace(met, weights=met.weights + arms, turning=turning)


def carried(ways: Floats, followers: Integers, centre: int, unit: float, total: int) -> csr_matrix:
    """Weights that move forces on places of a ball to what it touches, (gaps, nodes).

    Args:
        ways: From what is met to the places [m], (gaps, dim); what meets nothing weighs nothing.
        followers: What follows its centre among all contact nodes, one along each axis, (dim,).
        centre: Place of the centre among these.
        unit: Arm of the followers [m].
        total: Number of all contact nodes.
    """
    shares = -ways / unit
    values = np.hstack([shares, -shares.sum(axis=1, keepdims=True)])
    return weights_on(values, np.append(followers, centre), total)


def _outside(
    target: Target, places: Floats, shares: Floats, arms: Floats, length: Floats
) -> tuple[Floats, Floats]:
    """Signed distances from faces, infinite for those that are not met, and their directions.

    A face is met where its closest point is closest among all around it, and is seen from
    outside; inside the body it is the nearest face only.
    """
    inner = (shares > _SAME).all(axis=2)
    faces = target.normals(places)
    areas = np.linalg.norm(faces, axis=1)
    faces = faces / np.maximum(areas, _TINY)[:, None]
    nodes = np.zeros((len(target.nodes), faces.shape[1]))
    for corner in target.simplices.T:
        np.add.at(nodes, corner, faces)
    around = np.einsum("psc,scd->psd", shares, nodes[target.simplices])
    around /= np.maximum(np.linalg.norm(around, axis=2), _TINY)[..., None]
    outward = np.where(inner[..., None], faces, around)
    side = np.where(np.einsum("psd,psd->ps", arms, outward) < 0.0, -1.0, 1.0)
    # At edges along the arm, but where this is no more than rounding.
    clear = ~inner & (length > _SAME * float(np.ptp(places[target.nodes], axis=0).max()))
    straight = side[..., None] * arms / np.maximum(length, _TINY)[..., None]
    direction = np.where(clear[..., None], straight, outward)
    least = np.full((len(arms), len(nodes)), np.inf)
    for k, corner in enumerate(target.simplices.T):
        value = np.where(shares[:, :, k] > _SAME, length, np.inf)
        np.minimum.at(least.T, corner, value.T)
    near = np.where(shares > _SAME, least[:, target.simplices], np.inf).min(axis=2)
    met = inner | (length <= near * (1.0 + _SAME))
    nearest = length <= length.min(axis=1, keepdims=True) * (1.0 + _SAME)
    met &= (side > 0.0) | nearest
    if target.rims.any():  # what is behind an open surface, but beside it, is not inside
        sizes = areas ** (1.0 / (faces.shape[1] - 1))
        beyond = ((shares <= _SAME) & target.rims).any(axis=2)
        beside = np.linalg.norm(arms + length[..., None] * outward, axis=2)
        met &= (side > 0.0) | ~beyond | ((beside <= _RIM * sizes) & (length <= sizes))
    return np.where(met, side * length, np.inf), direction
