"""How large the bodies of a scene are, to judge lengths by."""

from typing import Any

from impactfem.result.table import Table
from impactfem.scene import Scene


def size_of(scene: Scene, history: Table) -> float | None:
    """Smallest characteristic length of the bodies [m].

    The length of bars, rods and beams, the largest extent of a solid's shape, of others the larger
    one of their extent and their way. None if nothing has a length.
    """
    known = [size for body in scene.bodies if (size := _size(body, history))]
    return min(known) if known else None


def _size(body: Any, history: Table) -> float | None:
    if hasattr(body, "length"):
        return float(body.length)
    if hasattr(body, "shape"):
        return None if body.shape is None else 2.0 * max(body.shape.half_extents)
    box = body.box()
    if box is None:
        return None
    columns = [history[f"{body.name}.{axis}"].values for axis in "xyz"]
    way = max(float(column.max() - column.min()) for column in columns)
    return max(2.0 * float(box[0].max()), way)
