"""Sampled controllers while a scene is marched, and what all controllers of a run have done."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.findings import Finding, Severity, percent
from impactfem.marching.rows import Level
from impactfem.result.history import CONTROLLER_COLUMN, column_of
from impactfem.result.summary import ControllerFigures
from impactfem.runs.run import Run
from impactfem.scene import Scene
from impactfem.scene.controllers import Controller
from impactfem.scene.grammar import Held
from impactfem.scene.nearest import meant
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import is_number, show

if TYPE_CHECKING:
    from impactfem.runs.whole_body import WholeBody

type Read = Callable[[], Mapping[str, float]]
"""Tells the columns of the history now (collective)."""

type Tried = Sequence[Mapping[str, float]]
"""Columns at the ends of samples."""

type Try = Callable[[Held, float, int], Tried]
"""Marches some samples of so many steps from t = 0 on, of which the first holds an output; all is
as before afterwards (collective)."""

_EARLY = 1e-6  # share of a step by which one that ends before a sample counts as at it
_SHARE = 1e-4  # of a limit, or of what the law gives first, by which a scene is tried
_STRAIGHT = 1e-3  # share by which answers may differ from those of two states
_GIVEN = ("controller", "index", "span", "touching", "whole")  # what of a loop never changes
_OUTSIDE = 1e-9  # above 1: a radius of rounding


@dataclass
class Loop:
    """A sampled controller in a run.

    Attributes:
        controller: As the scene says it.
        index: Its place in the scene.
        span: Time between two samples [s].
        inertia: Force by acceleration that it takes [kg or kg m^2].
        radius: Spectral radius of the sampled loop; None if it is not known.
        samples: How many there were.
        integral: Of the difference over time.
        before: Difference at the last sample; NaN before.
        turned: Angle at the last sample, counted over turns; NaN before [rad].
        waiting: Outputs that are delayed yet, the next one first.
        cut: Number of samples whose output was at a limit.
        work: Done along its coordinate [J].
        largest: Amount of the largest output.
        along: That coordinate at the last sample; NaN before.
        hopping: What the hopper remembers that it drives; see `impactfem.runs.hopping`.
        touching: Columns of the forces on its foot.
        whole: What drives all motors, if this is one of them; see `impactfem.runs.whole_body`.
        unsolved: Number of samples in which nothing did, so that the last output stayed.
        slid: Way of feet that stood, the largest of each sample [m].
    """

    controller: Controller
    index: int
    span: float
    inertia: float = math.nan
    radius: float | None = None
    samples: int = 0
    integral: float = 0.0
    before: float = math.nan
    turned: float = math.nan
    waiting: list[float] = field(default_factory=list)
    cut: int = 0
    work: float = 0.0
    largest: float = 0.0
    along: float = math.nan
    hopping: dict[str, float] = field(default_factory=dict)
    touching: tuple[str, ...] = ()
    whole: "WholeBody | None" = None
    unsolved: int = 0
    slid: float = 0.0

    @property
    def measured(self) -> tuple[str, ...]:
        """Columns that are fed back."""
        return self.whole.columns if self.whole is not None else self.controller.measured

    @property
    def lag(self) -> int:
        """Samples from one to its output."""
        return round(self.controller.delay / self.span)

    def sample(self, time: float, columns: Mapping[str, float]) -> None:
        """Measure, and hold what follows."""
        own = self.controller
        if own.law == "external":
            self.count(own.held.value)
            return
        if own.law == "raibert":
            from impactfem.runs.hopping import Hopping  # noqa: PLC0415  (rarely)

            force = sum(columns[name] for name in self.touching)
            hopper = Hopping(**self.hopping)  # type: ignore[arg-type]
            found = hopper.output(own, time, self._measured(columns), force)
            self.hopping = vars(hopper)
        elif self.whole is not None:
            outputs, moved = self.whole.outputs(time, self._measured(columns))
            self.unsolved += not outputs
            self.slid += self.span * moved
            found = outputs.get(own.acts.split(".")[3], own.held.value)
        else:
            found = self.output(time, self._measured(columns))
        self.waiting.append(self.count(found))
        if len(self.waiting) > self.lag:
            own.held.value = self.waiting.pop(0)

    def count(self, found: float) -> float:
        """Note a sample; its output within the limits."""
        low, high = self.controller.ends
        self.cut += not low < found < high
        self.samples += 1
        within = self.controller.within(found)
        self.largest = max(self.largest, abs(within))
        return within

    def _measured(self, columns: Mapping[str, float]) -> Floats:
        own = self.controller
        found = np.array([columns[name] for name in self.measured])
        if self.measured[0].endswith(".angle") and own.columns is None:  # counted over turns
            ahead = 0.0 if math.isnan(self.turned) else self.turned - found[0]
            self.turned = found[0] = found[0] + 2.0 * np.pi * np.round(ahead / (2.0 * np.pi))
        if own.noise is not None:  # by number: the same after a restart, and on all ranks
            chance = np.random.default_rng([own.noise.seed, self.index, self.samples])
            found += own.noise.sigma * chance.standard_normal(len(found))
        return found

    def output(self, time: float, measured: Floats) -> float:
        """What the law asks for, before its limits."""
        own = self.controller
        if own.law == "feedback":
            return own.parsed.number({"t": time, **dict(zip(own.words, measured, strict=True))})
        if own.law == "lqr":
            wanted = np.array(own.equilibrium or np.zeros(len(measured)))
            return float(own.gains @ (wanted - measured))
        ahead = time + (self.span if own.law == "implicit_pd" else 0.0)
        off = own.target.number({"t": ahead}) - float(measured[0])
        if own.guesses_rate:
            rate = 0.0 if math.isnan(self.before) else (off - self.before) / self.span
        else:
            rate = own.target_rate.number({"t": ahead}) - float(measured[-1])
        self.before = off
        if own.law == "bang_bang":
            return self._switched(time, off, rate)
        if own.law == "implicit_pd":  # at the end of the sample, of m v' = u by backward Euler
            off -= self.span * float(measured[-1])
            return (own.kp * off + own.kd * rate) / self._shared
        if own.law != "pid":
            return own.kp * off + (own.kd * rate if own.law == "pd" else 0.0)
        found = own.kp * off + own.kd * rate + own.ki * self.integral
        low, high = own.ends
        pressing = own.ki * off > 0.0 if found >= high else own.ki * off < 0.0
        if not (own.anti_windup and pressing and not low < found < high):
            self.integral += self.span * off
        return found

    @property
    def _shared(self) -> float:
        """By what an implicit law is less than one that does not look ahead."""
        own = self.controller
        return 1.0 + (self.span * own.kd + self.span**2 * own.kp) / self.inertia

    def _switched(self, time: float, off: float, rate: float) -> float:
        """The largest force to the side of the switching curve; two samples before it ends, less.

        The last force is the deadbeat one of a mass under held forces.
        """
        own, (e, v) = self.controller, (-off, -rate)
        low, high = own.ends
        if own.curve is not None:
            return high if own.curve.number({"t": time, "e": e, "v": v}) < 0.0 else low
        last = -self.inertia * (e / self.span**2 + 1.5 * v / self.span)
        if low <= last <= high:
            return last
        braking = -low if v > 0.0 else high
        return high if e + v * abs(v) * self.inertia / (2.0 * braking) < 0.0 else low

    @property
    def gains(self) -> Floats | None:
        """Of y and y' in a law that is linear in them; None of others."""
        own = self.controller
        if own.law == "lqr":
            return own.gains
        if own.law not in {"p", "pd", "pid", "implicit_pd"} or own.guesses_rate:
            return None
        kd = own.kd if own.law != "p" else 0.0
        if own.law == "implicit_pd":
            return np.array([own.kp, self.span * own.kp + kd]) / self._shared
        return np.array([own.kp, kd])


def loop_radius(
    a: Floats, b: Floats, gains: Floats, *, lag: int = 0, integral: float = 0.0, span: float = 0.0
) -> float:
    """Spectral radius of x -> A x + B u with u = -K x + ki I a number of samples ago.

    Args:
        a: (n, n).
        b: (n,).
        gains: K, (n,); the first state is the one whose integral I counts.
        lag: Samples from one to its output.
        integral: ki.
        span: Time between two samples [s].
    """
    n = len(a)
    size = n + 1 + lag
    whole, output = np.zeros((size, size)), np.zeros(size)
    output[:n], output[n] = -gains, integral
    whole[:n, :n] = a
    whole[n, n], whole[n, 0] = 1.0, -span
    if lag:  # the oldest output acts, the newest is kept last
        whole[:n, n + 1] = b
        whole[n + 1 : -1, n + 2 :] = np.eye(lag - 1)
        whole[-1] = output
    else:
        whole[:n] += np.outer(b, output)
    kept = np.arange(size) != n if integral == 0.0 else np.ones(size, dtype=bool)
    return float(np.abs(np.linalg.eigvals(whole[np.ix_(kept, kept)])).max())


def held_flow(a: Any, b: Any, span: float) -> tuple[Floats, Floats]:
    """A and B over a sample of x' = A x + B u with u held, (n, n) and (n,)."""
    from scipy.linalg import expm  # noqa: PLC0415  (slow to load)

    n = len(b)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = a, b
    flow = expm(span * whole)
    return flow[:n, :n], flow[:n, n]


def held_answer(answers: Sequence[Floats]) -> tuple[Floats, Floats] | None:
    """A and B of two states from what a force held over one sample does at four that follow.

    Args:
        answers: Changes of the states by a unit force at the ends of samples, (2,) each.

    Returns:
        (2, 2) and (2,); None if they are not those of two states.
    """
    first, after = np.column_stack(answers[:-2]), np.column_stack(answers[1:-1])
    if not (np.isfinite(first).all() and abs(np.linalg.det(first)) > 0.0):
        return None
    a = np.linalg.solve(first.T, after.T).T
    off = np.abs(a @ answers[-2] - answers[-1]).max()
    return (a, answers[0]) if off <= _STRAIGHT * np.abs(answers[-1]).max() else None


class Feedback:
    """Observer that samples the controllers of a scene as it is marched.

    Args:
        scene: The scene, with controllers that are sampled.
        dt: Time step [s].
        layers: Number of steps.
    """

    def __init__(self, scene: Scene, dt: float, layers: int) -> None:
        """Take them."""
        self._dt, self._layers = dt, layers
        self.loops = list[Loop]()
        for index, each in enumerate(scene.controllers):
            whole, span = None, max(each.sample, dt)  # once a step at most
            if each.law == "whole_body":
                from impactfem.runs.whole_body import WholeBody  # noqa: PLC0415  (rarely)

                whole = WholeBody.of(scene, each, span)
            parts = () if each.in_steps else each.parts
            self.loops += [Loop(part, index, span, whole=whole) for part in parts]
        for loop in self.loops:
            loop.controller.held.value = 0.0
            if loop.controller.law == "raibert":
                from impactfem.runs.hopping import Hopping  # noqa: PLC0415  (rarely)
                from impactfem.scene.hopping_checks import contacts_of  # noqa: PLC0415

                own = scene.controllers[loop.index]
                loop.hopping = vars(Hopping.of(scene, own))
                loop.touching = tuple(f"force.{n}" for n in contacts_of(scene, str(own.foot)))

    def told(self) -> dict[str, dict[str, float]]:
        """Outputs in the step that ends, by the parts of their columns."""
        return {e.controller.name: {CONTROLLER_COLUMN: e.controller.held.value} for e in self.loops}

    def hold(self, outputs: Mapping[str, float]) -> None:
        """Set outputs of external controllers, by name, within their limits.

        Raises:
            SceneError: There is no such controller, or no such number.
        """
        known = {e.controller.name: e.controller for e in self.loops}
        known = {name: own for name, own in known.items() if own.law == "external"}
        for name, value in outputs.items():
            if name not in known:
                there = ", ".join(known) or "those, there are none"
                raise SceneError(
                    f"Simulation.step: outputs[{show(name)}] is no external controller; give one "
                    f"of {there}"
                )
            if not (is_number(value) and math.isfinite(value)):
                raise SceneError(
                    f"Simulation.step: outputs[{show(name)}] = {show(value)} is no finite number"
                )
            known[name].held.value = known[name].within(float(value))

    @property
    def counts_turns(self) -> bool:
        """Whether an angle is fed back whose turns count."""
        counting = [e.controller for e in self.loops if e.controller.law != "raibert"]
        return any(name.endswith(".angle") for own in counting for name in own.measured)

    def _check(self, known: Mapping[str, float]) -> None:
        """Refuse columns that the run has not.

        Raises:
            KeyedError: naming the key.
        """
        for loop in self.loops:
            own = loop.controller
            for name in loop.measured:
                if name in known:
                    continue
                at = "columns" if own.columns else "of" if name == own.measured[0] else "rate"
                text = f" = {show(name)} is no column of this run; {meant(name, known)}."
                raise KeyedError(f"controller[{loop.index}]", at, text)

    def __call__(self, level: Level, read: Read, run: Try) -> None:
        """Do the work of the step that ends, and sample what is due."""
        due = [e for e in self.loops if self._is_due(e, level.time)]
        if not due and level.layer < self._layers:
            return
        columns = read()
        if level.layer == 0:
            self._check(columns)
            self.try_out(run)
        for loop in self.loops if level.layer >= self._layers else due:
            # What is held since the last sample: delays are whole ones.
            at = columns.get(loop.controller.acted_column or "", math.nan)
            if math.isfinite(way := at - loop.along):
                loop.work += loop.controller.held.value * way
            loop.along = at
        for loop in due:
            loop.sample(level.time, columns)

    def _is_due(self, loop: Loop, time: float) -> bool:
        return time >= loop.samples * loop.span - _EARLY * self._dt

    def try_out(self, run: Try) -> None:
        """Find the inertia that forces meet at t = 0, and how fast errors die out.

        Args:
            run: Tries an output, see `Try`.
        """
        found = [self._tried(loop, run) for loop in self.loops]
        for loop, (inertia, answer) in zip(self.loops, found, strict=True):
            loop.inertia = inertia
            own, gains = loop.controller, loop.gains
            if answer is not None and gains is not None and np.isfinite(gains).all():
                integral = own.ki if own.law == "pid" else 0.0
                loop.radius = loop_radius(
                    *answer, gains, lag=loop.lag, integral=integral, span=loop.span
                )

    def _tried(self, loop: Loop, run: Try) -> tuple[float, tuple[Floats, Floats] | None]:
        """Inertia, and A and B of what a controller feeds back; NaN and None if not known."""
        own = loop.controller
        if own.model is not None:
            return math.nan, held_flow(own.model.state_matrix, own.model.input_matrix, loop.span)
        if len(own.measured) != 2 or own.columns is not None:
            return own.inertia or math.nan, None
        size = _SHARE * max(map(abs, own.limits or (abs(own.kp) or 1.0,)))
        steps = max(1, round(loop.span / self._dt))
        sides = [
            np.array([[columns[name] for name in own.measured] for columns in found])
            for found in (run(own.held, force, steps) for force in (size, -size))
        ]
        answers = list((sides[0] - sides[1]) / (2.0 * size))
        speed = float(answers[0][1])
        held = steps * self._dt
        inertia = own.inertia or (held / speed if speed > 0.0 else math.nan)
        return inertia, held_answer(answers)

    # --- checkpoints ---

    def state(self) -> str:
        """All that changes, as text."""
        kept = [
            {n: v for n, v in vars(loop).items() if n not in _GIVEN}
            | {"held": loop.controller.held.value}
            for loop in self.loops
        ]
        return json.dumps(kept)

    def restore(self, state: str) -> None:
        """Go on from there."""
        for loop, kept in zip(self.loops, json.loads(state), strict=True):
            loop.controller.held.value = kept.pop("held")
            vars(loop).update(kept)

    # --- what they have done ---

    def figures(self) -> dict[str, ControllerFigures]:
        """By name, for the summary."""
        return {
            e.controller.name: ControllerFigures(
                kind=e.controller.law,
                sample=e.span,
                inertia=e.inertia,
                spectral_radius=e.radius,
                saturated=e.cut / max(1, e.samples),
                largest=e.largest,
                work=None if math.isnan(e.along) else e.work,
            )
            for e in self.loops
        }

    def findings(self) -> list[Finding]:
        """What of them a user should know."""
        found = []
        for loop in self.loops:
            own = loop.controller
            if loop.radius is not None and loop.radius > 1.0 + _OUTSIDE:
                text = f"the sampled loop has the spectral radius {loop.radius:.6g}: errors grow"
                remedy = 'take smaller gains, a shorter sample or delay, or kind = "implicit_pd"'
                found.append(Finding("controller", "warning", text, own.name, remedy=remedy))
            found += self._timed(loop)
            if abs(own.delay / loop.span - loop.lag) > _EARLY:
                text = f"delay = {own.delay:g} s is taken as {loop.lag} samples, "
                text += f"{loop.lag * loop.span:g} s"
                found.append(Finding("controller", "note", text, own.name))
            share = loop.cut / max(1, loop.samples)
            if own.limits is not None and own.law != "bang_bang" and share > 0.0:
                text = f"its output was at a limit in {percent(share)} of the samples"
                found.append(Finding("controller", "note", text, own.name))
            found += _whole_told(loop)
            if own.law in {"implicit_pd", "bang_bang"} and not loop.inertia > 0.0:
                text = "no acceleration answers its force at t = 0, so that its inertia is unknown"
                found.append(Finding("controller", "fault", text, own.name, remedy="give inertia"))
        return found

    def _timed(self, loop: Loop) -> list[Finding]:
        """What of its samples is not as the scene says it."""
        own, every = loop.controller, loop.span / self._dt
        severity: Severity = "note"
        remedy = ""
        if abs(every - round(every)) > _EARLY:
            text = f"samples every {loop.span:g} s lie within steps of {self._dt:g} s and are "
            text += "taken where these end: first order in the step"
        elif own.law == "external":
            if loop.largest:
                return []
            text = "its output is 0: Simulation.step(outputs=...) sets another"
        elif not own.sample:
            text = "measured where steps begin, its output is held over them: first order in the "
            text += "step"
        elif own.sample < loop.span * (1.0 - _EARLY):
            text = f"sample = {own.sample:g} s is shorter than a step: it measures once in each, "
            text += f"every {loop.span:g} s"
            severity, remedy = "warning", f"give solve.dt = {own.sample:g}, or leave it out"
        else:
            return []
        return [Finding("controller", severity, text, own.name, remedy=remedy)]


def _whole_told(loop: Loop) -> list[Finding]:
    """What samples of a whole-body controller have met: once, not for each motor."""
    found = list[Finding]()
    if loop.whole is None or loop.controller.name != loop.whole.own.parts[0].name:
        return found
    own = loop.whole.own
    if loop.unsolved:
        text = "nothing fulfilled dynamics, feet, limits and friction in "
        text += f"{percent(loop.unsolved / loop.samples)} of the samples; its outputs stayed"
        remedy = "widen limits, or let fewer feet stand"
        found.append(Finding("controller", "warning", text, own.name, remedy=remedy))
    if own.feet:
        text = f"feet that stood, as it was told, moved by {loop.slid:.3g} m in all"
        found.append(Finding("controller", "note", text, own.name))
    return found


def controlled(scene: Scene, run: Run) -> Run:
    """A run with the columns and figures of controllers that are part of its steps."""
    figures, time = dict(run.effort.details.get("controllers", {})), run.history["time"].values
    for own in scene.controllers:
        if not own.in_steps or any(name not in run.history for name in own.measured):
            continue
        found = own.outputs(time, [run.history[name].values for name in own.measured])
        run.history[f"{own.name}.{CONTROLLER_COLUMN}"] = column_of(own.name, found)
        (low, high), along, work = own.ends, own.acted_column, None
        if along is not None and along in run.history:
            way = np.diff(run.history[along].values)
            work = float(0.5 * (found[1:] + found[:-1]) @ way)
        if own.name in (bar.far_end_force.plain for bar in scene.bars):  # all that acts there
            work = run.effort.details.get("end_work", work)
        figures[own.name] = ControllerFigures(
            kind=own.law, sample=0.0, inertia=None, spectral_radius=None,
            saturated=float(np.mean((found <= low) | (found >= high))),
            largest=float(np.abs(found).max()), work=work,
        )  # fmt: skip
    if not figures:
        return run
    details = {**run.effort.details, "controllers": figures}
    return replace(run, effort=replace(run.effort, details=details))
