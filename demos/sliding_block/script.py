"""The block with friction below and above width / height: it slides upright, or tips.

python demos/sliding_block/script.py [FOLDER]     # results/sliding_block_script/tipping.png
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import impactfem

SCENE = impactfem.Scene.from_toml(Path(__file__).with_name("scene.toml"))
WIDTH, HEIGHT = 0.05, 0.1  # [m]
SPEED, GRAVITY = 0.25, 9.81  # [m/s], [m/s^2]
CASES = {0.3: "#0b559f", 0.8: "#d95f02"}  # coefficients and their colours
SHOWN = (0.0, 0.05, 0.1, 0.15)  # [s]


def solved(friction: float) -> impactfem.Result:
    """Solve the scene with another coefficient of friction."""
    return impactfem.solve(SCENE.with_settings({"contact.0.friction_coefficient": friction}))


def tilt(result: impactfem.Result) -> tuple[Any, Any]:
    """Times [s] and the slope of the line between the middles of both sides."""
    fields: Any = result.fields
    middles = [(0.0, 0.5 * HEIGHT), (WIDTH, 0.5 * HEIGHT)]
    left, right = (np.argmin(np.abs(fields.points[:, :2] - p).sum(axis=1)) for p in middles)
    layers = range(len(fields))
    heights = [fields.read(k, "displacement")["displacement"][[left, right], 1] for k in layers]
    return fields.times, np.array([a - b for a, b in heights]) / WIDTH


def rigid_tilt(friction: float) -> float:
    """Largest tilt of a rigid block, for small angles.

    Sliding on its front edge it is pressed by N = m (g + a w / 2), with the angular acceleration a
    from m (w^2 + h^2) / 12 a = N (mu h - w) / 2. When the edge stops, it pivots.
    """
    inertia = (WIDTH**2 + HEIGHT**2) / 12.0  # of a unit of mass
    lever = 0.5 * (friction * HEIGHT - WIDTH)
    if lever <= 0.0:
        return 0.0
    turns = GRAVITY * lever / (inertia - 0.5 * WIDTH * lever)
    brakes = friction * (GRAVITY + 0.5 * WIDTH * turns)
    stops = SPEED / (brakes + 0.5 * HEIGHT * turns)
    slowed = 0.5 * GRAVITY * WIDTH / (4.0 * inertia)
    return 0.5 * turns * stops**2 + (turns * stops) ** 2 / (2.0 * slowed)


def draw(axes: Any, result: impactfem.Result, time: float) -> None:
    """The mesh at the field nearest to a time, on the floor."""
    fields: Any = result.fields
    layer = int(np.argmin(np.abs(fields.times - time)))
    moved = (fields.points + fields.read(layer, "displacement")["displacement"])[:, :2]
    axes.triplot(1e3 * moved[:, 0], 1e3 * moved[:, 1], fields.cells, linewidth=0.5, color="0.35")
    axes.axhline(0.0, color="black", linewidth=1.2)
    axes.axvline(0.0, color="0.7", linewidth=0.8, linestyle=":")
    axes.set(aspect="equal", xlim=(-8, 75), ylim=(-6, 108), xticks=[], yticks=[])
    axes.set_title(f"{1e3 * fields.times[layer]:.0f} ms", fontsize=9)
    axes.spines[:].set_visible(False)


def main() -> None:
    """Solve both, say what they do, draw."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results/sliding_block_script")
    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(9.0, 8.4), layout="constrained")
    parts: Any = figure.subfigures(2, 1, height_ratios=[1.9, 1.0])
    places = parts[0].subplots(2, len(SHOWN))
    way, angle = parts[1].subplots(1, 2)
    stop = SPEED**2 / (2.0 * GRAVITY * min(CASES))
    way.axhline(1e3 * stop, color="0.6", linewidth=0.8, linestyle="--")
    way.annotate("$v_0^2 / (2 \\mu g)$", (0.0, 1e3 * stop), (3, -11), textcoords="offset points",
                 fontsize=9)  # fmt: skip
    for row, (friction, colour) in enumerate(CASES.items()):
        result = solved(friction)
        for column, time in enumerate(SHOWN):
            draw(places[row, column], result, time)
            if column == 0:
                places[row, column].set_ylabel(f"$\\mu$ = {friction:g}", fontsize=12, color=colour)
        history = result.history
        moved = 1e3 * (history["block.x"] - history["block.x"][0])
        times, tilted = tilt(result)
        way.plot(1e3 * history["time"], moved, color=colour, label=f"$\\mu$ = {friction:g}")
        angle.plot(1e3 * times, 1e3 * tilted, color=colour)
        if rigid_tilt(friction) > 0.0:
            angle.axhline(1e3 * rigid_tilt(friction), color="0.6", linewidth=0.8, linestyle="--")
        print(f"friction {friction:g}: centre moves by {float(moved.max()):.2f} mm at most, "
              f"tilt {tilted.max():.4f} (rigid {rigid_tilt(friction):.4f}), frictional work "
              f"{result.summary['details']['friction_work']:.4f} J")  # fmt: skip
    way.set(xlabel="time [ms]", ylabel="way of the centre [mm]")
    way.legend(frameon=False)
    angle.set(xlabel="time [ms]", ylabel="tilt [mrad]")
    angle.annotate(
        "rigid block",
        (0.98, 1e3 * rigid_tilt(max(CASES))),
        (-2, 4),
        fontsize=9,
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        ha="right",
    )
    figure.savefig(folder / "tipping.png", dpi=110)
    print(folder / "tipping.png")


if __name__ == "__main__":
    main()
