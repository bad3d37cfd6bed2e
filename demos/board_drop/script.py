"""What a package on a dropped board feels. script.py [FOLDER] (default results/board_drop_script).

shock.png: accelerations at a screw and in the middle, and their shock response spectra.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
GRAVITY = 9.81  # [m/s^2]
PLACES = {"corner": ("at a screw", "#555555"), "middle": ("beside the package", "#0b559f")}


def main() -> None:
    """Solve, draw, and say the largest values."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/board_drop_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    result = impactfem.solve(impactfem.Scene.from_toml(SCENE), estimate=False)
    time = 1e3 * result.history["time"].values
    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    above, below = figure.subplots(2, 1)
    for name, (words, color) in PLACES.items():
        felt = result.history[f"{name}.az"].values / GRAVITY
        above.plot(time, felt, color=color, lw=1.2, label=words)
        found = result.spectrum(f"{name}.az", q=10.0)
        shock = np.asarray(found.shock) / GRAVITY
        below.loglog(found.shock_frequencies, shock, color=color, label=words)
        at = int(np.argmax(shock))
        print(f"{words}: {np.abs(felt).max():.0f} g, shock response {shock[at]:.0f} g at "
              f"{found.shock_frequencies[at]:.0f} Hz")  # fmt: skip
    above.set(xlabel="time [ms]", ylabel="acceleration [g]")
    below.set(xlabel="frequency [Hz]", ylabel="shock response, Q = 10 [g]")
    above.legend()
    figure.savefig(folder / "shock.png", dpi=110)


if __name__ == "__main__":
    main()
