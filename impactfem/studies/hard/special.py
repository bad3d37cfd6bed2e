"""Hard cases beyond one scene: units, meshes, graded elements, merit constants, ranks."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from impactfem.errors import ConvergenceError, MeshError
from impactfem.reference.bar import exact_bar, measure
from impactfem.result import Result
from impactfem.scene import PiecewiseConstant
from impactfem.solving import solve
from impactfem.studies.hard.board import Case, Claim, Facts
from impactfem.studies.hard.scenes import (
    ALL,
    GROWTH,
    OFF_GRID,
    PENETRATION,
    PULL,
    SWEPT,
    THROWN,
    bar_scene,
    claims,
    facts_of,
    run,
    solved,
)

Floats = NDArray[np.float64]

# Materials by name: length [m], density [kg/m^3], Young's modulus [Pa].
_UNITS = {
    "1e-9 m MEMS bar and 1 km bar": ((1e-9, 2330.0, 160e9), (1e3, 7850.0, 210e9)),
    "density 1e-6 to 1e4": ((1.0, 1e-6, 1.0), (1.0, 1e4, 1.0)),
}
_GAMMAS = (1e-12, 1e-6, 1.0, 1e6, 1e12)
_SAME = Claim("difference", 1e-10, "the equations know no units")


def _dimensionless(method: str, length: float, density: float, modulus: float) -> Any:
    """Gap over L and force over E A of the same motion with other data."""
    c = (modulus / density) ** 0.5
    scene = bar_scene(
        6.0 * length / c,
        gravity=0.1 * c**2 / length,
        length=length,
        density=density,
        youngs_modulus=modulus,
        gap=OFF_GRID * length,
        velocity=-0.5 * c,
    )
    history = solved(method, scene).history
    return np.stack([history["gap"].values / length, history["contact_force"].values / modulus])


def _in_units(name: str) -> Callable[[str], Facts]:
    def compare(method: str) -> Facts:
        base = _dimensionless(method, 1.0, 1.0, 1.0)
        others = (_dimensionless(method, *data) for data in _UNITS[name])
        return {"difference": max(float(np.abs(other - base).max()) for other in others)}

    return compare


def _graded(method: str) -> Facts:
    """Elements that grow 1000-fold away from the wall, and towards it; the computed stable step."""
    from impactfem.marching.chain import Chain  # noqa: PLC0415  (loads Numba)
    from impactfem.marching.march import SCHEMES, Marching, march  # noqa: PLC0415

    bar, still = THROWN.bar, PiecewiseConstant()
    worst = {"growth": 0.0, "penetration": 0.0, "pull": 0.0, "of bound": 0.0}
    sizes = np.geomspace(1e-3, 1.0, 80)
    for widths in (sizes, sizes[::-1]):
        edges = np.append(0.0, np.cumsum(widths / widths.sum()))
        positions = bar.length * edges / edges[-1]
        step = SCHEMES[method].stable_dt(Chain.of_bar(bar, positions))
        dt = min(step, float(np.median(np.diff(positions))) / bar.wave_speed)
        layers = int(np.ceil(THROWN.duration / dt))
        motion = march(
            bar, still, positions, SCHEMES[method], Marching(dt, layers, every=layers // 400 + 1)
        )
        errors = measure(motion, exact_bar(THROWN, motion.times[-1]))
        energy = motion.kinetic + motion.elastic + motion.potential
        largest = float(np.diff(positions).max()) / bar.length
        limit = 3.0 * largest ** (2.0 / 3.0)  # the bound of the coarsest element
        for name, value in (
            ("growth", float((energy - energy[0]).max() / energy[0])),
            ("penetration", max(0.0, -float(motion.gap.min()))),
            ("pull", max(0.0, float(motion.multiplier.max()))),
            ("of bound", errors.displacement_max / limit),
        ):
            worst[name] = max(worst[name], value)
    return worst


def _every_gamma(method: str) -> Facts:
    """One active-set loop over all layers with very different merit constants."""
    results = [
        solved(method, bar_scene(5.0, gap=0.5, velocity=-0.5), window="all", gamma=gamma)
        for gamma in _GAMMAS
    ]
    gaps = [result.history["gap"].values for result in results]
    worst = {name: max(facts_of(r)[name] for r in results) for name in ("growth", "pull")}
    # Gaps vanish in contact up to the rounding of the solver.
    return worst | {
        "iterations": max(r.summary["active_set"]["iterations"] for r in results),
        "difference": max(float(np.abs(gap - gaps[0]).max()) for gap in gaps),
    }


def _mesh_text(points: Floats, size: int, duration: float) -> str:
    """A mesh of the space-time rectangle in Gmsh's format 2.2: the Delaunay triangles of points."""
    x = np.linspace(0.0, 1.0, size + 1)
    t = np.linspace(0.0, duration, round(duration * size) + 1)
    sides = [np.column_stack([t, np.full_like(t, end)]) for end in (0.0, 1.0)]
    ends = [np.column_stack([np.full(size - 1, end), x[1:-1]]) for end in (0.0, duration)]
    nodes = np.concatenate([*sides, *ends, points])
    triangles = Delaunay(nodes).simplices
    corners = nodes[triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    triangles = triangles[np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > 1e-12]
    elements = [f"2 2 1 1 {i + 1} {j + 1} {k + 1}" for i, j, k in triangles]
    names = ['2 1 "bar"']
    for tag, (name, axis, end) in enumerate(
        (("wall", 1, 0.0), ("far", 1, 1.0), ("start", 0, 0.0), ("end", 0, duration)), 2
    ):
        there = np.flatnonzero(nodes[:, axis] == end) + 1
        line = there[np.argsort(nodes[there - 1, 1 - axis])]
        elements += [f"1 2 {tag} {tag} {i} {j}" for i, j in pairwise(line)]
        names.append(f'1 {tag} "{name}"')
    return gmsh_text(names, nodes, elements)


def gmsh_text(names: Sequence[str], nodes: Floats, elements: Sequence[str]) -> str:
    """A plane mesh in Gmsh's format 2.2, from lines without the numbers that elements get."""
    parts = (
        ("MeshFormat", ["2.2 0 8"]),
        ("PhysicalNames", [str(len(names)), *names]),
        ("Nodes", [str(len(nodes)), *(f"{k} {t!r} {x!r} 0" for k, (t, x) in _counted(nodes))]),
        ("Elements", [str(len(elements)), *(f"{k} {e}" for k, e in enumerate(elements, 1))]),
    )
    return "\n".join(f"${name}\n{'\n'.join(lines)}\n$End{name}" for name, lines in parts) + "\n"


def _counted(nodes: Floats) -> Iterator[tuple[int, list[float]]]:
    return enumerate(nodes.tolist(), 1)


def _on_mesh(points: Floats, size: int) -> Callable[[str], Facts]:
    def on_mesh(method: str) -> Facts:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "mesh.msh"
            path.write_text(_mesh_text(points, size, THROWN.duration), encoding="ascii")
            try:
                return run(method, THROWN, {"mesh": str(path)})
            except MeshError as error:
                raise MeshError(str(error).replace(f"{folder}/", "")) from error

    return on_mesh


def _random_points(count: int) -> Floats:
    """Seeded points in the space-time rectangle."""
    points: Floats = np.random.default_rng(20).uniform(0.03, 0.97, (count, 2)) * (5.0, 1.0)
    return points


def _slivers() -> Floats:
    """Pairs of points a thousandth of an element apart: triangles with angles of 1e-3 and less."""
    points = _random_points(600)
    return np.concatenate([points, points + np.array([6e-5, 0.0])])


def _mpirun() -> str | None:
    beside = Path(sys.executable).with_name("mpirun")
    return str(beside) if beside.exists() else shutil.which("mpirun")


def _two_ranks(method: str) -> Facts:
    """The command line on two ranks against this process."""
    scene = THROWN.with_settings(
        {"solve.method": method, "solve.elements": 16, "output.fields": []}
    )
    alone = solve(scene)
    with tempfile.TemporaryDirectory() as folder:
        path, out = Path(folder) / "case.toml", Path(folder) / "out"
        path.write_text(scene.to_toml(), encoding="utf-8")
        unset = ("PMI_", "PMIX_", "OMPI_", "MPI_", "HYDRA_")
        clean = {k: v for k, v in os.environ.items() if not k.startswith(unset)}
        command = [_mpirun() or "mpirun", "-n", "2", sys.executable, "-m", "impactfem", "run"]
        done = subprocess.run(  # noqa: S603  (our own command line)
            [*command, str(path), "--out", str(out), "--quiet"],
            env=clean, capture_output=True, text=True, check=False, timeout=120,
        )  # fmt: skip
        if done.returncode != 0:
            raise ConvergenceError(f"two ranks: exit code {done.returncode}; {done.stderr[-300:]}")
        both = Result.load(out)
    return {"difference": _difference(alone, both), "ranks": float(both.summary["ranks"])}


def _difference(one: Result, other: Result) -> float:
    worst = 0.0
    for name in ("gap", "contact_force"):
        a, b = one.history[name].values, other.history[name].values
        worst = max(worst, float(np.abs(a - b).max()) if a.shape == b.shape else float("inf"))
    return worst


def _same_result(_: str) -> Sequence[Claim]:
    return [Claim("difference", 1e-10, "the number of ranks is no part of the problem")]


CASES: tuple[Case, ...] = (
    Case("element sizes varying by 1000", _graded,
         lambda _: [GROWTH, PENETRATION, PULL,
                    Claim("of bound", 1.0, "error within the bound of the largest element")],
         SWEPT),
    *(Case(f"units: {name}", _in_units(name), lambda _: [_SAME], ALL) for name in _UNITS),
    Case("gamma 1e-12 to 1e12, one window", _every_gamma,
         lambda _: [GROWTH, PULL, Claim("iterations", 4, "the set settles in three solves"),
                    Claim("difference", 1e-10, "gamma only weighs the merit")],
         ("galerkin", "monolithic")),
    Case("slivers", _on_mesh(_slivers(), 16), claims, ("dg", *SWEPT, "monolithic"),
         frozenset({*SWEPT, "monolithic"})),
    Case("random mesh", _on_mesh(_random_points(1200), 16), claims, ("dg", *SWEPT, "monolithic"),
         frozenset({*SWEPT, "monolithic"})),
    Case("1 and 2 ranks", _two_ranks, _same_result, ALL if _mpirun() else (), quick=False),
)  # fmt: skip
"""Hard cases beyond one scene."""
