"""Estimated errors over true ones, in cases with a reference (two minutes of computing).

    python benchmarks/estimates.py [--out benchmarks/results]

Writes estimates.csv and estimates.md with their stamp. References: the stored one of the standing
disc; closed forms of bars that strike a wall or each other, for blocks with nu = 0; that of
a bouncing ball.
"""

import argparse
import csv
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import disc_scene
import numpy as np
from numpy.typing import NDArray
from stamp import RESULTS, write_stamp

import impactfem
from impactfem.facade import Result
from impactfem.reference.bar import Errors
from impactfem.runs.tracks import Track, difference
from impactfem.scene import Scene
from impactfem.studies.study import markdown_table

Floats = NDArray[np.float64]

FIGURES = ("displacement_max", "displacement_l2", "force_l1")
METHODS = ("explicit", "massless", "conserving", "moreau_jean")
LIMITS, MIDDLE = (0.5, 10.0), (0.8, 3.0)
_UNIT: dict[str, Any] = {
    "kind": "solid", "model": "plane_strain", "density": 1.0, "youngs_modulus": 1.0,
    "poisson_ratio": 0.0, "cells": "hexahedron",
}  # fmt: skip
_FLOOR = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
_FINE = 30_000  # layers of closed forms
GRAVITY = 9.81


@dataclass(frozen=True)
class Case:
    """A scene and what its true error is measured against."""

    family: str
    method: str
    size: str
    scene: Scene
    true: Callable[[Result], tuple[float, float, float]]


def disc_reference() -> Track:
    """The standing disc, by the reference of its study."""
    samples, times = next(iter(disc_scene.load_references().values())), disc_scene.WINDOWS
    position = np.zeros((len(times), 3))
    position[:, 1] = samples.way
    force = np.diff(samples.impulse) / np.diff(times)
    return Track(times, position, np.concatenate([[0.0], force]))


def bar_reference(duration: float, hit: float, force: float, bodies: list[Any]) -> Track:
    """Bars of length 1 in contact from ``hit`` for two transits, by d'Alembert.

    Args:
        duration: [s].
        hit: When they meet [s].
        force: Constant force of the contact [N].
        bodies: Mass [kg], speed [m/s], axis and sense of the force of each.
    """
    times = np.linspace(0.0, duration, _FINE + 1)
    dt, middle = times[1], 0.5 * (times[1:] + times[:-1])
    acting = np.where((middle > hit) & (middle < hit + 2.0), force, 0.0)
    position = np.zeros((len(times), 3 * len(bodies)))
    for k, (mass, speed, axis, sense) in enumerate(bodies):
        velocity = speed + np.concatenate([[0.0], np.cumsum(sense * acting) * dt / mass])
        way = np.cumsum(0.5 * dt * (velocity[1:] + velocity[:-1]))
        position[1:, 3 * k + axis] = way
    return Track(times, position, np.concatenate([[0.0], acting]))


def against(reference: Track) -> Callable[[Result], tuple[float, float, float]]:
    """The error of a run of solids."""

    def true(result: Result) -> tuple[float, float, float]:
        names = [body.name for body in result.scene.bodies]
        return figures(difference(reference, Track.of_history(result.history, names), ""))

    return true


def figures(errors: Errors) -> tuple[float, float, float]:
    """Those that are compared."""
    return errors.displacement_max, errors.displacement_l2, errors.force_l1


def scene(duration: float, bodies: list[Any], obstacles: list[Any], **solve: Any) -> Scene:
    """A scene whose error is estimated."""
    return Scene.from_dict({
        "title": "estimate", "duration": duration, "body": bodies, "obstacle": obstacles,
        "solve": {"estimate": True, **solve}, "output": {"fields": []},
    })  # fmt: skip


def discs() -> Iterator[Case]:
    """A disc thrown on a plane."""
    true = against(disc_reference())
    for elements in (8, 16, 32, 64):
        for method in METHODS:
            case = disc_scene.scene(elements, method=method, estimate=True)
            yield Case("disc", method, f"n = {elements}", case, true)
    for elements in (8, 16, 32):
        case = disc_scene.scene(elements, 2, method="conserving", estimate=True)
        yield Case("disc, degree 2", "conserving", f"n = {elements}", case, true)


def disc_files(folder: Path) -> Iterator[Case]:
    """The same disc, meshed beforehand."""
    import gmsh  # noqa: PLC0415

    true = against(disc_reference())
    for elements in (8, 16, 32):
        gmsh.initialize(readConfigFiles=False)
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addDisk(0.0, 0.5 + disc_scene.GAP, 0.0, 0.5, 0.5)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 1.0 / elements)
        gmsh.option.setNumber("Mesh.MeshSizeMin", 1.0 / elements)
        gmsh.model.mesh.generate(2)
        path = folder / f"disc_{elements}.msh"
        gmsh.write(str(path))
        gmsh.finalize()
        data = disc_scene.scene(elements).to_dict()
        body = {k: v for k, v in data["body"][0].items() if k not in {"shape", "mesh_size"}}
        body = {k: v for k, v in body.items() if v not in (None, [], ())} | {"mesh": str(path)}
        for method in ("explicit", "massless"):
            case = scene(disc_scene.DURATION, [body], [_FLOOR], method=method)
            yield Case("disc from a .msh", method, f"n = {elements}", case, true)


def blocks() -> Iterator[Case]:
    """A block falls flat, and two blocks meet."""
    for elements in (20, 40, 80):
        shape = {"kind": "block", "size": [0.4, 1.0], "corner": [0.0, 0.1]}
        body = _UNIT | {"shape": shape, "mesh_size": 1.0 / elements, "velocity": [0.0, -0.5]}
        true = against(bar_reference(3.0, 0.2, 0.2, [(0.4, -0.5, 1, 1.0)]))
        for method in METHODS:
            case = scene(3.0, [body | {"name": "block"}], [_FLOOR], method=method)
            yield Case("block on a floor", method, f"n = {elements}", case, true)
    true = against(bar_reference(3.0, 0.2, 0.02, [(0.4, 0.1, 0, -1.0), (0.4, 0.0, 0, 1.0)]))
    for elements in (20, 40):
        pair = []
        for name, left, speed in (("left", 0.0, 0.1), ("right", 1.02, 0.0)):
            shape = {"kind": "block", "size": [1.0, 0.4], "corner": [left, 0.0]}
            body = _UNIT | {"name": name, "shape": shape, "mesh_size": 1.0 / elements}
            pair.append(body | {"velocity": [speed, 0.0]})
        for method in METHODS:
            case = scene(3.0, pair, [], method=method)
            yield Case("two blocks", method, f"n = {elements}", case, true)


def balls() -> Iterator[Case]:
    """A ball that bounces."""
    data = {"name": "ball", "kind": "point", "mass": 1.0, "velocity": [0.0]}
    floor = {"name": "floor", "kind": "half_space", "point": [0.0], "normal": [1.0]}
    for duration, height in ((1.0, 1.0), (1.0, 0.37), (2.0, 1.0), (2.0, 2.13), (3.0, 1.0)):
        for method, dt in (("event_driven", None), ("moreau_jean", 1e-3)):
            case = Scene.from_dict({
                "title": "ball", "duration": duration, "gravity": [-GRAVITY], "obstacle": [floor],
                "body": [data | {"position": [height]}],
                "contact": [{"between": ["ball", "floor"], "restitution": 0.8}],
                "solve": {"method": method, **({} if dt is None else {"dt": dt})},
            })  # fmt: skip
            size = f"h = {height:g} m, {duration:g} s"
            yield Case("bouncing ball", method, size, case, _ball_error(height))


def _ball_error(height: float) -> Callable[[Result], tuple[float, float, float]]:
    """The error of a ball against its closed form, in extended precision."""
    real = np.longdouble

    def true(result: Result) -> tuple[float, float, float]:
        times, g, e = result.history["time"].values.astype(real), real(GRAVITY), real(0.8)
        fall = np.sqrt(2 * real(height) / g)
        powers = e ** np.arange(1, 60).astype(real)
        hits = fall * (1 + 2 * np.concatenate([[real(0)], np.cumsum(powers)]))
        last = np.searchsorted(hits, times) - 1
        since = times - hits[np.maximum(last, 0)]
        speed = np.sqrt(2 * g * real(height)) * e ** (last + 1).astype(real)
        fallen = real(height) - g * times**2 / 2
        exact = np.where(last < 0, fallen, speed * since - g * since**2 / 2)
        apart = np.abs(result.history["ball.x"].values - exact)
        way = np.abs(exact - exact[0])
        square = np.sqrt((apart**2).sum() / (way**2).sum())
        return float(apart.max() / way.max()), float(square), math.nan

    return true


def measured(case: Case) -> list[Any]:
    """A row: the case, and for each figure the estimate over the true error."""
    result = impactfem.solve(case.scene)
    told, true = result.summary["error"], case.true(result)
    row: list[Any] = [case.family, case.method, case.size]
    for name, value in zip(FIGURES, true, strict=True):
        row += [value, told[name] / value if told else math.nan]
    print(*row, "" if told else result.summary["details"]["error_estimate"], flush=True)
    return row


def report(rows: list[list[Any]]) -> str:
    """Ratios by case: least, median and largest over its sizes, and over all."""
    lines = []
    for family in [*dict.fromkeys(row[0] for row in rows), "all"]:
        chosen = [row for row in rows if family in {row[0], "all"}]
        cells = [family, str(len(chosen)), str(sum(math.isnan(row[4]) for row in chosen))]
        for column in (4, 6, 8):
            found = [row[column] for row in chosen if math.isfinite(row[column])]
            spread = f"{min(found):.2g}, {median(found):.2g}, {max(found):.2g}" if found else "-"
            cells.append(spread)
        lines.append(cells)
    head = ["case", "runs", "no estimate", "displacement, largest", "displacement, mean", "force"]
    detail = [
        [*row[:3], *(f"{v:.1e}" if k % 2 == 0 else f"{v:.2g}" for k, v in enumerate(row[3:]))]
        for row in rows
    ]
    names = ["displacement, largest", "estimate / true", "mean", "estimate / true", "force"]
    return (
        "Estimated error over true error: least, median, largest.\n\n"
        + markdown_table(head, lines)
        + "\n\nEach run, with its true errors:\n\n"
        + markdown_table(["case", "method", "size", *names, "estimate / true"], detail)
        + "\n"
    )


def main() -> None:
    """Measure all cases and write the tables."""
    import tempfile  # noqa: PLC0415

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        cases = [*discs(), *disc_files(Path(folder)), *blocks(), *balls()]
        rows = [measured(case) for case in cases]
    with (given.out / "estimates.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        ratios = [name for figure in FIGURES for name in (figure, f"{figure} estimate/true")]
        writer.writerow(["case", "method", "size", *ratios])
        writer.writerows(rows)
    (given.out / "estimates.md").write_text(report(rows), encoding="utf-8")
    write_stamp("estimates", folder=given.out)


if __name__ == "__main__":
    main()
