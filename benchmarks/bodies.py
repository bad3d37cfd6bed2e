"""Time of a step of two bodies: what detection takes, against a rigid obstacle, against faces.

    python benchmarks/bodies.py [--out benchmarks/results]

A disc is thrown on a block (updated pairs), and on a rigid half-space with as many unknowns. The
time of a layer is the median over the layers with contact; detection is that of the gaps.
"""

import argparse
import time
from pathlib import Path
from unittest.mock import patch

import numpy as np
from stamp import write_stamp

import impactfem
from impactfem.contact.gaps import Gaps
from impactfem.contact.pairs import PairGaps
from impactfem.marching.solids import SolidMarch
from impactfem.studies.study import markdown_table

SIZES = (0.08, 0.04, 0.02, 0.01)
METHODS = ("explicit", "massless")
LAYERS = 60


def scene(size: float, method: str, kind: str) -> impactfem.Scene:
    """A disc on a block of as many unknowns ("fixed", "updated"), or on a plane ("obstacle")."""
    plain = {"kind": "solid", "model": "plane_strain", "density": 1.0, "youngs_modulus": 1.0,
             "poisson_ratio": 0.3, "mesh_size": size}  # fmt: skip
    radius = 0.5 if kind != "obstacle" else 0.5 * np.sqrt(2.0)
    top = plain | {
        "name": "disc", "velocity": [0.02, -0.1],
        "shape": {"kind": "disc", "radius": radius, "center": [0.0, radius + 1e-3]},
    }  # fmt: skip
    table = {"title": "step", "duration": LAYERS * 0.3 * size, "body": [top]}
    table["solve"] = {"method": method, "dt": 0.3 * size}
    table["output"] = {"fields": []}
    if kind == "obstacle":
        floor = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
        return impactfem.Scene.from_dict(table | {"obstacle": [floor]})
    block = plain | {"name": "block", "mesh_size": 1.1 * size}
    block["shape"] = {"kind": "block", "size": [1.0, 0.8], "corner": [-0.5, -0.8]}
    table["body"] = [top, block]
    table["solve"] |= {"normals": kind}
    return impactfem.Scene.from_dict(table)


def measure(case: impactfem.Scene) -> tuple[int, float, float]:
    """Unknowns, median time of a layer with contact and of its gaps [s]."""
    layers, gaps = [], []
    advance = SolidMarch._advance  # noqa: SLF001  (what is timed)

    def timed(self: SolidMarch) -> object:
        begin, spent = time.perf_counter(), len(gaps)
        force = advance(self)
        if self.contact.multiplier.any():
            layers.append((time.perf_counter() - begin, sum(gaps[spent:])))
        return force

    def watched(at: object) -> object:
        def found(*given: object, **more: object) -> object:
            begin = time.perf_counter()
            answer = at(*given, **more)  # type: ignore[operator]
            gaps.append(time.perf_counter() - begin)
            return answer

        return found

    alone = len(case.bodies) == 1
    kind = Gaps if alone else PairGaps
    with patch.object(SolidMarch, "_advance", timed), patch.object(kind, "at", watched(kind.at)):
        result = impactfem.solve(case)
    whole, part = np.median(np.array(layers), axis=0)
    return int(result.summary["num_dofs"]), float(whole), float(part)


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    given = parser.parse_args()
    rows = []
    for method in METHODS:
        for size in SIZES:
            found = {k: measure(scene(size, method, k)) for k in ("obstacle", "fixed", "updated")}
            unknowns, alone, _ = found["obstacle"]
            _, fixed, _ = found["fixed"]
            both, updated, detection = found["updated"]
            rows.append([
                method, f"{both}", f"{unknowns}", f"{1e3 * alone:.2f}", f"{1e3 * fixed:.2f}",
                f"{1e3 * updated:.2f}", f"{1e3 * detection:.2f}", f"{detection / updated:.0%}",
                f"{fixed / alone * unknowns / both:.2f}",
            ])  # fmt: skip
            print(rows[-1], flush=True)
    head = ["method", "unknowns", "with obstacle", "obstacle [ms]", "fixed [ms]", "updated [ms]",
            "detection [ms]", "share", "fixed / obstacle, each unknown"]  # fmt: skip
    (given.out / "bodies.md").write_text(markdown_table(head, rows) + "\n", encoding="utf-8")
    write_stamp("bodies", folder=given.out)


if __name__ == "__main__":
    main()
