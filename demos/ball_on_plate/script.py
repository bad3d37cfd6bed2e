"""Throw the ball on plates of several thicknesses: script.py [FOLDER].

Default folder: results/ball_on_plate_script. plates.png: force over time, and how fast the ball
leaves, against the thickness of the plate.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
THICKNESSES = (0.005, 0.01, 0.02, 0.04)  # [m]
SPEED = 0.5  # [m/s]


def throw(thickness: float) -> impactfem.Result:
    """Solve the scene with another plate [m], without fields."""
    scene = impactfem.Scene.from_toml(SCENE)
    return impactfem.solve(
        scene.with_settings(
            {
                "body.plate.shape.size": [0.04, thickness],
                "body.plate.shape.corner": [0.0, -thickness],
                "duration": 14e-3,
                "output.fields": [],
            }
        )
    )


def main() -> None:
    """Solve, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "folder", nargs="?", type=Path, default=Path("results/ball_on_plate_script")
    )
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.5, 1.0])
    rebounds = []
    for shade, thickness in zip(np.linspace(0.75, 0.0, 4), THICKNESSES, strict=True):
        result = throw(thickness)
        history, contact = result.history, result.summary["contact"]
        rebounds.append(float(history["ball.vy"][-1]) / SPEED)
        left.plot(1e3 * history["time"], history["contact_force"], color=(shade, shade, 1.0),
                  label=f"{1e3 * thickness:.0f} mm")  # fmt: skip
        begin, end = contact["intervals"][0][0], contact["intervals"][-1][1]
        print(f"plate of {1e3 * thickness:2.0f} mm: largest force {contact['max_force']:5.2f} N, "
              f"contact {1e3 * begin:.2f} to {1e3 * end:.2f} ms in {len(contact['intervals'])}, "
              f"rebound {rebounds[-1]:.3f}, "
              f"change of energy {result.summary['energy']['max_relative_drift']:.0e}")  # fmt: skip
    left.set(xlabel="time [ms]", ylabel="contact force [N]", xlim=(0.0, 14.0))
    left.legend(frameon=False, title="plate")
    right.plot(1e3 * np.array(THICKNESSES), rebounds, "o-", color="#d95f02")
    right.set(xlabel="thickness of the plate [mm]", ylabel="speed after over before")
    right.set_ylim(0.0, 1.05)
    figure.savefig(folder / "plates.png", dpi=100)
    print(folder / "plates.png")


if __name__ == "__main__":
    main()
