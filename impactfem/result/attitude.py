"""Rotation and spin of a body that may turn far, from moments of its mass."""

import numpy as np
from scipy.spatial.transform import Rotation

from impactfem.arrays import Floats
from impactfem.result.whole import Whole

_NONE = 1e-13  # share of moments that is rounding


def attitude(
    moments: Floats, spun: Floats, whole: Whole, dt: float, ahead: float = 0.0
) -> tuple[Floats, Floats]:
    """Rotation and spin as `BodyMotion` has them.

    The rotation is the one that fits the places best (W. Kabsch, Acta Cryst. A 32 (1976) 922-923),
    in the plane counted over the turns that spins tell, of which a step may have many; the spin is
    that of the rigid body with the present moment of inertia and the same angular momentum.

    Args:
        moments: Sum of m x (X - c)^T and of m a a^T with present arms a [kg m^2],
            (rows, 2, dim, dim).
        spun: Angular momentum about the centre [kg m^2/s], (rows, 1 or 3).
        whole: What the body is part of: images undo products across their planes.
        dt: From row to row [s].
        ahead: Time from where moments were taken to the rows but the first, which spins go on [s].

    Returns:
        Angle [rad], (rows, 1), or unit quaternions, w first, (rows, 4); spin [rad/s], (rows, 1 or
        3).
    """
    dim = moments.shape[-1]
    cut = np.isin(np.arange(dim), list(whole.levels))
    kept = ~np.logical_xor.outer(cut, cut)
    if cut.sum() > 1:
        kept &= np.eye(dim, dtype=bool)
    fit, second = np.where(kept, moments[:, 0], 0.0), np.where(kept, moments[:, 1], 0.0)
    if dim == 2:
        angle = np.arctan2(fit[:, 1, 0] - fit[:, 0, 1], np.trace(fit, axis1=1, axis2=2))
        spin = spun / np.trace(second, axis1=1, axis2=2)[:, None]
        steps, ways = np.diff(angle), 0.5 * dt * (spin[1:, 0] + spin[:-1, 0])
        turns = np.cumsum(np.round((ways - steps) / (2.0 * np.pi)))
        angle[1:] += 2.0 * np.pi * turns + ahead * spin[1:, 0]
        return angle[:, None], spin
    inertia = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second
    # About a line that carries all mass, as in very coarse meshes, nothing tells a spin or a turn.
    spin = (np.linalg.pinv(inertia, _NONE, hermitian=True) @ spun[:, :, None])[:, :, 0]
    least = _NONE * np.trace(second, axis1=1, axis2=2)[:, None, None]
    left, _, right = np.linalg.svd(fit + least * np.eye(3))
    left[:, :, -1] *= np.sign(np.linalg.det(left @ right))[:, None]
    found = left @ right
    if ahead:
        found[1:] = Rotation.from_rotvec(ahead * spin[1:]).as_matrix() @ found[1:]
    turn = np.roll(Rotation.from_matrix(found).as_quat(), 1, axis=1)  # w comes last there
    steps = np.sign(np.einsum("ij,ij->i", turn[1:], turn[:-1]))
    turn[1:] *= np.cumprod(np.where(steps < 0.0, -1.0, 1.0))[:, None]
    return turn, spin
