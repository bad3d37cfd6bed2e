"""Exact solution of the homogeneous elastic bar against a rigid wall, by characteristics."""

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from impactfem.errors import SceneError
from impactfem.exact import initial
from impactfem.exact.drive import EndDrive
from impactfem.exact.pieces import Array, Load, integrate
from impactfem.exact.waves import SNAP, follow, intervals

type FarEnd = Literal["free", "clamped"]

_EPS = float(np.finfo(float).eps)
_EVEN = 1e-9  # share of a step by which times or places may miss a lattice
_MANY = 2000  # times from which their integrals are compiled
_SLACK = 1e-9  # times and places may lie this share of T, L outside: they are moved to the border


class ExactBar:
    """Motion of a bar u_tt = c^2 u_xx - p(t) that may touch a rigid wall with its end x = 0.

    0 <= u(t, 0), lambda = c^2 u_x(t, 0) <= 0, u lambda = 0; the end x = L is free (u_x = 0) or
    clamped (u = u(0, L)), or driven (see `impactfem.exact.drive`). The solution is exact up to
    rounding for u(0, x) continuous and quadratic and u_t(0, x) linear on each piece; see
    `impactfem.exact.waves` for the method. On a characteristic that carries a jump, velocity and
    strain have the value of one side.

    Attributes:
        length, wave_speed, duration: L [m], c [m/s], T [s].
        far_end: "free" or "clamped".
        transit_time: L/c [s].
        contacts: intervals (t_in, t_out) of contact within [0, T] [s]; intervals that meet to
            rounding are one, touches of no duration are left out.
        exact_until: time [s] up to which every breakpoint was kept; later the wave is simplified
            where that changes it least (see `resolution`), keeping its momentum and energy.
        events: times in [0, T] of all impacts and releases [s].
        pieces: number of pieces of the initial data.
        sampled: whether the initial data were sampled.
        sampling_error: estimate of the largest error of a displacement that this leaves [m], until
            contacts make it grow.
    """

    __slots__ = (
        "_drive",
        "_load",
        "_wave",
        "contacts",
        "duration",
        "events",
        "exact_until",
        "far_end",
        "length",
        "pieces",
        "sampled",
        "sampling_error",
        "transit_time",
        "wave_speed",
    )

    def __init__(
        self,
        *,
        length: float,
        wave_speed: float,
        duration: float,
        nodes: ArrayLike,
        displacement: ArrayLike,
        velocity: ArrayLike,
        midpoints: ArrayLike | None = None,
        gravity_times: ArrayLike = (0.0,),
        gravity_values: ArrayLike = (0.0,),
        far_end: FarEnd = "free",
        drive: EndDrive | None = None,
        damping: float = 0.0,
        resolution: int = 2048,
    ) -> None:
        """Solve for all times at once.

        Args:
            length: L [m].
            wave_speed: c [m/s].
            duration: T [s].
            nodes: (n+1,) borders of the pieces, from 0 to L [m].
            displacement: (n+1,) u(0, x) at the nodes [m].
            velocity: u_t(0, x) at the nodes (n+1,), or at both ends of each piece (n, 2) [m/s].
            midpoints: (n,) u(0, x) in the middle of each piece [m]; absent: u is linear there.
            gravity_times: (m,) times from which the values hold, the first 0 [s].
            gravity_values: (m,) acceleration p towards the wall [m/s^2], of any sign.
            far_end: "free" or "clamped".
            drive: what drives the far end; None: nothing.
            damping: of a damper at a free far end, over rho A c, not below 0.
            resolution: breakpoints of the wave kept from one return from the far end to the next
                (never fewer than four times the pieces, and what the drive has); irregular bouncing
                asks for ever more.

        Raises:
            SceneError: the data contradict each other or start inside the wall, or the motion
                has too many breakpoints to keep.
        """
        if far_end not in ("free", "clamped"):
            raise SceneError(f'far_end = "{far_end}": choose "free" or "clamped"')
        self.far_end = far_end
        self.length = initial.positive("length", length)
        self.wave_speed = initial.positive("wave_speed", wave_speed)
        self.duration = initial.positive("duration", duration)
        self.transit_time = self.length / self.wave_speed
        self.sampled = drive is not None and drive.error > 0.0
        self.sampling_error = 0.0 if drive is None else drive.error
        self._drive = drive
        self._load = Load.from_steps(*initial.steps(gravity_times, gravity_values))
        x, u, v = initial.pieces(self.length, nodes, displacement, velocity)
        self.pieces = len(x) - 1
        chord = 0.5 * (u[:-1] + u[1:])
        middle = chord if midpoints is None else initial.finite("midpoints", midpoints, chord.shape)
        gap, scale = float(u[0]), float(np.abs(u).max())
        if gap < -_SLACK * scale:
            raise SceneError(f"displacement = {gap} m at x = 0: start outside the wall, at u >= 0")
        strain = initial.strain(x, u, 4.0 * (middle - chord))
        clamped = far_end == "clamped"
        leaving = initial.wave(x / self.wave_speed, v, self.wave_speed * strain, clamped=clamped)
        self._wave, events, exact_until = follow(
            leaving,
            self._load,
            gap=max(gap, 0.0),
            duration=self.duration + self.transit_time,
            turn=-1.0 if clamped else (1.0 - damping) / (1.0 + damping),
            resolution=max(
                resolution, 4 * self.pieces + (0 if drive is None else len(drive.values))
            ),
            drive=drive,
        )
        self.exact_until = min(exact_until, self.duration)
        self.events = np.array([t for t, _ in events if t <= self.duration], dtype=np.float64)
        self.contacts = intervals(events, self.duration, self.transit_time)

    @classmethod
    def from_functions(
        cls,
        *,
        length: float,
        wave_speed: float,
        duration: float,
        displacement: Callable[[Array], ArrayLike],
        velocity: Callable[[Array], ArrayLike],
        gravity_times: ArrayLike = (0.0,),
        gravity_values: ArrayLike = (0.0,),
        far_end: FarEnd = "free",
        drive: EndDrive | None = None,
        damping: float = 0.0,
        pieces: int = 256,
        tolerance: float = 1e-11,
        resolution: int = 2048,
    ) -> "ExactBar":
        """Solve for u(0, x) and u_t(0, x) given as functions of x (vectorised).

        If both are affine to rounding the solution is exact. Otherwise they are taken in pieces,
        u quadratic and u_t linear on each, as short as the tolerance asks (see
        `impactfem.exact.initial.sample`); for smooth data displacements err by the third power of
        their width, velocities by the second. Kinks and jumps are enclosed by short pieces.

        Args:
            length: L [m].
            wave_speed: c [m/s].
            duration: T [s].
            displacement: u(0, x) [m].
            velocity: u_t(0, x) [m/s].
            gravity_times: as in the class.
            gravity_values: as in the class.
            far_end: "free" or "clamped".
            drive: what drives the far end; None: nothing.
            damping: as in the class.
            pieces: number of equal pieces to begin with, for data that are not affine.
            tolerance: error of displacements that the pieces may leave, relative to the largest.
            resolution: as in the class.

        Raises:
            SceneError: As the class, or a function does not give a finite number at some x.
        """
        length = initial.positive("length", length)
        speed = initial.positive("wave_speed", wave_speed)
        start = initial.sample(length, speed, displacement, velocity, pieces, tolerance)
        bar = cls(
            length=length,
            wave_speed=wave_speed,
            duration=duration,
            nodes=start.nodes,
            displacement=start.displacement,
            velocity=start.velocity,
            midpoints=start.middle,
            gravity_times=gravity_times,
            gravity_values=gravity_values,
            far_end=far_end,
            drive=drive,
            damping=damping,
            resolution=resolution,
        )
        bar.sampled = bar.sampled or start.middle is not None
        bar.sampling_error += start.error
        return bar

    def displacement(self, t: ArrayLike, x: ArrayLike) -> Array:
        """u(t, x) [m]; t in [0, T] and x in [0, L] broadcast against each other."""
        return self._fields(*self._inside(t, x))[0]

    def velocity(self, t: ArrayLike, x: ArrayLike) -> Array:
        """u_t(t, x) [m/s]; arguments as for `displacement`."""
        return self._waves(*self._inside(t, x))[0]

    def strain(self, t: ArrayLike, x: ArrayLike) -> Array:
        """u_x(t, x) [1]; arguments as for `displacement`."""
        return self._waves(*self._inside(t, x))[1] / self.wave_speed

    def gap(self, t: ArrayLike) -> Array:
        """u(t, 0) [m], 0 exactly in contact."""
        wave = self._wave
        i, dt = wave.pieces(self._inside(t, 0.0)[0])
        flight = wave.gap[i] + (wave.value[i] + 0.5 * wave.slope[i] * dt) * dt
        return np.where(wave.contact[i], 0.0, np.maximum(flight, 0.0))

    def multiplier(self, t: ArrayLike) -> Array:
        """Lambda(t) = c^2 u_x(t, 0) <= 0 [m^2/s^2]; at a jump the value just before it.

        At t = 0 it is the value just after. The contact force is -rho A lambda.
        """
        wave, t = self._wave, self._inside(t, 0.0)[0]
        # A time meant to be the jump may be rounded to either side of it.
        near = 2.0 * SNAP * self.transit_time + 8.0 * _EPS * self.duration
        i, _ = wave.pieces(np.maximum(t - near, 0.0))
        force = wave.value[i] + wave.slope[i] * (t - wave.start[i])
        return self.wave_speed * np.where(wave.contact[i], np.minimum(force, 0.0), 0.0)

    @property
    def multiplier_breaks(self) -> Array:
        """Times in [0, T], ends included, between which lambda is linear in time [s]."""
        wave = self._wave
        beside = wave.contact | np.r_[False, wave.contact[:-1]]
        inside = (wave.start > 0.0) & (wave.start < self.duration)
        breaks: Array = np.r_[0.0, wave.start[beside & inside], self.duration]
        return breaks

    def force_integral(self, t0: ArrayLike, t1: ArrayLike) -> Array:
        """Integral of lambda from t0 to t1 [m^2/s]; the arguments broadcast."""
        end, begin = (self._wave.pressed(self._inside(t, 0.0)[0]) for t in (t1, t0))
        return self.wave_speed * (end - begin)

    def mean_multiplier(self, times: ArrayLike) -> Array:
        """Mean of lambda between each two of (m + 1,) increasing times [m^2/s^2], (m,)."""
        t = np.asarray(times, dtype=np.float64)
        means = self.force_integral(t[:-1], t[1:]) / np.diff(t)
        # A time known to rounding only puts this share of the force into the layer beside it.
        leak = 64.0 * _EPS * self.duration / np.diff(t) * self.largest_force
        return np.where(np.abs(means) > leak, np.minimum(means, 0.0), 0.0)

    @property
    def largest_force(self) -> float:
        """Largest -lambda within [0, T] [m^2/s^2]."""
        wave = self._wave
        held = np.flatnonzero(wave.contact & (wave.start < self.duration))
        stop = np.minimum(np.append(wave.start[1:], np.inf)[held], self.duration)
        first = wave.value[held]
        last = first + wave.slope[held] * (stop - wave.start[held])
        return self.wave_speed * -float(np.minimum(first, last).min(initial=0.0))

    @property
    def drive_pieces(self) -> int:
        """Pieces of what drives the far end."""
        return 0 if self._drive is None else len(self._drive.values)

    @property
    def load_switches(self) -> Array:
        """Times in (0, T) at which gravity changes [s]."""
        times = self._load.times
        return times[(times > 0.0) & (times < self.duration)]

    def end_work(self, times: ArrayLike) -> Array:
        """Work over rho A of what drives the far end, from 0 to increasing times (m,) [m^3/s^2].

        The integral of c^2 u_x u_t at x = L; both are linear between the breakpoints of all waves.
        """
        t = self._inside(times, 0.0)[0]
        if self._drive is None:
            return np.zeros(t.shape)
        reach, load, start = self.transit_time, self._load.times[1:], self._wave.start
        breaks = [start - reach, start + reach, self._drive.times, load, load - reach, load + reach]
        edges = np.unique(np.concatenate([[0.0], t, *breaks]))
        edges = edges[(edges >= 0.0) & (edges <= t.max(initial=0.0))]
        width, middle = np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
        shift = width / np.sqrt(12.0)
        power = np.zeros(len(width))
        for x in (middle - shift, middle + shift):
            v, s = self._waves(x, np.array(reach))
            power += 0.5 * width * v * s
        done = self.wave_speed * np.concatenate([[0.0], np.cumsum(power)])
        found: Array = done[np.searchsorted(edges, t)]
        return found

    def fields(self, times: ArrayLike, places: ArrayLike) -> tuple[Array, Array]:
        """Displacement and velocity [m, m/s] at times (m,) and places (n,), each (m, n).

        Where waves run from place to place within each so many of equal steps, they are read off
        once and moved on: as far as no change of gravity is near.
        """
        t, y = self._inside(times, 0.0)[0], self._inside(0.0, places)[1]
        lattice = _lattice(t, y)
        if lattice is None:
            return self._fields(t[:, None], y)
        step, stride = lattice
        last, size = stride * (len(t) - 1), len(y) - 1
        when = t[0] + step * np.arange(-size, last + size + 1)
        towards, away = (
            self._wave.arriving(when[size:]),
            self._wave.leaving(when[: last + size + 1]),
        )
        sampled = []
        for wave, back in zip(towards, away, strict=True):
            rows = sliding_window_view(wave, size + 1)[::stride]
            field = rows + sliding_window_view(back, size + 1)[::stride, ::-1]
            field *= 0.5
            sampled.append(field)
        v, u = sampled
        jumps = self._load.times[1:]
        near = np.searchsorted(jumps, t - y[-1]) < np.searchsorted(jumps, t + y[-1], side="right")
        if near.any():
            u[near], v[near] = self._fields(t[near, None], y)
        for p in np.unique(self._load.values):
            rows = ~near & (self._load.values[np.searchsorted(jumps, t, side="right")] == p)
            if p and rows.all():
                u += 0.5 * p * y * y
            elif p:
                u[rows] += 0.5 * p * y * y
        return u, v

    def _fields(self, t: Array, y: Array) -> tuple[Array, Array]:
        a, b = t - y, t + y
        zeroth, first = self._load.moments(a, y)
        after, lift = self._load.moments(t, y)
        (towards, came), (away, left) = self._wave.arriving(b), self._wave.leaving(a)
        u = 0.5 * (came + left + lift + y * zeroth - first)
        return u, 0.5 * (towards + after + away - zeroth)

    def energy(self, t: ArrayLike) -> tuple[Array, Array]:
        """Kinetic and elastic energy of the bar over rho A, integrated exactly [m^3/s^2]."""
        kinetic, elastic, _, _ = self.sums(t)
        return kinetic, elastic

    def mean_velocity(self, t: ArrayLike) -> Array:
        """Velocity of the centre of mass [m/s]."""
        return self.sums(t)[2] / self.length

    def mean_displacement(self, t: ArrayLike) -> Array:
        """Mean of u(t, x) over the bar [m]."""
        return self.sums(t)[3] / self.length

    def sums(self, t: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """Integrals over the bar of u_t^2 / 2, c^2 u_x^2 / 2, u_t and u, exactly."""
        time = self._inside(t, 0.0)[0]
        flat, wave, load = time.ravel(), self._wave, self._load
        rows = np.zeros((4, flat.size))
        if flat.size > _MANY:
            from impactfem.exact import wave_kernels  # noqa: PLC0415  (loads Numba)

            wave_kernels.sums(
                wave.start, wave.value, wave.slope, wave.contact, wave.gap, wave.impulse,
                load.times, load.values, flat, self.transit_time, rows,
            )  # fmt: skip
        elif flat.size:
            breaks = np.union1d(wave.start, load.times[1:])
            rows = integrate(flat, breaks, self.transit_time, self._densities)
        kinetic, elastic, speed, place = self.wave_speed * rows.reshape(4, *time.shape)
        return kinetic, elastic, speed, place

    def _densities(self, t: Array, y: Array) -> tuple[Array, Array, Array, Array]:
        v, s = self._waves(t, y)
        return 0.5 * v * v, 0.5 * s * s, v, self._fields(t, y)[0]

    def _waves(self, t: Array, y: Array) -> tuple[Array, Array]:
        """Fields v and s = c u_x at times t and travel times y = x/c from the wall."""
        a, b = t - y, t + y
        towards = self._wave.arriving(b)[0] + self._load.moments(t, y)[0]
        away = self._wave.leaving(a)[0] - self._load.moments(a, y)[0]
        return 0.5 * (towards + away), 0.5 * (towards - away)

    def _inside(self, t: ArrayLike, x: ArrayLike) -> tuple[Array, Array]:
        """Times and travel times x/c as floats, or SceneError when one lies outside the domain."""
        pair = []
        for name, value, end in (("t", t, self.duration), ("x", x, self.length)):
            array = np.asarray(value, dtype=np.float64)
            bad = ~((array >= -_SLACK * end) & (array <= (1.0 + _SLACK) * end))
            if bad.any():
                raise SceneError(f"{name} = {array[bad].flat[0]}: give values in [0, {end}]")
            pair.append(np.clip(array, 0.0, end))
        return pair[0], pair[1] / self.wave_speed


def _lattice(t: Array, y: Array) -> tuple[float, int] | None:
    """Step of equal travel times and steps of time in it, if there is such a whole number."""
    if len(t) < 2 or len(y) < 2:
        return None
    step, wide = y[-1] / (len(y) - 1), (t[-1] - t[0]) / (len(t) - 1)
    stride = round(wide / step)
    even = np.abs(t - (t[0] + stride * step * np.arange(len(t)))).max() <= _EVEN * step
    even &= np.abs(y - step * np.arange(len(y))).max() <= _EVEN * step
    return (step, stride) if stride >= 1 and even else None
