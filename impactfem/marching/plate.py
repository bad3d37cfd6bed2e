"""Layers of a thin plate: the midpoint rule with one factorisation, and massless contact.

With forces F of the layer at its middle, without damping (with it: `plate_step`) and mu = 4 / dt^2

    (K + mu M) q = f + F + M (mu q_a + 2 v_a / dt),
    q_b = 2 q - q_a,   v_b = 2 (q_b - q_a) / dt - v_a.

Slopes and the vertices that touch have no mass: at the ends of layers they are in equilibrium,
K_cc q_c = F_c - K_ci q_i, with the forces there. So energy is kept as of solids (`midpoint`). They
are in its middle too, so that what they would be without contact needs no system of its own: twice
the middle less the start.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import SuperLU, splu

from impactfem.arrays import Floats
from impactfem.findings import ROTATION_LIMITS, STRAIN_LIMITS, Finding, by_limits, percent
from impactfem.marching.few import FewInterior
from impactfem.marching.held_rows import HeldLumped
from impactfem.marching.layers import Backward, Ends, MaterialSums, Sums
from impactfem.marching.plate_shown import ShownPlate
from impactfem.marching.plate_start import PlateAtRest
from impactfem.marching.plate_step import PlateStep
from impactfem.marching.plate_tips import PlateTips
from impactfem.scene import PiecewiseVector
from impactfem.system.kirchhoff import DOFS
from impactfem.system.plate import PlateSystem
from impactfem.system.stations import Stations
from impactfem.system.surface import CHOLESKY

_STIFFENING = 0.488
"""By which a clamped disc is stiffer if it deflects by its thickness: w^3 term of q over the linear
one (S. Timoshenko, S. Woinowsky-Krieger, Theory of plates and shells, 1959, chapter 13)."""

_SHEAR = 19.0
"""Deflection by shear over that by bending, times (width / thickness)^2: a clamped square, nu = 0.3
(.00150463 against .00126532 q L^4 / D at a tenth)."""

_SETTLED = 256  # layers after which what has no mass is solved for anew: rounding adds up
_COLUMN_BYTES = 2**28  # kept answers to unit forces; beyond this a layer solves once more


class PlateMidpoint(FewInterior):
    """Interior of a plate; see `impactfem.marching.layers.Interior`.

    Attributes:
        pulls: Of friction in the plane [N], of one that stretches.
        before: Coordinates at the start of the layer, (d,).
        strains: Of the triangles of the middle, where it stretches, (cells, 3).
        in_plane: Displacement of vertices in the plane that friction brings about [m],
            (vertices, 3).
    """

    bodies: PlateSystem
    pulls: Floats = np.zeros(0)
    strains: Floats = np.zeros((0, 3))
    in_plane: Floats | float = 0.0

    def __init__(
        self, bodies: PlateSystem, gravity: PiecewiseVector, dt: float, *, counts: bool
    ) -> None:
        """Factor once and begin at t = 0; see `FewInterior`."""
        super().__init__(bodies, gravity, dt, counts=counts)
        self._normal = bodies.plate.frame[1][2]
        vertex = bodies.basis[::DOFS].T.tocsr()  # from forces on vertices to those on q
        self._of_vertices, self._faces = vertex, bodies.on_faces
        self._mass = bodies.weight
        self._light = np.flatnonzero(bodies.light)
        self._heavy = np.flatnonzero(~bodies.light)
        slopes = np.flatnonzero(~bodies.deflected)
        self._slopes, self._deflected = slopes, np.flatnonzero(bodies.deflected)
        self._follows = not bodies.shears  # slopes do, whatever deflections do
        self._massless = bodies.massless
        # Changes of q by unit forces and moments on places, by component and place.
        self._units: dict[tuple[int, int], Floats] = {}
        self._told: dict[tuple[int, int], Floats] = {}  # the same of places, and at rest
        self._held = np.zeros(0)  # what forces do to what has no mass
        self.massive = np.full(len(self._start), not self._massless)
        arms = bodies.plate.frame[0] + bodies.mesh.points @ bodies.plate.frame[1][:2]
        # Momentum along the normal (d,) and angular momentum (d, 3) by rates; slopes turn about the
        # axes of the plate that lie across them.
        lever = np.cross(arms - bodies.centers[0], self._normal)
        self._pull = vertex @ bodies.node_mass
        x, y = (bodies.basis[k::DOFS].T @ bodies.turning for k in (1, 2))
        (first, second), levers = bodies.plate.frame[1][:2], bodies.node_mass[:, None] * lever
        self._turns = vertex @ levers + np.outer(y, first) - np.outer(x, second)
        local = np.column_stack([np.ones(len(bodies.mesh.points)), bodies.mesh.points])
        self._fit, self._fitting = local, np.linalg.pinv(local)
        self._seen, self._rim = np.zeros(2), bodies.mesh.rim
        self._shown: Floats | None = None  # of `surface_displacement`, until something moves
        self._loads = self._pressed(0.0, 0.0)  # of the layer
        self._moves, self._led = bool(bodies.motions), bodies.leading(0.0)
        for own, led in zip((self._q, self._v), self._led, strict=True):
            own[bodies.led] = led[bodies.led]
        self._weighing = 0.0  # of the layer [m/s^2]
        # At the start slopes are in equilibrium, and so is what touches, unless it is asked for.
        self._settle_slopes(self._q)
        self._begun, self.before = self._q.copy(), self._q.copy()
        self._kicked: Floats | float = 0.0
        self._start = bodies.places(self._q)
        self._free = self._at_ease()
        self.shown = ShownPlate(self)

    @property
    def speed(self) -> Floats:
        """Of all vertices along the normal [m/s]; of massless ones the mean of their neighbours."""
        return np.asarray(self.bodies.transfer @ self.bodies.deflection(self._v))

    @cached_property
    def _layer(self) -> PlateStep:
        """The equations of a layer."""
        return PlateStep(self.bodies, self.dt)

    @cached_property
    def _statics(self) -> SuperLU:
        """Factors of what has no mass."""
        return splu(self.bodies.stiffness[self._light][:, self._light].tocsc(), **CHOLESKY)

    @cached_property
    def _turned(self) -> tuple[SuperLU, csr_matrix]:
        """Factors of slopes, and what deflections do to them."""
        rows = self.bodies.stiffness[self._slopes]
        return splu(rows[:, self._slopes].tocsc(), **CHOLESKY), rows[:, self._deflected].tocsr()

    def _pressed(self, start: float, end: float, place: Floats | None = None) -> Floats:
        """Mean forces of pressures on q, moved off what has no mass.

        Args:
            start: Of the time, at which the present state is [s].
            end: Its end [s]: speed takes gaps on to the middle.
            place: Coordinates that gaps are at the start at; None: the present ones.
        """
        bodies, moved = self.bodies, None
        if bodies.by_gap:
            moved = bodies.deflection(self._q if place is None else place)
            moved = moved + 0.5 * (end - start) * self.speed
        forces = bodies.pressure(start, end, moved)
        return np.asarray(self._of_vertices @ (self.bodies.transfer.T @ forces))

    def at_rest(self) -> PlateAtRest:
        """It as the search for equilibrium asks it; see `impactfem.marching.resting.Resting`."""
        return PlateAtRest(self)

    def displaced(self, place: Floats, pulls: Floats) -> Floats:  # noqa: ARG002  (does not stretch)
        """Displacements of the contact nodes with some coordinates [m], (count, 3).

        Args:
            place: Coordinates.
            pulls: Of friction in the plane [N].
        """
        return self.contact_moved(place - self._begun)

    def moved(self, place: Floats, pulls: Floats, change: Floats, more: Floats) -> Floats:  # noqa: ARG002
        """How `displaced` changes by small changes of both arguments [m], (count, 3)."""
        return self.contact_moved(change)

    def pulled(self, forces: Floats) -> tuple[Floats, Floats]:
        """Forces on the contact nodes (count, 3) as those on q, and in the plane."""
        return self._faces.pulled(self._faces.pressing(forces)), self.pulls

    def contact_moved(self, change: Floats) -> Floats:
        """How contact nodes move by a change of q [m], (count, 3)."""
        return self._faces.moved(self._faces.told(change))

    def loads_at_rest(self, place: Floats) -> Floats:
        """Forces on q at t = 0 with some coordinates, without contact."""
        weight = float(np.asarray(self._gravity.at(0.0)) @ self._normal)
        return np.asarray(self._pressed(0.0, 0.0, place) + weight * self._pull)

    def settle(self, place: Floats, pulls: Floats) -> Floats:
        """Begin elsewhere, as `displaced` has it; mass times the way there [kg m], (3,)."""
        self.pulls = pulls.copy()
        fallen = float(self._pull @ (place - self._q))
        self._q, self.before, self._shown = place.copy(), place.copy(), None
        self._free = self._at_ease()
        self._loads = self._pressed(0.0, 0.0)
        return np.asarray(fallen * self._normal)

    def _settle_slopes(self, q: Floats) -> None:
        """Bring slopes into equilibrium with deflections, in place."""
        factor, pull = self._turned
        q[self._slopes] = -factor.solve(pull @ q[self._deflected])

    def _at_ease(self) -> Floats:
        """What has no mass, in equilibrium with all else without contact forces, (light,)."""
        if not len(self._light):
            return np.zeros(0)
        q = self._q.copy()
        q[self._light] = 0.0
        return np.asarray(-self._statics.solve((self.bodies.stiffness @ q)[self._light]))

    @property
    def surface_displacement(self) -> Floats:
        """Of the contact nodes since t = 0, without contact forces [m], (count, 3)."""
        if self._shown is None:
            moved = self._q - self._begun
            moved[self._light] = self._free - self._begun[self._light]
            self._shown = self.contact_moved(moved)
        return self._shown

    @property
    def surface_velocity(self) -> Floats:
        """Of the contact nodes [m/s], (count, 3)."""
        rates, none = self._v.copy(), self.bodies.light & self.bodies.deflected
        if self._massless:  # of which the mean of their neighbours is told
            rates[none] = (self._of_vertices @ self.speed)[none]
        if self._faces.rubs and self._follows:
            self._settle_slopes(rates)
        return self.contact_moved(rates)

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:
        """Velocities of contact nodes at both ends of the layer [m/s], (count, 3) each."""
        before = self.surface_velocity
        return before, 2.0 / self.dt * way - before

    def begin(self, start: float, end: float) -> None:
        """Solve the layer without contact forces."""
        if not self.bodies.is_steady:
            self._loads = self._pressed(start, end)
        motion = self._layer.motion(self._q, self._v, self.dt)
        self._weighing = float(self.gravity(start, end) @ self._normal)
        weight = self._pull * self._weighing
        advance = self._layer.advance
        there = self._lead(self._q, end) if self._moves else None
        middle = self._layer.solve(motion + weight + self._loads, there)
        self.before = self._q.copy()
        self._q, self._shown = self.before.copy(), None
        heavy = self._heavy
        self._q[heavy] = advance * middle[heavy] + (1.0 - advance) * self.before[heavy]
        self._free = advance * middle[self._light] + (1.0 - advance) * self._free
        if round(end / self.dt) % _SETTLED == 0:
            self._free = self._at_ease()

    def _lead(self, place: Floats, end: float) -> Floats:
        """See where edges move to by the end of the layer: `PlateStep.solve` takes this, (d,).

        Args:
            place: Coordinates at its start.
            end: Of the layer [s].
        """
        self._led = self.bodies.leading(end)
        here = np.where(self.bodies.led, place, 0.0)
        advance = self._layer.advance
        return np.asarray((self._led[0] - (1.0 - advance) * here) / advance)

    def _led_work(self, way: Floats, inside: Floats, loads: Floats, had: float) -> float:
        """Work of edges that move [J]: what their mass gains, less what else pushes it.

        Args:
            way: Of all coordinates in the layer, (d,).
            inside: Forces against them in it, without inertia, (d,).
            loads: Other forces, (d,).
            had: Kinetic energy of the mass of these edges before [J].
        """
        led = self.bodies.led
        return self._led_energy - had + float((inside - loads)[led] @ way[led])

    @property
    def surface_iterate(self) -> Floats:
        """The same at the end of the layer, as it is solved now."""
        return self.surface_displacement

    def _changed(self, pressing: Floats) -> tuple[Floats, Floats]:
        """What pressing does to q at the end of a layer, and at rest, (d,) each.

        Of what has no mass the first is what it would be without these forces there.

        Args:
            pressing: See `PlateFaces.pressing`.
        """
        right, advance = self._faces.pulled(pressing), self._layer.advance
        found, pressed = self.answer(right), np.zeros_like(right)
        if right[self._light].any():
            pressed[self._light] = self._statics.solve(right[self._light])
        return found - advance * pressed, pressed

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Answers of the contact nodes to several forces (several, count, 3) in a layer."""
        layer, static = np.zeros_like(forces), np.zeros_like(forces)
        for k, pressing in enumerate(self._pressing(forces)):
            told = np.zeros((2, *pressing.shape))
            for part, place in np.argwhere(pressing).tolist():
                told += pressing[part, place] * self._unit(part, place)
            layer[k], static[k] = map(self._faces.moved, told)
        return layer, static

    def _pressing(self, forces: Floats) -> Floats:
        """What of forces (..., count, 3) moves the plate; it does not move in its plane."""
        return self._faces.pressing(forces)[..., : len(self._faces.rows), :]

    def _unit(self, part: int, place: int) -> Floats:
        """How places answer in a layer, and at rest, to a unit of pressing, (2, parts, places)."""
        at = part, place
        if at not in self._told:
            unit = np.zeros((len(self._faces.rows), len(self._faces.half)))
            unit[at] = 1.0
            found, pressed = self._changed(unit)
            told = [self._faces.told(each) for each in (found, self._massless * pressed)]
            self._told[at] = np.stack(told)
            if (len(self._units) + 1) * found.nbytes <= _COLUMN_BYTES:
                self._units[at] = found
        return self._told[at]

    answers = columns

    def held(self, stations: Stations) -> HeldLumped:
        """It as joints hold it."""
        count = len(stations.places)
        tips = PlateTips(self, stations.rows.reshape(6 * count, -1))
        rows = np.eye(6 * count)[:, tips.moves].reshape(count, 6, -1)
        return HeldLumped(tips, replace(stations, rows=rows), self)

    def answer(self, forces: Floats) -> Floats:
        """Change of q at the end of a layer by forces on it, (d,) each."""
        return np.asarray(self._layer.advance * self._layer.solve(forces))

    def answer_to(self, forces: Floats) -> Floats:
        """The same by forces on the contact nodes (count, 3)."""
        pressing, found = self._pressing(forces), np.zeros_like(self._q)
        for part, place in np.argwhere(pressing).tolist():
            self._unit(part, place)
            if (unit := self._units.get((part, place))) is None:
                return self._changed(pressing)[0]
            found += pressing[part, place] * unit
        return found

    def shift(self, change: Floats) -> None:
        """Move q at the end of the layer."""
        self._shown = None
        self._q[self._heavy] += change[self._heavy]
        self._free += change[self._light]

    def kick(self, rates: Floats) -> None:
        """Let the next layer start with other rates."""
        self._kicked = rates

    def look(self) -> None:
        """Nothing: contact nodes move with each force."""

    @property
    def rates(self) -> Floats:
        """Of q at the start of the layer, (d,)."""
        return self._v

    def static(self, forces: Floats) -> Floats:
        """Displacement of massless contact nodes by static forces on them, (count, 3) each."""
        if not self._massless:
            return np.zeros_like(forces)
        moved = np.zeros_like(self._q)
        moved[self._light] = self._held = self._statics.solve(self.pulled(forces)[0][self._light])
        return self.contact_moved(moved)

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:  # noqa: ARG002
        """Add the layer's contact forces (count, 3)."""
        pressing, answer = self._pressing(forces), np.zeros_like(self._q)
        known = [at for at in self._units if pressing[at]]
        if len(known) == np.count_nonzero(pressing):
            for at in known:
                answer += pressing[at] * self._units[at]
        else:
            answer, _ = self._changed(pressing)
        self.shift(answer)

    def finish(self, static: Floats) -> list[Sums]:
        """End the layer and sum up."""
        heavy, led = self._heavy, self.bodies.led
        moved, had = self._q[heavy] - self.before[heavy], self._led_energy
        # Velocities turn round in a layer, and what they begin with, too.
        self._v = self._v - self._kicked
        self._v[heavy] = 2.0 / self.dt * moved - self._v[heavy]
        self._kicked = 0.0
        self._place(static)
        work = float(self._loads[heavy] @ moved)
        if self._moves:
            self._q[led], self._v[led] = (each[led] for each in self._led)
            way, damping = self._q - self.before, self.bodies.damping
            inside = (
                self.bodies.stiffness @ (self.before + (0.5 + damping.stiffness / self.dt) * way)
                + damping.mass / self.dt * self._mass * way
            )
            work += self._led_work(way, inside, self._loads + self._weighing * self._pull, had)
        self.before = self._q.copy()
        return self._summed(work)

    @property
    def _led_energy(self) -> float:
        """Kinetic energy of the mass of edges that move [J]."""
        led = self.bodies.led
        return 0.5 * float(self._mass[led] @ self._v[led] ** 2)

    def initial(self, static: Floats) -> list[Sums]:
        """Sums of the initial state."""
        self._place(static)
        return self._summed(0.0)

    def _place(self, static: Floats) -> None:
        """Put what has no mass where it is with contact forces."""
        self._q[self._light] = self._free
        if static.any():
            self._q[self._light] += self._held
        self._look()

    def _summed(self, work: float) -> list[Sums]:
        if not self.counts:
            return [Sums(0.0, 0.0, 0.0, *np.zeros((3, 3)))]
        return [
            Sums(
                0.5 * float(self._mass @ self._v**2),
                self.bodies.elastic(self._q, self.strains),
                work,
                float(self._pull @ self._v) * self._normal,
                float(self._pull @ (self._q - self._begun)) * self._normal,
                self._v @ self._turns,
            )
        ]

    @property
    def reversible(self) -> bool:
        """Whether `backward` knows all that happens in a layer."""
        return not (self._moves or self.bodies.by_gap)

    @property
    def dofs(self) -> int:
        """How many coordinates `backward` takes."""
        return len(self._q)

    def backward(
        self, place: Floats, rate: Floats, contact: Floats, *, first: bool,  # noqa: ARG002  (as the interface has it)
        parts: Floats | None = None,  # noqa: ARG002  (likewise)
    ) -> Backward:  # fmt: skip
        """Derivatives by what a layer begins with; see `Reversible`.

        Coordinates are those without contact forces on what has no mass, which follows all else.
        """
        heavy, layer = self._heavy, self._layer
        moved, turned = self.settled(place, contact), np.zeros_like(rate)
        turned[heavy] = rate[heavy]
        moved += (2.0 / self.dt) * turned
        loads = self.answer(moved)
        begun = (1.0 - layer.advance) * moved + layer.motion(loads, 0.0 * loads, self.dt)
        begun -= (2.0 / self.dt) * turned
        rates = (2.0 / self.dt) * self._mass * loads - turned
        return Backward(begun, rates, self.contact_moved(loads), loads)

    def settled(self, place: Floats, contact: Floats) -> Floats:
        """Derivatives by what has mass, with those by all that follows it; see `Reversible`."""
        moved, eased = place + self.pulled(contact)[0], self.eased(place, contact)
        if eased is not None:
            moved -= self.bodies.stiffness @ eased
        moved[self._light] = 0.0
        return moved

    def eased(self, place: Floats | float, contact: Floats) -> Floats | None:
        """How far derivatives by what has no mass move it; see `Reversible`."""
        right = (place + self.pulled(contact)[0])[self._light]
        if not right.any():
            return None
        found = np.zeros_like(self._q)
        found[self._light] = self._statics.solve(right)
        return found

    def pressed_by(self, place: Floats) -> Floats:
        """Derivatives by static forces on contact nodes of those by coordinates, (count, 3)."""
        none = np.zeros((len(self._start), 3))
        held = self.eased(place, none)
        return none if held is None else self.contact_moved(held)

    def vary(self, into: MaterialSums, loads: Floats, ends: Ends) -> None:
        """Add derivatives by the material that a layer makes; see `Reversible`."""
        layer, light = self._layer, self._light
        # Where stiffness acts with what it damps; what has no mass is in equilibrium there.
        middle = ends.place + (ends.end_place - ends.place) / layer.advance
        if len(light):
            middle[light] = 0.0
            right = self.pulled(ends.forces)[0] - self.bodies.stiffness @ middle
            middle[light] = self._statics.solve(right[light])
        into.stiff(-loads, middle)
        into.heavy(loads, layer.mu * (ends.place - middle) + (2.0 / self.dt) * ends.velocity)
        into.weigh(float(self.gravity(ends.start, ends.end) @ self._normal) * loads)

    def vary_product(self, into: MaterialSums, one: Floats, other: Floats) -> None:
        """Add those of one . M other; see `Reversible`."""
        into.heavy(one, other)

    def vary_weight(self, into: MaterialSums, values: Floats) -> None:
        """Add those of sums by mass; see `Reversible`."""
        into.weigh(values)

    def sums_by(self) -> tuple[Floats, Floats]:
        """Mass times displacement and momentum; see `Reversible`."""
        along = np.outer(self._normal, self._pull)
        return along, along

    def energies_by(self, placed: Floats, velocity: Floats) -> tuple[Floats, Floats]:
        """Elastic energy by coordinates, kinetic energy by rates, (d,) each."""
        return np.asarray(self.bodies.stiffness @ placed), self._mass * velocity

    @property
    def _taut(self) -> float:
        """How much stiffer a tension at rest makes a clamped disc: 4 N / R^2 over 64 D / R^4."""
        plate, radius = self.bodies.plate, 0.5 * self.bodies.width
        tension = plate.residual_stress * plate.depth
        return max(tension, 0.0) * radius**2 / (16.0 * plate.section.rigidity)

    def _look(self) -> None:
        """Keep how far it deflects from the plane that fits it best, and how steep it is."""
        moved = (self.bodies.basis @ self._q).reshape(-1, DOFS)
        flat: Floats | float = 0.0
        if not self.bodies.enclosed:
            flat = self._fit @ (self._fitting @ moved[:, 0])
        elif self._moves:  # from where its edges have moved, about
            flat = self._fit @ (np.linalg.pinv(self._fit[self._rim]) @ moved[self._rim, 0])
        deflection = float(np.abs(moved[:, 0] - flat).max())
        steepness = float(np.sqrt((moved[:, 1:] ** 2).sum(axis=1).max()))
        self._seen = np.maximum(self._seen, [deflection, steepness])

    def findings(self) -> Iterator[Finding]:
        """Deflections that stretch the mid-surface, and slopes that are not small."""
        name, (deflection, steepness) = self.bodies.names[0], self._seen.tolist()
        share = deflection / self.bodies.depth
        stiffer = _STIFFENING * share**2 / (1.0 + self._taut)
        stiffer *= self.bodies.membrane is None
        text = f"{name} deflects by {deflection:.3g} m, {share:.2g} times its thickness: a clamped "
        text += f"disc would be about {percent(stiffer)} stiffer by the stretching of its middle, "
        text += "which is left out"
        if not self.bodies.enclosed:
            text += "; here edges are free, and it stretches less or not at all"
        limits = STRAIN_LIMITS if self.bodies.enclosed else (STRAIN_LIMITS[0], np.inf)
        remedy = "smaller loads or speeds, or model it as a solid of finite strain"
        yield from by_limits("model_strain", stiffer, limits, text, name, remedy)
        text = f"{name} is inclined by up to {steepness:.2g} rad, taken as small"
        yield from by_limits("model_rotation", steepness, ROTATION_LIMITS, text, name, remedy)
        depth = self.bodies.plate.section.shear_depth
        depth *= self.bodies.depth / self.bodies.plate.depth
        share = self._follows * _SHEAR * (depth / self.bodies.width) ** 2
        text = f"{name} is thick for Kirchhoff's theory: shear, which is left out, would let a "
        text += f"clamped square of its width give way by {percent(share)} more"
        remedy = 'give theory = "reissner_mindlin", or model it as a solid'
        yield from by_limits("model_thin", share, STRAIN_LIMITS, text, name, remedy)

        share = self.bodies.plate.section.coupled
        text = f"bending stretches the layers of {name}, which is taken as free: held in its plane "
        text += f"it would be up to {percent(share)} stiffer"
        remedy = "take layers that are symmetric about the middle, or model it as a solid"
        yield from by_limits("model_layers", share, STRAIN_LIMITS, text, name, remedy)

    def memory(self) -> dict[str, Floats]:
        """Coordinates, rates, contact nodes without forces, and what was seen."""
        return super().memory() | {"free": self._free.copy(), "seen": self._seen.copy()}

    def remember(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory` gave."""
        super().remember(memory)
        self._shown, self.before = None, self._q.copy()
        self._free, self._seen = memory["free"].copy(), memory["seen"].copy()
