"""What a time step of a solid costs: explicit ones in products, implicit ones in solves.

    python benchmarks/solid_steps.py [--out benchmarks/results] [--quick]

An explicit step is held against one product with the same stiffness in PETSc's BAIJ (and AIJ)
format plus the updates of step and displacement by PETSc's vectors; an implicit step against one
solve with MUMPS. Steps and units alternate and are timed in seconds of the process (one thread),
which other work on the machine disturbs little. Each case runs in a process of its own.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from statistics import mean, median, quantiles

from stamp import write_stamp

from impactfem.studies.study import markdown_table

_RUN = """
import json, resource, sys, time
import numpy as np
from impactfem.fem import MPI, PETSc
from impactfem.log import Progress
from impactfem.marching import solids
from impactfem.planning import plan
from impactfem.scene import Scene
from impactfem.models.solids import solids_model
from impactfem.runs.solids import run_solids
from impactfem.system.matrices import to_blocked


memory = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
scene = Scene.from_dict(json.loads(sys.argv[1]))
loaded = memory()
model = solids_model(scene, [1]).parts[0]
system, contact = model.system, model.contact
chosen = plan(scene)

K = system.stiffness
x, y = K.createVecs()
x.setRandom()
explicit = chosen.linear_solver == "none"
out = {"unknowns": system.num_dofs, "contact": contact.count}
step, inverse = x.duplicate(), x.duplicate()
inverse.set(1.0)
step.set(0.0)
blocked = to_blocked(K) if explicit else None
now = time.process_time

def timed(work):
    begin = now()
    work()
    return now() - begin

def updates():
    y.pointwiseMult(inverse, y)
    step.axpy(-1e-9, y)
    x.axpy(1.0, step)

# After each step one unit of work: caches and other work on the machine are the same for both.
times, active, units, plain = [], [], [], []
def watched(march, observers, end):
    begin = now()
    def tick(level):
        nonlocal begin
        times.append(now() - begin)
        active.append(int(np.count_nonzero(level.force)))
        if explicit:
            units.append(timed(lambda: blocked.mult(x, y)) + timed(updates))
            plain.append(timed(lambda: K.mult(x, y)) + timed(updates))
        else:
            units.append(timed(lambda: march.interior._solver.solve(y, x)))
        begin = now()
    if not explicit:
        y.setRandom()
    go_on(march, [tick], end)
go_on = solids.SolidMarch.go_on
solids.SolidMarch.go_on = watched
motion, _ = run_solids(scene, chosen, Progress())
out["memory"] = memory() - loaded
out["times"], out["active"] = times[1:], active[1:]
out["unit"], out["plain"] = units[1:], plain[1:]
print(json.dumps(out))
"""
YOUNG = 0.742857142857142857  # lambda + 2 mu = 1 with nu = .3
FEW = 10
ALL = "all (mean)"


def body(shape: dict, model: str, size: float, speed: float) -> dict:
    """A body that falls along y."""
    dim = 3 if model == "3d" else 2
    return {
        "name": "body", "kind": "solid", "model": model, "shape": shape, "mesh_size": size,
        "density": 1.0, "youngs_modulus": YOUNG, "poisson_ratio": 0.3, "degree": 1,
        "velocity": [0.0, -speed, 0.0][:dim],
    }  # fmt: skip


def scene(shape: dict, model: str, size: float, speed: float, duration: float, method: str) -> dict:
    """The body above a plane, by one method."""
    dim = 3 if model == "3d" else 2
    floor = {"name": "floor", "kind": "half_space", "point": [0.0] * dim,
             "normal": [0.0, 1.0, 0.0][:dim]}  # fmt: skip
    return {
        "title": "step", "duration": duration, "obstacle": [floor],
        "body": [body(shape, model, size, speed)],
        "solve": {"method": method, "estimate": False}, "output": {"fields": []},
    }  # fmt: skip


def cases(*, quick: bool) -> dict[str, dict]:
    """Scenes by the name under which their steps are listed."""
    fine, coarse = (0.04, 0.06) if quick else (0.018, 0.04)
    plane = 1.0 / 64 if quick else 1.0 / 128
    sphere = {"kind": "sphere", "radius": 0.5, "center": [0.0, 0.51, 0.0]}
    disc = {"kind": "disc", "radius": 0.5, "center": [0.0, 0.51]}
    return {
        "explicit, sphere, slow": scene(sphere, "3d", fine, 0.02, 1.2, "explicit"),
        "explicit, sphere, fast": scene(sphere, "3d", fine, 0.1, 1.2, "explicit"),
        "conserving, disc": scene(disc, "plane_strain", plane, 0.1, 1.0, "conserving"),
        "massless, disc": scene(disc, "plane_strain", plane, 0.1, 1.0, "massless"),
        "massless, sphere": scene(sphere, "3d", coarse, 0.1, 1.2, "massless"),
    }


def states(found: dict) -> dict[str, list[float]]:
    """Times of steps by how many contact nodes are active."""
    pairs = list(zip(found["times"], found["active"], strict=True))
    grown = 0
    by: dict[str, list[float]] = {"in flight": [], f"1 to {FEW} active": [], "more active": [],
                                  "more active, new ones": []}  # fmt: skip
    for seconds, active in pairs:
        new, grown = active > grown, max(grown, active)
        name = "in flight" if not active else (
            f"1 to {FEW} active" if active <= FEW else
            "more active, new ones" if new else "more active"
        )  # fmt: skip
        by[name].append(seconds)
    return {name: times for name, times in by.items() if times} | {ALL: found["times"]}


def main() -> None:
    """Print and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args()
    rows, notes = [], []
    for name, data in cases(quick=given.quick).items():
        done = subprocess.run(
            [sys.executable, "-c", _RUN, json.dumps(data)], stdout=subprocess.PIPE, check=True,
            text=True,
        )  # fmt: skip
        found = json.loads(done.stdout.splitlines()[-1])
        unit = median(found["unit"])
        plain = median(found["plain"]) if found["plain"] else None
        for state, times in states(found).items():
            step = mean(times) if state == ALL else median(times)
            rows.append([
                name, str(found["unknowns"]), str(found["contact"]), state, str(len(times)),
                f"{1e3 * step:.3g}", f"{1e3 * unit:.3g}", f"{step / unit:.2f}",
                "-" if plain is None else f"{step / plain:.2f}",
            ])  # fmt: skip
            print(*rows[-1], flush=True)
        size = 1024**2 * found["memory"] / found["unknowns"]
        low, _, high = quantiles(found["unit"], n=4)
        notes.append(
            f"{name} {size:.0f} B (most active {max(found['active'])}, quartiles of the unit "
            f"{1e3 * low:.3g} and {1e3 * high:.3g} ms)"
        )
    head = ["case", "unknowns", "contact nodes", "state", "steps", "step [ms]", "unit [ms]"]
    head += ["step / unit", "step / (AIJ product, updates)"]
    text = (
        f"{markdown_table(head, rows)}\n\nUnit: explicit, one BAIJ product and the vector updates; "
        "implicit, one solve with MUMPS's factors. Medians of times of the process. Peak memory "
        f"per unknown with meshing: {'; '.join(notes)}.\n"
    )
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "solid_steps.md").write_text(text, encoding="utf-8")
    write_stamp("solid_steps", folder=given.out)
    print(text)


if __name__ == "__main__":
    main()
