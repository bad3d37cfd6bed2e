"""Contact of one time layer: a small complementarity problem, and the rule that decides its energy.

With massless contact nodes the elastic energy, minimised over these nodes, is a convex potential of
the gaps g that the body would have without contact forces:

    V(g) = max over lambda >= 0 of  -lambda . D lambda / 2 - lambda . g,   lambda(g) = -grad V,

where D is the static compliance of the contact nodes; gap = g + D lambda >= 0 is the true gap. In a
layer from a to b the contact force is Lambda = (1 - theta) lambda_a + theta lambda_b and
g_b = g_free + C Lambda. By convexity there is one theta in [0, 1] for which the work of Lambda is
V(g_a) - V(g_b), so that energy is conserved exactly, and every larger theta dissipates:

    theta = 1/2 + (lambda_a . gap_b - lambda_b . gap_a) / (2 R),
    R = lambda_a . gap_b + lambda_b . gap_a + (lambda_b - lambda_a) . D (lambda_b - lambda_a).

In flight and in lasting contact theta = 1/2. With D = 0 and theta = 1/2 this is the contact rule of
the space-time Petrov-Galerkin form and of Newmark's scheme.

Gaps that do not answer to each other's forces are problems of their own, each with its theta: what
happens elsewhere in a scene changes nothing. V is their sum, so that each keeps its energy.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

from impactfem.contact.active_set import primal_dual_active_set
from impactfem.contact.springs import ContactSprings
from impactfem.errors import ConvergenceError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]
Rule = Literal["conserving", "dissipative", "middle"]
"""theta as above, the larger of it and 1/2, or always 1/2."""

Solver = Callable[[Floats, Floats, Booleans], tuple[Floats, int]]
"""Solves a complementarity problem (matrix, offset, start) for lambda; also counts iterations."""

_EXACT = 1e-14  # error of the energy that theta leaves, as a share of the contact energy
_NARROW = 1e-15
_OPEN = 1e-6  # share of the largest gap that closed pairs may keep: far above rounding
_COMPLIANCE = 1e-12  # of each pair by itself, where active sets are singular
_MAX_THETA = 80  # evaluations; bisection alone needs 50


@dataclass(frozen=True)
class LayerContact:
    """Contact in one layer.

    Attributes:
        force: Lambda, force of the layer [N], shape (pairs,), >= 0.
        multiplier: lambda_b at the end of the layer [N], shape (pairs,), >= 0.
        gap: True gap at the end [m], shape (pairs,), >= 0 to rounding.
        theta: Weight of lambda_b; of gaps in groups of their own that furthest from 1/2.
        iterations: Linear systems solved.
    """

    force: Floats
    multiplier: Floats
    gap: Floats
    theta: float
    iterations: int


def solve_layer(
    free: Floats,
    response: Floats,
    compliance: Floats,
    before: tuple[Floats, Floats],
    rule: Rule,
    solver: Solver,
    springs: ContactSprings | None = None,
) -> LayerContact:
    """Find the contact forces of a layer.

    Args:
        free: Gaps at the end of the layer if Lambda were zero, massless nodes in equilibrium [m],
            shape (pairs,).
        response: C, change of these gaps per unit of Lambda [m/N], shape (pairs, pairs).
        compliance: D [m/N], shape (pairs, pairs); zero where contact nodes have mass.
        before: lambda_a [N] and true gaps gap_a [m] at the start.
        rule: How theta is chosen.
        solver: Solver of complementarity problems.
        springs: In the gaps; None without any.

    Raises:
        ConvergenceError: The active set or theta was not found.
    """
    # Without a theta to find they change each other by rounding only.
    groups = () if rule == "middle" else uncoupled(response, compliance)
    if not groups:
        return _solve_group(free, response, compliance, before, rule, solver, springs)
    found = [
        _solve_group(
            free[rows], response[np.ix_(rows, rows)], compliance[np.ix_(rows, rows)],
            (before[0][rows], before[1][rows]), rule, solver,
            None if springs is None else springs.some(rows),
        )
        for rows in groups
    ]  # fmt: skip
    return LayerContact(
        scattered(groups, [each.force for each in found]),
        scattered(groups, [each.multiplier for each in found]),
        scattered(groups, [each.gap for each in found]),
        max((each.theta for each in found), key=lambda theta: abs(theta - 0.5)),
        sum(each.iterations for each in found),
    )


def uncoupled(*matrices: Floats) -> Sequence[Integers]:
    """Groups of rows that have no entries with each other in any of some matrices.

    Args:
        matrices: Symmetric, of one shape (rows, rows).

    Returns:
        Rows of each group; nothing where there is a single one.
    """
    count = len(matrices[0])
    if count < 2 or any(matrix[0].all() for matrix in matrices):  # by far the most
        return ()
    beside = np.logical_or.reduce([matrix != 0.0 for matrix in matrices])
    groups, left = [], np.ones(count, dtype=bool)
    while left.any():
        reached = np.zeros(count, dtype=bool)
        front = np.flatnonzero(left)[:1]
        while len(front):
            reached[front] = True
            front = np.flatnonzero(beside[front].any(axis=0) & ~reached)
        groups.append(np.flatnonzero(reached))
        left &= ~reached
    return groups if len(groups) > 1 else ()


def scattered(groups: Sequence[Integers], values: Sequence[Floats]) -> Floats:
    """Values of the rows of groups, of each row at its place."""
    found = np.zeros((sum(map(len, groups)), *values[0].shape[1:]))
    for rows, own in zip(groups, values, strict=True):
        found[rows] = own
    return found


def _solve_group(
    free: Floats,
    response: Floats,
    compliance: Floats,
    before: tuple[Floats, Floats],
    rule: Rule,
    solver: Solver,
    springs: ContactSprings | None,
) -> LayerContact:
    """The same of gaps that answer to each other."""
    old, gap_a = before
    total = 0
    start = old > 0.0

    def end(theta: float) -> tuple[Floats, Floats]:
        nonlocal total, start
        offset = free + response @ ((1.0 - theta) * old)
        matrix = theta * response + compliance
        new = np.zeros(len(offset))

        def obey(give: Floats, rest: Floats) -> tuple[Floats, Floats, int]:
            nonlocal new, start
            new, iterations = solver(matrix + np.diag(give), offset + rest, start)
            start = new > 0.0
            return new, offset + matrix @ new, iterations

        if springs is None:
            new, iterations = solver(matrix, offset, start)
        elif offset.min(initial=0.0) >= 0.0:
            iterations = 0
        else:
            iterations = springs.solve(obey, offset, matrix.diagonal())
        total += iterations
        start = new > 0.0
        gap = offset + matrix @ new
        return new, gap if springs is None else gap + springs.depth(new)

    def excess(theta: float, new: Floats, gap: Floats) -> tuple[float, bool]:
        """What theta should be more, and whether the energy hardly depends on that."""
        released, pressed = float(old @ gap), float(new @ gap_a)
        change = new - old
        strained = compliance @ change
        more, less = (0.0, 0.0) if springs is None else springs.excess(old, new)
        released, pressed = released + more, pressed + less
        room = released + pressed + float(change @ strained)
        wanted = 0.5 + 0.5 * (released - pressed) / room if room > 0.0 else 0.5
        wanted = min(max(wanted, 0.5 if rule == "dissipative" else 0.0), 1.0)
        stored = float(new @ (compliance @ new))
        stored += 0.0 if springs is None else 2.0 * float(springs.energy(new).sum())
        return wanted - theta, abs(wanted - theta) * room <= _EXACT * stored

    theta = 0.5
    new, gap = end(theta)
    if rule != "middle":
        theta, new, gap = _fixed_point(end, excess, theta, new, gap)
    force = (1.0 - theta) * old + theta * new
    return LayerContact(force, new, gap, theta, total)


def _fixed_point(
    end: Callable[[float], tuple[Floats, Floats]],
    excess: Callable[[float, Floats, Floats], tuple[float, bool]],
    theta: float,
    new: Floats,
    gap: Floats,
) -> tuple[float, Floats, Floats]:
    """Find theta in [0, 1] without excess, by secants kept inside a bracket.

    Where there is more than one answer, as with much friction, the excess may jump past 0: of both
    sides of the jump that is taken which gives no energy.
    """
    low, high = 0.0, 1.0  # the wanted theta lies in [0, 1]: the excess is >= 0 at 0, <= 0 at 1
    more, exact = excess(theta, new, gap)
    following = theta + more
    taking = theta, new, gap  # the last that gives no energy
    for _ in range(_MAX_THETA):
        if more <= 0.0:
            taking = theta, new, gap
        if exact or more == 0.0:
            return theta, new, gap
        if high - low <= _NARROW:
            return taking if taking[0] == high else (theta, new, gap)
        low, high = (theta, high) if more > 0.0 else (low, theta)
        if not low < following < high:
            following = 0.5 * (low + high)
        last, last_more = theta, more
        theta = following
        new, gap = end(theta)
        more, exact = excess(theta, new, gap)
        slope = (more - last_more) / (theta - last) if theta != last else 0.0
        following = theta - more / slope if slope != 0.0 else 0.5 * (low + high)
    raise ConvergenceError(
        f"contact: the weight theta of a time step was not found (excess {more:.1e} after "
        f"{_MAX_THETA} evaluations); use a smaller solve.dt or solve.courant"
    )


def solve_by_active_set(tolerance: float, max_iterations: int) -> Solver:
    """Make a solver that uses the primal-dual active set, and Murty's pivots should it cycle.

    Args:
        tolerance: Rounding level of gaps [m].
        max_iterations: Limit of linear systems.
    """

    def solver(matrix: Floats, offset: Floats, start: Booleans) -> tuple[Floats, int]:
        if not start.any() and offset.min(initial=0.0) >= -tolerance:
            return np.zeros(len(offset)), 0
        pairs = len(offset)
        gamma = float(np.abs(matrix).max(initial=0.0))

        def solve(active: Booleans) -> tuple[Floats, Floats]:
            force = _forces(matrix, offset, active)
            gap = offset + matrix @ force
            gap[active] = 0.0
            return gap, -force

        found = primal_dual_active_set(
            solve, pairs, gamma=gamma, tolerance=tolerance,
            max_iterations=max_iterations, start=start,
        )  # fmt: skip
        force = np.maximum(-found.multiplier, 0.0)
        if found.converged and _are_closed(matrix, offset, found.active, force):
            return force, found.iterations
        # A singular set may have passed for a solution, or pivots go round between such: a little
        # compliance, far below that of the body, gives each set one answer.
        soft = matrix + np.diag(_COMPLIANCE * np.diag(matrix))
        try:
            trial = soft if found.converged else matrix
            force, pivots = _murty(trial, offset, found.active, tolerance)
        except ConvergenceError:
            if found.converged:
                raise
            force, pivots = _murty(soft, offset, found.active, tolerance)
            # Where gaps contradict each other forces grow by it without end, and close none.
            if (offset + matrix @ force).min() < -_OPEN * np.abs(offset).max():
                raise
        return force, found.iterations + pivots

    return solver


def _are_closed(matrix: Floats, offset: Floats, active: Booleans, force: Floats) -> bool:
    """Whether forces do close the active gaps: the least squares of a singular set need not."""
    rows = np.flatnonzero(active)
    left = np.abs(offset[rows] + matrix[rows] @ force)
    return bool(left.max(initial=0.0) <= _OPEN * np.abs(offset).max(initial=0.0))


def _forces(matrix: Floats, offset: Floats, active: Booleans) -> Floats:
    """Forces that close the active gaps."""
    force = np.zeros(len(offset))
    rows = np.flatnonzero(active)
    if len(rows) == 1:
        force[rows] = -offset[rows] / matrix[rows[0], rows[0]]
    elif len(rows):
        block = matrix[rows[:, None], rows]
        # LAPACK's Cholesky at once: SciPy's wrappers would cost more than a small system.
        _, found, failed = dposv(block, -offset[rows], lower=True, overwrite_a=True)
        if failed:  # singular by rounding
            found = np.linalg.lstsq(matrix[rows[:, None], rows], -offset[rows])[0]
        force[rows] = found
    return force


def _murty(
    matrix: Floats, offset: Floats, active: Booleans, tolerance: float
) -> tuple[Floats, int]:
    """Flip the first pair that is wrong until none is; finite for positive definite matrices.

    Source: Murty, Note on a Bard-type scheme, Opsearch 11 (1974) 123-130.
    """
    active = active.copy()
    for pivot in range(1, 50 * len(offset) + 1):
        force = _forces(matrix, offset, active)
        gap = offset + matrix @ force
        wrong = np.where(active, force < 0.0, gap < -tolerance)
        if not wrong.any():
            return force, pivot
        first = int(np.argmax(wrong))
        active[first] = not active[first]
    raise ConvergenceError(
        f"contact: no active set was found for {len(offset)} pairs in {50 * len(offset)} pivots; "
        "use a smaller solve.dt or solve.courant"
    )


@dataclass(frozen=True)
class Halfway:
    """Gaps whose law acts on velocities, as those of nodes with mass on both sides.

    Positions cannot be the law there: a node that arrives with the speed w would leave with -w.
    With w_a and w_b before and after the layer, Moreau's and Jean's rule

        0 <= Lambda _|_ w_b + e w_a >= 0    where the gap would close,

    makes the work Lambda (w_a + w_b) dt / 2 <= 0 for nodes that approach. For those that leave
    (w_a > 0), e = 1 stands in, so that this work is 0: no layer gains energy.

    Between nodes with mass and ends of bars, or two of these, nothing stores the force from layer
    to layer either, but an end has a velocity at once: the law acts on gaps, and the force of a
    layer is its own. Its work is Lambda times the change of the gap, never positive.

    Attributes:
        rows: Which gaps have forces of the layer alone, of both sorts, shape (pairs,).
        way: (w_b + e w_a) dt / 2 without contact forces [m], shape (pairs,) or (pairs, dim) with
            the tangential parts, which have no e. The unit makes the answer of Lambda that of the
            gaps, so that both kinds of gaps are one problem. Of ends of bars the gap itself [m].
        ends: Which of the gaps are those of ends of bars, shape (pairs,).
        across: Which of the other gaps have springs and no massless nodes, shape (pairs,): only
            what is tangential acts on velocities, and has forces of the layer alone. None: none.
    """

    rows: Booleans
    way: Floats
    ends: Booleans
    across: Booleans | None = None

    def acting(self, gap: Floats) -> NDArray[np.int64]:
        """Gaps to be solved: those of positions, and of the others what would close."""
        return np.flatnonzero(~self.rows | self.ends | (gap <= 0.0))


def keeping(rule: Rule, springs: ContactSprings | None) -> Rule:
    """The rule where springs keep their energy, whatever impacts beside them do."""
    return "conserving" if springs is not None and rule == "middle" else rule


def rebound(before: Floats, after: Floats, restitution: Floats, dt: float) -> Floats:
    """(w_b + e w_a) dt / 2 of normal velocities [m]; see `Halfway`."""
    lively = np.where(before > 0.0, 1.0, restitution)
    return np.asarray(0.5 * dt * (after + lively * before))


def expanded(restitution: Floats, compression: Floats, before: Floats) -> Floats:
    """Least forces of impacts with a compression and an expansion (Poisson) [N], (pairs,).

    Args:
        restitution: Poisson's e, 0 where there is no such impact, (pairs,).
        compression: Forces that end the approach, (pairs,).
        before: What of these bodies that rest on each other had before, (pairs,).
    """
    struck = np.maximum(compression - before, 0.0)
    return np.where(restitution > 0.0, compression + restitution * struck, 0.0)


def solve_layer_at_speed(
    free: Floats,
    halfway: Halfway,
    response: Floats,
    compliance: Floats,
    before: tuple[Floats, Floats],
    rule: Rule,
    solver: Solver,
    springs: ContactSprings | None = None,
) -> LayerContact:
    """Find the contact forces of a layer in which the law of some gaps acts on velocities.

    Args:
        free: As for `solve_layer`, and so are those not named here.
        halfway: Which gaps, and what their law acts on.
        response: See there.
        compliance: See there; 0 for gaps at velocity level.
        before: See there.
        rule: See there; how theta weighs impulses does not matter.
        solver: See there.
        springs: See there.
    """
    acting = halfway.acting(free)
    fast, block = halfway.rows[acting], np.ix_(acting, acting)
    found = solve_layer(
        np.where(fast, halfway.way[acting], free[acting]), response[block], compliance[block],
        (np.where(fast, 0.0, before[0][acting]), np.where(fast, 0.0, before[1][acting])),
        rule, solver, None if springs is None else springs.some(acting),
    )  # fmt: skip
    force, multiplier = np.zeros(len(free)), np.zeros(len(free))
    force[acting] = found.force
    multiplier[acting] = np.where(fast, found.force, found.multiplier)
    gap = free + response @ force + compliance @ np.where(halfway.rows, 0.0, multiplier)
    gap[acting[~fast]] = found.gap[~fast]
    return LayerContact(force, multiplier, gap, found.theta, found.iterations)
