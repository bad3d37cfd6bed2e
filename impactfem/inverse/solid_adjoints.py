"""Derivatives of a run of solids by its steps backwards: one sweep for each number.

Whatever varies of loads, starts and places of obstacles costs no more: the sweep tells derivatives
by forces of layers, by displacements and velocities at t = 0 and by gaps, which are then held
against how these change from scene to scene (`impactfem.inverse.local_slopes`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from impactfem.arrays import Booleans, Floats
from impactfem.errors import SceneError
from impactfem.fem import MPI
from impactfem.inverse.contact_spells import Pair, rebound_row
from impactfem.inverse.local_slopes import Local, slopes
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.steps import Changes
from impactfem.marching.collect import total
from impactfem.marching.reversed_march import Given, Reading, ReversedMarch, Trail
from impactfem.marching.rows import Level
from impactfem.marching.solids import SolidMarch
from impactfem.scene import Scene, Term
from impactfem.system.loads import Loads
from impactfem.system.matrices import body_forms

if TYPE_CHECKING:
    from impactfem.inverse.solids import SolidRuns
    from impactfem.runs.solids import Ready

_AXES = "xyz"
_LOADS = ("tractions", "pressures")
_STARTS = ("velocity", "angular_velocity", "displacement")

type Part = Callable[[int, float], None]
"""Adds what a number reads at a level, with a weight."""


def reversible(ready: "Ready") -> bool:
    """Whether a march is known backwards."""
    march, seen, model = ready.seen.march, ready.seen, ready.seen.model
    plain = seen.feedback is None and seen.loop.started is None
    # Bodies without a mesh of their own: one plate alone.
    plain = plain and len(model.few) + min(len(model.parts), 1) == 1
    return plain and isinstance(march, SolidMarch) and march.reversible


@dataclass
class Kept:
    """What a march keeps for its derivatives; an observer.

    Attributes:
        trail: Of its gaps.
        times: At which its energies may be asked for [s].
        states: Displacements and velocities of the levels beside these.
    """

    trail: Trail
    times: Floats
    states: dict[int, tuple[Floats, Floats]] = field(default_factory=dict)

    def __call__(self, level: Level) -> None:
        """Keep a level."""
        self.trail(level)
        dt = self.trail.march.interior.dt
        if (np.abs(self.times - level.time) < 2.001 * dt).any():
            self.states[level.layer] = self.seen(level)

    def seen(self, level: Level) -> tuple[Floats, Floats]:
        """Displacements and velocities of a level."""
        return level.displacement.copy(), level.velocity.copy()


@dataclass(frozen=True)
class Weights:
    """Derivatives of all numbers by what changes from scene to scene.

    Attributes:
        place, velocity: By displacements and velocities at t = 0, (numbers, owned dofs).
        loads: By forces on the dofs that loads reach, (numbers, layers, reached dofs).
        gap: By gaps at each level without displacements, (numbers, levels, gaps).
    """

    place: Floats
    velocity: Floats
    loads: Floats
    gap: Floats


@dataclass(frozen=True)
class Start:
    """What a scene begins with.

    Attributes:
        place, velocity: Displacements and velocities of owned dofs.
        gap: At the levels without displacements, (levels or 1, gaps).
        normals: Of the gaps, (gaps, dim).
    """

    place: Floats
    velocity: Floats
    gap: Floats
    normals: Floats

    @classmethod
    def of(cls, ready: "Ready") -> "Start":
        """Of a march that is ready to run."""
        march, parts = ready.seen.march, ready.seen.model.parts
        gaps, still = march.gaps, np.zeros_like(march.interior.surface_displacement)
        levels = range(march.layers + 1 if gaps.moves else 1)
        each = [gaps.at(still, still, still, k * march.interior.dt) for k in levels]
        return cls(
            np.concatenate([np.zeros(0), *(part.system.displacement for part in parts)]),
            np.concatenate([np.zeros(0), *(part.system.velocity for part in parts)]),
            np.array([gap for gap, _ in each]), each[0][1],
        )  # fmt: skip


class Adjoints:
    """Derivatives of the numbers of a run.

    Args:
        runs: Who ran it.
        changes: The place, and the sizes of steps.
        quantities: The numbers.
        ready: The march that has ended.
        kept: What it has kept.
        pairs: What its pairs did, by name.
    """

    def __init__(
        self, runs: "SolidRuns", changes: Changes, quantities: Quantities, ready: "Ready",
        kept: Kept, pairs: Mapping[str, "Pair"],
    ) -> None:  # fmt: skip
        self._runs, self._changes, self._ready = runs, changes, ready
        self._quantities = quantities
        self._numbers = self._numbers_of(changes.scene, quantities, ready, kept, pairs)
        self._march, self._reversed = kept.trail.march, ReversedMarch(kept.trail)
        self._scene, self._start = changes.scene, self._start_of(ready)
        seen = ready.seen
        self._comm, self._parts = seen.model.comm, seen.model.parts
        sizes = [len(part.system.constrained) for part in self._parts]
        self._own = [slice(*ends) for ends in pairwise(np.cumsum([0, *sizes]).tolist())]
        reached = [p.system.loads.reached & ~p.system.constrained for p in self._parts]
        self._reached = np.concatenate([np.zeros(0, dtype=bool), *reached])

    def jacobian(self) -> tuple[Floats, Booleans] | None:
        """Derivatives of all numbers (n, P), and of which unknowns they are; None: not known."""
        read = self._numbers.read()
        if read is None:
            return None
        weights = self._weights([self._given(each) for each in read])
        by, known = slopes(self._changes, partial(self._arrays, weights))
        count, layers = weights.loads.shape[:2]
        number = np.concatenate([np.arange(count).repeat(layers), *(np.arange(count),) * 2])
        sums = csr_array((np.ones(len(number)), (number, np.arange(len(number)))))
        found = np.asarray((sums @ by).toarray())
        self._quantities.add_efforts(found, self._scene)
        return found, known

    @cached_property
    def _forces(self) -> Floats:
        return self._loads(self._scene)

    def _given(self, read: "Number") -> Given:
        def add(level: int, reading: Reading) -> None:
            for part in read.get(level, ()):
                part(reading)

        found = self._reversed.given(max(read, default=0), add)
        moved = [self._carried(load) for load in found.loads]
        return found._replace(loads=np.array(moved).reshape(len(moved), -1))

    def _carried(self, load: Floats) -> Floats:
        """By forces on nodes that loads reach, of which massless ones pass theirs on."""
        found = load.copy()
        for own, transfer in zip(self._own, self._ready.transfers, strict=True):
            if transfer is not None:
                given, passed = transfer.createVecs()
                given.setArray(load[own])
                transfer.mult(given, passed)
                found[own] = passed.getArray()
                given.destroy()
                passed.destroy()
        return np.asarray(found[self._reached])

    def _weights(self, each: Sequence[Given]) -> Weights:
        march = self._march
        # Of explicit layers the rate is the step that the velocity makes.
        unit = march.interior.dt if march.skips else 1.0
        levels = np.zeros((len(each), march.layers + 1, len(self._start.normals)))
        for own, given in zip(levels, each, strict=True):
            own[: len(given.gap)] = given.gap
        return Weights(
            np.array([given.place for given in each]),
            unit * np.array([given.rate for given in each]),
            np.array([given.loads for given in each]), levels,
        )  # fmt: skip

    def _arrays(self, weights: Weights, scene: Scene) -> Sequence[Local]:
        """What a scene gives, times the derivatives by it.

        Raises:
            SceneError: It changes more than loads, starts and places of obstacles.
        """
        starts, start = self._alike(scene), self._start
        bodies = list(zip(scene.bodies, self._scene.bodies, strict=True))
        if starts:
            ready = self._runs.ready(scene)
            try:
                start = self._start_of(ready)
            finally:
                ready.destroy()
        if not np.array_equal(start.normals, self._start.normals):
            raise SceneError("its obstacles face another way")
        forces = self._forces
        each = ((getattr(a, name, ()), getattr(b, name, ())) for a, b in bodies for name in _LOADS)
        if any(one != other for one, other in each):
            forces = self._loads(scene)
        dt, layers = self._march.interior.dt, np.arange(weights.loads.shape[1], dtype=np.float64)
        begin, end = self._spans(dt * layers)
        began = weights.place @ start.place + weights.velocity @ start.velocity
        pushed = np.einsum("nkd,kd->nk", weights.loads, forces)
        pushed, began = map(self._summed, (pushed, began))
        met = np.einsum("nkg,kg->n", weights.gap, np.broadcast_to(start.gap, weights.gap.shape[1:]))
        # Of each number by itself: what rounds in one may be all of another.
        found = [Local(own, {"t": (begin, end)}) for own in pushed]
        return [*found, *(Local(own, {}) for own in np.concatenate([began, met])[:, None])]

    def _summed(self, values: Floats) -> Floats:
        """Over all ranks."""
        return np.asarray(self._comm.allreduce(np.ascontiguousarray(values)))

    def _start_of(self, ready: "Ready") -> Start:
        return Start.of(ready)

    def _numbers_of(self, *given: Any) -> "Numbers":
        return Numbers(*given)

    def _spans(self, begin: Floats) -> tuple[Floats, Floats]:
        """Times whose mean acts in layers that begin at some times [s]."""
        march = self._march
        if march.skips:
            half = 0.5 * march.interior.dt
            return np.maximum(begin - half, 0.0), begin + half
        return begin, begin + march.interior.dt

    def _loads(self, scene: Scene) -> Floats:
        """Forces on the dofs that loads reach, in all layers [N], (layers, reached dofs)."""
        march, found = self._march, []
        begin, end = self._spans(march.interior.dt * np.arange(march.layers, dtype=np.float64))
        for part, solid, own in zip(self._parts, scene.solids, self._own, strict=True):
            nodes, reached = part.system.nodes, self._reached[own]
            forms = body_forms(nodes, solid)
            loads = Loads(nodes, forms, part.mesh.surfaces, solid, scene.vector_gravity)
            more = loads.reached & ~part.system.constrained & ~reached
            if self._comm.allreduce(bool(more.any()), op=MPI.LOR):
                raise SceneError("its loads reach other places")
            found.append(loads.means(begin, end, reached))
            loads.destroy()
        return np.hstack(found)

    def _alike(self, scene: Scene) -> bool:
        """Whether a scene sets out or meets obstacles in another way.

        Raises:
            SceneError: It differs in more than that and loads.
        """
        moved = begun = scene.obstacles != self._scene.obstacles
        for solid, other in zip(scene.solids, self._scene.solids, strict=True):
            for entry in fields(solid):
                if entry.name in _LOADS or not entry.init:
                    continue
                if getattr(solid, entry.name) == getattr(other, entry.name):
                    continue
                if entry.name not in _STARTS:
                    raise SceneError(f"{entry.name} is another")
                begun, moved = True, moved or entry.name == "displacement"
        self._check_beside(scene, moved=moved)
        return bool(begun)

    def _check_beside(self, scene: Scene, *, moved: bool) -> None:
        """Refuse what changes in a scene besides its bodies.

        Args:
            scene: The scene.
            moved: Whether what is pulled by gravity begins elsewhere.

        Raises:
            SceneError: It is more than obstacles.
        """
        same = scene.contacts == self._scene.contacts
        same = same and scene.gravity == self._scene.gravity
        if not same or scene.duration != self._scene.duration:
            raise SceneError("it is another in more than loads and starts")
        if moved and self._numbers.levels:
            raise SceneError("its potential begins elsewhere")


type Number = dict[int, list[Callable[[Reading], None]]]
"""What a number reads: by the level what adds it."""


class Numbers:
    """What the numbers of a run read; arguments as of `Adjoints`.

    Attributes:
        levels: Whether one counts the potential of gravity.
    """

    def __init__(
        self, scene: Scene, quantities: Quantities, ready: "Ready", kept: Kept,
        pairs: Mapping[str, "Pair"],
    ) -> None:  # fmt: skip
        self._scene, self._quantities, self._ready = scene, quantities, ready
        self._kept, self._pairs = kept, pairs
        self._now: Number = {}
        self._whole, self._march = ready.seen.whole, kept.trail.march
        self._dt, self._layers = self._march.interior.dt, self._march.layers
        interior = self._march.interior
        self._inner: Sequence[Any] = getattr(interior, "parts", (interior,))
        sizes = [part.dofs for part in self._inner]
        self._own = [slice(*ends) for ends in pairwise(np.cumsum([0, *sizes]).tolist())]
        self._sums = [part.sums_by() for part in self._inner]
        self._names = list(ready.seen.model.names)
        self.levels = False
        columns = self._march.gaps.pair_of()
        self._of_pair = {name: columns == k for k, name in enumerate(self._march.gaps.pairs)}
        masses = (mass for mass, _ in ready.seen.model.masses.values())
        self._masses = dict(zip(self._names, masses, strict=True))

    def read(self) -> list[Number] | None:
        """What each number reads, in their order; None: of one it is not known."""
        quantities, found = self._quantities, list[Any]()
        for measure, data in zip(quantities.scene.measures, quantities.data, strict=True):
            for time in data.times.tolist():
                self._now = {}
                if not self._measure(measure.of, time):
                    return None
                found.append(self._now)
        for term in quantities.all_terms:
            self._now = {}
            if not self._term(term, quantities.at(term)):
                return None
            found.append(self._now)
        return found

    def _put(self, level: int, add: Callable[[Reading], None]) -> None:
        self._now.setdefault(level, []).append(add)

    def _measure(self, of: str, time: float) -> bool:
        kind, _, name = of.partition(".")
        if kind == "rebound_speed" and name in self._names:
            body = self._names.index(name)
            self._speed(body, rebound_row(name, self._scene, self._pairs, self._layers), 1.0)
            return True
        if kind == "duration" and name in self._pairs:
            return self._duration(name)
        if kind == "impulse" and name in self._pairs:
            return self._over(partial(self._impulse, name), time)
        part = self._column(of)
        return part is not None and self._over(part, time)

    def _term(self, term: Term, time: float) -> bool:
        body = self._names.index(term.body) if term.body in self._names else None
        match term.term:
            case "value" | "misfit" | "effort" | "mass":
                return True
            case "speed" if body is not None:
                velocity = self._velocity(body, time)
                return self._along(body, time, _direction(velocity))
            case "terminal_energy" | "vibration_energy":
                return self._energies(time) and self._rest(term.term, time)
            case "peak_force" if term.pair in self._pairs:
                row = int(self._pairs[str(term.pair)].force.argmax())
                self._force(str(term.pair), row, 1.0)
                return True
        return False

    def _rest(self, term: str, time: float) -> bool:
        """What an energy counts besides those of motion and strain."""
        if term == "vibration_energy":
            for body, name in enumerate(self._names):
                mass = self._whole.factor * self._masses[name]
                self._along(body, time, -mass * self._velocity(body, time))
            return True
        gravity = self._ready.seen.model.scene.vector_gravity
        if not gravity.is_constant or self._march.gaps.moves:
            return False
        pull = np.asarray(gravity.at(0.0))
        self.levels = bool(pull.any())
        for body, name in enumerate(self._names):
            mass = self._whole.factor * self._masses[name]
            for axis, g in enumerate(pull):
                self._over(partial(self._centre, 0, body, axis), time, -mass * g)
        return True

    def _over(self, part: Part, time: float, weight: float = 1.0) -> bool:
        """What is linear between levels, at a time [s]."""
        place = min(time / self._dt, float(self._layers))
        level = min(int(place), self._layers - 1)
        for each, share in ((level, level + 1.0 - place), (level + 1, place - level)):
            if share:
                part(each, weight * share)
        return True

    def _column(self, name: str) -> Part | None:
        """What a column of the history reads."""
        body, _, of = name.rpartition(".")
        if body in self._names and of in {"x", "y", "z", "vx", "vy", "vz"}:
            at, axis = self._names.index(body), _AXES.index(of[-1])
            return partial(self._centre, len(of) - 1, at, axis)
        kind, _, pair = name.partition(".")
        if kind == "force" and pair in self._pairs:
            return partial(self._force, pair)
        if kind == "gap" and pair in self._pairs:
            return partial(self._gap, pair)
        if name == "contact_force":
            return partial(self._force, None)
        if name in {"kinetic_energy", "elastic_energy"}:
            return partial(self._energy, name.partition("_")[0])
        return self._probe(*name.rpartition(".")[::2])

    def _probe(self, name: str, of: str) -> Part | None:
        """What a column of a probe reads: displacement, stress, velocity, acceleration."""
        probes = self._ready.seen.probes
        if name in probes.laws:
            return None
        if of in {"ax", "ay", "az"} and (part := self._probe(name, f"v{of[1]}")) is not None:
            filters = {probe.name: probe.filter for probe in self._scene.probes}
            return None if filters[name] else partial(self._change, part)
        known = probes.names[: probes.weights.shape[0]]
        if (name, of) not in known:
            return None
        row = probes.weights[[known.index((name, of))]].toarray()[0]
        cuts = np.cumsum([len(each) for each in probes.needed])
        moved, moving = np.zeros((2, self._own[-1].stop))
        np.add.at(moved, probes.needed[0], row[: cuts[0]])
        np.add.at(moving, probes.needed[1], row[cuts[0] : cuts[1]])
        np.add.at(moved, probes.needed[2], row[cuts[1] :])
        return partial(self._nodes, moved, moving)

    def _change(self, part: Part, row: int, weight: float) -> None:
        """What a part changes by in the step before a row, as a rate."""
        row = max(row, 1)
        part(row, weight / self._dt)
        part(row - 1, -weight / self._dt)

    def _nodes(self, moved: Floats, moving: Floats, level: int, weight: float) -> None:
        """Displacements and velocities of nodes, by weights of all owned dofs, (dofs,) each.

        Contact nodes go from where they are in equilibrium to where they are so at the next level.
        """
        place, contact, multiplier = self._pressed(weight * moved)
        rate, going = weight * moving, self._gathered(weight / self._dt * moving)
        if self._march.skips:
            rate = rate / self._dt

        def add(reading: Reading) -> None:
            reading.place += place
            reading.rate += rate
            reading.contact += contact
            reading.multiplier += multiplier

        self._put(level, add)
        if level and self._going(moving):
            self._put(level, lambda r: _add(r.contact, going))
            self._put(level - 1, lambda r: _add(r.contact, -going))

    def _going(self, moving: Floats) -> bool:
        return bool(self._gathered(np.abs(moving)).any())

    def _gathered(self, values: Floats) -> Floats:
        """Of owned dofs those of contact nodes, (count, dim) (collective)."""
        surfaces = (self._ready.seen.model.surface(k) for k in range(len(self._inner)))
        each = zip(surfaces, self._own, strict=True)
        return np.concatenate([surface.gather(values[own]) for surface, own in each])

    def _pressed(self, place: Floats) -> tuple[Floats, Floats, Floats]:
        """Of derivatives by displacements, contact included, those by its parts (collective).

        Returns:
            By owned dofs, by contact nodes in equilibrium, by the multipliers that press these.
        """
        return place, *self._pressed_by(self._gathered(place))

    def _centre(self, order: int, body: int, axis: int, level: int, weight: float) -> None:
        """Place (0) or velocity (1) of the centre of a body."""
        if not self._fixed(body, axis):
            row = self._sums[body][order][axis] / self._masses[self._names[body]]
            own = self._own[body]
            self._put(level, lambda r: _add((r.place, r.rate)[order][own], weight * row))

    def _fixed(self, body: int, axis: int) -> bool:
        """Whether symmetry holds the centre of a body along an axis."""
        revolved = self._ready.seen.model.parts[body].system.axisymmetric and axis == 0
        dim = self._ready.seen.model.dim
        return revolved or axis in self._whole.levels or axis >= dim

    def _velocity(self, body: int, time: float) -> Floats:
        """Of the centre of a body, linear between levels [m/s], (dim,)."""
        rows = self._history[:, body, 3 : 3 + self._ready.seen.model.dim]
        levels = self._dt * np.arange(len(rows))
        found = np.array([np.interp(time, levels, row) for row in rows.T])
        found[[self._fixed(body, axis) for axis in range(len(found))]] = 0.0
        return found / self._masses[self._names[body]]

    @cached_property
    def _history(self) -> Floats:
        return total(self._ready.seen.model.comm, self._march.rows.sums)

    def _along(self, body: int, time: float, way: Floats) -> bool:
        for axis, share in enumerate(way.tolist()):
            self._over(partial(self._centre, 1, body, axis), time, share)
        return True

    def _speed(self, body: int, level: int, weight: float) -> None:
        velocity = self._velocity(body, level * self._dt)
        for axis, share in enumerate(_direction(velocity).tolist()):
            self._centre(1, body, axis, level, weight * share)

    def _force(self, pair: str | None, row: int, weight: float) -> None:
        """Of a pair in a row of the history, of all pairs if None."""
        own = np.ones(1, dtype=bool) if pair is None else self._of_pair[pair]
        weight *= self._whole.factor
        if self._march.skips and 0 < row < self._layers:
            # What acts at a level is told of the layers beside it.
            for level in (row, row + 1):
                self._put(level, lambda r: _add(r.force, 0.5 * weight * own))
        elif row:
            self._put(row, lambda r: _add(r.force, weight * own))

    def _impulse(self, pair: str, row: int, weight: float) -> None:
        for each in range(1, row + 1):
            self._force(pair, each, weight * self._dt)

    def _gap(self, pair: str, level: int, weight: float) -> None:
        """Least one of a pair."""
        gap = np.where(self._of_pair[pair], self._kept.trail.gap[level], np.inf)
        nearest = int(gap.argmin())
        if self._kept.trail.multiplier[level, nearest] > 0.0:
            return  # shut

        def add(reading: Reading) -> None:
            reading.gap[nearest] += weight

        self._put(level, add)

    def _duration(self, pair: str) -> bool:
        met = self._pairs[pair]
        for (first, last), (begin, end) in zip(met.spells, met.times.tolist(), strict=True):
            for level, time, way in ((first, begin, -1), (last, end, 1)):
                near, far = level + way, level + 2 * way
                inside = min(near, far) >= 0 and max(near, far) <= self._layers
                whole = (time - level * self._dt) / (way * self._dt)
                if not inside or not 1e-12 < whole < 1.0 - 1e-12:
                    continue
                a, b = met.gap[near], met.gap[far]
                # t = near - way dt a / (b - a), counted along the way.
                self._gap(pair, near, -self._dt * b / (b - a) ** 2)
                self._gap(pair, far, self._dt * a / (b - a) ** 2)
        return True

    def _energies(self, time: float) -> bool:
        return all(self._over(partial(self._energy, kind), time) for kind in ("kinetic", "elastic"))

    def _energy(self, kind: str, level: int, weight: float) -> None:
        pulled, momentum = self._energies_by(*self._kept.states[level])
        weight *= self._whole.factor
        if kind == "kinetic":
            unit = self._dt if self._march.skips else 1.0
            self._put(level, lambda r: _add(r.rate, weight / unit * momentum))
        elif self._march.skips:
            self._amid(level, weight, pulled)
        else:
            self._strain(level, *self._pressed(weight * pulled))

    def _energies_by(self, placed: Floats, velocity: Floats) -> tuple[Floats, Floats]:
        """Elastic energy by displacements, kinetic energy by velocities, of all bodies."""
        each = [
            part.energies_by(placed[own], velocity[own])
            for part, own in zip(self._inner, self._own, strict=True)
        ]
        pulled, momentum = map(np.concatenate, zip(*each, strict=True))
        return pulled, momentum

    def _strain(self, level: int, place: Floats, contact: Floats, multiplier: Floats) -> None:
        def add(reading: Reading) -> None:
            reading.place += place
            reading.contact += contact
            reading.multiplier += multiplier

        self._put(level, add)

    def _amid(self, level: int, weight: float, pulled: Floats) -> None:
        """Elastic energy of an explicit layer, u_a . K u_b / 2 and half of that of both contacts.

        Args:
            level: At its end.
            weight: Of the energy.
            pulled: K u_b.
        """
        before, none = max(level - 1, 0), np.zeros_like(self._march.interior.surface_displacement)
        pressing = self._kept.trail.multiplier
        for each in (level, before):
            nodes = self._march.gaps.spread(pressing[each][:, None] * self._march.normals)
            *_, strained = self._pressed_by(nodes)
            self._strain(each, np.zeros_like(pulled), none, 0.5 * weight * strained)
        if not level:
            self._strain(0, weight * pulled, none, np.zeros(pressing.shape[1]))
            return
        placed, velocity = self._kept.states[before]
        lags = np.concatenate(
            [
                np.full(own.stop - own.start, part.lag if before else 0.0)
                for part, own in zip(self._inner, self._own, strict=True)
            ]
        )
        ahead, _ = self._energies_by(placed + lags * self._dt * velocity, velocity)
        still = np.zeros(pressing.shape[1])
        self._strain(level, 0.5 * weight * ahead, none, still)
        self._strain(before, 0.5 * weight * pulled, none, still)
        self._put(before, lambda r: _add(r.rate, 0.5 * weight * lags * pulled))

    def _pressed_by(self, nodes: Floats) -> tuple[Floats, Floats]:
        """By contact nodes (count, dim), and by the multipliers that press these (gaps,)."""
        march = self._march
        pressed = march.gaps.relative(march.interior.static(nodes))
        return nodes, np.einsum("ij,ij->i", march.normals, pressed)


def _add(to: Floats, more: Floats) -> None:
    to += more


def _direction(velocity: Floats) -> Floats:
    """Of a velocity; 0 at rest, where a speed has a kink, which the check of slopes sees."""
    speed = float(np.linalg.norm(velocity))
    return velocity / speed if speed > 0.0 else np.zeros_like(velocity)
