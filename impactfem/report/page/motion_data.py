"""What moving pictures have in common: the choice of their frames, and numbers packed into text."""

import base64
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from impactfem.arrays import Integers
from impactfem.report.page.numbers import round_below
from impactfem.result import Record

MOST_FRAMES = 120
"""Frames of a moving picture at most."""
BUDGET = 1_000_000
"""Bytes that the packed numbers of a moving picture may take."""
INVISIBLE = 0.01
"""Share of the size below which motion is not seen at true scale."""
ROOM = 0.2
"""Share of the size that magnified motion takes."""

_KINDS = {8: np.uint8, 16: np.uint16, 32: np.uint32}


def packed(values: ArrayLike, bits: int = 16) -> dict[str, Any]:
    """Numbers as low + step * q with unsigned integers q in base64, little-endian.

    Args:
        values: Finite, any shape; order is that of C.
        bits: 8 or 16. The numbers are wrong by at most half a step, range / 2^bits / 2.
    """
    given = np.asarray(values, dtype=np.float64).ravel()
    low, high = (float(given.min()), float(given.max())) if len(given) else (0.0, 0.0)
    step = (high - low) / (2**bits - 1)
    scaled = np.rint((given - low) / step) if step > 0.0 else np.zeros(len(given))
    return {"low": low, "step": step, "bits": bits, "data": _text(scaled, bits)}


def packed_signs(values: ArrayLike, limit: float) -> dict[str, Any]:
    """Numbers in [-limit, limit] in 8 bits, 0 exactly; wrong by at most limit / 254."""
    step = limit / 127.0
    share = np.clip(np.asarray(values, dtype=np.float64).ravel() / (step or 1.0), -127.0, 127.0)
    return {"low": -limit, "step": step, "bits": 8, "data": _text(np.rint(share) + 127.0, 8)}


def packed_indices(values: ArrayLike) -> dict[str, Any]:
    """Integers from 0 on, exactly."""
    given = np.asarray(values).ravel()
    bits = 16 if not len(given) or given.max() < 2**16 else 32
    return {"low": 0, "step": 1, "bits": bits, "data": _text(given, bits)}


def _text(values: NDArray[Any], bits: int) -> str:
    kind = np.dtype(_KINDS[bits]).newbyteorder("<")
    return base64.b64encode(values.astype(kind).tobytes()).decode("ascii")


def telling_frames(result: Record, times: ArrayLike, most: int = MOST_FRAMES) -> Integers:
    """Choose frames evenly in time, up to half of them in contact, one at the largest force.

    Args:
        result: With its history.
        times: Times at which a picture can be made, increasing [s], shape (layers,).
        most: Frames at most, from 4 on.

    Returns:
        Indices into the times, increasing, with both ends.
    """
    at = np.asarray(times, dtype=np.float64)
    if len(at) <= most:
        return np.arange(len(at), dtype=np.int64)
    rows = rows_at(result, at)
    force = np.nan_to_num(result.rows["contact_force"].values, posinf=0.0)
    struck = result.rows.get("contact_impulse")
    acts = force > 0.0 if struck is None else (force > 0.0) | (struck.values > 0.0)
    touching = np.append(0, np.cumsum(acts))
    before = np.append(0, rows[:-1])
    # Whether there is contact since the picture before.
    loaded = (touching[rows + 1] > touching[before + 1]).astype(np.float64)
    weight = np.diff(at, prepend=at[0]) / (at[-1] - at[0])
    count = float(loaded.sum())
    if count:  # no more frames than there are layers in contact
        share = min(1.0, count / (most - count) if count < most else 1.0)
        weight = weight + share * loaded / count
    progress = np.cumsum(weight) / weight.sum()
    wanted = np.linspace(0.0, 1.0, most - 2)
    found = np.searchsorted(progress, wanted - 1e-12)
    peak = int(np.argmin(np.abs(rows - int(np.argmax(force)))))
    chosen = np.concatenate([found, [0, peak, len(at) - 1]])
    return np.unique(np.clip(chosen, 0, len(at) - 1)).astype(np.int64)


def rows_at(result: Record, times: ArrayLike) -> Integers:
    """Rows of the history nearest to some times."""
    levels = result.rows["time"].values
    at = np.asarray(times, dtype=np.float64)
    after = np.clip(np.searchsorted(levels, at), 1, len(levels) - 1)
    nearer = np.abs(levels[after - 1] - at) < np.abs(levels[after] - at)
    return np.asarray(after - nearer, dtype=np.int64)


def factors_of(displacement: float, size: float) -> list[float]:
    """Scales of motion to choose from: 1, and a magnification if the motion is hard to see.

    Args:
        displacement: The largest one [m].
        size: Of what moves [m].
    """
    if not 0.0 < displacement < INVISIBLE * size:
        return [1.0]
    largest = round_below(ROOM * size / displacement)
    between = float(f"{np.sqrt(largest):.1g}")
    return sorted({1.0, between, largest})
