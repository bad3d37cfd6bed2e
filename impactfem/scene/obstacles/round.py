"""What round obstacles have in common."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from impactfem.scene.obstacles.base import ROUNDING, Field, Floats


def round_gap(arms: Floats, fallback: Floats, radius: float, sign: float) -> Field:
    """Distances from a sphere or cylinder, and normals.

    Args:
        arms: From its centre or axis to the points [m], shape (points, dim).
        fallback: Normal where an arm has no length, shape (dim,).
        radius: [m].
        sign: 1 if the body is outside, else -1.
    """
    length = np.sqrt(np.einsum("ij,ij->i", arms, arms))
    centred = length <= ROUNDING * radius
    normal = arms / np.where(centred, 1.0, length)[:, None]
    normal[centred] = fallback
    return sign * (length - radius), sign * normal


def side_sign(side: str) -> float:
    """1 if the body is outside, else -1."""
    return -1.0 if side == "inside" else 1.0


def circle(centre: Sequence[float], radius: float, side: str) -> dict[str, Any]:
    """Outline in the plane."""
    return {"shape": "circle", "point": centre[:2], "radius": radius, "inside": side == "inside"}


def upwards(dim: int) -> Floats:
    """Unit vector along y."""
    up: Floats = np.zeros(dim)
    up[1] = 1.0
    return up
