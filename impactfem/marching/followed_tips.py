"""Tips of nodes that move far: places and turns of stations, with arms that turn with their nodes.

Arms amid a layer make of ways u of the nodes the turn T = J^-1 sum w r x u of which rigid ones have
R_b - R_a = T x (R_a + R_b) / 2 exactly: what moments do on nodes by the transposed map is their
work on T, and the moment itself.
"""

from dataclasses import replace

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.system.cuts import WHOLE, Cuts
from impactfem.system.regions import tip
from impactfem.system.stations import Stations


class FollowedTips:
    """Stations of nodes, by rates of which each moves some."""

    def __init__(self, stations: Stations, dim: int) -> None:
        """Take the nodes from the rows of stations, (stations, 6, nodes dim)."""
        self._dim, self._rows = dim, stations.rows.reshape(-1, stations.rows.shape[2])
        self._moves = np.flatnonzero(self._rows.any(axis=1))  # in the plane not all
        self._turning: list[tuple[int, Integers, Floats, Cuts]] = []
        for k, row in enumerate(stations.rows):
            if row[3:].any():
                axis = next(k for k in range(dim) if row[k].any())  # one along planes that cut it
                shares = row[axis, axis::dim]
                nodes = np.flatnonzero(shares)
                cuts = stations.cuts[k] if stations.cuts else WHOLE
                self._turning.append((k, nodes, shares[nodes], cuts))

    @property
    def turns(self) -> bool:
        """Whether rates change with places."""
        return bool(self._turning)

    @property
    def first(self) -> Floats:
        """Rates of the tips by those of the nodes as given, (tips, nodes dim)."""
        return np.asarray(self._rows[self._moves])

    def as_coordinates(self, stations: Stations) -> Stations:
        """The stations with rows of their own rates."""
        rows = np.eye(len(self._rows))[:, self._moves]
        return replace(stations, rows=rows.reshape(*stations.places.shape[:1], 6, -1))

    def rows(self, places: Floats) -> Floats:
        """Rates of the tips by those of the nodes, these at some places [m], (tips, nodes dim)."""
        if not self._turning:
            return self.first
        found = self._rows.reshape(len(self._rows), -1, self._dim).copy()
        for k, nodes, shares, cuts in self._turning:
            made = tip(places.reshape(-1, self._dim)[nodes], shares, cuts)
            if made is not None:
                found[6 * k : 6 * k + 6, nodes] = made[1]
        return np.asarray(found.reshape(self._rows.shape)[self._moves])

    def places(self, places: Floats) -> Floats:
        """Mean places of the tips by those of the nodes (nodes dim,), and 0 for turns, (tips,)."""
        turns = self._moves % 6 >= 3
        return np.where(turns, 0.0, self._rows[self._moves] @ places)
