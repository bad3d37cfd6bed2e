"""How far beams and bars turn and are strained in the march, as its watch takes solids."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.marching.few import FewInterior, FewMidpoint
from impactfem.marching.wave_bar import WaveBar
from impactfem.runs.line_bodies import bar_figures, strains
from impactfem.system.beam_parts import BeamParts
from impactfem.system.stretches import Look

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class BeamLooks:
    """Rotation and strains of a beam in the march, as a watch takes them of solids.

    Attributes:
        march: Of the beam.
        parts: The beam.
    """

    march: FewMidpoint
    parts: BeamParts

    @property
    def mass(self) -> float:
        """[kg]."""
        return self.parts.beam.mass

    @property
    def inertia(self) -> Floats:
        """About its centre [kg m^2], (1, 1) or (3, 3)."""
        return self.parts.inertia

    def look(self, displacement: Floats, known: float = 0.0) -> Look:  # noqa: ARG002  (of solids)
        """What it is now; the watch gives what it knows of solids."""
        position = self.march.coordinates
        strain, volumes = self.parts.fibres(position)
        largest, exceeded = strains(strain[None], volumes)
        found = {"strain_max": largest, "strain_99": exceeded}
        return _looked(self.parts.turned(position), found, known)


@dataclass(frozen=True)
class BarLooks:
    """Strains of a bar in the march, likewise; it does not turn.

    Attributes:
        march: Of the bar.
    """

    march: WaveBar

    @property
    def mass(self) -> float:
        """[kg]."""
        return self.march.bodies.masses[0]

    @property
    def inertia(self) -> Floats:
        """None that is known, (1, 1)."""
        return np.full((1, 1), np.nan)

    def look(self, displacement: Floats, known: float = 0.0) -> Look:  # noqa: ARG002  (of solids)
        """What it is now."""
        moved = self.march.motion(0)["displacement"] @ self.march.bodies.axis
        found = bar_figures(self.march.bodies.bar, self.march.nodes, moved[None])
        return _looked(0.0, found, known)


def _looked(turned: float, found: Mapping[str, Any], known: float) -> Look:
    unknown = float("nan")
    strains = (found[name] for name in ("strain_max", "strain_99"))
    most, exceeded = (unknown if value is None else value for value in strains)
    return Look(turned, most, max(known, exceeded), 1.0)


def line_looks(few: Sequence[FewInterior]) -> dict[str, BeamLooks | BarLooks]:
    """Of the beams and bars among some bodies, by name."""
    found: dict[str, BeamLooks | BarLooks] = {}
    for march in few:
        if isinstance(march, WaveBar):
            found[march.bodies.names[0]] = BarLooks(march)
        elif isinstance(march, FewMidpoint) and march.bodies.beam is not None:
            found[march.bodies.names[0]] = BeamLooks(march, march.bodies.beam)
    return found
