"""Forces on bodies of few degrees of freedom: those that stay, and how others change."""

from collections.abc import Callable

import numpy as np

from impactfem.arrays import Floats
from impactfem.system.beam_load import BeamForces
from impactfem.system.generalized import GeneralizedSystem, LinearSystem

_SHARE_OF_SIZE = 1e-6  # of coordinates and speeds by which forces are differentiated


def steady_load(system: GeneralizedSystem) -> Floats | None:
    """Constant loads of a linear system, asked for in every layer; None if they change."""
    if not isinstance(system, LinearSystem) or not all(s.is_constant for s in system.load):
        return None
    return np.array([signal.constant for signal in system.load], dtype=float)


def tangent(
    system: GeneralizedSystem, around: tuple[float, float], q: Floats, v: Floats
) -> tuple[Floats, Floats]:
    """Stiffness -df/dq and damping -df/dv (d, d) each, by central differences if not constant.

    Those of means over a step, given by its middle and its length [s].
    """
    if isinstance(system, LinearSystem):
        return system.stiffness, system.damping
    if isinstance(system.applied, BeamForces):
        return system.applied.tangent
    return (
        _falling(lambda x: system.force(around[0], x, v, around[1]), q),
        _falling(lambda x: system.force(around[0], q, x, around[1]), v),
    )


def _falling(force: Callable[[Floats], Floats], values: Floats) -> Floats:
    """Minus the derivative of forces at some values, (d, d)."""
    step = _SHARE_OF_SIZE * max(float(np.abs(values).max(initial=0.0)), _SHARE_OF_SIZE)
    sides = step * np.eye(len(values))
    columns = [force(values - h) - force(values + h) for h in sides]
    return np.stack(columns, axis=1) / (2.0 * step)
