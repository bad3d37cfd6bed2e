"""Spectra of columns of a history: amplitudes by FFT, and the shock response spectrum."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.result.table import Table
from impactfem.scene.nearest import meant
from impactfem.scene.values import show

_EVEN = 1e-6  # share by which times of equal steps differ
_LEAST = 8  # rows
_PEAKS = 72  # values in a period of an oscillator: peaks in between are missed by 1e-3
_PER_OCTAVE = 12
_SAMPLES = 10  # rows in a period up to which a shock response is told
_MOST = 50_000_000  # values of an oscillator's answers that are looked at


@dataclass(frozen=True)
class Spectrum:
    """What a column holds of each frequency.

    Attributes:
        column: Its name.
        unit: Its unit, which is that of all values.
        step: Time between the samples [s].
        resampled: Whether rows at unequal times were brought to equal ones, linearly.
        frequencies: [Hz], (n,), from 0 on.
        amplitudes: Of the sines that add up to the column, (n,); at 0 its mean.
        q: Of the oscillators.
        shock_frequencies: Natural ones of the oscillators [Hz], (m,).
        highest, lowest: Largest absolute acceleration of the oscillators during and after the
            record, (m,); `lowest` is <= 0. Empty of columns that are no accelerations.
        modes: Natural frequencies of a body [Hz], to compare with.
        mode_body: Its name.
    """

    column: str
    unit: str
    step: float
    resampled: bool
    frequencies: Floats
    amplitudes: Floats
    q: float = 10.0
    shock_frequencies: Floats = field(default_factory=lambda: np.zeros(0))
    highest: Floats = field(default_factory=lambda: np.zeros(0))
    lowest: Floats = field(default_factory=lambda: np.zeros(0))
    modes: Floats = field(default_factory=lambda: np.zeros(0))
    mode_body: str = ""

    @property
    def shock(self) -> Floats:
        """Shock response spectrum, maximax: the larger amount of both, (m,)."""
        found: Floats = np.maximum(self.highest, -self.lowest)
        return found

    def figures(self) -> Mapping[str, Any]:
        """Figures for ``summary.json``."""
        top = 1 + int(np.argmax(self.amplitudes[1:]))
        found: dict[str, Any] = {
            "column": self.column, "unit": self.unit, "step": self.step,
            "resampled": self.resampled,
            "fft": {"peak": float(self.amplitudes[top]),
                    "peak_frequency": float(self.frequencies[top]),
                    "resolution": float(self.frequencies[1])},
        }  # fmt: skip
        if len(self.shock):
            most = int(np.argmax(self.shock))
            found["srs"] = {"q": self.q, "peak": float(self.shock[most]),
                            "peak_frequency": float(self.shock_frequencies[most])}  # fmt: skip
        if self.mode_body:
            found["modes"] = {"body": self.mode_body, "frequencies": self.modes.tolist()}
        return found


def spectrum(history: Table, column: str, q: float | None = None) -> Spectrum:
    """Amplitudes of a column, and its shock response spectrum if it is an acceleration.

    Args:
        history: One row per time step.
        column: Its name.
        q: Quality factor of the oscillators, 1 / (2 damping ratio); 10 if None.

    Raises:
        SceneError: There is no such column, or it has no spectrum.
    """
    values, times, unit = _column(history, column)
    if q is not None and not (math.isfinite(q) and q > 0.5):
        raise SceneError(f"spectrum: q = {q:g} must be a number > 0.5; 10 is usual")
    is_acceleration = unit == "m/s^2"
    if q is not None and not is_acceleration:
        raise SceneError(
            f"spectrum: column {show(column)} is in {unit}, but the shock response spectrum is one "
            'of accelerations: give a column such as NAME.ax (quantities = ["acceleration"])'
        )
    steps = np.diff(times)
    resampled = bool(np.ptp(steps) > _EVEN * steps.max())
    step = float(steps.mean())
    if resampled:
        even = np.arange(times[0], times[-1], float(np.median(steps)))
        values, step = np.interp(even, times, values), float(np.median(steps))
    if is_acceleration:  # row 0 repeats row 1, which has the mean of the first step
        values = values[1:]
    count = len(values)
    amplitudes = np.abs(np.fft.rfft(values)) / count
    amplitudes[1 : (count + 1) // 2] *= 2.0  # both signs of a frequency, but for the highest one
    parts = np.zeros((3, 0))
    if is_acceleration:
        parts = _shocks(values, step, q or 10.0)
    return Spectrum(
        column, unit, step, resampled, np.fft.rfftfreq(count, step), amplitudes, q or 10.0, *parts
    )


def _column(history: Table, column: str) -> tuple[Floats, Floats, str]:
    """Values, times and unit of a column."""
    if column not in history.data_vars:
        text = f"spectrum: the history has no column {show(column)}; "
        raise SceneError(text + meant(column, history.data_vars))
    series, times = history[column], history["time"].values
    values = np.asarray(series.values, dtype=np.float64)
    if len(values) < _LEAST:
        raise SceneError(f"spectrum: {len(values)} rows are too few: run longer, or smaller steps")
    if not np.isfinite(values).all():
        raise SceneError(
            f"spectrum: {show(column)} holds rows without a number (what is not known there): give "
            "a column that is known all the time"
        )
    return values, np.asarray(times, dtype=np.float64), str(series.attrs.get("units", "1"))


def _shocks(values: Floats, step: float, q: float) -> Floats:
    """Frequencies [Hz], highest and lowest answers of the oscillators, (3, m)."""
    low, high = 1.0 / (len(values) * step), 1.0 / (_SAMPLES * step)
    count = 1 + max(1, math.ceil(_PER_OCTAVE * math.log2(max(high / low, 2.0))))
    frequencies = np.geomspace(low, max(high, 2.0 * low), count)
    return np.array([frequencies, *shock_response(values, step, frequencies, q).T])


def shock_response(values: Floats, step: float, frequencies: Floats, q: float = 10.0) -> Floats:
    """Largest absolute accelerations, of each sign, of oscillators on a base that is accelerated.

    The base is accelerated linearly between the samples, from 0 one step before the first, and is
    not accelerated after the last; oscillators are at rest before. Their answer at the samples is
    then exact: the ramp invariant recursion of D. O. Smallwood, Shock and Vibration Bulletin 51
    (1981) part 1, 279-287. Samples are added until a period has 72, so that peaks in between are
    missed by a thousandth at most.

    Args:
        values: Acceleration of the base, (samples,).
        step: Time between samples [s].
        frequencies: Natural ones of the oscillators [Hz], (m,).
        q: Their quality factor, > 1/2.

    Returns:
        Highest (>= 0) and lowest (<= 0), (m, 2).
    """
    from scipy.signal import lfilter  # noqa: PLC0415  (slow to load)

    found = np.zeros((len(frequencies), 2))
    base = np.concatenate([[0.0], values])
    at = np.arange(len(base), dtype=np.float64)
    damping = 0.5 / q
    root = math.sqrt(1.0 - damping**2)
    for row, frequency in enumerate(np.asarray(frequencies, dtype=np.float64)):
        parts = math.ceil(_PEAKS * frequency * step)
        parts = max(1, min(parts, _MOST // len(base)))
        given = base
        if parts > 1:
            given = np.interp(np.arange((len(base) - 1) * parts + 1) / parts, at, base)
        h = step / parts
        a = 2.0 * math.pi * frequency * h
        e, k = math.exp(-damping * a), root * a
        c, s = e * math.cos(k), e * math.sin(k) / k
        # One period of free vibration after the record: later peaks are smaller.
        after = math.ceil(1.0 / (frequency * h)) + 1
        given = np.concatenate([given, np.zeros(after)])
        answer = lfilter([1.0 - s, 2.0 * (s - c), e * e - s], [1.0, -2.0 * c, e * e], given)
        found[row] = max(0.0, answer.max()), min(0.0, answer.min())
    return found
