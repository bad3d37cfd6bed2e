"""A rigid surface from a file."""

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.closed_surface import ClosedSurface
from impactfem.scene.given import Given, MaybeFormulas, MaybeTable
from impactfem.scene.kinds import Choice, FilePath, Line, Name, Real
from impactfem.scene.mesh_files import PART
from impactfem.scene.obstacles.base import (
    MOTION,
    MOTION_KIND,
    NAME,
    SIDE,
    SIDES,
    Field,
    RigidObstacle,
)
from impactfem.scene.obstacles.mirror import Mirror
from impactfem.scene.obstacles.rotation import ROTATION, ROTATION_KIND, Rotation
from impactfem.scene.schema import KeyedError, aside, key, table
from impactfem.scene.surface_files import MESH_SIZE, SCALE, SURFACE_FILES, closed_surface
from impactfem.scene.values import show


@table('[[obstacle]] with kind = "mesh"')
class RigidMesh(RigidObstacle):
    """A closed surface of triangles from a file, in space.

    Raises:
        SceneError: a value is not allowed; in a scene also: the file cannot be read, or its surface
            is none of a body.
    """

    kind: ClassVar[str] = "mesh"
    is_smooth: ClassVar[bool] = False

    name: str = key(Name(), NAME, default="mesh")
    mesh: Given[str, Path] = key(FilePath(endings=SURFACE_FILES), "file of its surface")
    part: str | None = key(Line(), PART, default=None, absent="all of them")
    scale: float = key(Real(above=0), SCALE, unit="m", default=1.0)
    mesh_size: float | None = key(
        Real(above=0), MESH_SIZE, unit="m", default=None, absent="by the file"
    )
    side: str = key(Choice(SIDES), SIDE, default="outside")
    motion: MaybeFormulas = key(MOTION_KIND, MOTION, unit="m", default=None, absent="at rest")
    rotation: MaybeTable[Rotation] = key(ROTATION_KIND, ROTATION, default=None, absent="none")
    folder: Path | None = aside()

    def opened(self, folder: Path) -> Self:
        """The same with its file read, whose relative path starts at a folder.

        Raises:
            KeyedError: The file cannot be read, or its surface is none of a body.
        """
        found = replace(self, folder=folder)
        found.surface  # noqa: B018  (reads it)
        return found

    @cached_property
    def surface(self) -> ClosedSurface:
        """Its surface at rest, whose triangles look to the side of the body."""
        found = closed_surface(self, 3)
        return found.reversed() if self.side == "inside" else found

    def check_dimension(self, dim: int) -> None:
        """As for all obstacles; a mesh is for bodies in space."""
        if dim != 3:
            text = f" = {show(self.kind)} is for bodies in space: in the plane give a polyline."
            raise KeyedError(self.kind, "kind", text)
        super().check_dimension(dim)

    @property
    def features(self) -> float:
        """Its shortest edge [m]."""
        corners = self.surface.corners
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).min())

    @property
    def rims(self) -> Floats:
        """Sides of its triangles [m], (sides, 2, 3)."""
        ends = np.stack([self.surface.simplices, np.roll(self.surface.simplices, -1, axis=1)], 2)
        return self.surface.points[ends[ends[:, :, 0] < ends[:, :, 1]]]

    def gap(self, points: Floats) -> Field:
        """Distances (points,) and normals (points, 3) at rest."""
        return self.surface.gap(points)

    def other_gap(self, points: Floats) -> Field:
        """Distances from the nearest face that looks elsewhere, as in a corner that bends inwards.

        Infinite where there is none.
        """
        return self.surface.gap(points, self.surface.gap(points))

    def is_image(self, other: Self, mirror: Mirror) -> bool:  # noqa: ARG002  (as the interface has it)
        """Never: symmetries of files are not looked for."""
        return False

    def faces(self, centre: Floats, reach: float) -> Floats:  # noqa: ARG002  (it ends)
        """Triangles (faces, 3, 3) whose normals point to the side of the body, at rest."""
        return self.surface.corners
