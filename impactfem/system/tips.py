"""Marked surfaces of solids as joints hold them: rigid tips in the mean.

A tip is where the mean of its surface is, and turns as a rigid body would that moves most like it:
with weights w (areas of nodes), arms r from the mean place, displacements u

    x = sum w u / sum w,    theta = J^-1 sum w r x u,    J = sum w (r.r 1 - r r^T).

Forces and moments go to the nodes by the transposed map, so that they are the same, and do the same
work, as on the tip. (As RBE3 of NASTRAN.) Nodes that may touch have no mass, and nodes that are
held do not move: the mean is that of the others.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats, Integers
from impactfem.errors import SceneError
from impactfem.fem import gather
from impactfem.system.elastic import ElasticSystem
from impactfem.system.rigid import in_space
from impactfem.system.stations import Stations
from impactfem.system.surface import SurfaceNodes

_FLAT = 1e-9  # share of the largest moment of a tip below which its nodes lie on a line


@dataclass(frozen=True)
class Tips:
    """Tips of a solid.

    Attributes:
        name: Of the solid.
        system: The solid.
        surfaces: Numbers (nodes,), places (nodes, dim) [m] and areas (nodes,) of the nodes of each
            surface that joints hold, by its name, the same on every rank.
        touching: Canonical numbers of nodes that may touch.
    """

    name: str
    system: ElasticSystem
    surfaces: Mapping[str, tuple[Integers, Floats, Floats]]
    touching: Integers

    @property
    def names(self) -> tuple[str, ...]:
        """That of the solid."""
        return (self.name,)

    @property
    def nodes(self) -> SurfaceNodes:
        """Nodes of all surfaces."""
        system = self.system
        return SurfaceNodes.of(system.comm, system.dim, self._every, system.numbers)

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Which of the nodes neither touch nor are held (collective at the first use)."""
        held = self.nodes.gather(self.system.constrained.astype(float)).any(axis=1)
        return np.asarray(~held & ~np.isin(self._every, self.touching))

    @property
    def _every(self) -> Integers:
        """Numbers of all nodes, increasing."""
        return np.unique(np.concatenate([numbers for numbers, *_ in self.surfaces.values()]))

    def left_out(self) -> dict[str, tuple[int, int]]:
        """Of surfaces not all nodes of which count: how many do, and how many there are."""
        counts = {
            name: (int(self.free[np.searchsorted(self._every, numbers)].sum()), len(numbers))
            for name, (numbers, *_) in self.surfaces.items()
        }
        return {name: both for name, both in counts.items() if both[0] < both[1]}

    def beside(self, name: str, place: Floats) -> tuple[float, float, float]:
        """How a place lies to the tip of a surface [m] (collective at the first use).

        Returns:
            Its distance from the mean of the nodes, their own root mean square distance from that,
            and its distance from the nearest node. Undeformed.
        """
        numbers, points, areas = self.surfaces[name]
        weights = areas * self.free[np.searchsorted(self._every, numbers)]
        mean = np.average(points, axis=0, weights=weights)
        away = ((points - mean) ** 2).sum(axis=1)
        nearest = np.linalg.norm(points - place, axis=1).min()
        spread = np.average(away, weights=weights)
        return float(np.linalg.norm(place - mean)), float(np.sqrt(spread)), float(nearest)

    def stations(self, asked: Sequence[tuple[str, Floats]]) -> Stations:
        """One for each surface that is named (collective).

        Rows are of the displacements of `nodes`. The compliance is that of a mass spread over
        them, which tells redundant rows; the march has its own.

        Raises:
            SceneError: Too few nodes of one neither touch nor are held.
        """
        system, nodes, every = self.system, self.nodes, self._every
        names = tuple(dict.fromkeys(name for name, _ in asked))
        places, rows = [], []
        for name in names:
            numbers, points, areas = self.surfaces[name.partition("/")[2]]
            at = np.searchsorted(every, numbers)
            weights = areas * self.free[at]
            made = tip(points, weights)
            if made is None:
                raise SceneError(
                    f'joint.between = "{name}": {int((weights > 0.0).sum())} of {len(at)} nodes of '
                    "the surface neither touch nor are held, too few to tell how it turns; give a "
                    "finer mesh or another surface, or name the surfaces that touch by [[contact]]"
                )
            place, own = made
            row = np.zeros((6, nodes.count, nodes.dim))
            row[:, at] = own
            places.append(place)
            rows.append(row.reshape(6, -1))
        moved, moving = nodes.gather(system.displacement).ravel(), np.array(rows)
        found = Stations.along(
            tuple(names.index(name) for name, _ in asked),
            names,
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
