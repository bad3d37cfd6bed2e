"""How far beams turn and are strained in the march, as its watch takes solids."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.marching.few import FewMidpoint
from impactfem.runs.line_bodies import beam_figures
from impactfem.system.beam import FreeBeam
from impactfem.system.stretches import Look

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class BeamLooks:
    """Rotation and strains of a beam in the march, as a watch takes them of solids.

    Attributes:
        march: Of the beam.
        free: The beam.
    """

    march: FewMidpoint
    free: FreeBeam

    @property
    def mass(self) -> float:
        """[kg]."""
        return self.free.beam.mass

    @property
    def inertia(self) -> Floats:
        """About its centre [kg m^2], (1, 1)."""
        return self.free.rigid_mass[2:, 2:]

    def look(self, displacement: Floats, known: float = 0.0) -> Look:  # noqa: ARG002  (of solids)
        """What it is now; the watch gives what it knows of solids."""
        position = self.march.coordinates
        turned = float(self.free.rigid_part(position)[2])
        found = beam_figures(self.free, position[None], abs(turned))
        unknown = float("nan")
        strains = (found[name] for name in ("strain_max", "strain_99"))
        most, exceeded = (unknown if value is None else value for value in strains)
        return Look(turned, most, max(known, exceeded), 1.0)


def beam_looks(few: Sequence[FewMidpoint]) -> dict[str, BeamLooks]:
    """Of the beams among some bodies, by name."""
    return {
        march.bodies.names[0]: BeamLooks(march, march.bodies.beam)
        for march in few
        if march.bodies.beam is not None
    }
