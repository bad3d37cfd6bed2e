"""How much a body turns: moments of its momentum about its centre, as a scheme's mass has them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.fem import MPI
from impactfem.system.rigid_modes import unit_spins


@dataclass(frozen=True)
class Turning:
    """Moments of the momenta of nodes with the arms of the undeformed body.

    A linearised motion knows no others: with arms that move along, internal forces would have
    moments, and a body that nothing touches would not keep its angular momentum.

    Attributes:
        arms: From the centre of mass to the nodes this rank owns [m], (nodes, dim).
        rows: Angular momentum of unit momenta of the dofs [m], (1 or 3, dofs).
        inertia: Of all ranks [kg m^2], (1, 1) or (3, 3).
    """

    arms: Floats
    rows: Floats
    inertia: Floats

    @classmethod
    def of(cls, system: Any, momenta: Callable[[Floats], Floats]) -> "Turning":
        """Prepare (collective).

        Args:
            system: The body, an `impactfem.system.elastic.ElasticSystem`.
            momenta: Momenta of the owned dofs for their velocities, with the mass of the scheme.
        """
        dim, places = system.dim, system.positions
        size = dim * (dim - 1) // 2

        def total(values: Floats) -> Floats:
            return np.asarray(system.comm.allreduce(values, op=MPI.SUM))

        mass = np.array(momenta(np.ones(places.size))).reshape(places.shape)
        moved = total(mass.sum(axis=0))
        centre = total((mass * places).sum(axis=0)) / np.where(moved > 0.0, moved, 1.0)
        # An axis undoes on one side what the other one does.
        arms = np.zeros_like(places) if system.axisymmetric else places - centre
        spins = np.array(unit_spins(arms))
        # Momentum p at an arm: (a x p) . e = p . (e x a), so that the rows are the unit spins.
        rows = np.ascontiguousarray(spins.reshape(size, -1))
        inertia = np.stack([rows @ np.array(momenta(row)) for row in rows], axis=1)
        return cls(arms, rows, total(inertia))
