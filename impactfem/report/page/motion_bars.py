"""The moving picture of bars: strips on a line, coloured by their strain."""

from typing import Any

import numpy as np

from impactfem.report.line_panels import magnified, stacked_places
from impactfem.report.page.chart import numbers
from impactfem.report.page.motion_data import packed, packed_signs, telling_frames
from impactfem.report.panel import evenly
from impactfem.result import Fields, Record

_NODES = 400  # of all bars together
_LEAST = 12  # of each of many bars
_SHARE = 0.3  # of all lengths that motion and gaps may take when magnified
_VISIBLE = 0.05  # share of all lengths from which motion is seen as it is


def bars_motion(result: Record, fields: Fields) -> dict[str, Any] | None:
    """Data of one bar or a row of bars.

    Bars are drawn at ``base`` + factor * ``motion``: the places that they would have if all touched
    each other and the wall, plus what separates them from that. So gaps are magnified as motion is,
    and bars that touch do so in the picture.

    Returns:
        None if no frame is finite.
    """
    finite = np.flatnonzero(np.isfinite(fields.displacement).all(axis=1))
    if not len(finite):
        return None
    frames = finite[telling_frames(result, fields.times[finite])]
    counts = fields.counts or (len(fields.positions),)
    starts = np.cumsum([0, *counts])
    each = max(_LEAST, _NODES // len(counts))
    parts = [start + evenly(count, each) for start, count in zip(starts, counts, strict=False)]
    nodes = np.concatenate(parts)
    stacked = stacked_places(fields)
    place = (fields.positions + fields.displacement)[np.ix_(frames, nodes)]
    moved = place - stacked[nodes]
    shown = [len(part) for part in parts]
    first = np.setdiff1d(np.arange(len(nodes)), np.cumsum(shown) - 1)
    lengths = (fields.positions[nodes[first + 1]] - fields.positions[nodes[first]])[None]
    stretched = fields.displacement[np.ix_(frames, nodes)]
    strain = (stretched[:, first + 1] - stretched[:, first]) / lengths
    limit = float(np.abs(strain).max())
    span = float(np.ptp(moved))
    factor = magnified(fields, share=_SHARE)[1] if span < _VISIBLE * float(stacked[-1]) else 1.0
    names = [bar.name for bar in result.scene.bars]
    return {
        "kind": "bars",
        "caption": _caption(len(names), limit, factor),
        "times": fields.times[frames],
        "names": names,
        "counts": shown,
        "wall": bool(result.scene.obstacles),
        "base": numbers(stacked[nodes]),
        "motion": packed(moved),
        "value": packed_signs(strain, limit),
        "limit": limit,
        "valueName": "strain",
        "factors": sorted({1.0, factor}),
        "factor": factor,
    }


def _caption(count: int, limit: float, factor: float) -> str:
    text = "The bar along its axis" if count == 1 else "The bars along their axis"
    text += f"; red is tension, blue compression, up to a strain of {limit:.3g}"
    if factor > 1.0:
        text += (
            f"; motion and gaps are magnified {factor:g} times at first, as they would hardly be "
            "seen"
        )
    return text + "."
