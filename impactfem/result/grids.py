"""Fields at one time as pyvista's unstructured grids; pyvista is loaded when they are asked for."""

import subprocess
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.errors import MissingDependencyError, SceneError
from impactfem.result.shapes import LINE, VERTEX, Layout

if TYPE_CHECKING:
    import pyvista as pv


_RENDER = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.add_mesh(pyvista.Sphere())
plotter.screenshot(return_img=True)
"""
_LATE = 1e-6  # share of the time of the fields by which a time may lie beyond its ends


def load_pyvista() -> Any:
    """The module pyvista.

    Raises:
        MissingDependencyError: It is not installed.
    """
    try:
        return import_module("pyvista")
    except ImportError as error:
        raise MissingDependencyError(
            f"this needs pyvista ({error}); `pip install pyvista`, on Debian "
            "`apt install python3-pyvista`, or open fields.vtkhdf in ParaView"
        ) from error


def drawing_fault() -> str:
    """Why VTK cannot draw here, "" if it can; tried in a process of its own, as it may abort."""
    try:
        done = subprocess.run(  # noqa: S603  (our own text)
            [sys.executable, "-c", _RENDER], capture_output=True, timeout=60, check=False
        )
    except subprocess.TimeoutExpired:
        return "hangs without a display"
    return "cannot draw here (no display or Xvfb)" if done.returncode else ""


def nearest_layer(times: Floats, time: float) -> int:
    """The layer whose time is nearest.

    Args:
        times: Times of the layers [s], shape (layers,).
        time: [s].

    Raises:
        SceneError: The time is none of the fields.
    """
    room = _LATE * float(times[-1] - times[0])
    if not times[0] - room <= time <= times[-1] + room:
        raise SceneError(
            f"time = {time:g} s: the fields are from {times[0]:g} to {times[-1]:g} s; give a time "
            "among them"
        )
    return int(np.abs(times - time).argmin())


def make_grid(
    layout: Layout, values: dict[str, NDArray[Any]], time: float, *, deformed: bool
) -> "pv.UnstructuredGrid":
    """A grid with the fields of a layer; see `Snapshots.grid`.

    Args:
        layout: The bodies.
        values: Values at the nodes, shape (nodes,) or (nodes, 3).
        time: [s].
        deformed: Whether the nodes are where the bodies are.

    Raises:
        MissingDependencyError: pyvista is not installed.
    """
    pyvista = load_pyvista()
    widths = np.diff(layout.offsets)
    cells = np.insert(layout.connectivity, layout.offsets[:-1], widths)
    points = layout.points + values["displacement"] if deformed else layout.points
    grid: pv.UnstructuredGrid = pyvista.UnstructuredGrid(cells, layout.types, points)
    for name, given in values.items():
        grid.point_data[name] = given
    grid.point_data["radius"] = layout.radius
    grid.cell_data["body"] = layout.body_of_cells
    grid.field_data["time"] = np.array([time])
    grid.field_data["bodies"] = list(layout.names)
    if "von_mises" in values:
        grid.set_active_scalars("von_mises")
    return grid


def thickened(grid: "pv.UnstructuredGrid", layout: Layout) -> "list[pv.DataSet]":
    """What a grid of `make_grid` looks like: its cells, tubes around lines and balls at points.

    Returns:
        Solids first, if there are any; lines and points without radius stay as they are.
    """
    pyvista = load_pyvista()
    kinds, found = layout.types, []
    slender = np.isin(kinds, [LINE, VERTEX])
    if not slender.any():
        return [grid]
    if not slender.all():
        found.append(grid.extract_cells(~slender))
    thick = layout.radius[layout.connectivity[layout.offsets[:-1]]]
    for radius, kind in sorted({*zip(thick[slender], kinds[slender], strict=True)}):
        part = grid.extract_cells(slender & (thick == radius) & (kinds == kind))
        if radius > 0.0 and kind == LINE:
            axis = pyvista.PolyData(np.asarray(part.points), lines=np.asarray(part.cells))
            for name in part.point_data:
                axis.point_data[name] = part.point_data[name]
            part = axis.tube(radius=radius, n_sides=24)
        elif radius > 0.0:
            part = part.glyph(orient=False, scale=False, geom=pyvista.Sphere(radius=radius))
        found.append(part)
    return found
