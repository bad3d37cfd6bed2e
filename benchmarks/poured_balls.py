"""Time steps of rigid balls that are poured into a box, with friction (ten minutes for all).

    python benchmarks/poured_balls.py [--python PYTHON] [--out benchmarks/results] [COUNT...]

`PYTHON` imports MuJoCo; without it only ours run.

Steps of 1 ms, forces of friction to a residual of 1e-4 and as exact as they are found. Times are
those of the processor, of one core; each run has a process of its own.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from stamp import write_stamp

import impactfem
from impactfem import Scene
from impactfem.marching.rows import Level
from impactfem.marching.time_loop import TimeLoop
from impactfem.studies.study import markdown_table

RADIUS, PITCH = 0.05, 2.2
STEPS = {1000: 150}
"""Steps of runs with so many balls, of others `USUAL`."""
USUAL, WINDOW = 600, 50


def poured(count: int, steps: int) -> Scene:
    """Balls on a loose lattice, a little off it, above the floor of a box."""
    side, noise = (4 if count <= 100 else 6), np.random.default_rng(0)
    layers, rest = np.divmod(np.arange(count), side * side)
    places = np.column_stack([rest // side + 0.5, rest % side + 0.5, layers])
    places *= RADIUS * np.array([PITCH, PITCH, 2.15])
    places[:, :2] += noise.uniform(-0.05, 0.05, (count, 2)) * RADIUS
    places[:, 2] += 1.01 * RADIUS
    balls = [
        {"kind": "rigid", "name": f"ball_{k}", "mass": 0.1,
         "shape": {"kind": "sphere", "radius": RADIUS, "center": place}}
        for k, place in enumerate(places.tolist())
    ]  # fmt: skip
    width = side * PITCH * RADIUS
    walls = {
        "floor": ([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), "left": ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        "right": ([width, 0.0, 0.0], [-1.0, 0.0, 0.0]), "front": ([0.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
        "back": ([0.0, width, 0.0], [0.0, -1.0, 0.0]),
    }  # fmt: skip
    obstacles = [
        {"kind": "half_space", "name": name, "point": point, "normal": normal}
        for name, (point, normal) in walls.items()
    ]
    law = {"between": ["*", "*"], "friction_coefficient": 0.3, "restitution": 0.2}
    return Scene.from_dict(
        {
            "title": "Poured balls", "duration": 1e-3 * steps, "gravity": [0.0, 0.0, -9.81],
            "body": balls, "obstacle": obstacles, "contact": [law],
            "solve": {"dt": 1e-3, "estimate": False}, "output": {"fields": []},
        }
    )  # fmt: skip


@contextmanager
def watched(tick: Callable[[Level], None]) -> Iterator[None]:
    """Have what runs inside show the level after each step.

    Raises:
        RuntimeError: It showed none.
    """
    go_on, shown = TimeLoop.go_on, []

    def watching(
        loop: TimeLoop[Any], observers: Sequence[Callable[[Level], None]], end: int
    ) -> None:
        shown.append(end)
        go_on(loop, [*observers, tick], end)

    TimeLoop.go_on = watching  # type: ignore[method-assign]
    try:
        yield
    finally:
        TimeLoop.go_on = go_on  # type: ignore[method-assign]
    if not shown:
        raise RuntimeError("no time loop ran")


def measured(count: int, asked: float | None) -> dict[str, Any]:
    """One run in this process: times of the processor, memory, residual and penetration."""
    steps, marks, seen = STEPS.get(count, USUAL), [], {}

    def mark(level: Level) -> None:
        marks.append(time.process_time())
        seen["push"] = int((level.force > 0.0).sum())
        seen["depth"] = max(seen.get("depth", 0.0), -float(level.gap.min()))

    impactfem.solve(poured(25, 100))  # what is compiled or loaded once
    begin = time.process_time()
    scene = poured(count, steps)
    if asked is not None:
        scene = scene.with_settings({"solve.friction_residual": asked})
    with watched(mark):
        found = impactfem.solve(scene)
    whole, details = time.process_time() - begin, found.summary["details"]
    each, left = 1e3 * np.diff(marks), details.get("friction_residual", 0.0)
    return {
        "by": "ours",
        "balls": count,
        "residual asked": "-" if asked is None else f"{asked:.0e}",
        "reached": f"{left:.0e}" if left else "rounding",
        "before and after [s]": f"{whole - marks[-1] + marks[0]:.1f}",
        "falling [ms]": f"{each[:WINDOW].mean():.1f}",
        "at the end [ms]": f"{each[-WINDOW:].mean():.1f}",
        "steps": len(each),
        "contacts there": seen["push"],
        "depth / radius": f"{seen['depth'] / RADIUS:.3f}",
        "memory [MiB]": f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f}",
    }


def of_peer(python: str, count: int) -> dict[str, Any]:
    """The same balls and walls in MuJoCo."""
    steps = STEPS.get(count, USUAL)
    scene = poured(count, steps).to_dict()
    case = {
        "radius": RADIUS, "steps": steps, "window": WINDOW, "tolerance": "1e-8",
        "places": [body["shape"]["center"] for body in scene["body"]],
        "walls": [(wall["point"], wall["normal"]) for wall in scene["obstacle"]],
    }  # fmt: skip
    script = Path(__file__).parent / "peers" / "poured_mujoco.py"
    command = [python, str(script), json.dumps(case)]
    done = subprocess.run(command, capture_output=True, check=True, text=True)
    row: dict[str, Any] = json.loads(done.stdout)
    row.pop("rest")  # for rigid_peers.py
    return row


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="*", type=int, default=[20, 50, 200, 1000])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    parser.add_argument("--one", type=float, help="residual of a single run (0: none)")
    parser.add_argument("--python", help="of an environment with MuJoCo")
    given = parser.parse_args()
    if given.one is not None:
        print(json.dumps(measured(given.count[0], given.one or None)))
        return
    rows = []
    for count in given.count:
        for asked in ("1e-4", "0"):
            command = [sys.executable, __file__, str(count), "--one", asked]
            done = subprocess.run(command, capture_output=True, check=True, text=True)
            rows.append(json.loads(done.stdout.splitlines()[-1]))
            print(rows[-1], flush=True)
        if given.python is not None:
            rows.append(of_peer(given.python, count))
            print(rows[-1], flush=True)
    cells = [[str(value) for value in row.values()] for row in rows]
    table = markdown_table(list(rows[0]), cells) + "\n"
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "poured_balls.md").write_text(table, encoding="utf-8")
    write_stamp("poured_balls", folder=given.out)


if __name__ == "__main__":
    main()
