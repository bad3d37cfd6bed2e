"""Motions of scenes: what [trajectory] asks, as a problem of the bodies' coordinates."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene import Scene
from impactfem.scene.formula import Formula
from impactfem.scene.grammar import FormulaError
from impactfem.scene.trajectory import TrajectoryKeys
from impactfem.scene.values import show
from impactfem.trajectory.bodies import Symbolic, in_symbols, symbolic
from impactfem.trajectory.contacts import Closing, closings
from impactfem.trajectory.modes import hybrid
from impactfem.trajectory.problem import Problem, Row
from impactfem.trajectory.resimulated import by_events
from impactfem.trajectory.rotations import asked_rotations, rotation_rows, turned
from impactfem.trajectory.symbols import loaded
from impactfem.trajectory.touching import touching
from impactfem.trajectory.transcribing import Transcribed, solved
from impactfem.trajectory.transcriptions import transcription_of
from impactfem.trajectory.tree import turning_of

_COLUMN = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+")
_REST = (0.0, 0.0)
_CLOSED = 1e-9  # of the largest of states: loops that are more open at the start are open
_FINE = 10  # rows of what follows in each interval


@dataclass(frozen=True)
class Planned:
    """A motion of a scene that was found.

    Attributes:
        scene: As given.
        found: The motion, in coordinates of the bodies.
        rests: Columns that end at rest since nothing else was said.
        unseen: What the motion knows nothing of, for messages.
        columns: States (n,), controls (m,) and time to all columns, as a function of CasADi.
        names: Of the columns.
        at_start: Columns as the scene starts.
        limits: Of joints, by the column of their coordinate.
        fine: What really follows, at times (k,) also between nodes: states (k, n).
    """

    scene: Scene
    found: Transcribed
    rests: tuple[str, ...]
    unseen: tuple[str, ...]
    columns: Any
    names: tuple[str, ...]
    at_start: Mapping[str, float]
    limits: Mapping[str, tuple[float, float]]
    fine: tuple[Floats, Floats]

    def table(self, times: Floats, states: Floats) -> dict[str, Floats]:
        """All columns at some times (k,) of states (k, n)."""
        controls = self.found.control(times)
        values = [
            np.asarray(self.columns(t, x, u), dtype=float).ravel()
            for t, x, u in zip(times, states, controls, strict=True)
        ]
        named = dict(zip(self.names, np.array(values).T, strict=True))
        return {"time": times, **named, **dict(zip(self.found.controls, controls.T, strict=True))}


def trajectory(scene: Scene | str | Path) -> Planned:
    """Find the motion that [trajectory] of a scene asks for.

    Args:
        scene: With controls that act on forces, moments or motors of points and rigid bodies.

    Raises:
        SceneError: It has no such table, or bodies or forces without a form in symbols.
        MissingDependencyError: CasADi is not installed.
    """
    if not isinstance(scene, Scene):
        scene = Scene.from_toml(scene)
    wanted = scene.trajectory
    if wanted is None:
        raise SceneError(
            'trajectory: the scene asks for none; give [trajectory] with end = { "COLUMN" = VALUE }'
        )
    for control in scene.controls:
        until = scene.duration if control.end is None else control.end
        if control.begin > 0.0 or until < scene.duration:
            raise SceneError(
                f"control.{control.name}: a trajectory moves it from 0 to its end; leave from and "
                "until out, and hold it by a path formula"
            )
    if not scene.controls:
        raise SceneError("control: nothing may vary; give a [[control]] with name and acts")
    asked = _Asked(scene, wanted, symbolic(scene))
    problem, known = asked.problem(), asked.known
    starts = {control.name: control.values for control in scene.controls} | asked.turned
    if wanted.transcription == "hybrid":
        settings = wanted.nodes, wanted.refine or 0.0, wanted.max_iterations
        found, fine = hybrid(known, asked.gaps, problem, wanted.modes, settings, starts)
    else:
        found = solved(
            problem, wanted.transcription, wanted.nodes, wanted.refine or 0.0, starts,
            control=_course(scene), most=wanted.max_iterations,
        )  # fmt: skip
        events = bool(asked.struck) and not known.tree.beyond
        fine = by_events(known, asked.struck, found, _FINE) if events else found.follow(_FINE)
        # What sticks at the edge of its cone may stall events; a run of the scene tells then.
        stalls = problem.pairs is not None and not np.isfinite(fine[1]).all()
        if stalls:
            fine = found.follow(_FINE)
        elif events:
            found = found.with_followed("event_driven", fine[1][::_FINE])
    casadi, tree = loaded(), known.tree
    columns = casadi.Function(
        "columns", [tree.t, casadi.vertcat(tree.q, tree.v), asked.controls],
        [casadi.vertcat(*known.columns.values())],
    )  # fmt: skip
    begun = [*(f.start for f in tree.freedoms), *known.start]
    told = np.asarray(columns(0.0, begun, np.zeros(asked.controls.numel())), dtype=float).ravel()
    return Planned(
        scene, found, tuple(asked.rests), tuple(asked.unseen), columns, tuple(known.columns),
        dict(zip(known.columns, told.tolist(), strict=True)), _limits(scene, known), fine,
    )  # fmt: skip


def _course(scene: Scene) -> str:
    """How controls go between the nodes of shooting, as they all say."""
    courses = {control.course for control in scene.controls}
    return courses.pop() if len(courses) == 1 else "linear"


def _limits(scene: Scene, known: Symbolic) -> dict[str, tuple[float, float]]:
    """Limits of joints by the columns of their coordinates."""
    joints = ((f"{joint.name}.q", joint.limits) for joint in scene.joints)
    own = {name: (pair[0], pair[1]) for name, pair in joints if pair is not None}
    return {name: pair for name, pair in own.items() if name in known.columns} | dict(known.limits)


class _Asked:
    """What a scene asks, of its coordinates."""

    def __init__(self, scene: Scene, wanted: TrajectoryKeys, known: Symbolic) -> None:
        casadi = loaded()
        self.scene, self.wanted, self.known = scene, wanted, known
        tree = known.tree
        self.x = casadi.vertcat(tree.q, tree.v)
        self.names = [f.name for f in tree.freedoms] + [f.rate for f in tree.freedoms]
        self.rests: list[str] = []
        self.unseen: list[str] = []
        self.struck: list[Closing] = []
        self.gaps: list[Closing] = []
        hybrid = wanted.transcription == "hybrid"
        self.through = hybrid or transcription_of(wanted.transcription).through
        self.controls = known.controls

    def problem(self) -> Problem:
        """The problem.

        Raises:
            SceneError: A column is not known, or a limit cannot be.
        """
        casadi, known, tree = loaded(), self.known, self.known.tree
        x, t = self.x, tree.t
        states, paths = self._bounds()
        begun = [*(f.start for f in tree.freedoms), *known.start]
        start, start_rows = self._ends("start", {
            name: (value, value) for name, value in zip(self.names, begun, strict=True)
        })  # fmt: skip
        self._check_loops(start)
        end, end_rows = self._ends("end", {})
        turns = {each.name: 1.0 for each in tree.freedoms if each.turns or each.entry >= 0}
        transcription = self.wanted.transcription
        gaps, self.unseen = closings(self.scene, known)
        self.struck = [each for each in gaps if self.through and each.restitution]
        # Limits of joints that do not rebound are bounds of their coordinates.
        self.gaps = [g for g in gaps if g.known and (not g.limits or g in self.struck)]
        named = {control.name: control.limits for control in self.scene.controls}
        controls: dict[str, tuple[float, float]] = dict(named)
        told, factors = known.rate, tuple[tuple[Any, Any], ...]()
        pair_names: tuple[str, ...] = ()
        if transcription == "contact_implicit":
            touch = touching(known, self.gaps)
            self.struck, told, factors = self.gaps, touch.rate, touch.pairs
            pair_names = touch.pair_names
            self.controls = casadi.vertcat(known.controls, touch.symbols)
            controls |= dict.fromkeys(touch.names, (-np.inf, np.inf))
        elif tree.rubs:
            rub = tree.rubs[0]
            raise SceneError(
                f"{rub.key} = {rub.most:g}: turns with the sign of {rub.rate}, where it has no "
                f'slope; give trajectory.bounds."{rub.rate}" = [0.0, MOST] or [-MOST, 0.0], which '
                'keep the sign, or transcription = "contact_implicit"'
            )
        elif transcription == "hybrid":
            self.struck = self.gaps
        paths += [
            (f"{each.name} stays open", -each.gap)
            for each in gaps if each not in self.struck and not each.limits
        ]  # fmt: skip
        u = self.controls
        rate = casadi.Function("rate", [t, x, u], [casadi.vertcat(tree.v, told)])
        flat = casadi.vertcat(casadi.SX(0, 1), *(each for pair in factors for each in pair))
        pairs = casadi.Function("pairs", [t, x, u], [flat]) if factors else None
        running, final = self._cost()
        paths += self._paths()
        limited = casadi.Function("path", [t, x, u], [casadi.vertcat(*(e for _, e in paths))])
        shot = transcription not in {"contact_implicit", "hybrid"}
        impacts = tuple(each.impact(known) for each in self.struck) if shot else ()
        return Problem.of(
            rate, states, controls, (), self.duration, start, end,
            running=running, final=final, path=limited if paths else None,
            path_names=tuple(name for name, _ in paths),
            start_rows=tuple(start_rows), end_rows=tuple(end_rows),
            impacts=impacts,
            pairs=pairs, pair_names=pair_names, sizes=turns,
        )  # fmt: skip

    def _check_loops(self, start: Mapping[str, tuple[float, float]]) -> None:
        """Refuse a start in which loops are open, or may be.

        Raises:
            SceneError: They are.
        """
        tree = self.known.tree
        if not (tree.loops and self.wanted.start):
            return
        casadi = loaded()
        told = casadi.Function("open", [self.x], [casadi.vertcat(*tree.loops, tree.opening())])
        pairs = np.array([start.get(name, (np.nan, np.nan)) for name in self.names])
        off = np.abs(np.asarray(told(pairs[:, 0]), dtype=float)).max()
        if not off <= _CLOSED * np.abs(pairs).max() or np.ptp(pairs, axis=1).any():
            raise SceneError(
                f"trajectory.start.{next(iter(self.wanted.start))}: {tree.beyond}, which such a "
                "start opens or leaves open: put bodies of the scene where they begin, with their "
                "velocities, and leave start out"
            )

    @property
    def duration(self) -> tuple[float, float]:
        """Least and largest [s]."""
        span = self.wanted.duration or (self.scene.duration,)
        return span[0], span[-1]

    def _column(self, key: str, name: str) -> Any:
        if name not in self.known.columns:
            text = f"trajectory.{key}.{name}: there is no such column; columns: "
            raise SceneError(text + ", ".join(self.known.columns))
        return self.known.columns[name]

    def _as_state(self, column: Any) -> tuple[int, float, float] | None:
        """Place, slope and offset, if a column is a state but for these."""
        casadi = loaded()
        slopes = casadi.jacobian(column, self.x)
        if not slopes.is_constant() or slopes.nnz() != 1:
            return None
        numbers = np.asarray(casadi.evalf(casadi.densify(slopes)), dtype=float).ravel()
        place = int(np.abs(numbers).argmax())
        offset = casadi.Function("offset", [self.x], [column])
        return place, float(numbers[place]), float(offset(np.zeros(len(numbers))))

    def _ends(
        self, side: str, begun: dict[str, tuple[float, float]]
    ) -> tuple[dict[str, tuple[float, float]], list[Row]]:
        """Limits of states at an end, and rows of other columns."""
        given = dict(getattr(self.wanted, side))
        states, rows = dict(begun), list[Row]()
        if side == "end":
            given = self._rest(given) | given
            rows += self._rotated(given)
        for name, limits in given.items():
            column = self._column(side, name)
            one = self._as_state(column)
            if one is not None:
                states[self.names[one[0]]] = _moved(limits, one)
            elif np.isfinite(limits).any():
                rows.append(self._row(side, name, column, limits))
        self._check_held(side, rows, given)
        return {n: v for n, v in states.items() if np.isfinite(v).any()}, rows

    def _rotated(self, given: dict[str, tuple[float, float]]) -> list[Row]:
        """Rows of rotations at the end, whose columns are taken out of what is given."""
        self.rotations = asked_rotations(self.known.tree, given)
        for name in self.rotations:
            for letter in "wxyz":
                del given[f"{name}.q{letter}"]
        return [
            row for name, wanted in self.rotations.items()
            for row in rotation_rows(name, self.known.tree, wanted, self.x)
        ]  # fmt: skip

    @property
    def turned(self) -> dict[str, Floats]:
        """Ways and rates of quaternions to begin with, by the states that they are."""
        found, known = dict[str, Floats](), self.known
        duration = float(np.sqrt(np.prod(self.duration)))
        for name, wanted in self.rotations.items():
            four = known.tree.quaternions[name]
            start = np.array([each.start for each in known.tree.freedoms[four]])
            spin = np.asarray(loaded().evalf(turning_of(start))) @ known.start[four]
            way = turned(start, wanted, spin)
            rates = np.gradient(way, duration / (len(way) - 1), axis=0)
            found |= dict(zip(self.names[four], way.T, strict=True))
            found |= {f"{state}_rate": rates[:, k] for k, state in enumerate(self.names[four])}
        return found

    def _check_held(self, side: str, rows: Sequence[Row], given: Mapping[str, Any]) -> None:
        """Refuse a start that is said of what follows from coordinates that are held."""
        if side == "start" and rows:
            name = rows[0].name.partition(" ")[0]
            if name.rpartition(".")[0] in self.known.tree.quaternions:
                raise SceneError(
                    f"trajectory.start.{name}: how a body is turned and spins at t = 0 is the "
                    "body's to say: give its orientation and angular velocity, and leave this out"
                )
            raise SceneError(
                f"trajectory.start.{name}: follows from "
                f"{', '.join(n for n in self.names if n not in given)}; give these"
            )

    def _rest(self, given: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
        """Rates that end at 0: those of coordinates that are said, without a word on their own."""
        found = {}
        for name in given:
            for rate in _rates_of(name):
                if rate in self.known.columns and rate not in given:
                    found[rate] = _REST
        self.rests = list(found)
        return found

    def _row(self, side: str, name: str, column: Any, limits: tuple[float, float]) -> Row:
        casadi = loaded()
        of = casadi.Function("row", [self.x], [column])
        sizes = [abs(value) for value in limits if np.isfinite(value) and value]
        low, high = limits
        told = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        return Row(f"{name} = {told} at the {side}", of, low, high, max(sizes, default=1.0))

    def _bounds(self) -> tuple[dict[str, Any], list[tuple[str, Any]]]:
        """Limits of states, and of columns that are none, as paths."""
        states: dict[str, tuple[float, float]] = dict.fromkeys(self.names, (-np.inf, np.inf))
        struck = {f"{j.name}.q" for j in self.scene.joints if j.restitution and self.through}
        every = _limits(self.scene, self.known)
        states |= {name: pair for name, pair in every.items() if name not in struck}
        paths: list[tuple[str, Any]] = []
        for name, limits in self.wanted.bounds.items():
            column = self._column("bounds", name)
            one = self._as_state(column)
            if one is not None:
                low, high = _moved(limits, one)
                least, most = states[self.names[one[0]]]
                states[self.names[one[0]]] = max(low, least), min(high, most)
                continue
            low, high = limits
            paths += [(f"{name} >= {low:g}", low - column)] * bool(np.isfinite(low))
            paths += [(f"{name} <= {high:g}", column - high)] * bool(np.isfinite(high))
        return states, paths

    def _paths(self) -> list[tuple[str, Any]]:
        """Formulas of columns that stay <= 0."""
        found = []
        for index, text in enumerate(self.wanted.path):
            used: dict[str, Any] = {}

            def named(match: re.Match[str], used: dict[str, Any] = used, index: int = index) -> str:
                column = self._column(f"path[{index}]", match.group())
                name = f"column_{_letters(len(used))}"
                used[name] = column
                return name

            plain = _COLUMN.sub(named, text)
            known = {c.name: self.known.controls[k] for k, c in enumerate(self.scene.controls)}
            known |= used | {"t": self.known.tree.t}
            try:
                formula = Formula(plain, tuple(known))
            except FormulaError as error:
                raise SceneError(f"trajectory.path[{index}] = {show(text)}: {error}") from None
            found.append((text, in_symbols(formula, known)))
        return found

    def _cost(self) -> tuple[Any, Any]:
        """Integrand, and cost of the end."""
        casadi, known = loaded(), self.known
        names = [control.name for control in self.scene.controls]
        terms = [(c.term, c.of, c.weight) for c in self.wanted.cost]
        terms = terms or [("effort", name, 1.0) for name in names]
        effort: Any = 0.0
        time = 0.0
        for index, (term, of, weight) in enumerate(terms):
            if term == "time":
                time += weight
                continue
            if of not in names:
                raise SceneError(
                    f"trajectory.cost[{index}].of = {show(of)}: there is no such control; "
                    f"controls: {', '.join(names)}"
                )
            effort = effort + weight * known.controls[names.index(of)] ** 2
        running = casadi.Function(
            "running", [known.tree.t, self.x, self.controls], [casadi.SX(effort)]
        )
        return running, (lambda t, *_: time * t) if time else None


def _moved(limits: tuple[float, float], one: tuple[int, float, float]) -> tuple[float, float]:
    """Limits of a state, of those of a column that is slope times it and an offset."""
    _, slope, offset = one
    low, high = sorted((limit - offset) / slope for limit in limits)
    return low, high


def _rates_of(column: str) -> list[str]:
    """Columns of the rates of one."""
    head, _, last = column.rpartition(".")
    turning = dict.fromkeys(("qw", "qx", "qy", "qz"), ("wx", "wy", "wz"))
    rates = {"x": ("vx",), "y": ("vy",), "z": ("vz",), "angle": ("spin",), "q": ("v",)} | turning
    return [f"{head}.{rate}" for rate in rates.get(last, ())]


def _letters(number: int) -> str:
    """A name without digits, of which formulas know none."""
    found = ""
    while True:
        found += chr(ord("a") + number % 26)
        number //= 26
        if not number:
            return found
