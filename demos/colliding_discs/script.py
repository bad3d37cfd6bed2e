"""Collide the discs at several offsets: script.py [FOLDER].

Default folder: results/colliding_discs_script.
offsets.png: direction in which the struck disc leaves, against the line of centres of rigid discs.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
OFFSETS = (0.0, 0.02, 0.04, 0.05, 0.06, 0.08)  # of the centres, across the way [m]
DIAMETER = 0.1


def collide(offset: float) -> impactfem.Result:
    """Solve the scene with another offset [m], without fields."""
    scene = impactfem.Scene.from_toml(SCENE)
    return impactfem.solve(
        scene.with_settings(
            {
                "duration": 0.08,
                "body.right.shape.center": [0.05, offset],
                "solve.normals": "updated",
                "output.fields": [],
            }
        )
    )


def main() -> None:
    """Solve, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "folder", nargs="?", type=Path, default=Path("results/colliding_discs_script")
    )
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    angles, speeds = [], []
    for offset in OFFSETS:
        history = collide(offset).history.isel(time=-1)
        vx, vy = float(history["right.vx"]), float(history["right.vy"])
        angles.append(np.degrees(np.arctan2(vy, vx)))
        speeds.append(np.hypot(vx, vy))
        rigid = np.arcsin(offset / DIAMETER)
        print(f"offset {1e3 * offset:3.0f} mm: the right disc leaves at {angles[-1]:5.2f} degrees "
              f"(rigid {np.degrees(rigid):5.2f}) with {speeds[-1]:.4f} m/s "
              f"(rigid {np.cos(rigid):.4f})")  # fmt: skip
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True)
    fine = np.linspace(0.0, 0.09, 100)
    rigid = np.arcsin(fine / DIAMETER)
    for axes, curve, found in ((left, np.degrees(rigid), angles), (right, np.cos(rigid), speeds)):
        axes.plot(1e3 * fine, curve, color="0.5", label="rigid discs, restitution 1")
        axes.plot(1e3 * np.array(OFFSETS), found, "o", color="#0b559f", label="elastic discs")
        axes.set_xlabel("offset of the centres [mm]")
    left.set_ylabel("direction of the struck disc [degrees]")
    right.set_ylabel("speed of the struck disc [m/s]")
    right.set_ylim(0.0, None)
    left.legend(frameon=False)
    figure.savefig(folder / "offsets.png", dpi=100)
    print(folder / "offsets.png")


if __name__ == "__main__":
    main()
