"""Pull kept on, paused and by feedback: script.py [FOLDER] (default results/soft_plate_script).

landing.png: gap under the middle, and the share of the pull.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem

HERE = Path(__file__).parent
GAP = 0.9e-6  # [m]
FOUND = [0.21, 1.0, 0.74]  # by "impactfem optimise pause.toml"


def main() -> None:
    """Solve all three, draw, and say how they land."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/soft_plate_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    pause, feedback = (impactfem.Scene.from_toml(HERE / f"{n}.toml") for n in ("pause", "scene"))
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    scenes = {
        "kept on": pause.with_settings({"control.pause.start": 0.0}),
        "paused": pause.with_settings({"control.pause.start": FOUND}),
        "feedback": feedback.with_settings({"duration": 0.8e-6}),
    }
    for name, scene in scenes.items():
        history = impactfem.solve(scene).history
        time, gap = history["time"].values, history["middle.uz"].values + GAP
        if scene.controls:
            pull = 1.0 - scene.controls[0].at(time, scene.duration)
        else:
            pull = history["drive.u"].values
        above.plot(1e6 * time, 1e9 * gap, label=name)
        below.step(1e6 * time, pull, where="post", label=name)
        force, speed = history["contact_force"].values, -history["middle.vz"].values
        touch = int(np.argmax(force > 0.0))
        off = float((force[touch:] == 0.0).mean() * (time[-1] - time[touch]))
        up = max(float(gap[touch:].max()), 0.0)
        print(
            f"{name}: touches after {1e6 * time[touch]:.2f} us at {speed[touch - 1]:.1f} m/s, "
            f"its middle then comes up by {1e9 * up:.0f} nm, off for {1e9 * off:.0f} ns"
        )
    above.set(ylabel="gap under the middle [nm]")
    below.set(xlabel="time [us]", ylabel="pull")
    above.legend()
    figure.savefig(folder / "landing.png", dpi=110)
    print(folder / "landing.png")


if __name__ == "__main__":
    main()
