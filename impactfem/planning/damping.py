"""Whether steps and elements follow the damping of solids."""

from typing import Any

from impactfem.findings import Finding, by_limits, percent
from impactfem.marching.schemes import SOLID_SCHEMES
from impactfem.planning.solid_costs import Size, leading_speed
from impactfem.scene import Solid

RATE_LIMITS = (0.5, 2.0)
"""Steps over the time of damping by the mass from which it is 2 % off, and turns speeds round."""

REBOUND_LIMIT = 0.2
"""Share of the speed of an impact from where a rebound that is too fast is told."""

_UNDAMPED = 1.5
"""Speed too much after an impact, over beta c h / L^2 and that before it (measured).

Of balls and discs 2 to 5 times that, of blocks 1 to 3 times, at h / L from 1/10 to 1/40, against
schemes whose contact nodes have mass and are damped.
"""


def mass_damping_findings(body: Any, dt: float) -> list[Finding]:
    """What of the damping of a body by its mass steps of dt [s] do not follow."""
    rate = body.rayleigh_mass * dt
    if rate == 0.0:
        return []
    text = (
        f"damping by the mass stops {body.name} in {1.0 / body.rayleigh_mass:.3g} s, and "
        f"steps of {dt:.3g} s do not follow it"
    )
    text += ": the velocity turns round in each" if rate > RATE_LIMITS[1] else ""
    remedy = f"take solve.dt <= {RATE_LIMITS[0] / body.rayleigh_mass:.1g}, or damp it less"
    return [*by_limits("setting", rate, RATE_LIMITS, text, body.name, remedy)]


def contact_damping_findings(bodies: Any) -> list[Finding]:
    """What contacts of bodies without masses where they touch lack of their damping."""
    text = (
        f"{bodies.names[0]} is damped so strongly that what touches shows: it has no mass and is "
        "not damped, so that impulses of contacts are too large by about "
        f"{percent(bodies.undamped)}"
    )
    remedy = "take a smaller mesh_size, less damping, or a stiffness of its contacts"
    limits = REBOUND_LIMIT, float("inf")
    return [*by_limits("setting", bodies.undamped, limits, text, bodies.names[0], remedy)]


def damping_findings(
    method: str, solid: Solid, size: Size, extent: float, dt: float
) -> list[Finding]:
    """What of a body's damping its steps and elements do not follow.

    Args:
        method: Its scheme.
        solid: The body.
        size: How large its elements are.
        extent: Its largest extent [m].
        dt: Time step [s], about.
    """
    found = mass_damping_findings(solid, dt)
    if not SOLID_SCHEMES[method].massless:
        return found
    h = min([size.mesh_size, *(ball.size for ball in solid.refine)])
    share = _UNDAMPED * solid.rayleigh_stiffness * leading_speed(solid) * h / extent**2
    text = (
        f"{solid.name} is damped so strongly that what its contact nodes lack of it shows: they "
        f"have no mass and rebound undamped, too fast by about {percent(min(1.0, share))} of the "
        "speed of impact"
    )
    remedy = "take smaller elements where it touches, or a smaller rayleigh_stiffness"
    found += by_limits("setting", share, (REBOUND_LIMIT, float("inf")), text, solid.name, remedy)
    return found
