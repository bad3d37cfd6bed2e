"""How far bodies will turn and be strained, and whether their first contacts will be resolved.

A body flies as a rigid one until it first meets an obstacle or another body. There it takes the
impulse of a rigid impact that gives back all speed, at the middle of what touches: a normal one,
which turns the body if its line misses the centre of mass, and that of friction until it sticks.
What weight presses on after that rubs on. The body then turns for the rest of the duration; under
loads that is not known, and it is only told how far they turn it until then. Its strain is that of
a wave, speed over wave speed, several times as much at a curved contact. A body on supports turns
as these do. All this is right to a factor of about 2: enough to tell which scenes are none for
small strains.
"""

import math
from collections.abc import Sequence

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.boundary import Boundary
from impactfem.findings import Finding
from impactfem.planning.flights import Blow, Flyer, first_blow, flyer, spacing
from impactfem.planning.model_limits import rotation_findings, strain_findings
from impactfem.planning.resolution import resolution_findings
from impactfem.scene import Scene, Solid
from impactfem.system.elastic import ElasticSystem

_FLAT, _CURVED = 1.2, 3.0
"""Strain of 1 % of the volume over speed / wave speed, where a face or a curve meets (measured)."""

_WIDE = 0.5
"""Share of a body's width from which what touches is a face."""

_LEVEL = 0.01
"""Rise of a face's nodes over its width; on an arc that touches, more than a fifth is steeper."""


def flight_findings(
    scene: Scene, parts: Sequence[tuple[Solid, ElasticSystem, Boundary]], dt: float | None
) -> list[Finding]:
    """What bodies will turn and be strained beyond small strains, and meet unresolved (collective).

    Args:
        scene: The scene.
        parts: The solids with their matrices and outsides.
        dt: Time step [s]; None if it follows from the mesh.
    """
    flyers = [flyer(scene, *part) for part in parts]
    found: list[Finding] = []
    for body in flyers:
        blow = first_blow(scene, body, flyers)
        small = not body.solid.is_finite
        found += _rotation(scene, body, blow) if small else ()
        if blow is not None:
            why = f"as it meets {blow.met} at {blow.speed:.3g} m/s"
            found += strain_findings(body.name, _strain(body, blow), why) if small else ()
            known = {finding.code for finding in found}
            sharp = resolution_findings(body, blow, dt)
            found += [finding for finding in sharp if finding.code not in known]
    return found


def _rotation(scene: Scene, body: Flyer, blow: Blow | None) -> Sequence[Finding]:
    """How far a body turns, if that is known."""
    drives = body.drives
    if not drives.known:
        return ()
    end = scene.duration if blow is None else blow.time
    if not body.free:
        most = float(np.linalg.norm(drives.turn, axis=1).max())
        return rotation_findings(body.name, math.atan(most), "as its supports move")
    spun, struck = float(np.linalg.norm(drives.turned(end))), 0.0
    if blow is not None and not drives.loaded:
        spun = float(np.linalg.norm(drives.turned(scene.duration)))
        pull = np.zeros(3)
        pull[: body.solid.dim] = scene.vector_gravity.at(end)
        struck = _turned(body, blow, scene.duration, pull)
    why = "as its loads turn it" if drives.loaded else "as it spins"
    if blow is not None and struck > spun:
        why = f"as it meets {blow.met}"
    return rotation_findings(body.name, math.atan(spun + struck), why)


def _turned(body: Flyer, blow: Blow, duration: float, gravity: Floats) -> float:
    """How far a body turns after its first contact [rad]."""
    left = max(0.0, duration - blow.time)
    normal, weights = blow.normal, blow.weights / blow.weights.sum()
    across = blow.arms - np.outer(blow.arms @ normal, normal)
    middle = weights @ across
    # The middle of what touches is known to half the distance of neighbours.
    length = float(np.linalg.norm(middle))
    middle *= max(0.0, length - 0.5 * spacing(body.points)) / max(length, 1e-300)
    turn = body.inverse @ np.cross(middle, normal)
    give = 1.0 / body.mass + blow.give + float(np.cross(turn, middle) @ normal)
    impulse = 2.0 * blow.speed / give
    angle = float(np.linalg.norm(turn)) * impulse * left
    slip = float(np.linalg.norm(blow.along))
    if blow.friction <= 0.0 or slip <= 1e-9 * body.wave_speed:
        return angle
    forward = blow.along / slip
    height = -float(weights @ (blow.arms @ normal))
    # Pressure that moves forward holds against tipping, as far as the face reaches; what a curve
    # presses flat beside its lowest place holds little.
    rise = blow.arms @ normal - float((blow.arms @ normal).min())
    face = across[rise <= _LEVEL * float(np.linalg.norm(across, axis=1).max())]
    foot = max(0.0, float((face @ forward).max()))
    lever = max(0.0, blow.friction * height - foot) / blow.friction
    turn = body.inverse @ np.cross(-height * normal, -forward)
    sticks = slip / (1.0 / body.mass + blow.give + height * float(np.linalg.norm(turn)))
    pressed = max(0.0, -float(gravity @ normal)) * body.mass
    rate = float(np.linalg.norm(turn)) * lever / max(height, 1e-300)
    start, growth = min(blow.friction * impulse, sticks), blow.friction * pressed
    until = left if growth <= 0.0 else min(left, (sticks - start) / growth)
    grown = start * until + 0.5 * growth * until**2
    return angle + rate * (grown + (start + growth * until) * (left - until))


def _strain(body: Flyer, blow: Blow) -> float:
    """Strain that 1 % of the volume exceeds, about."""
    across = blow.arms - np.outer(blow.arms @ blow.normal, blow.normal)
    points = body.points - np.outer(body.points @ blow.normal, blow.normal)
    wide = np.ptp(across, axis=0).max() > _WIDE * np.ptp(points, axis=0).max()
    return (_FLAT if wide else _CURVED) * blow.share(body) * blow.speed / body.wave_speed
