"""Fields of several solids, kept as those of one mesh on rank 0."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.pairs import PairGaps
from impactfem.errors import SceneError
from impactfem.fem import cell_nodes, on_root
from impactfem.marching.collect import Collector
from impactfem.marching.solids import Level
from impactfem.result.cell_kinds import KINDS
from impactfem.result.solid_fields import FieldSpool

Floats = NDArray[np.float64]


class BodiesOutput:
    """Appends the fields of every so many layers to a spool on rank 0; nodes body after body.

    Args:
        model: The solids: `parts` with mesh, system and solid, `numbers` of their contact nodes.
        place: The file on rank 0, None elsewhere.
        every: Layers between fields; the last is written too.
        layers: Number of layers.
        gaps: Of the march.

    Raises:
        SceneError: The bodies have different kinds of cells, which one file cannot hold.
    """

    def __init__(
        self, model: Any, place: Path | None, every: int, layers: int, gaps: PairGaps
    ) -> None:
        self._model, self._every, self._layers, self._gaps = model, every, layers, gaps
        kinds = {(part.mesh.cell, part.mesh.degree) for part in model.parts}
        if len(kinds) > 1:
            raise SceneError(
                f"output.fields: the bodies have different cells ({sorted(kinds)}), which one file "
                "cannot hold; give all the same cells and degree, or fields = []"
            )
        comm = model.comm
        self._collectors = [Collector(comm, part.system.numbers) for part in model.parts]
        self._sizes = [len(part.system.constrained) for part in model.parts]
        points, cells = [], []
        for part, collector in zip(model.parts, self._collectors, strict=True):
            dim = part.solid.dim
            points.append(collector.collect(part.system.positions.ravel(), dim))
            cells.append(_cells(comm, part.mesh))
        found: list[FieldSpool] = []

        def make() -> None:
            starts = np.cumsum([0, *(len(p) for p in points if p is not None)])
            self._starts = starts
            kind = KINDS[model.parts[0].mesh.cell, model.parts[0].mesh.degree]
            joined = np.concatenate(
                [c[:, list(kind.order)] + first for c, first in zip(cells, starts, strict=False)]
            )
            if place is not None:
                found.append(
                    FieldSpool(
                        place,
                        np.concatenate([p for p in points if p is not None]),
                        joined,
                        kind.vtk_type,
                    )
                )

        on_root(comm, make)
        self._spool = found[0] if found else None

    def __call__(self, level: Level) -> None:
        """Write the level if it is its turn (collective)."""
        if level.layer % self._every and level.layer != self._layers:
            return
        model = self._model
        cuts = np.cumsum([0, *self._sizes])
        names = ("displacement", "velocity", "von_mises")
        values: dict[str, list[Floats | None]] = {name: [] for name in names}
        displacement, velocity = level.displacement, level.velocity
        for k, (part, collector) in enumerate(zip(model.parts, self._collectors, strict=True)):
            own, dim = slice(cuts[k], cuts[k + 1]), part.solid.dim
            values["displacement"].append(collector.collect(displacement[own], dim))
            values["velocity"].append(collector.collect(velocity[own], dim))
            stress = part.system.stress_at(displacement[own])
            values["von_mises"].append(collector.collect(stress, 1))
        on_root(model.comm, lambda: self._append(level, values))

    def _append(self, level: Level, values: dict[str, list[Floats | None]]) -> None:
        if self._spool is None:
            return
        joined = {n: np.concatenate([p for p in v if p is not None]) for n, v in values.items()}
        joined["von_mises"] = joined["von_mises"][:, 0]
        nodes = len(joined["von_mises"])
        gap, pressure, active = np.full(nodes, np.nan), np.zeros(nodes), np.zeros(nodes)
        seen = self._gaps.nodal(level.force, level.gap)
        first = 0
        for k, numbers in enumerate(self._model.numbers):
            where, own = self._starts[k] + numbers, slice(first, first + len(numbers))
            gap[where], pressure[where], active[where] = (part[own] for part in seen)
            first = own.stop
        self._spool.append(
            level.time, {**joined, "gap": gap, "contact_pressure": pressure, "active": active}
        )

    def close(self) -> None:
        """Close the file."""
        if self._spool is not None:
            self._spool.close()


def _cells(comm: Any, mesh: Any) -> Any:
    """Cells of the whole mesh by canonical numbers, on rank 0 (collective)."""
    own = mesh.mesh.topology.index_map(mesh.mesh.topology.dim).size_local
    cells = mesh.numbers[cell_nodes(mesh.mesh)[:own]]
    everything = comm.gather((mesh.mesh.topology.original_cell_index[:own], cells), root=0)
    if everything is None:
        return None
    order = np.concatenate([part[0] for part in everything])
    ordered = np.empty((len(order), cells.shape[1]), dtype=np.int64)
    ordered[order] = np.concatenate([part[1] for part in everything])
    return ordered
