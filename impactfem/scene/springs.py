"""Masses and springs on the edges of a mesh."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.body import BodyKind, Solver
from impactfem.scene.boundary import Support
from impactfem.scene.damping import QUALITY, RATIO, Damping, fill_damping, filled_keys
from impactfem.scene.given import MaybeFormulas, MaybeTable, Tables
from impactfem.scene.inline import Formulas, InlineTable, ListOf, NumberOrVector, Vector
from impactfem.scene.kinds import Choice, FilePath, Name, Real
from impactfem.scene.mesh_files import MESH_FILES
from impactfem.scene.rigid_forms import form_of
from impactfem.scene.rigid_keys import check_forces
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.shapes import Block, Disc, Ring
from impactfem.scene.values import show

MODELS = ("2d", "3d")
PATTERNS = ("triangles", "squares", "crossed")


@table('[[body]] with kind = "springs"')
class SpringNet(BodyKind):
    """Point masses at the nodes of a mesh, and a spring on each of its edges, unstrained at t = 0.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    kind: ClassVar[str] = "springs"
    solvers: ClassVar[tuple[Solver, Solver]] = ("march", "march")
    may_meet_nothing: ClassVar[bool] = True
    settles: ClassVar[bool] = True
    takes_joints: ClassVar[bool] = True
    joined_in_steps: ClassVar[bool] = True
    joined_by_surface: ClassVar[bool] = True
    parts_in_joints: ClassVar[str] = "surfaces"

    name: str = key(Name(), "name of the body in histories", default="springs")
    shape: MaybeTable[Block | Disc | Ring] = key(
        InlineTable((Block, Disc, Ring)), "shape in the plane to fill with a pattern, or give mesh",
        default=None, absent="none",
    )  # fmt: skip
    mesh: str | None = key(
        FilePath(endings=MESH_FILES),
        "mesh or geometry file instead of a shape; its names of groups are those of the surfaces",
        default=None, absent="none",
    )  # fmt: skip
    model: str | None = key(
        Choice(MODELS), "number of coordinates of the mesh file", default=None, absent="2d"
    )
    mesh_size: float | None = key(
        Real(above=0), "length of the edges; required with a shape or a STEP file", unit="m",
        default=None, absent="by the mesh file",
    )  # fmt: skip
    pattern: str | None = key(
        Choice(PATTERNS), "cells that fill a shape; crossed: squares with both diagonals",
        default=None, absent="triangles",
    )  # fmt: skip
    mass: float = key(Real(above=0), "total mass, spread evenly over the cells", unit="kg")
    stiffness: float = key(
        Real(above=0),
        "of an edge; in the plane of one between two cells: an edge on the outline has half of it",
        unit="N/m",
    )
    diagonal_stiffness: float | None = key(
        Real(above=0), "of a diagonal of crossed squares", unit="N/m", default=None,
        absent="half of stiffness, which makes them isotropic",
    )  # fmt: skip
    radius: float = key(Real(at_least=0), "of masses and edges in contact", unit="m", default=0.0)
    velocity: Sequence[float] | None = key(
        Vector(), "at t = 0", unit="m/s", default=None, absent="at rest"
    )
    angular_velocity: Sequence[float] | float | None = key(
        NumberOrVector(), "rotation at t = 0 about the centre of mass, added to the velocity",
        unit="rad/s", default=None, absent="0",
    )  # fmt: skip
    force: MaybeFormulas = key(
        Formulas(("t",), lengths=(2, 3)),
        "applied to the body besides gravity, spread over its masses as they weigh",
        unit="N", default=None, absent="none",
    )  # fmt: skip
    supports: Tables[Support] = key(
        ListOf(InlineTable((Support,))),
        'surfaces all masses of which are held, kind = "fixed", or moved, kind = "motion"',
        default=(),
    )
    rayleigh_mass: float = key(
        Real(at_least=0), "damping by the mass: speeds fall at this rate", unit="1/s", default=0.0
    )
    rayleigh_stiffness: float = key(
        Real(at_least=0), "a damper of so many times its stiffness beside each spring", unit="s",
        default=0.0,
    )  # fmt: skip
    damping_ratio: float | None = key(Real(at_least=0, below=1), RATIO, default=None, absent="none")
    quality_factor: float | None = key(Real(above=0), QUALITY, default=None, absent="none")
    damping: MaybeTable[Damping] = key(
        InlineTable((Damping,)), "the same in one table", default=None, absent="none"
    )

    def _check(self) -> None:
        if (self.shape is None) == (self.mesh is None):
            given = "neither is" if self.mesh is None else "both are"
            raise KeyedError(self.kind, "shape", f": {given} given; give shape, or mesh.")
        if self.damping or self.quality_factor or self.damping_ratio:
            fill_damping(self)
        if self.shape is not None:
            self._check_shape(self.shape)
        elif self.pattern is not None:
            text = " is for shapes: remove it, a mesh file has its own edges."
            raise self._fail("pattern", text)
        if self.diagonal_stiffness is not None and self.pattern != "crossed":
            text = ' needs pattern = "crossed": give that, or remove it.'
            raise self._fail("diagonal_stiffness", text)
        for name in ("velocity", "force"):
            given = getattr(self, name)
            if given is not None and len(given) != self.dim:
                text = f" has {len(given)} entries, the body has {self.dim}: give {self.dim}."
                raise self._fail(name, text)
        check_forces(self, {})
        spin, turns = self.angular_velocity, 2 * self.dim - 3
        if spin is not None and (np.size(spin) != turns or np.ndim(spin) != self.dim - 2):
            wanted = "a number" if turns == 1 else "3 numbers"
            text = f" does not fit {self.dim} coordinates: give {wanted}."
            raise self._fail("angular_velocity", text)
        self._check_supports()

    def _check_supports(self) -> None:
        """Refuse what holds no masses, and motions along some axes only."""
        for index, support in enumerate(self.supports):
            if support.mirrors:
                text = f' = {show(support.kind)} is not known of springs: give "fixed" or "motion".'
                raise KeyedError(self.kind, f"supports[{index}].kind", text)
            if support.until is not None:
                text = f" = {support.until:g}: masses of springs are held for ever; remove it, or "
                text += "model the body as a solid."
                raise KeyedError(self.kind, f"supports[{index}].until", text)
            moved = support.value
            if moved is not None and (len(moved) != self.dim or None in moved):
                text = f": masses of springs move along all {self.dim} axes; give a formula of each"
                raise KeyedError(self.kind, f"supports[{index}].value", f"{text}, 0 where none.")
            known = () if self.shape is None else self.shape.surface_names()
            if known and support.surface not in known:
                text = f" = {show(support.surface)} is no surface: give {' or '.join(known)}."
                raise KeyedError(self.kind, f"supports[{index}].surface", text)

    def _check_shape(self, shape: Block | Disc | Ring) -> None:
        """Refuse what does not fit a shape."""
        if shape.dim != 2:
            text = f" has {shape.dim} coordinates: give one in the plane, or a mesh file."
            raise KeyedError(self.kind, "shape.size", text)
        if shape.symmetry:
            text = f" = {show(list(shape.symmetry))} cuts solids: remove it."
            raise KeyedError(self.kind, "shape.symmetry", text)
        if self.model not in {None, "2d"}:
            raise self._fail("model", ", but the shape lies in the plane: remove it.")
        if self.mesh_size is None:
            raise KeyedError(self.kind, "mesh_size", " is missing: give the length of the edges.")

    def _fail(self, name: str, text: str) -> KeyedError:
        value = getattr(self, name)
        plain = (
            [getattr(each, "plain", each) for each in value] if isinstance(value, tuple) else value
        )
        shown = show(plain)
        return KeyedError(self.kind, name, f" = {shown}{text}")

    @property
    def derived(self) -> tuple[str, ...]:
        """Keys that follow from others: scene files leave them out."""
        return filled_keys(self) if self.damping else ()

    @property
    def dim(self) -> int:
        """Number of coordinates."""
        return 3 if self.model == "3d" else 2

    @property
    def joint_parts(self) -> tuple[str, ...] | None:
        """Surfaces of its shape; None with a mesh file, which names its own."""
        return None if self.shape is None else self.shape.surface_names()

    def turns_at(self, part: str) -> bool:
        """A surface does, a mass does not."""
        return bool(part)

    def box(self) -> tuple[Floats, Floats] | None:
        """Half edges and centre [m] of a box around it; None of mesh files."""
        if self.shape is None:
            return None
        reach = float(np.linalg.norm(self.shape.half_extents)) + self.radius
        return np.full(2, reach), np.asarray(self.shape.centre, dtype=np.float64)

    def faces(self) -> Floats | None:
        """Triangles that fill its shape [m], (cells, corners, 2); None of mesh files."""
        if self.shape is None:
            return None
        form = form_of(self.shape)
        return np.asarray(form.points[form.cells])

    def centre_velocity(self) -> Floats:
        """Velocity at t = 0 [m/s], (dim,)."""
        given = self.velocity or (0.0,) * self.dim
        return np.asarray(given, dtype=np.float64)
