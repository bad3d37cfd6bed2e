"""Speed of the schemes with time steps on the founding paper's oscillator.

Run: python benchmarks/vibro_speed.py. Writes benchmarks/results/vibro_speed.md.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from stamp import write_stamp

from impactfem.scene.signal import Signal
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.ensemble import integrate_ensemble
from impactfem.vibro.position_level import PositionSettings, integrate_positions
from impactfem.vibro.velocity_level import VelocitySettings, integrate_velocities

STEP, STEPS = 0.005, 1_000_000
START = ([0.8], [0.1])
RESULTS = Path(__file__).resolve().parent / "results"

LINEAR = LinearSystem(
    mass=1.0, damping=1.0, stiffness=1.0, load=[Signal(harmonics=((50.0, 5.0, 0.0),))],
    normals=[[1.0]], offsets=[-0.8], restitution=0.5,
)  # fmt: skip
CALLBACK = GeneralizedSystem(
    mass=1.0,
    force=lambda t, u, v: 5.0 * np.cos(50.0 * t) - v - u,
    constraints=lambda u: u - 0.8,
    restitution=0.5,
)


def best(run: Callable[[], Any], repeats: int = 3) -> float:
    """Least time of some runs [s], after one that compiles."""
    run()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return min(times)


def main() -> None:
    """Measure and write the table."""
    whole, part = STEP * STEPS, STEP * 5000
    position, velocity = PositionSettings(STEP), VelocitySettings(STEP)
    rng = np.random.default_rng(0)
    members = (0.8 + 0.2 * rng.random((10_000, 1)), rng.normal(size=(10_000, 1)))
    cases = [
        ("position level, 1e6 steps, all kept", STEPS,
         lambda: integrate_positions(LINEAR, *START, whole, position)),
        ("position level, 1e6 steps, every 1000th kept", STEPS,
         lambda: integrate_positions(LINEAR, *START, whole, PositionSettings(STEP, every=1000))),
        ("velocity level, 1e6 steps, all kept", STEPS,
         lambda: integrate_velocities(LINEAR, *START, whole, velocity)),
        ("position level, force in Python, 5e3 steps", 5000,
         lambda: integrate_positions(CALLBACK, *START, part, position)),
        ("velocity level, force in Python, 5e3 steps", 5000,
         lambda: integrate_velocities(CALLBACK, *START, part, velocity)),
        ("position level, 1e4 members, 1e3 steps", 10_000_000,
         lambda: integrate_ensemble(LINEAR, *members, 5.0, position)),
        ("velocity level, 1e4 members, 1e3 steps", 10_000_000,
         lambda: integrate_ensemble(LINEAR, *members, 5.0, velocity)),
    ]  # fmt: skip
    lines = ["| run | time [s] | per step [us] |", "| --- | --- | --- |"]
    for name, steps, run in cases:
        seconds = best(run)
        lines.append(f"| {name} | {seconds:.3f} | {1e6 * seconds / steps:.3g} |")
    (RESULTS / "vibro_speed.md").write_text("\n".join(lines) + "\n")
    write_stamp("vibro_speed")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
