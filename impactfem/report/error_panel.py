"""The error of a run over time, where an exact solution is known."""

import numpy as np

from impactfem.arrays import Floats
from impactfem.report.panel import BLUE, ORANGE, Curve, Panel, is_exact, over_time
from impactfem.result import Record

_RAMP = 1e-8  # share of the duration below which a step of samples stands for a jump
_ROUNDING = 1e-17  # relative, below which a point counts as exact
_SURE = 0.5  # share of an error up to which its reference may be uncertain


def error(result: Record) -> Panel | None:
    """Error of the gap and of the impulse so far against the exact solution, where both are known.

    Returns:
        None without an exact solution, or if the run is that solution.
    """
    if result.exact_rows is None or is_exact(result.summary):
        return None
    time = result.rows["time"].values
    at, exact_gap = result.exact_rows["time"].values, result.exact_rows["gap"].values
    wrong = np.abs(result.rows["gap"].values - np.interp(time, at, exact_gap))
    wrong[interpolation_bound(time, at, exact_gap) > _SURE * wrong] = np.nan
    force = result.rows["contact_force"].values
    impulse = np.append(0.0, np.cumsum(force[1:] * np.diff(time)))
    exact_force = result.exact_rows["contact_force"].values
    exact_impulse = _integral(at, exact_force, time)
    off = np.abs(impulse - exact_impulse)
    off[ramp_bound(time, at, exact_force) > _SURE * off] = np.nan
    found = []
    scale = float(np.abs(exact_gap).max())
    if scale > 0.0 and np.count_nonzero(wrong > 0.0) >= 0.2 * len(time):
        found.append(("gap, over the largest one", wrong / scale, BLUE))
    scale = float(np.abs(exact_impulse).max())
    if scale > 0.0:
        found.append(("impulse so far, over all of it", off / scale, ORANGE))
    curves = []
    for name, values, tint in found:
        shown = np.where(values > _ROUNDING, values, np.nan)
        if np.isfinite(shown).any():
            curves.append(Curve(name, time, shown, "", tint))
    if not curves:
        return None
    caption = (
        "Distance from the exact solution over time, relative, on a logarithmic scale: 1e-2 is one "
        "per cent, 1e-15 is rounding. Missing points are exact, or closer than the exact curve "
        "is sampled."
    )
    return over_time(
        result, "error", "Error over time", caption, curves, "relative error", log=True,
        named=True, still=False,
    )  # fmt: skip


def interpolation_bound(time: Floats, at: Floats, values: Floats) -> Floats:
    """Bound of the error of linear interpolation between samples, from their bends; shape (rows,).

    Args:
        time: Where it is interpolated [s], shape (rows,).
        at: Times of the samples [s], at least two.
        values: Samples of a curve whose kinks and bends near each sample turn one way.
    """
    steps = np.diff(at)
    slopes = np.diff(values) / steps
    turns = np.abs(np.diff(slopes))
    # A kink or a bend within an interval changes the slopes from one neighbour to the other.
    bends = 0.25 * steps * (np.append(turns, 0.0) + np.insert(turns, 0, 0.0))
    k = np.clip(np.searchsorted(at, time, side="right") - 1, 0, len(steps) - 1)
    share = np.clip((time - at[k]) / steps[k], 0.0, 1.0)
    bound: Floats = 4.0 * share * (1.0 - share) * bends[k]
    return bound


def ramp_bound(time: Floats, at: Floats, force: Floats) -> Floats:
    """Bound of the error of the impulse up to each time as jumps are sampled as ramps [N s].

    Args:
        time: Where the impulse is taken [s], shape (rows,).
        at: Times of the samples [s].
        force: Samples; a jump is one within a very short interval [N].
    """
    steps = np.diff(at)
    ramps = steps < _RAMP * (at[-1] - at[0])
    parts = np.where(ramps, 0.5 * np.abs(np.diff(force)) * steps, 0.0)
    total = np.append(0.0, np.cumsum(parts))
    bound: Floats = total[np.clip(np.searchsorted(at, time, side="right"), 0, len(at) - 1)]
    return bound


def _integral(at: Floats, values: Floats, time: Floats) -> Floats:
    """Integral up to each time of a curve that is straight between samples."""
    places = np.union1d(at, time)
    curve = np.interp(places, at, values)
    total = np.append(0.0, np.cumsum(0.5 * (curve[1:] + curve[:-1]) * np.diff(places)))
    return np.asarray(total[np.searchsorted(places, time)])
