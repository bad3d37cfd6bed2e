"""Bodies without meshes, without their contacts: what one march needs of them.

Points, rods and beams are `Lumped`: M q'' = f(t, q, q') + W g with coordinates q, gravity g and
W = M R for unit motions R along the axes, and contact nodes at places x(q) with the Jacobian
H = dx / dq. W^T q' is the momentum, W^T q the first moment of mass, whatever the coordinates. A bar
is an `ElasticBar`: its coordinates are the displacements of its ends, between which waves run.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.errors import SceneError
from impactfem.scene import Bar
from impactfem.system.beam_parts import BeamParts
from impactfem.system.convex import Carrier
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.system.stations import Asked, Stations


@dataclass(frozen=True)
class Lone:
    """A rigid body as a compiled march of it alone takes it.

    Attributes:
        mass: [kg].
        inertia: About the centre along the axes of the body [kg m^2], (3, 3).
        arms: From the centre to the contact nodes [m], (nodes, 3).
        rolling: Radius with which nodes roll [m], (nodes,).
        shares, axis: Of `impactfem.system.rigid.Rims`, (nodes or 0, 2) and (3,).
        free: See `impactfem.system.rigid.Rigid`.
    """

    mass: float
    inertia: Floats
    arms: Floats
    rolling: Floats
    shares: Floats
    axis: Floats
    free: bool


@dataclass(frozen=True, kw_only=True)
class FewBodies:
    """Bodies that share coordinates q; points do, since springs may join them.

    Attributes:
        names: Of the bodies.
        masses: [kg].
        centers: Centres of mass at t = 0 [m], shape (bodies, dim).
        speeds: Their velocities at t = 0 [m/s], shape (bodies, dim).
        inertias: Of the bodies about their centres [kg m^2]; 0 of what does not turn.
        angles: Of their axes at t = 0 [rad].
        position, velocity: q [m, rad] and q' at t = 0, shape (d,).
        places: x(q) of the contact nodes [m], (nodes, dim).
        radius: Of the contact nodes as balls, among themselves and with solids [m], (nodes,).
        shell: The same with obstacles [m].
        touching: Which nodes meet obstacles, (nodes,).
        body: Body of each contact node, (nodes,).
        lines: Contact nodes joined by straight axes, shape (lines, 2).
        ends: Contact nodes that may meet others by the names that `[[contact]] between` has for
            them: "" for those of the bare body, and its surfaces; empty: all meet, none has a name.
        rate: Frequency [rad/s] that steps have to follow; 0 if there is none.
        words: What they are, in words.
        carriers: Convex shapes that edges and faces may meet.
    """

    names: tuple[str, ...]
    masses: tuple[float, ...]
    centers: Floats
    speeds: Floats
    inertias: tuple[float, ...]
    angles: tuple[float, ...]
    position: Floats
    velocity: Floats
    places: Callable[[Floats], Floats]
    radius: Floats
    shell: Floats
    touching: Booleans
    body: Integers
    lines: Integers
    rate: Callable[[], float]
    words: str
    ends: Mapping[str, Integers]
    carriers: Sequence[Carrier] = ()

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return int(self.centers.shape[1])

    @property
    def transit(self) -> float:
        """Time that a wave needs through them [s]; infinite without waves."""
        return float("inf")

    @property
    def impedance(self) -> float:
        """Force by the velocity that it gives at once [kg/s]; 0 without waves."""
        return 0.0

    @property
    def massless(self) -> bool:
        """Whether what touches has no mass: then the law of contact acts on places, not speeds."""
        return False

    @property
    def figured(self) -> Mapping[str, float | list[list[float]] | Mapping[str, float]]:
        """What the summary says of a single body that turns besides its mass; nothing of others."""
        return {}

    @property
    def lone(self) -> Lone | None:
        """A rigid body that touches with its nodes alone and that nothing but gravity pulls."""
        return None

    @property
    def shared(self) -> Integers:
        """Of contact nodes how many from there on other balls share, 0: none do, (nodes,)."""
        return np.zeros(len(self.radius), dtype=np.int64)

    @property
    def undamped(self) -> float:
        """By which share contacts push too much since what touches is not damped."""
        return 0.0

    @property
    def seconds(self) -> float:
        """Time of a layer on one core, about, beside what any bodies take [s]."""
        return 0.0

    @property
    def areas(self) -> Floats:
        """Of the contact nodes on obstacles [m^2], 1 of those that touch at a single place."""
        return np.ones(len(self.radius))

    @property
    def faces(self) -> tuple[Integers, Integers]:
        """Nodes that touch on a face, and what follows each; see `impactfem.contact.faces`."""
        return np.zeros(0, dtype=np.int64), np.zeros((0, self.dim), dtype=np.int64)

    @property
    def facing(self) -> Floats:
        """Way along the first axis that the end at each contact node looks, 0 if any, (nodes,)."""
        return np.zeros(len(self.radius))

    def nodes_of(self, body: int) -> Integers:
        """Contact nodes of one of the bodies."""
        return np.flatnonzero(self.body == body)

    @property
    def singles(self) -> Mapping[str, int]:
        """Bodies that meet all of their kind with the same contact node, by name, and that."""
        if self.ends or len(self.lines):
            return {}
        alone = np.bincount(self.body, minlength=len(self.names)) == 1
        own = np.argsort(self.body, kind="stable")[alone[np.sort(self.body)]]
        return {self.names[self.body[node]]: int(node) for node in own}

    def meeting(
        self,
        body: int,
        surfaces: Sequence[str] | None,
        partner: tuple[str, int],  # noqa: ARG002  (of bodies that roll)
    ) -> Integers:
        """Contact nodes of one of the bodies that may meet another body, or an obstacle.

        Args:
            body: Its place.
            surfaces: Those that a contact law names, "" for the bare body; None: there is no law.
            partner: What it meets, by its name, and which face of it.
        """
        if not self.ends:
            return self.nodes_of(body)
        return np.concatenate([self.ends[name] for name in surfaces or self.ends])

    def stations(self, asked: Sequence[Asked]) -> Stations:
        """What joints hold of bodies at places [m], (3,); see `BodyKind.takes_joints`.

        Raises:
            SceneError: A kind that is registered does not say how its places move.
        """
        raise SceneError(
            f"{asked[0][0]}: joints and masses cannot hold it, as its system does not say how its "
            "places move; give Lumped(section=...), or take takes_joints from its class"
        )

    def lines_of(self, body: int) -> Integers:
        """Lines of one of the bodies, by places among its own nodes, (lines, 2)."""
        own = self.nodes_of(body)
        mine = self.lines[np.isin(self.lines[:, 0], own)]
        return np.searchsorted(own, mine)


@dataclass(frozen=True, kw_only=True)
class Lumped(FewBodies):
    """Points, a rod or a beam.

    Attributes:
        system: M, f without gravity; no constraints.
        weights: W, shape (d, dim).
        moments: The same for angular momenta about the bodies' centres, shape (d, 1) or (d, 3).
        owner: Body of each coordinate, shape (d,).
        jacobian: H(q), shape (nodes * dim, d).
        turning: Whether H depends on q.
        elastic: Elastic energy of q [J].
        load: Mean forces that do work besides gravity, springs and inertia, (start, end, q, q') ->
            (d,); None without any.
        beam: The beam, None for other bodies.
        section: Of a body and a place in space the place of what moves there [m], (3,), and its
            velocity and spin in space by q', (6, d); None of bodies that joints do not hold.
    """

    system: GeneralizedSystem
    weights: Floats
    moments: Floats
    owner: Integers
    jacobian: Callable[[Floats], Floats]
    turning: bool
    elastic: Callable[[Floats], float]
    load: Callable[[float, float, Floats, Floats], Floats] | None
    beam: BeamParts | None = None
    section: Callable[[int, Floats], tuple[Floats, Floats]] | None = None

    def stations(self, asked: Sequence[Asked]) -> Stations:
        """One for each place, but for those that are the same."""
        if self.section is None:
            return super().stations(asked)
        of: list[int] = []
        names: list[str] = []
        places: list[Floats] = []
        rows: list[Floats] = []
        for name, wanted, _ in asked:
            place, moving = self.section(self.names.index(name), wanted)
            known = [n == name and (p == place).all() for n, p in zip(names, places, strict=True)]
            of.append(known.index(True) if any(known) else len(names))
            if not any(known):
                names.append(name)
                places.append(place)
                rows.append(moving)
        every = np.array(rows)
        flat = every.reshape(-1, every.shape[-1])
        answers = np.linalg.solve(self.system.mass(self.position), flat.T)
        return Stations.along(
            tuple(of), tuple(names), np.array(places), every, answers, self.velocity
        )


@dataclass(frozen=True, kw_only=True)
class ElasticBar(FewBodies):
    """A bar whose waves are followed; q are the displacements of its ends along it [m].

    Attributes:
        bar: The bar.
        axis: Unit vector from its near end to the far one, shape (dim,).
        origin: Where the near end is without displacement [m], shape (dim,).
    """

    bar: Bar
    axis: Floats
    origin: Floats

    @property
    def transit(self) -> float:
        """L / c [s]."""
        return self.bar.transit_time

    @property
    def impedance(self) -> float:
        """Z = rho A c [kg/s]."""
        return self.bar.impedance

    @property
    def facing(self) -> Floats:
        """The near end looks back, the far end ahead."""
        return np.array([-1.0, 1.0])

    def stations(self, asked: Sequence[Asked]) -> Stations:
        """Its ends, which move along it and do not turn; rows are of q'."""
        names = tuple(dict.fromkeys(name for name, *_ in asked))
        ends = np.array([int("/" in name) for name in names])
        rows = np.zeros((len(names), 6, 2))
        rows[np.arange(len(names)), : self.dim, ends] = self.axis
        places = np.zeros((len(names), 3))
        places[:, : self.dim] = self.places(self.position)[ends]
        found = Stations.along(
            tuple(names.index(name) for name, *_ in asked), names, places, rows,
            2.0 / self.masses[0] * rows.reshape(-1, 2).T, self.velocity,
        )  # fmt: skip
        return replace(found, given=())

    def at(self, x: Floats, moved: Floats) -> Floats:
        """Places [m] of material at x with displacements along the bar, (nodes, dim)."""
        return np.asarray(self.origin + (x + moved)[:, None] * self.axis)


def rigid_in_plane(
    name: str,
    *,
    mass: float,
    inertia: float,
    center: Sequence[float] | Floats,
    arms: Floats,
    velocity: Sequence[float],
    radius: float,
    lines: Integers,
    words: str,
    angle: float = 0.0,
) -> Lumped:
    """A rigid body in the plane: coordinates x, y and the angle.

    Args:
        name: Of the body.
        mass: [kg].
        inertia: About its centre [kg m^2].
        center: At t = 0 [m], (2,).
        arms: From the centre to the contact nodes at t = 0 [m], (nodes, 2).
        velocity: Of the centre [m/s] and of the angle [rad/s], (3,).
        radius: Of the nodes and the lines between them [m].
        lines: Nodes that are joined, (lines, 2).
        words: What it is.
        angle: At t = 0 [rad].
    """
    count = len(arms)
    along, across = arms.ravel(), np.stack([-arms[:, 1], arms[:, 0]], axis=1).ravel()
    moving = np.tile(np.eye(2), (count, 1))

    def places(q: Floats) -> Floats:
        turned = np.cos(q[2] - angle) * along + np.sin(q[2] - angle) * across
        return np.asarray(q[:2] + turned.reshape(count, 2))

    def jacobian(q: Floats) -> Floats:
        turned = np.cos(q[2] - angle) * across - np.sin(q[2] - angle) * along
        return np.column_stack([moving, turned])

    return Lumped(
        names=(name,),
        masses=(mass,),
        centers=np.array([center], dtype=float),
        speeds=np.array([velocity[:2]], dtype=float),
        inertias=(inertia,),
        angles=(angle,),
        position=np.array([*center, angle], dtype=float),
        velocity=np.array(velocity, dtype=float),
        places=places,
        radius=np.full(count, radius),
        shell=np.full(count, radius),
        touching=np.ones(count, dtype=bool),
        body=np.zeros(count, dtype=np.int64),
        lines=lines,
        ends={},
        rate=lambda: 0.0,
        words=words,
        system=LinearSystem(
            mass=np.array([mass, mass, inertia]), normals=np.zeros((0, 3)), offsets=np.zeros(0),
            names=("x", "y", "theta"),
        ),
        weights=mass * np.eye(3)[:, :2],
        moments=inertia * np.eye(3)[:, 2:],
        owner=np.zeros(3, dtype=np.int64),
        jacobian=jacobian,
        turning=True,
        elastic=lambda _: 0.0,
        load=None,
    )  # fmt: skip
