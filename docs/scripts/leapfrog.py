"""The space-time scheme step by step, in NumPy only: an independent check of its limits.

P1 on right triangles is the leapfrog scheme with lumped masses. The contact force lambda_m acts
during (t_{m-1}, t_m]; the end node at t_m feels half of lambda_m and half of lambda_{m+1}, and
lambda_{m+1} is what keeps u_{m+1} from becoming negative.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Bar:
    """A free bar (length, wave speed) at rest shape, at a gap, with a velocity and gravity; SI."""

    length: float = 1.0
    wave_speed: float = 1.0
    gap: float = 0.5
    velocity: float = -0.5
    gravity: float = 0.0


@dataclass(frozen=True)
class Motion:
    """End of the bar, multiplier and energy (per rho A) of each layer, shape (layers,)."""

    times: NDArray[np.float64]
    gap: NDArray[np.float64]
    multiplier: NDArray[np.float64]
    energy: NDArray[np.float64]


def march(
    bar: Bar,
    elements: int,
    courant: float,
    duration: float,
    rule: Literal["node", "mean"] = "node",
) -> Motion:
    """Go through the layers one by one.

    Contact holds u_{m+1} = 0 if without it u_{m+1} were negative (rule "node", the product's) or
    the mean of u_m and u_{m+1} were (rule "mean", that of the slides).
    """
    h = bar.length / elements
    dt = courant * h / bar.wave_speed
    layers = round(duration / dt)
    mass = np.full(elements + 1, h)
    mass[[0, -1]] = 0.5 * h
    stiffness = bar.wave_speed**2 / h
    gap, multiplier, energy = np.empty((3, layers))

    def elastic(u: NDArray[np.float64]) -> NDArray[np.float64]:
        stress = stiffness * (u[1:] - u[:-1])
        force = np.zeros_like(u)
        force[:-1] -= stress
        force[1:] += stress
        return force

    now = old = np.full(elements + 1, float(bar.gap))
    pull = elastic(now)
    # Row m = 0 covers half a layer: the initial velocity, half the forces, half of lambda_1.
    new = now + dt * bar.velocity - 0.5 * dt**2 * (pull / mass + bar.gravity)
    last = 0.0
    rounding = 1e-12 * bar.gap
    for m in range(layers):
        if m > 0:
            new = 2.0 * now - old - dt**2 * (pull / mass + bar.gravity)
            new[0] -= 0.5 * dt**2 * last / mass[0]
        last = 0.0
        if new[0] + (now[0] if rule == "mean" else 0.0) < -rounding:
            last, new[0] = 2.0 * mass[0] * new[0] / dt**2, 0.0
        velocity = (new - now) / dt
        # What leapfrog conserves: v M v / 2 + now K new / 2, and gravity's potential between them.
        energy[m] = 0.5 * (mass @ velocity**2 + pull @ new)
        energy[m] += 0.5 * bar.gravity * (mass @ (now + new))
        gap[m], multiplier[m] = new[0], last
        old, now = now, new
        pull = elastic(now)
    return Motion(dt * np.arange(1, layers + 1), gap, multiplier, energy)
