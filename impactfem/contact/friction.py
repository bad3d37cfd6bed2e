"""Contact of one time layer with Coulomb friction: cones, slip, and the rule that decides energy.

A pair has the relative place r = (gap, r_t), with one or two tangential components, and the force
f = (lambda, tau). Let z be the place that the inside of the body gives it without contact forces.
Massless contact nodes are in equilibrium, so that r = z + D f with the static compliance D, and a
layer from a to b exerts F = (Lambda, T) = (1 - theta) f_a + theta f_b with z_b = z_free + C F.

**Energy.** The elastic energy is that of the inside plus f . D f / 2, and F does the work
F . (z_b - z_a) on the inside (midpoint rule). With delta = f_b - f_a and Delta r = r_b - r_a

    E_b - E_a = F . Delta z + (f_b . D f_b - f_a . D f_a) / 2
              = F . Delta r - (theta - 1/2) delta . D delta                       (z = r - D f)
              = T . Delta r_t + N(theta),
    N = (1 - theta) lambda_a . gap_b - theta lambda_b . gap_a - (theta - 1/2) delta . D delta,

since lambda . gap = 0 at both ends. Without friction N = 0 is the rule of
`impactfem.contact.complementarity`; with it delta and D have their tangential parts too.

**Which force obeys the cone.** The multipliers at the levels: |tau_b| <= mu lambda_b, with
tau_b = -mu lambda_b Delta r_t / |Delta r_t| in slip and Delta r_t = 0 in stick. By convexity then
|T| <= mu Lambda. Were it T instead, tau_b = (T - (1 - theta) tau_a) / theta would leave the cone
when T jumps and alternate for ever (theta = 1/2: mu lambda, -3 mu lambda, mu lambda, ...), and
f . D f with it.

**Sign of the frictional work.** The work T . Delta r_t of a pair j is linear in theta,

    w_j(theta) = (1 - theta) p_j + theta q_j,
    p_j = tau_a . Delta r_t,   q_j = tau_b . Delta r_t = -mu lambda_b |Delta r_t|,

and only p_j can be positive: where a force that falls meets a slip that has turned within the
layer, as at releases (for theta >= 1/2 and mu lambda_b >= |tau_a| always w_j <= 0). A positive w_j
is no work of friction, which cannot give any; it is there because a layer does not know when in it
the force has changed, and so are the terms of N. It is counted with them, and the frictional work
W of the layer is the rest:

    G(theta) = N(theta) + sum of max(0, w_j),   W = sum of min(0, w_j) <= 0,   E_b - E_a = W + G.

For given ends G is convex, piecewise linear and falls, with

    G(0) = lambda_a . gap_b + delta . D delta / 2 + sum of max(0, p_j) >= 0,
    G(1) = -lambda_b . gap_a - delta . D delta / 2 <= 0.

So there is a theta in [0, 1] with G = 0, for which E_b - E_a = W exactly ("conserving"), and a
larger one has G <= 0 ("dissipative" takes the larger of it and 1/2). As f_b depends on theta, it is
sought by secants in the bracket [0, 1]: the wanted theta less the used one is >= 0 at 0, <= 0 at 1,
and continuous where f_b is unique (mu not too large). Where no w_j is positive W is T . Delta r_t.

**Explicit layers** (leapfrog, massless nodes) pair the levels a = m - 1 and b = m + 1, and the same
holds for half of each term. But were the slip of the law taken between these levels too, even and
odd levels would stick at different places, and tau alternate between them for ever. There the law
takes it from level m: sticking nodes keep that place (``held``). Then q_j may be positive where a
node comes to stick, so that the rule is N = 0, which has a root by itself, and W = T . Delta r_t as
it comes: the balance is as exact, but in such layers W may be > 0.

**Contact nodes with mass** (D = 0, rule "middle"): tau_b strains nothing, so that no level has to
keep it. There the layer force itself obeys the law, |T| <= mu Lambda with T against Delta r_t, and
E_b - E_a = W + N(1/2) with W = T . Delta r_t <= 0 whatever Lambda does.

**Velocity level** (Moreau, Jean): the layer force obeys the law with the velocity at the end of the
layer in place of Delta r_t; nodes that stick have no speed.

**Springs in gaps** (`impactfem.contact.springs`) press by d(lambda): r = z + D f + (d, 0). Their
energy adds (1 - theta) e_a - theta e_b to N, e_a and e_b >= 0 as there: the signs of G(0) and G(1)
stay. Between nodes with mass (``across``) T, bounded by mu Lambda, belongs to its layer and opposes
the velocity at its end. With T = theta t the matrix of (lambda_b, t) is theta C + D, symmetric, and
|t| <= mu ((1 - theta) / theta lambda_a + lambda_b); T does W, no part of G: E_b - E_a = W + G.

With mu = 0 all this is the frictionless law, and its solver is called.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.complementarity import (
    Halfway,
    Rule,
    _fixed_point,
    scattered,
    solve_by_active_set,
    solve_layer,
    uncoupled,
)
from impactfem.contact.friction_many import Accuracy
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solver import solve_cones
from impactfem.contact.rooted import Matrix, among, full
from impactfem.contact.springs import ContactSprings

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

_EXACT = 1e-14  # error of the energy that theta leaves, as a share of the contact energy


@dataclass(frozen=True)
class FrictionContact:
    """Contact with friction in one layer.

    Attributes:
        force: F = (Lambda, T) of the layer [N], shape (pairs, dim), the normal component first.
        multiplier: f_b at the end of the layer [N], shape (pairs, dim); its tangential part is T
            for the rule "middle" and at velocity level.
        place: (gap, r_t) at the end [m], shape (pairs, dim).
        work: Frictional work of each pair in the layer [J], shape (pairs,). It is <= 0 to rounding
            unless the law measures slip otherwise than energy does: at velocity level and with
            ``held`` places, in layers where a slip turns or ends.
        theta: Weight of f_b; of pairs in groups of their own that furthest from 1/2.
        iterations: Linear systems solved.
    """

    force: Floats
    multiplier: Floats
    place: Floats
    work: Floats
    theta: float
    iterations: int

    def split(self, count: int) -> "tuple[FrictionContact, FrictionContact]":
        """That of the first pairs, and that of the others."""
        first, rest = (
            replace(
                self, force=self.force[part], multiplier=self.multiplier[part],
                place=self.place[part], work=self.work[part],
            )
            for part in (slice(0, count), slice(count, None))
        )  # fmt: skip
        return first, rest


def solve_friction_layer(
    free: Floats,
    answers: Matrix,
    static: Matrix,
    before: tuple[Floats, Floats],
    friction: Floats,
    rule: Rule,
    tolerance: float,
    max_iterations: int = 1000,
    held: Floats | None = None,
    moments: tuple[Integers, Floats] | None = None,
    near: Floats | None = None,
    accuracy: Accuracy | None = None,
    springs: tuple[ContactSprings, Booleans] | None = None,
) -> FrictionContact:
    """Find the contact forces of a layer with friction.

    Args:
        free: Places (gap, r_t) at the end of the layer if F were zero, massless nodes in
            equilibrium [m], shape (pairs, dim).
        answers: C, change of these places per unit of F [m/N], shape (pairs dim, pairs dim), the
            components of a pair one after the other.
        static: D [m/N], of the same shape; zero where contact nodes have mass.
        before: f_a [N] and true places r_a [m] at the start, shape (pairs, dim) each.
        friction: Coefficients mu, shape (pairs,), >= 0.
        rule: How theta is chosen; "middle" is for nodes with mass, D = 0.
        tolerance: Rounding level of places [m].
        max_iterations: Limit of linear systems for one theta.
        held: Tangential places that sticking nodes keep [m], shape (pairs, dim - 1), for explicit
            layers; those of ``before`` if None.
        moments: Master and resistance to spinning of each pair where some are moments, shape
            (pairs,) each; see `impactfem.contact.friction_newton.ConeProblem`.
        near: Forces to begin with where contact nodes have mass [N], (pairs, dim).
        accuracy: What is asked of those of many contacts.
        springs: In the gaps, and which of them are ``across``; None without any.

    Raises:
        ConvergenceError: Stick and slip or theta were not found.
    """
    old, place_a = before
    if rule == "middle" and friction.any():
        stuck = place_a[:, 1:] if held is None else held
        limits = stuck, tolerance, max_iterations
        spinning = moments or (None, None)
        return _with_mass(free, answers, before, friction, *limits, spinning, near, accuracy)
    response, compliance = full(answers), full(static)
    # Without a theta to find they change each other by rounding only.
    groups = () if rule == "middle" else _groups(response, compliance, old.shape[1], moments)
    if not groups:
        whole = friction, rule, tolerance, max_iterations
        return _solve_group(free, response, compliance, before, *whole, held, moments, springs)
    found = []
    for rows in groups:
        wide = (old.shape[1] * rows[:, None] + np.arange(old.shape[1])).ravel()
        law: tuple[Integers, Floats] | None = None
        if moments is not None:
            law = np.searchsorted(rows, moments[0][rows]), moments[1][rows]
        found.append(
            _solve_group(
                free[rows], response[np.ix_(wide, wide)], compliance[np.ix_(wide, wide)],
                (old[rows], place_a[rows]), friction[rows], rule, tolerance, max_iterations,
                None if held is None else held[rows], law,
                None if springs is None else (springs[0].some(rows), springs[1][rows]),
            )
        )  # fmt: skip
    return FrictionContact(
        scattered(groups, [each.force for each in found]),
        scattered(groups, [each.multiplier for each in found]),
        scattered(groups, [each.place for each in found]),
        scattered(groups, [each.work for each in found]),
        max((each.theta for each in found), key=lambda theta: abs(theta - 0.5)),
        sum(each.iterations for each in found),
    )


def _groups(
    response: Floats, compliance: Floats, dim: int, moments: tuple[Integers, Floats] | None
) -> Sequence[Integers]:
    """Pairs that do not answer to each other, nor bound each other's moments."""
    pairs = len(response) // dim
    if pairs < 2 or response[0].all():  # by far the most
        return ()
    links = np.zeros((pairs, pairs))
    for matrix in response, compliance:
        links += np.abs(matrix).reshape(pairs, dim, pairs, dim).max(axis=(1, 3)) > 0.0
    if moments is not None:
        own = np.arange(pairs)
        links[own, moments[0]] = links[moments[0], own] = 1.0
    return uncoupled(links)


def _solve_group(
    free: Floats,
    response: Floats,
    compliance: Floats,
    before: tuple[Floats, Floats],
    friction: Floats,
    rule: Rule,
    tolerance: float,
    max_iterations: int,
    held: Floats | None,
    moments: tuple[Integers, Floats] | None,
    springs: tuple[ContactSprings, Booleans] | None,
) -> FrictionContact:
    """The same of pairs that answer to each other, but for friction on nodes with mass."""
    old, place_a = before
    law = moments or (None, None)
    if not friction.any():
        limits = tolerance, max_iterations
        return _without_friction(free, response, compliance, before, rule, *limits, springs)
    stuck = place_a[:, 1:] if held is None else held
    total, start = 0, old
    soft, across = springs or (None, np.zeros(len(free), dtype=bool))
    own = np.arange(len(free))
    masters = own if moments is None else moments[0]
    given = across | (masters != own)  # what belongs to the layer is bounded by its force

    def end(theta: float) -> tuple[Floats, Floats]:
        nonlocal total, start
        offset = free + _times(response, (1.0 - theta) * old)
        slipped = offset.copy()
        slipped[:, 1:] -= stuck
        matrix = theta * response + compliance
        base = np.where(given, (1.0 - theta) / theta * old[masters, 0], 0.0)
        problem = ConeProblem(matrix, slipped, friction, base, *law)
        start, systems = _obeying(problem, soft, start, tolerance, max_iterations)
        total += systems
        place = offset + _times(matrix, start)
        if soft is not None:
            place[:, 0] += soft.depth(start[:, 0])
        return start, place

    def excess(theta: float, new: Floats, place: Floats) -> tuple[float, bool]:
        """What theta should be more, and whether the energy hardly depends on that."""
        released = float(old[:, 0] @ place[:, 0])
        pressed = float(new[:, 0] @ place_a[:, 0])
        strained = float(((new - old) * _times(compliance, new - old)).sum())
        if soft is not None:
            more, less = soft.excess(old[:, 0], new[:, 0])
            released, pressed = released + more, pressed + less
        slip = place[:, 1:] - place_a[:, 1:]
        early, late = (old[:, 1:] * slip).sum(axis=1), (new[:, 1:] * slip).sum(axis=1)
        giving = (early > 0.0) & (held is None)
        wanted, slope = _balanced(released, pressed, strained, early[giving], late[giving])
        wanted = max(wanted, 0.5 if rule == "dissipative" else 0.0)
        stored = float((new * _times(compliance, new)).sum()) + float(np.abs(late).sum())
        stored += 0.0 if soft is None else 2.0 * float(soft.energy(new[:, 0]).sum())
        return wanted - theta, abs(wanted - theta) * slope <= _EXACT * stored

    theta, new, place = _fixed_point(end, excess, 0.5, *end(0.5))
    force = (1.0 - theta) * old + theta * new
    work = _work(force, place, place_a)
    work = np.minimum(work, 0.0) if held is None else work
    return FrictionContact(force, new, place, work, theta, total)


def _obeying(
    problem: ConeProblem, springs: ContactSprings | None, start: Floats, tolerance: float, most: int
) -> tuple[Floats, int]:
    """Forces that obey a law in which springs may give way, and linear systems solved."""
    if springs is None:
        return solve_cones(problem, start, tolerance, most)
    matrix, first = full(problem.matrix), slice(None, None, start.shape[1])

    def obey(give: Floats, rest: Floats) -> tuple[Floats, Floats, int]:
        nonlocal start
        softer = replace(problem, matrix=matrix.copy(), offset=problem.offset.copy())
        full(softer.matrix)[first, first] += np.diag(give)
        softer.offset[:, 0] += rest
        start, count = solve_cones(softer, start, tolerance, most)
        return start[:, 0], problem.answers(start)[:, 0], count

    count = springs.solve(obey, problem.offset[:, 0], matrix.diagonal()[first], tolerance)
    return start, count


def _balanced(
    released: float, pressed: float, strained: float, early: Floats, late: Floats
) -> tuple[float, float]:
    """The theta with G = 0, and the steepest slope of G.

    Args:
        released: lambda_a . gap_b [J], >= 0.
        pressed: lambda_b . gap_a [J], >= 0.
        strained: delta . D delta [J], >= 0.
        early: The p_j > 0 [J].
        late: Their q_j <= 0 [J].
    """
    room = released + pressed + strained
    slope = room + float((early - late).sum())
    if slope <= 0.0:
        return 0.5, 0.0
    theta = 0.0
    # Newton's steps from the left of a convex function: each drops a pair, or is the last one.
    for _ in range(len(early) + 1):
        acting = (1.0 - theta) * early + theta * late > 0.0
        top = released + 0.5 * strained + float(early[acting].sum())
        steep = room + float((early - late)[acting].sum())
        following = top / steep if steep > 0.0 else theta
        if following <= theta:
            break
        theta = following
    return min(max(theta, 0.0), 1.0), slope


def _with_mass(
    free: Floats,
    response: Matrix,
    before: tuple[Floats, Floats],
    friction: Floats,
    stuck: Floats,
    tolerance: float,
    max_iterations: int,
    law: tuple[Integers | None, Floats | None],
    near: Floats | None,
    accuracy: Accuracy | None,
) -> FrictionContact:
    """Take theta = 1/2 for normal forces; T obeys the law with Lambda.

    The unknowns are lambda_b / 2 and T: then the matrix is C, symmetric.
    """
    old, place_a = before
    given = np.zeros_like(old)
    given[:, 0] = 0.5 * old[:, 0]
    offset = free + _times(response, given)
    slipped = offset.copy()
    slipped[:, 1:] -= stuck
    problem = ConeProblem(response, slipped, friction, given[:, 0], *law)
    start = old.copy()
    start[:, 0] *= 0.5
    if near is not None:
        start = near
    found, iterations = solve_cones(problem, start, tolerance, max_iterations, accuracy)
    force, multiplier = given + found, found.copy()
    multiplier[:, 0] *= 2.0
    place = offset + _times(response, found)
    work = _work(force, place, place_a)
    return FrictionContact(force, multiplier, place, work, 0.5, iterations)


def solve_friction_layer_at_speed(
    free: Floats,
    halfway: Halfway,
    response: Matrix,
    compliance: Matrix,
    before: tuple[Floats, Floats],
    friction: Floats,
    rule: Rule,
    tolerance: float,
    max_iterations: int = 1000,
    held: Floats | None = None,
    moments: tuple[Integers, Floats] | None = None,
    accuracy: Accuracy | None = None,
    springs: ContactSprings | None = None,
) -> FrictionContact:
    """Find the contact forces of a layer in which the law of some gaps acts on velocities.

    There the force of the layer obeys the cone with the velocity at its end: nodes that stick have
    no speed. Arguments as of `solve_friction_layer`, ``halfway`` with tangential parts, and
    ``springs`` in the gaps. Moments act where their masters do; their places are relative turns.

    Raises:
        ConvergenceError: Stick and slip or theta were not found.
    """
    masters = np.arange(len(free)) if moments is None else moments[0]
    acting = halfway.acting(free[masters, 0])
    own = np.searchsorted(acting, masters[acting])
    law = None if moments is None else (own, moments[1][acting])
    dim = free.shape[1]
    wide = (dim * acting[:, None] + np.arange(dim)).ravel()
    fast = np.repeat(halfway.rows[acting][:, None], dim, axis=1)
    soft = None
    if springs is not None and halfway.across is not None:
        soft = springs.some(acting), halfway.across[acting]
        fast[:, 1:] |= soft[1][:, None]
    old, place_a = before
    known = [np.where(fast, 0.0, values[acting]) for values in before]
    near = np.where(fast, old[acting], known[0] * np.array([0.5, *[1.0] * (dim - 1)]))
    found = solve_friction_layer(
        np.where(fast, halfway.way[acting], free[acting]), among(response, wide),
        among(compliance, wide), (known[0], known[1]), friction[acting], rule, tolerance,
        max_iterations, None if held is None else np.where(fast[:, 1:], 0.0, held[acting]), law,
        near, accuracy, soft,
    )  # fmt: skip
    force, multiplier, work = np.zeros_like(old), np.zeros_like(old), np.zeros(len(old))
    force[acting] = found.force
    multiplier[acting] = np.where(fast, found.force, found.multiplier)
    strained = np.where(halfway.rows[:, None], 0.0, multiplier)
    place = free + _times(response, force) + _times(compliance, strained)
    place[acting] = np.where(fast, place[acting], found.place)
    work[acting] = _work(force, place, place_a)[acting]
    slow = ~fast.any(axis=1)
    work[acting[slow]] = found.work[slow]
    resists = masters != np.arange(len(free))
    work[resists] += (force * place)[resists, 0]
    return FrictionContact(force, multiplier, place, work, found.theta, found.iterations)


def _without_friction(
    free: Floats,
    response: Floats,
    compliance: Floats,
    before: tuple[Floats, Floats],
    rule: Rule,
    tolerance: float,
    max_iterations: int,
    springs: tuple[ContactSprings, Booleans] | None,
) -> FrictionContact:
    old, place_a = before
    dim = free.shape[1]
    normal = (slice(None, None, dim), slice(None, None, dim))
    layer = solve_layer(
        free[:, 0], np.ascontiguousarray(response[normal]),
        np.ascontiguousarray(compliance[normal]), (old[:, 0], place_a[:, 0]), rule,
        solve_by_active_set(tolerance, max_iterations), None if springs is None else springs[0],
    )  # fmt: skip
    force, multiplier = np.zeros_like(free), np.zeros_like(free)
    force[:, 0], multiplier[:, 0] = layer.force, layer.multiplier
    place = free + _times(response, force) + _times(compliance, multiplier)
    place[:, 0] = layer.gap
    work = np.zeros(len(free))
    return FrictionContact(force, multiplier, place, work, layer.theta, layer.iterations)


def _times(matrix: Matrix, values: Floats) -> Floats:
    return np.asarray((matrix @ values.ravel()).reshape(values.shape))


def _work(force: Floats, place: Floats, place_a: Floats) -> Floats:
    """T . Delta r_t of each pair [J]."""
    return np.asarray((force[:, 1:] * (place[:, 1:] - place_a[:, 1:])).sum(axis=1))
