"""The block on the ball and flat on a floor, by four schemes: script.py [FOLDER].

force.png in FOLDER (default results/schemes): contact force over time. Printed are energy and total
variation of the force: 2 times the largest force for one smooth pulse, more if it rings.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem
from impactfem import HalfSpace

SCENE = Path(__file__).with_name("scene.toml")
METHODS = {"newmark": "0.7", "moreau_jean": "#d95f02", "massless": "#1b7837", "explicit": "#0b559f"}


def main() -> None:
    """Solve by every scheme, print energy and total variation of the force, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/schemes"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    scene = impactfem.Scene.from_toml(SCENE)
    scene = scene.with_settings(
        {"output.fields": [], "duration": 4e-3, "body.block.mesh_size": 0.006}
    )
    flat = scene.with_settings({"body.block.refine": []})
    floor = HalfSpace(name="floor", point=(0.0, 0.0, 0.0), normal=(0.0, 1.0, 0.0))
    cases = {"on the ball": scene, "flat on a floor": replace(flat, obstacles=(floor,))}
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    for axes, (name, case) in zip(figure.subplots(1, 2), cases.items(), strict=True):
        highest = 0.0
        for method, colour in METHODS.items():
            result = impactfem.solve(case, method=method, estimate=False)
            force = result.history["contact_force"].values
            energy = result.history["total_energy"].values
            time = 1e3 * result.history["time"]
            axes.stairs(force[1:], time, baseline=None, color=colour, label=method)
            print(f"{name}, {method}: largest force {force.max():.4g} N, total variation "
                  f"{np.abs(np.diff(force)).sum() / force.max():.2f} of it, energy at the end "
                  f"{energy[-1] / energy[0] - 1:+.1e}, {result.summary['status']}")  # fmt: skip
            if method == "explicit":
                highest = force.max()
        axes.set(xlabel="time [ms]", title=name, ylim=(0.0, 1.6 * highest))
        axes.set_xlim(0.0, 1.2e3 * result.summary["contact"]["intervals"][-1][1])
    figure.axes[0].set_ylabel("contact force [N]")
    figure.axes[0].legend(frameon=False)
    figure.savefig(folder / "force.png", dpi=100)
    print(folder / "force.png")


if __name__ == "__main__":
    main()
