"""Whether contact will be resolved by steps and nodes, as far as it can be foreseen."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from impactfem.findings import Finding
from impactfem.scene import Scene, Solid
from impactfem.scene.shapes import Disc, Sphere

Floats = NDArray[np.float64]

STEPS = (8, 3)
"""Steps from which the speed after an impact is right to some 5 %, and up to which to 20 to 50 %.

Measured with discs and balls: 8 steps leave 2 to 5 %, 16 steps 1 to 2 %, 4 steps 5 to 20 %.
"""

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


def resolution_findings(
    scene: Scene, gap: Floats, normal: Floats, velocity: Floats, extent: float, dt: float | None
) -> list[Finding]:
    """What a free solid's first impact will be too fast or too sharp for.

    Only what the plan knows: the time that waves need through the body and back, of balls Hertz's
    duration and depth. Impacts of bodies that are held, pushed or struck otherwise are left to the
    run, which measures all of them.

    Args:
        scene: With one solid.
        gap: Gaps of the contact nodes at t = 0 [m], shape (nodes,).
        normal: Their normals towards the body, shape (nodes, dim).
        velocity: Mean velocity of the body at t = 0 [m/s], shape (dim,).
        extent: Largest extent of the body [m].
        dt: Time step [s]; None if it follows from the mesh.
    """
    solid = scene.solid
    held = any(support.kind != "symmetry" for support in solid.supports)
    if not len(gap) or held or solid.tractions or solid.pressures:
        return []
    first = int(np.argmin(gap))
    pull = np.asarray(scene.vector_gravity.at(0.0), dtype=np.float64)
    speed, gained = (
        -float(velocity @ normal[first]),
        -2.0 * float(pull @ normal[first]) * gap[first],
    )
    if speed**2 + gained <= 0.0 or (speed < 0.0 and gained <= 0.0):
        return []
    lasting, depth = _impact(solid, float(np.sqrt(speed**2 + gained)), extent)
    found = []
    if dt is not None and lasting < STEPS[0] * dt:
        text = f"an impact of about {lasting:.3g} s will last {lasting / dt:.2g} steps"
        found.append(replace(unresolved(lasting / dt, text), severity="warning"))
    if np.count_nonzero(gap <= gap[first] + depth) == 1:
        text = (
            f"a single node will touch: no other lies within {depth:.2g} m, the depth of an impact"
        )
        found.append(replace(single_node(1.0, text), value=None))
    return found


def _impact(solid: Solid, speed: float, extent: float) -> tuple[float, float]:
    """About how long an impact lasts [s], and how deep it goes [m]."""
    lasting = 2.0 * extent / solid.p_wave_speed
    depth = speed * lasting
    shape, mass = solid.shape, solid.mass
    round_ = isinstance(shape, Sphere) or (
        isinstance(shape, Disc) and solid.is_axisymmetric and not shape.center[0]
    )
    if round_ and isinstance(shape, Sphere | Disc) and mass is not None:
        mass *= 2.0 ** len(shape.symmetry)
        stiff = solid.youngs_modulus / (1.0 - solid.poisson_ratio**2)
        hertz = 2.87 * (mass**2 / (shape.radius * stiff**2 * speed)) ** 0.2
        depth = (15.0 * mass * speed**2 / (16.0 * stiff * shape.radius**0.5)) ** 0.4
        lasting = max(lasting, hertz)
    return lasting, depth
