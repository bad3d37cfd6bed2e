"""Several bodies in one layer: each moves by its own scheme, contact sees all their nodes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import SceneError
from impactfem.marching.layers import Interior, Sums

Floats = NDArray[np.float64]


class Composite:
    """The interiors of several bodies as one; see `impactfem.marching.layers.Interior`.

    Contact nodes are those of the first body, then of the second, and so on. Bodies that no force
    reaches are not asked for answers. The part of a contact force that a support takes (a
    normal on the axis or a cut of symmetry may lean a little out of it) moves nothing.

    Attributes:
        parts: Interiors of the bodies, all with the same step.
        offsets: Where the contact nodes of each body begin, and their number, (bodies + 1,).
        rows: Sums of each body, layer by layer, of this rank: kinetic, elastic, work of loads,
            momentum and moment, shape (bodies, layers + 1, 3 + 2 dim).
    """

    def __init__(
        self, parts: Sequence[Interior], layers: int, free: Sequence[Floats] | None = None
    ) -> None:
        """Join interiors.

        Args:
            parts: The bodies.
            layers: Number of layers.
            free: Of each body 1 where a contact node may move and 0 where a support holds it,
                (count, dim); everywhere 1 if None.

        Raises:
            SceneError: Their steps differ.
        """
        self.parts = tuple(parts)
        self.dt = parts[0].dt
        if any(part.dt != self.dt for part in parts):
            raise SceneError(
                f"the bodies have the time steps {[part.dt for part in parts]} s: give one solve.dt"
            )
        counts = [len(part.surface_displacement) for part in parts]
        dim = parts[0].surface_displacement.shape[1]
        self.offsets: tuple[int, ...] = (0, *np.cumsum(counts).tolist())
        self.whole_columns: int | None = 0
        self._free = [1.0] * len(parts) if free is None else list(free)
        self.rows: Floats = np.zeros((len(parts), layers + 1, 3 + 2 * dim))

    def own(self, body: int) -> slice:
        """Places of a body's contact nodes."""
        return slice(self.offsets[body], self.offsets[body + 1])

    @property
    def velocity(self) -> Floats:
        """Velocity of the owned dofs of all bodies, one after the other [m/s]."""
        return np.concatenate([part.velocity for part in self.parts])

    @property
    def surface_displacement(self) -> Floats:
        """Of the contact nodes of all bodies [m], (count, dim)."""
        return np.concatenate([part.surface_displacement for part in self.parts])

    def surface_velocity(self) -> Floats:
        """Velocity of the contact nodes [m/s], (count, dim) (collective)."""
        return np.concatenate([part.surface_velocity() for part in self.parts])

    def initial(self, static: Floats) -> Sums:
        """Sums of the initial state."""
        return self._joined(0, [p.initial(static[self.own(k)]) for k, p in enumerate(self.parts)])

    def share(self, layer: int) -> float:
        """Part of a layer's contact force that acts."""
        return self.parts[0].share(layer)

    def gravity(self, layer: int) -> Floats:
        """Gravity that the layer uses [m/s^2], shape (dim,)."""
        return self.parts[0].gravity(layer)

    def predict(self, layer: int) -> Floats:
        """Move all bodies to the end of a layer without contact."""
        return np.concatenate([part.predict(layer) for part in self.parts])

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Answers of the contact nodes to several forces (several, count, dim)."""
        layer, static = np.zeros_like(forces), np.zeros_like(forces)
        for k, part in enumerate(self.parts):
            mine = forces[:, self.own(k)] * self._free[k]
            asked = np.flatnonzero(mine.any(axis=(1, 2)))
            if len(asked):
                found = part.columns(np.ascontiguousarray(mine[asked]))
                layer[asked, self.own(k)], static[asked, self.own(k)] = found
        return layer, static

    def static(self, forces: Floats) -> Floats:
        """Displacement of massless contact nodes by static forces on them, (count, dim) each."""
        found = np.zeros_like(forces)
        for k, part in enumerate(self.parts):
            mine = forces[self.own(k)] * self._free[k]
            if mine.any():
                found[self.own(k)] = part.static(mine)
        return found

    def push(self, forces: Floats, change: Floats | None) -> None:  # noqa: ARG002  (as the interface has it)
        """Add the effect of the layer's contact forces (count, dim) to the bodies they act on."""
        for k, part in enumerate(self.parts):
            mine = forces[self.own(k)] * self._free[k]
            if mine.any():
                part.push(mine, None)

    def finish(self, layer: int, static: Floats) -> Sums:
        """End the layer of all bodies."""
        sums = [part.finish(layer, static[self.own(k)]) for k, part in enumerate(self.parts)]
        return self._joined(layer + 1, sums)

    def _joined(self, row: int, sums: list[Sums]) -> Sums:
        for k, entry in enumerate(sums):
            self.rows[k, row] = [
                entry.kinetic, entry.elastic, entry.work, *entry.momentum, *entry.moment,
            ]  # fmt: skip
        return Sums(
            sum(entry.kinetic for entry in sums),
            sum(entry.elastic for entry in sums),
            sum(entry.work for entry in sums),
            np.sum([entry.momentum for entry in sums], axis=0),
            np.sum([entry.moment for entry in sums], axis=0),
        )

    def placed(self, static: Floats) -> Floats:
        """Displacement of the owned dofs of all bodies, one after the other."""
        return np.concatenate(
            [part.placed(static[self.own(k)]) for k, part in enumerate(self.parts)]
        )

    def state(self) -> dict[str, Any]:
        """What the next layer needs, of all bodies."""
        return {
            f"{k}.{name}": value
            for k, part in enumerate(self.parts)
            for name, value in part.state().items()
        }

    def restore(self, state: dict[str, Any], surface: Floats) -> None:
        """Continue from a state."""
        for k, part in enumerate(self.parts):
            mark = f"{k}."
            mine = {n.removeprefix(mark): v for n, v in state.items() if n.startswith(mark)}
            part.restore(mine, surface[self.own(k)])

    def destroy(self) -> None:
        """Free what PETSc holds."""
        for part in self.parts:
            part.destroy()
