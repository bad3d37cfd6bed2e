"""Note beside stored results when, where and with what they were measured.

    python benchmarks/stamp.py NAME...      # results/NAME.md was just written by a command

A benchmark calls ``write_stamp`` after its results: NAME.json beside NAME.md and NAME.csv, which
pages of the documentation show.
"""

import argparse
import json
import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).resolve().parent / "results"
LIBRARIES = {
    "impactfem": ("impactfem",),
    "dolfinx": ("fenics-dolfinx", "dolfinx-solver-real"),
    "numpy": ("numpy",),
    "numba": ("numba",),
    "scipy": ("scipy",),
}
# Runnable processes per minute when the benchmark began: other work on the machine.
LOAD_BEFORE = os.getloadavg()[0]


def processor() -> str:
    """Name of the processor, as far as the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def at_commit() -> str:
    """The commit that the sources are at; empty without git."""
    command = ["git", "-C", str(RESULTS), "rev-parse", "--short", "HEAD"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip()


def study_arguments(description: str | None) -> argparse.ArgumentParser:
    """Where a study writes its tables and pictures: options --results and --images."""
    parser = argparse.ArgumentParser(description=description)
    images = RESULTS.parents[1] / "docs" / "images"
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--images", type=Path, default=images)
    return parser


def stamp(note: str = "") -> dict[str, Any]:
    """Date, machine, load and versions of a measurement that ends now, and a note on it."""
    facts: dict[str, Any] = {
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "cpu": processor(),
        "cores": os.cpu_count(),
        "load_before": round(LOAD_BEFORE, 2),
        "python": platform.python_version(),
    }
    for name, packages in LIBRARIES.items():
        for package in packages:
            try:
                facts[name] = version(package)
            except PackageNotFoundError:
                continue
            break
    if commit := at_commit():
        facts["commit"] = commit
    return facts | ({"note": note} if note else {})


def write_stamp(*names: str, folder: Path = RESULTS, note: str = "") -> None:
    """Write NAME.json for each result NAME of a folder."""
    text = json.dumps(stamp(note), indent=1) + "\n"
    for name in names:
        (folder / f"{name}.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="+", metavar="NAME")
    write_stamp(*parser.parse_args().names)
