"""The point mass that meets a wall: the equations leave the rebound open, energy settles it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactfem.errors import SceneError
from impactfem.exact import initial

type Array = NDArray[np.float64]


@dataclass(frozen=True)
class PointMassImpact:
    """One solution of u_tt = -lambda, 0 <= u, lambda <= 0, u lambda = 0, u(0) = H, u_t(0) = -v0.

    The mass arrives at tau = H/v0, rests until r and leaves with v1. Every r >= tau and v1 >= 0
    solve the equations: -lambda is the measure of the two impulses, v0 at tau and v1 at r, both
    where u = 0. (The founding slides print u_tt = lambda <= 0: pulled towards the wall, the mass
    could not even stop there.)

    Attributes:
        height: H > 0 [m].
        speed: v0 > 0, towards the wall [m/s].
        rebound_time: r >= tau [s]; inf: it stays. None: r = tau.
        rebound_speed: v1 >= 0 [m/s]. None: v1 = v0.

    Raises:
        SceneError: A value is out of range.
    """

    height: float
    speed: float
    rebound_time: float | None = None
    rebound_speed: float | None = None

    def __post_init__(self) -> None:
        initial.positive("height", self.height)
        initial.positive("speed", self.speed)
        if self.rebound_time is None:
            object.__setattr__(self, "rebound_time", self.impact_time)
        if self.rebound_speed is None:
            object.__setattr__(self, "rebound_speed", self.speed)
        if math.isnan(self.leaving_time) or self.leaving_time < self.impact_time:
            raise SceneError(
                f"rebound_time = {self.leaving_time}: it cannot leave before it arrives, at "
                f"{self.impact_time} s"
            )
        if float(initial.finite("rebound_speed", self.leaving_speed, ())) < 0.0:
            raise SceneError(f"rebound_speed = {self.leaving_speed}: give a number of at least 0")

    @property
    def impact_time(self) -> float:
        """Tau = H/v0 [s]."""
        return self.height / self.speed

    @property
    def leaving_time(self) -> float:
        """R [s], given or tau."""
        return self.impact_time if self.rebound_time is None else float(self.rebound_time)

    @property
    def leaving_speed(self) -> float:
        """v1 [m/s], given or v0."""
        return self.speed if self.rebound_speed is None else float(self.rebound_speed)

    @property
    def restitution(self) -> float:
        """Ratio e = v1/v0."""
        return self.leaving_speed / self.speed

    @property
    def conserves_energy(self) -> bool:
        """Whether the kinetic energy is the same at all times but tau: r = tau and e = 1."""
        return self.leaving_time == self.impact_time and self.leaving_speed == self.speed

    @property
    def impulses(self) -> tuple[tuple[float, float], ...]:
        """Times [s] and impulses per mass [m/s] of the wall on the mass; together -lambda."""
        arrive, leave = self.impact_time, self.leaving_time
        if leave == arrive:
            return ((arrive, self.speed + self.leaving_speed),)
        if math.isinf(leave):
            return ((arrive, self.speed),)
        return ((arrive, self.speed), (leave, self.leaving_speed))

    def displacement(self, t: ArrayLike) -> Array:
        """u(t) [m] for t >= 0 [s]."""
        t = np.asarray(t, dtype=np.float64)
        falling = self.speed * np.maximum(self.impact_time - t, 0.0)
        if math.isinf(self.leaving_time):
            return np.asarray(falling)
        return np.asarray(falling + self.leaving_speed * np.maximum(t - self.leaving_time, 0.0))

    def velocity(self, t: ArrayLike) -> Array:
        """u_t(t) [m/s]; at a jump the value after it."""
        t = np.asarray(t, dtype=np.float64)
        resting = np.where(t < self.impact_time, -self.speed, 0.0)
        return np.where(t >= self.leaving_time, self.leaving_speed, resting)

    def kinetic_energy(self, t: ArrayLike) -> Array:
        """u_t^2/2 [m^2/s^2], per mass."""
        return np.asarray(0.5 * self.velocity(t) ** 2)
