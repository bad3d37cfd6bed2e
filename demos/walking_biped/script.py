"""A biped walks: script.py [FOLDER] (default results/walking_biped_script).

biped.png: the legs at every fourth of a step, heights of the feet, and what the motors give.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
SIDES, LONG, BALL, STEP = ("right", "left"), 0.4, 0.01, 0.36


def main() -> None:
    """Solve, draw, and say how far feet slid."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = Path("results/walking_biped_script")
    parser.add_argument("folder", nargs="?", type=Path, default=default)
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    scene = impactfem.Scene.from_toml(SCENE).with_settings({"output.fields": []})
    history = impactfem.solve(scene).history
    time = history["time"].values

    def joint(name: str, of: str = "q") -> np.ndarray:
        return np.asarray(history[f"biped.{name}.{of}"].values)

    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    way, feet, acts = figure.subplots(3, 1)
    every = round(STEP / 4.0 / (time[1] - time[0]))
    for side, color in zip(SIDES, ("C0", "C1"), strict=True):
        hip, knee = joint("pitch") + joint(f"{side}_hip"), joint(f"{side}_knee")
        x = [joint("x")]
        z = [joint("z")]
        for angle in (hip, hip + knee):
            x.append(x[-1] - LONG * np.sin(angle))
            z.append(z[-1] - LONG * np.cos(angle))
        slid = np.gradient(x[-1], time) - BALL * np.gradient(hip + knee, time)
        down = z[-1] < BALL + 1e-4
        ends = np.flatnonzero(np.diff(down.astype(int)))
        stances = [part for part in np.split(np.arange(len(time)), ends + 1) if down[part[0]]]
        # Landing included: a foot slides until its speed is braked.
        most = max(np.trapezoid(np.abs(slid[part]), time[part]) for part in stances)
        print(f"{side}: {len(stances)} stances, slip at most {1e3 * most:.3f} mm")
        for k in range(0, len(time), every):
            way.plot([e[k] for e in x], [e[k] for e in z], color=color, linewidth=0.7)
        feet.plot(time, z[-1] - BALL, color=color, label=side)
        for part in ("hip", "knee"):
            acts.step(time, history[f"walk_{side}_{part}.u"].values, where="pre",
                      label=f"{side} {part}", linewidth=0.8)  # fmt: skip
    way.plot(history["biped.x"].values, history["biped.z"].values, "k", label="centre of mass")
    way.set(xlabel="x [m]", ylabel="height [m]", aspect="equal")
    feet.set(ylabel="height of feet [m]", xlim=(0.0, 6.0 * STEP))
    acts.set(xlabel="time [s]", ylabel="motors [N m]", xlim=(0.0, 6.0 * STEP))
    for axes in (feet, acts):
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False)
    figure.savefig(folder / "biped.png", dpi=110)
    print(f"way {history['biped.x'].values[-1] - history['biped.x'].values[0]:.4f} m")
    print(folder / "biped.png")


if __name__ == "__main__":
    main()
