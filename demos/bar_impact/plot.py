"""Draw the contact force of some results against the exact one: plot.py [FOLDER ...] [--out FILE].

Without folders the scene is solved on 10, 20 and 40 elements with the gap 0.5 + 1/60 m, so that the
impact (t = 1 + 1/30 s) lies a third of a time step beside a time level and the force has an error
to see.
"""

import argparse
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

import impactfem


def solve_some(folder: Path) -> list[Path]:
    """Solve the scene on three grids; returns the result folders."""
    scene = impactfem.Scene.from_toml(Path(__file__).with_name("scene.toml"))
    scene = scene.with_settings({"body.bar.gap": 0.5 + 1 / 60})
    return [
        impactfem.solve(scene, elements=n).save(folder / f"bar_impact_{n}", pictures=False)
        for n in (10, 20, 40)
    ]


def draw(folders: list[Path]) -> Figure:
    """Force of each result and the exact one, around the first impact and the last release."""
    results = [impactfem.Result.load(folder) for folder in folders]
    contacts = results[-1].summary["contact"]["intervals"]
    width = 2.5 * max(float(result.history["time"][1]) for result in results)
    events = {"impact": contacts[0][0], "release": contacts[-1][1]} if contacts else {"": 0.0}
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    panels = figure.subplots(1, len(events), sharey=True, squeeze=False)[0]
    for axes, (event, time) in zip(panels, events.items(), strict=True):
        for result in results:
            _staircase(axes, result)
        exact = results[-1].exact
        if exact is not None:
            axes.plot(exact["time"], exact["contact_force"], "k--", linewidth=1, label="exact")
        if event:
            axes.set_xlim(time - width, time + width)
        axes.set_xlabel("time [s]")
        axes.set_title(f"{results[0].scene.title}: {event}", fontsize="medium")
    panels[0].set_ylabel("contact force [N]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2,
                  frameon=False, fontsize="small")  # fmt: skip
    return figure


def _staircase(axes: Axes, result: impactfem.Result) -> None:
    """One result; the force of row m holds during (t_{m-1}, t_m]."""
    label = f"{result.scene.solve.elements} elements"
    error = result.summary["error"]
    if error is not None:
        label += f", displacement error {error['displacement_max']:.1e}"
    history = result.history
    axes.stairs(history["contact_force"][1:], history["time"], baseline=None, linewidth=1.8,
                alpha=0.8, label=label)  # fmt: skip


def main() -> None:
    """Read the arguments, draw, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", metavar="FOLDER", nargs="*", type=Path)
    parser.add_argument("--out", type=Path, default=Path("results/bar_impact_force.png"))
    given = parser.parse_args()
    figure = draw(given.folders or solve_some(Path("results")))
    given.out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(given.out, dpi=130)
    print(given.out)


if __name__ == "__main__":
    main()
