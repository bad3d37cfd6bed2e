"""With feedback, and the voltage kept on: script.py [FOLDER] (default results/soft_plate_script).

landing.png: gap under the middle, and when the voltage is on.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
GAP = 0.9e-6  # [m]


def main() -> None:
    """Solve both, draw, and say how they land."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/soft_plate_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    scene = impactfem.Scene.from_toml(SCENE)
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    for name, given in (("kept on", {"controller.drive.formula": "1"}), ("feedback", {})):
        history = impactfem.solve(scene.with_settings(given)).history
        time, gap = history["time"].values * 1e6, (history["middle.uz"].values + GAP) * 1e9
        above.plot(time, gap, label=name)
        below.step(time, history["drive.u"].values, where="post", label=name)
        touch = int(np.argmax(history["contact_force"].values > 0.0))
        back = gap[touch:].max() - gap[touch:].min()
        print(f"{name}: touches after {time[touch]:.2f} us at "
              f"{-history['middle.vz'].values[touch - 1]:.2f} m/s, its middle then moves by "
              f"{back:.0f} nm")  # fmt: skip
    above.set(ylabel="gap under the middle [nm]")
    below.set(xlabel="time [us]", ylabel="voltage", yticks=[0, 1], yticklabels=["off", "on"])
    above.legend()
    figure.savefig(folder / "landing.png", dpi=110)
    print(folder / "landing.png")


if __name__ == "__main__":
    main()
