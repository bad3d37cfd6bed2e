"""Snapshots of the bodies of a scene: what is known at their nodes, layer by layer."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.cards import card
from impactfem.errors import SceneError
from impactfem.result.grids import make_grid, nearest_layer
from impactfem.result.shapes import Layout, Shape

if TYPE_CHECKING:
    import pyvista as pv

_AT_ONCE = 1 << 25  # bytes of layers that are written together


class Snapshots(ABC):
    """Fields of all bodies at the layers that were asked for.

    Attributes:
        times: Times of the layers [s], shape (layers,).
    """

    times: Floats

    @property
    @abstractmethod
    def point_data(self) -> Mapping[str, int]:
        """Components of each field at the nodes."""

    @property
    @abstractmethod
    def layout(self) -> Layout:
        """The bodies, undeformed."""

    @abstractmethod
    def read(self, layer: int, *names: str) -> dict[str, NDArray[Any]]:
        """Read some fields of a layer, all if no name is given.

        Args:
            layer: From 0, or from -1 backwards.
            *names: As in `point_data`.

        Returns:
            Arrays of shape (nodes,) or (nodes, 3).

        Raises:
            IndexError: There is no such layer.
        """

    @abstractmethod
    def over_time(self, name: str, body: str | slice | None = None) -> NDArray[Any]:
        """A field at all layers, in memory.

        Args:
            name: As in `point_data`.
            body: At its nodes, or at a slice of all nodes only.

        Returns:
            Shape (layers, nodes) or (layers, nodes, 3).

        Raises:
            SceneError: There is no such body.
        """

    def _repr_html_(self) -> str:
        layout = self.layout
        rows = [
            (
                "time levels",
                f"{len(self)}, {self.times[0]:g} to {self.times[-1]:g} s" if len(self) else "0",
            ),
            ("bodies", ", ".join(layout.names)),
            ("nodes", str(len(layout.points))),
            ("fields", ", ".join(self.point_data)),
        ]
        return card(
            "Fields", rows, parts=["<code>.grid(time=...)</code>, <code>.over_time(name)</code>"]
        )

    @property
    def needed_bytes(self) -> int:
        """Upper bound of what the file of `write` takes."""
        layout = self.layout
        mesh = 16 * (4 * len(layout.points) + len(layout.connectivity) + 2 * len(layout.types))
        from impactfem.result.spool import needed_bytes  # noqa: PLC0415  (h5py, to write only)

        return mesh + 131_072 + needed_bytes(len(self), len(layout.points), self.point_data)

    def write(self, path: Path) -> None:
        """Write a file as `FieldSpool` does; some layers at a time are made vectors of.

        Raises:
            OutputError: The file cannot be written.
        """
        # Only what is kept needs h5py.
        from impactfem.result.spool import FieldSpool  # noqa: PLC0415

        nodes, times = len(self.layout.points), self.times
        count = max(1, _AT_ONCE // (8 * nodes * sum(self.point_data.values())))
        with FieldSpool(path, self.layout, self.point_data) as spool:
            for first in range(0, len(times), count):
                some = [self.read(k) for k in range(first, min(first + count, len(times)))]
                values = {name: np.stack([one[name] for one in some]) for name in self.point_data}
                spool.extend(times[first : first + count], values)

    @property
    def points(self) -> Floats:
        """Undeformed nodes [m], shape (nodes, 3)."""
        return self.layout.points

    @property
    def cells(self) -> NDArray[np.int64]:
        """Nodes of each cell in VTK's order, shape (cells, nodes of a cell).

        Raises:
            SceneError: There are cells of several kinds.
        """
        blocks = self.layout.blocks
        if len(blocks) > 1:
            raise SceneError("fields.cells: there are cells of several kinds; take layout.blocks")
        (cells,) = blocks.values()
        return cells

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return self.layout.names

    def __len__(self) -> int:
        """Number of layers."""
        return len(self.times)

    def nodes(self, body: str | slice | None) -> slice:
        """Nodes of a body, of all if None; a slice is given back.

        Raises:
            SceneError: There is no such body.
        """
        if isinstance(body, slice):
            return body
        layout = self.layout
        if body is None:
            return slice(0, int(layout.starts[-1]))
        if body not in layout.names:
            raise SceneError(
                f'body "{body}" is none of these fields: give {" or ".join(layout.names)}'
            )
        first = layout.names.index(body)
        return slice(*layout.starts[first : first + 2].tolist())

    def places(self, body: str | None = None) -> Floats:
        """Where the nodes of a body, or of all, are at all layers [m], shape (layers, nodes, 3).

        Raises:
            SceneError: There is no such body.
        """
        places: Floats = self.points[self.nodes(body)] + self.over_time("displacement", body)
        return places

    def grid(
        self, layer: int = -1, *, time: float | None = None, deformed: bool = False
    ) -> "pv.UnstructuredGrid":
        """The bodies at one time as a grid of pyvista.

        Args:
            layer: From 0, or from -1 backwards.
            time: The layer nearest to this time [s] instead.
            deformed: Whether the nodes are where the bodies are, not where they were.

        Returns:
            All fields and ``radius`` are at its points, ``body`` (the number of the body) in its
            cells, ``time`` [s] and ``bodies`` (their names) among its field data.

        Raises:
            IndexError: There is no such layer.
            SceneError: The time is none of the fields.
            MissingDependencyError: pyvista is not installed.
        """
        index = range(len(self))[layer] if time is None else nearest_layer(self.times, time)
        return make_grid(self.layout, self.read(index), float(self.times[index]), deformed=deformed)


class KeptSnapshots(Snapshots):
    """Snapshots in memory.

    Attributes:
        times: Times of the layers [s], shape (layers,).
        values: Each field, shape (layers, nodes) or (layers, nodes, 3).
    """

    def __init__(
        self, times: Floats, shapes: Sequence[Shape], values: Mapping[str, NDArray[Any]]
    ) -> None:
        """Take bodies, as they are at rest, and what is known at their nodes."""
        self.times, self.values = times, values
        self._layout = Layout.of(shapes)

    @property
    def layout(self) -> Layout:
        """The bodies, undeformed."""
        return self._layout

    @property
    def point_data(self) -> Mapping[str, int]:
        """Components of each field at the nodes."""
        return {name: 3 if given.ndim == 3 else 1 for name, given in self.values.items()}

    def read(self, layer: int, *names: str) -> dict[str, NDArray[Any]]:
        """Some fields of a layer; see `Snapshots.read`."""
        return {name: self.values[name][layer] for name in names or self.values}

    def over_time(self, name: str, body: str | slice | None = None) -> NDArray[Any]:
        """A field at all layers; see `Snapshots.over_time`."""
        return self.values[name][:, self.nodes(body)]

    def __repr__(self) -> str:
        bodies = ", ".join(self.names)
        return f"KeptSnapshots({len(self)} time levels of {len(self.points)} nodes of {bodies})"
