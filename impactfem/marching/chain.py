"""A bar as a chain of masses and springs: what the time loops see."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvalsh_tridiagonal

from impactfem.scene import Bar

Floats = NDArray[np.float64]


_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True)
class Chain:
    """Linear elements with lumped mass, per rho A; node 0 may touch the wall.

    Attributes:
        positions: [m], shape (nodes,).
        mass: Mass of each node [m], shape (nodes,).
        stiffness: c^2 / h of each element [m/s^2], shape (nodes - 1,).
        displacement: u at t = 0 [m], shape (nodes,).
        velocity: u_t at t = 0 weighted with each node's hat function [m/s], shape (nodes,); it has
            the momentum of the bar.
        clamped: Whether the last node is held.
    """

    positions: Floats
    mass: Floats
    stiffness: Floats
    displacement: Floats
    velocity: Floats
    clamped: bool

    @classmethod
    def of_bar(cls, bar: Bar, positions: Floats) -> "Chain":
        """Divide a bar at the given positions."""
        h = np.diff(positions)
        mass = 0.5 * (np.append(h, 0.0) + np.insert(h, 0, 0.0))
        velocity = _weighted_velocity(bar, positions) / mass
        if bar.far_end == "clamped":
            velocity[-1] = 0.0
        return cls(
            positions,
            mass,
            bar.wave_speed**2 / h,
            bar.initial_displacement(x=positions) + np.zeros_like(positions),
            velocity,
            bar.far_end == "clamped",
        )

    @property
    def highest_frequency(self) -> float:
        """Largest eigenfrequency of M^-1 K with both ends free [rad/s]."""
        k = self.stiffness
        diagonal = (np.append(k, 0.0) + np.insert(k, 0, 0.0)) / self.mass
        beside = -k / np.sqrt(self.mass[1:] * self.mass[:-1])
        last = len(self.mass) - 1
        values = eigvalsh_tridiagonal(diagonal, beside, select="i", select_range=(last, last))
        return float(np.sqrt(values[0]))


def _weighted_velocity(bar: Bar, positions: Floats) -> Floats:
    """Integral of u_t(0, x) times each hat function, as in the weak form [m^2/s]."""
    left, h = positions[:-1, None], np.diff(positions)[:, None]
    share = 0.5 * (1.0 + _POINTS)
    velocity = bar.initial_velocity(x=left + h * share) + np.zeros((len(h), len(share)))
    weights = 0.5 * h * _WEIGHTS * velocity
    integrals = np.zeros(len(positions))
    integrals[:-1] += weights @ (1.0 - share)
    integrals[1:] += weights @ share
    return integrals
