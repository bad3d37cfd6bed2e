"""One point of a sweep: run, sum up; and the process that does so for others."""

import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError, FolderError, ImpactError, MeshError, SceneError
from impactfem.scene import Scene
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.facade import Result

FIGURES: Mapping[str, str] = {
    "status": "status",
    "verdict": "verdict.level",
    "method": "method",
    "max_force": "contact.max_force",
    "max_impulse": "contact.max_impulse",
    "impulse": "contact.impulse",
    "error": "error.displacement_max",
    "energy_drift": "energy.final_relative_drift",
    "steps": "num_steps",
    "wall_time": "wall_time",
}
"""Figures of every point, by name: their place in ``summary.json``."""

IMPACTS = "impacts"
"""Section that takes the impacts one by one."""
LONGEST = 300
"""Letters of a message."""
_MOST = 1000  # last values of a section that are kept
_PLACE, _SPEED = ("x", "y", "z"), ("vx", "vy", "vz")
_ENDS: Mapping[str, Callable[[Floats], float]] = {
    "min": lambda values: float(np.nanmin(values)),
    "max": lambda values: float(np.nanmax(values)),
    "last": lambda values: float(values[-1]),
}


@dataclass(frozen=True)
class Asked:
    """What is asked of each point.

    Attributes:
        figures: Places in ``summary.json`` such as "contact.impulse", or columns of the history
            with .min, .max or .last behind, as "ball.y.max".
        section: Column of the history that is looked at once in a period, or "impacts": time of
            each, with its speed away from what was struck. None for no section.
        period: [s].
        after: Time from which on [s]; before, the motion settles.
    """

    figures: tuple[str, ...] = ()
    section: str | None = None
    period: float = 0.0
    after: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what makes no sense.

        Raises:
            SceneError: A section has no period.
        """
        if self.section is not None and not self.period > 0.0:
            raise SceneError(f"--section {self.section} takes --period T, a time > 0 in s")


@dataclass(frozen=True)
class Point:
    """What a point gave.

    Attributes:
        code: Exit code that ``impactfem run`` would have had.
        figures: By name; empty if there is no result.
        section: Rows of time [s], phase [s] and value.
        message: Why it failed, or the first thing against trusting it.
        end: Of a sweep that continues: settings that let a scene start where this one ended.
    """

    code: int
    figures: Mapping[str, Any] = field(default_factory=dict)
    section: list[list[float]] = field(default_factory=list)
    message: str = ""
    end: Mapping[str, Any] = field(default_factory=dict)


def run_point(
    scene: Scene, settings: Mapping[str, Any], asked: Asked, *, ends: bool = False
) -> Point:
    """Run a scene with some keys changed; what cannot be done is told, not raised.

    Args:
        scene: The scene.
        settings: Values by key.
        asked: What is asked of it.
        ends: Whether the end is kept, for a run that goes on from there.
    """
    from impactfem.solving import solve  # noqa: PLC0415  (loads much)

    try:
        result = solve(scene.with_settings(settings))
        summary = result.summary
        figures = {name: _at(summary, place) for name, place in FIGURES.items()}
        figures |= {name: _figure(result, name) for name in asked.figures}
        section = [] if asked.section is None else _section(result, asked.section, asked)
    except (ImpactError, MemoryError) as error:
        return Point(_code(error), message=str(error)[:LONGEST])
    verdict = summary["verdict"]
    trusted = verdict["level"] != "do_not_trust"
    message = "" if trusted else str(verdict["findings"][0]["text"])[:LONGEST]
    end = end_of(result) if ends else {}
    return Point(0 if trusted else 3, figures, section, message, end)


def end_of(result: "Result") -> dict[str, Any]:
    """Settings that let a scene of points and rods start where a run ended."""
    found: dict[str, Any] = {}
    for index, body in enumerate(result.scene.bodies):
        columns = {
            name: float(result.rows[f"{body.name}.{name}"].values[-1])
            for name in ("x", "y", "z", "vx", "vy", "vz", "angle", "spin")
            if f"{body.name}.{name}" in result.rows
        }
        dim = result.scene.dim  # columns are those of space
        place, speed = ([columns[k] for k in names[:dim]] for names in (_PLACE, _SPEED))
        at = {"position": place} if body.kind == "point" else {
            "center": place, "inclination": math.remainder(columns["angle"], 2.0 * math.pi),
            "angular_velocity": columns["spin"],
        }  # fmt: skip
        found |= {f"body.{index}.{key}": value for key, value in (at | {"velocity": speed}).items()}
    return found


def _code(error: BaseException) -> int:
    if isinstance(error, SceneError | MeshError | FolderError):
        return 2
    return 3 if isinstance(error, ConvergenceError) else 1


def _at(summary: Mapping[str, Any], place: str, unknown: Any = None) -> Any:
    """What stands at a place of a summary."""
    found: Any = summary
    for part in place.split("."):
        if not isinstance(found, Mapping) or part not in found:
            return unknown
        found = found[part]
    return found if isinstance(found, str | int | float | bool) or found is None else unknown


def _figure(result: "Result", name: str) -> Any:
    column, _, end = name.rpartition(".")
    if end in _ENDS and column in result.rows:
        return _ENDS[end](result.rows[column].values)
    found = _at(result.summary, name, _ENDS)
    if found is _ENDS:
        raise SceneError(
            f"--figure {show(name)}: no number in summary.json has this place, as "
            "contact.impulse, and no column of the history with .max, .min or .last behind it"
        )
    return found


def _section(result: "Result", column: str, asked: Asked) -> list[list[float]]:
    """Rows of time, phase and value."""
    if column == IMPACTS:
        if result.impacts is None:
            raise SceneError(
                f"--section impacts: {result.summary['method']} tells no impacts one by one; name "
                "a column of the history, or take event_driven"
            )
        times, values = result.impacts.time, result.impacts.after
        own = times >= asked.after
        times, values = times[own], values[own]
    else:
        if column not in result.rows:
            raise SceneError(
                f"--section {show(column)}: the history has no such column; "
                'give one of history.csv, or "impacts"'
            )
        every = result.rows["time"].values
        first = np.ceil(asked.after / asked.period)
        times = asked.period * np.arange(first, np.floor(every[-1] / asked.period) + 1.0)
        values = np.interp(times, every, result.rows[column].values)
    rows = np.column_stack([times, times % asked.period, values])[-_MOST:]
    return [[float(each) for each in row] for row in rows]


def main() -> None:
    """Run points that lines of standard input name, until it ends."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    # Libraries print where they like: answers have a stream of their own.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    from impactfem.extensions import load, load_installed  # noqa: PLC0415

    load_installed()
    for extension in sys.argv[1:]:
        load(extension)
    head = json.loads(sys.stdin.readline())
    scene = Scene.from_dict(json.loads(head["scene"]), base=head["folder"] or None)
    asked = Asked(**head["asked"] | {"figures": tuple(head["asked"]["figures"])})
    run_lines(scene, asked, sys.stdin, answers)


def run_lines(scene: Scene, asked: Asked, lines: Iterable[str], answers: TextIO) -> None:
    """Run the points of some lines, and answer each by a line."""
    for line in lines:
        point = run_point(scene, json.loads(line), asked)
        answers.write(json.dumps(vars(point)) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
