"""Moments that resist rolling and spinning where balls touch, as pairs of the friction problem.

In a gap with the normal force lambda a ball is held by a moment m: along the normal |m_n| <= s
lambda, across it |m_t| <= r lambda, against the spin relative to what it touches, with lengths s
and r. They act at velocity level, as friction of nodes with mass does.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.marching.layers import ContactGaps


class Turnable(Protocol):
    """Bodies whose nodes may turn; see `impactfem.marching.composite.Composite`."""

    def turning(self) -> tuple[Floats, Floats]:
        """Spins of the body of each node at both ends of the layer [rad/s], (count, turns)."""

    def twisted(self, moments: Floats) -> tuple[Floats, Floats]:
        """Displacements of all nodes and turns of their bodies by moments on nodes."""


@dataclass(frozen=True)
class Moments:
    """Moments in some gaps, in the layout of forces: along the normal first, in the plane 0.

    Attributes:
        of: Which of the gaps that take part they are in, (k,).
        directions: Of the moments, (k, dim, turns).
        across: Answers of the gaps to them, (gaps dim, k dim) [rad/N].
        own: Turns by them, (k dim, k dim) [rad/(N m)].
        after: Relative spin at the end without them times dt / 2 [rad], (k, dim).
        way: Relative turn without them [rad], (k, dim).
        rolling, spinning: Lengths r and s [m], (k,).
    """

    of: Integers
    directions: Floats
    across: Floats
    own: Floats
    after: Floats
    way: Floats
    rolling: Floats
    spinning: Floats

    def in_gaps(self, rows: Integers, count: int, moments: Floats) -> Floats:
        """Vectors in all gaps [N m], (count, turns), of components (k, dim)."""
        found = np.zeros((count, self.directions.shape[2]))
        found[rows[self.of]] = np.einsum("kwt,kw->kt", self.directions, moments)
        return found


def resisting(
    gaps: ContactGaps,
    bodies: Turnable,
    rows: Integers,
    frames: Floats,
    lengths: tuple[Floats, Floats],
    dt: float,
) -> Moments | None:
    """Moments in gaps that take part; None if nothing resists in them.

    Args:
        gaps: All gaps.
        bodies: What they are between.
        rows: Those that take part.
        frames: Their directions, the normal first, (rows, dim, dim).
        lengths: Resistance to rolling and spinning of all gaps [m].
        dt: Step [s].
    """
    rolling, spinning = (each[rows] for each in lengths)
    of = np.flatnonzero((rolling > 0.0) | (spinning > 0.0))
    if not len(of):
        return None
    chosen, dim, count = rows[of], frames.shape[1], len(of)
    ways = frames[of] if dim == 3 else np.tile([[0.0], [1.0]], (count, 1, 1))
    units = gaps.units(chosen, ways)
    moved, turned = bodies.twisted(units.reshape(-1, *units.shape[2:]))
    relative = np.array([gaps.relative(each)[rows] for each in moved])
    turns = np.array([gaps.relative(each)[chosen] for each in turned])
    before, after = (gaps.relative(spin)[chosen] for spin in bodies.turning())
    own = np.einsum("kwt,akt->kwa", ways, turns).reshape(count * dim, -1)
    return Moments(
        of,
        ways,
        np.einsum("rij,arj->ria", frames, relative).reshape(len(rows) * dim, -1),
        0.5 * (own + own.T),
        0.5 * dt * np.einsum("kwt,kt->kw", ways, after),
        0.5 * dt * np.einsum("kwt,kt->kw", ways, before + after),
        rolling[of],
        spinning[of],
    )
