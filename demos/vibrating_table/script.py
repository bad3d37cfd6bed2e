"""Impact speeds of a ball on a vibrating table against the strength of the vibration.

python demos/vibrating_table/script.py [FOLDER]     # results/vibrating_table_script/bifurcation.png
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import impactfem

GRAVITY, OMEGA, RESTITUTION = 9.81, 100.0, 0.8
SETTLE, KEEP = 300, 60  # impacts

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results/vibrating_table_script")
folder.mkdir(parents=True, exist_ok=True)
period = 2.0 * np.pi / OMEGA
strengths, points, speeds = np.linspace(1.1, 6.0, 120), [], []
for gamma in strengths:
    amplitude = gamma * GRAVITY / (2.0 * OMEGA**2 * (1.0 + RESTITUTION))
    # One flight a period: the ball leaves with g T / 2 where the table moves up with the speed that
    # makes up for the loss, and slows down. Where no such place exists: at the fastest.
    wanted = 0.5 * GRAVITY * period * (1.0 - RESTITUTION) / (1.0 + RESTITUTION)
    phase = np.arccos(min(1.0, wanted / (amplitude * OMEGA)))
    cosine, sine = amplitude * np.sin(phase), amplitude * np.cos(phase)
    table = impactfem.bodies.Signal(harmonics=((OMEGA, cosine, sine),))
    system = impactfem.systems.LinearSystem(
        mass=1.0, load=[-GRAVITY], normals=[[1.0]], offsets=[0.0], restitution=RESTITUTION,
        motion=[table],
    )  # fmt: skip
    start, speed = [cosine], [0.5 * GRAVITY * period]
    motion = impactfem.integrate(system, start, speed, (SETTLE + KEEP) * period, rows=10)
    last = motion.impacts.before[motion.impacts.time > SETTLE * period]
    points.extend([gamma] * len(last))
    speeds.extend(-last)

figure = Figure(figsize=(8.0, 4.6), layout="constrained")
FigureCanvasAgg(figure)
axes = figure.add_subplot()
axes.plot(points, speeds, ".", color="black", markersize=1.5)
for value, name in ((1.25664, "one flight a period exists"), (3.85501, "and flips")):
    axes.axvline(value, color="C1", linewidth=0.8)
    axes.annotate(name, (value, axes.get_ylim()[1]), rotation=90, va="top", ha="right", fontsize=8)
axes.set(xlabel="gamma = 2 w^2 (1 + e) A / g", ylabel="impact speed [m/s]",
         title=f"Ball on a vibrating table, e = {RESTITUTION}")  # fmt: skip
figure.savefig(folder / "bifurcation.png", dpi=120)
print(f"{len(speeds)} impacts shown; {folder / 'bifurcation.png'}")
