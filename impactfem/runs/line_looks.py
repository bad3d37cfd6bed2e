"""How far beams and bars turn and are strained in the march, as its watch takes solids."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.marching.few import FewInterior, FewMidpoint
from impactfem.marching.wave_bar import WaveBar
from impactfem.runs.line_bodies import bar_figures, strains
from impactfem.system.beam_parts import BeamParts
from impactfem.system.stretches import Look

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LineLooks:
    """Rotation and strains of a body in the march, as a watch takes them of solids.

    Attributes:
        mass: [kg].
        inertia: About its centre [kg m^2], (1, 1) or (3, 3); NaN if it is not known.
        seen: Rotation now [rad], largest strain and that which 1 % of the volume exceeds; None of
            strains that are not finite.
    """

    mass: float
    inertia: Floats
    seen: Callable[[], tuple[float, float | None, float | None]]

    def look(self, displacement: Floats, known: float = 0.0) -> Look:  # noqa: ARG002  (of solids)
        """What it is now; the watch gives what it knows of solids."""
        turned, *strained = self.seen()
        most, exceeded = (math.nan if value is None else value for value in strained)
        return Look(turned, most, max(known, exceeded), 1.0)


def _of_beam(march: FewMidpoint, parts: BeamParts) -> LineLooks:
    """Of a beam."""

    def seen() -> tuple[float, float | None, float | None]:
        position = march.coordinates
        strain, volumes = parts.fibres(position)
        return parts.turned(position), *strains(strain[None], volumes)

    return LineLooks(parts.beam.mass, parts.inertia, seen)


def _of_bar(march: WaveBar) -> LineLooks:
    """Of a bar, which does not turn."""

    def seen() -> tuple[float, float | None, float | None]:
        moved = march.motion(0)["displacement"] @ march.bodies.axis
        found = bar_figures(march.bodies.bar, march.nodes, moved[None])
        return 0.0, found["strain_max"], found["strain_99"]

    return LineLooks(march.bodies.masses[0], np.full((1, 1), np.nan), seen)


def line_looks(few: Sequence[FewInterior]) -> dict[str, LineLooks]:
    """Of the beams and bars among some bodies, by name."""
    found: dict[str, LineLooks] = {}
    for march in few:
        if isinstance(march, WaveBar):
            found[march.bodies.names[0]] = _of_bar(march)
        elif isinstance(march, FewMidpoint) and march.bodies.beam is not None:
            found[march.bodies.names[0]] = _of_beam(march, march.bodies.beam)
    return found
