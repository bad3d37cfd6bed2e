"""Moments that resist rolling and spinning where balls touch, as pairs of the friction problem.

In a gap with the normal force lambda a ball is held by a moment m: along the normal |m_n| <= s
lambda, across it |m_t| <= r lambda, against the spin relative to what it touches, with lengths s
and r. They act at velocity level, as friction of nodes with mass does.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.rooted import full
from impactfem.marching.layers import ContactGaps


class Turnable(Protocol):
    """Bodies whose nodes may turn; see `impactfem.marching.composite.Composite`."""

    def turning(self) -> tuple[Floats, Floats]:
        """Spins of the body of each node at both ends of the layer [rad/s], (count, turns)."""

    def twisted(self, moments: Floats) -> tuple[Floats, Floats]:
        """Displacements of all nodes and turns of their bodies by moments on nodes."""

    def twist(self, moments: Floats) -> None:
        """Moments on nodes (count, turns) that act in the step."""


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


class Resisting:
    """Moments in gaps over the iterates of a step."""

    def __init__(self, gaps: ContactGaps, bodies: Turnable, lengths: tuple[Floats, Floats]) -> None:
        """Begin without any.

        Args:
            gaps: All gaps.
            bodies: What they are between.
            lengths: Resistance to rolling and spinning of all gaps [m].
        """
        self._gaps, self._bodies, self._lengths = gaps, bodies, lengths
        self._there: Booleans = (lengths[0] > 0.0) | (lengths[1] > 0.0)
        self.begin(0.0)

    def begin(self, span: float) -> None:
        """Begin a step of some length [s]."""
        self._span = span
        self._known: Moments | None = None
        self._part = np.zeros(0, dtype=np.int64)  # gaps that take part
        self._rows = self._part  # those that they are in
        self._found = np.zeros((0, 0))
        self._vectors: Floats = np.zeros((len(self._there), 0))

    def rest(self) -> None:
        """Nothing presses."""
        if self._known is not None:
            self._bodies.twist(self._gaps.spread(0.0 * self._vectors))
        self.begin(self._span)

    def beside(
        self, law: ConeProblem, rows: Integers, frames: Floats, start: Floats
    ) -> tuple[ConeProblem, Floats]:
        """A law of forces with that of the moments behind, and where to begin, (rows + k, dim).

        Args:
            law: Of the forces in some gaps.
            rows: The gaps.
            frames: Their directions, (rows, dim, dim).
            start: Forces that act, of those that the law asks for [N], (rows, dim).
        """
        acting = np.zeros((len(self._there), frames.shape[1]))
        if self._known is not None:
            acting[self._rows] = self._found
        found = resisting(self._gaps, self._bodies, rows, frames, self._lengths, self._span)
        self._known = found
        if found is None:
            self._rows = np.zeros(0, dtype=np.int64)
            return law, start
        self._part, self._rows = rows, rows[found.of]
        twists, matrix = acting[self._rows], full(law.matrix)
        across = found.across
        whole = np.block([[matrix, across], [across.T, found.own]])
        turns = found.after - (found.own @ twists.ravel()).reshape(twists.shape)
        turns = turns - (across.T @ start.ravel()).reshape(twists.shape)
        offset = law.offset - (across @ twists.ravel()).reshape(start.shape)
        count, more = len(rows), len(found.of)
        return replace(
            law,
            matrix=whole,
            offset=np.concatenate([offset, turns]),
            friction=np.concatenate([law.friction, found.rolling]),
            base=np.concatenate([law.base, law.base[found.of]]),
            master=np.concatenate([np.arange(count), found.of]),
            spinning=np.concatenate([np.zeros(count), found.spinning]),
            springs=None if law.springs is None else law.springs.beside(more),
        ), np.concatenate([start, twists])

    def take(self, found: Floats) -> None:
        """Let moments act that were found [N m], (k, dim)."""
        self._found = found
        if self._known is not None:
            count = len(self._there)
            self._vectors = self._known.in_gaps(self._part, count, found)
            self._bodies.twist(self._gaps.spread(self._vectors))

    def missed(self, pressing: Floats) -> float:
        """How far the moments are from their law, as ways of what rolls [m].

        Args:
            pressing: Normal forces in the gaps [N], (gaps,).
        """
        rows, known = self._rows, self._known
        if not np.isin(np.flatnonzero((pressing > 0.0) & self._there), rows).all():
            return np.inf  # by how much they yield is not known yet
        if known is None:
            return 0.0
        each = np.arange(len(rows))
        spin = self._gaps.relative(self._bodies.turning()[1])[rows]
        after = 0.5 * self._span * np.einsum("kwt,kt->kw", known.directions, spin)
        shape = *self._found.shape, *self._found.shape
        yields = known.own.reshape(shape)[each, :, each].diagonal(axis1=1, axis2=2).copy()
        yields[:, 1:] = yields[:, 1:].mean(axis=1, keepdims=True)
        yields[yields <= 0.0] = np.inf  # in the plane nothing turns about the normal
        trial = self._found - after / yields
        bounds = np.stack([known.spinning, known.rolling], axis=1) * pressing[rows, None]
        sizes = np.stack([np.abs(trial[:, 0]), np.linalg.norm(trial[:, 1:], axis=1)], axis=1)
        share = np.minimum(1.0, bounds / np.maximum(sizes, np.finfo(float).tiny))
        wrong = np.abs(self._found - np.repeat(share, [1, trial.shape[1] - 1], axis=1) * trial)
        moved = known.across.reshape(-1, *shape[1:])[known.of, :, each]
        radius = np.linalg.norm(moved, axis=(1, 2)) / np.linalg.norm(
            known.own.reshape(shape)[each, :, each], axis=(1, 2)
        )
        turns = np.where(np.isfinite(yields), yields, 0.0) * wrong
        return float((radius[:, None] * turns).max())

    def work(self) -> Floats | float:
        """What they do in the step [J], (gaps,)."""
        if self._known is None:
            return 0.0
        before, after = map(self._gaps.relative, self._bodies.turning())
        turned: Floats = np.einsum("ij,ij->i", self._vectors, before + after)
        return 0.5 * self._span * turned
