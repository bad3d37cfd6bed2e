"""How fast systems of few degrees of freedom vibrate."""

from collections.abc import Callable

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
        stiffness = _slopes(lambda step: system.force(0.0, u + step, v), steps) @ system.moving(u)
    return float(np.sqrt(_largest(system, u, stiffness)))


def fastest_decay(system: GeneralizedSystem, u: Floats, v: Floats) -> float:
    """The largest rate c/m of M^-1 C [1/s], C = -df/dv by differences likewise.

    A motion that decays at that rate allows no step of an exact flight or of an adaptive
    integrator that is much longer than its inverse, long after it has died out.
    """
    if isinstance(system, LinearSystem):
        damping = system.damping
    else:
        steps = 6e-6 * np.maximum(1.0, np.abs(v))
        damping = _slopes(lambda step: system.force(0.0, u, v + step), steps)
    return _largest(system, u, damping)


def _slopes(force: Callable[[Floats], Floats], steps: Floats) -> Floats:
    """-df/dx by central differences, columns by ``steps``."""
    columns = [(force(-row) - force(row)) / (2.0 * row.sum()) for row in np.diag(steps)]
    return np.stack(columns, axis=1)


def _largest(system: GeneralizedSystem, u: Floats, matrix: Floats) -> float:
    """The largest real part of an eigenvalue of M^-1 A, 0 if none is positive."""
    room = Room.at(system, u)
    found = eigvals(room.load(room.rows(matrix)), room.mass)
    return float(np.real(found).max(initial=0.0))
