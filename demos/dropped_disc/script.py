"""Drop the disc with and without damping: script.py [FOLDER] (default results/dropped_disc_script).

bounces.png: the gap below the disc and the energy over time.
"""

import argparse
from itertools import pairwise
from pathlib import Path

from matplotlib.figure import Figure

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
COLOURS = {"damped": "#0b559f", "undamped": "#d95f02"}


def drop(damping: float) -> impactfem.Result:
    """Solve the scene with another damping of strains [s], without fields."""
    scene = impactfem.Scene.from_toml(SCENE)
    settings = {"body.disc.rayleigh_stiffness": damping, "output.fields": []}
    return impactfem.solve(scene.with_settings(settings), estimate=False)


def heights(result: impactfem.Result) -> list[float]:
    """Largest gap between one contact and the next [m]."""
    history, contacts = result.history, result.summary["contact"]["intervals"]
    flights = pairwise(contacts)
    return [float(history["gap"].sel(time=slice(a[1], b[0])).max()) for a, b in flights]


def main() -> None:
    """Solve, say how high the disc bounces, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/dropped_disc_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    gap, energy = figure.subplots(2, 1, sharex=True)
    for name, damping in (("damped", 1e-4), ("undamped", 0.0)):
        result = drop(damping)
        history = result.history
        gap.plot(history["time"], 1e3 * history["gap"], color=COLOURS[name], label=name)
        energy.plot(history["time"], history["total_energy"], color=COLOURS[name])
        drift = result.summary["energy"]["max_relative_drift"]
        print(f"{name}: heights {', '.join(f'{1e3 * h:.2f}' for h in heights(result))} mm, "
              f"largest force {float(history['contact_force'].max()):.0f} N, "
              f"change of energy {drift:.1e}")  # fmt: skip
    gap.set_ylabel("gap below the disc [mm]")
    gap.legend(frameon=False)
    gap.set_title("Rubber disc dropped from 10 mm")
    energy.set(ylabel="total energy [J]", xlabel="time [s]", ylim=(0.0, None), xlim=(0.0, 0.2))
    figure.savefig(folder / "bounces.png", dpi=100)
    print(folder / "bounces.png")


if __name__ == "__main__":
    main()
