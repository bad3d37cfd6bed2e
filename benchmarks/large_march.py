"""Time and memory of sweeps against space-time nodes, each size in a process of its own.

    python benchmarks/large_march.py [--out benchmarks/results]

Sizes from 1e5 to 1e8 nodes, among them 5 million (1000 elements x 5000 layers); every 50th layer
is kept.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from stamp import write_stamp

from impactfem.studies.study import markdown_table

# Elements and layers: three decades of nodes, of one shape; the third is the one with 5 million.
SIZES = ((141, 707), (447, 2237), (1000, 5000), (1414, 7071), (4472, 22360))
METHODS = ("galerkin", "conserving")

_RUN = """
import json, resource, statistics, sys, time
import numpy as np
from impactfem.scene import Bar, PiecewiseConstant
method, elements, layers = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
from impactfem.marching.march import Marching, march
from impactfem.marching.schemes import SCHEMES
bar = Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=0.51414, velocity=-0.5)
x = np.linspace(0.0, 1.0, elements + 1)
numbers = Marching(1.0 / elements, layers, every=50)
march(bar, PiecewiseConstant(), x[:: elements // 2], SCHEMES[method], Marching(0.1, 5, every=50))
loaded = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
times = []
for _ in range(5):
    start = time.perf_counter()
    march(bar, PiecewiseConstant(), x, SCHEMES[method], numbers)
    times.append(time.perf_counter() - start)
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps([statistics.median(times), peak, peak - loaded]))
"""


def run(method: str, elements: int, layers: int) -> tuple[float, float, float]:
    """Seconds, peak memory of the process and growth of it [MiB]."""
    done = subprocess.run(
        [sys.executable, "-c", _RUN, method, str(elements), str(layers)],
        capture_output=True, check=True, text=True,
    )  # fmt: skip
    seconds, peak, growth = json.loads(done.stdout)
    return seconds, peak, growth


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    given = parser.parse_args()
    rows, slopes = [], []
    for method in METHODS:
        points = []
        for elements, layers in SIZES:
            seconds, peak, growth = run(method, elements, layers)
            nodes = (elements + 1) * (layers + 1)
            points.append((nodes, seconds))
            rows.append([
                method, str(elements), str(layers), f"{nodes:.3g}", f"{1e3 * seconds:.3g}",
                f"{1e9 * seconds / nodes:.2f}", f"{peak:.0f}", f"{growth:.1f}",
            ])  # fmt: skip
            print(*rows[-1], flush=True)
        slope = np.polyfit(*np.log(np.array(points)).T, 1)[0]
        slopes.append(f"{method} {slope:.2f}")
    head = ["method", "elements", "time steps", "nodes", "time [ms]", "ns a node"]
    head += ["peak of the process [MiB]", "of it the march [MiB]"]
    text = (
        f"{markdown_table(head, rows)}\n\nTime grows with nodes to the power: {', '.join(slopes)}."
        f" Every 50th time level is kept; medians of 5 runs.\n"
    )
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "large_march.md").write_text(text, encoding="utf-8")
    write_stamp("large_march", folder=given.out)
    print(text)


if __name__ == "__main__":
    main()
