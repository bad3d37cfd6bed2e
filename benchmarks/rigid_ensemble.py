"""Ensembles of one rigid body beside single runs and MuJoCo: time of a step of a member.

    python benchmarks/rigid_ensemble.py [--python PYTHON] [--out benchmarks/results]

PYTHON imports MuJoCo; without it only ours run. Bodies are thrown on a floor with friction from
0.1 m and come to lie; times are those of the process on one thread.
"""

import argparse
import dataclasses
import json
import os
import subprocess
import time
from pathlib import Path

import numpy as np
from stamp import write_stamp

import impactfem
from impactfem.studies.study import markdown_table

HERE = Path(__file__).resolve().parent
DT, DURATION = 1e-3, 1.0
FEW = 200  # members in MuJoCo
SHAPES = {
    "block": {"size": [0.1, 0.1, 0.1], "corner": [-0.05, 0.1, -0.05]},
    "sphere": {"radius": 0.05, "center": [0.0, 0.15, 0.0]},
    "cylinder": {"radius": 0.05, "height": 0.02, "center": [0.0, 0.14, 0.0]},
}


def thrown(kind: str) -> impactfem.Scene:
    """A body above a floor."""
    return impactfem.Scene.from_dict(
        {
            "title": kind, "duration": DURATION, "gravity": [0.0, -9.81, 0.0],
            "body": [{
                "kind": "rigid", "name": "b", "shape": {"kind": kind, **SHAPES[kind]},
                "density": 1000.0,
            }],
            "obstacle": [{
                "kind": "half_space", "name": "floor", "point": [0.0] * 3,
                "normal": [0.0, 1.0, 0.0],
            }],
            "contact": [{
                "between": ["b", "floor"], "friction_coefficient": 0.3, "restitution": 0.3
            }],
            "solve": {"dt": DT, "estimate": False}, "output": {"fields": []},
        }
    )  # fmt: skip


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", default=os.environ.get("PEER_RIGID"))
    parser.add_argument("--members", type=int, default=10000)
    parser.add_argument("--out", type=Path, default=HERE / "results")
    given = parser.parse_args()
    rows, note, steps = [], "", round(DURATION / DT)
    for kind in SHAPES:
        scene, rng = thrown(kind), np.random.default_rng(0)
        velocity = rng.normal(size=(given.members, 3))
        spin = 10.0 * rng.normal(size=(given.members, 3))
        start = {"velocity": velocity, "angular_velocity": spin, "threads": 1}
        few = {name: each if name == "threads" else each[:2] for name, each in start.items()}
        impactfem.studies.solve_ensemble(scene, **few)  # compiles
        begin = time.process_time()
        found = impactfem.studies.solve_ensemble(scene, **start)
        ours = 1e6 * (time.process_time() - begin) / steps / given.members
        begin = time.process_time()
        flies = impactfem.studies.solve_ensemble(dataclasses.replace(scene, duration=0.1), **start)
        falls = 1e6 * (time.process_time() - begin) / (0.1 / DT) / given.members
        body = dataclasses.replace(
            scene.bodies[0], velocity=velocity[0].tolist(), angular_velocity=spin[0].tolist()
        )
        single = dataclasses.replace(scene, bodies=(body,))
        impactfem.solve(single)
        begin = time.process_time()
        impactfem.solve(single)
        alone = 1e6 * (time.process_time() - begin) / steps
        peer = "-"
        if given.python:
            case = {
                "kind": kind, "dt": DT, "steps": steps, "velocity": velocity[:FEW].tolist(),
                "spin": spin[:FEW].tolist(),
            }  # fmt: skip
            script = HERE / "peers" / "ensemble_mujoco.py"
            done = subprocess.run(
                [given.python, str(script), json.dumps(case)], check=True, text=True,
                stdout=subprocess.PIPE, env={**os.environ, "OMP_NUM_THREADS": "1"},
            )  # fmt: skip
            answer = json.loads(done.stdout)
            peer, note = f"{answer['seconds']:.1f}", f"MuJoCo {answer['version']}"
        handed = found.details["handed_back"] / steps / given.members
        rows.append([
            kind, f"{given.members}", f"{falls:.1f}", f"{ours:.1f}", f"{handed:.0e}",
            f"{alone:.0f}", peer,
        ])  # fmt: skip
        print(*rows[-1], flies.details, sep=" | ", flush=True)
    head = [
        "body", "members", "first 0.1 s [µs]", "1 s [µs]", "steps solved elsewhere",
        "one run by solve [µs]", "MuJoCo [µs]",
    ]  # fmt: skip
    (given.out / "rigid_ensemble.md").write_text(markdown_table(head, rows), encoding="utf-8")
    write_stamp("rigid_ensemble", folder=given.out, note=note)


if __name__ == "__main__":
    main()
