"""How large the bodies of a result are, to judge lengths by."""

from impactfem.result import Result
from impactfem.scene import Bar, Beam, Point, Rod, Solid


def size_of(result: Result) -> float | None:
    """Smallest characteristic length of the bodies [m].

    The length of bars, rods and beams, the largest extent of a solid's shape, the way of a point.
    None if nothing has a length.
    """
    sizes = [_size(result, body) for body in result.scene.bodies]
    known = [size for size in sizes if size]
    return min(known) if known else None


def _size(result: Result, body: object) -> float | None:
    if isinstance(body, Bar | Rod | Beam):
        return body.length
    if isinstance(body, Solid):
        return None if body.shape is None else 2.0 * max(body.shape.half_extents)
    if isinstance(body, Point):
        columns = [result.history[f"{body.name}.{axis}"].values for axis in "xyz"]
        return max(float(column.max() - column.min()) for column in columns)
    return None
