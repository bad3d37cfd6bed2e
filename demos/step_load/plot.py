"""Draw benchmark K3, a load that ends at the impact: plot.py [FOLDER].

Default folder: results/step_load_script.

motion.png: both ends and the contact force with the load switched off (K3) and kept on (K2).
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem
from impactfem.exact.fourier import StepLoadImpact

BLUE, ORANGE = "#0b559f", "#d95f02"
SCENE = impactfem.Scene.from_toml(Path(__file__).with_name("scene.toml"))


def main() -> None:
    """Solve with the load switched off and kept on, compare, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/step_load_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    kept_on = SCENE.with_settings({"gravity": SCENE.gravity.values[0]})
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    ends, force = figure.subplots(1, 2)
    for scene, colour, label in (
        (kept_on, ORANGE, "load kept on"),
        (SCENE, BLUE, "load off at the impact"),
    ):
        exact = impactfem.solve(scene, method="exact", elements=400)
        run = impactfem.solve(scene, method="galerkin", elements=40)
        place = exact.fields.positions[[0, -1]] + exact.fields.displacement[:, [0, -1]]
        ends.plot(exact.fields.times, place, color=colour, label=[label, None])
        force.stairs(run.history["contact_force"][1:], run.history["time"], baseline=None,
                     color=colour, label=label)  # fmt: skip
        force.plot(exact.exact["time"], exact.exact["contact_force"], "k--", linewidth=0.7)
        after = exact.history.isel(time=exact.history["time"] > 2.95)
        elastic = float(after["elastic_energy"].max())
        error = run.summary["error"]["displacement_max"]
        print(f"{label}: elastic energy after release up to {elastic:.1e} J, "
              f"error of galerkin at n = 40: {error:.1e}")  # fmt: skip
    bar = SCENE.bodies[0]
    formula = StepLoadImpact(
        bar.length, bar.wave_speed, bar.gap, -float(bar.initial_velocity(x=0.0)),
        SCENE.gravity.values[0],
    )  # fmt: skip
    t, x = exact.fields.times, exact.fields.positions  # of the scene itself
    difference = exact.fields.displacement - formula.displacement(t[:, None], x)
    print(f"formula against characteristics: {np.abs(difference).max():.1e} m")
    print(f"impact and rebound speed {formula.impact_speed:.6f} m/s")
    ends.axhspan(-0.08, 0.0, color="0.5", alpha=0.5, hatch="//", linewidth=0)
    ends.set(xlim=(0.0, SCENE.duration), xlabel="time [s]", ylabel="distance from the wall [m]",
             title="Both ends of the bar")  # fmt: skip
    ends.set_ylim(bottom=-0.08)
    ends.legend(frameon=False, loc="upper center")
    force.set(xlabel="time [s]", ylabel="contact force [N]",
              title="Contact force, n = 40 (dashed: exact)")  # fmt: skip
    force.legend(frameon=False, loc="upper left")
    force.set_ylim(-0.03, 1.0)
    figure.savefig(folder / "motion.png", dpi=120)
    print(folder / "motion.png")


if __name__ == "__main__":
    main()
