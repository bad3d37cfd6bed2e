"""How far apart two runs are in what probes tell: velocities, accelerations, stresses.

Displacements of probes are compared with those of all places, see `impactfem.runs.tracks`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats
from impactfem.reference.bar import trapezoidal
from impactfem.result.table import Table
from impactfem.scene.probes import Probe

_PARTS = {"velocity": "v", "acceleration": "a", "stress": "s"}
_ROUNDING = 1e-10  # share of the largest value below which nothing differs
_PLACES = 32.0 * float(np.finfo(float).eps)  # share of the extent by which places may be rounded
_STRAIN = 1e-11  # below which bodies are not strained


@dataclass(frozen=True)
class Told:
    """What a probe tells of one quantity.

    Attributes:
        values: Its components, (rows, components).
        twice: Which of them stand for two, as shear stresses do, (components,).
        quantity: Its name in scenes.
        filtered: Whether it has passed a filter.
        least: What is rounding in its unit: of bodies at rest or in flight all may be.
    """

    values: Floats
    twice: Floats
    quantity: str
    filtered: bool
    least: float = 0.0

    def at(self, times: Floats, rows: Floats) -> Floats:
        """At some of the times of its rows and others between them, (times, components).

        Accelerations that are means over steps become means over the steps between these times.
        """
        if self.quantity == "acceleration" and not self.filtered:
            gone = np.cumsum(self.values[1:] * np.diff(rows)[:, None], axis=0)
            gone = np.vstack([np.zeros(gone.shape[1]), gone])
            velocity = np.stack([np.interp(times, rows, column) for column in gone.T], axis=1)
            rates = np.diff(velocity, axis=0) / np.diff(times)[:, None]
            return np.vstack([rates[:1], rates])
        return np.stack([np.interp(times, rows, column) for column in self.values.T], axis=1)


def told(
    history: Table,
    probes: Sequence[Probe],
    extents: Mapping[str, float] | None = None,
    moduli: Mapping[str, float] | None = None,
) -> dict[str, Told]:
    """What probes tell in a run, by ``PROBE.QUANTITY``.

    Args:
        history: Of the run.
        probes: Of its scene.
        extents: What places of bodies are rounded to eps of [m], by their names.
        moduli: Of those of one material [Pa].
    """
    found, times = {}, history["time"].values
    step = float(np.median(np.diff(times))) if len(times) > 1 else math.inf
    for probe in probes:
        rounded = _PLACES * (extents or {}).get(probe.body, 0.0) / step
        stress = _STRAIN * (moduli or {}).get(probe.body, 0.0)
        least = {"velocity": rounded, "acceleration": rounded / step, "stress": stress}
        for quantity in probe.quantities:
            letter = _PARTS.get(quantity)
            own = [name for name in history.data_vars if _belongs(name, probe.name, letter)]
            if own:
                parts = [name.rpartition(".")[2] for name in own]
                twice = np.array([2.0 if len(set(part[1:])) == 2 else 1.0 for part in parts])
                values = np.stack([history[name].values for name in own], axis=1)
                found[f"{probe.name}.{quantity}"] = Told(
                    values, twice, quantity, probe.filter is not None, least[quantity]
                )
    return found


def _belongs(column: str, probe: str, letter: str | None) -> bool:
    """Whether a column has a component of what a letter stands for, in axes of the scene."""
    name, _, part = column.rpartition(".")
    return name == probe and part[:1] == letter and set(part[1:]) <= set("xyz") and len(part) > 1


def apart(
    one: Mapping[str, Told], other: Mapping[str, Told], rows: tuple[Floats, Floats], times: Floats
) -> dict[str, float]:
    """How far two runs are apart, by what both tell: root of the mean square in time.

    Components count as one vector or tensor, so that axes do not matter, and are seen against the
    same of the first run; of velocities against how far they leave their mean, so that it does not
    matter who watches.

    Args:
        one: What the first tells.
        other: What the second tells.
        rows: Their times [s].
        times: At which they are compared [s], (times,).
    """
    weights = trapezoidal(times)
    found = {}
    for name in one.keys() & other.keys():
        mine, others = one[name].at(times, rows[0]), other[name].at(times, rows[1])
        if mine.shape != others.shape:
            continue
        size = mine
        if one[name].quantity == "velocity":
            size = mine - weights @ mine / weights.sum()
        off, own = (
            math.sqrt(weights @ (each**2 @ one[name].twice) / weights.sum())
            for each in (mine - others, size)
        )
        least = _ROUNDING * float(np.abs(mine).max(initial=0.0))
        own = max(own, one[name].least)
        found[name] = 0.0 if off <= least else off / own if own > 0.0 else math.inf
    return dict(sorted(found.items()))
