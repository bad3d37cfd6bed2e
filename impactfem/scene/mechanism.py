"""Mechanisms: trees of links and joints from URDF and MJCF files."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from impactfem.arrays import Floats
from impactfem.reading.robot_xml import FileError, parsed, planes_of, rooms_of
from impactfem.scene.body import BodyKind, Solver
from impactfem.scene.formula import Formula
from impactfem.scene.given import Given, MaybeFormula, MaybeTable
from impactfem.scene.inline import InlineTable, TablesByName, Vector
from impactfem.scene.jets import motion_at
from impactfem.scene.kinds import Choice, FilePath, FormulaOf, Line, Name, Real, Switch
from impactfem.scene.obstacles import HalfSpace
from impactfem.scene.rigid_keys import Orientation
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import NotAllowedError, show

SOLVERS = ("damped", "gauss_newton", "jacobian_transpose", "gradient")
"""Methods of inverse kinematics; see `impactfem.system.inverse_kinematics`."""


@table("joints = { NAME = { ... } }")
class JointStart:
    """Where a joint of a mechanism begins, and what drives it.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "joint"

    position: MaybeFormula = key(
        FormulaOf(("t",)), "at t = 0, as the file counts it; a formula in t drives it",
        unit="rad or m", default=None, absent="0, or what its limits or place make of it",
    )  # fmt: skip
    velocity: float = key(
        Real(), "at t = 0, of what no formula drives", unit="rad/s or m/s", default=0.0
    )
    motor: MaybeFormula = key(
        FormulaOf(("t", "q", "v")), "moment or force of its motor, in place of actuators",
        unit="N m or N", default=None, absent="those of the file",
    )  # fmt: skip
    control: MaybeFormula = key(
        FormulaOf(("t", "q", "v")), "signal of the actuator that the file gives it",
        unit="that of the actuator", default=None, absent="0",
    )  # fmt: skip
    restitution: float = key(
        Real(at_least=0.0), "of its limits, 0 to 1: speed after by speed before", default=0.0
    )

    def _check(self) -> None:
        if self.restitution > 1.0:
            text = f" = {show(self.restitution)} would gain energy: give 0 to 1."
            raise KeyedError(self.heading, "restitution", text)
        if self.motor is not None and self.control is not None:
            text = f" = {show(self.control.plain)} is that of an actuator, motor replaces it: "
            raise KeyedError(self.heading, "control", f"{text}remove one.")
        if self.drive is None:
            return
        for name in ("velocity", "motor", "control"):
            if given := getattr(self, name):
                shown = show(given.plain if isinstance(given, Formula) else given)
                text = f" = {shown}, but the formula of position drives the joint: remove one."
                raise KeyedError(self.heading, name, text)
        begun = motion_at(self.drive, 0.0)
        if not (math.isfinite(begun.value) and math.isfinite(begun.rate)):
            text = (
                f" = {show(self.drive.text)} has no finite value or rate at the start: rewrite it."
            )
            raise KeyedError(self.heading, "position", text)

    @property
    def drive(self) -> Formula | None:
        """What drives it; None if it only begins somewhere."""
        given = self.position
        return given if given is not None and "t" in given.used else None

    @property
    def start(self) -> float | None:
        """Position at t = 0 [rad or m]; None if it is left open."""
        return None if self.position is None else float(self.position(t=0.0))


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
    settles: ClassVar[bool] = True
    joined_in_steps: ClassVar[bool] = True
    meets_edges: ClassVar[bool] = True
    has_links: ClassVar[bool] = True
    joined_whole: ClassVar[bool] = False
    joined_by_surface: ClassVar[bool] = True
    dim: ClassVar[int] = 3

    name: str = key(Name(), "name of the mechanism in histories", default="mechanism")
    file: str = key(
        FilePath(endings=(".urdf", ".xml")),
        "URDF (.urdf) or MJCF (.xml); its meshes lie in its folder, that of the scene or its "
        "ROS package",
    )
    base: str = key(
        Choice(("fixed", "free")), "whether its first link stays or moves (MJCF says it itself; a "
        "URDF file of one link is a rigid body, which moves)",
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
        TablesByName(JointStart), "joints by name: position, velocity, motor, control, restitution",
        default=(),
    )  # fmt: skip
    strict: bool = key(
        Switch(),
        "whether what is not read of the file is refused, instead of listed",
        default=False,
    )
    place: MaybeTable[Place] = key(
        InlineTable((Place,)), "inverse kinematics of the start", default=None, absent="none"
    )

    def _check(self) -> None:
        if self.orientation is not None:
            self.orientation.check_in_space(self.kind)

    def obstacles(self, folder: Path) -> list[HalfSpace]:
        """Planes of the world of its file, as obstacles; what is wrong with the file is told later.

        Args:
            folder: Where a relative path begins.
        """
        path = folder / self.file
        if path.suffix.lower() == ".urdf":
            return []
        try:
            planes = list(planes_of(parsed(path, rooms_of(path, folder))))
        except FileError:
            return []
        found = []
        for index, plane in enumerate(planes):
            try:
                name = Name().read(plane.name)
            except NotAllowedError:
                name = "floor" + (f"_{index + 1}" if index else "")
            found.append(HalfSpace(name=name, point=plane.point, normal=plane.normal))
        return found

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
