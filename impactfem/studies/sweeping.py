"""Sweeps: a scene at many values of some of its keys, in several processes, that can be resumed."""

import csv
import hashlib
import itertools
import json
import math
import os
import subprocess
import sys
import tempfile
import threading
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from impactfem.errors import FolderError, OutputError, SceneError
from impactfem.extensions import load
from impactfem.scene import Scene, parse_assignment
from impactfem.scene.values import show
from impactfem.studies.forked import Forked
from impactfem.studies.sweep_point import FIGURES, LONGEST, Asked, Point, run_lines, run_point

MOST = 100_000
"""Largest number of points."""
_PHASE = 1e-6  # periods by which a duration may miss a whole number of them
KEPT = "points.jsonl"
"""File of the points that are done, of which a sweep takes what it has."""


@dataclass(frozen=True)
class Axis:
    """A key and its values.

    Attributes:
        key: Path in the scene, as of ``--set``.
        values: Of it.
    """

    key: str
    values: tuple[Any, ...]

    @classmethod
    def parse(cls, text: str) -> "Axis":
        """Read ``key=a:b:n`` (n values from a to b) or ``key=v1,v2,v3``.

        Raises:
            SceneError: It is neither.
        """
        key, equals, given = (part.strip() for part in text.partition("="))
        if not (key and equals and given):
            raise SceneError(
                f"--vary {show(text)}: write key=a:b:n (n values from a to b) or key=v1,v2,v3"
            )
        parts = given.split(":")
        if len(parts) == 3:
            with suppress(ValueError):
                first, last, count = float(parts[0]), float(parts[1]), int(parts[2])
                if count < 1 or not math.isfinite(first + last) or (count == 1 and first != last):
                    raise SceneError(
                        f"--vary {show(text)}: a:b:n takes two finite numbers and a count from 2 on"
                    )
                return cls(key, tuple(np.linspace(first, last, count).tolist()))
        try:
            return cls(key, tuple(tomllib.loads(f"values = [{given}]")["values"]))
        except (ValueError, RecursionError):
            return cls(key, tuple(parse_assignment(f"x={each}")[1] for each in given.split(",")))


@dataclass(frozen=True)
class Sweep:
    """What a sweep found.

    Attributes:
        title: Of the scene.
        axes: What was varied; the last one changes fastest.
        asked: What was asked of each point.
        points: One for each combination, in order.
        taken: How many were done before.
        continued: Whether each point began where the one before ended, up and down again.
    """

    title: str
    axes: tuple[Axis, ...]
    asked: Asked
    points: tuple[Point, ...]
    taken: int = 0
    continued: bool = False

    @property
    def names(self) -> list[str]:
        """Names of the columns of `rows`."""
        way = ["way"] * self.continued
        return ["point", *(axis.key for axis in self.axes), *way, "exit", *FIGURES,
                *self.asked.figures, "message"]  # fmt: skip

    @property
    def ways(self) -> list[str]:
        """Of each point, if it is continued, whether it lies on the way "there" or "back"."""
        half = len(self.points) // 2
        return ["there"] * half + ["back"] * half if self.continued else []

    def rows(self) -> list[list[Any]]:
        """The table: values, exit code, figures and message of each point."""
        names = (*FIGURES, *self.asked.figures)
        return [
            [
                k,
                *values,
                *self.ways[k : k + 1],
                point.code,
                *(point.figures.get(name) for name in names),
                point.message,
            ]
            for k, (values, point) in enumerate(zip(combined(self.axes), self.points, strict=True))
        ]  # fmt: skip

    def column(self, name: str) -> list[Any]:
        """A column of the table."""
        at = self.names.index(name)
        return [row[at] for row in self.rows()]

    @property
    def failed(self) -> int:
        """How many points have no result."""
        return sum(not point.figures for point in self.points)

    def summary(self) -> dict[str, Any]:
        """Figures for ``summary.json``."""
        codes = [point.code for point in self.points]
        return {
            "title": self.title, "kind": "sweep", "points": len(codes), "failed": self.failed,
            "exit_codes": {str(code): codes.count(code) for code in sorted({*codes})},
            "axes": {axis.key: list(axis.values) for axis in self.axes},
            "section": self.asked.section, "continued": self.continued,
        }  # fmt: skip

    def save(self, folder: str | Path) -> None:
        """Write sweep.csv, section.csv, summary.json and pictures.

        Raises:
            OutputError: The folder cannot be written.
        """
        from impactfem.report.sheet import write_png  # noqa: PLC0415
        from impactfem.studies.sweep_figure import section_figure, sweep_figure  # noqa: PLC0415

        folder = Path(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _write(folder / "sweep.csv", [self.names, *self.rows()])
            write_png(sweep_figure(self), folder / "sweep.png")
            if self.asked.section:
                keys = [axis.key for axis in self.axes]
                _write(folder / "section.csv", [["point", *keys, *SECTION], *self.section_rows()])
                write_png(section_figure(self), folder / "section.png")
            text = json.dumps(self.summary(), indent=2, default=str)
            (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
        except OSError as error:
            raise _cannot(folder, error) from None

    def section_rows(self) -> list[list[Any]]:
        """Of each value of the section: point, values of the keys, time, phase and value."""
        found = []
        for k, (values, point) in enumerate(zip(combined(self.axes), self.points, strict=True)):
            found += [[k, *values, *row] for row in point.section]
        return found


SECTION = ("time", "phase", "value")
"""Last columns of section.csv: time [s], phase [s] in a period, value."""


def sweep(
    scene: Scene,
    vary: Sequence[Axis] | Mapping[str, Sequence[Any]],
    *,
    folder: Path | None = None,
    jobs: int = 1,
    asked: Asked | None = None,
    continued: bool = False,
    extensions: Sequence[str] = (),
    say: Callable[[str], None] = lambda _: None,
) -> Sweep:
    """Run a scene at all combinations of values of some keys.

    A point that fails is a row with the exit code that ``impactfem run`` would have had, and the
    others go on; of several processes also one that crashes.

    Args:
        scene: The scene.
        vary: Values by key, as of ``--set``.
        folder: Where points that are done are kept: a sweep that was killed goes on from there
            when it is asked for again. None: they are not kept.
        jobs: Number of processes; 1: this one.
        asked: What is asked of each point besides `FIGURES`.
        continued: Let each run start where the one before has ended, through all values and back
            again: branches are followed, and where both ways differ there is hysteresis. One
            key; points and rods; one after the other, whatever the jobs; the duration is a whole
            number of periods, so that what is driven goes on in phase.
        extensions: Modules that the processes load.
        say: Told of each point.

    Raises:
        SceneError: A key is unknown, or no point can be run as it is said.
        FolderError: The folder keeps another sweep.
        OutputError: It cannot be written.
    """
    axes = tuple(vary) if not isinstance(vary, Mapping) else tuple(
        Axis(key, tuple(values)) for key, values in vary.items()
    )  # fmt: skip
    asked = asked or Asked()
    if continued:
        axes = _there_and_back(scene, axes, asked)
    settings = _checked(scene, axes, jobs)
    text = json.dumps(scene.given())
    told = [text, [vars(axis) for axis in axes], vars(asked), *(["continued"] * continued)]
    kept = _Kept.of(folder, told)
    found = dict(kept.points)
    left = [k for k in range(len(settings)) if k not in found]
    if found:
        say(f"{len(found)} of {len(settings)} points are taken from {folder}")
    waiting = [(k, settings[k]) for k in left]
    run = (
        _continue(scene, waiting, asked, found) if continued
        else _run(scene, text, waiting, asked, jobs, extensions)
    )  # fmt: skip
    for done, (index, point) in enumerate(run, len(found) + 1):
        kept.add(index, point)
        found[index] = point
        shown = ", ".join(f"{key} = {show(value)}" for key, value in settings[index].items())
        say(f"{done}/{len(settings)}: {shown}: exit {point.code} {point.message}".rstrip())
    points = tuple(found[k] for k in range(len(settings)))
    return Sweep(scene.title, axes, asked, points, len(settings) - len(left), continued)


def _there_and_back(scene: Scene, axes: Sequence[Axis], asked: Asked) -> tuple[Axis, ...]:
    """The values and the same backwards.

    Raises:
        SceneError: The scene cannot go on from its end.
    """
    if len(axes) != 1:
        raise SceneError(f"sweep --continue: it follows one key, not {len(axes)}; vary one")
    others = [body for body in scene.bodies if body.kind not in {"point", "rod"}]
    if others:
        raise SceneError(
            f"sweep --continue: {others[0].name} is a {others[0].kind}; only points and rods start "
            "where they ended, as they are their places and velocities: leave --continue out"
        )
    if not asked.period > 0.0:
        raise SceneError(
            "sweep --continue: it takes --period T, the time after which what drives repeats"
        )
    periods = scene.duration / asked.period
    if (whole := round(periods)) < 1 or abs(periods - whole) > _PHASE:
        raise SceneError(
            f"sweep --continue: duration = {scene.duration:g} is {periods:.9g} periods of "
            f"{asked.period:g} s, so that what drives would jump; give duration = "
            f"{max(whole, 1) * asked.period!r}"
        )
    (axis,) = axes
    return (Axis(axis.key, (*axis.values, *reversed(axis.values))),)


def _continue(
    scene: Scene, points: Sequence[tuple[int, dict[str, Any]]], asked: Asked,
    done: Mapping[int, Point],
) -> Iterator[tuple[int, Point]]:  # fmt: skip
    """Run points one after the other, each from the last end there is."""
    known = [done[k].end for k in sorted(done) if done[k].end]
    last = known[-1] if known else {}
    for index, settings in points:
        point = run_point(scene, {**last, **settings}, asked, ends=True)
        last = point.end or last
        yield index, point


def combined(axes: Sequence[Axis]) -> Iterator[tuple[Any, ...]]:
    """All combinations of values, the last axis fastest."""
    return itertools.product(*(axis.values for axis in axes))


def _checked(scene: Scene, axes: Sequence[Axis], jobs: int) -> list[dict[str, Any]]:
    """Settings of all points.

    Raises:
        SceneError: They make no sense.
    """
    keys = [axis.key for axis in axes]
    if not axes or len({*keys}) < len(keys):
        raise SceneError("sweep: give one or more keys to vary, each once")
    count = math.prod(len(axis.values) for axis in axes)
    if not 0 < count <= MOST:
        raise SceneError(f"sweep: {count} points; give 1 to {MOST}")
    if not 1 <= jobs <= 1000:
        raise SceneError(f"sweep: jobs = {jobs}: give a number of processes from 1 to 1000")
    settings = [dict(zip(keys, values, strict=True)) for values in combined(axes)]
    faults = []
    for each in {0: settings[0], 1: settings[-1]}.values():
        try:
            scene.with_settings(each)
        except SceneError as error:
            faults.append(error)
    if len(faults) == 2:
        raise faults[0]
    return settings


@dataclass
class _Kept:
    """Points that are done, in a file to which each is appended.

    Attributes:
        path: Of the file; None for none.
        points: What it held.
    """

    path: Path | None
    points: dict[int, Point] = field(default_factory=dict)

    @classmethod
    def of(cls, folder: Path | None, what: list[Any]) -> "_Kept":
        """Read it, or begin one.

        Raises:
            FolderError: It is of another sweep, or the folder holds something else.
            OutputError: It cannot be written.
        """
        if folder is None:
            return cls(None)
        digest = hashlib.sha256(json.dumps(what, default=str).encode()).hexdigest()
        head = json.dumps({"sweep": digest})
        path = folder / KEPT
        try:
            if path.exists():
                return cls._read(path, head)
            if folder.exists() and any(folder.iterdir()):
                raise FolderError(f"{folder}: holds other files; choose another folder (--out)")
            folder.mkdir(parents=True, exist_ok=True)
            path.write_text(head + "\n", encoding="utf-8")
        except OSError as error:
            raise _cannot(folder, error) from None
        return cls(path)

    @classmethod
    def _read(cls, path: Path, head: str) -> "_Kept":
        lines = path.read_text(encoding="utf-8").splitlines()
        if not lines or lines[0] != head:
            raise FolderError(
                f"{path.parent}: keeps the points of another sweep (scene, keys or figures "
                "differ); choose another folder (--out), or remove it"
            )
        found, whole = cls(path), [head]
        for line in lines[1:]:
            with suppress(ValueError, TypeError, KeyError):  # the end of a killed run
                told = json.loads(line)
                index = int(told.pop("index"))
                found.points[index] = Point(**told)
                whole.append(line)
        beside = path.with_suffix(".new")
        beside.write_text("\n".join(whole) + "\n", encoding="utf-8")
        beside.replace(path)
        return found

    def add(self, index: int, point: Point) -> None:
        """Keep a point.

        Raises:
            OutputError: The file cannot be written.
        """
        if self.path is None:
            return
        try:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"index": index, **vars(point)}) + "\n")
        except OSError as error:
            raise _cannot(self.path.parent, error) from None


def _run(
    scene: Scene, text: str, points: Sequence[tuple[int, dict[str, Any]]], asked: Asked, jobs: int,
    extensions: Sequence[str],
) -> Iterator[tuple[int, Point]]:  # fmt: skip
    """Run points as they come."""
    if jobs == 1:
        for index, settings in points:
            yield index, run_point(scene, settings, asked)
        return
    jobs = min(jobs, max(1, len(points)))
    team, here = (
        _Team({"scene": text, "folder": str(scene.folder or ""), "asked": vars(asked)}, extensions),
        threading.local(),
    )
    ready = team.forked(scene, asked, jobs)

    def run(settings: dict[str, Any]) -> Point:
        worker = getattr(here, "worker", None)
        if worker is None or worker.poll() is not None:
            worker = here.worker = ready.pop() if ready else team.start()
        return team.ask(worker, settings)

    pool = ThreadPoolExecutor(jobs)
    try:
        waiting = {pool.submit(run, settings): index for index, settings in points}
        for done in as_completed(waiting):
            yield waiting[done], done.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        team.end()


class _Team:
    """Processes that run points: a line of JSON to each, a line back."""

    def __init__(self, head: dict[str, Any], extensions: Sequence[str]) -> None:
        self._head, self._extensions = head, list(extensions)
        self._workers: list[Any] = []
        self._noise = tempfile.TemporaryFile()  # noqa: SIM115  (of libraries, and tracebacks)

    def forked(self, scene: Scene, asked: Asked, count: int) -> list[Any]:
        """Workers that begin with all that this process has loaded; none where that is unsafe."""
        if sys.platform != "linux" or "mpi4py.MPI" in sys.modules or threading.active_count() > 1:
            return []
        import impactfem.solving  # noqa: F401, PLC0415  (once for all)

        sys.stdout.flush()
        sys.stderr.flush()

        def work(lines: TextIO, answers: TextIO) -> None:
            for extension in self._extensions:
                load(extension)
            run_lines(scene, asked, lines, answers)

        for _ in range(count):
            self._workers.append(Forked.start(work, self._noise.fileno(), self._workers))
        return list(self._workers)

    def start(self) -> "subprocess.Popen[str]":
        """Start one; it ends with its input, also when we are killed."""
        words = [sys.executable, "-m", "impactfem.studies.sweep_point", *self._extensions]
        worker = subprocess.Popen(  # noqa: S603  (ourselves)
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._noise,
            text=True, start_new_session=True, env={**os.environ, "OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        self._workers.append(worker)
        self._say(worker, self._head)
        return worker

    def ask(self, worker: Any, settings: dict[str, Any]) -> Point:
        """Have one run a point."""
        self._say(worker, settings)
        line = worker.stdout.readline() if worker.stdout else ""
        if line:
            return Point(**json.loads(line))
        code = worker.wait()
        code = 128 - code if code < 0 else code or 1
        self._noise.seek(0)
        last = self._noise.read().decode(errors="replace").strip().rpartition("\n")[2]
        return Point(code, {}, [], f"its process ended with exit code {code}: {last}"[:LONGEST])

    @staticmethod
    def _say(worker: Any, what: dict[str, Any]) -> None:
        if worker.stdin:
            with suppress(OSError):  # one that has ended is seen as it is asked
                worker.stdin.write(json.dumps(what) + "\n")
                worker.stdin.flush()

    def end(self) -> None:
        """End all."""
        for worker in self._workers:
            worker.kill()
            worker.wait()
        self._noise.close()


def _write(path: Path, rows: Sequence[Sequence[Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(
            [repr(each) if isinstance(each, float) else each for each in row] for row in rows
        )


def _cannot(folder: Path, error: OSError) -> OutputError:
    return OutputError(
        f"{folder}: cannot be written ({error.strerror}); choose another folder (--out)"
    )
