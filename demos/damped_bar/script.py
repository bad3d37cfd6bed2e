"""What comes back from a damper? script.py [FOLDER] (default results/damped_bar_script).

damping.png: energy that is not that of the flight, for several dampers at the end of the bar.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
SHARES = (0.0, 0.3, 1.0, 3.0)  # of the impedance


def main() -> None:
    """Solve for each damper, draw, and say what is left."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/damped_bar_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    scene = impactfem.Scene.from_toml(SCENE)
    bar, gain = scene.bar, scene.controllers[0].kp
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for share in SHARES:
        given = {"controller.damper.kp": share * gain}
        if not share:  # a free end
            given = {"controller": None, "body.bar.far_end_force": 0.0}
        history = impactfem.solve(scene.with_settings(given)).history
        flight = 0.5 * bar.mass * history["bar.vx"].values ** 2
        left = history["kinetic_energy"].values + history["elastic_energy"].values - flight
        transits = history["time"].values / bar.transit_time
        axes.semilogy(transits, np.maximum(left / left[0], 1e-18), label=f"{share:g} rho A c")
        print(f"{share:g} of the impedance: {max(left[-1] / left[0], 0.0):.2g} of the vibration "
              f"left, flight {history['bar.vx'].values[-1]:.6f} m/s")  # fmt: skip
    axes.set(xlabel="transits of a wave", ylabel="energy of the vibration", ylim=(1e-18, 3.0))
    axes.legend(title="damper at the end")
    figure.savefig(folder / "damping.png", dpi=110)
    print(folder / "damping.png")


if __name__ == "__main__":
    main()
