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

from impactfem.arrays import Floats, Integers
from impactfem.fem import gather
from impactfem.system.elastic import ElasticSystem
from impactfem.system.regions import HeldRegion
from impactfem.system.rigid import in_space
from impactfem.system.stations import Asked, Stations
from impactfem.system.surface import SurfaceNodes

_FLAT = 1e-9  # share of the largest moment of a tip below which its nodes lie on a line


@dataclass(frozen=True)
class Tips:
    """Tips of a solid.

    Attributes:
        name: Of the solid.
        system: The solid.
        regions: What joints hold, by the name of a side and a place at t = 0 [m], the same on every
            rank.
    """

    name: str
    system: ElasticSystem
    regions: Mapping[tuple[str, tuple[float, ...]], HeldRegion]

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
        return np.unique(np.concatenate([held.numbers for held in self.regions.values()]))

    def stations(self, asked: Sequence[Asked]) -> Stations:
        """One for each region (collective).

        Rows are of the displacements of `nodes`. The compliance is that of a mass spread over
        them, which tells redundant rows; the march has its own.
        """
        system, nodes, every = self.system, self.nodes, self._every
        keys = [(name, tuple(place[: system.dim].tolist())) for name, place, _ in asked]
        alone = list(dict.fromkeys(keys))
        places, rows = [], []
        for key in alone:
            held = self.regions[key]
            made = tip(held.points, held.areas)
            if made is None:  # regions tell how they turn
                raise NotImplementedError
            place, own = made
            row = np.zeros((6, nodes.count, nodes.dim))
            row[:, np.searchsorted(every, held.numbers)] = own
            places.append(place)
            rows.append(row.reshape(6, -1))
        moved, moving = nodes.gather(system.displacement).ravel(), np.array(rows)
        found = Stations.along(
            tuple(alone.index(key) for key in keys),
            tuple(name for name, _ in alone),
            np.array(places) + np.array([(row @ moved)[:3] for row in rows]),
            moving,
            nodes.count / system.total_mass * moving.reshape(-1, len(moved)).T,
            nodes.gather(system.velocity).ravel(),
        )
        count = int((~gather(system.comm, system.constrained)).sum())
        return replace(found, freedoms=count, given=())


def tip(points: Floats, weights: Floats) -> tuple[Floats, Floats] | None:
    """Place (3,) of a tip and its velocity and spin by those of nodes (6, nodes, dim).

    None where its nodes do not tell how it turns.
    """
    dim = points.shape[1]
    whole = weights.sum()
    if not whole > 0.0:
        return None
    shares = weights / whole
    mean = shares @ points
    arms = in_space(points - mean)
    unit = np.eye(3)[:dim]
    moments = (arms**2).sum(axis=1)[:, None, None] * np.eye(3) - arms[:, :, None] * arms[:, None]
    moment = np.einsum("n,nij->ij", shares, moments)
    turns = slice(2, 3) if dim == 2 else slice(0, 3)  # in the plane one turn
    inner = moment[turns, turns]
    if np.linalg.eigvalsh(inner)[0] <= _FLAT * np.trace(moment):
        return None
    rows = np.zeros((6, len(points), dim))
    rows[:3] = shares[None, :, None] * np.eye(3)[:, None, :dim]
    turned = np.cross(arms[:, None], unit)  # r x e, (nodes, dim, 3)
    spins = np.einsum("n,ndk->knd", shares, turned)[turns]
    rows[3:][turns] = np.tensordot(np.linalg.inv(inner), spins, axes=1)
    return in_space(mean), rows
