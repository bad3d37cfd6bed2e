"""The motion of a solid as every time scheme returns it, and the history made of it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from impactfem.result.bar_motion import Effort
from impactfem.result.history import BodyMotion, Columns, make_history
from impactfem.result.table import Table

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SolidMotion:
    """Motion of a solid at its time levels, summed over all ranks; fields go to a `FieldSpool`.

    Rows of "layer" quantities belong to the layer (t_{m-1}, t_m]; row 0 is the initial state.

    Attributes:
        times: t_m [s], shape (rows,).
        gap: Smallest gap of all contact nodes at t_m [m], >= 0 open, shape (rows,).
        contact_force: Sum of the normal forces on the contact nodes during the layer [N], >= 0,
            shape (rows,).
        kinetic: Kinetic energy of each layer [J], shape (rows,).
        elastic: Elastic energy of each layer [J], shape (rows,).
        potential: Minus the work that gravity, loads and moved supports and obstacles have done
            up to the layer, plus a constant of choice [J], shape (rows,); then the total of a
            scheme that conserves energy is constant.
        momentum: Linear momentum along ``direction`` in each layer [kg m/s], shape (rows,).
        direction: Unit vector of the momentum, as the first obstacle's normal, shape (3,).
        active: Number of contact nodes that are active in the layer, shape (rows,).
        position: Centre of mass at t_m [m], shape (rows, 3).
        velocity: Velocity of the centre of mass in each layer [m/s], shape (rows, 3).
        effort: How the scheme got there.
    """

    times: Floats
    gap: Floats
    contact_force: Floats
    kinetic: Floats
    elastic: Floats
    potential: Floats
    momentum: Floats
    direction: Floats
    active: NDArray[np.int64]
    position: Floats
    velocity: Floats
    effort: Effort = field(default_factory=Effort)

    @property
    def total(self) -> Floats:
        """Sum of the energies [J], shape (rows,)."""
        return self.kinetic + self.elastic + self.potential

    @property
    def is_finite(self) -> bool:
        """Whether forces, energies and the motion of the centre of mass are finite."""
        return all(
            bool(np.isfinite(values).all())
            for values in (self.contact_force, self.total, self.position, self.velocity)
        )


def solid_history(motion: SolidMotion, name: str) -> Table:
    """History of a motion, in the columns of the contract.

    Args:
        motion: The motion.
        name: Name of the body, for the columns of its centre of mass.
    """
    history = make_history(
        Columns(
            time=motion.times,
            gap=motion.gap,
            contact_force=motion.contact_force + 0.0,  # no negative zeros
            kinetic_energy=motion.kinetic,
            elastic_energy=motion.elastic,
            potential_energy=motion.potential,
            momentum=motion.momentum,
            active=motion.active,
            bodies={name: BodyMotion(motion.position, motion.velocity)},
        )
    )
    history["momentum"].attrs["direction"] = np.asarray(motion.direction, dtype=np.float64)
    along = ", ".join(f"{component:.6g}" for component in motion.direction)
    history["momentum"].attrs["long_name"] = f"linear momentum along ({along})"
    history["contact_force"].attrs["comment"] = (
        "sum of the normal forces on the body during (t_{m-1}, t_m]"
    )
    history["potential_energy"].attrs["comment"] = "minus the work of gravity and other loads"
    return history
