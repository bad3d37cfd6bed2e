"""The field file of all bodies: written layer by layer, or many layers at once."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactfem.errors import OutputError
from impactfem.hdf5 import h5py, of_a_dead_writer
from impactfem.result.shapes import FLAGS, MOTION, VECTOR, Layout, Shape, as_vectors
from impactfem.result.store import reserve
from impactfem.signals import held_back

POINT_DATA: Mapping[str, int] = MappingProxyType(
    {**MOTION, "von_mises": 1, "contact_pressure": 1, "contact_force": 3, "gap": 1, "active": 1}
)
"""Fields of scenes that are marched: besides the motion [Pa], [Pa], [N], [m], 0 or 1.

Solids have more; see `impactfem.runs.solid_output`. At their nodes without contact unknown
``gap`` is NaN, and what contact does there is 0; at those of other bodies what they do not have is
NaN.
"""

ABOUT = "impactfem"
"""Group beside that of VTK, which readers pass over: names and first nodes of the bodies."""

# The same value at nearly all nodes: packed, they take no room.
_PACKED = frozenset({"contact_pressure", "contact_force", "contact_normal", "gap", "active"})
_CHUNK, _LEAST = 1 << 17, 1 << 9  # values of a chunk at most (1 MiB of floats), rows at least


class FieldSpool:
    """A temporal VTKHDF file of an unstructured grid that grows by layers.

    ParaView and pyvista read it once it is closed. What was appended is on disk when `append`
    returns, and whenever the writer is killed, `reopen` finds it: HDF5's mode of a single writer
    and many readers orders its writes so that the file is consistent at any moment. Only the layer
    being written is in memory. Format: VTK documentation, "VTKHDF file format", version 2.0,
    temporal data with one static mesh. Write from one rank only.

    All bodies are in the one grid; the cell data ``body`` says whose a cell is, by the order of
    the shapes, and the point data ``radius`` how thick points and lines are.

    Attributes:
        path: The file.
        point_data: Components of each field.
    """

    def __init__(
        self,
        path: str | Path,
        shapes: Sequence[Shape] | Layout,
        point_data: Mapping[str, int] = POINT_DATA,
    ) -> None:
        """Create the file; one that is there is replaced.

        Args:
            path: Where to write; ends in ".vtkhdf".
            shapes: The bodies, undeformed.
            point_data: Fields at the nodes with their numbers of components.

        Raises:
            OutputError: The file cannot be written, or the disk is full.
        """
        self.path = Path(path)
        self.point_data = dict(point_data)
        layout = shapes if isinstance(shapes, Layout) else Layout.of(shapes)
        self._nodes = len(layout.points)
        try:
            mesh = layout.points.nbytes + layout.connectivity.nbytes + 16 * len(layout.types)
            reserve(self.path.parent, 131_072 + mesh + layout.radius.nbytes)
            self.path.unlink(missing_ok=True)  # a link would have us write to its target
            # The oldest format with that mode; ParaView reads it.
            self._file = h5py.File(self.path, "w", libver=("v110", "v110"))
            self._write_grid(layout)
            self._write_empty_steps()
            # Looked up once: a lookup costs as much as what a layer writes.
            data, steps = (self._file[f"VTKHDF/{name}"] for name in ("PointData", "Steps"))
            self._data = {name: data[name] for name in self.point_data}
            self._moments = {name: steps[name] for name in self._steps(0, np.zeros(0))}
            self._count = 0
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
            # As one of many readers: of a killed run the file still says that it has a writer.
            with of_a_dead_writer(path) as file:
                root = file["VTKHDF"]
                data = {name: root["PointData"][name] for name in fields_of(file)}
                there = int(root["Steps"].attrs["NSteps"])
                if layers is not None and layers > there:
                    raise OutputError(
                        f"{path}: {there} time levels are there, {layers} are expected; start the "
                        "run anew"
                    )
                self = cls(
                    path.with_name(f"{path.stem}.copy{path.suffix}"), read_layout(file),
                    fields_of(file),
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
        return self._count

    @property
    def layer_bytes(self) -> int:
        """Upper bound of what one more layer takes on disk."""
        return needed_bytes(1, self._nodes, self.point_data)

    def append(self, time: float, values: Mapping[str, ArrayLike]) -> None:
        """Append a layer and have it on disk.

        Args:
            time: [s].
            values: Each field, shape (nodes,) or (nodes, components); vectors may have 2
                components.

        Raises:
            OutputError: The disk is full; the layers before are kept.
        """
        self.extend([time], {name: np.asarray(given)[None] for name, given in values.items()})

    def extend(self, times: ArrayLike, values: Mapping[str, ArrayLike]) -> None:
        """Append some layers and have them on disk.

        Args:
            times: [s], shape (layers,).
            values: Each field, shape (layers, nodes) or (layers, nodes, components).

        Raises:
            OutputError: The disk is full; the layers before are kept.
        """
        moments, begin = np.asarray(times, dtype=np.float64), self._count
        count = len(moments)
        try:
            needed = needed_bytes(count, self._nodes, self.point_data)
            reserve(self.path.parent, needed, self.path.stat().st_size)
            with held_back():  # an interrupt in the midst would leave half a layer
                for name, components in self.point_data.items():
                    given = np.asarray(values[name])
                    given = as_vectors(given) if components == VECTOR else given
                    rows = given.reshape(count * self._nodes, *self._data[name].shape[1:])
                    _extend(self._data[name], begin * self._nodes, rows)
                for name, entries in self._steps(begin, moments).items():
                    data = self._moments[name]
                    _extend(data, begin, entries.reshape(-1, *data.shape[1:]))
                self._count = begin + count
                # In place, as the mode asks.
                self._file["VTKHDF/Steps"].attrs.modify("NSteps", np.int64(self._count))
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

    def _steps(self, begin: int, times: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
        """What layers add to the group of steps, shape (layers,)."""
        zero, one = np.zeros(len(times), np.int64), np.ones(len(times), np.int64)
        own: dict[str, NDArray[Any]] = {"Values": times, "NumberOfParts": one}
        # The one mesh serves every step.
        own |= dict.fromkeys(("PartOffsets", "PointOffsets", "CellOffsets"), zero)
        own |= dict.fromkeys(("CellDataOffsets/body", "PointDataOffsets/radius"), zero)
        own["ConnectivityIdOffsets"] = zero
        rows = self._nodes * (begin + np.arange(len(times), dtype=np.int64))
        return own | {f"PointDataOffsets/{name}": rows for name in self.point_data}

    def _write_grid(self, layout: Layout) -> None:
        about = self._file.create_group(ABOUT)
        about.attrs["bodies"] = json.dumps(layout.names)
        about.attrs["fields"] = json.dumps(self.point_data)
        about["starts"] = layout.starts
        root = self._file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0], dtype=np.int64)
        root.attrs.create("Type", b"UnstructuredGrid", dtype=h5py.string_dtype("ascii", 16))
        root["NumberOfPoints"] = np.array([self._nodes], dtype=np.int64)
        root["NumberOfCells"] = np.array([len(layout.types)], dtype=np.int64)
        root["NumberOfConnectivityIds"] = np.array([len(layout.connectivity)], dtype=np.int64)
        root["Points"] = layout.points
        root["Connectivity"] = layout.connectivity
        root["Offsets"] = layout.offsets
        root["Types"] = layout.types
        root["CellData/body"] = layout.body_of_cells
        root["PointData/radius"] = layout.radius

    def _write_empty_steps(self) -> None:
        root = self._file["VTKHDF"]
        data, steps = root["PointData"], root.create_group("Steps")
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
                chunks=(max(_LEAST, min(self._nodes, _CHUNK // components)), *width),
                dtype=np.uint8 if name in FLAGS else np.float64,
                **packed,
            )
        steps.attrs["NSteps"] = np.int64(0)
        for name, entries in self._steps(0, np.zeros(0)).items():
            width = (1,) if name in {"CellOffsets", "ConnectivityIdOffsets"} else ()
            steps.create_dataset(
                name, (0, *width), maxshape=(None, *width), chunks=(512, *width),
                dtype=entries.dtype,
            )  # fmt: skip

    def _cannot(self, error: Exception) -> OutputError:
        why = getattr(error, "strerror", None) or error
        return OutputError(
            f"{self.path}: cannot be written ({why}); free some space, choose another folder, or "
            "write fewer time levels (output.every)"
        )


def _extend(data: Any, begin: int, rows: NDArray[Any]) -> None:
    """Write rows at the end of a dataset, from row `begin` on; h5py's slices cost far more."""
    rows = np.ascontiguousarray(rows, dtype=data.dtype)
    data.id.set_extent((begin + len(rows), *rows.shape[1:]))
    there = data.id.get_space()
    there.select_hyperslab((begin, *(0 for _ in rows.shape[1:])), rows.shape)
    data.id.write(h5py.h5s.create_simple(rows.shape), there, rows)


def needed_bytes(layers: int, nodes: int, point_data: Mapping[str, int]) -> int:
    """Upper bound of what layers take on disk, from measurements."""
    rows = nodes * layers + max(nodes, _LEAST)  # the last chunk may be hardly used
    return 65_536 + 512 * layers + 8 * rows * sum(point_data.values())


def foreign_file(path: Path, error: Exception) -> OutputError:
    """The error of a file that is broken or not of this kind."""
    return OutputError(f"{path}: not a field file of impactfem ({error}); run the scene again")


def fields_of(file: Any) -> dict[str, int]:
    """Components of the fields that change with time, of a file that is open."""
    return {str(name): int(n) for name, n in json.loads(file[ABOUT].attrs["fields"]).items()}


def read_layout(file: Any) -> Layout:
    """The bodies of a file that is open."""
    root = file["VTKHDF"]
    return Layout(
        *read_bodies(file), root["Points"][:], root["PointData/radius"][:], root["Types"][:],
        root["Offsets"][:], root["Connectivity"][:],
    )  # fmt: skip


def read_bodies(file: Any) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    """Names of the bodies of a file that is open, and their first nodes with the end."""
    about = file[ABOUT]
    return tuple(map(str, json.loads(about.attrs["bodies"]))), about["starts"][:]
