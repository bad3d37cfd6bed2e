"""Checks across the tables of a scene: body against obstacles, gravity, settings and output."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import is_dataclass
from functools import cache
from typing import Any, cast

from impactfem.methods import METHODS
from impactfem.scene.bar_checks import check_drive
from impactfem.scene.bar_row_checks import check_apart, check_bar_row, check_walls
from impactfem.scene.body import Solver
from impactfem.scene.breaks import check_motion
from impactfem.scene.column_names import check_column_names
from impactfem.scene.content import BODIES, Content
from impactfem.scene.finite_checks import check_finite, check_relaxing
from impactfem.scene.formula import Formula
from impactfem.scene.inverse import check_asked
from impactfem.scene.joint_checks import check_couplings, check_joints, check_ties
from impactfem.scene.loads import PiecewiseConstant, PiecewiseVector
from impactfem.scene.mixed import check_dimensions, check_mixed
from impactfem.scene.obstacle_checks import check_gravity, check_obstacles
from impactfem.scene.pair_checks import check_adhesion, check_itself, check_pairs, check_springs
from impactfem.scene.pairing import self_meeting
from impactfem.scene.probe_checks import check_probes
from impactfem.scene.schema import KeyedError, keys_of
from impactfem.scene.values import show
from impactfem.scene.vibro_checks import FAMILY, check_vibro

# Keys of [solve] that only one kind of body knows, and what to do instead.
_BAR_ONLY: Mapping[str, str] = {
    "elements": "set body.mesh_size",
    "window": "remove it, a solid is solved step by step",
    "degree": "set body.degree",
    "fitted": "remove it, it belongs to method dg of bars",
    "accuracy": "set body.mesh_size, and estimate = true to learn the error",
    "mesh": "set body.mesh",
}
_SOLID_ONLY = ("normals", "linear_solver", "estimate")
_ELASTIC_ONLY = ("courant", "active_set", "gamma", "max_iterations")
_VIBRO_ONLY = ("impact_law", "stick_speed")

_RUBBING = ("friction of bodies without waves", ("friction_residual",))
_BARS: Sequence[tuple[str, Sequence[str]]] = (
    (FAMILY, _VIBRO_ONLY),
    ("solids", _SOLID_ONLY),
    _RUBBING,
)
_FOREIGN: Mapping[Solver, Sequence[tuple[str, Sequence[str]]]] = {
    "bar": _BARS,
    "bar_row": _BARS,
    "march": ((FAMILY, _VIBRO_ONLY[1:]),),
    "vibro": (
        ("solids", _SOLID_ONLY[:2]),
        ("bars and solids", (*_BAR_ONLY, *_ELASTIC_ONLY)),
        _RUBBING,
    ),
}
"""Whose keys what solves a scene does not know."""


def check_scene(scene: Content, gravity: object) -> None:
    """Refuse a scene whose tables contradict each other.

    Args:
        scene: the scene, its fields checked one by one.
        gravity: as given, for messages.

    Raises:
        KeyedError: naming the key.
    """
    _check_signals(scene)
    _check_names(scene)
    check_joints(scene)
    check_couplings(scene)
    check_ties(scene)
    check_itself(scene)
    check_springs(scene)
    check_adhesion(scene)
    _check_counts(scene)
    if len(scene.bars) > 1 or (scene.bars and not scene.obstacles):
        check_bar_row(scene)
    elif scene.bars:
        _check_bar(scene, gravity)
    else:
        check_dimensions(scene)
        if scene.dim == 1:
            check_apart(scene)
        _check_bodies(scene)
        check_obstacles(scene)
        check_gravity(scene, gravity)
        (_check_marched if scene.marches else check_vibro)(scene)
    _check_start(scene)
    check_column_names(scene)
    check_probes(scene)
    if any(own.law == "raibert" for own in scene.controllers):
        from impactfem.scene.hopping_checks import check_hoppers  # noqa: PLC0415  (rarely)

        check_hoppers(scene)
    check_asked(scene)
    _check_settings(scene)
    if scene.solve.dt is not None and scene.solve.dt > scene.duration:
        text = f" = {scene.solve.dt} exceeds duration = {scene.duration}: give a smaller step."
        raise KeyedError("solve", "dt", text)


def _check_signals(scene: Content) -> None:
    """Refuse measured signals of another unit, or that do not last as long as the run."""
    for index, part in enumerate(scene.gravity.given or ()):
        place = f"gravity[{index}]" if isinstance(scene.gravity, PiecewiseVector) else "gravity"
        if isinstance(part, Formula):
            _check_record(scene.duration, part, ("", place, "m/s^2"))
    for where, table in (("body", scene.bodies), ("obstacle", scene.obstacles),
                         ("joint", scene.joints), ("controller", scene.controllers)):  # fmt: skip
        for index, entry in enumerate(table):
            _check_records(scene.duration, entry, f"{where}[{index}]")


def _check_records(duration: float, table: Any, where: str) -> None:
    """The same for what stands in one table."""
    end = getattr(table, "until", None)
    end = duration if end is None else min(duration, end)
    for name, (place, unit) in _places(cast("Any", type(table))).items():
        value = getattr(table, name)
        if isinstance(value, tuple | list):
            plain = not value or isinstance(value[0], float | int | str)
            each = [] if plain else [(f"{place}[{k}]", entry) for k, entry in enumerate(value)]
        elif isinstance(value, Mapping):
            each = [(f"{place}.{own}", entry) for own, entry in value.items()]
        else:
            each = [(place, value)]
        for own, entry in each:
            if isinstance(entry, Formula):
                _check_record(end, entry, (where, own, unit))
            elif is_dataclass(entry):
                _check_records(duration, entry, f"{where}.{own}")


@cache
def _places(cls: Any) -> Mapping[str, tuple[str, str]]:
    """Names of the keys of a table in scenes, and their units, by field."""
    return {name: (key.name, key.unit) for name, key in keys_of(cls).items()}


def _check_record(end: float, formula: Formula, at: tuple[str, str, str]) -> None:
    """The same for one signal, which stands somewhere, in a unit."""
    if formula.record is None:
        return
    where, name, wanted = at
    (first, last), unit = formula.record
    shown, room = f" = {show(formula.plain)}", 1e-9 * end
    if last < end - room:
        text = f"{shown} ends at t = {last:g} s, before the run, which lasts {end:g} s: give a "
        raise KeyedError(where, name, f"{text}longer record, or duration = {last:g}.")
    if first > room:
        text = f"{shown} begins at t = {first:g} s, after the run: give a record from t = 0 on."
        raise KeyedError(where, name, text)
    if unit and wanted and _unit(unit) not in {_unit(each) for each in wanted.split(" or ")}:
        text = f"{shown} is in {show(unit)}, and this in {wanted}: convert it, as by "
        raise KeyedError(where, name, f'{text}formula = "1e-3*signal".')


def _unit(text: str) -> str:
    """A unit, however its powers and products are written."""
    plain = text.replace("**", "^").replace("\u00b2", "^2").replace("\u00b3", "^3")
    return re.sub(r"(?<=[A-Za-z])(?=-?\d)", "^", re.sub(r"[\s.*\u00b7]", "", plain))


def _check_residual(scene: Content) -> None:
    """Refuse a residual of friction where no sweeps look for its forces."""
    asked = scene.solve.friction_residual
    rubs = any(law.friction_coefficient for law in scene.contacts)
    if asked is None or (rubs and not all(body.waves for body in scene.bodies)):
        return
    text = f" = {show(asked)} is for friction of bodies without waves, of which there is none here"
    raise KeyedError("solve", "friction_residual", f"{text}: remove it.")


def _check_bodies(scene: Content) -> None:
    for index, body in enumerate(scene.bodies):
        try:
            body.check_beside(scene.bodies)
        except KeyedError as error:
            raise error.moved(f"body[{index}]") from None


def _check_ends(scene: Content, body: Any, place: str) -> None:
    """Refuse what ends before it did anything."""
    for name in () if scene.starts_at_rest else ("supports", "tractions", "pressures"):
        for index, entry in enumerate(getattr(body, name, ())):
            if getattr(entry, "until", None) == 0.0:
                text = " = 0 ends before it did anything: give a later time, remove it, or give "
                text += 'start = "static", so that the motion begins in equilibrium with it.'
                raise KeyedError(place, f"{name}[{index}].until", text)


def _check_marched(scene: Content) -> None:
    places = {body.name: f"body[{index}]" for index, body in enumerate(scene.bodies)}
    for body in scene.bodies:
        _check_ends(scene, body, places[body.name])
        for index, support in enumerate(getattr(body, "supports", ())):
            name = "value" if hasattr(support, "value") else "motion"
            if not (given := getattr(support, name, None)):
                continue
            given = given if isinstance(given, tuple) else (given,)
            # A displacement that is given may be that of a body that fits its supports.
            shaped = getattr(body, "displacement", ())
            each = shaped if isinstance(shaped, tuple) else (shaped,)
            fitted = any(u.plain != 0.0 for u in each)
            begins = not (scene.starts_at_rest or fitted)
            key = f"supports[{index}].{name}"
            end = min(scene.duration, getattr(support, "until", None) or scene.duration)
            check_motion(places[body.name], key, given, end, from_zero=begins)
    check_finite(scene)
    check_relaxing(scene)
    _check_residual(scene)
    mixed = len(scene.solids) < len(scene.bodies)
    if not mixed:
        check_pairs(scene)
    if mixed or scene.couplings:
        check_mixed(scene)


def _check_start(scene: Content) -> None:
    """Refuse a start at rest of bodies that cannot be brought there."""
    if not scene.starts_at_rest:
        return
    unsettled = [body for body in scene.bodies if not body.settles]
    if unsettled:
        body = unsettled[0]
        able = " and ".join(kind for kind, cls in BODIES.items() if cls.settles)
        text = f" = {show(scene.start)} brings bodies of kind {able} to rest, {body.name} is a "
        text += f"{body.kind}: remove "
        raise KeyedError("", "start", f"{text}it, or model that body as one of these.")


def _check_names(scene: Content) -> None:
    taken: dict[str, str] = {}
    for index, body in enumerate(scene.bodies):
        if body.name in taken:
            text = f" = {show(body.name)} is the name of {taken[body.name]} too: give another name."
            raise KeyedError(f"body[{index}]", "name", text)
        taken[body.name] = f"body[{index}]"
    for index, obstacle in enumerate(scene.obstacles):
        if scene.bars and index:
            break  # too many anyhow
        if obstacle.name in taken:
            what = taken[obstacle.name]
            text = f" = {show(obstacle.name)} is the name of {what} too: give another name."
            raise KeyedError(f"obstacle[{index}]", "name", text)
        taken[obstacle.name] = f"obstacle[{index}]"


def _check_counts(scene: Content) -> None:
    """Refuse places in space of bars alone, and laws without use."""
    for index, bar in enumerate(scene.bars):
        if bar.point is not None:
            text = f" = {show(list(bar.point))} is for bars beside other bodies: these lie on the "
            raise KeyedError(f"body[{index}]", "point", f"{text}x axis; give gap instead.")
    if len(scene.bodies) > 1 or scene.couplings:
        return
    if any(body.may_meet_nothing or not body.waves for body in scene.bodies):
        return
    if not scene.obstacles and not self_meeting(scene):
        kind = "wall" if scene.bars else "half_space"
        text = " is missing: there is none (obstacle = []); give one or more [[obstacle]], as "
        text += f"kind = {show(kind)}."
        raise KeyedError("obstacle", "", text)
    if scene.contacts and scene.bars and not scene.gives_way:
        text = (
            f" = {show(scene.contacts[0])} is for points, rods, beams and solids: a bar rebounds "
        )
        text += "by its own elasticity, without friction; remove [[contact]], or give a stiffness."
        raise KeyedError("contact[0]", "", text)


def _check_bar(scene: Content, gravity: object) -> None:
    if len(scene.obstacles) != 1:
        shown, count = show(list(scene.obstacles)), len(scene.obstacles)
        why = f"there are {count}, but a bar meets one wall; give exactly one [[obstacle]]"
        raise KeyedError("obstacle", "", f" = {shown} is not allowed: {why}.")
    check_walls(scene)
    if not isinstance(scene.gravity, PiecewiseConstant):
        why = (
            "it is a vector, but a bar moves along one axis with gravity positive towards the wall "
            "(gravity = 9.81); give a number or a table of numbers"
        )
        raise KeyedError("", "gravity", f" = {show(gravity)} is not allowed: {why}.")
    if scene.output.checkpoint:
        text = f" = {scene.output.checkpoint}: bars are not checkpointed; remove it."
        raise KeyedError("output", "checkpoint", text)
    check_drive(scene)


def _check_settings(scene: Content) -> None:
    """Refuse settings that belong to another kind of body."""
    solve = scene.solve
    method = None if solve.method is None else METHODS[solve.method]
    are = f"the body is a {' or a '.join(sorted(scene.kinds))}"
    mixed = scene.marches and len(scene.solids) < len(scene.bodies)
    if method is not None and not scene.kinds <= method.bodies and not mixed:
        fitting = " or ".join(show(n) for n, m in METHODS.items() if scene.kinds <= m.bodies)
        text = f" = {show(solve.method)} does not solve a {' or a '.join(sorted(scene.kinds))}: "
        raise KeyedError("solve", "method", f"{text}give {fitting}.")
    for owners, names in _FOREIGN[scene.solver]:
        for name in names:
            value = getattr(solve, name)
            if value is not None:
                text = f" = {show(value)} belongs to {owners}, {are}: remove it."
                raise KeyedError("solve", name, text)
    if scene.bars and solve.active_set == "snes_vi" and method and not method.assembled:
        fitting = " or ".join(f"method = {show(n)}" for n, m in METHODS.items() if m.assembled)
        text = f' = "snes_vi" contradicts method = {show(solve.method)}: it needs {fitting}.'
        raise KeyedError("solve", "active_set", text)
    if not scene.marches:
        return
    if solve.impact_law is not None and all(body.waves for body in scene.bodies):
        text = f" = {show(solve.impact_law)} is for impacts of bodies without waves, {are}"
        raise KeyedError("solve", "impact_law", f"{text}: remove it.")
    # Beside solids the step follows from these.
    brought = {name for each in scene.bodies for name in each.settings if not scene.solids}
    for name, remedy in _BAR_ONLY.items():
        value = getattr(solve, name)
        if value is not None and name not in brought:
            raise KeyedError("solve", name, f" = {show(value)} belongs to bars, {are}: {remedy}.")
