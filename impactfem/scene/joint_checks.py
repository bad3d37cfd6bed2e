"""Checks of joints against the bodies of their scene, and against each other."""

from impactfem.scene.content import Content
from impactfem.scene.joints import GROUND
from impactfem.scene.nearest import nearest
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show


def check_joints(scene: Content) -> None:
    """Refuse joints that hold what is not there, or what cannot be held.

    Raises:
        KeyedError: naming the key.
    """
    bodies = {body.name: body for body in scene.bodies}
    taken = {**{name: f"body {name}" for name in bodies}}
    taken |= {obstacle.name: f"obstacle {obstacle.name}" for obstacle in scene.obstacles}
    if scene.joints and GROUND in taken:
        text = f" = {show(GROUND)} is what joints call what does not move: give another name."
        raise KeyedError(taken[GROUND], "name", text)
    known = {joint.name: joint for joint in scene.joints}
    for index, joint in enumerate(scene.joints):
        where = f"joint[{index}]"
        if joint.name in taken:
            text = f" = {show(joint.name)} is the name of {taken[joint.name]} too: give another."
            raise KeyedError(where, "name", text)
        taken[joint.name] = where
        for name in joint.joints or ():
            if name not in known or not known[name].moves:
                moving = [each.name for each in scene.joints if each.moves]
                text = f" = {show(list(joint.joints or ()))}: {show(name)} is no joint with a "
                text += f"coordinate; give two of {', '.join(moving) or 'these, there is none'}."
                raise KeyedError(where, "joints", text)
        for name in joint.between or ():
            _check_side(scene, where, name, joint.between or ())
        dim = joint.dim
        if dim is not None and dim != scene.dim:
            key = "point" if joint.points is None else "points"
            text = f" has {dim} coordinates, the bodies have {scene.dim}: give {scene.dim}."
            raise KeyedError(where, key, text)


def _check_side(scene: Content, where: str, name: str, between: object) -> None:
    """Refuse a side of a joint that is no rigid body, nor the ground."""
    bodies = {body.name: body for body in scene.bodies}
    if name == GROUND:
        return
    given = f" = {show(list(between))}: "  # type: ignore[call-overload]
    if name not in bodies:
        able = [*(body.name for body in scene.bodies if body.takes_joints), GROUND]
        near = nearest(name, able)
        meant = f"did you mean {show(near)}? " if near else ""
        text = f"there is no body {show(name)}; {meant}give two of {', '.join(able)}."
        raise KeyedError(where, "between", given + text)
    if not bodies[name].takes_joints:
        kind = bodies[name].kind
        text = (
            f"{name} is a {kind}, joints hold rigid bodies; model it as one, or remove the joint."
        )
        raise KeyedError(where, "between", given + text)
