"""Nodal values of all ranks on rank 0, in an order that does not depend on their number."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.fem import MPI


class Collector:
    """Moves nodal values between the ranks and rank 0, where they are in canonical order."""

    def __init__(self, comm: Any, numbers: NDArray[np.int64]) -> None:
        """Tell rank 0 which nodes this rank owns (collective).

        Args:
            comm: MPI communicator.
            numbers: Canonical numbers of the nodes this rank owns, shape (owned,).
        """
        self._comm, self._own = comm, len(numbers)
        parts = comm.gather(numbers, root=0)
        self._counts = None if parts is None else np.array([len(part) for part in parts])
        self._order = None if parts is None else np.concatenate(parts)

    @property
    def count(self) -> int:
        """Number of nodes of all ranks, on rank 0; 0 elsewhere."""
        return 0 if self._order is None else len(self._order)

    def collect(self, values: Floats, components: int) -> Floats | None:
        """Values of all nodes on rank 0, shape (nodes, components); None elsewhere (collective).

        Args:
            values: Of the own nodes, shape (owned * components,).
            components: Values of a node.
        """
        sent = np.ascontiguousarray(values, dtype=np.float64)
        if self._counts is None or self._order is None:
            self._comm.Gatherv(sent, None, root=0)
            return None
        found = np.empty(components * len(self._order))
        self._comm.Gatherv(sent, (found, components * self._counts), root=0)
        ordered = np.empty((len(self._order), components))
        ordered[self._order] = found.reshape(-1, components)
        return ordered

    def distribute(self, values: Floats | None, components: int) -> Floats:
        """Give each rank the values of its nodes, the inverse of `collect` (collective)."""
        own = np.empty(components * self._own)
        if self._counts is None or self._order is None or values is None:
            self._comm.Scatterv(None, own, root=0)
            return own
        sent = np.ascontiguousarray(values[self._order]).ravel()
        self._comm.Scatterv((sent, components * self._counts), own, root=0)
        return own


def total(comm: Any, values: Floats) -> Floats:
    """Sum over all ranks, on every rank."""
    found = np.array(values)
    comm.Allreduce(MPI.IN_PLACE, found)
    return found
