"""The weight theta of the forces at the end of a layer, for which its energy is as it should be.

With R = lambda_a . gap_b + lambda_b . gap_a + delta . D delta and the works p_j > 0, q_j <= 0 of
friction that would give energy (see `impactfem.contact.layer_law`) the gain of a layer is

    G(theta) = lambda_a . gap_b + delta . D delta / 2 - theta R + sum of max(0, w_j(theta)),
    w_j(theta) = (1 - theta) p_j + theta q_j,

convex, piecewise linear and falling. Where no w_j is positive its root is

    1/2 + (lambda_a . gap_b - lambda_b . gap_a) / (2 R).
"""

from collections.abc import Callable

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError

EXACT = 1e-14
"""Error of the energy that theta leaves, as a share of the contact energy."""

_NARROW = 1e-15
_MAX_THETA = 80  # evaluations; bisection alone needs 50


def balanced(
    released: float, pressed: float, strained: float, early: Floats, late: Floats
) -> tuple[float, float]:
    """The theta with G = 0, and the steepest slope of G.

    Args:
        released: lambda_a . gap_b [J], >= 0.
        pressed: lambda_b . gap_a [J], >= 0.
        strained: delta . D delta [J], >= 0.
        early: The p_j > 0 [J].
        late: Their q_j <= 0 [J].
    """
    room = released + pressed + strained
    if not len(early):
        theta = 0.5 + 0.5 * (released - pressed) / room if room > 0.0 else 0.5
        return min(max(theta, 0.0), 1.0), max(room, 0.0)
    slope = room + float((early - late).sum())
    theta = 0.0
    # Newton's steps from the left of a convex function: each drops a pair, or is the last one.
    for _ in range(len(early) + 1):
        acting = (1.0 - theta) * early + theta * late > 0.0
        top = released + 0.5 * strained + float(early[acting].sum())
        steep = room + float((early - late)[acting].sum())
        following = top / steep if steep > 0.0 else theta
        if following <= theta:
            break
        theta = following
    return min(max(theta, 0.0), 1.0), slope


def fixed_point(
    end: Callable[[float], tuple[Floats, Floats]],
    excess: Callable[[float, Floats, Floats], tuple[float, bool]],
    theta: float,
    new: Floats,
    place: Floats,
) -> tuple[float, Floats, Floats]:
    """Find theta in [0, 1] without excess, by secants kept inside a bracket.

    Where there is more than one answer, as with much friction, the excess may jump past 0: of both
    sides of the jump that is taken which gives no energy.

    Args:
        end: Forces and places at the end of the layer, by theta.
        excess: What theta should be more, by it and these, and whether energy hardly depends on it.
        theta: To begin with.
        new: Forces for it [N].
        place: Places for it [m].

    Raises:
        ConvergenceError: It was not found.
    """
    low, high = 0.0, 1.0  # the wanted theta lies in [0, 1]: the excess is >= 0 at 0, <= 0 at 1
    more, exact = excess(theta, new, place)
    following = theta + more
    taking = theta, new, place  # the last that gives no energy
    for _ in range(_MAX_THETA):
        if more <= 0.0:
            taking = theta, new, place
        if exact or more == 0.0:
            return theta, new, place
        if high - low <= _NARROW:
            return taking if taking[0] == high else (theta, new, place)
        low, high = (theta, high) if more > 0.0 else (low, theta)
        if not low < following < high:
            following = 0.5 * (low + high)
        last, last_more = theta, more
        theta = following
        new, place = end(theta)
        more, exact = excess(theta, new, place)
        slope = (more - last_more) / (theta - last) if theta != last else 0.0
        following = theta - more / slope if slope != 0.0 else 0.5 * (low + high)
    raise ConvergenceError(
        f"contact: the weight theta of a time step was not found (excess {more:.1e} after "
        f"{_MAX_THETA} evaluations); use a smaller solve.dt or solve.courant"
    )
