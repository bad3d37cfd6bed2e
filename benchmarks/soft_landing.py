"""A MEMS strip lands softly from five starts of the search (a quarter of an hour of one core).

    python benchmarks/soft_landing.py [--results benchmarks/results] [--images docs/images]

Writes soft_landing.md with its stamp, and soft_landing.png: the tip after a step of the voltage and
after the pulse that the search found. Bounces are the largest gaps after the first touch. The
answer is run again with more elements.
"""

import time
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from stamp import study_arguments, write_stamp

import impactfem
from impactfem import Scene
from impactfem.studies.study import markdown_table

Floats = NDArray[np.float64]
DEMO = Path(__file__).resolve().parents[1] / "demos" / "soft_landing" / "scene.toml"
QUIET = {"report": False, "pictures": False, "fields": []}
SEEDS = 5
STEP = 8e-6  # [s] of both switches: the voltage stays on


def scene(off: float, on: float, **beam: Any) -> Scene:
    """The demo with other switches [s], or another beam."""
    data = Scene.from_toml(DEMO).to_dict()
    data["body"][0] |= beam
    for parameter, start in zip(data["parameter"], (off, on), strict=True):
        parameter |= {"start": start, "bounds": [0.5e-6, STEP]}
    return Scene.from_dict(data | {"output": QUIET}, base=DEMO.parent)


def landing(found: impactfem.Result) -> tuple[float, float, Floats, Floats]:
    """First touch [s], bounce [m], and the tip over the bump [m] at times [s]."""
    history = found.history
    times, gap = np.asarray(history["time"]), np.asarray(history["tip.uy"]) + 1e-6
    first = found.summary["contact"]["intervals"][0][0]
    return first, float(gap[times > first].max()), times, gap


def row(seed: int) -> tuple[list[str], float, tuple[float, ...]]:
    """One search: what is told of it, its objective, its switches [s]."""
    random = np.random.default_rng(seed)
    start = random.uniform(2.2e-6, 3.2e-6), random.uniform(3.5e-6, 5e-6)
    begun = time.perf_counter()
    found = impactfem.optimise(scene(*start))
    answer = tuple(each["value"] for each in found.parameters.values())
    first, bounce, *_ = landing(impactfem.solve(scene(*answer)))
    told = "trusted" if found.trusted else found.status
    cells = [
        str(seed), *(f"{1e6 * each:.3f}" for each in (*start, *answer)), f"{first * 1e6:.3f}",
        f"{bounce * 1e9:.2f}", f"{found.objective['final']:.4f}", told,
        str(found.gradient_runs), f"{time.perf_counter() - begun:.0f}",
    ]  # fmt: skip
    print(cells, found.objective["final"], answer, flush=True)
    return cells, found.objective["final"], answer


def main() -> None:
    """Search, run again, write."""
    options = study_arguments(__doc__).parse_args()
    searches = [row(seed) for seed in range(SEEDS)]
    write(searches, options.results, options.images)


def write(
    searches: list[tuple[list[str], float, tuple[float, ...]]], results: Path, images: Path
) -> None:
    """Run the best answer with more elements; write tables and the picture."""
    rows, best = [each[0] for each in searches], min(searches, key=lambda each: each[1])[2]
    head = ["seed", "off, start [us]", "on, start", "off", "on", "lands [us]", "bounce [nm]"]
    text = markdown_table([*head, "objective", "search", "gradients", "seconds"], rows)
    again = []
    figure, axes = plt.subplots(figsize=(7.0, 3.6), layout="constrained")
    for elements in (2, 4, 8):
        for name, switches in (("step", (STEP, STEP)), ("pulse", best)):
            first, bounce, times, gap = landing(
                impactfem.solve(scene(*switches, elements=elements))
            )
            again.append([str(elements), name, f"{first * 1e6:.3f}", f"{bounce * 1e9:.2f}"])
            print(again[-1], flush=True)
            if elements == 2:
                axes.plot(1e6 * times, 1e9 * gap, label=name)
    text += (
        "\n\n" + markdown_table(["elements", "voltage", "lands [us]", "bounce [nm]"], again) + "\n"
    )
    axes.set(xlabel="time [us]", ylabel="tip over the bump [nm]")
    axes.legend()
    figure.savefig(images / "soft_landing.png", dpi=130)
    (results / "soft_landing.md").write_text(text, encoding="utf-8")
    write_stamp("soft_landing", folder=results)


if __name__ == "__main__":
    main()
