"""Points, rods and rigid bodies from event to event: outcomes and their derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.inverse.outcomes import Outcome
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.steps import Changes, Slopes
from impactfem.models.vibro import VibroModel, vibro_model
from impactfem.planning import Plan, VibroNumbers
from impactfem.result.table import Table
from impactfem.result.trajectory import Trajectory
from impactfem.runs.line_probes import vibro_probes
from impactfem.runs.vibro import settings_of, vibro_history
from impactfem.scene import Scene
from impactfem.vibro.bundles import Neighbours
from impactfem.vibro.event_contacts import Contacts
from impactfem.vibro.event_driven import EventSettings, follow
from impactfem.vibro.event_legs import Leg
from impactfem.vibro.event_record import Record
from impactfem.vibro.tangents import Tangents, tangents

_RTOL = 1e-12  # of flights: searches and checks look at small differences of runs
_STEP = 1e-5  # share of a parameter between neighbours: their square is lost beside rounding


@dataclass(frozen=True)
class EventRuns:
    """Event-driven runs as planned."""

    chosen: Plan[VibroNumbers]

    def _settings(self, scene: Scene, times: Floats) -> EventSettings:
        return self._sharp(settings_of(scene, self.chosen), times)

    @staticmethod
    def _sharp(made: EventSettings, times: Floats) -> EventSettings:
        rtol, atol = min(made.rtol, _RTOL), min(made.atol, 1e-2 * _RTOL)
        return replace(made, times=tuple(times.tolist()), rtol=rtol, atol=atol)

    def _model(self, scene: Scene) -> VibroModel:
        return vibro_model(scene)

    def _history(self, scene: Scene, model: VibroModel, motion: Trajectory) -> Table:
        return vibro_history(motion, model, vibro_probes(scene, model)(motion))

    def _followed(self, scene: Scene, model: VibroModel, times: Floats) -> tuple[Record, Contacts]:
        return follow(
            model.system, model.position, model.velocity, scene.duration,
            self._settings(scene, times), [], _edges(scene),
        )  # fmt: skip

    def outcome(self, scene: Scene, times: Floats) -> Outcome:
        """A run, known at some times."""
        model = self._model(scene)
        record, contacts = self._followed(scene, model, times)
        return self._outcome(scene, model, record.trajectory(contacts), record.legs or [])

    def jacobian(self, changes: Changes, quantities: Quantities) -> Slopes:
        """Numbers of a run and their derivatives.

        Raises:
            SceneError: A parameter begins where the model changes its kind.
            ConvergenceError: There is no derivative.
        """
        scene, times = changes.scene, quantities.times
        model = self._model(scene)
        record, contacts = self._followed(scene, model, times)
        outcome = self._outcome(scene, model, record.trajectory(contacts), record.legs or [])
        q = quantities.read(outcome, scene)
        count = len(changes.values)
        scenes: list[tuple[list[tuple[Scene, VibroModel]], Floats, Floats]] = [
            changes.neighbours(k, _STEP, lambda other: (other, _alike(self._model(other), model)))
            for k in range(count)
        ]
        neighbours = [
            Neighbours(
                tuple(m.system for _, m in made),
                tuple((m.position, m.velocity) for _, m in made), offsets, weights,
            )
            for made, offsets, weights in scenes
        ]  # fmt: skip
        found = tangents(model.system, record, neighbours, scene.duration, _edges(scene))
        slopes = np.zeros((len(q), count))
        for k, (made, offsets, weights) in enumerate(scenes):
            for (other, own), offset, weight in zip(made, offsets, weights, strict=True):
                moved = found.moved(record, own.system, k, float(offset))
                outcome = self._outcome(other, own, moved.trajectory(contacts), moved.legs or [])
                slopes[:, k] += weight * quantities.read(outcome, other)
        margin = _margin(record.legs or [], found, times, changes.scales)
        return Slopes(q, slopes, found.doubts, margin)

    def _outcome(
        self, scene: Scene, model: VibroModel, motion: Trajectory, legs: Sequence[Leg]
    ) -> Outcome:
        history = self._history(scene, model, motion)
        impulse, duration, touched = {}, {}, {}
        for k, name in enumerate(model.pairs):
            own = model.pair_of == k
            impulse[name] = np.cumsum(motion.impulse[:, own].sum(axis=1))
            touching = set(np.flatnonzero(own).tolist())
            duration[name] = sum(
                until.event.time - leg.event.time
                for leg, until in pairwise(legs)
                if touching & set(leg.closed)
            )
            touches = (leg.event.time for leg in legs if touching & _touched(leg))
            touched[name] = next(touches, float("nan"))
        names = list(model.bodies(motion.position[:1], motion.velocity[:1]))
        return Outcome(
            history, impulse, duration, _rebounds(model, legs, names),
            dict(zip(names, model.masses, strict=True)), touched=touched,
        )  # fmt: skip

    def reference(self, scene: Scene) -> None:
        """They have no error but that of their integrator."""


def _edges(scene: Scene) -> list[float]:
    """Where pieces of controls begin and end [s], though their values may be the same."""
    return [
        float(time)
        for each in scene.controls
        if each.along == "t"
        for time in each.times(scene.duration)
    ]


def _margin(legs: Sequence[Leg], found: Tangents, times: Floats, scales: Floats) -> float:
    """Change of the parameters at which an impact passes one of some times."""
    margin = float("inf")
    for leg, (late, _, _) in zip(legs, found.events, strict=True):
        moved = float(np.abs(late * scales).max(initial=0.0))
        if leg.event.strikes and moved > 0.0:
            margin = min(margin, float(np.abs(times - leg.event.time).min()) / moved)
    return margin


def _alike(made: VibroModel, model: VibroModel) -> VibroModel:
    """The model of a neighbour.

    Raises:
        SceneError: It is of another kind.
    """
    rubs = [bool(each.system.static_friction.any()) for each in (made, model)]
    if made.labels != model.labels or made.is_exact != model.is_exact or rubs[0] != rubs[1]:
        raise SceneError(
            "parameter: beside its value the scene is of another kind (friction or damping that "
            "begins at 0, contacts that come and go); start at another value"
        )
    return made


def _touched(leg: Leg) -> set[int]:
    """Constraints that an event strikes, or that are closed after it."""
    return {*leg.closed, *(row for strike in leg.event.strikes for row in strike.rows)}


def _rebounds(model: VibroModel, legs: Sequence[Leg], names: Sequence[str]) -> dict[str, float]:
    """Speeds of the centres just after the last contact of any body."""
    found: dict[str, float] = dict.fromkeys(names, float("nan"))
    last: Leg | None = None
    for before, leg in zip([None, *legs], legs, strict=False):
        if leg.event.strikes or (before is not None and set(before.closed) - set(leg.closed)):
            last = leg
    if last is not None:
        bodies: dict[str, Any] = dict(model.bodies(last.position[None], last.velocity[None]))
        found = {name: float(np.linalg.norm(bodies[name].velocity)) for name in names}
    return found
