"""Obstacles of a scene: the wall of bars, and the rigid obstacles of all other bodies.

Each kind is one file: its keys and checks, its distance, outline, faces and mirror image. A new one
is listed here.
"""

from typing import Any

from impactfem.scene.obstacles.base import SIDES, Field, RigidObstacle
from impactfem.scene.obstacles.box import RigidBox
from impactfem.scene.obstacles.cylinder import RigidCylinder
from impactfem.scene.obstacles.half_space import HalfSpace
from impactfem.scene.obstacles.mesh import RigidMesh
from impactfem.scene.obstacles.polyline import RigidPolyline
from impactfem.scene.obstacles.sphere import RigidSphere
from impactfem.scene.obstacles.wall import Wall

__all__ = [
    "OBSTACLES", "SIDES", "Field", "HalfSpace", "Rigid", "RigidBox", "RigidCylinder",
    "RigidMesh", "RigidObstacle", "RigidPolyline", "RigidSphere", "Wall",
]  # fmt: skip

type Rigid = RigidObstacle

OBSTACLES: dict[str, type[Any]] = {
    cls.kind: cls
    for cls in (
        Wall,
        HalfSpace,
        RigidSphere,
        RigidCylinder,
        RigidBox,
        RigidPolyline,
        RigidMesh,
    )
}
"""All kinds by name; `impactfem.extend` adds others."""
