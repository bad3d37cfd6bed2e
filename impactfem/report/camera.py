"""From where pictures look at bodies: parallel projections of space, and the plane itself."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene import Scene

_ELEVATION, _STEEP = np.radians(14.0), np.radians(40.0)  # of the view; upon plates
_AZIMUTHS = np.radians([55.0, 125.0, 235.0, 305.0])


@dataclass(frozen=True)
class Camera:
    """A parallel projection.

    Attributes:
        right: Unit vector that points right in the picture, shape (3,).
        up: Unit vector that points up in it.
        towards: Unit vector towards the viewer.
    """

    right: Floats
    up: Floats
    towards: Floats

    @classmethod
    def facing(
        cls, vertical: Floats, planes: Sequence[Floats], elevation: float = _ELEVATION
    ) -> "Camera":
        """Look down a little, from where most planes (by their normals) show their front."""
        first = np.eye(3)[int(np.argmin(np.abs(vertical)))]
        if abs(vertical[1]) > 0.9:
            first = np.eye(3)[0]
        first -= (first @ vertical) * vertical
        first /= np.linalg.norm(first)
        second = np.cross(first, vertical)  # with y up: x right and z towards the viewer
        views = [
            np.cos(elevation) * (np.cos(a) * first + np.sin(a) * second)
            + np.sin(elevation) * vertical
            for a in _AZIMUTHS
        ]
        towards = max(views, key=lambda view: sum(bool(view @ n > 1e-9) for n in planes))
        right = np.cross(vertical, towards)
        right /= np.linalg.norm(right)
        return cls(right, np.cross(towards, right), towards)

    @classmethod
    def of(cls, scene: Scene) -> "Camera":
        """The view of a scene."""
        steep = _STEEP if _plate_normal(scene) is not None else _ELEVATION
        return cls.facing(vertical_of(scene), plane_normals(scene), steep)

    def flat(self, places: Floats) -> Floats:
        """Where places appear, shape (..., 2)."""
        return np.stack([places @ self.right, places @ self.up], axis=-1)


FLAT = Camera(*np.eye(3))
"""The view of the plane: x points right and y up."""


def plane_normals(scene: Scene) -> list[Floats]:
    """Normals of the obstacles that are planes, (3,) each."""
    found = (obstacle.plane_normal for obstacle in scene.rigid_obstacles)
    return [np.array(normal) for normal in found if normal is not None]


def vertical_of(scene: Scene) -> Floats:
    """What points up: a plate's normal, else against gravity, or along y without any; (3,)."""
    if (normal := _plate_normal(scene)) is not None:
        return normal
    gravity = np.asarray(scene.vector_gravity.at(0.0), dtype=np.float64)
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0.0 else np.eye(3)[1]


def _plate_normal(scene: Scene) -> Floats | None:
    """Normal of the plate; None without one, or beside solids."""
    plates = scene.plates
    return np.asarray(plates[0].frame[1][2]) if plates and not scene.solids else None
