"""Friction in the time loop: what the law needs of a layer, and what it leaves for the next one."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.complementarity import Halfway, Solver, expanded, keeping
from impactfem.contact.friction import (
    FrictionContact,
    solve_friction_layer,
    solve_friction_layer_at_speed,
)
from impactfem.contact.friction_many import Accuracy
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solver import solve_cones
from impactfem.contact.rooted import Matrix, full
from impactfem.contact.springs import ContactSprings
from impactfem.marching.resisting import Moments
from impactfem.marching.schemes import SolidScheme

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


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
        halfway: Of these, in space, the way of `impactfem.contact.complementarity.Halfway` [m],
            normal and tangential parts, (k, dim).
        ends: Which of these are gaps of ends of bars, (k,).
        stuck: Which did not slip before, (k,).
        poisson: Poisson's restitution in layers with an impact, else 0, (k,).
        across: Which have springs and slip as those of velocities do, (k,).
        springs: In the gaps; None without any.
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
) -> tuple[FrictionContact, NDArray[np.bool_]]:
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
    # What did not slip before is held by the larger coefficient, unless it slips all the same.
    of_levels = ~(layer.fast | layer.across) & (keeping(scheme.rule, layer.springs) != "middle")
    holds = layer.stuck & (law.static > law.coefficients)[layer.rows]
    while True:
        mu = np.where(holds, law.static[layer.rows], law.coefficients[layer.rows])
        found = _with_poisson(law, scheme, layer, blocks, share, mu, moments)
        force = np.where(of_levels[:, None], found.multiplier[: len(mu)], found.force[: len(mu)])
        inside = np.linalg.norm(force[:, 1:], axis=1) < (1.0 - ON_CONE) * mu * force[:, 0]
        slips = holds & ~inside & (force[:, 0] > 0.0)
        if not slips.any():
            return found, inside
        holds &= ~slips


ON_CONE = 1e-9  # share of the bound within which a tangential force has reached it


def _with_poisson(
    law: Friction,
    scheme: SolidScheme,
    layer: LayerGaps,
    blocks: tuple[Matrix, Matrix],
    share: float,
    mu: Floats,
    moments: Moments | None,
) -> FrictionContact:
    """Solve a layer whose impacts may have two phases; see `expanded`."""
    given = np.zeros_like(layer.way)
    if not layer.poisson.any():
        return _solve(law, scheme, layer, blocks, share, mu, moments, given)
    first = _solve(law, scheme, layer, blocks, share, mu, moments, given).force[: len(mu), 0]
    given[:, 0] = expanded(layer.poisson, first, layer.old[0])
    found = _solve(law, scheme, layer, blocks, share, mu, moments, given)
    for forces in (found.force, found.multiplier):
        forces[: len(mu)] += given
    moved = _by(share * blocks[0], given)[:, 0]
    found.place[: len(mu), 0] += np.where(layer.fast, moved, 0.0)
    return found


def _solve(
    law: Friction,
    scheme: SolidScheme,
    layer: LayerGaps,
    blocks: tuple[Matrix, Matrix],
    share: float,
    mu: Floats,
    moments: Moments | None,
    given: Floats,
) -> FrictionContact:
    """Solve a layer with some friction in which some forces are given besides, (k, dim)."""
    free = turned(layer.frames, layer.way)
    free[:, 0] = layer.gap
    before = turned(layer.frames, layer.old_way)
    before[:, 0] = layer.old[1]
    response, compliance = share * blocks[0], blocks[1]
    old = turned(layer.frames, layer.old_tangential)
    old[:, 0] = layer.old[0]
    held = None if layer.held is None else turned(layer.frames, layer.held)[:, 1:]
    springs = layer.springs
    limits = keeping(scheme.rule, springs), law.tolerance, law.max_iterations
    if moments is None and not (layer.fast | layer.across).any():
        soft = None if springs is None else (springs, layer.across)
        states = free, response, compliance, (old, before), mu
        return solve_friction_layer(*states, *limits, held, None, None, law.accuracy, soft)
    moved = _by(response, given)
    free[:, 1:] += moved[:, 1:]
    # Gaps of velocities still act where they would close without forces.
    free[:, 0] += np.where(layer.fast, 0.0, moved[:, 0])
    fast, ways, ends = layer.fast, turned(layer.frames, layer.halfway) + moved, layer.ends
    slides = layer.across
    pairs = None
    if moments is not None:
        count, more = len(free), len(moments.of)
        none, yes = np.zeros_like(moments.way), np.ones(more, dtype=bool)
        free = np.concatenate([free, moments.way + _by(share * moments.across.T, given)])
        ways = np.concatenate([ways, moments.after + _by(share * moments.across.T, given)])
        fast = np.concatenate([fast, yes])
        ends, slides = (np.concatenate([each, ~yes]) for each in (ends, slides))
        springs = None if springs is None else springs.beside(more)
        old, before = (np.concatenate([each, none]) for each in (old, before))
        across = share * moments.across
        response = np.block([[full(response), across], [across.T, share * moments.own]])
        compliance = np.pad(full(compliance), (0, none.size))
        held = None if held is None else np.concatenate([held, none[:, 1:]])
        mu = np.concatenate([mu, moments.rolling])
        pairs = (
            np.concatenate([np.arange(count), moments.of]),
            np.concatenate([np.zeros(count), moments.spinning]),
        )
    return solve_friction_layer_at_speed(
        free, Halfway(fast, ways, ends, slides), response, compliance, (old, before), mu, *limits,
        held, pairs, law.accuracy, springs,
    )  # fmt: skip


def _by(matrix: Matrix, forces: Floats) -> Floats:
    return np.asarray((matrix @ forces.ravel()).reshape(-1, forces.shape[1]))


def obeying(
    matrix: Floats,
    offset: Floats,
    rows: Integers,
    start: Floats,
    law: Friction | None,
    solver: Solver,
) -> Floats:
    """Forces in some gaps for which the law of contact and friction holds, (rows, ways).

    Args:
        matrix: Their increments by forces [m/N], (rows ways, rows ways).
        offset: Increments without any [m], (rows, ways).
        rows: The gaps.
        start: Forces to begin with [N], (rows, ways).
        law: Coulomb's; None without, where only normal forces are.
        solver: Of gaps without friction.

    Raises:
        ConvergenceError: They were not found.
    """
    if law is None:
        normal, _ = solver(matrix, offset[:, 0], start[:, 0] > 0.0)
        return np.asarray(normal[:, None])
    problem = ConeProblem(matrix, offset, law.coefficients[rows], np.zeros(len(rows)))
    return solve_cones(problem, start, law.tolerance, law.max_iterations)[0]


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
    count, dim = normals.shape
    found = np.zeros((count, dim, dim))
    found[:, 0] = normals
    if dim == 2:
        found[:, 1] = np.stack([-normals[:, 1], normals[:, 0]], axis=1)
        return found
    first = _crossed(normals, np.eye(3)[np.argmin(np.abs(normals), axis=1)])
    found[:, 1] = first / np.sqrt(np.einsum("ij,ij->i", first, first))[:, None]
    found[:, 2] = _crossed(normals, found[:, 1])
    return found


def _crossed(a: Floats, b: Floats) -> Floats:
    """Cross products of rows, (k, 3): of few of them in a third of the time NumPy's takes."""
    return a[:, _NEXT] * b[:, _AFTER] - a[:, _AFTER] * b[:, _NEXT]


_NEXT, _AFTER = [1, 2, 0], [2, 0, 1]


def turned(directions: Floats, vectors: Floats) -> Floats:
    """Components of vectors along some directions, (k, dim)."""
    found: Floats = np.einsum("kij,kj->ki", directions, vectors)
    return found


def in_space(directions: Floats, components: Floats) -> Floats:
    """Vectors of components along some directions, the inverse of `turned`."""
    found: Floats = np.einsum("kij,ki->kj", directions, components)
    return found
