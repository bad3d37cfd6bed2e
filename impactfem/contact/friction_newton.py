"""Contact forces that obey Signorini's and Coulomb's law at once: a semismooth Newton method.

Find forces x_j = (y_j, tau_j) of the pairs j with

    0 <= y _|_ w >= 0,   tau = P_b(tau - s / a),   b = mu (base + y),   (w, s) = o + A x,

where w is the normal and s the tangential part of each pair, P_b the projection on the disc (in
the plane: the interval) of radius b, and a > 0 any number: the law does not depend on it. Here
a is the mean diagonal of A in the pair's tangential plane, which no rotation of its axes changes.

**Moments** that resist rolling and spinning are pairs too, whose bounds hang on the normal force
of another one, their ``master``: the first component is that of spinning, within its interval.

Newton's step takes the derivative of these functions where they have one (Alart, Curnier, Comput.
Methods Appl. Mech. Eng. 92 (1991) 353-375; Hueeber, Stadler, Wohlmuth, SIAM J. Sci. Comput. 30
(2008) 572-596). With q = tau - s / a, n = q / |q|:

    no force:  y = 0;             push:  w = 0,
    stick |q| <= b:  s = 0,       slip:  tau - b n = 0,  d(b n) = n mu dy + (b / |q|)(1 - n n) dq.

In slip b / |q| < 1, so that the step exists far from a solution too. How it is led to a solution
from afar, and what is done where forces depend on each other, stands in
`impactfem.contact.friction_solver`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact import cone_kernels
from impactfem.contact.cone_kernels import newton_cones, proximal_cones
from impactfem.contact.friction_kernels import islands_of
from impactfem.contact.rooted import Matrix, Rooted, among, full, own_blocks

if TYPE_CHECKING:
    from impactfem.contact.spring_steps import SpringStep
    from impactfem.contact.springs import ContactSprings


Obeying = Callable[[Floats, Floats], tuple[Floats, Floats, int]]
"""Normal forces [N] if springs are pressed by rest + give * force, gaps without springs, systems.

Arguments are give [m/N] and rest [m], all of shape (pairs,).
"""


type Springs = ContactSprings | SpringStep
"""Springs in gaps: over a layer by its levels, or over a step that is solved by iterates."""


@dataclass(frozen=True)
class ConeProblem:
    """Data of the coupled law above.

    Attributes:
        matrix: A [m/N], symmetric positive definite, shape (pairs dim, pairs dim), the components
            of a pair one after the other, the normal one first; of many pairs by its roots.
        offset: o [m], shape (pairs, dim).
        friction: mu, shape (pairs,), >= 0; of moments the resistance to rolling [m].
        base: Part of the bound's normal force that is given [N], shape (pairs,), >= 0; moments
            have their own.
        master: Which pair's normal force bounds the others: of forces the own number, shape
            (pairs,); None: no pair is a moment.
        spinning: Resistance to spinning of pairs that are moments [m], shape (pairs,).
        springs: In the gaps, in which w falls short of them by what these give way; None: none.
    """

    matrix: Matrix
    offset: Floats
    friction: Floats
    base: Floats
    master: Integers | None = None
    spinning: Floats | None = None
    springs: "Springs | None" = None
    masters: Integers = field(init=False)
    spins: Floats = field(init=False)

    def __post_init__(self) -> None:
        """Fill in what is absent."""
        count = len(self.offset)
        own = np.arange(count) if self.master is None else self.master
        object.__setattr__(self, "masters", own)
        none = np.zeros(count) if self.spinning is None else self.spinning
        object.__setattr__(self, "spins", none)

    @property
    def is_plain(self) -> bool:
        """Whether none of the pairs are moments, and answers are an array."""
        return self.master is None and self.spinning is None and isinstance(self.matrix, np.ndarray)

    @property
    def has_friction(self) -> bool:
        """Whether there are any tangential forces or moments."""
        return bool(self.friction.any() or (self.spinning is not None and self.spinning.any()))

    @property
    def pushes(self) -> Booleans:
        """Which pairs are forces, no moments, (pairs,)."""
        found: Booleans = self.masters == np.arange(len(self.masters))
        return found

    def answers(self, force: Floats) -> Floats:
        """(w, s) for forces of shape (pairs, dim)."""
        return self.offset + (self.matrix @ force.ravel()).reshape(force.shape)

    def pressing(self, force: Floats) -> Floats:
        """Normal forces that bound the others of each pair [N]."""
        found: Floats = self.base + np.maximum(force[self.masters, 0], 0.0)
        return found

    def bound(self, force: Floats) -> Floats:
        """Largest tangential force of each pair [N]."""
        return np.asarray(self.friction * self.pressing(force))

    def own(self) -> Floats:
        """Answers of pairs to their own forces [m/N], (pairs, dim, dim)."""
        return own_blocks(self.matrix, self.offset.shape[1])

    def scales(self) -> Floats:
        """The numbers a of each component [m/N], (pairs, dim)."""
        diagonal = self.matrix.diagonal().reshape(self.offset.shape)
        scale, ways = np.empty_like(diagonal), self.offset.shape[1]
        scale[:, 1:] = diagonal[:, 1:].sum(axis=1, keepdims=True) / (ways - 1)
        scale[:, 0] = diagonal[:, 0]
        return scale

    def islands(self) -> list[Integers]:
        """Pairs that move each other, or bound each other's forces."""
        pairs, dim = self.offset.shape
        if pairs < 2:
            return [np.arange(pairs)] if pairs else []
        if isinstance(self.matrix, Rooted):
            return self.matrix.islands(dim)
        island = islands_of(self.matrix, self.masters, dim)
        return [np.flatnonzero(island == k) for k in range(island.max() + 1)]

    def part(self, pairs: Integers) -> "ConeProblem":
        """That of some pairs which no others move, with the masters of all moments among them."""
        dim = self.offset.shape[1]
        wide = (dim * pairs[:, None] + np.arange(dim)).ravel()
        return ConeProblem(
            among(self.matrix, wide), self.offset[pairs], self.friction[pairs],
            self.base[pairs], np.searchsorted(pairs, self.masters[pairs]), self.spins[pairs],
        )  # fmt: skip


def newton(
    problem: ConeProblem, start: Floats, tolerance: float, limit: int
) -> tuple[Floats, float, int]:
    """Newton's steps from some forces (pairs, dim).

    Returns:
        The best forces, their error in units of the tolerance, and linear systems solved.
    """
    found, left, steps = newton_cones(*_law(problem), start, tolerance, limit)
    return found, float(left), int(steps)


def proximal(
    problem: ConeProblem, start: Floats, tolerance: float, limit: int
) -> tuple[Floats, float, int]:
    """Proximal steps likewise; see `impactfem.contact.friction_solver`."""
    found, left, steps = proximal_cones(*_law(problem), start, tolerance, limit)
    return found, float(left), int(steps)


def residual(problem: ConeProblem, force: Floats) -> float:
    """Largest error of the law in a force, as a share of the largest force."""
    error = cone_kernels.missed_by(_law(problem), force, 0.0)[1]
    largest = float(np.abs(force).max(initial=0.0))
    worst = float(np.abs(error).max(initial=0.0))
    return worst / largest if largest else worst


def _law(problem: ConeProblem) -> tuple[Floats | Integers, ...]:
    """What kernels take of a problem."""
    return (
        np.ascontiguousarray(full(problem.matrix)), np.ascontiguousarray(problem.offset),
        problem.friction, problem.masters, problem.spins, problem.base, problem.scales(),
    )  # fmt: skip
