"""Probes of solids: motion and stress of places, layer by layer."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats, Integers
from impactfem.marching.marched import Marched
from impactfem.marching.rows import Level
from impactfem.marching.time_loop import TimeLoop
from impactfem.models.solids import SolidsModel
from impactfem.runs.accelerations import check_sampling
from impactfem.runs.line_probes import LETTERS
from impactfem.runs.samples import Kept, LinePlaces
from impactfem.scene.probes import outside
from impactfem.system.located import Located
from impactfem.system.point_memory import REMEMBERED, Recalled
from impactfem.system.true_stress import TrueStress

_BLOCKS = {"velocity": 1, "stress": 2}
"""Which of what levels tell the nodes of a quantity have, beside displacements."""

Told = Callable[[], Mapping[str, Mapping[str, float]]]
"""Tells figures of a level by first and last part of their columns."""


def _on_lines(model: SolidsModel, few: Sequence[Marched]) -> list[Told]:
    """Probes of bodies without meshes: between two of their nodes, linearly.

    Raises:
        SceneError: One is outside its body.
    """
    axes, found = "xyz"[: model.dim], list[Told]()
    known = {name: [f"{letter}{axis}" for axis in axes] for name, letter in LETTERS.items()}
    known["stress"] = ["sxx"]
    for index, probe in enumerate(model.scene.probes):
        for march in few:
            if probe.body not in march.bodies.names:
                continue
            body = march.bodies.names.index(probe.body)
            nodes, shares, inside = march.shown.located(body, np.array(probe.point, dtype=float))
            if not inside:
                raise outside(index, probe, shares @ march.shown.material(body)[nodes])
            parts = {name: known[name] for name in probe.watched}
            places = LinePlaces(probe.name, march, body, nodes, shares[None], parts)
            found.append(places.told)
    return found


@dataclass(frozen=True)
class SolidProbes:
    """Observer that keeps what the nodes of this rank add to the columns of all probes.

    Attributes:
        march: Its rows take the columns.
        names: Probe and last part of each column.
        weights: Of the displacements, the velocities and the displacements that strain which are
            `needed`, one after the other, (columns, needed).
        needed: Which of the owned dofs of all bodies, one body after the other, of each of these.
        residual: Residual stresses [Pa], by probe and the last part of their columns.
        laws: Of stresses that are not linear, by probe: the columns are what these need.
        recalling: What tells the columns that follow, the part of this rank.
        telling: What tells those after them, the same on all ranks.
        counts: Whether this rank does.
        kept: Places that are kept besides, for runs on other elements.
    """

    march: TimeLoop[Any]
    names: tuple[tuple[str, str], ...]
    weights: csr_matrix
    needed: tuple[Integers, Integers, Integers]
    residual: Mapping[str, Mapping[str, float]]
    laws: Mapping[str, TrueStress]
    recalling: tuple[Recalled, ...]
    telling: tuple[Told, ...]
    counts: bool
    kept: Kept | None = None

    @classmethod
    def of(
        cls,
        march: TimeLoop[Any],
        model: SolidsModel,
        few: Sequence[Marched] = (),
        joined: Sequence[Told] = (),
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
            SceneError: A probe is outside its body, or its filter asks for shorter steps.
        """
        own, dim = model.own_numbers, model.dim
        check_sampling(model.scene.probes, march.interior.dt)
        telling = [*_on_lines(model, few), *(march.told for march in few), *joined]
        telling += [] if kept is None else [line.told for line in kept.lines]
        asked = [
            (probe.name, located.numbers + model.starts[body], _BLOCKS.get(quantity, 0),
             _weights(quantity, located, dim))
            for probe, body, located in model.probes
            for quantity in probe.watched
        ]  # fmt: skip
        if kept is not None:
            asked += [
                (name, numbers, 0, {f"{k}{at}": w for at, w in _along(shares, dim).items()})
                for name, each in kept.rows.items()
                for k, (numbers, shares) in enumerate(zip(*each, strict=True))
            ]
        place = {int(number): k for k, number in enumerate(own)} if asked else {}
        names: list[tuple[str, str]] = []
        told, rows, columns = [np.zeros(0)], [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)]
        for name, numbers, block, parts in asked:
            mine = [k for k, number in enumerate(numbers.tolist()) if number in place]
            dofs = dim * np.array([place[int(numbers[k])] for k in mine], dtype=int)[:, None]
            own_columns = (block * dim * len(own) + dofs + np.arange(dim)).ravel()
            for part, weights in parts.items():
                rows.append(np.full(len(own_columns), len(names)))
                columns.append(own_columns)
                told.append(weights[mine].ravel())
                names.append((name, part))
        needed, compact = np.unique(np.concatenate(columns), return_inverse=True)
        entries = np.concatenate(told), (np.concatenate(rows), compact)
        weights = csr_matrix(entries, shape=(len(names), len(needed)))
        cuts = np.searchsorted(needed, dim * len(own) * np.arange(1, 3))
        displaced, moving, strained = np.split(needed, cuts)
        recalled: dict[str, Recalled] = {}
        for k, solid in enumerate(model.parts):
            each = {
                probe.name: located
                for probe, body, located in model.probes
                if body == k and "stress" in probe.quantities
            }
            if (memory := solid.system.memory) is not None:
                recalled |= zip(each, memory.follow(list(each.values())), strict=True)
        names += [(name, key) for name, tells in recalled.items() for key in tells()]
        names += [(name, part) for each in telling for name, own in each().items() for part in own]
        march.rows.probes = np.zeros((march.layers + 1, len(names)))
        laws = {
            probe.name: located.law
            for probe, _, located in model.probes
            if located.law is not None and "stress" in probe.quantities
        }
        residual = {
            probe.name: located.residual
            for probe, _, located in model.probes
            if "stress" in probe.quantities
        }
        which = displaced, moving - dim * len(own), strained - 2 * dim * len(own)
        counts = model.comm.rank == 0
        return cls(
            march, tuple(names), weights, which, residual, laws, tuple(recalled.values()),
            tuple(telling), counts, kept,
        )  # fmt: skip

    def __call__(self, level: Level) -> None:
        """Keep a level."""
        at, moving, strained = self.needed
        moved = [level.displacement[at] if len(at) else np.zeros(0)]
        moved += [level.velocity[moving]] if len(moving) else []
        moved += [level.straining[strained]] if len(strained) else []
        told = [value for each in self.telling for of in each().values() for value in of.values()]
        own = self.weights @ np.concatenate(moved) if self.weights.shape[0] else moved[0]
        recalled = [value for each in self.recalling for value in each().values()]
        kept = [own, recalled, self.counts * np.array(told)]
        self.march.rows.probes[level.layer] = np.concatenate(kept)

    def columns(self, values: Floats) -> dict[str, dict[str, Floats]]:
        """Columns of each probe by their last part, of the sums of all ranks (rows, columns)."""
        found: dict[str, dict[str, Floats]] = {}
        for k, (probe, part) in enumerate(self.names):
            own = found.setdefault(probe, {})
            # Terms that relax add theirs to the stress of the strain.
            own[part] = values[:, k] + own.get(part, self.residual.get(probe, {}).get(part, 0.0))
        for probe, law in self.laws.items():
            kept = found[probe]
            stress = law.of(kept)
            for name in (*law.weights, *REMEMBERED, "rise"):
                kept.pop(name, None)
            kept |= stress
        return found


def _weights(quantity: str, located: Located, dim: int) -> dict[str, Floats]:
    """Weights of the nodes in each column of a quantity, (nodes, dim), by its last part."""
    if quantity == "stress":
        return located.stress
    along = _along(located.values, dim).items()
    return {f"{LETTERS[quantity]}{axis}": weights for axis, weights in along}


def _along(shares: Floats, dim: int) -> dict[str, Floats]:
    """Weights of the nodes in each component of a vector, (nodes, dim), by its axis."""
    return {"xyz"[k]: np.outer(shares, np.eye(dim)[k]) for k in range(dim)}
