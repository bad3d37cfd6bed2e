"""A rigid surface from a file."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from impactfem.scene.closed_surface import ClosedSurface
from impactfem.scene.formula import Formula
from impactfem.scene.kinds import Choice, FilePath, Name, Real
from impactfem.scene.obstacles.base import (
    MOTION,
    MOTION_KIND,
    NAME,
    SIDE,
    SIDES,
    Field,
    Floats,
    Motion,
    RigidObstacle,
)
from impactfem.scene.obstacles.mirror import Mirror
from impactfem.scene.obstacles.rotation import ROTATION, ROTATION_KIND, Rotation
from impactfem.scene.schema import KeyedError, check_fields, key, table
from impactfem.scene.surface_files import MESH_SIZE, SCALE, SURFACE_FILES, closed_surface
from impactfem.scene.values import show

if TYPE_CHECKING:
    from collections.abc import Mapping


@table('[[obstacle]] with kind = "mesh"')
@dataclass(frozen=True, kw_only=True)
class RigidMesh(RigidObstacle):
    """A closed surface of triangles from a file, in space.

    Raises:
        SceneError: a value is not allowed; in a scene also: the file cannot be read, or its surface
            is none of a body.
    """

    kind: ClassVar[str] = "mesh"
    is_smooth: ClassVar[bool] = False

    name: str = key(Name(), NAME, default="mesh")
    mesh: str = key(FilePath(endings=SURFACE_FILES), "file of its surface")
    scale: float = key(Real(above=0), SCALE, unit="m", default=1.0)
    mesh_size: float | None = key(
        Real(above=0), MESH_SIZE, unit="m", default=None, absent="by the file"
    )
    side: str = key(Choice(SIDES), SIDE, default="outside")
    motion: tuple[Formula, ...] | None = key(
        MOTION_KIND, MOTION, unit="m", default=None, absent="at rest"
    )
    rotation: Rotation | None = key(  # noqa: RUF009  # a field
        ROTATION_KIND, ROTATION, default=None, absent="none"
    )
    folder: Path | None = field(default=None, compare=False, repr=False)

    if TYPE_CHECKING:

        def __init__(
            self,
            *,
            mesh: str | Path,
            scale: float = 1.0,
            mesh_size: float | None = None,
            side: str = "outside",
            name: str = "mesh",
            motion: Motion | None = None,
            rotation: Rotation | Mapping[str, Any] | None = None,
            folder: Path | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, self.kind)

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
