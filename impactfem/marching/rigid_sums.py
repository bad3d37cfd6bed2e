"""Sums of a level of rigid bodies."""

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.marching.layers import Sums
from impactfem.marching.rigid_kernels import summed


def sums_of(
    mass: Floats, inertia: Floats, moved: Floats, speed: Floats, spin: Floats, rotated: Floats,
    work: Floats, dim: int,
) -> list[Sums]:  # fmt: skip
    """Sums of each body.

    Args:
        mass: [kg], (bodies, 1).
        inertia: Along their axes [kg m^2], (bodies, 3, 3).
        moved: Displacements of the centres [m], (bodies, 3).
        speed: Velocities [m/s].
        spin: Along their axes [rad/s].
        rotated: Rotations, (bodies, 3, 3).
        work: Of loads in the layer [J], (bodies,).
        dim: Dimension of space.
    """
    kinetic, vectors, attitude = summed(mass[:, 0], inertia, moved, speed, spin, rotated, dim)
    ends = dim, 2 * dim
    return [
        Sums(energy, 0.0, done, own[: ends[0]], own[ends[0] : ends[1]], own[ends[1] :], turned)
        for energy, done, own, turned in zip(
            kinetic.tolist(), work.tolist(), vectors, attitude, strict=True
        )
    ]


def no_sums(bodies: int, dim: int) -> list[Sums]:
    """Those of ranks that do not sum up."""
    none = np.zeros(dim)
    turning = np.zeros(dim * (dim - 1) // 2), np.zeros(2 * dim**2)
    return [Sums(0.0, 0.0, 0.0, none, none, *turning) for _ in range(bodies)]


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
