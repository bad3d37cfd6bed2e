"""Find impacts in which several constraints take part: there the model itself may be ill-posed."""

import math
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.impact_law import delassus
from impactfem.result.trajectory import Trajectory
from impactfem.system.generalized import GeneralizedSystem
from impactfem.system.joined import Room

_COUPLED = 1e-9  # of |W_ij| / sqrt(W_ii W_jj) below which two constraints do not feel each other
_CLOSED = 1e-9  # share of the largest gap
_LOOKED_AT = 10_000  # impacts of each kind that are examined


@dataclass(frozen=True)
class Together:
    """Impacts of coupled constraints within the resolution.

    Attributes:
        count: How many, of those looked at.
        time: Time of the first [s].
        constraints: Its two constraints.
        angle: Angle between them in the metric of M [rad].
        resolution: Times closer than this count as one [s].
    """

    count: int
    time: float
    constraints: tuple[int, int]
    angle: float
    resolution: float

    def text(self, labels: tuple[str, ...] | None = None) -> str:
        """What happened and what it means, as a warning."""
        i, j = self.constraints
        names = f"{labels[i]}, {labels[j]}" if labels else f"{i} and {j}"
        parts = math.pi / self.angle
        whole = abs(parts - round(parts)) < 1e-6 * parts
        angle = f"{math.degrees(self.angle):.4g} degrees"
        meaning = (
            f"at {angle} = pi/{round(parts)} lossless two-body impacts give one outcome in any "
            "order, the simultaneous law another, and with losses the law decides"
            if whole
            else f"at {angle}, no part pi/n, the motion after it depends on which comes first and "
            "jumps with the start"
        )
        return (
            f"two constraints meet within {self.resolution:.2g} s at t = {self.time:.6g} s "
            f"({names}; {self.count} such impacts): {meaning}. Vary the start a little and compare "
            "impact_law simultaneous and sequential before trusting what follows"
        )


def find_together(system: GeneralizedSystem, motion: Trajectory, within: float) -> Together | None:
    """Find impacts of different constraints that are coupled by M and closer than a resolution.

    An impact on a constraint while another one is in lasting contact counts too.

    Args:
        system: The system.
        motion: Its motion, with impacts.
        within: The resolution [s].

    Returns:
        The first, and their number; None if there is none, or impacts are not known.
    """
    impacts = motion.impacts
    if impacts is None or not len(impacts):
        return None
    time, which = impacts.time, impacts.constraint
    least = _least_speed(system, motion)
    strikes = -impacts.before > least
    near = (np.diff(time) <= within) & (which[1:] != which[:-1])
    near &= strikes[1:] | strikes[:-1]  # else both just rest
    pairs = [(float(time[k]), int(which[k]), int(which[k + 1])) for k in np.flatnonzero(near)]
    pairs = pairs[:_LOOKED_AT] + _onto_lasting(motion, least)
    found, first = 0, None
    for when, i, j in sorted(pairs):
        row = int(np.clip(np.searchsorted(motion.times, when), 0, len(motion.times) - 1))
        angle = _angle(system, motion.position[row], i, j)
        if angle is not None:
            found += 1
            first = first or (when, (i, j), angle)
    return None if first is None else Together(found, *first, within)


def _least_speed(system: GeneralizedSystem, motion: Trajectory) -> float:
    """Normal speed below which nothing strikes [m/s], also where nothing moves.

    There it is measured by the speed that contacts take from what rests on them in a row.
    """
    u = motion.position[0]
    room = Room.at(system, u)
    matrix, _ = delassus(room.factor, room.rows(system.jacobian(u)))
    held = float((np.abs(motion.impulse).max(axis=0) * np.diag(matrix)).max(initial=0.0))
    slow = float(np.abs(motion.position).max()) / float(motion.times[-1])
    return _CLOSED * max(slow, held, float(np.abs(motion.velocity).max()))


def _onto_lasting(motion: Trajectory, least: float) -> list[tuple[float, int, int]]:
    """Impacts (time, constraint, other) while the other is closed before and after."""
    impacts = motion.impacts
    if impacts is None:
        return []
    rows = np.clip(np.searchsorted(motion.times, impacts.time), 2, len(motion.times) - 1)
    shut = np.abs(motion.gap) <= _CLOSED * np.abs(motion.gap).max(axis=0, initial=1e-300)
    lasting = shut[rows] & shut[rows - 1] & (motion.impulse[rows - 1] > 0.0)
    lasting[np.arange(len(rows)), impacts.constraint] = False
    lasting[-impacts.before <= least] = False
    hits = np.argwhere(lasting)[:_LOOKED_AT]
    return [(float(impacts.time[k]), int(impacts.constraint[k]), int(j)) for k, j in hits]


def _angle(system: GeneralizedSystem, u: Floats, i: int, j: int) -> float | None:
    """Angle of the corner of two constraints in the metric of M; None if they are not coupled."""
    room = Room.at(system, u)
    matrix, _ = delassus(room.factor, room.rows(system.jacobian(u)[[i, j]]))
    size = math.sqrt(matrix[0, 0] * matrix[1, 1])
    if size == 0.0 or abs(matrix[0, 1]) <= _COUPLED * size:
        return None
    angle = math.acos(min(1.0, max(-1.0, -matrix[0, 1] / size)))
    return angle if angle > 1e-6 else None  # one constraint written twice
