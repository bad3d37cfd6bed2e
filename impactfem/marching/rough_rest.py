"""Friction of bodies that come to rest: Coulomb's law on what slipped since gaps have closed.

Forces obey |T| <= mu Lambda, T = -mu Lambda s / |s| in slip and s = 0 in stick, with the static
coefficient and the ways s of gaps along their tangents from where they first pressed: as if all
loads began to act at once on bodies that touch. What friction could hold in many ways is held so.
"""

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solver import solve
from impactfem.contact.rooted import full
from impactfem.marching.layers import DirectedAnswers
from impactfem.marching.pressing import Pressing
from impactfem.marching.rubbing import Friction, frames, in_space, turned


class Rough:
    """What finds forces with friction in the passes of a search.

    Attributes:
        forces: Tangential ones [N], (gaps, dim).
    """

    def __init__(self, law: Friction, pressing: Pressing, dim: int) -> None:
        """Begin without forces."""
        self._law, self._pressing = law, pressing
        self.forces: Floats = np.zeros((len(law.coefficients), dim))
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self.forces = self._before = np.zeros_like(self.forces)
        self._from = np.full_like(self.forces, np.nan)  # where gaps first pressed

    def take(self, part: float) -> None:
        """Take a part of the last change only."""
        self.forces = self._before + part * (self.forces - self._before)

    def find(
        self,
        answers: DirectedAnswers,
        free: Floats,
        places: tuple[Floats, Floats],
        normals: Floats,
        old: Floats,
    ) -> tuple[Floats, int]:
        """Normal forces [N], (gaps,), and systems solved; tangential ones are kept (collective).

        Args:
            answers: How gaps answer to forces.
            free: Gaps if forces stay while bodies move by what is left [m], (gaps,).
            places: Relative places of the gaps, and how these change so [m], (gaps, dim) each.
            normals: Of the gaps, (gaps, dim).
            old: Normal forces before [N], (gaps,).
        """
        here, ways = places
        tolerance, springs = self._pressing.tolerance, self._pressing.springs
        taking_part, total = (old > 0.0) | (free < -tolerance), 0
        directions = frames(normals)
        own = turned(directions, self.forces)
        own[:, 0] = old
        self._before, found = self.forces, np.zeros_like(own)
        while taking_part.any():
            rows = np.flatnonzero(taking_part)
            begun = np.where(np.isnan(self._from), here, self._from)
            slip = turned(directions, here + ways - begun)
            slip[:, 0] = free
            answers.require(rows)
            compliance, _ = answers.blocks(rows, directions[rows])
            matrix = full(compliance)
            offset = slip[rows] - (matrix @ own[rows].ravel()).reshape(len(rows), -1)
            soft = None if springs is None else springs.some(rows)
            law = ConeProblem(
                matrix, offset, self._law.static[rows], np.zeros(len(rows)), springs=soft
            )
            new, count = solve(law, own[rows], self._law.solving)
            total += count
            change = in_space(directions[rows], new - own[rows])
            moved = answers.moved(rows, change, np.zeros_like(change))
            after = free + np.einsum("ij,ij->i", normals, moved)
            missed = (after < -tolerance) & ~taking_part
            if not missed.any():
                found[rows] = new
                self._from = np.where(taking_part[:, None], begun, np.nan)
                break
            taking_part |= missed
        self.forces = in_space(directions[:, 1:], found[:, 1:])
        return found[:, 0], total
