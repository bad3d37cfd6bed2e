"""Where the axis of a rod or beam is: places of its nodes over time."""

import numpy as np
from numpy.typing import NDArray

from impactfem.result.table import Series, Table

Floats = NDArray[np.float64]

MOST_ROWS = 2000
"""Rows of the history at which the axis is kept at most, evenly chosen."""


def kept_rows(count: int) -> NDArray[np.int64]:
    """Rows of a history of ``count`` rows at which the axis is kept; both ends are among them."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).round().astype(np.int64))


def make_axis(times: Floats, stations: Floats, places: Floats, name: str) -> Table:
    """The table of an axis.

    Args:
        times: [s], shape (rows,).
        stations: Distance of each node from the first end [m], shape (nodes,).
        places: Where the nodes are [m], shape (rows, nodes, 2).
        name: Of the body.

    Returns:
        ``x`` and ``y`` [m] over the coordinates ``time`` [s] and ``station`` [m].
    """
    about = {"units": "m", "long_name": f"distance from the first end of {name}"}
    columns = {
        letter: Series(
            ("time", "station"),
            places[:, :, k],
            {"units": "m", "long_name": f"{letter} of the axis of {name}"},
        )
        for k, letter in enumerate("xy")
    }
    found = Table.over_time(times, columns)
    found.coords["station"] = Series(("station",), stations, about)
    return found
