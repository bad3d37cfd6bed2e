"""Loads, supports and obstacles that change faster than steps follow."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.findings import Finding, by_limits, percent
from impactfem.scene import Scene
from impactfem.scene.formula import Formula
from impactfem.scene.means import Within, within

if TYPE_CHECKING:
    from impactfem.system.loads import FormulaValues


DATA_CODES = ("load_unresolved",)
"""What each run looks for, whose step explicit plans do not know yet."""

_LIMIT = 0.05
"""Share of an impulse, or of a way, that steps may misplace: six steps in a period of a sine."""

_OF_ALL = 1e-3  # of the whole impulse of a load, below which a ripple on it is not told
_UNSURE = 1e-3  # of a mean
_CHUNK, _FEW = 20_000, 50  # steps that are looked at together, and where means are unsure then
_LOOKS = 2_000_000  # steps times places
_PLACES = 16
_MOST = 1_000_000  # steps that are tried
_CHEAP = 4  # parts of a step that the plan takes by itself
_HALVINGS = 10  # of a step that does not follow
_ROUNDING = 1e-9  # of places


@dataclass(frozen=True)
class Datum:
    """A formula in time.

    Attributes:
        subject: Body or obstacle.
        what: It is, in words.
        formula: In t and others.
        others: What the others are, one mapping for each place that is looked at.
        moves: Whether it is a way; else it is a load.
        but: What is lost of a load that changes within steps, though they take its mean; empty:
            nothing, as of one that makes no waves.
    """

    subject: str
    what: str
    formula: Formula
    others: Sequence[dict[str, float]] = ({},)
    moves: bool = False
    but: str = "all of it acts, but waves shorter than steps are left out"

    def missed(self, dt: float, steps: int) -> tuple[float, float, float]:
        """Share, and amount [N s, Pa s, m, rad], that steps misplace; share that means are unsure.

        Args:
            dt: Step [s].
            steps: Number of steps.
        """
        levels = dt * np.arange(steps + 1, dtype=np.float64)
        if "t" not in self.formula.used:
            return 0.0, 0.0, 0.0
        most = max(1, min(len(self.others), _LOOKS // len(levels)))
        chosen = np.linspace(0, len(self.others) - 1, most).round().astype(int)
        with np.errstate(all="ignore"):
            looks = [self._misplaced(levels, self.others[k]) for k in chosen]
        largest, scale, unsure = (max(column) for column in zip(*looks, strict=True))
        return (largest / scale if scale > 0.0 else 0.0), largest, unsure

    def _misplaced(self, levels: Floats, others: dict[str, float]) -> tuple[float, float, float]:
        """Largest amount in a step, the scale of all steps, and what is unsure, at a place."""
        unsure = np.inf
        for chunk in (_CHUNK, _FEW) if len(levels) < _CHUNK else (_CHUNK,):
            if unsure > _UNSURE:  # the fewer steps at once, the more they may be cut
                parts = range(0, len(levels) - 1, chunk)
                each = [self._of_steps(levels[k : k + chunk + 1], others) for k in parts]
                unsure = max(part[2] for part in each)
        amounts, course = (np.concatenate(parts) for parts in list(zip(*each, strict=True))[:2])
        amount = float(amounts.max(initial=0.0))
        if not self.moves:
            course = np.cumsum(np.append(0.0, course))
        # A constant load and a steady motion are followed by any step: the rest is the scale.
        whole, times = float(np.ptp(course)), np.linspace(0.0, 1.0, len(course))
        bent = course - course[0] - times * (course[-1] - course[0])
        scale = max(float(np.ptp(bent)), amount)
        floor = _OF_ALL * whole if not self.moves else _ROUNDING * float(np.abs(course).max())
        return (amount if amount > floor and self.but else 0.0), scale, unsure

    def _of_steps(self, levels: Floats, others: dict[str, float]) -> tuple[Floats, Floats, float]:
        """Amounts of each step, and its impulse; or of ways the places at its start."""
        seen: Within = within(self.formula, levels, **others)
        steps, span = len(levels) - 1, np.diff(levels)
        if not self.moves:
            mean = np.bincount(seen.of, seen.weights * seen.values, steps)
            away = seen.weights * np.abs(seen.values - mean[seen.of])
            return 0.5 * span * np.bincount(seen.of, away, steps), span * mean, seen.unsure
        at = np.asarray(self.formula(t=levels, **others), dtype=np.float64)
        share = (seen.times - levels[seen.of]) / span[seen.of]
        chord = at[seen.of] + share * np.diff(at)[seen.of]
        farthest = np.zeros(steps)
        np.maximum.at(farthest, seen.of, np.abs(seen.values - chord))
        return farthest, at[:-1], 0.0


def time_data(
    scene: Scene, systems: Sequence[Any] = (), few: Sequence[Any] = (), *, means: bool = True
) -> list[Datum]:
    """What changes in time in a scene (collective).

    Args:
        scene: The scene.
        systems: `ElasticSystem` of its solids, in their order.
        few: Systems of its bodies without meshes, of which plates have pressures.
        means: Whether steps take means of forces on bodies without waves.
    """
    return [
        *_of_obstacles(scene),
        *_of_forces(scene, "" if means else "steps look at it at single times"),
        *(each for pair in zip(scene.solids, systems, strict=False) for each in _of_solid(*pair)),
        *(each for plate in few if hasattr(plate, "plate") for each in _of_plate(plate)),
    ]


def _of_obstacles(scene: Scene) -> Iterator[Datum]:
    for obstacle in scene.obstacles:
        motion, rotation = (getattr(obstacle, name, None) for name in ("motion", "rotation"))
        for formula in motion or ():
            yield Datum(obstacle.name, f"the motion of {obstacle.name}", formula, moves=True)
        if rotation is not None:
            what = f"the rotation of {obstacle.name}"
            yield Datum(obstacle.name, what, rotation.angle, moves=True)


def _of_forces(scene: Scene, but: str) -> Iterator[Datum]:
    """On bodies without waves."""
    given = [
        (body.name, f"the {name} on {body.name}", formula)
        for body in scene.bodies
        for name in ("force", "moment")
        for formula in getattr(body, name, None) or ()
    ]
    given += [(j.name, f"the motor of {j.name}", j.motor) for j in scene.couplings if j.motor]
    for joint in scene.joints:
        for formula in joint.motion or ():
            yield Datum(joint.name, f"the motion of {joint.name}", formula, moves=True)
        if joint.is_driven:
            what = f"the position of {joint.name}"
            yield Datum(joint.name, what, joint.position, moves=True)
    for subject, what, formula in given:
        state = dict.fromkeys(formula.used - {"t"}, 1.0)
        yield Datum(subject, what, formula, (state,), but=but)


def _of_solid(solid: Any, system: Any) -> Iterator[Datum]:
    for support in solid.supports:
        what = f"the support of {support.surface!r} of {solid.name}"
        for formula in filter(None, support.value or ()):
            yield Datum(solid.name, what, formula, moves=True)
    for values in (*system.loads.varying, *system.following.values):
        yield _of_load(solid.name, values, {})


def _of_plate(plate: Any) -> Iterator[Datum]:
    for sign, values in plate.loads:
        gap = {"gap": float(np.max(plate.gap(sign, 0.0)))} if values.uses_gap else {}
        yield _of_load(plate.names[0], values, gap)


def _of_load(name: str, values: "FormulaValues", more: dict[str, float]) -> Datum:
    others = [place | more for place in values.some(_PLACES)]
    return Datum(name, f"the {values.label} of {name}", values.formula, others)


def parts_following(
    data: Sequence[Datum], duration: float, steps: int, reasons: dict[str, str]
) -> int:
    """Into how many parts a step is cut to follow what changes in time; 1 where a few do not."""
    parts = fitting_parts(data, duration / steps, steps, _CHEAP)
    if parts is None or parts == 1:
        return 1
    names = ", ".join(dict.fromkeys(datum.what for datum in data if "t" in datum.formula.used))
    reasons["dt"] = f"1/{parts} of the usual step follows what changes in time: {names}"
    return parts


def data_findings(data: Sequence[Datum], dt: float, steps: int) -> list[Finding]:
    """What changes faster than steps follow: one finding for each body or obstacle.

    Args:
        data: Formulas in time.
        dt: Step [s].
        steps: Number of steps.
    """
    worst: dict[str, tuple[float, Finding]] = {}
    for datum in data:
        share, amount, unsure = datum.missed(dt, steps)
        if unsure > _UNSURE:
            text = f"{datum.what} changes too often within a step of {dt:.2g} s for its mean to be "
            text += f"sure: two ways to find it differ by {percent(unsure)}"
            found = by_limits("load_unresolved", unsure, (_UNSURE, np.inf), text, datum.subject)
        else:
            found = by_limits(
                "load_unresolved", share, (_LIMIT, np.inf), _text(datum, dt, share, amount),
                datum.subject, _remedy(datum, dt, steps) if share > _LIMIT else "",
            )  # fmt: skip
        for each in found:
            if each.subject not in worst or worst[each.subject][0] < share:
                worst[each.subject] = share, each
    return [found for _, found in worst.values()]


def _text(datum: Datum, dt: float, share: float, amount: float) -> str:
    if datum.moves:
        text = f"{datum.what} leaves the straight path of a step of {dt:.2g} s by {amount:.2g}, "
        return f"{text}{percent(share)} of its path: what it does between time levels is not seen"
    text = f"{datum.what} changes within a step of {dt:.2g} s: {percent(share)} of its impulse "
    return f"{text}comes at another time; {datum.but}"


def _remedy(datum: Datum, dt: float, steps: int) -> str:
    parts = fitting_parts([datum], dt, steps, 2**_HALVINGS)
    if parts is None:
        return "let it change more slowly"
    return f"use solve.dt <= {float(f'{dt / parts:.2g}'):g}"


def fitting_parts(data: Sequence[Datum], dt: float, steps: int, most: int) -> int | None:
    """The least 1, 2, 4 ... parts of a step that follow all data; None if ``most`` do not."""
    parts = 1
    while parts <= most and parts * steps <= _MOST:
        if all(datum.missed(dt / parts, steps * parts)[0] <= _LIMIT for datum in data):
            return parts
        parts *= 2
    return None
