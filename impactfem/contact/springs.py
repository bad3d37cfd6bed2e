"""Contacts that give way by themselves: a dent about a single place, which bodies do not model.

A spring lies in the gap: pressed by d it pushes with f = K d^p, and its free end is what may not
pass. It is one more part of the convex energy of `impactfem.contact.layer_law`: the true gap
is g + D lambda + d(lambda), and with the energy U(d) = f d / (p + 1) of the springs

    V(g) = lambda . D lambda / 2 + U,
    theta = 1/2 + (lambda_a . gap_b - lambda_b . gap_a + e_a - e_b) / (2 R),
    R = lambda_a . gap_b + lambda_b . gap_a + change . D change + e_a + e_b,

where e_a = U_b - U_a - lambda_a . (d_b - d_a) >= 0, and e_b likewise, are what the springs store
beyond the work of the force of one end. With p = 1 the spring is a compliance 1 / K more.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.friction_newton import Obeying
from impactfem.errors import ConvergenceError
from impactfem.findings import Finding, by_limits

if TYPE_CHECKING:
    from collections.abc import Callable

_EXACT = 1e-14  # share of the largest force by which the law may be missed
_LEAST = 1e-12  # share of the deepest gap from which on a spring counts as pressed
_TINY = 1e-30  # m
_MOST = 100  # Newton steps
_DIGIT = float(np.finfo(np.float64).eps)
_SOFTEST = 1e6  # tangent over what answers to the force: beyond it a spring hardly pushes
_RESOLVED = (20.0, 4.0)  # layers in a contact below which forces call for care, and are none


@dataclass(frozen=True)
class ContactSprings:
    """Springs in gaps.

    Attributes:
        stiffness: K of each gap [N/m^p], (gaps,); infinite where there is none.
        exponent: p, (gaps,), at least 1.
        dashpots: Beside them, c [N s/m], and in proportion to their forces, chi [s/m], (gaps,)
            each; see `impactfem.contact.dashpots`. None: none.
    """

    stiffness: Floats
    exponent: Floats
    dashpots: tuple[Floats, Floats] | None = None

    @property
    def there(self) -> Booleans:
        """Which gaps have one."""
        return np.isfinite(self.stiffness)

    @property
    def damped(self) -> Booleans:
        """Which gaps have dashpots too."""
        if self.dashpots is None:
            return np.zeros(len(self.stiffness), dtype=bool)
        viscous, by_force = self.dashpots
        return (viscous > 0.0) | (by_force > 0.0)

    def some(self, rows: Integers) -> "ContactSprings":
        """Those of some gaps."""
        return self._as(self.stiffness[rows], self.exponent[rows], lambda each: each[rows])

    def over(self, time: float) -> "ContactSprings":
        """The same with impulses of dashpots told as mean forces over some time [s]."""
        return self._as(self.stiffness, self.exponent, lambda each: each / time)

    def beside(self, more: int) -> "ContactSprings":
        """The same with gaps behind them that have none."""
        none = np.full(more, np.inf)
        stiffness = np.concatenate([self.stiffness, none])
        exponent = np.concatenate([self.exponent, np.ones(more)])
        return self._as(stiffness, exponent, lambda each: np.pad(each, (0, more)))

    def _as(
        self, stiffness: Floats, exponent: Floats, dashpot: "Callable[[Floats], Floats]"
    ) -> "ContactSprings":
        """Other springs, with what becomes of dashpots."""
        if self.dashpots is None:
            return ContactSprings(stiffness, exponent)
        viscous, by_force = self.dashpots
        return ContactSprings(stiffness, exponent, (dashpot(viscous), dashpot(by_force)))

    def depth(self, force: Floats) -> Floats:
        """How far they are pressed by forces [N]: d [m], (gaps,); 0 where there is none."""
        return np.asarray((force / self.stiffness) ** (1.0 / self.exponent))

    def energy(self, force: Floats) -> Floats:
        """What they store then [J], (gaps,)."""
        return force * self.depth(force) / (self.exponent + 1.0)

    def drawn(self, depth: Floats) -> tuple[Floats, Floats]:
        """Forces of springs pressed by some depths [m], and their slopes [N/m], (gaps,) each."""
        stiffness = np.where(self.there, self.stiffness, 0.0)
        force, deep = stiffness * depth**self.exponent, np.where(depth > 0.0, depth, 1.0)
        slope = self.exponent * np.where(depth > 0.0, force, stiffness * (self.exponent == 1.0))
        return force, slope / deep

    def braked(self, depth: Floats) -> tuple[Floats, Floats]:
        """Impulses of dashpots up to some depths [N s], or over time [N], and slopes by depth."""
        if self.dashpots is None:
            return np.zeros_like(depth), np.zeros_like(depth)
        (viscous, by_force), force = self.dashpots, self.drawn(depth)[0]
        found = viscous * depth + by_force * force * depth / (self.exponent + 1.0)
        return found, viscous + by_force * force

    def _law(self, depth: Floats) -> tuple[Floats, Floats]:
        """Forces to be found by depths [m], and their slopes, (gaps,) each."""
        return self.drawn(depth)

    def _rounding(self, depth: Floats, give: Floats) -> Floats:  # noqa: ARG002
        """By which these may be missed besides [N], by what gives way then [m/N], (gaps,) each."""
        return np.zeros_like(depth)

    def rest(self, offset: Floats) -> bool:
        """Whether nothing presses gaps [m], (gaps,), without forces."""
        return bool(offset.min(initial=0.0) >= 0.0)

    def excess(self, old: Floats, new: Floats) -> tuple[float, float]:
        """e_a and e_b of the forces at both ends of a layer [J]; see the module."""
        way = self.depth(new) - self.depth(old)
        gained = float((self.energy(new) - self.energy(old)).sum())
        return max(0.0, gained - float(old @ way)), max(0.0, float(new @ way) - gained)

    def solve(self, obey: Obeying, offset: Floats, own: Floats, tolerance: float = 0.0) -> int:
        """Find normal forces of a law in which the springs give way; returns systems solved.

        Newton's steps, each the law with the tangents of the springs. From deeper than they are
        pressed, where they begin, the steps come down without passing.

        Args:
            obey: The law with springs that are straight; it keeps the last forces.
            offset: Gaps without forces and springs [m], (gaps,).
            own: How gaps answer to their own forces [m/N], (gaps,).
            tolerance: By which open gaps may be missed [m].

        Raises:
            ConvergenceError: They did not.
        """
        there, total = self.there, 0
        deepest = -float(offset.min())  # friction may press what is open by itself
        least = max(_TINY, _LEAST * (deepest if deepest > 0.0 else float(offset.max())))
        softest = np.where(own > 0.0, _SOFTEST * own, np.inf)
        depth, worst = np.maximum(-offset, least), np.inf
        for _ in range(_MOST):
            pushed, slope = self._law(depth)
            give = np.zeros(len(offset))
            give[there] = 1.0 / slope[there]
            stiffened = give > softest
            give = np.minimum(give, softest)
            force, gap, count = obey(give, np.where(there, depth - give * pushed, 0.0))
            total, pressed = total + count, force > 0.0
            depth = depth + give * (force - pushed)
            missed = np.where(pressed, np.abs(self._law(depth)[0] - force), 0.0)[there]
            worst, last = missed.max(initial=0.0), worst
            lost = self._rounding(depth, give)
            # What the last digit of a depth makes of forces by tangents that are not the springs'.
            lost[stiffened] += _DIGIT * depth[stiffened] / give[stiffened]
            lost = lost[there]
            fine = (missed <= _EXACT * force.max(initial=0.0) + lost).all()
            # Below the tolerance steps go on while they gain.
            fine |= worst > 0.5 * last and (missed * give[there]).max(initial=0.0) <= tolerance
            closing = gap[there & ~pressed].min(initial=0.0)
            if fine and closing >= -max(least, tolerance):
                return total
            depth = np.where(pressed, np.maximum(depth, least), least)
        raise ConvergenceError(
            f"contact: forces of springs in {np.count_nonzero(there)} gaps were not found in "
            f"{_MOST} steps; use a smaller solve.dt"
        )


def unresolved(indentation: Floats, dt: float) -> tuple[Finding, ...]:
    """Whether a contact was too short for its steps.

    Args:
        indentation: Largest of all gaps at each level [m], (levels,).
        dt: Of a layer [s].
    """
    changes = np.diff(np.concatenate([[0], (indentation > 0.0).astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(changes > 0), np.flatnonzero(changes < 0)
    whole = ends < len(indentation)  # what lasts at the end of the run may go on
    shortest = float((ends - starts)[whole].min(initial=np.iinfo(np.int64).max)) + 1.0
    text = f"a contact that gives way lasts {shortest:g} steps: its force is not resolved"
    remedy = f"use solve.dt below {shortest * dt / _RESOLVED[0]:.1g}"
    code, limits = "contact_unresolved", (1.0 / _RESOLVED[0], 1.0 / _RESOLVED[1])
    return by_limits(code, 1.0 / shortest, limits, text, remedy=remedy)
