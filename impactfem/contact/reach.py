"""How far a body and its obstacles can approach each other within the duration."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from impactfem.scene.obstacles.rotation import placement

_SAMPLES = 1001  # times at which the motion of an obstacle is looked at
_WAVES = 2.0
"""A wave that meets a free face moves it at twice the speed of the particles in the wave. Corners
may do more: the run watches the nodes that were left out."""


@dataclass(frozen=True)
class Reach:
    """An upper bound of the approach.

    Attributes:
        distance: [m], infinite where nothing can be said.
        why: What it follows from, in words.
    """

    distance: float
    why: str


def reach(
    speed: float,
    gravity_times: ArrayLike,
    gravity: ArrayLike,
    obstacles: Sequence[Any],
    duration: float,
    *,
    driven: str | None = None,
) -> Reach:
    """Bound the way by which any node of a body can approach an obstacle.

    A free body has but its initial speed, what gravity adds, and what moving obstacles throw it
    with: twice their speed.

    Args:
        speed: Largest initial speed of its points [m/s].
        gravity_times: Times from which the values hold [s], shape (values,), from 0 on.
        gravity: Values [m/s^2], shape (values, dim).
        obstacles: The obstacles, some of which may move.
        duration: [s].
        driven: What else moves the body ("supports", "tractions", "an initial displacement"), or
            None: with it there is no bound.

    Raises:
        SceneError: The motion of an obstacle is not finite.
    """
    if driven is not None:
        return Reach(np.inf, f"there is no bound of the body's displacement: it has {driven}")
    times = np.asarray(gravity_times, dtype=np.float64)
    ends = np.clip(np.append(times[1:], np.inf), 0.0, duration)
    lasting = np.maximum(ends - np.clip(times, 0.0, duration), 0.0)
    pull = np.linalg.norm(np.atleast_2d(np.asarray(gravity, dtype=np.float64)), axis=1)
    # |g| acts for `lasting`, and the speed that it gave lasts to the end.
    fall = float(np.sum(pull * lasting * (duration - ends + lasting / 2)))
    furthest = fastest = 0.0
    for obstacle in obstacles:
        if obstacle.motion is not None:
            moments = np.linspace(0.0, duration, _SAMPLES)
            way = np.array([placement(obstacle, float(t)).shift for t in moments])
            steps = np.linalg.norm(np.diff(way, axis=0), axis=1)
            furthest = max(furthest, float(np.linalg.norm(way - way[0], axis=1).max()))
            fastest = max(fastest, float(steps.max()) / float(moments[1]))
    distance = _WAVES * ((speed + 2.0 * fastest) * duration + fall) + furthest
    parts = [
        text
        for value, text in (
            (speed, f"its initial speed of at most {speed:.3g} m/s"),
            (fall, "gravity"),
            (fastest, f"obstacles that move at up to {fastest:.3g} m/s"),
        )
        if value > 0
    ]
    source = " and ".join(parts) if parts else "nothing that moves it"
    return Reach(
        distance, f"within {duration:g} s both approach by {distance:.3g} m at most: {source}"
    )
