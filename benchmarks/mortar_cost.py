"""CPU time to match two non-matching surfaces by mortar integrals, against the number of faces.

Run: python benchmarks/mortar_cost.py. Writes benchmarks/results/mortar_cost.md.
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "contact"))
from mortar_surfaces import segment, square
from stamp import write_stamp

from impactfem.contact.mortar import faces_in_reach, mortar
from impactfem.contact.mortar_surface import Kind, Surface

RESULTS = Path(__file__).resolve().parent / "results"
SIZES = (1_000, 10_000, 100_000)
FAMILIES: list[tuple[Kind, int]] = [
    ("interval", 1), ("interval", 2), ("triangle", 1), ("quadrilateral", 1),
    ("triangle", 2), ("quadrilateral", 2),
]  # fmt: skip


def couple(kind: Kind, degree: int, faces: int) -> tuple[Surface, Surface, float]:
    """A carrier of about so many faces, a larger surface of 0.7 times their size, a face's size."""
    if kind == "interval":
        sides = faces
        carrier = segment(np.linspace(0, 1, sides + 1), degree, height=0.3 / sides, up=False)
        other = segment(np.linspace(-0.1, 1.1, int(1.7 * sides)), degree)
        return carrier, other, 1 / sides
    sides = round((faces / (2 if kind == "triangle" else 1)) ** 0.5)
    x, y = np.linspace(0, 1, sides + 1), np.linspace(-0.1, 1.1, int(1.7 * sides))
    carrier = square(kind, x, x, degree, height=0.3 / sides, up=False)
    return carrier, square(kind, y, y, degree), 1 / sides


def main() -> None:
    """Measure and write the table."""
    for kind, degree in FAMILIES:  # compile
        carrier, other, size = couple(kind, degree, 50)
        mortar(carrier, other, size)
    lines = [
        "CPU time on one core.",
        "",
        "| faces | degree | number | overlaps | search [s] | whole [s] | per face [us] |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for kind, degree in FAMILIES:
        for faces in SIZES:
            carrier, other, size = couple(kind, degree, faces)
            begin = time.process_time()
            pairs = faces_in_reach(carrier, other, size)
            middle = time.process_time()
            found = mortar(carrier, other, size, pairs=pairs)
            whole = time.process_time() - begin
            count = len(carrier.faces)
            lines.append(
                f"| {kind} | {degree} | {count} | {len(found.faces)} | {middle - begin:.3f} "
                f"| {whole:.3f} | {1e6 * whole / count:.0f} |"
            )
            print(lines[-1], flush=True)
    lines += ["", "Search alone, triangles of degree 1, reach in sizes of a face:", ""]
    lines += ["| number | reach | pairs | search [s] |", "| --- | --- | --- | --- |"]
    for faces in SIZES[1:]:
        for reach in (1, 10, 100):
            carrier, other, size = couple("triangle", 1, faces)
            far = other.moved(other.points - np.array([0.0, 0.0, 0.9 * reach * size]))
            begin = time.process_time()
            pairs = faces_in_reach(carrier, far, reach * size)
            seconds = time.process_time() - begin
            lines.append(f"| {len(carrier.faces)} | {reach} | {len(pairs)} | {seconds:.3f} |")
            print(lines[-1], flush=True)
    (RESULTS / "mortar_cost.md").write_text("\n".join(lines) + "\n")
    write_stamp("mortar_cost")


if __name__ == "__main__":
    main()
