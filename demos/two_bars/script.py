"""What a strike leaves of the speeds, against the ratios of lengths and of impedances.

python demos/two_bars/script.py [FOLDER]     # results/two_bars_script/speeds.png
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from impactfem.exact import ExactBarRow, RowBar

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results/two_bars_script")
folder.mkdir(parents=True, exist_ok=True)


def speeds(length: float, impedance: float) -> tuple[float, float, float]:
    """Speeds of both bars after the strike over that before, and the share of vibrations.

    Args:
        length: Of the first bar, which strikes; the second one has 1.
        impedance: Of the second bar; the first one has 1.
    """
    first = RowBar.moving(length=length, wave_speed=1.0, impedance=1.0, place=0.0, velocity=1.0)
    second = RowBar.moving(
        length=1.0, wave_speed=1.0, impedance=impedance, place=length, velocity=0.0
    )
    row = ExactBarRow([first, second], 60.0)
    a, b = (float(row.mean_velocity(k, 60.0)) for k in (0, 1))
    rigid = 0.5 * (first.mass * a**2 + second.mass * b**2)
    return a, b, 1.0 - rigid / (0.5 * first.mass)


figure = Figure(figsize=(9.0, 3.8), layout="constrained")
FigureCanvasAgg(figure)
studies = {
    "length of the striking bar / other": (np.linspace(0.1, 2.0, 96), lambda r: speeds(r, 1.0)),
    "impedance of the struck bar / other": (np.geomspace(0.2, 5.0, 96), lambda r: speeds(1.0, r)),
}
for axes, (label, (ratios, found)) in zip(
    figure.subplots(1, 2, sharey=True), studies.items(), strict=True
):
    a, b, lost = np.array([found(float(ratio)) for ratio in ratios]).T
    axes.plot(ratios, a, label="striking bar")
    axes.plot(ratios, b, label="struck bar")
    axes.plot(ratios, b - a, "k--", linewidth=1.0, label="apparent restitution")
    axes.plot(ratios, lost, color="0.6", label="energy in vibrations")
    axes.set(xlabel=label)
    axes.grid(visible=True, linewidth=0.3)
    if axes.get_subplotspec().is_first_col():
        axes.set_ylabel("speed / speed of the strike")
    else:
        axes.set_xscale("log")
        axes.minorticks_off()
        axes.set_xticks([0.2, 0.5, 1.0, 2.0, 5.0], ["0.2", "0.5", "1", "2", "5"])
        axes.legend(frameon=False)
figure.savefig(folder / "speeds.png", dpi=120)
print("length 1/2: speeds {:.12g}, {:.12g}, vibrations {:.6g}".format(*speeds(0.5, 1.0)))
print("impedance 2: speeds {:.12g}, {:.12g}, vibrations {:.6g}".format(*speeds(1.0, 2.0)))
print("impedance 1/2: speeds {:.12g}, {:.12g}, vibrations {:.6g}".format(*speeds(1.0, 0.5)))
print(folder / "speeds.png")
