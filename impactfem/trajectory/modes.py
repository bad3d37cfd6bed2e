"""Motions through contacts that close and open in a known order: phases, and impacts between.

In a phase some gaps are closed: g'' = 0 along their normals n, which tells the forces. What rubs
sticks, within the cone of friction, or slips one way, with friction at the edge of it. Forces
press, and all other gaps are open. How long phases last is free. Where a gap closes, rates jump as
impacts let them; one that rebounds is an instant between two phases.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene.values import show
from impactfem.trajectory.bodies import Symbolic
from impactfem.trajectory.building import Guess, Sizes, Stretch, cost_size, sizes_of
from impactfem.trajectory.contacts import Closing, check_events
from impactfem.trajectory.following import Followed, followed
from impactfem.trajectory.motion import Motion
from impactfem.trajectory.nlp import Answer, Program
from impactfem.trajectory.problem import Problem
from impactfem.trajectory.resimulated import recorded
from impactfem.trajectory.symbols import loaded
from impactfem.trajectory.transcribing import Transcribed, begin, cut
from impactfem.trajectory.transcriptions import transcription_of
from impactfem.vibro.event_legs import Leg

FLIGHT, STANCE = "flight", "stance"
_SLIPS = {"_slip_back": -1, "_slip": 1}  # how a contact that is named slips
_ROW = "hermite_simpson"  # in each phase
_SHORTEST = 1e-3  # share of the longest duration that a phase lasts at least
_CLOSED = 1e-9  # of the size of states: a gap that is more open at the start is
_STILL = 1e-9  # of the size of speeds, by which what slips may do so the other way
_BRIEF = 0.5 * _SHORTEST  # share of the duration: what is told of shorter flights is rounding
_TOUCHES = 1e-6  # of the size of a gap, below which it counts as closed
_ROUNDS = 8
_NAMED = 8  # entries of an order in messages; the summary has all


@dataclass(frozen=True)
class Mode:
    """An entry of `modes`.

    Attributes:
        name: As it is said.
        closed: Places of the gaps that are closed.
        slips: Those of them that slip: 1 forwards, -1 back.
        instant: Whether these rebound at once.
    """

    name: str
    closed: frozenset[int]
    slips: Mapping[int, int]
    instant: bool = False


def places_of(gaps: Sequence[Closing], begun: Floats) -> dict[str, set[int]]:
    """Gaps by name: BODY.OBSTACLE are the nearest ones at the start, BODY.OBSTACLE#1 one alone.

    Args:
        gaps: Of a scene (J,).
        begun: How far they are open at the start (J,).
    """
    own: dict[str, set[int]] = {}
    for pair in dict.fromkeys(map(label, gaps)):
        places = [k for k, gap in enumerate(gaps) if label(gap) == pair]
        least, room = begun[places].min(), _CLOSED * np.abs(begun[places]).max()
        own[pair] = {k for k in places if begun[k] <= least + room}
        if len(places) > 1:
            own |= {f"{pair}#{number + 1}": {k} for number, k in enumerate(places)}
    return own


def modes_of(
    names: Sequence[str], gaps: Sequence[Closing], own: Mapping[str, set[int]]
) -> list[Mode]:
    """What `modes` says of the gaps of a scene, whose places have names.

    Raises:
        SceneError: A contact is not known, or the order cannot be.
    """
    known = ", ".join(own) or "there are none"
    found: list[Mode] = []
    for index, name in enumerate(names):
        text = f"trajectory.modes[{index}] = {show(name)}: "
        ways = _closed_by(name, own, gaps, text)
        closed, slips = frozenset(ways), {k: way for k, way in ways.items() if way}
        before = found[-1] if found else None
        bounce = {k for k in closed if gaps[k].restitution and before is not None
                  and k not in before.closed}  # fmt: skip
        if bounce and bounce != closed:
            raise SceneError(
                f"{text}part of it rebounds (restitution > 0) and part does not: give these as "
                "entries of their own"
            )
        if bounce and slips:
            raise SceneError(f"{text}it rebounds (restitution > 0) at once; leave the slip out")
        mode = Mode(name, closed, slips, bool(bounce))
        same = before is not None and (before.closed, before.slips) == (closed, slips)
        if before is not None and (same or (before.instant and bounce)):
            raise SceneError(f'{text}does not follow {show(before.name)}; give "flight" between')
        found.append(mode)
    if not found or found[-1].instant or found[0].instant:
        raise SceneError(
            f"trajectory.modes = {show(list(names))}: give the order of contacts, as "
            f'["flight", "stance"]; one that rebounds is followed by "flight". Contacts: {known}'
        )
    return found


def label(gap: Closing) -> str:
    """Of the contact of a gap: BODY.OBSTACLE, or JOINT.lower and JOINT.upper."""
    return f"{gap.pair}.{gap.name.split()[1]}" if gap.limits else gap.pair


def _closed_by(
    name: str, own: Mapping[str, set[int]], gaps: Sequence[Closing], text: str
) -> dict[int, int]:
    """Gaps that an entry closes, and how they slip: 1 forwards, -1 back, 0 not."""
    known, pairs = ", ".join(own) or "there are none", {label(g) for g in gaps if not g.limits}
    found: dict[int, int] = {}
    for part in [] if name == FLIGHT else [part.strip() for part in name.split("+")]:
        ending = next((each for each in _SLIPS if part.endswith(each)), "")
        contact, way = part.removesuffix(ending), _SLIPS.get(ending, 0)
        if contact == STANCE and len(pairs) != 1:
            why = "several contacts may close; name those that do" if pairs else "nothing may close"
            raise SceneError(f"{text}{why}: {known}")
        contact = next(iter(pairs)) if contact == STANCE else contact
        if contact not in own:
            raise SceneError(
                f'{text}there is no contact {show(contact)}; give "flight", "stance", or contacts '
                f'joined by "+", with "_slip" or "_slip_back" what slips: {known}'
            )
        if way and not all(gaps[k].friction for k in own[contact]):
            raise SceneError(
                f"{text}nothing rubs there, so that it slips as it likes; give {show(contact)}, or "
                "friction_coefficient in its [[contact]]"
            )
        found |= dict.fromkeys(own[contact], way)
    return found


class Forces:
    """What closed gaps do to bodies in symbols.

    Args:
        known: The bodies.
        gaps: All gaps.
        closed: Places of the closed ones.
        slips: Those that slip: 1 forwards, -1 back.
    """

    def __init__(
        self, known: Symbolic, gaps: Sequence[Closing], closed: frozenset[int],
        slips: Mapping[int, int],
    ) -> None:  # fmt: skip
        casadi, tree = loaded(), known.tree
        self.known, self.places = known, sorted(closed)
        speeds, self.normal, pushed = list[Any](), list[int](), dict[int, Any]()
        self.slips = [slips[k] * gaps[k].slip for k in self.places if k in slips]
        self.cones: list[tuple[int, list[int], float]] = []
        rubbed: dict[str, tuple[int, list[int]]] = {}
        for k in self.places:
            gap = gaps[k]
            self.normal.append(len(speeds))
            opens = casadi.jtimes(gap.gap, tree.q, tree.v)
            speeds.append(opens + casadi.jacobian(casadi.SX(gap.gap), tree.t))
            if k in slips:
                rubs = slips[k] * gap.friction * casadi.jacobian(gap.slip, tree.v)
                pushed[self.normal[-1]] = -rubs
            elif gap.friction:
                if gap.name not in rubbed:  # one tangent of a face: more say the same
                    speeds.append(gap.slip)
                    rubbed[gap.name] = len(speeds) - 1, []
                    self.cones.append((*rubbed[gap.name], gap.friction))
                rubbed[gap.name][1].append(self.normal[-1])
        self.turned = [gaps[k].restitution for k in self.places]
        self.speeds = casadi.vertcat(casadi.SX(0, 1), *speeds)
        self.rows = casadi.jacobian(self.speeds, tree.v)
        self.along = casadi.SX(self.rows)  # of forces: with the friction of what slips
        for row, rubs in pushed.items():
            self.along[row, :] += rubs

    def lasting(self) -> tuple[Any, Any]:
        """V' and forces along rows, while they stay closed."""
        casadi, tree = loaded(), self.known.tree
        free = self.known.rate
        if not self.places:
            return free, casadi.SX(0, 1)
        speeds = self.speeds
        drift = casadi.jtimes(speeds, tree.q, tree.v) + casadi.jacobian(speeds, tree.t)
        back = tree.solved(self.along.T)
        push = _small(self.rows @ back, -(self.rows @ free + drift))
        return free + back @ push, push

    def impact(self, rebounds: bool) -> tuple[Any, Any]:
        """V after they close, and impulses along rows."""
        casadi, tree = loaded(), self.known.tree
        if not self.places:
            return tree.v, casadi.SX(0, 1)
        speeds = self.speeds
        wanted = -speeds
        if rebounds:
            for row, e in zip(self.normal, self.turned, strict=True):
                wanted[row] = -(1.0 + e) * speeds[row]
        back = tree.solved(self.along.T)
        push = _small(self.rows @ back, wanted)
        return tree.v + back @ push, push

    def pressed(self, push: Any, size: Floats) -> list[tuple[str, Any]]:
        """What stays <= 0, in sizes: forces or impulses press, within the cone of friction."""
        casadi = loaded()
        found = [("presses", -push[row] / size[row]) for row in self.normal]
        for row, normals, friction in self.cones:
            most = friction * sum(push[k] for k in normals)
            own = size[normals[0]]
            found += [("sticks", (push[row] - most) / own), ("sticks", (-push[row] - most) / own)]
        return [(text, casadi.SX(each)) for text, each in found]

    def slipping(self, speeds: Floats) -> list[tuple[str, Any]]:
        """What stays <= 0: it slips the way it is to, in sizes of speeds (d,)."""
        casadi, tree = loaded(), self.known.tree
        found = []
        for slip in self.slips:
            size = casadi.fabs(casadi.jacobian(slip, tree.v)) @ speeds
            found.append(("slips that way", -slip / size - _STILL))
        return found

    def sizes(self, q: Floats, speeds: Floats, span: float) -> Floats:
        """Of forces along rows (r,), as speeds of such size come about in a time [s]."""
        casadi, tree = loaded(), self.known.tree
        if not self.places:
            return np.zeros(0)
        told = casadi.Function(
            "sizes",
            [tree.t, tree.q],
            [self.rows, casadi.diag(self.rows @ tree.solved(self.rows.T))],
        )
        rows, gives = (np.abs(np.asarray(each, dtype=float)) for each in told(0.0, q))
        found = rows @ speeds / (span * gives.ravel())
        return np.where(found > 0.0, found, 1.0)


def _spans(motions: Sequence[Motion], sizes: Sizes) -> Floats:
    """How far states go in all of the phases, (n,)."""
    states = np.concatenate([motion.states for motion in motions])
    return np.asarray(np.maximum(np.ptp(states, axis=0), 1e-3 * sizes.states))


def _small(matrix: Any, right: Any) -> Any:
    """Of few rows, by QR in symbols."""
    return loaded().solve(matrix, right)


@dataclass(frozen=True)
class _Phase:
    mode: Mode
    problem: Problem
    jump: Any  # of (t, x, u) before it to x after, and what stays <= 0; None for the first
    closing: tuple[Any, ...]  # gaps, and slips of what sticks, that are 0 where it begins
    names: tuple[str, ...]  # of what stays <= 0


def hybrid(
    known: Symbolic, gaps: Sequence[Closing], problem: Problem, modes: Sequence[str],
    settings: tuple[int, float, int], guess: Mapping[str, Any],
) -> tuple[Transcribed, tuple[Floats, Floats]]:  # fmt: skip
    """The motion of least cost through contacts in a known order, and what really follows.

    Args:
        known: The bodies.
        gaps: What they may touch.
        problem: What is asked of the whole motion; its rate is that of flight, its path knows no
            gaps.
        modes: The order of contacts.
        settings: Intervals of each phase, largest defect (0: the mesh is kept), most iterations.
        guess: Values of controls to begin with.

    Raises:
        SceneError: A mode is not known, or the start is none of the first one.
    """
    check_events(known)  # they judge the order
    begun = time.perf_counter()
    search = _Search(known, gaps, problem, modes, settings, begin(problem, guess))
    found = search.refined()
    answer = found.answer
    message = answer.in_words
    if answer.status == "infeasible":
        message = (
            f"no motion was found with contacts in the order {show(list(modes))}; farthest off is "
            f"{answer.worst}: give another order, a longer duration, or wider bounds"
        )
    elif answer.status != "converged":
        message = (
            f"the search did not converge (Ipopt: {message}) in {answer.iterations} iterations; "
            "give other starts of controls, more nodes, or bounds"
        )
    motion, followed_, sizes = search.joined(found)
    told = Transcribed(
        problem, "hybrid", answer.status, message, answer.cost, answer.kkt, search.iterations,
        settings[1], tuple(search.rounds), time.perf_counter() - begun, motion, followed_, sizes,
    )  # fmt: skip
    return _resimulated(search, found, told)


@dataclass(frozen=True)
class _Found:
    answer: Answer
    motions: list[Motion]
    followed: list[Followed]


class _Search:
    def __init__(
        self, known: Symbolic, gaps: Sequence[Closing], problem: Problem, modes: Sequence[str],
        settings: tuple[int, float, int], guess: Guess,
    ) -> None:  # fmt: skip
        self.guess, self.sizes = guess, sizes_of(problem, guess)
        self.known, self.gaps, self.problem = known, gaps, problem
        self.nodes, self.refine, self.most = settings
        self.row = transcription_of(_ROW)
        self.iterations, self.rounds = 0, list[int]()
        casadi, tree = loaded(), known.tree
        self.given = [tree.t, casadi.vertcat(tree.q, tree.v), known.controls]
        gap = casadi.vertcat(casadi.SX(0, 1), *(each.gap for each in gaps))
        begun = [np.mean(problem.start.get(each.name, each.start)) for each in tree.freedoms]
        open_ = np.asarray(casadi.Function("gap", [tree.t, tree.q], [gap])(0, begun)).ravel()
        self.own = places_of(gaps, open_)
        self.modes = modes_of(modes, gaps, self.own)
        self._check_start(open_)
        self.phases = self._phases()

    def _check_start(self, open_: Floats) -> None:
        """Refuse a start whose gaps (J,) or speeds are not those of the first mode."""
        casadi, tree, mode = loaded(), self.known.tree, self.modes[0]
        start = {k: np.mean(v) for k, v in self.problem.start.items() if not np.ptp(v)}
        if set(self.problem.states) - set(start):
            return
        q, v = np.split(np.array([start[name] for name in self.problem.states]), 2)
        text = f"trajectory.modes[0] = {show(mode.name)}: "
        for k in sorted(mode.closed):
            if abs(open_[k]) > _CLOSED * max(np.abs(q).max(), 1e-300):
                raise SceneError(
                    f"{text}the gap of {self.gaps[k].name} is {open_[k]:.4g} m at the start; give "
                    '"flight" first, or a start where it is closed'
                )
        forces = Forces(self.known, self.gaps, mode.closed, mode.slips)
        told = casadi.Function("speeds", [tree.t, tree.q, tree.v], [forces.speeds])(0, q, v)
        speeds = np.asarray(told, dtype=float).ravel()
        if np.abs(speeds).max(initial=0.0) > _CLOSED * max(np.abs(v).max(), 1e-300):
            row = int(np.abs(speeds).argmax())
            does = "closes or opens" if row in forces.normal else "slips"
            raise SceneError(
                f"{text}a contact {does} with {abs(speeds[row]):.4g} m/s at the start; give "
                'velocities with which it does not, "flight" first, or "_slip" behind its name'
            )

    def _phases(self) -> list[_Phase]:
        casadi, tree, whole = loaded(), self.known.tree, self.problem
        t, x, u = self.given
        found: list[_Phase] = []
        at: Mode | None = None
        instant: Mode | None = None
        lasting = [mode for mode in self.modes if not mode.instant]
        low, high = whole.duration
        count, span = len(tree.freedoms), self.sizes.duration
        scale = self.guess.states(np.zeros(1))[0][:count], self.sizes.states[count:], span
        lengths = [self.size(gap) for gap in self.gaps]
        for mode in self.modes:
            if mode.instant:
                instant = mode
                continue
            forces = Forces(self.known, self.gaps, mode.closed, mode.slips)
            rate, push = forces.lasting()
            paths = [
                (f"{self.gaps[k].name} stays open in {mode.name}", -self.gaps[k].gap / lengths[k])
                for k in range(len(self.gaps)) if k not in mode.closed
            ] + [
                (f"{mode.name} {text}", each)
                for text, each in (*forces.pressed(push, forces.sizes(*scale)),
                                   *forces.slipping(scale[1]))
            ]  # fmt: skip
            own = casadi.Function(
                "path", self.given,
                [casadi.vertcat(whole.limited(t, x, u, casadi.SX(0, 1))
                                if whole.path is not None else casadi.SX(0, 1),
                                *(each for _, each in paths))],
            ) if paths or whole.path is not None else None  # fmt: skip
            first, last = mode is lasting[0], mode is lasting[-1]
            problem = replace(
                whole, dynamics=casadi.Function("rate", self.given, [casadi.vertcat(tree.v, rate)]),
                duration=(_SHORTEST * high, high) if len(lasting) > 1 else (low, high),
                start=whole.start if first else {}, end=self._end(forces) if last else {},
                start_rows=whole.start_rows if first else (),
                end_rows=whole.end_rows if last else (),
                final=whole.final if last else None, path=own,
                path_names=(*whole.path_names, *(text for text, _ in paths)),
            )  # fmt: skip
            jump, closing, names = None, list[Any](), tuple[str, ...]()
            if at is not None:
                closed = mode.closed if instant is None else mode.closed | instant.closed
                new = closed - at.closed
                struck = Forces(self.known, self.gaps, closed if new else frozenset(), mode.slips)
                v, impulse = struck.impact(instant is not None)
                pressed = struck.pressed(impulse, span * struck.sizes(*scale))
                jump = casadi.Function(
                    "jump", self.given,
                    [casadi.vertcat(tree.q, v),
                     casadi.vertcat(casadi.SX(0, 1), *(each for _, each in pressed))],
                )  # fmt: skip
                names = tuple(f"the impact of {_told(self.own, new)} {w}" for w, _ in pressed)
                closing = [
                    casadi.Function("gap", self.given, [self.gaps[k].gap / lengths[k]]) for k in new
                ]
                # What sticks from now on has come to rest; one tangent of a face says it.
                rests = {
                    self.gaps[k].name: self.gaps[k].slip
                    for k in sorted(set(at.slips) & (mode.closed - set(mode.slips))) if not new
                }  # fmt: skip
                closing += [
                    casadi.Function("slip", self.given, [slip / self._speed(slip)])
                    for slip in rests.values()
                ]
            found.append(_Phase(mode, problem, jump, tuple(closing), names))
            at, instant = mode, None
        return found

    def refined(self) -> _Found:
        guess, sizes, count = self.guess, self.sizes, len(self.phases)
        meshes = [np.linspace(0.0, 1.0, self.nodes + 1)] * count
        guesses = [_part(guess, k, count) for k in range(count)]
        found = self.solved(meshes, guesses, sizes, cost_size(self.problem, guess, sizes))
        for _ in range(_ROUNDS if self.refine else 0):
            spans = _spans(found.motions, sizes)
            defects = [np.abs(each.defects / spans).max(axis=1) for each in found.followed]
            if found.answer.status != "converged" or max(d.max() for d in defects) <= self.refine:
                break
            meshes = [
                cut(mesh, own, self.refine, self.row.order)
                for mesh, own in zip(meshes, defects, strict=True)
            ]  # fmt: skip
            size = abs(found.answer.cost) or 1.0
            finer = self.solved(meshes, [Guess.of(m) for m in found.motions], sizes, size)
            if finer.answer.status != "converged":
                break
            found = finer
        return found

    def solved(
        self, meshes: list[Floats], guesses: list[Guess], sizes: Sizes, size: float
    ) -> _Found:
        for _ in range(3):
            answer, motions = self._solved(meshes, guesses, sizes, size)
            share = abs(answer.cost) / size
            if answer.status != "converged" or not share > 1e-9 or 1e-2 < share < 1e3:
                break
            size, guesses = abs(answer.cost), [Guess.of(motion) for motion in motions]
        self.rounds.append(sum(len(mesh) - 1 for mesh in meshes))
        spans = _spans(motions, sizes)
        along = [
            followed(phase.problem, motion, spans)
            for phase, motion in zip(self.phases, motions, strict=True)
        ]
        return _Found(answer, motions, along)

    def _solved(
        self, meshes: list[Floats], guesses: list[Guess], sizes: Sizes, size: float
    ) -> tuple[Answer, list[Motion]]:
        program = Program()
        begun: Any = 0.0
        stretches = list[Stretch]()
        for phase, mesh, guess in zip(self.phases, meshes, guesses, strict=True):
            stretch = Stretch(program, phase.problem, self.row, mesh, guess, sizes, begun=begun)
            if stretches:
                self._link(program, phase, stretches[-1], stretch)
            stretches.append(stretch)
            begun = begun + stretch.duration
        if len(stretches) > 1:
            low, high = (each / sizes.duration for each in self.problem.duration)
            program.row(begun / sizes.duration, low, high, lambda _: "the duration")
        answer = program.solve(size, self.most)
        self.iterations += answer.iterations
        return answer, [stretch.motion(answer) for stretch in stretches]

    def _link(self, program: Program, phase: _Phase, before: Stretch, after: Stretch) -> None:
        """What one phase leaves to the next, through an impact."""
        end = before.rights[-1]
        for gap in phase.closing:
            program.row(
                gap(end.t, end.x, end.u), 0.0, 0.0,
                lambda _: f"what closes or comes to rest before {phase.mode.name}",
            )  # fmt: skip
        state, pressed = phase.jump(end.t, end.x, end.u)
        names = list(self.problem.states)
        program.row(
            (after.lefts[0].x - state) / self.sizes.states, 0.0, 0.0,
            lambda i: f"{names[i]} into {phase.mode.name}",
        )  # fmt: skip
        program.row(pressed, -np.inf, 0.0, partial(_name, phase.names))

    def _end(self, forces: Forces) -> dict[str, Any]:
        """What is asked at the end, without what closed gaps hold anyhow: no row is said twice."""
        casadi, tree, end = loaded(), self.known.tree, dict(self.problem.end)
        names, count = list(self.problem.states), len(tree.freedoms)
        at = self.guess.states(np.ones(1))[0][:count]
        held = np.asarray(casadi.Function("rows", [tree.t, tree.q], [forces.rows])(0.0, at))
        # What has not stuck from the start on holds no place that is known.
        stuck = len({(mode.closed, *mode.slips.items()) for mode in self.modes}) == 1
        for begin_ in (0, count):
            rows = held if begin_ or stuck else held[forces.normal]
            for k in range(count):
                name = names[begin_ + k]
                if name not in end or np.ptp(np.atleast_1d(end[name])) > 0.0:
                    continue
                more = np.vstack([rows, np.eye(count)[k]])
                if np.linalg.matrix_rank(more) > np.linalg.matrix_rank(rows):
                    rows = more
                else:
                    del end[name]
        return end

    def size(self, gap: Closing) -> float:
        """Of a gap, by those of coordinates."""
        casadi, tree = loaded(), self.known.tree
        count = len(tree.freedoms)
        slopes = casadi.Function("slopes", [tree.t, tree.q], [casadi.jacobian(gap.gap, tree.q)])
        told = slopes(0.0, self.guess.states(np.zeros(1))[0][:count])
        found = float(np.abs(np.asarray(told, dtype=float)).ravel() @ self.sizes.states[:count])
        return found if found > 0.0 else 1.0

    def _speed(self, slip: Any) -> Any:
        """Of a slip, by sizes of rates."""
        casadi, tree = loaded(), self.known.tree
        return casadi.fabs(casadi.jacobian(slip, tree.v)) @ self.sizes.states[len(tree.freedoms) :]

    def joined(self, found: _Found) -> tuple[Motion, Followed, Floats]:
        """One motion, whose states where phases meet are those before impacts."""
        lengths = np.array([motion.duration for motion in found.motions])
        ends = np.concatenate([[0.0], np.cumsum(lengths)])
        total = float(ends[-1])
        shares = [
            (begin + motion.times) / total
            for begin, motion in zip(ends[:-1], found.motions, strict=True)
        ]
        shares[-1][-1] = 1.0
        first, *rest = found.motions
        states = np.concatenate([first.states, *(motion.states[1:] for motion in rest)])
        motion = Motion(
            np.concatenate([shares[0], *(share[1:] for share in shares[1:])]), total, states,
            np.concatenate([m.rates for m in found.motions]),
            np.concatenate([m.controls for m in found.motions]), first.parameters,
            None if first.middles is None
            else np.concatenate([np.asarray(m.middles) for m in found.motions]),
        )  # fmt: skip
        along = Followed(
            states, sum(each.cost for each in found.followed),
            np.concatenate([each.defects for each in found.followed]),
        )  # fmt: skip
        self.ends = ends
        return motion, along, _spans(found.motions, self.sizes)


def _in_row(order: Sequence[str]) -> str:
    """An order for messages."""
    return " > ".join(order[:_NAMED]) + " > ..." * (len(order) > _NAMED)


def _name(names: Sequence[str], row: int) -> str:
    return names[row]


def _told(
    own: Mapping[str, set[int]], closed: frozenset[int] | set[int],
    slips: Mapping[int, int] = MappingProxyType({}),
) -> str:  # fmt: skip
    """Closed gaps as `modes` name them: contacts, or single gaps of these, and how they slip."""
    ending = {way: each for each, way in _SLIPS.items()} | {0: ""}
    names, left = list[str](), set(closed)
    for name, places in own.items():  # contacts come before their single gaps
        ways = {slips.get(k, 0) for k in places}
        if places <= left and len(ways) == 1:
            names.append(name + ending[ways.pop()])
            left -= places
    return "+".join(names) or FLIGHT


def _part(guess: Guess, k: int, count: int) -> Guess:
    """A phase of as many, equally long."""

    def at(shares: Floats) -> Floats:
        return (k + shares) / count

    return replace(
        guess, duration=guess.duration / count, states=lambda s: guess.states(at(s)),
        controls=lambda s: guess.controls(at(s)),
    )  # fmt: skip


def _resimulated(
    search: _Search, found: _Found, told: Transcribed
) -> tuple[Transcribed, tuple[Floats, Floats]]:
    """What really follows, and whether contacts close and open as they were to."""
    pieces = 10
    times, record = recorded(search.known, search.gaps, told, pieces)
    asked = [_told(search.own, mode.closed, mode.slips) for mode in search.modes]
    spans = iter(found.motions)
    lasts = [0.0 if mode.instant else float(next(spans).duration) for mode in search.modes]
    lengths = {"modes": asked, "lasts": lasts}
    if record is None:
        lost = np.full((len(times), told.at_nodes.shape[1]), np.nan)
        return replace(told, more=lengths), (times, lost)
    states = np.concatenate([record.position, record.velocity], axis=1)
    nodes = states[::pieces].copy()
    # Where contacts change rates jump: what is just before on one side is just after on the other.
    for end in search.ends[1:-1]:
        nearest = int(np.abs(told.times - end).argmin())
        nodes[nearest] = told.at_nodes[nearest]
    casadi, tree = loaded(), search.known.tree
    gap = casadi.Function("gap", [tree.t, tree.q], [casadi.vertcat(*(g.gap for g in search.gaps))])
    away = np.array([
        np.asarray(gap(t, q), dtype=float).ravel()
        for t, q in zip(times, record.position, strict=True)
    ])  # fmt: skip
    near = away < _TOUCHES * np.array([search.size(each) for each in search.gaps])
    order = order_of(record.legs or [], times, search.gaps, search.own, near)
    wrong: tuple[str, ...] = ()
    if order != asked and told.status == "converged":
        text = "contacts close and open in another order than modes say: "
        text += f"{_in_row(order)} instead of {_in_row(asked)}; give that order, more nodes, "
        wrong = (f"{text}or a guess nearer to what is asked",)
    told = replace(told, wrong=wrong, more=lengths | {"true_order": order})
    return told.with_followed("event_driven", nodes), (times, states)


def order_of(
    legs: Sequence[Leg], times: Floats, gaps: Sequence[Closing], own: Mapping[str, set[int]],
    near: NDArray[np.bool_],
) -> list[str]:  # fmt: skip
    """The order in which contacts close, slip and open in a run from event to event.

    Args:
        legs: Its flights.
        times: Of rows (k,).
        gaps: Contacts (J,).
        own: Their names.
        near: Whether they are closed or all but closed at rows (k, J): without force they may
            part by rounding.
    """
    order: list[str] = []
    ends = [*(leg.event.time for leg in legs[1:]), float(times[-1])]
    held = frozenset[int]()
    for leg, end in zip(legs, ends, strict=True):
        before, inside = held, (leg.event.time < times) & (times < end)
        still = np.flatnonzero(near[inside].all(axis=0)).tolist() if inside.any() else []
        held = frozenset([*leg.closed, *still])
        struck = {j for each in leg.event.strikes for j in each.rows if gaps[j].restitution}
        if bounced := struck - before - held:
            order.append(_told(own, bounced))
        elif end - leg.event.time < _BRIEF * times[-1]:
            continue
        ways = dict(zip(leg.closed, leg.modes, strict=False))
        # One corner of a face that sticks holds them all.
        stuck = {gaps[j].name for j, way in ways.items() if way == 0}
        slips = {j: way or 0 for j, way in ways.items()
                 if gaps[j].friction and gaps[j].name not in stuck}  # fmt: skip
        name = _told(own, held, slips)
        if not order or order[-1] != name:
            order.append(name)
    return order
