"""Rigid bodies in the plane and in space."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.body import BodyKind, Solver
from impactfem.scene.flight import Flight
from impactfem.scene.formula import Formula
from impactfem.scene.given import Given, MaybeFormulas, MaybeTable, Tables
from impactfem.scene.inline import Formulas, InlineTable, ListOf, NumberOrVector, Vector
from impactfem.scene.kinds import Choice, FilePath, Line, Name, Real
from impactfem.scene.mesh_files import PART
from impactfem.scene.points import COORDINATES
from impactfem.scene.rigid_forms import Form, form_of, form_of_surface
from impactfem.scene.rigid_keys import (
    InertiaKind,
    Orientation,
    check_forces,
    inertia_fault,
    rotation,
)
from impactfem.scene.rigid_shapes import RIGID_SHAPES, RigidShape
from impactfem.scene.schema import KeyedError, aside, key, table
from impactfem.scene.surface_files import MESH_SIZE, SCALE, SURFACE_FILES, closed_surface
from impactfem.scene.values import show

MODELS = ("2d", "3d")
_FORCE = ("t", *COORDINATES, "vx", "vy", "vz")
_MOMENT = ("t", "w", "wx", "wy", "wz")


@table('[[body]] with kind = "rigid"')
class RigidBody(BodyKind):
    """A body without waves that moves and turns, and touches with its surface.

    Raises:
        SceneError: a value is missing or not allowed, or no body has this mass and inertia.
    """

    kind: ClassVar[str] = "rigid"
    solvers: ClassVar[tuple[Solver, Solver]] = ("march", "march")
    has_coordinates: ClassVar[bool] = True
    may_meet_nothing: ClassVar[bool] = True
    settles: ClassVar[bool] = True
    takes_joints: ClassVar[bool] = True
    has_centre: ClassVar[bool] = True
    tied: ClassVar[bool] = True
    joined_in_steps: ClassVar[bool] = True

    name: str = key(Name(), "name of the body in histories", default="rigid")
    model: str | None = key(
        Choice(MODELS), "number of coordinates", default=None,
        absent="that of the shape; of a mesh 3d",
    )  # fmt: skip
    shape: MaybeTable[RigidShape] = key(
        InlineTable(RIGID_SHAPES), "its shape at t = 0, before orientation; or give mesh",
        default=None, absent="none",
    )  # fmt: skip
    shapes: Tables[RigidShape] = key(
        ListOf(InlineTable(RIGID_SHAPES)), "instead: the shapes of its parts at t = 0, which "
        "never touch each other; what two of them share counts twice in its mass", default=(),
    )  # fmt: skip
    mesh: Given[str | None, Path] = key(
        FilePath(endings=SURFACE_FILES), "file of its closed surface instead of a shape",
        default=None, absent="none",
    )  # fmt: skip
    part: str | None = key(Line(), PART, default=None, absent="all of them")
    scale: float = key(Real(above=0), SCALE, unit="m", default=1.0)
    mesh_size: float | None = key(
        Real(above=0), MESH_SIZE, unit="m", default=None, absent="by the file"
    )
    position: Sequence[float] | None = key(
        Vector(), "where the origin of the mesh is at t = 0", unit="m", default=None,
        absent="at the origin",
    )  # fmt: skip
    density: float | None = key(
        Real(above=0), "mass density; or give mass", unit="kg/m^3", default=None, absent="from mass"
    )
    mass: float | None = key(
        Real(above=0), "mass; or give density", unit="kg", default=None, absent="from density"
    )
    inertia: Given[float | tuple[tuple[float, ...], ...] | None, Sequence[Any]] = key(
        InertiaKind(), "about the centre of mass along the axes of the shape; with mass",
        unit="kg m^2", default=None, absent="as if the mass were spread evenly",
    )  # fmt: skip
    center_of_mass: Sequence[float] | None = key(
        Vector(), "centre of mass, in the place of the shape; with mass and inertia", unit="m",
        default=None, absent="centre of the shape",
    )  # fmt: skip
    thickness: float = key(Real(above=0), "across the plane (2D)", unit="m", default=1.0)
    angle: float = key(
        Real(), "turns the shape about its centre of mass at t = 0 (2D)", unit="rad", default=0.0
    )
    orientation: MaybeTable[Orientation] = key(
        InlineTable((Orientation,)), "the same, in space (3D) with an axis", default=None,
        absent="as drawn",
    )  # fmt: skip
    velocity: Sequence[float] | None = key(
        Vector(), "of the centre of mass at t = 0", unit="m/s", default=None, absent="at rest"
    )
    angular_velocity: float | Sequence[float] | None = key(
        NumberOrVector(), "at t = 0, along the axes of the scene", unit="rad/s", default=None,
        absent="none",
    )  # fmt: skip
    force: MaybeFormulas = key(
        Formulas(_FORCE), "at the centre of mass besides gravity; x y z vx vy vz are the centre's",
        unit="N", default=None, absent="none",
    )  # fmt: skip
    moment: MaybeFormulas = key(
        Formulas(_MOMENT, lengths=(1, 3)),
        "about the centre of mass, along the axes of the scene; in 2D one formula in t and w",
        unit="N m", default=None, absent="none",
    )  # fmt: skip
    folder: Path | None = aside()

    def _check(self) -> None:
        self._check_source()
        self._check_dimension()
        if self.mesh is None or self.folder is not None:  # else its file is not known yet
            self._check_form()

    def opened(self, folder: Path) -> Self:
        """The same with its file read, whose relative path starts at a folder.

        Raises:
            KeyedError: The file cannot be read, or its surface is none of a body.
        """
        return self if self.mesh is None else replace(self, folder=folder)

    def _check_form(self) -> None:
        """Refuse forms, masses and inertias that no body has."""
        for where, part in self._figures.items():
            if cuts := getattr(part, "symmetry", ()):
                text = f" = {show(list(cuts))} makes parts of solids: remove it, a rigid body is "
                raise KeyedError(self.kind, f"{where}.symmetry", f"{text}whole.")
            try:
                form_of(part)
            except KeyedError as error:
                raise error.moved("").under(where, self.kind) from None
        for where, form in zip(self._figures or ("mesh",), self.parts, strict=True):
            if not 0.0 < form.volume < math.inf or not len(form.nodes):
                raise KeyedError(self.kind, where, " has no usable volume: give SI units.")
        self._check_mass()
        self._check_inertia()
        self._check_formulas()

    @cached_property
    def form(self) -> Form:
        """What the shape amounts to, before the body is turned."""
        return Form.joined(self.parts)

    @cached_property
    def parts(self) -> tuple[Form, ...]:
        """The same of each of its shapes, which are convex but for one from a file."""
        if self.mesh is not None:
            return (form_of_surface(closed_surface(self, self.dim), self.position),)
        return tuple(map(form_of, self._figures.values()))

    @property
    def summed(self) -> tuple[Form, ...]:
        """Its parts; none if its inertia is given."""
        return self.parts if len(self.shapes) > 1 and self.inertia is None else ()

    @property
    def _figures(self) -> Mapping[str, RigidShape]:
        """Its shapes by their keys."""
        if self.shape is not None:
            return {"shape": self.shape}
        return {f"shapes[{index}]": shape for index, shape in enumerate(self.shapes)}

    @property
    def figure(self) -> str:
        """Word for its shape."""
        kinds = [shape.kind for shape in self._figures.values()]
        return kinds[0] if len(kinds) == 1 else f"body of {len(kinds)} shapes" if kinds else "body"

    @property
    def dim(self) -> int:
        """Number of coordinates."""
        for shape in self._figures.values():
            return shape.dim
        return 2 if self.model == MODELS[0] else 3

    @property
    def turns_far(self) -> bool:
        """It may."""
        return True

    @property
    def rolls(self) -> bool:
        """Whether it is a ball or disc."""
        return not self.has_corners

    @property
    def is_round(self) -> bool:
        """Whether it has balls, capsules or cylinders."""
        return bool(self.form.radius.any() or self.form.rim.any())

    @property
    def dents(self) -> bool:  # type: ignore[override]
        """Whether its contacts may have a stiffness: those of balls."""
        return self.rolls

    @property
    def has_corners(self) -> bool:
        """Whether it is no single ball."""
        return len(self.form.nodes) > 1 or self.form.curved

    @property
    def is_curved(self) -> bool:
        """Whether it, or a part, is an ellipsoid."""
        return self.form.curved

    @property
    def is_convex(self) -> bool:
        """Whether it, or each of its shapes, is its own convex hull."""
        return self.form.convex

    @property
    def hull_corners(self) -> int:
        """Most corners of a convex hull of its parts, or centres of their balls and rims."""
        return max(len(part.nodes) for part in self.parts)

    @property
    def turns(self) -> int:
        """Number of its rotations, 1 or 3."""
        return 1 if self.dim == 2 else 3

    @property
    def total_mass(self) -> float:
        """Mass [kg]."""
        if self.mass is not None:
            return self.mass
        thick = self.thickness if self.dim == 2 else 1.0
        return (self.density or 0.0) * thick * self.form.volume

    @property
    def center(self) -> Floats:
        """Centre of mass at t = 0 [m], (dim,)."""
        given = self.center_of_mass
        return self.form.centre if given is None else np.asarray(given, dtype=np.float64)

    @property
    def moments(self) -> Floats:
        """Inertia about the centre of mass, in space along its axes [kg m^2], (1 or 3, same)."""
        if self.inertia is not None:
            return np.atleast_2d(np.asarray(self.inertia, dtype=np.float64))
        second = self.total_mass / self.form.volume * self.form.second
        if self.dim == 2:
            return np.array([[np.trace(second)]])
        return np.asarray(np.trace(second) * np.eye(3) - second)

    @property
    def quaternion(self) -> Floats:
        """Orientation at t = 0, unit quaternion (w, x, y, z)."""
        return np.array([1.0, 0.0, 0.0, 0.0]) if self.orientation is None else self.orientation.unit

    @property
    def start_velocity(self) -> Floats:
        """Of the centre [m/s] and of the rotation [rad/s], (dim + turns,)."""
        spin = np.zeros(self.turns) if self.angular_velocity is None else self.angular_velocity
        moving = np.zeros(self.dim) if self.velocity is None else self.velocity
        return np.concatenate([moving, np.atleast_1d(spin)]).astype(np.float64)

    def box(self) -> tuple[Floats, Floats]:
        """Half edges and centre [m] of a box around it in any rotation."""
        form, center = self.form, self.center
        reach = float((form.reach + np.linalg.norm(center - form.centre)).max())
        return np.full(self.dim, reach), center

    @property
    def rotation(self) -> Floats:
        """Matrix of its orientation at t = 0, (dim, dim)."""
        if self.dim == 2:
            c, s = math.cos(self.angle), math.sin(self.angle)
            return np.array([[c, -s], [s, c]])
        return rotation(self.quaternion)

    def faces(self) -> Floats:
        """Triangles, in space tetrahedra, that fill it at t = 0 [m], (cells, corners, dim)."""
        places = self.center + (self.form.points - self.center) @ self.rotation.T
        return np.asarray(places[self.form.cells])

    def centre_velocity(self) -> Floats:
        """Velocity of its centre at t = 0 [m/s], (dim,)."""
        return self.start_velocity[: self.dim]

    @property
    def flight(self) -> Flight | None:
        """How it flies; None if forces act on it."""
        if self.force or self.moment:
            return None
        half, center = self.box()
        return Flight(half.tolist(), center.tolist(), self.centre_velocity().tolist())

    def _fail(self, name: str, text: str) -> KeyedError:
        value = getattr(self, name)
        if isinstance(value, tuple):
            value = [e.plain if isinstance(e, Formula) else e for e in value]
        return KeyedError(self.kind, name, f" = {show(value)}{text}")

    def _check_source(self) -> None:
        """Refuse bodies without a shape or file, with both, or with keys of the other one."""
        given = [name for name in ("shape", "shapes", "mesh") if getattr(self, name)]
        if len(given) != 1:
            found = f"{' and '.join(given)} are" if given else "neither is"
            text = f": {found} given; give a shape, shapes = a list of them, or mesh = a file."
            raise KeyedError(self.kind, given[0] if given else "shape", text)
        for where, shape in self._figures.items():
            if shape.dim != self.dim:
                text = f" has {shape.dim} coordinates, but {next(iter(self._figures))} has "
                raise KeyedError(self.kind, where, f"{text}{self.dim}: give all as many.")
        for name in ("scale", "mesh_size", "position", "part"):
            usual = 1.0 if name == "scale" else None
            if self.mesh is None and getattr(self, name) != usual:
                raise self._fail(name, " is for mesh, and a shape is given: remove it.")

    def _check_dimension(self) -> None:
        """Refuse what does not fit the number of coordinates."""
        dim = self.dim
        if self.model is not None and self.model != MODELS[dim - 2]:
            fitting = MODELS[dim - 2]
            raise self._fail(
                "model", f", but the shape has {dim} coordinates: give {show(fitting)}."
            )
        for name in ("position", "center_of_mass", "velocity", "force"):
            value = getattr(self, name)
            if value is not None and len(value) != dim:
                raise self._fail(
                    name, f" has {len(value)} entries, the shape has {dim}: give {dim}."
                )
        spin, moment = self.angular_velocity, self.moment
        if spin is not None and np.size(spin) != self.turns:
            wanted = "a number" if dim == 2 else "3 numbers"
            raise self._fail("angular_velocity", f" does not fit {dim} coordinates: give {wanted}.")
        if moment is not None and len(moment) != self.turns:
            text = f" has {len(moment)} entries: give {self.turns} for {dim} coordinates."
            raise self._fail("moment", text)
        if dim == 3 and self.angle:
            text = " is for the plane: give orientation = { axis = [0, 0, 1], angle = ... }."
            raise self._fail("angle", text)
        if self.orientation is not None:
            self._check_orientation(self.orientation)

    def _check_orientation(self, given: Orientation) -> None:
        """Take that of a body in the plane for its angle; refuse what does not fit."""
        if self.dim == 3:
            given.check_in_space(self.kind)
            return
        angle = given.in_plane
        if angle is None:
            text = " turns the body out of its plane: give { angle = ... }, or angle."
            raise KeyedError(self.kind, "orientation", text)
        if self.angle:
            raise KeyedError(self.kind, "orientation", " is given beside angle: remove one.")
        object.__setattr__(self, "angle", angle)
        object.__setattr__(self, "orientation", None)

    def _check_mass(self) -> None:
        """Refuse a mass that is not given just once, and what contradicts it."""
        if (self.density is None) == (self.mass is None):
            given = "neither is" if self.mass is None else "both are"
            raise KeyedError(self.kind, "mass", f": {given} given; give density, or mass.")
        if self.inertia is not None and self.mass is None:
            raise self._fail("inertia", " needs mass: give it instead of density.")
        moved = self.center_of_mass is not None and not np.allclose(
            self.center, self.form.centre, rtol=0.0, atol=1e-12 * float(self.form.reach.max())
        )
        if moved and self.inertia is None:
            text = " is not the centre of the shape, whose mass then is not spread evenly: give "
            raise self._fail("center_of_mass", f"{text}inertia too.")
        if not 0.0 < self.total_mass < math.inf:
            raise KeyedError(
                self.kind, "density", f" gives the mass {self.total_mass:g}: give SI units."
            )

    def _check_inertia(self) -> None:
        """Refuse an inertia that no body has."""
        if self.inertia is not None and self.moments.shape[0] != self.turns:
            wanted = "a number" if self.dim == 2 else "[Ixx, Iyy, Izz] or 3 x 3 numbers"
            raise self._fail("inertia", f" does not fit {self.dim} coordinates: give {wanted}.")
        if fault := inertia_fault(self.moments):
            raise self._fail("inertia", fault)

    def _check_formulas(self) -> None:
        """Refuse formulas that need other coordinates, or have no finite value at the start."""
        dim, speed = self.dim, self.start_velocity
        axes = COORDINATES[:dim]
        moving = dict(
            zip((*axes, *(f"v{a}" for a in axes)), (*self.center, *speed[:dim]), strict=True)
        )
        names = ("w",) if dim == 2 else ("wx", "wy", "wz")
        turning = dict(zip(names, speed[dim:], strict=True))
        check_forces(self, moving, turning)
