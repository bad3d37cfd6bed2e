"""Field output of bars: displacement and velocity on their own line mesh, layer by layer."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import OutputError
from impactfem.hdf5 import h5py
from impactfem.result.dolfinx_files import write_functions
from impactfem.result.grids import make_grid, nearest_layer

if TYPE_CHECKING:
    import pyvista as pv

MAX_LAYERS = 10_000_000
"""Most layers of a file that is read: it may claim any number."""

_VTK_LINE = 3  # VTK's number of the two-node line


@dataclass(frozen=True)
class Fields:
    """A bar's motion at the layers that were asked for, or that of a row of bars.

    Attributes:
        times: [s], shape (layers,).
        positions: Node positions from the near end [m], shape (nodes,); of a row bar after bar,
            each from its own near end.
        displacement: u [m], shape (layers, nodes); the node is at position + displacement from
            the wall.
        velocity: u_t [m/s], shape (layers, nodes).
        counts: Nodes of each bar of a row; None: there is one bar.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    displacement: NDArray[np.float64]
    velocity: NDArray[np.float64]
    counts: tuple[int, ...] | None = None

    @property
    def starts(self) -> NDArray[np.int64]:
        """First node of each element."""
        nodes = len(self.positions)
        ends = np.cumsum(self.counts or (nodes,)) - 1
        return np.setdiff1d(np.arange(nodes, dtype=np.int64), ends)

    def grid(
        self, layer: int = -1, *, time: float | None = None, deformed: bool = False
    ) -> "pv.UnstructuredGrid":
        """Bars at one time as a grid of pyvista along x, with displacement and velocity.

        Args:
            layer: From 0, or from -1 backwards.
            time: The layer nearest to this time [s] instead.
            deformed: Whether the nodes are at their distance from the wall, not at that from the
                near end of their bar.

        Raises:
            IndexError: There is no such layer.
            SceneError: The time is none of the fields.
            MissingDependencyError: pyvista is not installed.
        """
        count = len(self.times)
        index = range(count)[layer] if time is None else nearest_layer(self.times, time)
        u, v = self.displacement[index], self.velocity[index]
        arrays = {"displacement": _as_vectors(u), "velocity": _as_vectors(v)}
        points = _as_vectors(self.positions + u if deformed else self.positions)
        cells = np.stack([self.starts, self.starts + 1], axis=1)
        return make_grid(points, cells, _VTK_LINE, arrays, float(self.times[index]))

    def __repr__(self) -> str:
        return f"Fields({len(self.times)} layers of {len(self.positions)} nodes of bars)"


class StoredFields(Fields):
    """A bar's motion in a file, read when it is first asked for."""

    def __init__(
        self, path: Path, times: Any, positions: Any, counts: tuple[int, ...] | None
    ) -> None:
        for name, value in {
            "_path": path, "times": times, "positions": positions, "counts": counts,
        }.items():  # fmt: skip
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        if name not in {"displacement", "velocity"}:
            raise AttributeError(name)
        try:
            with h5py.File(self._path, "r") as file:
                data = file[f"VTKHDF/PointData/{name}"]
                values = data[:, 0].reshape(len(self.times), len(self.positions))
        except (OSError, KeyError, ValueError) as error:
            raise foreign_file(self._path, error) from error
        object.__setattr__(self, name, values)
        return values


def foreign_file(path: Path, error: Exception) -> OutputError:
    """The error of a file that is broken or not of this kind."""
    return OutputError(f"{path}: not a field file of impactfem ({error}); run the scene again")


def needed_bytes(fields: Fields, kind: str) -> int:
    """Upper bound of what a format needs on disk, from measurements."""
    layers, nodes = fields.displacement.shape
    per_layer, per_value = (256, 48) if kind == "vtkhdf" else (16_384, 160)
    return int(65_536 + 128 * nodes + layers * (per_layer + per_value * nodes))


def _as_vectors(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors along the bar's axis, shape (values, 3)."""
    vectors = np.zeros((values.size, 3))
    vectors[:, 0] = values.ravel()
    return vectors


def write_vtkhdf(fields: Fields, path: Path) -> None:
    """Write a temporal VTKHDF unstructured grid (one static mesh, one step per layer).

    DOLFINx 0.9 cannot write VTKHDF; this one file serves all versions. ParaView's filter "Warp by
    vector" with the displacement shows the bar where it is, the wall being at 0.
    Format: VTK documentation, "VTKHDF file format", temporal data.
    """
    nodes, layers = len(fields.positions), len(fields.times)
    first = fields.starts
    cells = len(first)
    with h5py.File(path, "w") as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0], dtype=np.int64)
        root.attrs.create("Type", b"UnstructuredGrid", dtype=h5py.string_dtype("ascii", 16))
        root["NumberOfPoints"] = np.array([nodes], dtype=np.int64)
        root["NumberOfCells"] = np.array([cells], dtype=np.int64)
        root["NumberOfConnectivityIds"] = np.array([2 * cells], dtype=np.int64)
        root["Points"] = _as_vectors(fields.positions)
        root["Connectivity"] = np.stack([first, first + 1], axis=1).ravel()
        root["Offsets"] = np.arange(0, 2 * cells + 1, 2, dtype=np.int64)
        root["Types"] = np.full(cells, _VTK_LINE, dtype=np.uint8)
        data = root.create_group("PointData")
        data["displacement"] = _as_vectors(fields.displacement)
        data["velocity"] = _as_vectors(fields.velocity)
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = np.int64(layers)
        steps["Values"] = fields.times
        zeros = np.zeros(layers, dtype=np.int64)
        steps["PartOffsets"] = zeros  # the one mesh serves every step
        steps["NumberOfParts"] = np.ones(layers, dtype=np.int64)
        steps["PointOffsets"] = zeros
        steps["CellOffsets"] = zeros[:, None]
        steps["ConnectivityIdOffsets"] = zeros[:, None]
        offsets = steps.create_group("PointDataOffsets")
        for name in ("displacement", "velocity"):
            offsets[name] = nodes * np.arange(layers, dtype=np.int64)


def is_bar_file(path: Path) -> bool:
    """Whether a file holds cells of a bar, not of a solid.

    Raises:
        OutputError: It is no field file.
    """
    try:
        with h5py.File(path, "r") as file:
            return bool(file["VTKHDF/Types"][0] == _VTK_LINE)
    except (OSError, KeyError, ValueError) as error:
        raise foreign_file(path, error) from error


def read_vtkhdf(path: Path) -> Fields:
    """Read back what `write_vtkhdf` wrote: displacement and velocity when they are asked for.

    Raises:
        OutputError: The file is not such a file.
    """
    try:
        with h5py.File(path, "r") as file:
            root = file["VTKHDF"]
            times = read_times(root)
            # A node that starts no element is the last one of its bar.
            nodes = np.arange(len(root["Points"]))
            ends = np.setdiff1d(nodes, root["Connectivity"][0::2])
            counts = tuple(np.diff(np.append(-1, ends)).tolist())
            size = len(times) * len(nodes)
            if any(len(root["PointData"][name]) != size for name in ("displacement", "velocity")):
                raise ValueError("not one value for each node and layer")
            return StoredFields(
                path, times, root["Points"][:, 0], counts if len(counts) > 1 else None
            )
    except (OSError, KeyError, ValueError) as error:
        raise foreign_file(path, error) from error


def read_times(root: Any) -> NDArray[np.float64]:
    """Times of the layers of a file.

    Raises:
        ValueError: It claims to have more than any run writes.
    """
    values = root["Steps/Values"]
    if values.ndim != 1 or len(values) > MAX_LAYERS:
        raise ValueError(f"its times have the shape {values.shape}")
    times: NDArray[np.float64] = values[:]
    return times


def write_with_dolfinx(fields: Fields, path: Path, kind: str) -> None:
    """Write VTX (a .bp folder of ADIOS2) or PVD (with .vtu files) through DOLFINx, on one rank.

    Args:
        fields: What to write.
        path: Target; ``.bp`` or ``.pvd``.
        kind: "vtx" or "pvd".
    """
    # Only when such output is wanted. Our module: it loads MPI before DOLFINx.
    from impactfem.fem import MPI, dolfinx_fem, dolfinx_mesh  # noqa: PLC0415

    mesh = dolfinx_mesh.create_interval(MPI.COMM_SELF, len(fields.positions) - 1, [0.0, 1.0])
    # The interval is uniform and its nodes come in any order: put each where it belongs.
    node = np.rint(mesh.geometry.x[:, 0] * (len(fields.positions) - 1)).astype(int)
    mesh.geometry.x[:, 0] = fields.positions[node]
    space = dolfinx_fem.functionspace(mesh, ("Lagrange", 1, (3,)))
    dofs = np.searchsorted(fields.positions, space.tabulate_dof_coordinates()[:, 0])
    functions = []
    for name in ("displacement", "velocity"):
        function = dolfinx_fem.Function(space)
        function.name = name
        functions.append(function)

    def fill(layer: int) -> None:
        for function, values in zip(functions, (fields.displacement, fields.velocity), strict=True):
            function.x.array[0::3] = values[layer, dofs]

    write_functions(path, kind, functions, fields.times, fill)
