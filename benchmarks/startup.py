"""Wall time of commands from the start of the process to its end (about two minutes).

    python benchmarks/startup.py [--repeats N] [--results FOLDER]

Writes startup.csv and startup.md. "Warm": what is compiled once has been, as in every run but the
first; a run ends when result, pictures and report.html are written.
"""

import argparse
import csv
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from stamp import RESULTS, write_stamp

IMPACTFEM = Path(sys.executable).with_name("impactfem")
# Name, arguments, whether it starts without compiled code, and the limit that is wished [s].
COMMANDS: tuple[tuple[str, tuple[str, ...], bool, float | None], ...] = (
    ("`impactfem --help`", ("--help",), False, 0.3),
    ("`impactfem --version`", ("--version",), False, None),
    ("`impactfem validate bar_impact`", ("validate", "bar_impact"), False, None),
    ("`impactfem plan bar_impact`", ("plan", "bar_impact"), False, 1.5),
    ("`impactfem plan bouncing_ball`", ("plan", "bouncing_ball"), False, None),
    ("`impactfem plan dropped_beam`", ("plan", "dropped_beam"), False, None),
    ("`impactfem plan dropped_disc`", ("plan", "dropped_disc"), False, None),
    ("`impactfem plan colliding_discs`", ("plan", "colliding_discs"), False, None),
    ("`impactfem run bar_impact`, warm", ("run", "bar_impact", "--out", "result"), False, 1.5),
    ("`impactfem run bar_impact`, first", ("run", "bar_impact", "--out", "result"), True, None),
)


def seconds(arguments: tuple[str, ...], caches: Path, folder: Path) -> tuple[float, float]:
    """Wall time and CPU time of a command in a folder [s]."""
    places = {"XDG_CACHE_HOME": str(caches), "NUMBA_CACHE_DIR": str(caches / "numba")}
    start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [IMPACTFEM, *arguments],
        cwd=folder,
        env=os.environ | places,
        capture_output=True,
        check=True,
    )
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Measure all commands."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5, help="runs of each command")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of the tables")
    parser.add_argument("--note", default="", help="what the stamp shall say besides")
    given = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as place:
        warm, folder = Path(place) / "warm", Path(place) / "work"
        folder.mkdir()
        for name, arguments, first, limit in COMMANDS:
            if not first:
                seconds(arguments, warm, folder)  # compiles, and fills the file cache
            times = [
                seconds(arguments, Path(place) / f"cold{k}" if first else warm, folder)
                for k in range(given.repeats)
            ]
            wall, cpu = zip(*times, strict=True)
            rows.append((name, min(wall), statistics.median(wall), statistics.median(cpu), limit))
            print(name, *(f"{value:.2f}" for value in rows[-1][1:4]), flush=True)
    given.results.mkdir(parents=True, exist_ok=True)
    with (given.results / "startup.csv").open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["command", "least", "median", "cpu", "aim"])
        for name, *times, limit in rows:
            table.writerow([name.replace("`", ""), *(f"{t:.3f}" for t in times), limit or ""])
    lines = ["| command | least [s] | median [s] | CPU, median [s] | aim, at most [s] |"]
    lines.append("| --- | --- | --- | --- | --- |")
    for name, *times, limit in rows:
        lines.append(f"| {name} | {' | '.join(f'{t:.2f}' for t in times)} | {limit or ''} |")
    text = "\n".join(lines) + f"\n\nWall time and CPU time; runs of each: {given.repeats}.\n"
    (given.results / "startup.md").write_text(text, encoding="utf-8")
    write_stamp("startup", folder=given.results, note=given.note)


if __name__ == "__main__":
    main()
