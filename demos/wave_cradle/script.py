"""Speeds of five bars struck by one, if one bar of the row has another impedance.

python demos/wave_cradle/script.py [FOLDER]     # results/wave_cradle_script/odd_one.png
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import impactfem
from impactfem.shipped import find_scene

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results/wave_cradle_script")
folder.mkdir(parents=True, exist_ok=True)
scene = impactfem.Scene.from_toml(find_scene("wave_cradle"))
names = [bar.name for bar in scene.bars]
area = scene.bars[0].area

figure = Figure(figsize=(8.0, 3.8), layout="constrained")
FigureCanvasAgg(figure)
axes = figure.add_subplot()
rows = {"equal": {}, "third twice as thick": {"body.third.area": 2.0 * area},
        "last half as thick": {"body.fifth.area": 0.5 * area}}  # fmt: skip
for shift, (label, settings) in zip((-0.25, 0.0, 0.25), rows.items(), strict=True):
    result = impactfem.solve(scene.with_settings({"duration": 0.02, **settings}))
    speeds = [round(float(result.history[f"{name}.vx"][-1]), 9) + 0.0 for name in names]
    axes.bar(np.arange(len(names)) + shift, speeds, width=0.23, label=label)
    text = ", ".join(f"{speed:.3f}" for speed in speeds)
    error = result.summary["error"]["displacement_max"]
    print(f"{label:21} speeds {text} m/s ({result.summary['method']}, error {error:.1e})")
axes.axhline(0.0, color="black", linewidth=0.8)
axes.set_xticks(range(len(names)), names)
axes.set_ylabel("speed after 20 ms [m/s]")
axes.legend(frameon=False)
figure.savefig(folder / "odd_one.png", dpi=120)
print(folder / "odd_one.png")
