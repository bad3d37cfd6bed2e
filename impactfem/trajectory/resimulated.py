"""What really follows from controls of a scene, by `event_driven`, which knows no search."""

from collections.abc import Sequence

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError, SceneError
from impactfem.trajectory.bodies import Symbolic
from impactfem.trajectory.contacts import Closing, system_of
from impactfem.trajectory.transcribing import Transcribed
from impactfem.vibro.event_driven import EventSettings, follow
from impactfem.vibro.event_record import Record

_RTOL = 1e-11


def by_events(
    known: Symbolic, gaps: Sequence[Closing], found: Transcribed, pieces: int
) -> tuple[Floats, Floats]:
    """States (k, n) at times (k,), so many in each interval; NaN where they cannot be told.

    Args:
        known: The bodies.
        gaps: What they strike.
        found: The motion, whose start and controls are taken.
        pieces: Of an interval.
    """
    times, record = recorded(known, gaps, found, pieces)
    if record is None:
        return times, np.full((len(times), found.at_nodes.shape[1]), np.nan)
    return times, np.concatenate([record.position, record.velocity], axis=1)


def recorded(
    known: Symbolic, gaps: Sequence[Closing], found: Transcribed, pieces: int
) -> tuple[Floats, Record | None]:
    """The same as times (k,) and what the run leaves; None: it cannot be told."""
    nodes, count = found.times, len(known.tree.freedoms)
    fine = np.linspace(nodes[:-1], nodes[1:], pieces, endpoint=False, axis=1)
    times = np.append(fine.ravel(), nodes[-1])
    m = known.controls.numel()
    system = system_of(known, gaps, lambda t: found.control(t)[0, :m])
    settings = EventSettings(times=tuple(times.tolist()), rtol=_RTOL, atol=1e-2 * _RTOL)
    start = found.at_nodes[0]
    try:
        record, _ = follow(
            system, start[:count], start[count:], float(nodes[-1]), settings, [], nodes.tolist()
        )
    except (ConvergenceError, SceneError):
        return times, None
    return times, record
