"""Kinematics of the mechanisms of a scene at t = 0: frames, Jacobians, inverse kinematics."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.models.falls import fall
from impactfem.scene import Mechanism, Scene
from impactfem.scene.schema import KeyedError
from impactfem.system.inverse_kinematics import Found
from impactfem.system.mechanism import start_of
from impactfem.system.mechanism_file import read_mechanism


@dataclass(frozen=True)
class Frame:
    """Where a frame of a mechanism is.

    Attributes:
        position: [m], (3,).
        quaternion: Unit quaternion (w, x, y, z) of its rotation.
        jacobian: Velocity and angular velocity along fixed axes by the rates, (6, rates).
    """

    position: Floats
    quaternion: Floats
    jacobian: Floats


@dataclass(frozen=True)
class Kinematics:
    """A mechanism at t = 0.

    Attributes:
        name: Of the body.
        frames: Its frames by name: links, joints and others of its file.
        above: The frame that each hangs on.
        rates: Names of the columns of Jacobians.
        joints: Positions of the joints of one degree of freedom by name [rad, m].
        inverse: How ``place`` was found; None without it.
        target: Of ``place``.
        shapes: Points of each collision shape [m], (points, 3).
    """

    name: str
    frames: Mapping[str, Frame]
    above: Mapping[str, str]
    rates: Sequence[str]
    joints: Mapping[str, float]
    inverse: Found | None
    target: Sequence[float] | None
    shapes: Sequence[Floats]

    def as_json(self) -> dict[str, Any]:
        """What ``kinematics.json`` holds of it."""
        frames = {
            name: {
                "position": frame.position.tolist(),
                "quaternion": frame.quaternion.tolist(),
                "jacobian": frame.jacobian.tolist(),
            }
            for name, frame in self.frames.items()
        }
        found = self.inverse
        inverse = found and {
            "method": found.method,
            "solved": found.solved,
            "iterations": found.iterations,
            "residual": found.residual,
            "q": list(self.joints.values()),
        }
        told: dict[str, Any] = {"frames": frames, "rates": [*self.rates], "joints": {**self.joints}}
        return told | {"inverse": inverse}


def kinematics(scene: Scene) -> tuple[Kinematics, ...]:
    """Frames, Jacobians and inverse kinematics of the mechanisms of a scene at t = 0.

    Args:
        scene: With bodies of ``kind = "mechanism"``.

    Raises:
        SceneError: There is none, or a file or key of one is wrong.
        MissingDependencyError: Pinocchio is not installed.
    """
    fall(scene)
    found = [
        _of(scene, body, f"body[{index}]")
        for index, body in enumerate(scene.bodies)
        if isinstance(body, Mechanism)
    ]
    if not found:
        raise SceneError('body: no one is a mechanism; give [[body]] kind = "mechanism"')
    return tuple(found)


def _of(scene: Scene, body: Mechanism, where: str) -> Kinematics:
    try:
        robot = read_mechanism(body, scene.folder)
        tree, shapes = robot.tree, robot.shapes
        _, q, _, inverse = start_of(body, robot)
    except KeyedError as error:
        raise error.moved(where) from None
    moving = sorted({shape.joint for shape in shapes})
    turns, places = tree.poses(q, moving)
    at = {joint: k for k, joint in enumerate(moving)}
    return Kinematics(
        body.name,
        {name: Frame(*tree.frame(q, name)) for name in tree.frames()},
        tree.above(),
        tree.rate_names(),
        {name: tree.position(q, name) for name in tree.single},
        inverse,
        None if body.place is None else body.place.target,
        [places[at[s.joint]] + s.points @ turns[at[s.joint]].T for s in shapes],
    )
