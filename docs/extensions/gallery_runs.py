"""Run every scene of the demos through the command line, once for each state of the sources.

    python docs/extensions/gallery_runs.py [--out FOLDER] [--only NAME ...] [--jobs 2]

Results go to FOLDER/NAME, beside them NAME.json says what they were made from. A scene is run again
only if the package, the scene, the meshes or the versions of libraries have changed.
"""

import argparse
import fcntl
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
DEFAULT = ROOT / "docs" / "_build" / "gallery"
LIBRARIES = ("numpy", "numba", "scipy", "matplotlib", "pyvista", "vtk", "dolfinx-solver-real", "fenics-dolfinx", "gmsh")  # fmt: skip  # noqa: E501
LEAST_PICTURE = 1024  # bytes; an empty canvas is smaller


class GalleryError(Exception):
    """A demo does not run."""


@dataclass(frozen=True)
class Run:
    """A scene of a demo and the folder of its results.

    Attributes:
        demo: Folder of the demo.
        scene: Its scene file.
        folder: Where its results are, or will be.
    """

    demo: Path
    scene: Path
    folder: Path

    @property
    def name(self) -> str:
        """Name among all runs."""
        return self.folder.name

    @property
    def command(self) -> str:
        """What a reader types to repeat it, from the top folder."""
        return f"impactfem run {self.scene.relative_to(ROOT).as_posix()}"

    @property
    def stamp(self) -> dict[str, Any]:
        """What the stored results were made from; empty if there are none."""
        path = self.folder.with_suffix(".json")
        if not path.is_file() or not (self.folder / "summary.json").is_file():
            return {}
        stamp: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return stamp


def find_runs(out: Path = DEFAULT) -> list[Run]:
    """All scenes of the demos, by name; `out` holds a folder for each."""
    runs = []
    for scene in sorted(ROOT.glob("demos/*/scene*.toml")):
        rest = scene.stem.removeprefix("scene").lstrip("_")
        runs.append(
            Run(scene.parent, scene, out / "-".join(filter(None, (scene.parent.name, rest))))
        )
    return runs


def missing(scene: Path) -> str:
    """Why a scene cannot be run here, in words; empty if it can: one that needs an extra."""
    text = scene.read_text(encoding="utf-8")
    if 'kind = "mechanism"' in text and find_spec("pinocchio") is None:
        return "Pinocchio is not installed (impactfem[robots])"
    return ""


def _digest(paths: Iterable[Path]) -> str:
    """Of names and contents of files."""
    found = hashlib.sha256()
    for path in sorted(paths):
        found.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return found.hexdigest()


def sources() -> str:
    """Digest of what all runs depend on: package, meshes, versions of libraries."""
    package = (
        path for path in (ROOT / "impactfem").rglob("*")
        if path.is_file() and path.suffix != ".pyc" and "scenes" not in path.parts
    )  # fmt: skip
    meshes = (path for path in (ROOT / "meshes").rglob("*") if path.is_file())
    versions = [sys.version]
    for name in LIBRARIES:
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return hashlib.sha256("\n".join([_digest([*package, *meshes]), *versions]).encode()).hexdigest()


def _own(run: Run) -> list[Path]:
    """The scene, and what it reads from its folder."""
    return [run.scene, *run.demo.glob("*.urdf")]


def is_current(run: Run, digest: str) -> bool:
    """Whether the stored results are those of the present sources (`digest` of `sources`)."""
    return bool(run.stamp) and run.stamp.get("sources") == digest + _digest(_own(run))


def execute(run: Run, digest: str) -> None:
    """Run a scene and store what its results were made from.

    Raises:
        GalleryError: If the run fails, or draws nothing.
    """
    shutil.rmtree(run.folder, ignore_errors=True)
    run.folder.with_suffix(".json").unlink(missing_ok=True)
    state = digest + _digest(_own(run))
    environment = {"OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"} | dict(os.environ)
    command = [sys.executable, "-m", *run.command.split(), "--out", str(run.folder), "--quiet"]
    start = time.perf_counter()
    done = subprocess.run(  # noqa: S603  (our own command line)
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    seconds = time.perf_counter() - start
    if done.returncode:
        last = "\n".join((done.stderr or done.stdout).splitlines()[-15:])
        raise GalleryError(f"{run.command}: exit status {done.returncode}\n{last}")
    if not any(path.stat().st_size > LEAST_PICTURE for path in run.folder.glob("*.png")):
        raise GalleryError(f"{run.command}: drew no picture")
    stamp = {"sources": state, "seconds": seconds, "date": f"{datetime.now(UTC):%Y-%m-%d}"}
    run.folder.with_suffix(".json").write_text(json.dumps(stamp, indent=1), encoding="utf-8")
    print(f"{run.name}: {seconds:.1f} s", flush=True)


@contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Hold the folder: two builds at once must not run the same demos."""
    out.mkdir(parents=True, exist_ok=True)
    with (out / ".lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def execute_all(
    out: Path = DEFAULT, jobs: int = 2, only: Sequence[str] = ()
) -> tuple[list[Run], int]:
    """Run what is not current, the longest first; returns all runs and how many were made.

    Raises:
        GalleryError: If any fails, with the messages of all that do; if there are no scenes.
    """
    with _alone(out):
        digest = sources()
        runs = [run for run in find_runs(out) if not only or run.name in only]
        if not runs:
            raise GalleryError("there is no demos/*/scene.toml of that name")
        due = [run for run in runs if not is_current(run, digest)]
        for run in [run for run in due if missing(run.scene)]:
            print(f"{run.name}: skipped, {missing(run.scene)}", flush=True)
            due.remove(run)
        due.sort(key=lambda run: -run.stamp.get("seconds", float("inf")))
        faults = []
        with ThreadPoolExecutor(jobs) as pool:
            for future in [pool.submit(execute, run, digest) for run in due]:
                try:
                    future.result()
                except GalleryError as fault:
                    faults.append(str(fault))
    if faults:
        raise GalleryError("\n\n".join(faults))
    return runs, len(due)


def main() -> None:
    """Run the demos from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=DEFAULT)
    parser.add_argument("--only", nargs="*", default=(), metavar="NAME")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    start = time.perf_counter()
    try:
        runs, made = execute_all(given.out.resolve(), given.jobs, given.only)
    except GalleryError as fault:
        sys.exit(str(fault))
    print(f"{len(runs)} scenes, {made} of them run in {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
