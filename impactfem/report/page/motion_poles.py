"""The moving picture of a rod or a beam: its axis, where the run has it."""

from typing import Any

import numpy as np

from impactfem.report.page.motion_data import factors_of, packed, telling_frames
from impactfem.report.page.motion_obstacles import plane_obstacles
from impactfem.result import Record, Snapshots

_FRAMES = 240
_NODES = 65  # of a line


def poles_motion(result: Record, fields: Snapshots) -> dict[str, Any] | None:
    """Data of a rod or a beam.

    Returns:
        None if no moment of it is finite.
    """
    bodies: tuple[Any, ...] = result.scene.bodies
    (body,) = bodies
    places = fields.places(body.name)[:, :, :2]
    count = places.shape[1]
    nodes = np.unique(np.linspace(0, count - 1, min(count, _NODES)).round().astype(np.int64))
    places = places[:, nodes]
    way = places - places[0]
    finite = np.flatnonzero(np.isfinite(way).all(axis=(1, 2)))
    if not len(finite):
        return None
    kept = fields.times[finite]
    frames = telling_frames(result, kept, _FRAMES)
    times, shown = kept[frames], way[finite[frames]]
    length = float(np.linalg.norm(np.diff(places[0], axis=0), axis=1).sum())
    factors = factors_of(float(np.linalg.norm(shown, axis=2).max()), length)
    return {
        "kind": "points",
        "dim": 2,
        "caption": _caption(body.kind, body.round_ends, factors),
        "times": times,
        "names": [body.name],
        "reference": packed(places[0]),
        "displacement": packed(shown),
        "thickness": 2.0 * float(fields.layout.radius[0]),
        "round": body.round_ends,
        "obstacles": plane_obstacles(result.scene.obstacles, times),
        "factors": factors,
        "factor": factors[-1],
    }


def _caption(what: str, round_ends: bool, factors: list[float]) -> str:
    text = f"The {what}{'' if round_ends else ', whose axis touches,'}"
    text += " and where it was at first (grey)"
    if len(factors) > 1:
        text += (
            f"; its displacement is magnified {factors[-1]:g} times at first, the obstacle is not "
            "moved: it may seem to enter it"
        )
    return text + "."
