"""Contact normals of the undeformed body, or updated ones: what the way of the body asks for."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from impactfem.scene import Scene
from impactfem.scene.obstacles import (
    HalfSpace,
    RigidBox,
    RigidCylinder,
    RigidPolyline,
    RigidSphere,
)
from impactfem.scene.scene import Rigid

Floats = NDArray[np.float64]

_FAR = 0.1  # ways over the size of an obstacle's features from which its normals change much


def choose_normals(scene: Scene, gap: Floats, normal: Floats, reasons: dict[str, str]) -> str:
    """Fixed normals where they are exact or nothing moves far, else updated ones.

    Args:
        scene: The scene.
        gap: Gaps of the contact nodes at t = 0 [m], shape (count,).
        normal: Their normals, shape (count, dim).
        reasons: Gets the reason.
    """
    if scene.solve.normals is not None:
        reasons["normals"] = "as asked"
        return scene.solve.normals
    curved = [_features(o) for o in scene.rigid_obstacles if not isinstance(o, HalfSpace)]
    if not curved:
        reasons["normals"] = "fixed: the normal of a plane is the same everywhere, so this is exact"
        return "fixed"
    if not len(gap):
        reasons["normals"] = "fixed: nothing can touch"
        return "fixed"
    nearest = int(np.argmin(gap))
    along = _way_along(scene, normal[nearest])
    limit = _FAR * min(curved)
    if max(float(gap[nearest]), along) <= limit:
        reasons["normals"] = (
            f"fixed: until and along the contact the body moves by less than {limit:.3g} m, a "
            "tenth of the obstacle's radius or shortest face"
        )
        return "fixed"
    reasons["normals"] = (
        f"updated in each layer: the body moves {gap[nearest]:.3g} m towards the obstacle and "
        f"about {along:.3g} m along it, where its normal changes; energy is then kept to the "
        "accuracy of the step only"
    )
    return "updated"


def _way_along(scene: Scene, normal: Floats) -> float:
    """Way of the body and the obstacles across a normal within the duration [m], about."""
    solid, duration = scene.solid, scene.duration
    centre = dict(zip("xyz", solid.shape.centre if solid.shape else (0.0,) * 3, strict=False))
    speed = np.array([float(formula(**centre)) for formula in solid.velocity])
    pulls = [scene.vector_gravity.at(t) for t in scene.vector_gravity.times]
    way = _across(speed, normal) * duration
    way += 0.5 * max(_across(pull, normal) for pull in pulls) * duration**2
    for obstacle in scene.rigid_obstacles:
        start, end = obstacle.offset(0.0), obstacle.offset(duration)
        if start is not None and end is not None:
            way += _across(end - start, normal)
    return way


def _across(vector: Floats, normal: Floats) -> float:
    """Length of the part of a vector across a unit normal."""
    return float(np.linalg.norm(vector - (vector @ normal) * normal))


def _features(obstacle: Rigid) -> float:
    """Length over which the normal of an obstacle changes [m]."""
    match obstacle:
        case RigidSphere() | RigidCylinder():
            return obstacle.radius
        case RigidBox():
            return min(obstacle.size)
        case RigidPolyline():
            return min(math.dist(a, b) for a, b in pairwise(obstacle.points))
        case _:
            return math.inf
