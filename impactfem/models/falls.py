"""Drops of mechanisms: their files say how far they reach."""

import numpy as np

from impactfem.scene import Mechanism, Scene
from impactfem.scene.fallers import Reach, flat
from impactfem.scene.schema import KeyedError
from impactfem.system.mechanism import start_of
from impactfem.system.mechanism_file import read_mechanism


def fall(scene: Scene) -> None:
    """Let a scene with mechanisms start where its drop ends; the scene then shows this start.

    Args:
        scene: Which has its drop no more afterwards.

    Raises:
        SceneError: It cannot fall so, or a file or key of a mechanism is wrong.
        MissingDependencyError: Pinocchio is not installed.
    """
    if scene.drop is None:
        return
    reach = {}
    for body in scene.mechanisms:
        try:
            reach[body.name] = _reach(scene, body)
        except KeyedError as error:
            raise error.moved(f"body[{scene.bodies.index(body)}]") from None
    scene.fall(reach)


def _reach(scene: Scene, body: Mechanism) -> Reach:
    """Nodes of the links of a mechanism and rims of round cylinders, where they are drawn."""
    robot = read_mechanism(body, scene.folder)
    _, q, _, found = start_of(body, robot)
    if found is not None:
        found.check(body, robot.tree)
    if not robot.tree.free:
        text = f" = {body.base!r}: {body.name} is held, and does not fall; leave drop out."
        raise KeyedError("", "base", text)
    nodes, radius, rims = [], [], []
    for shape in robot.shapes:
        turn, there = (each[0] for each in robot.tree.poses(q, [shape.joint]))
        nodes.append(there + shape.nodes @ turn.T)
        radius.append(shape.radius)
        if shape.ends is not None:
            axis = turn @ (shape.ends[1] - shape.ends[0])
            axes = flat(axis[None], np.array([shape.girth]))[0]
            rims += [(there + turn @ end, axes) for end in shape.ends]
    if not nodes:
        text = f" = {body.file!r} has no collision shape that could touch: give <collision>."
        raise KeyedError("", "file", text)
    return (np.concatenate(nodes), np.concatenate(radius)), rims
