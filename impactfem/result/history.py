"""Histories: one row per time layer, with units, as an xarray data set."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from impactfem.result.table import Series, Table

Floats = NDArray[np.float64]

COLUMNS: Mapping[str, tuple[str, str]] = {
    "gap": ("m", "smallest distance between body and obstacle"),
    "contact_force": ("N", "normal force on the body during (t_{m-1}, t_m]"),
    "kinetic_energy": ("J", "kinetic energy of layer m"),
    "elastic_energy": ("J", "elastic energy of layer m"),
    "potential_energy": ("J", "initial potential of gravity minus the work it has done"),
    "total_energy": ("J", "sum of the energies"),
    "momentum": ("kg m/s", "linear momentum away from the obstacle"),
    "active": ("1", "number of active contact pairs"),
}
"""Columns of every history: unit and meaning.

A column's attribute ``long_name`` is short, for the labels of plots; ``comment`` is the meaning.
"""


@dataclass(frozen=True)
class BodyMotion:
    """Motion of a body's centre of mass.

    Attributes:
        position: [m], shape (rows, 3).
        velocity: [m/s], shape (rows, 3).
    """

    position: Floats
    velocity: Floats

    @classmethod
    def along_axis(cls, position: Floats, velocity: Floats) -> "BodyMotion":
        """Motion along the first axis only; both of shape (rows,)."""
        zero = np.zeros_like(position)
        return cls(
            np.stack([position, zero, zero], axis=1), np.stack([velocity, zero, zero], axis=1)
        )


@dataclass(frozen=True)
class Columns:
    """Raw columns of a history, each of shape (rows,); see `COLUMNS` for units."""

    time: Floats
    gap: Floats
    contact_force: Floats
    kinetic_energy: Floats
    elastic_energy: Floats
    potential_energy: Floats
    momentum: Floats
    active: NDArray[np.int64]
    bodies: Mapping[str, BodyMotion] = field(default_factory=dict)


def make_history(columns: Columns) -> Table:
    """Make the table of a history: coordinate ``time``, columns as in `COLUMNS`.

    For each body NAME follow NAME.x, NAME.y, NAME.z [m] and NAME.vx, NAME.vy, NAME.vz [m/s].
    """
    values: dict[str, NDArray[np.float64] | NDArray[np.int32]] = {
        name: np.asarray(getattr(columns, name), dtype=np.float64)
        for name in COLUMNS
        if name not in {"total_energy", "active"}
    }
    values["total_energy"] = np.asarray(
        columns.kinetic_energy + columns.elastic_energy + columns.potential_energy
    )
    values["active"] = columns.active.astype(np.int32)  # netCDF 3 has no longer integers
    attributes = {
        name: {"units": unit, "long_name": name.replace("_", " "), "comment": text}
        for name, (unit, text) in COLUMNS.items()
    }
    attributes["active"]["long_name"] = "active contact pairs"
    for body, motion in columns.bodies.items():
        for prefix, unit, data in (("", "m", motion.position), ("v", "m/s", motion.velocity)):
            for axis, letter in enumerate("xyz"):
                name = f"{body}.{prefix}{letter}"
                values[name] = data[:, axis]
                what = "velocity" if prefix else "position"
                attributes[name] = {
                    "units": unit,
                    "long_name": f"{what} of {body} along {letter}",
                    "comment": f"{what} of the centre of mass",
                }
    ordered = [*COLUMNS, *(name for name in values if name not in COLUMNS)]
    return Table.over_time(
        columns.time,
        {name: Series(("time",), values[name], attributes[name]) for name in ordered},
    )


def write_csv(history: Table, path: Path) -> None:
    """Write all columns with 17 digits, so that reading gives the same numbers."""
    names = list(history.data_vars)
    table = np.column_stack([history["time"].values, *(history[name].values for name in names)])
    formats = ["%d" if name == "active" else "%.17g" for name in ("time", *names)]
    np.savetxt(path, table, delimiter=",", header=",".join(("time", *names)), comments="",
               fmt=formats)  # fmt: skip
