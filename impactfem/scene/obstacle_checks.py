"""Checks of obstacles and gravity, of all bodies but bars alone."""

from impactfem.scene.breaks import check_motion
from impactfem.scene.content import Content
from impactfem.scene.loads import PiecewiseConstant, PiecewiseVector
from impactfem.scene.obstacles import Rigid
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show


def check_obstacles(scene: Content) -> None:
    """Refuse obstacles that do not fit the bodies' space, and motions that jump.

    Raises:
        KeyedError: naming the key.
    """
    walls = scene.marches and scene.dim == 1  # a bar is there too
    for index, (given, obstacle) in enumerate(
        zip(scene.obstacles, scene.rigid_obstacles, strict=True)
    ):
        where = f"obstacle[{index}]"
        if given.before_bars and not walls:
            text = (
                f" = {show(given.kind)} is for bars: a {' or a '.join(sorted(scene.kinds))} meets "
            )
            text += 'kind = "half_space" (point, normal) or another one; give it.'
            raise KeyedError(where, "kind", text)
        try:
            obstacle.check_dimension(scene.dim)
        except KeyedError as error:
            raise error.moved(where) from None
        if obstacle.motion is not None:
            check_motion(where, "motion", obstacle.motion, scene.duration)
        if obstacle.rotation is not None:
            angle = [obstacle.rotation.angle]
            check_motion(where, "rotation.angle", angle, scene.duration, "rad")
            _check_turning(scene, where, obstacle)


def _check_turning(scene: Content, where: str, obstacle: Rigid) -> None:
    """Refuse rotations that bodies or settings do not follow."""
    if any(solid.is_axisymmetric for solid in scene.solids):
        text = ": the body is axisymmetric and does not twist; remove it, or give a body in space."
        raise KeyedError(where, "rotation", text)
    if scene.solve.normals == "fixed":
        text = f' = "fixed", but {obstacle.name} turns and its normals with it: remove it.'
        raise KeyedError("solve", "normals", text)


def check_gravity(scene: Content, given: object) -> None:
    """Refuse gravity that is no vector with as many entries as the bodies have coordinates.

    Args:
        scene: The scene.
        given: Gravity as given, for messages.

    Raises:
        KeyedError: naming the key.
    """
    gravity, dim = scene.gravity, scene.dim
    example = ", ".join(["0.0"] * (dim - 1) + ["-9.81"])
    if isinstance(gravity, PiecewiseConstant):
        if gravity.is_constant and gravity.values[0] == 0.0:
            return
        why = f"it is a number, but the bodies move in space; give a vector [{example}]"
    elif gravity.dim != dim:
        why = f"it has {gravity.dim} entries, but the bodies have {dim} coordinates; give a "
        why += f"vector [{example}]"
    elif any(solid.is_axisymmetric for solid in scene.solids) and any(
        value[0] != 0.0 for value in gravity.values
    ):
        why = "it has a radial part, which is not axisymmetric; give [0.0, g]"
    else:
        return
    if isinstance(given, PiecewiseConstant | PiecewiseVector) and len(given.values) == 1:
        (given,) = given.values
    shown = show(list(given) if isinstance(given, tuple) else given)
    raise KeyedError("", "gravity", f" = {shown} is not allowed: {why}.")
