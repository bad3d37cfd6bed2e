"""Regions of surfaces of solids as joints hold them: rigid tips in the mean.

A tip is where the mean of its nodes is, and turns as a rigid body would that moves most like it:
with weights w (areas of nodes), arms r from the mean place, displacements u

    x = sum w u / sum w,    theta = J^-1 sum w r x u,    J = sum w (r.r 1 - r r^T).

Forces and moments go to the nodes by the transposed map, so that they are the same, and do the same
work, as on the tip. (As RBE3 of NASTRAN.) Nodes that supports hold do not move: the mean is that of
the others. Nodes that joints hold have their mass, and do not touch.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactfem.arrays import Integers
from impactfem.fem import gather
from impactfem.system.elastic import ElasticSystem
from impactfem.system.regions import HeldRegion, Key
from impactfem.system.stations import Asked, Stations, Tied
from impactfem.system.surface import SurfaceNodes


@dataclass(frozen=True)
class Tips:
    """Tips of a solid.

    Attributes:
        name: Of the solid.
        system: The solid.
        regions: What joints hold, the same on every rank.
    """

    name: str
    system: ElasticSystem
    regions: Mapping[Key, HeldRegion]

    @property
    def names(self) -> tuple[str, ...]:
        """That of the solid."""
        return (self.name,)

    @property
    def nodes(self) -> SurfaceNodes:
        """Nodes of all regions."""
        system = self.system
        return SurfaceNodes.of(system.comm, system.dim, self._every, system.numbers)

    @property
    def _every(self) -> Integers:
        """Numbers of all nodes, increasing."""
        each = [held.numbers for held in self.regions.values()]
        return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *each]))

    def stations(self, asked: Sequence[Asked]) -> Stations:
        """One for each region (collective).

        Rows are of the displacements of `nodes`. The compliance is that of a mass spread over
        them, which tells redundant rows; the march has its own.
        """
        system, nodes, every = self.system, self.nodes, self._every
        keys = [(name, tuple(at[: system.dim].tolist()), radius) for name, at, radius in asked]
        alone = list(dict.fromkeys(keys))
        places, rows = [], []
        for key in alone:
            held = self.regions[key]
            place, own = held.tip()
            row = np.zeros((6, nodes.count, nodes.dim))
            row[:, np.searchsorted(every, held.numbers)] = own
            # Ties hold displacements, which places would round; see `Joints.extent`.
            places.append(np.zeros(3) if isinstance(key[2], Tied) else place)
            rows.append(row.reshape(6, -1))
        moved, moving = nodes.gather(system.displacement).ravel(), np.array(rows)
        found = Stations.along(
            tuple(alone.index(key) for key in keys),
            tuple(name for name, *_ in alone),
            np.array(places) + np.array([(row @ moved)[:3] for row in rows]),
            moving,
            nodes.count / system.total_mass * moving.reshape(-1, len(moved)).T,
            nodes.gather(system.velocity).ravel(),
        )
        count = int((~gather(system.comm, system.constrained)).sum())
        fastest = float(np.abs(nodes.gather(system.velocity)).max(initial=0.0))
        cuts = tuple(self.regions[key].cuts for key in alone)
        return replace(found, freedoms=count, given=(), fastest=fastest, cuts=cuts)
