"""A bar of a row at its start: velocity and strain constant on pieces, sampled from functions."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from impactfem.errors import SceneError
from impactfem.exact import initial
from impactfem.exact.row_waves import Array, Wave

PIECES = 840
"""Pieces on which functions of x are sampled; divisible by 2 to 8 and 10."""

_INSET = 1e-9  # "just inside a piece", as a share of its width
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class RowBar:
    """A bar of a row with velocity and strain constant on each piece of it.

    Attributes:
        length: L [m].
        wave_speed: c [m/s].
        impedance: Z = rho A c [kg/s].
        place: Place of its near end at t = 0 [m].
        nodes: (n+1,) borders of the pieces, from 0 to L [m].
        velocity: (n,) [m/s].
        strain: (n,) [1].
        sampled: Whether the data were sampled (then the solution is that accurate).

    Raises:
        SceneError: A value is out of range.
    """

    length: float
    wave_speed: float
    impedance: float
    place: float
    nodes: ArrayLike
    velocity: ArrayLike
    strain: ArrayLike
    sampled: bool = False

    def __post_init__(self) -> None:
        for name in ("length", "wave_speed", "impedance"):
            initial.positive(name, getattr(self, name))
        x = initial.finite("nodes", self.nodes)
        if x.ndim != 1 or len(x) < 2 or not (np.diff(x) > 0.0).all():
            raise SceneError(f"nodes: give at least two, increasing from 0 to {self.length}")
        if x[0] != 0.0 or x[-1] != self.length:
            raise SceneError(f"nodes run from {x[0]} to {x[-1]}: give 0 to {self.length}")
        for name in ("velocity", "strain"):
            initial.finite(name, getattr(self, name), (len(x) - 1,))

    @classmethod
    def moving(
        cls, *, length: float, wave_speed: float, impedance: float, place: float, velocity: float
    ) -> "RowBar":
        """Bar without strain that moves as a whole."""
        return cls(length, wave_speed, impedance, place, [0.0, length], [velocity], [0.0])

    @classmethod
    def from_functions(
        cls,
        *,
        length: float,
        wave_speed: float,
        impedance: float,
        place: float,
        displacement: Callable[[Array], ArrayLike],
        velocity: Callable[[Array], ArrayLike],
        pieces: int = PIECES,
    ) -> "RowBar":
        """Bar whose displacement (added to its place) and velocity are functions of x.

        Mean strain and velocity in the middle on equal pieces; neighbours that agree to
        rounding are one. Exact for constant velocity and strain with jumps on borders of pieces,
        else displacements are right to second order in the width of a piece, and velocities and
        strains to first order.
        """
        x = np.linspace(0.0, length, pieces + 1)
        u = initial.finite("displacement", np.zeros_like(x) + np.asarray(displacement(x)))
        inside = x[:-1, None] + np.diff(x)[:, None] * np.array([_INSET, 0.5, 1.0 - _INSET])
        speeds = initial.finite("velocity", np.zeros_like(inside) + np.asarray(velocity(inside)))
        v = speeds[:, 1]
        s = np.diff(u) / np.diff(x)
        rough = 64.0 * _EPS * float(np.abs(u).max()) * pieces / length
        fine = 64.0 * _EPS * float(np.abs(v).max())
        changes = (np.abs(np.diff(s)) > rough) | (np.abs(np.diff(v)) > fine)
        kept = np.r_[0, np.flatnonzero(changes) + 1, pieces]
        strain = np.diff(u[kept]) / np.diff(x[kept])
        return cls(
            length, wave_speed, impedance, place + float(u[0]), x[kept], v[kept[:-1]], strain,
            sampled=bool((np.diff(kept) == 1).any() or (np.ptp(speeds, axis=1) > fine).any()),
        )  # fmt: skip

    @property
    def transit_time(self) -> float:
        """L / c [s]."""
        return self.length / self.wave_speed

    @property
    def mass(self) -> float:
        """Z L / c [kg]."""
        return self.impedance * self.transit_time

    @property
    def far_place(self) -> float:
        """Place of the far end at t = 0 [m]."""
        stretch = np.asarray(self.strain) @ np.diff(np.asarray(self.nodes))
        return float(self.place + self.length + stretch)

    def waves(self) -> tuple[Wave, Wave]:
        """A that would have left the near end, and B that would have left the far end."""
        y = np.asarray(self.nodes, dtype=np.float64) / self.wave_speed
        v = np.asarray(self.velocity, dtype=np.float64)
        s = self.wave_speed * np.asarray(self.strain, dtype=np.float64)
        end = self.transit_time
        away, towards = np.r_[-end, -y[-2:0:-1]], np.r_[-end, y[1:-1] - end]
        return (
            Wave(end, away.tolist(), (v - s)[::-1].tolist()),
            Wave(end, towards.tolist(), (v + s).tolist()),
        )
