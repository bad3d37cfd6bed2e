"""Rigid obstacles as meshes of pyvista, on a line, in the plane and in space."""

from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.distance import on_a_line, signed_distance
from impactfem.result.grids import load_pyvista
from impactfem.scene.obstacles.rotation import placement

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pyvista as pv

    from impactfem.scene import Scene


_REACH = 0.8  # how far obstacles are drawn from the middle of the motion, of its size
_SAMPLES = 400  # of the plane along an axis
_BEHIND = 1e-3  # share of the size that obstacles in the plane lie behind the bodies
_SOLID = {"color": "#cccccc", "smooth_shading": False}
_LINES = {"color": "#999999", "line_width": 1.0}


def obstacle_parts(
    scene: "Scene", time: float, centre: Floats, size: float
) -> "Iterator[tuple[str, pv.DataSet, dict[str, Any]]]":
    """What there is to draw of the obstacles at a time.

    Args:
        scene: With obstacles.
        time: [s].
        centre: Middle of the motion [m], shape (3,).
        size: Largest extent of the motion [m].

    Yields:
        Name, mesh, and how to draw it.
    """
    make = (_on_a_line, _in_the_plane, _in_space)[scene.dim - 1]
    for obstacle in scene.obstacles:
        for k, (mesh, style) in enumerate(make(obstacle, time, centre, _REACH * size)):
            if mesh.n_points:
                yield f"obstacle {obstacle.name} {k}", mesh, style


def _on_a_line(
    obstacle: Any, time: float, centre: Floats, reach: float
) -> "Iterator[tuple[pv.DataSet, dict[str, Any]]]":
    place, side = on_a_line(obstacle, np.array([time]))
    wide = 0.3 * reach
    middle = (float(place[0]) - 0.1 * side * reach, *centre[1:])
    yield (
        load_pyvista().Cube(center=middle, x_length=0.2 * reach, y_length=wide, z_length=wide),
        _SOLID,
    )


def _in_the_plane(
    obstacle: Any, time: float, centre: Floats, reach: float
) -> "Iterator[tuple[pv.DataSet, dict[str, Any]]]":
    """Where the distance that the solver uses is negative."""
    step = 2.0 * reach / (_SAMPLES - 1)
    origin = (centre[0] - reach, centre[1] - reach, -_BEHIND * reach)
    pixels = load_pyvista().ImageData(
        dimensions=(_SAMPLES, _SAMPLES, 1), spacing=(step, step, 1.0), origin=origin
    )
    pixels["gap"] = signed_distance(obstacle, np.asarray(pixels.points)[:, :2], time)[0]
    inside = pixels.clip_scalar(scalars="gap", value=0.0)
    inside.clear_data()
    yield inside, {**_SOLID, "lighting": False}


def _in_space(
    obstacle: Any, time: float, centre: Floats, reach: float
) -> "Iterator[tuple[pv.DataSet, dict[str, Any]]]":
    pyvista, at = load_pyvista(), placement(obstacle, time)
    around = at.back(centre)
    faces = at.moved(obstacle.faces(around, reach))
    yield joined(pyvista, faces, "faces"), {**_SOLID, "ambient": 0.3}
    lines = at.moved(obstacle.lines(around, reach))
    yield joined(pyvista, lines, "lines"), _LINES


def joined(pyvista: Any, corners: Floats, kind: str) -> "pv.PolyData":
    """Triangles or lines by their corners, shape (cells, corners of a cell, 3)."""
    count, width = corners.shape[:2]
    cells = np.insert(np.arange(count * width).reshape(count, width), 0, width, axis=1)
    if not count:
        return pyvista.PolyData()
    return pyvista.PolyData(corners.reshape(-1, 3), **{kind: cells.ravel()})
