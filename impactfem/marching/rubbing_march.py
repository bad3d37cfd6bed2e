"""The time loop with friction: the forces of a layer have tangential parts and do work."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solver import solve
from impactfem.contact.rooted import Matrix, Rooted, among
from impactfem.contact.rooted_kernels import full_of
from impactfem.contact.speed_law_kernels import ended, opened
from impactfem.findings import Finding
from impactfem.marching.composite import Composite
from impactfem.marching.layers import DirectedAnswers, DirectedGaps, Interior, Rolling
from impactfem.marching.resisting import Moments, resisting
from impactfem.marching.rubbing import (
    ON_CONE,
    Friction,
    LayerGaps,
    Rubbing,
    frames,
    in_space,
    rub,
    told,
    turned,
)
from impactfem.marching.solids import SolidMarch
from impactfem.marching.time_loop import LoopSettings

if TYPE_CHECKING:
    from impactfem.contact.pair_responses import PairResponses

_REMEMBERED = ("tangential", "older_tangential", "place", "older_place", "stuck")
_STILL = 1e-12  # share of the largest speed that counts as none at t = 0
_SLOW = 1e-6  # share of it that counts as no slip where friction may jam


class RubbingMarch(SolidMarch):
    """A march with Coulomb friction in gaps of bodies (`impactfem.contact.pairs`)."""

    def __init__(self, interior: Interior, settings: LoopSettings) -> None:
        """Find the contact forces of the initial state, at which nothing rubs yet."""
        friction = cast("Friction", settings.friction)
        place = interior.surface_displacement
        self._rubbing = Rubbing.at_rest(friction, place)
        held = np.zeros_like(self._rubbing.tangential)
        if settings.rest is not None:
            held = self._rubbing.tangential = settings.rest[2]
        self._tangential = self._rubbing_force = np.zeros((len(friction.coefficients), 0))
        # Gaps that took part, their normal forces and tangential ones, and ways: see `told`.
        self._slid: tuple[Integers, Floats, Floats] | None = None
        self._told: Integers = np.zeros(0, dtype=np.int64)  # what pushed and stuck, by `ended`
        super().__init__(interior, settings)
        self._rubbing = Rubbing.at_rest(friction, place + self.contact.static)
        if settings.rest is not None:
            state = self._rubbing
            state.tangential = state.older_tangential = self._tangential = held
            state.stuck = (self._start_force > 0.0).astype(float)

    def _answers(self) -> DirectedAnswers:
        """How the gaps answer to contact forces in any direction."""
        interior = self.interior
        return cast("DirectedGaps", self._gaps).directed(interior.columns, interior.apart)

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs besides the state of the bodies, the same on all ranks."""
        reached = {"residual": np.array(self._rubbing.law.accuracy.reached)}
        own = {name: getattr(self._rubbing, name) for name in _REMEMBERED}
        return super().memory() | own | reached

    def restore(
        self, state: dict[str, Any], memory: Mapping[str, Floats], asked: Integers, layer: int
    ) -> None:
        """Continue after ``layer`` layers; see `SolidMarch.restore`."""
        super().restore(state, memory, asked, layer)
        for name in _REMEMBERED:
            setattr(self._rubbing, name, memory[name])
        self._rubbing.law.accuracy.reached = float(memory["residual"])

    @property
    def sets(self) -> Booleans:
        """Which gaps press, and which stick, (gaps, 2)."""
        return np.hstack([super().sets, self._rubbing.stuck[:, None] > 0.0])

    def figures(self) -> Mapping[str, Any]:
        """What is not determined of the forces, and the residual where it is not rounding."""
        reached = self._rubbing.law.accuracy.reached
        return {**super().figures(), **({"friction_residual": reached} if reached else {})}

    def findings(self) -> tuple[Finding, ...]:
        """The same in words, where the residual is larger than asked."""
        accuracy = self._rubbing.law.accuracy
        if accuracy.reached <= accuracy.share:
            return super().findings()
        text = f"forces of many contacts with friction were found to {accuracy.reached:.2g} of the "
        text += f"largest force in a time step, not to {accuracy.share:.2g}"
        remedy = "trust forces to that share, or use a smaller solve.dt"
        value, limit = accuracy.reached, accuracy.share
        return (
            *super().findings(),
            Finding("not_converged", "warning", text, value=value, limit=limit, remedy=remedy),
        )

    def _end_layer(self, time: float, part: float, place: Floats) -> None:
        """Keep the tangential state, and sum up what friction and moved obstacles have done."""
        self._rubbing.advance(self._tangential, place)
        rows, row = self.rows, self.layer
        # What rubs in an impact is part of its law: a split of its loss would say nothing.
        struck, work = self._impulsive, self._rubbing.work
        if self._rubbing_force.size:
            work = work + self._beyond(self._rubbing_force)
        lost = float(work[struck].sum()) if struck.any() else 0.0
        rows.friction_work[row] = part * (float(work.sum()) - lost)
        rows.impact_work[row] += part * lost
        if self._gaps.moves:
            before = max(0.0, time - self.interior.dt / part)
            shift = self._gaps.shift(time) - self._gaps.shift(before)
            rows.obstacle_work[row] += part * float((self._rubbing_force * shift).sum())

    def _close_pairs(self, row: int, force: Floats) -> None:
        """Store what pairs have of the forces across normals, and of slip."""
        super()._close_pairs(row, force)
        if self._slid is not None:
            self._close_rubbing(row, *self._slid)

    def _vectors(self, lasting: Floats) -> Floats:
        """Forces in the gaps as vectors with those of friction, (pairs, dim) [N]."""
        rubbing = self._tangential if self._scheme.shares_forces else self._rubbing_force
        if not rubbing.size:  # at t = 0
            return super()._vectors(lasting)
        return super()._vectors(lasting) + np.where(self._impulsive[:, None], 0.0, rubbing)

    def _pressed_work(self, way: Floats) -> float:
        """Multipliers times the displacements (pairs, dim) that they give to massless nodes [J]."""
        return super()._pressed_work(way) + float((self._rubbing.tangential * way).sum())

    def _rubbing_halfway(self, normals: Floats, way: Floats, ends: Floats) -> Floats:
        """`Halfway.way` of all gaps as vectors in space [m], (pairs, dim).

        Args:
            normals: Of the gaps, (pairs, dim).
            way: Of the contact nodes in the layer without contact forces [m], (nodes, dim).
            ends: Gaps of ends of bars [m], NaN elsewhere, (pairs,).
        """
        gaps, reach = self._gaps, self._reach
        before, after = (gaps.relative(each) for each in self.interior.contact_speeds(way))
        # Tangentially the speed at the end, against that of what is touched.
        earlier, later = self._obstacle_speeds()
        slid: Floats = reach * (after - later)
        rebound = self._rebound(normals, before, after)
        self._slipping, self._fastest = before - earlier, float(np.abs(before).max(initial=0.0))
        if (lively := self._rubbing.law.rebound).any():
            arriving = np.where(self._arriving, lively, 0.0)[:, None]
            slid = slid + reach * arriving * (before - earlier)
        rebound = np.where(np.isnan(ends), rebound, ends)
        along = rebound - np.einsum("ij,ij->i", normals, slid)
        return np.asarray(slid + along[:, None] * normals)

    def _slips(self, rows: Integers, directions: Floats) -> Floats:
        """Speeds in some gaps at the start of a layer, along directions [m/s], (rows, dim)."""
        return turned(directions, self._slipping[rows])

    def _stuck(self, normals: Floats, way: Floats) -> Floats:
        """1 where nothing slipped before, (pairs,); arguments as of `_rubbing_halfway`."""
        if self.layer > 0:
            return self._rubbing.stuck
        before = self._gaps.relative(self.interior.contact_speeds(way)[0])
        across = before - self._obstacle_speeds()[0]
        across = across - np.einsum("ij,ij->i", across, normals)[:, None] * normals
        still: Floats = np.abs(across).max(axis=1) <= _STILL * np.abs(before).max(initial=0.0)
        return still.astype(float)

    @property
    def _turnable(self) -> Composite:
        """The bodies; where some turn they are several."""
        return cast("Composite", self.interior)

    def _moments(self, rows: Integers, directions: Floats) -> Moments | None:
        """What resists rolling and spinning in some gaps."""
        law = self._rubbing.law
        if not (law.rolling.any() or law.spinning.any()):
            return None
        lengths = law.rolling, law.spinning
        return resisting(self._gaps, self._turnable, rows, directions, lengths, 2.0 * self._reach)

    def _hand_over(self) -> None:
        """Give forces to the gaps that carry them now, and what else belongs to friction."""
        super()._hand_over()
        state, handed = self._rubbing, self._gaps.handed
        state.tangential, state.older_tangential, state.stuck = map(
            handed, (state.tangential, state.older_tangential, state.stuck)
        )

    def _earlier(self, last: Floats) -> tuple[Floats, Floats, Floats, Floats, float]:
        """Multipliers, gaps, tangential forces and places where the law begins; how many layers."""
        contact, state = self.contact, self._rubbing
        if not self._skips:
            return contact.multiplier, contact.gap, state.tangential, last, 1.0
        place = state.older_place
        if self.interior.rolling:  # the layer before the last level rolled too
            place = place - cast("Rolling", self.interior).rolled
        return contact.older_multiplier, contact.older_gap, state.older_tangential, place, 2.0

    @cached_property
    def _at_speeds(self) -> bool:
        """Whether the law of all gaps acts on speeds, and nothing else acts in them."""
        law, interior = self._rubbing.law, self.interior
        more = law.rolling.any() or law.spinning.any() or (law.static > law.coefficients).any()
        by_mass = self._massive.all() and not interior.radiating.any() and not self._skips
        at_once = self._scheme.rule == "middle" and self._impacts.law == "simultaneous"
        without = self._springs is None and self._poisson is None and not more
        without = without and self._speed_laws is None
        return bool(without and by_mass and at_once)

    def _shifts(self, count: int, dim: int) -> Floats:
        """Ways and speeds of what nodes face as `opened` takes them, (gaps, 4 dim)."""
        gaps, dt = self._gaps, self.interior.dt
        if not gaps.moves:
            return np.zeros((count, 4 * dim))
        time = (self.layer + 1) * dt
        first, second = self._obstacle_speeds()
        self._led = 0.5 * dt * (first + second)
        return np.hstack([gaps.shift(time), gaps.shift(max(0.0, time - dt)), first, second])

    def _forces_at_speeds(
        self, gap: Floats, normals: Floats, free: Floats, last: Floats
    ) -> tuple[Floats, Floats, Floats, int] | None:
        """`_layer_forces` where `_at_speeds`; None without friction where gaps act, or roots."""
        responses = cast("PairResponses", self._responses)
        if (rooted := responses.rooted) is None:
            return None
        weights, roots, size, many = rooted
        interior, state, contact = self.interior, self._rubbing, self.contact
        (count, dim), law = normals.shape, self._rubbing.law
        nodes = free + self._rolled, last, *interior.contact_speeds(free - last)
        shift, before = self._shifts(count, dim), (contact.gap, contact.multiplier)
        gaps = normals, gap, *before, state.tangential, shift
        coefficients = self._lively, law.rebound, law.coefficients
        times = self.tolerance, interior.dt, self._reach
        found = opened(weights, roots, nodes, gaps, coefficients, times)
        relative, approach, (directions, way, near, slip), answers, acts, rubs, jams = found
        if not rubs or not responses.has_roots(approach[0]):
            return None
        rows, _, self._normal_speed, self._mean_way, *approach = approach
        self._arriving, self._leaving, struck, _ = approach
        self._fast, self._braked = np.ones(count, dtype=bool), 0.0
        mu, (ends, columns, values) = law.coefficients[rows], answers
        matrix: Matrix = np.zeros(0)
        if many:
            matrix = Rooted(csr_matrix((values, columns, ends), shape=(way.size, size)))
        else:
            matrix = np.asarray(full_of(*answers, size))

        def slips() -> Floats:
            each = (values[rows, 2 * dim : 3 * dim] for values in (relative, shift))
            return turned(directions, np.subtract(*each))

        self._in_turn(rows, struck[rows], matrix, slips, law)
        problem = ConeProblem(matrix, way, mu, np.zeros(len(rows)))
        force, systems = _acting(problem, near, acts, law)
        closed = weights, roots, size, rows, directions, gaps, relative, answers, force, mu
        nodal, done, self._told, same = ended(*closed, 1.0 - ON_CONE, self._told)
        self._tangential, pushes, self._true_gap, state.work, state.stuck, *slid = done
        self._rubbing_force, self._slid = self._tangential, (rows, *slid)
        if force.any():
            interior.push(nodal, None, np.zeros(0))
        if jams or not same:
            time = (self.layer + 1) * interior.dt
            self._determinacy.look(time, rows, self._gaps.pair_of, problem, force, slip)
        return pushes, pushes, np.zeros_like(free), systems

    def _layer_forces(
        self, gap: Floats, normals: Floats, free: Floats, last: Floats
    ) -> tuple[Floats, Floats, Floats, int]:
        """Forces of the layer, multipliers at its end, what they do, and linear systems solved."""
        state, contact, count = self._rubbing, self.contact, len(gap)
        state.work, self._true_gap, self._braked = np.zeros(count), gap, 0.0
        self._tangential = self._rubbing_force = np.zeros_like(normals)
        self._slid = None
        taking_part = (contact.multiplier > 0.0) | (gap < -self.tolerance)
        if self._skips:
            taking_part |= contact.older_multiplier > 0.0
        if not taking_part.any():
            state.stuck = np.zeros(count)
            return np.zeros(count), np.zeros(count), np.zeros_like(free), 0
        found = self._forces_at_speeds(gap, normals, free, last) if self._at_speeds else None
        return found or self._forces_at_levels(gap, normals, free, last, taking_part)

    def _forces_at_levels(  # noqa: PLR0915  (a layer is one matter)
        self, gap: Floats, normals: Floats, free: Floats, last: Floats, taking_part: Booleans
    ) -> tuple[Floats, Floats, Floats, int]:
        """The same where the law of some gaps acts on places."""
        state, answers = self._rubbing, cast("DirectedAnswers", self._responses)
        interior, gaps, dt = self.interior, self._gaps, self.interior.dt
        time, share, count = (self.layer + 1) * dt, interior.share, len(gap)
        force, multiplier, static = np.zeros(count), np.zeros(count), np.zeros_like(free)
        old, old_gap, old_tangential, old_place, back = self._earlier(last)
        way = gaps.relative(free + self._rolled) - gaps.shift(time)
        old_way = gaps.relative(old_place) - gaps.shift(max(0.0, time - back * dt))
        held = gaps.relative(last) - gaps.shift(time - dt) if self._skips else None
        (fast, ends), halfway = self._laws(count), way
        across = self._across
        stuck = self._stuck(normals, free - last)
        struck = np.zeros(count, dtype=bool)
        if (fast | ends | across)[taking_part].any():
            halfway = self._rubbing_halfway(normals, free - last, np.where(ends, gap, np.nan))
            struck = self._struck_gaps(taking_part, gap)
            taking_part |= struck
        iterations, poisson = 0, self._expanding(count)
        while True:
            rows = np.flatnonzero(taking_part)
            answers.require(rows)
            directions = frames(normals[rows])
            layer = LayerGaps(
                rows, directions, gap[rows], way[rows], (old[rows], old_gap[rows]),
                old_tangential[rows], old_way[rows], None if held is None else held[rows],
                (fast | ends)[rows], halfway[rows], ends[rows], stuck[rows] > 0.0,
                poisson[rows], across[rows],
                self._giving(rows), struck[rows],
            )  # fmt: skip
            blocks = answers.blocks(rows, directions)
            turns = self._in_turn(
                rows, struck[rows], share * blocks[0],
                partial(self._slips, rows, directions), state.law,
            )  # fmt: skip
            layer = replace(layer, turns=turns)
            moments = self._moments(rows, directions)
            solved, sticks = rub(state.law, self._scheme, layer, blocks, share, moments)
            iterations += solved.iterations
            self._braked = solved.braked
            found, turning = solved.split(len(rows))
            acting = in_space(directions, found.force)
            levels = in_space(directions, found.multiplier)
            moved = answers.moved(rows, share * acting, levels)
            if moments is not None:
                twisting = share * gaps.spread(moments.in_gaps(rows, count, turning.force))
                moved += gaps.relative(self._turnable.twisted(twisting[None])[0][0])
            true = gap + np.einsum("ij,ij->i", normals, moved)
            true[rows] = found.place[:, 0]
            missed = true < -self.tolerance
            missed[rows] = False
            missed &= ~fast
            if not missed.any():
                break
            taking_part |= missed
        whole, multipliers = np.zeros_like(normals), np.zeros_like(normals)
        whole[rows], multipliers[rows] = acting, levels
        force[rows], multiplier[rows] = found.force[:, 0], found.multiplier[:, 0]
        if found.force.any():
            interior.push(gaps.spread(whole), None, answers.parts(rows, acting))
        if self._scheme.massless:
            static = interior.static(gaps.spread(multipliers))
        state.work[rows] = found.work
        if moments is not None:
            self._turnable.twist(gaps.spread(moments.in_gaps(rows, count, turning.force)))
            state.work[rows[moments.of]] += turning.work
        if layer.turns is None and fast[rows].all():
            mu = np.where(sticks, state.law.static[rows], state.law.coefficients[rows])
            law = ConeProblem(
                share * blocks[0], turned(directions, halfway[rows]),
                mu, np.zeros(len(rows)),
            )  # fmt: skip
            slip = turned(directions, self._slipping[rows])[:, 1:]
            slip[np.linalg.norm(slip, axis=1) <= _SLOW * self._fastest] = 0.0
            self._determinacy.look(time, rows, gaps.pair_of, law, found.force, slip)
        state.stuck = np.zeros(count)
        state.stuck[rows] = sticks
        self._true_gap = true
        self._tangential = multipliers - multiplier[:, None] * normals
        self._rubbing_force = whole - force[:, None] * normals
        self._slid = rows, *told(directions, found.force, layer.slid(found.place))
        return force, multiplier, static, iterations


def _acting(
    problem: ConeProblem, near: Floats, acts: Booleans, law: Friction
) -> tuple[Floats, int]:
    """Forces in gaps of which some act, (rows, dim), and linear systems solved."""
    if acts.all():
        return solve(problem, near, law.solving)
    force, at, dim = np.zeros_like(near), np.flatnonzero(acts), near.shape[1]
    wide = (dim * at[:, None] + np.arange(dim)).ravel()
    own = problem.offset[at], problem.friction[at], problem.base[at]
    force[at], iterations = solve(
        ConeProblem(among(problem.matrix, wide), *own), near[at], law.solving
    )
    return force, iterations
