"""A rigid surface from a file."""

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.closed_surface import ClosedSurface
from impactfem.scene.given import Given, MaybeFormulas, MaybeTable
from impactfem.scene.height_fields import HEIGHT_FILES, height_field
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
    """A surface of triangles from a file, in space: closed, or open as terrain.

    Bodies stay on the side where the normals of an open one look: by the right hand, its triangles
    turn left seen from there. Heights give such a surface over x and y.

    Raises:
        SceneError: a value is not allowed; in a scene also: the file cannot be read, or its surface
            is none of a body or terrain.
    """

    kind: ClassVar[str] = "mesh"
    is_smooth: ClassVar[bool] = False

    name: str = key(Name(), NAME, default="mesh")
    mesh: Given[str | None, Path] = key(
        FilePath(endings=SURFACE_FILES),
        "file of its surface: a closed one, or an open one as terrain, which is outside where the "
        "normals of its triangles look",
        default=None, absent="none",
    )  # fmt: skip
    heights: Given[str | None, Path] = key(
        FilePath(endings=HEIGHT_FILES),
        "instead of it a table of heights [m] along z: entries of a row lie along x, rows along y, "
        "the first one at x = y = 0",
        default=None, absent="none",
    )  # fmt: skip
    spacing: float | None = key(
        Real(above=0), "between neighbouring heights", unit="m", default=None,
        absent="required with heights",
    )  # fmt: skip
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

    def _check(self) -> None:
        given = [name for name in ("mesh", "heights") if getattr(self, name)]
        if len(given) != 1:
            text = ": both are given; give one." if given else " is missing: give it, or heights."
            raise KeyedError(self.kind, "mesh", text)
        if (self.heights is None) != (self.spacing is None):
            text = " is missing: give the way between neighbouring heights in m."
            if self.spacing is not None:
                text = f" = {self.spacing:g} is for heights; remove it."
            raise KeyedError(self.kind, "spacing", text)
        for name, usual in (("scale", 1.0), ("mesh_size", None), ("part", None)):
            if self.heights is not None and (value := getattr(self, name)) != usual:
                text = f" = {show(value)} is for mesh, and heights are given: remove it."
                raise KeyedError(self.kind, name, text)

    @cached_property
    def surface(self) -> ClosedSurface:
        """Its surface at rest, whose triangles look to the side of the body."""
        known = self.heights is None
        found = closed_surface(self, 3, may_end=True) if known else height_field(self)
        return found.reversed() if self.side == "inside" else found

    def check_dimension(self, dim: int) -> None:
        """As for all obstacles; a mesh is for bodies in space."""
        if dim != 3:
            text = f" = {show(self.kind)} is for bodies in space: in the plane give a polyline."
            raise KeyedError(self.kind, "kind", text)
        super().check_dimension(dim)

    def meets_sides(self, body: object) -> bool:
        """All of them."""
        return bool(getattr(body, "dim", 3) == 3)

    @property
    def features(self) -> float:
        """Its shortest edge [m]."""
        corners = self.surface.corners
        return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).min())

    @property
    def rims(self) -> Floats:
        """Sides of its triangles [m], (sides, 2, 3)."""
        ends = np.stack([self.surface.simplices, np.roll(self.surface.simplices, -1, axis=1)], 2)
        once = (ends[:, :, 0] < ends[:, :, 1]) | (self.surface.beside < 0)
        return self.surface.points[ends[once]]

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
