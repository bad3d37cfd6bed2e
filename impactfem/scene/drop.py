"""Drops: bodies turned, placed where they touch first, with the speed of a fall."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from impactfem.scene.fallers import Curves, Move, Outline, Reach, place, reach_of
from impactfem.scene.given import MaybeTable
from impactfem.scene.inline import InlineTable
from impactfem.scene.kinds import Real
from impactfem.scene.rigid_keys import Orientation
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.scene.scene import Scene

type Floats = NDArray[np.float64]

_LEFT = 4e-15  # share of the sizes that a gap may be left open
_STEPS = 100_000
_FLAT = 1e-300  # what a circle along a surface reaches towards it [m]
_TURNS = 60  # looks for where an ellipsoid is nearest to what is round


@table("[drop]")
class Drop:
    """A fall onto the obstacles: the scene starts at first touch.

    All bodies are turned together about the middle of them, moved along gravity until the first of
    them touches an obstacle, and get sqrt(2 g height) along gravity besides their own velocities.
    Joints, springs and probes go along. Mechanisms fall as their joints begin.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "drop"

    height: float = key(
        Real(at_least=0), "of the lowest point over the obstacle, along gravity", unit="m"
    )
    orientation: MaybeTable[Orientation] = key(
        InlineTable((Orientation,)), "turns all bodies before", default=None, absent="as drawn"
    )


def dropped(scene: "Scene", drop: Drop, reach: Mapping[str, Reach]) -> dict[str, Any]:
    """Tables of a scene that starts where a drop ends.

    Args:
        scene: As drawn.
        drop: How it falls.
        reach: How far bodies reach whose files are read elsewhere, by name.

    Raises:
        KeyedError: It cannot fall so.
    """
    down = _down(scene)
    turn = _turn(drop, scene.dim)
    bodies = [body for body in scene.bodies if not body.attached]
    folder = Path(scene.folder or "")
    reaches = [reach.get(body.name) or reach_of(body, folder) for body in bodies]
    outlines = [each for each, _ in reaches]
    round_ones = [each for _, own in reaches for each in own]
    boxes = [(nodes, r[:, None]) for nodes, r in outlines]
    boxes += [(at[None], np.linalg.norm(axes, axis=1)[None]) for at, axes in round_ones]
    low = np.min([(at - half).min(axis=0, initial=np.inf) for at, half in boxes], axis=0)
    high = np.max([(at + half).max(axis=0, initial=-np.inf) for at, half in boxes], axis=0)
    pivot: Floats = np.asarray(0.5 * (low + high), dtype=np.float64)
    size = float(np.linalg.norm(high - low))
    speed = math.sqrt(2.0 * float(np.linalg.norm(down)) * drop.height)
    down = down / np.linalg.norm(down)
    turned = [_turned(each, turn, pivot) for each in outlines]
    round_ones = [(pivot + turn @ (at - pivot), turn @ axes) for at, axes in round_ones]
    nodes, radius = (np.concatenate(each) for each in zip(*turned, strict=True))
    way = _way(scene, nodes, radius, round_ones, down, size)
    data = scene.to_dict()
    data.pop("drop", None)
    angle = None if drop.orientation is None else drop.orientation.in_plane
    move = Move(turn, pivot, way * down, angle)
    for body, tables in zip(bodies, data["body"], strict=True):
        place(body, tables, move, speed * down)
    for probe in data.get("probe", ()):
        probe["point"] = move.point(probe["point"])
    for heading in ("joint", "spring", "point_mass"):
        for index, tables in enumerate(data.get(heading, ())):
            _move_coupling(tables, move, f"{heading}[{index}]")
    return data


def _move_coupling(tables: dict[str, Any], move: Move, where: str) -> None:
    """Turn and move the tables of a joint or a spring.

    Raises:
        KeyedError: It holds the ground.
    """
    between = list(tables.get("between", ()))  # of a gear none
    if "ground" in between:
        text = f" = {show(between)}: what is held does not fall; leave drop out."
        raise KeyedError(where, "between", text)
    for name in {"point", "points", "axis", "second_axis"} & {*tables}:
        values = tables[name]
        if name == "points":
            tables[name] = [move.point(each) for each in values]
        else:
            tables[name] = move.point(values) if name == "point" else move.vector(values)


def _down(scene: "Scene") -> Floats:
    """Gravity [m/s^2], (dim,)."""
    if scene.bars:
        raise KeyedError("drop", "height", ": a bar falls by its gap and velocity; leave drop out.")
    gravity = scene.vector_gravity
    down = np.asarray(gravity.at(0.0), dtype=np.float64)
    if not down.any() or not gravity.is_constant:
        raise KeyedError("drop", "height", ": without a constant gravity nothing falls: give one.")
    if not scene.obstacles:
        raise KeyedError("drop", "height", ": there is no obstacle to fall onto: give one.")
    for obstacle in scene.rigid_obstacles:
        if obstacle.moves:
            text = f": {obstacle.name} moves; drops onto obstacles that stand still only."
            raise KeyedError("drop", "height", text)
    return down


def _turn(drop: Drop, dim: int) -> Floats:
    """Rotation matrix, (dim, dim)."""
    if drop.orientation is None or dim == 1:
        return np.eye(dim)
    if dim == 3:
        drop.orientation.check_in_space("drop")
    elif drop.orientation.in_plane is None:
        raise KeyedError("drop", "orientation", ": in the plane all turns are about z: give angle.")
    return drop.orientation.matrix(dim)


def _turned(outline: Outline, turn: Floats, pivot: Floats) -> Outline:
    nodes, radius = outline
    return pivot + (nodes - pivot) @ turn.T, radius


def _nearest(obstacle: Any, centre: Floats, axes: Floats) -> float:
    """Gap of an ellipsoid or a circle, by the normal where it is nearest [m]."""
    normal = obstacle.gap(centre[None])[1][0]
    for _ in range(_TURNS):
        along = axes.T @ normal
        there = centre - axes @ along / max(float(np.linalg.norm(along)), _FLAT)
        gap, found = obstacle.gap(there[None])
        if np.abs(found[0] - normal).max() <= _LEFT:
            break
        normal = found[0]
    return float(gap[0])


def _way(
    scene: "Scene", nodes: Floats, radius: Floats, round_ones: Curves,
    down: Floats, size: float,
) -> float:  # fmt: skip
    """How far bodies go along gravity to their first touch [m].

    From above: lifted until they are clear of the obstacles, then by steps as long as the gap,
    within which nothing can touch.
    """

    def gap(way: float) -> float:
        found = []
        for o in scene.rigid_obstacles:
            if len(nodes):
                found.append(float((o.gap(nodes + way * down)[0] - radius).min()))
            found += [_nearest(o, at + way * down, axes) for at, axes in round_ones]
        return min(found)

    far = max([float(np.abs(nodes).max(initial=0.0)), *(np.abs(at).max() for at, _ in round_ones)])
    reach = size + max(far, 1e-300)
    way, lift = 0.0, reach
    while gap(way) <= 0.0:
        way -= lift
        lift *= 2.0
        if lift > 1e9 * reach:
            text = ": however high, bodies lie in an obstacle; turn gravity or the obstacle."
            raise KeyedError("drop", "height", text)
    for _ in range(_STEPS):
        left = gap(way)
        if left <= _LEFT * (reach + abs(way)):
            return way
        way += left
        if way > 1e6 * reach:
            break
    raise KeyedError("drop", "height", ": falling along gravity, bodies meet no obstacle.")
