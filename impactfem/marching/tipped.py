"""Layers of a solid whose tips joints hold, see `impactfem.system.tips`; implicit ones.

Its coordinates, for joints, are places and turns of the tips: how impulses there move all of it is
solved for once. Contact forces go to the massless nodes as without joints.
"""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, cast

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Booleans, Floats
from impactfem.marching.held_rows import HeldLumped
from impactfem.marching.layers import Sums
from impactfem.marching.midpoint import Midpoint
from impactfem.marching.stations import Held
from impactfem.system.linear import of_mass
from impactfem.system.stations import Stations
from impactfem.system.surface import SurfaceNodes


class Tipped(ABC):
    """Tips of an interior: what joints ask of it.

    Attributes:
        blocks: Kinds of displacements of all contact nodes that `_unit` tells.
    """

    blocks = 1
    _still: Booleans  # owned dofs that nothing pulls
    _surface: SurfaceNodes

    def _take_tips(self, nodes: SurfaceNodes, stations: Stations | None) -> None:
        """Take tips, whose rows are those of nodes; None: nothing holds it."""
        each = np.zeros((0, 0)) if stations is None else stations.rows
        self._tips, rows = nodes, each.reshape(int(np.prod(each.shape[:-1])), each.shape[-1])
        self._moves = np.flatnonzero(rows.any(axis=1))  # in the plane not all
        self._rows: Floats = rows[self._moves]
        self._units: dict[int, Floats] = {}  # answers to unit forces

    def _pull(self, row: Floats) -> Floats:
        """Forces on the owned dofs by one on nodes of the tips."""
        return self._tips.pulled(row.reshape(-1, self._tips.dim), self._still)

    def _of_tips(self, values: Floats) -> Floats:
        """Coordinates of the tips by those of owned dofs (..., dofs), (..., d) (collective)."""
        if values.ndim > 1:
            return np.array([self._of_tips(each) for each in values])
        return np.asarray(self._rows @ self._tips.gather(values).ravel())

    def held(self, stations: Stations) -> Held:
        """It as joints hold it."""
        count = len(stations.places)
        rows = np.eye(6 * count)[:, self._moves].reshape(count, 6, -1)
        return HeldLumped(cast("Any", self), replace(stations, rows=rows))

    def look(self) -> None:  # noqa: B027  (of others)
        """Nothing: contact nodes move with each force."""

    def kick(self, impulse: Floats) -> None:
        """Let the next layer start with rates that an impulse (d,) has changed."""
        self._kick = impulse

    @abstractmethod
    def _unit(self, force: Floats) -> list[Floats]:
        """What a force on contact nodes (count, dim) does to these, last to the tips."""

    def _by_units(self, forces: Floats) -> list[Floats]:
        """The same by several forces (several, count, dim), (several, ...) each, which is kept."""
        flat, kept = forces.reshape(len(forces), -1), self._units
        acting, size = np.flatnonzero(flat.any(axis=0)).tolist(), flat.shape[1]
        for dof in acting:
            if dof not in kept:
                unit = np.zeros(size)
                unit[dof] = 1.0
                each = self._unit(unit.reshape(forces.shape[1:]))
                kept[dof] = np.concatenate([values.ravel() for values in each])
        wide = self.blocks * size + len(self._rows)
        known = np.array([kept[dof] for dof in acting]).reshape(len(acting), wide)
        found = np.asarray(csr_matrix(flat[:, acting]) @ known)  # most forces are on few nodes
        *moved, tips = np.split(found, [size * (k + 1) for k in range(self.blocks)], axis=1)
        return [*(each.reshape(forces.shape) for each in moved), tips]


class TippedMidpoint(Tipped, Midpoint):
    """Implicit interior with tips, by d coordinates of these.

    Attributes:
        counts: Whether this rank adds up what the joints of its tips store.
        span: Of the step [s].
    """

    def with_tips(self, nodes: SurfaceNodes, stations: Stations | None) -> "TippedMidpoint":
        """Take tips, whose rows are those of nodes, and solve for what impulses do (collective).

        Raises:
            ConvergenceError: A matrix cannot be factored.
        """
        self.counts, self.span = self._surface.comm.rank == 0, self.dt
        self._take_tips(nodes, stations)
        pulls = [self._pull(row) for row in self._rows]
        self._by_impulses = np.array([self._solved(pull) for pull in pulls]) / self.dt
        self._touched = np.array([self._answer_of_contact(each) for each in self._by_impulses])
        self.reach = 2.0 / self.dt * self._of_tips(self._by_impulses).T
        self._by_kicks = self._kicked(pulls)
        self.reach_ahead, self.noise = self._of_tips(self._by_kicks).T, 0.0
        self._renew()
        return self

    def _kicked(self, pulls: list[Floats]) -> Floats:
        """Velocities by unit impulses that leave no time for anything else, (d, owned dofs)."""
        solver = of_mass(self._system.stiffness, self._mass, self._still, self._kind)
        found = np.zeros((len(pulls), len(self._still)))
        for k, pull in enumerate(pulls):
            self._right.setArray(pull)
            self._middle.set(0.0)
            solver.solve(self._right, self._middle)
            found[k] = self._middle.getArray()
        solver.destroy()
        return found

    def _renew(self) -> None:
        """Take coordinates and rates of the tips from the body (collective)."""
        self.joined_coordinates = self._of_tips(self.displacement)
        self.rates = self._of_tips(self.velocity)
        self._way = self._joined = self._kick = np.zeros(len(self._rows))

    @property
    def rates_ahead(self) -> Floats:
        """Rates of the coordinates at the end of the layer, as it is solved now, (d,)."""
        return np.asarray(2.0 / self.dt * self._way - self.rates)

    rates_left = rates_ahead

    def set_out(self, start: float, end: float) -> None:
        """Solve a step between two times without forces of contact and joints."""
        self.begin(start, end)
        self._way = self._of_tips(self.displacement - self._before)
        self._joined = self._kick = np.zeros(len(self._rows))

    def impel(self, impulse: Floats) -> bool:
        """Solve the layer with an impulse of joints (d,); it answers linearly."""
        change = impulse - self._joined
        self._joined = impulse
        self.displacement += change @ self._by_impulses
        self._contact = self._contact + np.tensordot(change, self._touched, axes=1)
        self._way = self._way + 0.5 * self.dt * self.reach @ change
        return True

    def strike(self, forces: Floats) -> None:
        """Add the layer's contact forces (count, dim)."""
        answer = self._answer(forces)
        self.displacement += answer
        self._contact = self._contact + self._answer_of_contact(answer)
        self._way = self._way + self._of_tips(answer)

    def _unit(self, force: Floats) -> list[Floats]:
        """See `Tipped`."""
        answer = self._answer(force)
        return [self._answer_of_contact(answer), self._of_tips(answer)]

    def reached(self, forces: Floats) -> Floats:
        """Rates by several contact forces (several, count, dim) for a second, (several, d)."""
        return 2.0 / self.dt**2 * self._by_units(forces)[1]

    def carried(self, impulses: Floats) -> Floats:
        """Velocities of the contact nodes by impulses on the tips, (several, count, dim)."""
        return 2.0 / self.dt * np.tensordot(impulses, self._touched, axes=1)

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Answers of the contact nodes to several forces in a layer, without joints."""
        static = np.array([self.static(force) for force in forces]).reshape(forces.shape)
        return self._by_units(forces)[0], static

    def answers(self, forces: Floats) -> tuple[Floats, Floats]:
        """The same: joints ask in every layer, and answers to unit forces are kept."""
        return self.columns(forces)

    def finish(self, static: Floats) -> list[Sums]:
        """End the layer and sum up."""
        # Velocities turn round in a layer, and what they begin with, too.
        self.velocity -= self._kick @ self._by_kicks
        sums = super().finish(static)
        self._renew()
        return sums

    def restore(self, state: dict[str, Any], surface: Floats) -> None:
        """Continue from a state."""
        super().restore(state, surface)
        self._renew()
