"""Mechanisms of robot files as parts of a tree in symbols: axes, masses, motors as they begin."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene import Mechanism, Scene
from impactfem.scene.formula import Formula
from impactfem.scene.schema import KeyedError
from impactfem.system.mechanism import motor_of, start_of
from impactfem.system.mechanism_file import read_mechanism
from impactfem.trajectory.tree import Freedom, Part

_TURNS = 0.5  # length of an axis of length 1, or of none


@dataclass(frozen=True)
class RobotParts:
    """A mechanism as parts of a tree.

    Attributes:
        freedoms: Its coordinates; each moves a part, after those that move what it hangs on.
        above: Places of the freedoms that move each part, from the ground on.
        parts: Of these, with no freedoms yet.
        rates: At t = 0, of each coordinate.
        limits: Least and largest, of each.
        damping: Of each [N m s, N s/m].
        rotors: Inertia that each has besides [kg m^2, kg].
        motors: In t, q and v, by place.
    """

    freedoms: list[Freedom]
    above: list[list[int]]
    parts: list[Part]
    rates: Floats
    limits: list[tuple[float, float]]
    damping: Floats
    rotors: Floats
    motors: Mapping[int, Formula]


def robot_parts(scene: Scene, body: Mechanism) -> RobotParts:
    """A mechanism of a scene.

    Raises:
        SceneError: It has joints that have no such form; or what its file or keys say is wrong.
    """
    try:
        robot = read_mechanism(body, scene.folder)
        tree = robot.tree
        acting, q, v, _ = start_of(body, robot)
    except KeyedError as error:
        raise error.moved(f"body[{scene.bodies.index(body)}]") from None
    _check(body, tree.free, [*tree.followers], tree.rates != len(tree.single))
    if acting.driven or acting.friction.any():
        what = "position: a formula drives it" if acting.driven else "friction: is not smooth"
        names = [n for n, at in tree.single.items() if at in acting.driven or acting.friction[at]]
        raise SceneError(
            f"body.{body.name}.joints.{names[0]}.{what}; a trajectory knows motors and damping"
        )
    model = tree.model
    order = list(range(1, model.njoints))
    turns, places = tree.poses(q, order)
    jacobians = tree.jacobians(q, order)
    names = list(model.names)[1:]
    freedoms, above, parts = list[Freedom](), list[list[int]](), list[Part]()
    for k, name in enumerate(names):
        along, about = np.split(jacobians[k, :, tree.single[name]], 2)
        rotates = bool(np.linalg.norm(about) > _TURNS)
        freedoms.append(
            Freedom(f"{body.name}.{name}.q", f"{body.name}.{name}.v", rotates,
                    about if rotates else along, places[k], tree.position(q, name))
        )  # fmt: skip
        hangs = int(model.parents[k + 1]) - 1
        above.append([*(above[hangs] if hangs >= 0 else []), k])
        inertia = model.inertias[k + 1]
        parts.append(
            Part(f"{body.name}/{name}", (), float(inertia.mass),
                 places[k] + turns[k] @ np.asarray(inertia.lever),
                 turns[k] @ np.asarray(inertia.inertia) @ turns[k].T)
        )  # fmt: skip
    at = [tree.single[name] for name in names]
    ends = np.array(tree.limits())[:, at].T
    motors = {
        k: motor for k, name in enumerate(names)
        if (motor := motor_of(body, robot, name, freedoms[k].start, v[at[k]])) is not None
    }  # fmt: skip
    return RobotParts(
        freedoms, above, parts, v[at], [(float(a), float(b)) for a, b in ends], acting.damping[at],
        np.asarray(model.armature, dtype=float)[at], motors,
    )  # fmt: skip


def _check(body: Mechanism, free: bool, followers: list[str], more: bool) -> None:
    """Refuse what moves in other ways than by a joint of one freedom each.

    Raises:
        SceneError: It does.
    """
    why = ""
    if free:
        why = "its base flies freely; a trajectory knows mechanisms whose base is fixed"
    elif followers:
        why = f"joint {followers[0]} follows another; a trajectory knows joints of their own"
    elif more:
        why = "a joint has several freedoms; a trajectory knows those that turn or slide"
    if why:
        raise SceneError(f"body.{body.name}: {why}")
