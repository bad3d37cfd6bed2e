"""The moving picture of a rod or a beam: its axis, where the run has it."""

from typing import Any, cast

import numpy as np

from impactfem.report.page.motion_data import factors_of, packed, telling_frames
from impactfem.report.page.motion_obstacles import plane_obstacles
from impactfem.result import Record
from impactfem.scene import Beam, Rod

_FRAMES = 240
_NODES = 65  # of a line


def poles_motion(result: Record) -> dict[str, Any] | None:
    """Data of a rod or a beam.

    Returns:
        None if the result has no fields, or no moment of it is finite.
    """
    if result.fields is None:
        return None
    body = result.scene.bodies[0]
    places = result.fields.places(body.name)[:, :, :2]
    count = places.shape[1]
    nodes = np.unique(np.linspace(0, count - 1, min(count, _NODES)).round().astype(np.int64))
    places = places[:, nodes]
    way = places - places[0]
    finite = np.flatnonzero(np.isfinite(way).all(axis=(1, 2)))
    if not len(finite):
        return None
    kept = result.fields.times[finite]
    frames = telling_frames(result, kept, _FRAMES)
    times, shown = kept[frames], way[finite[frames]]
    length = cast("Rod | Beam", body).length
    factors = factors_of(float(np.linalg.norm(shown, axis=2).max()), length)
    thickness = 2.0 * body.radius if isinstance(body, Rod) else cast("Beam", body).height
    return {
        "kind": "points",
        "dim": 2,
        "caption": _caption(isinstance(body, Rod), factors),
        "times": times,
        "names": [body.name],
        "reference": packed(places[0]),
        "displacement": packed(shown),
        "thickness": thickness,
        "round": isinstance(body, Rod),
        "obstacles": plane_obstacles(result.scene.obstacles, times),
        "factors": factors,
        "factor": factors[-1],
    }


def _caption(is_rod: bool, factors: list[float]) -> str:
    text = "The rod" if is_rod else "The beam, whose axis touches,"
    text += " and where it was at first (grey)"
    if len(factors) > 1:
        text += (
            f"; its way is magnified {factors[-1]:g} times at first, the obstacle is not moved: it "
            "may seem to enter it"
        )
    return text + "."
