"""Wave arriving at the wall end of a bar, followed exactly through impacts and releases.

With v = u_t and s = c u_x the equation u_tt = c^2 u_xx - p(t) splits into v + s, which travels
towards the wall x = 0, and v - s, which travels away from it; along both d/dt = -p. All that
happens at the wall follows from the arriving wave w(t) = (v + s)(t, 0):

* wall free: s = 0, the gap changes by dg/dt = w and the leaving wave is w;
* contact: v = 0, lambda = c w <= 0 and the leaving wave is -w.

With l = L/c and p = 0 before t = 0 the leaving wave returns after 2 l as

* free far end: w(t) = w_out(t - 2l) - int_{t-2l}^t p;
* clamped far end: w(t) = -w_out(t - 2l) + int_{t-2l}^{t-l} p - int_{t-l}^t p;
* damper d rho A c: w(t) = r (w_out(t - 2l) - int_{t-2l}^{t-l} p) - int_{t-l}^t p, with
  r = (1 - d) / (1 + d): nothing returns from d = 1.

So w is piecewise linear and the gap piecewise quadratic in time, and impacts and releases are
roots of linear and quadratic functions. Time is counted inside windows of length 2 l: a
breakpoint then keeps its place from window to window without rounding.
"""

from dataclasses import dataclass, field
from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import SceneError
from impactfem.exact.drive import EndDrive
from impactfem.exact.pieces import Array, Line, Load

_EPS = float(np.finfo(float).eps)
SNAP = 64 * _EPS
"""Events closer than this share of a window to a breakpoint happen at it."""
_VALUE = 64 * _EPS  # waves equal to this share of the largest wave are equal
_REACH = 16 * _EPS  # penetration below this share of the largest gap is rounding
_MAX_PIECES = 5_000_000  # half a GB while they are put together


@dataclass(frozen=True, slots=True)
class Wave:
    """Arriving wave and state of the wall, piece by piece; each array has one entry per piece.

    Before t = 0 it holds the initial leaving wave, as if the wall had been free.

    Attributes:
        start: time at which the piece starts [s].
        value: w there [m/s].
        slope: dw/dt on the piece [m/s^2].
        contact: whether the bar touches the wall.
        gap: u(t, 0) at the start [m].
        impulse: int_0^start s(t, 0) dt = int lambda / c at the start [m].
    """

    start: Array
    value: Array
    slope: Array
    contact: NDArray[np.bool_]
    gap: Array
    impulse: Array

    def pieces(self, t: Array) -> tuple[NDArray[np.intp], Array]:
        """Index of the piece that holds t (right of a breakpoint) and time since its start."""
        i = np.maximum(np.searchsorted(self.start, t, side="right") - 1, 0)
        return i, t - self.start[i]

    def arriving(self, t: Array) -> tuple[Array, Array]:
        """Wave w and its antiderivative gap + impulse at times t."""
        i, dt = self.pieces(t)
        w, m = self.value[i], self.slope[i]
        return w + m * dt, self.gap[i] + self.impulse[i] + (w + 0.5 * m * dt) * dt

    def leaving(self, t: Array) -> tuple[Array, Array]:
        """Wave w_out and its antiderivative gap - impulse at times t."""
        i, dt = self.pieces(t)
        sign = np.where(self.contact[i], -1.0, 1.0)
        w, m = sign * self.value[i], sign * self.slope[i]
        return w + m * dt, self.gap[i] - self.impulse[i] + (w + 0.5 * m * dt) * dt

    def pressed(self, t: Array) -> Array:
        """Impulse int_0^t s(t, 0) dt = int lambda / c; it stands still to the bit in flight."""
        i, dt = self.pieces(t)
        part = (self.value[i] + 0.5 * self.slope[i] * dt) * dt
        return self.impulse[i] + np.where(self.contact[i], part, 0.0)


type Row = tuple[float, float, float, float, bool, float]
"""A piece of the wave at the wall: its ends, w there, whether in contact, gap at its start."""


@dataclass(slots=True)
class Wall:
    """State of the wall end while the windows pass: mode, gap, events, scales of rounding."""

    window: float
    gap: float
    contact: bool = False
    speed: float = 0.0
    reach: float = 0.0
    events: list[tuple[float, bool]] = field(default_factory=list)

    def cross(self, begin: float, w: Line) -> list[Row]:
        """Let one window of the arriving wave meet the wall.

        At most three events happen in a piece, so the loop ends.

        Args:
            begin: time at which the window begins [s].
            w: arriving wave over the window.

        Returns:
            The wave with the events of the window among its breakpoints.
        """
        self.speed = max(self.speed, *map(abs, w.left), *map(abs, w.right))
        snap = SNAP * self.window
        rows: list[Row] = []
        start, *ends = w.border
        for end, left, b in zip(ends, w.left, w.right, strict=True):
            a = left
            while start < end:
                tau, at = (self._release if self.contact else self._impact)(end - start, a, b)
                if tau <= snap:
                    # A flight or contact too short to see; the sign of w keeps it from repeating.
                    a = max(a, 0.0) if self.contact else min(a, 0.0)
                else:
                    whole = tau >= end - start - snap
                    stop, last = (end, b) if whole else (start + tau, at)
                    rows.append((start, stop, a, last, self.contact, self.gap))
                    start, a = stop, b if whole else at
                if tau == inf:
                    self._drift(rows[-1])
                else:
                    self.contact, self.gap = not self.contact, 0.0
                    self.events.append((begin + start, self.contact))
        return rows

    def _drift(self, row: Row) -> None:
        """Move on to the end of a piece without event."""
        start, end, a, b, contact, gap = row
        if not contact:
            self.gap = gap + 0.5 * (end - start) * (a + b)
            self.reach = max(self.reach, self.gap)

    def _release(self, width: float, a: float, b: float) -> tuple[float, float]:
        """Time after which w, from a to b, becomes positive (inf if not), and w then."""
        if max(a, b) <= _VALUE * self.speed:
            return inf, b
        return (0.0, a) if a >= 0.0 else (width * a / (a - b), 0.0)

    def _impact(self, width: float, a: float, b: float) -> tuple[float, float]:
        """Time after which the gap becomes negative (inf if not), and w then."""
        low = self.gap + 0.5 * width * (a + b)
        if a < 0.0 < b:
            low = self.gap - 0.5 * width * a * a / (b - a)
        if low >= -_REACH * max(self.reach, self.speed * self.window):
            return inf, b
        gap, slope = max(self.gap, 0.0), (b - a) / width
        # Roots of gap + a t + slope t^2 / 2 in the form that does not cancel.
        speed = sqrt(max(a * a - 2.0 * slope * gap, 0.0))
        return (2.0 * gap / (speed - a) if a < 0.0 else (a + speed) / -slope), -speed


def follow(
    leaving: Line, load: Load, *, gap: float, duration: float, turn: float, resolution: int,
    drive: EndDrive | None = None,
) -> tuple[Wave, list[tuple[float, bool]], float]:  # fmt: skip
    """Follow the wave at the wall until `duration`.

    Costs about 10 microseconds per window of length 2 l and 2 microseconds per breakpoint. A window
    keeps the breakpoints of the one before, less those that carry no jump any more, and each
    contact adds two. Periodic motions keep their number; irregular bouncing makes it grow
    exponentially (waves of ever smaller height touch the wall more and more often).

    Args:
        leaving: initial leaving wave w_out(t - 2l), 0 <= t <= 2l; for t < l this is the wave
            arriving at t before gravity acts, sent back through the far end.
        load: acceleration towards the wall.
        gap: u(0, 0) >= 0 [m].
        duration: end time [s].
        turn: what the far end makes of a wave: 1 free, -1 held, (1 - d) / (1 + d) with a damper d
            over rho A c.
        resolution: largest number of breakpoints kept from window to window.
        drive: of the far end; None: nothing drives it.

    Returns:
        The wave, the events as pairs (time [s], whether contact begins), and the time up to
        which no breakpoint had to be given up (inf: always).

    Raises:
        SceneError: the motion has more breakpoints than memory should hold.
    """
    length = leaving.border[-1]
    wall = Wall(length, gap, speed=max(map(abs, [*leaving.left, *leaving.right])), reach=gap)
    before = 0.5 * np.diff(leaving.border) * (np.array(leaving.left) + leaving.right)
    gaps = (gap - np.cumsum(before[::-1])[::-1]).tolist()
    ends = zip(leaving.border[:-1], leaving.border[1:], strict=True)
    waves = zip(leaving.left, leaving.right, gaps, strict=True)
    rows = [(*x, a, b, False, g) for x, (a, b, g) in zip(ends, waves, strict=True)]
    kept, exact_until, k = _Kept(), inf, 0
    kept.add(-length, rows)
    while k * length < duration * (1.0 - SNAP):
        line = leaving.merge(_VALUE * wall.speed)
        if len(line.left) > resolution:
            line, exact_until = line.coarsen(resolution), min(exact_until, k * length)
        rows = wall.cross(k * length, _arrive(line, load, k, turn, drive))
        kept.add(k * length, rows)
        leaving = Line(
            [row[0] for row in rows] + [length],
            [-row[2] if row[4] else row[2] for row in rows],
            [-row[3] if row[4] else row[3] for row in rows],
        )
        k += 1
        if len(kept.start) > _MAX_PIECES:
            raise SceneError(
                f"duration: the exact solution has over {_MAX_PIECES} breakpoints at"
                f" t = {k * length:g} s; shorten the duration or use fewer pieces"
            )
    return kept.wave(), wall.events, exact_until


@dataclass(slots=True)
class _Kept:
    """Columns of `Wave` while the windows pass, with the impulse of each piece, not their sum."""

    start: list[float] = field(default_factory=list)
    value: list[float] = field(default_factory=list)
    slope: list[float] = field(default_factory=list)
    contact: list[bool] = field(default_factory=list)
    gap: list[float] = field(default_factory=list)
    force: list[float] = field(default_factory=list)

    def add(self, begin: float, rows: list[Row]) -> None:
        """Append a window."""
        for start, end, a, b, contact, gap in rows:
            self.start.append(begin + start)
            self.value.append(a)
            self.slope.append((b - a) / (end - start))
            self.contact.append(contact)
            self.gap.append(gap)
            self.force.append(0.5 * (end - start) * (a + b) if contact else 0.0)

    def wave(self) -> Wave:
        """The wave of all windows."""
        start, value, slope = np.array(self.start), np.array(self.value), np.array(self.slope)
        impulse = np.concatenate([[0.0], np.cumsum(self.force[:-1])])
        return Wave(start, value, slope, np.array(self.contact), np.array(self.gap), impulse)


def _arrive(leaving: Line, load: Load, k: int, turn: float, drive: EndDrive | None) -> Line:
    """The wave that arrives in window k from the one that left in window k - 1."""
    length = leaving.border[-1]
    begin, half = k * length, 0.5 * length
    # Counted from the window's begin: differences of large times would cost digits.
    near = load.around(begin - length, begin + length, begin)
    driven = None if drive is None else drive.around(begin - half, begin + half, begin - half)
    shifts = (0.0, length) if turn == 1.0 else (0.0, half, length)
    cuts = [near.times[1:] + x for x in shifts] if len(near.times) > 1 else []
    cuts += [] if driven is None else [driven.times]
    # What was on its way to the wall at t = 0 meets no far end: it is kept as if 1 or -1 did.
    whole = abs(turn) == 1.0 or k > 0
    cuts += [] if whole else [np.array([half])]
    if cuts:
        leaving = leaving.split(np.concatenate(cuts), SNAP * length)
    now = np.array(leaving.border)
    if len(near.times) == 1:
        drops = np.full(len(now), near.values[0] * half * (1.0 + turn))
    elif turn == 1.0:
        drops = near.moments(now - length, np.array(length))[0]
    else:
        drops = near.moments(now - half, np.array(half))[0]
        drops = drops + turn * near.moments(now - length, np.array(half))[0]
    low, high = drops[:-1], drops[1:]
    if driven is not None:
        low, high = np.stack([low, high]) - 2.0 * driven.ends(now).T
    turns = [turn if whole or x >= half else 1.0 for x in leaving.border[:-1]]
    return Line(
        leaving.border,
        [f * w - p for f, w, p in zip(turns, leaving.left, low.tolist(), strict=True)],
        [f * w - p for f, w, p in zip(turns, leaving.right, high.tolist(), strict=True)],
    )


def intervals(
    events: list[tuple[float, bool]], duration: float, transit_time: float
) -> tuple[tuple[float, float], ...]:
    """Contacts (t_in, t_out) within [0, duration]; those that meet to rounding become one."""
    tiny = 4.0 * SNAP * transit_time + 8.0 * _EPS * duration
    spans: list[tuple[float, float]] = []
    begins = [t for t, begin in events if begin]
    ends = [t for t, begin in events if not begin]
    for start, end in zip(begins, [*ends, inf], strict=False):
        low, high = start, min(end, duration)
        if spans and low - spans[-1][1] <= tiny:
            low = spans.pop()[0]
        if low < duration:
            spans.append((low, high))
    return tuple(span for span in spans if span[1] - span[0] > tiny)
