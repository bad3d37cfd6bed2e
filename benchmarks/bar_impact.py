"""Error and cost of the founding benchmark (K1) against the number of elements.

Run with ``python benchmarks/bar_impact.py``; it writes results/bar_impact.md. Each size runs in a
process of its own, so that the peak memory is its own; the first run of a machine also compiles the
forms and is left out.
"""

import json
import statistics
import subprocess
import sys

from stamp import RESULTS, write_stamp

from impactfem.studies.study import markdown_table

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
    """Print and write the table."""
    run(SIZES[0])
    head = ["n", "unknowns", "iterations", "displacement, largest", "force, L1"]
    head += ["energy, change", "time [s]", "memory [MiB]"]
    rows = []
    for size in SIZES:
        summaries = [run(size) for _ in range(REPEATS)]
        last = summaries[-1]
        seconds = statistics.median(summary["wall_time"] for summary in summaries)
        sets, error, energy = last["active_set"], last["error"], last["energy"]
        rows.append([
            f"{size}", f"{last['num_dofs']}", f"{sets['iterations']}",
            f"{error['displacement_max']:.1e}",
            f"{error['force_l1']:.1e}", f"{energy['final_relative_drift']:.0e}", f"{seconds:.2f}",
            f"{last['peak_memory_mib']:.0f}",
        ])  # fmt: skip
    text = f"{markdown_table(head, rows)}\n\nErrors are relative; medians of {REPEATS} runs.\n"
    (RESULTS / "bar_impact.md").write_text(text, encoding="utf-8")
    write_stamp("bar_impact")
    print(text)


if __name__ == "__main__":
    main()
