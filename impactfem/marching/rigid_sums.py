"""What arrays of rigid bodies need besides kernels."""

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats


def applied(matrices: Floats, vectors: Floats) -> Floats:
    """Matrices (..., 3, 3) by as many vectors, (..., 3)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def about_axes(values: Floats) -> Floats:
    """Spins or moments (..., 3) by these or by those about z, (..., 1)."""
    if values.shape[-1] == 3:
        return values
    found = np.zeros((*values.shape[:-1], 3))
    found[..., 3 - values.shape[-1] :] = values
    return found


def on_bodies(moments: Floats, of: NDArray[np.int64], count: int) -> Floats:
    """Several moments on nodes (several, nodes, turns) as such on bodies, whose number each has."""
    found = np.zeros((len(moments), count, moments.shape[2]))
    np.add.at(found.swapaxes(0, 1), of, moments.swapaxes(0, 1))
    return found
