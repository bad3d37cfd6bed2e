"""A hopper runs and is pushed: script.py [FOLDER] (default results/running_hopper_script).

hopper.png: the ways of body and foot, the body's speed, and what leg and hip do.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem

SCENE = Path(__file__).with_name("scene.toml")


def main() -> None:
    """Solve, draw, and say height and speed at each apex."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = Path("results/running_hopper_script")
    parser.add_argument("folder", nargs="?", type=Path, default=default)
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    history = impactfem.solve(
        impactfem.Scene.from_toml(SCENE).with_settings({"output.fields": []})
    ).history
    names = ("time", "body.x", "body.y", "body.vx", "foot.x", "foot.y", "run.u", "run_hip.u")
    t, x, y, speed, foot, clearance, thrust, hip = (history[name].values for name in names)
    apexes = 1 + np.flatnonzero((y[1:-1] > y[:-2]) & (y[1:-1] >= y[2:]))
    for k in apexes:
        print(f"{t[k]:.3f} s: apex {y[k]:.4f} m, speed {speed[k]:.4f} m/s")

    figure = Figure(figsize=(7.0, 7.0), layout="constrained")
    way, fast, acts = figure.subplots(3, 1)
    for k in range(0, len(t), 16):
        way.plot([x[k], foot[k]], [y[k], clearance[k]], color="0.8", linewidth=1.0)
    way.plot(x, y, label="body")
    way.plot(foot, clearance, label="foot")
    way.axhline(1.3, color="0.5", linestyle=":", label="asked for")
    way.set(xlabel="x [m]", ylabel="height [m]", aspect="equal")
    way.legend(loc="lower right", ncols=3)
    fast.plot(t, speed)
    fast.plot(t[apexes], speed[apexes], "o", label="at apexes")
    fast.axhline(1.0, color="0.5", linestyle=":", label="asked for")
    fast.axvspan(1.84, 1.94, color="C1", alpha=0.3, label="push")
    fast.set(ylabel="speed [m/s]")
    fast.legend(loc="lower right", ncols=3)
    acts.step(t, thrust, where="pre", label="leg [N]")
    acts.step(t, hip, where="pre", label="hip [N m]")
    acts.set(xlabel="time [s]", ylabel="output")
    acts.legend(loc="lower right", ncols=2)
    figure.savefig(folder / "hopper.png", dpi=110)
    print(folder / "hopper.png")


if __name__ == "__main__":
    main()
