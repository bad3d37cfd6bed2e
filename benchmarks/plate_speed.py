"""What a step of a plate of 1e5 unknowns costs, in solves: a ball that dents it (Karas).

    python benchmarks/plate_speed.py

Prints the seconds of a step in contact and in flight, those of one solve with the factors of the
layer, and their ratio; beside a plate of 1e4.
"""

import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.sparse import diags
from scipy.sparse.linalg import splu

import impactfem
from impactfem.system.plate_making import discretised
from impactfem.system.plate_mesh import plate_mesh
from impactfem.system.surface import CHOLESKY

SIDES = ("left", "right", "bottom", "top")
STEEL = {"density": 7800.0, "youngs_modulus": 2.06e11, "poisson_ratio": 0.3}
DT = 2.5e-7


def plate(size: float) -> dict[str, object]:
    """Of Karas' problem, with elements of a size [m]."""
    return {
        "kind": "plate", "name": "plate", "mesh_size": size, "thickness": 0.008,
        "outline": {"kind": "rectangle", "size": [0.2, 0.2]},
        "supports": [{"edge": edge, "kind": "simply_supported"} for edge in SIDES],
    } | STEEL  # fmt: skip


def seconds(size: float, layers: int, gap: float) -> float:
    """Wall time of a run [s]."""
    ball = {
        "kind": "rigid", "name": "ball", "density": 7800.0, "velocity": [0.0, 0.0, -1.0],
        "shape": {"kind": "sphere", "radius": 0.01, "center": [0.0, 0.0, 0.014 + gap]},
    }  # fmt: skip
    contact = {"between": ["ball", "plate"], "stiffness": 1.50916e10, "stiffness_exponent": 1.5}
    scene = impactfem.Scene.from_dict(
        {"title": "speed", "duration": layers * DT, "gravity": [0.0, 0.0, 0.0],
         "body": [plate(size), ball], "contact": [contact], "output": {"fields": []},
         "solve": {"dt": DT, "estimate": False}}
    )  # fmt: skip
    start = time.perf_counter()
    impactfem.solve(scene)
    return time.perf_counter() - start


def one_solve(size: float) -> tuple[int, float]:
    """Unknowns, and the seconds of a solve with the factors of a layer."""
    body = impactfem.Plate(**{key: value for key, value in plate(size).items() if key != "kind"})
    with tempfile.TemporaryDirectory() as folder:
        bodies = discretised(body, plate_mesh(body, Path(folder)), touches=False, sprung=True)
    factor = splu((bodies.stiffness + 4.0 / DT**2 * diags(bodies.weight)).tocsc(), **CHOLESKY)
    right = np.random.default_rng(1).normal(size=len(bodies.position))
    each = []
    for _ in range(15):
        start = time.perf_counter()
        factor.solve(right)
        each.append(time.perf_counter() - start)
    return len(right), float(np.median(each))


def main() -> None:
    """Measure both plates."""
    for size in (0.0036, 0.00118):
        unknowns, solve = one_solve(size)
        print(f"{unknowns} unknowns, one solve {1e3 * solve:.1f} ms")
        for name, gap in (("contact", 0.0), ("flight", 1e-3)):
            few, many = (min(seconds(size, n, gap) for _ in range(2)) for n in (100, 500))
            step = (many - few) / 400
            print(f"  {name}: {1e3 * step:.1f} ms a step, {step / solve:.2f} solves")


if __name__ == "__main__":
    main()
