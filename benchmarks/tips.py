"""A spring and a dashpot between a body and each of its constraints: compliant contact.

Each constraint G_j u + c_j >= 0 moves from the body to a small mass mu at q_j, tied to the body:

    mu q_j'' = -F_j + lambda_j,   F_j = k (q_j - G_j u) + c (q_j' - G_j u'),   q_j + c_j >= 0.

For mu -> 0 that is the viscoelastic contact of T. Schwager and T. Poeschel, Granular Matter 9
(2007) 465-469, which cannot pull: the tip leaves when spring and dashpot balance.
"""

import math
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from impactfem.errors import SceneError
from impactfem.system.generalized import LinearSystem

Floats = NDArray[np.float64]

_LARGEST_RATIO = 0.999


def with_tips(system: LinearSystem, stiffness: float, damping: float, mass: float) -> LinearSystem:
    """Put a spring with a dashpot before each constraint, which then has e = 0.

    Args:
        system: Its coordinates u stay the first ones; those of the tips q follow, 0 where u is 0.
        stiffness: k [N/m].
        damping: c [N s/m].
        mass: mu of each tip [kg], small against what it meets.

    Raises:
        SceneError: A value is not allowed.
    """
    for name, value in (("stiffness", stiffness), ("mass", mass)):
        if not 0.0 < value < math.inf:
            raise SceneError(f"tip: {name} = {value} is not allowed: give a number > 0")
    if not 0.0 <= damping < math.inf:
        raise SceneError(f"tip: damping = {damping} is not allowed: give a number >= 0")
    d, tips = system.dofs, system.num_constraints
    links = np.hstack((-system.normals, np.eye(tips)))
    masses, springs, dampers = np.zeros((3, d + tips, d + tips))
    masses[:d, :d] = system.mass(np.zeros(d))
    masses[d:, d:] = mass * np.eye(tips)
    springs[:d, :d], dampers[:d, :d] = system.stiffness, system.damping
    return LinearSystem(
        mass=masses,
        stiffness=springs + stiffness * links.T @ links,
        damping=dampers + damping * links.T @ links,
        load=[*system.load, *([0.0] * tips)],
        normals=np.hstack((np.zeros((tips, d)), np.eye(tips))),
        offsets=system.offsets,
        motion=system.motion,
        names=list(chain(system.names, (f"tip[{j}]" for j in range(tips)))),
    )


def tip_state(system: LinearSystem, field: Floats) -> Floats:
    """Displacement or velocity u of the body, followed by that of tips which move with it."""
    return np.concatenate((field, system.normals @ field))


def tip_restitution(damping_ratio: float) -> float:
    """Restitution e = exp(-zeta phi / w) of a rigid mass m on a massless tip that cannot pull.

    w = sqrt(1 - zeta^2), and phi in (0, pi) with tan phi = 2 zeta w / (2 zeta^2 - 1) is the phase
    at which k x + c x' vanishes.

    Args:
        damping_ratio: zeta = c / (2 sqrt(k m)) in [0, 1).
    """
    zeta, w = damping_ratio, math.sqrt(1.0 - damping_ratio**2)
    return math.exp(-zeta / w * math.atan2(2.0 * zeta * w, 2.0 * zeta**2 - 1.0))


def tip_damping_ratio(restitution: float) -> float:
    """Damping ratio that gives a restitution above 0.14, the inverse of `tip_restitution`.

    Raises:
        SceneError: There is none.
    """
    least = tip_restitution(_LARGEST_RATIO)
    if not least <= restitution <= 1.0:
        raise SceneError(
            f"tip: restitution = {restitution} is not allowed: give one from {least:.3g} to 1"
        )
    return float(brentq(lambda z: tip_restitution(z) - restitution, 0.0, _LARGEST_RATIO))
