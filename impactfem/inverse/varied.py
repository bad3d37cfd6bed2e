"""Numbers of a scene and their derivatives by its parameters, with the plan of the start kept."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import SceneError
from impactfem.inverse.bars import BarRuns
from impactfem.inverse.events import EventRuns
from impactfem.inverse.outcomes import Outcome
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.steps import Changes, Slopes
from impactfem.methods import METHODS
from impactfem.planning import Plan, plan
from impactfem.scene import Parameter, Scene
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

Floats = NDArray[np.float64]


class Runs(Protocol):
    """Runs of a scene by one method."""

    def outcome(self, scene: Scene, times: Floats) -> Outcome:
        """A run, known at some times."""
        ...

    def jacobian(self, changes: Changes, quantities: Quantities) -> Slopes:
        """The numbers of a run and their derivatives."""
        ...


RUNS: Mapping[str, Any] = {"event_driven": EventRuns, "exact": BarRuns}
"""What has derivatives, by method."""

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
    """

    scene: Scene
    quantities: Quantities
    chosen: Plan[Any]
    runs: Runs
    forward: int = 0
    sloped: int = 0
    _last: tuple[bytes, Slopes] | None = field(default=None)

    @classmethod
    def of(cls, scene: Scene) -> "Varied":
        """A scene with its parameters, planned at their starts.

        Raises:
            SceneError: Nothing varies, nothing is wanted, or the method has no right derivatives.
        """
        if not scene.parameters:
            raise SceneError("parameter: nothing may vary; give a [[parameter]] with name and key")
        quantities = Quantities.of(scene)
        chosen = plan(scene)
        if chosen.method not in RUNS:
            known = [n for n in RUNS if METHODS[n].bodies & scene.kinds]
            remedy = " or ".join(f"solve.method = {show(n)}" for n in known)
            raise SceneError(
                f"solve.method = {show(chosen.method)} has no derivatives that are right: use "
                f"{remedy or 'points, one rod, one rigid body or one bar'}, which have"
            )
        return cls(scene, quantities, chosen, RUNS[chosen.method](chosen))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """What varies."""
        return self.scene.parameters

    @property
    def start(self) -> Floats:
        """The parameters as the scene has them, (P,)."""
        return np.array([parameter.start for parameter in self.parameters], dtype=float)

    @property
    def scales(self) -> Floats:
        """Sizes of the parameters: of their starts, else of their bounds, (P,)."""
        found = np.abs(self.start)
        for k, parameter in enumerate(self.parameters):
            if parameter.bounds is not None:
                found[k] = max(found[k], 1e-2 * (parameter.bounds[1] - parameter.bounds[0]))
        return np.where(found > 0.0, found, 1.0)

    def at(self, values: Floats) -> Scene:
        """The scene with other parameters.

        Raises:
            SceneError: It cannot be with these; the message names them.
        """
        settings = {
            f"parameter.{parameter.name}.start": float(value)
            for parameter, value in zip(self.parameters, values, strict=True)
        }
        return self.scene.with_settings(settings)

    def numbers(self, values: Floats) -> Floats:
        """The numbers of the run with some parameters, (n,)."""
        self.forward += 1
        scene = self.at(values)
        return self.quantities.read(self.runs.outcome(scene, self.quantities.times))

    def jacobian(self, values: Floats) -> Slopes:
        """The numbers and their derivatives by the parameters."""
        key = np.asarray(values, dtype=float).tobytes()
        if self._last is None or self._last[0] != key:
            self.forward += 1
            self.sloped += 1
            changes = Changes.of(self.at, np.asarray(values, dtype=float), self.scales)
            self._last = key, self.runs.jacobian(changes, self.quantities)
        return self._last[1]

    def verified(self, values: Floats) -> tuple[float, Plan[Any]]:
        """The objective with a plan of its own, and that plan."""
        scene = self.at(values)
        other = replace(self, scene=scene, chosen=plan(scene), _last=None)
        if other.chosen.method not in RUNS:
            return float("nan"), other.chosen
        other.runs = RUNS[other.chosen.method](other.chosen)
        return other.quantities.objective(other.numbers(values)), other.chosen

    def check_moves(self, q: Floats, jacobian: Floats) -> None:
        """Refuse parameters that move nothing that is looked at, but for rounding.

        Raises:
            KeyedError: naming one.
        """
        moved = np.abs(jacobian * self.scales).max(axis=0)
        for k, parameter in enumerate(self.parameters):
            if moved[k] <= _STILL * (np.abs(q).max() + moved.max()):
                text = f" = {show(parameter.path or parameter.name)} moves nothing that is wanted: "
                raise KeyedError(
                    f"parameter[{k}]", "key" if parameter.path else "name",
                    f"{text}remove it, or measure what it moves.",
                )  # fmt: skip
