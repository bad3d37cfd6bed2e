"""Checks across the tables of a scene: body against obstacles, gravity, settings and output."""

from collections.abc import Mapping, Sequence

from impactfem.methods import METHODS
from impactfem.scene.bar_row_checks import check_bar_row
from impactfem.scene.breaks import check_motion
from impactfem.scene.column_names import check_column_names
from impactfem.scene.content import Body, Content
from impactfem.scene.loads import PiecewiseConstant, PiecewiseVector
from impactfem.scene.mixed import check_dimensions, check_mixed
from impactfem.scene.obstacle_checks import check_obstacles
from impactfem.scene.obstacles import Wall
from impactfem.scene.pair_checks import check_pairs
from impactfem.scene.probe_checks import check_probes
from impactfem.scene.schema import KeyedError
from impactfem.scene.solids import Solid
from impactfem.scene.values import show
from impactfem.scene.vibro_checks import FAMILY, check_bodies, check_vibro

# Keys of [solve] that only one kind of body knows, and what to do instead.
_BAR_ONLY: Mapping[str, str] = {
    "elements": "set body.mesh_size",
    "window": "remove it, a solid is solved layer by layer",
    "degree": "set body.degree",
    "fitted": "remove it, it belongs to method dg of bars",
    "accuracy": "set body.mesh_size, and estimate = true to learn the error",
    "mesh": "set body.mesh",
}
_SOLID_ONLY = ("normals", "linear_solver", "estimate")
_ELASTIC_ONLY = ("courant", "active_set", "gamma", "max_iterations")
_VIBRO_ONLY = ("impact_law", "stick_speed")


def check_scene(scene: Content, gravity: object) -> None:
    """Refuse a scene whose tables contradict each other.

    Args:
        scene: the scene, its fields checked one by one.
        gravity: as given, for messages.

    Raises:
        KeyedError: naming the key.
    """
    _check_names(scene)
    _check_counts(scene)
    body = scene.bodies[0]
    if len(scene.bars) > 1:
        check_bar_row(scene)
    elif scene.bars:
        _check_bar(scene, gravity)
    else:
        check_dimensions(scene)
        check_bodies(scene, scene.dim)
        check_obstacles(scene)
        (_check_marched if scene.marches else check_vibro)(scene, gravity)
    check_column_names(scene)
    check_probes(scene)
    _check_settings(scene, body)
    if scene.solve.dt is not None and scene.solve.dt > scene.duration:
        text = f" = {scene.solve.dt} exceeds duration = {scene.duration}: give a smaller step."
        raise KeyedError("solve", "dt", text)


def _check_marched(scene: Content, gravity: object) -> None:
    for index, solid in enumerate(scene.bodies):
        if isinstance(solid, Solid):
            _check_solid(scene, solid, gravity, f"body[{index}]")
    if len(scene.solids) < len(scene.bodies):
        check_mixed(scene, gravity)
    elif scene.has_pairs:
        check_pairs(scene)


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
    first, count = scene.bodies[0], len(scene.bodies)
    for index, bar in enumerate(scene.bars):
        if bar.point is not None:
            text = f" = {show(list(bar.point))} is for bars beside other bodies: these lie on the "
            raise KeyedError(f"body[{index}]", "point", f"{text}x axis; give gap instead.")
    if count > 1 or not first.waves:
        return
    if not scene.obstacles:
        kind = "wall" if scene.bars else "half_space"
        text = " is missing: there is none (obstacle = []); give one or more [[obstacle]], as "
        text += f"kind = {show(kind)}."
        raise KeyedError("obstacle", "", text)
    if scene.contacts and scene.bars:
        text = (
            f" = {show(scene.contacts[0])} is for points, rods, beams and solids: a bar rebounds "
        )
        text += "by its own elasticity, without friction; remove [[contact]]."
        raise KeyedError("contact[0]", "", text)


def _check_bar(scene: Content, gravity: object) -> None:
    if len(scene.obstacles) != 1:
        shown, count = show(list(scene.obstacles)), len(scene.obstacles)
        why = f"there are {count}, but a bar meets one wall; give exactly one [[obstacle]]"
        raise KeyedError("obstacle", "", f" = {shown} is not allowed: {why}.")
    obstacle = scene.obstacles[0]
    if not isinstance(obstacle, Wall):
        text = f' = {show(obstacle.kind)} is for solids: a bar meets kind = "wall"; give it.'
        raise KeyedError("obstacle[0]", "kind", text)
    if not isinstance(scene.gravity, PiecewiseConstant):
        why = (
            "it is a vector, but a bar moves along one axis with gravity positive towards the wall "
            "(gravity = 9.81); give a number or a table of numbers"
        )
        raise KeyedError("", "gravity", f" = {show(gravity)} is not allowed: {why}.")
    if scene.output.checkpoint:
        text = f" = {scene.output.checkpoint}: bars are not checkpointed; remove it."
        raise KeyedError("output", "checkpoint", text)


def _check_solid(scene: Content, solid: Solid, gravity: object, place: str) -> None:
    for index, support in enumerate(solid.supports):
        check_motion(place, f"supports[{index}].value", support.value or (), scene.duration)
    _check_gravity(scene, solid, gravity)


def _check_gravity(scene: Content, solid: Solid, given: object) -> None:
    gravity, dim = scene.gravity, solid.dim
    example = ", ".join(["0.0", "-9.81", "0.0"][:dim])
    if isinstance(gravity, PiecewiseConstant):
        if gravity.is_constant and gravity.values[0] == 0.0:
            return
        why = f"it is a number, but a solid moves in space; give a vector [{example}]"
    elif gravity.dim != dim:
        why = f'it has {gravity.dim} entries, but model = "{solid.model}" has {dim} coordinates'
        why += f"; give a vector [{example}]"
    elif solid.is_axisymmetric and any(value[0] != 0.0 for value in gravity.values):
        why = "it has a radial part, which is not axisymmetric; give [0.0, g]"
    else:
        return
    raise KeyedError("", "gravity", f" = {show(_shown(given))} is not allowed: {why}.")


def _shown(given: object) -> object:
    if isinstance(given, PiecewiseConstant | PiecewiseVector) and len(given.values) == 1:
        value = given.values[0]
        return list(value) if isinstance(value, tuple) else value
    return given


def _check_settings(scene: Content, body: Body) -> None:
    """Refuse settings that belong to another kind of body."""
    solve, method = scene.solve, scene.solve.method
    mixed = scene.marches and len(scene.solids) < len(scene.bodies)
    if method is not None and body.kind not in METHODS[method].bodies and not mixed:
        fitting = " or ".join(show(n) for n, entry in METHODS.items() if body.kind in entry.bodies)
        text = f" = {show(method)} does not solve a {body.kind}: give {fitting}."
        raise KeyedError("solve", "method", text)
    if not scene.is_vibro:
        _refuse(scene, _VIBRO_ONLY, FAMILY, body)
    if not scene.marches:
        _refuse(scene, _SOLID_ONLY[:2] if scene.is_vibro else _SOLID_ONLY, "solids", body)
    if scene.is_vibro:
        _refuse(scene, (*_BAR_ONLY, *_ELASTIC_ONLY), "bars and solids", body)
        return
    if scene.bars:
        if solve.active_set == "snes_vi" and method not in {None, "monolithic"}:
            text = f' = "snes_vi" contradicts method = {show(method)}: it needs '
            raise KeyedError("solve", "active_set", f'{text}method = "monolithic".')
        return
    # Beside solids the step follows from these.
    brought = {name for each in scene.bodies for name in each.settings if not scene.solids}
    for name, remedy in _BAR_ONLY.items():
        value = getattr(solve, name)
        if value is not None and name not in brought:
            text = f" = {show(value)} belongs to bars, the body is a {body.kind}: {remedy}."
            raise KeyedError("solve", name, text)


def _refuse(scene: Content, names: Sequence[str], owners: str, body: Body) -> None:
    """Refuse settings that belong to other bodies."""
    for name in names:
        value = getattr(scene.solve, name)
        if value is not None:
            text = f" = {show(value)} belongs to {owners}, the body is a {body.kind}: remove it."
            raise KeyedError("solve", name, text)
