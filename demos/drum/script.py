"""What does the drum sound like? script.py [FOLDER] (default results/drum_script).

sound.png: the head from above at four times, and what a probe hears beside a membrane.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from scipy.special import jn_zeros

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
TIMES = (1e-3, 4e-3, 10e-3, 12e-3)  # [s]
MODES = ((0, 1), (1, 1), (2, 1), (0, 2), (3, 1), (1, 2))  # nodal diameters and circles


def membrane(scene: impactfem.Scene) -> dict[tuple[int, int], float]:
    """Tones of a membrane with the tension of the head [Hz]."""
    head = scene.bodies[0]
    speed = np.sqrt(head.residual_stress / head.density)
    scale = speed / (2.0 * np.pi * head.outline.radius)
    return {(m, n): float(jn_zeros(m, n)[-1]) * scale for m, n in MODES}


def main() -> None:
    """Solve, draw, and name the tones."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/drum_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    scene = impactfem.Scene.from_toml(SCENE)
    result = impactfem.solve(scene, estimate=False)
    history, fields = result.history, result.fields
    time, speed = history["time"].values, history["ear.vz"].values
    late = time > result.summary["contact"]["intervals"][-1][1]
    heard = speed[late] * np.hanning(late.sum())
    loud = np.abs(np.fft.rfft(heard, 8 * len(heard)))
    tone = np.fft.rfftfreq(8 * len(heard), time[1] - time[0])
    figure = Figure(figsize=(11.0, 6.0), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=(3, 2))
    head = fields.nodes("head")
    points = np.asarray(fields.points)[head] * 1e2
    mesh = Triangulation(points[:, 0], points[:, 1])
    for axes, when in zip(above.subplots(1, len(TIMES)), TIMES, strict=True):
        k = int(np.argmin(np.abs(np.asarray(fields.times) - when)))
        moved = fields.read(k)["displacement"][head, 2] * 1e3
        shades = axes.tripcolor(mesh, moved, cmap="RdBu_r", vmin=-1.5, vmax=1.5, shading="gouraud")
        axes.set(aspect="equal", title=f"{fields.times[k] * 1e3:.1f} ms", xlabel="x [cm]")
    above.colorbar(shades, ax=above.axes, label="deflection [mm]")
    axes = below.subplots()
    axes.plot(tone, loud / loud.max(), color="#0b559f", label="velocity at the probe")
    for (m, n), known in membrane(scene).items():
        near = np.abs(tone - known) < 15.0
        found = tone[near][np.argmax(loud[near])]
        print(f"({m}, {n}): membrane {known:.1f} Hz, head {found:.1f} Hz")
        axes.axvline(known, color="#d95f02", linewidth=0.8)
        axes.annotate(f"({m}, {n})", (known, 1.0), ha="center", va="bottom")
    axes.set(xlabel="frequency [Hz]", ylabel="by the loudest", xlim=(100, 700), ylim=(0, 1.15))
    figure.savefig(folder / "sound.png", dpi=110)
    print(folder / "sound.png")


if __name__ == "__main__":
    main()
