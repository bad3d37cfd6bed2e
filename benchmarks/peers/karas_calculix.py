"""Karas' problem in CalculiX: a quarter of the plate as S8R shells, ball and Hertz spring.

    python benchmarks/peers/karas_calculix.py [ELEMENTS] [STEP]

Needs `ccx` (Debian: calculix-ccx). Elements in half a side (8), step in s (5e-7). CalculiX expands
shells to quadratic bricks, so that the plate gives way to shear, which under a point has no limit
as elements get smaller. Newmark's rule without damping (ALPHA = 0); the spring is a table.
"""

import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HALF, THICK, RADIUS = 0.1, 0.008, 0.01
E, NU, RHO = 2.06e11, 0.3, 7800.0
MASS = RHO * 4.0 / 3.0 * np.pi * RADIUS**3
K = 4.0 / 3.0 * E / (2.0 * (1.0 - NU**2)) * np.sqrt(RADIUS)
PEAK, AT, LEAVES = 1379.64, 32.730e-6, 0.66415  # of a plate without shear, by modes


def deck(count: int, dt: float, duration: float) -> tuple[str, int, int]:
    """Input, and the nodes of the ball and of the plate's middle."""
    side = range(2 * count + 1)
    grid = [(i, j) for j in side for i in side if not (i % 2 and j % 2)]
    number = {place: k for k, place in enumerate(grid, start=1)}
    ball, size = len(grid) + 1, HALF / (2 * count)
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{number[i, j]}, {size * i:.9g}, {size * j:.9g}, 0." for i, j in grid]
    lines += [f"{ball}, 0., 0., 0.05", "*ELEMENT, TYPE=S8R, ELSET=PLATE"]
    around = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))
    for e, (j, i) in enumerate(np.ndindex(count, count), start=1):
        nodes = (number[2 * i + a, 2 * j + b] for a, b in around)
        lines.append(f"{e}, " + ", ".join(map(str, nodes)))
    last = count**2
    lines += [
        "*ELEMENT, TYPE=SPRINGA, ELSET=DENT", f"{last + 1}, {ball}, {number[0, 0]}",
        "*ELEMENT, TYPE=MASS, ELSET=BALL", f"{last + 2}, {ball}",
        "*MATERIAL, NAME=STEEL", "*ELASTIC", f"{E:g}, {NU}", "*DENSITY", f"{RHO}",
        "*SHELL SECTION, ELSET=PLATE, MATERIAL=STEEL", f"{THICK}",
        "*MASS, ELSET=BALL", f"{MASS / 4:.9g}", "*SPRING, ELSET=DENT, NONLINEAR",
    ]  # fmt: skip
    dents = np.concatenate([-np.linspace(3e-5, 0.0, 301), [1e-3]])
    lines += [f"{-K / 4 * max(-dent, 0.0) ** 1.5:.9g}, {dent:.9g}" for dent in dents]
    sets = {
        "RIM": [k for (i, j), k in number.items() if 2 * count in (i, j)],
        "CUTX": [k for (i, _), k in number.items() if i == 0],
        "CUTY": [k for (_, j), k in number.items() if j == 0],
        "SEEN": [ball, number[0, 0]],
    }
    for name, nodes in sets.items():
        lines += [f"*NSET, NSET={name}", *(f"{node}," for node in nodes)]
    lines += [
        "*BOUNDARY", "RIM, 3, 3", "CUTX, 1, 1", "CUTX, 5, 5", "CUTY, 2, 2", "CUTY, 4, 4",
        f"{ball}, 1, 2", "*INITIAL CONDITIONS, TYPE=VELOCITY", f"{ball}, 3, -1.",
        f"*STEP, INC={round(duration / dt) + 10}", "*DYNAMIC, DIRECT, ALPHA=0",
        f"{dt:g}, {duration:g}", "*NODE PRINT, NSET=SEEN, FREQUENCY=1", "U, V", "*END STEP",
    ]  # fmt: skip
    return "\n".join(lines) + "\n", ball, number[0, 0]


def printed(text: str, kind: str, node: int) -> np.ndarray:
    """Times and third components of a node, (steps, 2)."""
    blocks = re.finditer(kind + r".*?time\s+([\d.E+-]+)\n\n(.*?)\n\n", text + "\n\n", re.DOTALL)
    rows = ((block.group(1), line.split()) for block in blocks for line in block[2].splitlines())
    return np.array([[float(t), float(row[3])] for t, row in rows if int(row[0]) == node])


def main() -> None:
    """Run and compare with the reference."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    dt = float(sys.argv[2]) if len(sys.argv) > 2 else 5e-7
    text, ball, middle = deck(count, dt, 8e-5)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "karas.inp").write_text(text)
        start = time.perf_counter()
        command = [shutil.which("ccx") or "ccx", "-i", "karas"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
        seconds = time.perf_counter() - start
        found = Path(folder, "karas.dat").read_text()
    times, above = printed(found, "displacements", ball).T
    dent = np.maximum(printed(found, "displacements", middle)[:, 1] - above, 0.0)
    force, speed = K * dent**1.5, printed(found, "velocities", ball)[-1, 1]
    at = int(force.argmax())
    end = times[np.flatnonzero(force > 0.0)[-1]]
    print(f"{count} elements in half a side, {dt:g} s, {seconds:.1f} s of wall time")
    shown = {
        "largest force [N]": (force[at], PEAK), "at [s]": (times[at], AT),
        "end [s]": (end, 73.040e-6), "ball leaves with [m/s]": (speed, LEAVES),
    }  # fmt: skip
    for name, (value, known) in shown.items():
        print(f"{name} {value:.6g} ({100 * (value / known - 1):+.2f} %)")


if __name__ == "__main__":
    main()
