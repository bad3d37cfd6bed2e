"""Two surfaces that may strike each other: their faces, who carries the multipliers, their gaps."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.boundary import Boundary
from impactfem.contact.followed_pair import FollowedPair, along_ways, pair_weights
from impactfem.contact.meeting import NOTHING, Meet, Meeting
from impactfem.contact.mortar import MortarPairs, faces_in_reach, mortar
from impactfem.contact.mortar_surface import Kind, Surface, surface
from impactfem.contact.self_pairs import WithinBody
from impactfem.errors import SceneError

_ROUNDING = 1e-9  # share of the bodies' size by which they may overlap at t = 0
_KINDS: dict[tuple[int, int], Kind] = {
    (2, 2): "interval", (2, 3): "interval", (3, 3): "triangle", (3, 6): "triangle",
    (3, 4): "quadrilateral", (3, 9): "quadrilateral",
}  # fmt: skip


@dataclass(frozen=True)
class Side:
    """Part of the outside of a body that may strike another one.

    Attributes:
        nodes: Its nodes among those of the outside, increasing, shape (nodes,).
        surface: Its faces, nodes numbered in that order, at t = 0.
    """

    nodes: Integers
    surface: Surface

    @classmethod
    def of(cls, outside: Boundary, places: Floats, faces: Booleans) -> "Side":
        """Take some faces of an outside, with its nodes at some places (nodes, dim)."""
        own = outside.faces[faces]
        nodes = np.unique(own)
        kind = _KINDS[places.shape[1], own.shape[1]]
        found = surface(places[nodes], np.searchsorted(nodes, own), kind, outside.normals[faces])
        return cls(nodes, found)


@dataclass(frozen=True)
class SurfacePair:
    """Two surfaces that may strike each other; the first carries the multipliers.

    Attributes:
        bodies: Places of the bodies in the scene.
        names: Their names.
        label: Name of the pair in the scene.
        sides: Their faces.
        count: Number of multipliers.
        why: Why the first carries them, in words.
        reach: Distance from which faces are looked at [m].
        updated: Whether the pair follows the bodies.
        thickness: Of plane bodies [m].
        axisymmetric: Whether the first coordinate is the radius.
        within: Of a body that may meet itself, which of its faces may meet.
    """

    bodies: tuple[int, int]
    names: tuple[str, str]
    label: str
    sides: tuple[Side, Side]
    count: int
    why: str
    reach: float
    updated: bool
    thickness: float
    axisymmetric: bool
    within: WithinBody | None = None

    @property
    def nodes(self) -> tuple[Integers, Integers]:
        """Nodes of both among those of the outsides of their bodies."""
        return self.sides[0].nodes, self.sides[1].nodes

    @property
    def surfaces(self) -> tuple[Surface, Surface]:
        """Both at t = 0."""
        return self.sides[0].surface, self.sides[1].surface

    def roles(self) -> Integers:
        """Which faces carry before any contact; see `WithinBody.meeting`."""
        return np.zeros(0, dtype=np.int64) if self.within is None else self.within.roles()

    def met(
        self, points: Sequence[Floats], reach: float | None = None, roles: Integers | None = None
    ) -> MortarPairs:
        """Weighted gaps with the nodes of both sides at some places, (nodes, dim) each.

        Args:
            points: The places [m].
            reach: Distance from which faces are looked at, if less than that of the pair [m].
            roles: Which faces carried last, of a body that may meet itself; changed.
        """
        carrier, other = (
            side.surface.moved(place) for side, place in zip(self.sides, points, strict=True)
        )
        return _met(
            carrier, other, self.reach if reach is None else min(reach, self.reach),
            self.thickness, self.within, roles, axisymmetric=self.axisymmetric,
        )  # fmt: skip

    def meeting(self, rows: Sequence[Integers], total: int) -> Meet:
        """How the pair meets, in terms of all contact nodes.

        Args:
            rows: Places of both sides' nodes among all contact nodes.
            total: Number of these.
        """
        return FollowedPair(self, rows, total) if self.updated else FixedPair(self, rows, total)


@dataclass(frozen=True)
class FixedPair:
    """How a pair meets whose surfaces stay those of t = 0; see `SurfacePair.meeting`."""

    pair: SurfacePair
    rows: Sequence[Integers]
    total: int

    memory = NOTHING
    follows = False

    def recall(self, memory: Floats) -> None:
        """Nothing: these surfaces are looked at once."""

    def __call__(self, places: Floats, acting: Floats) -> Meeting:  # noqa: ARG002  (fixed)
        """How the surfaces meet with all contact nodes at some places (nodes, dim)."""
        found = self.pair.met([places[own] for own in self.rows])
        count = len(found.gap)
        weights = pair_weights(found, self.rows, np.arange(count), (count, self.total))
        gap, normal = along_ways(weights @ places, found.normal, float(np.abs(places).max()))
        return Meeting(weights, gap, normal, found.area)


def make_pair(
    bodies: tuple[int, int],
    faces: Sequence[tuple[Boundary, Floats, Booleans]],
    names: tuple[str, str],
    reach: float,
    *,
    updated: bool,
    label: str = "",
    thickness: float = 1.0,
    axisymmetric: bool = False,
) -> SurfacePair | None:
    """Pair the surfaces of two bodies; None if no face can meet another.

    Of surfaces that stay those of t = 0 some must be opposite then, of such that follow not yet.

    The body with the smaller faces carries the multipliers: each of its nodes then is held off the
    other surface, and no node of the larger faces can hide between them.

    Args:
        bodies: Places of the bodies in the scene.
        faces: Of each the outside, places of its nodes at t = 0 [m], and which faces may strike.
        names: Names of the bodies.
        reach: Largest distance that can close within the duration [m].
        updated: Whether the pair follows the bodies.
        label: Name of the pair in the scene.
        thickness: Of plane bodies [m].
        axisymmetric: Whether the first coordinate is the radius.

    Raises:
        SceneError: The bodies overlap at t = 0.
    """
    sizes = [
        float(outside.areas[asked].sum()) / (np.count_nonzero(asked) or 1)
        for outside, _, asked in faces
    ]
    order = [0, 1] if sizes[0] <= sizes[1] else [1, 0]
    sides = [Side.of(*faces[k]) for k in order]
    name = names[order[0]], names[order[1]]
    extent = max(float(np.ptp(side.surface.points, axis=0).max()) for side in sides)
    within = None
    if bodies[0] == bodies[1]:
        within = WithinBody.of(faces[0][0], [faces[k][2] for k in order])
    found = _met(
        sides[0].surface, sides[1].surface, min(reach, 1e3 * extent), thickness, within,
        axisymmetric=axisymmetric,
    )  # fmt: skip
    if not len(found.gap) and within is None:
        points = [side.surface.points for side in sides]
        if not updated or boxes_apart(*map(box, points)) > reach:
            return None
    worst = int(np.argmin(found.gap)) if len(found.gap) else None
    if worst is not None and found.gap[worst] < -_ROUNDING * extent:
        place = ", ".join(f"{x:.4g}" for x in sides[0].surface.points[found.nodes[worst]])
        depth = f"by {-found.gap[worst]:.4g} m at t = 0 near ({place})"
        if within is not None:
            raise SceneError(f"body {name[0]} overlaps itself {depth}: mend its mesh")
        raise SceneError(f"bodies {name[0]} and {name[1]} overlap {depth}: move one of them")
    if not updated:
        # Only faces with a node that carries weight can take part.
        used = [np.unique(w.indices) for w in (found.carrier_weights, found.other_weights)]
        sides = [
            _part(side, faces[k], nodes) for side, k, nodes in zip(sides, order, used, strict=True)
        ]
    why = f"{name[0]} is the slave side: its faces are the smaller ones"
    if within is not None:
        why = f"{name[0]} meets itself: of two patches that face each other one carries"
    pair = SurfacePair(
        (bodies[order[0]], bodies[order[1]]), name, label, (sides[0], sides[1]), 0, why,
        min(reach, 1e3 * extent), updated, thickness, axisymmetric, within,
    )  # fmt: skip
    count = len(np.unique(sides[0].surface.corners))
    if not updated:
        count = len(pair.met([side.surface.points for side in sides]).gap)
    return SurfacePair(**{**vars(pair), "count": count})


def box(points: Floats) -> tuple[Floats, Floats]:
    """Least and largest coordinates of points (count, dim), (dim,) each."""
    return points.min(axis=0), points.max(axis=0)


def boxes_apart(one: tuple[Floats, Floats], two: tuple[Floats, Floats]) -> float:
    """Distance of two boxes along the axis where they are farthest apart, 0 if they overlap."""
    return float(np.maximum(one[0] - two[1], two[0] - one[1]).max(initial=0.0))


def _part(side: Side, faces: tuple[Boundary, Floats, Booleans], used: Integers) -> Side:
    """The faces of a side that have a node among some."""
    outside, places, asked = faces
    marked = np.zeros(len(outside.numbers), dtype=bool)
    marked[side.nodes[used]] = True
    return Side.of(outside, places, asked & marked[outside.faces].all(axis=1))


def _met(
    carrier: Surface,
    other: Surface,
    reach: float,
    thickness: float,
    within: WithinBody | None,
    roles: Integers | None = None,
    *,
    axisymmetric: bool,
) -> MortarPairs:
    """How two surfaces meet at the places of their nodes; of one body as it says."""
    pairs = None
    if within is not None:
        seen = faces_in_reach(carrier, other, reach)
        pairs = within.meeting(seen, within.roles() if roles is None else roles)
    return mortar(
        carrier, other, reach, thickness=thickness, axisymmetric=axisymmetric, pairs=pairs
    )
