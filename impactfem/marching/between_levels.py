"""Bodies that step themselves from level to level, beside solids of finite strain there.

Solids in explicit steps hand forces F_m over at levels. Other bodies take their own step to the
next one with F_m, contact, joints and impacts among them included, and then the change of rates by
forces that change:

    (x_m, v_m) -> (x_{m+1}, v) with F_m,    v_{m+1} = v + dt M^-1 H^T (F_{m+1} - F_m) / 2.

Of a point that is x_{m+1} - 2 x_m + x_{m-1} = dt^2 M^-1 F_m, as inside the solids, so that F_m does
the work F_m (x_{m+1} - x_{m-1}) / 2 on both. x_{m+1} does not depend on F_{m+1}: at a level the
bodies are to the solids what moving obstacles are. The energy told of them is that which such steps
keep, as of the solids (`impactfem.marching.finite_leapfrog`).
"""

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.marching.finite_leapfrog import FiniteLeapfrog
from impactfem.marching.layers import Sums
from impactfem.marching.leapfrog_bodies import LeapfrogBodies, LevelStepper
from impactfem.marching.meshless import Meshless
from impactfem.marching.newton_bodies import NewtonBodies, NewtonStepper
from impactfem.marching.newton_march import NewtonMarch
from impactfem.marching.newton_steps import LayerSums
from impactfem.marching.time_loop import LoopSettings
from impactfem.scene import PiecewiseVector


class Still(Meshless):
    """Contact nodes of the solids where no gap weighs them.

    Attributes:
        missing, massive: As of a body that nothing moves.
        surface_displacement, surface_iterate, surface_velocity, surface_way: 0, (count, dim).
    """

    generation = 0

    def __init__(self, gravity: PiecewiseVector, dt: float, count: int) -> None:
        """Keep still."""
        super().__init__(gravity, dt, counts=False)
        self.missing = dict[str, float]()
        self.massive = np.ones(count, dtype=bool)
        none = np.zeros((count, np.shape(gravity.values)[1]))
        self.surface_displacement = self.surface_iterate = none
        self.surface_velocity = self.surface_way = none

    def begin(self, start: float, end: float) -> None:
        """Nothing."""

    def touch(self, normals: Floats) -> None:
        """Nothing."""

    def predicted(self, start: float, end: float) -> Floats:  # noqa: ARG002  (as others)
        """Where they are."""
        return self.surface_way

    def arms(self, middle: Floats) -> Floats:
        """Where they are."""
        return middle

    def unbalanced(self, forces: Floats) -> float:  # noqa: ARG002  (as others)
        """Nothing is."""
        return 0.0

    def linearise(self) -> Floats:
        """Nothing moves."""
        return self.surface_way

    def answers(self, forces: Floats) -> Floats:
        """Nothing moves."""
        return np.zeros_like(forces)

    def correct(self, forces: Floats) -> None:
        """Nothing."""

    def accept(self) -> None:
        """Nothing."""

    def jolt(self, impulses: Floats) -> None:
        """Nothing."""

    def spins(self) -> Floats:
        """Nothing turns."""
        dim = self.surface_way.shape[1]
        return np.zeros((dim * (dim - 1) // 2, *self.surface_way.shape))

    def inertia(self) -> list[Floats]:
        """Of no body."""
        return []

    def initial(self, static: Floats) -> Sequence[Sums]:  # noqa: ARG002  (as others)
        """Of no body."""
        return []

    finish = initial

    def memory(self) -> dict[str, Floats]:
        """Nothing."""
        return {}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Nothing."""


class _Pushed:
    """Bodies that given forces push besides.

    Attributes:
        given: On the contact nodes [N], (count, dim).
        towards: Sum of the normals of the gaps of each node that these are from, (count, dim).
    """

    def __init__(self, bodies: NewtonBodies) -> None:
        self.bodies = bodies
        self.given: Floats = np.zeros_like(bodies.surface_displacement)
        self.towards: Floats = self.given

    def __getattr__(self, name: str) -> Any:
        return getattr(self.bodies, name)

    def touch(self, normals: Floats) -> None:
        """Learn where bodies that roll touch."""
        self.bodies.touch(normals + self.towards)

    def unbalanced(self, forces: Floats) -> float:
        """The worst of all bodies."""
        return self.bodies.unbalanced(forces + self.given)


class BetweenLevels(Meshless):
    """Such bodies as a part of an explicit march; see `impactfem.marching.leapfrog_bodies`.

    Attributes:
        march: Of what is among them and beside obstacles.
        lent: What joints store and take at the tips of solids, by the places of these.
        missing, most, rounding, lag: As of bodies that ask for nothing.
        yields: That forces move none of their nodes at a level, (count, dim).
    """

    most, rounding, lag = 1, 0.0, 0.0

    def __init__(
        self,
        bodies: NewtonBodies,
        settings: LoopSettings,
        solids: int,
        tipped: Mapping[int, FiniteLeapfrog],
    ) -> None:
        """Begin at t = 0.

        Args:
            bodies: They, joined or not, behind the contact nodes of the solids (`Still`), and
                behind the tips of some.
            settings: Of the march among them.
            solids: Number of contact nodes of the solids.
            tipped: Those with tips by their places, in the order of these.
        """
        self._tipped = dict(tipped)
        self.dt, self._bodies, self._own = bodies.dt, bodies, slice(solids, None)
        self.counts = any(part.counts for part in cast("Sequence[Meshless]", bodies.parts))
        self._pushed = _Pushed(bodies)
        self.march = NewtonMarch(cast("NewtonStepper", self._pushed), settings)
        self.missing = dict[str, float]()
        none = np.zeros_like(self.surface_displacement)
        self.yields: Booleans = none > 0.0
        self._force = self._begun = self._beyond = none
        self._place, self._span = self.surface_displacement, bodies.dt
        self._over = self._rate = 0.0  # F M^-1 F, and v K v + F M^-1 F_last
        self._done = self._nothing()

    def _nothing(self) -> LayerSums:
        return LayerSums(len(self.march.contact.gap), self._force.shape[1])

    def taken(self) -> LayerSums:
        """What steps have summed up to since it was asked last."""
        done, self._done = self._done, self._nothing()
        return done

    def _all(self, values: Floats) -> Floats:
        """With those of the solids' nodes, 0."""
        return np.concatenate([np.zeros((self._own.start, values.shape[1])), values])

    @property
    def surface_displacement(self) -> Floats:
        """Of their contact nodes [m], (count, dim)."""
        return self._bodies.surface_displacement[self._own]

    @property
    def surface_iterate(self) -> Floats:
        """The same: their step is done."""
        return self.surface_displacement

    def _speeds(self, name: str) -> Floats:
        """Of all contact nodes, of which each body has its own [m/s], (count, dim)."""
        parts = cast("Sequence[Any]", self._bodies.parts[1:])
        return np.concatenate([getattr(part.body, name) for part in parts])

    @property
    def _rolling(self) -> Floats:
        """Velocity of what touches besides that of its node [m/s], (count, dim)."""
        if not self._bodies.rolling:
            return np.zeros_like(self._beyond)
        return self._speeds("touching_velocity") - self._speeds("surface_velocity")

    @property
    def rolled(self) -> Floats:
        """How far what touches has moved in the step besides its node [m], (count, dim)."""
        return 0.5 * self._span * (self._begun + self._rolling)

    def begin(self, start: float, end: float) -> None:
        """Take their own step, with the forces of the level where it starts."""
        self._span, self._begun, self._place = end - start, self._beyond, self.surface_displacement
        self._pushed.given = self._all(self._force)
        self._done.join(self.march.through(start, end))
        self.march.layer += 1
        for solid in self._tipped.values():
            solid.carry()

    def touch(self, normals: Floats) -> None:
        """Learn where they touch solids now, by the normals of their nodes (count, dim)."""
        self._pushed.towards = self._all(normals)
        if self.march.layer:
            self._pushed.touch(self.march.towards)

    def pieces(self) -> int:
        """Any steps do."""
        return 1

    def move_surface(self, place: Floats) -> None:
        """Nothing: they are where their step has brought them."""

    def unbalanced(self) -> Floats:
        """Nothing is [N], (count, dim)."""
        return np.zeros_like(self._force)

    balance = unbalanced

    def renew(self) -> None:
        """Nothing."""

    def relaxed(self, right: Floats, held: Booleans, normals: Floats) -> Floats:  # noqa: ARG002
        """Nothing moves at a level [m], (count, dim)."""
        return np.zeros_like(right)

    def answer(self, right: Floats) -> Floats:
        """The same."""
        return np.zeros_like(right)

    def answers(self, nodes: Integers) -> Floats:
        """The same, (some, dim, count, dim)."""
        count, dim = self._force.shape
        return np.zeros((len(nodes), dim, count, dim))

    def _jolt(self, forces: Floats) -> Floats:
        """Let forces (count, dim) [N] act for half a step; accelerations by them [m/s^2]."""
        if not forces.any():
            return np.zeros_like(forces)
        before, half = self._speeds("touching_velocity"), 0.5 * self._span
        self._bodies.jolt(self._all(half * forces))
        return (self._speeds("touching_velocity") - before) / half

    def receive(self, left: Floats, *, first: bool = False) -> None:
        """Take the forces of a level, -left, in place of those of the last one."""
        last, self._force = self._force, -left
        if first:
            self._span, last = self.dt, self._force
        new, old = self._jolt(self._force), self._jolt(-last)
        moved = self.surface_displacement - self._place + self.rolled * (not first)
        change = 0.0 if first else float(((self._force - last) * moved).sum()) / self._span**2
        self._over = float((self._force * new).sum())
        self._rate = -float((self._force * old).sum()) - change
        self._beyond = self._rolling

    def close(self, left: Floats) -> None:
        """End the step; forces (count, dim) [N] are taken off it alone, with those of the level."""
        self._jolt(-left)
        self._beyond = self._rolling

    @property
    def between(self) -> Floats:
        """Part of the energy that comes from two levels, told of the first body [J]."""
        found = np.zeros(len(self.inertia()))
        found[:1] = self._span**2 / 12.0 * self._rate * self.counts
        return found

    def initial(self, static: Floats) -> Sequence[Sums]:
        """Sums of the initial state."""
        return self._told(self._bodies.initial(self._all(static)))

    def finish(self, static: Floats) -> Sequence[Sums]:
        """End the layer and sum up."""
        ended = self._bodies.finish if self.march.layer else self._bodies.initial
        return self._told(ended(self._all(static)))

    def _told(self, sums: Sequence[Sums]) -> Sequence[Sums]:
        over, first = self._span**2 / 8.0 * self._over * self.counts, len(self._tipped)
        self.lent, own = dict(zip(self._tipped, sums, strict=False)), sums[first:]
        if own:
            own[0].elastic += float(self.between[0]) - over
        return own

    def inertia(self) -> list[Floats]:
        """Of each body."""
        return self._bodies.inertia()[len(self._tipped) :]

    def spins(self) -> Floats:
        """Velocities of the contact nodes by unit spins of their bodies [m]."""
        return self._bodies.spins()[:, self._own]

    def gravity(self, start: float, end: float) -> Floats:
        """Mean gravity of a layer [m/s^2], shape (dim,)."""
        return self._bodies.gravity(start, end)

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs: of their march, and from level to level."""
        own = {"force": self._force, "beyond": self._beyond, "towards": self._pushed.towards}
        own["told"] = np.array([self.march.layer, self._span, self._over, self._rate])
        return self.march.memory() | {f"between.{name}": each for name, each in own.items()}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        self._force, self._beyond = memory["between.force"], memory["between.beyond"]
        self._pushed.towards = memory["between.towards"]
        layer, self._span, self._over, self._rate = memory["between.told"].tolist()
        self.march.restore({}, memory, np.zeros(0, dtype=np.int64), int(layer))


class LevelsBeside(LeapfrogBodies):
    """Solids in explicit steps, and what is beside them."""

    def __init__(self, solids: Sequence[LevelStepper], beside: BetweenLevels) -> None:
        """Join them."""
        super().__init__([*solids, cast("LevelStepper", beside)])
        self._beside = beside

    def initial(self, static: Floats) -> Sequence[Sums]:
        """Sums of the initial state, of each body."""
        return self._told(super().initial(static))

    def finish(self, static: Floats) -> Sequence[Sums]:
        """End the layer; sums of each body."""
        return self._told(super().finish(static))

    def _told(self, found: Sequence[Sums]) -> Sequence[Sums]:
        for solid, sums in self._beside.lent.items():
            found[solid].elastic += sums.elastic
            found[solid].work += sums.work
        return found
