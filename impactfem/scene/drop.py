"""Drops: bodies turned, placed where they touch first, with the speed of a fall."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from impactfem.scene.given import MaybeTable
from impactfem.scene.inline import InlineTable
from impactfem.scene.kinds import Real
from impactfem.scene.points import Point
from impactfem.scene.rigid import RigidBody
from impactfem.scene.rigid_forms import Form, form_of
from impactfem.scene.rigid_keys import Orientation, rotation
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.solids import Solid
from impactfem.scene.tables import own
from impactfem.scene.values import show

if TYPE_CHECKING:
    from impactfem.scene.scene import Scene

type Floats = NDArray[np.float64]

_LEFT = 4e-15  # share of the sizes that a gap may be left open
_STEPS = 100_000
_AROUND = 3600  # places of a circle that may touch


@table("[drop]")
class Drop:
    """A fall onto the obstacles: the scene starts at first touch.

    All bodies are turned together about the middle of them, moved along gravity until the first of
    them touches an obstacle, and get sqrt(2 g height) along gravity besides their own velocities.
    Joints and probes go along.

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


def dropped(scene: "Scene", drop: Drop) -> dict[str, Any]:
    """Tables of a scene that starts where a drop ends.

    Args:
        scene: As drawn.
        drop: How it falls.

    Raises:
        KeyedError: It cannot fall so.
    """
    down = _down(scene)
    turn = _turn(drop, scene.dim)
    outlines = [_outline(body) for body in scene.bodies]
    low = np.min([(nodes - r[:, None]).min(axis=0) for nodes, r, *_ in outlines], axis=0)
    high = np.max([(nodes + r[:, None]).max(axis=0) for nodes, r, *_ in outlines], axis=0)
    pivot: Floats = np.asarray(0.5 * (low + high), dtype=np.float64)
    size = float(np.linalg.norm(high - low))
    speed = math.sqrt(2.0 * float(np.linalg.norm(down)) * drop.height)
    down = down / np.linalg.norm(down)
    turned = [_turned(each, turn, pivot) for each in outlines]
    way = _way(scene, np.concatenate([t[0] for t in turned]),
               np.concatenate([t[1] for t in turned]), down, size)  # fmt: skip
    data = scene.to_dict()
    data.pop("drop", None)
    move = _Move(turn, pivot, way * down)
    for body, tables in zip(scene.bodies, data["body"], strict=True):
        _place(body, tables, move, drop)
        given = tables.get("velocity") or [0.0] * scene.dim
        tables["velocity"] = [
            _plus(one, more) for one, more in zip(given, (speed * down).tolist(), strict=True)
        ]
    for probe in data.get("probe", ()):
        probe["point"] = move.point(probe["point"])
    for heading in ("joint", "spring"):
        for index, tables in enumerate(data.get(heading, ())):
            _move_coupling(tables, move, f"{heading}[{index}]")
    return data


def _move_coupling(tables: dict[str, Any], move: "_Move", where: str) -> None:
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


class _Move:
    """Turns about a pivot, then shifts."""

    def __init__(self, turn: Floats, pivot: Floats, shift: Floats) -> None:
        self.turn, self.pivot, self.shift = turn, pivot, shift
        self.turns = not np.array_equal(turn, np.eye(len(turn)))

    def point(self, place: Sequence[float] | Floats) -> list[float]:
        at = np.asarray(place, dtype=np.float64)
        if self.turns:
            at = self.pivot + self.turn @ (at - self.pivot)
        return [float(each) for each in at + self.shift]

    def vector(self, along: Sequence[float]) -> list[float]:
        given = np.asarray(along, dtype=np.float64)
        turned = self.turn @ given if len(given) == len(self.turn) else given
        return [float(each) for each in turned]


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
        return rotation(np.asarray(drop.orientation.unit))
    angle = drop.orientation.in_plane
    if angle is None:
        raise KeyedError("drop", "orientation", ": in the plane all turns are about z: give angle.")
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def _outline(body: Any) -> tuple[Floats, Floats]:
    """Centres (n, dim) and radii (n,) of balls that reach as far as a body [m]."""
    faller = _FALLERS.get(type(body))
    if faller is None or (getattr(body, "shape", body) is None and not faller.takes_mesh):
        text = f" drops points, rigid bodies and solids with a shape; {body.name} is "
        kind = f"a {body.kind}" if faller is None else f"a {body.kind} from a mesh file"
        raise KeyedError("drop", "height", f"{text}{kind}: give its place and velocity instead.")
    return faller.outline(body)


def _of_point(body: Point) -> tuple[Floats, Floats]:
    return np.array([body.position], dtype=np.float64), np.array([body.radius])


def _of_form(form: Form, at: Floats, turn: Floats) -> tuple[Floats, Floats]:
    """Of a shape that is turned about a place."""
    nodes, radius = form.nodes, form.radius
    if len(form.rim):
        sizes = np.linalg.norm(form.rim, axis=1)
        rims = np.unique(np.column_stack([nodes, sizes, radius, form.axis]), axis=0)
        angles = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
        ways = np.linalg.svd(rims[:, None, 5:])[2][:, 1:]  # across each axis
        circles = np.einsum("ka,rkd->rad", [np.cos(angles), np.sin(angles)], ways)
        nodes = (rims[:, None, :3] + rims[:, 3, None, None] * circles).reshape(-1, 3)
        radius = np.repeat(rims[:, 4], _AROUND)
    return at + (nodes - at) @ turn.T, radius


def _turned(outline: tuple[Floats, Floats], turn: Floats, pivot: Floats) -> tuple[Floats, Floats]:
    nodes, radius = outline
    return pivot + (nodes - pivot) @ turn.T, radius


def _way(scene: "Scene", nodes: Floats, radius: Floats, down: Floats, size: float) -> float:
    """How far bodies go along gravity to their first touch [m].

    From above: lifted until they are clear of the obstacles, then by steps as long as the gap,
    within which nothing can touch.
    """

    def gap(way: float) -> float:
        places = nodes + way * down
        return min(float((o.gap(places)[0] - radius).min()) for o in scene.rigid_obstacles)

    reach = size + max(float(np.abs(nodes).max()), 1e-300)
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


def _place(body: Any, tables: dict[str, Any], move: _Move, drop: Drop) -> None:
    """Turn and move the tables of a body."""
    centre = _FALLERS[type(body)].turned(body, tables, move, drop)
    if not {"shape", "shapes", "mesh"} & set(tables):  # a point
        tables["position"] = move.point(tables["position"])
        return
    for refined in tables.get("refine", ()):
        refined["point"] = move.point(refined["point"])
    _shift(tables, np.asarray(move.point(centre)) - centre)


def _rigid_turned(body: RigidBody, tables: dict[str, Any], move: _Move, _: Drop) -> Floats:
    if move.turns:
        _orient(body, tables, move)
    return body.center


def _solid_turned(body: Solid, tables: dict[str, Any], move: _Move, drop: Drop) -> Floats:
    _check_even(body, tables)
    if move.turns:
        _turn_solid(body, tables, drop)
    return form_of(body.shape).centre


def _shift(tables: dict[str, Any], shift: Floats) -> None:
    """Move all places in the tables of a body with a shape or a surface."""

    def shifted(place: Sequence[float]) -> list[float]:
        return [float(each) for each in np.asarray(place, dtype=np.float64) + shift]

    homes: list[tuple[dict[str, Any], str]] = [(tables, "center_of_mass"), (tables, "position")]
    shapes: list[Any] = [own(each) for each in tables.get("shapes") or ()]
    if shapes:
        tables["shapes"] = shapes
    elif tables.get("shape") is None:
        tables.setdefault("position", [0.0] * len(shift))
    else:
        tables["shape"] = own(tables["shape"])
        shapes = [tables["shape"]]
    for shape in shapes:
        homes += [(shape, "corner"), (shape, "center")]
        if "points" in shape:
            shape["points"] = [shifted(each) for each in shape["points"]]
    for home, name in homes:
        if home.get(name) is not None:
            home[name] = shifted(home[name])


def _check_even(body: Solid, tables: Mapping[str, Any]) -> None:
    """Refuse motions of a solid that depend on places.

    Raises:
        KeyedError: One does.
    """
    for name in ("velocity", "displacement"):
        given = tables.get(name) or ()
        if any(isinstance(each, str) for each in given):
            text = f" = {show(list(given))} depends on places, which drop moves: give numbers."
            raise KeyedError(f"body.{body.name}", name, text)


def _orient(body: RigidBody, tables: dict[str, Any], move: _Move) -> None:
    """Turn a rigid body about its centre."""
    if body.dim == 2:
        tables["angle"] = body.angle + math.atan2(move.turn[1, 0], move.turn[0, 0])
        tables.pop("orientation", None)
        return
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  (slow to load)

    x, y, z, w = Rotation.from_matrix(move.turn @ body.rotation).as_quat()
    tables["orientation"] = {"quaternion": [float(each) for each in (w, x, y, z)]}


def _turn_solid(body: Solid, tables: Mapping[str, Any], drop: Drop) -> None:
    """Turn the shape of a solid, where it has an angle or looks the same."""
    shape = tables["shape"]
    if shape["kind"] in {"disc", "sphere", "ring"} and not body.is_axisymmetric:
        return
    angle = None if drop.orientation is None else drop.orientation.in_plane
    if "angle" not in shape or angle is None or body.is_axisymmetric:
        text = f": {body.name} is a solid whose shape takes no such turn; draw it turned."
        raise KeyedError("drop", "orientation", text)
    shape["angle"] = shape["angle"] + angle


def _plus(given: float | str, more: float) -> float | str:
    return f"{more!r} + ({given})" if isinstance(given, str) else given + more


class _Faller(NamedTuple):
    """How a kind of body falls.

    Attributes:
        outline: Balls that reach as far as it.
        turned: Turns its tables; its centre [m], (dim,).
        takes_mesh: Whether it may have a mesh instead of a shape.
    """

    outline: Callable[[Any], tuple[Floats, Floats]]
    turned: Callable[[Any, dict[str, Any], _Move, Drop], Floats]
    takes_mesh: bool = True


_FALLERS: Mapping[type[Any], _Faller] = {
    Point: _Faller(_of_point, lambda body, *_: np.asarray(body.position)),
    RigidBody: _Faller(
        lambda body: _of_form(body.form, body.center, body.rotation), _rigid_turned
    ),
    Solid: _Faller(
        lambda body: _of_form(form := form_of(body.shape), form.centre, np.eye(form.dim)),
        _solid_turned, takes_mesh=False,
    ),
}  # fmt: skip
