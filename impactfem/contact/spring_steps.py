"""Springs in gaps over a step that is solved by iterates: forces that do the work of their energy.

A gap that opens by w in a step, pressed by d_a before and d_b = (d_a - w)^+ behind it, has the mean
force

    F = (U(d_a) - U(d_b)) / w,    U(d) = K d^(p+1) / (p + 1),

so that F w is what the spring gives, to rounding (O. Gonzalez, J. Nonlinear Sci. 6 (1996) 449; of
one coordinate this is the only such force along the gap). Dashpots (`impactfem.contact.dashpots`)
add (P(d_b) - P(d_a)) / dt, and never pull.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Booleans, Floats
from impactfem.contact.friction_newton import Obeying
from impactfem.contact.springs import ContactSprings
from impactfem.errors import ConvergenceError

_NEAR = 1e-3  # share of the depth below which changes of it lose digits in the quotient
_EXACT = 1e-12  # share of the largest force by which the law may be missed
_LEAST = 1e-12  # share of the deepest gap from which on a spring counts as pressed
_FLAT = 1e-12  # slope over the stiffness of what is around, below which it counts as so much
_MOST = 100  # Newton steps


@dataclass(frozen=True)
class SpringStep:
    """Springs in a step.

    Attributes:
        springs: In the gaps; others are rigid.
        depth: By which they are pressed at the start [m], (gaps,).
        room: By which gaps are open there [m], (gaps,); one of both is 0.
    """

    springs: ContactSprings
    depth: Floats
    room: Floats

    @classmethod
    def of(cls, springs: ContactSprings, pressing: Floats, gap: Floats) -> "SpringStep":
        """A step from forces [N] and gaps [m], (gaps,) each.

        Where there is a force it says how deep a spring is pressed, so that its energy is known.
        """
        there = springs.there
        depth = np.where(there, springs.depth(np.where(there, pressing, 0.0)), 0.0)
        return cls(springs, depth, np.where(there & (depth == 0.0), np.maximum(gap, 0.0), 0.0))

    @property
    def there(self) -> Booleans:
        """Which gaps have one."""
        return self.springs.there

    def left(self, apart: Floats) -> Floats:
        """Forces at the end [N], by `apart`: ways and room [m], (gaps,) each."""
        return self._pushed(np.maximum(self.depth - apart, 0.0))

    def _pushed(self, depth: Floats) -> Floats:
        stiffness = np.where(self.there, self.springs.stiffness, 0.0)
        return np.asarray(stiffness * depth**self.springs.exponent)

    @cached_property
    def loose(self) -> Booleans:
        """Which are pressed at the start by dashpots too, and may have no force, (gaps,)."""
        return self.springs.damped & (self.depth > 0.0)

    def braked(self, apart: Floats, force: Floats) -> float:
        """Work of dashpots [J], by forces of the step [N], (gaps,)."""
        rows = np.flatnonzero(self.springs.damped & (force > 0.0) | self.loose)
        if not len(rows):
            return 0.0
        more, way = force - self._drawn(apart)[0], apart - self.room
        return float(more[rows] @ way[rows])

    def mean(self, apart: Floats) -> tuple[Floats, Floats]:
        """Forces of the step [N], and what they lose by way [N/m], (gaps,) each."""
        force, slope = self._drawn(apart)
        if not self.springs.damped.any():
            return force, slope
        after = np.maximum(self.depth - apart, 0.0)
        (late, more), (early, _) = self.springs.braked(after), self.springs.braked(self.depth)
        whole = force + late - early
        return np.maximum(whole, 0.0), np.where(whole > 0.0, slope + more * (after > 0.0), 0.0)

    def _drawn(self, apart: Floats) -> tuple[Floats, Floats]:
        """The same of springs alone."""
        p = self.springs.exponent
        after = np.maximum(self.depth - apart, 0.0)
        way = apart - self.room
        middle = 0.5 * (self.depth + after)
        near = np.abs(way) <= _NEAR * middle
        before, behind = self._pushed(self.depth), self._pushed(after)
        stored = (before * self.depth - behind * after) / (p + 1.0)
        safe = np.where(near | (way == 0.0), 1.0, way)
        force, slope = stored / safe, (stored / safe - behind) / safe
        # Close to the start by its series about the middle.
        deep = np.where(near, middle, 1.0)
        pushed = self._pushed(deep)
        bent = pushed * p * (p - 1.0) / deep**2 * way**2 / 24.0
        force = np.where(near, pushed + bent, force)
        slope = np.where(near, 0.5 * pushed * p / deep, slope)
        return force * self.there, np.maximum(slope, 0.0) * self.there

    def some(self, rows: NDArray[np.int64]) -> "SpringStep":
        """Those of some gaps."""
        return SpringStep(self.springs.some(rows), self.depth[rows], self.room[rows])

    def beside(self, more: int) -> "SpringStep":
        """The same with gaps behind them that have none."""
        none = np.zeros(more)
        return SpringStep(
            self.springs.beside(more),
            np.concatenate([self.depth, none]), np.concatenate([self.room, none]),
        )  # fmt: skip

    def rest(self, offset: Floats) -> bool:
        """Whether nothing presses gaps [m], (gaps,), without forces."""
        return self._least(offset) == 0.0

    @cached_property
    def _rounding(self) -> float:
        """Forces that lose digits in differences [N]."""
        return float(self.springs.braked(self.depth)[0].max(initial=0.0))

    def _least(self, offset: Floats) -> float:
        deepest = max(-float(offset.min(initial=0.0)), float(self.depth.max(initial=0.0)))
        return _LEAST * deepest

    def solve(self, obey: Obeying, offset: Floats, own: Floats, tolerance: float) -> int:  # noqa: ARG002
        """Find forces F of springs by `apart`, gaps then; others keep 0 <= F _|_ apart >= 0.

        Newton's steps, each the law with the tangents of the springs, from as deep as they are
        pressed without forces. Arguments as of `impactfem.contact.springs.ContactSprings.solve`.

        Raises:
            ConvergenceError: They did not settle.
        """
        there, pressed, least = self.there, self.depth > 0.0, self._least(offset)
        closing = np.where(pressed, offset, np.minimum(offset, -least))
        apart = np.where(there, closing, 0.0)
        total = 0
        for _ in range(_MOST):
            mean, slope = self.mean(apart)
            give = 1.0 / np.maximum(slope, _FLAT / own.max())
            give = np.where(there, give, 0.0)
            force, gap, count = obey(give, -np.where(there, apart + give * mean, 0.0))
            total, pushes = total + count, force > 0.0
            found = apart - give * (force - mean)
            open_up = np.where(pushes, np.minimum(found, -least), -least)
            found = np.where(self.loose & ~pushes, gap, found)
            apart = np.where(there, np.where(pressed, found, open_up), 0.0)
            missed = np.abs(self.mean(apart)[0] - force)[there & (pushes | self.loose)]
            if missed.max(initial=0.0) <= _EXACT * max(force.max(initial=0.0), self._rounding):
                return total
        raise ConvergenceError(f"forces of springs in gaps not found in {_MOST} steps")
