"""Phase portraits: velocity against position, with impacts as the jumps they are."""

from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.result import Record
from impactfem.scene.jets import motion_at
from impactfem.system.points import contact_pairs

_SMEARED = 1.5  # rows about an impact in which a scheme with steps means velocities over it


def phase_curve(result: Record) -> tuple[Floats, Floats, Floats]:
    """Times [s], positions [m] and velocities [m/s] of one point on a line, each of shape (n,).

    Rows of the history, and between them the states just before and just after each impact: at the
    place of the obstacle, with the normal velocities that the run has noted.
    """
    (body,), history = result.scene.bodies, result.rows
    times, x, v = (history[n].values for n in ("time", f"{body.name}.x", f"{body.name}.vx"))
    impacts = result.impacts
    if impacts is None or not len(impacts):
        return times, x, v
    place, speed = np.empty(len(impacts)), np.empty((len(impacts), 2))
    obstacles: tuple[Any, ...] = result.scene.rigid_obstacles
    walls = {o.name: o for o in obstacles if o.plane_normal is not None}
    for k, (pair, _) in enumerate(contact_pairs(result.scene)):
        own, wall = impacts.constraint == k, walls[pair[1]]
        at, normal = impacts.time[own], wall.unit_normal[0]
        moved = motion_at(wall.motion[0], at) if wall.motion else None
        place[own] = wall.point[0] + normal * getattr(body, "radius", 0.0)
        place[own] += moved.value if moved else 0.0
        for side, relative in enumerate((impacts.before[own], impacts.after[own])):
            speed[own, side] = normal * relative + (moved.rate if moved else 0.0)
    kept = np.ones(len(times), dtype=np.bool_)
    if "sticking" not in result.summary["details"]:
        near = np.searchsorted(impacts.time, times)
        sides = (np.clip(near - shift, 0, len(impacts) - 1) for shift in (0, 1))
        apart = np.min([np.abs(times - impacts.time[side]) for side in sides], axis=0)
        kept = apart > _SMEARED * (times[1] - times[0])
    where = np.repeat(np.searchsorted(times[kept], impacts.time, side="left"), 2)
    return (
        np.insert(times[kept], where, np.repeat(impacts.time, 2)),
        np.insert(x[kept], where, np.repeat(place, 2)),
        np.insert(v[kept], where, speed.ravel()),
    )
