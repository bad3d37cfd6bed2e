"""Where small-strain elasticity ends: findings on turns and strains, foreseen or measured."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from impactfem.findings import ROTATION_LIMITS, STRAIN_LIMITS, Finding, by_limits, percent
from impactfem.scene import Scene

CODES = ("model_rotation", "model_strain")
"""What every run of solids looks for."""

FOLDED = 0.5
"""Ratio of volumes that calls for care; at 0 a cell is turned inside out."""

_COLLAPSE = (0.6, 0.4)
"""The same for St. Venant and Kirchhoff's law: no stiffness is left at a stretch of 1 / sqrt 3."""

_TURNS = (
    "elasticity of small strains has no large rotations: give the body "
    'strain = "finite"; else take a shorter duration, a central impact or supports that keep the '
    "body from turning"
)
_STRAINS = (
    "elasticity of small strains is not for this: give the body "
    'strain = "finite"; else take a slower impact, a stiffer body or less load'
)


def as_asked(scene: Scene, findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings on the model, as warnings of bodies whose scene asks for small strains itself.

    A linear problem has its answer at any amplitude, and is one that is computed to compare.

    Args:
        scene: As it was given, without the choices of a plan.
        findings: What is foreseen or was measured.
    """
    asked = {solid.name for solid in scene.solids if solid.strain == "small"}
    return tuple(
        replace(found, severity="warning")
        if found.severity == "fault" and found.code in CODES and found.subject in asked
        else found
        for found in findings
    )


def measured_findings(
    bodies: Mapping[str, Mapping[str, Any]], finite: Mapping[str, str] | None = None
) -> Iterator[Finding]:
    """What a run has measured beyond the limits of the model.

    Args:
        bodies: As in ``summary.json``.
        finite: Materials of the bodies under finite strain, which has no such limits.
    """
    for name, body in bodies.items():
        if finite and name in finite:
            yield from _collapsing(name, finite[name], body["volume_ratio_min"])
            continue
        yield from rotation_findings(name, body["rotation_max"])
        share, least = body["strain_99"], body["volume_ratio_min"]
        found = strain_findings(name, share)
        if not found and least < FOLDED:
            text = f"a cell of {name} is pressed to {percent(least)} of its volume"
            found = by_limits("model_strain", -least, (-FOLDED, 0.0), text, name, _STRAINS)
        yield from found


def _collapsing(name: str, material: str, least: float) -> tuple[Finding, ...]:
    """A finding if a body is pressed together further than its law can tell."""
    if material != "linear":
        return ()
    text = f"a cell of {name} is pressed to {percent(least)} of its volume, where St. Venant and "
    text += "Kirchhoff's law grows weaker instead of stiffer"
    remedy = 'give material = "neo_hookean"'
    low, high = (-limit for limit in _COLLAPSE)
    return by_limits("model_strain", -least, (low, high), text, name, remedy)


def rotation_findings(name: str, angle: float, why: str = "") -> tuple[Finding, ...]:
    """A finding if a body turns too far.

    Args:
        name: Of the body.
        angle: Rotation [rad], the best fit of its places.
        why: Why it is foreseen; empty if it was measured.
    """
    growth = 1.0 / max(math.cos(min(angle, math.pi / 2.0)), 1e-3) - 1.0
    verb, about = ("will turn", "about ") if why else ("turned", "up to ")
    text = f"{name} {verb} by {about}{angle:.2g} rad ({math.degrees(angle):.2g} degrees)"
    text += f", {why}" if why else ""
    text += f": by linear elasticity a body that turns so far grows by {percent(growth)}"
    return by_limits("model_rotation", angle, ROTATION_LIMITS, text, name, _TURNS)


def strain_findings(name: str, strain: float, why: str = "") -> tuple[Finding, ...]:
    """A finding if a body is strained too much.

    Args:
        name: Of the body.
        strain: Principal strain that 1 % of its volume exceeds.
        why: Why it is foreseen; empty if it was measured.
    """
    verb = (
        f"will exceed a strain of about {percent(strain)}, {why}"
        if why
        else (f"exceeded a strain of {percent(strain)}")
    )
    text = f"1 % of the volume of {name} {verb}"
    return by_limits("model_strain", strain, STRAIN_LIMITS, text, name, _STRAINS)
