"""Layers of bodies of few degrees of freedom: the midpoint rule in their coordinates.

    M (v_b - v_a) = dt (f(t, q, v) + W g + H^T F) at the middle,   q_b = q_a + dt (v_a + v_b) / 2,

with contact forces F of the layer and H where the free motion is halfway. Each rank holds the whole
bodies, of which there are few, and only rank 0 sums them up.
"""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.errors import ConvergenceError
from impactfem.findings import STRAIN_LIMITS, Finding, by_limits, percent
from impactfem.marching.few_forces import steady_load, tangent
from impactfem.marching.few_start import FewAtRest
from impactfem.marching.held_rows import HeldLumped
from impactfem.marching.iterated import SHARE, by_energy
from impactfem.marching.layers import Sums
from impactfem.marching.marched import Marched, Shown
from impactfem.marching.meshless import Meshless, step_length
from impactfem.marching.stations import Held
from impactfem.scene import PiecewiseVector
from impactfem.system.few import FewBodies, Lumped
from impactfem.system.generalized import LinearSystem
from impactfem.system.stations import Stations

_MOST_ITERATIONS = 50
_EPS, _TINY = 4.0 * float(np.finfo(float).eps), float(np.finfo(float).tiny)
_SETTLED = 1e-13  # change of velocities, as a share of the largest


class FewInterior(Marched, Meshless):
    """What steps bodies without meshes of one kind."""

    strike: Callable[[Floats], None]
    """Adds the layer's contact forces (count, dim)."""
    advance: Callable[[], Any]
    """Takes what was found as the state; the work of loads [J]."""
    summed: Callable[..., list[Sums]]
    """Sums now, with the work of loads since the last ones [J]."""

    def __init__(
        self, bodies: FewBodies, gravity: PiecewiseVector, dt: float, *, counts: bool
    ) -> None:
        """Begin at t = 0.

        Args:
            bodies: What moves.
            gravity: [m/s^2].
            dt: Time step [s].
            counts: Whether this rank sums the bodies up.
        """
        super().__init__(gravity, dt, counts=counts)
        self.bodies = bodies
        self._q, self._v = bodies.position.copy(), bodies.velocity.copy()
        self._ahead: Floats = self._v.copy()  # rates at the end of the step
        self._start = bodies.places(bodies.position)
        self.shown = Shown(self)
        self._compliance = np.zeros((0, 0))  # of a layer, of kinds that know it as a whole [m/N]
        none = np.zeros(len(self._start), dtype=bool)
        self.massive: Booleans = none
        self.radiating: Booleans = none
        self.volatile: Booleans = none

    @property
    def coordinates(self) -> Floats:
        """Q now, shape (d,)."""
        return self._q

    @property
    def joined_coordinates(self) -> Floats:
        """Those by which joints hold it, (d,)."""
        return self._q

    @property
    def surface_displacement(self) -> Floats:
        """Of the contact nodes since t = 0 [m], (count, dim)."""
        return self.bodies.places(self._q) - self._start

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:  # noqa: ARG002
        """Add the layer's contact forces (count, dim)."""
        self.strike(forces)

    def finish(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """End the layer and sum up."""
        return self.summed(self.advance())

    def initial(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """Sums of the initial state."""
        return self.summed(0.0)

    @property
    @abstractmethod
    def surface_iterate(self) -> Floats:
        """Of the contact nodes at the end of the step, as it is solved now [m], (count, dim)."""

    @property
    def surface_way(self) -> Floats:
        """How far what touches moves in the step, as it is solved now [m], (count, dim)."""
        return self.surface_iterate - self.surface_displacement

    @property
    def touching_velocity(self) -> Floats:
        """Of what touches, at the start of the step [m/s], (count, dim)."""
        return self.surface_velocity

    def touch(self, normals: Floats) -> None:
        """Nothing: nodes touch themselves."""

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim)."""
        return self.bodies.places(self._q + (end - start) * self._v) - self._start

    @property
    def velocity_ahead(self) -> Floats:
        """Of the contact nodes at the end of the step, as it is solved now [m/s], (count, dim)."""
        return self.contact_speeds(self._start)[1]

    def drift(self, span: float) -> None:
        """Go on for a time [s] at the rates now, without forces."""
        self._q = self._q + span * self._v

    def known(self) -> Floats:
        """Rates at the end of the step as it is solved now, to compare others with."""
        return self._ahead.copy()

    @abstractmethod
    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:
        """Velocities of the contact nodes at both ends of the step [m/s], (count, dim) each."""

    def inertia(self) -> list[Floats]:
        """Moments of inertia of each body [kg m^2]; 0 of points."""
        dim = self.bodies.dim
        return [moment * np.eye(dim * (dim - 1) // 2) for moment in self.bodies.inertias]

    def spins(self) -> Floats:
        """Velocities of the contact nodes by unit spins [m]: 0 of what does not turn."""
        dim = self.bodies.dim
        return np.zeros((dim * (dim - 1) // 2, *self._start.shape))

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Displacements of the contact nodes by several forces; nothing is massless."""
        if not self._compliance.size:  # a run that goes on asks before its first layer, in vain
            return np.zeros_like(forces), np.zeros_like(forces)
        moved = forces.reshape(len(forces), -1) @ self._compliance.T
        return moved.reshape(forces.shape), np.zeros_like(forces)

    answers = columns

    def memory(self) -> dict[str, Floats]:
        """Coordinates and their rates."""
        return {"coordinates": self._q.copy(), "rates": self._v.copy()}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        self._q, self._v = memory["coordinates"].copy(), memory["rates"].copy()


class FewMidpoint(FewInterior):
    """Interior of few degrees of freedom; see `impactfem.marching.layers.Interior`.

    Contact forces act on the nodes where these are amid the step.

    Attributes:
        span: Of the step [s].
    """

    bodies: Lumped

    def __init__(
        self, bodies: Lumped, gravity: PiecewiseVector, dt: float, *, counts: bool
    ) -> None:
        """Begin at t = 0; see `FewInterior`."""
        super().__init__(bodies, gravity, dt, counts=counts)
        self.span = dt
        self._system = bodies.system
        self._mass = self._system.mass(bodies.position)
        self._jacobian = bodies.jacobian(self._q)
        self._linear = isinstance(self._system, LinearSystem)
        self._steady = steady_load(self._system)
        self._turns = np.linalg.solve(self._mass, bodies.moments)
        self._prepare(0.0)
        self._pushed = self._joined = self._kick = np.zeros_like(self._q)
        self._stretched = np.zeros(2)  # see `_look`
        self._applied: Floats | None = None  # forces from outside, (d,)
        self.massive = np.ones(len(self._start), dtype=bool)
        self.volatile = np.full(len(self._start), bodies.turning or not self._linear)

    def _prepare(self, time: float) -> None:
        """Invert M + dt C / 2 + dt^2 K / 4, with forces linearised: layers then are products."""
        stiffness, damping = tangent(self._system, (time, self.span), self._q, self._v)
        half = 0.5 * self.span
        self._inverse = np.linalg.inv(self._mass + half * damping + half**2 * stiffness)
        # Forces of stiff bodies are small differences of large products, known to their rounding.
        forces = self.span * np.abs(stiffness) @ np.abs(self._q)
        self._noise = _EPS * float((np.abs(self._inverse) @ forces).max(initial=0.0)) + _TINY
        self._renew_answer()

    def _renew_answer(self) -> None:
        """Velocities by unit forces on the contact nodes, (d, nodes dim)."""
        self._answer = self.span * self._inverse @ self._jacobian.T
        self._compliance = 0.5 * self.span * self._jacobian @ self._answer

    @property
    def surface_velocity(self) -> Floats:
        """Of the contact nodes [m/s], (count, dim)."""
        return (self.bodies.jacobian(self._q) @ self._v).reshape(self._start.shape)

    def spins(self) -> Floats:
        """Velocities of the contact nodes by unit spins in the layer [m], (turns, count, dim)."""
        return (self._jacobian @ self._turns).T.reshape(-1, *self._start.shape)

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:  # noqa: ARG002  (of others)
        """Velocities of the contact nodes at both ends of the layer without contact forces.

        Each where the bodies are then: what turns on a node that stays has none at either end, and
        with the Jacobian between them it would, now up, now down, and the force with it.
        """
        jacobian, shape = self.bodies.jacobian, self._start.shape
        if not self.bodies.turning:
            before, after = self._jacobian @ self._v, self._jacobian @ self._ahead
        else:
            before = jacobian(self._q) @ self._v
            after = jacobian(self._end(self._ahead)) @ self._ahead
        return before.reshape(shape), after.reshape(shape)

    def begin(self, start: float, end: float) -> None:
        """Solve the step without contact forces."""
        self.set_out(start, end)
        self.look()

    def set_out(self, start: float, end: float) -> None:
        """Solve a step between two times without forces of contact and joints."""
        span, self._time = step_length(start, end, self.dt), 0.5 * (start + end)
        if not self._linear or span != self.span:
            self.span = span
            self._prepare(self._time)
        self._weight = self.bodies.weights @ self.gravity(start, end)
        if self._applied is not None:
            self._weight = self._weight + self._applied
        self._pushed = self._joined = self._kick = np.zeros_like(self._q)
        self._ahead = self._settle(self._v)

    def look(self) -> None:
        """See how forces act on contact nodes as the step is solved now."""
        if self.bodies.turning:
            self._jacobian = self.bodies.jacobian(self._middle(self._ahead))
            self._renew_answer()

    @property
    def surface_iterate(self) -> Floats:
        """Displacement of contact nodes at the end of the step, as it is solved now [m]."""
        return self.bodies.places(self._end(self._ahead)) - self._start

    def changed(self, ahead: Floats) -> tuple[float, float, float]:
        """By how much rates have changed since, what changes them in the step, and rounding."""
        acting = self._inverse @ self._pushed, self._inverse @ (self.span * self._weight)
        causes = *acting, self._ahead - self._v, SHARE * self._v
        return *by_energy(self._mass, self._ahead - ahead, causes), self._noise

    def lay(self, forces: Floats) -> None:
        """Put the contact forces of the step (count, dim), to be solved for."""
        self._pushed = self.span * (self._jacobian.T @ forces.ravel())

    def settle(self) -> None:
        """Solve for the rates at the end of the step, with what has pushed so far."""
        self._ahead = self._settle(self._ahead)

    def jolt(self, impulses: Floats) -> None:
        """Change the rates now by impulses on the contact nodes [N s], (count, dim)."""
        acting = self.bodies.jacobian(self._q).T @ impulses.ravel()
        self._v = self._v + np.linalg.solve(self._mass, acting)

    def displaced(self, q: Floats) -> Floats:
        """Displacements of the contact nodes with some coordinates [m], (count, dim)."""
        return self.bodies.places(q) - self._start

    def apply(self, body: int, force: Floats, moment: Floats) -> bool:
        """See `FewInterior`; nothing that a moment could turn is asked for one."""
        if moment.any():
            return False
        if self._applied is None:
            self._applied = np.zeros_like(self._q)
        own = self.bodies.owner == body
        self._applied[own] = self.bodies.weights[own] @ force / self.bodies.masses[body]
        return True

    @property
    def linear(self) -> bool:
        """Whether its forces are."""
        return self._linear

    def at_rest(self) -> FewAtRest:
        """It as the search for equilibrium asks it."""
        return FewAtRest(self)

    def put(self, q: Floats) -> None:
        """Begin at some coordinates."""
        self._q = q
        self._jacobian = self.bodies.jacobian(q)
        self._prepare(0.0)

    def held(self, stations: Stations) -> Held:
        """It as joints hold it."""
        return HeldLumped(self, stations)

    @property
    def rates(self) -> Floats:
        """Rates of the coordinates at the start of the layer, (d,)."""
        return self._v

    @property
    def rates_ahead(self) -> Floats:
        """The same at its end, as it is solved now."""
        return self._ahead

    rates_left = rates_ahead

    @property
    def reach(self) -> Floats:
        """Rates at the end of the layer by unit impulses in it, (d, d)."""
        return self._inverse

    @cached_property
    def reach_ahead(self) -> Floats:
        """The same at its end, of impulses that leave no time for anything else, (d, d)."""
        return np.linalg.inv(self._mass)

    @property
    def noise(self) -> float:
        """Rounding of the rates."""
        return self._noise

    def reached(self, forces: Floats) -> Floats:
        """Rates by several contact forces (several, count, dim) for a second, (several, d)."""
        acting = forces.reshape(len(forces), -1) @ self._jacobian
        return np.asarray(acting @ self._inverse.T)

    def carried(self, impulses: Floats) -> Floats:
        """Velocities of the contact nodes by impulses on the coordinates, (several, count, dim)."""
        moved = impulses @ self._inverse.T @ self._jacobian.T
        return np.asarray(moved.reshape(len(impulses), *self._start.shape))

    def impel(self, impulse: Floats) -> bool:
        """Solve the layer with an impulse of joints (d,); whether it answers linearly."""
        self._joined = impulse
        self._ahead = self._settle(self._ahead)
        return self._linear

    def kick(self, impulse: Floats) -> None:
        """Let the next layer start with rates that an impulse (d,) has changed."""
        self._kick = np.linalg.solve(self._mass, impulse)

    def strike(self, forces: Floats) -> None:
        """Add the layer's contact forces (count, dim)."""
        self._pushed = self._pushed + self.span * (self._jacobian.T @ forces.ravel())
        self._ahead = self._settle(self._ahead + self._answer @ forces.ravel())

    def _middle(self, ahead: Floats) -> Floats:
        return np.asarray(self._q + 0.25 * self.span * (self._v + ahead))

    def _end(self, ahead: Floats) -> Floats:
        return np.asarray(self._q + 0.5 * self.span * (self._v + ahead))

    def _settle(self, guess: Floats) -> Floats:
        """Velocities at the end of the layer, by Newton's method with the tangent of its start."""
        ahead = guess
        for _ in range(_MOST_ITERATIONS):
            mean = 0.5 * (self._v + ahead)
            force = self._force(self._middle(ahead), mean) + self._weight
            missing = self.span * force + self._pushed + self._joined
            missing -= self._mass @ (ahead - self._v)
            change = self._inverse @ missing
            ahead = ahead + change
            if self._linear:
                return ahead
            if not np.isfinite(ahead).all():
                break
            if np.abs(change).max() <= _SETTLED * np.abs(ahead).max() + self._noise:
                return ahead
        raise ConvergenceError(
            f"the forces on {', '.join(self.bodies.names)} did not settle at t = {self._time:.6g} "
            "s; use a smaller solve.dt"
        )

    def _force(self, q: Floats, v: Floats) -> Floats:
        system = self._system
        if self._steady is None or not isinstance(system, LinearSystem):
            return system.force(self._time, q, v, self.span)
        return self._steady - system.stiffness @ q - system.damping @ v

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:  # noqa: ARG002
        """Add the layer's contact forces (count, dim)."""
        if self._linear:
            self._pushed = self._pushed + self.span * (self._jacobian.T @ forces.ravel())
            self._ahead = self._ahead + self._answer @ forces.ravel()
        else:
            self.strike(forces)

    def advance(self) -> Floats:
        """Take the coordinates and rates that were found; the work of loads [J], (d,)."""
        end, mean, work = self._end(self._ahead), 0.5 * (self._v + self._ahead), 0.0 * self._q
        if self.bodies.load is not None:
            ends = self._time - 0.5 * self.span, self._time + 0.5 * self.span
            work = self.bodies.load(*ends, self._middle(self._ahead), mean) * (end - self._q)
        if self._applied is not None:
            work = work + self._applied * (end - self._q)
        self._q, self._v = end, self._ahead + self._kick
        return work

    def _look(self) -> None:
        """Keep the most that an axis between held ends had to stretch, and what bent it [J]."""
        beam = self.bodies.beam
        if beam is not None and (stretched := beam.stretching(self._q)) > self._stretched[0]:
            self._stretched = np.array([stretched, beam.elastic(self._q)])

    def findings(self) -> Iterator[Finding]:
        """Deflections that stretch a beam between ends that are held."""
        stretched, bent = self._stretched.tolist()
        name = self.bodies.names[0]
        stiffer = 2.0 * stretched / bent if bent else 0.0  # forces of U ~ w^4 over those of ~ w^2
        text = f"{name} would be about {percent(stiffer)} stiffer by the stretching of its axis "
        text += "between its ends, which is left out"
        remedy = "smaller loads or speeds, or model it as a solid of finite strain"
        yield from by_limits("model_strain", stiffer, STRAIN_LIMITS, text, name, remedy)

    def memory(self) -> dict[str, Floats]:
        """Coordinates, their rates, and what was seen."""
        return super().memory() | {"stretched": self._stretched.copy()}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        super().remember(memory)
        self._stretched = memory["stretched"].copy()

    def initial(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """Sums of the initial state."""
        return self.summed(np.zeros(len(self._q)))

    def summed(self, work: Floats) -> list[Sums]:
        """Sums of each body, with the work of loads (d,) since the last ones [J].

        The energy of springs is told of the first.
        """
        self._look()
        bodies, none = self.bodies, np.zeros(self.bodies.dim)
        if not self.counts:
            still = np.zeros(bodies.moments.shape[1])
            return [Sums(0.0, 0.0, 0.0, none, none, still) for _ in bodies.names]
        pushing, moved = self._mass @ self._v, self._q - bodies.position
        found = []
        for body in range(len(bodies.names)):
            own = bodies.owner == body
            weights = bodies.weights[own]
            found.append(
                Sums(
                    0.5 * float(self._v[own] @ pushing[own]),
                    bodies.elastic(self._q) if body == 0 else 0.0,
                    float(work[own].sum()),
                    weights.T @ self._v[own],
                    weights.T @ moved[own],
                    bodies.moments[own].T @ self._v[own],
                )
            )
        return found
