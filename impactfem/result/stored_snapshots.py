"""Snapshots in a file, read layer by layer."""

import pickle
import shutil
import weakref
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.hdf5 import h5py
from impactfem.result.cell_kinds import BY_VTK_TYPE
from impactfem.result.shapes import LINE, VERTEX, Layout
from impactfem.result.snapshots import Snapshots
from impactfem.result.spool import fields_of, foreign_file, read_bodies, read_layout

MAX_LAYERS = 10_000_000
"""Most layers of a file that is read: it may claim any number."""


class StoredSnapshots(Snapshots):
    """Snapshots in a file of `FieldSpool`, read when asked for.

    Attributes:
        path: The file; it must stay while the fields are used.
        times: Times of the layers [s], shape (layers,).
        num_points: Number of nodes.
        num_cells: Number of cells.
        is_passing: Whether the file goes with this object.
    """

    def __init__(self, path: str | Path, *, passing: Path | None = None) -> None:
        """Open a file; only the times are read.

        Args:
            path: What a spool has written.
            passing: Folder of the file that shall go when these fields are no longer used.

        Raises:
            OutputError: The file is none of a spool.
        """
        self.path = Path(path)
        self.is_passing = passing is not None
        if passing is not None:
            weakref.finalize(self, shutil.rmtree, passing, ignore_errors=True)
        try:
            with h5py.File(self.path, "r") as file:
                root = file["VTKHDF"]
                self.times = read_times(root)
                self.num_points = int(root["NumberOfPoints"][0])
                self.num_cells = int(root["NumberOfCells"][0])
                self._point_data = fields_of(file)
                self._bodies = read_bodies(file)
                unknown = set(np.unique(root["Types"][:]).tolist()) - {VERTEX, LINE, *BY_VTK_TYPE}
        except (OSError, KeyError, ValueError, IndexError) as error:
            raise foreign_file(self.path, error) from error
        if unknown:
            raise foreign_file(self.path, ValueError(f"cell type {min(unknown)}"))

    @property
    def point_data(self) -> dict[str, int]:
        """Components of each field at the nodes."""
        return self._point_data

    @property
    def layout(self) -> Layout:
        """The bodies, undeformed; read anew each time."""
        with h5py.File(self.path, "r") as file:
            return read_layout(file)

    @property
    def points(self) -> Floats:
        """Undeformed nodes [m], shape (nodes, 3); read anew each time."""
        with h5py.File(self.path, "r") as file:
            points: Floats = file["VTKHDF/Points"][:]
        return points

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return self._bodies[0]

    def read(self, layer: int, *names: str) -> dict[str, NDArray[Any]]:
        """Read some fields of a layer; see `Snapshots.read`."""
        index = range(len(self.times))[layer]
        first, last = index * self.num_points, (index + 1) * self.num_points
        with h5py.File(self.path, "r") as file:
            data = file["VTKHDF/PointData"]
            return {name: data[name][first:last] for name in names or self.point_data}

    def over_time(self, name: str, body: str | slice | None = None) -> NDArray[Any]:
        """A field at all layers; see `Snapshots.over_time`."""
        own, count = self.nodes(body), self.num_points
        with h5py.File(self.path, "r") as file:
            data = file["VTKHDF/PointData"][name]
            if own == slice(0, count):
                whole: NDArray[Any] = data[: count * len(self)]
                return whole.reshape(len(self), count, *data.shape[1:])
            parts = [data[k * count + own.start : k * count + own.stop] for k in range(len(self))]
        return np.array(parts)

    @property
    def needed_bytes(self) -> int:
        """Size of the file."""
        return self.path.stat().st_size

    def write(self, path: Path) -> None:
        """Let the file appear at another place, without a copy where it is a passing one."""
        if self.is_passing:
            try:
                path.hardlink_to(self.path)
            except OSError:  # another disk, or one without links
                pass
            else:
                return
        shutil.copyfile(self.path, path)

    def __copy__(self) -> Self:
        """These fields themselves: they are read only, and their file may go with the object."""
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self

    def __reduce__(self) -> tuple[type[Self], tuple[Path]]:
        """Only the path goes to another process.

        Raises:
            pickle.PicklingError: The file would be gone when this process has ended.
        """
        if self.is_passing:
            raise pickle.PicklingError(
                "the fields of this run lie in a file that goes with them: save the result and "
                "load it from its folder where it is needed (Result.save, Result.load), or solve "
                "without fields (output.fields = [])"
            )
        return type(self), (self.path.absolute(),)

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}({len(self)} time levels of {self.num_points} nodes and "
            f"{self.num_cells} cells in {self.path})"
        )


def read_times(root: Any) -> Floats:
    """Times of the layers of a file.

    Raises:
        ValueError: It claims to have more than any run writes.
    """
    values = root["Steps/Values"]
    if values.ndim != 1 or len(values) > MAX_LAYERS:
        raise ValueError(f"its times have the shape {values.shape}")
    times: Floats = values[:]
    return times
