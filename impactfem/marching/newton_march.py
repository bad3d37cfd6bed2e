"""The time loop of bodies under finite strain: Newton's iterates of a step, and its contact law.

Forces F = (Lambda, T) act along normals and tangents at the mean places of the step, and the law is
one of the increments (w, s) in these directions, ways of nodes less those of what they touch:

    conserving   0 <= Lambda  _|_  w >= 0                 where the gap was closed before the step,
    massless     0 <= Lambda  _|_  max(gap, 0) + w >= 0   everywhere,
    friction     |T| <= mu Lambda,  T = -mu Lambda s / |s| in slip,  s = 0 in stick.

The work Lambda w is 0 for the first, so that energy is kept to rounding for any normals, and
-Lambda max(gap, 0) <= 0 for the second, which does not penetrate; T . s is that of friction, never
positive. Between bodies the directions turn with them (`impactfem.contact.turning_gaps`), so that
forces have no moment: momentum and angular momentum are kept too, whoever meets whom. A step in
which a node without mass would close is cut where it does: what the first law penetrates and the
second loses are both of the order of the way that is left. Between nodes with mass the law acts on
speeds, of all that would close in a step, as in other marches (`impactfem.marching.impacts`).
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.followed_pair import FAR
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solver import solve
from impactfem.contact.impact_law import Approach
from impactfem.contact.speed_law import expanded
from impactfem.contact.spring_steps import SpringStep
from impactfem.contact.springs import unresolved
from impactfem.errors import ConvergenceError
from impactfem.findings import Finding
from impactfem.marching.determinacy import Determinacy
from impactfem.marching.impacts import reached
from impactfem.marching.newton_bodies import NewtonStepper
from impactfem.marching.newton_impacts import obstacle_speed, slow, way_ahead
from impactfem.marching.newton_steps import LayerSums, Step
from impactfem.marching.resisting import Resisting, Turnable
from impactfem.marching.rubbing import frames, held_by_static, in_space, turned
from impactfem.marching.time_loop import ContactState, LoopSettings, TimeLoop

_ITERATES = 25
_PAIRED = 1  # iterates that still change who meets whom: all would keep others from settling
_SHORTEST = 2.0**-10  # of a layer
_NEAR = 0.005  # of a layer, less than `_CLOSED`: cuts nearer to the ends of a step are left out
_CUTS = 32  # of a layer at nodes that close
_TRIES = 3  # of a step: gaps between bodies may jump, where others face each other than before
_STILL = 1e-12  # share of the largest displacement ahead that counts as none at t = 0
_CLOSED = 0.01  # of the largest change of a gap in a layer: gaps up to it count as closed


class NewtonMarch(TimeLoop[NewtonStepper]):
    """A march of bodies of which some are under finite strain."""

    def __init__(self, interior: NewtonStepper, settings: LoopSettings) -> None:
        """Begin at t = 0; see `TimeLoop`."""
        self._massive = interior.massive
        self._by_mass = bool(self._massive.any())
        self._generation = -1
        self._known: dict[int, Floats] = {}
        self._looked: tuple[float, Floats, Floats] | None = None  # time, place, and gaps there
        super().__init__(interior, settings)
        none = np.zeros(len(self.contact.gap), dtype=bool)
        self._soft = none if self._springs is None else self._springs.there
        self._tangential = np.zeros_like(self._normals)  # of the last step [N], (gaps, dim)
        if settings.rest is not None:
            self._tangential = settings.rest[2]
        self._law, self._stuck = self._friction, none  # in a step; what did not slip in the last
        self._determinacy = Determinacy()
        # Forces that are given in a step along its directions [N], (gaps, ways).
        self._least = np.zeros((len(none), self._normals.shape[1] if self._rubs else 1))
        self._resisting: Resisting | None = None
        law = self._friction
        if law is not None and (law.rolling.any() or law.spinning.any()):
            self._resisting = Resisting(
                self._gaps, cast("Turnable", interior), (law.rolling, law.spinning)
            )

    def figures(self) -> Mapping[str, Any]:
        """What is not determined of the forces, and of impacts."""
        return {**super().figures(), **self._determinacy.figures(self._gaps.pairs)}

    def findings(self) -> tuple[Finding, ...]:
        """The same in words, and contacts too short for steps."""
        found = (*super().findings(), *self._determinacy.findings(self._gaps.pairs))
        if self._springs is None:
            return found
        pressed = self.rows.indentation[: self.layer + 1]
        return (*found, *unresolved(pressed, self.interior.dt))

    def _ask(self, time: float, step: Step) -> None:
        """Ask whether forces between nodes with mass are determined."""
        rows = np.flatnonzero(step.force[:, 0] > 0.0)
        lumped = self._by_mass and len(rows) > 1 and step.massive[rows].all()
        if not (lumped and self._known.keys() >= set(rows.tolist())):
            return
        size = rows.size * step.force.shape[1]
        each = np.stack([self._known[row][:, rows] for row in rows.tolist()]).reshape(size, size)
        matrix, force, pair_of = 0.5 * (each + each.T), step.force[rows], self._gaps.pair_of
        if self._law is None:
            self._determinacy.look_at_normal(time, rows, pair_of, matrix, force[:, 0])
            return
        mu = self._law.static if step.sticks is not None else self._law.coefficients
        free = step.way[rows] - (matrix @ force.ravel()).reshape(force.shape)
        law = ConeProblem(matrix, free, mu[rows], np.zeros(len(rows)))
        self._determinacy.look(time, rows, pair_of, law, force)

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs besides the state of the bodies, the same on all ranks."""
        own = {"tangential": self._tangential, "stuck": self._stuck.astype(float)}
        own["determinacy"] = self._determinacy.seen
        return super().memory() | own

    def restore(
        self, state: dict[str, Any], memory: Mapping[str, Floats], asked: Integers, layer: int
    ) -> None:
        """Continue after ``layer`` layers; see `TimeLoop.restore`."""
        super().restore(state, memory, asked, layer)
        self._tangential, self._stuck = memory["tangential"], memory["stuck"] > 0.0
        self._determinacy.seen = memory["determinacy"].copy()

    def _advance(self) -> Floats:
        """One layer, in as many steps as it takes; returns its mean contact forces [N]."""
        layer, dt = self.layer, self.interior.dt
        done = self.through(layer * dt, (layer + 1) * dt)
        self.layer = layer + 1
        self.rows.put(self.layer, self.interior.finish(self.contact.static))
        self._close_layer(done)
        force: Floats = done.impulse / dt
        self._close_row(self.layer, force, done.iterations)
        return force

    def through(self, time: float, end: float) -> LayerSums:
        """Take the bodies from one time to another, at most a layer later; what that sums up to.

        Raises:
            ConvergenceError: No equilibrium was found, not even in short steps.
        """
        interior, state, dt = self.interior, self.contact, self.interior.dt
        last, cuts = state.multiplier, _CUTS
        if self.layer == 0:
            self._stuck = self._still(time, end)
        done = LayerSums(len(last), interior.surface_displacement.shape[1])
        before = self._look(interior.surface_displacement, time)
        near = self._near(time, end)
        span, tries = dt, 0  # the next step, and how often it was cut
        while time < end - 1e-9 * dt:
            stop = min(end, time + span)
            if stop > end - 1e-9 * dt:
                stop = end
            closed = (before <= near) | (last > 0.0) | self._soft
            try:
                step, share = self._cut(time, stop, last, before, closed, tries < min(_TRIES, cuts))
            except ConvergenceError as error:
                span = 0.5 * (stop - time)
                if span < _SHORTEST * dt:
                    raise ConvergenceError(
                        f"no equilibrium was found in a step from t = {time:g} s, not even in "
                        f"{2 * span:.1e} s ({error}): give a smaller solve.dt, or smaller elements "
                        "where the body is squeezed most"
                    ) from error
                continue
            if step is None:
                span, tries = share * (stop - time), tries + 1
                continue
            interior.accept()
            self._stuck = self._stuck if step.sticks is None else step.sticks
            self._ask(stop, step)
            done.add(step, stop - time)
            last, self._normals = step.left, step.directions[:, 0]
            self._tangential = in_space(step.directions[:, 1:], step.force[:, 1:])
            time, span = stop, dt if tries else min(dt, 2.0 * span)
            cuts, tries = cuts - tries, 0
            before = self._look(interior.surface_displacement, time)
            last = self._hand_over(last)
        if self._springs is not None:  # pressed by which gaps are shut
            before = before + self._springs.depth(last)
        none = np.zeros_like(state.static)
        self.contact = ContactState(last, before, state.multiplier, state.gap, none)
        return done

    @property
    def normals(self) -> Floats:
        """Of the gaps, as the last step has them, (gaps, dim)."""
        return self._normals

    @property
    def towards(self) -> Floats:
        """Sum of the normals of the gaps of each contact node, (nodes, dim)."""
        return self._gaps.spread(self._normals)

    def _look(self, place: Floats, time: float) -> Floats:
        """Gaps of contact nodes at a place, which is looked at once [m], (gaps,)."""
        if self._looked is not None:
            then, there, gap = self._looked
            if then == time and np.array_equal(there, place):
                return gap
        gap = self._gaps.at(place, place, place, time)[0]
        self._looked = time, place, gap
        return gap

    def _near(self, start: float, end: float) -> Floats:
        """Gaps up to which nodes count as closed in a layer [m], (gaps,)."""
        bound = self.interior.predicted(start, end)
        change = np.abs(self._look(bound, end) - self.contact.gap)
        return np.where(change < 0.5 * FAR, _CLOSED * change, 0.0)

    def _cut(
        self,
        start: float,
        end: float,
        last: Floats,
        before: Floats,
        closed: Booleans,
        may_cut: bool,
    ) -> tuple[Step | None, float]:
        """Solve a step, or tell after which share of it the first open gap closes.

        Args:
            start: [s].
            end: [s].
            last: As for `_step`.
            before: See there.
            closed: See there.
            may_cut: Whether to look for gaps that close.

        Raises:
            ConvergenceError: Newton's method did not converge.
        """
        interior = self.interior
        if may_cut:
            bound = interior.predicted(start, end)
            share = self._closing(before, closed, bound, start, end)
            if share < 1.0:
                return None, share
        step = self._struck_step(start, end, last, before, closed)
        if may_cut:
            share = self._closing(before, closed, interior.surface_iterate, start, end)
            if share < 1.0:
                return None, share
        return step, 1.0

    def _closing(
        self, before: Floats, closed: Booleans, then: Floats, start: float, end: float
    ) -> float:
        """Share of a step after which the first open gap closes; 1 if none does.

        Args:
            before: Gaps at its start [m], (gaps,).
            closed: Which of them count as closed, (gaps,).
            then: Displacement of the contact nodes at its end [m], (nodes, dim).
            start: [s].
            end: [s].
        """
        after = self._look(then, end)
        rows = ~closed & ~self._between_masses & (after < 0.0)
        least, most = _NEAR * self.interior.dt / (end - start), 1.0 - _NEAR
        share = before[rows] / (before[rows] - after[rows])
        share = share[share < most]
        return max(least, float(share.min())) if len(share) and least < most else 1.0

    @property
    def _between_masses(self) -> Booleans:
        """Gaps that weigh nodes with mass only and give no way, (gaps,): their law is of speeds."""
        if not self._by_mass:
            return np.zeros(len(self._soft), dtype=bool)
        return self._gaps.only_on(self._massive) & ~self._soft

    def _hand_over(self, last: Floats) -> Floats:
        """Forces (gaps,) and all else that nodes take along which slide to another obstacle."""
        each = last, self._tangential, self._stuck.astype(float)
        last, self._tangential, stuck = map(self._gaps.handed, each)
        self._stuck = stuck > 0.0
        return last

    def _still(self, start: float, end: float) -> Booleans:
        """Gaps that nothing moves along at t = 0, (gaps,)."""
        interior, gaps = self.interior, self._gaps
        way = gaps.relative(interior.predicted(start, end) - interior.surface_displacement)
        way = way - (gaps.shift(end) - gaps.shift(start))
        along = np.einsum("ij,ij->i", way, self._normals)[:, None] * self._normals
        largest: float = np.abs(way).max(initial=0.0)
        return np.asarray(np.abs(way - along).max(axis=1) <= _STILL * largest)

    def _struck_step(
        self, start: float, end: float, last: Floats, before: Floats, closed: Booleans
    ) -> Step:
        """A step whose impacts expand (Poisson); arguments and errors are those of `_step`."""
        self._least = np.zeros_like(self._least)
        step = self._held_step(start, end, last, before, closed)
        at_once = self._impacts.law == "simultaneous"
        if self._poisson is not None and at_once and step.struck.any():
            given = expanded(self._poisson, step.force[:, 0], last)
            self._least[:, 0] = np.where(step.massive, given, 0.0)
            step = self._held_step(start, end, last, before, closed)
        return step if self._resisting is None else replace(step, turned=self._resisting.work())

    def _held_step(
        self, start: float, end: float, last: Floats, before: Floats, closed: Booleans
    ) -> Step:
        """A step with static friction; arguments and errors are those of `_step`."""
        law = self._friction
        if law is None or not (law.static > law.coefficients).any():
            return self._step(start, end, last, before, closed)

        def with_friction(mu: Floats) -> tuple[Step, Floats]:
            self._law = replace(law, coefficients=mu)
            step = self._step(start, end, last, before, closed)
            return step, step.force

        step, sticks = held_by_static(with_friction, self._stuck, law.coefficients, law.static)
        return replace(step, sticks=sticks)

    def _step(  # noqa: PLR0915  (a step is one matter)
        self, start: float, end: float, last: Floats, before: Floats, closed: Booleans
    ) -> Step:
        """Solve a step from the guess of the forces of the last one; it is not taken yet.

        Args:
            start: [s].
            end: [s].
            last: Normal forces of the last step [N], (gaps,).
            before: Gaps at the start [m], (gaps,).
            closed: Which of them count as closed, (gaps,).

        Raises:
            ConvergenceError: Newton's method did not converge.
        """
        interior, gaps = self.interior, self._gaps
        begin = interior.surface_displacement
        holds = self._scheme.holds
        may = closed if holds else np.ones(len(before), dtype=bool)
        room = self._room(last, before, end - start)
        middle_time = 0.5 * (start + end)
        interior.begin(start, end)
        self._begin_law(end - start)
        force: Floats | None = None
        massive = fresh = shut = np.zeros(len(before), dtype=bool)
        rebound: Floats | float = 0.0
        gained: Floats | float = 0.0
        if meets := bool(self._between_masses.any()):
            gap = self._look(interior.surface_iterate, end)
            shut = (gap < -self.tolerance) | ((last > 0.0) & (gap <= self.tolerance))
        for iteration in range(_ITERATES):
            place = interior.surface_iterate
            middle = 0.5 * (begin + place)
            if iteration <= _PAIRED and (may.any() or meets):
                gaps.at(middle, middle, middle, middle_time)
                self._looked = None
            normals = gaps.normals_at(middle, middle_time, interior.arms(middle))
            shift = gaps.shift(end) - gaps.shift(start)  # of what nodes now face
            interior.touch(gaps.spread(normals))
            directions = frames(normals) if self._rubs else normals[:, None, :]
            if force is None:
                force = turned(directions, self._tangential)
                force[:, 0] = last
                force[~may] = 0.0
            way = turned(directions, gaps.relative(interior.surface_way) - shift)
            left = interior.unbalanced(gaps.spread(in_space(directions, force)))
            apart = way.copy()
            apart[:, 0] += room
            if self._by_mass:
                loose = gaps.only_on(self._massive)
                massive = loose & ~self._soft
                may = np.where(massive, shut, may)
                speed = self._speed(directions, start, end - start)
                self._approach(speed[:, 0])
                ahead = way + way_ahead(speed, self._lively, rebound, end - start, gained)
                apart[massive, 0], apart[loose, 1:] = ahead[massive, 0], ahead[loose, 1:]
            if left <= 1.0 and self._missed(apart, force, may) <= self.tolerance:
                massive = massive & (force[:, 0] > 0.0)
                struck = massive & (massive & fresh).any()
                rest = self._left_behind(force, struck, apart)
                found = Step(directions, force, way, iteration, shift, massive, struck, rest)
                if self._pressed is None:
                    return found
                return replace(found, braked=self._pressed.braked(apart[:, 0], force[:, 0]))
            free = turned(directions, gaps.relative(interior.linearise()))
            if self._by_mass and not iteration:
                least = slow(speed[:, 0], (way + free)[:, 0], end - start)
                least = np.maximum(least, self.tolerance / (end - start))
                arrived = (speed[:, 0] < -least) & massive & shut
                fresh, apace = arrived & (last == 0.0), speed[:, 0] > least
                shut = massive & reached(massive & shut, fresh, before - self.tolerance, apace)
                # The next iterate sees to what may push, and to what comes back.
                may, rebound = np.where(massive, shut, may), self._rebound(arrived)
                law = directions, speed, before, rebound
                gained, rebound = self._in_turn(shut, fresh, (start, end), *law)
            new = self._obeying(apart + free, directions, force, may)
            interior.correct(gaps.spread(in_space(directions, new - force)))
            force = new
        raise ConvergenceError(f"{_ITERATES} iterates")

    def _begin_law(self, step: float) -> None:
        """Forget what was known of another step; this one has a length [s]."""
        self._known = {}
        if self._resisting is not None:
            self._resisting.begin(step)

    def _in_turn(
        self,
        shut: Booleans,
        fresh: Booleans,
        times: tuple[float, float],
        directions: Floats,
        speed: Floats,
        before: Floats,
        rebound: Floats | float,
    ) -> tuple[Floats | float, Floats | float]:
        """What impacts one after the other change of speeds [m/s], (gaps, ways); 0: all at once.

        What then comes back of the slip is told with it; see `_rebound`.

        Args:
            shut: Gaps that take part, (gaps,).
            fresh: Those in which nodes arrive, (gaps,).
            times: Start and end of the step [s].
            directions: See `_answers_to`.
            speed: Along them at its start [m/s], (gaps, ways).
            before: Gaps there [m], (gaps,).
            rebound: See `_rebound`.
        """
        rows, half = np.flatnonzero(shut), 0.5 * (times[1] - times[0])
        if not (fresh.any() and self._impacts.asks(len(rows))):
            return 0.0, rebound
        answers = self._answers_to(rows, directions)
        size = len(rows) * speed.shape[1]
        matrix = answers[:, :, rows].reshape(size, size)
        none = np.zeros(len(speed))
        lively = self._returning
        mu = none if self._law is None else self._law.coefficients
        each = (values[rows] for values in (half * speed, before, lively, none + rebound, mu))
        pairs = self._gaps.pair_of
        found = self._impacts.given(
            times[1], lambda: pairs()[rows], 0.5 * (matrix + matrix.T), Approach(*each), 2.0
        )
        if found is None:
            return 0.0, rebound
        self._least = np.zeros_like(self._least)
        self._least[rows] = found
        return np.asarray(np.einsum("jb,jbic->ic", found, answers) / half), 0.0

    def _room(self, last: Floats, before: Floats, step: float) -> Floats:
        """What gaps may close by in a step [m], (gaps,), springs taken up; arguments of `_step`."""
        room = np.zeros(len(before)) if self._scheme.holds else np.maximum(before, 0.0)
        self._pressed = None
        if self._springs is None:
            return room
        self._pressed = SpringStep.of(self._springs.over(step), last, before)
        self._foreseen = np.full(len(before), np.inf)
        return np.where(self._soft, self._pressed.room, room)

    def _left_behind(self, force: Floats, struck: Booleans, apart: Floats) -> Floats:
        """Normal forces at the end of a step [N], (gaps,)."""
        found = np.where(struck, 0.0, force[:, 0])
        if self._pressed is None:
            return found
        return np.where(self._soft, self._pressed.left(apart[:, 0]), found)

    def _speed(self, directions: Floats, start: float, step: float) -> Floats:
        """Speeds in the gaps at the start of a step, along its directions [m/s], (gaps, ways)."""
        moved = obstacle_speed(self._gaps.shift, start, step)
        return turned(directions, self._gaps.relative(self.interior.surface_velocity) - moved)

    def _rebound(self, arrived: Booleans) -> Floats | float:
        """Share of the slip that impacts in some gaps reverse, (gaps,)."""
        return 0.0 if self._law is None else np.where(arrived, self._law.rebound, 0.0)

    def _missed(self, apart: Floats, force: Floats, may: Booleans) -> float:
        """How far the increments are from the law [m].

        Args:
            apart: Increments, of the gaps what must not be negative [m], (gaps, ways).
            force: [N], (gaps, ways).
            may: Gaps in which there may be forces, (gaps,).
        """
        force = force - self._least
        normal, pushing = apart[:, 0], force[:, 0]
        if (pushing < 0.0).any():
            return np.inf
        shut = normal
        if self._pressed is not None:
            shut = np.where(self._soft, normal - self._foreseen, normal)
        held = pushing > 0.0 if self._pressed is None else (pushing > 0.0) | self._pressed.loose
        missed = np.where(held, np.abs(shut), np.maximum(-normal, 0.0))[may]
        worst = float(missed.max(initial=0.0))
        if self._law is None:
            return worst
        rows = np.flatnonzero((force[:, 0] > 0.0) & (self._law.coefficients > 0.0))
        if not self._known.keys() >= set(rows.tolist()):
            return np.inf  # by how much they yield is not known yet
        for row in rows.tolist():
            yields = np.trace(self._known[row][1:, row, 1:]) / (force.shape[1] - 1)
            tau, slip = force[row, 1:], apart[row, 1:]
            trial = tau - slip / yields
            bound = self._law.coefficients[row] * force[row, 0]
            length = float(np.linalg.norm(trial))
            wanted = trial if length <= bound else bound / length * trial
            worst = max(worst, yields * float(np.abs(tau - wanted).max()))
        if self._resisting is not None:
            worst = max(worst, self._resisting.missed(force[:, 0]))
        return worst

    def _obeying(self, apart: Floats, directions: Floats, force: Floats, may: Booleans) -> Floats:
        """Forces for which the linearised law holds, (gaps, ways).

        Args:
            apart: Increments if the forces stay, of the gaps what must not be negative [m], (gaps,
                ways).
            directions: (gaps, ways, dim).
            force: Forces that stay [N], (gaps, ways).
            may: Gaps in which there may be forces, (gaps,).
        """
        pushes = (force[:, 0] > 0.0) | (self._least[:, 0] > 0.0)
        if self._pressed is not None:  # dashpots may end forces in springs that are still pressed
            pushes = pushes | self._pressed.loose
        rows = np.flatnonzero(may & (pushes | (apart[:, 0] < -self.tolerance)))
        found = np.zeros_like(force)
        if self._resisting is not None and not len(rows):
            self._resisting.rest()
        while len(rows):
            answers = self._answers_to(rows, directions)
            size = len(rows) * force.shape[1]
            # Symmetric but for what the step turns; what that leaves the next iterate settles.
            matrix = answers[:, :, rows].reshape(size, size)
            matrix = 0.5 * (matrix + matrix.T)
            own = force[rows]
            solved = self._solved(matrix, apart[rows], rows, own, directions[rows])
            after = apart[:, 0] + np.einsum("jb,jbi->i", solved - own, answers[..., 0])
            missed = may & (after < -self.tolerance)
            missed[rows] = False
            if not missed.any():
                found[rows], self._foreseen = solved, after
                return found
            rows = np.union1d(rows, np.flatnonzero(missed))
        return found

    def _solved(
        self, matrix: Floats, apart: Floats, rows: Integers, own: Floats, directions: Floats
    ) -> Floats:
        """Forces in gaps that take part, (rows, ways); moments that resist there come with them.

        Args:
            matrix: Their increments by forces [m/N], (rows ways, rows ways).
            apart: Increments if the forces stay [m], (rows, ways).
            rows: The gaps.
            own: Their forces that stay [N], (rows, ways).
            directions: Of the gaps, (rows, ways, dim).
        """
        least = self._least[rows]
        none = np.zeros(len(rows))
        mu = none if self._law is None else self._law.coefficients[rows]
        springs = None if self._pressed is None else self._pressed.some(rows)
        more = own - least
        offset = apart - (matrix @ more.ravel()).reshape(own.shape)
        law = ConeProblem(matrix, offset, mu, none, springs=springs)
        if self._resisting is None:
            return least + solve(law, more, self._how)[0]
        law, start = self._resisting.beside(law, rows, directions, more)
        found = solve(law, start, self._how)[0]
        self._resisting.take(found[len(rows) :])
        return least + found[: len(rows)]

    def _answers_to(self, rows: Integers, directions: Floats) -> Floats:
        """Increments by unit forces in some gaps, (rows, ways, gaps, ways).

        They are kept as long as the tangent.
        """
        interior, gaps = self.interior, self._gaps
        if self._generation != interior.generation:
            self._generation, self._known = interior.generation, {}
        fresh = [row for row in rows.tolist() if row not in self._known]
        if fresh:
            count, ways, dim = directions.shape
            units = np.zeros((len(fresh), ways, count, dim))
            for k, row in enumerate(fresh):
                units[k, :, row] = directions[row]
            spread = [gaps.spread(unit) for unit in units.reshape(-1, count, dim)]
            moved = interior.answers(np.stack(spread))
            each = np.stack([turned(directions, gaps.relative(one)) for one in moved])
            known = each.reshape(len(fresh), ways, count, ways)
            self._known |= dict(zip(fresh, known, strict=True))
        return np.stack([self._known[row] for row in rows.tolist()])
