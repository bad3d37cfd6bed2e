"""Waves in a row of bars: followed from interface to interface, one event after the other.

With c the wave speed of a bar, v its velocity and s = c u_x, the sums A = v - s and B = v + s
travel unchanged towards its far and its near end. Where bars a and b meet, A of a and B of b
arrive. Apart (or for A <= B) both are sent back as they came, and the gap grows at the rate
B - A. Pressed together they have one velocity and one force,

    F = (A - B) / (1/Z_a + 1/Z_b) >= 0,  Z = rho A c,

and A - 2 F/Z_a goes back into a, B + 2 F/Z_b into b. What leaves an interface arrives at the
next one a transit time later: until then interfaces know nothing of each other.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import SceneError

type Array = NDArray[np.float64]

SNAP = 1e-12
"""Share of the shortest transit time within which events count as one."""

_EPS = float(np.finfo(float).eps)
_STEP = 256.0 * _EPS  # share of the largest wave below which a jump is rounding
_MAX_PIECES = 500_000


class TooManyWavesError(SceneError):
    """Waves have split at interfaces more often than can be followed."""


@dataclass(slots=True)
class Wave:
    """What leaves one end of a bar: constant from each time of leaving on.

    Attributes:
        transit: Travel time to the other end [s].
        start: Times of leaving [s], from -transit on.
        value: A or B [m/s].
    """

    transit: float
    start: list[float]
    value: list[float]

    def send(self, time: float, value: float, step: float) -> None:
        """Go on with another value, unless they differ by rounding only."""
        if abs(value - self.value[-1]) > step:
            if self.start[-1] == time:
                self.value[-1] = value
            else:
                self.start.append(time)
                self.value.append(value)


@dataclass(slots=True)
class Interface:
    """Place where two bars may meet, a bar and the wall, or the outer end of a bar.

    Attributes:
        compliance: 1/Z of the bar before and of the bar behind [s/kg]; 0 for what does not move.
        incoming: A of the bar before and B of the bar behind; None: there is none.
        outgoing: B of the bar before and A of the bar behind.
        gap: Distance at `time` [m]; inf: nothing to meet.
        glued: Whether it also pulls (a clamped end).
        time: Of the last event [s].
        arrived: A and B of now [m/s].
        force: F of now [N].
        record: Of each event: time, gap, its rate afterwards, force afterwards.
    """

    compliance: tuple[float, float]
    incoming: tuple[Wave | None, Wave | None]
    outgoing: tuple[Wave | None, Wave | None]
    gap: float
    glued: bool = False
    time: float = 0.0
    arrived: list[float] = field(default_factory=lambda: [0.0, 0.0])
    force: float = 0.0
    rate: float = 0.0
    record: list[tuple[float, float, float, float]] = field(default_factory=list)
    _next: list[int] = field(default_factory=lambda: [0, 0])

    def upcoming(self) -> tuple[float, float]:
        """Time of the next arriving jump, and of the next closing."""
        closing = self.time - self.gap / self.rate if self.rate < 0.0 else math.inf
        return min(self._arrival(0), self._arrival(1)), closing

    def _arrival(self, side: int) -> float:
        wave, k = self.incoming[side], self._next[side]
        if wave is None or k >= len(wave.start):
            return math.inf
        return wave.start[k] + wave.transit

    def advance(self, until: float, snap: float, step: float) -> None:
        """Work off all events before a time."""
        while True:
            jump, closing = self.upcoming()
            now = min(jump, closing)
            if now >= until:
                return
            for side, wave in enumerate(self.incoming):
                while wave is not None and self._arrival(side) <= now + snap:
                    self.arrived[side] = wave.value[self._next[side]]
                    self._next[side] += 1
            moved = self.gap + self.rate * (now - self.time) if self.rate else self.gap
            self.gap = 0.0 if closing <= now + snap else max(0.0, moved)
            self.time = now
            self._answer(step)

    def _answer(self, step: float) -> None:
        """Send back what belongs to the waves of now."""
        towards, away = self.arrived
        pressed = towards - away
        closed = self.glued or (self.gap == 0.0 and pressed > step)
        self.force = pressed / sum(self.compliance) if closed else 0.0
        self.rate = 0.0 if closed or (self.gap == 0.0 and pressed >= -step) else -pressed
        if self.gap == math.inf:
            self.rate = 0.0
        signs = (-2.0, 2.0)
        for side, wave in enumerate(self.outgoing):
            if wave is not None:
                answer = signs[side] * self.force * self.compliance[side]
                wave.send(self.time, self.arrived[side] + answer, step)
        self.record.append((self.time, self.gap, self.rate, self.force))


def follow(interfaces: list[Interface], waves: list[Wave], duration: float) -> None:
    """Follow all waves until a time; waves and records of interfaces are filled.

    Raises:
        TooManyWavesError: There are too many of them.
    """
    shortest = min(wave.transit for wave in waves)
    snap = SNAP * shortest + 8.0 * _EPS * duration
    step = _STEP * max(max(map(abs, wave.value)) for wave in waves)
    while True:
        first = min(min(interface.upcoming()) for interface in interfaces)
        if first > duration:
            return
        # What is sent from now on arrives a transit later.
        until = first + 0.5 * shortest
        for interface in interfaces:
            interface.advance(until, snap, step)
        if (count := sum(len(wave.start) for wave in waves)) > _MAX_PIECES:
            raise TooManyWavesError(
                f"duration = {duration:g} s: after {first:g} s there are {count} waves, more than "
                'are followed; give a shorter duration, or method = "conserving"'
            )


@dataclass(frozen=True, slots=True)
class Pieces:
    """A function of time that is constant between breakpoints, with its integrals.

    Attributes:
        start: (n,) breakpoints [s].
        value: (n,) value from each on.
        once, twice, square: (n,) integral, that of the integral, and that of the square up to
            each breakpoint.
    """

    start: Array
    value: Array
    once: Array
    twice: Array
    square: Array

    @classmethod
    def of(cls, start: "list[float] | Array", value: "list[float] | Array") -> "Pieces":
        """Function with values from breakpoints on."""
        t, f = np.asarray(start, dtype=np.float64), np.asarray(value, dtype=np.float64)
        width = np.diff(t)
        once = np.r_[0.0, np.cumsum(f[:-1] * width)]
        twice = np.r_[0.0, np.cumsum((once[:-1] + 0.5 * f[:-1] * width) * width)]
        return cls(t, f, once, twice, np.r_[0.0, np.cumsum(f[:-1] ** 2 * width)])

    def _at(self, t: Array) -> tuple[NDArray[np.intp], Array]:
        i = np.clip(np.searchsorted(self.start, t, side="right") - 1, 0, None)
        return i, t - self.start[i]

    def __call__(self, t: Array) -> Array:
        """Value just after t."""
        return np.asarray(self.value[self._at(t)[0]])

    def before(self, t: Array, near: float) -> Array:
        """Value just before t."""
        return self(t - near)

    def integral(self, t: Array) -> Array:
        """Integral up to t."""
        i, dt = self._at(t)
        return np.asarray(self.once[i] + self.value[i] * dt)

    def second_integral(self, t: Array) -> Array:
        """Integral of the integral up to t."""
        i, dt = self._at(t)
        return np.asarray(self.twice[i] + (self.once[i] + 0.5 * self.value[i] * dt) * dt)

    def square_integral(self, t: Array) -> Array:
        """Integral of the square up to t."""
        i, dt = self._at(t)
        return np.asarray(self.square[i] + self.value[i] ** 2 * dt)
