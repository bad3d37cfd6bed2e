"""Exact solution of the homogeneous elastic bar against a rigid wall, by characteristics."""

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from impactfem.errors import SceneError
from impactfem.exact import initial
from impactfem.exact.pieces import Array, Load, integrate
from impactfem.exact.waves import SNAP, follow, intervals

type FarEnd = Literal["free", "clamped"]

_EPS = float(np.finfo(float).eps)
_SLACK = 1e-9  # times and places may lie this share of T, L outside: they are moved to the border


class ExactBar:
    """Motion of a bar u_tt = c^2 u_xx - p(t) that may touch a rigid wall with its end x = 0.

    0 <= u(t, 0), lambda = c^2 u_x(t, 0) <= 0, u lambda = 0; the end x = L is free (u_x = 0) or
    clamped (u = u(0, L)). The solution is exact up to rounding for u(0, x) continuous and
    quadratic and u_t(0, x) linear on each piece; see `impactfem.exact.waves` for the method.
    On a characteristic that carries a jump, velocity and strain have the value of one side.

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
        sampled: whether the initial data were sampled (then the solution is that accurate).
    """

    __slots__ = (
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
            resolution: breakpoints of the wave kept from one return from the far end to the next
                (never fewer than four times the pieces); irregular bouncing asks for ever more.

        Raises:
            SceneError: the data contradict each other or start inside the wall, or the motion
                has too many breakpoints to keep.
        """
        if far_end not in ("free", "clamped"):
            raise SceneError(f'far_end = {far_end!r}: choose "free" or "clamped"')
        self.far_end = far_end
        self.length = initial.positive("length", length)
        self.wave_speed = initial.positive("wave_speed", wave_speed)
        self.duration = initial.positive("duration", duration)
        self.transit_time = self.length / self.wave_speed
        self.sampled = False
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
            clamped=clamped,
            resolution=max(resolution, 4 * self.pieces),
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
        pieces: int = 1024,
        resolution: int = 2048,
    ) -> "ExactBar":
        """Solve for u(0, x) and u_t(0, x) given as functions of x (vectorised).

        If both are affine to rounding the solution is exact. Otherwise they are sampled on
        `pieces` equal pieces of width h: the quadratic through both ends and the middle for u,
        the straight line between its ends for u_t. For smooth data the error is of second order:
        at most h^2 (max |v_xx| / 8 + c max |u_xxx| / 12) in velocity and in c times strain until
        the first event, and that times t in u. Kinks and jumps on piece borders do no harm; one
        inside a piece leaves an error of first order there.

        Args:
            length: L [m].
            wave_speed: c [m/s].
            duration: T [s].
            displacement: u(0, x) [m].
            velocity: u_t(0, x) [m/s].
            gravity_times: as in the class.
            gravity_values: as in the class.
            far_end: "free" or "clamped".
            pieces: number of pieces for data that are not affine.
            resolution: as in the class.

        Raises:
            SceneError: as the class, or a function does not give a finite number at some x.
        """
        length = initial.positive("length", length)
        x, u, v, middle = initial.sample(length, displacement, velocity, pieces)
        bar = cls(
            length=length,
            wave_speed=wave_speed,
            duration=duration,
            nodes=x,
            displacement=u,
            velocity=v,
            midpoints=middle,
            gravity_times=gravity_times,
            gravity_values=gravity_values,
            far_end=far_end,
            resolution=resolution,
        )
        bar.sampled = middle is not None
        return bar

    def displacement(self, t: ArrayLike, x: ArrayLike) -> Array:
        """u(t, x) [m]; t in [0, T] and x in [0, L] broadcast against each other."""
        t, y = self._inside(t, x)
        a, b = t - y, t + y
        zeroth, first = self._load.moments(a, y)
        lift = self._load.moments(t, y)[1] + y * zeroth - first
        towards, away = self._wave.arriving(b)[1], self._wave.leaving(a)[1]
        return 0.5 * (towards + away + lift)

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
        impulse: list[Array] = []
        for t in (t0, t1):
            time = self._inside(t, 0.0)[0]
            impulse.append(0.5 * (self._wave.arriving(time)[1] - self._wave.leaving(time)[1]))
        return self.wave_speed * (impulse[1] - impulse[0])

    def energy(self, t: ArrayLike) -> tuple[Array, Array]:
        """Kinetic and elastic energy of the bar over rho A, integrated exactly [m^3/s^2]."""
        kinetic, elastic = self._integrals(
            t, lambda t, y: tuple(0.5 * wave * wave for wave in self._waves(t, y))
        )
        return kinetic, elastic

    def mean_velocity(self, t: ArrayLike) -> Array:
        """Velocity of the centre of mass [m/s]."""
        return self._integrals(t, lambda t, y: self._waves(t, y)[:1])[0] / self.length

    def mean_displacement(self, t: ArrayLike) -> Array:
        """Mean of u(t, x) over the bar [m]."""
        (total,) = self._integrals(t, lambda t, y: (self.displacement(t, y * self.wave_speed),))
        return total / self.length

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

    def _integrals(
        self, t: ArrayLike, integrands: Callable[[Array, Array], tuple[Array, ...]]
    ) -> tuple[Array, ...]:
        """Integrals over x of piecewise quadratic fields, by two Gauss points per piece."""
        time = self._inside(t, 0.0)[0]
        flat, end = time.ravel(), self.transit_time
        if flat.size == 0:
            return tuple(row for row in integrands(time, time))
        breaks = np.union1d(self._wave.start, self._load.times[1:])
        sums = integrate(flat, breaks, end, integrands)
        return tuple(self.wave_speed * row.reshape(time.shape) for row in sums)
