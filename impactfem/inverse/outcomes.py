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
            there was none.
        masses: Of the bodies [kg].
        peak: Largest force of each pair, where impacts take time [N].
        touched: When each pair first touches [s]; NaN if it does not.
        rise: Mean rate of each pair's force up to half of the largest [N/s]; none where it jumps.
        driven: Work of what drives ends, which potential energies count [J], (rows,) or 0.
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


def at_times(history: Table, times: Floats) -> Table:
    """Columns of a history at some times [s], linear between its rows."""
    levels = np.asarray(history["time"].values)
    return Table.over_time(
        times,
        {
            name: Series(
                column.dims,
                np.asarray(np.interp(times, levels, np.asarray(column.values, float))),
                column.attrs,
            )
            for name, column in history.items()
            if name != "time" and column.values.ndim == 1
        },
    )
