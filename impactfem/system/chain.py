"""A bar as a chain of masses and springs: what the time loops and the space-time form see."""

from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene import Bar
from impactfem.system.sections import weighted_velocity


@dataclass(frozen=True)
class Chain:
    """Linear elements with lumped mass, per rho A; node 0 may touch the wall.

    Attributes:
        positions: In the bar [m], shape (nodes,).
        travel: Travel times to them as shares of L/c, times L [m], shape (nodes,).
        element_mass: Mass of each element over rho A [m], shape (nodes - 1,).
        mass: Mass of each node [m], shape (nodes,).
        stiffness: c^2 / h of each element, times its weight [m/s^2], shape (nodes - 1,).
        displacement: u at t = 0 [m], shape (nodes,).
        velocity: u_t at t = 0 weighted with each node's hat function [m/s], shape (nodes,); it has
            the momentum of the bar.
        clamped: Whether the last node is held.
    """

    positions: Floats
    travel: Floats
    element_mass: Floats
    mass: Floats
    stiffness: Floats
    displacement: Floats
    velocity: Floats
    clamped: bool

    @classmethod
    def of_bar(cls, bar: Bar, travel: Floats) -> "Chain":
        """Divide a bar at nodes that waves have these travel times to (`Bar.places`)."""
        h, weights, positions = np.diff(travel), bar.weights(travel), bar.places(travel)
        own = h * weights
        mass = 0.5 * (np.append(own, 0.0) + np.insert(own, 0, 0.0))
        velocity = weighted_velocity(bar, travel) / mass
        if bar.far_end == "clamped":
            velocity[-1] = 0.0
        return cls(
            positions,
            travel,
            own,
            mass,
            bar.wave_speed**2 / h * weights,
            bar.initial_displacement(x=positions) + np.zeros_like(positions),
            velocity,
            bar.far_end == "clamped",
        )

    @property
    def highest_frequency(self) -> float:
        """Largest eigenfrequency of M^-1 K with both ends free [rad/s]."""
        from scipy.linalg import eigvalsh_tridiagonal  # noqa: PLC0415  (a run needs it rarely)

        k = self.stiffness
        diagonal = (np.append(k, 0.0) + np.insert(k, 0, 0.0)) / self.mass
        beside = -k / np.sqrt(self.mass[1:] * self.mass[:-1])
        last = len(self.mass) - 1
        values = eigvalsh_tridiagonal(diagonal, beside, select="i", select_range=(last, last))
        return float(np.sqrt(values[0]))
