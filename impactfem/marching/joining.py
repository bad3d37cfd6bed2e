"""Joints that hold bodies of a march together, in a step: what they push with, and what they show.

Rows hold at ends of steps, and rates then keep to them but for the size of a step; where contact
has given impulses, which jump, rates are projected on what the joints allow, which never gives
energy. Limits act as contact of bodies without massless nodes does: where a coordinate would be
beyond one at the end of a step and would go on outwards, its rate turns to -e times that before.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, cast

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.marching.composite import Bodies
from impactfem.marching.joint_kernels import FAST, FOUND, joined
from impactfem.marching.joint_states import JointStates
from impactfem.marching.layers import Stepper, Sums
from impactfem.marching.meshless import step_length
from impactfem.marching.stations import Held, Motion
from impactfem.marching.steady_rows import SteadyRows
from impactfem.result.history import LOST
from impactfem.scene import Joint
from impactfem.scene.ties import TieRows
from impactfem.system.joint_kernels import (
    ANGLE,
    DOT,
    POINT,
    at_gradients,
    delassus,
    least,
    shown,
    sizes_of,
    wrenches,
)
from impactfem.system.joints import Joints
from impactfem.system.stations import couples

_MOST = 50  # looks for forces by formula, and for what slips, stops or lets go in a layer
_TWO = 2.0  # of which half counts, where rates and not ways of a step are asked for
_ROUNDING = 64.0 * float(np.finfo(float).eps)  # of places in a row

_SHOWN = ("q", "v", "force", "moment", LOST)  # of each joint
_FORCE = _SHOWN.index("force")


class Joining[P: Stepper](Bodies[P]):
    """Bodies of which joints hold some together; see `joint_kernels`.

    Attributes:
        counts: Whether this rank sums them up.
        span: Of the step [s].
    """

    span: float
    _time: float  # amid the step [s]

    def _hold(
        self, joints: Joints, held: Sequence[Held], places: Sequence[int], span: float
    ) -> None:
        """Begin at t = 0.

        Args:
            joints: What holds some of the bodies.
            held: Those, in the order of `Joints.parts`.
            places: Of these among the parts.
            span: Of the first step [s].
        """
        self.span = span
        self._joints, self._held, self.counts = joints, tuple(held), held[0].part.counts
        self._places = tuple(places)
        self._owns = [self.own(k) for k in places]
        # Sums of the first one held.
        self._first = sum(len(part.inertia()) for part in self.parts[: places[0]])
        self._now, self._led = 0.0, joints.ground.count  # stations that are not held
        self._leads = self._led > 1 or bool((joints.driven >= 0).any())
        ends = np.cumsum([self._led, *(len(body.freedoms) for body in held)])
        self._at = [slice(*both) for both in pairwise(ends)]  # stations of each
        terms, count, each = joints.terms, joints.count, len(joints.joints)
        self._acting = np.zeros(count)
        self._summed: tuple[tuple[Floats, Floats], ...] = ()  # terms and rows
        self._terms = joints.values_at(joints.places, joints.turns, np.zeros(len(terms.kinds)))
        self._gradient = joints.gradient
        self._rates = joints.rates_now()
        self._damping = np.array([joint.damping for joint in joints.joints])
        self._stiffness = np.array([joint.stiffness for joint in joints.joints])
        self._rest = np.array([joints.rest(joint) for joint in joints.joints])
        self._shift = np.array([joints.shift(joint) for joint in joints.joints])
        self._gears = np.array([joint.between is None for joint in joints.joints])
        self._owner = joints.owner[terms.rows]
        self._struck = False
        # Whether rows act along lines that stay, by laws that do.
        turn = (terms.kinds != POINT).any() or terms.arms.any()
        self._same = not (turn or self._leads or self._states_change(joints))
        # Where they do, and bodies answer alike in all layers, one factor is that of all.
        steady = self._same and not joints.redundant and joints.count > 0
        answers = [body.steady_answer for body in held]
        self._columns = {joint.name: _columns(joint) for joint in joints.joints}
        self._images = np.ones(7)  # see `mirror`
        self._steady = steady and all(answer is not None for answer in answers)
        self._kept: SteadyRows | None = None
        self._kept_ahead: SteadyRows | None = None
        reach = joints.extent or 1.0
        # Places round by the lengths that make them, cosines and angles do not.
        rounds = np.where(np.isin(terms.kinds, (DOT, ANGLE)), 1.0, reach)
        self._rounding = _ROUNDING * reach  # of places [m]
        self._sizes = _ROUNDING * np.bincount(terms.rows, np.abs(terms.shares) * rounds, count)
        self._states = JointStates(joints, self._rates, span, self._sizes)
        self._reaction: Floats | None = None
        self._middles = joints.turns
        self._ends = self._terms
        self._look()
        self._shown = np.zeros((each, len(_SHOWN)))  # of the layer; what was taken up to now
        self._show(self._terms)

    def _look(self) -> None:
        """Take laws of the rows by which contact that is asked for before a layer is answered."""
        self._laws = self._states.laws(self._coordinates(self._terms), self._rates)
        self._reaction = None

    def _join_steadily(self) -> bool:
        """Solve the layer by the factor that is kept; whether rows are independent."""
        joints, dt = self._joints, self.span
        flats = [cast("Floats", body.steady_answer) for body in self._held]
        if self._kept is None or not self._kept.stays(dt, flats):
            self._kept, self._reaction = SteadyRows(joints, self._gradient, dt, flats), None
        places, turns = self._starts()
        still = joints.ground.still
        rates = _stacked([(still, still), *(body.rates for body in self._held)])
        given = _stacked([(still, still), *(body.impulses() for body in self._held)])
        begun = self._coordinates(self._terms)
        laws = self._states.laws(begun, self._rates)
        # Spins do not move these rows, whatever axes they are told along.
        ways = np.hstack([2.0 * one + other for one, other in zip(rates, given, strict=True)])
        free = begun + 0.5 * dt * self._kept.rates(ways) - joints.wanted(self._end)[0]
        try:
            self._acting = self._kept.solve(free, laws)
        except np.linalg.LinAlgError:
            return False
        if not np.array_equal(laws[:, :2], self._laws[:, :2]):
            self._reaction = None
        self._laws, pushes = laws, self._wrenches(self._acting)
        moved, none = np.hstack(rates), np.zeros((len(places), 3))
        for flat, own in zip(flats, self._at, strict=True):
            moved[own] += np.hstack(given)[own] + (flat @ pushes[own].ravel()).reshape(-1, 6)
        speeds, spins = moved[:, :3], moved[:, 3:]
        ahead = places + 0.5 * dt * (rates[0] + speeds)
        self._ends, self._middles = joints.values_at(ahead, turns, self._terms), turns
        self._drawn = 0.0
        frees = np.zeros((len(places), 3, 3))
        moving = speeds, spins, none, turns, turns, frees, pushes
        for body, at in zip(self._held, self._at, strict=True):
            body.take(Motion(False, self._rounding / dt, *(each[at] for each in moving)))
        return True

    @staticmethod
    def _states_change(joints: Joints) -> bool:
        """Whether any joint slips, stops, is driven or may let go."""
        bounded = (joints.rubbing >= 0).any() or (joints.stopping >= 0).any()
        each = ((j.motor, getattr(j, "break_force", None)) for j in joints.joints)
        return bool(bounded) or any(force is not None for both in each for force in both)

    def settle(self, forces: Floats) -> None:
        """Begin where the bodies have come to rest, with forces of the rows [N or N m], (rows,)."""
        joints, t = self._joints, self._joints.terms
        for body in self._held:
            body.settle()
        places, turns = self._starts()
        self._terms = self._ends = joints.values_at(places, turns, self._terms)
        if (joints.taut >= 0).any():
            self._tighten(joints.tightened(self._coordinates(self._terms)))
        self._gradient = np.asarray(
            at_gradients(t.kinds, t.bodies, t.arms, t.axes, places, turns, self._terms)
        )
        self._middles, self._acting = turns, forces * self.span
        self._show(self._terms)

    def _tighten(self, joints: Joints) -> None:
        """Go on with joints that hold their preloads."""
        self._joints = joints
        self._rest = np.array([joints.rest(joint) for joint in joints.joints])
        self._states = JointStates(joints, self._rates, self.span, self._sizes)
        self._look()

    def _set_out(self, start: float, end: float) -> None:
        """Take up a step between two times; what joints hold is to be solved for."""
        self._now, self._end = start, end
        self.span = self._states.span = step_length(start, end, self.dt)
        self._time = 0.5 * (start + end)
        for k, part in enumerate(self.parts):
            if k not in self._places:
                part.begin(start, end)
        for body in self._held:
            body.set_out(start, end)

    def _coordinates(self, terms: Floats) -> Floats:
        """Rows by values of their terms, (rows,), which are kept of a layer's start and end."""
        for known, rows in self._summed:
            if known is terms:
                return rows
        rows = self._joints.terms.sums(terms, self._joints.count)
        self._summed = *self._summed[-1:], (terms, rows)
        return rows

    def _stored(self, terms: Floats) -> float:
        """Energy in the springs [J]."""
        rows = self._coordinates(terms)[self._joints.moving]
        return float((0.5 * self._stiffness * (rows - self._rest) ** 2).sum())

    def _join(self) -> None:
        """Solve the layer of the bodies that joints hold, with what has pushed so far."""
        if self._steady:
            self._steady = self._join_steadily()
            if self._steady:
                return
        joints, terms, dt = self._joints, self._joints.terms, self.span
        start, still = self._starts(), joints.ground.still
        led = (joints.ground.at(self._end)[0] - start[0][: self._led]) / dt
        spins = _stacked([(led, still), *(body.rates for body in self._held)])
        begun = self._coordinates(self._terms)
        offsets = joints.wanted(self._end)[0]
        slid = self._states.slides.copy()
        if joints.redundant:  # what changes have the least of, their sums need not
            self._acting = np.zeros(joints.count)
        for look in range(_MOST):
            elastic = couples([body.compliance for body in self._held], self._led)
            given = [(still, still), *(body.impulses() for body in self._held)]
            self._laws = self._states.laws(begun, self._rates)
            known = (
                terms.kinds, terms.rows, terms.bodies, terms.arms, terms.axes, terms.across,
                terms.shares, offsets, self._laws, start, spins, _stacked(given), self._acting,
                self._terms, joints.masses, elastic, dt, self._sizes,
            )  # fmt: skip
            state, self._acting, *moving, self._ends, self._gradient, _ = _solved(known, joints)
            if state != FOUND and self._states.let_go(slid):
                self._acting = np.zeros(joints.count)
                continue
            if state != FOUND:
                why = (
                    "turn too far in a step" if state == FAST else "cannot be held by their joints"
                )
                names = ", ".join(joints.names[self._led :])
                raise ConvergenceError(
                    f"{names}: bodies {why} at t = {self._time:.6g} s; use a smaller solve.dt, or "
                    "check the joints"
                )
            ended = self._coordinates(self._ends)
            if not self._states.settled(begun, ended, self._rates, self._acting, self._time, look):
                continue  # bodies that moved as wrong states have it could go too far
            self._middles = moving[4]
            pushes = self._wrenches(self._acting)
            self._drawn = -float((pushes[: self._led, :3] * led).sum())
            jumps, noise = bool(self._states.stops.any()), self._rounding / dt
            settled = [
                body.take(Motion(jumps, noise, *(each[at] for each in (*moving, pushes))))
                for body, at in zip(self._held, self._at, strict=True)
            ]
            if all(settled):
                break
        else:
            raise ConvergenceError(
                f"forces by formula, friction or limits of joints did not settle at t = "
                f"{self._time:.6g} s; use a smaller solve.dt"
            )
        self._reaction = None

    def _starts(self) -> tuple[Floats, Floats]:
        """Places and rotations of all stations at the start of the layer."""
        ground = self._joints.ground
        led = ground.at(self._now)[0], ground.turns
        return _stacked([led, *(body.frames for body in self._held)])

    def _wrenches(self, acting: Floats) -> Floats:
        """Impulses on the stations by those of the rows (..., rows), (..., stations, 6)."""
        count, t = len(self._joints.names), self._joints.terms
        each = acting.reshape(-1, acting.shape[-1])
        found = wrenches(each, self._gradient, t.rows, t.shares, t.bodies, count)
        return np.asarray(found.reshape(*acting.shape[:-1], count, 6))

    def _held_back(self, moved: Floats, forces: Floats) -> None:
        """Take back what joints do not let move of answers to forces (several, count, dim)."""
        if any(forces[:, own].any() for own in self._owns):
            each = zip(self._held, self._owns, strict=True)
            back = self._taken_back([body.reached(forces[:, own]) for body, own in each])
            self._move(moved, back)

    def twisted(self, moments: Floats) -> tuple[Floats, Floats]:
        """Displacements of all nodes and turns of their bodies by moments; see `Bodies`."""
        moved, turned = super().twisted(moments)
        first = 6 - moments.shape[2]
        each = zip(self._held, self._owns, strict=True)
        spun = [body.whirled(moments[:, own]) for body, own in each]
        back = self._taken_back([np.pad(rates, [(0, 0), (0, 0), (first, 0)]) for rates in spun])
        self._move(moved, back)
        for body, own, at in zip(self._held, self._owns, self._at, strict=True):
            turned[:, own] += 0.5 * self.span * body.spun(back[:, at, first:])
        return moved, turned

    def _move(self, moved: Floats, impulses: Floats) -> None:
        """Add displacements of nodes by impulses on stations, (several, stations, 6)."""
        for body, own, at in zip(self._held, self._owns, self._at, strict=True):
            moved[:, own] += 0.5 * self.span * body.carried(impulses[:, at])

    def _taken_back(self, rates: Sequence[Floats]) -> Floats:
        """Impulses of joints on stations in the layer, (several, stations, 6).

        Args:
            rates: Of the stations of each body in space by forces for a second, (several, own, 6).
        """
        joints, terms, dt = self._joints, self._joints.terms, self.span
        moved = np.concatenate([np.zeros((len(rates[0]), self._led, 6)), *rates], axis=1)
        weighed = self._gradient * terms.shares[:, None, None]
        if self._reaction is None:
            self._reaction = self._reactions(weighed)
        ways = np.einsum("tsk,ntsk->nt", weighed, moved[:, terms.bodies])
        rows = np.zeros((joints.count, len(moved)))
        np.add.at(rows, terms.rows, ways.T)
        # Impulses of the rows by unit forces, whose own is dt.
        return self._wrenches(-(0.5 * dt**2 * (self._reaction @ rows)).T)

    def _reactions(self, weighed: Floats) -> Floats:
        """Impulses of the rows that take back unit ways of them, (rows, rows)."""
        laws, joints = self._meeting_contact(), self._joints
        still = np.zeros((self._led, 3, 3))
        free = np.concatenate([still, *(body.freedoms for body in self._held)])
        elastic = couples([body.compliance for body in self._held], self._led)
        matrix = self._moving(weighed, free, elastic)
        matrix = 0.5 * self.span * matrix
        scale = sizes_of(matrix)
        matrix = laws[:, :1] * matrix + np.diag(laws[:, 1])
        return least(matrix, np.diag(laws[:, 0]), scale, redundant=bool(joints.redundant))

    def _meeting_contact(self) -> Floats:
        """Laws of rows that contact meets, (rows, 3)."""
        return self._states.unbounded(self._laws)

    def _moving(self, weighed: Floats, free: Floats, elastic: tuple[Any, Floats]) -> Floats:
        """How rows move by unit impulses in them, (rows, rows); see `delassus`."""
        joints, terms = self._joints, self._joints.terms
        return np.asarray(
            delassus(
                terms.rows, terms.bodies, weighed, weighed, joints.count, joints.masses[0], free,
                *elastic,
            )
        )  # fmt: skip

    def _keep_rates(self) -> None:
        """Let rates at the end keep to the joints where they jumped, or are led.

        Without it rates of what is led would err by alternate signs from step to step for ever,
        which accelerations show.
        """
        jumped = self._struck or any(body.jumped for body in self._held)
        if jumped or self._states.stops.any():
            self._project(share=0.0)
        elif self._leads:
            self._project(share=0.5)

    def _project(self, share: float) -> None:
        """Take rates at the end of the layer that the joints allow, the nearest by energy.

        Args:
            share: Of what rows were off that counts in the work of what leads them: half of what
                is but smoothed, none where the rest of the energy is lost.
        """
        joints, terms = self._joints, self._joints.terms
        holding = np.flatnonzero(self._states.hard)
        places, speeds = joints.ground.at(self._end)
        ground, led = (places, joints.ground.turns), np.hstack([speeds, joints.ground.still])
        places, turns = _stacked([ground, *(body.places_ahead for body in self._held)])
        at = joints.values_at(places, turns, self._ends)
        now = at_gradients(terms.kinds, terms.bodies, terms.arms, terms.axes, places, turns, at)
        weighed = np.asarray(now * terms.shares[:, None, None])
        twists = np.concatenate([led, *(body.rates_ahead for body in self._held)])
        wanted = joints.wanted(self._end)[1]
        rates = -wanted
        np.add.at(rates, terms.rows, np.einsum("tsk,tsk->t", weighed, twists[terms.bodies]))
        acting = self._leave_steadily(rates) if self._steady else None
        if acting is None:
            free = turns @ joints.masses[2] @ turns.swapaxes(1, 2)
            elastic = couples([body.compliance_ahead for body in self._held], self._led)
            matrix = self._moving(weighed, free, elastic)
            acting = np.zeros(joints.count)
            inner = matrix[np.ix_(holding, holding)]
            redundant = bool(joints.redundant)
            acting[holding] = -least(inner, rates[holding], sizes_of(inner), redundant=redundant)
        pushes = np.zeros_like(twists)
        np.add.at(pushes, terms.bodies, acting[terms.rows, None, None] * weighed)
        for body, own in zip(self._held, self._at, strict=True):
            body.leave(pushes[own])
        led_away = float((pushes[: self._led] * led).sum())
        self._drawn += float(acting @ (wanted + share * rates)) - led_away

    def _leave_steadily(self, rates: Floats) -> Floats | None:
        """Impulses by which rates (rows,) at the end of a layer keep to the joints, (rows,).

        None where some rows follow from others.
        """
        ahead = [body.compliance_ahead for body in self._held]
        answers = [each.reshape(6 * len(each), -1) for each in ahead]
        if self._kept_ahead is None or not self._kept_ahead.stays(_TWO, answers):
            self._kept_ahead = SteadyRows(self._joints, self._gradient, _TWO, answers)
        hard = np.zeros(self._joints.count)
        hard[self._states.hard] = 1.0
        try:
            return self._kept_ahead.solve(rates, np.column_stack([hard, 1.0 - hard, 0.0 * hard]))
        except np.linalg.LinAlgError:
            return None

    def mirror(self, axes: Sequence[int]) -> None:
        """Tell forces and moments of a whole of which planes across some axes leave a part."""
        if len(axes):
            self._images *= 2.0 ** len(axes)
            for axis in axes:
                self._images[[axis, *(3 + turn for turn in range(3) if turn != axis)]] = 0.0
            self._show(self._terms)

    def _show(self, terms: Floats) -> None:
        """Rates of the rows now, and what columns of joints show."""
        joints, t, dt = self._joints, self._joints.terms, self.span
        led = joints.ground.at(self._now)[1], joints.ground.still
        moving = _stacked([led, *(body.rates for body in self._held)])
        stations = *self._starts(), *moving, self._middles
        more = self._owner, joints.moving, self._shift, self._gears, self._images, self._dim
        acting = self._gradient, self._acting / dt
        own = t.kinds, t.rows, t.bodies, t.arms, t.axes, t.shares
        self._rates = shown(own, terms, *acting, stations, more, self._shown)

    def told(self) -> dict[str, dict[str, float]]:
        """Columns of the joints; those without a coordinate have forces only, ties but these."""
        ties, found = {}, {}
        for joint, values in zip(self._joints.joints, self._shown.tolist(), strict=True):
            columns = self._columns[joint.name]
            if columns:
                found[joint.name] = {name: values[at] for name, at in columns}
            else:
                ties[joint.name] = values[_FORCE]
        return {"force": ties, **found} if ties else found

    def parted(self) -> dict[str, float]:
        """When ties let go [s]."""
        each = zip(self._joints.joints, self._states.parted.tolist(), strict=True)
        return {joint.name: time for joint, time in each if time < np.inf}

    def opened(self) -> dict[str, tuple[float, float]]:
        """How far each joint that does not give way is open now [m], [rad]."""
        joints, terms = self._joints, self._joints.terms
        off = np.abs(self._coordinates(self._terms) - joints.wanted(self._now)[0])
        off = np.where(self._states.hard, off, 0.0)
        turns = np.isin(np.arange(joints.count), terms.rows[np.isin(terms.kinds, (DOT, ANGLE))])
        most = np.zeros((2, len(joints.joints)))
        np.maximum.at(most, (turns.astype(int), joints.owner), off)
        each = zip(joints.joints, *most.tolist(), strict=True)
        return {joint.name: (way, turn) for joint, way, turn in each}

    def _ended(self) -> tuple[float, float]:
        """Take what the step has found; energy in springs at its end, and work of motors [J]."""
        joints = self._joints
        way = self._coordinates(self._ends) - self._coordinates(self._terms)
        # What rows take that are neither held exactly nor springs or motors.
        taken = np.where(joints.hard, 0.0, -self._acting * way / self.span)
        moving = joints.moving[joints.moving >= 0]
        taken[moving] = self._damping[joints.owner[moving]] * way[moving] ** 2 / self.span
        self._shown[:, 4] += self._images[6] * np.bincount(joints.owner, taken, len(joints.joints))
        own = joints.driven[joints.driven >= 0]
        driven = self._states.driven(way) + float(self._acting[own] @ way[own]) / self.span
        driven += self._drawn
        self._now = self._end
        self._show(self._ends)
        self._states.part(self._shown[:, 2], self._now)
        self._acting[self._states.gone] = 0.0  # rounding would leave 1e-32 of it in each step
        self._terms = self._ends
        return self._stored(self._ends), driven

    def initial(self, static: Floats) -> Sequence[Sums]:
        """Sums of the initial state, of each body."""
        found = super().initial(static)
        if self.counts:
            found[self._first].elastic += self._stored(self._terms)
        return found

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs besides the bodies."""
        own = {
            "joints.acting": self._acting.copy(), "joints.terms": self._terms.copy(),
            "joints.rates": self._rates.copy(), "joints.lost": self._shown[:, 4].copy(),
            "joints.now": np.array([self._now]), "joints.start": self._joints.start.copy(),
            "joints.slack": self._joints.slack.copy(),
        }  # fmt: skip
        for k, body in enumerate(self._held):
            own |= {f"joints.{k}.{name}": values for name, values in body.memory().items()}
        return super().memory() | own | self._states.memory()

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        super().remember(memory)
        self._acting, self._terms = memory["joints.acting"].copy(), memory["joints.terms"].copy()
        self._rates, self._shown[:, 4] = memory["joints.rates"].copy(), memory["joints.lost"]
        self._now = float(memory["joints.now"][0])
        start, slack = memory["joints.start"].copy(), memory["joints.slack"].copy()
        self._tighten(replace(self._joints, start=start, slack=slack))
        self._states.remember(memory)
        self._look()
        for k, body in enumerate(self._held):
            first = f"joints.{k}."
            body.remember(
                {n.removeprefix(first): v for n, v in memory.items() if n.startswith(first)}
            )


def _columns(joint: Joint) -> list[tuple[str, int]]:
    """What is shown of a joint, and where that stands in its values; of ties nothing."""
    if isinstance(joint, TieRows):
        return []
    names = [*_SHOWN[: 2 * joint.moves], "force"]
    names += ["moment"] * (joint.between is not None) + [LOST]
    return [(name, _SHOWN.index(name)) for name in names]


def _solved(known: Sequence[Any], joints: Joints) -> Any:
    """The layer by `joined`; where rows come to follow from others, with the least impulses."""
    try:
        return joined(*known, bool(joints.redundant))
    except np.linalg.LinAlgError:
        return joined(*known, True)


def _stacked(each: Sequence[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    first, second = zip(*each, strict=True)
    return np.concatenate(first), np.concatenate(second)
