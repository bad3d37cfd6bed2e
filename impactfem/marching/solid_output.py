"""What is kept of a solid's march: fields every so many layers, checkpoints, and a watch."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.surfaces import ContactNodes
from impactfem.contact.watch import penetration_of_others
from impactfem.fem import on_root
from impactfem.marching.collect import Collector
from impactfem.marching.solids import Level
from impactfem.result.solid_fields import FieldSpool

Floats = NDArray[np.float64]


class FieldOutput:
    """Appends the fields of every so many layers to a spool on rank 0."""

    def __init__(
        self,
        collector: Collector,
        dim: int,
        spool: FieldSpool | None,
        contact: ContactNodes,
        stress: Callable[[Floats], Floats],
        comm: Any,
        every: int,
        layers: int,
    ) -> None:
        """Set what is written when.

        Args:
            collector: Of the nodes.
            dim: Components of a node.
            spool: Open on rank 0, None elsewhere.
            contact: The contact nodes.
            stress: Gives von Mises stress of the own nodes for their displacements [Pa].
            comm: MPI communicator.
            every: Layers between fields.
            layers: Number of layers; the last is written too.
        """
        self._collector, self._dim = collector, dim
        self._spool, self._contact = spool, contact
        self._stress, self._comm, self._every, self._layers = stress, comm, every, layers

    def __call__(self, level: Level) -> None:
        """Write the level if it is its turn (collective)."""
        if level.layer % self._every and level.layer != self._layers:
            return
        collect = self._collector.collect
        values = {
            "displacement": collect(level.displacement, self._dim),
            "velocity": collect(level.velocity, self._dim),
            "von_mises": collect(self._stress(level.displacement), 1),
        }
        on_root(self._comm, lambda: self._append(level, values))

    def _append(self, level: Level, values: dict[str, Floats | None]) -> None:
        if self._spool is None:
            return
        nodes = len(values["von_mises"])  # type: ignore[arg-type]  # on rank 0 there are arrays
        where = self._contact.numbers
        gap, pressure, active = np.full(nodes, np.nan), np.zeros(nodes), np.zeros(nodes)
        gap[where] = level.gap
        pressure[where] = self._contact.pressures @ level.force
        active[where] = level.force > 0.0
        given = {name: array for name, array in values.items() if array is not None}
        given["von_mises"] = given["von_mises"][:, 0]
        self._spool.append(
            level.time, {**given, "gap": gap, "contact_pressure": pressure, "active": active}
        )


class Watch:
    """Notices nodes without contact unknowns that come into an obstacle all the same."""

    def __init__(
        self, comm: Any, contact: ContactNodes, obstacles: Sequence[Any], numbers: Any,
        positions: Floats, every: int,
    ) -> None:  # fmt: skip
        """Look every so many layers; arguments as for `penetration_of_others`."""
        self._comm, self._contact, self._obstacles = comm, contact, obstacles
        self._numbers, self._positions, self._every = numbers, positions, every
        self.depth = 0.0
        self.message = ""

    def __call__(self, level: Level) -> None:
        """Look at a level if it is its turn (collective)."""
        if level.layer % self._every:
            return
        places = self._positions + level.displacement.reshape(self._positions.shape)
        found = penetration_of_others(
            self._comm, self._contact, self._obstacles, self._numbers, places, level.time
        )
        if found is not None and found.depth > self.depth:
            self.depth = found.depth
            where = ", ".join(f"{value:.4g}" for value in found.place)
            self.message = (
                f"a node without contact unknowns was {found.depth:.3g} m deep in obstacle "
                f"{self._obstacles[found.obstacle].name!r} at ({where}) m, t = {level.time:.4g} s; "
                "name its surface in body.contact_surfaces"
            )
