"""Probes of solids: motion and stress of places, layer by layer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from impactfem.marching.solids import Level, SolidMarch
from impactfem.models.solids import SolidsModel
from impactfem.system.located import Located

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SolidProbes:
    """Observer that keeps what the nodes of this rank add to the columns of all probes.

    Attributes:
        march: Its rows take the columns.
        names: Probe and last part of each column.
        weights: Of the owned displacements and then the velocities of all bodies, one body after
            the other, (columns, 2 dofs).
    """

    march: SolidMarch
    names: tuple[tuple[str, str], ...]
    weights: csr_matrix

    @classmethod
    def of(cls, march: SolidMarch, model: SolidsModel) -> "SolidProbes":
        """Prepare; the rows of the march get room for the columns."""
        own, dim = model.own_numbers, model.parts[0].solid.dim
        place = {int(number): k for k, number in enumerate(own)} if model.probes else {}
        names: list[tuple[str, str]] = []
        told, rows, columns = [np.zeros(0)], [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)]
        for probe, body, located in model.probes:
            numbers = (located.numbers + model.starts[body]).tolist()
            mine = [k for k, number in enumerate(numbers) if number in place]
            dofs = dim * np.array([place[numbers[k]] for k in mine], dtype=int)[:, None]
            for quantity in probe.quantities:
                first = dim * len(own) if quantity == "velocity" else 0
                own_columns = (first + dofs + np.arange(dim)).ravel()
                for name, weights in _weights(quantity, located, dim).items():
                    rows.append(np.full(len(own_columns), len(names)))
                    columns.append(own_columns)
                    told.append(weights[mine].ravel())
                    names.append((probe.name, name))
        march.rows.probes = np.zeros((march.layers + 1, len(names)))
        entries = np.concatenate(told), (np.concatenate(rows), np.concatenate(columns))
        shape = len(names), 2 * dim * len(own)
        return cls(march, tuple(names), csr_matrix(entries, shape=shape))

    def __call__(self, level: Level) -> None:
        """Keep a level."""
        moved = np.concatenate([level.displacement, level.velocity])
        self.march.rows.probes[level.layer] = self.weights @ moved

    def columns(self, values: Floats) -> dict[str, dict[str, Floats]]:
        """Columns of each probe by their last part, of the sums of all ranks (rows, columns)."""
        found: dict[str, dict[str, Floats]] = {}
        for k, (probe, part) in enumerate(self.names):
            found.setdefault(probe, {})[part] = values[:, k]
        return found


def _weights(quantity: str, located: Located, dim: int) -> dict[str, Floats]:
    """Weights of the nodes in each column of a quantity, (nodes, dim), by its last part."""
    if quantity == "stress":
        return located.stress
    letter = {"displacement": "u", "velocity": "v"}[quantity]
    return {f"{letter}{'xyz'[k]}": np.outer(located.values, np.eye(dim)[k]) for k in range(dim)}
