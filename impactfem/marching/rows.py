"""What a march shows of a level, and what each layer leaves in the history."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.marching.layers import Stepper, Sums, SumsTable


class Level:
    """State at the end of a layer, as observers see it.

    Attributes:
        layer: Number of layers done.
        time: [s].
        force: Normal force of each contact node during the layer [N], shape (count,).
        gap: True gap of each contact node [m], shape (count,).
    """

    def __init__(
        self,
        interior: Stepper,
        layer: int,
        static: Floats,
        force: Floats,
        gap: Floats,
        vectors: Callable[[], Floats],
        spread: Callable[[Floats], Floats],
        normals: Floats,
    ) -> None:
        """Show a level of an interior.

        Args:
            interior: At the end of a layer.
            layer: Number of layers done.
            static: Displacement of massless nodes by the multipliers [m], (count, dim).
            force: See above.
            gap: See above.
            vectors: Gives `forces`.
            spread: From forces in the gaps to those on the contact nodes.
            normals: Of the gaps, (gaps, dim).
        """
        self._interior, self._static = interior, static
        self._vectors, self._spread, self._normals = vectors, spread, normals
        self.layer, self.time = layer, layer * interior.dt
        self.force, self.gap = force, gap

    @cached_property
    def displacement(self) -> Floats:
        """Displacement of the dofs this rank owns, contact included [m]."""
        return self._interior.placed(self._static)

    @cached_property
    def straining(self) -> Floats:
        """Displacement whose elastic stress is that of the bodies: more where they relax [m]."""
        own = getattr(self._interior, "straining", None)
        return self.displacement if own is None else np.asarray(own(self._static))

    @property
    def velocity(self) -> Floats:
        """Velocity of the dofs this rank owns [m/s]."""
        return self._interior.velocity

    @property
    def surface(self) -> Floats:
        """Displacement of the contact nodes, contact included [m], (nodes, dim)."""
        return self._interior.surface_displacement + self._static

    @cached_property
    def forces(self) -> Floats:
        """Lasting forces in the gaps, friction included [N], (pairs, dim)."""
        return self._vectors()

    @cached_property
    def nodal_forces(self) -> Floats:
        """The same on the contact nodes [N], (nodes, dim)."""
        return self._spread(self.forces)

    @property
    def nodal_normals(self) -> Floats:
        """Unit vectors along which contact pushes, without friction, (nodes, dim); 0 elsewhere."""
        pushed = self._spread(self.force[:, None] * self._normals)
        size = np.linalg.norm(pushed, axis=1, keepdims=True)
        found: Floats = pushed / np.where(size > 0.0, size, 1.0)
        return found


OF_RANKS = ("sums", "attitude", "probes", "early")
"""Rows to which each rank adds its part; the others are the same on all ranks."""


@dataclass
class Rows:
    """What each layer leaves in the history; row 0 is the initial state.

    Attributes:
        sums: Kinetic, elastic, work of loads, momentum, first moment of mass and angular momentum
            of each body, of this rank, (rows, bodies, 3 + 2 dim + 1 or 3).
        attitude: See `Sums`, of each body and this rank, 0 where it has none,
            (rows, bodies, 2, dim, dim).
        gap, force, contact_energy, obstacle_work, friction_work: Of all ranks, (rows,).
        indentation, spring_energy: How far springs in gaps are pressed at most [m], and what all of
            them store [J], (rows,).
        braked_work: Of dashpots beside these springs [J], <= 0.
        held_energy, parted_work: What adhesion stores, and what it has cost where bodies parted,
            with the sign of work, <= 0 [J].
        impact: Impulse of impacts between nodes with mass [N s], which is none of the force.
        impact_work: Work of the contact forces between such nodes [J], <= 0.
        largest: Force of the node with the largest [N], (rows,).
        active, iterations: Of all ranks, (rows,).
        pair_force, pair_gap, pair_impact: Sum of the normal forces [N], smallest gap [m] and
            impulse of impacts [N s] of each pair of the scene, (rows, pairs).
        tangential: With friction, sum of the tangential forces of each pair [N], in the plane along
            the normal turned by -90 degrees, in space a vector, (rows, pairs, 1 or 3); else empty.
        slip: Way slid in the layer [m], the mean over the gaps by their normal force; in the plane
            with the same sign, in space its length, (rows, pairs); without friction empty.
        early: See `Sums`, of this rank, (rows,).
        probes: What this rank adds to the columns of probes, (rows, columns).
        place: Sum of places times normal forces, impacts included [N m], (rows, pairs, dim).
        moment: Moments of the lasting forces of each pair about the centre of its first body [N m],
            (rows, pairs, 1 or 3).
    """

    sums: Floats
    attitude: Floats
    early: Floats
    gap: Floats
    force: Floats
    contact_energy: Floats
    obstacle_work: Floats
    friction_work: Floats
    indentation: Floats
    spring_energy: Floats
    braked_work: Floats
    held_energy: Floats
    parted_work: Floats
    impact: Floats
    impact_work: Floats
    largest: Floats
    active: Integers
    iterations: Integers
    pair_force: Floats
    pair_gap: Floats
    pair_impact: Floats
    tangential: Floats
    slip: Floats
    probes: Floats
    place: Floats
    moment: Floats

    @classmethod
    def empty(cls, rows: int, bodies: int, dim: int, pairs: int, *, friction: bool) -> "Rows":
        """Rows of zeros."""
        turns = dim * (dim - 1) // 2
        sums = np.zeros((rows, bodies, 3 + 2 * dim + turns))
        pair_force, pair_gap, pair_impact = np.zeros((3, rows, pairs))
        rubbing = pairs if friction else 0
        attitude = np.zeros((rows, bodies, 2, dim, dim))
        each: list[Any] = [
            sums,
            attitude,
            *np.zeros((14, rows)),
            *np.zeros((2, rows), dtype=np.int64),
        ]
        each += [pair_force, pair_gap, pair_impact, np.zeros((rows, rubbing, turns))]
        each += [np.zeros((rows, rubbing)), np.zeros((rows, 0)), *np.zeros((2, rows, 0, 0))]
        return cls(*each)

    def first(self, count: int) -> "Rows":
        """The first so many rows."""
        return Rows(*(getattr(self, entry.name)[:count] for entry in fields(self)))

    def times(self, factor: int) -> "Rows":
        """Those of so many bodies that move alike; gaps and counts are the same."""
        counts = {"gap", "indentation", "active", "iterations", "pair_gap", "slip", "probes"}
        return Rows(
            *(
                getattr(self, entry.name) * (1 if entry.name in counts else factor)
                for entry in fields(self)
            )
        )

    def put(self, row: int, bodies: Sequence[Sums]) -> None:
        """Store the sums of a row, of each body."""
        if isinstance(bodies, SumsTable) and bodies.whole:
            self.sums[row], self.attitude[row] = bodies.sums, bodies.attitude
            return
        row_of, dim = self.sums[row], self.attitude.shape[-1]
        self.early[row] += sum(sums.early for sums in bodies)
        row_of[:, :3] = [(sums.kinetic, sums.elastic, sums.work) for sums in bodies]
        row_of[:, 3 : 3 + dim] = [sums.momentum for sums in bodies]
        row_of[:, 3 + dim : 3 + 2 * dim] = [sums.first_moment for sums in bodies]
        row_of[:, 3 + 2 * dim :] = [sums.angular_momentum for sums in bodies]
        for body, sums in enumerate(bodies):
            if sums.attitude is not None:
                self.attitude[row, body].flat = sums.attitude
