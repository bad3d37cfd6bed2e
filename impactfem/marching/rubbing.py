"""Friction in the time loop: what the law needs of a layer, and what it leaves for the next one."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.friction_many import Accuracy
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solver import Solving, solve
from impactfem.contact.layer_law import Layer, LayerContact, keeping, solve_layer
from impactfem.contact.rooted import Matrix, full
from impactfem.contact.speed_kernels import frames_of
from impactfem.contact.speed_law import Halfway
from impactfem.contact.springs import ContactSprings
from impactfem.marching.resisting import Moments
from impactfem.marching.schemes import SolidScheme


@dataclass(frozen=True)
class Friction:
    """Coulomb's law in the gaps.

    Attributes:
        coefficients: mu of each gap, shape (pairs,).
        tolerance: Rounding level of places [m].
        max_iterations: Limit of linear systems of a layer.
        rebound: Share of the slip that impacts of nodes with mass reverse, as far as the cone
            allows, shape (pairs,).
        static: mu of what does not slip, shape (pairs,), not smaller.
        rolling, spinning: Moments that resist over the normal force [m], shape (pairs,).
        accuracy: Of the forces of many contacts.
    """

    coefficients: Floats
    tolerance: float
    max_iterations: int
    rebound: Floats
    static: Floats
    rolling: Floats
    spinning: Floats
    accuracy: Accuracy = field(default_factory=Accuracy)

    def some(self, rows: Integers) -> "Friction":
        """Of some gaps."""
        names = ("coefficients", "rebound", "static", "rolling", "spinning")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})

    @cached_property
    def solving(self) -> Solving:
        """How its problems are solved."""
        return Solving.to(self.tolerance, self.max_iterations, self.accuracy)


@dataclass
class Rubbing:
    """Tangential state of the gaps between layers.

    Attributes:
        law: Coefficients and limits.
        tangential: Tangential multipliers at the last level [N], vectors in space, (pairs, dim).
        older_tangential: One level earlier.
        place: Displacement of the contact nodes at the last level, forces included [m], (nodes,
            dim).
        older_place: One level earlier.
        work: Frictional work in each gap in the last layer [J], (pairs,).
        stuck: 1 where a gap was shut and did not slip at the last level, (pairs,).
    """

    law: Friction
    tangential: Floats
    older_tangential: Floats
    place: Floats
    older_place: Floats
    work: Floats
    stuck: Floats

    @classmethod
    def at_rest(cls, law: Friction, place: Floats) -> "Rubbing":
        """No tangential forces yet."""
        zero = np.zeros((len(law.coefficients), place.shape[1]))
        return cls(law, zero, zero, place, place, *np.zeros((2, len(zero))))

    def advance(self, tangential: Floats, place: Floats) -> None:
        """Go to the next level."""
        self.older_tangential, self.tangential = self.tangential, tangential
        self.older_place, self.place = self.place, place


@dataclass(frozen=True)
class LayerGaps:
    """A layer as the law of friction sees it, for some gaps.

    Attributes:
        rows: The gaps.
        frames: Their directions, the normal first, shape (k, dim, dim).
        gap: Gaps at the end without forces [m], (k,).
        way: Relative displacements there, less those of obstacles [m], (k, dim).
        old: lambda_a [N] and gap_a [m], (k,) each.
        old_tangential: tau_a [N], vectors in space, (k, dim).
        old_way: Relative displacements at a [m], (k, dim).
        held: Where sticking gaps stay [m], (k, dim); None for ``old_way``.
        fast: Gaps whose law acts on velocities, (k,).
        halfway: Of these, in space, the way of `impactfem.contact.speed_law.Halfway` [m],
            normal and tangential parts, (k, dim).
        ends: Which of these are gaps of ends of bars, (k,).
        stuck: Which did not slip before, (k,).
        poisson: Poisson's restitution in layers with an impact, else 0, (k,).
        across: Which have springs and slip as those of velocities do, (k,).
        springs: In the gaps; None without any.
        touching: Which impacts reach though they would not close, (k,).
        turns: Forces of impacts one after the other [N], and what they change of ``halfway`` [m],
            along the directions, (k, dim) each; None where they come at once.
    """

    rows: Integers
    frames: Floats
    gap: Floats
    way: Floats
    old: tuple[Floats, Floats]
    old_tangential: Floats
    old_way: Floats
    held: Floats | None
    fast: NDArray[np.bool_]
    halfway: Floats
    ends: NDArray[np.bool_]
    stuck: NDArray[np.bool_]
    poisson: Floats
    across: NDArray[np.bool_]
    springs: ContactSprings | None
    touching: NDArray[np.bool_]
    turns: tuple[Floats, Floats] | None = None

    def slid(self, place: Floats) -> Floats:
        """Ways to some places (gap, r_t) as the law measures them, along the tangents [m]."""
        before = turned(self.frames, self.old_way if self.held is None else self.held)
        return np.asarray(place[:, 1:] - before[:, 1:])


def rub(
    law: Friction,
    scheme: SolidScheme,
    layer: LayerGaps,
    blocks: tuple[Matrix, Matrix],
    share: float,
    moments: Moments | None = None,
) -> tuple[LayerContact, NDArray[np.bool_]]:
    """Solve a layer; forces and multipliers come back in the frames of the gaps.

    Args:
        law: Coefficients and limits.
        scheme: Its contact rule.
        layer: The gaps that take part.
        blocks: C and D in their frames.
        share: Part of the layer's force that acts.
        moments: What resists rolling and spinning; they come back behind the forces.

    Returns:
        The contact, and which gaps are shut and do not slip.

    Raises:
        ConvergenceError: Stick, slip or theta were not found.
    """
    of_levels = ~(layer.fast | layer.across) & (keeping(scheme.rule, layer.springs) != "middle")

    def with_friction(mu: Floats) -> tuple[LayerContact, Floats]:
        found = _solve(law, scheme, layer, blocks, share, mu, moments)
        own = slice(0, len(mu))
        return found, np.where(of_levels[:, None], found.multiplier[own], found.force[own])

    rows = layer.rows
    return held_by_static(with_friction, layer.stuck, law.coefficients[rows], law.static[rows])


def held_by_static[Found](
    solve: Callable[[Floats], tuple[Found, Floats]],
    stuck: Booleans,
    kinetic: Floats,
    static: Floats,
) -> tuple[Found, Booleans]:
    """Forces where the larger coefficient holds what did not slip, unless it slips all the same.

    Args:
        solve: A solution with some coefficients, and its forces [N], (k, ways).
        stuck: What did not slip before, (k,).
        kinetic: Coefficient of what slips, (k,).
        static: Of what does not, (k,).

    Returns:
        The solution, and which gaps are shut and do not slip.
    """
    holds = stuck & (static > kinetic)
    while True:
        mu = np.where(holds, static, kinetic)
        found, force = solve(mu)
        inside = np.linalg.norm(force[:, 1:], axis=1) < (1.0 - ON_CONE) * mu * force[:, 0]
        slips = holds & ~inside & (force[:, 0] > 0.0)
        if not slips.any():
            return found, inside
        holds = holds & ~slips


ON_CONE = 1e-9  # share of the bound within which a tangential force has reached it


def _solve(
    law: Friction,
    scheme: SolidScheme,
    layer: LayerGaps,
    blocks: tuple[Matrix, Matrix],
    share: float,
    mu: Floats,
    moments: Moments | None,
) -> LayerContact:
    """Solve a layer with some friction."""
    free = turned(layer.frames, layer.way)
    free[:, 0] = layer.gap
    before = turned(layer.frames, layer.old_way)
    before[:, 0] = layer.old[1]
    old = turned(layer.frames, layer.old_tangential)
    old[:, 0] = layer.old[0]
    made = Layer(
        free, share * blocks[0], blocks[1], (old, before), mu, layer.springs,
        held=None if layer.held is None else turned(layer.frames, layer.held)[:, 1:],
    )  # fmt: skip
    poisson, given = layer.poisson, None
    if moments is not None or (layer.fast | layer.across).any():
        ways = turned(layer.frames, layer.halfway)
        if layer.turns is not None:
            given, ways = layer.turns[0], ways + layer.turns[1]
        acts = Halfway(layer.fast, ways, layer.ends, layer.across, layer.touching)
        made = replace(made, halfway=acts)
    if moments is not None:
        made = _resisted(made, moments, share)
        none = np.zeros_like(moments.way)
        poisson = np.concatenate([poisson, none[:, 0]])
        given = None if given is None else np.concatenate([given, none])
    return solve_layer(made, keeping(scheme.rule, layer.springs), law.solving, poisson, given)


def _resisted(layer: Layer, moments: Moments, share: float) -> Layer:
    """A layer at whose gaps moments resist, which stand behind them."""
    count, more = len(layer.free), len(moments.of)
    none, yes, law = np.zeros_like(moments.way), np.ones(more, dtype=bool), layer.halfway
    if law is None or law.touching is None or layer.friction is None:
        raise ValueError("moments act on velocities, where there is friction")
    across = share * moments.across
    return replace(
        layer,
        free=np.concatenate([layer.free, moments.way]),
        response=np.block([[full(layer.response), across], [across.T, share * moments.own]]),
        static=np.pad(full(layer.static), (0, none.size)),
        before=(
            np.concatenate([layer.before[0], none]),
            np.concatenate([layer.before[1], none]),
        ),
        friction=np.concatenate([layer.friction, moments.rolling]),
        springs=None if layer.springs is None else layer.springs.beside(more),
        halfway=Halfway(
            np.concatenate([law.rows, yes]),
            np.concatenate([law.way, moments.after]),
            np.concatenate([law.ends, ~yes]),
            np.concatenate([layer.across, ~yes]),
            np.concatenate([law.touching, law.touching[moments.of]]),
        ),
        held=None if layer.held is None else np.concatenate([layer.held, none[:, 1:]]),
        moments=(
            np.concatenate([np.arange(count), moments.of]),
            np.concatenate([np.zeros(count), moments.spinning]),
        ),
    )


def obeying(
    matrix: Floats,
    offset: Floats,
    rows: Integers,
    start: Floats,
    law: Friction | None,
    how: Solving,
) -> Floats:
    """Forces in some gaps for which the law of contact and friction holds, (rows, ways).

    Args:
        matrix: Their increments by forces [m/N], (rows ways, rows ways).
        offset: Increments without any [m], (rows, ways).
        rows: The gaps.
        start: Forces to begin with [N], (rows, ways).
        law: Coulomb's; None without, where only normal forces are.
        how: How it is solved.

    Raises:
        ConvergenceError: They were not found.
    """
    none = np.zeros(len(rows))
    mu = none if law is None else law.coefficients[rows]
    return solve(ConeProblem(matrix, offset, mu, none), start, how)[0]


def told(directions: Floats, force: Floats, way: Floats) -> tuple[Floats, Floats]:
    """What histories have of forces, and of the ways slid.

    In the plane the tangent is the normal turned by -90 degrees, which of a floor points to the
    right: the same whichever side of a gap is looked from.

    Args:
        directions: Of the gaps, the normal first, (k, dim, dim).
        force: Along them [N], (k, dim).
        way: Slid, along the tangents, as the law of friction measures it [m], (k, dim - 1).

    Returns:
        Normal forces followed by tangential ones [N], (k, 2), or vectors in space, (k, 4); ways
        [m], in the plane with sign, in space lengths, (k,).
    """
    if way.shape[1] == 1:  # the frames have the opposite tangent
        return force * [1.0, -1.0], -way[:, 0]
    tangential = in_space(directions[:, 1:], force[:, 1:])
    return np.hstack([force[:, :1], tangential]), np.linalg.norm(way, axis=1)


def frames(normals: Floats) -> Floats:
    """Orthonormal directions with the normals first, shape (k, dim, dim)."""
    return np.asarray(frames_of(np.ascontiguousarray(normals)))


def turned(directions: Floats, vectors: Floats) -> Floats:
    """Components of vectors along some directions, (k, dim)."""
    found: Floats = np.einsum("kij,kj->ki", directions, vectors)
    return found


def in_space(directions: Floats, components: Floats) -> Floats:
    """Vectors of components along some directions, the inverse of `turned`."""
    found: Floats = np.einsum("kij,ki->kj", directions, components)
    return found
