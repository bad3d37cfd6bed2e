"""Draw regular and irregular bounces of a bar: plot.py [FOLDER].

Default folder: results/bouncing_script.

bounces.png: displacement of both ends, and the share of the energy that the centre of mass carries.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem
from impactfem.reference.bar import exact_bar
from impactfem.shipped import shipped_scenes

BLUE, ORANGE = "#0b559f", "#d95f02"


def centre_share(run: impactfem.Result) -> np.ndarray:
    """Kinetic and potential energy of the centre of mass over the total; the rest is vibration."""
    bar = run.scene.bodies[0]
    history = run.history
    rigid = 0.5 * history["momentum"] ** 2 / bar.mass + history["potential_energy"]
    return np.asarray(rigid / history["total_energy"])


def main() -> None:
    """Solve both scenes exactly and draw them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/bouncing_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(9.5, 6.0), layout="constrained")
    for (ends, share), name in zip(
        figure.subplots(2, 2), ("doyen_bounces", "irregular_bounces"), strict=True
    ):
        scene = impactfem.Scene.from_toml(shipped_scenes()[name])
        run = impactfem.solve(scene, method="exact", elements=80)
        fields = run.fields
        near, far = fields.displacement[:, 0], fields.displacement[:, -1]
        ends.plot(fields.times, far, color=ORANGE, linewidth=1.0, label="far end")
        ends.plot(fields.times, near, color=BLUE, linewidth=1.4, label="near end")
        ends.axhline(0.0, color="0.5", linewidth=0.8)
        ends.set(xlim=(0.0, scene.duration), xlabel="time [s]", ylabel="displacement u [m]",
                 title=scene.title)  # fmt: skip
        ends.legend(frameon=False, fontsize="small", loc="upper right", ncols=2)
        ends.set_ylim(top=1.25 * max(near.max(), far.max()))
        for start, end in run.summary["contact"]["intervals"]:
            share.axvspan(start, end, color="0.85", linewidth=0)
        share.plot(run.history["time"], centre_share(run), color=ORANGE)
        share.set(xlim=(0.0, scene.duration), ylim=(-0.15, 1.05), xlabel="time [s]",
                  ylabel="share of the energy",
                  title="Energy of the centre of mass (grey: contact)")  # fmt: skip
        contacts = exact_bar(scene).contacts  # those of the run are rounded to its time steps
        print(f"{scene.title}: {len(contacts)} contacts, the first at "
              f"{', '.join(f'{a:.4g} to {b:.4g}' for a, b in contacts[:4])} s; energy drift "
              f"{run.summary['energy']['max_relative_drift']:.0e}")  # fmt: skip
    figure.savefig(folder / "bounces.png", dpi=100)
    print(folder / "bounces.png")


if __name__ == "__main__":
    main()
