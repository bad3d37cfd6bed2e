"""Accelerations of probes, as means over the steps of a run, and as filters let them pass."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene import Probe
from impactfem.scene.probes import FILTERS
from impactfem.scene.values import show

type Probed = dict[str, dict[str, Floats]]
"""Columns of each probe by their last part, (rows,) each."""

_SAMPLES = 10.0  # least number of samples in 1 / class: SAE J211-1, ISO 6487
_CORNER = 2.0775  # of the two-pole filter whose two passes make a class, SAE J211-1 appendix C
_TAIL = 0.05  # of 1 / class at the end of a record, whose mean goes on
_EVEN = 1e-6  # share by which steps of one length differ


def longest_row(probe: Probe) -> float:
    """Longest time between rows of the history that its filter allows [s]."""
    return 1.0 / (_SAMPLES * FILTERS[probe.filter]) if probe.filter else math.inf


def check_sampling(probes: Sequence[Probe], step: float) -> None:
    """Refuse filters that ask for shorter steps.

    Args:
        probes: Of the scene.
        step: Longest time between rows of the history [s].

    Raises:
        SceneError: The standard's ten samples in 1 / class are missing.
    """
    for index, probe in enumerate(probes):
        longest = longest_row(probe)
        if step > longest * (1.0 + _EVEN):
            raise SceneError(
                f"probe[{index}].filter = {show(probe.filter)} takes a row every {longest:.4g} s "
                f"or sooner (SAE J211: ten in 1 / class), but the history has one every "
                f"{step:.4g} s; give solve.dt = {longest:.4g} or less, or a lower class"
            )


def accelerated(
    probes: Sequence[Probe], times: Floats, told: Mapping[str, Mapping[str, Floats]]
) -> Probed:
    """Columns of probes with the accelerations asked for, and without velocities that are not.

    Args:
        probes: Of the scene; others are left as they are.
        times: Of the rows [s], (rows,).
        told: What was `Probe.watched`.

    Raises:
        SceneError: A filter asks for shorter steps.
    """
    found = {name: dict(columns) for name, columns in told.items()}
    if len(times) > 1:
        check_sampling(probes, float(np.diff(times).max()))
    for probe in probes:
        if "acceleration" not in probe.quantities:
            continue
        own = found[probe.name]
        for axis in "xyz":
            velocity = own.get(f"v{axis}")
            if velocity is None:
                continue
            if "velocity" not in probe.quantities:
                del own[f"v{axis}"]
            own[f"a{axis}"] = acceleration(times, velocity, probe.filter)
    return found


def acceleration(times: Floats, velocity: Floats, passed: str | None = None) -> Floats:
    """Mean acceleration in each step [m/s^2], (rows,); row 0 has that of row 1.

    Its integral is the change of velocity, whatever the lengths of steps: what an impact changes at
    once lies in one row, as high as that step is short. Through a filter it does not depend on that
    any more.

    Args:
        times: [s], (rows,), increasing.
        velocity: [m/s], (rows,).
        passed: Class of the filter; None for none.
    """
    if len(times) < 2:
        return np.zeros(len(times))
    steps = np.diff(times)
    if passed is None:
        rates = np.diff(velocity) / steps
        return np.concatenate([rates[:1], rates])
    if np.ptp(steps) <= _EVEN * steps.max():
        rates = np.diff(velocity) / steps
        filtered = cfc(rates, float(steps.mean()), FILTERS[passed])
        return np.concatenate([filtered[:1], filtered])
    # Means over equal samples keep the integral; ten times as many as the standard asks for.
    whole = float(times[-1] - times[0])
    count = math.ceil(whole / min(float(np.median(steps)), 0.1 / (_SAMPLES * FILTERS[passed])))
    even = np.linspace(times[0], times[-1], count + 1)
    rates = np.diff(np.interp(even, times, velocity)) * count / whole
    filtered = cfc(rates, whole / count, FILTERS[passed])
    return np.interp(times, 0.5 * (even[1:] + even[:-1]), filtered)


def cfc(values: Floats, step: float, number: float) -> Floats:
    """Pass samples through a channel frequency class of SAE J211-1.

    A Butterworth filter of two poles at 2.0775 times the class, forwards and backwards: no shift of
    phase, four poles in all. Before its first sample a record is as there: bodies come in flight or
    from rest. It goes on as the mean of its last twentieth of 1 / class: a last sample alone may be
    noise. What follows is not known: the last half of 1 / class is as good as that guess.

    Args:
        values: (samples,).
        step: Time between samples [s].
        number: Of the class [Hz].
    """
    from scipy.signal import butter, filtfilt  # noqa: PLC0415  (slow to load)

    corner = 2.0 * _CORNER * number * step
    if corner >= 1.0 or len(values) < 2:
        return values
    over = math.ceil(2.0 / (number * step))
    last = values[-max(1, round(_TAIL / (number * step))) :].mean()
    continued = np.concatenate([np.full(over, values[0]), values, np.full(over, last)])
    filtered: Floats = filtfilt(*butter(2, corner), continued, padtype=None)[over:-over]
    return filtered
