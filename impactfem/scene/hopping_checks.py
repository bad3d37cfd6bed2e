"""Checks of Raibert's controllers: whether the scene has the leg that they make hop."""

import numpy as np

from impactfem.scene.content import Content
from impactfem.scene.controllers import Controller
from impactfem.scene.joints import Joint
from impactfem.scene.pairing import named_body_pairs, obstacles_of, pair_name
from impactfem.scene.rigid import RigidBody
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show


def check_hoppers(scene: Content) -> None:
    """Refuse controllers of legs that the scene does not have.

    Raises:
        KeyedError: naming the key.
    """
    for index, own in enumerate(scene.controllers):
        if own.law == "raibert":
            _check_hopper(scene, f"controller[{index}]", own)


def _check_hopper(scene: Content, where: str, own: Controller) -> None:
    rigid = rigid_of(scene) if scene.dim == 2 else {}
    for name, given in (("body", own.body), ("foot", own.foot)):
        if given not in rigid:
            text = f" = {show(given)} is no rigid body in the plane: give one of "
            raise KeyedError(where, name, f"{text}{', '.join(rigid) or 'these, there is none'}.")
    body, foot = str(own.body), str(own.foot)
    if not contacts_of(scene, foot) or body == foot:
        text = f" = {show(foot)} is to meet an obstacle or a body, and to be at the end of a leg: "
        raise KeyedError(where, "foot", f"{text}give another, or a [[contact]] of it.")
    leg = motor_of(scene, where, "acts", own.acts, "prismatic")
    if own.hip is not None:
        hip = motor_of(scene, where, "hip.acts", own.hip.acts, "revolute")
        if body not in hip.bodies:
            text = f" = {show(own.hip.acts)} does not hold {body}: give the joint of it and its leg"
            raise KeyedError(where, "hip.acts", f"{text}.")
        if own.hip.stance is None and not leg.stiffness:
            text = f" is missing: {leg.name} has no stiffness that tells it; give a time."
            raise KeyedError(where, "hip.stance", text)
    down = np.atleast_1d(scene.gravity.values[0]).tolist()
    if len(down) != 2 or down[0] or down[1] >= 0.0:
        text = f" = {show(down)}: {body} hops along y against it; give [0.0, -9.81], say."
        raise KeyedError("", "gravity", text)


def rigid_of(scene: Content) -> dict[str, RigidBody]:
    """Rigid bodies of a scene by name."""
    return {body.name: body for body in scene.bodies if isinstance(body, RigidBody)}


def motor_of(scene: Content, where: str, name: str, path: str, kind: str) -> Joint:
    """The joint of which a path is the motor.

    Raises:
        KeyedError: There is none, or it is of another kind.
    """
    known = {f"joint.{each.name}.motor": each for each in scene.joints if each.kind == kind}
    if path not in known:
        there = ", ".join(known) or "one, there is none"
        text = f" = {show(path)} is no motor of a {kind} joint: give {there}."
        raise KeyedError(where, name, text)
    return known[path]


def contacts_of(scene: Content, name: str) -> list[str]:
    """Names of the pairs by which a body touches."""
    found = [pair_name(scene, name, obstacle.name) for obstacle in obstacles_of(scene, name)]
    between = named_body_pairs(scene)
    return found + [pair for pair, (one, _), (two, _) in between if name in {one, two}]
