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
from impactfem.trajectory.rotations import quaternion_rates
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
        friction: Largest dry friction of each [N m, N].
        rotors: Inertia that each has besides [kg m^2, kg].
        motors: In t, q and v, by place.
    """

    freedoms: list[Freedom]
    above: list[list[int]]
    parts: list[Part]
    rates: Floats
    limits: list[tuple[float, float]]
    damping: Floats
    friction: Floats
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
    _check(body, [*tree.followers], tree.rates != len(tree.single) + 6 * tree.free)
    if acting.driven:
        names = [name for name, at in tree.single.items() if at in acting.driven]
        raise SceneError(
            f"body.{body.name}.joints.{names[0]}.position: a formula drives it; a trajectory knows "
            "motors and damping"
        )
    model = tree.model
    order = list(range(1, model.njoints))
    turns, places = tree.poses(q, order)
    jacobians = tree.jacobians(q, order)
    names = list(model.names)[1:]
    single = [name for name in names if name in tree.single]
    at = [tree.single[name] for name in single]
    freedoms, above, parts = list[Freedom](), list[list[int]](), list[Part]()
    rates = v[at]
    if tree.free:
        quaternion = np.roll(q[3:7], 1)
        freedoms += Freedom.free(f"{body.name}.{tree.root}", places[0], quaternion)
        spins = quaternion_rates(quaternion, tree.base(q) @ v[3:6])
        rates = np.concatenate([v[:3], spins, rates])
    base = len(freedoms)
    for k, name in enumerate(names):
        own = list(range(base))
        if name in tree.single:
            own = [len(freedoms)]
            along, about = np.split(jacobians[k, :, tree.single[name]], 2)
            rotates = bool(np.linalg.norm(about) > _TURNS)
            freedoms.append(
                Freedom(f"{body.name}.{name}.q", f"{body.name}.{name}.v", rotates,
                        about if rotates else along, places[k], tree.position(q, name))
            )  # fmt: skip
        hangs = int(model.parents[k + 1]) - 1
        above.append([*(above[hangs] if hangs >= 0 else []), *own])
        inertia = model.inertias[k + 1]
        parts.append(
            Part(f"{body.name}/{name}", (), float(inertia.mass),
                 places[k] + turns[k] @ np.asarray(inertia.lever),
                 turns[k] @ np.asarray(inertia.inertia) @ turns[k].T)
        )  # fmt: skip
    ends = np.array(tree.limits())[:, at].T
    motors = {
        base + k: motor for k, name in enumerate(single)
        if (motor := motor_of(body, robot, name, freedoms[base + k].start, v[at[k]])) is not None
    }  # fmt: skip
    none = np.zeros(base)
    return RobotParts(
        freedoms, above, parts, rates,
        [(-np.inf, np.inf)] * base + [(float(low), float(high)) for low, high in ends],
        np.append(none, acting.damping[at]), np.append(none, acting.friction[at]),
        np.append(none, np.asarray(model.armature, dtype=float)[at]), motors,
    )  # fmt: skip


def _check(body: Mechanism, followers: list[str], more: bool) -> None:
    """Refuse what moves in other ways than by a joint of one freedom each.

    Raises:
        SceneError: It does.
    """
    why = ""
    if followers:
        why = f"joint {followers[0]} follows another; a trajectory knows joints of their own"
    elif more:
        why = "a joint has several freedoms; a trajectory knows those that turn or slide"
    if why:
        raise SceneError(f"body.{body.name}: {why}")
