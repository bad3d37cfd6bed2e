"""Numbers of a scene and their derivatives by its parameters, with the plan of the start kept."""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError, SceneError
from impactfem.inverse.bars import BarRuns
from impactfem.inverse.evaluations import Evaluations
from impactfem.inverse.events import EventRuns
from impactfem.inverse.layered_bars import LayeredBars
from impactfem.inverse.meshed_bars import DiscontinuousBars, MonolithicBars
from impactfem.inverse.outcomes import Outcome
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.solids import STEPPED, SolidRuns
from impactfem.inverse.steps import Changes, Slopes
from impactfem.inverse.trees import TreeRuns, is_tree
from impactfem.methods import METHODS
from impactfem.planning import Plan, plan
from impactfem.scene import Scene
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show


@dataclass(frozen=True)
class Unknown:
    """A number that varies: a parameter, or a value of a control.

    Attributes:
        name: As it is shown.
        start: As the scene has it.
        limits: Least and largest value; infinite where there are none.
        size: In which its changes are counted.
        least: Smallest size that it takes where it is near 0.
        where: The table that says it, and its key that does, for messages.
    """

    name: str
    start: float
    limits: tuple[float, float]
    size: float
    least: float
    where: tuple[str, str]


def unknowns(scene: Scene) -> tuple[Unknown, ...]:
    """What varies in a scene: its parameters, then the values of its controls."""
    found = []
    for k, each in enumerate(scene.parameters):
        start, where = float(each.start or 0.0), (f"parameter[{k}]", "key" if each.path else "name")
        size = max(abs(start), 1e-2 * _width(each.limits)) or 1.0
        found.append(Unknown(each.name, start, each.limits, size, 1e-2 * size, where))
    for k, control in enumerate(scene.controls):
        largest = max(map(abs, control.values))
        size, where = max(largest, 0.5 * _width(control.limits)) or 1.0, (f"control[{k}]", "name")
        found += [
            Unknown(
                f"{control.name}.{i}", value, control.limits, size, size, (f"control[{k}]", "name")
            )
            for i, value in enumerate(control.values)
        ]
    return tuple(found)


def _width(limits: tuple[float, float]) -> float:
    """Of limits, 0 where there are none."""
    return limits[1] - limits[0] if np.isfinite(limits).all() else 0.0


class Runs(Protocol):
    """Runs of a scene by one method."""

    def outcome(self, scene: Scene, times: Floats) -> Outcome:
        """A run, known at some times."""
        ...

    def jacobian(self, changes: Changes, quantities: Quantities) -> Slopes:
        """The numbers of a run and their derivatives."""
        ...

    def reference(self, scene: Scene) -> "Runs | None":
        """Runs without the error that a mesh makes, or with less; None: there is no mesh."""
        ...


RUNS: Mapping[str, Callable[[Plan[Any], Scene], Any]] = {
    "event_driven": lambda chosen, _: EventRuns(chosen),
    "exact": lambda chosen, _: BarRuns(chosen),
    "galerkin": LayeredBars.of,
    "monolithic": MonolithicBars.of,
    "dg": DiscontinuousBars.of,
}
"""Runs with derivatives of a plan and its scene, by method."""


_STIFFENS = re.compile(
    r"youngs_modulus|density|poisson_ratio|bulk_modulus|c10|c01|orthotropic|stiffness|materials"
    r"|shape"
)
"""Keys by which waves cross elements in less time."""


def _runs(chosen: Plan[Any], scene: Scene) -> Callable[[Plan[Any], Scene], Any] | None:
    """What makes the runs with derivatives of a plan; None if it has none that are right."""
    if is_tree(scene) and chosen.method == "event_driven":
        return TreeRuns.of
    if scene.solver == "march":
        return SolidRuns.of if chosen.method in STEPPED else None
    return RUNS.get(chosen.method)


def _known(scene: Scene) -> list[str]:
    """Methods with derivatives that know the bodies of a scene."""
    if scene.solver == "march":
        stable = [name for name in STEPPED if METHODS[name].stable == "always"]
        return list(STEPPED) if scene.solids else stable
    return [name for name in RUNS if METHODS[name].bodies & scene.kinds]


def _planned(scene: Scene) -> Plan[Any]:
    """The plan of a scene; where no method is asked for, by an exact one, or one with derivatives.

    Raises:
        SceneError: There is none.
    """
    chosen, known = plan(scene), _known(scene)
    if is_tree(scene) and scene.solve.method is None and not scene.gives_way:
        # Runs take steps, whose impacts have no slopes.
        return replace(chosen, method="event_driven")
    uniform = all(bar.has_two_waves for bar in scene.bars) and not scene.gives_way
    fitting = [name for name in known if METHODS[name].exact and uniform] or known
    stiffens = any(each.path is None or _STIFFENS.search(each.path) for each in scene.parameters)
    if stiffens or any(control.along == "x" for control in scene.controls):
        # The time step of the start is kept: that of explicit steps has a limit by wave speeds.
        fitting = [name for name in fitting if name != "explicit"]
    if scene.solve.method is None and fitting and chosen.method not in fitting:
        try:
            return plan(scene.with_settings({"solve.method": fitting[0]}))
        except SceneError as error:
            text = f"{chosen.method}, which the plan takes, has no derivatives that are right; "
            raise SceneError(f"{text}{fitting[0]} has, but {error}") from None
    return chosen


_LARGE = 0.1  # share of its size by which one is changed that has no derivative
_OF_FALL = 0.1  # share of what a search has won that new elements may take back or add
_STILL = 1e-9  # share of what is looked at that a parameter has to move


@dataclass
class Varied:
    """A scene that varies.

    Attributes:
        scene: As given.
        quantities: The numbers of its runs.
        chosen: The plan of the start, which all runs keep.
        runs: Who runs it.
        forward: How many runs there were, those beside them for derivatives not counted.
        sloped: How many of them told derivatives.
        kept: Evaluations that a search can go on from; None if they are not kept.
    """

    scene: Scene
    quantities: Quantities
    chosen: Plan[Any]
    runs: Runs
    forward: int = 0
    sloped: int = 0
    kept: Evaluations | None = None
    _last: tuple[bytes, Slopes] | None = field(default=None)

    @classmethod
    def of(cls, scene: Scene) -> "Varied":
        """A scene with its parameters, planned at their starts.

        Raises:
            SceneError: Nothing varies, nothing is wanted, or the method has no right derivatives.
        """
        if not (scene.parameters or scene.controls):
            raise SceneError(
                "parameter: nothing may vary; give a [[parameter]] with name and key, or a "
                "[[control]]"
            )
        quantities = Quantities.of(scene)
        chosen = _planned(scene)
        runs = _runs(chosen, scene)
        if runs is None:
            remedy = " or ".join(f"solve.method = {show(n)}" for n in _known(scene))
            if is_tree(scene):
                remedy = "no method: bodies and joints then go from event to event by coordinates"
            raise SceneError(
                f"solve.method = {show(chosen.method)} has no derivatives that are right: use "
                f"{remedy or 'solids, plates, points, a rod, a rigid body or a bar'}, which have"
            )
        return cls(scene, quantities, chosen, runs(chosen, scene))

    @property
    def wrinkles(self) -> bool:
        """Whether steps in contact bend what is computed, and no run is known without them."""
        return self.chosen.method in STEPPED

    @cached_property
    def unknowns(self) -> tuple[Unknown, ...]:
        """What varies."""
        return unknowns(self.scene)

    @property
    def start(self) -> Floats:
        """The unknowns as the scene has them, (P,)."""
        return np.array([each.start for each in self.unknowns], dtype=float)

    @property
    def limits(self) -> Floats:
        """Least and largest values of the unknowns, (2, P)."""
        return np.array([each.limits for each in self.unknowns], dtype=float).T

    @property
    def scales(self) -> Floats:
        """Sizes of the unknowns, (P,)."""
        return np.array([each.size for each in self.unknowns])

    def at(self, values: Floats) -> Scene:
        """The scene with other values of what varies.

        Raises:
            SceneError: It cannot be with these; the message names them.
        """
        left, known = values.tolist(), {}
        for parameter in self.scene.parameters:
            known[f"parameter.{parameter.name}.start"] = left.pop(0)
        for control in self.scene.controls:
            own, left = left[: control.count], left[control.count :]
            known[f"control.{control.name}.start"] = own
        return self.scene.with_settings(known)

    def numbers(self, values: Floats) -> Floats:
        """The numbers of the run with some parameters, (n,)."""
        self.forward += 1
        scene = self.at(values)
        return self.quantities.read(self.runs.outcome(scene, self.quantities.times), scene)

    def jacobian(self, values: Floats) -> Slopes:
        """The numbers and their derivatives by the parameters."""
        at = np.asarray(values, dtype=float)
        key = at.tobytes()
        if self._last is None or self._last[0] != key:
            found = None if self.kept is None else self.kept.find(at)
            if found is None:
                self.forward += 1
                self.sloped += 1
                sizes = np.maximum(np.abs(at), [each.least for each in self.unknowns])
                names = tuple(each.name for each in self.unknowns)
                found = self.runs.jacobian(Changes(self.at, at, sizes, names), self.quantities)
                if not np.isfinite(found.jacobian).all():
                    raise ConvergenceError(
                        "gradient: a derivative is not finite at the place that is looked at; "
                        "begin at another start"
                    )
                if self.kept is not None:
                    self.kept.add(at, found)
            self._last = key, found
        return self._last[1]

    def verified(
        self, values: Floats, told: tuple[float, float], least: float
    ) -> tuple[float, list[str]]:
        """The objective with a plan of its own, and doubts where that tells another one.

        Args:
            values: The answer (P,).
            told: The objective at the start and at the answer, as the search has them.
            least: By how much plans of one mesh may differ; new elements by a share of the fall.
        """
        scene, (first, last) = self.at(values), told
        other = replace(self, scene=scene, chosen=_planned(scene), kept=None, _last=None)
        runs = _runs(other.chosen, scene)
        if runs is None:
            return float("nan"), []
        other.runs = runs(other.chosen, scene)
        found, where = other.quantities.objective(other.numbers(values)), "with a plan of its own"
        from impactfem.mesh.morph import shaped  # noqa: PLC0415  (DOLFINx)

        if any(shaped(a, b) for a, b in zip(scene.solids, self.scene.solids, strict=True)):
            least = max(least, _OF_FALL * abs(first - last))
            where = "with elements of its own, as its shape is another,"
        same = other.chosen.method != self.chosen.method or abs(found - last) <= least
        text = f"{where} the answer has the objective {found:.6g}, in the search {last:.6g}"
        return found, [] if same else [text]

    def check_moves(self, q: Floats, jacobian: Floats) -> None:
        """Refuse parameters that move nothing that is looked at, but for rounding.

        Raises:
            KeyedError: naming one.
        """
        for each in self.still(self.start, q, jacobian):
            text = f" = {show(each.name)} moves nothing that is wanted: remove it, or measure "
            raise KeyedError(*each.where, f"{text}what it moves.")

    def still(self, at: Floats, q: Floats, jacobian: Floats) -> Iterator[Unknown]:
        """Parameters and controls that move nothing of what is looked at, but for rounding."""
        moved = np.abs(jacobian * self.scales).max(axis=0)
        least = _STILL * (np.abs(q).max() + moved.max())
        moving = {each.where for k, each in enumerate(self.unknowns) if moved[k] > least}
        for k, each in enumerate(self.unknowns):
            if each.where not in moving and not self._moves(k, at, q):
                yield each
            moving.add(each.where)

    def _moves(self, k: int, at: Floats, q: Floats) -> bool:
        """Whether an unknown without derivatives, as at an optimum, moves something in a step."""
        for sign in (1.0, -1.0):
            values = at.copy()
            values[k] = np.clip(values[k] + sign * _LARGE * self.scales[k], *self.limits[:, k])
            with suppress(SceneError, ConvergenceError):
                changed = np.abs(self.numbers(values) - q).max()
                if changed > _STILL * (np.abs(q).max() + changed):
                    return True
        return False
