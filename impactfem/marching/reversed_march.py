"""A march backwards, with the gaps that pressed: derivatives of its numbers by all it was given.

In a layer from a to b, gap_b = g + C Lambda + D lambda_b with Lambda = (1 - theta) lambda_a +
theta lambda_b, the gaps that press are shut and the others have no force; theta is 1/2, or the root
of (`impactfem.contact.layer_law`)

    N = (1 - theta) lambda_a . gap_b - theta lambda_b . gap_a - (theta - 1/2) delta . D delta,

delta = lambda_b - lambda_a. These are as many equations as unknowns lambda_b and theta, J their
matrix: of a number with derivatives b by both, J^T (eta, zeta) = b are those by the equations, from
which its derivatives by gap_a, lambda_a and g follow.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.layer_law import uncoupled
from impactfem.marching.rows import Level
from impactfem.marching.solids import SolidMarch

if TYPE_CHECKING:
    from impactfem.marching.layers import Reversible

_WEAK = 1e-9  # share of the largest force, or gap, that is none
_HALF = 1e-9  # within which theta is 1/2, as where the same gaps press at both ends


@dataclass
class Trail:
    """What a march keeps for its way back; an observer.

    Attributes:
        march: The march.
        force: In the layer before each level [N], (levels, gaps).
        multiplier: At each level [N], (levels, gaps).
        gap: True gaps there [m], (levels, gaps).
    """

    march: SolidMarch
    force: Floats
    multiplier: Floats
    gap: Floats

    @classmethod
    def of(cls, march: SolidMarch) -> "Trail":
        """An empty one."""
        shape = march.layers + 1, len(march.contact.gap)
        return cls(march, *(np.zeros(shape) for _ in range(3)))

    def __call__(self, level: Level) -> None:
        """Keep a level."""
        state = self.march.contact
        self.force[level.layer] = level.force
        self.multiplier[level.layer], self.gap[level.layer] = state.multiplier, state.gap

    @property
    def weak(self) -> bool:
        """Whether a gap shuts or opens at a level, so that its sets are those of one side."""
        force, gap = self.multiplier[1:], self.gap[1:]
        little = _WEAK * np.abs(gap[np.isfinite(gap)]).max(initial=0.0)
        slight = (force > 0.0) & (force <= _WEAK * force.max(initial=0.0))
        return bool((slight | ((force == 0.0) & (gap <= little))).any())


@dataclass
class Reading:
    """Derivatives of a number by what a march has at a level, to which parts are added.

    Attributes:
        place, rate: As of `Backward`, (dofs,).
        contact: By the places of contact nodes without what presses them, (count, dim).
        multiplier, gap: By these, (gaps,).
        force: By the force of the layer before, (gaps,).
    """

    place: Floats
    rate: Floats
    contact: Floats
    multiplier: Floats
    gap: Floats
    force: Floats


class Given(NamedTuple):
    """Derivatives of a number by what a march was given.

    Attributes:
        place, rate: As of `Backward`, at t = 0, (dofs,).
        loads: By forces on owned dofs in each layer, (layers, dofs).
        gap: By what gaps are at each level without displacements, (levels, gaps).
    """

    place: Floats
    rate: Floats
    loads: Floats
    gap: Floats


class ReversedMarch:
    """A march that has ended, backwards (collective).

    Args:
        trail: What it has kept.
    """

    def __init__(self, trail: Trail) -> None:
        march = trail.march
        self._trail, self._march, self._gaps = trail, march, march.gaps
        self._interior, self._normals = cast("Reversible", march.interior), march.normals
        self._static = march.interior.static

    def given(self, last: int, read: Callable[[int, Reading], None]) -> Given:
        """Derivatives of a number.

        Args:
            last: Level after which nothing counts.
            read: Adds what the number reads at a level.
        """
        trail, interior = self._trail, self._interior
        size, count = interior.dofs, trail.gap.shape[1]
        nodes = self._march.interior.surface_displacement.shape
        multipliers, gaps = np.zeros((2, last + 1, count))
        place, rate = np.zeros((2, size))
        loads, skips = np.zeros((self._march.layers, size)), self._march.skips
        for layer in range(last - 1, -1, -1):
            level, begin = layer + 1, max(layer - 1, 0) if skips else layer
            found = Reading(
                place, rate, np.zeros(nodes), multipliers[level], gaps[level], np.zeros(count)
            )
            read(level, found)
            contact = found.contact + self._on_nodes(found.gap)
            back = interior.backward(place, rate, contact, first=layer == 0)
            if trail.multiplier[[begin, level]].any():
                acting = found.force + self._along(back.forces)
                shut, older, gap = self._contact(layer, begin, acting, found)
                more = interior.backward(
                    np.zeros(size), np.zeros(size), self._on_nodes(shut), first=layer == 0
                )
                back = type(back)(*(one + two for one, two in zip(back, more, strict=True)))
                acting = found.force + self._along(back.forces)
                multipliers[begin] += older(acting)
                gaps[begin] += gap
                gaps[level] += shut
            place, rate, loads[layer] = back.place, back.rate, back.loads
        found = Reading(place, rate, np.zeros(nodes), multipliers[0], gaps[0], np.zeros(count))
        read(0, found)
        place = place + interior.settled(found.contact + self._on_nodes(gaps[0]))
        return Given(place, rate, loads, gaps)

    def _on_nodes(self, forces: Floats) -> Floats:
        """Along the normals of gaps (gaps,), on the contact nodes (count, dim)."""
        return self._gaps.spread(forces[:, None] * self._normals)

    def _along(self, values: Floats) -> Floats:
        """Of the contact nodes (count, dim) what makes gaps, (gaps,)."""
        found: Floats = np.einsum("ij,ij->i", self._normals, self._gaps.relative(values))
        return found

    def _contact(
        self, layer: int, begin: int, acting: Floats, found: Reading
    ) -> tuple[Floats, Callable[[Floats], Floats], Floats]:
        """What the law of a layer does backwards.

        Args:
            layer: Whose.
            begin: Level with which its end is paired.
            acting: Derivatives by its forces, (gaps,).
            found: By its end.

        Returns:
            What the law adds to derivatives by the gaps of its end, (gaps,); how those by the
            multipliers of its begin follow from those by its forces; those by gaps of its begin.
        """
        trail, level = self._trail, layer + 1
        count = len(acting)
        shut, of_gap, keeps, direct = np.zeros((4, count))
        old, new = trail.multiplier[begin], trail.multiplier[level]
        pressed = self._along(self._static(self._on_nodes(found.gap)))
        rows = np.flatnonzero((old > 0.0) | (new > 0.0))
        response, static = self._march.answers.matrices(rows, self._normals[rows])
        response = response * (0.5 if self._march.skips and layer == 0 else 1.0)
        for own in uncoupled(response, static) or (np.arange(len(rows)),):
            at = rows[own]
            law = _Law(
                response[np.ix_(own, own)], static[np.ix_(own, own)], old[at], new[at],
                trail.gap[begin][at], trail.gap[level][at], trail.force[level][at],
            )  # fmt: skip
            closed, zeta = law.equations(
                acting[at], found.multiplier[at] + pressed[at], free=self._march.keeps_energy
            )
            theta = law.theta
            shut[at], of_gap[at] = closed - zeta * (1.0 - theta) * law.old, zeta * theta * law.new
            keeps[at] = 1.0 - theta
            direct[at] = -zeta * ((1.0 - theta) * law.gap + (2.0 * theta - 1.0) * law.strained)
        return shut, lambda by_force: keeps * by_force + direct, of_gap


@dataclass
class _Law:
    """The law of a layer for gaps that answer to each other; names as in the module's formulas.

    Attributes:
        response, static: C and D [m/N].
        old, new: lambda_a and lambda_b [N].
        old_gap, gap: gap_a and gap_b [m].
        force: Lambda [N].
    """

    response: Floats
    static: Floats
    old: Floats
    new: Floats
    old_gap: Floats
    gap: Floats
    force: Floats

    @property
    def change(self) -> Floats:
        """Delta."""
        return self.new - self.old

    @property
    def strained(self) -> Floats:
        """D delta."""
        return np.asarray(self.static @ self.change)

    @property
    def theta(self) -> float:
        """The weight that the layer had."""
        change = self.change
        square = float(change @ change)
        found = float((self.force - self.old) @ change) / square if square else 0.5
        return found if abs(found - 0.5) > _HALF else 0.5

    def equations(self, acting: Floats, multiplier: Floats, *, free: bool) -> tuple[Floats, float]:
        """Derivatives by shut gaps, with their sign turned (gaps,), and zeta.

        Args:
            acting: By Lambda.
            multiplier: By lambda_b besides.
            free: Whether theta may be less than 1/2.
        """
        theta, change = self.theta, self.change
        matrix = theta * self.response + self.static
        shut: Integers = np.flatnonzero(self.new > 0.0)
        right = (theta * acting + multiplier)[shut]
        own = matrix[np.ix_(shut, shut)]
        closed = np.zeros(len(self.new))
        same = np.array_equal(self.old > 0.0, self.new > 0.0)
        moved = self.response @ change
        by_theta = -float(self.old @ self.gap + self.new @ self.old_gap + change @ self.strained)
        by_theta += (1.0 - theta) * float(self.old @ moved)
        if same or by_theta == 0.0 or (not free and theta == 0.5):
            closed[shut] = -np.linalg.solve(own.T, right)
            return closed, 0.0
        by_new = (1.0 - theta) * (matrix @ self.old) - theta * self.old_gap
        by_new = by_new - (2.0 * theta - 1.0) * self.strained
        size = len(shut)
        both = np.empty((size + 1, size + 1))
        both[:size, :size], both[:size, size] = own, moved[shut]
        both[size, :size], both[size, size] = by_new[shut], by_theta
        # Of unlike units: each equation in its own.
        scale = np.append(np.full(size, np.abs(own).max(initial=0.0)), np.abs(by_theta))
        unit = np.append(np.ones(size), scale[0] / max(np.abs(moved).max(), 1e-300))
        scale[-1] = max(np.abs(both[size] * unit).max(), 1e-300)
        scaled = both * unit / scale[:, None]
        right = np.append(right, float(acting @ change)) * unit
        found = np.linalg.solve(scaled.T, right) / scale
        closed[shut] = -found[:size]
        return closed, float(found[size])
