"""What a start at rest asks of a body, linear or not, and what it finds."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from impactfem.arrays import Floats


class FreeModes(Protocol):
    """Rigid motions that supports leave free; see `impactfem.system.rigid_modes`."""

    @property
    def fields(self) -> Floats:
        """Of the owned dofs, (modes, dofs)."""

    @property
    def count(self) -> int:
        """How many there are."""

    def along(self, forces: Floats) -> Floats:
        """Parts of forces that work on each mode (collective)."""

    def forces(self, along: Floats) -> Floats:
        """Forces that accelerate the body along them."""

    def moved(self, displacement: Floats) -> Floats:
        """How far a displacement is one along each mode (collective)."""

    def of_displacement(self, displacement: Floats) -> Floats:
        """Rigid part of a displacement (collective)."""

    def push(self, along: Floats) -> float:
        """Force that would accelerate all of the body as much [N]."""

    def words(self, along: Floats) -> str:
        """The motion that forces drive and how hard."""


class Resting(Protocol):
    """A body as the search for equilibrium sees it, linear or not.

    Attributes:
        name: Of the body.
        start: Displacement from which equilibrium is sought [m], of the owned dofs.
        patience: Passes that it may take along a free motion before that counts as driven.
        modes: Its free rigid motions.
    """

    name: str
    start: Floats
    patience: int

    @property
    def modes(self) -> FreeModes:
        """See above."""

    def contact(self, place: Floats) -> Floats:
        """Displacements of the contact nodes [m], (count, dim) (collective)."""

    def touch(self, normals: Floats) -> None:
        """Learn where it touches if it rolls, by the normals of its nodes (count, dim)."""

    def touching(self, place: Floats) -> Floats:
        """Displacements of what touches at them [m], (count, dim) (collective)."""

    def moved(self, place: Floats, change: Floats) -> Floats:
        """How that moves by a small change of the owned dofs from a place [m] (collective)."""

    def pulled(self, forces: Floats, place: Floats) -> Floats:
        """Forces on the owned dofs by those on the contact nodes (count, dim) at a place."""

    def residual(self, place: Floats) -> Floats:
        """Loads less internal forces [N], without contact; not finite where there is no body."""

    def tangent(self, place: Floats) -> Callable[[Floats], Floats]:
        """What forces on the owned dofs do, linearised, with mass that holds free bodies.

        Equal functions for equal tangents: answers that are known are kept.
        """

    def steady(self) -> bool:
        """From now on answer to rigid motions by mass alone; whether that changes anything."""

    def destroy(self) -> None:
        """Free what PETSc holds."""


@dataclass(frozen=True)
class Rest:
    """Where bodies are at rest.

    Attributes:
        places: Displacements of the owned dofs of each body [m].
        surface: Displacements of all contact nodes [m], (nodes, dim).
        multiplier: Forces in the gaps [N], (gaps,).
        rubbing: Those of friction [N], (gaps, dim); 0 without any.
        forces: These on the contact nodes [N], (nodes, dim).
        residual: Forces that are left, as a share of those that act.
        iterations: Passes, and linear systems of the active sets in them.
        shifted: How far each body was moved rigidly, and how far nodes besides [m].
        neutral: Bodies on which small forces work that nothing holds: these as a share of all, and
            the motion that they drive.
    """

    places: tuple[Floats, ...]
    surface: Floats
    multiplier: Floats
    rubbing: Floats
    forces: Floats
    residual: float
    iterations: tuple[int, int]
    shifted: dict[str, tuple[float, float]]
    neutral: dict[str, tuple[float, str]]
