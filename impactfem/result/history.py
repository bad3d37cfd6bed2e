"""Histories: one row per time layer, with units, as an xarray data set."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.result.table import Series, Table

COLUMNS: Mapping[str, tuple[str, str]] = {
    "gap": ("m", "smallest distance of what may meet"),
    "contact_force": ("N", "sum of the normal forces of all pairs during (t_{m-1}, t_m]"),
    "kinetic_energy": ("J", "kinetic energy of time step m"),
    "elastic_energy": ("J", "elastic energy of time step m"),
    "potential_energy": ("J", "initial potential of gravity minus the work it has done"),
    "total_energy": ("J", "sum of the energies"),
    "dissipated_energy": (
        "J",
        (
            "total energy of row 0 minus that of this row and nothing else: what impacts, "
            "friction, damping and the method have taken, less the work of prescribed motions that "
            "the potential energy leaves out"
        ),
    ),
    "friction_work": (
        "J", "work of friction on what slides since t = 0, <= 0: the heat with the opposite sign",
    ),
    "momentum": ("kg m/s", "linear momentum along the attribute direction"),
    "momentum.x": ("kg m/s", "linear momentum of all bodies; likewise momentum.y, momentum.z"),
    "momentum.y": ("kg m/s", "linear momentum of all bodies"),
    "momentum.z": ("kg m/s", "linear momentum of all bodies"),
    "active": ("1", "number of active contact pairs"),
}  # fmt: skip
"""Columns of every history: unit and meaning.

A column's attribute ``long_name`` is short, for the labels of plots; ``comment`` is the meaning.
"""

ANGULAR: tuple[str, str] = (
    "kg m^2/s",
    (
        "angular momentum of all bodies about the origin, in space .x .y .z: that of the centres "
        "of mass and that about them, of deformable bodies with the arms of the undeformed body"
    ),
)
"""Unit and meaning of ``angular_momentum``."""

BODY_COLUMNS: Mapping[str, tuple[str, str]] = {
    "x": ("m", "centre of mass; likewise y, z"),
    "vx": ("m/s", "its velocity; likewise vy, vz"),
    "angle": (
        "rad",
        (
            "in the plane, of bodies that turn freely: angle counted over turns, of rods and beams "
            "that of the axis, of solids that since the undeformed body, linearised as their model"
        ),
    ),
    "spin": ("rad/s", "its rate"),
    "qw": ("1", "the same in space: unit quaternion of the rotation; likewise qx, qy, qz"),
    "wx": ("rad/s", "angular velocity along fixed axes; likewise wy, wz"),
}
"""Columns ``NAME.x`` of each body: unit and meaning."""

PAIR_COLUMNS: Mapping[str, tuple[str, str]] = {
    "force": ("N", "sum of the normal forces of the pair during (t_{m-1}, t_m], without impacts"),
    "gap": ("m", "smallest gap of the pair; NaN while it is too far to be looked at"),
    "tangential_force": (
        "N",
        (
            "where there is friction: sum of its forces on the first body of the pair; in the "
            "plane along the normal turned by -90 degrees (of a floor: to the right), in space "
            "its amount, and .x .y .z"
        ),
    ),
    "slip": (
        "m",
        (
            "where there is friction: distance slid under force since t = 0, the mean over the "
            "pair's gaps by force; in the plane with sign, in space its length"
        ),
    ),
    "center": (
        "m",
        (
            "where bodies are time-stepped, .x .y .z: place of the pair's normal forces, their "
            "mean by amount, impacts included; without a force it goes along with the centre of "
            "the first body, as it lay at the last contact, before the first one as the pair was "
            "nearest at t = 0"
        ),
    ),
    "moment": (
        "N m",
        (
            "where bodies are time-stepped: moment of the pair's forces on its first body about "
            "the centre of mass of that, without impacts, in space .x .y .z, 0 of what cannot turn"
        ),
    ),
    "impulse": ("N s", "of points, rods and beams: impulses of impacts during (t_{m-1}, t_m]"),
}
"""Columns ``force.PAIR`` of each pair that may meet: unit and meaning."""

PROBE_COLUMNS: Mapping[str, tuple[str, str]] = {
    "ux": ("m", "displacement of the place since the undeformed body; likewise uy, uz"),
    "vx": ("m/s", "its velocity; likewise vy, vz"),
    "ax": (
        "m/s^2",
        (
            "its acceleration, the change of velocity over (t_{m-1}, t_m] by its duration, what "
            "impacts change included (row 0: that of row 1); with filter as it passes; likewise "
            "ay, az"
        ),
    ),
    "sxx": ("Pa", "elastic stress there, tension > 0; likewise syy, szz, sxy, syz, sxz"),
}
"""Columns ``NAME.ux`` of each probe: unit and meaning."""

LOST = "lost"
"""Last part of the columns of what joints have taken."""

JOINT_COLUMNS: Mapping[str, tuple[str, str]] = {
    "q": ("rad or m", "position of the joint, counted over turns"),
    "v": ("rad/s or m/s", "its rate"),
    "x": (
        "m",
        (
            "of a free base of a mechanism: origin of its frame; likewise y, z, with vx, vy, vz, "
            "rotation qw, qx, qy, qz, angular velocity wx, wy, wz"
        ),
    ),
    "force": (
        "N",
        (
            "amount of the force on the second body during (t_{m-1}, t_m]; of a gear that along "
            "the coordinate of its second joint"
        ),
    ),
    "moment": (
        "N m",
        (
            "moment on the second body about the joint, spring and motor included; in the plane "
            "with its sign, in space its amount"
        ),
    ),
    LOST: ("J", "energy that its damper, friction and limits have taken since t = 0"),
}
"""Columns ``JOINT.q`` of joints, of those of mechanisms ``BODY.JOINT.q``: unit and meaning."""

TIE_COLUMN = (
    "N", "amount of the resultant of a tie on its second side during (t_{m-1}, t_m]"
)  # fmt: skip
"""Columns ``force.TIE`` of ties: unit and meaning."""

CONTROLLER_COLUMN = "u"
"""Last part of the columns of what controllers give."""

CONTROLLER: tuple[str, str] = (
    "N or N m",
    "force or moment by the controller, held during (t_{m-1}, t_m] where it is sampled",
)
"""Unit and meaning of ``CONTROLLER.u``."""

MOST_PAIRS = 100
"""Number of pairs up to which each has columns of its own."""


@dataclass(frozen=True)
class BodyMotion:
    """Motion of a body.

    Attributes:
        position: Of the centre of mass [m], shape (rows, 3).
        velocity: [m/s], shape (rows, 3).
        turn: Angle [rad], shape (rows, 1), or in space unit quaternion, shape (rows, 4); None if
            it does not turn, or it is not known.
        spin: Angular velocity [rad/s], shape (rows, 1) or (rows, 3); likewise.
    """

    position: Floats
    velocity: Floats
    turn: Floats | None = None
    spin: Floats | None = None

    @classmethod
    def along_axis(cls, position: Floats, velocity: Floats) -> "BodyMotion":
        """Motion along the first axis only; both of shape (rows,)."""
        zero = np.zeros_like(position)
        return cls(
            np.stack([position, zero, zero], axis=1), np.stack([velocity, zero, zero], axis=1)
        )


@dataclass(frozen=True)
class PairMotion:
    """What a pair does; see `PAIR_COLUMNS`.

    Attributes:
        force, gap: [N], [m], shape (rows,).
        tangential: [N], shape (rows, 1), in space (rows, 3); None without friction.
        slip: [m], shape (rows,); None without friction.
        impulse: [N s], shape (rows,); None where impacts are none of their own.
        center: [m], shape (rows, dim); None if it is not known.
        moment: [N m], shape (rows, 1), in space (rows, 3); None if it is not known.
    """

    force: Floats
    gap: Floats
    tangential: Floats | None = None
    slip: Floats | None = None
    impulse: Floats | None = None
    center: Floats | None = None
    moment: Floats | None = None


@dataclass(frozen=True)
class Columns:
    """Raw columns of a history, each of shape (rows,); see `COLUMNS` for units.

    Attributes:
        momentum: Shape (rows, 3).
        direction: Unit vector of the column ``momentum``, shape (3,).
        angular_momentum: About the origin, shape (rows, 1), in space (rows, 3); None: nothing can
            turn.
        friction_work: None without friction.
        bodies, pairs: By name.
        probes: By name, each with its columns by their last part, shape (rows,).
    """

    time: Floats
    gap: Floats
    contact_force: Floats
    kinetic_energy: Floats
    elastic_energy: Floats
    potential_energy: Floats
    momentum: Floats
    active: NDArray[np.int64]
    direction: Floats = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    angular_momentum: Floats | None = None
    friction_work: Floats | None = None
    bodies: Mapping[str, BodyMotion] = field(default_factory=dict)
    pairs: Mapping[str, PairMotion] = field(default_factory=dict)
    probes: Mapping[str, Mapping[str, Floats]] = field(default_factory=dict)


def make_history(columns: Columns) -> Table:
    """Make the table of a history: coordinate ``time``, columns as the tables above say."""
    none = np.zeros(len(columns.time))
    total = columns.kinetic_energy + columns.elastic_energy + columns.potential_energy
    rubbed = none if columns.friction_work is None else columns.friction_work
    values: dict[str, NDArray[np.float64] | NDArray[np.int32]] = {
        "gap": columns.gap,
        "contact_force": columns.contact_force,
        "kinetic_energy": columns.kinetic_energy,
        "elastic_energy": columns.elastic_energy,
        "potential_energy": columns.potential_energy,
        "total_energy": total,
        "dissipated_energy": total[:1] - total,
        "friction_work": rubbed,
        "momentum": columns.momentum @ columns.direction,
        **_by_axis("momentum.", columns.momentum),
        "active": columns.active.astype(np.int32),  # netCDF 3 has no longer integers
    }
    series = {name: _series(name, values[name], *COLUMNS[name]) for name in COLUMNS}
    along = ", ".join(f"{component:.6g}" for component in columns.direction)
    series["momentum"].attrs["direction"] = columns.direction
    series["momentum"].attrs["long_name"] = f"linear momentum along ({along})"
    series["active"].attrs["long_name"] = "active contact pairs"
    angular = none[:, None] if columns.angular_momentum is None else columns.angular_momentum
    for name, column in _named("angular_momentum", angular).items():
        series[name] = _series(name, column, *ANGULAR)
    for body, motion in columns.bodies.items():
        series |= _of_body(body, motion)
    if len(columns.pairs) <= MOST_PAIRS:
        for pair, met in columns.pairs.items():
            series |= _of_pair(pair, met)
    for probe, found in columns.probes.items():
        for part, told in found.items():
            name = f"{probe}.{part}"
            kind = f"{part[0]}{'xx' if part[0] == 's' else 'x'}"
            unit, text = (
                (TIE_COLUMN if probe == "force" else None)
                or (CONTROLLER if part == CONTROLLER_COLUMN else JOINT_COLUMNS.get(part))
                or PROBE_COLUMNS.get(kind)
                or (JOINT_COLUMNS["x"] if part in "xyz" else None)
                or BODY_COLUMNS["qw" if part[0] == "q" else "wx"]  # of a base that turns freely
            )
            series[name] = _series(name, told, unit, text, f"{part} at {probe}")
    return Table.over_time(columns.time, series)


def column_of(controller: str, values: Floats) -> Series:
    """The column of a controller's output [N or N m], (rows,)."""
    return _series(f"{controller}.{CONTROLLER_COLUMN}", values, *CONTROLLER, f"u of {controller}")


def _series(
    name: str, values: NDArray[Any], unit: str, text: str, what: str = "", **more: str
) -> Series:
    what = what or name.replace("_", " ")
    attributes = {"units": unit, "long_name": what, "comment": text, **more}
    return Series(("time",), np.asarray(values), attributes)


def _by_axis(name: str, vectors: Floats) -> dict[str, Floats]:
    """Components under the name followed by x, y, z."""
    return {f"{name}{'xyz'[k]}": column for k, column in enumerate(vectors.T)}


def _named(name: str, vectors: Floats) -> dict[str, Floats]:
    """A scalar (rows, 1) under its name, a vector (rows, 3) under those of its components."""
    return {name: vectors[:, 0]} if vectors.shape[1] == 1 else _by_axis(f"{name}.", vectors)


def _of_body(body: str, motion: BodyMotion) -> dict[str, Series]:
    found = {}
    for prefix, what, data in (
        ("", "position", motion.position),
        ("v", "velocity", motion.velocity),
    ):
        unit = BODY_COLUMNS[f"{prefix}x"][0]
        for letter, values in zip("xyz", data.T, strict=True):
            name = f"{body}.{prefix}{letter}"
            text = f"{what} of the centre of mass"
            found[name] = _series(name, values, unit, text, f"{what} of {body} along {letter}")
    for turned, plane, space in (
        (motion.turn, "angle", ("qw", "qx", "qy", "qz")),
        (motion.spin, "spin", ("wx", "wy", "wz")),
    ):
        if turned is None:
            continue
        names = (plane,) if turned.shape[1] == 1 else space
        unit, text = BODY_COLUMNS[names[0]]
        for own, values in zip(names, turned.T, strict=True):
            name = f"{body}.{own}"
            found[name] = _series(name, values, unit, text, f"{own} of {body}")
    return found


def _of_pair(pair: str, met: PairMotion) -> dict[str, Series]:
    columns = {f"force.{pair}": met.force, f"gap.{pair}": met.gap}
    if met.tangential is not None:
        name = f"tangential_force.{pair}"
        if met.tangential.shape[1] > 1:
            columns[name] = np.linalg.norm(met.tangential, axis=1)
        columns |= _named(name, met.tangential)
    if met.center is not None:
        columns |= _by_axis(f"center.{pair}.", met.center)
    if met.moment is not None and met.moment.shape[1]:
        columns |= _named(f"moment.{pair}", met.moment)
    for name, values in (("slip", met.slip), ("impulse", met.impulse)):
        if values is not None:
            columns[f"{name}.{pair}"] = values
    return {
        name: _series(
            name, values + 0.0, *PAIR_COLUMNS[kind],
            f"{kind.replace('_', ' ')} of {pair}{axis and f' along {axis[1:]}'}", label=pair,
        )
        for name, values in columns.items()
        for kind in [name.partition(".")[0]]
        for axis in [name.removeprefix(f"{kind}.{pair}")]
    }  # fmt: skip


def write_csv(history: Table, path: Path) -> None:
    """Write all columns with 17 digits, so that reading gives the same numbers."""
    names = list(history.data_vars)
    table = np.column_stack([history["time"].values, *(history[name].values for name in names)])
    formats = ["%d" if name == "active" else "%.17g" for name in ("time", *names)]
    np.savetxt(path, table, delimiter=",", header=",".join(("time", *names)), comments="",
               fmt=formats)  # fmt: skip
