"""Drop an elastic beam at 30 degrees and look at its micro-impacts.

python demos/dropped_beam/script.py [FOLDER] [--degrees 30]  # results/dropped_beam_script/axis.png
"""

import argparse
import math
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from impactfem.scene.beams import Beam
from impactfem.scene.obstacles import HalfSpace
from impactfem.system.beam import free_beam
from impactfem.system.episode import contact_episode
from impactfem.vibro.position_level import PositionSettings, integrate_positions

arguments = argparse.ArgumentParser(description="Drop an elastic beam at an angle.")
arguments.add_argument("folder", nargs="?", type=Path, default=Path("results/dropped_beam_script"))
arguments.add_argument("--degrees", type=float, default=30.0)
given = arguments.parse_args()
folder, degrees = given.folder, given.degrees
folder.mkdir(parents=True, exist_ok=True)

# A steel bar of 200 mm, 12.7 mm square, just above the floor, at 1 m/s.
angle, length = math.radians(degrees), 0.2
beam = Beam(
    length=length,
    height=0.0127,
    width=0.0127,
    density=7800.0,
    youngs_modulus=2.1e11,
    elements=16,
    center=[0.0, 0.5 * length * math.sin(angle) + 6e-6],
    inclination=angle,
    velocity=[0.0, -1.0],
)
floor = HalfSpace(point=[0.0, 0.0], normal=[0.0, 1.0])

# Local restitution 0: whatever comes back comes back by elasticity.
body = free_beam(beam)
system = body.system(floor, restitution=0.0)
duration = 1.5 * 2.0 * math.pi / beam.first_frequency
motion = integrate_positions(
    system, *body.start, duration, PositionSettings(dt=duration / 32_000, implicit=True)
)
episode = contact_episode(body, system, motion)
print(f"apparent restitution {episode.restitution:.3f}, {episode.micro_impacts} micro-impacts")
print(f"energy left in vibrations {episode.vibration:.1%}, lost {episode.lost:.1%}")
print(f"change of angle, neglected by the model: {math.degrees(episode.angle):.2f} degrees")

figure = Figure(figsize=(7.0, 4.6), layout="constrained")
FigureCanvasAgg(figure)
axes = figure.add_subplot()
for level in np.linspace(0, len(motion.times) - 1, 7).astype(int):
    places = body.points(60.0 * motion.position[level])
    axes.plot(places[:, 0], places[:, 1], label=f"{1e3 * motion.times[level]:.2f} ms")
axes.axhline(0.0, color="black", lw=1.0)
axes.set(
    xlabel="x [m]", ylabel="y [m]", title="Motion of the axis, displacements 60 times as large"
)
axes.set_aspect("equal")
axes.legend(frameon=False, fontsize=8)
figure.savefig(folder / "axis.png", dpi=130)
print(folder / "axis.png")
