"""Height fields: tables of heights over a regular grid in the plane z = 0."""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.reading.regular import read_regular, reason
from impactfem.scene.closed_surface import ClosedSurface
from impactfem.scene.schema import KeyedError
from impactfem.scene.surface_files import MOST_FACES
from impactfem.scene.values import show

HEIGHT_FILES = (".csv", ".txt")


def height_field(body: Any) -> ClosedSurface:
    """The open surface, two triangles a cell, over heights in the file that an obstacle names.

    Args:
        body: With the keys ``heights`` and ``spacing``, and the folder of its scene.

    Raises:
        KeyedError: The file cannot be read, or holds no heights.
    """
    path, text = Path(body.folder or "", body.heights), ""
    try:
        known = path.stat()
        return _read(path, (known.st_mtime_ns, known.st_size), float(body.spacing))
    except OSError as error:
        text = f"cannot be read ({reason(error)}): check it, relative paths start at the scene file"
    except UnicodeDecodeError:
        text = "holds no text: give numbers with commas or blanks between them"
    except ValueError as error:
        text = str(error)
    raise KeyedError(body.kind, "heights", f" = {show(body.heights)} {text} (looked for {path}).")


@lru_cache(maxsize=8)
def _read(path: Path, known: tuple[int, int], spacing: float) -> ClosedSurface:
    """The surface in a file; `known` tells its contents apart."""
    del known
    heights = _table(read_regular(path).decode())
    rows, columns = heights.shape
    if min(rows, columns) < 2:
        raise ValueError(f"has {rows} rows of {columns} heights: give at least 2 of 2")
    if 2 * (rows - 1) * (columns - 1) > MOST_FACES:
        raise ValueError(f"has {rows} rows of {columns} heights, too many: give a coarser one")
    row, column = (each.ravel() for each in np.indices((rows, columns)))
    points = np.stack([spacing * column, spacing * row, heights.ravel()], axis=1)
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    one, two = first + 1, first + columns
    lower, upper = np.stack([first, one, two + 1], 1), np.stack([first, two + 1, two], 1)
    return ClosedSurface(points, np.concatenate([lower, upper]))


def _table(text: str) -> Floats:
    """Numbers of all lines that are neither empty nor begin with #, (rows, columns)."""
    rows: list[list[float]] = []
    for number, line in enumerate(text.lstrip("\ufeff").splitlines(), start=1):
        entries = line.replace(",", " ").replace(";", " ").split()
        if not entries or entries[0].startswith("#"):
            continue
        for entry in entries:
            try:
                value = float(entry)
            except ValueError:
                value = np.nan
            if not np.isfinite(value):
                raise ValueError(f"has {show(entry)} in line {number}: give finite heights")
        rows.append([float(entry) for entry in entries])
        if len(rows[-1]) != len(rows[0]):
            text = f"has {len(rows[-1])} heights in line {number}, before {len(rows[0])}"
            raise ValueError(f"{text}: give each line as many")
    return np.array(rows).reshape(len(rows), len(rows[0]) if rows else 0)
