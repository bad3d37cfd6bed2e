"""Whether contact will be resolved by steps and nodes, as far as it can be foreseen."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from impactfem.findings import Finding
from impactfem.scene.shapes import Disc, Sphere

if TYPE_CHECKING:
    from impactfem.planning.flights import Blow, Flyer

STEPS = (8, 3)
"""Steps from which the speed after an impact is right to some 5 %, and up to which to 20 to 50 %.

Measured with discs and balls: 8 steps leave 2 to 5 %, 16 steps 1 to 2 %, 4 steps 5 to 20 %.
"""

_ALIKE = 2.0  # impedances over each other, up to which waves of both bodies end a contact

SINGLE_LIMIT = 0.5
"""Share of the impulse that one node carries alone from where the force depends on the mesh."""


def unresolved(steps: float, text: str) -> Finding:
    """A contact of too few steps."""
    fault = steps <= STEPS[1]
    return Finding(
        "contact_unresolved", "fault" if fault else "warning", text, value=steps,
        limit=float(STEPS[1] if fault else STEPS[0]),
        remedy=f"take a smaller solve.dt: {STEPS[0]} steps leave errors of 5 %, 16 of 1 to 2 %",
    )  # fmt: skip


def single_node(share: float, text: str) -> Finding:
    """Contact on a single node."""
    return Finding(
        "contact_single_node", "warning", f"{text}: force and duration depend on the mesh",
        value=share, limit=SINGLE_LIMIT,
        remedy="take smaller elements where it touches, or round the corner off",
    )  # fmt: skip


def resolution_findings(body: "Flyer", blow: "Blow", dt: float | None) -> list[Finding]:
    """What a body's first contact will be too fast or too sharp for.

    Only what the plan knows: the time that waves need through the body and back, of balls Hertz's
    duration and depth. Other contacts are left to the run, which measures all of them.

    Args:
        body: The body.
        blow: Its first contact.
        dt: Time step [s]; None if it follows from the mesh.
    """
    both = [body] if blow.other is None else [body, blow.other]
    if blow.speed <= 0.0 or any(each.solid.materials for each in both):
        return []  # of what is soft and what is heavy the run tells
    lasting, depth = _impact(body, blow)
    way = body.drives.at(blow.time) - body.drives.at(blow.time + lasting)
    if float(way @ blow.normal) > 2.0 * blow.speed * lasting:
        return []  # put down rather than struck
    found = []
    if dt is not None and lasting < STEPS[0] * dt:
        text = (
            f"the impact of {body.name} on {blow.met}, of about {lasting:.3g} s, will last "
            f"{lasting / dt:.2g} steps"
        )
        found.append(replace(unresolved(lasting / dt, text), severity="warning"))
    if blow.clearance > depth:
        text = (
            f"a single node of {body.name} will touch {blow.met}: no other lies within "
            f"{depth:.2g} m, the depth of the impact"
        )
        found.append(replace(single_node(1.0, text), value=None))
    return found


def _impact(body: "Flyer", blow: "Blow") -> tuple[float, float]:
    """About how long an impact lasts [s], and how deep it goes [m]."""
    both = [body] if blow.other is None else [body, blow.other]
    # The softer body gives way. Of bodies alike the first wave that comes back ends the contact.
    softest = min(each.impedance for each in both)
    lasting = min(
        2.0 * each.size / each.solid.p_wave_speed
        for each in both
        if each.impedance <= _ALIKE * softest
    )
    depth = blow.speed * lasting
    curvature = sum(1.0 / radius for radius in map(_radius, both) if radius is not None)
    if curvature:
        give = sum(2.0 ** -len(_cuts(each)) / each.mass for each in both)
        soft = sum((1.0 - each.solid.poisson_ratio**2) / each.solid.youngs_modulus for each in both)
        # Hertz: K. L. Johnson, Contact Mechanics (1985), section 11.4.
        depth = (15.0 * blow.speed**2 * soft * curvature**0.5 / (16.0 * give)) ** 0.4
        lasting = max(lasting, 2.87 * (curvature * (soft / give) ** 2 / blow.speed) ** 0.2)
    return lasting, depth


def _cuts(body: "Flyer") -> Sequence[str]:
    shape = body.solid.shape
    return () if shape is None else shape.symmetry


def _radius(body: "Flyer") -> float | None:
    """Of a ball [m]; None of other bodies."""
    shape, solid = body.solid.shape, body.solid
    if isinstance(shape, Sphere):
        return shape.radius
    if isinstance(shape, Disc) and solid.is_axisymmetric and not shape.center[0]:
        return shape.radius
    return None
