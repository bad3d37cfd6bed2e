"""What a time step of small bodies costs, in processor time, with all that `solve` does around it.

    python benchmarks/small_bodies.py [--runs 3] [--out benchmarks/results] [NAME...]

Each scene runs some times in turn in one process of one thread; the least counts. The time of a
step is that of the loop between the ends of its first step and its last, with rows and observers.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from finite_peers import BODY
from poured_balls import poured, watched
from rigid_ensemble import thrown
from rigid_peers import bodies, cases
from stamp import write_stamp

import impactfem
from impactfem import Scene
from impactfem.studies.study import markdown_table

HERE = Path(__file__).resolve().parent
DT = 1e-3
LIMITS = {
    "box on a floor": 0.1, "arm, two joints": 0.2, "chain of 50 links": 2.0,
    "200 balls, falling": 1.0, "200 balls, heap": 1.0, "1000 balls": 10.0,
    "two finite discs": 2.0,
}  # fmt: skip
"""What is wanted of each [ms]."""


def scene_of(name: str, steps: int, dt: float, **data: Any) -> Scene:
    """A scene of some bodies in the xy-plane or in space under gravity."""
    gravity = [0.0, -9.81, 0.0] if name.startswith("box") else [0.0, -9.81]
    return Scene.from_dict(
        {
            "title": name, "duration": steps * dt, "gravity": gravity, **data,
            "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
        }
    )  # fmt: skip


def slides() -> Scene:
    """A box that slides on a floor and tumbles to rest."""
    data = thrown("block").to_dict()
    data["body"][0] |= {"velocity": [3.0, 0.0, 0.0]}
    data["body"][0]["shape"]["corner"] = [-0.05, 0.0, -0.05]
    return Scene.from_dict(data | {"duration": 1000 * DT})


def arm() -> Scene:
    """A double pendulum of bodies and joints that strikes nothing."""
    return chain(2, 1000)


def chain(links: int, steps: int) -> Scene:
    """Links that swing from a joint."""
    at = next(case for case in cases() if case["kind"] == "chain") | {"links": links}
    return scene_of("chain", steps, DT, **bodies(at))


def discs() -> Scene:
    """Two discs of rubber of 340 unknowns each that strike each other."""
    found = [
        {
            "name": name, "kind": "solid", "model": "plane_strain", "mesh_size": 0.0088,
            "shape": {"kind": "disc", "radius": 0.05, "center": [place, 0.0]},
            "material": "neo_hookean", "density": BODY.density, "youngs_modulus": BODY.young,
            "poisson_ratio": BODY.poisson, "velocity": [speed, 0.0],
        }
        for name, place, speed in (("left", -0.0501, 2.0), ("right", 0.0501, -2.0))
    ]  # fmt: skip
    data = scene_of("discs", 100, 1.15e-4, body=found, contact=[{"between": ["left", "right"]}])
    return Scene.from_dict(data.to_dict() | {"gravity": [0.0, 0.0]})


def heap(count: int, steps: int) -> Scene:
    """Balls poured into a box, forces of friction to 1e-4."""
    return poured(count, steps).with_settings({"solve.friction_residual": 1e-4})


def laps(scene: Scene) -> np.ndarray:
    """Times of the steps of a run [ms]."""
    marks: list[float] = []
    with watched(lambda level: marks.append(time.process_time())):  # noqa: ARG005
        impactfem.solve(scene)
    return 1e3 * np.diff(marks)


RUNS: dict[str, tuple[Callable[[], Scene], dict[str, slice]]] = {
    "box": (slides, {"box on a floor": slice(None)}),
    "arm": (arm, {"arm, two joints": slice(None)}),
    "chain": (lambda: chain(50, 200), {"chain of 50 links": slice(None)}),
    "balls": (
        lambda: heap(200, 600),
        {"200 balls, falling": slice(0, 50), "200 balls, heap": slice(-50, None)},
    ),
    "many": (lambda: heap(1000, 60), {"1000 balls": slice(None)}),
    "discs": (discs, {"two finite discs": slice(None)}),
}


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", nargs="*", help=f"of {', '.join(RUNS)}; none: all")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    rows = []
    for name in given.name or RUNS:
        make, parts = RUNS[name]
        scene = make()
        laps(Scene.from_dict(scene.to_dict() | {"duration": 20 * scene.solve.dt}))  # compiles
        found = [laps(scene) for _ in range(given.runs)]
        for part, steps in parts.items():
            each = min(float(one[steps].mean()) for one in found)
            rows.append([part, f"{len(found[0])}", f"{each:.2f}", f"{LIMITS[part]:g}"])
            print(*rows[-1], sep=" | ", flush=True)
    if given.out is not None:
        head = ["scene", "steps", "a step [ms]", "wanted [ms]"]
        (given.out / "small_bodies.md").write_text(markdown_table(head, rows), encoding="utf-8")
        write_stamp("small_bodies", folder=given.out)


if __name__ == "__main__":
    main()
