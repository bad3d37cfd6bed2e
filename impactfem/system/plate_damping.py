"""Damping of plates: by mass, by stiffness, and of modes one by one.

    C = a M + b K + M V diag(g) V^T M,    V^T M V = 1,    K V = M V diag(w^2),

with the lowest modes V, at a + b w^2 + g = 2 zeta w. K is the stiffness of small deflections.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene.damping import rayleigh_of
from impactfem.scene.plate import Plate
from impactfem.system.plate_tones import first_frequency, vibrations

Answer = Callable[[Floats], Floats]
"""What forces on q do, (d,) or (d, several)."""


@dataclass(frozen=True)
class PlateDamping:
    """How a plate is damped.

    Attributes:
        mass: a [1/s].
        stiffness: b [s].
        rates: g [1/s], (modes,).
        squares: w^2 [1/s^2], (modes,).
        modes: V, (d, modes).
        momenta: M V, (d, modes).
    """

    mass: float
    stiffness: float
    rates: Floats
    squares: Floats
    modes: Floats
    momenta: Floats

    @classmethod
    def of(cls, plate: Plate, stiffness: csr_matrix, mass: Floats) -> "PlateDamping":
        """That of a scene's plate.

        Args:
            plate: As the scene has it.
            stiffness: In q, (d, d).
            mass: Diagonal of the mass in q, 0 of what has none, (d,).

        Raises:
            SceneError: It has fewer modes than ratios.
        """
        ratios = np.asarray(plate.damping_ratio or ())
        if not len(ratios):
            none = np.zeros((len(mass), 0))
            by = plate.rayleigh_mass, plate.rayleigh_stiffness
            if plate.quality_factor is not None:
                first = first_frequency(stiffness, mass)
                by = rayleigh_of(plate, first, held=bool(plate.supports))
            return cls(*by, rates=none[0], squares=none[0], modes=none, momenta=none)
        found, shapes = vibrations(stiffness, mass, len(ratios))
        if len(found) < len(ratios):
            raise SceneError(
                f"body {plate.name}: damping_ratio has {len(ratios)} entries, more than the "
                f"{len(found)} modes of this mesh: give fewer, or a smaller mesh_size"
            )
        # What is beyond goes on at the last ratio, which by the stiffness alone the last mode has.
        rising = float(2.0 * ratios[-1] / found[-1])
        rates = (2.0 * ratios * found - rising * found**2)[:-1]
        shapes = shapes[:, :-1]
        momenta = mass[:, None] * shapes
        return cls(0.0, rising, rates, found[:-1] ** 2, shapes, momenta)

    def force(self, speed: Floats) -> Floats:
        """That of modes, against speeds of q, (d,) each."""
        return np.asarray(self.momenta @ (self.rates * (self.momenta.T @ speed)))

    def beside(self, answer: Answer, step: float, more: int) -> Answer:
        """What forces do with the damping of modes, by what they do without it.

        Args:
            answer: Difference over a step by forces, without it.
            step: Length [s].
            more: Number of undamped coordinates behind q.
        """
        if not len(self.rates):
            return answer
        momenta = np.pad(self.momenta, [(0, more), (0, 0)])
        moved = answer(momenta)
        slowed = self.rates[:, None] / step
        small = np.eye(len(slowed)) + slowed * (momenta.T @ moved)
        share = np.linalg.solve(small, slowed * momenta.T)

        def damped(forces: Floats) -> Floats:
            found = answer(forces)
            return np.asarray(found - moved @ (share @ found))

        return damped
