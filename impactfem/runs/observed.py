"""A march with everything that looks at its levels: what runs it, what its history is made of."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.marching.few import FewMidpoint
from impactfem.marching.flexible_beam import FlexibleMidpoint
from impactfem.marching.marched import Marched
from impactfem.marching.model_watch import ModelWatch
from impactfem.marching.rows import Level
from impactfem.marching.schemes import SolidScheme
from impactfem.marching.time_loop import TimeLoop
from impactfem.marching.wave_bar import WaveBar
from impactfem.models.solids import SolidsModel
from impactfem.planning import MarchNumbers
from impactfem.result.whole import Whole
from impactfem.runs.axis_watch import AxisWatch
from impactfem.runs.contact_places import ContactPlaces
from impactfem.runs.feedback import Feedback, Read, Tried
from impactfem.runs.line_bodies import bar_figures, strains
from impactfem.runs.loops import Loop
from impactfem.runs.samples import Kept, Places, chosen_places
from impactfem.runs.solid_output import Watch
from impactfem.runs.solid_probes import SolidProbes
from impactfem.scene.grammar import Held
from impactfem.system.beam_parts import BeamParts
from impactfem.system.stretches import Look, Stretches

Observer = Callable[[Level], None]


@dataclass(frozen=True)
class Observed:
    """A march and its observers.

    Attributes:
        model: The bodies.
        scheme: What marches them.
        numbers: Of the plan.
        loop: The march, its gaps, and how bodies that start at rest came there.
        limit: Least stable time step [s] of an explicit scheme.
        watch: Sees what contact lets through.
        limits: Sees rotations and strains.
        probes: Look at places.
        touching: Looks at contact forces; None where pairs have no columns.
        feedback: Samples controllers; None without any.
        beside: Whether it runs to be compared with another, which says what contact lets through.
    """

    model: SolidsModel
    scheme: SolidScheme
    numbers: MarchNumbers
    loop: Loop
    limit: float | None
    watch: Watch
    limits: ModelWatch
    probes: SolidProbes
    touching: ContactPlaces | None
    feedback: Feedback | None
    beside: bool

    @classmethod
    def of(
        cls,
        model: SolidsModel,
        few: Sequence[Marched],
        scheme: SolidScheme,
        numbers: MarchNumbers,
        loop: Loop,
        limit: float | None,
        every: int,
        places: Places | None,
    ) -> "Observed":
        """Have a march looked at; its rows get room for what that finds (collective).

        Of all others see above; ``few`` march bodies without meshes, fields are kept of every so
        many layers (0: of none), and the ways of places of bodies (None: chosen, if the error is
        estimated).

        Raises:
            SceneError: A probe is outside its body.
        """
        march, parts = loop.march, model.parts
        beside = places is not None
        limits = ModelWatch(
            {**{p.solid.name: Stretches(p.system, p.solid) for p in parts}, **_line_looks(few)},
            [*(len(p.system.constrained) for p in parts), *(0 for _ in few)],
            march.layers,
            every,
        )
        if places is None and numbers.estimate:
            places = chosen_places(model, few, march.layers)
        kept = Kept.of(places, model, few) if places else None
        joined = [loop.joined.told] if model.joints else []
        feedback = None
        if model.scene.sampled:
            feedback = Feedback(model.scene, march.interior.dt, march.layers)
        joined += [feedback.told] if feedback else []
        probes = SolidProbes.of(march, model, few, joined, kept)
        touching = ContactPlaces.of(march, loop.gaps, loop.contacts, model)
        axes = AxisWatch(model, few, loop.contacts.places, march.layers)
        watch = Watch(model, max(1, march.layers // 50), axes, all_held=loop.gaps.shares_nodes)
        looks = watch, limits, probes, touching, feedback, beside
        return cls(model, scheme, numbers, loop, limit, *looks)

    @property
    def march(self) -> TimeLoop[Any]:
        """The march."""
        return self.loop.march

    @property
    def whole(self) -> Whole:
        """What the solids are parts of; motions are told of the whole."""
        return self.numbers.whole

    def observers(self) -> list[Observer]:
        """What looks at levels, in this order."""
        found: list[Observer] = [self.limits] if self.beside else [self.watch, self.limits]
        found += [self.probes] if self.probes.names else []
        found += [self.touching] if self.touching else []
        return found + ([self._feed] if self.feedback else [])

    def _feed(self, level: Level) -> None:
        """Have controllers sampled."""
        from impactfem.runs.latest import latest  # noqa: PLC0415  (it looks at this)

        if self.feedback is None:
            return
        read = partial(latest, self, turns=self.feedback.counts_turns)
        self.feedback(level, read, partial(self._tried, read))

    def _tried(self, read: Read, held: Held, output: float, steps: int) -> Tried:
        """What an output of a controller does from t = 0 on; see `impactfem.runs.feedback.Try`."""
        from impactfem.runs.rewinding import State  # noqa: PLC0415  (it looks at this)

        march, start, found = self.march, State.of(self), []
        looks = (self.probes,) if self.probes.names else ()
        for sample in range(4):
            held.value = 0.0 if sample else output
            for _ in range(min(steps, march.layers - march.layer)):
                march.step(looks)
            found.append(read())
        start.restore(self)
        return found

    def state(self) -> dict[str, float | str]:
        """What was seen, for a checkpoint."""
        own = {} if self.feedback is None else {"feedback": self.feedback.state()}
        return self.watch.state() | {"limits": self.limits.state()} | own

    def restore(self, state: dict[str, float | str]) -> None:
        """Go on from what was seen."""
        self.watch.restore(state)
        self.limits.restore(str(state["limits"]))
        if self.feedback is not None:
            self.feedback.restore(str(state["feedback"]))


@dataclass(frozen=True)
class LineLooks:
    """Rotation and strains of a body in the march, as a watch takes them of solids.

    Attributes:
        mass: [kg].
        inertia: About its centre [kg m^2], (1, 1) or (3, 3); NaN if it is not known.
        seen: Rotation now [rad], largest strain and that which 1 % of the volume exceeds; None of
            strains that are not finite.
    """

    mass: float
    inertia: Floats
    seen: Callable[[], tuple[float, float | None, float | None]]

    def look(self, displacement: Floats, known: float = 0.0) -> Look:  # noqa: ARG002  (of solids)
        """What it is now; the watch gives what it knows of solids."""
        turned, *strained = self.seen()
        most, exceeded = (math.nan if value is None else value for value in strained)
        return Look(turned, most, max(known, exceeded), 1.0)


def _of_beam(march: FewMidpoint, parts: BeamParts) -> LineLooks:
    """Of a beam."""

    def seen() -> tuple[float, float | None, float | None]:
        position = march.coordinates
        strain, volumes = parts.fibres(position)
        return parts.turned(position), *strains(strain[None], volumes)

    return LineLooks(parts.beam.mass, parts.inertia, seen)


def _of_flexible(march: FlexibleMidpoint) -> LineLooks:
    """Of a beam that turns far; its sums tell how far."""
    bodies = march.bodies

    def seen() -> tuple[float, float | None, float | None]:
        strain, volumes = bodies.fibres(march.frames)
        return bodies.turned(march.frames), *strains(strain[None], volumes)

    return LineLooks(bodies.masses[0], bodies.about_centre, seen)


def _of_bar(march: WaveBar) -> LineLooks:
    """Of a bar, which does not turn."""

    def seen() -> tuple[float, float | None, float | None]:
        moved = march.shown.motion(0)["displacement"] @ march.bodies.axis
        found = bar_figures(march.bodies.bar, march.nodes, moved[None])
        return 0.0, found["strain_max"], found["strain_99"]

    return LineLooks(march.bodies.masses[0], np.full((1, 1), np.nan), seen)


def _line_looks(few: Sequence[Marched]) -> dict[str, LineLooks]:
    """Of the beams and bars among some bodies, by name."""
    found: dict[str, LineLooks] = {}
    for march in few:
        if isinstance(march, WaveBar):
            found[march.bodies.names[0]] = _of_bar(march)
        elif isinstance(march, FlexibleMidpoint):
            found[march.bodies.names[0]] = _of_flexible(march)
        elif isinstance(march, FewMidpoint) and march.bodies.beam is not None:
            found[march.bodies.names[0]] = _of_beam(march, march.bodies.beam)
    return found
