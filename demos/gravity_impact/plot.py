"""Draw benchmark K2, a bar falling onto a wall: plot.py [FOLDER].

Default folder: results/gravity_impact_script.

motion.png: world lines by the generalised d'Alembert formula, with its five regions.
check.png: contact force of the formula, of a finite-element run and as the slides' printed sign of
eta_x would have it; error of the Fourier series against the number of terms.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import impactfem
from impactfem.exact.fourier import (
    GravityImpact,
    clamped_series,
    clamped_vibration,
    free_series,
    free_vibration,
)

BLUE, ORANGE, GREEN = "#0b559f", "#d95f02", "#1b7837"
SCENE = impactfem.Scene.from_toml(Path(__file__).with_name("scene.toml"))


def closed_form() -> GravityImpact:
    """The formula for the scene's numbers."""
    bar = SCENE.bodies[0]
    return GravityImpact(
        length=bar.length,
        wave_speed=bar.wave_speed,
        height=bar.gap,
        speed=-float(bar.initial_velocity(x=0.0)),
        gravity=SCENE.gravity.values[0],
    )


def draw_motion(formula: GravityImpact) -> Figure:
    """World lines of eleven points; dashed, the waves that bound the regions."""
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    t, x = np.linspace(0.0, SCENE.duration, 401)[:, None], np.linspace(0.0, formula.length, 11)
    place = x + formula.displacement(t, x)
    axes.fill_between(t[:, 0], place[:, 0], place[:, -1], color=BLUE, alpha=0.10)
    axes.plot(t, place, color=BLUE, linewidth=0.8)
    y = np.linspace(0.0, formula.length, 101)
    for times in (
        formula.impact_time + y / formula.wave_speed,
        formula.release_time - y / formula.wave_speed,
        np.full(101, formula.impact_time),
        np.full(101, formula.release_time),
    ):
        axes.plot(times, y + formula.displacement(times, y), "--", color=ORANGE, linewidth=1.2)
    frame = {"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 1.5}
    for name, (time, point) in {
        "$I_0$": (0.4, 0.55), "$I_1$": (1.2, 0.75), "$A_1$": (1.9, 0.3), "$I_2$": (2.63, 0.75),
        "$I_3$": (3.4, 0.5),
    }.items():  # fmt: skip
        height = point + float(formula.displacement(time, point))
        axes.text(time, height, name, ha="center", va="center", fontsize="large", bbox=frame)
    axes.axhspan(-0.08, 0.0, color="0.5", alpha=0.5, hatch="//", linewidth=0)
    axes.set(xlim=(0.0, SCENE.duration), xlabel="time [s]", ylabel="distance from the wall [m]",
             title="Falling bar: points, and the waves between the regions")  # fmt: skip
    axes.set_ylim(bottom=-0.08)
    return figure


def draw_check(formula: GravityImpact) -> Figure:
    """Contact force three ways, and the error of the series."""
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    force, series = figure.subplots(1, 2)
    run = impactfem.solve(SCENE, method="galerkin", elements=40)
    t = np.unique(np.r_[np.linspace(0.0, SCENE.duration, 801),
                        formula.impact_time + 1e-9, formula.release_time + 1e-9])  # fmt: skip
    law = -formula.multiplier(t)
    # eta_x = +(t - tau)/c instead of -(t - tau)/c turns the slope of the force around.
    pushed = law > 0.0
    printed = np.where(pushed, 2.0 * formula.wave_speed * formula.impact_speed - law, 0.0)
    force.plot(t, law, color=ORANGE, linewidth=4, alpha=0.6, label="$-\\lambda = c(v_0 + pt)$")
    force.stairs(run.history["contact_force"][1:], run.history["time"], baseline=None, color=BLUE,
                 linewidth=1.2, label="galerkin, n = 40")  # fmt: skip
    force.plot(t, printed, color="0.4", linestyle=":", label="with the printed sign of $\\eta_x$")
    force.set(xlabel="time [s]", ylabel="contact force [N]", ylim=(-0.03, 1.05),
              title="Contact force")  # fmt: skip
    force.legend(frameon=False, loc="upper left", fontsize="small")
    draw_series(series, formula)
    return figure


def draw_series(axes: Axes, formula: GravityImpact) -> None:
    """Largest and median error of eta and chi at places and times of the motion."""
    rng = np.random.default_rng(0)
    bar = (formula.length, formula.wave_speed)
    s = rng.uniform(0.0, 8.0 * formula.transit_time, 1000)
    x = rng.uniform(0.0, formula.length, 1000)
    s[:50] = formula.transit_time * (2.0 + x[:50] / formula.length)  # on a wave front
    terms = np.array([3, 6, 12, 25, 50, 100, 200, 400, 800])
    for name, colour, series, closed in (
        ("$\\eta$", BLUE, clamped_series, clamped_vibration),
        ("$\\chi$", ORANGE, free_series, free_vibration),
    ):
        exact = closed(s, x, *bar)
        sums = [series(s, x, *bar, int(n)) for n in terms]
        errors = np.array([np.abs(one.value - exact) for one in sums])
        axes.loglog(terms, [one.bound.max() for one in sums], "--", color=colour, linewidth=1,
                    label=f"{name}: bound at wave fronts")  # fmt: skip
        axes.loglog(terms, errors.max(axis=1), "o", color=colour, label=f"{name}: largest error")
        axes.loglog(terms, np.median(errors, axis=1), "s-", color=colour, markersize=3,
                    linewidth=0.8, label=f"{name}: median error")  # fmt: skip
    axes.set(xlabel="terms", ylabel="error [s$^2$]", title="Fourier series, summed by parts")
    axes.legend(frameon=False, fontsize="x-small", loc="lower left")


def main() -> None:
    """Draw both pictures and say what was compared."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "folder", nargs="?", type=Path, default=Path("results/gravity_impact_script")
    )
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    formula = closed_form()
    for name, figure in {
        "motion": draw_motion(formula), "check": draw_check(formula),
    }.items():  # fmt: skip
        figure.savefig(folder / f"{name}.png", dpi=120)
        print(folder / f"{name}.png")
    run = impactfem.solve(SCENE, method="exact", elements=40)
    t, x = run.fields.times, run.fields.positions
    difference = run.fields.displacement - formula.displacement(t[:, None], x)
    print(f"formula against characteristics: {np.abs(difference).max():.1e} m")
    print(f"impact {formula.impact_time:.6f} s, release {formula.release_time:.6f} s, "
          f"next impact {formula.next_impact:.6f} s")  # fmt: skip


if __name__ == "__main__":
    main()
