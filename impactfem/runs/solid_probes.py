"""Probes of solids: motion and stress of places, layer by layer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from impactfem.marching.few import FewInterior
from impactfem.marching.rows import Level
from impactfem.marching.time_loop import TimeLoop
from impactfem.models.solids import SolidsModel
from impactfem.runs.samples import Kept
from impactfem.scene.probes import Probe, outside
from impactfem.system.located import Located
from impactfem.system.true_stress import TrueStress

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Telling(Protocol):
    """What tells figures of a level besides those of bodies."""

    @property
    def counts(self) -> bool:
        """Whether this rank does."""

    def told(self) -> dict[str, dict[str, float]]:
        """Figures by first and last part of their columns."""


@dataclass(frozen=True)
class AxisProbe:
    """A probe of a body without a mesh: between two of its nodes, linearly.

    Attributes:
        probe: As the scene has it.
        march: Of its body.
        body: Its place there.
        nodes: Of the body beside it, (nodes,).
        shares: Their weights, (nodes,).
    """

    probe: Probe
    march: FewInterior
    body: int
    nodes: Integers
    shares: Floats

    @property
    def columns(self) -> list[str]:
        """Last parts of its columns."""
        axes = "xyz"[: self.march.bodies.dim]
        known = {"displacement": [f"u{axis}" for axis in axes],
                 "velocity": [f"v{axis}" for axis in axes], "stress": ["sxx"]}  # fmt: skip
        return [column for name in self.probe.quantities for column in known[name]]

    def values(self) -> Floats:
        """Of its columns now; 0 on ranks that do not sum the body up."""
        known = self.march.motion(self.body)
        if "stress" in self.probe.quantities:
            known = known | {"stress": self.march.stress(self.body)[:, None]}
        each = [self.shares @ known[name][self.nodes] for name in self.probe.quantities]
        return np.concatenate(each) * self.march.counts


def _axes(model: SolidsModel, few: Sequence[FewInterior]) -> tuple[AxisProbe, ...]:
    found = []
    for index, probe in enumerate(model.scene.probes):
        for march in few:
            if probe.body not in march.bodies.names:
                continue
            body = march.bodies.names.index(probe.body)
            nodes, shares, inside = march.located(body, np.array(probe.point, dtype=float))
            if not inside:
                raise outside(index, probe, shares @ march.material(body)[nodes])
            found.append(AxisProbe(probe, march, body, nodes, shares))
    return tuple(found)


@dataclass(frozen=True)
class SolidProbes:
    """Observer that keeps what the nodes of this rank add to the columns of all probes.

    Attributes:
        march: Its rows take the columns.
        names: Probe and last part of each column.
        weights: Of the displacements and then the velocities that are `needed`, (columns, needed).
        needed: Which of the owned dofs of all bodies, one body after the other: of displacements,
            and of velocities.
        laws: Of stresses that are not linear, by probe: the columns are what these need.
        axes: Probes of bodies without meshes, whose columns follow.
        telling: Bodies without meshes, and what joins them.
        kept: Places that are kept besides, for runs on other elements.
    """

    march: TimeLoop[Any]
    names: tuple[tuple[str, str], ...]
    weights: csr_matrix
    needed: tuple[Integers, Integers]
    laws: Mapping[str, TrueStress]
    axes: tuple[AxisProbe, ...] = ()
    telling: tuple[Telling, ...] = ()
    kept: Kept | None = None

    @classmethod
    def of(
        cls,
        march: TimeLoop[Any],
        model: SolidsModel,
        few: Sequence[FewInterior] = (),
        joined: Sequence[Telling] = (),
        kept: Kept | None = None,
    ) -> "SolidProbes":
        """Prepare; the rows of the march get room for the columns.

        Args:
            march: The march.
            model: The bodies.
            few: What marches those without meshes.
            joined: What else tells figures, as joints do.
            kept: Places that are kept besides.

        Raises:
            SceneError: A probe is outside its body.
        """
        own, dim = model.own_numbers, model.dim
        axes = _axes(model, few)
        asked = [
            (probe.name, located.numbers + model.starts[body], quantity == "velocity",
             _weights(quantity, located, dim))
            for probe, body, located in model.probes
            for quantity in probe.quantities
        ]  # fmt: skip
        if kept is not None:
            asked += [
                (name, numbers, False, {f"{k}{at}": w for at, w in _along(shares, dim).items()})
                for name, each in kept.rows.items()
                for k, (numbers, shares) in enumerate(zip(*each, strict=True))
            ]
        place = {int(number): k for k, number in enumerate(own)} if asked else {}
        names: list[tuple[str, str]] = []
        told, rows, columns = [np.zeros(0)], [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)]
        for name, numbers, of_velocity, parts in asked:
            mine = [k for k, number in enumerate(numbers.tolist()) if number in place]
            dofs = dim * np.array([place[int(numbers[k])] for k in mine], dtype=int)[:, None]
            own_columns = (of_velocity * dim * len(own) + dofs + np.arange(dim)).ravel()
            for part, weights in parts.items():
                rows.append(np.full(len(own_columns), len(names)))
                columns.append(own_columns)
                told.append(weights[mine].ravel())
                names.append((name, part))
        needed, compact = np.unique(np.concatenate(columns), return_inverse=True)
        entries = np.concatenate(told), (np.concatenate(rows), compact)
        weights = csr_matrix(entries, shape=(len(names), len(needed)))
        moving = needed >= dim * len(own)
        telling = (*few, *joined, *(() if kept is None else kept.lines))
        names += [(axis.probe.name, column) for axis in axes for column in axis.columns]
        names += [
            (name, part) for each in telling for name, told in each.told().items() for part in told
        ]
        march.rows.probes = np.zeros((march.layers + 1, len(names)))
        laws = {
            probe.name: located.law
            for probe, _, located in model.probes
            if located.law is not None and "stress" in probe.quantities
        }
        which = needed[~moving], needed[moving] - dim * len(own)
        return cls(march, tuple(names), weights, which, laws, axes, telling, kept)

    def __call__(self, level: Level) -> None:
        """Keep a level."""
        at, moving = self.needed
        moved = [level.displacement[at] if len(at) else np.zeros(0)]
        moved += [level.velocity[moving]] if len(moving) else []
        values = [self.weights @ np.concatenate(moved), *(axis.values() for axis in self.axes)]
        for each in self.telling:
            values += [each.counts * np.array([*of.values()]) for of in each.told().values()]
        self.march.rows.probes[level.layer] = np.concatenate(values)

    def columns(self, values: Floats) -> dict[str, dict[str, Floats]]:
        """Columns of each probe by their last part, of the sums of all ranks (rows, columns)."""
        found: dict[str, dict[str, Floats]] = {}
        for k, (probe, part) in enumerate(self.names):
            found.setdefault(probe, {})[part] = values[:, k]
        for probe, law in self.laws.items():
            kept = found[probe]
            stress = law.of(kept)
            for name in law.weights:
                del kept[name]
            kept |= stress
        return found


def _weights(quantity: str, located: Located, dim: int) -> dict[str, Floats]:
    """Weights of the nodes in each column of a quantity, (nodes, dim), by its last part."""
    if quantity == "stress":
        return located.stress
    letter = {"displacement": "u", "velocity": "v"}[quantity]
    return {f"{letter}{axis}": weights for axis, weights in _along(located.values, dim).items()}


def _along(shares: Floats, dim: int) -> dict[str, Floats]:
    """Weights of the nodes in each component of a vector, (nodes, dim), by its axis."""
    return {"xyz"[k]: np.outer(shares, np.eye(dim)[k]) for k in range(dim)}
