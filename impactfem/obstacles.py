"""Rigid obstacles of a scene; `Wall` and `HalfSpace` stand in `impactfem` itself too."""

from impactfem.scene import (
    HalfSpace,
    RigidBox,
    RigidCylinder,
    RigidMesh,
    RigidPolyline,
    RigidSphere,
    Wall,
)

__all__ = [
    "HalfSpace",
    "RigidBox",
    "RigidCylinder",
    "RigidMesh",
    "RigidPolyline",
    "RigidSphere",
    "Wall",
]
