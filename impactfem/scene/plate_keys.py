"""Tables inside that of a plate: materials, how edges are held, pressures on its faces."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.boundary import SURFACE, check_sprung, until_key
from impactfem.scene.formula import Formula
from impactfem.scene.given import AFormula, FormulaOrSome, MaybeTable
from impactfem.scene.inline import FormulaOrFormulas, InlineTable
from impactfem.scene.kinds import Choice, FormulaOf, Real
from impactfem.scene.laminate import Ply
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

EDGE_SUPPORTS = dict.fromkeys(("clamped", "simply_supported", "soft_support", "free"), False)
"""Ways to hold an edge, and whether by springs."""
EDGE_SUPPORTS["elastic"] = True
_STAYS = dict.fromkeys(EDGE_SUPPORTS, True) | {"free": False, "elastic": False}
IN_PLANE = {"held": True, "free": False}
"""Whether an edge stays where it is in the plane."""
FACES: Mapping[str, float] = {"top": -1.0, "bottom": 1.0}
"""Which way along the normal a pressure on a face pushes."""


@table("orthotropic = { e1 = ... }")
class Orthotropic:
    """A material with other moduli along its axis 1 than along its axis 2.

    Raises:
        SceneError: a value is not allowed, or the material would give way without end.
    """

    heading: ClassVar[str] = "orthotropic"

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

    def _check(self) -> None:
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
class Layer:
    """A layer of a plate.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "layer"

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
    orthotropic: MaybeTable[Orthotropic] = key(
        InlineTable((Orthotropic,)), "its moduli instead", default=None, absent="none"
    )
    angle: float = key(
        Real(), "by which its axes are turned besides, counter-clockwise", unit="rad", default=0.0
    )

    def _check(self) -> None:
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
class EdgeSupport:
    """How an edge of a plate is held.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "support"

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
    motion: FormulaOrSome = key(
        FormulaOrFormulas(("t",)),
        "displacement of an edge that is held: a formula along the normal, or three along the axes "
        "of the scene, of which that along the normal counts",
        unit="m", default=None, absent="none",
    )  # fmt: skip

    def _check(self) -> None:
        check_sprung(self, "edge", sprung=EDGE_SUPPORTS[self.kind])
        if self.motion is not None and not _STAYS[self.kind]:
            text = f' moves an edge that is {self.kind}: give kind = "clamped", "simply_supported" '
            raise KeyedError(self.heading, "motion", f'{text}or "soft_support", or remove it.')

    def led(self, normal: Floats) -> Formula | None:
        """Displacement along the normal of a plate in t [m]; None if there is none.

        Raises:
            KeyedError: It moves in the plane too.
        """
        if self.motion is None or isinstance(self.motion, Formula):
            return self.motion
        at = int(np.abs(normal).argmax())
        beside = [u for k, u in enumerate(self.motion) if k != at and (u.used or u())]
        if len(self.motion) != 3 or beside or abs(normal[at]) < 1.0 - 1e-12:
            text = f" = {show([u.plain for u in self.motion])}: plates move along their normal "
            text += "alone; give one formula, along it."
            raise KeyedError(self.heading, "motion", text)
        along = self.motion[at]
        return along if normal[at] > 0.0 else Formula(f"-({along.text})", ("t",))

    @property
    def stays(self) -> bool:
        """Whether it does not move in the plane of the plate."""
        if self.in_plane is not None:
            return IN_PLANE[self.in_plane]
        return _STAYS[self.kind]


@table("pressures = [{ face = ... }]")
class FacePressure:
    """A pressure on a face of a plate; the top is where the normal points.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "pressure"

    face: str = key(Choice(tuple(FACES)), "on which face it pushes")
    value: AFormula = key(
        FormulaOf(("x", "y", "t", "gap")),
        "pressure; x and y in the plate, from its centre; gap from the face to the obstacle there, "
        "0 where it lies in it",
        unit="Pa",
    )
    until: float | None = until_key("it ends")

    @property
    def acting(self) -> Formula:
        """Its value up to its end, and 0 after it [Pa]."""
        return self.value.until(self.until)
