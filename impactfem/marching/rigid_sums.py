"""Sums of a level of rigid bodies."""

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.marching.layers import Sums


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
    turns = dim * (dim - 1) // 2
    own = applied(inertia, spin)
    kinetic = mass[:, 0] * np.einsum("bi,bi->b", speed, speed)
    kinetic = 0.5 * (kinetic + np.einsum("bi,bi->b", spin, own))
    angular = applied(rotated, own)[:, 3 - turns :]
    if dim == 2:
        size, rotated = inertia[:, 2, 2, None, None], rotated[:, :2, :2]
        second = 0.5 * size * np.eye(2)
    else:
        size = np.trace(inertia, axis1=1, axis2=2)[:, None, None]
        second = 0.5 * size * np.eye(3) - rotated @ inertia @ rotated.swapaxes(1, 2)
    # Its polar factor is asked for only: of a rod the moments of mass would not have one.
    attitude = np.stack([size * rotated, second], axis=1).reshape(len(mass), -1)
    vectors = (mass * speed)[:, :dim], (mass * moved)[:, :dim], angular, attitude
    each = zip(kinetic.tolist(), work.tolist(), *vectors, strict=True)
    return [Sums(energy, 0.0, done, *rest) for energy, done, *rest in each]


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
