"""Fields of a solid: written layer by layer while it moves, read back layer by layer."""

import pickle
import shutil
import weakref
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactfem.errors import OutputError
from impactfem.hdf5 import h5py
from impactfem.result.cell_kinds import BY_VTK_TYPE
from impactfem.result.fields import foreign_file, read_times
from impactfem.result.grids import make_grid, nearest_layer
from impactfem.result.killed_files import mend
from impactfem.result.store import reserve
from impactfem.signals import held_back

if TYPE_CHECKING:
    import pyvista as pv

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

POINT_DATA: Mapping[str, int] = MappingProxyType(
    {
        "displacement": 3,
        "velocity": 3,
        "von_mises": 1,
        "contact_pressure": 1,
        "gap": 1,
        "active": 1,
    }
)
"""Fields of a solid at its nodes, with their components. [m], [m/s], [Pa], [Pa], [m], 0 or 1.

Where a node carries no contact unknown, ``gap`` is NaN, ``contact_pressure`` and ``active`` are 0.
"""

# The same value at nearly all nodes: packed, they take no room.
_PACKED = frozenset({"contact_pressure", "gap", "active"})
_CHUNK = 1 << 17  # values of a chunk: 1 MiB of floats


class FieldSpool:
    """A temporal VTKHDF file of an unstructured grid that grows by one layer at a time.

    ParaView and pyvista read it once it is closed. What was appended is on disk when `append`
    returns, and whenever the writer is killed, `reopen` finds it: HDF5's mode of a single writer
    and many readers orders its writes so that the file is consistent at any moment. Only the layer
    being written is in memory. Format: VTK documentation, "VTKHDF file format", temporal data with
    one static mesh. Write from one rank only.

    Attributes:
        path: The file.
        point_data: Components of each field.
    """

    def __init__(
        self,
        path: str | Path,
        points: ArrayLike,
        cells: ArrayLike,
        vtk_cell_type: int,
        point_data: Mapping[str, int] = POINT_DATA,
    ) -> None:
        """Create the file; one that is there is replaced.

        Args:
            path: Where to write; ends in ".vtkhdf".
            points: Undeformed nodes [m], shape (nodes, 2 or 3).
            cells: Nodes of each cell in VTK's order, shape (cells, nodes of a cell).
            vtk_cell_type: VTK's number of the cells, as in `impactfem.result.cell_kinds`.
            point_data: Fields at the nodes with their numbers of components.

        Raises:
            OutputError: The file cannot be written, or the disk is full.
        """
        self.path = Path(path)
        self.point_data = dict(point_data)
        nodes, connectivity = as_vectors(points), np.asarray(cells, dtype=np.int64)
        self._nodes = len(nodes)
        try:
            reserve(self.path.parent, 131_072 + nodes.nbytes + connectivity.nbytes)
            self.path.unlink(missing_ok=True)  # a link would have us write to its target
            # The oldest format with that mode; ParaView reads it.
            self._file = h5py.File(self.path, "w", libver=("v110", "v110"))
            self._write_grid(nodes, connectivity, vtk_cell_type)
            self._write_empty_steps()
            self._file.swmr_mode = True
            self._file.flush()
        except (OSError, RuntimeError) as error:
            raise self._cannot(error) from error

    @classmethod
    def reopen(cls, path: str | Path, layers: int | None = None) -> Self:
        """Go on with a file: its layers are copied into a new one, which takes its place.

        Args:
            path: What an earlier spool has written, perhaps of a run that was killed.
            layers: Keep the first so many layers; None for all.

        Raises:
            OutputError: The file is none of a spool, or has fewer layers, or the disk is full.
        """
        path = Path(path)
        try:
            mend(path)
            with h5py.File(path, "r") as file:
                root = file["VTKHDF"]
                names = root["Steps/PointDataOffsets"]
                data = {name: root["PointData"][name] for name in names}
                there = int(root["Steps"].attrs["NSteps"])
                if layers is not None and layers > there:
                    raise OutputError(
                        f"{path}: {there} layers are there, {layers} are expected; start the run "
                        "anew"
                    )
                cells = root["Connectivity"][:].reshape(int(root["NumberOfCells"][0]), -1)
                self = cls(
                    path.with_name(f"{path.stem}.copy{path.suffix}"), root["Points"][:], cells,
                    int(root["Types"][0]), {name: _components(data[name]) for name in data},
                )  # fmt: skip
                try:
                    for layer in range(there if layers is None else layers):
                        own = slice(layer * self._nodes, (layer + 1) * self._nodes)
                        values = {name: data[name][own] for name in data}
                        self.append(float(root["Steps/Values"][layer]), values)
                    self.path = self.path.replace(path)
                except BaseException:
                    self.close()
                    self.path.unlink(missing_ok=True)
                    raise
        except (OSError, RuntimeError, LookupError, ValueError, TypeError) as error:
            raise foreign_file(path, error) from error
        return self

    def __len__(self) -> int:
        """Number of layers."""
        return int(self._file["VTKHDF/Steps"].attrs["NSteps"])

    @property
    def layer_bytes(self) -> int:
        """Upper bound of what one more layer takes on disk."""
        return 65_536 + 8 * self._nodes * sum(self.point_data.values())

    def append(self, time: float, values: Mapping[str, ArrayLike]) -> None:
        """Append a layer and have it on disk.

        Args:
            time: [s].
            values: Each field, shape (nodes,) or (nodes, components); vectors may have 2
                components.

        Raises:
            OutputError: The disk is full; the layers before are kept.
        """
        root = self._file["VTKHDF"]
        layer = len(self)
        first, last = layer * self._nodes, (layer + 1) * self._nodes
        try:
            reserve(self.path.parent, self.layer_bytes, self.path.stat().st_size)
            with held_back():  # an interrupt in the midst would leave half a layer
                for name, components in self.point_data.items():
                    data = root["PointData"][name]
                    given = np.asarray(values[name], dtype=data.dtype)
                    data.resize(last, axis=0)
                    data[first:last] = as_vectors(given) if components == 3 else given
                steps = root["Steps"]
                for name, value in self._steps(layer, time).items():
                    steps[name].resize(layer + 1, axis=0)
                    steps[name][layer] = value
                steps.attrs.modify("NSteps", np.int64(layer + 1))  # in place, as the mode asks
                self._file.flush()
        except (OSError, RuntimeError) as error:
            raise self._cannot(error) from error

    def close(self) -> None:
        """Close the file; nothing happens if it is closed."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _steps(self, layer: int, time: float) -> dict[str, float]:
        """What a layer adds to the group of steps."""
        own = {"Values": time, "NumberOfParts": 1}
        # The one mesh serves every step.
        own |= dict.fromkeys(("PartOffsets", "PointOffsets", "CellOffsets"), 0)
        own["ConnectivityIdOffsets"] = 0
        return own | {f"PointDataOffsets/{n}": layer * self._nodes for n in self.point_data}

    def _write_grid(self, points: Floats, cells: Integers, vtk_cell_type: int) -> None:
        root = self._file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0], dtype=np.int64)
        root.attrs.create("Type", b"UnstructuredGrid", dtype=h5py.string_dtype("ascii", 16))
        root["NumberOfPoints"] = np.array([len(points)], dtype=np.int64)
        root["NumberOfCells"] = np.array([len(cells)], dtype=np.int64)
        root["NumberOfConnectivityIds"] = np.array([cells.size], dtype=np.int64)
        root["Points"] = points
        root["Connectivity"] = cells.ravel()
        root["Offsets"] = np.arange(0, cells.size + 1, cells.shape[1], dtype=np.int64)
        root["Types"] = np.full(len(cells), vtk_cell_type, dtype=np.uint8)

    def _write_empty_steps(self) -> None:
        root = self._file["VTKHDF"]
        data, steps = root.create_group("PointData"), root.create_group("Steps")
        for name, components in self.point_data.items():
            width = () if components == 1 else (components,)
            packed: dict[str, Any] = (
                {"compression": "gzip", "compression_opts": 1, "shuffle": True}
                if name in _PACKED
                else {}
            )
            data.create_dataset(
                name,
                (0, *width),
                maxshape=(None, *width),
                chunks=(max(1, min(self._nodes, _CHUNK // components)), *width),
                dtype=np.uint8 if name == "active" else np.float64,
                **packed,
            )
        steps.attrs["NSteps"] = np.int64(0)
        steps.create_group("PointDataOffsets")
        for name in self._steps(0, 0.0):
            width = (1,) if name in {"CellOffsets", "ConnectivityIdOffsets"} else ()
            kind = np.float64 if name == "Values" else np.int64
            steps.create_dataset(
                name, (0, *width), maxshape=(None, *width), chunks=(512, *width), dtype=kind
            )

    def _cannot(self, error: Exception) -> OutputError:
        why = getattr(error, "strerror", None) or error
        return OutputError(
            f"{self.path}: cannot be written ({why}); free some space, choose another folder, or "
            "write fewer layers (output.every)"
        )


class SolidFields:
    """Fields of a solid in a file of `FieldSpool`, read when asked for.

    Attributes:
        path: The file; it must stay while the fields are used.
        times: Times of the layers [s], shape (layers,).
        num_points: Number of nodes.
        num_cells: Number of cells.
        vtk_cell_type: VTK's number of the cells.
        point_data: Components of each field.
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
                self.times: Floats = read_times(root)
                self.num_points = int(root["NumberOfPoints"][0])
                self.num_cells = int(root["NumberOfCells"][0])
                self.vtk_cell_type = int(root["Types"][0])
                self.point_data = {
                    name: _components(root["PointData"][name])
                    for name in root["Steps/PointDataOffsets"]
                }
                known = self.vtk_cell_type in BY_VTK_TYPE
        except (OSError, KeyError, ValueError, IndexError) as error:
            raise foreign_file(self.path, error) from error
        if not known:
            raise foreign_file(self.path, ValueError(f"cell type {self.vtk_cell_type}"))

    @property
    def points(self) -> Floats:
        """Undeformed nodes [m], shape (nodes, 3); read anew each time."""
        with h5py.File(self.path, "r") as file:
            points: Floats = file["VTKHDF/Points"][:]
        return points

    @property
    def cells(self) -> Integers:
        """Nodes of each cell in VTK's order, shape (cells, nodes of a cell); read anew."""
        with h5py.File(self.path, "r") as file:
            cells: Integers = file["VTKHDF/Connectivity"][:]
        return cells.reshape(self.num_cells, -1)

    def __len__(self) -> int:
        """Number of layers."""
        return len(self.times)

    def read(self, layer: int, *names: str) -> dict[str, NDArray[Any]]:
        """Read some fields of a layer, all if no name is given.

        Args:
            layer: From 0, or from -1 backwards.
            *names: As in `POINT_DATA`.

        Returns:
            Arrays of shape (nodes,) or (nodes, 3).

        Raises:
            IndexError: There is no such layer.
        """
        index = range(len(self.times))[layer]
        first, last = index * self.num_points, (index + 1) * self.num_points
        with h5py.File(self.path, "r") as file:
            data = file["VTKHDF/PointData"]
            return {name: data[name][first:last] for name in names or self.point_data}

    def grid(
        self, layer: int = -1, *, time: float | None = None, deformed: bool = False
    ) -> "pv.UnstructuredGrid":
        """The solid at one time as a grid of pyvista, with all fields of `POINT_DATA`.

        Args:
            layer: From 0, or from -1 backwards.
            time: The layer nearest to this time [s] instead.
            deformed: Whether the nodes are where the body is, not where it was.

        Raises:
            IndexError: There is no such layer.
            SceneError: The time is none of the fields.
            MissingDependencyError: pyvista is not installed.
        """
        index = range(len(self))[layer] if time is None else nearest_layer(self.times, time)
        values, points = self.read(index), self.points
        if deformed:
            points = points + values["displacement"]
        when = float(self.times[index])
        return make_grid(points, self.cells, self.vtk_cell_type, values, when)

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
            f"SolidFields({len(self)} layers of {self.num_points} nodes and {self.num_cells} "
            f"cells in {self.path})"
        )


def as_vectors(values: ArrayLike) -> Floats:
    """Vectors with a third component, shape (rows, 3), of shape (rows, 2 or 3)."""
    given = np.asarray(values, dtype=np.float64)
    if given.shape[1] == 3:
        return given
    return np.column_stack([given, np.zeros(len(given))])


def _components(data: Any) -> int:
    return 1 if data.ndim == 1 else int(data.shape[1])
