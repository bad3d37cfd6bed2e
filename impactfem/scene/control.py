"""Controls: histories in pieces that formulas use by name, and that an optimisation finds."""

import math
import re
from bisect import bisect_right
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.scene.grammar import Node
from impactfem.scene.inline import NumberOrList, Vector
from impactfem.scene.inverse import check_formula_name
from impactfem.scene.kinds import Choice, Integer, Line, Name, Real
from impactfem.scene.pieces import Table
from impactfem.scene.schema import KeyedError, check_ends, key, table
from impactfem.scene.tables import assign, is_missing, looked_up
from impactfem.scene.values import NotAllowedError, is_number, number, show

MAX_CONTROLS = 100
MAX_PIECES = 10_000
COURSES = ("constant", "linear")
AXES = "xyz"
_LOADS = {"traction": "tractions", "pressure": "pressures", "motion": "supports"}
_IN_JOINT = re.compile(r"(body\.[^.]+)\.joints\.([^.]+)\.motor")
_ON_CENTRE = re.compile(r"((body\.[^.]+)\.(?:force|moment))\.[xyz]")
_ON_SURFACE = re.compile(r"body\.([^.]+)\.(traction|pressure|motion)\.([^.]+)(\.[^.]+)?")
"""`body.NAME.traction.SURFACE.x`: loads by the names of surfaces, of plates of faces and edges."""


@table("[[control]]")
class Control:
    """A history in equal pieces of time, or a course in pieces of x, 0 before and after.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    heading: ClassVar[str] = "control"

    name: str = key(Name(), "name of the control; formulas in t may use it")
    acts: str | None = key(
        Line(), "path of a formula in t that it is added to, as body.ball.force.x, "
        "body.S.traction.SURFACE.x, body.S.motion.SURFACE.y, joint.J.motor; of plates "
        "body.P.pressure.top, body.P.motion.EDGE", default=None,
        absent="its name stands in formulas",
    )  # fmt: skip
    course: str = key(
        Choice(COURSES), "whether a piece has one value, or goes from one value to the next",
        name="kind", default=COURSES[0],
    )  # fmt: skip
    along: str = key(
        Choice(("t", "x")), "whether its pieces follow each other in time, or along x of a body",
        default="t",
    )  # fmt: skip
    pieces: int = key(
        Integer(1, MAX_PIECES), "how many pieces; a trajectory takes its nodes instead", default=1
    )
    begin: float = key(
        Real(), "where the first piece begins", name="from", unit="s or m", default=0.0
    )
    end: float | None = key(
        Real(), "where the last piece ends; along x it has to be given", name="until",
        unit="s or m", default=None, absent="the duration",
    )  # fmt: skip
    start: Sequence[float] = key(
        NumberOrList(Real(), MAX_PIECES + 1),
        "values to begin with, and those of plain runs: one for all, or one of each piece (of each "
        "end of a piece where they are linear)",
        default=(0.0,),
    )  # fmt: skip
    bounds: Sequence[float] | None = key(
        Vector((2,)), "least and largest value", default=None, absent="none"
    )

    def _check(self) -> None:
        check_formula_name(self.heading, self.name, "give another name")
        if self.along == "t" and self.begin < 0.0:
            text = f" = {self.begin:g} s is before t = 0: give 0 or later."
            raise KeyedError(self.heading, "from", text)
        if self.end is not None and not self.end > self.begin:
            text = f" = {self.end:g} is not after from = {self.begin:g}: give a later time or "
            raise KeyedError(self.heading, "until", f"{text}place.")
        if self.along == "x" and self.end is None:
            raise KeyedError(self.heading, "until", " is missing: give a place, as the length.")
        if len(self.start) not in {1, self.count}:
            text = f" has {len(self.start)} values: give one, or {self.count}."
            raise KeyedError(self.heading, "start", text)
        low, high = self.limits
        check_ends(self.heading, "bounds", low, high)
        if not all(low <= value <= high for value in self.start):
            text = f" = {show([low, high])} excludes a start: widen them."
            raise KeyedError(self.heading, "bounds", text)

    @property
    def is_linear(self) -> bool:
        """Whether a piece goes from one value to the next."""
        return self.course == COURSES[1]

    @property
    def count(self) -> int:
        """How many values it has."""
        return self.pieces + (self.is_linear)

    @property
    def values(self) -> tuple[float, ...]:
        """Its values as the scene has them."""
        return tuple(self.start) if len(self.start) > 1 else tuple(self.start) * self.count

    @property
    def limits(self) -> tuple[float, float]:
        """Bounds; infinite where there are none."""
        low, high = self.bounds or (-math.inf, math.inf)
        return low, high

    def times(self, duration: float) -> Floats:
        """Ends of its pieces in a run that lasts so long [s], [m] along x; (pieces + 1,)."""
        return np.linspace(self.begin, duration if self.end is None else self.end, self.pieces + 1)

    def tree(self, duration: float) -> Node:
        """The control as a node of formulas in t or x."""
        times, values = self.times(duration), np.array(self.values)
        slopes = np.diff(values) / np.diff(times) if self.is_linear else np.zeros(self.pieces)
        starts, places = values[: self.pieces], times.copy()
        if self.along == "x":  # the end of a bar is part of its last piece
            places[-1] = np.nextafter(times[-1], np.inf)
        begun, ended = np.zeros(1), np.zeros(1)
        if times[0] == 0.0:
            places, begun = places[1:], begun[1:]
        if self.along == "t" and times[-1] >= duration:  # what holds to the end jumps not there
            places, ended = places[:-1], ended[1:]
        if not len(places) and not self.is_linear:
            return self.values[0]
        table = Table.of(
            places, np.concatenate([begun, starts, ended]),
            np.concatenate([begun, slopes, ended]), np.concatenate([begun, times[:-1], ended]),
        )  # fmt: skip
        return ("table", table, ("variable", self.along))

    def at(self, t: ArrayLike, duration: float) -> Floats:
        """Its values at some times [s], of the piece that begins there."""
        times, values, now = self.times(duration), np.array(self.values), np.asarray(t, dtype=float)
        if self.is_linear:
            return np.asarray(np.interp(now, times, values, left=0.0, right=0.0))
        place = np.searchsorted(times, now, side="right") - 1
        inside = (place >= 0) & (place < self.pieces)
        return np.where(inside, values[np.clip(place, 0, self.pieces - 1)], 0.0)

    def reader(self, duration: float) -> Callable[[float], float]:
        """The same of one time, for many calls."""
        times, values = self.times(duration), np.array(self.values)
        if self.is_linear:
            return lambda t: float(np.interp(t, times, values, left=0.0, right=0.0))
        ends, each = times.tolist(), [0.0, *values.tolist(), 0.0]
        return lambda t: each[bisect_right(ends, t)]

    def effort(self, duration: float) -> float:
        """Integral of its square over time."""
        lengths, values = np.diff(self.times(duration)), np.array(self.values)
        if not self.is_linear:
            return float(lengths @ values**2)
        a, b = values[:-1], values[1:]
        return float(lengths @ (a * a + a * b + b * b) / 3.0)

    def effort_slope(self, duration: float) -> Floats:
        """Derivatives of the effort by the values, (count,)."""
        lengths, values = np.diff(self.times(duration)), np.array(self.values)
        if not self.is_linear:
            return np.asarray(2.0 * lengths * values)
        a, b = values[:-1], values[1:]
        return (
            np.append(lengths * (2.0 * a + b), 0.0) / 3.0
            + np.insert(lengths * (a + 2.0 * b), 0, 0.0) / 3.0
        )


def acted(
    data: dict[str, Any], controls: Sequence[Control], keys: Mapping[str, Collection[str]]
) -> tuple[Control, ...]:
    """Put controls into the formulas that they act on.

    Args:
        data: Plain tables of the scene; changed.
        controls: Read from it.
        keys: That bodies of each kind have, whether they are given or not.

    Returns:
        The controls, which then stand in formulas by name.

    Raises:
        KeyedError: naming the key.
    """
    found = []
    for index, control in enumerate(controls):
        if control.acts is None:
            found.append(control)
            continue
        try:
            put_into(data, control.acts, control.name, keys)
        except NotAllowedError as error:
            text = f" = {show(control.acts)}: {error}. What it acts on has to stand there, as 0."
            raise KeyedError(f"control[{index}]", "acts", text) from None
        found.append(replace(control, acts=None))
    return tuple(found)


def put_into(
    data: dict[str, Any], path: str, name: str, keys: Mapping[str, Collection[str]]
) -> None:
    """Add a name to the formula at a path, unless it stands there already.

    Args:
        data: Plain tables of the scene; changed.
        path: Of the formula; x, y and z are entries of a list.
        name: That formulas know.
        keys: See `acted`.

    Raises:
        NotAllowedError: There is no formula.
    """
    path = _loaded(data, path)
    if (on := _ON_CENTRE.fullmatch(path)) and is_missing(data, on[1]):
        _add_none(data, on[1], keys)
    head, _, last = path.rpartition(".")
    path = f"{head}.{AXES.index(last)}" if last in AXES and last else path
    present = _present(data, path, keys)
    if isinstance(present, Mapping):  # a measured signal
        data, path, present = cast("Any", present), "formula", present.get("formula", "signal")
    if not re.search(rf"\b{name}\b", str(present)):
        assign(data, path, name if present in (0, "0") else f"({present}) + {name}")


def _loaded(data: dict[str, Any], path: str) -> str:
    """Path of the value of a traction, pressure or motion that is named by its surface.

    Tractions and pressures of which the body has none there are added to the scene, as 0, and so
    are joints of mechanisms that it does not name.

    Raises:
        NotAllowedError: There is no such body, or a plate has no such loads.
    """
    if (joint := _IN_JOINT.fullmatch(path)) and looked_up(data, f"{joint[1]}.kind") == "mechanism":
        for table in (f"{joint[1]}.joints", f"{joint[1]}.joints.{joint[2]}"):
            if is_missing(data, table):
                assign(data, table, {})
    named = _ON_SURFACE.fullmatch(path)
    if named is None:
        return path
    body, load, surface, axis = named.groups()
    place, where = f"body.{body}.{_LOADS[load]}", f".{surface}.value{axis or ''}"
    plate = looked_up(data, f"body.{body}.kind") == "plate"
    if load == "motion":
        return f"{place}.{surface}.motion{axis or ''}" if plate else place + where
    if plate and load == "traction":
        raise NotAllowedError(f"plates have no tractions; give body.{body}.pressure.top")
    given = [] if is_missing(data, place) else cast("list[Any]", looked_up(data, place))
    face = "face" if plate else "surface"
    if all(each.get(face) != surface for each in given):
        none: Any = 0
        if load == "traction":
            none = [0] * (3 if looked_up(data, f"body.{body}.model") == "3d" else 2)
        assign(data, place, [*given, {face: surface, "value": none}])
    return place + where


def _add_none(data: dict[str, Any], path: str, keys: Mapping[str, Collection[str]]) -> None:
    """Give a body that may have a force or a moment one of 0, along as many axes as its place."""
    owner, _, name = path.rpartition(".")
    if name not in keys.get(str(looked_up(data, f"{owner}.kind")), ()):
        return
    shaped = not is_missing(data, f"{owner}.shape")
    places = ("shape.center", "shape.corner", "position")[0 if shaped else 2 :]
    for place in (f"{owner}.{each}" for each in places):
        if not is_missing(data, place) and isinstance(at := looked_up(data, place), list):
            assign(data, path, [0] * len(at))


def _present(data: dict[str, Any], path: str, keys: Mapping[str, Collection[str]]) -> object:
    """The number, formula or signal at a path; 0 where a body does not give a key that it has.

    Raises:
        NotAllowedError: There is none.
    """
    head, _, last = path.rpartition(".")
    if head.count(".") == 1 and is_missing(data, path):
        kind = looked_up(data, f"{head}.kind") if head.startswith("body.") else head.split(".")[0]
        if last in keys.get(str(kind), ()):
            return 0
    if last == "motor" and re.match(r"joint|body\.[^.]+\.joints", path) and is_missing(data, path):
        return 0
    found = looked_up(data, path)
    told = isinstance(found, str) or (isinstance(found, Mapping) and "table" in found)
    if not is_number(found) and not told:
        raise NotAllowedError(f"it is {show(found)}; give the path of a formula in t")
    return found


def named_histories(controls: Sequence[Control], duration: object) -> Mapping[str, Node]:
    """Histories and courses that formulas know by name."""
    try:
        known = number(duration) if controls else 1.0
    except NotAllowedError:  # which is told where the scene is checked
        known = 1.0
    return {control.name: control.tree(known) for control in controls}
