"""Strike a clamped bar with hammers of several masses: script.py [FOLDER].

Default folder: results/hammer_bar_script. hammers.png: force over time against the closed form of
Saint-Venant (B. de Saint-Venant and Flamant, Comptes rendus 97, 1883), for three masses.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
RATIOS = (0.5, 1.0, 2.0)  # mass of the bar over that of the hammer


def closed_form(ratio: float, time: np.ndarray) -> np.ndarray:
    """Force over its first value until the second wave is back, at times in L / c up to 4."""
    after = time - 2.0
    first = np.exp(-ratio * time)
    second = first + 2.0 * np.exp(-ratio * after) * (1.0 - ratio * after)
    force = np.where(after < 0.0, first, second)
    left = np.argmax(force < 0.0) if (force < 0.0).any() else len(force)
    return np.where(np.arange(len(force)) < left, force, 0.0)


def main() -> None:
    """Solve, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/hammer_bar_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    scene = impactfem.Scene.from_toml(SCENE)
    bar, hammer = scene.bodies
    impedance = bar.density * bar.area * bar.wave_speed
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    axes = figure.subplots()
    for ratio, colour in zip(RATIOS, ("#0b559f", "#d95f02", "#1b7837"), strict=True):
        given = {"body.hammer.mass": bar.mass / ratio, "output.fields": []}
        history = impactfem.solve(scene.with_settings(given)).history
        time = history["time"].values / bar.transit_time
        middle = 0.5 * (time[1:] + time[:-1])
        force = history["force.hit"].values[1:] / (impedance * hammer.velocity[0])
        known = closed_form(ratio, middle)
        axes.plot(middle, force, color=colour, label=f"{ratio:g}")
        axes.plot(middle[::20], known[::20], ".", color=colour)
        pressed = (force > 0.0) & (known > 0.0)
        end = time[1:][force > 0.0].max()
        until = f"ends at {end:.3f}" if end < time[-1] else f"lasts beyond {end:.3f}"
        print(f"mass of the bar {ratio:g} times that of the hammer: contact {until} L/c, force "
              "right to "
              f"{np.abs(force - known)[pressed].max():.1e}")  # fmt: skip
    axes.set(xlabel="time [L / c]", ylabel="force over Z v", xlim=(0.0, 4.0))
    axes.legend(frameon=False, title="mass of the bar\nover the hammer's")
    figure.savefig(folder / "hammers.png", dpi=100)
    print(folder / "hammers.png")


if __name__ == "__main__":
    main()
