"""What the numbers of a run of solids read of its steps, for the way back through these."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.inverse.contact_spells import Pair, rebound_row
from impactfem.inverse.outcomes import amid
from impactfem.inverse.quantities import Quantities
from impactfem.marching.collect import total
from impactfem.marching.reversed_march import Reading, Trail, shares_of
from impactfem.marching.rows import Level
from impactfem.scene import Scene, Term
from impactfem.system.relaxation import kept_of

if TYPE_CHECKING:
    from impactfem.marching.layers import MaterialSums
    from impactfem.runs.solids import Ready

_AXES = "xyz"

type Part = Callable[[int, float], None]
"""Adds what a number reads at a level, with a weight."""


@dataclass
class Kept:
    """What a march keeps for its derivatives; an observer.

    Attributes:
        trail: Of its gaps.
        times: At which its energies may be asked for [s].
        beside: Displacements and velocities of the levels beside these.
        remembered: What bodies that relax remember there, (terms, dofs).
    """

    trail: Trail
    times: Floats
    beside: dict[int, tuple[Floats, Floats]] = field(default_factory=dict)
    remembered: dict[int, Floats] = field(default_factory=dict)

    def state(self, level: int) -> tuple[Floats, Floats]:
        """Displacements and velocities of a level beside these times."""
        states = self.trail.states
        return self.beside[level] if states is None else states.at(level)

    def __call__(self, level: Level) -> None:
        """Keep a level."""
        self.trail(level)
        interior = self.trail.march.interior
        near = bool((np.abs(self.times - level.time) < 2.001 * interior.dt).any())
        if self.trail.states is not None:
            self.trail.states.put(level.layer, *self.seen(level))
        elif near:
            self.beside[level.layer] = self.seen(level)
        if near:
            self.remembered[level.layer] = kept_of(interior.state())

    def seen(self, level: Level) -> tuple[Floats, Floats]:
        """Displacements and velocities of a level."""
        return level.displacement.copy(), level.velocity.copy()


type Number = dict[int, list[Callable[[Reading], None]]]
"""What a number reads: by the level what adds it."""


class Numbers:
    """What the numbers of a run read; arguments as of `solid_adjoints.Adjoints`.

    Attributes:
        levels: Whether one counts the potential of gravity.
        stressed: Whether one is a stress.
        placed: Whether one is the place of a centre.
        probed: Whether one is read at a place of t = 0, where another point of a body may be.
        into: Sums of the bodies, to which derivatives by their material are added; None: it stays.
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
        self._shares = shares_of(interior)
        self._names = list(ready.seen.model.names)
        self.levels = self.stressed = self.placed = self.probed = False
        self.into: Sequence[MaterialSums] | None = None
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
                if not self._measure(measure.of, time, by_rows=data.by_rows):
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

    def _measure(self, of: str, time: float, *, by_rows: bool) -> bool:
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
        if not by_rows:
            time = amid(of, time, self._dt, self._layers * self._dt)
        return part is not None and self._over(part, time)

    def _term(self, term: Term, time: float) -> bool:
        body = self._names.index(term.body) if term.body in self._names else None
        match term.term:
            case "value" | "misfit" | "effort":
                return True
            case "mass" if body is not None:
                self._weigh(0, body, self._whole.factor)
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
                mass, velocity = self._whole.factor * self._masses[name], self._velocity(body, time)
                self._along(body, time, -mass * velocity)
                self._weigh(0, body, -0.5 * self._whole.factor * float(velocity @ velocity))
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
            self.placed |= len(of) == 1
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
        moved, moving, strained = np.zeros((3, self._own[-1].stop))
        np.add.at(moved, probes.needed[0], row[: cuts[0]])
        np.add.at(moving, probes.needed[1], row[cuts[0] : cuts[1]])
        np.add.at(strained, probes.needed[2], row[cuts[1] :])
        self.stressed |= of[0] not in "uva"
        self.probed = True

        def read(level: int, weight: float) -> None:
            self._nodes(moved + strained, moving, level, weight)
            self._put(level, lambda r: _add(r.memory, weight * self._shares * strained))

        return read

    def _change(self, part: Part, row: int, weight: float) -> None:
        """What a part changes by in the step before a row, as a rate."""
        row = max(row, 1)
        part(row, weight / self._dt)
        part(row - 1, -weight / self._dt)

    def _nodes(self, moved: Floats, moving: Floats, level: int, weight: float) -> None:
        """Displacements and velocities of nodes, by weights of all owned dofs, (dofs,) each.

        Contact nodes go from where they are in equilibrium to where they are so at the next level.
        """
        place, contact = weight * moved, self._gathered(weight * moved)
        rate, going = weight * moving, self._gathered(weight / self._dt * moving)
        if self._march.skips:
            rate = rate / self._dt

        def add(reading: Reading) -> None:
            reading.place += place
            reading.rate += rate
            reading.contact += contact
            reading.static += contact

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

    def _centre(self, order: int, body: int, axis: int, level: int, weight: float) -> None:
        """Place (0) or velocity (1) of the centre of a body."""
        if not self._fixed(body, axis):
            mass, own = self._masses[self._names[body]], self._own[body]
            row = self._sums[body][order][axis] / mass
            self._put(level, lambda r: _add((r.place, r.rate)[order][own], weight * row))
            self._put(level, lambda _: self._heavier(order, body, axis, level, weight / mass))

    def _heavier(self, order: int, body: int, axis: int, level: int, weight: float) -> None:
        """Derivatives of first moments (0) or momenta (1) over the mass, by the mass."""
        if self.into is None:
            return
        part, into, dim = self._inner[body], self.into[body], self._ready.seen.model.dim
        along = np.zeros(dim)
        along[axis] = weight
        moved = self._kept.state(level)[order][self._own[body]]
        along = np.tile(along, len(moved) // dim)
        mean = self._history[level, body, 3 + (1 - order) * dim + axis]
        mean = mean / self._masses[self._names[body]]
        if order:
            part.vary_product(into, along, moved)
        else:
            system = self._ready.seen.model.parts[body].system
            part.vary_weight(into, along * moved)
            into.weigh(along * system.positions.ravel())
            mean += system.center_of_mass[axis]
        into.weigh_whole(-weight * mean)

    def _weigh(self, level: int, body: int, weight: float) -> None:
        """Add derivatives by the mass of a body."""

        def add(_: Reading) -> None:
            if self.into is not None:
                self.into[body].weigh_whole(weight)

        self._put(level, add)

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
        placed, velocity = self._kept.state(level)
        pulled, momentum = self._energies_by(placed, velocity)
        weight *= self._whole.factor
        if kind == "kinetic":
            unit = self._dt if self._march.skips else 1.0
            self._put(level, lambda r: _add(r.rate, weight / unit * momentum))
            self._products(level, 0.5 * weight * velocity, velocity, stiff=False)
        elif self._march.skips:
            self._amid(level, weight, pulled)
            if level:
                self._put(level, lambda r: setattr(r, "early", r.early + weight))
        else:
            nodes = self._gathered(weight * pulled)
            self._strain(level, weight * pulled, nodes, nodes)
            self._products(level, 0.5 * weight * placed, placed, stiff=True)
            kept = self._kept.remembered[level] if len(self._shares) else self._shares
            each = [self._energies_by(own, np.zeros_like(own))[0] for own in kept]
            stored = weight * self._shares * np.reshape(each, self._shares.shape)
            self._put(level, lambda r: _add(r.memory, stored))

    def _products(self, level: int, one: Floats, other: Floats, *, stiff: bool) -> None:
        """Add derivatives of one . K other or one . M other by the material, (dofs,) each."""

        def add(_: Reading) -> None:
            for k, (into, own) in enumerate(zip(self.into or (), self._own, strict=False)):
                if stiff:
                    into.stiff(one[own], other[own])
                else:
                    self._inner[k].vary_product(into, one[own], other[own])

        self._put(level, add)

    def _on_contact(self, nodes: Floats) -> Floats:
        """Values of the contact nodes (count, dim) on all owned dofs, 0 where held."""
        counts = [self._ready.seen.model.surface(k).count for k in range(len(self._inner))]
        each = zip(self._inner, pairwise(np.cumsum([0, *counts]).tolist()), strict=True)
        return np.concatenate([part.on_contact(nodes[slice(*own)]) for part, own in each])

    def _energies_by(self, placed: Floats, velocity: Floats) -> tuple[Floats, Floats]:
        """Elastic energy by displacements, kinetic energy by velocities, of all bodies."""
        each = [
            part.energies_by(placed[own], velocity[own])
            for part, own in zip(self._inner, self._own, strict=True)
        ]
        pulled, momentum = map(np.concatenate, zip(*each, strict=True))
        return pulled, momentum

    def _strain(self, level: int, place: Floats, contact: Floats, static: Floats) -> None:
        def add(reading: Reading) -> None:
            reading.place += place
            reading.contact += contact
            reading.static += static

        self._put(level, add)

    def _amid(self, level: int, weight: float, pulled: Floats) -> None:
        """Elastic energy of an explicit layer, u_a . K u_b / 2 and half of that of both contacts.

        Args:
            level: At its end.
            weight: Of the energy.
            pulled: K u_b.
        """
        before, none = max(level - 1, 0), np.zeros_like(self._march.interior.surface_displacement)
        for each in (level, before):
            nodes = self._pressing(each)
            self._strain(each, np.zeros_like(pulled), none, 0.5 * weight * nodes)
            pressed = self._on_contact(self._march.interior.static(nodes))
            self._products(each, 0.25 * weight * pressed, pressed, stiff=True)
        placed, velocity = self._kept.state(level)
        after = self._unpressed(level, placed)
        if not level:
            self._strain(0, weight * pulled, none, none)
            self._products(0, 0.5 * weight * after, after, stiff=True)
            return
        placed, velocity = self._kept.state(before)
        lags = np.concatenate(
            [
                np.full(own.stop - own.start, part.lag if before else 0.0)
                for part, own in zip(self._inner, self._own, strict=True)
            ]
        )
        ahead, _ = self._energies_by(placed + lags * self._dt * velocity, velocity)
        self._strain(level, 0.5 * weight * ahead, none, none)
        self._strain(before, 0.5 * weight * pulled, none, none)
        strained = self._unpressed(before, placed) + lags * self._dt * velocity
        self._products(level, 0.5 * weight * strained, after, stiff=True)
        self._put(before, lambda r: _add(r.rate, 0.5 * weight * lags * pulled))

    def _unpressed(self, level: int, placed: Floats) -> Floats:
        """Displacements of a level without what multipliers press contact nodes by, (dofs,)."""
        return placed - self._on_contact(self._march.interior.static(self._pressing(level)))

    def _pressing(self, level: int) -> Floats:
        """Forces of the multipliers of a level on the contact nodes [N], (count, dim)."""
        multiplier = self._kept.trail.multiplier[level]
        return np.asarray(self._march.gaps.spread(multiplier[:, None] * self._march.normals))


def _add(to: Floats, more: Floats) -> None:
    to += more


def _direction(velocity: Floats) -> Floats:
    """Of a velocity; 0 at rest, where a speed has a kink, which the check of slopes sees."""
    speed = float(np.linalg.norm(velocity))
    return velocity / speed if speed > 0.0 else np.zeros_like(velocity)
