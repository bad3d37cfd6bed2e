"""Checks of the obstacles of all bodies but bars alone."""

from impactfem.scene.breaks import check_motion
from impactfem.scene.content import Content
from impactfem.scene.obstacles import Wall
from impactfem.scene.schema import KeyedError


def check_obstacles(scene: Content) -> None:
    """Refuse obstacles that do not fit the bodies' space, and motions that jump.

    Raises:
        KeyedError: naming the key.
    """
    first = scene.bodies[0]
    walls = scene.marches and scene.dim == 1  # a bar is there too
    for index, (given, obstacle) in enumerate(
        zip(scene.obstacles, scene.rigid_obstacles, strict=True)
    ):
        where = f"obstacle[{index}]"
        if isinstance(given, Wall) and not walls:
            text = (
                f' = "wall" is for bars: a {first.kind} meets kind = "half_space" (point, normal)'
            )
            raise KeyedError(where, "kind", f"{text} or another one; give it.")
        try:
            obstacle.check_dimension(scene.dim)
        except KeyedError as error:
            raise error.moved(where) from None
        if obstacle.motion is not None:
            check_motion(where, "motion", obstacle.motion, scene.duration)
