"""Time a step of rigid balls that are poured into a box, with friction (half a minute for all).

    python benchmarks/poured_balls.py [COUNT...]

Steps of 1 ms over .15 s; the friction of each layer is solved to the residual of the package.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import impactfem
from impactfem import Scene
from impactfem.marching.rows import Level
from impactfem.marching.time_loop import TimeLoop

RADIUS, PITCH, STEPS = 0.05, 2.2, 150


def poured(count: int) -> Scene:
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
            "title": "Poured balls", "duration": 1e-3 * STEPS, "gravity": [0.0, 0.0, -9.81],
            "body": balls, "obstacle": obstacles, "contact": [law],
            "solve": {"dt": 1e-3, "estimate": False}, "output": {"fields": []},
        }
    )  # fmt: skip


def main() -> None:
    """Print a row for each number of balls."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="*", type=int, default=[40, 100, 200])
    inside, run = [0.0], TimeLoop.run

    def timed(self: TimeLoop[Any], observers: Sequence[Callable[[Level], None]] = ()) -> None:
        begin = time.perf_counter()
        run(self, observers)
        inside.append(time.perf_counter() - begin)

    TimeLoop.run = timed  # type: ignore[method-assign]
    print("| balls | before the steps [s] | a step [ms] |\n| --- | --- | --- |")
    for count in parser.parse_args().count:
        begin = time.perf_counter()
        impactfem.solve(poured(count))
        whole = time.perf_counter() - begin
        print(f"| {count} | {whole - inside[-1]:.1f} | {1e3 * inside[-1] / STEPS:.0f} |")


if __name__ == "__main__":
    main()
