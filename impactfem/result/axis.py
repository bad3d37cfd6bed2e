"""Where the axis of a rod or beam is: places of its nodes over time."""

from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MOST_ROWS = 2000
"""Rows of the history at which the axis is kept at most, evenly chosen."""


def kept_rows(count: int) -> NDArray[np.int64]:
    """Rows of a history of ``count`` rows at which the axis is kept; both ends are among them."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).round().astype(np.int64))


def make_axis(times: Floats, stations: Floats, places: Floats, name: str) -> xr.Dataset:
    """The data set of an axis.

    Args:
        times: [s], shape (rows,).
        stations: Distance of each node from the first end [m], shape (nodes,).
        places: Where the nodes are [m], shape (rows, nodes, 2).
        name: Of the body.

    Returns:
        ``x`` and ``y`` [m] over the coordinates ``time`` [s] and ``station`` [m].
    """
    return xr.Dataset(
        {
            letter: (
                ("time", "station"),
                places[:, :, k],
                {"units": "m", "long_name": f"{letter} of the axis of {name}"},
            )
            for k, letter in enumerate("xy")
        },
        coords={
            "time": ("time", times, {"units": "s", "long_name": "time"}),
            "station": (
                "station",
                stations,
                {"units": "m", "long_name": f"distance from the first end of {name}"},
            ),
        },
    )


def read_axis(path: Path) -> xr.Dataset:
    """Read an axis back into memory; errors are those of xarray and SciPy."""
    with xr.open_dataset(path, engine="scipy") as data:
        return data.load()
