"""Tables inside that of a plate: outline, materials, how edges are held, pressures on its faces."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from impactfem.scene.boundary import SURFACE, FormulaLike
from impactfem.scene.formula import Formula
from impactfem.scene.inline import InlineTable, ListOf, Vector
from impactfem.scene.kinds import Choice, FormulaOf, Real
from impactfem.scene.laminate import Ply
from impactfem.scene.schema import KeyedError, check_fields, key, table
from impactfem.scene.shapes import Block, Disc, Ring
from impactfem.scene.values import show

EDGE_SUPPORTS = dict.fromkeys(("clamped", "simply_supported", "soft_support", "free"), False)
"""Ways to hold an edge, and whether by springs."""
EDGE_SUPPORTS["elastic"] = True
_STAYS = dict.fromkeys(EDGE_SUPPORTS, True) | {"free": False, "elastic": False}
IN_PLANE = {"held": True, "free": False}
"""Whether an edge stays where it is in the plane."""
FACES: Mapping[str, float] = {"top": -1.0, "bottom": 1.0}
"""Which way along the normal a pressure on a face pushes."""


@table('outline = { kind = "rectangle" }')
@dataclass(frozen=True, kw_only=True)
class RectangleOutline:
    """A rectangle about the centre of the plate: edges left, right, bottom, top.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "rectangle"
    edges: ClassVar[tuple[str, ...]] = ("left", "right", "bottom", "top")

    size: Sequence[float] = key(Vector((2,), positive=True), "edges along x and y", unit="m")

    def __post_init__(self) -> None:
        check_fields(self, self.kind)

    @property
    def shape(self) -> Block:
        """The same as that of a solid."""
        a, b = self.size
        return Block(size=(a, b), corner=(-0.5 * a, -0.5 * b))

    @property
    def place(self) -> tuple[float, float]:
        """A corner [m]."""
        a, b = self.size
        return 0.5 * a, 0.5 * b

    @property
    def extent(self) -> tuple[float, float]:
        """Least and largest width [m]."""
        return min(self.size), max(self.size)


@table('outline = { kind = "disc" }')
@dataclass(frozen=True, kw_only=True)
class DiscOutline:
    """A disc about the centre of the plate: edge rim.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "disc"
    edges: ClassVar[tuple[str, ...]] = ("rim",)

    radius: float = key(Real(above=0), "radius", unit="m")

    def __post_init__(self) -> None:
        check_fields(self, self.kind)

    @property
    def shape(self) -> Disc:
        """The same as that of a solid."""
        return Disc(radius=self.radius)

    @property
    def place(self) -> tuple[float, float]:
        """A place on the rim [m]."""
        return self.radius, 0.0

    @property
    def extent(self) -> tuple[float, float]:
        """Least and largest width [m]."""
        return 2.0 * self.radius, 2.0 * self.radius


@table('outline = { kind = "ring" }')
@dataclass(frozen=True, kw_only=True)
class RingOutline:
    """A ring about the centre of the plate: edges outer, inner.

    Raises:
        SceneError: a value is not allowed.
    """

    kind: ClassVar[str] = "ring"
    edges: ClassVar[tuple[str, ...]] = ("outer", "inner")

    inner_radius: float = key(Real(above=0), "radius of the hole", unit="m")
    radius: float = key(Real(above=0), "outer radius", unit="m")

    def __post_init__(self) -> None:
        check_fields(self, self.kind)
        if not self.inner_radius < self.radius:
            text = f" = {self.inner_radius} is not below radius = {self.radius}: give a smaller "
            raise KeyedError(self.kind, "inner_radius", f"{text}one.")

    @property
    def shape(self) -> Ring:
        """The same as that of a solid."""
        return Ring(inner_radius=self.inner_radius, radius=self.radius)

    @property
    def place(self) -> tuple[float, float]:
        """A place on the rim [m]."""
        return self.radius, 0.0

    @property
    def extent(self) -> tuple[float, float]:
        """Least and largest width [m]."""
        return self.radius - self.inner_radius, 2.0 * self.radius


@table('outline = { kind = "polygon" }')
@dataclass(frozen=True, kw_only=True)
class PolygonOutline:
    """A polygon: edge_1 from the first point to the second, and so on.

    Raises:
        SceneError: a value is not allowed, or its edges cross.
    """

    kind: ClassVar[str] = "polygon"
    shape: ClassVar[None] = None

    points: Sequence[Sequence[float]] = key(
        ListOf(Vector((2,)), at_least=3), "corners in their order, from the centre", unit="m"
    )

    def __post_init__(self) -> None:
        check_fields(self, self.kind)
        corners = np.array(self.points)
        count = len(corners)
        if min(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)) == 0.0:
            text = f" = {show([list(p) for p in self.points])} has the same corner twice in a row: "
            raise KeyedError(self.kind, "points", f"{text}remove one.")
        for i in range(count):
            for j in range(i + 2, count):
                if (j + 1) % count != i and _cross(corners, i, j):
                    text = f" = {show([list(p) for p in self.points])}: edge_{i + 1} and "
                    text += f"edge_{j + 1} cross; give the corners in their order."
                    raise KeyedError(self.kind, "points", text)

    @property
    def edges(self) -> tuple[str, ...]:
        """Names of its edges."""
        return tuple(f"edge_{k + 1}" for k in range(len(self.points)))

    @property
    def corners(self) -> NDArray[np.float64]:
        """Its corners [m], (corners, 2)."""
        return np.array(self.points, dtype=np.float64)

    @property
    def signed_area(self) -> float:
        """[m^2], positive if its corners go round counter-clockwise."""
        x, y = self.corners.T
        return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))

    @property
    def place(self) -> tuple[float, float]:
        """A corner [m]."""
        x, y = self.points[0]
        return x, y

    @property
    def extent(self) -> tuple[float, float]:
        """Least and largest width [m], about."""
        width = float(np.ptp(self.corners, axis=0).max())
        return abs(self.signed_area) / width, width


def _cross(corners: NDArray[np.float64], i: int, j: int) -> bool:
    """Whether two edges meet that have no corner in common."""
    a, b = corners[i], corners[(i + 1) % len(corners)]
    c, d = corners[j], corners[(j + 1) % len(corners)]

    def side(p: NDArray[np.float64], q: NDArray[np.float64], r: NDArray[np.float64]) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    return side(a, b, c) * side(a, b, d) <= 0.0 and side(c, d, a) * side(c, d, b) <= 0.0


OUTLINES = (RectangleOutline, DiscOutline, RingOutline, PolygonOutline)


@table("orthotropic = { e1 = ... }")
@dataclass(frozen=True, kw_only=True)
class Orthotropic:
    """A material with other moduli along its axis 1 than along its axis 2.

    Raises:
        SceneError: a value is not allowed, or the material would give way without end.
    """

    e1: float = key(Real(above=0), "Young's modulus along axis 1", unit="Pa")
    e2: float = key(Real(above=0), "Young's modulus along axis 2", unit="Pa")
    nu12: float = key(Real(), "Poisson's ratio: pulled along 1 it narrows along 2 by so much")
    g12: float = key(Real(above=0), "shear modulus in the plane", unit="Pa")
    g13: float | None = key(
        Real(above=0), "shear modulus across it along axis 1", unit="Pa", default=None, absent="g12"
    )
    g23: float | None = key(
        Real(above=0), "shear modulus across it along axis 2", unit="Pa", default=None, absent="g12"
    )
    angle: float = key(
        Real(), "of axis 1 from the x axis of the plate, counter-clockwise", unit="rad", default=0.0
    )

    def __post_init__(self) -> None:
        check_fields(self, "orthotropic")
        if not self.nu12**2 < self.e1 / self.e2:
            text = (
                f" = {self.nu12:g} is no Poisson's ratio of e1 = {self.e1:g} and e2 = {self.e2:g}"
            )
            text += f": nu12^2 must be below e1/e2 = {self.e1 / self.e2:.4g}."
            raise KeyedError("orthotropic", "nu12", text)

    def ply(self, thickness: float, density: float, turned: float = 0.0) -> Ply:
        """A layer of it, turned by another angle [rad] besides."""
        shears = self.g12, self.g13 or self.g12, self.g23 or self.g12
        moduli, angle = (self.e1, self.e2), self.angle + turned
        return Ply.of(thickness, density, moduli, self.nu12, shears, angle)


@table("layers = [{ thickness = ... }]")
@dataclass(frozen=True, kw_only=True)
class Layer:
    """A layer of a plate.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    thickness: float = key(Real(above=0), "its own", unit="m")
    density: float = key(Real(above=0), "mass density", unit="kg/m^3")
    youngs_modulus: float | None = key(
        Real(above=0), "Young's modulus, or give orthotropic", unit="Pa", default=None,
        absent="none",
    )  # fmt: skip
    poisson_ratio: float | None = key(
        Real(above=-1, below=0.5), "Poisson's ratio, or give orthotropic", default=None,
        absent="none",
    )  # fmt: skip
    orthotropic: Orthotropic | None = key(  # noqa: RUF009  # a field
        InlineTable((Orthotropic,)), "its moduli instead", default=None, absent="none"
    )
    angle: float = key(
        Real(), "by which its axes are turned besides, counter-clockwise", unit="rad", default=0.0
    )

    def __post_init__(self) -> None:
        check_fields(self, "layer")
        check_moduli(self, "layer")
        if self.angle and self.orthotropic is None:
            text = f" = {self.angle:g} turns nothing: the layer is alike in all directions; remove "
            raise KeyedError("layer", "angle", f"{text}it, or give orthotropic.")

    @property
    def ply(self) -> Ply:
        """It as the cross-section takes it."""
        return ply_of(self, self.thickness, self.density, self.angle)


def check_moduli(owner: Any, where: str) -> None:
    """Refuse a material without moduli, or with two sets of them.

    Raises:
        KeyedError: naming the key.
    """
    for name in ("youngs_modulus", "poisson_ratio"):
        value = getattr(owner, name)
        if owner.orthotropic is None and value is None:
            raise KeyedError(where, name, " is missing: give it, or orthotropic.")
        if owner.orthotropic is not None and value is not None:
            text = f" = {value:g} contradicts orthotropic, which has its own: remove one of them."
            raise KeyedError(where, name, text)


def ply_of(material: Any, thickness: float, density: float, turned: float = 0.0) -> Ply:
    """A layer of a material that has moduli (`check_moduli`)."""
    if material.orthotropic is not None:
        own: Orthotropic = material.orthotropic
        return own.ply(thickness, density, turned)
    return Ply.isotropic(thickness, density, material.youngs_modulus, material.poisson_ratio)


@table("supports = [{ edge = ... }]")
@dataclass(frozen=True, kw_only=True)
class EdgeSupport:
    """How an edge of a plate is held.

    Raises:
        SceneError: a value is not allowed.
    """

    edge: str = key(SURFACE, "name of an edge of the outline, or of the mesh file")
    kind: str = key(
        Choice(tuple(EDGE_SUPPORTS)),
        "clamped: neither moves nor turns; simply_supported (hard): does not move, nor turn in "
        "its own direction; soft_support: does not move; free; elastic: on springs along it",
    )
    stiffness: float = key(
        Real(at_least=0), "of an elastic one to deflection, by its length", unit="N/m^2",
        default=0.0,
    )  # fmt: skip
    rotational_stiffness: float = key(
        Real(at_least=0), "of an elastic one to rotation about it, by its length", unit="N",
        default=0.0,
    )  # fmt: skip
    in_plane: str | None = key(
        Choice(tuple(IN_PLANE)), "whether it moves in the plane of a plate that stretches",
        default=None, absent="held where it does not move along the normal",
    )  # fmt: skip

    if TYPE_CHECKING:

        def __init__(
            self,
            *,
            edge: str,
            kind: str,
            stiffness: float = 0.0,
            rotational_stiffness: float = 0.0,
            in_plane: str | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, "support")
        springs = {name: getattr(self, name) for name in ("stiffness", "rotational_stiffness")}
        if EDGE_SUPPORTS[self.kind]:
            if not any(springs.values()):
                text = (
                    ' is 0 of an elastic edge: give it, or rotational_stiffness, or kind = "free".'
                )
                raise KeyedError("support", "stiffness", text)
            return
        for name, value in springs.items():
            if value:
                text = f' = {value:g} is for elastic edges: give kind = "elastic", or remove it.'
                raise KeyedError("support", name, text)

    @property
    def stays(self) -> bool:
        """Whether it does not move in the plane of the plate."""
        if self.in_plane is not None:
            return IN_PLANE[self.in_plane]
        return _STAYS[self.kind]


@table("pressures = [{ face = ... }]")
@dataclass(frozen=True, kw_only=True)
class FacePressure:
    """A pressure on a face of a plate; the top is where the normal points.

    Raises:
        SceneError: a value is not allowed.
    """

    face: str = key(Choice(tuple(FACES)), "on which face it pushes")
    value: Formula = key(  # noqa: RUF009  # a field
        FormulaOf(("x", "y", "t", "gap")),
        "pressure; x and y in the plate, from its centre; gap from the face to the obstacle there, "
        "0 where it lies in it",
        unit="Pa",
    )

    if TYPE_CHECKING:

        def __init__(self, *, face: str, value: FormulaLike) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, "pressure")
