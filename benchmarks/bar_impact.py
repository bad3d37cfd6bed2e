"""Error and cost of the founding benchmark (K1) against the number of elements.

Run with ``python benchmarks/bar_impact.py``. Each size runs in a process of its own, so that the
peak memory is its own; the first run of a machine also compiles the forms and is left out.
"""

import json
import statistics
import subprocess
import sys

SIZES = (10, 20, 40, 80, 160)
REPEATS = 3

_RUN = """
import json, sys, impactfem
from impactfem.shipped import shipped_scenes
scene = impactfem.Scene.from_toml(shipped_scenes()["bar_impact"])
result = impactfem.solve(scene, elements=int(sys.argv[1]))
print(json.dumps(result.summary))
"""


def run(elements: int) -> dict:
    """Summary of one run in a fresh process."""
    done = subprocess.run(
        [sys.executable, "-c", _RUN, str(elements)], capture_output=True, check=True, text=True
    )
    return json.loads(done.stdout)


def main() -> None:
    """Print the table."""
    run(SIZES[0])
    print("| n | layers | unknowns | iterations | set changes | u max | F L1 | time [s] | MiB |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for size in SIZES:
        summaries = [run(size) for _ in range(REPEATS)]
        last = summaries[-1]
        seconds = statistics.median(summary["wall_time"] for summary in summaries)
        sets, error = last["active_set"], last["error"]
        print(
            f"| {size} | {last['num_steps']} | {last['num_dofs']} | {sets['iterations']} "
            f"| {sets['set_changes']} | {error['displacement_max']:.1e} | {error['force_l1']:.1e} "
            f"| {seconds:.2f} | {last['peak_memory_mib']:.0f} |"
        )


if __name__ == "__main__":
    main()
