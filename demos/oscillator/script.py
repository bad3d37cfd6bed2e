"""Draw the driven oscillator by detection and by the position-level scheme.

python demos/oscillator/script.py [FOLDER]     # results/oscillator_script/methods.png
"""

import sys
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import impactfem

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results/oscillator_script")
folder.mkdir(parents=True, exist_ok=True)
scene = impactfem.Scene.from_toml(Path(__file__).parent / "scene.toml")

runs = {
    "event_driven": impactfem.solve(scene, dt=5e-4),
    "paoli_schatzman, dt = 0.005": impactfem.solve(
        scene, method="paoli_schatzman", dt=5e-3, estimate=False
    ),
    "paoli_schatzman, dt = 0.0005": impactfem.solve(
        scene, method="paoli_schatzman", dt=5e-4, estimate=False
    ),
}

figure = Figure(figsize=(9.0, 4.2), layout="constrained")
FigureCanvasAgg(figure)
left, right = figure.subplots(1, 2)
for name, result in runs.items():
    history = result.history
    style = {"color": "black", "linewidth": 2.5} if name == "event_driven" else {"linewidth": 1.0}
    left.plot(history["time"], history["mass.x"], label=name, **style)
    right.plot(history["time"], 1e3 * history["gap"], **style)
    late = history["gap"].sel(time=slice(2.0, None))
    print(f"{name:30} residual bounces {1e6 * float(late.max()):.1f} micrometres")
left.set(xlabel="time [s]", ylabel="position [m]", xlim=(0, 2.5), title="motion")
right.set(xlabel="time [s]", ylabel="gap [mm]", xlim=(2.0, 2.5), ylim=(-0.05, 0.11),
          title="bounces after the transient")  # fmt: skip
left.legend(frameon=False)
figure.savefig(folder / "methods.png", dpi=120)
print(folder / "methods.png")
