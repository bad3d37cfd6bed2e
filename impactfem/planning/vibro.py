"""The plan of points, rods and beams: method and step, with the reasons."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, override

import numpy as np

from impactfem.errors import SceneError
from impactfem.findings import Finding, warning
from impactfem.methods import METHODS
from impactfem.planning.plans import Numbers, Plan, estimate_row
from impactfem.planning.time_data import data_findings, parts_following, time_data
from impactfem.scene import Scene
from impactfem.scene.values import show
from impactfem.sizing import check_memory

if TYPE_CHECKING:
    from impactfem.models.vibro import VibroModel

_ROWS = 1000
_LIVELY = 0.85
_MEANS = ("moreau_jean", "paoli_schatzman")  # methods whose steps take means of loads
_MOST_STEPS = 200_000_000
_PER_RADIAN = 20.0  # steps of a radian of the fastest vibration
_BEAM_PERIOD = 200.0  # steps of the first bending period
_SHORT = 1.0  # s of flights of events: below it impacts may decide the time
_FEW = 500  # degrees of freedom of which frequencies are known at once
_BYTES = 8.0 * 24.0


@dataclass(frozen=True, kw_only=True)
class VibroNumbers(Numbers):
    """Numbers of the run of few degrees of freedom.

    Attributes:
        dt: Time step, of "event_driven" that of the output [s].
        steps: Steps of that length.
        unknowns: Degrees of freedom.
        contact_pairs: Constraints.
        impact_law: "simultaneous" or "sequential".
        stick_speed: Given normal speed from which on contact lasts [m/s]; None for the default.
        estimate: Whether the error is estimated by a second run.
    """

    dt: float
    steps: int
    unknowns: int
    contact_pairs: int
    impact_law: str
    stick_speed: float | None
    estimate: bool

    @override
    def rows(self, plan: Plan[Any]) -> list[tuple[str, str]]:
        unknown = "depends on the number of impacts"
        return [
            ("dt", f"{self.dt:g} s{' of the output' * METHODS[plan.method].locates}"),
            ("steps", str(self.steps)),
            ("unknowns", f"{self.unknowns} ({self.contact_pairs} constraints)"),
            ("impact law", self.impact_law),
            estimate_row(self),
            ("memory", f"about {plan.memory_mib:.2g} MiB"),
            ("time", unknown if plan.seconds is None else f"about {plan.seconds:.2g} s"),
        ]


def plan_vibro(scene: Scene) -> Plan[VibroNumbers]:
    """Choose method and numbers for points, a rod or a beam.

    Raises:
        SceneError: The start or the settings cannot work.
    """
    from impactfem.models.vibro import vibro_model  # noqa: PLC0415  (loads SciPy)

    model = vibro_model(scene)
    solve = scene.solve
    reasons: dict[str, str] = {}
    method = solve.method or _choose_method(model, reasons)
    if solve.method is not None:
        reasons["method"] = "as given"
    _check_settings(scene, method)
    fastest = 0.0
    if METHODS[method].locates and model.system.dofs <= _FEW:
        fastest = _check_periods(scene, model, method)
    dt = solve.dt or _choose_step(scene, model, method, reasons)
    data = [] if METHODS[method].locates else time_data(scene, means=method in _MEANS)
    if solve.dt is None:
        dt /= parts_following(data, scene.duration, round(scene.duration / dt), reasons)
    steps = max(1, round(scene.duration / dt))
    if steps > _MOST_STEPS:
        raise SceneError(
            f"solve.dt = {dt:g} s makes {steps:.3g} steps of duration = {scene.duration:g} s, more "
            f"than {_MOST_STEPS:g}: give a larger dt or a shorter duration"
        )
    memory = _memory(scene, steps)
    estimate = _choose_estimate(scene, method, steps, reasons)
    return Plan(
        method=method,
        model=model.words,
        numbers=VibroNumbers(
            dt=scene.duration / steps,
            steps=steps,
            unknowns=model.system.dofs,
            contact_pairs=model.system.num_constraints,
            impact_law=solve.impact_law or "simultaneous",
            stick_speed=solve.stick_speed,
            estimate=estimate,
        ),
        memory_mib=memory,
        seconds=_seconds(model, method, steps, scene.duration * fastest, estimate=estimate),
        reasons=reasons,
        findings=(*_findings(scene, model, method), *data_findings(data, dt, steps)),
    )


def _choose_method(model: "VibroModel", reasons: dict[str, str]) -> str:
    if model.beam is not None:
        reasons["method"] = (
            "a beam strikes in many micro-impacts: the position-level scheme passes them without "
            "detection, its stiff forces averaged"
        )
        return "paoli_schatzman"
    if model.is_exact:
        reasons["method"] = "flights are linear, so that they and the impacts are exact to rounding"
    else:
        reasons["method"] = "few degrees of freedom: impacts are located by an adaptive integrator"
    return "event_driven"


def _choose_step(scene: Scene, model: "VibroModel", method: str, reasons: dict[str, str]) -> float:
    even = scene.duration / _ROWS
    if METHODS[method].locates:
        reasons["dt"] = f"{_ROWS} rows of output; flights and impacts do not depend on it"
        return even
    if model.beam is not None:
        period = 2.0 * math.pi / model.beam.beam.first_frequency
        reasons["dt"] = f"{_BEAM_PERIOD:g} steps in the first bending period of {period:.3g} s"
        return min(even, period / _BEAM_PERIOD)
    from impactfem.system.frequency import highest_frequency  # noqa: PLC0415  (SciPy)

    frequency = highest_frequency(model.system, model.position, model.velocity)
    drive = max((w for s in _signals(model) for w, _, _ in s.harmonics), default=0.0)
    fastest = max(frequency, drive)
    reasons["dt"] = f"{_ROWS} steps, and {_PER_RADIAN:g} in a radian of the fastest vibration"
    return min(even, 1.0 / (_PER_RADIAN * fastest)) if fastest > 0.0 else even


def _check_periods(scene: Scene, model: "VibroModel", method: str) -> float:
    """Refuse to look for events in more vibrations, or falls of bodies, than can be followed.

    Returns:
        The fastest rate of the free motion [rad/s, 1/s].
    """
    from impactfem.system.frequency import (  # noqa: PLC0415  (SciPy)
        fastest_decay,
        highest_frequency,
    )

    fastest = highest_frequency(model.system, model.position, model.velocity)
    periods, of = scene.duration * fastest / (2.0 * math.pi), "periods of the fastest vibration"
    remedy = "give a shorter duration (check the units), or "
    decay, further = fastest_decay(model.system, model.position, model.velocity), "fewer elements"
    if decay > fastest:
        fastest, further = decay, "less damping"
        periods, of = scene.duration * decay, "decay times of the strongest damper"
    pull = float(np.linalg.norm(scene.vector_gravity.values, axis=-1).max(initial=0.0))
    flights = (body.flight for body in scene.bodies)
    sizes = [float(np.linalg.norm(flight.half)) for flight in flights if flight is not None]
    size = min((size for size in sizes if size > 0.0), default=math.inf)
    falls = scene.duration * math.sqrt(pull / size)
    if falls > max(periods, _MOST_STEPS):
        periods, of = falls, "times in which a body falls by its size"
        further = "larger bodies"
    if periods > _MOST_STEPS:
        raise SceneError(
            f"duration = {scene.duration:g} s is {periods:.3g} {of}, in each of which method = "
            f'"{method}" looks for events: more than {_MOST_STEPS:g}; {remedy}{further}'
        )
    return fastest


def _signals(model: "VibroModel") -> list[Any]:
    return [*getattr(model.system, "load", ()), *model.system.motion]


def _choose_estimate(scene: Scene, method: str, steps: int, reasons: dict[str, str]) -> bool:
    if scene.solve.estimate is not None:
        return scene.solve.estimate
    if not METHODS[method].locates and steps > 1_000_000:
        reasons["estimate"] = "left out: many steps; set estimate = true to have it"
        return False
    reasons["estimate"] = (
        "by a second run from a start changed by 1e-9, or with tolerances 100 times as large"
        if METHODS[method].locates
        else "against a run of the event-driven method, or with half the step"
    )
    return True


def _check_settings(scene: Scene, method: str) -> None:
    """Refuse settings of other methods."""
    solve = scene.solve
    owners = {key: name for name, entry in METHODS.items() for key in entry.own}
    for name, owner in owners.items():
        value = getattr(solve, name)
        if value is not None and method != owner:
            raise SceneError(
                f'solve.{name} = {show(value)} belongs to method = "{owner}", not to "{method}": '
                "remove it"
            )
    if solve.impact_law == "sequential" and not METHODS[method].locates:
        raise SceneError(
            f'solve.impact_law = "sequential" needs method = "event_driven", not "{method}": the '
            "others share an impact between all constraints at once; remove it"
        )


def _memory(scene: Scene, steps: int) -> float:
    stride = scene.output.stride
    memory = _BYTES * (steps / stride) * max(1, len(scene.bodies)) / 2**20
    what, remedy = f"{steps // stride:.3g} rows", "a larger one, a larger solve.dt or less duration"
    check_memory(memory, f"output.every = {stride}", what, remedy)
    return memory


def _seconds(
    model: "VibroModel", method: str, steps: int, radians: float, *, estimate: bool
) -> float | None:
    """Time of the run; micro-seconds a step as measured in benchmarks/vibro_speed.py.

    Args:
        model: What moves.
        method: Its method.
        steps: Steps, or rows of output.
        radians: Duration times the fastest rate: an exact flight has a substep for each.
        estimate: Whether the error is estimated, by a second run.

    Returns:
        The time [s]; None where impacts decide it.
    """
    d = model.system.dofs
    linear = hasattr(model.system, "stiffness")
    if METHODS[method].locates:
        substep = 2e-7 * d * d + 5e-7 if model.is_exact else 1e-4
        seconds = radians * substep * (1 + estimate)
        return seconds if seconds > _SHORT else None
    if estimate and model.beam is not None:
        steps *= 3  # a run with half the step
    return steps * (1e-7 * d * d + 1e-6 if linear else 2e-4)


def _findings(scene: Scene, model: "VibroModel", method: str) -> list[Finding]:
    found = []
    if not scene.contacts:
        text = "no [[contact]] gives a restitution: 0 is taken, nothing rebounds"
        found.append(
            warning("setting", text, remedy="add [[contact]] with between and restitution")
        )
    if METHODS[method].lively and float(model.system.restitution.max()) > _LIVELY:
        text = (
            f"{method} can gain energy with restitution near 1: beside corners, and at some steps "
            "over thousands of bounces"
        )
        remedy = "event_driven or moreau_jean do not"
        found.append(warning("energy_growth", text, remedy=remedy))
    pairs = model.system.num_constraints
    if model.beam is None and pairs > 1 and np.unique(model.system.restitution).size > 1:
        text = "the constraints have different restitution: no law of impact is settled for several"
        found.append(warning("impact_law", f"{text} of them at once"))
    return found
