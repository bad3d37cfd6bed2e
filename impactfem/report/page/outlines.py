"""Outlines of solids in the plane as their shapes say, and the parts that are held or loaded."""

import math
from collections.abc import Sequence

import numpy as np

from impactfem.arrays import Floats
from impactfem.report.page.numbers import formula, formulas
from impactfem.scene import Solid

_CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
_AROUND = 97  # the outermost places of a circle and of half of one are among them


def outline_of(solid: Solid) -> Floats | None:
    """Corners of the outline [m], shape (corners, 2), turned as the shape is.

    None where the mesh must tell: mesh files, symmetry cuts, initial displacements, rings.
    """
    shape = solid.shape
    moved = any(entry.plain != 0.0 for entry in solid.displacement)
    if shape is None or shape.symmetry or moved or len(shape.figure.radii) > 1:
        return None
    figure = shape.figure
    corners: Floats = np.array(figure.origin) + _CORNERS * np.array(figure.edges or 0.0)
    for radius in figure.radii.values():
        corners = _round(figure.origin, radius, half=solid.is_axisymmetric)
    if not shape.angle:
        return corners
    centre = np.array(shape.centre, dtype=np.float64)[:2]
    cosine, sine = math.cos(shape.angle), math.sin(shape.angle)
    turned: Floats = centre + (corners - centre) @ np.array([[cosine, sine], [-sine, cosine]])
    return turned


def _round(center: Sequence[float], radius: float, *, half: bool) -> Floats:
    half = half and not center[0]
    angles = np.linspace(-0.5 * np.pi, (0.5 if half else 1.5) * np.pi, _AROUND)
    return np.array(center) + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def told_surfaces(solid: Solid) -> list[tuple[str, str]]:
    """Names of the surfaces that are held or loaded, and what happens there."""
    told = [(s.surface, {"fixed": "held", "symmetry": "symmetry"}.get(s.kind, "moved"))
            for s in solid.supports]  # fmt: skip
    told += [(s.surface, f"traction {formulas(s.value, 'Pa')}") for s in solid.tractions]
    return told + [(s.surface, f"pressure {formula(s.value, 'Pa')}") for s in solid.pressures]


def supported_lines(solid: Solid) -> list[tuple[Floats, str]]:
    """Sides of a box that are held or loaded: segments (1, 2, 2) [m], and what happens there."""
    shape, outline = solid.shape, outline_of(solid)
    if shape is None or outline is None or not shape.figure.edges:
        return []
    left, right, bottom, top = shape.figure.faces
    sides = {name: k for k, name in enumerate((bottom, right, top, left))}
    return [
        (outline[[sides[name], (sides[name] + 1) % 4]][None], text)
        for name, text in told_surfaces(solid)
        if name in sides
    ]
