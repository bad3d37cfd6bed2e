"""What explicit levels under finite strain ask of bodies, and several bodies in one."""

from typing import Protocol

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.marching.composite import Bodies, Gathered
from impactfem.marching.layers import Stepper


class LevelStepper(Stepper, Protocol):
    """A layer in explicit steps, whose contact nodes are brought to equilibrium at each level.

    In each step the march asks for `begin`, which takes the inside to its end and guesses where
    the surface is, then for `unbalanced`, `relaxed`, `answers` and
    `move_surface` in turns, then for `balance`, `receive` and `close`.
    """

    @property
    def missing(self) -> dict[str, float]:
        """Shares of the moments of inertia that the bodies' masses have not, by name."""

    @property
    def most(self) -> int:
        """Steps of the layers so far, at most."""

    @property
    def between(self) -> Floats:
        """Part of the energy of each body that comes from two levels, of this rank [J]."""

    @property
    def rounding(self) -> float:
        """Of forces on the surface [N]."""

    @property
    def lag(self) -> float:
        """Share of forces that an iterate leaves as tangents know no pressures (collective)."""

    @property
    def yields(self) -> Booleans:
        """Whether forces at a level move contact nodes along each direction, (count, dim)."""

    @property
    def rolled(self) -> Floats:
        """How far what touches has moved in the step besides its node [m], (count, dim)."""

    def touch(self, normals: Floats) -> None:
        """Learn where bodies that roll touch, by the normals of their nodes (count, dim)."""

    def pieces(self) -> int:
        """Steps that the next layer takes (collective)."""

    def move_surface(self, place: Floats) -> None:
        """Put the contact nodes somewhere, (count, dim) [m]."""

    def unbalanced(self) -> Floats:
        """Forces with which contact nodes press outwards [N], (count, dim) (collective)."""

    def renew(self) -> None:
        """Take the tangent of the surface where the bodies are now (collective)."""

    def relaxed(self, right: Floats, held: Booleans, normals: Floats) -> Floats:
        """How contact nodes move by forces [m], (count, dim)."""

    def answer(self, right: Floats) -> Floats:
        """The same without any held, as exactly as `answers` [m], (count, dim)."""

    def answers(self, nodes: Integers) -> Floats:
        """How contact nodes move by unit forces on some of them [m/N], (some, dim, count, dim)."""

    def balance(self) -> Floats:
        """All forces at the level; those of contact nodes as `unbalanced` has them (collective)."""

    def receive(self, left: Floats, *, first: bool = False) -> None:
        """Hand what the surface leaves unbalanced (count, dim) [N] to the inside; accelerate it."""

    def close(self, left: Floats) -> None:
        """End the step; forces (count, dim) [N] are taken off it alone, with those of the level."""


class LeapfrogBodies(Bodies[LevelStepper]):
    """Several bodies in explicit steps."""

    between = Gathered()
    yields = Gathered()
    rolled = Gathered()

    @property
    def missing(self) -> dict[str, float]:
        """Shares of the moments of inertia that their masses have not, by name."""
        return {name: share for part in self.parts for name, share in part.missing.items()}

    @property
    def most(self) -> int:
        """Of any of them."""
        return max(part.most for part in self.parts)

    @property
    def rounding(self) -> float:
        """The largest of them."""
        return max(part.rounding for part in self.parts)

    @property
    def lag(self) -> float:
        """The largest of them."""
        return max(part.lag for part in self.parts)

    def touch(self, normals: Floats) -> None:
        """Learn where bodies that roll touch."""
        for part, own in self._owned:
            part.touch(normals[own])

    def pieces(self) -> int:
        """Steps that the next layer takes: those of the body that needs most."""
        return max(part.pieces() for part in self.parts)

    def move_surface(self, place: Floats) -> None:
        """Put the contact nodes somewhere."""
        for part, own in self._owned:
            part.move_surface(place[own])

    def unbalanced(self) -> Floats:
        """Forces with which contact nodes press outwards [N], (count, dim)."""
        return np.concatenate([part.unbalanced() for part in self.parts])

    def renew(self) -> None:
        """Take the tangents of the surfaces."""
        for part in self.parts:
            part.renew()

    def relaxed(self, right: Floats, held: Booleans, normals: Floats) -> Floats:
        """How contact nodes move by forces [m], (count, dim)."""
        each = self._owned
        return np.concatenate([p.relaxed(right[o], held[o], normals[o]) for p, o in each])

    def answer(self, right: Floats) -> Floats:
        """The same without any held, as exactly as `answers` [m], (count, dim)."""
        return np.concatenate([part.answer(right[own]) for part, own in self._owned])

    def answers(self, nodes: Integers) -> Floats:
        """How contact nodes move by unit forces on some of them, 0 of other bodies."""
        dim = self.surface_displacement.shape[1]
        found = np.zeros((len(nodes), dim, self.offsets[-1], dim))
        for part, own in self._owned:
            mine = np.flatnonzero((nodes >= own.start) & (nodes < own.stop))
            if len(mine):
                found[mine, :, own] = part.answers(nodes[mine] - own.start)
        return found

    def balance(self) -> Floats:
        """All forces at the level."""
        return np.concatenate([part.balance() for part in self.parts])

    def receive(self, left: Floats, *, first: bool = False) -> None:
        """Hand what the surfaces leave unbalanced to the inside."""
        for part, own in self._owned:
            part.receive(left[own], first=first)

    def close(self, left: Floats) -> None:
        """End the step."""
        for part, own in self._owned:
            part.close(left[own])
