"""Hard cases of bars beyond one scene: units, meshes, graded elements, merit constants, ranks."""

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.errors import ConvergenceError
from impactfem.facade import Result
from impactfem.marching.schemes import SCHEMES
from impactfem.reference.bar import exact_bar, measure
from impactfem.scene import PiecewiseConstant
from impactfem.solving import solve
from impactfem.studies.hard.bars import (
    by_default,
    facts_of,
    impulse,
    plain,
    rounding,
    solved,
)
from impactfem.studies.hard.board import Case, Facts
from impactfem.studies.hard.gradients import on_layers, valley
from impactfem.studies.hard.meshes import mesh_file, space_time
from impactfem.studies.hard.rows import Row, load


def units(method: str, row: Row) -> Facts:
    """The same motion, gap over L and force over E A, of other lengths and materials."""

    def dimensionless(length: float, density: float, modulus: float) -> Any:
        c = (modulus / density) ** 0.5
        thrown = row.scene()
        body = {
            "length": length, "density": density, "youngs_modulus": modulus,
            "gap": thrown.bar.gap * length, "velocity": -0.5 * c,
        }  # fmt: skip
        scaled = {f"body.0.{name}": value for name, value in body.items()}
        more = {"duration": 6.0 * length / c, "gravity": 0.1 * c**2 / length, **scaled}
        history = solved(method, row.scene(more)).history
        return np.stack([history["gap"].values / length, history["contact_force"].values / modulus])

    first = dimensionless(1.0, 1.0, 1.0)
    others = (dimensionless(*data) for data in row.given["materials"])
    return {"difference": max(float(np.abs(other - first).max()) for other in others)}


def graded(method: str, row: Row) -> Facts:
    """Elements that grow 1000-fold away from the wall, and towards it; the computed stable step."""
    from impactfem.marching.march import Marching, march  # noqa: PLC0415
    from impactfem.system.chain import Chain  # noqa: PLC0415  (loads Numba)

    scene, scheme = row.scene(), SCHEMES[method]
    bar, still = scene.bar, PiecewiseConstant()
    worst = {"growth": 0.0, "penetration": 0.0, "pull": 0.0, "of bound": 0.0}
    sizes = np.geomspace(1e-3, 1.0, 80)
    for widths in (sizes, sizes[::-1]):
        edges = np.append(0.0, np.cumsum(widths / widths.sum()))
        positions = bar.length * edges / edges[-1]
        step = scheme.stable_dt(Chain.of_bar(bar, positions))
        dt = min(step, float(np.median(np.diff(positions))) / bar.wave_speed)
        layers = int(np.ceil(scene.duration / dt))
        motion = march(bar, still, positions, scheme, Marching(dt, layers, every=layers // 400 + 1))
        errors = measure(motion, exact_bar(scene, motion.times[-1]))
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


def gamma(method: str, row: Row) -> Facts:
    """One active-set loop over all layers with very different merit constants."""
    results = [solved(method, row.scene(more)) for more in row.vary]
    gaps = [result.history["gap"].values for result in results]
    worst = {name: max(facts_of(r)[name] for r in results) for name in ("growth", "pull")}
    # Gaps vanish in contact up to the rounding of the solver.
    return worst | {
        "iterations": max(r.summary["active_set"]["iterations"] for r in results),
        "difference": max(float(np.abs(gap - gaps[0]).max()) for gap in gaps),
    }


def mesh(method: str, row: Row) -> Facts:
    """A space-time mesh of triangles among random points, each with another one beside it or not.

    Args:
        method: Name of the method.
        row: Gives the number of ``points`` and how far ``beside`` each in time the other one is.
    """
    shape = (row.given["points"], 2)
    points = np.random.default_rng(20).uniform(0.03, 0.97, shape) * (5.0, 1.0)
    if "beside" in row.given:
        points = np.concatenate([points, points + np.array([row.given["beside"], 0.0])])
    with mesh_file(space_time(points, 16, 5.0)) as path:
        return plain(method, replace(row, set={**row.set, "solve.mesh": path}))


def mpirun() -> str | None:
    """The launcher beside this Python, or that on the path."""
    beside = Path(sys.executable).with_name("mpirun")
    return str(beside) if beside.exists() else shutil.which("mpirun")


def two_ranks(method: str, row: Row) -> Facts:
    """The command line on two ranks against this process."""
    undrawn = dict.fromkeys(("output.pictures", "output.film", "output.report"), False)
    scene = row.scene({"solve.method": method, **undrawn})
    alone = solve(scene)
    with tempfile.TemporaryDirectory() as folder:
        path, out = Path(folder) / "case.toml", Path(folder) / "out"
        path.write_text(scene.to_toml(), encoding="utf-8")
        unset = ("PMI_", "PMIX_", "OMPI_", "MPI_", "HYDRA_")
        clean = {k: v for k, v in os.environ.items() if not k.startswith(unset)}
        command = [mpirun() or "mpirun", "-n", "2", sys.executable, "-m", "impactfem", "run"]
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


CASES: tuple[Case, ...] = load(
    "bars", (
        plain, by_default, rounding, impulse, units, graded, gamma, mesh, two_ranks, on_layers,
        valley,
    ),
)  # fmt: skip
"""Hard cases of bars."""
