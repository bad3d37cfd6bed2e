"""Exact solution of a row of homogeneous elastic bars that strike each other, by waves."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from impactfem.errors import SceneError
from impactfem.exact import initial
from impactfem.exact.row_bar import RowBar
from impactfem.exact.row_waves import SNAP, Array, Interface, Pieces, Wave, follow

_EPS = float(np.finfo(float).eps)


class ExactBarRow:
    """Motion of bars on one axis that may meet their neighbours, and the first a rigid wall at 0.

    In each bar u_tt = c^2 u_xx. Where two ends meet, the gap g >= 0, the pressing force F >= 0 and
    F g = 0; the outer ends are free, the last one may be clamped. Exact up to rounding; the
    method is that of `impactfem.exact.row_waves`. Positions x of material points count from the
    near end of their bar, a point is at x + u.

    Attributes:
        bars: The bars, in the order of the axis.
        duration: T [s].
        contacts: For each pair of neighbours, the wall and the first bar first (if there is a
            wall): intervals (t_in, t_out) of contact under pressure within [0, T] [s].
        events: Beginnings and ends of all contacts within [0, T] [s].
        sampled: Whether the data of a bar were sampled.
    """

    __slots__ = (
        "_away", "_forces", "_gaps", "_offset", "_towards", "bars", "contacts",
        "duration", "events", "sampled",
    )  # fmt: skip

    def __init__(
        self, bars: Sequence[RowBar], duration: float, *, wall: bool = False, clamped: bool = False
    ) -> None:
        """Solve for all times at once.

        Args:
            bars: In the order of the axis.
            duration: T [s].
            wall: Whether a rigid wall at 0 stops the first bar.
            clamped: Whether the far end of the last bar is held.

        Raises:
            SceneError: Bars overlap.
            TooManyWavesError: There are too many waves to follow: where bars of transit times
                without a common measure stay pressed together, each wave goes on splitting.
        """
        self.bars = tuple(bars)
        if not self.bars:
            raise SceneError("bars = []: give at least one")
        self.duration = initial.positive("duration", duration)
        self.sampled = any(bar.sampled for bar in self.bars)
        waves = [bar.waves() for bar in self.bars]
        faces = self._interfaces(waves, wall=wall, clamped=clamped)
        follow(faces, [wave for pair in waves for wave in pair], self.duration)
        self._away = [Pieces.of(pair[0].start, pair[0].value) for pair in waves]
        self._towards = [Pieces.of(pair[1].start, pair[1].value) for pair in waves]
        # u = (integral of A + integral of B) / 2 + a constant, which the start gives.
        now = np.zeros(())
        self._offset = [
            bar.place - 0.5 * float(away.integral(now))
            for bar, away in zip(self.bars, self._away, strict=True)
        ]
        meeting = [face for face in faces if face.gap < math.inf and not face.glued]
        self._forces = [_forces(face) for face in meeting]
        self._gaps = [np.array(face.record) for face in meeting]
        self.contacts = [_intervals(force, self.duration) for force in self._forces]
        found = [t for spells in self.contacts for spell in spells for t in spell]
        self.events = np.unique([t for t in found if t < self.duration])

    def _interfaces(
        self, waves: list[tuple[Wave, Wave]], *, wall: bool, clamped: bool
    ) -> list[Interface]:
        """Interfaces in the order of the axis, outer ends included."""
        first, last = self.bars[0], self.bars[-1]
        near = _closed(first.place, first, None) if wall else math.inf
        faces = [
            Interface((0.0, 1.0 / first.impedance), (None, waves[0][1]), (None, waves[0][0]), near)
        ]
        for k in range(1, len(self.bars)):
            a, b = self.bars[k - 1], self.bars[k]
            faces.append(
                Interface(
                    (1.0 / a.impedance, 1.0 / b.impedance),
                    (waves[k - 1][0], waves[k][1]),
                    (waves[k - 1][1], waves[k][0]),
                    _closed(b.place - a.far_place, b, a),
                )
            )
        away, towards = waves[-1]
        end = Interface((1.0 / last.impedance, 0.0), (away, None), (towards, None), math.inf)
        if clamped:
            end.glued, end.gap = True, 0.0
        return [*faces, end]

    def displacement(self, bar: int, t: ArrayLike, x: ArrayLike) -> Array:
        """u(t, x) of a bar, from the wall [m]; t in [0, T] and x in [0, L] broadcast."""
        away, towards = self._phases(bar, t, x)
        path = self._away[bar].integral(away) + self._towards[bar].integral(towards)
        return np.asarray(self._offset[bar] + 0.5 * path)

    def velocity(self, bar: int, t: ArrayLike, x: ArrayLike) -> Array:
        """u_t(t, x) of a bar [m/s]; at a jump the value just after it."""
        away, towards = self._phases(bar, t, x)
        return 0.5 * (self._away[bar](away) + self._towards[bar](towards))

    def strain(self, bar: int, t: ArrayLike, x: ArrayLike) -> Array:
        """u_x(t, x) of a bar [1]; at a jump the value just after it."""
        away, towards = self._phases(bar, t, x)
        difference = self._towards[bar](towards) - self._away[bar](away)
        return 0.5 * difference / self.bars[bar].wave_speed

    def gap(self, contact: int, t: ArrayLike) -> Array:
        """Gap of a pair [m], 0 exactly in contact; pairs are numbered as in `contacts`."""
        record, time = self._gaps[contact], np.asarray(t, dtype=np.float64)
        i = np.clip(np.searchsorted(record[:, 0], time, side="right") - 1, 0, None)
        return np.asarray(np.maximum(record[i, 1] + record[i, 2] * (time - record[i, 0]), 0.0))

    def force(self, contact: int, t: ArrayLike) -> Array:
        """Pressing force of a pair [N]; at a jump the value just before it."""
        return self._forces[contact].before(np.asarray(t, dtype=np.float64), self._near)

    def impulse(self, contact: int, t: ArrayLike) -> Array:
        """Integral of the pressing force from 0 to t [N s]."""
        return self._forces[contact].integral(np.asarray(t, dtype=np.float64))

    def mean_force(self, contact: int, times: ArrayLike) -> Array:
        """Mean pressing force of a pair between each two of (m + 1,) increasing times [N], (m,)."""
        t = np.asarray(times, dtype=np.float64)
        means = np.diff(self.impulse(contact, t)) / np.diff(t)
        # Times known to rounding only put this share of the force into the layer beside theirs.
        leak = self._near / np.diff(t) * self.largest_force(contact)
        return np.where(means > leak, means, 0.0)

    def largest_force(self, contact: int) -> float:
        """Largest pressing force of a pair within [0, T] [N]."""
        pieces = self._forces[contact]
        return float(pieces.value[pieces.start < self.duration].max(initial=0.0))

    def force_breaks(self, contact: int) -> Array:
        """Times within (0, T) at which the force of a pair jumps [s]."""
        pieces = self._forces[contact]
        jumps = pieces.start[1:][np.diff(pieces.value) != 0.0]
        return np.asarray(jumps[(jumps > 0.0) & (jumps < self.duration)])

    def mean_velocity(self, bar: int, t: ArrayLike) -> Array:
        """Velocity of the centre of mass of a bar [m/s]."""
        time, end = np.asarray(t, dtype=np.float64), self.bars[bar].transit_time
        waves = (self._away[bar], self._towards[bar])
        total = sum(wave.integral(time) - wave.integral(time - end) for wave in waves)
        return np.asarray(0.5 * total / end)

    def mean_displacement(self, bar: int, t: ArrayLike) -> Array:
        """Mean of u(t, x) over a bar [m]."""
        time, end = np.asarray(t, dtype=np.float64), self.bars[bar].transit_time
        waves = (self._away[bar], self._towards[bar])
        total = sum(w.second_integral(time) - w.second_integral(time - end) for w in waves)
        return np.asarray(self._offset[bar] + 0.5 * total / end)

    def energy(self, t: ArrayLike) -> tuple[Array, Array]:
        """Kinetic and elastic energy of each bar [J], one shape of t for each bar."""
        time = np.asarray(t, dtype=np.float64)
        kinetic, elastic = [], []
        for bar, away, towards in zip(self.bars, self._away, self._towards, strict=True):
            end, z = bar.transit_time, bar.impedance
            half = 0.125 * z * sum(
                wave.square_integral(time) - wave.square_integral(time - end)
                for wave in (away, towards)
            )  # fmt: skip
            mixed = [_product(away, towards, float(now), end) for now in time.ravel()]
            product = 0.25 * z * np.reshape(mixed, time.shape)
            kinetic.append(half + product)
            elastic.append(half - product)
        return np.array(kinetic), np.array(elastic)

    def momentum(self, t: ArrayLike) -> Array:
        """Momentum of all bars along the axis [kg m/s]."""
        parts = [bar.mass * self.mean_velocity(k, t) for k, bar in enumerate(self.bars)]
        return np.asarray(sum(parts))

    @property
    def _near(self) -> float:
        """Time that counts as "just before" a jump, above the rounding of times [s]."""
        shortest = min(bar.transit_time for bar in self.bars)
        return 4.0 * SNAP * shortest + 32.0 * _EPS * self.duration

    def _phases(self, bar: int, t: ArrayLike, x: ArrayLike) -> tuple[Array, Array]:
        """Times at which what is at (t, x) has left the near and the far end."""
        time, y = np.asarray(t, dtype=np.float64), np.asarray(x) / self.bars[bar].wave_speed
        return time - y, time - (self.bars[bar].transit_time - y)


def _closed(gap: float, behind: RowBar, before: RowBar | None) -> float:
    """A gap at t = 0, exactly 0 if it is rounding."""
    size = max(abs(behind.place), 0.0 if before is None else abs(before.far_place))
    if gap < -64.0 * _EPS * size:
        raise SceneError(f"place = {behind.place} m: overlaps what is before it by {-gap:g} m")
    return gap if gap > 64.0 * _EPS * size else 0.0


def _forces(face: Interface) -> Pieces:
    record = np.array(face.record)
    return Pieces.of(record[:, 0], record[:, 3])


def _intervals(force: Pieces, end: float) -> list[tuple[float, float]]:
    """Intervals of pressure."""
    on = np.r_[False, force.value > 0.0, False]
    times = np.r_[force.start, max(end, force.start[-1])]
    changes = np.flatnonzero(on[1:] != on[:-1])
    spells = [(float(times[i]), min(float(times[j]), end)) for i, j in changes.reshape(-1, 2)]
    return [(begin, stop) for begin, stop in spells if begin < stop]


def _product(away: Pieces, towards: Pieces, t: float, end: float) -> float:
    """Integral of A(t - y) B(t - end + y) over y in [0, end]."""
    i, j = np.searchsorted(away.start, [t - end, t], side="right")
    k, m = np.searchsorted(towards.start, [t - end, t], side="right")
    cuts = np.sort(np.r_[0.0, t - away.start[i:j], towards.start[k:m] - (t - end), end])
    middle = 0.5 * (cuts[1:] + cuts[:-1])
    return float(np.diff(cuts) @ (away(t - middle) * towards(t - end + middle)))
