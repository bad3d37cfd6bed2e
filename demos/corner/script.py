"""Where a lossless point leaves a corner, against the offset of its start.

python demos/corner/script.py [FOLDER]     # results/corner_script/angles.png
"""

import math
import sys
import warnings
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import impactfem

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results/corner_script")
folder.mkdir(parents=True, exist_ok=True)
warnings.simplefilter("ignore", impactfem.ImpactWarning)  # the middle offset hits both sides

figure = Figure(figsize=(9.0, 3.6), layout="constrained")
FigureCanvasAgg(figure)
corners = {"pi/2": math.pi / 2, "pi/3": math.pi / 3, "2 pi/5": 0.4 * math.pi}
offsets = np.linspace(-0.1, 0.1, 41)
for axes, (name, angle) in zip(figure.subplots(1, 3, sharey=True), corners.items(), strict=True):
    # The floor y = 0 and a side that rises at the angle; the ray comes along 0.6 of the angle.
    sides = [[0.0, 1.0], [math.sin(angle), -math.cos(angle)]]
    system = impactfem.systems.LinearSystem(
        mass=[1.0, 1.0], normals=sides, offsets=[0.0, 0.0], restitution=1.0
    )
    ray = np.array([math.cos(0.6 * angle), math.sin(0.6 * angle)])
    across = np.array([-ray[1], ray[0]])
    for method, settings in (("event_driven", {}), ("paoli_schatzman", {"dt": 2e-3})):
        leaving = []
        for offset in offsets:
            motion = impactfem.integrate(
                system, ray + offset * across, -ray, 2.5, method=method, **settings
            )
            last = motion.velocity[-2]
            leaving.append(math.degrees(math.atan2(last[1], last[0])))
        axes.plot(offsets, leaving, ".-", markersize=4, linewidth=0.8, label=method)
        if method == "event_driven":
            jump = np.abs(np.diff(leaving)).max()
            print(f"corner {name:7} largest jump of the outgoing direction {jump:.3g} degrees")
    axes.set(xlabel="offset of the start [m]", title=f"corner of {name}")
    axes.grid(visible=True, linewidth=0.3)
    if axes.get_subplotspec().is_first_col():
        axes.set_ylabel("outgoing direction [degrees]")
        axes.legend(frameon=False)
figure.savefig(folder / "angles.png", dpi=120)
print(folder / "angles.png")
