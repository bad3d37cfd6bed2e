"""A ball on a thread that swings against a wall: equations that no scene file holds."""

import math

import impactfem
import numpy as np
from numpy.typing import NDArray

GRAVITY = 9.81  # [m/s^2]


def pendulum(length: float, mass: float, restitution: float) -> impactfem.systems.GeneralizedSystem:
    """The angle u of the thread to the vertical [rad]; the wall is the vertical through the hook.

    Args:
        length: Of the thread [m].
        mass: Of the ball [kg].
        restitution: Of the ball and the wall.
    """

    def force(t: float, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        del t, v
        return -mass * GRAVITY * length * np.sin(u)

    def potential(t: float, u: NDArray[np.float64]) -> float:
        del t
        return float(mass * GRAVITY * length * (1.0 - np.cos(u[0])))

    return impactfem.systems.GeneralizedSystem(
        mass=mass * length**2,
        force=force,
        constraints=[lambda u: length * np.sin(u[0])],
        restitution=restitution,
        potential=potential,
        names=["angle"],
    )


def swing(
    angle: float, restitution: float, duration: float = 2.0, length: float = 0.5
) -> impactfem.systems.Trajectory:
    """Let the ball go at an angle [rad]."""
    return impactfem.integrate(pendulum(length, 0.1, restitution), [angle], [0.0], duration)


def rebound_angle(angle: float, restitution: float) -> float:
    """Angle of the first rebound in closed form [rad]: 1 - cos falls with restitution squared."""
    return math.acos(1.0 - restitution**2 * (1.0 - math.cos(angle)))
