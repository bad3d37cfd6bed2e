"""A walker without motor. script.py [FOLDER] (default results/walker_script).

gaits.png: a step as the legs stand, and multipliers of the gait on steeper and steeper slopes.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import impactfem

SLOPES = [0.001, 0.004, 0.007, 0.01, 0.013, 0.016, 0.018]  # [rad]


def swing(x: np.ndarray, slope: float) -> list[float]:
    """Rates of the angle of the stance leg, and of that between the legs, with their rates."""
    turn = np.sin(x[0] - slope)
    return [x[1], turn, x[3], turn + np.sin(x[2]) * (x[1] ** 2 - np.cos(x[0] - slope))]


def height(x: np.ndarray, slope: float) -> Any:  # noqa: ARG001
    """Above 0 while the foot that swings ahead is above the ground."""
    return 2.0 * x[0] - x[2]


def ahead(x: np.ndarray, slope: float) -> Any:  # noqa: ARG001
    """Whether it may strike: without knees it passes the ground amid the step too."""
    return x[0] < 0.0


def strike(x: np.ndarray, slope: float) -> list[float]:  # noqa: ARG001
    """The foot that swings sticks where it lands, the other one leaves: the legs change parts."""
    c = np.cos(2.0 * x[0])
    return [-x[0], c * x[1], -2.0 * x[0], c * (1.0 - c) * x[1]]


def main() -> None:
    """Walk down slopes, find where one step becomes two, and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/walker_script"))
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    step = impactfem.systems.Phase(swing, height, strike, when=ahead, name="step")
    walker = impactfem.systems.HybridSystem([step], ["stance", "stance'", "between", "between'"])
    gait = impactfem.systems.periodic_orbit(walker, [0.2, -0.2, 0.4, -0.016], {"slope": 0.009})
    print("slope   step angle   time of a step   multipliers")
    gaits = [gait.at(slope=slope) for slope in SLOPES]
    for each in gaits:
        told = "  ".join(f"{m:.6f}" for m in each.multipliers[:2])
        print(f"{each.parameters['slope']:.3f}   {each.start[0]:.8f}   {each.period:.8f}   {told}")
    doubled = gait.critical("slope", SLOPES[-2])
    print(f"one step becomes two at a slope of {doubled.parameters['slope']:.11f}")
    steep = {"slope": 0.017}
    seen = walker.follow(gait.at(**steep).start * (1.0 + 1e-3), 60, steep)[-2:]
    print("at 0.017 it limps, steps last", *(f"{each.end - each.begin:.4f}" for each in seen))

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    walk, plane = figure.subplots(1, 2)
    for share in np.linspace(0.0, 1.0, 9):
        stance, _, between, _ = gait.states(share * gait.period)[0]
        hip = np.array([-np.sin(stance), np.cos(stance)])
        foot = hip - [-np.sin(stance - between), np.cos(stance - between)]
        shade = str(0.75 * (1.0 - share))
        walk.plot([0.0, hip[0], foot[0]], [0.0, hip[1], foot[1]], color=shade)
        walk.plot(*hip, "o", color=shade, markersize=8)
    walk.set(aspect="equal", title="one step on a slope of 0.009 rad", xlabel="leg lengths")
    round_ = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 200))
    plane.plot(round_.real, round_.imag, color="0.7")
    for each in gaits:
        two = each.multipliers[:2]
        plane.plot(two.real, two.imag, "o", label=f"{each.parameters['slope']:g}")
    plane.set(aspect="equal", title="multipliers: outside the circle it limps")
    plane.legend(title="slope", fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(folder / "gaits.png", dpi=110)
    print(f"written to {folder / 'gaits.png'}")


if __name__ == "__main__":
    main()
