"""Explicit steps under finite strain against a bare pass of their kernels.

A rubber ball falls and spins on a frictionless floor. What a step costs is counted in passes of the
element kernels over the body, which every explicit scheme takes once a step; the rest is the
equilibrium of the massless surface, contact, and what the history keeps.

    python benchmarks/explicit_steps.py [mesh size in m ...]
"""

import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from statistics import median
from typing import Any

import impactfem
from impactfem.marching.level_march import LevelMarch
from impactfem.system.element_forces import ElementForces
from impactfem.system.inward import Inward
from impactfem.system.surface_layer import SurfaceLayer

SIZES = (0.0062, 0.0037, 0.0028)
PARTS = {
    "pass": (ElementForces, "forces"), "layer": (SurfaceLayer, "forces"),
    "solver": (SurfaceLayer, "solve"), "tangent": (SurfaceLayer, "renew"),
    "inward": (Inward, "forces"), "squeeze": (ElementForces, "rate"),
    "step": (LevelMarch, "_advance"),
}  # fmt: skip


def ball(size: float) -> impactfem.Scene:
    """Scene of the ball of section 5 of the notes on finite strain."""
    return impactfem.Scene.from_dict(
        {
            "title": "rubber ball", "duration": 0.012, "gravity": [0.0, 0.0, -100.0],
            "body": [{
                "name": "ball", "kind": "solid", "model": "3d", "mesh_size": size,
                "shape": {"kind": "sphere", "radius": 0.05, "center": [0.0, 0.0, 0.0505]},
                "material": "neo_hookean", "density": 1100.0, "youngs_modulus": 1e6,
                "poisson_ratio": 0.4, "velocity": [0.0, 0.0, -2.0],
                "angular_velocity": [0.0, 30.0, 0.0],
            }],
            "obstacle": [{
                "name": "floor", "kind": "half_space", "point": [0.0, 0.0, 0.0],
                "normal": [0.0, 0.0, 1.0],
            }],
            "solve": {"method": "explicit", "courant": 0.6, "estimate": False},
            "output": {"fields": []},
        }
    )  # fmt: skip


@contextmanager
def timed() -> Iterator[dict[str, list[float]]]:
    """Times of all calls of the parts [s], by name."""
    times: dict[str, list[float]] = defaultdict(list)
    saved = {}

    def watched(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any) -> Any:
            begin = time.process_time()
            found = function(*args)
            times[name].append(time.process_time() - begin)
            return found

        return call

    for name, (owner, key) in PARTS.items():
        saved[name] = getattr(owner, key)
        setattr(owner, key, watched(name, saved[name]))
    try:
        yield times
    finally:
        for name, (owner, key) in PARTS.items():
            setattr(owner, key, saved[name])


def main(sizes: Sequence[float]) -> None:
    """Print a table: nodes, contact nodes, and what a step costs in passes."""
    impactfem.solve(ball(0.0125))  # compiles
    print("nodes contact  ns/cell  ms/step  passes:  step  " + "  ".join(list(PARTS)[1:6]))
    for size in sizes:
        with timed() as times:
            result = impactfem.solve(ball(size))
        details = result.summary["details"]
        # Medians of processor time: others use the machine, too.
        bare, step = median(times["pass"]), median(times["step"])
        steps = len(times["step"])
        shares = [sum(times[name]) / steps / bare for name in list(PARTS)[1:6]]
        told = "  ".join(f"{share:6.2f}" for share in shares)
        cells = 1e9 * bare / details["cells"]
        print(
            f"{details['nodes']:6d} {details['contact_nodes']:6d} {cells:8.1f}"
            f" {1e3 * step:8.2f} {step / bare:14.2f} {told}"
        )
        energy = result.history["total_energy"].values
        print(f"       energy {energy[-1] / energy[0] - 1.0:+.1e}, {steps} steps")


if __name__ == "__main__":
    main([float(size) for size in sys.argv[1:]] or SIZES)
