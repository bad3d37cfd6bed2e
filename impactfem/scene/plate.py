"""Elastic plates."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.body import BodyKind, Solver
from impactfem.scene.damping import MOST_RATIOS, QUALITY, Damping, fill_damping, filled_keys
from impactfem.scene.flight import Flight
from impactfem.scene.formula import Formula
from impactfem.scene.given import AFormula, Given, MaybeFormula, MaybeTable, Tables
from impactfem.scene.inline import InlineTable, ListOf, NumberOrList, Vector
from impactfem.scene.kinds import Choice, FilePath, FormulaOf, Name, Real
from impactfem.scene.laminate import Section
from impactfem.scene.mesh_files import MESH_FILES
from impactfem.scene.plate_keys import (
    EdgeSupport,
    FacePressure,
    Layer,
    Orthotropic,
    check_moduli,
    ply_of,
)
from impactfem.scene.plate_outlines import OUTLINES, AnyOutline, PolygonOutline
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

THIN, SHEARING = "kirchhoff", "reissner_mindlin"
THEORIES = {THIN: False, SHEARING: True}
"""Whether plates shear, by their theory."""
SHOWN = {"mid_surface": False, "filled": True}
"""What field files show, and whether that is all between the faces."""
MEMBRANES = {"none": False, "von_karman": True}
"""Whether the middle stretches, by moderate rotations."""
_THICK = {None: 0.2, THIN: 0.1, SHEARING: 0.2}
"""Thickness by the least width from which on a theory is refused."""
_COUPLED = 1e-6  # share of the bending stiffness from which on layers stretch as they bend
_SHEARS = 0.05  # the same from which on shear counts, unless theory says so


@table('[[body]] with kind = "plate"')
class Plate(BodyKind):
    """An elastic plate that bends, by Kirchhoff or by Reissner and Mindlin; small deflections.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    kind: ClassVar[str] = "plate"
    solvers: ClassVar[tuple[Solver, Solver]] = ("march", "march")
    dim: ClassVar[int] = 3
    waves: ClassVar[bool] = True
    in_elements: ClassVar[bool] = True
    may_meet_nothing: ClassVar[bool] = True
    settles: ClassVar[bool] = True
    has_surface: ClassVar[bool] = True
    meets_edges: ClassVar[bool] = True
    dents: ClassVar[bool] = True
    lined: ClassVar[bool] = True
    meshed: ClassVar[bool] = True
    takes_joints: ClassVar[bool] = True
    parts_in_joints: ClassVar[str] = "regions"
    damped_by_modes: ClassVar[bool] = True
    mesh_dim: ClassVar[int] = 2

    name: str = key(Name(), "name of the plate in histories", default="plate")
    outline: MaybeTable[AnyOutline] = key(
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
    thickness: MaybeFormula = key(
        FormulaOf(("x", "y")), "thickness about the mid-surface", unit="m", default=None,
        absent="that of the layers",
    )  # fmt: skip
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
    density: float | None = key(
        Real(above=0), "mass density", unit="kg/m^3", default=None, absent="those of the layers"
    )
    youngs_modulus: float | None = key(
        Real(above=0), "Young's modulus, or give orthotropic or layers", unit="Pa", default=None,
        absent="none",
    )  # fmt: skip
    poisson_ratio: float | None = key(
        Real(above=-1, below=0.5), "Poisson's ratio, or give orthotropic or layers", default=None,
        absent="none",
    )  # fmt: skip
    orthotropic: MaybeTable[Orthotropic] = key(
        InlineTable((Orthotropic,)), "moduli along two axes instead", default=None, absent="none"
    )
    layers: Tables[Layer] = key(
        ListOf(InlineTable((Layer,))), "layers of other materials, from the bottom to the top face",
        default=(),
    )  # fmt: skip
    residual_stress: float = key(
        Real(), "tension in the plate at rest, alike in all directions", unit="Pa", default=0.0
    )
    rayleigh_mass: float = key(
        Real(at_least=0), "damping by the mass: speeds fall at this rate", unit="1/s", default=0.0
    )
    rayleigh_stiffness: float = key(
        Real(at_least=0), "damping by the stiffness of small deflections", unit="s", default=0.0
    )
    damping_ratio: Given[Sequence[float] | None, float] = key(
        NumberOrList(Real(at_least=0, below=1), MOST_RATIOS),
        "damping of the first modes of vibration over the critical one, a number or a list; modes "
        "beyond are damped by the stiffness, at the last ratio where the list ends",
        default=None, absent="0",
    )  # fmt: skip
    quality_factor: float | None = key(Real(above=0), QUALITY, default=None, absent="none")
    damping: MaybeTable[Damping] = key(
        InlineTable((Damping,)), "the same in one table", default=None, absent="none"
    )
    theory: str | None = key(
        Choice(tuple(THEORIES)), "thin, or thick with shear and rotary inertia",
        default=None, absent="with shear from a twentieth of the width, but beside balls",
    )  # fmt: skip
    patch_radius: float | None = key(
        Real(above=0),
        "over which forces of bodies act that touch at single places, by a Gaussian with this "
        "standard deviation; a plate that shears needs it",
        unit="m", default=None, absent="single places",
    )  # fmt: skip
    membrane: str = key(
        Choice(tuple(MEMBRANES)), "whether its middle stretches as it bends", default="none"
    )
    shown: str = key(
        Choice(tuple(SHOWN)), "what field files show: its mid-surface with stresses of both faces, "
        "or all between them", default="mid_surface",
    )  # fmt: skip
    velocity: AFormula = key(
        FormulaOf(("x", "y")), "at t = 0 along the normal", unit="m/s", default=0.0
    )
    displacement: AFormula = key(
        FormulaOf(("x", "y")), "at t = 0 along the normal; its slopes follow", unit="m", default=0.0
    )
    supports: Tables[EdgeSupport] = key(
        ListOf(InlineTable((EdgeSupport,))), "edges that are held", default=()
    )
    pressures: Tables[FacePressure] = key(
        ListOf(InlineTable((FacePressure,))), "pressures on its faces", default=()
    )

    def _check(self) -> None:
        self._check_material()
        self._check_membrane()
        self._check_motions()
        if self.damping or self.quality_factor or self.damping_ratio:
            fill_damping(self)
        if (self.outline is None) == (self.mesh is None):
            given = "neither is" if self.mesh is None else "both are"
            raise KeyedError(self.kind, "outline", f": {given} given; give outline, or mesh.")
        if self.outline is None:
            return
        _, largest = self.outline.extent
        if self.mesh_size is None:
            raise KeyedError(self.kind, "mesh_size", " is missing: give the size of elements.")
        if self.mesh_size > largest:
            raise self._fail("mesh_size", f"exceeds the width {largest:.6g} m: give a smaller one.")
        self.check_thickness(self.depth)
        for index, support in enumerate(self.supports):
            if support.edge not in self.outline.edges:
                text = f" = {show(support.edge)} is no edge: give "
                text += f"{' or '.join(self.outline.edges)}."
                raise KeyedError(self.kind, f"supports[{index}].edge", text)

    def _check_material(self) -> None:
        """Refuse a plate without material, or with two."""
        if not self.layers:
            for name in ("thickness", "density"):
                if getattr(self, name) is None:
                    raise KeyedError(self.kind, name, " is missing: give it, or layers.")
            check_moduli(self, self.kind)
            if not self.depth > 0.0:
                raise self._fail("thickness", "is not above 0: give the thickness of the plate.")
            return
        for name in ("density", "youngs_modulus", "poisson_ratio", "orthotropic"):
            if getattr(self, name) is not None:
                text = " contradicts layers, which have their own: remove one of them."
                raise KeyedError(self.kind, name, text)
        total = self.section.thickness
        if self.thickness is not None and not (
            self.thickness.is_constant and math.isclose(self.depth, total, rel_tol=1e-9)
        ):
            text = f" = {show(self.thickness.plain)} is not the sum of the layers, {total:.9g} m: "
            raise KeyedError(self.kind, "thickness", f"{text}remove it, or change them.")

    def _check_membrane(self) -> None:
        """Refuse what only plates that stretch know, and what these do not."""
        if not self.stretches:
            for index, support in enumerate(self.supports):
                if support.in_plane is not None:
                    text = f" = {show(support.in_plane)}: the plate does not stretch; give "
                    text += 'membrane = "von_karman", or remove it.'
                    raise KeyedError(self.kind, f"supports[{index}].in_plane", text)
            return
        if self.section.coupled > _COUPLED:
            text = f" = {show(self.membrane)}: bending stretches these layers by itself; take "
            text += 'layers that are symmetric about the middle, or membrane = "none".'
            raise KeyedError(self.kind, "membrane", text)

    def _check_motions(self) -> None:
        """Refuse motions in its plane."""
        for index, support in enumerate(self.supports):
            try:
                support.led(self.frame[1][2])
            except KeyedError as error:
                raise KeyedError(self.kind, f"supports[{index}].motion", error.text) from None

    def check_thickness(self, thickness: float) -> None:
        """Refuse a plate that is too thick for its theory somewhere [m].

        Raises:
            KeyedError: It is.
        """
        if thickness > (most := _THICK[self.theory]) * self.least_width:
            given = self.thickness
            text = f" = {thickness:.6g}" if given is None else f" = {show(given.plain)}"
            varies = given is not None and not given.is_constant
            text += f", up to {thickness:.6g} m," if varies else ""
            text += f" is more than {most:g} of the least width "
            text += f"{self.least_width:.6g} m: too thick for theory = "
            text += show(self.theory or SHEARING) + '; use kind = "solid", or check units.'
            raise KeyedError(self.kind, "thickness", text)

    def _fail(self, name: str, text: str) -> KeyedError:
        value = getattr(self, name)
        shown = show(value.plain if isinstance(value, Formula) else value)
        return KeyedError(self.kind, name, f" = {shown} {text}")

    def with_elements(self, factor: float) -> Self:
        """The same with elements so many times as large, of one that has a `mesh_size`."""
        return replace(self, mesh_size=factor * (self.mesh_size or 0.0))

    @property
    def stretches(self) -> bool:
        """Whether its middle does as it bends."""
        return MEMBRANES[self.membrane]

    @property
    def is_filled(self) -> bool:
        """Whether files show all that is between its faces."""
        return SHOWN[self.shown]

    @property
    def why_iterated(self) -> str:
        """Forces of its middle go by the square of slopes."""
        return f"has membrane = {show(self.membrane)}" if self.stretches else ""

    @property
    def least_width(self) -> float:
        """Of its outline [m]; infinite if a file knows it."""
        return float("inf") if self.outline is None else self.outline.extent[0]

    @cached_property
    def depth(self) -> float:
        """Thickness [m]; of one that varies that at a corner, or on the rim, of the outline."""
        if self.thickness is None:
            return self.section.thickness
        x, y = (0.0, 0.0) if self.outline is None else self.outline.place
        return float(self.thickness(x=x, y=y))

    @cached_property
    def section(self) -> Section:
        """Its cross-section where its thickness is `depth`."""
        if self.layers:
            return Section.of([layer.ply for layer in self.layers])
        return Section.of([ply_of(self, self.depth, self.density or 0.0)])

    def theory_beside(self, bodies: Sequence[Any]) -> str:
        """Its theory beside others, all bodies of its scene; see `theory`."""
        thick = self.section.shear_depth > _SHEARS * self.least_width
        struck = bool(self.pressed_by(bodies)) and self.patch_radius is None
        return self.theory or (SHEARING if thick and not struck else THIN)

    def shears_beside(self, bodies: Sequence[Any]) -> bool:
        """Whether it shears."""
        return THEORIES[self.theory_beside(bodies)]

    def check_beside(self, bodies: Sequence[Any]) -> None:
        """Refuse what presses on single places of a plate that shears: there it would sink in.

        Raises:
            KeyedError: There are some.
        """
        balls = self.pressed_by(bodies)
        if balls and THEORIES.get(self.theory or "") and self.patch_radius is None:
            text = f" = {show(self.theory)}: {balls[0]} would press on a single place, which gives "
            text += "way to shear the more the smaller elements are; give patch_radius, about half "
            text += 'the thickness, and a stiffness of the contact, or theory = "kirchhoff".'
            raise KeyedError("", "theory", text)

    def pressed_by(self, bodies: Sequence[Any]) -> list[str]:
        """Names of bodies that press on single places."""
        return [body.name for body in bodies if not body.has_surface]

    @property
    def led_edges(self) -> tuple[tuple[str, Formula], ...]:
        """Edges that move, and their displacements along the normal in t [m]."""
        each = ((support, support.led(self.frame[1][2])) for support in self.supports)
        return tuple((support.edge, moved) for support, moved in each if moved is not None)

    @property
    def derived(self) -> tuple[str, ...]:
        """Keys that follow from others: scene files leave them out."""
        return filled_keys(self) if self.damping else ()

    @property
    def rayleigh_damping(self) -> tuple[float, ...]:
        """By mass [1/s], stiffness [s], and the ratios of modes."""
        each = self.rayleigh_mass, self.rayleigh_stiffness, *(self.damping_ratio or ())
        return (*each, 1.0 / self.quality_factor) if self.quality_factor else each

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

    @property
    def swing(self) -> Flight | None:
        """Its start; None if pressures or a displacement move it, or its outline is not known."""
        moved = not (self.displacement.is_constant and float(self.displacement()) == 0.0)
        moved = moved or any(support.motion is not None for support in self.supports)
        if self.outline is None or moved or self.pressures or not self.velocity.is_constant:
            return None
        outline = self.outline
        corners = outline.corners if isinstance(outline, PolygonOutline) else [outline.place]
        half = float(np.linalg.norm(corners, axis=1).max()) + 0.5 * self.depth
        velocity = float(self.velocity()) * self.frame[1][2]
        return Flight((half,) * 3, tuple(self.center), tuple(velocity.tolist()))

    @property
    def flight(self) -> Flight | None:
        """How it flies; None if it is held or damped, or its `swing` is not known."""
        return None if self.supports or self.rayleigh_mass else self.swing

    def centre_velocity(self) -> Floats | None:
        """Velocity at t = 0 [m/s], (3,); None if it varies, or edges are held."""
        if not self.velocity.is_constant or self.supports:
            return None
        return np.asarray(float(self.velocity()) * self.frame[1][2])
