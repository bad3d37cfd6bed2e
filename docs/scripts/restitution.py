"""Draw what restitution an elastic bar shows in a gravity field (docs/images/restitution.png).

python docs/scripts/restitution.py [OUTPUT]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from impactfem.exact import ExactBar

DOCS = Path(__file__).resolve().parent.parent
BLUE, ORANGE, GREEN = "#0b559f", "#d95f02", "#1b7837"


def measured(q: float) -> tuple[float, float, float]:
    """Three coefficients of one impact with pull q = p l / V, from the exact bar.

    Returns:
        Velocity of the centre of mass after over before; the same from its kinetic and potential
        energy; velocity of the end after over before.
    """
    bar = ExactBar(
        length=1.0, wave_speed=1.0, duration=8.0, nodes=[0.0, 1.0], displacement=[0.0, 0.0],
        velocity=[-1.0, -1.0], gravity_values=[q],
    )  # fmt: skip
    leave = bar.contacts[0][1]
    velocity = float(bar.mean_velocity(leave))
    energy = velocity**2 + 2.0 * q * float(bar.mean_displacement(leave))
    moment = 1e-7
    end = float(bar.gap(leave + moment)) / moment
    return velocity, float(np.sqrt(energy)), end


def main() -> None:
    """Curves by formula, dots from the exact bar, and the energy over many irregular bounces."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "images" / "restitution.png"
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    single, many = figure.subplots(1, 2)
    q = np.linspace(1e-6, 2.0, 801)
    weak = q <= 0.5
    formulas = {
        "velocity of the centre of mass": (BLUE, np.minimum(1.0, 0.5 / q)),
        "its energy, as a velocity": (
            ORANGE, np.sqrt(np.where(weak, 1 - 4 * q**2 / 3, 1 - 2 / (3 * q) + 1 / (4 * q**2))),
        ),
        "velocity of the end": (GREEN, np.maximum(0.0, 1.0 - 2.0 * q)),
    }  # fmt: skip
    dots = np.array([0.05, 0.15, 0.25, 0.35, 0.45, 0.6, 0.75, 1.0, 1.25, 1.5, 1.75, 1.95])
    values = np.array([measured(pull) for pull in dots]).T
    for (label, (colour, curve)), value in zip(formulas.items(), values, strict=True):
        single.plot(q, curve, color=colour, label=label)
        single.plot(dots, value, "o", color=colour, markersize=4)
        at = np.interp(dots, q, curve)
        print(f"{label}: formula against exact bar {np.abs(at - value).max():.0e}")
    single.axvline(0.5, color="0.6", linewidth=0.8, linestyle=":")
    single.set(xlabel="pull during contact, $p\\,l / V$", ylabel="after / before",
               title="One impact, three coefficients", ylim=(-0.03, 1.35))  # fmt: skip
    single.legend(frameon=False, fontsize="small", loc="upper right")

    bar = ExactBar(
        length=1.0, wave_speed=1.0, duration=60.0, nodes=[0.0, 1.0], displacement=[0.5, 0.5],
        velocity=[-2.0, -2.0], gravity_values=[1.0],
    )  # fmt: skip
    t = np.linspace(0.0, 60.0, 6001)
    share = (0.5 * bar.mean_velocity(t) ** 2 + bar.mean_displacement(t)) / 2.5
    for start, end in bar.contacts:
        many.axvspan(start, end, color="0.87", linewidth=0)
    many.plot(t, share, color=ORANGE, linewidth=1.0)
    many.set(xlim=(0.0, 60.0), ylim=(-0.3, 1.05), xlabel="time [s]", ylabel="share of the energy",
             title="Centre of mass, irregular bounces (grey: contact)")  # fmt: skip
    figure.savefig(path, dpi=110)
    print(path, len(bar.contacts), "contacts")


if __name__ == "__main__":
    main()
