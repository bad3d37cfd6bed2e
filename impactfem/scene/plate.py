"""Elastic plates."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from impactfem.scene.body import BodyKind, Floats, Solver
from impactfem.scene.formula import Formula
from impactfem.scene.inline import InlineTable, ListOf, Vector
from impactfem.scene.kinds import Choice, FilePath, FormulaOf, Name, Real
from impactfem.scene.plate_keys import (
    OUTLINES,
    DiscOutline,
    EdgeSupport,
    FacePressure,
    PolygonOutline,
    RectangleOutline,
    RingOutline,
)
from impactfem.scene.schema import KeyedError, check_fields, key, table
from impactfem.scene.solid_keys import MESH_FILES
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.scene.boundary import FormulaLike

THIN, SHEARING = "kirchhoff", "reissner_mindlin"
THEORIES = {THIN: 0.0, SHEARING: 5.0 / 6.0}
"""Theories by their shear correction factor; 0 of that without shear."""
_THICK = {None: 0.2, THIN: 0.1, SHEARING: 0.2}
"""Thickness by the least width from which on a theory is refused."""
_SHEARS = 0.05  # the same from which on shear counts, unless theory says so


@table('[[body]] with kind = "plate"')
@dataclass(frozen=True, kw_only=True)
class Plate(BodyKind):
    """An elastic plate that bends, by Kirchhoff or by Reissner and Mindlin; small deflections.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    kind: ClassVar[str] = "plate"
    solvers: ClassVar[tuple[Solver, Solver]] = ("march", "march")
    dim: ClassVar[int] = 3
    waves: ClassVar[bool] = True
    may_meet_nothing: ClassVar[bool] = True
    substeps: ClassVar[bool] = False
    balls_only: ClassVar[bool] = True
    dents: ClassVar[bool] = True
    rubs: ClassVar[bool] = False
    meshed: ClassVar[bool] = True
    mesh_dim: ClassVar[int] = 2

    name: str = key(Name(), "name of the plate in histories", default="plate")
    outline: RectangleOutline | DiscOutline | RingOutline | PolygonOutline | None = key(  # noqa: RUF009
        InlineTable(OUTLINES), "outline of the mid-surface, or give mesh", default=None,
        absent="none",
    )  # fmt: skip
    mesh: str | None = key(
        FilePath(endings=MESH_FILES),
        "mesh or geometry file of triangles in x and y instead; its physical names are the edges",
        default=None, absent="none",
    )  # fmt: skip
    mesh_size: float | None = key(
        Real(above=0), "size of elements; required with an outline or a STEP file", unit="m",
        default=None, absent="by the mesh file",
    )  # fmt: skip
    thickness: float = key(Real(above=0), "thickness", unit="m")
    center: Sequence[float] = key(
        Vector((3,)), "where x = y = 0 of the outline lies", unit="m", default=(0.0, 0.0, 0.0)
    )
    normal: Sequence[float] = key(
        Vector((3,), nonzero=True), "direction from the bottom to the top face, of any length",
        default=(0.0, 0.0, 1.0),
    )  # fmt: skip
    angle: float = key(
        Real(), "by which the outline is turned about the normal, counter-clockwise seen from it",
        unit="rad", default=0.0,
    )  # fmt: skip
    density: float = key(Real(above=0), "mass density", unit="kg/m^3")
    youngs_modulus: float = key(Real(above=0), "Young's modulus", unit="Pa")
    poisson_ratio: float = key(Real(above=-1, below=0.5), "Poisson's ratio")
    rayleigh_mass: float = key(
        Real(at_least=0), "damping by the mass: speeds fall at this rate", unit="1/s", default=0.0
    )
    theory: str | None = key(
        Choice(tuple(THEORIES)), "thin, or thick with shear and rotary inertia",
        default=None, absent="with shear from a twentieth of the width, but beside balls",
    )  # fmt: skip
    velocity: Formula = key(  # noqa: RUF009  # a field
        FormulaOf(("x", "y")), "at t = 0 along the normal", unit="m/s", default=0.0
    )
    displacement: Formula = key(  # noqa: RUF009  # a field
        FormulaOf(("x", "y")), "at t = 0 along the normal; its slopes follow", unit="m", default=0.0
    )
    supports: tuple[EdgeSupport, ...] = key(
        ListOf(InlineTable((EdgeSupport,))), "edges that are held", default=()
    )
    pressures: tuple[FacePressure, ...] = key(
        ListOf(InlineTable((FacePressure,))), "pressures on its faces", default=()
    )

    if TYPE_CHECKING:  # type checkers learn what else may be given

        def __init__(
            self,
            *,
            thickness: float,
            density: float,
            youngs_modulus: float,
            poisson_ratio: float,
            name: str = "plate",
            outline: Any = None,
            mesh: str | None = None,
            mesh_size: float | None = None,
            center: Sequence[float] = (0.0, 0.0, 0.0),
            normal: Sequence[float] = (0.0, 0.0, 1.0),
            angle: float = 0.0,
            rayleigh_mass: float = 0.0,
            theory: str | None = None,
            velocity: "FormulaLike" = 0.0,
            displacement: "FormulaLike" = 0.0,
            supports: Sequence[EdgeSupport | Mapping[str, Any]] = (),
            pressures: Sequence[FacePressure | Mapping[str, Any]] = (),
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, self.kind)
        if (self.outline is None) == (self.mesh is None):
            given = "neither is" if self.mesh is None else "both are"
            raise KeyedError(self.kind, "outline", f": {given} given; give outline, or mesh.")
        if self.outline is None:
            return
        least, largest = self.outline.extent
        if self.mesh_size is None:
            raise KeyedError(self.kind, "mesh_size", " is missing: give the size of elements.")
        if self.mesh_size > largest:
            raise self._fail("mesh_size", f"exceeds the width {largest:.6g} m: give a smaller one.")
        if self.thickness > _THICK[self.theory] * least:
            text = f"is more than {_THICK[self.theory]:g} of the least width {least:.6g} m: "
            text += "too thick for theory = " + show(self.theory or SHEARING)
            text += '; use kind = "solid", or check units.'
            raise self._fail("thickness", text)
        for index, support in enumerate(self.supports):
            if support.edge not in self.outline.edges:
                text = f" = {show(support.edge)} is no edge: give "
                text += f"{' or '.join(self.outline.edges)}."
                raise KeyedError(self.kind, f"supports[{index}].edge", text)

    def _fail(self, name: str, text: str) -> KeyedError:
        return KeyedError(self.kind, name, f" = {show(getattr(self, name))} {text}")

    def with_elements(self, factor: float) -> Self:
        """The same with elements so many times as large, of one that has a `mesh_size`."""
        return replace(self, mesh_size=factor * (self.mesh_size or 0.0))

    @property
    def least_width(self) -> float:
        """Of its outline [m]; infinite if a file knows it."""
        return float("inf") if self.outline is None else self.outline.extent[0]

    @property
    def rigidity(self) -> float:
        """D = E t^3 / (12 (1 - nu^2)) [N m]."""
        across = 12.0 * (1.0 - self.poisson_ratio) * (1.0 + self.poisson_ratio)
        return self.youngs_modulus * self.thickness**3 / across

    def theory_beside(self, bodies: Sequence[Any]) -> str:
        """Its theory beside others, all bodies of its scene; see `theory`."""
        thick = self.thickness > _SHEARS * self.least_width
        struck = any(body.is_ball for body in bodies)
        return self.theory or (SHEARING if thick and not struck else THIN)

    def shear_beside(self, bodies: Sequence[Any]) -> float:
        """D over the stiffness to shear [m^2]; 0 without shear."""
        factor = THEORIES[self.theory_beside(bodies)]
        return self.thickness**2 / (6.0 * factor * (1.0 - self.poisson_ratio)) if factor else 0.0

    def check_beside(self, bodies: Sequence[Any]) -> None:
        """Refuse points and balls on a plate that shears: there they would sink in without end.

        Raises:
            KeyedError: There are some.
        """
        balls = [body.name for body in bodies if body.is_ball]
        if balls and THEORIES.get(self.theory or ""):
            text = f" = {show(self.theory)}: {balls[0]} would press on a single place, which gives "
            text += 'way to shear the more the smaller elements are; give theory = "kirchhoff".'
            raise KeyedError("", "theory", text)

    @property
    def rayleigh_damping(self) -> tuple[float, float]:
        """By mass [1/s] and stiffness [s]."""
        return self.rayleigh_mass, 0.0

    @property
    def frame(self) -> tuple[Floats, Floats]:
        """Its centre [m], (3,), and unit vectors along its x, y and normal, (3, 3) by rows.

        With `angle` 0 its x axis is that of space, put onto the plane; where the normal lies along
        that, the y axis of space is.
        """
        normal = np.asarray(self.normal, dtype=np.float64)
        normal = normal / np.linalg.norm(normal)
        along = np.eye(3)[int(abs(normal[0]) > 1.0 - 1e-9)]
        x = along - (along @ normal) * normal
        x = x / np.linalg.norm(x)
        y = np.cross(normal, x)
        cosine, sine = math.cos(self.angle), math.sin(self.angle)
        axes = np.array([cosine * x + sine * y, cosine * y - sine * x, normal])
        return np.asarray(self.center, dtype=np.float64), axes + 0.0

    def centre_velocity(self) -> Floats | None:
        """Velocity at t = 0 [m/s], (3,); None if it varies, or edges are held."""
        if not self.velocity.is_constant or self.supports:
            return None
        return np.asarray(float(self.velocity()) * self.frame[1][2])
