"""A 3D sphere of a million unknowns: 200 explicit steps on 1 and on 2 ranks, alternating.

    python benchmarks/large_sphere.py [--size 0.0098] [--repeats 2] [--out benchmarks/results]

Goals: 200 steps within 3 minutes and 4 GiB on 2 ranks, meshing and assembly included; 2 ranks 1.7
times faster than 1.
"""

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
from pathlib import Path

from stamp import write_stamp

from impactfem.studies.study import markdown_table

STEPS = 200
SHARE = 0.3  # time step in elements; about 0.4 is stable
MINUTES, GIB, FASTER = 3.0, 4.0, 1.7

_RUN = """
import json, resource, sys, time
begin = time.perf_counter()
import numpy as np
from impactfem.fem import MPI
from impactfem.log import Progress
from impactfem.marching import solids
from impactfem.planning import plan
from impactfem.scene import Scene
from impactfem.models.solids import solids_model
from impactfem.runs.solids import run_solids

comm = MPI.COMM_WORLD
scene = Scene.from_dict(json.loads(sys.argv[1]))
times = [begin, time.perf_counter()]
def lap():
    comm.barrier()
    times.append(time.perf_counter())

model = solids_model(scene, [1]).parts[0]
lap()
model.system, model.contact
lap()
ticks, active = [], []
def tick(level):
    ticks.append(time.perf_counter())
    active.append(int(np.count_nonzero(level.force)))
go_on = solids.SolidMarch.go_on
def watched(march, observers, end):
    lap()
    go_on(march, [*observers, tick], end)
    lap()
solids.SolidMarch.go_on = watched
motion, _ = run_solids(scene, plan(scene), Progress())
memory = comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) / 1024**2
A = model.system.stiffness.convert("baij")
x, y = A.createVecs()
products = []
for _ in range(20):
    comm.barrier()
    start = time.perf_counter()
    A.mult(x, y)
    comm.barrier()
    products.append(time.perf_counter() - start)
if comm.rank == 0:
    energy = motion.history["total_energy"].values
    print(json.dumps({
        "unknowns": model.system.num_dofs, "contact": model.contact.count, "parts":
        np.diff(times).tolist(), "steps": np.diff(ticks).tolist(), "active": max(active),
        "memory": memory, "product": float(np.median(products)),
        "drift": float(abs(energy / energy[0] - 1.0).max()),
        "force": float(motion.history["contact_force"].values.max()), "end": [
        float(motion.history[f"{scene.bodies[0].name}.{axis}"].values[-1]) for axis in "xyz"],
    }))
"""


def scene(size: float) -> dict:
    """A sphere of diameter 1 that touches the plane after a tenth of the steps."""
    duration = STEPS * SHARE * size
    body = {
        "name": "ball", "kind": "solid", "model": "3d", "mesh_size": size,
        "shape": {"kind": "sphere", "radius": 0.5, "center": [0.0, 0.501, 0.0]},
        "density": 1.0, "youngs_modulus": 0.742857142857142857, "poisson_ratio": 0.3,
        "degree": 1, "velocity": [0.0, -0.02, 0.0],
    }  # fmt: skip
    floor = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0, 0.0],
             "normal": [0.0, 1.0, 0.0]}  # fmt: skip
    return {
        "title": "Large sphere", "duration": duration, "body": [body], "obstacle": [floor],
        "solve": {"method": "explicit", "dt": SHARE * size, "estimate": False},
        "output": {"fields": []},
    }  # fmt: skip


def run(ranks: int, size: float) -> dict:
    """Times [s], memory [GiB] and motion of one run."""
    beside = Path(sys.executable).parent / "mpirun"
    launcher = str(beside) if beside.exists() else shutil.which("mpirun") or "mpirun"
    done = subprocess.run(
        [launcher, "-n", str(ranks), sys.executable, "-c", _RUN, json.dumps(scene(size))],
        stdout=subprocess.PIPE, check=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    # Libraries may say something too.
    text = next((line for line in done.stdout.splitlines() if line.startswith("{")), None)
    if text is None:
        raise RuntimeError(f"no result on {ranks} ranks: {done.stdout[-2000:]}")
    found: dict = json.loads(text)
    return found


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    parser.add_argument("--size", type=float, default=0.0098)
    parser.add_argument("--repeats", type=int, default=2)
    given = parser.parse_args()
    rows: list[list[str]] = []
    loops: dict[int, list[float]] = {1: [], 2: []}
    last: dict[int, dict] = {}
    for _ in range(given.repeats):
        for ranks in (2, 1):
            load = os.getloadavg()[0]
            found = last[ranks] = run(ranks, given.size)
            loops[ranks].append(found["parts"][-1])
            step = statistics.median(found["steps"])
            rows.append([
                str(ranks), *(f"{part:.1f}" for part in found["parts"]),
                f"{sum(found['parts']):.0f}", f"{1e3 * step:.0f}", f"{1e3 * found['product']:.0f}",
                f"{found['memory']:.2f}", f"{load:.1f}",
            ])  # fmt: skip
            print(*rows[-1], flush=True)
    one, two = last[1], last[2]
    ratios = [a / b for a in loops[1] for b in loops[2]]
    apart = max(abs(a - b) for a, b in zip(one["end"], two["end"], strict=True))
    head = ["ranks", "imports [s]", "mesh [s]", "assembly, contact [s]", "preparation [s]"]
    head += [f"{STEPS} steps [s]", "all [s]", "step [ms]", "BAIJ product [ms]", "memory [GiB]"]
    text = (
        f"{markdown_table([*head, 'load before'], rows)}\n\n{one['unknowns']} unknowns, "
        f"{one['contact']} contact nodes, at most {one['active']} active; memory of all ranks "
        f"together, {1024**3 * two['memory'] / two['unknowns']:.0f} B per unknown on 2 ranks. "
        f"2 ranks march {statistics.median(ratios):.2f} times as fast as 1 ({min(ratios):.2f} to "
        f"{max(ratios):.2f}; goal {FASTER:g}). Energy drift {two['drift']:.0e}; the centres of "
        f"mass end {apart:.0e} m apart. Goals on 2 ranks: {MINUTES:g} minutes, {GIB:g} GiB.\n"
    )
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "large_sphere.md").write_text(text, encoding="utf-8")
    write_stamp("large_sphere", folder=given.out)
    print(text)


if __name__ == "__main__":
    main()
