"""Bilateral rows b(u) = 0 of systems in generalised coordinates: forces, impulses, closing.

Multipliers of rows that depend on each other are those of least size.
"""

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import ConvergenceError
from impactfem.system.generalized import GeneralizedSystem

Floats = NDArray[np.float64]

_DEPENDENT = 1e-10  # least share of a singular value of rows that counts
_MOST_CLOSING, _CLOSED = 20, 1e-14  # iterates that close bilateral rows, and their change
_STEP = 3e-3  # of differences along the motion, as a share of the lengths
_SECOND = ((0.0, -30.0), (1.0, 16.0), (-1.0, 16.0), (2.0, -1.0), (-2.0, -1.0))


def held(system: GeneralizedSystem, t: float, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Accelerations (d,) and multipliers of the bilateral rows (B,), those of least size."""
    mass, load = system.mass(u), system.force(t, u, v)
    if system.bilateral is None:
        return np.linalg.solve(mass, load), np.zeros(0)
    rows, speed = system.joined(u), float(np.abs(v).max(initial=0.0))
    bend = np.zeros(len(rows))
    if speed > 0.0:
        bend = _bend(system, u, v, speed)
    free = np.linalg.solve(mass, np.column_stack([load, rows.T]))
    pulled = -np.linalg.pinv(rows @ free[:, 1:], _DEPENDENT) @ (rows @ free[:, 0] + bend)
    return free[:, 0] + free[:, 1:] @ pulled, pulled


def answers(system: GeneralizedSystem, u: Floats, rows: Floats) -> Floats:
    """Velocities (d, n) by unit impulses along rows (n, d) that bilateral rows let pass."""
    joined = system.joined(u)
    free = np.linalg.solve(system.mass(u), np.concatenate([rows, joined]).T)
    found, holding = free[:, : len(rows)], free[:, len(rows) :]
    if not len(joined):
        return np.asarray(found)
    back = np.linalg.pinv(joined @ holding, _DEPENDENT) @ (joined @ found)
    return np.asarray(found - holding @ back)


def closed(system: GeneralizedSystem, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """The nearest u and v, in the metric of M, that keep the bilateral rows.

    Raises:
        ConvergenceError: None was found near.
    """
    if system.bilateral is None:
        return u, v
    for _ in range(_MOST_CLOSING):
        wrong, rows = np.atleast_1d(np.asarray(system.bilateral(u), float)), system.joined(u)
        holding = np.linalg.solve(system.mass(u), rows.T)
        back = holding @ np.linalg.pinv(rows @ holding, _DEPENDENT)
        change = system.moving(u) @ (back @ wrong)
        u = u - change
        if np.abs(change).max() <= _CLOSED * max(1e-300, float(np.abs(u).max())):
            return u, v - back @ (rows @ v)
    raise ConvergenceError(
        f"the bilateral rows do not close: {wrong.tolist()} is left of them at u = "
        f"{u.tolist()}; use a smaller dt, or a start from which they can be closed"
    )


def _bend(system: GeneralizedSystem, u: Floats, v: Floats, speed: float) -> Floats:
    """Part (d/dt of the Jacobian) v of the second rates of the rows, (B,)."""
    h = _STEP * max(1.0, float(np.abs(u).max(initial=0.0))) / speed
    if system.rates is not None:
        h *= 1e-2
        way = h * (system.moving(u) @ v)
        return np.asarray((system.joined(u + way) - system.joined(u - way)) @ v / (2.0 * h))
    parts = (k * np.asarray(system.bilateral(u + s * h * v)) for s, k in _SECOND)  # type: ignore[misc]  # asked for with rows only
    return np.atleast_1d(sum(parts)) / (12.0 * h * h)
