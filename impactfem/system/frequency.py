"""How fast systems of few degrees of freedom vibrate."""

import numpy as np
from scipy.linalg import eigvals

from impactfem.arrays import Floats
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.system.joined import Room


def highest_frequency(system: GeneralizedSystem, u: Floats, v: Floats) -> float:
    """omega_max of M^-1 K [rad/s], K = -df/du by differences where the system is not linear."""
    if isinstance(system, LinearSystem):
        stiffness = system.stiffness
    else:
        steps = 6e-6 * np.maximum(1.0, np.abs(u))
        stiffness = -np.stack(
            [
                (system.force(0.0, u + row, v) - system.force(0.0, u - row, v)) / (2.0 * row.sum())
                for row in np.diag(steps)
            ],
            axis=1,
        )
        stiffness = stiffness @ system.moving(u)
    room = Room.at(system, u)
    squares = eigvals(room.load(room.rows(stiffness)), room.mass)
    return float(np.sqrt(float(np.real(squares).max(initial=0.0))))
