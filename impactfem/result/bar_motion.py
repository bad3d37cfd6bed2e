"""The motion of a bar as every method returns it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.findings import Finding


@dataclass(frozen=True)
class Effort:
    """How a method got its answer.

    Attributes:
        num_unknowns: Unknowns of the linear systems, or of one layer times layers.
        iterations: Active-set iterations (of the worst window, where there are several).
        set_changes: Changes of the active set after each iteration (of that window).
        converged: Whether every active set stood still.
        message: How the iteration ended, in words.
        details: Further figures of the method, for the summary (plain data).
        findings: What the run found that a user should know before trusting it.
        measured: Codes of findings that the run has looked for; its plan's are then settled.
        force_window: Time [s] over which the largest force is told as a mean; 0 where the forces
            of single rows are right.
        least_window: Part of it [s] that is not shortened for short contacts, as impacts on meshes
            of plates are that belong to one.
        iterates: Gap [m] and contact force [N] (of bars' solvers lambda L / c^2 [m]) after each
            linear solve of an active set that has all layers at once; empty if they are many.
        bodies: Mass, inertia, rotation and strains of bodies, as ``summary.json`` has them.
    """

    num_unknowns: int = 0
    iterations: int = 0
    set_changes: tuple[int, ...] = ()
    converged: bool = True
    message: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    measured: tuple[str, ...] = ()
    force_window: float = 0.0
    least_window: float = 0.0
    bodies: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    iterates: tuple[tuple[Floats, Floats], ...] = ()

    KEPT: ClassVar[int] = 20_000  # numbers of iterates


@dataclass(frozen=True)
class BarMotion:
    """Motion of a bar at its time levels; energies and momentum are per rho A.

    Rows of "layer" quantities belong to the layer (t_{m-1}, t_m]; row 0 is the initial state.

    Attributes:
        times: t_m [s], shape (layers + 1,).
        positions: Node positions from the near end [m], shape (nodes,).
        kept: Levels at which the fields are kept, shape (kept,).
        displacement: u at the kept levels [m], shape (kept, nodes).
        velocity: u_t at the kept levels [m/s], shape (kept, nodes).
        gap: u(t_m, 0) [m], shape (layers + 1,).
        multiplier: lambda = c^2 u_x(t, 0) of each layer [m^2/s^2], <= 0 in contact, (layers,).
        active: Layers in which contact is active, shape (layers,).
        kinetic: Kinetic energy of each layer [m^3/s^2], shape (layers + 1,).
        elastic: Elastic energy of each layer [m^3/s^2], shape (layers + 1,).
        potential: p(0) u(0) L minus the work of loads [m^3/s^2], shape (layers + 1,).
        mean_displacement: Displacement of the centre of mass at t_m [m], shape (layers + 1,).
        mean_velocity: Velocity of the centre of mass in each layer [m/s], shape (layers + 1,).
        end_work: Work of the load along it and of what drives its far end, which the potential
            counts [m^3/s^2], shape (layers + 1,).
        effort: How the method got there.
    """

    times: Floats
    positions: Floats
    kept: NDArray[np.int64]
    displacement: Floats
    velocity: Floats
    gap: Floats
    multiplier: Floats
    active: NDArray[np.bool_]
    kinetic: Floats
    elastic: Floats
    potential: Floats
    mean_displacement: Floats
    mean_velocity: Floats
    end_work: Floats
    effort: Effort = field(default_factory=Effort)

    @property
    def is_finite(self) -> bool:
        """Whether all displacements and multipliers are finite."""
        return all(
            bool(np.isfinite(values).all())
            for values in (self.displacement, self.gap, self.multiplier)
        )


def kept_levels(layers: int, every: int) -> NDArray[np.int64]:
    """Every ``every``-th level from 0 on, and the last one."""
    levels = np.arange(0, layers + 1, every)
    return levels if levels[-1] == layers else np.append(levels, layers)
