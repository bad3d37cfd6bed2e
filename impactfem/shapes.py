"""Shapes of solids and rigid bodies, outlines of plates."""

from impactfem.scene import (
    Block,
    Capsule,
    Cylinder,
    Disc,
    DiscOutline,
    Ellipsoid,
    Hull,
    PolygonOutline,
    RectangleOutline,
    Ring,
    RingOutline,
    Sphere,
)

__all__ = [
    "Block",
    "Capsule",
    "Cylinder",
    "Disc",
    "DiscOutline",
    "Ellipsoid",
    "Hull",
    "PolygonOutline",
    "RectangleOutline",
    "Ring",
    "RingOutline",
    "Sphere",
]
