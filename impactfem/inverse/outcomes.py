"""What a run offers to measures, whatever solved it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from impactfem.arrays import Floats
from impactfem.result.table import Series, Table


@dataclass(frozen=True)
class Outcome:
    """A run as measures see it.

    Attributes:
        history: Its history.
        impulse: Of each pair, of its normal force from 0 up to each row [N s], (rows,).
        duration: Of each pair, how long it lasted in all [s].
        rebound: Speed of each body's centre of mass just after its last contact [m/s]; NaN if
            there was none, or it lasts where the run ends.
        masses: Of the bodies [kg].
        peak: Largest force of each pair, where impacts take time [N].
        touched: When each pair first touches [s]; NaN if it does not.
        rise: Mean rate of each pair's force up to half of the largest [N/s]; none where it jumps.
        driven: Work of what drives ends, which potential energies count [J], (rows,) or 0.
        means: Of a run by steps its forces as rows have them, by column, (rows,).
    """

    history: Table
    impulse: Mapping[str, Floats]
    duration: Mapping[str, float]
    rebound: Mapping[str, float]
    masses: Mapping[str, float]
    driven: Floats | float = 0.0
    peak: Mapping[str, float] = field(default_factory=dict)
    touched: Mapping[str, float] = field(default_factory=dict)
    rise: Mapping[str, float] = field(default_factory=dict)
    means: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def times(self) -> Floats:
        """Of the rows [s]."""
        return np.asarray(self.history["time"].values)

    @property
    def names(self) -> list[str]:
        """What a measure may be of."""
        columns = [name for name, column in self.history.items() if column.values.ndim == 1]
        return [
            *columns,
            *(f"impulse.{name}" for name in self.impulse),
            *(f"duration.{name}" for name in self.duration),
            *(f"force_rise.{name}" for name in self.rise),
            *(f"rebound_speed.{name}" for name in self.rebound),
        ]


_MEANS = ("contact_force", "force", "tangential_force", "moment")


def is_mean(name: str) -> bool:
    """Whether rows of a column of a run by steps hold its mean over the step before them."""
    kind, _, of = name.partition(".")
    return kind in _MEANS or of.endswith(".force")


def amid(name: str, time: float, dt: float, end: float) -> float:
    """Time at which rows of a column have what acts at a time [s]: means act amid their step.

    Args:
        name: Of the column.
        time: [s].
        dt: Length of a step [s].
        end: Of the run [s].
    """
    return min(max(time + 0.5 * dt, dt), end) if is_mean(name) else time


def means_at(history: Table, times: Floats) -> dict[str, Floats]:
    """Means over steps at some times [s], linear between the rows that have them."""
    levels = np.asarray(history["time"].values)
    return {
        name: np.asarray(np.interp(times, levels, np.asarray(column.values, float)))
        for name, column in history.items()
        if is_mean(name) and column.values.ndim == 1
    }


def at_times(history: Table, times: Floats) -> Table:
    """Columns of a history by steps at some times [s].

    Linear between its rows, means over steps between the middles of these, and constant beyond.
    """
    levels = np.asarray(history["time"].values)
    middles = 0.5 * (levels[1:] + levels[:-1])

    def told(name: str, values: Floats) -> Floats:
        if is_mean(name):
            return np.asarray(np.interp(times, middles, values[1:]))
        return np.asarray(np.interp(times, levels, values))

    return Table.over_time(
        times,
        {
            name: Series(column.dims, told(name, np.asarray(column.values, float)), column.attrs)
            for name, column in history.items()
            if name != "time" and column.values.ndim == 1
        },
    )
