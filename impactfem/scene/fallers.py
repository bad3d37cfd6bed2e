"""How bodies of each kind fall: how far they reach, and how they are turned and moved."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.errors import MeshError
from impactfem.reading.opening import STEP, Job, opened
from impactfem.scene.beams import Beam, Rod
from impactfem.scene.boundary import SPACE
from impactfem.scene.formula import Formula
from impactfem.scene.mechanism import Mechanism
from impactfem.scene.mesh_files import MESH_FILES
from impactfem.scene.plate import Plate
from impactfem.scene.points import Point
from impactfem.scene.rigid import RigidBody
from impactfem.scene.rigid_forms import Form, form_of
from impactfem.scene.schema import KeyedError
from impactfem.scene.solids import Solid
from impactfem.scene.springs import SpringNet
from impactfem.scene.tables import own
from impactfem.scene.values import show

type Outline = tuple[Floats, Floats]
"""Centres (n, dim) and radii (n,) of balls that reach as far as a body [m]."""

type Curves = list[tuple[Floats, Floats]]
"""Centres (3,) and half axes by columns (3, 3) of ellipsoids [m]; of circles the last one is 0."""

type Reach = tuple[Outline, Curves]
"""How far a body reaches."""

_AROUND = 3600  # places of a circle that may touch
_ACROSS = 101  # places along a plate that may touch
_ALONG = 1e-9  # share by which gravity may miss the normal of a plate
_MILLIMETRE = 1e-3  # in m: Gmsh gives the lengths of STEP files in mm


class Move:
    """Turns about a pivot, then shifts; `angle` is that of a turn in the plane [rad]."""

    def __init__(self, turn: Floats, pivot: Floats, shift: Floats, angle: float | None) -> None:
        self.turn, self.pivot, self.shift, self.angle = turn, pivot, shift, angle
        self.turns = not np.array_equal(turn, np.eye(len(turn)))

    def point(self, place: Sequence[float] | Floats) -> list[float]:
        """A place where it comes to [m]."""
        at = np.asarray(place, dtype=np.float64)
        if self.turns:
            at = self.pivot + self.turn @ (at - self.pivot)
        return [float(each) for each in at + self.shift]

    def vector(self, along: Sequence[float]) -> list[float]:
        """A direction as it is then."""
        given = np.asarray(along, dtype=np.float64)
        turned = self.turn @ given if len(given) == len(self.turn) else given
        return [float(each) for each in turned]


def reach_of(body: Any, folder: Path) -> Reach:
    """How far a body reaches.

    Raises:
        KeyedError: It does not fall.
    """
    faller = _FALLERS.get(type(body))
    if faller is None:
        text = f" drops {', '.join(sorted(kind.kind for kind in _FALLERS))}; {body.name} is "
        raise KeyedError(
            "drop", "height", f"{text}a {body.kind}: give its place and velocity instead."
        )
    for support in getattr(body, "supports", ()):
        if not getattr(support, "mirrors", False) and getattr(support, "kind", "") != "free":
            text = f": {body.name} has supports, and what is held does not fall; leave drop out."
            raise KeyedError("drop", "height", text)
    return faller.outline(body, folder), faller.curves(body)


def place(body: Any, tables: dict[str, Any], move: Move, velocity: Floats) -> None:
    """Turn and move the tables of a body, and add a velocity [m/s], (dim,).

    Raises:
        KeyedError: It cannot be turned so, or not move so.
    """
    faller = _FALLERS[type(body)]
    faller.move(body, tables, move)
    faller.speed(body, tables, velocity)


def _of_point(body: Point, _: Path) -> Outline:
    return np.array([body.position], dtype=np.float64), np.array([body.radius])


def _of_form(form: Form, at: Floats, turn: Floats) -> Outline:
    """Of a shape that is turned about a place."""
    nodes, radius = form.nodes, form.radius
    if len(form.rim):
        centres, axes = _rims(form)
        angles = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
        around = np.stack([np.cos(angles), np.sin(angles)])
        circles = np.swapaxes(axes[..., :2] @ around, 1, 2).reshape(-1, 3)
        nodes = np.concatenate([nodes, np.repeat(centres, _AROUND, axis=0) + circles])
        radius = np.concatenate([radius, np.zeros(len(circles))])
    return at + (nodes - at) @ turn.T, radius


def _rims(form: Form) -> tuple[Floats, Floats]:
    """Centres (n, 3) and half axes by columns (n, 3, 3) of the rims of a shape [m]."""
    rims = np.column_stack([form.nodes, np.linalg.norm(form.rim, axis=1), form.axis])
    rims = np.unique(rims[rims[:, 3] > 0.0], axis=0)
    return rims[:, :3], flat(rims[:, 4:], rims[:, 3])


def flat(normals: Floats, radii: Floats) -> Floats:
    """Half axes by columns of circles, (n, 3, 3), with some normals (n, 3) and radii (n,)."""
    ways = np.linalg.svd(normals[:, None])[2][:, 1:]
    axes = np.zeros((len(normals), 3, 3))
    axes[..., :2] = radii[:, None, None] * np.swapaxes(ways, 1, 2)
    return axes


def _of_rigid(body: RigidBody, _: Path) -> Outline:
    """Nodes of its parts but ellipsoids, which `_curves_of` tells."""
    if not body.is_curved:
        return _of_form(body.form, body.center, body.rotation)
    each = [_of_form(part, body.center, body.rotation) for part in body.parts if not part.curved]
    nodes, radius = zip((np.zeros((0, 3)), np.zeros(0)), *each, strict=True)
    return np.concatenate(nodes), np.concatenate(radius)


def _curves_of(body: RigidBody) -> Curves:
    """Ellipsoids that are parts of a rigid body, and its rims."""
    if body.dim != 3:
        return []
    at, turn = np.asarray(body.center), body.rotation
    found = [(part.centre, np.diag(part.radii)) for part in body.parts if part.curved]
    if len(body.form.rim):
        found += zip(*_rims(body.form), strict=True)
    return [(at + turn @ (centre - at), turn @ axes) for centre, axes in found]


def _of_net(body: SpringNet, folder: Path) -> Outline:
    if body.shape is None:
        nodes = _nodes(body, body.dim, folder)
        return nodes, np.full(len(nodes), body.radius)
    nodes, radius = _of_form(form := form_of(body.shape), form.centre, np.eye(form.dim))
    return nodes, radius + body.radius


def _of_solid(body: Solid, folder: Path) -> Outline:
    if body.shape is not None:
        return _of_form(form := form_of(body.shape), form.centre, np.eye(form.dim))
    nodes = _nodes(body, body.dim, folder) @ body.turn.T
    if body.position is not None:
        nodes = nodes + body.position
    return nodes, np.zeros(len(nodes))


def _nodes(body: Any, dim: int, folder: Path) -> Floats:
    """Nodes of the mesh file of a body [m], (nodes, dim)."""
    path = Path(folder, body.mesh)
    unit = _MILLIMETRE if path.suffix.lower() in STEP else 1.0
    size = {} if body.mesh_size is None else {"Mesh.MeshSizeMax": body.mesh_size / unit}
    part = getattr(body, "part", None)
    job = Job(key="body.mesh", endings=MESH_FILES, dim=dim, options=size, unit=unit, part=part,
              arrays=True)  # fmt: skip
    try:
        with opened(path, job) as found:
            given = found.arrays
    except MeshError as error:
        raise KeyedError(body.kind, "mesh", f" = {show(body.mesh)}: {error}.") from None
    points = given["points"].reshape(-1, 3)[np.isin(given["tags"], given["used"])]
    return unit * np.asarray(points[:, :dim], dtype=np.float64)


def _of_rod(body: Rod, _: Path) -> Outline:
    return body.centreline(), np.full(2, body.radius)


def _of_beam(body: Beam, _: Path) -> Outline:
    nodes = body.node_places if body.touches_along else body.node_places[[0, -1]]
    return nodes, np.zeros(len(nodes))


def _of_plate(body: Plate, folder: Path) -> Outline:
    """Its rim and places within, on both faces."""
    flat = _nodes(body, 2, folder) if body.outline is None else _places(body.outline)
    thick = np.full(len(flat), body.depth)
    if body.thickness is not None and not body.thickness.is_constant:
        thick = np.broadcast_to(body.thickness(x=flat[:, 0], y=flat[:, 1]), thick.shape)
    centre, axes = body.frame
    middle, half = centre + flat @ axes[:2], 0.5 * thick[:, None] * axes[2]
    return np.concatenate([middle - half, middle + half]), np.zeros(2 * len(flat))


def _places(figure: Any) -> Floats:
    """Corners or a rim of the outline of a plate, and places within [m], (n, 2)."""
    if hasattr(figure, "radius"):
        angles = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
        rim = figure.radius * np.column_stack([np.cos(angles), np.sin(angles)])
    elif figure.shape is None:
        rim = figure.corners
    else:
        a, b = figure.place
        rim = np.array([[-a, -b], [a, -b], [a, b], [-a, b]])
    low, high = rim.min(axis=0), rim.max(axis=0)
    each = [np.linspace(*ends, _ACROSS) for ends in zip(low, high, strict=True)]
    grid = np.reshape(np.meshgrid(*each), (2, -1)).T
    sides = np.linspace(rim, np.roll(rim, -1, axis=0), _ACROSS if len(rim) < _AROUND else 1)
    within = grid[_inside(grid, rim)]
    if hole := getattr(figure, "inner_radius", 0.0):
        within = within[np.linalg.norm(within, axis=1) >= hole]
    return np.concatenate([sides.reshape(-1, 2), within])


def _inside(points: Floats, corners: Floats) -> Booleans:
    """Which points lie in a polygon: a ray along x crosses its sides an odd number of times."""
    inside = np.zeros(len(points), dtype=bool)
    x, y = points.T
    for (a, b), (c, d) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if b != d:
            inside ^= ((b > y) != (d > y)) & (x < a + (y - b) / (d - b) * (c - a))
    return inside


def _move_point(body: Point, tables: dict[str, Any], move: Move) -> None:
    tables["position"] = move.point(body.position)


def _move_rigid(body: RigidBody, tables: dict[str, Any], move: Move) -> None:
    if move.turns:
        _orient(body, tables, move)
    _shift(tables, np.asarray(move.point(body.center)) - body.center)


def _move_mechanism(body: Mechanism, tables: dict[str, Any], move: Move) -> None:
    tables["position"] = move.point(body.position)
    if move.turns:
        turn = np.eye(3) if body.orientation is None else body.orientation.matrix(3)
        tables["orientation"] = _oriented(move.turn @ turn)
    if body.place is not None:
        tables["place"] = {**tables["place"], "target": move.point(body.place.target)}


def _move_solid(body: Solid, tables: dict[str, Any], move: Move) -> None:
    _check_even(body, tables)
    if move.turns:
        if body.shape is None and not body.is_axisymmetric:
            tables["orientation"] = _oriented(move.turn @ body.turn)
        else:
            _turn_drawn(body, tables, move)
        _turn_materials(body, tables, move)
    for refined in tables.get("refine", ()):
        refined["point"] = move.point(refined["point"])
    if body.shape is None:
        tables["position"] = move.point(body.position or np.zeros(body.dim))
        return
    centre = form_of(body.shape).centre
    _shift(tables, np.asarray(move.point(centre)) - centre)


def _move_net(body: SpringNet, tables: dict[str, Any], move: Move) -> None:
    if move.turns:
        _turn_drawn(body, tables, move)
    if body.shape is None:
        text = f": {body.name} is a net from a mesh file, which has no place of its own; draw it "
        raise KeyedError("drop", "height", f"{text}where it touches.")
    centre = form_of(body.shape).centre
    _shift(tables, np.asarray(move.point(centre)) - centre)


def _move_slender(body: Rod | Beam, tables: dict[str, Any], move: Move) -> None:
    tables["center"] = move.point(body.center)
    curved = getattr(body, "centerline", None)
    if move.turns and curved is not None:
        given = [formula.text for formula in curved]
        tables["centerline"] = [
            " + ".join(f"{share!r}*({text})" for share, text in zip(row, given, strict=True))
            for row in move.turn[: body.dim, : body.dim].tolist()
        ]
        if len(curved) == 3:
            tables["width_axis"] = move.vector(cast("Beam", body).frame[2])
    elif move.turns and body.dim == 2:
        angle = body.inclination + math.atan2(move.turn[1, 0], move.turn[0, 0])
        tables["inclination"] = math.remainder(angle, 2.0 * math.pi)
    elif move.turns and isinstance(body, Beam):
        along, _, wide = body.frame
        tables["axis"], tables["width_axis"] = move.vector(along), move.vector(wide)


def _move_plate(body: Plate, tables: dict[str, Any], move: Move) -> None:
    tables["center"] = move.point(body.center)
    if move.turns:
        x, _, normal = body.frame[1] @ move.turn.T
        tables["normal"] = normal.tolist()
        along, across, _ = replace(body, normal=normal.tolist(), angle=0.0).frame[1]
        tables["angle"] = math.atan2(x @ across, x @ along)


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
    materials: Mapping[str, Any] = tables.get("materials") or {}
    homes = [(tables, ""), *((own, f"materials.{name}.") for name, own in materials.items())]
    for home, where in homes:
        for name in ("velocity", "displacement", "density", "youngs_modulus"):
            given = home.get(name)
            entries = given if isinstance(given, list) else [given]
            if any(isinstance(entry, str) for entry in entries):
                text = f" = {show(given)} depends on places, which drop moves: give numbers."
                raise KeyedError(f"body.{body.name}", f"{where}{name}", text)
    for name in ("tractions", "pressures"):
        for index, load in enumerate(getattr(body, name)):
            each = load.value if isinstance(load.value, tuple) else (load.value,)
            if any(isinstance(one, Formula) and one.used & {*SPACE} for one in each):
                text = " depends on places, which drop moves: give formulas of t."
                raise KeyedError(f"body.{body.name}", f"{name}[{index}].value", text)


def _orient(body: RigidBody, tables: dict[str, Any], move: Move) -> None:
    """Turn a rigid body about its centre."""
    if body.dim == 2:
        tables["angle"] = body.angle + math.atan2(move.turn[1, 0], move.turn[0, 0])
        tables.pop("orientation", None)
        return
    tables["orientation"] = _oriented(move.turn @ body.rotation)


def _oriented(turn: Floats) -> dict[str, Any]:
    """The table of a rotation matrix."""
    if len(turn) == 2:
        return {"angle": math.atan2(turn[1, 0], turn[0, 0])}
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  (slow to load)

    x, y, z, w = Rotation.from_matrix(turn).as_quat()
    return {"quaternion": [float(each) for each in (w, x, y, z)]}


def _turn_materials(body: Solid, tables: dict[str, Any], move: Move) -> None:
    """Turn the axes of materials of a solid with it.

    Raises:
        KeyedError: It has stresses at rest.
    """
    if body.has_residual_stress:
        text = f": {body.name} has residual_stress, whose components do not turn; draw it turned."
        raise KeyedError("drop", "orientation", text)
    materials: Mapping[str, Any] = tables.get("materials") or {}
    homes: list[tuple[dict[str, Any], Any]] = [(tables, body)]
    homes += [(materials[name], given) for name, given in body.materials.items()]
    for home, given in homes:
        if (law := given.orthotropic) is None:
            continue
        turn = np.eye(3)
        turn[: body.dim, : body.dim] = move.turn
        home["orthotropic"] = own(home["orthotropic"])
        home["orthotropic"].pop("angle", None)
        home["orthotropic"]["orientation"] = _oriented(turn @ law.axes)


def _turn_drawn(body: Solid | SpringNet, tables: Mapping[str, Any], move: Move) -> None:
    """Turn the shape of a body, where it has an angle or looks the same."""
    shape = tables.get("shape")
    axisymmetric = isinstance(body, Solid) and body.is_axisymmetric
    if shape and shape["kind"] in {"disc", "sphere", "ring"} and not axisymmetric:
        return
    if not shape or "angle" not in shape or move.angle is None or axisymmetric:
        what = "shape" if shape else "mesh file"
        text = f": {body.name} is a {body.kind} whose {what} takes no such turn; draw it turned."
        raise KeyedError("drop", "orientation", text)
    shape["angle"] = shape["angle"] + move.angle


def _add(_: Any, tables: dict[str, Any], velocity: Floats) -> None:
    """Add a velocity to that along the axes of the scene."""
    given = tables.get("velocity") or [0.0] * len(velocity)
    tables["velocity"] = [
        _plus(one, more) for one, more in zip(given, velocity.tolist(), strict=True)
    ]


def _add_along_normal(body: Plate, tables: dict[str, Any], velocity: Floats) -> None:
    """Add a velocity to that of a plate, which moves along its normal alone."""
    normal = np.asarray(tables["normal"], dtype=np.float64)
    normal = normal / np.linalg.norm(normal)
    along = float(velocity @ normal)
    if np.linalg.norm(velocity - along * normal) > _ALONG * np.linalg.norm(velocity):
        text = f": {body.name} is a plate, which moves along its normal, and gravity does not: "
        raise KeyedError("drop", "height", f"{text}turn it, or gravity, so that it falls flat.")
    tables["velocity"] = _plus(tables.get("velocity") or 0.0, along)


def _plus(given: float | str, more: float) -> float | str:
    return f"{more!r} + ({given})" if isinstance(given, str) else given + more


def _no_curves(_: Any) -> Curves:
    return []


def _of_file(body: Mechanism, _: Path) -> Outline:
    """Of what is told with the drop, by who reads its file."""
    raise AssertionError(body.file)


class _Faller(NamedTuple):
    """How a kind of body falls.

    Attributes:
        outline: Balls that reach as far as it.
        move: Turns and moves its tables.
        speed: Adds a velocity to them.
        curves: What else reaches as far as it.
    """

    outline: Callable[[Any, Path], Outline]
    move: Callable[[Any, dict[str, Any], Move], None]
    speed: Callable[[Any, dict[str, Any], Floats], None] = _add
    curves: Callable[[Any], Curves] = _no_curves


_FALLERS: Mapping[type[Any], _Faller] = {
    Point: _Faller(_of_point, _move_point),
    RigidBody: _Faller(_of_rigid, _move_rigid, curves=_curves_of),
    Solid: _Faller(_of_solid, _move_solid),
    SpringNet: _Faller(_of_net, _move_net),
    Rod: _Faller(_of_rod, _move_slender),
    Beam: _Faller(_of_beam, _move_slender),
    Plate: _Faller(_of_plate, _move_plate, _add_along_normal),
    Mechanism: _Faller(_of_file, _move_mechanism),
}  # fmt: skip
