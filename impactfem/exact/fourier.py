"""A bar that strikes a wall once in a gravity field, as the founding slides write its motion.

Generalised d'Alembert formula with two vibrations: eta (clamped at the wall, while in contact) and
chi (free, after release). Each is given as its Fourier series, cut off with a bound, and as the
periodic piecewise quadratic function that the series sums to. Where the printed formulas differ
from these, docs/benchmarks.md says so. `impactfem.exact.bar` solves the same problem, and any other
of its kind, along characteristics; the two share no code.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactfem.errors import SceneError
from impactfem.exact import initial
from impactfem.exact.series import PartialSum, cosines, sines

type Array = NDArray[np.float64]

REGIONS = ("I0", "I1", "A1", "I2", "I3")
"""Fall; not yet reached by the impact; at rest but for eta; moving off; after release."""

_EPS = float(np.finfo(float).eps)


def clamped_vibration(s: ArrayLike, x: ArrayLike, length: float, wave_speed: float) -> Array:
    """Eta(s, x) [s^2]: eta_tt - c^2 eta_xx = -1, eta = 0 at x = 0, eta_x = 0 at x = L, from rest.

    Args:
        s: Time since the impact t - tau [s], broadcast against x.
        x: Place from 0 to L [m].
        length: L [m].
        wave_speed: c [m/s].
    """
    s, x = _arrays(s, x)
    ahead, behind = x + wave_speed * s, x - wave_speed * s

    def static(z: Array) -> Array:
        # (2/L) sum sin(nu_n z)/nu_n^3: z (2L - z)/2 on [0, 2L], odd, changes sign every 2L.
        turn = np.floor(z / (2.0 * length))
        z = z - 2.0 * length * turn
        return np.where(turn % 2.0 == 0.0, 0.5, -0.5) * z * (2.0 * length - z)

    mean = 0.5 * (static(ahead) + static(behind))
    return np.asarray((mean - static(x)) / wave_speed**2)


def free_vibration(s: ArrayLike, x: ArrayLike, length: float, wave_speed: float) -> Array:
    """Chi(s, x) [s^2]: chi_tt = c^2 chi_xx, chi_x = 0 at both ends, chi_t = 0 at s = 2 L/c.

    Arguments as for `clamped_vibration`; chi(2 L/c, x) = (x^2 - 2 L x)/c^2.
    """
    s, x = _arrays(s, x)

    def periodic(z: Array) -> Array:
        # 4 sum cos(mu_n z)/mu_n^2 - 2 L^2/3: z (z - 2L) on [0, 2L], period 2L.
        z = z % (2.0 * length)
        return z * (z - 2.0 * length)

    way = wave_speed * s
    return np.asarray(0.5 * (periodic(way + x) + periodic(way - x)) / wave_speed**2)


def clamped_series(
    s: ArrayLike, x: ArrayLike, length: float, wave_speed: float, terms: int = 400
) -> PartialSum:
    """Fourier series of eta, with the error of cutting it off after `terms`.

    2/(L c^2) sum_n (cos(nu_n c s) - 1) sin(nu_n x)/nu_n^3, nu_n = (n - 1/2) pi/L. The plain tail is
    at most 2 (L/c)^2/(pi^3 terms^2); away from wave fronts summation by parts makes it far smaller.

    Raises:
        SceneError: `terms` is not positive.
    """
    s, x = _arrays(s, x)
    turn, way = np.pi / length, wave_speed * s
    ahead, behind, here = (
        sines(turn * z, terms) for z in np.broadcast_arrays(x + way, x - way, x + 0.0 * way)
    )
    scale = 2.0 * (length / wave_speed) ** 2 / np.pi**3
    return PartialSum(
        scale * (0.5 * (ahead.value + behind.value) - here.value),
        scale * (0.5 * (ahead.bound + behind.bound) + here.bound),
    )


def free_series(
    s: ArrayLike, x: ArrayLike, length: float, wave_speed: float, terms: int = 400
) -> PartialSum:
    """Fourier series of chi, with the error of cutting it off after `terms`.

    4/c^2 sum_n cos(mu_n (c s - 2 L)) cos(mu_n x)/mu_n^2 - 2 L^2/(3 c^2), mu_n = n pi/L. The plain
    tail is at most 4 (L/c)^2/(pi^2 (terms + 1/2)); summation by parts as for eta.

    Raises:
        SceneError: `terms` is not positive.
    """
    s, x = _arrays(s, x)
    turn, way = np.pi / length, wave_speed * s - 2.0 * length
    ahead, behind = (cosines(turn * z, terms) for z in np.broadcast_arrays(way + x, way - x))
    scale = 4.0 * (length / wave_speed) ** 2 / np.pi**2
    return PartialSum(
        scale * (0.5 * (ahead.value + behind.value) - np.pi**2 / 6.0),
        scale * 0.5 * (ahead.bound + behind.bound),
    )


@dataclass(frozen=True)
class _ThrownBar:
    """A bar above a wall: u = H, u_t = -v0 at t = 0, pulled by p until it meets the wall at tau.

    Attributes:
        length: L [m].
        wave_speed: c [m/s].
        height: H > 0 [m].
        speed: v0 >= 0, towards the wall [m/s].
        gravity: p >= 0, towards the wall [m/s^2].
    """

    length: float
    wave_speed: float
    height: float
    speed: float
    gravity: float

    def __post_init__(self) -> None:
        for name in ("length", "wave_speed", "height"):
            initial.positive(name, getattr(self, name))
        for name in ("speed", "gravity"):
            if float(initial.finite(name, getattr(self, name), ())) < 0.0:
                raise SceneError(f"{name} = {getattr(self, name)}: give a number of at least 0")
        if self.speed == 0.0 and self.gravity == 0.0:
            raise SceneError("speed = gravity = 0: the bar never meets the wall; give one of them")

    @property
    def transit_time(self) -> float:
        """L/c [s]."""
        return self.length / self.wave_speed

    @property
    def impact_speed(self) -> float:
        """v0 + p tau = sqrt(v0^2 + 2 p H) [m/s]."""
        return float(np.sqrt(self.speed**2 + 2.0 * self.gravity * self.height))

    @property
    def impact_time(self) -> float:
        """Tau [s]; written so that p = 0 does no harm."""
        return 2.0 * self.height / (self.impact_speed + self.speed)

    @property
    def release_time(self) -> float:
        """Tau + 2 L/c [s]."""
        return self.impact_time + 2.0 * self.transit_time

    def region(self, t: ArrayLike, x: ArrayLike) -> NDArray[np.int64]:
        """Index into `REGIONS`; t [s] and x [m] broadcast."""
        t, x = _arrays(t, x)
        s, y = t - self.impact_time, x / self.wave_speed
        borders = (s >= 0.0, s >= y, s >= 2.0 * self.transit_time - y, s >= 2.0 * self.transit_time)
        return np.sum(np.broadcast_arrays(*borders), axis=0, dtype=np.int64)

    def _fall(self, t: Array) -> Array:
        # H - v0 t - p t^2/2 with its root tau taken out.
        return (self.impact_time - t) * (self.speed + 0.5 * self.gravity * (self.impact_time + t))

    def _held(self, t: Array) -> NDArray[np.bool_]:
        return (t > self.impact_time) & (t <= self.release_time)


@dataclass(frozen=True)
class GravityImpact(_ThrownBar):
    """First impact under constant gravity (K2; K1 without gravity), valid until `next_impact`.

    Attributes: as of the class it derives from.

    Raises:
        SceneError: A value is out of range, or v0 + p tau < 2 p L/c (the end would not leave).
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        least = 2.0 * self.gravity * self.transit_time
        if self.impact_speed < least * (1.0 - 8.0 * _EPS):
            raise SceneError(
                f"impact speed {self.impact_speed} < 2 p L/c = {least}: the end does not leave at "
                "once and the closed form does not hold; use impactfem.exact.ExactBar"
            )

    @property
    def next_impact(self) -> float:
        """When the near end meets the wall again and the formulas end [s]; inf without gravity."""
        if self.gravity == 0.0:
            return float("inf")
        # In transit times u(t, 0)/(p l^2) = q r - r^2/2 + chi with -1 <= chi <= 0, chi piecewise
        # (r - 2k - 1)^2 - 1. So the root is at most 2 q, and not before chi = -1 would have it.
        q = self.impact_speed / (self.gravity * self.transit_time)
        earliest = q + np.sqrt(max(q * q - 2.0, 0.0))
        root = 2.0 * q
        for k in np.floor(0.5 * earliest) + np.arange(3.0):
            half = 2.0 * (2.0 * k + 1.0) - q
            square = half * half - 8.0 * k * (k + 1.0)
            found = half - np.sqrt(max(square, 0.0))
            # At V = 2 p l the end just touches: a double root.
            if square >= -64.0 * _EPS * half * half and found <= 2.0 * (k + 1.0):
                root = min(root, found)
                break
        return float(self.release_time + root * self.transit_time)

    def displacement(self, t: ArrayLike, x: ArrayLike, terms: int | None = None) -> Array:
        """u(t, x) [m] by the generalised d'Alembert formula.

        Args:
            t: Times from 0 to `next_impact` [s], broadcast against x.
            x: Places from 0 to L [m].
            terms: Take eta and chi from so many terms of their series; absent: closed forms.

        Raises:
            SceneError: A time lies outside.
        """
        t, x = _arrays(t, x)
        _check_times(t, self.next_impact)
        s, bar = t - self.impact_time, (self.length, self.wave_speed)
        r = s - 2.0 * self.transit_time
        p, v = self.gravity, self.impact_speed
        if terms is None:
            eta, chi = clamped_vibration(s, x, *bar), free_vibration(s, x, *bar)
        else:
            eta = clamped_series(s, x, *bar, terms).value
            chi = free_series(s, x, *bar, terms).value
        forms = (
            self._fall(t),
            -s * v + p * eta,
            -v * x / self.wave_speed + p * eta,
            r * v + p * eta,
            r * v - 0.5 * p * r * r + p * chi,
        )
        return np.asarray(np.choose(self.region(t, x), forms))

    def multiplier(self, t: ArrayLike) -> Array:
        """Lambda(t) = -c (v0 + p t) in contact, else 0 [m^2/s^2]; at a jump the value before it."""
        t = np.asarray(t, dtype=np.float64)
        _check_times(t, self.next_impact)
        force = self.wave_speed * (self.speed + self.gravity * t)
        return np.where(self._held(t), -force, 0.0)


@dataclass(frozen=True)
class StepLoadImpact(_ThrownBar):
    """The same bar when the load is switched off at the impact (K3): no vibration, for all times.

    Attributes: as of the class it derives from; the load must end at `impact_time`.
    """

    def displacement(self, t: ArrayLike, x: ArrayLike) -> Array:
        """u(t, x) [m]; t >= 0 [s] and x [m] broadcast."""
        t, x = _arrays(t, x)
        _check_times(t, float("inf"))
        s, y = t - self.impact_time, x / self.wave_speed
        forms = (self._fall(t), -s, -y, s - 2.0 * self.transit_time)
        v = self.impact_speed
        region = np.minimum(self.region(t, x), 3)
        return np.asarray(np.choose(region, (forms[0], *(v * form for form in forms[1:]))))

    def multiplier(self, t: ArrayLike) -> Array:
        """Lambda(t) = -c (v0 + p tau) in contact, else 0 [m^2/s^2]; at a jump the value before."""
        t = np.asarray(t, dtype=np.float64)
        _check_times(t, float("inf"))
        return np.where(self._held(t), -self.wave_speed * self.impact_speed, 0.0)


def _arrays(t: ArrayLike, x: ArrayLike) -> tuple[Array, Array]:
    return np.asarray(t, dtype=np.float64), np.asarray(x, dtype=np.float64)


def _check_times(t: Array, end: float) -> None:
    bad = ~((t >= 0.0) & (t <= end * (1.0 + 8.0 * _EPS)))
    if bad.any():
        raise SceneError(f"t = {t[bad].flat[0]}: give times in [0, {end}] s")
