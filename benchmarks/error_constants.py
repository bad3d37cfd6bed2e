"""Constants C of the error bounds C contacts / elements^q, from random scenes with gravity.

    python benchmarks/error_constants.py [--scenes 300] [--out benchmarks/results]

The largest C over all scenes is what `error` of `impactfem.methods.METHODS` must not fall below.
"""

import argparse
import math
from pathlib import Path

import numpy as np
from stamp import write_stamp

import impactfem
from impactfem.reference.bar import exact_bar
from impactfem.studies.study import markdown_table

VARIANTS = (
    ("galerkin", 1.0, 1.0), ("galerkin", 0.5, 2 / 3), ("conserving", 0.5, 1.0),
    ("conserving", 1.0, 1.0), ("conserving", 2.0, 1.0),
    ("dg", None, 2 / 3),
)  # fmt: skip
SIZES = (20, 80, 320)


def fall(rng: np.random.Generator) -> impactfem.Scene:
    """A bar of any length and wave speed thrown at a wall in a gravity field."""
    length, speed = 10.0 ** rng.uniform(-3, 3), 10.0 ** rng.uniform(-3, 4)
    gap, velocity, pull = (10.0 ** rng.uniform(*r) for r in ((-1.3, 0.5), (-1.5, 0.3), (-1.5, 1)))
    arrival = math.sqrt(velocity**2 + 2.0 * pull * gap)
    bounces = rng.uniform(0.5, 3.5)
    end = (arrival - velocity) / pull + 2.0 + bounces * (2.0 + 2.0 * arrival / pull)
    return impactfem.Scene(
        title="fall",
        duration=min(end, 120.0) * length / speed,
        gravity=pull * speed**2 / length,
        bodies=[
            impactfem.Bar(
                length=length, density=1.0, youngs_modulus=speed**2,
                gap=gap * length, velocity=-velocity * speed,
            )
        ],
        obstacles=[impactfem.Wall()],
    )  # fmt: skip


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=300)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    given = parser.parse_args()
    rng = np.random.default_rng(5)
    scenes = [fall(rng) for _ in range(given.scenes)]
    counted = [(scene, len(exact_bar(scene).contacts)) for scene in scenes]
    counted = [(scene, contacts) for scene, contacts in counted if contacts]
    rows = []
    for method, courant, rate in VARIANTS:
        sizes, some = (SIZES, counted) if method != "dg" else ((10, 20), counted[:60])
        for n in sizes:
            found = np.array([
                _errors(scene, method, n, courant) * n**rate / contacts for scene, contacts in some
            ])  # fmt: skip
            name = method if courant is None else f"{method}, courant {courant:g}"
            u, force = found.T
            rows.append([
                name, str(n), f"{rate:.2f}", str(len(some)), f"{np.median(u):.2f}",
                f"{np.quantile(u, 0.9):.2f}", f"{u.max():.2f}", f"{np.median(force):.2f}",
                f"{force.max():.2f}",
            ])  # fmt: skip
            print(*rows[-1], flush=True)
    head = ["method", "n", "q", "scenes", "C median", "C 90 %", "C largest", "force: C median"]
    text = f"{markdown_table([*head, 'force: C largest'], rows)}\n"
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "error_constants.md").write_text(text, encoding="utf-8")
    write_stamp("error_constants", folder=given.out)


def _errors(scene: impactfem.Scene, method: str, n: int, courant: float | None) -> np.ndarray:
    layers = scene.duration / scene.bodies[0].transit_time * n
    case = scene.with_settings({"output.every": max(1, int(layers) // 200)})
    keys = {"fitted": False} if courant is None else {"courant": courant}
    error = impactfem.solve(case, method=method, elements=n, **keys).summary["error"]
    return np.array([error["displacement_max"], error["force_l1"]])


if __name__ == "__main__":
    main()
