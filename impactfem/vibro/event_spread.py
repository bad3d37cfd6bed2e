"""How contacts that hold a body more than once share its forces.

Two feet of a block that stick leave open how much of a push along the floor each of them takes.
The accelerations are those of the least forces; whether the feet hold is asked of the forces that
are farthest from slipping and lifting.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

Floats = NDArray[np.float64]

_ROOM = 0.1  # share of the forces that is room enough
_RANK = 1e-12  # least share of a singular value that counts
_TOLERANCE = 1e-10  # least one of the solver, of forces of size 1


def spread(
    forces: Floats, push: Floats, normals: int, limits: Sequence[tuple[int, float]]
) -> Floats:
    """Forces with the same effect that obey lambda >= 0 and |tau| <= mu lambda, if any do.

    Args:
        forces: Normal ones, then those of what sticks, shape (n,).
        push: What unit forces do, shape (n, k).
        normals: Number of normal ones.
        limits: Of what sticks, its normal force and mu.

    Returns:
        The given ones if they do; else those whose worst excess is least.
    """
    rooms = np.zeros((normals + 2 * len(limits), len(forces)))
    rooms[:normals, :normals] = np.eye(normals)
    for k, (i, mu) in enumerate(limits):
        rooms[normals + 2 * k : normals + 2 * k + 2, i] = mu
        rooms[normals + 2 * k : normals + 2 * k + 2, normals + k] = 1.0, -1.0
    size = float(np.abs(forces).max(initial=0.0))
    if size == 0.0 or (rooms @ forces >= 0.0).all():
        return forces
    _, sizes, right = np.linalg.svd(push.T)
    free = right[int((sizes > _RANK * sizes[0]).sum()) :].T
    cost = np.zeros(free.shape[1] + 1)
    cost[-1] = 1.0  # the worst excess
    found = linprog(
        cost,
        A_ub=-np.column_stack([rooms @ free, np.ones(len(rooms))]),
        b_ub=rooms @ forces / size,
        bounds=[(None, None)] * free.shape[1] + [(-_ROOM, None)],
        options={"primal_feasibility_tolerance": _TOLERANCE},
    )
    return forces if found.x is None else forces + size * (free @ found.x[:-1])
