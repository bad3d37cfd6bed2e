"""Fields at one time as pyvista's unstructured grids; pyvista is loaded when they are asked for."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import MissingDependencyError, SceneError

if TYPE_CHECKING:
    import pyvista as pv

Floats = NDArray[np.float64]

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
    points: Floats,
    cells: NDArray[np.int64],
    vtk_cell_type: int,
    arrays: dict[str, NDArray[Any]],
    time: float,
) -> "pv.UnstructuredGrid":
    """A grid with arrays at its points and the array ``time`` [s] among its field data.

    Args:
        points: Where the nodes are [m], shape (nodes, 3).
        cells: Nodes of each cell in VTK's order, shape (cells, nodes of a cell).
        vtk_cell_type: VTK's number of the cells.
        arrays: Values at the nodes, shape (nodes,) or (nodes, 3).
        time: [s].

    Raises:
        MissingDependencyError: pyvista is not installed.
    """
    pyvista = load_pyvista()
    counts = np.full((len(cells), 1), cells.shape[1], dtype=np.int64)
    kinds = np.full(len(cells), vtk_cell_type, dtype=np.uint8)
    grid: pv.UnstructuredGrid = pyvista.UnstructuredGrid(
        np.hstack([counts, cells]).ravel(), kinds, points
    )
    for name, values in arrays.items():
        grid.point_data[name] = values
    grid.field_data["time"] = np.array([time])
    if "von_mises" in arrays:
        grid.set_active_scalars("von_mises")
    return grid
