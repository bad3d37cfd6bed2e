"""How bodies without meshes meet each other and solids: which gaps there are, between what."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats, Integers
from impactfem.contact.ball_pairs import BallPair, Target
from impactfem.contact.body_pairs import Side
from impactfem.contact.boundary import Boundary
from impactfem.contact.convex_pairs import LedPair, Marked
from impactfem.contact.crossings import AxisPair
from impactfem.contact.line_pairs import LinePair
from impactfem.contact.meeting import NodeMeet
from impactfem.contact.mortar_surface import Surface
from impactfem.contact.terrain import OnTerrain
from impactfem.errors import SceneError
from impactfem.models.convex_contacts import Shapes, convex_meetings, on_others
from impactfem.models.tip_contacts import tip_meetings
from impactfem.scene import Scene, Solid
from impactfem.scene.laws import default_name
from impactfem.scene.pairing import body_pairs, named_body_pairs
from impactfem.system.few import FewBodies

_RESOLVED = 2.0  # faces in the radius of a ball from which the nodes of the faces follow its shape
_ROUNDING = 1e-9  # share of a size by which bodies may overlap at t = 0


class Part(Protocol):
    """A solid of the model; see `impactfem.models.solids.SolidPart`."""

    @property
    def solid(self) -> Solid:
        """The body."""

    @property
    def outside(self) -> Boundary:
        """Its faces."""

    @property
    def places(self) -> Floats:
        """Places of their nodes at t = 0 [m]."""


class Bodies(Protocol):
    """What is asked of a model; see `impactfem.models.solids.SolidsModel`."""

    @property
    def scene(self) -> Scene:
        """The scene."""

    @property
    def parts(self) -> Sequence[Part]:
        """Its solids."""

    @property
    def few(self) -> Sequence[FewBodies]:
        """Its points, rods and beams."""

    @property
    def struck(self) -> Mapping[int, Side]:
        """Faces that these may strike, by the place of the solid."""

    @property
    def numbers(self) -> Sequence[Integers]:
        """Canonical numbers of the contact nodes of each solid."""

    @property
    def ball_meetings(self) -> "Sequence[BallMeeting]":
        """What `ball_meetings` has found besides single balls."""

    def faces(
        self, body: int, surfaces: Sequence[str] | None
    ) -> tuple[Boundary, Floats, NDArray[np.bool_]]:
        """Outside of a solid, places of its nodes, and which of its faces may strike."""


@dataclass(frozen=True)
class BallMeeting:
    """A pair of bodies of which at least one has no mesh.

    Attributes:
        label: Name of the pair.
        names: Of the bodies.
        carrier: Which of them the forces of the gaps act on.
        pair: Its gaps.
        patch: Whether the contact is one of many nodes, or of single places on a solid.
        single: The pair if it is one ball beside another one.
    """

    label: str
    names: tuple[str, str]
    carrier: str
    pair: NodeMeet
    patch: bool
    single: BallPair | None = None


@dataclass(frozen=True)
class Crowded:
    """Pairs of bodies that each meet all of their kind with one ball: they may be millions.

    Attributes:
        bodies: Names of all bodies.
        pairs: Places of both among these, (pairs, 2).
        ends: Of both among all contact nodes, (pairs, 2).
        radii: Of both [m], (pairs, 2).
        named: Labels of the first pairs, the others have default ones.
    """

    bodies: Sequence[str]
    pairs: Integers
    ends: Integers
    radii: Floats
    named: Sequence[str] = ()

    def __len__(self) -> int:
        """Number of pairs."""
        return len(self.pairs)

    def behind(self, meetings: Sequence[BallMeeting]) -> "Crowded":
        """These pairs behind those that are `BallMeeting.single`."""
        single = [(met, met.single) for met in meetings if met.single is not None]
        if not single:
            return self
        place = {name: k for k, name in enumerate(self.bodies)}
        pairs = [[place[name] for name in met.names] for met, _ in single]
        ends = [(pair.balls[0], pair.target.nodes[0]) for _, pair in single]
        radii = [(pair.radius[0], pair.target.radius[0]) for _, pair in single]
        return Crowded(
            self.bodies,
            np.concatenate([pairs, self.pairs]),
            np.concatenate([ends, self.ends]),
            np.concatenate([radii, self.radii]),
            tuple(met.label for met, _ in single),
        )

    @property
    def names(self) -> list[tuple[str, str]]:
        """Of both bodies of each pair."""
        return [(self.bodies[one], self.bodies[two]) for one, two in self.pairs.tolist()]

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the pairs."""
        return (*self.named, *(default_name(*both) for both in self.names[len(self.named) :]))


def crowded(model: Bodies, offsets: Sequence[int]) -> tuple[Crowded, list[dict[str, int]]]:
    """Pairs of bodies of one kind without contact laws, and contact nodes of each kind by name.

    Args:
        model: The bodies.
        offsets: Where the contact nodes of each part begin, their number last.
    """
    scene = model.scene
    bodies = list(dict.fromkeys(body.name for body in scene.bodies))
    place, kinds = {name: k for k, name in enumerate(bodies)}, dict[type, dict[str, int]]()
    radius = np.zeros(offsets[-1])
    meeting = {body.name for body in scene.bodies if not body.attached}
    asked = scene.dim == 1 or bool(scene.contacts)  # a line has an order, laws have ends
    for few, start in zip(model.few, offsets[len(model.parts) : -1], strict=True):
        radius[start : start + len(few.radius)] = few.radius
        if few.singles and not asked:
            own = {name: node + start for name, node in few.singles.items() if name in meeting}
            if own:
                kinds.setdefault(type(few), {}).update(own)
    # Gears join three or more, and others one to the ground.
    both = (set(joint.bodies) & place.keys() for joint in scene.holding if len(joint.bodies) == 2)
    held = {tuple(sorted(place[name] for name in names)) for names in both if len(names) == 2}
    found = [np.zeros((0, 2), dtype=np.int64)]
    node = np.zeros(len(bodies), dtype=np.int64)
    for kind in kinds.values():
        among = np.array([place[name] for name in kind])
        node[among] = list(kind.values())
        found.append(np.sort(among)[np.stack(np.triu_indices(len(among), 1), axis=1)])
    pairs = np.concatenate(found)
    for two in held:
        pairs = pairs[(pairs != two).any(axis=1)]
    radii = radius[node[pairs]]
    there = radii.sum(axis=1) > 0.0  # two points do not meet
    ends = node[pairs[there]]
    return Crowded(bodies, pairs[there], ends, radii[there]), list(kinds.values())


@dataclass(frozen=True)
class _Balls:
    """A body without a mesh: its contact nodes among all, radii and lines between them.

    Attributes:
        facing: Of each node the way that its end looks along the x axis, 0 if it has none.
        places: At t = 0 [m], (nodes, dim).
        faces: Whether it is pushed on its faces.
    """

    name: str
    nodes: Integers
    radius: Floats
    lines: Integers
    facing: Floats
    places: Floats
    faces: bool

    @cached_property
    def thinnest(self) -> float:
        """Least radius [m]."""
        return float(self.radius.min())

    @cached_property
    def target(self) -> Target:
        return Target.of_axis(self.nodes, self.lines, self.radius, faces=self.faces)


@dataclass(frozen=True)
class _Faces:
    """A solid: contact nodes of its faces among all, and the faces."""

    name: str
    nodes: Integers
    surface: Surface

    @property
    def target(self) -> Target:
        return Target.of_surface(self.nodes, self.surface)

    @property
    def size(self) -> float:
        """Typical size of a face [m]."""
        corners = self.surface.points[self.surface.corners]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        return float(np.median(edges))


def places_of(few: Sequence[FewBodies]) -> Floats:
    """Places of the contact nodes of bodies without a mesh at t = 0 [m]."""
    return np.concatenate([bodies.places(bodies.position) for bodies in few])


def ball_meetings(
    model: Bodies, offsets: Sequence[int], alike: Sequence[Collection[str]] = ()
) -> list[BallMeeting]:
    """Meetings of all pairs with a body without a mesh.

    Args:
        model: The bodies.
        offsets: Where the contact nodes of each part begin, their number last.
        alike: Groups of names within which `crowded` has the pairs.

    Raises:
        SceneError: Two bodies overlap at t = 0, or have no extent, so that they cannot meet.
    """
    asked, sides = bool(model.scene.contacts), _sides(model, offsets)
    shapes = Shapes.of(model.few, offsets)
    found: list[BallMeeting] = []
    flat = model.scene.dim == 1
    thin = {body.name for body in model.scene.bodies if body.is_slender and body.dim == 3}
    for label, (one, on_one), (two, on_two) in named_body_pairs(model.scene, alike):
        # A law names the ends that meet; without any all do.
        first = sides[one](on_one or ("",) if asked else None, two) if one in sides else None
        second = sides[two](on_two or ("",) if asked else None, one) if two in sides else None
        if isinstance(first, _Faces) and isinstance(second, _Faces):
            continue
        looks = ((one, on_one, two, second), (two, on_two, one, first)) if shapes.known else ()
        for name, on, other, side in looks:
            for shape in shapes.meeting(name, on, other):
                if side is not None and not shapes.meeting(other, None, name):
                    found += _on_other(label, name, shape, side, offsets[-1], other in thin)
        if first is None or second is None or not (len(first.nodes) and len(second.nodes)):
            continue
        if isinstance(first, _Faces) or isinstance(second, _Faces):
            found += _on_solid(label, first, second, offsets[-1])
        elif flat:
            found += _on_line(label, first, second, offsets[-1], asked=asked)
        else:
            crosses = one in thin or two in thin
            found += _slender(label, first, second, offsets[-1], asked=asked, crosses=crosses)
    found += [BallMeeting(*each) for each in convex_meetings(model.scene, model.few, offsets)]
    return found + [BallMeeting(*each) for each in tip_meetings(model.scene, model.few, offsets)]


type _Side = Callable[[Sequence[str] | None, str], _Balls | _Faces]
"""What a body offers to another one, by the surfaces that a contact law names, None without one,
and by the name of the other one."""


def _sides(model: Bodies, offsets: Sequence[int]) -> dict[str, _Side]:
    """What each body offers to the others, by its name."""
    found: dict[str, _Side] = {}

    def faces(k: int, side: Side) -> _Side:
        numbers = model.parts[k].outside.numbers[side.nodes]
        nodes = np.searchsorted(model.numbers[k], numbers) + offsets[k]
        whole = _Faces(model.parts[k].solid.name, nodes, side.surface)
        return lambda *_: whole

    def balls(bodies: FewBodies, body: int, start: int) -> _Side:
        places, lines = bodies.places(bodies.position), bodies.lines_of(body)

        # Of nodes that many others meet, which are kept: their id stays theirs.
        made: dict[int, tuple[Integers, _Balls]] = {}

        def some(surfaces: Sequence[str] | None, other: str) -> _Balls:
            own = bodies.meeting(body, surfaces, (other, 0))
            if id(own) not in made:
                parts = own + start, bodies.radius[own], lines, bodies.facing[own], places[own]
                faces = bool(len(bodies.faces[0]))
                made[id(own)] = own, _Balls(bodies.names[body], *parts, faces)
            return made[id(own)][1]

        return some

    for k, side in model.struck.items():
        found[model.parts[k].solid.name] = faces(k, side)
    starts = list(pairwise(offsets))[len(model.parts) :]
    for bodies, (start, _) in zip(model.few, starts, strict=True):
        found |= {name: balls(bodies, k, start) for k, name in enumerate(bodies.names)}
    return found


def _on_solid(
    label: str, one: _Balls | _Faces, two: _Balls | _Faces, total: int
) -> list[BallMeeting]:
    """A body without a mesh on a solid.

    Where its radius spans several faces, their nodes are held off it: the patch of contact then has
    the shape that bodies take. Else its nodes are held off the faces, a place at a time; corners of
    the solid are held off its axis too, if it has a thickness.
    """
    ball, solid = (two, one) if isinstance(one, _Faces) else (one, two)
    if not isinstance(ball, _Balls) or not isinstance(solid, _Faces):
        raise TypeError("one is a solid, one is not")
    names, none = (one.name, two.name), np.zeros(len(solid.nodes))
    thick = float(ball.radius.min())
    around = BallPair(solid.nodes, none, ball.target, total)
    if thick >= _RESOLVED * solid.size:
        return [BallMeeting(label, names, solid.name, around, patch=True)]
    places = BallPair(ball.nodes, ball.radius, solid.target, total)
    patch = ball.lines.shape[1] > 2  # triangles of a plate
    found = [BallMeeting(label, names, ball.name, places, patch=patch)]
    if len(ball.lines) and thick > 0.0:
        found.append(BallMeeting(label, names, solid.name, around, patch=patch))
    return found


def _on_other(
    label: str, name: str, body: Marked, other: _Balls | _Faces, total: int, crosses: bool
) -> list[BallMeeting]:
    """A rigid body with edges and faces, or that rolls, on one that deforms."""
    patch = other.target.signs is not None and len(body.shape.vertices) > 1
    return [
        BallMeeting(label, (other.name, name), (other.name, name)[told], pair, patch=patch)
        for told, pair in on_others(body, other.target, total, crosses=crosses)
    ]


def _slender(
    label: str, one: _Balls, two: _Balls, total: int, *, asked: bool, crosses: bool
) -> list[BallMeeting]:
    """Two bodies without meshes: nodes of each on the axis of the other, if it has one.

    In space axes may cross between nodes.
    """
    if one.thinnest + two.thinnest <= 0.0:
        if not asked:
            return []
        raise SceneError(
            f"contact of {one.name} and {two.name}: both have radius = 0, so that they cannot "
            "meet; give one a radius"
        )
    names = one.name, two.name
    pairs = [(one, two)] if len(two.lines) or not len(one.lines) else []
    pairs += [(two, one)] if len(one.lines) else []
    met = [(a, BallPair(a.nodes, a.radius, b.target, total)) for a, b in pairs]
    if crosses and one.lines.shape[1] == two.lines.shape[1] == 2 and len(pairs) == 2:
        (_, own), (_, other) = met
        axes = AxisPair(other.target, own.target, own, other)
        return [BallMeeting(label, names, one.name, axes, patch=False)]
    return [
        BallMeeting(label, names, a.name, pair, patch=False, single=pair if pair.single else None)
        for a, pair in met
    ]


def _on_line(label: str, one: _Balls, two: _Balls, total: int, *, asked: bool) -> list[BallMeeting]:
    """Two bodies on the x axis: ends that look at each other, in the order of t = 0.

    Raises:
        SceneError: The bodies overlap, or a law names an end that looks away from the other body.
    """
    found, size = [], float(np.ptp(np.concatenate([one.places, two.places]))) or 1.0
    for a, b in np.ndindex(len(one.nodes), len(two.nodes)):
        apart = float(two.places[b, 0] - one.places[a, 0])
        # The way from one to two: that of an end; of bodies without ends that of their places.
        looks = {float(one.facing[a]), -float(two.facing[b])} - {0.0}
        ways = looks or {1.0 if apart >= 0.0 else -1.0}
        room = float(one.radius[a] + two.radius[b])
        if len(ways) > 1 or apart * min(ways) - room < -_ROUNDING * size:
            continue
        ends = (one, a), (two, b)
        (lower, i), (upper, j) = ends if min(ways) > 0.0 else reversed(ends)
        pair = LinePair(int(lower.nodes[i]), int(upper.nodes[j]), room, total)
        found.append(BallMeeting(label, (one.name, two.name), upper.name, pair, patch=False))
    if not found:
        why = "overlap at t = 0, or what is clamped lies between them"
        why += ", or they meet at other ends than it names" * asked
        raise SceneError(
            f"contact {label}: {one.name} and {two.name} {why}; move one, or say by [[contact]] "
            "which bodies meet (the near end of a bar is that at gap, bar/far_end the other)"
        )
    return found


def point_loads(model: Bodies) -> list[tuple[str, str]]:
    """Bodies that press on single places of solids, and these."""
    solids, found = {part.solid.name for part in model.parts}, []
    for met in model.ball_meetings:
        one, two = met.names if met.names[1] in solids else reversed(met.names)
        if two in solids and not met.patch:
            found.append((one, two))
    return found


def striking(model: Bodies) -> dict[str, list[float]]:
    """Diameters of what may strike each solid [m], by its name; of places without one none."""
    known = {
        name: 2.0 * float(few.radius[few.nodes_of(k)].max(initial=0.0))
        for few in model.few
        for k, name in enumerate(few.names)
    }
    found: dict[str, list[float]] = {part.solid.name: [] for part in model.parts}
    for met in model.ball_meetings:
        one, two = met.names if met.names[1] in found else reversed(met.names)
        if two in found and known.get(one):
            found[two].append(known[one])
    return found


def check_apart(meetings: Sequence[BallMeeting], places: Floats) -> None:
    """Refuse bodies that overlap at t = 0, with all contact nodes at some places [m].

    Raises:
        SceneError: They do.
    """
    for meeting in meetings:
        if isinstance(meeting.pair, OnTerrain | LedPair) and meeting.pair.behind(places) > 0.0:
            one, two = meeting.names
            text = (
                f"the middle of a shape of {one} lies {meeting.pair.behind(places):.4g} m inside "
            )
            text += f'obstacle {two} at t = 0: move it, or give {two} side = "inside" if the '
            raise SceneError(f"{text}triangles of its surface turn the other way round")
        met = meeting.pair(places, places)
        own = places[meeting.pair.nodes]
        size = float(np.ptp(own, axis=0).max())
        worst = int(np.argmin(met.gap)) if len(met.gap) else 0
        depth = -met.gap[worst] - meeting.pair.touch if len(met.gap) else 0.0
        if depth > _ROUNDING * size:
            raise _overlap(*meeting.names, depth)


def check_crowd(crowd: Crowded, places: Floats) -> None:
    """Refuse balls that overlap, as `check_apart`.

    Raises:
        SceneError: They do.
    """
    ways = places[crowd.ends[:, 0]] - places[crowd.ends[:, 1]]
    gap = np.linalg.norm(ways, axis=1) - crowd.radii.sum(axis=1)
    worst = int(np.argmin(gap)) if len(gap) else 0
    if len(gap) and -gap[worst] > _ROUNDING * float(np.abs(ways[worst]).max()):
        one, two = crowd.pairs[worst]
        raise _overlap(crowd.bodies[one], crowd.bodies[two], -gap[worst])


def _overlap(one: str, two: str, depth: float) -> SceneError:
    text = f"bodies {one} and {two} overlap by {depth:.4g} m at t = 0: move one, or make it "
    return SceneError(text + "smaller")


def strike(model: Bodies) -> dict[int, Side]:
    """Faces of the solids that bodies without meshes may strike, by the place of the solid."""
    names = [part.solid.name for part in model.parts]
    asked: dict[int, NDArray[np.bool_]] = {}
    if not (names and model.few):  # pairs may be millions
        return {}
    for sides in body_pairs(model.scene):
        solids = [side for side in sides if side[0] in names]
        if len(solids) != 1:
            continue
        k = names.index(solids[0][0])
        _, _, faces = model.faces(k, solids[0][1])
        asked[k] = faces | asked.get(k, np.zeros_like(faces))
    parts = model.parts
    return {k: Side.of(parts[k].outside, parts[k].places, faces) for k, faces in asked.items()}
