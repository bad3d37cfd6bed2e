"""Ties between surfaces of solids, whose meshes may be unlike, or of one and what is rigid.

The side with the smaller faces carries a multiplier at each node (`impactfem.contact.mortar`, with
`full`), and a row holds the mean of that side's displacement with the multiplier's function to the
mean of the other side's at the points opposite, integrated over the segments that both meshes cut
each other into. Both means have weights of the sum 1, the functions of the corners add up to 1: a
constant stress is passed on exactly. A component of a node that supports hold has no multiplier:
its neighbours take over the function, and so they do for nodes that meet next to nothing. Surfaces
that are curved lie apart by the height of their arcs; that way then turns with the carrier.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING
from weakref import ref

import numpy as np
from scipy.sparse import coo_array

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.body_pairs import Side
from impactfem.contact.mortar import mortar
from impactfem.scene import Scene
from impactfem.scene.joints import GROUND
from impactfem.scene.laws import side_of
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show
from impactfem.system.closest import closest_shares, distances
from impactfem.system.link_shapes import named
from impactfem.system.regions import HeldRegion, Key, triangles
from impactfem.system.rigid import in_space
from impactfem.system.stations import Asked, Tied
from impactfem.system.ties import TiedPlace

if TYPE_CHECKING:
    from impactfem.models.solids import SolidPart

_TOUCH = 0.25  # of the size of the carrier's faces: as far apart as arcs of coarse meshes lie
_LEAST = 1e-2  # share of a node's area that a multiplier of its own needs
_FLAT = 1e-9  # share of faces' size by which means on both sides lie apart by rounding
_SOME = 200  # nodes whose distances are looked at at once


@dataclass(frozen=True)
class _Glued:
    """What a tie holds.

    Attributes:
        places: Where, in the order of its rows.
        regions: Nodes of each solid, by what joints ask for.
        words: What it is, for plans.
    """

    places: tuple[TiedPlace, ...]
    regions: Mapping[str, Mapping[Key, HeldRegion]]
    words: str


class Ties:
    """The ties of a scene (collective at the first use of each)."""

    def __init__(self, scene: Scene) -> None:
        """Take the scene; its solids, which hold this, come one by one by `add`."""
        self._scene = scene
        # In a circle, meshes would keep their communicators, of which MPI has about 2000, until
        # Python looks for circles.
        self._parts: list[ref[SolidPart]] = []

    def add(self, part: "SolidPart") -> "SolidPart":
        """Take the next solid, which is given back."""
        self._parts.append(ref(part))
        return part

    @cached_property
    def _each(self) -> dict[str, _Glued]:
        return {tie.name: self._glued(index) for index, tie in enumerate(self._scene.ties)}

    @property
    def places(self) -> dict[str, tuple[TiedPlace, ...]]:
        """What each tie holds, by its name.

        Raises:
            KeyedError: A surface is unknown, or two do not touch.
        """
        return {name: glued.places for name, glued in self._each.items()}

    @property
    def words(self) -> dict[str, str]:
        """What each tie is (likewise)."""
        return {name: glued.words for name, glued in self._each.items()}

    def regions(self, body: str) -> dict[Key, HeldRegion]:
        """Nodes of a solid that ties hold (likewise)."""
        if not any(body in map(_body, tie.between) for tie in self._scene.ties):
            return {}
        found: dict[Key, HeldRegion] = {}
        for glued in self._each.values():
            found |= glued.regions.get(body, {})
        return found

    def _glued(self, index: int) -> _Glued:
        tie = self._scene.ties[index]
        where = f"tie[{index}]"
        parts = {part.solid.name: part for each in self._parts if (part := each())}
        if len(parts) < len(self._parts):
            raise ReferenceError("a solid of these ties is gone: hold all of them")
        sides = [parts.get(_body(name)) for name in tie.between]
        made = [_Surface.of(p, n, where) for p, n in zip(sides, tie.between, strict=True) if p]
        cuts = [set(p.solid.shape.symmetry) if p and p.solid.shape else set() for p in sides]
        cuts = [cut for cut, name in zip(cuts, tie.between, strict=True) if name != GROUND]
        if any(cut != cuts[0] for cut in cuts):
            text = f" = {show(list(tie.between))}: symmetry cuts one of them, and not the other "
            raise KeyedError(where, "between", f"{text}alike; cut both so, or none.")
        if len(made) == 1:
            return _to_rigid(tie.name, tie.between, made[0], first=sides[0] is not None)
        return _together(tie.name, (made[0], made[1]), f"{where}.between", tie.between)


def _body(name: str) -> str:
    return side_of(name)[0]


@dataclass(frozen=True)
class _Surface:
    """A surface of a solid that is glued.

    Attributes:
        part: The solid.
        name: As the scene has it.
        faces: Its faces among those of the outside.
        side: They, and their nodes, at t = 0.
        areas: Of the nodes [m^2], (nodes,).
        held: Whether supports hold them, (nodes, dim).
    """

    part: "SolidPart"
    name: str
    faces: Booleans
    side: Side
    areas: Floats
    held: Booleans

    @classmethod
    def of(cls, part: "SolidPart", name: str, where: str) -> "_Surface":
        """Find it (collective).

        Raises:
            KeyedError: There is no such surface, or it is empty.
        """
        outside, (surface,) = part.outside, side_of(name)[1] or ("",)
        if surface not in outside.names:
            raise named(where, "between", name, outside.names, "surface")
        faces = outside.on([surface])
        if not faces.any():
            text = f" = {show(name)}: it has no faces on the outside of {part.solid.name}; give "
            raise KeyedError(where, "between", f"{text}another.")
        side = Side.of(outside, part.places, faces)
        areas = outside.total(outside.areas, faces)
        return cls(part, name, faces, side, areas[side.nodes], part.supported[side.nodes])

    @property
    def size(self) -> float:
        """Of its faces [m]."""
        x = self.side.surface.points[self.side.surface.faces]
        return float(np.linalg.norm(np.ptp(x, axis=1), axis=1).mean())

    def region(self, nodes: Integers, weights: Floats, *, turns: bool) -> HeldRegion:
        """Some of its nodes, increasing, with weights of the sum 1."""
        outside, own = self.part.outside, self.side.nodes[nodes]
        every = len(self.side.nodes)
        numbers, points = outside.numbers[own], outside.points[own]
        return HeldRegion(numbers, points, weights, every, 0.0, "", turns=turns)


def _asked(name: str, at: Floats, token: Tied) -> tuple[Asked, Key]:
    """What a tie holds of a side at a mean place (dim,), and where its region is."""
    return (name, in_space(at), token), (name, tuple(at.tolist()), token)


def _to_rigid(tie: str, names: Sequence[str], own: _Surface, *, first: bool) -> _Glued:
    """All free nodes of a surface, held to the ground or a rigid body."""
    found, places = dict[Key, HeldRegion](), list[TiedPlace]()
    other = names[1] if first else names[0]
    for node, held in enumerate(own.held):
        along = tuple(np.flatnonzero(~held).tolist())
        if not along:
            continue
        at = own.side.surface.points[node]
        asked, key = _asked(own.name, at, Tied(tie, node))
        found[key] = own.region(np.array([node]), np.ones(1), turns=False)
        rigid: Asked = (other, in_space(at), None)
        both = (asked, rigid) if first else (rigid, asked)
        places.append(TiedPlace(both, np.zeros((2, 3)), along))
    what = "the ground" if other == GROUND else other
    words = f"{len(places)} nodes of {own.name} held to {what}"
    return _Glued(tuple(places), {own.part.solid.name: found}, f"{words}; they do not touch")


def _together(
    tie: str, sides: tuple[_Surface, _Surface], where: str, names: Sequence[str]
) -> _Glued:
    """Two surfaces of solids.

    Raises:
        KeyedError: They do not touch.
    """
    swapped = sides[1].size < sides[0].size * (1.0 - 1e-9)
    carrier, other = sides[::-1] if swapped else sides
    solid, reach = carrier.part.solid, _TOUCH * carrier.size
    met = mortar(
        carrier.side.surface, other.side.surface, reach, depth=reach, thickness=solid.thickness,
        axisymmetric=solid.is_axisymmetric, full=True,
    )  # fmt: skip
    if not met.count:
        apart = _distance(carrier, other)
        table, _, key = where.rpartition(".")
        text = f" = {show(list(names))}: the surfaces do not touch at t = 0, they are {apart:.4g} m"
        text += f" apart, more than {reach:.3g} m, a quarter of a face, by which curved ones may "
        raise KeyedError(table, key, text + "be; move one, or give others that face each other.")
    area = np.zeros(len(carrier.areas))
    area[met.nodes] = met.area
    scattered = coo_array(
        (met.area, (met.nodes, np.arange(met.count))), (len(area), met.count)
    ).tocsr()
    integrals = [
        (scattered @ weights).toarray() for weights in (met.carrier_weights, met.other_weights)
    ]
    met_enough = area > _LEAST * carrier.areas
    along: dict[tuple[int, tuple[tuple[int, float], ...]], list[int]] = {}
    for k in range(solid.dim):
        for row in _folded(carrier, met_enough & ~carrier.held[:, k]).items():
            along.setdefault(row, []).append(k)
    found: tuple[dict[Key, HeldRegion], ...] = ({}, {})
    places, far = list[TiedPlace](), 0.0
    for number, ((node, taken), axes) in enumerate(sorted(along.items())):
        both = [
            whole[node] + sum(share * whole[dropped] for dropped, share in taken)
            for whole in integrals
        ]
        both = [weights / weights.sum() for weights in both]
        x = [w @ s.side.surface.points for w, s in zip(both, (carrier, other), strict=True)]
        way, asked, arms = in_space(x[1] - x[0]), list[Asked](), np.zeros((2, 3))
        apart = float(np.linalg.norm(way))
        if apart > _FLAT * carrier.size:
            far, arms[0] = max(far, apart), way
        for n, (weights, side) in enumerate(zip(both, (carrier, other), strict=True)):
            what, where_held = _asked(side.name, x[n], Tied(tie, number))
            nodes = np.flatnonzero(weights)
            found[n][where_held] = side.region(nodes, weights[nodes], turns=bool(arms[n].any()))
            asked.append(what)
        order = [1, 0] if swapped else [0, 1]
        both_asked = asked[order[0]], asked[order[1]]
        places.append(TiedPlace(both_asked, arms[order], tuple(axes)))
    corners = np.unique(carrier.side.surface.corners)
    shares = area[corners].sum() / carrier.areas.sum()
    words = f"{len(met.nodes)} multipliers on {carrier.name}, {shares:.0%} of which touches "
    words += f"{other.name}" + (f", up to {far:.2g} m apart" if far else "")
    regions = {carrier.part.solid.name: found[0], other.part.solid.name: found[1]}
    return _Glued(tuple(places), regions, f"{words}; nodes there do not touch")


def _folded(carrier: _Surface, kept: Booleans) -> dict[int, tuple[tuple[int, float], ...]]:
    """Multipliers that are kept, each with the nodes whose functions it takes over, and shares.

    Those of corners go to the corners of their faces; others add nothing to the sum of all.
    """
    corners = carrier.side.surface.corners
    found: dict[int, list[tuple[int, float]]] = {int(node): [] for node in np.flatnonzero(kept)}
    beside: dict[int, set[int]] = {}
    for face in corners:
        for node in face[~kept[face]].tolist():
            beside.setdefault(node, set()).update(face[kept[face]].tolist())
    for node, near in sorted(beside.items()):
        for other in sorted(near):
            found[other].append((node, 1.0 / len(near)))
    return {node: tuple(taken) for node, taken in found.items()}


def _distance(one: _Surface, two: _Surface) -> float:
    """Least distance of the nodes of two surfaces to the other one [m]."""
    least = np.inf
    for side, other in ((one, two), (two, one)):
        there, points = other.side.surface, side.side.surface.points
        faces = there.points[triangles(there.faces, points.shape[1])]
        for some in np.array_split(points, 1 + len(points) // _SOME):
            least = min(least, distances(some, faces, closest_shares(some, faces))[1].min())
    return float(least)
