"""How contacts that hold a body more than once share its forces.

Two feet of a block that stick leave open how much of a push along the floor each of them takes.
The accelerations are those of the least forces. Whether the feet hold is asked of the least forces
that obey the laws of contact; if there are none, something slips. They are found as the least way
from the others, by non-negative least squares (Lawson and Hanson, Solving Least Squares Problems,
1974, chapter 23).
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import nnls

from impactfem.arrays import Floats

_RANK = 1e-12  # least share of a singular value that counts
_NONE = 1e-8  # residual from which on no forces obey: the inverse square of the way to them
_MISSED = 1e-12  # share of the forces by which they may miss


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
        The given ones, of all the least, if they obey or none do; else the least that obey.
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
    both = np.column_stack([rooms @ free, -(rooms @ forces) / size]).T
    target = np.zeros(len(both))
    target[-1] = 1.0
    try:
        left = both @ nnls(both, target)[0] - target
    except RuntimeError:  # it gave up, as where hardly any forces obey
        return forces
    if left[-1] >= -_NONE:
        return forces
    found = forces - size * (free @ left[:-1]) / left[-1]
    return found if (rooms @ found >= -_MISSED * size).all() else forces
