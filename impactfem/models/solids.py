"""What the solids of a scene are, meshed and discretised: shared by plan and run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.body_pairs import Side, SurfacePair, make_pair
from impactfem.contact.boundary import Boundary, boundary, everywhere
from impactfem.contact.overlap import in_obstacle, overlap
from impactfem.contact.reach import Reach
from impactfem.contact.self_pairs import WithinBody
from impactfem.contact.surfaces import ContactNodes
from impactfem.errors import SceneError
from impactfem.fem import MPI
from impactfem.marching.schemes import SOLID_SCHEMES
from impactfem.mesh.body import BodyMesh, build_body_mesh
from impactfem.mesh.morph import morphed
from impactfem.models.ball_contacts import (
    BallMeeting,
    Crowded,
    ball_meetings,
    check_apart,
    check_crowd,
    crowded,
    places_of,
    strike,
)
from impactfem.models.carried import set_out
from impactfem.models.key import SceneKey
from impactfem.models.obstacle_contacts import ObstacleMeeting, obstacle_meetings
from impactfem.models.solid_contact import contact_of, reach_of
from impactfem.models.ties import Ties
from impactfem.models.tips import held_regions, supported, tips_of
from impactfem.scene import Scene, Solid
from impactfem.scene.apartness import Apartness
from impactfem.scene.masses import Attached
from impactfem.scene.nearest import meant
from impactfem.scene.obstacles import Rigid
from impactfem.scene.pairing import named_body_pairs, obstacles_of
from impactfem.scene.probes import Probe, outside
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show
from impactfem.system.elastic import ElasticSystem, elastic_system
from impactfem.system.few import FewBodies
from impactfem.system.few_bodies import few_bodies
from impactfem.system.joints import Joints, joints_of
from impactfem.system.located import Located, locate
from impactfem.system.materials import StandIns, stand_ins
from impactfem.system.quality import with_quality
from impactfem.system.regions import HeldRegion, Key
from impactfem.system.surface import SurfaceNodes
from impactfem.system.tips import Tips


@dataclass(frozen=True)
class SolidPart:
    """One of the solids, meshed and distributed over the ranks.

    Attributes:
        comm: MPI communicator.
        scene: A scene with this model; its solver and output settings may be those of another run.
        solid: The body.
        degree: Degree of its elements.
        mesh: Its mesh.
        ties: Those of the scene.
        first: The body as it begins, where supports have let go of it since: contact stays there.
    """

    comm: Any
    scene: Scene
    solid: Solid
    degree: int
    mesh: BodyMesh
    ties: Ties = field(repr=False, compare=False)
    first: "SolidPart | None" = field(default=None, repr=False, compare=False)

    @cached_property
    def system(self) -> ElasticSystem:
        """Mass, stiffness, supports and loads (collective at the first use)."""
        made = elastic_system(self.solid, self.scene.vector_gravity, self.mesh)
        return with_quality(made, self.solid)

    @cached_property
    def foreseen(self) -> StandIns:
        """Bodies of one material by which steps and blows are foreseen (collective likewise)."""
        if self.solid.is_uniform:
            return StandIns(self.solid, self.solid, None)
        return stand_ins(self.system.nodes, self.solid)

    @cached_property
    def outside(self) -> Boundary:
        """Its faces, on every rank (collective at the first use)."""
        solid = self.solid
        return boundary(self.mesh, thickness=solid.thickness, axisymmetric=solid.is_axisymmetric)

    @cached_property
    def within(self) -> WithinBody:
        """Which faces of the outside may meet others of it."""
        every = np.ones(len(self.outside.faces), dtype=bool)
        return WithinBody.of(self.outside, (every, every))

    @cached_property
    def begun(self) -> Floats:
        """Displacement at t = 0 as far as it is known, of the owned dofs [m].

        Bodies that start in equilibrium are looked at undeformed: what supports move by then would
        be the only nodes that have moved.
        """
        if self.first is not None:
            return self.first.begun
        found = self.system.displacement
        return np.zeros_like(found) if self.scene.starts_at_rest else found

    @cached_property
    def places(self) -> Floats:
        """Places of the nodes of the outside at t = 0 [m], (nodes, dim) (collective likewise)."""
        return self.places_at(self.begun)

    def places_at(self, displacement: Floats) -> Floats:
        """The same for another displacement of the owned dofs [m] (collective)."""
        moved = displacement.reshape(-1, self.solid.dim)
        numbers = self.outside.numbers
        return self.outside.points + everywhere(self.comm, numbers, self.system.numbers, moved)

    @cached_property
    def supported(self) -> Booleans:
        """Nodes of the outside that supports hold, (nodes, dim) (collective likewise)."""
        return supported(self)

    @cached_property
    def regions(self) -> Mapping[Key, HeldRegion]:
        """What joints and ties hold of it (collective likewise).

        Raises:
            KeyedError: A surface is unknown, or a region is empty or shared.
        """
        return {**held_regions(self), **self.ties.regions(self.solid.name)}

    @property
    def joined(self) -> Booleans:
        """Nodes of the outside that joints hold, which do not touch, (nodes,)."""
        held = [region.numbers for region in self.regions.values()]
        none = np.zeros(0, dtype=np.int64)
        return np.isin(self.outside.numbers, np.concatenate([none, *held]))

    @cached_property
    def obstacles(self) -> Sequence[Rigid]:
        """What of the scene's obstacles it may meet."""
        return obstacles_of(self.scene, self.solid.name)

    @cached_property
    def reach(self) -> Reach:
        """Bound of its way within the duration (collective at the first use)."""
        return reach_of(self) if self.first is None else self.first.reach

    @cached_property
    def contact(self) -> ContactNodes | None:
        """Nodes that can touch an obstacle within the duration; None if there is none (likewise).

        Raises:
            SceneError: The body is inside an obstacle at t = 0, or a surface is unknown.
        """
        if self.first is not None:
            return self.first.contact
        if not self.obstacles:
            return None
        found = contact_of(self)
        for obstacle in self.obstacles:
            met = in_obstacle(obstacle, 0.0, self.outside, self.places)
            if met is not None:
                raise SceneError(
                    f"body {self.solid.name} and obstacle {obstacle.name} lie in each other at "
                    f"t = 0, at ({', '.join(f'{x:.4g}' for x in met[1])}), between its nodes: move "
                    "one of them"
                )
        return found


@dataclass(frozen=True)
class SolidsModel:
    """The solids of a scene, meshed and discretised.

    Attributes:
        comm: MPI communicator.
        scene: The scene.
        parts: The solids, in its order.
        updated: Whether pairs of surfaces follow the bodies.
        few: Its bodies without meshes.
    """

    comm: Any
    scene: Scene
    parts: tuple[SolidPart, ...]
    updated: bool
    few: tuple[FewBodies, ...] = ()

    @cached_property
    def pairs(self) -> tuple[SurfacePair, ...]:
        """Pairs of surfaces that can meet within the duration.

        Raises:
            SceneError: Two bodies overlap at t = 0, or a surface is unknown.
        """
        names = [part.solid.name for part in self.parts]
        found, apart = [], Apartness.of(self.scene)
        # Bodies without meshes may be in millions of pairs.
        for label, (one, first), (two, second) in named_body_pairs(self.scene) if names else ():
            if one not in names or two not in names:
                continue
            a, b = names.index(one), names.index(two)
            if a != b:
                if not apart.meet(one, two):
                    continue
                self._check_apart(a, b)
            pair = make_pair(
                (a, b),
                tuple(self.faces(k, surfaces) for k, surfaces in ((a, first), (b, second))),
                (names[a], names[b]),
                self.parts[a].reach.distance + self.parts[b].reach.distance,
                updated=self.updated,
                label=label,
                thickness=self.parts[a].solid.thickness,
                axisymmetric=self.parts[a].solid.is_axisymmetric,
            )
            if pair is not None:
                found.append(pair)
        return tuple(found)

    @cached_property
    def probes(self) -> tuple[tuple[Probe, int, Located], ...]:
        """The probes of the scene, the place of each one's body and where in it they are.

        Raises:
            SceneError: One is outside its body (collective).
        """
        names = [part.solid.name for part in self.parts]
        found = []
        for index, probe in enumerate(self.scene.probes):
            if probe.body not in names:
                continue
            body = names.index(probe.body)
            part = self.parts[body]
            place = np.asarray(probe.point, dtype=float)
            located = locate(part.system, part.solid, part.begun, place)
            if not isinstance(located, Located):
                raise outside(index, probe, located)
            found.append((probe, body, located))
        return tuple(found)

    def _check_apart(self, a: int, b: int) -> None:
        one, two = self.parts[a], self.parts[b]
        found = overlap(one.outside, one.places, two.outside, two.places, closely=True)
        if found is not None:
            depth, place = found
            raise SceneError(
                f"bodies {one.solid.name} and {two.solid.name} overlap by at least {depth:.3g} m "
                f"at t = 0 near ({', '.join(f'{x:.4g}' for x in place)}): move one, "
                "by its shape or displacement"
            )

    def faces(self, body: int, surfaces: Sequence[str] | None) -> tuple[Boundary, Floats, Any]:
        """Outside, places of its nodes, and which of its faces may strike."""
        part = self.parts[body]
        solid, outside = part.solid, part.outside
        cuts = [s.surface for s in solid.all_supports if s.mirrors]
        asked = ~outside.on([*cuts, "axis"])
        chosen = surfaces or solid.contact_surfaces
        if chosen is not None:
            for name in chosen:
                if name not in outside.names:
                    text = f"contact.between = {show(f'{solid.name}/{name}')}: the body has no "
                    text += f"surface {show(name)}; {meant(name, outside.names)}"
                    raise SceneError(text)
            asked &= outside.on(chosen)
        if part.regions:
            asked &= ~part.joined[outside.faces].any(axis=1)
            if not asked.any():
                text = f": joints hold all faces of {solid.name} that may strike others; give a "
                raise KeyedError("joint", "radius", text + "smaller one, or finer elements.")
        return outside, part.places, asked

    @cached_property
    def struck(self) -> Mapping[int, Side]:
        """Faces that bodies without meshes may strike, by the place of the solid."""
        return strike(self)

    @property
    def ball_meetings(self) -> tuple[BallMeeting, ...]:
        """Meetings of other pairs with a body without a mesh (collective at the first use).

        Raises:
            SceneError: Two bodies cannot meet, or overlap at t = 0.
        """
        return self._balls[0]

    @property
    def crowd(self) -> Crowded:
        """Pairs of which both are single balls (collective and raising likewise)."""
        return self._balls[1]

    @cached_property
    def _balls(self) -> tuple[tuple[BallMeeting, ...], Crowded]:
        counts = [len(numbers) for numbers in self.numbers]
        counts += [len(bodies.radius) for bodies in self.few]
        offsets = np.cumsum([0, *counts]).tolist()
        crowd, kinds = crowded(self, offsets)
        found = ball_meetings(self, offsets, kinds)
        crowd = crowd.behind(found)
        several = tuple(met for met in found if met.single is None)
        if found or len(crowd):
            places = self.contact_places
            check_crowd(crowd, places)
            check_apart(several, places)
        return several, crowd

    @property
    def contact_places(self) -> Floats:
        """Places of the contact nodes of all bodies at t = 0 [m], (nodes, dim) (collective)."""
        systems = [(part.system, self.surface(k)) for k, part in enumerate(self.parts)]
        places = [on.gather(s.positions.ravel() + s.displacement) for s, on in systems]
        return np.concatenate([*places, places_of(self.few)] if self.few else places)

    @cached_property
    def obstacle_meetings(self) -> tuple[ObstacleMeeting, ...]:
        """Meetings of bodies without meshes with obstacles.

        Raises:
            SceneError: A body is inside an obstacle at t = 0.
        """
        return tuple(obstacle_meetings(self))

    @cached_property
    def joints(self) -> Joints | None:
        """What holds its bodies together (collective at the first use).

        Raises:
            SceneError: Bodies part in a joint at t = 0, or a surface is none that can be held.
        """
        if not self.scene.couplings:
            return None
        ties = self.parts[0].ties.places if self.scene.ties else {}
        return joints_of(self.scene, [*self.tips, *self.few], ties)

    @cached_property
    def tips(self) -> tuple[Tips, ...]:
        """What joints hold of each solid (collective likewise)."""
        return tuple(map(tips_of, self.parts))

    @property
    def names(self) -> tuple[str, ...]:
        """Of all bodies, in the order in which they are marched."""
        solids = (part.solid.name for part in self.parts)
        return (*solids, *(name for bodies in self.few for name in bodies.names))

    @property
    def masses(self) -> dict[str, tuple[float, Floats]]:
        """Mass [kg] and centre at t = 0 [m], (dim,), of all bodies as they are marched."""
        each = [(part.system.total_mass, part.system.center_of_mass) for part in self.parts]
        for bodies in self.few:
            each += list(zip(bodies.masses, bodies.centers, strict=True))
        return dict(zip(self.names, each, strict=True))

    @property
    def speeds(self) -> Floats:
        """Mean velocities of all bodies at t = 0 [m/s], (bodies, dim) (collective)."""
        found = [part.system.mean(part.system.velocity) for part in self.parts]
        return np.array([*found, *(speed for bodies in self.few for speed in bodies.speeds)])

    @property
    def dim(self) -> int:
        """Number of coordinates."""
        return self.scene.dim

    @cached_property
    def numbers(self) -> tuple[Integers, ...]:
        """Canonical numbers of the contact nodes of each body, increasing."""
        found = []
        for k, part in enumerate(self.parts):
            sets = [np.zeros(0, dtype=np.int64)]
            if part.contact is not None:
                sets.append(part.contact.numbers)
            sets += [
                part.outside.numbers[pair.nodes[side]]
                for pair in self.pairs
                for side in (0, 1)
                if pair.bodies[side] == k
            ]
            if k in self.struck:
                sets.append(part.outside.numbers[self.struck[k].nodes])
            found.append(np.unique(np.concatenate(sets)))
        return tuple(found)

    @cached_property
    def starts(self) -> Integers:
        """Where the nodes of each body begin among those of all; their number, (bodies + 1,)."""
        return np.cumsum([0, *(part.mesh.num_nodes for part in self.parts)])

    @property
    def own_numbers(self) -> Integers:
        """Canonical numbers, body after body, of the nodes that this rank owns."""
        each = zip(self.parts, self.starts, strict=False)
        none = np.zeros(0, dtype=np.int64)
        return np.concatenate([none, *(part.system.numbers + start for part, start in each)])

    def surface(self, body: int) -> SurfaceNodes:
        """Contact nodes of a body on this rank."""
        part = self.parts[body]
        return SurfaceNodes.of(self.comm, part.solid.dim, self.numbers[body], part.system.numbers)

    def beside(self, scene: Scene, *, later: bool = False) -> "SolidsModel":
        """The same bodies with other numbers, on the meshes of these (collective).

        Args:
            scene: The other scene, whose solids have the same kinds of shapes and elements.
            later: Whether it goes on from this one.

        Raises:
            SceneError: They have not.
        """
        parts: list[SolidPart] = []
        ties = Ties(scene)
        for part, solid in zip(self.parts, scene.solids, strict=True):
            mesh = morphed(part.mesh, part.solid, solid)
            first = part if later else None
            other = SolidPart(self.comm, scene, solid, part.degree, mesh, ties, first)
            parts.append(ties.add(other))
        return _on_their_way(scene, tuple(parts), self.updated)

    @cached_property
    def contact_count(self) -> int:
        """Number of gaps."""
        obstacles = sum(part.contact.count for part in self.parts if part.contact is not None)
        obstacles += sum(len(met.nodes) for met in self.obstacle_meetings)
        balls = sum(met.pair.count for met in self.ball_meetings)
        return obstacles + balls + len(self.crowd) + sum(pair.count for pair in self.pairs)

    def takes_iterates(self, method: str, active_set: str) -> bool:
        """Whether steps are solved by iterates: as bodies ask for, and for pairs that follow.

        These change what a layer's answer is made of: where it is linear in the forces, energy and
        angular momentum are kept to the size of faces only.
        """
        if self.scene.iterated:
            return True
        follow = SOLID_SCHEMES[method].holds and self.updated and not self.few
        # Joints hold solids in linear steps only; contacts that give way are left to these too.
        follow = follow and not (self.scene.gives_way or self.scene.couplings)
        return follow and active_set != "snes_vi" and bool(self.pairs)

    @property
    def unknowns(self) -> int:
        """Displacement components of all bodies."""
        few = sum(len(bodies.position) for bodies in self.few)
        return few + sum(part.system.num_dofs for part in self.parts)


def solids_model(scene: Scene, degrees: Sequence[int], *, updated: bool = False) -> SolidsModel:
    """Mesh the solids of a scene (collective); the last model is kept for plan and run to share.

    Raises:
        MeshError: A mesh cannot be made, or does not fit the scene.
        MissingDependencyError: DOLFINx or Gmsh is not installed.
    """
    return _model(SceneKey(scene), tuple(degrees), updated)


@lru_cache(maxsize=1)
def _model(key: SceneKey, degrees: tuple[int, ...], updated: bool) -> SolidsModel:  # hashed
    return _on_their_way(key.scene, _parts(key, degrees), updated)


def _on_their_way(scene: Scene, parts: tuple[SolidPart, ...], updated: bool) -> SolidsModel:
    """The model of a scene, its attached masses as fast as what carries them (collective)."""
    model = SolidsModel(MPI.COMM_WORLD, scene, parts, updated, few_bodies(scene))
    if masses := [body for body in scene.bodies if isinstance(body, Attached)]:
        set_out(model, masses)
    return model


@lru_cache(maxsize=1)
def _parts(key: SceneKey, degrees: tuple[int, ...]) -> tuple[SolidPart, ...]:
    """The bodies, meshed once for pairs that are fixed and for those that follow."""
    scene, comm = key.scene, MPI.COMM_WORLD
    folder = scene.folder or Path()
    # A list with a name outlives an error of a later body. What a comprehension had found would be
    # freed while the error is under way, which mpi4py's locks of communicators do not survive.
    parts: list[SolidPart] = []
    ties = Ties(scene)
    for solid, degree in zip(scene.solids, degrees, strict=True):
        mesh = build_body_mesh(comm, solid, degree, folder)
        parts.append(ties.add(SolidPart(comm, scene, solid, degree, mesh, ties)))
    return tuple(parts)
