"""Compare ball and quarter of a ball with Hertz: script.py [FOLDER] (default results/hertz).

force.png: contact force of the axisymmetric and the 3D ball, and of Hertz's theory.
"""

import argparse
import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

import impactfem

HERE = Path(__file__).parent
RADIUS, DENSITY, MODULUS, POISSON, SPEED = 0.02, 1200.0, 1e7, 0.4, 0.5
MASS = 4 / 3 * math.pi * RADIUS**3 * DENSITY
STIFFNESS = 4 / 3 * MODULUS / (1 - POISSON**2) * math.sqrt(RADIUS)  # force = stiffness depth^1.5


def hertz() -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and force [N] of a rigid mass on the static contact law of a half-space."""

    def rate(_: float, state: np.ndarray) -> list[float]:
        return [state[1], -STIFFNESS * max(state[0], 0.0) ** 1.5 / MASS]

    times = np.linspace(0.0, 4e-3, 801)
    depth = solve_ivp(rate, (0.0, times[-1]), [0.0, SPEED], t_eval=times, rtol=1e-10, atol=1e-14).y[
        0
    ]
    return times, STIFFNESS * np.maximum(depth, 0.0) ** 1.5


def solved(name: str) -> impactfem.Result:
    """Solve one of the scenes without fields."""
    scene = impactfem.Scene.from_toml(HERE / name).with_settings({"output.fields": []})
    return impactfem.solve(scene, estimate=False)


def main() -> None:
    """Solve both scenes, print what Hertz has to say of them, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/hertz"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.add_subplot()
    times, force = hertz()
    length = times[force > 0.0][-1]
    axes.plot(1e3 * times, force, "k--", linewidth=1.0, label="Hertz, a/R = 0.16")
    print(f"Hertz: {force.max():.2f} N, {1e3 * length:.3f} ms")
    cases = (
        ("scene.toml", "axisymmetric", "#0b559f"),
        ("scene_3d.toml", "a quarter in 3D", "#d95f02"),
    )
    for name, label, colour in cases:
        result = solved(name)
        history, (contact,) = result.history, result.summary["contact"]["intervals"]
        pushed = history["contact_force"]
        axes.stairs(pushed[1:], 1e3 * (history["time"] - contact[0]), baseline=None, color=colour,
                    label=f"{label}, {result.summary['method']}")  # fmt: skip
        rebound = float(history["ball.vy"][-1]) / SPEED
        print(f"{label}: {float(pushed.max()):.2f} N, {1e3 * (contact[1] - contact[0]):.3f} ms, "
              f"leaves with {rebound:.4f} of its speed")  # fmt: skip
    axes.set(xlabel="time since first contact [ms]", ylabel="contact force [N]", xlim=(-0.3, 3.8))
    axes.legend(frameon=False)
    figure.savefig(folder / "force.png", dpi=100)
    print(folder / "force.png")


if __name__ == "__main__":
    main()
