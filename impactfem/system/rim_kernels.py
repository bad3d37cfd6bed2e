"""Compiled: places on circles about an axis of a body, the lowest one and others beside it."""

import numpy as np

from impactfem.compiled import compiled

NEAR = 0.5
"""Least cosine between lowest directions in a layer: a rim that rocks has others."""

_LEVEL = 1e-9  # sine of the angle to an obstacle below which a rim lies flat on it


@compiled
def lowest_direction(axis, normal, known, near):
    """Direction from the centre of a circle to what is nearest, (3,).

    Args:
        axis: Of the circle in space, (3,).
        normal: Of what it may touch, towards it, (3,).
        known: Direction that is taken where it lies flat, or where the other would be farther off
            than so, (3,).
        near: Least cosine of the angle from that.
    """
    down, other = np.empty(3), np.empty(3)
    along = axis[0] * normal[0] + axis[1] * normal[1] + axis[2] * normal[2]
    before = axis[0] * known[0] + axis[1] * known[1] + axis[2] * known[2]
    size, length = 0.0, 0.0
    for k in range(3):
        down[k] = along * axis[k] - normal[k]
        other[k] = known[k] - before * axis[k]
        size += down[k] ** 2
        length += other[k] ** 2
    size, length = np.sqrt(size), np.sqrt(length)
    cosine = 0.0
    for k in range(3):
        down[k] /= max(size, _LEVEL)
        other[k] /= max(length, _LEVEL)
        cosine += down[k] * other[k]
    return down if size > _LEVEL and cosine >= near else other


@compiled
def add_along_rim(arm, axis, down, share):
    """Add to an arm (3,) the way from the centre of a circle to a place on it, in place.

    Args:
        arm: [m], (3,).
        axis: Of the circle in space, (3,).
        down: Direction to its lowest place, (3,).
        share: Radius times cosine and sine of the angle from there [m], (2,).
    """
    arm[0] += share[0] * down[0] + share[1] * (axis[1] * down[2] - axis[2] * down[1])
    arm[1] += share[0] * down[1] + share[1] * (axis[2] * down[0] - axis[0] * down[2])
    arm[2] += share[0] * down[2] + share[1] * (axis[0] * down[1] - axis[1] * down[0])


@compiled
def lowest_directions(axes, normals, known, near):
    """`lowest_direction` of circles about axes (nodes, 3), (nodes, 3)."""
    found = np.empty_like(known)
    for k in range(len(known)):
        found[k] = lowest_direction(axes[k], normals[k], known[k], near)
    return found


@compiled
def along_rims(axes, normals, known, shares):
    """From the centres of circles to places on them [m], (nodes, 3); all near known ones."""
    found = np.zeros_like(known)
    for k in range(len(known)):
        down = lowest_direction(axes[k], normals[k], known[k], NEAR)
        add_along_rim(found[k], axes[k], down, shares[k])
    return found
