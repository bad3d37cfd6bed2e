"""Places of bodies whose way is kept, so that runs on other elements can be compared with it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.fem import on_root
from impactfem.marching.marched import Marched
from impactfem.models.solids import SolidPart, SolidsModel

type Places = Mapping[str, Floats]
"""Undeformed places [m], (places, dim), by the body's name; of a probe behind a slash."""

_MOST, _LEAST = 24, 4  # places of a body
_VALUES = 4_000_000  # numbers that are kept of a run, as far as `_LEAST` allows
_MARK = "\0"  # no probe has such a name


def chosen_places(model: SolidsModel, few: Sequence[Marched], layers: int) -> Places:
    """Nodes all over each body that has elements, and its probes (collective).

    Args:
        model: The bodies.
        few: What marches those without meshes.
        layers: Number of layers.
    """
    lined = _lined(model, few)
    numbers = layers * model.dim * max(1, len(model.parts) + len(lined))
    count = int(np.clip(_VALUES // max(1, numbers), _LEAST, _MOST))
    found = {part.solid.name: _spread(part, count) for part in model.parts}
    meshed = {body.name for body in model.scene.meshed}
    for name, (march, body) in lined.items():
        nodes = march.shown.material(body)
        if name not in meshed and (shared := _shared(len(nodes) - 1)) > 1:
            nodes = nodes[:: (len(nodes) - 1) // shared]  # as beams bend between theirs
        found[name] = nodes[np.unique(np.linspace(0, len(nodes) - 1, count).round().astype(int))]
    moving = [probe for probe in model.scene.probes if "displacement" in probe.quantities]
    for probe in moving:
        if probe.body in found:
            found[f"{probe.body}/{probe.name}"] = np.array([probe.point], dtype=np.float64)
    for probe, body, located in model.probes:
        if probe in moving:
            system = model.parts[body].system
            mine = {int(number): at for at, number in enumerate(system.numbers)}
            shares = zip(located.numbers.tolist(), located.values, strict=True)
            own = [share * system.positions[mine[n]] for n, share in shares if n in mine]
            place = system.comm.allreduce(np.sum([np.zeros(model.dim), *own], axis=0))
            found[f"{probe.body}/{probe.name}"] = place[None]
    return found


def _shared(elements: int) -> int:
    """Elements between nodes that a line has on larger elements too."""
    return math.gcd(elements, *(max(1, round(elements / factor)) for factor in (2.0, 4.0)))


def _lined(model: SolidsModel, few: Sequence[Marched]) -> dict[str, tuple[Marched, int]]:
    """What marches the bodies with elements that are no solids, and their places there."""
    meshed = {body.name for body in model.scene.resized}
    each = [(m, k, name) for m in few for k, name in enumerate(m.bodies.names)]
    return {name: (march, body) for march, body, name in each if name in meshed}


def _spread(part: SolidPart, count: int) -> Floats:
    """So many nodes that lie evenly in the box around a solid (collective)."""
    from scipy.spatial import cKDTree  # noqa: PLC0415  (slow to load)

    system, dim = part.system, part.solid.dim
    gathered = system.comm.gather((system.numbers, system.positions))

    def choose() -> Floats:
        numbers, places = (np.concatenate(each) for each in zip(*gathered, strict=True))
        places = places[np.argsort(numbers)]
        low, high = places.min(axis=0), places.max(axis=0)
        # An additive recurrence fills a box evenly (Roberts, 2018).
        ratio = {1: 1.618033988749895, 2: 1.324717957244746, 3: 1.2207440846057596}[dim]
        steps = ratio ** -np.arange(1.0, dim + 1.0)
        even = low + (0.5 + np.outer(np.arange(8 * count), steps)) % 1.0 * (high - low)
        near = cKDTree(places).query(even)[1]
        first = np.sort(np.unique(near, return_index=True)[1])[:count]
        return np.asarray(places[near[first]])

    found: Floats = on_root(system.comm, choose)
    return found


@dataclass(frozen=True)
class Kept:
    """What an observer of probes keeps of some places.

    Attributes:
        places: They.
        rows: Nodes of all solids and their shares in each, by the name of its columns:
            (places, nodes).
        lines: Bodies without meshes among them.
    """

    places: Places
    rows: Mapping[str, tuple[Integers, Floats]]
    lines: tuple["LinePlaces", ...]

    @classmethod
    def of(cls, places: Places, model: SolidsModel, few: Sequence[Marched]) -> "Kept":
        """Find the places in the bodies (collective)."""
        from impactfem.system.located import followed  # noqa: PLC0415  (loads DOLFINx)

        solids = {part.solid.name: k for k, part in enumerate(model.parts)}
        lined, rows, lines = _lined(model, few), {}, []
        for name, points in places.items():
            body = name.partition("/")[0]
            if body in solids:
                numbers, shares = followed(model.parts[solids[body]].system, points)
                rows[_MARK + name] = numbers + model.starts[solids[body]], shares
            else:
                march, at = lined[body]
                weights = np.zeros((len(points), len(march.shown.material(at))))
                for row, point in zip(weights, points, strict=True):
                    nodes, shares, _ = march.shown.located(at, point)
                    row[nodes] = shares
                parts = {"displacement": [str(k) for k in range(points.size)]}
                lines.append(LinePlaces(_MARK + name, march, at, slice(None), weights, parts))
        return cls(places, rows, tuple(lines))

    def taken(self, told: dict[str, dict[str, Floats]]) -> dict[str, Floats]:
        """Take the displacements [m], (rows, places, dim), out of the columns of all probes."""
        each = {name: told.pop(_MARK + name) for name in self.places}
        return {
            name: np.stack([*columns.values()], axis=1).reshape(
                -1, len(self.places[name]), self.places[name].shape[1]
            )
            for name, columns in each.items()
        }


@dataclass(frozen=True)
class LinePlaces:
    """Places of a body without a mesh, between its nodes, as an observer of probes asks for them.

    Attributes:
        name: Of its columns, their first part.
        march: Of the body.
        body: Its place there.
        nodes: Of the body beside the places.
        weights: Of these, (places, nodes).
        parts: Last parts of the columns of each quantity: of each component place after place.
    """

    name: str
    march: Marched
    body: int
    nodes: Integers | slice
    weights: Floats
    parts: Mapping[str, Sequence[str]]

    def told(self) -> dict[str, dict[str, float]]:
        """Figures of the places now, by first and last part of their columns."""
        known = self.march.shown.motion(self.body)
        if "stress" in self.parts:
            known = known | {"stress": self.march.shown.stress(self.body)[:, None]}
        found: dict[str, float] = {}
        for quantity, parts in self.parts.items():
            values = self.weights @ known[quantity][self.nodes]
            found |= zip(parts, values.ravel().tolist(), strict=True)
        return {self.name: found}
