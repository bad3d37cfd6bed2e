"""Finite strain beside peers: a disc that strikes a floor, and explicit steps of a ball.

    python benchmarks/finite_peers.py [--getfem PYTHON] [--akantu PYTHON] [--out benchmarks/results]

The disc: our implicit and explicit steps, DOLFINx with a penalty (`peers/disc_dolfinx.py`) and
GetFEM's bricks (`peers/disc_getfem.py`), on the same meshes and with the layers of our implicit
steps. The ball: a step of ours with contact, and one of Akantu without (`peers/step_akantu.py`).
PYTHON are interpreters that import the peer, or scripts that start one with what it needs;
PEER_GETFEM and PEER_AKANTU in the environment say the same. Without them a peer is left out.

Times are seconds of the process on one thread, without meshing and compiling, least of up to three
runs, in which all take turns.
"""

import argparse
import json
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from statistics import median
from types import SimpleNamespace
from typing import Any

import numpy as np
from explicit_steps import ball, timed
from stamp import write_stamp

import impactfem
from impactfem.fem import MPI  # noqa: F401  (finds the libraries of DOLFINx)
from impactfem.models.solids import solids_model
from impactfem.studies.study import markdown_table

HERE = Path(__file__).resolve().parent
BODY = SimpleNamespace(young=1e6, poisson=0.4, density=1100.0, velocity=-2.0)
DURATION = 0.0115
# Ours at h = 0.6 mm and DOLFINx with degree 2 agree on these so far, see the page.
REBOUND, PEAK = 1.877, 5420.0
SIZES = (0.01, 0.005, 0.0025)
PENALTIES = (10.0, 100.0)  # in E/h
BALLS = (0.0037, 0.0028)
STEPS = 60  # of Akantu
ENOUGH = 3.0  # seconds for the repetitions of a case

Run = dict[str, Any]


def disc(size: float, method: str) -> impactfem.Scene:
    """The disc, which touches the floor at t = 0."""
    return impactfem.Scene.from_dict(
        {
            "title": "disc", "duration": DURATION,
            "body": [{
                "name": "disc", "kind": "solid", "model": "plane_strain", "mesh_size": size,
                "shape": {"kind": "disc", "radius": 0.05, "center": [0.0, 0.05]},
                "material": "neo_hookean", "density": BODY.density, "youngs_modulus": BODY.young,
                "poisson_ratio": BODY.poisson, "velocity": [0.0, BODY.velocity],
            }],
            "obstacle": [{
                "name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0],
            }],
            "solve": {"method": method, "estimate": False}, "output": {"fields": []},
        }
    )  # fmt: skip


def mesh_of(scene: impactfem.Scene) -> tuple[np.ndarray, np.ndarray]:
    """Nodes [m], (nodes, dim), and cells of the only body."""
    mesh = solids_model(scene, [1]).parts[0].mesh.mesh
    dim = mesh.topology.dim
    cells = np.asarray(mesh.geometry.dofmaps[0], dtype=np.int64)
    return mesh.geometry.x[:, :dim].copy(), cells


def ours(size: float, method: str) -> Run:
    """One of our runs."""
    scene = disc(size, method)
    begin = time.process_time()
    result = impactfem.solve(scene)
    seconds = time.process_time() - begin
    history = result.history
    return {
        "rebound": history["disc.vy"].values[-1], "forces": history["contact_force"].values,
        "seconds": seconds, "steps": result.summary["details"]["layers"],
        "energies": history["total_energy"].values[[0, -1]],
    }  # fmt: skip


def dolfinx(size: float, layers: int, penalty: float, at: float) -> Run:
    """One of DOLFINx."""
    from peers.disc_dolfinx import run  # noqa: PLC0415  (DOLFINx is found by then)

    points, cells = mesh_of(disc(size, "conserving"))
    found: Run = run(
        points, cells, BODY, penalty * BODY.young / size, DURATION / layers, layers, at
    )
    return found | {"seconds": found["loop"] + found["preparation"], "steps": layers}


def started(command: str, script: str, *args: object) -> Run:
    """What a peer's script prints, run by an interpreter of its own."""
    done = subprocess.run(
        [command, str(HERE / "peers" / script), *map(str, args)], check=True, text=True,
        stdout=subprocess.PIPE, env={**os.environ, "OMP_NUM_THREADS": "1",
                                     "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    found: Run = json.loads([line for line in done.stdout.splitlines() if line[:1] == "{"][-1])
    return found


def getfem(command: str, size: float, layers: int, penalty: float) -> Run:
    """One of GetFEM."""
    points, cells = mesh_of(disc(size, "conserving"))
    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder) / "case.npz"
        np.savez(case, points=points, cells=cells, body=list(vars(BODY).values()))
        found = started(
            command, "disc_getfem.py", case, penalty * BODY.young / size, DURATION / layers, layers
        )
    return found | {"seconds": found["loop"] + found["preparation"], "steps": layers}


def cases(command: str | None, layers: dict[float, int]) -> Iterator[tuple[str, float, Callable]]:
    """Names, sizes and calls of all runs."""
    for size in SIZES:
        yield "ours, `conserving`", size, lambda size=size: ours(size, "conserving")
    for size in (*SIZES, SIZES[-1] / 2.0):
        yield "ours, `explicit`", size, lambda size=size: ours(size, "explicit")
    for at, rule in ((0.5, "midpoint"), (1.0, "contact at the end")):
        for penalty in PENALTIES:
            for size in SIZES:
                name = f"DOLFINx, {rule}, {penalty:g} E/h"
                args = (size, layers[size], penalty, at)
                yield name, size, lambda args=args: dolfinx(*args)
    for penalty in PENALTIES[:1] if command else ():
        for size in SIZES[:2]:
            name, args = f"GetFEM, Newmark, {penalty:g} E/h", (size, layers[size], penalty)
            yield name, size, lambda args=args: getfem(command, *args)


def disc_table(command: str | None) -> str:
    """Error against time."""
    # Compiles, and tells the layers.
    layers = {size: ours(size, "conserving")["steps"] for size in SIZES[:1]}
    ours(SIZES[0], "explicit")
    dolfinx(SIZES[0], layers[SIZES[0]], 1.0, 1.0)
    layers |= {size: round(layers[SIZES[0]] * SIZES[0] / size) for size in SIZES[1:]}
    runs = list(cases(command, layers))
    least = [float("inf")] * len(runs)
    spent, found = [0.0] * len(runs), [{}] * len(runs)
    for turn in range(3):
        for k, (name, size, call) in enumerate(runs):
            if turn and spent[k] * (turn + 1) / turn > ENOUGH:
                continue
            try:
                found[k] = call()
            except RuntimeError as error:  # PETSc's, too
                print(name, size, error, flush=True)
                spent[k] = ENOUGH
                continue
            spent[k] += found[k]["seconds"]
            least[k] = min(least[k], found[k]["seconds"])
            if not turn:
                print(name, size, found[k]["seconds"], found[k]["rebound"], flush=True)
    rows = []
    for (name, size, _), run, seconds in zip(runs, found, least, strict=True):
        if not run:
            rows.append([name, f"{1e3 * size:g}", "", "Newton's method fails", *[""] * 6])
            continue
        forces = np.asarray(run["forces"])
        peak = forces.max()
        energy = run.get("energies")
        change = "" if energy is None else f"{100.0 * (energy[1] / energy[0] - 1.0):+.3f}"
        swing = np.abs(np.diff(forces, prepend=0.0, append=0.0)).sum() / peak
        rows.append([
            name, f"{1e3 * size:g}", str(run["steps"]), f"{run['rebound']:.4f}",
            f"{100.0 * (run['rebound'] / REBOUND - 1.0):+.2f}", f"{peak:.0f}",
            f"{100.0 * (peak / PEAK - 1.0):+.1f}", f"{swing:.1f}", change, f"{seconds:.2f}",
        ])  # fmt: skip
    head = ["code", "h [mm]", "steps", "rebound [m/s]", "error [%]", "peak [N/m]", "error [%]"]
    return markdown_table([*head, "variation / peak", "energy [%]", "time [s]"], rows)


def write_mesh(path: Path, points: np.ndarray, cells: np.ndarray) -> None:
    """A mesh of tetrahedra in Gmsh's format 2."""
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(points))]
    lines += [f"{i} {x:.17g} {y:.17g} {z:.17g}" for i, (x, y, z) in enumerate(points, 1)]
    lines += ["$EndNodes", "$Elements", str(len(cells))]
    lines += [f"{i} 4 2 1 1 {a} {b} {c} {d}" for i, (a, b, c, d) in enumerate(cells + 1, 1)]
    path.write_text("\n".join([*lines, "$EndElements", ""]), encoding="utf-8")


def ball_table(command: str) -> str:
    """Explicit steps of both."""
    rows = []
    impactfem.solve(replace(ball(0.0125), duration=0.001))  # compiles
    for size in BALLS:
        scene = replace(ball(size), duration=0.0015)
        points, cells = mesh_of(scene)
        step, bare, theirs = [], [], []
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "ball.msh"
            write_mesh(path, points, cells)
            for _ in range(3):
                # Looks for folds are no part of steps, and of a ball they take longer than all.
                with timed() as times:
                    result = impactfem.solve(scene)
                step.append(median(times["step"]))
                bare.append(median(times["pass"]))
                theirs.append(
                    started(command, "step_akantu.py", path, BODY.young, BODY.poisson,
                            BODY.density, STEPS)
                )  # fmt: skip
        other, dt = min(run["step"] for run in theirs), theirs[0]["dt"]
        mine = min(step)
        own = result.summary["details"]["dt"]
        rows.append([
            str(len(points)), str(len(cells)), f"{1e3 * mine:.1f}", f"{1e3 * min(bare):.1f}",
            f"{1e3 * other:.1f}", f"{other / mine:.1f}", f"{other / min(bare):.1f}",
            f"{1e6 * own:.1f}", f"{1e6 * dt:.1f}", f"{other / dt / (mine / own):.1f}",
        ])  # fmt: skip
        print(*rows[-1], flush=True)
    head = ["nodes", "tetrahedra", "ours [ms]", "its kernel pass [ms]", "Akantu [ms]"]
    head += ["step / step", "step / pass", "our dt [us]", "Akantu's dt [us]", "per time of motion"]
    return markdown_table(head, rows)


def main() -> None:
    """Print and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--getfem", default=os.environ.get("PEER_GETFEM"), metavar="PYTHON")
    parser.add_argument("--akantu", default=os.environ.get("PEER_AKANTU"), metavar="PYTHON")
    parser.add_argument("--out", type=Path, default=HERE / "results")
    parser.add_argument("--note", default="", help="what the stamp says besides")
    parser.add_argument("--only", choices=("disc", "step"), help="one of the tables")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    text: dict[str, str] = {}
    if given.akantu and given.only != "disc":
        text["finite_step"] = ball_table(given.akantu)
    if given.only != "step":
        text["finite_disc"] = disc_table(given.getfem)
    for peer in ("getfem", "akantu"):
        if not getattr(given, peer):
            print(f"{peer} is left out: give --{peer}")
    for name, found in text.items():
        (given.out / f"{name}.md").write_text(found + "\n", encoding="utf-8")
        write_stamp(name, folder=given.out, note=given.note)
        print(found)


if __name__ == "__main__":
    main()
