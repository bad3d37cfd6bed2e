"""Draw solutions of the point mass at a wall: plot.py [FOLDER].

Default folder: results/point_mass_script.

family.png: trajectories and kinetic energy for some rebound times and speeds.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from impactfem.exact.point_mass import PointMassImpact

HEIGHT, SPEED, DURATION = 0.5, 0.5, 4.0
BLUE, GREYS = "#0b559f", ("#d95f02", "#1b7837", "#984ea3", "0.45")


def main() -> None:
    """Draw the family; print its energies."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/point_mass_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    tau = HEIGHT / SPEED
    family = [
        PointMassImpact(HEIGHT, SPEED),
        PointMassImpact(HEIGHT, SPEED, tau, 0.5 * SPEED),
        PointMassImpact(HEIGHT, SPEED, tau + 1.0, SPEED),
        PointMassImpact(HEIGHT, SPEED, tau + 0.5, 1.4 * SPEED),
        PointMassImpact(HEIGHT, SPEED, float("inf")),
    ]
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    path, energy = figure.subplots(1, 2)
    jumps = {time for one in family for time, _ in one.impulses}
    t = np.unique(np.r_[np.linspace(0.0, DURATION, 401), *jumps, *(s - 1e-9 for s in jumps)])
    for one, colour in zip(family, (BLUE, *GREYS), strict=True):
        stays = np.isinf(one.leaving_time)
        label = f"$r = {one.leaving_time:g}$ s, $e = {one.restitution:g}$"
        label = "stays" if stays else label
        wide = 3.0 if one.conserves_energy else 1.3
        path.plot(t, one.displacement(t), color=colour, linewidth=wide, label=label)
        energy.plot(t, one.kinetic_energy(t), color=colour, linewidth=wide)
        print(f"{label:32} impulse {sum(i for _, i in one.impulses):.3f} m/s, energy kept "
              f"{one.kinetic_energy(DURATION) / one.kinetic_energy(0.0):.2f}"
              f"{', at all times' if one.conserves_energy else ''}")  # fmt: skip
    path.axhspan(-0.08, 0.0, color="0.5", alpha=0.5, hatch="//", linewidth=0)
    path.set(xlim=(0.0, DURATION), xlabel="time [s]", ylabel="u [m]",
             title="All of these solve the contact conditions")  # fmt: skip
    path.set_ylim(bottom=-0.08)
    path.legend(frameon=False, loc="upper left", fontsize="small")
    energy.set(xlim=(0.0, DURATION), xlabel="time [s]", ylabel="kinetic energy per mass [m²/s²]",
               title="One keeps its energy at all times")  # fmt: skip
    figure.savefig(folder / "family.png", dpi=120)
    print(folder / "family.png")


if __name__ == "__main__":
    main()
