"""Fields of bars: displacement and velocity along their axis, as arrays over layers and nodes."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.errors import OutputError
from impactfem.result.shapes import MOTION, Layout, Shape, as_vectors
from impactfem.result.snapshots import Snapshots

if TYPE_CHECKING:
    from impactfem.result.stored_snapshots import StoredSnapshots


@dataclass(frozen=True)
class Fields(Snapshots):
    """The motion of bars on their axis at the layers that were asked for.

    Attributes:
        times: [s], shape (layers,).
        positions: Node positions from the near end [m], shape (nodes,); of a row bar after bar,
            each from its own near end.
        displacement: u [m], shape (layers, nodes); the node is at position + displacement from
            the wall.
        velocity: u_t [m/s], shape (layers, nodes).
        counts: Nodes of each bar of a row; None: there is one bar.
        bars: Names of the bars; numbered if none are given.
    """

    times: Floats
    positions: Floats
    displacement: Floats
    velocity: Floats
    counts: tuple[int, ...] | None = None
    bars: tuple[str, ...] = ()

    @property
    def point_data(self) -> Mapping[str, int]:
        """Components of each field at the nodes."""
        return MOTION

    @property
    def layout(self) -> Layout:
        """The bars, undeformed, each from its own near end."""
        counts = self.counts or (len(self.positions),)
        names = self.bars or tuple(f"bar {k + 1}" for k in range(len(counts)))
        parts = np.split(self.positions, np.cumsum(counts)[:-1])
        return Layout.of(
            [Shape.line(name, own[:, None]) for name, own in zip(names, parts, strict=True)]
        )

    @property
    def starts(self) -> NDArray[np.int64]:
        """First node of each element."""
        nodes = len(self.positions)
        ends = np.cumsum(self.counts or (nodes,)) - 1
        return np.setdiff1d(np.arange(nodes, dtype=np.int64), ends)

    def read(self, layer: int, *names: str) -> dict[str, NDArray[Any]]:
        """Some fields of a layer as vectors; see `Snapshots.read`."""
        return {name: as_vectors(getattr(self, name)[layer, :, None]) for name in names or MOTION}

    def over_time(self, name: str, body: str | slice | None = None) -> NDArray[Any]:
        """A field at all layers as vectors; see `Snapshots.over_time`."""
        return as_vectors(getattr(self, name)[:, self.nodes(body), None])

    def __repr__(self) -> str:
        return f"Fields({len(self.times)} time levels of {len(self.positions)} nodes of bars)"


class StoredFields(Fields):
    """The motion of bars in a file, read when it is first asked for."""

    def __init__(self, stored: "StoredSnapshots") -> None:
        """Take a file; only its bodies are read."""
        layout = stored.layout
        counts = np.diff(layout.starts)
        for name, value in {
            "_stored": stored, "times": stored.times, "positions": layout.points[:, 0],
            "counts": tuple(counts.tolist()) if len(counts) > 1 else None,
            "bars": layout.names,
        }.items():  # fmt: skip
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        if name not in {"displacement", "velocity"}:
            raise AttributeError(name)
        stored: StoredSnapshots = self._stored
        try:
            values = stored.over_time(name)[:, :, 0]
        except (OSError, KeyError, ValueError) as error:
            raise OutputError(
                f"{stored.path}: not a field file of impactfem ({error}); run the scene again"
            ) from error
        object.__setattr__(self, name, values)
        return values

    def write(self, path: Path) -> None:
        """Copy the file."""
        self._stored.write(path)
