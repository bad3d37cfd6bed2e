"""Rigid bodies as the march takes them: Newton's and Euler's equations, and what can touch.

Coordinates are the centre and, in the plane, the angle; in space a unit quaternion. Rates are the
velocity of the centre and the spin, in space along the axes of the body. Everything is kept in
space: a body in the plane is one that turns about z only.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.scene import RigidBody, Rod, Scene
from impactfem.scene.means import StepMean
from impactfem.scene.obstacles.rotation import gap_at
from impactfem.scene.pairing import bodies_met, friction_of, obstacles_of
from impactfem.scene.rigid_forms import Form
from impactfem.scene.rigid_keys import rotation
from impactfem.system.convex import Carrier, Convex
from impactfem.system.few import FewBodies, Lone
from impactfem.system.rim_kernels import along_rims, lowest_directions
from impactfem.system.stations import Asked, Stations

type Loads = Callable[[float, float, Floats, Floats, Floats], tuple[Floats, Floats]]
"""Mean force [N] and moment [N m], (3,) each, between two times, by centre, velocity and spin."""


NEAR = 0.2
"""Gap within which balls among many are near, as a share of the smaller radius."""


@dataclass(frozen=True)
class Rims:
    """Places on circles about axes of a body, the lowest one and others at angles from it.

    Attributes:
        axis: Of the circles, along the axes of the body, (nodes, 3).
        shares: Radius times cosine and sine of the angles [m], (nodes, 2).
    """

    axis: Floats
    shares: Floats

    def lowest(self, turn: Floats, normals: Floats, known: Floats, near: float) -> Floats:
        """Directions from the centres of the circles to what is nearest, (nodes, 3).

        Args:
            turn: Rotation of the body.
            normals: Of what each place may touch, towards it, (nodes, 3).
            known: Directions that are taken where circles lie flat, or where others would be
                farther off than so, (nodes, 3).
            near: Least cosine of the angle from these.
        """
        return np.asarray(lowest_directions(self.axis @ turn.T, normals, known, near))

    def arms(self, turn: Floats, normals: Floats, known: Floats) -> Floats:
        """From the centres of the circles to the places [m], (nodes, 3); all near known ones."""
        return np.asarray(along_rims(self.axis @ turn.T, normals, known, self.shares))

    @property
    def across(self) -> Floats:
        """Some directions across the axes, along the axes of the body, (nodes, 3)."""
        return np.cross(self.axis, np.eye(3)[np.argmin(np.abs(self.axis), axis=1)])

    @property
    def one_axis(self) -> Floats | None:
        """That of all circles, (3,); None if they have several."""
        axes = self.axis[self.shares.any(axis=1)]
        return axes[0] if (axes == axes[0]).all() else None


@dataclass(frozen=True, kw_only=True)
class Rigid(FewBodies):
    """A rigid body.

    A ball (a disc, the ends of a capsule) rolls: it touches different things at different places of
    its surface. So each obstacle and body has a contact node of its own at its centre. Among many
    balls a ball has as many nodes as others find room around it, which those that are near share.

    Attributes:
        inertia: About the centre along the axes of the body [kg m^2], (3, 3).
        arms: From the centre to the contact nodes along the axes of the body [m], (nodes, 3).
        meets: Contact nodes that meet a body or obstacle, by its name and the number of its face.
        alike: Names of the balls that share nodes.
        crowd: The first of these nodes, (1,), of no meaning where there are none.
        rolling: Radius with which nodes roll [m], (nodes,): that of their balls but beside solids,
            which they may touch at several places: followers carry the arms of these.
        rims: What of the nodes are places on circles around `arms`; None if nothing is.
        normals, lowest: Of what these may touch at t = 0, towards them, and their directions from
            the axis, (nodes, 3).
        loads: What acts besides gravity; None if nothing does.
        picture: Points [m], (points, 3), along the axes of the body, and cells of its picture.
        crowded: Of each contact node how many from it on others share, 0 where none do, (nodes,).
        free: Whether it turns about any axis alike, and nothing of what touches turns with it: its
            steps may be of many turns.
    """

    inertia: Floats
    arms: Floats
    meets: Mapping[tuple[str, int], Integers]
    alike: frozenset[str]
    crowd: Integers
    rolling: Floats
    rims: Rims | None
    normals: Floats
    lowest: Floats
    loads: Loads | None
    picture: tuple[Floats, Integers]
    crowded: Integers
    free: bool

    @property
    def shared(self) -> Integers:
        """See `crowded`."""
        return self.crowded

    @property
    def followers(self) -> Floats:
        """Arms in space of all nodes besides `arms` [m], (nodes, 3)."""
        found = np.zeros((len(self.radius), 3))
        for carrier in self.carriers:
            found[carrier.markers] = Carrier.arms(len(carrier.markers), self.dim, carrier.unit)[1]
        return found

    @property
    def figured(self) -> Mapping[str, float | list[list[float]]]:
        """Its inertia [kg m^2]."""
        if self.dim == 2:
            return {"inertia": float(self.inertia[2, 2])}
        return {"inertia": self.inertia.tolist()}

    @property
    def lone(self) -> Lone | None:
        """Itself, where it touches with its nodes alone and nothing but gravity pulls."""
        axis = np.zeros(3) if self.rims is None else self.rims.one_axis
        if self.carriers or self.loads is not None or axis is None:
            return None
        shares = np.zeros((0, 2)) if self.rims is None else self.rims.shares
        return Lone(self.masses[0], self.inertia, self.arms, self.rolling, shares, axis, self.free)

    def stations(self, asked: Sequence[Asked]) -> Stations:
        """One, wherever joints hold it."""
        dim = self.dim
        centre, turn = frame(self.position)
        return Stations(
            of=(0,) * len(asked),
            names=self.names,
            places=centre[None],
            turns=turn[None],
            speeds=in_space(self.velocity[:dim])[None],
            spins=np.pad(self.velocity[dim:], (3 - len(self.velocity[dim:]), 0))[None],
            light=np.array([1.0 / self.masses[0]]),
            inertia=self.inertia[None],
            rows=np.zeros((1, 6, 0)),
            compliance=np.zeros((1, 6, 1, 6)),
            freedoms=len(self.velocity),
            given=("velocity", "angular_velocity"),
        )

    def meeting(
        self,
        body: int,  # noqa: ARG002  (it is one)
        surfaces: Sequence[str] | None,  # noqa: ARG002  (it has none)
        partner: tuple[str, int],
    ) -> Integers:
        """Contact nodes that may meet a body, or a face of an obstacle."""
        found = self.crowd if partner[0] in self.alike else _NONE
        return self.meets.get(partner, found)

    @property
    def singles(self) -> Mapping[str, int]:
        """See `FewBodies`."""
        return {self.names[0]: int(self.crowd[0])} if self.alike else {}


_NONE = np.zeros(0, dtype=np.int64)


def frame(q: Floats) -> tuple[Floats, Floats]:
    """Centre (3,) and rotation (3, 3) of coordinates of a body in the plane or in space."""
    if len(q) > 3:
        return q[:3], rotation(q[3:])
    c, s = np.cos(q[2]), np.sin(q[2])
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.array([q[0], q[1], 0.0]), turned


def in_space(values: Floats) -> Floats:
    """Vectors with three components, (..., 3), of these or of vectors in the plane."""
    if values.shape[-1] == 3:
        return values
    found = np.zeros((*values.shape[:-1], 3))
    found[..., : values.shape[-1]] = values
    return found


@dataclass(frozen=True)
class _Bodies:
    """What each rigid body asks of all others: found once, as they may be many.

    Attributes:
        cornered, rolling, linked, solids: Names of bodies with edges and faces, that roll, with
            links, and that are solids.
        least: Radius of the smallest ball [m].
    """

    cornered: frozenset[str]
    rolling: frozenset[str]
    linked: frozenset[str]
    solids: frozenset[str]
    least: float

    @classmethod
    def of(cls, scene: Scene) -> "_Bodies":
        """Those of a scene."""
        cornered = frozenset(body.name for body in scene.bodies if body.has_corners)
        balls = [cast("RigidBody", body) for body in scene.bodies if body.rolls]
        least = min((float(ball.form.radius[0]) for ball in balls), default=np.inf)
        linked = frozenset(body.name for body in scene.bodies if body.has_links)
        solids = frozenset(solid.name for solid in scene.solids)
        return cls(cornered, frozenset(ball.name for ball in balls), linked, solids, least)


def rigid_systems(scene: Scene, bodies: Sequence[RigidBody]) -> list[Rigid]:
    """Systems of rigid bodies of a scene."""
    among = _Bodies.of(scene)
    return [rigid_system(scene, body, among) for body in bodies]


def rigid_system(scene: Scene, body: RigidBody, among: _Bodies) -> Rigid:
    """A rigid body of a scene: mass, inertia, and contact nodes for the obstacles it may meet."""
    form, center, dim = body.form, body.center, body.dim
    named = obstacles_of(scene, body.name)
    obstacles = {
        o.name: o
        for o in named
        if not body.has_corners or (o.meets_corners and not o.meets_sides(body))
    }
    faces = [
        (name, face)
        for name, obstacle in obstacles.items()
        for face in range(1 if obstacle.other_gap(np.zeros((0, dim))) is None else 2)
    ]
    solids, others = among.solids, bodies_met(scene, body.name)
    shaped = set(others) if body.has_corners else set(among.cornered)
    shaped |= {name for name in solids if body.rolls and friction_of(scene, body.name, name)}
    rolls = bool(form.radius.any() or len(form.rim))
    alike, room = _alike(body, others, among)
    apart = [(each, 0) for each in others if each not in shaped and each not in alike]
    partners = list(dict.fromkeys([*faces, *apart]))
    copies, count = max(1, len(partners) + room) if rolls else 1, len(form.nodes)
    own = np.arange(count)
    meets = {partner: own + count * k * rolls for k, partner in enumerate(partners)}
    crowd = own + count * len(partners)
    rolling = np.tile(form.radius, copies)
    for (name, _), nodes in meets.items():
        rolling[nodes] *= name not in solids
    arms = in_space(np.tile(form.nodes - center, (copies, 1)))
    radius = np.tile(form.radius, copies)
    count = len(arms)
    shaped |= among.linked
    shaped = shaped.intersection(others)
    shaped |= {o.name for o in named}.difference(obstacles)
    carriers = []
    for part in body.parts if shaped else ():
        carrier, turning = _carrier(body, part, len(arms), shaped)
        carriers.append(carrier)
        arms, more = np.vstack([arms, turning]), len(turning)
        radius, rolling = (np.pad(each, (0, more)) for each in (radius, rolling))
    # Across its plane nothing turns a body: what is a size there has the units of the rest.
    inertia, turned = body.moments[0, 0] * np.eye(3), np.array([body.angle])
    if dim == 3:
        inertia, turned = body.moments, body.quaternion
    position, velocity = np.concatenate([center, turned]), body.start_velocity
    if dim == 3:
        velocity = np.concatenate([velocity[:3], rotation(turned).T @ velocity[3:]])

    middle, turn = frame(position)
    rims = _rims(form, copies, len(arms))
    normals = np.zeros((len(arms), 3))
    lowest = normals if rims is None else rims.across @ turn.T
    for _ in range(_LOOKS if rims else 0):
        for (name, _), nodes in meets.items():
            there = middle + arms @ turn.T + (rims.arms(turn, normals, lowest) if rims else 0.0)
            normals[nodes] = gap_at(obstacles[name], there[nodes], 0.0)[1]
        lowest = rims.lowest(turn, normals, lowest, -1.0) if rims else lowest

    def places(q: Floats) -> Floats:
        middle, turn = frame(q)
        around = rims.arms(turn, normals, lowest) if rims else 0.0
        return np.asarray((middle + arms @ turn.T + around)[:, :dim])

    spin = float(np.linalg.norm(velocity[dim:]))
    # Steps of what is joined, or beside iterated bodies, follow arms and turns.
    free = not (carriers or rims or scene.couplings or scene.iterated) and _is_free(inertia, arms)
    return Rigid(
        names=(body.name,),
        masses=(body.total_mass,),
        centers=center[None],
        speeds=velocity[None, :dim],
        inertias=(float(inertia[2, 2]) if dim == 2 else 0.0,),
        angles=(body.angle,),
        position=position,
        velocity=velocity,
        places=places,
        radius=radius,
        shell=radius,
        touching=np.arange(len(radius)) < count,
        body=np.zeros(len(radius), dtype=np.int64),
        lines=np.zeros((0, 2), dtype=np.int64),
        ends={},
        rate=lambda: 0.0 if free else spin,
        words=f"a rigid {body.figure}",
        inertia=inertia,
        arms=arms,
        meets=meets,
        alike=alike,
        crowd=crowd,
        rolling=rolling,
        rims=rims,
        normals=normals,
        lowest=lowest,
        loads=_loads(body),
        picture=(in_space(form.points - center), form.cells),
        crowded=np.where(np.arange(len(radius)) == len(own) * len(partners), room, 0),
        carriers=tuple(carriers),
        free=free,
    )


@dataclass(frozen=True, kw_only=True)
class RigidRod(Rigid):
    """A rod, whose ends meet all there is."""

    def meeting(
        self,
        body: int,
        surfaces: Sequence[str] | None,  # noqa: ARG002  (it has none)
        partner: tuple[str, int],  # noqa: ARG002  (all meet it alike)
    ) -> Integers:
        """Both ends."""
        return self.nodes_of(body)


def rigid_rod(rod: Rod) -> RigidRod:
    """A rod of a scene: both ends are balls that do not roll, joined by its axis."""
    arms = 0.5 * rod.length * np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    inertia = rod.mass * rod.length**2 / 12.0 * np.eye(3)
    centre, none = np.asarray(rod.center, dtype=float), np.zeros((2, 3))

    def places(q: Floats) -> Floats:
        middle, turn = frame(q)
        return np.asarray((middle + arms @ turn.T)[:, :2])

    return RigidRod(
        names=(rod.name,),
        masses=(rod.mass,),
        centers=centre[None],
        speeds=np.array([rod.velocity], dtype=float),
        position=np.append(centre, rod.inclination),
        velocity=np.array([*rod.velocity, rod.angular_velocity], dtype=float),
        inertias=(float(inertia[2, 2]),),
        angles=(rod.inclination,),
        places=places,
        radius=np.full(2, rod.radius),
        shell=np.full(2, rod.radius),
        touching=np.ones(2, dtype=bool),
        body=np.zeros(2, dtype=np.int64),
        lines=np.array([[0, 1]]),
        ends={},
        rate=lambda: abs(rod.angular_velocity),
        words="a rigid rod",
        inertia=inertia,
        arms=arms,
        meets={},
        alike=frozenset(),
        crowd=_NONE,
        rolling=np.zeros(2),
        rims=None,
        normals=none,
        lowest=none,
        loads=_loads(rod),
        picture=(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)),
        crowded=np.zeros(2, dtype=np.int64),
        free=False,
    )


def _alike(body: RigidBody, others: Sequence[str], among: _Bodies) -> tuple[frozenset[str], int]:
    """Other balls, where there are so many that they share nodes, and the number of these.

    Where these are all balls the set is that of all, itself among them: each has it.
    """
    found = among.rolling.intersection(others) if body.rolls else frozenset[str]()
    if not found or len(found) <= (room := _room(body, among)):
        return frozenset(), 0
    return (among.rolling if len(found) == len(among.rolling) - 1 else found), room


def _is_free(inertia: Floats, arms: Floats) -> bool:
    """Whether a body turns about any axis alike, and none of its arms (nodes, 3) turns with it."""
    alike = np.abs(inertia - inertia[0, 0] * np.eye(3)).max() <= 1e-14 * np.abs(inertia).max()
    return bool(alike) and not arms.any()


def _room(body: RigidBody, among: _Bodies) -> int:
    """How many others, the least of all, have room around a ball: by the angles that they fill."""
    own, least = float(body.form.radius[0]), among.least
    sine = least / (own + (1.0 + NEAR) * least)
    filled = 1.0 - np.sqrt(1.0 - sine**2)
    most = np.pi / np.arcsin(sine) if body.dim == 2 else 2.0 / filled
    return int(most) + _SPARE


_SPARE = 2  # nodes besides: balls that a step has moved may lie a little in each other
_MARKED = 0.25  # arm of markers, as a share of the size of a body
_LOOKS = 4  # for what is nearest to the lowest place of a rim at t = 0


def _rims(form: Form, copies: int, count: int) -> Rims | None:
    """Circles of so many copies of the nodes of a form, and of no radius of other nodes."""
    if not len(form.rim):
        return None
    more = [(0, count - copies * len(form.rim)), (0, 0)]
    axes = np.pad(np.tile(form.axis, (copies, 1)), more, mode="edge")
    return Rims(axes, np.pad(np.tile(form.rim, (copies, 1)), more))


def _carrier(body: RigidBody, part: Form, first: int, partners: set[str]) -> tuple[Carrier, Floats]:
    """A part of the body with markers from a contact node on, and the arms of these [m]."""
    middle = part.centre - body.center
    shape = convex_of(part)
    unit = _MARKED * part.volume ** (1.0 / body.dim)
    turning, _ = Carrier.arms(1 + body.dim + body.dim * shape.rounds, body.dim, unit)
    markers = first + np.arange(len(turning))
    return Carrier(shape, markers, unit, frozenset(partners)), in_space(middle) + turning


def convex_of(part: Form) -> Convex:
    """What edges and faces of others meet of a part of a body, from its centre."""
    nodes = part.nodes - part.centre
    if len(part.radii):
        return Convex.ellipsoid(part.radii)
    if len(part.rim):
        return Convex.cylinder(np.unique(nodes, axis=0), float(np.linalg.norm(part.rim[0])))
    return Convex.of(nodes, float(part.radius.max()))


def _loads(body: RigidBody | Rod) -> Loads | None:
    """Force and moment by the formulas of a body."""
    if not body.force and not body.moment:
        return None
    force, moment = (tuple(map(StepMean, each or ())) for each in (body.force, body.moment))

    def loads(
        start: float, end: float, place: Floats, speed: Floats, spin: Floats
    ) -> tuple[Floats, Floats]:
        moving = dict(zip(("x", "y", "z", "vx", "vy", "vz"), (*place, *speed), strict=True))
        turning = dict(zip(("wx", "wy", "wz", "w"), (*spin, spin[2]), strict=True))
        found = np.zeros((2, 3))
        for k, mean in enumerate(force):
            found[0, k] = mean(start, end, **moving)
        for k, mean in enumerate(moment, start=3 - len(moment)):
            found[1, k] = mean(start, end, **turning)
        return found[0], found[1]

    return loads
