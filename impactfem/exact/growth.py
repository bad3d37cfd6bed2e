"""How far contacts make a small error of a bar's motion grow.

Between contacts an error of the waves runs to and fro with them and keeps its size. An impact
turns an error d of the gap into one of its time, -d / w, after which the leaving wave is off by
-2 w for that long: an error of the wave at one place, with the integral -2 d. It is back at the
wall after each 2 L/c. In flight it then adds its integral to the gap, in contact it changes sign.
So the errors of gaps at impacts follow from those at impacts before, whatever the waves are: from
contact to contact of the bounces of Doyen, Ern and Piperno they grow by exactly 5.
"""

from collections.abc import Sequence

import numpy as np

from impactfem.exact.pieces import Array

_SNAP = 1e-9  # share of 2 L/c within which times are one
_ENOUGH = 1e20  # nothing is left of a motion long before


def growth(contacts: Sequence[tuple[float, float]], *, transit_time: float, clamped: bool) -> float:
    """Largest error of a displacement for an error 1 of the gap at the first impact.

    Errors that are at the wall just when a contact begins or ends count as in contact.

    Args:
        contacts: (t_in, t_out) of each contact [s].
        transit_time: L/c [s].
        clamped: whether the far end is held: it sends errors back with the other sign.
    """
    period, turn = 2.0 * transit_time, -1.0 if clamped else 1.0
    near = _SNAP * period
    phase, error = np.empty(0), np.empty(0)  # places in the period, integrals when next at the wall

    def passages(places: Array, begin: float, end: float) -> Array:
        return np.ceil((end - places) / period) - np.ceil((begin - places) / period)

    gap, largest, free_since = 1.0, 1.0, 0.0
    for begin, end in contacts:
        flown = passages(phase, free_since, begin - near)
        gap += float(error @ (flown if turn > 0 else flown % 2))
        error = error * turn**flown
        largest = max(largest, abs(gap))
        if largest > _ENOUGH:
            break
        error = error * (-turn) ** passages(phase, begin - near, end + near)
        here = np.array([begin % period])
        sent = -2.0 * gap * turn * (-turn) ** passages(here, begin + near, end + near)
        apart = np.abs(phase - here)
        same = np.minimum(apart, period - apart) < near
        if same.any():
            error[np.argmax(same)] += sent[0]
        else:
            phase, error = np.append(phase, here), np.append(error, sent)
        # Passing a point of the bar, an error of the wave moves it by half of its integral.
        largest = max(largest, 0.5 * float(np.abs(error).max()))
        gap, free_since = 0.0, end + near
    return largest
