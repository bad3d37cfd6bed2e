"""The standing disc: error of motion and force against time, for all schemes and a SciPy loop.

    python benchmarks/disc.py [--out FOLDER] [--images FOLDER] [--sizes 8,16,32] [--repeats 3]
    python benchmarks/disc.py --references        # first of all: makes results/disc_reference.csv

Writes disc.csv, disc.md (with goals) and disc_comparison.md to benchmarks/results, and
study_disc.png to docs/images.
"""

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from disc_scene import Run, Samples, clock, load_references, prepare, run, save_references
from scipy_disc import newmark
from stamp import write_stamp

from impactfem.studies.study import Row, Study, markdown_table
from impactfem.studies.variant import Variant

SCHEMES = (
    "explicit", "massless", "conserving", "galerkin", "moreau_jean", "newmark",
    "massless@courant=1", "conserving@courant=1", "conserving@degree=2",
)  # fmt: skip
UNFIT = ("galerkin", "newmark")  # their force rings, or energy grows
PEER = "SciPy loop"
PEERS = tuple(f"{PEER}, courant {courant:g}" for courant in (0.25, 0.5, 1.0))
SLOW = 10.0  # seconds beyond which a run is not repeated
GROWTH = {"conserving": 1e-9, "explicit": 1e-9}  # others: 1e-6
VARIATION = 1.3
FASTER = 3.0
TITLE = "Disc thrown on a plane"


def references() -> dict[str, Samples]:
    """Two that share neither mesh nor elements nor scheme; the first is the one that counts."""
    found = {}
    for elements, degree, name, solve in (
        (64, 2, "quadratic", {"method": "conserving", "dt": 0.125 / 64}),
        (480, 1, "linear", {"method": "explicit"}),
    ):
        start = time.perf_counter()
        found[name] = Samples.of(run(prepare(elements, degree), **solve).track)
        print(f"{name}: {time.perf_counter() - start:.0f} s", flush=True)
    return found


def measured(name: str, elements: int, repeats: int, bodies: dict[tuple[int, int], Any]) -> Run:
    """The run with the median time of its loop."""
    runs: list[Run] = []
    while len(runs) < repeats and not (runs and runs[0].total > SLOW):
        if name in PEERS:
            runs.append(newmark(elements, float(name.rsplit(" ", 1)[1])))
            continue
        variant = Variant.parse(name)
        solve = dict(variant.settings)
        degree = int(solve.pop("degree", 1))
        if (elements, degree) not in bodies:
            bodies.clear()  # impactfem keeps one model
            bodies[elements, degree] = prepare(elements, degree)
        runs.append(run(bodies[elements, degree], method=variant.method, **solve))
    middle = sorted(runs, key=lambda r: r.loop)[len(runs) // 2]
    return replace(middle, preparation=median(r.preparation for r in runs))


def row(name: str, elements: int, found: Run, exact: Samples) -> Row:
    """What a study keeps; its time is everything from the scene to the motion."""
    motion, mean, force = Samples.of(found.track).error(exact)
    drift = float(np.abs(found.energy - found.energy[0]).max() / found.energy[0])
    note = f"loop {found.loop:.3g} s"
    return Row(
        name, elements, "completed", motion, mean, force, drift, found.total, found.total,
        found.unknowns * found.layers, None, note,
    )  # fmt: skip


def goals(runs: dict[tuple[str, int], Run], exact: Samples) -> str:
    """Cost by parts, energy and oscillation of each run, with what misses a goal marked."""
    rows = []
    for (name, elements), r in runs.items():
        samples = Samples.of(r.track)
        motion, _, force = samples.error(exact)
        ringing = samples.variation / exact.variation
        limit = GROWTH.get(name.split("@")[0], 1e-6)
        rows.append([
            name, str(elements), str(r.unknowns), str(r.layers), f"{motion:.1e}", f"{force:.1e}",
            f"{r.loop:.3g}", f"{r.preparation:.2g}", f"{r.meshing + r.assembly:.2g}",
            f"{max(r.growth, 0.0):.0e}" + (" !" if r.growth > limit else ""),
            f"{ringing:.2f}" + (" !" if ringing > VARIATION else ""),
        ])  # fmt: skip
    head = ["method", "n", "unknowns", "steps", "motion", "force", "loop [s]", "preparation [s]"]
    head += ["mesh, assembly [s]", "energy gained", "variation of the force"]
    return markdown_table(head, rows)


def comparison(
    rows: Sequence[Row], loops: Mapping[tuple[str, int], float]
) -> tuple[str, dict[int, float]]:
    """For each row of the SciPy loop the fastest of ours with both errors no larger.

    Args:
        rows: Of all methods; times are totals.
        loops: Seconds of the loops, by method and size.

    Returns:
        A table, and the least factor by size.
    """

    def loop(one: Row) -> float:
        return loops[one.method, one.elements]

    def total(one: Row) -> float:
        return one.seconds

    ours = [r for r in rows if r.method not in (*PEERS, *UNFIT)]
    table, least = [], {}
    for theirs in (r for r in rows if r.method in PEERS):
        cells = [
            theirs.method.removeprefix(f"{PEER}, "), str(theirs.elements),
            f"{theirs.displacement_max:.1e}", f"{theirs.force_l1:.1e}",
        ]  # fmt: skip
        good = [
            r for r in ours
            if r.displacement_max <= theirs.displacement_max and r.force_l1 <= theirs.force_l1
        ]  # fmt: skip
        for seconds in (loop, total):
            if not good:
                cells += [f"{seconds(theirs):.3g}", "none", "-"]
                continue
            best = min(good, key=seconds)
            ratio = seconds(theirs) / seconds(best)
            least[theirs.elements] = min(ratio, least.get(theirs.elements, np.inf))
            name = f"{best.method}, n = {best.elements}: {seconds(best):.3g}"
            cells += [f"{seconds(theirs):.3g}", name, f"{ratio:.1f}"]
        table.append(cells)
    head = ["SciPy loop", "n", "motion", "force", "loop [s]", "ours, loop [s]", "faster by"]
    return markdown_table([*head, "total [s]", "ours, total [s]", "faster by"], table), least


def summary(least: Mapping[int, float]) -> str:
    """The least factors in a sentence."""
    found = ", ".join(f"{factor:.1f} at n = {n}" for n, factor in least.items())
    return (
        f"Least factors of either time: {found} (goal {FASTER:g}). Ours without {', '.join(UNFIT)}."
    )


def main() -> None:
    """Run everything and write tables and picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    here = Path(__file__).parent
    parser.add_argument("--out", type=Path, default=here / "results")
    parser.add_argument("--images", type=Path, default=here.parent / "docs" / "images")
    parser.add_argument("--sizes", default="8,16,32,64,128")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--references", action="store_true")
    parser.add_argument(
        "--cpu", action="store_true", help="times of the process, on a busy machine"
    )
    given = parser.parse_args()
    clock.of_process = given.cpu
    if given.references:
        save_references(references())
        return
    known = load_references()
    exact, second = known.values()
    sizes = [int(text) for text in given.sizes.split(",")]
    runs = _all_runs(sizes, given.repeats)
    ordered = {(n, s): runs[n, s] for n in (*SCHEMES, *PEERS) for s in sizes if (n, s) in runs}
    rows = tuple(row(name, n, r, exact) for (name, n), r in ordered.items())
    study = Study(TITLE, rows, given.repeats, PEERS)
    _write(study, ordered, exact, second, given.out, given.images)


def _all_runs(sizes: Sequence[int], repeats: int) -> dict[tuple[str, int], Run]:
    """Runs by method and size, after one of each that is not counted."""
    found = {}
    linear = [name for name in SCHEMES if "degree=2" not in name]
    quadratic = [name for name in SCHEMES if "degree=2" in name]
    for group in (linear, quadratic, PEERS):
        bodies: dict[tuple[int, int], Any] = {}
        for name in group:
            measured(name, 8, 1, bodies)
        for elements in sizes:
            if group is quadratic and elements > 64:
                continue
            for name in group:
                found[name, elements] = r = measured(name, elements, repeats, bodies)
                print(name, elements, f"loop {r.loop:.3f} s, total {r.total:.3f} s", flush=True)
    return found


def _write(
    study: Study, runs: dict[tuple[str, int], Run], exact: Samples, second: Samples, out: Path,
    images: Path,
) -> None:  # fmt: skip
    picture = study.save(out, "disc")[-1]
    images.mkdir(parents=True, exist_ok=True)
    picture.replace(images / "study_disc.png")
    table, least = comparison(study.rows, {key: r.loop for key, r in runs.items()})
    reference = second.error(exact)
    text = (
        f"{goals(runs, exact)}\n\n! misses its goal. The two references differ by "
        f"{reference[0]:.1e} in motion and {reference[2]:.1e} in force; the total variation of the "
        f"other one is {second.variation / exact.variation:.2f} of that of the first. Medians of "
        f"{study.repeats} runs"
        f"{', times of the process (one thread)' if clock.of_process else ''}.\n"
    )
    (out / "disc.md").write_text(text, encoding="utf-8")
    text = f"{table}\n\n{summary(least)}\n"
    (out / "disc_comparison.md").write_text(text, encoding="utf-8")
    write_stamp("disc", "disc_comparison", folder=out)
    print(text)


if __name__ == "__main__":
    main()
