"""Mechanisms: trees of links and joints from URDF and MJCF files."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.body import BodyKind, Solver
from impactfem.scene.given import Given, MaybeFormula, MaybeTable
from impactfem.scene.inline import InlineTable, TablesByName, Vector
from impactfem.scene.kinds import Choice, FilePath, FormulaOf, Line, Name, Real
from impactfem.scene.rigid_keys import Orientation
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

SOLVERS = ("damped", "gauss_newton", "jacobian_transpose", "gradient")
"""Methods of inverse kinematics; see `impactfem.system.inverse_kinematics`."""


@table("joints = { NAME = { ... } }")
class JointStart:
    """Where a joint of a mechanism begins, and what drives it.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "joint"

    position: float | None = key(
        Real(), "at t = 0, as the file counts it", unit="rad or m", default=None,
        absent="0, or what its limits or place make of it",
    )  # fmt: skip
    velocity: float = key(Real(), "at t = 0", unit="rad/s or m/s", default=0.0)
    motor: MaybeFormula = key(
        FormulaOf(("t", "q", "v")), "moment or force of its motor", unit="N m or N", default=None,
        absent="none",
    )  # fmt: skip
    restitution: float = key(
        Real(at_least=0.0), "of its limits, 0 to 1: speed after by speed before", default=0.0
    )

    def _check(self) -> None:
        if self.restitution > 1.0:
            text = f" = {show(self.restitution)} would gain energy: give 0 to 1."
            raise KeyedError(self.heading, "restitution", text)


@table("place = { ... }")
class Place:
    """Where a link begins: inverse kinematics finds the positions of the joints.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "place"

    frame: str = key(Line(), "link, joint or frame of the file whose origin is meant")
    target: Sequence[float] = key(Vector((3,)), "place of the origin at t = 0", unit="m")
    method: str = key(
        Choice(SOLVERS), "from the positions in joints on; limits are kept", default=SOLVERS[0]
    )
    factor: float | None = key(
        Real(above=0), "step of jacobian_transpose [1 or 1/m^2], or what damped adds to J J^T",
        default=None, absent="0.3, or 0.01",
    )  # fmt: skip

    def _check(self) -> None:
        if self.factor is not None and self.method not in {"jacobian_transpose", "damped"}:
            text = f" = {show(self.factor)} belongs to jacobian_transpose and damped: remove it."
            raise KeyedError(self.heading, "factor", text)


@table('[[body]] with kind = "mechanism"')
class Mechanism(BodyKind):
    """Links joined to a tree, as a URDF or MJCF file has them; needs ``impactfem[robots]``.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    kind: ClassVar[str] = "mechanism"
    solvers: ClassVar[tuple[Solver, Solver]] = ("march", "march")
    may_meet_nothing: ClassVar[bool] = True
    takes_joints: ClassVar[bool] = True
    joined_in_steps: ClassVar[bool] = True
    meets_edges: ClassVar[bool] = True
    has_links: ClassVar[bool] = True
    joined_whole: ClassVar[bool] = False
    joined_by_surface: ClassVar[bool] = True
    dim: ClassVar[int] = 3

    name: str = key(Name(), "name of the mechanism in histories", default="mechanism")
    file: str = key(
        FilePath(endings=(".urdf", ".xml")),
        "URDF (.urdf) or MJCF (.xml); its meshes lie in the same folder or below",
    )
    base: str = key(
        Choice(("fixed", "free")), "whether its first link stays or moves (MJCF says it itself)",
        default="fixed",
    )  # fmt: skip
    position: Sequence[float] = key(
        Vector((3,)), "of its first link at t = 0", unit="m", default=(0.0, 0.0, 0.0)
    )
    orientation: MaybeTable[Orientation] = key(
        InlineTable((Orientation,)), "of its first link at t = 0", default=None,
        absent="as the file has it",
    )  # fmt: skip
    velocity: Sequence[float] = key(
        Vector((3,)), "of the origin of a free first link at t = 0", unit="m/s",
        default=(0.0, 0.0, 0.0),
    )  # fmt: skip
    angular_velocity: Sequence[float] = key(
        Vector((3,)), "of a free first link at t = 0, along the axes of the scene", unit="rad/s",
        default=(0.0, 0.0, 0.0),
    )  # fmt: skip
    joints: Given[Mapping[str, JointStart], Mapping[str, JointStart | Mapping[str, Any]]] = key(
        TablesByName(JointStart), "joints by name: position, velocity, motor, restitution",
        default=(),
    )  # fmt: skip
    place: MaybeTable[Place] = key(
        InlineTable((Place,)), "inverse kinematics of the start", default=None, absent="none"
    )

    def _check(self) -> None:
        if self.orientation is not None:
            self.orientation.check_in_space(self.kind)

    @property
    def turns_far(self) -> bool:
        """Its joints may."""
        return True

    @property
    def surface_names(self) -> tuple[str, ...] | None:
        """Its links, which the file names."""
        return None

    @property
    def quaternion(self) -> Floats:
        """Orientation of its first link at t = 0, unit quaternion (w, x, y, z)."""
        return np.array([1.0, 0.0, 0.0, 0.0]) if self.orientation is None else self.orientation.unit
