"""What a space-time solver returns, in SI units, and the energies of its layers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SpaceTimeSolution:
    """Displacement on a grid of layers and positions, contact on the intervals between.

    Attributes:
        times: Layer times [s], shape (layers + 1,).
        positions: Node positions from the near end [m], shape (elements + 1,).
        displacement: u [m], shape (layers + 1, elements + 1).
        multiplier: lambda = c^2 u_x [m^2/s^2] on (t_{m-1}, t_m], <= 0 in contact, (layers,).
        active: Active intervals, shape (layers,).
        iterations: Linear systems solved.
        set_changes: Changes of the active set after each.
        converged: Whether the active set stood still.
        message: How the iteration ended.
        num_unknowns: Size of the linear system.
        layered: False if the grid samples a mesh without layers.
    """

    times: Floats
    positions: Floats
    displacement: Floats
    multiplier: Floats
    active: NDArray[np.bool_]
    iterations: int
    set_changes: tuple[int, ...]
    converged: bool
    message: str
    num_unknowns: int
    layered: bool


def lumped_mass(positions: Floats) -> Floats:
    """Mass of each node per rho A [m], shape (nodes,): half of each neighbouring element."""
    mass = np.zeros(len(positions))
    h = np.diff(positions)
    mass[:-1] += 0.5 * h
    mass[1:] += 0.5 * h
    return mass


def layer_energies(solution: SpaceTimeSolution, wave_speed: float) -> tuple[Floats, Floats]:
    """Kinetic and elastic energy of each layer, per rho A [m^3/s^2], each of shape (layers,).

    P1 on right triangles is the leapfrog scheme M (u^{m+1} - 2 u^m + u^{m-1}) + dt^2 K u^m = f,
    and what it conserves without contact and load is (Hairer, Lubich, Wanner, Geometric Numerical
    Integration, section I.1)

        E = v^T M v / 2 + (u^m)^T K u^{m+1} / 2,   v = (u^{m+1} - u^m) / dt.

    With w the mean of both layers, (u^m)^T K u^{m+1} = w^T K w - dt^2 v^T K v / 4. The elastic
    part is w^T K w / 2 and the kinetic part the rest; at c dt <= h it is not negative.
    """
    u, dt = solution.displacement, np.diff(solution.times)[:, None]
    h = np.diff(solution.positions)
    velocity = np.diff(u, axis=0) / dt
    middle = 0.5 * (u[1:] + u[:-1])
    stiffness = wave_speed**2 / h
    elastic = 0.5 * (np.diff(middle, axis=1) ** 2 @ stiffness)
    dispersion = 0.125 * dt[:, 0] ** 2 * (np.diff(velocity, axis=1) ** 2 @ stiffness)
    kinetic = 0.5 * (velocity**2 @ lumped_mass(solution.positions)) - dispersion
    return kinetic, elastic
