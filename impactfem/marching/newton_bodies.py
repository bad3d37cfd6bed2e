"""What Newton's iterates of a step ask of bodies, and several bodies in one."""

from typing import Protocol

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.marching.composite import Bodies, Gathered
from impactfem.marching.layers import Stepper


class NewtonStepper(Stepper, Protocol):
    """A layer in steps that are solved by iterates.

    In each step the march asks for `begin`, then for iterates: `unbalanced`, `linearise`,
    `answers`, `correct`, and last for `accept`.

    Attributes:
        generation: Of the tangent: answers to forces change with it.
        missing: Shares of the moments of inertia that the bodies' masses have not, by name.
        massive: Contact nodes whose mass makes impacts, (count,).
        surface_velocity: Of the contact nodes at the start of the step, 0 without mass [m/s],
            (count, dim).
    """

    @property
    def generation(self) -> int:
        """See above."""

    @property
    def missing(self) -> dict[str, float]:
        """See above."""

    @property
    def massive(self) -> Booleans:
        """See above."""

    @property
    def surface_velocity(self) -> Floats:
        """See above."""

    @property
    def surface_way(self) -> Floats:
        """How far what touches at contact nodes moves in the step, by the last iterate [m].

        Of shape (count, dim). Forces do their work on it.
        """

    def touch(self, normals: Floats) -> None:
        """Learn where bodies that roll touch, by the normals of their nodes (count, dim)."""

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim) (collective)."""

    def arms(self, middle: Floats) -> Floats:
        """Displacements amid the step that moments of forces go by [m], (count, dim) (collective).

        A body of small strains turns none of its arms: they move with its centre.

        Args:
            middle: The true ones [m], (count, dim).
        """

    def unbalanced(self, forces: Floats) -> float:
        """Largest force that the iterate leaves, over what rounding and forces allow (collective).

        Args:
            forces: On the contact nodes at the mean places [N], (count, dim).
        """

    def linearise(self) -> Floats:
        """Solve for what balances the iterate; how contact nodes move by it (collective)."""

    def answers(self, forces: Floats) -> Floats:
        """How contact nodes answer to forces on them at the iterate, (several, count, dim)."""

    def correct(self, forces: Floats) -> None:
        """Move the iterate, with a change of the contact forces (count, dim) (collective).

        That of moments which `Rolling.twist` has given comes with it.
        """

    def accept(self) -> None:
        """End the step at the iterate."""

    def jolt(self, impulses: Floats) -> None:
        """Change rates now by impulses on what touches [N s], (count, dim); of what has mass."""


class NewtonBodies(Bodies[NewtonStepper]):
    """Several bodies; those that no force reaches are not asked for answers."""

    surface_velocity = Gathered()
    surface_way = Gathered()

    @property
    def generation(self) -> int:
        """Grows with each of them."""
        return sum(part.generation for part in self.parts)

    @property
    def missing(self) -> dict[str, float]:
        """Shares of the moments of inertia that their masses have not, by name."""
        return {name: share for part in self.parts for name, share in part.missing.items()}

    def touch(self, normals: Floats) -> None:
        """Learn where bodies that roll touch."""
        for part, own in self._owned:
            part.touch(normals[own])

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim)."""
        return np.concatenate([part.predicted(start, end) for part in self.parts])

    def arms(self, middle: Floats) -> Floats:
        """Displacements amid the step that moments of forces go by [m], (count, dim)."""
        return np.concatenate([part.arms(middle[own]) for part, own in self._owned])

    def unbalanced(self, forces: Floats) -> float:
        """The worst of them."""
        return float(np.max([part.unbalanced(forces[own]) for part, own in self._owned]))

    def linearise(self) -> Floats:
        """Solve for what balances all iterates; how contact nodes move by it."""
        return np.concatenate([part.linearise() for part in self.parts])

    def answers(self, forces: Floats) -> Floats:
        """How contact nodes answer to forces on them, (several, count, dim)."""
        found = np.zeros_like(forces)
        for part, own in self._owned:
            mine = forces[:, own]
            asked = np.flatnonzero(mine.any(axis=(1, 2)))
            if len(asked):
                found[asked, own] = part.answers(np.ascontiguousarray(mine[asked]))
        return found

    def correct(self, forces: Floats) -> None:
        """Move all iterates."""
        for part, own in self._owned:
            part.correct(forces[own])

    def accept(self) -> None:
        """End the step of all."""
        for part in self.parts:
            part.accept()

    def jolt(self, impulses: Floats) -> None:
        """Change the rates of all now by impulses on what touches [N s], (count, dim)."""
        for part, own in self._owned:
            part.jolt(impulses[own])
