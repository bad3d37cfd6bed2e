"""Layers of bodies whose answers to forces are linear: predict, find contact forces, end it."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.adhesion import Bonds
from impactfem.contact.impact_law import Approach
from impactfem.contact.layer_law import Layer, keeping, solve_layer
from impactfem.contact.rooted import Matrix, full
from impactfem.contact.speed_kernels import struck_sums
from impactfem.contact.speed_law import Halfway, rebound, returned
from impactfem.contact.springs import ContactSprings, unresolved
from impactfem.findings import Finding
from impactfem.marching.determinacy import Determinacy
from impactfem.marching.impacts import reached
from impactfem.marching.layers import Answers, DirectedGaps, Interior, Rolling
from impactfem.marching.rubbing import Friction
from impactfem.marching.staggered import FIRST
from impactfem.marching.time_loop import ContactState, LoopSettings, TimeLoop


class SolidMarch(TimeLoop[Interior]):
    """A march of bodies whose layers are linear but for contact."""

    def __init__(self, interior: Interior, settings: LoopSettings) -> None:
        """Find the contact forces of the initial state; see `TimeLoop`."""
        self._massive = interior.massive
        self._radiating = interior.radiating
        self._by_mass, self._changes = bool(self._massive.any()), bool(interior.volatile.any())
        self.interior, self._gaps = interior, settings.gaps
        self._led: Floats | None = None  # ways of obstacles by the law of speeds
        self._determinacy = Determinacy()
        # Of gaps whose law acts on speeds in the last layer, see `_rebound`.
        self._mean_way, self._arriving = np.zeros(0), np.zeros(0, dtype=bool)
        self._rolled = np.zeros(1)  # what surfaces move in a layer besides the contact nodes
        self._responses = self._answers()
        # Of velocities behind levels [s].
        self._lag = 0.5 * interior.dt if settings.scheme.staggered else 0.0
        super().__init__(interior, settings)

    def _answers(self) -> Answers:
        """How the gaps answer to contact forces; with friction in all directions."""
        interior = self.interior
        if self._changes:  # answers that are kept by gaps would stay those of their first layer
            return cast("DirectedGaps", self._gaps).directed(interior.columns, interior.apart)
        return self._gaps.responses(interior.columns, interior.whole_columns, interior.apart)

    def _initial_contact(self, gap: Floats, normals: Floats) -> tuple[Floats, Floats]:
        """Forces that keep massless nodes out of the obstacle at t = 0."""
        multiplier = np.zeros(len(gap))
        static = np.zeros_like(self.interior.surface_displacement)
        if not self._scheme.massless or not (gap < -self.tolerance).any():
            return multiplier, static
        fast, ends = self._laws(len(gap))
        rows = np.flatnonzero((gap < -self.tolerance) & ~fast & ~ends)
        while len(rows):
            self._responses.require(rows)
            _, compliance = self._responses.matrices(rows, normals[rows])
            found, _ = self._solver(compliance, gap[rows], np.zeros(len(rows), dtype=bool))
            change = self._responses.approach(rows, normals, np.zeros(len(rows)), found)
            missed = gap + change < -self.tolerance
            missed[rows] = False
            if not missed.any():
                multiplier[rows] = found
                return multiplier, self._pressed(rows, normals, multiplier)
            rows = np.union1d(rows, np.flatnonzero(missed))
        return multiplier, static

    @property
    def answers(self) -> Answers:
        """How the gaps answer to contact forces."""
        return self._responses

    @property
    def normals(self) -> Floats:
        """Of the gaps at the last level, (gaps, dim)."""
        return self._normals

    @property
    def skips(self) -> bool:
        """Whether the law pairs each level with the one after the next."""
        return self._skips

    @property
    def keeps_energy(self) -> bool:
        """Whether theta is what keeps the energy; else it is at least 1/2."""
        return self._scheme.rule == "conserving"

    @property
    def reversible(self) -> bool:
        """Whether `impactfem.marching.reversed_march` knows all that happens in its layers."""
        plain = self._scheme.massless and self._springs is None and self._bonds is None
        by_speed = self._by_mass or self._changes or self._radiating.any()
        plain = plain and not (by_speed and len(self.contact.gap))
        start = self._start_force.any() or self._rubs or self._gaps.shares_nodes
        still = not getattr(self._gaps, "normals_vary", True)
        return bool(plain and still and not start and getattr(self.interior, "reversible", False))

    @property
    def asked(self) -> Integers:
        """Contact nodes whose answers to forces are known, in the order of their finding."""
        return self._responses.known

    def restore(
        self, state: dict[str, Any], memory: Mapping[str, Floats], asked: Integers, layer: int
    ) -> None:
        """Continue after ``layer`` layers; see `TimeLoop.restore`."""
        super().restore(state, memory, asked, layer)
        self._determinacy.seen = memory["determinacy"].copy()
        self._responses.learn(asked)

    def _advance(self) -> Floats:
        """One layer; returns the contact forces [N], shape (count,)."""
        layer, interior, state = self.layer, self.interior, self.contact
        time = (layer + 1) * interior.dt
        begin = interior.surface_displacement
        last = begin + state.static if state.static.any() else begin
        interior.begin(layer * interior.dt, time)
        free = interior.surface_iterate
        # Forces of explicit layers act at their start, amid two steps.
        explicit = self._scheme.explicit
        back = 1.0 if explicit else 0.5
        gap, normals = self._gaps.at(free, begin, last, time, back, interior.dt)
        if self._gaps.shares_nodes:
            self._hand_over()
            state = self.contact
        if interior.rolling:
            self._rolled = cast("Rolling", interior).touched(self._gaps.spread(normals))
        if self._changes:
            self._responses.renew(interior.volatile, interior.answers, interior.roots())
        if self._bonds is not None:
            gap, free = self._pull(self._bonds, gap, normals, (begin, last, free))
        force, multiplier, static, iterations = self._layer_forces(gap, normals, free, last)
        self.layer = layer + 1
        self.rows.put(self.layer, interior.finish(static))
        true = self._true_gap
        self._struck(force, gap, normals)
        held: Floats | float = 0.0
        if self._bonds is not None:
            held = self._hold(self._bonds, force, multiplier, normals, begin)
        half = 0.5 if explicit else 1.0
        # Along the normals of this layer: others would make work of their turning.
        if self._gaps.moves:
            led = _along(normals, self._obstacle_way(time, half))
            self.rows.obstacle_work[self.layer] = half * float((force - held) @ led)
        self.rows.braked_work[self.layer] = half * self._braked
        self._end_layer(time, half, interior.surface_displacement + static)
        self.contact = ContactState(multiplier, true, state.multiplier, state.gap, static)
        self._normals = normals
        if self._scheme.shares_forces:
            # What acts at a level is the mean of the forces of its two layers.
            force = multiplier
        self._close_row(self.layer, force - held, iterations)
        return force

    def _pull(
        self, bonds: Bonds, gap: Floats, normals: Floats, places: tuple[Floats, Floats, Floats]
    ) -> tuple[Floats, Floats]:
        """Let adhesion pull, and tell gaps and places without contact forces then.

        Args:
            bonds: What pulls.
            gap: Gaps without it [m], (gaps,).
            normals: Of them, (gaps, dim).
            places: Displacements of contact nodes at the start, without and with what presses
                massless ones, and at the end without contact forces [m], (nodes, dim) each.
        """
        interior, (begin, last, free) = self.interior, places
        time, back = (self.layer + 1) * interior.dt, 1.0 if self._scheme.explicit else 0.5
        before, soft = self._unsprung(self.contact.gap, self.contact.multiplier)
        none = self._responses.parts(np.zeros(0, dtype=np.int64), np.zeros((0, normals.shape[1])))

        def push(pulls: Floats) -> Floats:
            nonlocal free
            if not pulls.any():
                return gap
            forces = self._gaps.spread(-pulls[:, None] * normals)
            interior.push(forces, None, none)
            for part in getattr(interior, "parts", (interior,)):
                if hasattr(part, "look"):  # rigid bodies tell where they looked last
                    part.look()
            free = interior.surface_iterate
            return self._gaps.at(free, begin, last, time, back, interior.dt)[0]

        after = push(bonds.begin(before, gap, soft))
        less = bonds.shorten(before, gap, after)
        return (push(-less) if less.any() else after), free

    def _unsprung(self, gap: Floats, force: Floats) -> tuple[Floats, Booleans]:
        """Gaps without springs [m], and which have some, (gaps,) each."""
        if self._springs is None:
            return gap, np.zeros(len(gap), dtype=bool)
        return gap - self._springs.depth(force), self._springs.there

    def _hold(
        self, bonds: Bonds, force: Floats, multiplier: Floats, normals: Floats, begin: Floats
    ) -> Floats:
        """Take what adhesion has done in the layer; its forces [N], (gaps,)."""
        time, interior = self.layer * self.interior.dt, self.interior
        way = self._gaps.relative(interior.surface_displacement - begin)
        way = way - self._gaps.shift(time) + self._gaps.shift(max(0.0, time - interior.dt))
        after, soft = self._unsprung(self._true_gap, multiplier)
        stored, lost = bonds.end(_along(normals, way), after, force > 0.0, soft)
        self.rows.held_energy[self.layer], self.rows.parted_work[self.layer] = stored, -lost
        return bonds.pull

    def _hand_over(self) -> None:
        """Give forces to the gaps that carry them now: nodes slide from obstacle to obstacle."""
        state, handed = self.contact, self._gaps.handed
        new, older = handed(state.multiplier), handed(state.older_multiplier)
        gap = np.where((new > 0.0) & (new != state.multiplier), 0.0, state.gap)
        before = np.where((older > 0.0) & (older != state.older_multiplier), 0.0, state.older_gap)
        self.contact = ContactState(new, gap, older, before, state.static)

    def _layer_forces(
        self, gap: Floats, normals: Floats, free: Floats, last: Floats
    ) -> tuple[Floats, Floats, Floats, int]:
        """Forces of the layer, multipliers at its end, what they do, and linear systems solved.

        Args:
            gap: Gaps at the end without contact forces [m], (pairs,).
            normals: Their normals, (pairs, dim).
            free: Displacement of the contact nodes there [m], (nodes, dim).
            last: The same with contact forces, one layer earlier.
        """
        return self._contact_forces(gap, normals, free - last)

    def _laws(self, count: int) -> tuple[Booleans, Booleans]:
        """Gaps whose law acts on velocities, and those of ends of bars; see `Halfway`.

        Args:
            count: Number of gaps.
        """
        none = np.zeros(count, dtype=bool)
        by_mass, only_on = self._by_mass, self._gaps.only_on
        if self._scheme.contact == "velocity":
            loose = ~none
        else:
            any_loose = by_mass or self._radiating.any()
            loose = only_on(self._massive | self._radiating) if any_loose else none
        self._across = none
        if self._springs is not None:  # they keep the normal force from layer to layer
            there = self._springs.there
            self._across, loose = loose & there, loose & ~there
        ends = loose & ~only_on(~self._radiating) if self._radiating.any() else none
        self._fast = loose & ~ends  # what `_struck` asks of the same layer
        return self._fast, ends

    @property
    def _reach(self) -> float:
        """How far a speed at the end of a layer leads to its level, as answers have it [s]."""
        first = FIRST if self.layer == 0 else 1.0
        return (first if self._scheme.staggered else 0.5) * self.interior.dt

    def _rebound(self, normals: Floats, before: Floats, after: Floats) -> Floats:
        """`Halfway.way` of all gaps, (pairs,), by relative velocities without contact forces.

        Args:
            normals: Of the gaps, (pairs, dim).
            before: At the start of the layer [m/s], (pairs, dim).
            after: At its end [m/s], (pairs, dim).
        """
        dt = self.interior.dt
        first, second = self._obstacle_speeds()
        self._led = 0.5 * dt * (first + second)
        one, two = _along(normals, before - first), _along(normals, after - second)
        self._mean_way = 0.5 * dt * (one + two)
        # Faster than forces make in one layer, and than rounding.
        slow = np.maximum(np.abs(two - one), self.tolerance / dt)
        self._arriving, self._leaving = one < -slow, one > slow
        self._normal_speed = one
        self._approach(one)
        return rebound(one, two, self._lively, self._reach)

    def _struck_gaps(self, taking_part: Booleans, gap: Floats) -> Booleans:
        """Gaps between nodes with mass that impacts reach, if there are any, (pairs,)."""
        if not self._by_mass:
            return np.zeros(len(gap), dtype=bool)
        massive = self._fast & self._gaps.only_on(self._massive)
        closes = massive & taking_part & (gap <= self.tolerance)
        before = np.where(massive, self.contact.gap - self.tolerance, np.inf)
        return reached(closes, self._arriving, before, self._leaving)

    def _in_turn(
        self,
        rows: Integers,
        acts: Booleans,
        matrix: Matrix,
        speeds: Callable[[], Floats],
        law: Friction | None,
    ) -> tuple[Floats, Floats] | None:
        """Forces of impacts one after the other, and what they change of `Halfway.way`.

        Args:
            rows: Gaps that take part.
            acts: Those of them that impacts reach, (rows,).
            matrix: Answers of all of them [m/N], (rows ways, rows ways).
            speeds: Tells theirs at the start of the layer [m/s], (rows, ways).
            law: Of friction; None without.

        Returns:
            Both of shape (rows, ways); None where impacts come at once.

        Raises:
            ConvergenceError: Impacts do not come to an end.
        """
        asks = self._impacts.asks(int(np.count_nonzero(acts)))
        if not asks or not (acts & self._arriving[rows]).any():
            return None
        before, at, reach = speeds(), rows[acts], self._reach
        ways = before.shape[1]
        wide, answers = np.repeat(acts, ways), full(matrix)
        none = np.zeros(len(rows))
        lively = self._returning
        slips = none if law is None else np.where(self._arriving, law.rebound, 0.0)[rows]
        mu = none if law is None else law.coefficients[rows]
        bodies = Approach(
            reach * before[acts], self.contact.gap[at], lively[at], slips[acts], mu[acts]
        )
        time, pair_of = (self.layer + 1) * self.interior.dt, self._gaps.pair_of
        own = answers[np.ix_(wide, wide)]
        span = self.interior.dt / reach
        found = self._impacts.given(time, lambda: pair_of()[at], own, bodies, span)
        if found is None:
            return None
        given, old = np.zeros_like(before), reach * before
        given[acts] = found
        new = old + (answers @ given.ravel()).reshape(old.shape)
        more = -slips[:, None] * old
        more[:, 0] = returned(new[:, 0], lively[rows]) - returned(old[:, 0], self._lively[rows])
        return given, more

    def _obstacle_speeds(self) -> tuple[Floats, Floats]:
        """Of what gaps face on obstacles, at both ends of the layer [m/s], (pairs, dim) each."""
        gaps, dt = self._gaps, self.interior.dt
        time, before = (self.layer + 1) * dt - self._lag, self.layer * dt - self._lag
        before = max(before, 0.5 * dt)
        one, two = (
            (gaps.shift(when + 0.5 * dt) - gaps.shift(when - 0.5 * dt)) / dt
            for when in (before, time)
        )
        return one, two

    def _obstacle_way(self, time: float, half: float) -> Floats:
        """Way of what gaps face on obstacles in the layer, or over two, [m], (pairs, dim)."""
        way = self._gaps.shift(time) - self._gaps.shift(max(0.0, time - self.interior.dt / half))
        led, self._led = self._led, None
        # Where their law acts on speeds as it measures them.
        return way if led is None else np.where(self._fast[:, None], led / half, way)

    def _end_layer(self, time: float, part: float, place: Floats) -> None:
        """Called when a layer has ended; for friction."""

    def _beyond(self, along: Floats) -> Floats:
        """How far gaps went beyond what answers say, times vectors, (pairs,): beams that turn."""
        beyond = getattr(self.interior, "beyond", None)
        if beyond is None or not beyond.any():
            return np.zeros(len(along))
        return _along(along, self._gaps.relative(beyond))

    def _struck(self, force: Floats, gap: Floats, normals: Floats) -> None:
        """What impacts of nodes with mass have taken in the layer, and their impulse.

        An impact is where such a node arrives with a speed. What else acts between nodes with mass
        in its layer belongs to it: the step does not know how long it lasted.

        Args:
            force: Of the layer [N], (pairs,).
            gap: Gaps at its end without contact forces [m], (pairs,).
            normals: Of the gaps, (pairs, dim).
        """
        if (self._scheme.contact == "velocity" and not self._by_mass) or not force.any():
            self._impulsive = np.zeros(len(force), dtype=bool)
            return
        share, answered = self.interior.share, 0.5 * self.interior.dt / self._reach
        row, change = self.layer, answered * (self._true_gap + self._beyond(normals) - gap)
        before, arriving = self.contact.multiplier, self._arriving
        found = struck_sums(force, self._fast, self._mean_way, change, before, arriving)
        work, struck, self._impulsive = found
        self.rows.impact_work[row] = share * work
        if struck:
            self.rows.impact[row] = share * self.interior.dt * struck

    def _contact_forces(  # noqa: PLR0915  (a layer is one matter)
        self, gap: Floats, normals: Floats, way: Floats
    ) -> tuple[Floats, Floats, Floats, int]:
        """Forces of the layer, multipliers at its end and what they do, for free gaps.

        Only nodes that push or would penetrate take part; if the others come to penetrate by the
        forces found, they join and the layer is solved again.
        """
        interior, state = self.interior, self.contact
        count = len(gap)
        force, multiplier = np.zeros(count), np.zeros(count)
        static = np.zeros_like(interior.surface_displacement)
        old, old_gap = (
            (state.older_multiplier, state.older_gap) if self._skips
            else (state.multiplier, state.gap)
        )  # fmt: skip
        taking_part = (old > 0.0) | (state.multiplier > 0.0) | (gap < -self.tolerance)
        self._true_gap, self._braked = gap, 0.0
        if not taking_part.any():
            return force, multiplier, static, 0
        share, iterations = interior.share, 0
        (fast, ends), halfway = self._laws(count), gap
        struck = np.zeros(count, dtype=bool)
        if fast[taking_part].any():
            speeds = (self._gaps.relative(values) for values in interior.contact_speeds(way))
            halfway = np.where(fast, self._rebound(normals, *speeds), gap)
            struck = self._struck_gaps(taking_part, gap)
            taking_part |= struck
        while True:
            rows = np.flatnonzero(taking_part)
            self._responses.require(rows)
            response, compliance = self._responses.matrices(rows, normals[rows])
            springs = self._giving(rows)
            law = Halfway(
                (fast | ends)[rows], halfway[rows, None], ends[rows], touching=struck[rows]
            )
            law, given = self._struck_law(law, rows, struck[rows], share * response)
            layer = Layer(
                gap[rows, None], share * response, compliance,
                (old[rows, None], old_gap[rows, None]), springs=springs, halfway=law,
            )  # fmt: skip
            rule = keeping(self._scheme.rule, springs)
            found = solve_layer(layer, rule, self._how, self._expanding(count)[rows], given)
            iterations += found.iterations
            self._braked = found.braked
            pushes, levels = found.force[:, 0], found.multiplier[:, 0]
            acting = share * pushes
            true = gap + self._responses.approach(rows, normals, acting, levels)
            true[rows] = found.place[:, 0]
            missed = true < -self.tolerance
            missed[rows] = False
            missed &= ~fast
            if not missed.any():
                break
            taking_part |= missed
        force[rows], multiplier[rows] = pushes, levels
        if given is None and fast[rows].all() and np.count_nonzero(pushes) > 1:
            time, pair_of = (self.layer + 1) * interior.dt, self._gaps.pair_of
            self._determinacy.look_at_normal(time, rows, pair_of, share * response, pushes)
        if pushes.any():
            change = self._responses.displacement(rows, normals[rows], acting)
            inside = force[:, None] * normals
            parts = self._responses.parts(rows, inside[rows])
            interior.push(self._gaps.spread(inside), change, parts)
        if self._scheme.massless:
            static = self._pressed(rows, normals, multiplier)
        self._true_gap = true
        return force, multiplier, static, iterations

    def _giving(self, rows: Integers) -> ContactSprings | None:
        """What gives way in some gaps, in a layer of the law."""
        if self._springs is None:
            return None
        layers = 2.0 if self._skips else 1.0
        return self._springs.some(rows).over(layers * self.interior.dt)

    def _struck_law(
        self, law: Halfway, rows: Integers, acts: Booleans, matrix: Matrix
    ) -> tuple[Halfway, Floats | None]:
        """The law without friction where impacts come one after the other, and their forces."""
        turns = self._in_turn(rows, acts, matrix, lambda: self._normal_speed[rows, None], None)
        if turns is None:
            return law, None
        return replace(law, way=law.way + turns[1]), turns[0]

    def figures(self) -> Mapping[str, Any]:
        """What is not determined of the forces, and of impacts."""
        return {**super().figures(), **self._determinacy.figures(self._gaps.pairs)}

    def findings(self) -> tuple[Finding, ...]:
        """The same in words, and contacts that their steps do not resolve."""
        found = (*super().findings(), *self._determinacy.findings(self._gaps.pairs))
        if self._springs is None:
            return found
        pressed = self.rows.indentation[: self.layer + 1]
        return (*found, *unresolved(pressed, self.interior.dt))

    def memory(self) -> dict[str, Floats]:
        """What the next layer and the findings need; see `TimeLoop.memory`."""
        return super().memory() | {"determinacy": self._determinacy.seen}

    def _pressed(self, rows: Integers, normals: Floats, multiplier: Floats) -> Floats:
        """Displacement of massless nodes by the multipliers [m], (count, dim)."""
        known = self._responses.static(rows, normals[rows], multiplier[rows])
        if known is not None:
            return known
        return self.interior.static(self._gaps.spread(multiplier[:, None] * normals))

    def _expanding(self, count: int) -> Floats:
        """Poisson's restitution of gaps in layers with an impact, 0 elsewhere, (count,)."""
        if self._poisson is None or not (self._fast & self._arriving).any():
            return np.zeros(count)
        return np.where(self._fast, self._poisson, 0.0)


def _along(normals: Floats, vectors: Floats) -> Floats:
    """Components of vectors along normals, (pairs,)."""
    found: Floats = np.einsum("ij,ij->i", normals, vectors)
    return found
