"""Forces in gaps of bodies that answer linearly, rigid contacts or such that give way."""

from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.complementarity import Solver
from impactfem.contact.springs import ContactSprings
from impactfem.marching.layers import Answers


@dataclass(frozen=True)
class Pressing:
    """What finds them.

    Attributes:
        solve: Solver of complementarity problems.
        tolerance: Rounding level of gaps [m].
        springs: In the gaps; None without any.
    """

    solve: Solver
    tolerance: float
    springs: ContactSprings | None = None

    def missed(self, gap: Floats, force: Floats) -> float:
        """By how much gaps are closed too far, or open under a force [m].

        Args:
            gap: Without what springs give way [m], (gaps,).
            force: [N], (gaps,).
        """
        true = gap if self.springs is None else gap + self.springs.depth(force)
        return float(max(-true.min(initial=0.0), true[force > 0.0].max(initial=0.0)))

    def find(
        self, answers: Answers, free: Floats, normals: Floats, old: Floats
    ) -> tuple[Floats, int]:
        """Forces [N], (gaps,), and systems solved (collective).

        Args:
            answers: How gaps answer to forces.
            free: Gaps if forces stay `old` while bodies move by what is left [m], (gaps,).
            normals: Of the gaps, (gaps, dim).
            old: Forces before [N], (gaps,).
        """
        taking_part, total = (old > 0.0) | (free < -self.tolerance), 0
        found = np.zeros_like(old)
        while taking_part.any():
            rows = np.flatnonzero(taking_part)
            answers.require(rows)
            compliance, _ = answers.matrices(rows, normals[rows])
            springs = None if self.springs is None else self.springs.some(rows)
            new, count = self._forces(compliance, free[rows], old[rows], springs)
            total += count
            way = answers.approach(rows, normals, new - old[rows], np.zeros(len(rows)))
            missed = (free + way < -self.tolerance) & ~taking_part
            if not missed.any():
                found[rows] = new
                break
            taking_part |= missed
        return found, total

    def _forces(
        self, compliance: Floats, free: Floats, old: Floats, springs: ContactSprings | None
    ) -> tuple[Floats, int]:
        """Those of gaps that take part."""
        offset, new = free - compliance @ old, old

        def obey(give: Floats, rest: Floats) -> tuple[Floats, Floats, int]:
            nonlocal new
            softer = compliance + np.diag(give)
            new, count = self.solve(softer, offset + rest, new > 0.0)
            # Differences of large numbers last: free bodies answer with such.
            gap = free + rest + give * new + compliance @ (new - old)
            new = _polished(softer, gap, new)
            return new, free + compliance @ (new - old), count

        if springs is None:
            none = np.zeros(len(free))
            _, _, count = obey(none, none)
        else:
            count = springs.solve(obey, offset, compliance.diagonal(), self.tolerance)
        return new, count


def _polished(compliance: Floats, gap: Floats, force: Floats) -> Floats:
    """Forces that close what rounding has left open: free bodies answer with large numbers.

    Args:
        compliance: Of the gaps [m/N], (k, k).
        gap: Gaps that the forces leave [m], (k,).
        force: [N], (k,).
    """
    closed = np.flatnonzero(force > 0.0)
    change = np.linalg.lstsq(compliance[np.ix_(closed, closed)], -gap[closed])[0]
    found = force.copy()
    found[closed] = np.maximum(force[closed] + change, 0.0)
    return found
