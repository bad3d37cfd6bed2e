"""All gaps of a march in their order, and the laws of the scene for each of them."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.adhesion import Bonds
from impactfem.contact.ball_crowd import BallCrowd, NearPairs
from impactfem.contact.body_pairs import SurfacePair
from impactfem.contact.faces import Faces
from impactfem.contact.friction_many import Accuracy
from impactfem.contact.gaps import Gaps, Started, Touching
from impactfem.contact.meeting import Meet
from impactfem.contact.pairs import PairGaps
from impactfem.contact.speed_law import SpeedLaws
from impactfem.contact.springs import ContactSprings
from impactfem.marching.rubbing import Friction
from impactfem.models.ball_contacts import places_of
from impactfem.models.solids import SolidsModel
from impactfem.result.history import MOST_PAIRS
from impactfem.scene import Contact, Scene
from impactfem.scene.pairing import law_of, pair_name
from impactfem.system.surface import SurfaceNodes

Names = tuple[str, str]


@dataclass(frozen=True)
class Beside:
    """Nodes of a part beside obstacles.

    Attributes:
        part: Place of the part in the march.
        nodes: Its contact nodes with a gap, (gaps,).
        gaps: Of these.
        names: Body and obstacle of each gap at t = 0.
        areas: Of the nodes [m^2], 1 of those that touch at a single place, (gaps,).
    """

    part: int
    nodes: Integers
    gaps: Gaps
    names: tuple[Names, ...]
    areas: Floats


@dataclass(frozen=True)
class Between:
    """Bodies that may meet: names of pairs, bodies of each gap, and the gaps.

    Gaps that are lent have one law, and bodies that have it.
    """

    labels: tuple[str, ...]
    names: tuple[Names, ...]
    meet: Meet

    @classmethod
    def two(cls, label: str, names: Names, meet: Meet, count: int) -> "Between":
        """Of two bodies with several gaps."""
        return cls((label,) * count, (names,) * count, meet)


@dataclass(frozen=True)
class Contacts:
    """Gaps to obstacles, then gaps between bodies.

    Attributes:
        obstacles: Of each part that can touch obstacles.
        pairs: Of bodies that can meet.
        owns: Where the contact nodes of each part are.
        places: Of the contact nodes, undeformed [m], (nodes, dim).
        initial: Their displacement at t = 0 [m], (nodes, dim).
        faces: Nodes that touch on faces; None without any.
    """

    obstacles: tuple[Beside, ...]
    pairs: tuple[Between, ...]
    owns: tuple[slice, ...]
    places: Floats
    initial: Floats
    faces: Faces | None = None

    @classmethod
    def of(
        cls,
        model: SolidsModel,
        surfaces: Sequence[SurfaceNodes],
        offsets: Sequence[int],
    ) -> "Contacts":
        """All contacts of some bodies.

        Args:
            model: The bodies.
            surfaces: Contact nodes of the solids on this rank.
            offsets: Where the contact nodes of each part of the march begin, and their number.

        Raises:
            SceneError: Bodies overlap at t = 0, or cannot meet.
        """
        solids = list(zip(model.parts, surfaces, strict=True))
        places = [surface.gather(part.system.positions.ravel()) for part, surface in solids]
        initial = [surface.gather(part.begun) for part, surface in solids]
        if model.few:
            places.append(places_of(model.few))
            initial.append(np.zeros_like(places[-1]))
        joined = np.concatenate(places), np.concatenate(initial)
        obstacles = []
        for k, (part, surface) in enumerate(solids):
            if part.contact is not None:
                contact: Touching = part.contact
                at, nodes, against = np.arange(part.contact.count), None, list(part.obstacles)
                several = [piece for obstacle in against for piece in obstacle.parts()]
                # What is linearised at t = 0 goes on for ever, as planes do.
                exact = model.updated or all(piece.plane is not None for piece in several)
                if exact and len(several) > 1:
                    against = several
                    nodes, contact = Started.to_each(contact, against, part.reach.distance)
                    at = nodes
                chosen = np.searchsorted(model.numbers[k], part.contact.numbers)[at]
                moved = surface.gather(part.begun)[chosen]
                name = part.solid.name
                pairs = [pair_name(model.scene, name, o.name) for o in against]
                gaps = Gaps(
                    against, contact, moved, updated=model.updated, pairs=pairs, nodes=nodes
                )
                each = [(name, against[i].name) for i in contact.obstacle]
                chosen, areas = chosen.astype(np.int64), part.contact.area[at]
                obstacles.append(Beside(k, chosen, gaps, tuple(each), areas))
        for met in model.obstacle_meetings:
            each, areas = [met.names] * len(met.nodes), model.few[met.part].areas[met.nodes]
            place = len(solids) + met.part
            obstacles.append(Beside(place, met.nodes, met.gaps, tuple(each), areas))
        between = [
            Between.two(p.label, p.names, p.meeting(_rows(model, offsets, p), offsets[-1]), p.count)
            for p in model.pairs
        ]
        shared = [np.zeros(len(each), dtype=np.int64) for each in places[: len(solids)]]
        shared += [bodies.shared for bodies in model.few]
        between += [
            Between.two(met.label, met.names, met.pair, met.pair.count)
            for met in model.ball_meetings
        ]
        if count := len(model.crowd):
            crowd = BallCrowd.of(model.crowd.ends, model.crowd.radii, np.concatenate(shared))
            meet: Meet = crowd
            labels, names = model.crowd.labels, tuple(model.crowd.names)
            if count > MOST_PAIRS and crowd.room_near < count and _alike(model, names):
                meet, names = NearPairs(crowd), names[: crowd.room_near]
            between.append(Between(labels, names, meet))
        owns = tuple(slice(*ends) for ends in pairwise(offsets))
        faces = None
        if any(len(bodies.faces[0]) for bodies in model.few):
            starts = offsets[len(solids) : -1]
            each_side = zip(*(bodies.faces for bodies in model.few), strict=True)
            faces = Faces(
                *(np.concatenate([at + s for at, s in zip(side, starts, strict=True)])
                  for side in each_side)
            )  # fmt: skip
        return cls(tuple(obstacles), tuple(between), owns, *joined, faces)

    def gaps(self) -> PairGaps:
        """The gaps, in the order of `names`."""
        obstacles = [(self.owns[each.part], each.nodes, each.gaps) for each in self.obstacles]
        meets = [pair.meet for pair in self.pairs]
        labels = [label for pair in self.pairs for label in pair.labels]
        return PairGaps(self.places, self.initial, obstacles, meets, labels, self.faces)

    def split(self, solids: Collection[str]) -> tuple["Contacts", "Contacts"]:
        """Those of some bodies, and the others."""
        sides = [each for each in self.obstacles if each.names]  # of what may touch something
        first, second = (
            replace(
                self,
                obstacles=tuple(e for e in sides if (e.names[0][0] in solids) == own),
                pairs=tuple(
                    p for p in self.pairs if any({*both} & {*solids} for both in p.names) == own
                ),
            )
            for own in (True, False)
        )
        return first, second

    @property
    def names(self) -> tuple[Names, ...]:
        """Bodies, or body and obstacle, of each gap."""
        found = [names for each in self.obstacles for names in each.names]
        return (*found, *(names for pair in self.pairs for names in pair.names))

    def friction(self, scene: Scene, tolerance: float, most: int) -> Friction | None:
        """Coulomb's law in the gaps; None without friction.

        Args:
            scene: Its laws.
            tolerance: Rounding level of places [m].
            most: Limit of linear systems of a layer.
        """
        found = self._each(scene, lambda law: law.friction_coefficient)
        if not found.any():
            return None
        return Friction(
            found,
            tolerance,
            most,
            rebound=self._each(scene, lambda law: law.tangential_restitution),
            static=self._each(scene, lambda law: law.sticking),
            rolling=self._each(scene, lambda law: law.rolling_resistance),
            spinning=self._each(scene, lambda law: law.spinning_resistance),
            accuracy=Accuracy(scene.solve.friction_residual),
        )

    def restitution(self, scene: Scene) -> Floats | None:
        """Newton's e of the gaps; None if it is 0 everywhere."""
        found = self._numbers(scene)
        return found if found.any() else None

    def _numbers(self, scene: Scene) -> Floats:
        """Restitution of speeds that the scene gives, (gaps,)."""
        return self._each(scene, lambda law: 0.0 if law.by_impulses else law.restitution)

    def speed_laws(self, scene: Scene) -> SpeedLaws | None:
        """Restitution by the speed of approach; None if numbers tell it everywhere."""
        each = ((law.restitution_law or "", law.by_speed) for law in scene.contacts)
        laws = {name: law.of_speed for name, law in each if law is not None}
        if not laws:
            return None
        place = {name: 1.0 + k for k, name in enumerate(laws)}
        which = self._each(scene, lambda law: place.get(law.restitution_law or "", 0.0))
        return SpeedLaws(tuple(laws.items()), which.astype(np.int64) - 1, self._numbers(scene))

    def impulsive(self, scene: Scene) -> Floats | None:
        """Poisson's e of the gaps; None if it is 0 everywhere."""
        found = self._each(scene, lambda law: law.restitution if law.by_impulses else 0.0)
        return found if found.any() else None

    def springs(self, scene: Scene) -> ContactSprings | None:
        """What gives way in the gaps; None if nothing does."""
        if not scene.gives_way:
            return None
        stiffness = self._each(scene, lambda law: law.stiffness or 0.0)
        areas = np.concatenate([np.zeros(0), *(each.areas for each in self.obstacles)])
        stiffness[: len(areas)] *= areas
        exponent = self._each(scene, lambda law: law.stiffness_exponent)
        there = stiffness > 0.0
        springs = np.where(there, stiffness, np.inf), np.where(there, exponent, 1.0)
        by_force = self._each(scene, lambda law: law.damping * (law.damping_law != "kelvin_voigt"))
        viscous = self._each(scene, lambda law: law.damping * (law.damping_law == "kelvin_voigt"))
        viscous[: len(areas)] *= areas
        return ContactSprings(*springs, (viscous, by_force) if (viscous + by_force).any() else None)

    def bonds(self, scene: Scene) -> Bonds | None:
        """What holds bodies in the gaps together that have touched; None if nothing does."""
        force = self._each(scene, lambda law: law.adhesion.force if law.adhesion else 0.0)
        energy = self._each(scene, lambda law: law.adhesion.energy if law.adhesion else 0.0)
        return Bonds(force, energy) if force.any() else None

    def _each(self, scene: Scene, value: Callable[[Contact], float]) -> Floats:
        """Values of the laws of the gaps, 0 without one, (gaps,)."""
        laws = [law_of(scene, *names) for names in self._different]
        known = np.array([0.0 if law is None else value(law) for law in laws])
        return np.asarray(known[self._which], dtype=float)

    @cached_property
    def _different(self) -> list[Names]:
        """What gaps are between, each once."""
        return list(dict.fromkeys(self.names))

    @cached_property
    def _which(self) -> Integers:
        """Which of these each gap is between, (gaps,)."""
        place = {names: k for k, names in enumerate(self._different)}
        return np.array([place[names] for names in self.names], dtype=np.int64)


def _alike(model: SolidsModel, names: Sequence[Names]) -> bool:
    """Whether one law is between all pairs."""
    if len(model.scene.contacts) <= 1:
        return True
    laws = (law_of(model.scene, *both) for both in names)
    every = ({} if law is None else law.__dict__ | {"between": ()} for law in laws)
    first = next(every)
    return all(law == first for law in every)


def _rows(model: SolidsModel, offsets: Sequence[int], pair: SurfacePair) -> list[Integers]:
    """Places of both sides' nodes of a pair among all contact nodes."""
    return [
        np.searchsorted(model.numbers[b], model.parts[b].outside.numbers[pair.nodes[side]])
        + offsets[b]
        for side, b in enumerate(pair.bodies)
    ]
