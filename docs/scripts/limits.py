"""Measure where the method stops being exact and write docs/limits_table.md (about a minute).

    python docs/scripts/limits.py [OUTPUT]

Parts: impact between layers; courant < 1; many bounces; meshes without layers; 2D + time; several
impacts.
"""

import platform
import re
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import gmsh
import numpy as np
from layers_2d import CELLS, block_limit, symbol_limit
from leapfrog import Bar as PlainBar
from leapfrog import march

import impactfem
from impactfem.fem import MPI, PETSc, dolfinx
from impactfem.mesh.files import read_mesh
from impactfem.mesh.spacetime import SpaceTimeMesh, layered_mesh
from impactfem.scene import Bar, PiecewiseConstant
from impactfem.shipped import find_scene
from impactfem.spacetime.galerkin import GalerkinSettings, solve_galerkin

DOCS = Path(__file__).resolve().parent.parent
K1_FORCE, K1_CONTACT = 0.5, (1.0, 3.0)


def scene(name: str, **settings: object) -> impactfem.Scene:
    """A shipped scene; ``body__bar__gap=0.5`` sets ``body.bar.gap``."""
    values = {key.replace("__", "."): value for key, value in settings.items()}
    return impactfem.Scene.from_toml(find_scene(name)).with_settings(values)


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def order(errors: Sequence[float]) -> list[str]:
    """Observed orders for sizes that double; a dash for the first."""
    return ["-", *(f"{np.log2(a / b):.2f}" for a, b in pairwise(errors))]


def between_layers() -> Iterator[str]:
    """K1 with the gap enlarged by a fraction of the path of one layer."""
    yield "## Impact between time levels\n"
    yield (
        "K1 (`bar_impact`) at courant 1 with gap = 0.5 + s v0 h/c: the impact falls a fraction s "
        "of a time step behind a time level. Errors are relative. Overshoot is the largest force "
        "over the exact 0.5 N; the total variation is given in the same unit, that of the "
        "exact force is 2.\n"
    )
    rows = []
    for share in (0.3, 0.5, 0.7):
        errors = []
        for n in (10, 20, 40, 80):
            case = scene("bar_impact", body__bar__gap=0.5 + share * 0.5 / n)
            run = impactfem.solve(case, elements=n)
            force = run.history["contact_force"].values / K1_FORCE
            errors.append(run.summary["error"]["displacement_max"])
            rows.append([
                share, n, f"{errors[-1]:.2e}", "", f"{force.max():.10f}",
                f"{np.abs(np.diff(np.append(force, 0.0))).sum():.8f}",
                f"{run.summary['contact']['max_penetration']:.0e}",
                run.summary["active_set"]["set_changes"],
            ])  # fmt: skip
        for row, text in zip(rows[-4:], order(errors), strict=True):
            row[3] = text
    head = ["s", "n", "displacement error", "order", "overshoot", "total variation"]
    head += ["penetration [m]", "set changes"]
    yield table(head, rows)


def small_courant() -> Iterator[str]:
    """Step by step with both set rules, and the product's global loop."""
    yield "\n## Courant below 1\n"
    yield (
        "K1 solved step by step (`docs/scripts/leapfrog.py`, NumPy only). Overshoot = largest "
        "force over 0.5 N; force error = integral of |force - exact| over that of the exact force. "
        "Node rule and mean rule: see [method](method.md).\n"
    )
    rows: list[list[object]] = []
    for courant in (1.0, 0.9, 0.8, 0.5, 0.25):
        for n in (20, 40, 80, 160):
            row: list[object] = [courant, n]
            for rule in ("node", "mean"):
                motion = march(PlainBar(), n, courant, 5.0, rule)  # type: ignore[arg-type]
                force = -motion.multiplier
                row += [f"{force.max() / K1_FORCE:.2f}", f"{_force_error(motion.times, force):.1e}"]
            rows.append(row)
    head = ["courant", "n"]
    head += [
        f"{what}, {rule} rule" for rule in ("node", "mean") for what in ("overshoot", "force error")
    ]
    yield table(head, rows)
    yield (
        "\nThe same with `impactfem.solve`: node rule, all time slabs at once; default limit of "
        "iterations, and 1000.\n"
    )
    rows = []
    for courant in (0.9, 0.8, 0.5):
        for n in (20, 40):
            settings = {"elements": n, "courant": courant}
            short = impactfem.solve(scene("bar_impact"), **settings).summary
            run = impactfem.solve(scene("bar_impact"), **settings, max_iterations=1000).summary
            rows.append([
                courant, n, f"{short['status']} ({short['active_set']['iterations']})",
                f"{run['status']} ({run['active_set']['iterations']})",
                f"{run['contact']['max_force'] / K1_FORCE:.2f}", f"{run['error']['force_l1']:.1e}",
            ])  # fmt: skip
    head = ["courant", "n", "status (iterations), default", "status (iterations), 1000"]
    yield table([*head, "overshoot", "force error"], rows)


def _force_error(times: np.ndarray, force: np.ndarray) -> float:
    """Integral of |force - exact|, over that of the exact one; the force is constant on layers."""
    before, (first, last) = np.concatenate([[0.0], times[:-1]]), K1_CONTACT
    inside = np.clip(np.minimum(times, last) - np.maximum(before, first), 0.0, None)
    wrong = inside * np.abs(force - K1_FORCE) + (times - before - inside) * np.abs(force)
    return float(wrong.sum() / (K1_FORCE * (last - first)))


def many_bounces() -> Iterator[str]:
    """The bar of Doyen, Ern and Piperno dropped 5 m; 750 bounces of the exact motion."""
    yield "\n## 750 bounces\n"
    yield (
        "Bar of Doyen, Ern, Piperno (L = 10, c = 30, gap 5, gravity 10, n = 20) for 2000 s, step "
        "by step: energy over its initial value at some times. Exact: 1 at all times.\n"
    )
    bar = PlainBar(10.0, 30.0, 5.0, 0.0, 10.0)
    marks = (10.0, 20.0, 40.0, 80.0, 320.0, 2000.0)
    rows = []
    for rule in ("node", "mean"):
        for courant in (1.0, 0.5):
            motion = march(bar, 20, courant, 2000.0, rule)  # type: ignore[arg-type]
            energy = motion.energy[np.searchsorted(motion.times, marks) - 1] / 500.0
            rows.append([rule, courant, *(f"{value:.3g}" for value in energy)])
    yield table(["rule", "courant", *(f"t = {mark:g} s" for mark in marks)], rows)


def without_layers() -> Iterator[str]:
    """A standing wave without contact through the product's mesh reader and solver."""
    yield "\n## Meshes without time levels\n"
    yield (
        "Standing wave u = 1 + 0.1 cos(pi x) cos(pi t), T = 2, no contact, on "
        "`meshes/bar_unstructured.geo`: largest error over 0.1. MUMPS solves the linear system.\n"
    )
    names = {5: "Delaunay", 6: "frontal-Delaunay", 8: "frontal-Delaunay for quads"}
    sizes, rows = (8, 16, 32), []
    text = (DOCS.parent / "meshes" / "bar_unstructured.geo").read_text()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.geo"
        for algorithm, name in names.items():
            errors = []
            for n in sizes:
                for key, value in (("T", 2.0), ("n", n), ("algorithm", algorithm)):
                    text = re.sub(rf"(?m)^{key} = .*?;", f"{key} = {value};", text)
                path.write_text(text)
                errors.append(_standing_wave(read_mesh(MPI.COMM_SELF, path, 1.0, 2.0, 1.0)))
            rows.append([f"{name} ({algorithm})", *(f"{e:.1e}" for e in errors)])
    layered = [_standing_wave(layered_mesh(MPI.COMM_SELF, n, 2 * n, 1.0)) for n in sizes]
    rows.append(["time slabs of right triangles", *(f"{e:.1e}" for e in layered)])
    yield table(["Gmsh algorithm", *(f"n = {n}" for n in sizes)], rows)


def _standing_wave(space: SpaceTimeMesh) -> float:
    bar = Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=1.0, displacement="0.1*cos(pi*x)")
    # One iteration: the empty active set, that is no contact, however wrong u may be.
    found = solve_galerkin(space, bar, PiecewiseConstant(), GalerkinSettings(max_iterations=1))
    wave = np.cos(np.pi * found.times[:, None]) * np.cos(np.pi * found.positions[None, :])
    return float(np.nanmax(np.abs(found.displacement - 1.0 - 0.1 * wave)) / 0.1)


def layers_of_a_plane() -> Iterator[str]:
    """Stability limits of structured 2D + time meshes."""
    yield "\n## Time slabs in 2D + time\n"
    yield (
        "Largest stable c dt/h for u_tt = c^2 (u_xx + u_yy) on squares of side h, P1 or Q1 in "
        "space-time, integrated exactly: by the symbol on the unbounded plane, and by eigenvalues "
        "on n x n squares with free edges.\n"
    )
    rows = [
        [cells, f"{symbol_limit(cells):.3f}", *(f"{block_limit(cells, n):.3f}" for n in (4, 8))]
        for cells in CELLS
    ]
    yield table(["cells", "unbounded", "n = 4", "n = 8"], rows)


def several_impacts() -> Iterator[str]:
    """One active-set loop over several impacts."""
    yield "\n## Several impacts in one active-set loop\n"
    yield "Courant 1, impacts on time levels. Pre-stretched rod (`prestretched_rod`):\n"
    rows = []
    for n in (10, 20, 40):
        for contacts, duration in ((1, 3.0), (2, 6.0), (4, 12.0)):
            case = scene("prestretched_rod", duration=duration)
            rows.append([n, contacts, *_iterations(case, n)])
    head = ["n", "contacts", "status", "iterations"]
    head += ["displacement error", "force error", "time [s]"]
    yield table(head, rows)
    yield ("\nBounces of Doyen, Ern, Piperno: `doyen_impact` with velocity 0 and gravity 10.\n")
    rows = []
    bounces = {"body__bar__velocity": 0.0, "gravity": 10.0}
    for n in (10, 20):
        for contacts, duration in ((1, 2.5), (2, 5.0), (4, 10.0), (7, 18.5)):
            case = scene("doyen_impact", duration=duration, **bounces)
            rows.append([n, contacts, *_iterations(case, n)])
    yield table(head, rows)


def _iterations(case: impactfem.Scene, elements: int) -> list[object]:
    run = impactfem.solve(case, elements=elements).summary
    error = run["error"]
    return [
        run["status"], run["active_set"]["iterations"], f"{error['displacement_max']:.1e}",
        f"{error['force_l1']:.1e}", f"{run['wall_time']:.1f}",
    ]  # fmt: skip


def main() -> None:
    """Run all parts and write the page."""
    start = time.perf_counter()
    output = Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "limits_table.md"
    parts = (
        between_layers, small_courant, many_bounces, without_layers, layers_of_a_plane,
        several_impacts,
    )  # fmt: skip
    lines: list[str] = []
    for part in parts:
        print(part.__name__, "...", flush=True)
        lines += part()
    petsc = ".".join(str(number) for number in PETSc.Sys.getVersion())
    lines.append(
        f"\nMeasured by `docs/scripts/limits.py` on {datetime.now(UTC):%Y-%m-%d} with impactfem "
        f"{impactfem.__version__}, DOLFINx {dolfinx.__version__}, PETSc {petsc}, Gmsh "
        f"{gmsh.__version__}, NumPy {np.__version__}, Python {platform.python_version()}, "
        "one process."
    )
    output.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{output}: written after {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
