"""Bodies by time steps in which no impact jumps: outcomes, and their derivatives.

Steps, meshes and contact nodes are those of the start. For given sets of gaps that press, stick and
slip the motion of a step is smooth in what varies, the weight theta of its forces included, and it
is continuous where sets change if nodes that touch carry no mass or a stiffness in the gap gives
way; adhesion ends by shares of a step. So the derivatives of what is computed are those along these
sets. Impulses between nodes with mass and of joints at their limits jump from step to step: a run
with one is refused.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.errors import ConvergenceError, SceneError
from impactfem.inverse.bars import apart
from impactfem.inverse.contact_spells import Pair, rebound_row
from impactfem.inverse.outcomes import Outcome, at_times, means_at
from impactfem.inverse.pulses import rise_rate
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.steps import Changes, Slopes
from impactfem.log import Progress
from impactfem.result.table import Table
from impactfem.scene import Plate, Scene, Solid

if TYPE_CHECKING:
    from impactfem.marching.solids import SolidMarch
    from impactfem.models.solids import SolidsModel
    from impactfem.planning import MarchNumbers, Plan
    from impactfem.runs.solids import Ready

STEPPED = ("massless", "conserving", "explicit")
"""Methods whose derivatives are right: what touches without mass does not jump between steps."""

_STEPS = (1e-5, 1e-6, 1e-7)
"""Shares of an unknown between neighbours: the longest is taken within which sets stay."""

_FEW = 20  # unknowns of which both sides are looked at where sets are those of one
_MANY = 2  # numbers for each unknown, each a march backwards, that still take less than runs beside

_SHAPING = ("model", "outline", "mesh", "part", "mesh_size", "refine", "cells", "degree")
"""What makes the mesh of a solid or a plate, but for lengths by which its nodes move."""


class Marched(NamedTuple):
    """A march that has ended.

    Attributes:
        outcome: What it offers to measures.
        sets: Which gaps press and stick at each level, as bytes.
    """

    outcome: Outcome
    sets: bytes


@dataclass(frozen=True)
class SolidRuns:
    """Runs of bodies that are marched, as planned: time step and meshes stay.

    Attributes:
        chosen: The plan, with the time step of the start.
        model: The bodies of the start.
    """

    chosen: "Plan[MarchNumbers]"
    model: "SolidsModel"

    @classmethod
    def of(cls, chosen: "Plan[MarchNumbers]", scene: Scene) -> "SolidRuns":
        """On the meshes of a plan."""
        from impactfem.models.solids import solids_model  # noqa: PLC0415  (DOLFINx)
        from impactfem.runs.marched import strained  # noqa: PLC0415
        from impactfem.runs.solids import prepare  # noqa: PLC0415

        numbers = replace(chosen.numbers, estimate=False)
        scene = strained(scene, chosen)
        updated = numbers.normals == "updated"
        model = solids_model(scene, numbers.degrees, updated=updated)
        if numbers.dt is None:
            ready = prepare(scene, replace(chosen, numbers=numbers), Progress(), model=model)
            numbers = replace(numbers, dt=ready.seen.march.interior.dt, courant=None)
            ready.destroy()
        return cls(replace(chosen, numbers=numbers), model)

    def outcome(self, scene: Scene, times: Floats) -> Outcome:
        """A run, known at some times: columns are linear between levels."""
        return self.march(scene, times).outcome

    def reference(self, scene: Scene) -> None:
        """None that costs as little: finer elements are another scene."""

    def march(self, scene: Scene, times: Floats) -> Marched:
        """March a scene with the steps and meshes of the start.

        Raises:
            SceneError: Its solids have other shapes, or bodies with mass where they touch strike.
            ConvergenceError: A step did not settle.
        """
        ready = self.ready(scene)
        try:
            sets = list[Booleans]()
            ready.seen.march.run([*ready.seen.observers(), lambda _: sets.append(_sets(ready))])
            return Marched(self.told(scene, ready, times)[0], b"".join(map(_packed, sets)))
        finally:
            ready.destroy()

    def ready(self, scene: Scene) -> "Ready":
        """A march of a scene that is ready to run, on the meshes of the start."""
        from impactfem.runs.marched import strained  # noqa: PLC0415  (DOLFINx)
        from impactfem.runs.solids import prepare  # noqa: PLC0415

        own = self.model.scene
        for k, (body, other) in enumerate(zip(own.bodies, scene.bodies, strict=True)):
            for name in _SHAPING if isinstance(body, Solid | Plate) else ():
                if getattr(body, name, None) != getattr(other, name, None):
                    raise SceneError(
                        f"body[{k}].{name}: gradients keep the elements of the start; vary the "
                        f"place by the displacement of {body.name} or the point of the obstacle, "
                        "of solids also lengths of the shape (shape.size, shape.radius), by which "
                        "nodes move"
                    )
            known = [each for each in (body, other) if hasattr(each, "theory_beside")]
            theories = [each.theory_beside(scene.bodies) for each in known]
            if len({*theories}) > 1:
                raise SceneError(
                    f"body[{k}].theory: {body.name} passes from {' to '.join(theories)} as its "
                    "thickness varies, which no derivative crosses: give one of them"
                )
        if scene.ends:
            raise SceneError(
                "supports.until: no derivative is known across the time at which a support lets "
                "go; remove it, or let the duration end there"
            )
        scene = strained(_plain(scene), self.chosen)
        return prepare(scene, self.chosen, Progress(), model=self.model.beside(scene))

    def told(self, scene: Scene, ready: "Ready", times: Floats) -> tuple[Outcome, dict[str, Pair]]:
        """What is known of a march at some times, and what its pairs did."""
        from impactfem.marching.newton_march import NewtonMarch  # noqa: PLC0415  (DOLFINx)
        from impactfem.runs.solid_rows import solids_motion  # noqa: PLC0415

        seen = ready.seen
        motion = solids_motion(seen)
        if not motion.is_finite or len(motion.history["time"].values) <= seen.march.layers:
            raise ConvergenceError("the motion is no longer finite; take smaller steps or loads")
        history, whole = motion.history, seen.whole
        _check_jumps(ready, history)
        levels = np.asarray(history["time"].values)
        march, iterated = seen.march, isinstance(seen.march, NewtonMarch)
        pairs = {
            name: Pair.of(name, history, march.tolerance, by_force=iterated) for name in march.pairs
        }

        def of(values: Callable[[Pair], Any]) -> dict[str, Any]:
            return {name: values(pair) for name, pair in pairs.items()}

        def rebound(name: str) -> float:
            row = rebound_row(name, scene, pairs, seen.march.layers)
            speeds = (history.get(f"{name}.v{axis}") for axis in "xyz")
            speed = np.linalg.norm([each.values[row] for each in speeds if each is not None])
            return float(speed) if row else float("nan")

        outcome = Outcome(
            at_times(history, times),
            of(lambda pair: np.interp(times, levels, pair.impulse)),
            of(lambda pair: pair.duration),
            {name: rebound(name) for name in seen.model.names},
            {name: whole.factor * mass for name, (mass, _) in seen.model.masses.items()},
            np.interp(times, levels, _driven(ready)),
            of(lambda pair: float(pair.force.max(initial=0.0))),
            of(lambda pair: pair.begin),
            of(lambda pair: rise_rate(levels, pair.begin, pair.force[1:])),
            means_at(history, times),
        )
        return outcome, pairs

    def jacobian(self, changes: Changes, quantities: Quantities) -> Slopes:
        """Numbers of a run and their derivatives, along the sets of its steps.

        By the steps backwards where numbers are few, whatever varies of loads, starts, places and
        materials; of other unknowns, and where steps are not known backwards, by runs beside it.
        """
        beside = _Beside(self, changes, quantities)
        if quantities.count > _MANY * len(changes.values):
            return beside.slopes()
        numbers, found, weak = self._backwards(changes, quantities)
        if found is None or (weak and len(changes.values) <= _FEW):
            return beside.slopes()
        slopes, known = found
        margin = 0.0 if weak else float("inf")  # sets that are those of one side
        if not known.all():
            rest = _Beside(self, changes.some(~known), quantities).slopes()
            below, above = slopes.copy(), slopes.copy()
            below[:, ~known], above[:, ~known] = rest.sides or (rest.jacobian, rest.jacobian)
            slopes = 0.5 * (below + above)
            if rest.sides is not None:
                return Slopes(numbers, slopes, [], 0.0, (below, above))
        return Slopes(numbers, slopes, [], margin)

    def _backwards(
        self, changes: Changes, quantities: Quantities
    ) -> tuple[Floats, tuple[Floats, Booleans] | None, bool]:
        """Numbers and their derivatives by a march backwards; None where it is not known.

        And whether sets are those of one side.
        """
        from impactfem.inverse.solid_adjoints import (  # noqa: PLC0415
            Adjoints,
            reversible,
            varies_materials,
        )
        from impactfem.inverse.solid_readings import Kept  # noqa: PLC0415
        from impactfem.marching.reversed_march import Trail  # noqa: PLC0415  (DOLFINx)

        scene, kinds = changes.scene, (Kept, Adjoints)
        if not scene.solids:
            from impactfem.inverse.plate_adjoints import PlateAdjoints, PlateKept  # noqa: PLC0415

            kinds = PlateKept, PlateAdjoints
        ready = self.ready(scene)
        try:
            if not reversible(ready):
                return np.zeros(0), None, False
            march = cast("SolidMarch", ready.seen.march)
            whole = varies_materials(changes)
            kept = kinds[0](Trail.of(march, whole=whole), quantities.times)
            ready.seen.march.run([*ready.seen.observers(), kept])
            outcome, pairs = self.told(scene, ready, quantities.times)
            numbers = quantities.read(outcome, scene)
            adjoints = kinds[1](self, changes, quantities, ready, kept, pairs)
            return numbers, adjoints.jacobian(), kept.trail.weak
        finally:
            ready.destroy()


def _check_jumps(ready: "Ready", history: Table) -> None:
    """Refuse impulses between nodes with mass, and those of joints at their limits.

    Raises:
        SceneError: There are some.
    """
    jumps = "jumps from step to step as a parameter changes: steps have no right derivative"
    for name, column in history.items():
        kind, _, pair = name.partition(".")
        if kind == "impulse" and np.any(column.values):
            raise SceneError(
                f"contact {pair}: both have mass where they touch, and an impact {jumps}; give its "
                "[[contact]] a stiffness, in whose force it takes some 20 steps"
            )
    for joint, (low, high) in _limits(ready):
        places, rates = history.get(f"{joint}.q"), history.get(f"{joint}.v")
        if places is None or rates is None:
            continue
        step = float(np.abs(rates.values).max()) * ready.seen.march.interior.dt
        if min(places.values.min() - low, high - places.values.max()) <= step:
            raise SceneError(
                f"joint {joint} comes to its limits, {low:.6g} to {high:.6g}, where it {jumps}; "
                "widen them, or stop it by a motor that pushes back"
            )


def _limits(ready: "Ready") -> Iterator[tuple[str, tuple[float, float]]]:
    """Joints with limits, and these."""
    from impactfem.system.mechanism import Arm  # noqa: PLC0415  (loads SciPy)

    for joint in ready.scene.joints:
        if joint.limits is not None:
            yield joint.name, (joint.limits[0], joint.limits[1])
    for bodies in ready.seen.model.few:
        if isinstance(bodies, Arm):
            for name, at in bodies.tree.single.items():
                ends = float(bodies.joints.lower[at]), float(bodies.joints.upper[at])
                yield f"{bodies.names[0]}.{name}", ends


def _plain(scene: Scene) -> Scene:
    """Without fields, which nobody looks at."""
    return scene.with_settings({"output.fields": []}) if scene.output.fields else scene


def _sets(ready: "Ready") -> Booleans:
    return ready.seen.march.sets


def _packed(sets: Booleans) -> bytes:
    """Sets of a level as bytes, which change where a number of gaps does, too."""
    return len(sets).to_bytes(4, "big") + np.packbits(sets).tobytes()


class _Beside:
    """Runs beside a run, and differences over them.

    Args:
        runs: Who runs.
        changes: The place, and the sizes of steps.
        quantities: The numbers.
    """

    def __init__(self, runs: SolidRuns, changes: Changes, quantities: Quantities) -> None:
        self._runs, self._changes, self._quantities = runs, changes, quantities
        self._refused = ""

    @cached_property
    def _base(self) -> tuple[Floats, bytes]:
        return self._at(self._changes.values)

    @property
    def numbers(self) -> Floats:
        """Of the run itself."""
        return self._base[0]

    def _at(self, values: Floats) -> tuple[Floats, bytes]:
        scene = self._changes.at(values)
        found = self._runs.march(scene, self._quantities.times)
        return self._quantities.read(found.outcome, scene), found.sets

    def slopes(self) -> Slopes:
        """Numbers and their derivatives.

        Raises:
            SceneError: There is no scene on either side of an unknown.
        """
        count = len(self._changes.values)
        below, above = np.zeros((2, len(self.numbers), count))
        for k in range(count):
            below[:, k], above[:, k] = self._sides(k)
        return Slopes.of_sides(self.numbers, below, above, kinked=apart([below, above]))

    def _sides(self, k: int) -> tuple[Floats, Floats]:
        """Derivatives below and above an unknown, twice the same where sets stay on both sides."""
        for step in _STEPS:
            low, high = self._beside(k, -step), self._beside(k, step)
            if low is None or high is None:
                break
            if low[1] == high[1] == self._base[1]:
                slope = (high[0] - low[0]) / (2.0 * step * self._changes.scales[k])
                return slope, slope
        sides = [self._one_sided(k, sign) for sign in (-1.0, 1.0)]
        known = [side for side in sides if side is not None]
        if not known:
            name = self._changes.names[k]
            raise SceneError(
                f"{name}: there is no scene beside its value, so no derivative: {self._refused}"
            )
        return known[0], known[-1]

    def _one_sided(self, k: int, sign: float) -> Floats | None:
        """Derivative on a side, along the sets that are there next to the place; None: no scene.

        Over the longest step that has those of its half, of second order.
        """
        slope = None
        for step in _STEPS:
            h, far = sign * step * self._changes.scales[k], self._beside(k, sign * step)
            near = self._beside(k, 0.5 * sign * step)
            if far is None or near is None:
                break
            slope = np.asarray((4.0 * near[0] - far[0] - 3.0 * self.numbers) / h)
            if far[1] == near[1]:
                break
        return slope

    def _beside(self, k: int, share: float) -> tuple[Floats, bytes] | None:
        """Numbers and sets of a neighbour; None where there is none."""
        values = self._changes.values.copy()
        values[k] += share * self._changes.scales[k]
        try:
            return self._at(values)
        except SceneError as error:
            self._refused = str(error)
            return None


def _driven(ready: "Ready") -> Floats:
    """Work of tractions, pressures and supports up to each level [J], (levels,)."""
    from impactfem.marching.collect import total  # noqa: PLC0415  (DOLFINx)

    seen = ready.seen
    each = total(seen.model.comm, seen.march.rows.sums)
    return np.asarray(seen.whole.factor * np.cumsum(each[:, :, 2].sum(axis=1)))
