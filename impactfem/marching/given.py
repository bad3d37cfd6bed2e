"""What the Petrov-Galerkin recursion of a bar is given, in SI units, and its reversed sweep."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.marching import kernels
from impactfem.scene import Bar, PiecewiseConstant
from impactfem.system.chain import Chain
from impactfem.system.ends import end_means, end_ways
from impactfem.system.fronts import element_speeds
from impactfem.system.sections import lumped, node_loads, row_loads

Marks = NDArray[np.int8]


class Given(NamedTuple):
    """All numbers that a run depends on, or derivatives by them.

    Attributes:
        element_mass: [kg], (elements,).
        stiffness: Of each element [N/m].
        velocity: Of the nodes at t = 0, weighted with their hat functions [m/s], (nodes,).
        speeds: Of the middles of the elements [m/s].
        start: u at t = 0 [m], (nodes,).
        gravity: Mean in each layer [m/s^2], (layers,).
        forces: Mean load on the nodes in each layer [N], as `node_loads` has them.
        ends: Mean force on the far end in each layer [N], (layers,).
        ways: Of a far end that is held, in each layer [m], (layers,).
        gap: Of the bar without displacement [m], (1,).
        moments: Of the mass of each element about the near end [kg m], (elements,).
    """

    element_mass: Floats
    stiffness: Floats
    velocity: Floats
    speeds: Floats
    start: Floats
    gravity: Floats
    forces: Floats
    ends: Floats
    ways: Floats
    gap: Floats
    moments: Floats

    @classmethod
    def of(cls, bar: Bar, gravity: PiecewiseConstant, travel: Floats, times: Floats) -> Self:
        """Of a bar, its nodes as in `Bar.places` and levels [s]."""
        chain, section = Chain.of_bar(bar, travel), bar.section
        free = bar.far_end != "clamped"
        none = np.zeros(len(times) - 1)
        return cls(
            section * chain.element_mass, section * chain.stiffness, chain.velocity,
            element_speeds(bar, chain), chain.displacement,
            gravity.integral(times[:-1], times[1:]) / np.diff(times),
            section * node_loads(bar, times, travel),
            bar.impedance * end_means(bar, times) if free and bar.is_driven else none,
            none if free else end_ways(bar, times),
            np.array([bar.gap]), bar.moments(travel),
        )  # fmt: skip

    @property
    def mass(self) -> Floats:
        """Of the nodes [kg]."""
        return lumped(self.element_mass)

    def zeros(self) -> Self:
        """Of the same shapes."""
        return type(self)(*map(np.zeros_like, self))


def reversed_sweep(
    given: Given, dt: float, clamped: bool, u: Floats, multiplier: Floats, marks: Marks,
    last: int, of_u: Floats, of_multiplier: Floats, found: Given,
) -> None:  # fmt: skip
    """Add to the derivatives of a number by all that is given those through the motion.

    Args:
        given: Of the run.
        dt: Layer [s].
        clamped: Whether the far end is held.
        u: Its motion [m], (layers + 1, nodes).
        multiplier: Of each layer, the force against the axis [N].
        marks: Sets of the layers, 0 or 1.
        last: Level after which nothing counts.
        of_u: Derivative by the motion; used up.
        of_multiplier: Derivative by the multiplier; used up.
        found: Added to.
    """
    layers = len(multiplier)
    of_mass, of_rows, of_pushes = np.zeros(len(given.start)), np.zeros(layers), np.zeros(layers)
    kernels.two_step_reversed(
        given.mass, given.stiffness, dt, clamped, given.forces,
        row_loads(given.ends[:, None], layers)[:, 0], u, multiplier, marks, last,
        of_u, of_multiplier,
        of_mass, found.stiffness, found.velocity, of_rows, found.forces, of_pushes, found.ways,
    )  # fmt: skip
    found.start[:] += of_u[0]
    found.element_mass[:] += 0.5 * (of_mass[1:] + of_mass[:-1])
    for rows, means in ((of_rows, found.gravity), (of_pushes, found.ends)):
        means[0] += rows[0]
        means[1:] += 0.5 * rows[1:]
        means[:-1] += 0.5 * rows[1:]
