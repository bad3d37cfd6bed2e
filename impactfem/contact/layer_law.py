"""Contact of a time layer, with Coulomb friction or without: cones, slip, and what decides energy.

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

Pairs that do not answer to each other's forces are problems of their own, each with its theta: what
happens elsewhere in a scene changes nothing. V is their sum, so that each keeps its energy.

**Friction.** A pair has the relative place r = (gap, r_t), with one or two tangential components or
none, and the force f = (lambda, tau). Let z be the place that the inside of the body gives it
without contact forces: r = z + D f, and a layer exerts F = (Lambda, T) = (1 - theta) f_a +
theta f_b with z_b = z_free + C F.

**Energy.** The elastic energy is that of the inside plus f . D f / 2, and F does the work
F . (z_b - z_a) on the inside (midpoint rule). With delta = f_b - f_a and Delta r = r_b - r_a

    E_b - E_a = F . Delta z + (f_b . D f_b - f_a . D f_a) / 2
              = F . Delta r - (theta - 1/2) delta . D delta                       (z = r - D f)
              = T . Delta r_t + N(theta),
    N = (1 - theta) lambda_a . gap_b - theta lambda_b . gap_a - (theta - 1/2) delta . D delta,

since lambda . gap = 0 at both ends. Without friction N = 0 is the rule above; with it delta and D
have their tangential parts too.

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

**Velocity level** (`impactfem.contact.speed_law`): the layer force obeys the law with the velocity
at the end of the layer in place of Delta r_t; nodes that stick have no speed.

**Springs in gaps** (`impactfem.contact.springs`) press by d(lambda): r = z + D f + (d, 0). Their
energy adds (1 - theta) e_a - theta e_b to N, e_a and e_b >= 0 as there: the signs of G(0) and G(1)
stay. Between nodes with mass (``across``) T, bounded by mu Lambda, belongs to its layer and opposes
the velocity at its end. With T = theta t the matrix of (lambda_b, t) is theta C + D, symmetric, and
|t| <= mu ((1 - theta) / theta lambda_a + lambda_b); T does W, no part of G: E_b - E_a = W + G.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.dashpots import DampedLayer
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solver import Solving, solve
from impactfem.contact.rooted import Matrix, among, full
from impactfem.contact.speed_law import Halfway, expanded
from impactfem.contact.springs import ContactSprings
from impactfem.contact.theta import EXACT, balanced, fixed_point

Rule = Literal["conserving", "dissipative", "middle"]
"""theta as above, the larger of it and 1/2, or always 1/2."""


@dataclass(frozen=True)
class Layer:
    """A layer as the law of contact sees it, for some pairs.

    Components of a pair stand one after the other, the normal one first: of ``ways`` there are one
    without friction, or as many as dimensions.

    Attributes:
        free: Places (gap, r_t) at the end of the layer if F were zero, massless nodes in
            equilibrium [m], shape (pairs, ways).
        response: C, change of these places per unit of F [m/N], shape (pairs ways, pairs ways).
        static: D [m/N], of the same shape; zero where contact nodes have mass.
        before: f_a [N] and true places r_a [m] at the start, shape (pairs, ways) each.
        friction: Coefficients mu, shape (pairs,), >= 0; None without friction.
        springs: In the gaps; None without any.
        halfway: Pairs whose law acts on velocities; None without any.
        held: Tangential places that sticking nodes keep [m], shape (pairs, ways - 1), for explicit
            layers; those of ``before`` if None.
        moments: Master and resistance to spinning of each pair where some are moments, shape
            (pairs,) each; see `impactfem.contact.friction_newton.ConeProblem`. They act where their
            masters do, and their places are relative turns.
    """

    free: Floats
    response: Matrix
    static: Matrix
    before: tuple[Floats, Floats]
    friction: Floats | None = None
    springs: ContactSprings | None = None
    halfway: Halfway | None = None
    held: Floats | None = None
    moments: tuple[Integers, Floats] | None = None

    @cached_property
    def masters(self) -> Integers:
        """Whose normal force bounds each pair, (pairs,)."""
        return np.arange(len(self.free)) if self.moments is None else self.moments[0]

    @cached_property
    def across(self) -> Booleans:
        """See `Halfway`, (pairs,)."""
        if self.halfway is None or self.halfway.across is None:
            return np.zeros(len(self.free), dtype=bool)
        return self.halfway.across

    @cached_property
    def has_friction(self) -> bool:
        """Whether there are any tangential forces or moments."""
        spins = self.moments is not None and bool(self.moments[1].any())
        return spins or (self.friction is not None and bool(self.friction.any()))

    @property
    def stuck(self) -> Floats:
        """Tangential places that sticking nodes keep [m], (pairs, ways - 1)."""
        return self.before[1][:, 1:] if self.held is None else self.held

    def some(self, rows: Integers) -> "Layer":
        """That of some pairs in their order, with the masters of all moments among them."""
        if len(rows) == len(self.free):
            return self
        wide = (self.free.shape[1] * rows[:, None] + np.arange(self.free.shape[1])).ravel()
        moments, halfway = self.moments, self.halfway
        if moments is not None:
            moments = np.searchsorted(rows, moments[0][rows]), moments[1][rows]
        if halfway is not None:
            law = halfway
            across, touching = self.across[rows], law.touching
            touching = None if touching is None else touching[rows]
            halfway = Halfway(law.rows[rows], law.way[rows], law.ends[rows], across, touching)
        return Layer(
            self.free[rows], among(self.response, wide), among(self.static, wide),
            (self.before[0][rows], self.before[1][rows]),
            None if self.friction is None else self.friction[rows],
            None if self.springs is None else self.springs.some(rows),
            halfway, None if self.held is None else self.held[rows], moments,
        )  # fmt: skip

    def problem(self, matrix: Matrix, offset: Floats, base: Floats) -> ConeProblem:
        """The problem of some forces by what is left of the places [m], (pairs, ways)."""
        mu = np.zeros(len(offset)) if self.friction is None else self.friction
        master, spinning = self.moments or (None, None)
        return ConeProblem(matrix, offset, mu, base, master, spinning, self.springs)


@dataclass(frozen=True)
class LayerContact:
    """Contact in one layer.

    Attributes:
        force: F = (Lambda, T) of the layer [N], shape (pairs, ways), Lambda >= 0.
        multiplier: f_b at the end of the layer [N], shape (pairs, ways); its tangential part is T
            for the rule "middle" and at velocity level.
        place: (gap, r_t) at the end [m], shape (pairs, ways), the gap >= 0 to rounding.
        work: Frictional work of each pair in the layer [J], shape (pairs,). It is <= 0 to rounding
            unless the law measures slip otherwise than energy does: at velocity level and with
            ``held`` places, in layers where a slip turns or ends.
        theta: Weight of f_b; of pairs in groups of their own that furthest from 1/2.
        iterations: Linear systems solved.
        braked: Work of dashpots beside springs [J], <= 0; their forces are none of the multipliers.
    """

    force: Floats
    multiplier: Floats
    place: Floats
    work: Floats
    theta: float
    iterations: int
    braked: float = 0.0

    def split(self, count: int) -> "tuple[LayerContact, LayerContact]":
        """That of the first pairs, and that of the others; of all pairs twice the same."""
        if count == len(self.force):
            return self, self
        first, rest = (
            replace(
                self, force=self.force[part], multiplier=self.multiplier[part],
                place=self.place[part], work=self.work[part],
            )
            for part in (slice(0, count), slice(count, None))
        )  # fmt: skip
        return first, rest


def keeping(rule: Rule, springs: ContactSprings | None) -> Rule:
    """The rule where springs keep their energy, whatever impacts beside them do."""
    return "conserving" if springs is not None and rule == "middle" else rule


def solve_layer(
    layer: Layer,
    rule: Rule,
    how: Solving,
    poisson: Floats | None = None,
    given: Floats | None = None,
) -> LayerContact:
    """Find the contact forces of a layer.

    Poisson's impacts have two phases. The impulse of compression ends the approach; that of
    expansion is at least e times what it adds to the force before, and larger where nodes would
    come together otherwise.

    Args:
        layer: The pairs.
        rule: How theta is chosen; with friction "middle" is for nodes with mass, D = 0.
        how: How problems are solved.
        poisson: Poisson's restitution in layers with an impact, else 0, (pairs,); None: 0.
        given: Forces of impacts that came one after the other [N], (pairs, ways); None: they come
            at once.

    Raises:
        ConvergenceError: The active set, stick and slip or theta were not found.
    """
    if given is not None:
        return _beside(layer, rule, how, given)
    found = _once(layer, rule, how)
    if poisson is None or layer.halfway is None or not poisson.any():
        return found
    given = np.zeros_like(layer.free)
    given[:, 0] = expanded(poisson, found.force[:, 0], layer.before[0][:, 0])
    return _beside(layer, rule, how, given)


def _beside(layer: Layer, rule: Rule, how: Solving, given: Floats) -> LayerContact:
    """Forces of a layer of which some are given on gaps of velocities, what is added included."""
    moved, law = _times(layer.response, given), layer.halfway
    if law is None:
        raise ValueError("forces are given where the law acts on velocities")
    free = layer.free + moved
    # Gaps of velocities still act where they would close without forces.
    free[law.rows, 0] = layer.free[law.rows, 0]
    found = _once(replace(layer, free=free, halfway=replace(law, way=law.way + moved)), rule, how)
    place = found.place.copy()
    place[law.rows, 0] += moved[law.rows, 0]
    force, multiplier = found.force + given, found.multiplier + given
    work = found.work + _work(given, place, layer.before[1])
    return replace(found, force=force, multiplier=multiplier, place=place, work=work)


def _once(layer: Layer, rule: Rule, how: Solving) -> LayerContact:
    """The same without phases of impacts."""
    if layer.halfway is None or not layer.halfway.acts:
        return _of_levels(layer, rule, how)
    return _at_speed(layer, layer.halfway, rule, how)


def _at_speed(layer: Layer, law: Halfway, rule: Rule, how: Solving) -> LayerContact:
    """The same where the law of some pairs acts on velocities.

    There the force of the layer obeys the law with the velocity at its end: nodes that stick have
    no speed.
    """
    old, place_a = layer.before
    # Gaps that are shut but for rounding are shut: what rests on something is held by it.
    shut = layer.free[layer.masters, 0] - how.tolerance
    acting, fast = law.acting(shut), law.components()
    known = np.where(fast, 0.0, old), np.where(fast, 0.0, place_a)
    held = None if layer.held is None else np.where(fast[:, 1:], 0.0, layer.held)
    free = np.where(fast, law.way, layer.free)
    levels = replace(layer, free=free, before=known, held=held).some(acting)
    near = known[0] * np.array([0.5, *[1.0] * (old.shape[1] - 1)])
    found = _of_levels(levels, rule, how, np.where(fast, old, near)[acting])
    fast = fast[acting]
    force, multiplier, work = np.zeros_like(old), np.zeros_like(old), np.zeros(len(old))
    force[acting] = found.force
    multiplier[acting] = np.where(fast, found.force, found.multiplier)
    strained = np.where(law.rows[:, None], 0.0, multiplier)
    place = layer.free + _times(layer.response, force) + _times(layer.static, strained)
    place[acting] = np.where(fast, place[acting], found.place)
    work[acting] = _work(force, place, place_a)[acting]
    slow = ~fast.any(axis=1)
    work[acting[slow]] = found.work[slow]
    resists = layer.masters != np.arange(len(old))
    work[resists] += (force * place)[resists, 0]
    return LayerContact(force, multiplier, place, work, found.theta, found.iterations, found.braked)


def _of_levels(layer: Layer, rule: Rule, how: Solving, near: Floats | None = None) -> LayerContact:
    """Forces whose law acts on places; ``near``: to begin with where contact nodes have mass."""
    if rule == "middle" and layer.has_friction:
        return _with_mass(layer, how, near)
    # Without a theta to find they change each other by rounding only.
    groups = () if rule == "middle" else _groups(layer)
    if not groups:
        return _solve_group(layer, rule, how)
    found = [_solve_group(layer.some(rows), rule, how) for rows in groups]
    return LayerContact(
        _scattered(groups, [each.force for each in found]),
        _scattered(groups, [each.multiplier for each in found]),
        _scattered(groups, [each.place for each in found]),
        _scattered(groups, [each.work for each in found]),
        max((each.theta for each in found), key=lambda theta: abs(theta - 0.5)),
        sum(each.iterations for each in found),
        sum(each.braked for each in found),
    )


def _groups(layer: Layer) -> Sequence[Integers]:
    """Pairs that do not answer to each other, nor bound each other's moments."""
    (pairs, ways), matrices = layer.free.shape, (full(layer.response), full(layer.static))
    if pairs < 2 or any(matrix[0].all() for matrix in matrices):  # by far the most
        return ()
    if ways == 1:
        return uncoupled(*matrices)
    links = np.zeros((pairs, pairs))
    for matrix in matrices:
        links += np.abs(matrix).reshape(pairs, ways, pairs, ways).max(axis=(1, 3)) > 0.0
    own = np.arange(pairs)
    links[own, layer.masters] = links[layer.masters, own] = 1.0
    return uncoupled(links)


def uncoupled(*matrices: Floats) -> Sequence[Integers]:
    """Groups of rows that have no entries with each other in any of some matrices.

    Args:
        matrices: Symmetric, of one shape (rows, rows).

    Returns:
        Rows of each group; nothing where there is a single one.
    """
    count = len(matrices[0])
    if count < 2 or any(matrix[0].all() for matrix in matrices):
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


def _scattered(groups: Sequence[Integers], values: Sequence[Floats]) -> Floats:
    """Values of the rows of groups, of each row at its place."""
    found = np.zeros((sum(map(len, groups)), *values[0].shape[1:]))
    for rows, own in zip(groups, values, strict=True):
        found[rows] = own
    return found


def _solve_group(  # noqa: PLR0915  (a layer is one matter)
    layer: Layer, rule: Rule, how: Solving
) -> LayerContact:
    """The same of pairs that answer to each other, but for friction on nodes with mass."""
    old, place_a = layer.before
    response, static, springs = full(layer.response), full(layer.static), layer.springs
    total, start, damped = 0, old, springs is not None and bool(springs.damped.any())
    acted: dict[float, Floats] = {}  # forces by theta, where dashpots add to those of both ends
    # What belongs to the layer is bounded by its force.
    given = layer.across | (layer.masters != np.arange(len(old)))

    def end(theta: float) -> tuple[Floats, Floats]:
        nonlocal total, start
        before, base = (1.0 - theta) * old, (1.0 - theta) / theta * old[:, 0]
        law = DampedLayer.of(springs, old[:, 0], theta) if springs is not None and damped else None
        if law is not None:
            base = law.least
            before[:, 0] = theta * base
        offset = layer.free + _times(response, before)
        slipped = offset.copy()
        slipped[:, 1:] -= layer.stuck
        if law is not None:
            slipped[:, 0] += law.first
        matrix = theta * response + static
        problem = layer.problem(matrix, slipped, np.where(given, base[layer.masters], 0.0))
        problem = problem if law is None else replace(problem, springs=law)
        start, systems = solve(problem, start, how)
        total += systems
        place = offset + _times(matrix, start)
        if law is not None:
            acted[theta] = before + theta * start
            new, depth = start.copy(), law.depths(place[:, 0])
            new[:, 0] = np.where(law.there, law.drawn(depth)[0], start[:, 0])
            place[:, 0] += depth
            return new, place
        if springs is not None:
            place[:, 0] += springs.depth(start[:, 0])
        return start, place

    def excess(theta: float, new: Floats, place: Floats) -> tuple[float, bool]:
        """What theta should be more, and whether the energy hardly depends on that."""
        released, pressed = float(old[:, 0] @ place[:, 0]), float(new[:, 0] @ place_a[:, 0])
        strained = _energy(static, new - old)
        if springs is not None:
            more, less = springs.excess(old[:, 0], new[:, 0])
            released, pressed = released + more, pressed + less
        slip = place[:, 1:] - place_a[:, 1:]
        early, late = (old[:, 1:] * slip).sum(axis=1), (new[:, 1:] * slip).sum(axis=1)
        giving = (early > 0.0) & (layer.held is None)
        wanted, slope = balanced(released, pressed, strained, early[giving], late[giving])
        wanted = max(wanted, 0.5 if rule == "dissipative" else 0.0)
        stored = _energy(static, new) + float(np.abs(late).sum())
        stored += 0.0 if springs is None else 2.0 * float(springs.energy(new[:, 0]).sum())
        return wanted - theta, abs(wanted - theta) * slope <= EXACT * stored

    theta, (new, place) = 0.5, end(0.5)
    if rule != "middle":
        theta, new, place = fixed_point(end, excess, theta, new, place)
    force, braked = (1.0 - theta) * old + theta * new, 0.0
    if springs is not None and damped:
        way = place[:, 0] - place_a[:, 0] - springs.depth(new[:, 0]) + springs.depth(old[:, 0])
        braked = float((acted[theta] - force)[:, 0] @ way)
        force = acted[theta]
    work = _work(force, place, place_a)
    work = np.minimum(work, 0.0) if layer.held is None else work
    return LayerContact(force, new, place, work, theta, total, braked)


def _with_mass(layer: Layer, how: Solving, near: Floats | None) -> LayerContact:
    """Take theta = 1/2 for normal forces; T obeys the law with Lambda.

    The unknowns are lambda_b / 2 and T: then the matrix is C, symmetric.
    """
    old, place_a = layer.before
    given = np.zeros_like(old)
    given[:, 0] = 0.5 * old[:, 0]
    offset = layer.free + _times(layer.response, given)
    slipped = offset.copy()
    slipped[:, 1:] -= layer.stuck
    start = old.copy()
    start[:, 0] *= 0.5
    problem = layer.problem(layer.response, slipped, given[:, 0])
    found, iterations = solve(problem, start if near is None else near, how)
    force, multiplier = given + found, found.copy()
    multiplier[:, 0] *= 2.0
    place = offset + _times(layer.response, found)
    work = _work(force, place, place_a)
    return LayerContact(force, multiplier, place, work, 0.5, iterations)


def _times(matrix: Matrix, values: Floats) -> Floats:
    return np.asarray((matrix @ values.ravel()).reshape(values.shape))


def _energy(matrix: Floats, values: Floats) -> float:
    """Twice the energy of forces on a compliance [J]."""
    flat = values.ravel()
    return float(flat @ (matrix @ flat))


def _work(force: Floats, place: Floats, place_a: Floats) -> Floats:
    """T . Delta r_t of each pair [J]."""
    return np.asarray((force[:, 1:] * (place[:, 1:] - place_a[:, 1:])).sum(axis=1))
