"""Controllers: feedback of columns of the history to forces and motors that formulas give.

A controller stands in the formula of what it acts on. One that feeds back the coordinate and rate
of that alone, without clock and memory, is a formula itself: the step takes it as part of its law.
Any other is a number there, which is set anew at its samples and held between them.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.control import AXES, put_into
from impactfem.scene.formula import Formula
from impactfem.scene.given import AFormula, MaybeFormula, MaybeTable
from impactfem.scene.grammar import FormulaError, Held, Node
from impactfem.scene.inline import InlineTable, ListOf, Vector
from impactfem.scene.inverse import check_formula_name
from impactfem.scene.kinds import Choice, FormulaOf, Integer, Line, Name, Real, Switch
from impactfem.scene.least_cost import least_cost_gains
from impactfem.scene.scalar_formula import arrays
from impactfem.scene.schema import KeyedError, check_ends, key, keys_of, table
from impactfem.scene.values import NotAllowedError, show

MAX_CONTROLLERS = 100
CUMULATIVE = (
    "potential_energy", "total_energy", "dissipated_energy", "friction_work", "slip", "lost",
    "center", "contact_impulse", "indentation",
)  # fmt: skip
"""First or last parts of columns that are known only once a run is over."""

_GAINS = {
    "p": ("kp",), "pd": ("kp", "kd"), "pid": ("kp", "kd", "ki"), "implicit_pd": ("kp", "kd"),
    "bang_bang": (), "lqr": (), "feedback": (), "raibert": (), "whole_body": (),
    "external": (),
}  # fmt: skip
KINDS = tuple(_GAINS)
# Keys that only some kinds have: which.
_ONLY: Mapping[str, tuple[str, ...]] = {
    "kp": ("p", "pd", "pid", "implicit_pd"), "kd": ("pd", "pid", "implicit_pd"), "ki": ("pid",),
    "of": ("p", "pd", "pid", "implicit_pd", "bang_bang"), "rate": ("pd", "pid", "implicit_pd",
    "bang_bang"), "target": ("p", "pd", "pid", "implicit_pd", "bang_bang", "raibert"),
    "target_rate": ("pd", "pid", "implicit_pd", "bang_bang"), "columns": ("lqr", "feedback"),
    "formula": ("feedback",), "curve": ("bang_bang",), "inertia": ("implicit_pd", "bang_bang"),
    "model": ("lqr",), "weights": ("lqr",), "effort": ("lqr",), "equilibrium": ("lqr",),
    "anti_windup": ("pid",), "body": ("raibert",), "foot": ("raibert",), "hip": ("raibert",),
    "motors": ("whole_body",), "tasks": ("whole_body",), "feet": ("whole_body",),
}  # fmt: skip
_IN_STEPS = ("p", "pd", "feedback", "lqr")
_RATES = {"q": "v", "angle": "spin", **{f"{a}": f"v{a}" for a in AXES}}
_RATES |= {f"u{a}": f"v{a}" for a in AXES}
_ACTED = re.compile(
    r"joint\.[^.]+\.motor|body\.[^.]+\.motors|body\.[^.]+\.joints\.[^.]+\.(motor|control)|"
    r"body\.[^.]+\.(far_end_force|(force|moment)(\.[xyz012])?)|body\.[^.]+\.(tractions?|pressures?)\..+"
)
HIP = "_hip"
"""What the name of the output of a hip ends with."""


@table("noise = { ... }")
class Noise:
    """Noise of what a controller measures, the same in every run.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "noise"

    sigma: float = key(Real(at_least=0), "standard deviation, in the unit of the column")
    seed: int = key(Integer(0, 2**31 - 1), "of its random numbers", default=0)


@table("model = { ... }")
class LinearModel:
    """A linear model x' = A x + B u of what a controller drives.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "model"

    state_matrix: Sequence[Sequence[float]] = key(
        ListOf(ListOf(Real()), at_least=1), "A, row by row"
    )
    input_matrix: Sequence[float] = key(ListOf(Real(), at_least=1), "B, of one input")


@table("hip = { ... }")
class Hip:
    """The hip of a leg that hops.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    heading: ClassVar[str] = "hip"

    acts: str = key(Line(), "path of its motor, joint.J.motor")
    speed: AFormula = key(
        FormulaOf(("t",)), "what the body's velocity along x in flight shall be", unit="m/s",
        default=0.0,
    )  # fmt: skip
    attitude: AFormula = key(
        FormulaOf(("t",)), "what the body's angle shall be", unit="rad", default=0.0
    )
    swing_kp: float = key(Real(above=0), "gain of the leg's angle in flight", unit="N m/rad")
    swing_kd: float = key(Real(at_least=0), "of its rate", unit="N m s/rad", default=0.0)
    body_kd: float | None = key(
        Real(above=0), "of the body's spin in stance, towards that which turns it upright",
        unit="N m s/rad", default=None, absent="five times its inertia by the time of a stance",
    )  # fmt: skip
    placement: float | None = key(
        Real(above=0), "how far ahead the foot lands for each m/s that the body is too fast",
        unit="s", default=None, absent="two thirds of what would take that away in one hop",
    )  # fmt: skip
    stance: float | None = key(
        Real(above=0), "how long a stance is thought to last before the first one", unit="s",
        default=None, absent="half a period of the body on the leg's spring",
    )  # fmt: skip
    limits: Sequence[float] | None = key(
        Vector((2,)), "least and largest output", unit="N m", default=None, absent="none"
    )

    def _check(self) -> None:
        check_ends(self.heading, "limits", *(self.limits or (0.0, 1.0)))


@table("tasks = [{ ... }]")
class Task:
    """What a place or joint of a mechanism shall do: y'' = r'' + kp (r - y) + kd (r' - y').

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "tasks"

    of: str = key(
        Line(),
        "a joint, or x, y or z of a link's origin or of the centre of mass: foot.z, centre.x",
    )
    target: AFormula = key(FormulaOf(("t",)), "r, with its derivatives in time", default=0.0)
    kp: float = key(Real(at_least=0), "gain of the difference", unit="1/s^2", default=0.0)
    kd: float = key(Real(at_least=0), "gain of the difference of rates", unit="1/s", default=0.0)
    weight: float = key(Real(above=0), "of its square among those of all tasks", default=1.0)


@table("feet = [{ ... }]")
class Foot:
    """A link that stands on something, by a point or by a ball that rolls.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "feet"

    link: str = key(Line(), "whose origin is the foot, or the centre of its ball")
    friction: float = key(Real(above=0), "coefficient that forces keep to, at most the true one")
    radius: float = key(Real(at_least=0), "of its ball", unit="m", default=0.0)
    normal: Sequence[float] = key(
        Vector((3,)), "of what it stands on, towards the foot", default=(0.0, 0.0, 1.0)
    )
    stands: AFormula = key(
        FormulaOf(("t",)), "whether it stands: above 0 it does, else it is free", default=1.0
    )

    def _check(self) -> None:
        if not any(self.normal):
            raise KeyedError(self.heading, "normal", " has no direction: give [0.0, 0.0, 1.0].")

    @property
    def up(self) -> Floats:
        """Its normal, of length 1."""
        return np.asarray(self.normal) / np.linalg.norm(self.normal)


@table("[[controller]]")
class Controller:
    """Feedback of a column of the history to a force or motor.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    heading: ClassVar[str] = "controller"

    name: str = key(Name(), "name of the controller; its output is the column `NAME.u`")
    law: str = key(
        Choice(KINDS),
        "kp (target - y); with kd (target_rate - y'); with ki times the integral; the same with y "
        "and y' at the end of the sample; the largest force to either side; gains of a linear "
        "model and quadratic cost; a formula; Raibert's for a leg that hops, whose target is the "
        "height of the body's apex; motors of a mechanism by least squares of tasks under "
        "dynamics, limits and cones of friction; what `Simulation.step(outputs=...)` sets",
        name="kind",
    )
    acts: str = key(
        Line(),
        "path of the formula in t that it is added to: joint.J.motor, body.M.joints.J.motor, "
        "body.B.force.x, body.B.moment, body.B.traction.SURFACE.x, body.B.pressure.SURFACE, "
        "body.B.far_end_force; of a whole_body controller body.M.motors",
    )
    of: str | None = key(
        Line(), "column that is fed back, as joint.knee.q or ball.x", default=None, absent="columns"
    )
    rate: str | None = key(
        Line(), "column of its rate", default=None,
        absent="that of the same place (knee.v of knee.q), else differences of samples",
    )  # fmt: skip
    columns: Sequence[str] | None = key(
        ListOf(Line(), at_least=1, different=True),
        "columns of the formula, where their dots are underscores (knee_q), or states of the model",
        default=None, absent="of",
    )  # fmt: skip
    target: AFormula = key(FormulaOf(("t",)), "what the column shall be", default=0.0)
    target_rate: AFormula = key(FormulaOf(("t",)), "what its rate shall be", default=0.0)
    kp: float = key(Real(), "gain of the difference", default=0.0)
    kd: float = key(Real(), "gain of the difference of rates", default=0.0)
    ki: float = key(Real(), "gain of the integral of the difference over time", default=0.0)
    anti_windup: bool = key(
        Switch(),
        "whether the integral stands while it would only press against limits",
        default=True,
    )
    formula: str | None = key(
        Line(1000), "feedback by t and columns, as -3*knee_q - knee_v", default=None, absent="none"
    )
    curve: MaybeFormula = key(
        FormulaOf(("t", "e", "v")),
        "switching curve in y less target and y': the force is the largest where it is < 0",
        default=None, absent="e + v abs(v) inertia / (2 largest force), of least time",
    )  # fmt: skip
    inertia: float | None = key(
        Real(above=0), "force by acceleration y'' that it causes", unit="kg or kg m^2",
        default=None, absent="that which the scene shows at t = 0",
    )  # fmt: skip
    model: MaybeTable[LinearModel] = key(
        InlineTable((LinearModel,)), "linear model of the columns about the equilibrium",
        default=None, absent="none",
    )  # fmt: skip
    weights: Sequence[float] | None = key(
        ListOf(Real(at_least=0), at_least=1), "of the squares of the states in the cost",
        default=None, absent="1 each",
    )  # fmt: skip
    effort: float = key(Real(above=0), "weight of the square of the force in the cost", default=1.0)
    equilibrium: Sequence[float] | None = key(
        ListOf(Real(), at_least=1), "states about which the model holds", default=None,
        absent="0 each",
    )  # fmt: skip
    body: str | None = key(
        Line(), "rigid body that hops, whose apex and speed are held", default=None, absent="none"
    )
    foot: str | None = key(
        Line(), "rigid body that touches, at the end of its leg, along which the output thrusts",
        default=None, absent="none",
    )  # fmt: skip
    hip: MaybeTable[Hip] = key(
        InlineTable((Hip,)), "what swings the leg and holds the body; its output is `NAME_hip.u`",
        default=None, absent="none, as on a rail",
    )  # fmt: skip
    motors: Sequence[str] | None = key(
        ListOf(Line(), at_least=1, different=True),
        "joints of the mechanism that it drives; their outputs are `NAME_JOINT.u`",
        default=None, absent="none",
    )  # fmt: skip
    tasks: Sequence[Task] = key(
        ListOf(InlineTable((Task,))), "what the mechanism shall do", default=(),
        absent="none",
    )  # fmt: skip
    feet: Sequence[Foot] = key(
        ListOf(InlineTable((Foot,))), "links that stand on something", default=(),
        absent="none",
    )  # fmt: skip
    limits: Sequence[float] | None = key(
        Vector((2,)), "least and largest output", unit="N or N m", default=None, absent="none"
    )
    sample: float = key(
        Real(at_least=0), "time between two samples; 0: every step", unit="s", default=0.0
    )
    delay: float = key(
        Real(at_least=0), "from a sample to its output, in whole samples", unit="s", default=0.0
    )
    noise: MaybeTable[Noise] = key(
        InlineTable((Noise,)), "of what is measured", default=None, absent="none"
    )

    def _check(self) -> None:
        check_formula_name(self.heading, self.name, "give another name")
        for name, laws in _ONLY.items():
            if self.law not in laws and self._says(name):
                text = f" is given, but a {self.law} controller has none: remove it, or take "
                raise self._fail(name, f"{text}{' or '.join(laws)}.")
        self._check_acts()
        self._check_limits()
        self._check_end()
        if self.delay and not self.sample:
            text = f" = {self.delay:g} s without sample: give sample, of which it is a multiple."
            raise self._fail("delay", text)
        if self.law == "whole_body":
            self._check_whole()
        elif self.law == "raibert":
            self._check_hopper()
        elif self.law in _ONLY["columns"]:
            self._check_columns()
        elif self.law != "external":
            self._check_gains()
        for given in self.measured:
            if {given.partition(".")[0], given.rpartition(".")[2]} & {*CUMULATIVE}:
                text = f" = {show(given)} is known only after the run: give a column of the motion."
                raise self._fail("columns" if self.columns else "of", text)

    def _check_acts(self) -> None:
        if not _ACTED.fullmatch(self.acts):
            text = f" = {show(self.acts)} is no force or motor: give joint.J.motor, "
            text += "body.B.force.x, body.B.moment, body.M.joints.J.motor, body.B.far_end_force, "
            raise self._fail("acts", f"{text}or a value of tractions or pressures.")
        # What acts on all motors has a part for each, of which that joint is the only one.
        alone = f".joints.{'/'.join(self.motors or ())}.motor"
        whole = self.acts.endswith((".motors", alone))
        if (self.law == "whole_body") != whole:
            text = f" = {show(self.acts)}: whole_body controllers act on body.M.motors, others on "
            raise self._fail("acts", f"{text}one of them, body.M.joints.J.motor.")

    def _check_limits(self) -> None:
        low, high = self.ends
        check_ends(self.heading, "limits", low, high)
        if self.law == "bang_bang" and not -math.inf < low < 0.0 < high:
            text = " of a bang_bang controller are its two forces: give a negative and a positive."
            raise self._fail("limits", text)

    def _check_end(self) -> None:
        """Refuse what the far end of a bar does not follow within its waves."""
        if not self.acts.endswith(".far_end_force"):
            return
        column = next(name for name, word in self._own.items() if word)
        if not self.in_steps or self.limits is not None:
            text = f" = {show(self.acts)} takes feedback of {column} alone, by kind p or feedback, "
            raise self._fail("acts", f"{text}without limits, sample, delay and noise.")

    def _check_gains(self) -> None:
        gains = _GAINS[self.law]
        if self.of is None:
            raise self._fail("of", " is missing: give the column that is fed back.")
        if gains and not any(getattr(self, gain) for gain in gains):
            text = f" and all other gains are 0: it does nothing; give {gains[0]}."
            raise self._fail(gains[0], text)
        if self.law == "implicit_pd" and self.guesses_rate:
            text = f" = {show(self.of)} has no rate that is known by itself: give its column."
            raise self._fail("rate", text)

    def _check_hopper(self) -> None:
        for name, what in (("body", "that hops"), ("foot", "that touches")):
            if getattr(self, name) is None:
                raise self._fail(name, f" is missing: give the rigid body {what}.")
        if self.noise is not None:
            text = f" of a {self.law} controller would be of lengths, angles and forces at once: "
            raise self._fail("noise", f"{text}remove it.")

    def _check_whole(self) -> None:
        for name, what in (("motors", "the joints that it drives"), ("tasks", "what to do")):
            if not getattr(self, name):
                raise self._fail(name, f" is missing: give {what}.")
        for joint in self.motors or ():
            check_formula_name(self.heading, f"{self.name}_{joint}", "give another name")

    def _check_columns(self) -> None:
        if self.columns is None:
            raise self._fail("columns", " is missing: give the columns that are fed back.")
        if self.law == "feedback":
            if self.formula is None:
                raise self._fail("formula", " is missing: give the force, by t and columns.")
            try:
                self.parsed  # noqa: B018  (as it is read)
            except FormulaError as error:
                text = f" = {show(self.formula)}: {error.why}."
                raise self._fail("formula", text) from None
            return
        count = len(self.columns)
        if self.model is None:
            raise self._fail("model", " is missing: give state_matrix and input_matrix.")
        rows = [len(row) for row in self.model.state_matrix]
        if rows != [count] * count or len(self.model.input_matrix) != count:
            text = f" has matrices of other sizes than the {count} columns: give {count} rows of "
            raise self._fail("model", f"{text}{count}, and an input_matrix of {count}.")
        for name in ("weights", "equilibrium"):
            given = getattr(self, name)
            if given is not None and len(given) != count:
                raise self._fail(name, f" has {len(given)} entries: give {count}, as columns.")
        try:
            self.gains  # noqa: B018
        except (np.linalg.LinAlgError, ValueError):
            text = ": no gains hold it; the input does not reach a state that grows: correct it."
            raise self._fail("model", text) from None

    def _fail(self, name: str, text: str) -> KeyedError:
        return KeyedError(self.heading, name, text)

    def _says(self, name: str) -> bool:
        """Whether a key has another value than if it were absent."""
        value = getattr(self, name)
        plain = value.plain if isinstance(value, Formula) else value
        return bool(plain != keys_of(type(self))[name].default)

    @cached_property
    def held(self) -> Held:
        """Its output in formulas, where it is held between samples."""
        return Held()

    @property
    def measured(self) -> tuple[str, ...]:
        """Columns that are fed back, the rate last if the law has one."""
        if self.columns is not None:
            return tuple(map(_column, self.columns))
        if self.law == "raibert":
            moved = ("x", "y", "vx", "vy")
            body = [f"{self.body}.{part}" for part in (*moved, "angle", "spin")]
            return (*body, *(f"{self.foot}.{part}" for part in moved), *self._own)
        if self.of is None:
            return ()
        found = [_column(self.of)]
        if self.law in _ONLY["rate"]:
            own = None if self.rate is None else _column(self.rate)
            head, _, last = found[0].rpartition(".")
            found += [own] if own else [f"{head}.{_RATES[last]}"] if last in _RATES and head else []
        return tuple(found)

    @cached_property
    def parts(self) -> tuple["Controller", ...]:
        """It, and that of its hip, or of each motor: each has one output."""
        if self.law == "whole_body" and self.acts.endswith(".motors"):
            head = self.acts.removesuffix("motors")
            each = [(joint, f"{head}joints.{joint}.motor") for joint in self.motors or ()]
            return tuple(
                replace(self, name=f"{self.name}_{joint}", acts=acts, motors=[joint])
                for joint, acts in each
            )
        if self.hip is None or self.law != "raibert" or self.swings:
            return (self,)
        name, hip = f"{self.name}{HIP}", self.hip
        return (self, replace(self, name=name, acts=hip.acts, limits=hip.limits))

    @property
    def swings(self) -> bool:
        """Whether its output is that of a hip."""
        return self.hip is not None and self.acts == self.hip.acts

    @property
    def guesses_rate(self) -> bool:
        """Whether the rate is that of differences of samples."""
        return self.law in _ONLY["rate"] and len(self.measured) == 1

    @cached_property
    def parsed(self) -> Formula:
        """The formula of a feedback, in t and its columns."""
        return Formula(str(self.formula), ("t", *map(in_formulas, self.columns or ())))

    @cached_property
    def gains(self) -> Floats:
        """Gains of the states of a linear model, (n,); see `least_cost_gains`."""
        if self.model is None:
            return np.zeros(0)
        weights = self.weights or [1.0] * len(self.model.input_matrix)
        return least_cost_gains(
            (self.model.state_matrix, self.model.input_matrix), weights, self.effort, self.sample
        )

    @property
    def acted_column(self) -> str | None:
        """Column of the coordinate along which it does its work; None if there is none."""
        return next(iter(self._own), None)

    @property
    def _own(self) -> Mapping[str, str]:
        """Columns that the formula it stands in knows, and its words for them."""
        heads = self.acts.split(".")
        if heads[-1] == "motors":
            return {}
        if heads[-1] in {"motor", "control"}:
            name = heads[1] if heads[0] == "joint" else f"{heads[1]}.{heads[3]}"
            return {f"{name}.q": "q", f"{name}.v": "v"}
        if heads[2] == "force":
            first = AXES[int(heads[3])] if heads[3:] and heads[3].isdigit() else (*heads, "x")[3]
            names = [first, *AXES, *(f"v{axis}" for axis in AXES)]
            return {f"{heads[1]}.{name}": name for name in names}
        if heads[2] == "far_end_force":
            return {f"{heads[1]}.far_end.ux": "", f"{heads[1]}.far_end.vx": "v"}
        if heads[2] == "moment" and len(heads) == 3:
            return {f"{heads[1]}.angle": "", f"{heads[1]}.spin": "w"}
        return {}

    @property
    def in_steps(self) -> bool:
        """Whether the formula that it acts on knows all it feeds back: it is part of the step."""
        clocked = self.sample or self.delay or self.noise is not None or self.guesses_rate
        known = {name for name, word in self._own.items() if word}
        return not clocked and self.law in _IN_STEPS and known >= {*self.measured}

    @cached_property
    def node(self) -> Node:
        """What stands for it in formulas."""
        if not self.in_steps:
            return ("held", self.held)
        places: list[Node] = [("variable", self._own[name]) for name in self.measured]
        found: Node
        if self.law == "feedback":
            names = tuple(dict.fromkeys(("t", *self._own.values())))
            own = (self._own[name] for name in self.measured)
            parts = {n: Formula(word, names) for n, word in zip(self.words, own, strict=True)}
            found = self.parsed.composed(t=Formula("t", names), **parts).tree
        else:
            found = _sum(
                [_times(k, _less(w, x)) for k, w, x in zip(*self.linear, places, strict=True)]
            )
        if self.limits is not None:
            low, high = self.limits
            found = ("call", "min", (("call", "max", (found, low)), high))
        return found

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest output; infinite where there are no limits."""
        low, high = self.limits or (-math.inf, math.inf)
        return low, high

    def within(self, output: float) -> float:
        """An output within the limits."""
        low, high = self.ends
        return min(max(output, low), high)

    @property
    def words(self) -> tuple[str, ...]:
        """Names of the columns in the formula of a feedback."""
        return tuple(map(in_formulas, self.measured))

    @property
    def linear(self) -> tuple[list[float], list[Node]]:
        """Of a law that is a sum of gains times (wanted - measured): gains, and what is wanted."""
        if self.law == "lqr":
            return self.gains.tolist(), list(self.equilibrium or [0.0] * len(self.gains))
        gains = [self.kp, self.kd][: len(_GAINS[self.law])]
        return gains, [self.target.tree, self.target_rate.tree][: len(gains)]

    def outputs(self, time: Floats, measured: Sequence[Floats]) -> Floats:
        """Its outputs where it is part of the steps, of columns at some times [s], (rows,)."""
        words = (self._own[name] for name in self.measured)
        found = arrays(self.node)({"t": time, **dict(zip(words, measured, strict=True))})
        return np.asarray(found + np.zeros(len(time)))


def _less(one: Node, other: Node) -> Node:
    return ("chain", one, (("Sub", other),))


def _times(number: float, node: Node) -> Node:
    return ("chain", number, (("Mult", node),))


def _sum(nodes: Sequence[Node]) -> Node:
    return (
        ("chain", nodes[0], tuple(("Add", node) for node in nodes[1:])) if nodes[1:] else nodes[0]
    )


def fed_back(
    data: dict[str, Any], controllers: Sequence[Controller], keys: Mapping[str, Collection[str]]
) -> None:
    """Put controllers into the formulas that they act on.

    Args:
        data: Plain tables of the scene; changed.
        controllers: Read from it.
        keys: That bodies of each kind, and joints, have, whether they are given or not.

    Raises:
        KeyedError: naming the key.
    """
    for index, each in [(k, part) for k, own in enumerate(controllers) for part in own.parts]:
        try:
            put_into(data, each.acts, each.name, keys)
        except NotAllowedError as error:
            text = f" = {show(each.acts)}: {error}. What it acts on has to stand there, as 0."
            place = "hip.acts" if each.swings else "acts"
            raise KeyedError(f"controller[{index}]", place, text) from None


def in_formulas(column: str) -> str:
    """A column's name where formulas use it."""
    return re.sub(r"\W", "_", _column(column))


def _column(given: str) -> str:
    """The name of a column, which may be said with what it is of."""
    return re.sub(r"^(joint|body|probe)\.(?=[^.]+\.)", "", given)
