"""Layers of a bar: its waves, followed as those of bars alone are (`wave_bar_kernels`).

An end that a contact force F pushes moves with a + F / Z, where a is the wave that arrives. In a
step only the mean of the force is asked for, so that its work is F times the way of the end,
whatever the wave does in the step. A layer goes in one step, or in several where other bodies cut
it; what leaves in all of them becomes the line of the layer. Gravity is left out of the waves: they
are those of an observer who falls freely, for whom a clamped end rises.
"""

from collections.abc import Mapping

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.errors import SceneError
from impactfem.marching.bar_start import BarAtRest
from impactfem.marching.few import FewInterior
from impactfem.marching.held_rows import HeldLumped
from impactfem.marching.iterated import SHARE
from impactfem.marching.layers import Sums
from impactfem.marching.marched import Shown
from impactfem.marching.stations import Held
from impactfem.marching.wave_bar_kernels import arriving_means, end_layer, integrals
from impactfem.marching.waves import Delay, left_ends
from impactfem.scene import Bar, PiecewiseVector
from impactfem.system.few import ElasticBar
from impactfem.system.stations import Stations

_NODES = 200  # elements of the fields
_NOTHING = np.zeros(0)
_WHOLE = 1e-9  # of a layer: a step that ends closer to its end ends there
_EPS = 4.0 * float(np.finfo(float).eps)
_YIELDING = 1e16
"""Times by which ends give way to what acts in no time more than in a layer: it leaves them."""


class WaveBar(FewInterior):
    """Interior of a bar; see `impactfem.marching.layers.Interior`."""

    bodies: ElasticBar

    def __init__(
        self, bodies: ElasticBar, gravity: PiecewiseVector, dt: float, *, counts: bool
    ) -> None:
        """Begin at t = 0; see `FewInterior`.

        Raises:
            SceneError: The step is longer than a wave needs through the bar.
        """
        super().__init__(bodies, gravity, dt, counts=counts)
        bar = bodies.bar
        if dt > bar.transit_time * (1.0 + 1e-9):
            raise SceneError(
                f"solve.dt = {dt:g} s is longer than a wave needs through {bar.name}, "
                f"{bar.transit_time:g} s: give a smaller one"
            )
        self._delay = Delay.of(bar.transit_time, dt)
        self._share, self._transit = self._delay.share, bar.transit_time
        self._mean, self._rise = left_ends(bar, self._delay, dt)
        self._clamped = bar.far_end == "clamped"
        # Speed [m/s] and way [m] of the observer who falls along the bar.
        self._fallen = np.zeros(2)
        self._arriving, self._pushed = np.zeros(2), np.zeros(2)
        self._borders, self._pushes = [0.0], list[Floats]()  # of the steps of the layer so far
        self._speeds = [0.0]  # of the clamped end, to who falls
        self.radiating = np.ones(2, dtype=bool)
        self._across = np.kron(np.eye(2), bodies.axis)  # from forces to those along the bar
        self._give = np.array([1.0, 0.0 if self._clamped else 1.0])
        self._answer = self._across.T @ np.diag(self._give) @ self._across
        self._compliance = dt / bodies.impedance * self._answer
        self._span, self._last, self._pull = dt, 1.0, 0.0
        self._unhurt = self._ahead
        self._joined, self.noise = np.zeros(2), 0.0
        self.nodes = np.linspace(0.0, bar.length, _NODES + 1)
        self._initial = self._integrals()[2]
        self.shown = ShownBar(self)

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:
        """Velocities of the ends in the step without contact forces: both times their mean."""
        return way / self._span, way / self._span

    @property
    def surface_velocity(self) -> Floats:
        """Of the ends, means of the last layer [m/s], (2, dim)."""
        return np.asarray(self._v[:, None] * self.bodies.axis)

    def _unpushed(self, start: float, end: float) -> tuple[Floats, float]:
        """Mean velocities of the ends without contact forces in a step [m/s]; its end in the layer.

        The layer is that of the last step, or the next one if that has ended.
        """
        last = self._borders[-1] + (end - start) / self.dt
        last = 1.0 if last > 1.0 - _WHOLE else last
        arriving_means(self._mean, self._rise, self._share, self._borders[-1], last, self._arriving)
        pull = float(self.gravity(start, end) @ self.bodies.axis)
        speed = self._fallen[0] + 0.5 * (last - self._borders[-1]) * self.dt * pull
        return self._give * (self._arriving + speed), last

    def predicted(self, start: float, end: float) -> Floats:
        """Where the ends go if nothing pushes [m], (2, dim)."""
        speeds, _ = self._unpushed(start, end)
        return self.bodies.places(self._q + (end - start) * speeds) - self._start

    def begin(self, start: float, end: float) -> None:
        """Carry the waves through the step without forces of contact and joints."""
        self._pull = float(self.gravity(start, end) @ self.bodies.axis)
        self._unhurt, self._last = self._unpushed(start, end)
        self._span = (self._last - self._borders[-1]) * self.dt
        self._compliance = self._span / self.bodies.impedance * self._answer
        self._ahead = self._unhurt
        self._pushed, self._joined = np.zeros(2), np.zeros(2)

    set_out = begin

    def at_rest(self) -> BarAtRest:
        """It as the search for equilibrium asks it."""
        return BarAtRest(self)

    def displaced(self, q: Floats) -> Floats:
        """Displacements of the ends with some coordinates [m], (2, dim)."""
        return self.bodies.places(q) - self._start

    def put(self, ends: Floats, bar: Bar) -> float:
        """Begin with displacements of the ends [m], (2,), and the waves of a bar; its way [m]."""
        self._q = ends
        self._mean, self._rise = left_ends(bar, self._delay, self.dt)
        return self._integrals()[2] - self._initial

    def held(self, stations: Stations) -> Held:
        """It as joints hold it."""
        return HeldLumped(self, stations)

    @property
    def rates(self) -> Floats:
        """Of the ends, means of the last step [m/s], (2,)."""
        return self._v

    @property
    def rates_ahead(self) -> Floats:
        """Those that with `rates` have the means of the step, as it is solved now [m/s], (2,)."""
        return 2.0 * self._ahead - self._v

    rates_left = rates_ahead

    @property
    def span(self) -> float:
        """Of the step [s]."""
        return self._span

    @property
    def reach(self) -> Floats:
        """Rates of the ends by unit impulses in the step, (2, 2)."""
        return 2.0 / (self._span * self.bodies.impedance) * np.diag(self._give)

    @property
    def reach_ahead(self) -> Floats:
        """The same by what acts in no time, which leaves them: they have no mass."""
        return _YIELDING * self.reach

    def impel(self, impulse: Floats) -> bool:
        """Solve the step with an impulse of joints on the ends (2,); it answers linearly."""
        self._joined = self._give * impulse / self._span
        self.settle()
        return True

    def kick(self, impulse: Floats) -> None:
        """Nothing: see `reach_ahead`."""

    def strike(self, forces: Floats) -> None:
        """Add the step's contact forces (2, dim)."""
        self._pushed = self._pushed + self._give * (forces @ self.bodies.axis)
        self.settle()

    def reached(self, forces: Floats) -> Floats:
        """Rates by several contact forces (several, 2, dim) for a second, (several, 2)."""
        return np.asarray(forces @ self.bodies.axis @ self.reach)

    def carried(self, impulses: Floats) -> Floats:
        """Velocities of the ends by impulses on them, (several, 2, dim)."""
        return np.asarray((impulses @ self.reach)[..., None] * self.bodies.axis)

    @property
    def surface_iterate(self) -> Floats:
        """Displacements of the ends at the end of the step, as it is solved now [m]."""
        return self.bodies.places(self._q + self._span * self._ahead) - self._start

    def lay(self, forces: Floats) -> None:
        """Put the contact forces of the step (2, dim), to be solved for."""
        self._pushed = self._give * (forces @ self.bodies.axis)

    def settle(self) -> None:
        """Take what has pushed so far."""
        self._ahead = self._unhurt + (self._pushed + self._joined) / self.bodies.impedance

    def look(self) -> None:
        """Nothing: ends answer the same at any place."""

    def changed(self, ahead: Floats) -> tuple[float, float, float]:
        """By how much rates have changed since, what changes them in the step, and rounding."""
        causes = self._pushed / self.bodies.impedance, self._ahead - self._v, SHARE * self._v
        largest = float(np.abs(self._mean).max() + np.abs(self._rise).max())
        size, *sizes = (float(np.abs(each).max()) for each in (self._ahead - ahead, *causes))
        return size, max(sizes), _EPS * largest

    def advance(self) -> float:
        """End the step; with the last one of a layer its waves leave. No loads work on it [J]."""
        self._v = self._ahead
        self._q = self._q + self._span * self._v
        self._borders.append(self._last)
        self._pushes.append(2.0 * ((self._pushed + self._joined) / self.bodies.impedance))
        speed = self._fallen[0]
        later = speed + self._span * self._pull
        self._fallen += self._span * np.array([self._pull, 0.5 * (speed + later)])
        self._speeds.append(-later)
        if self._last == 1.0:
            self._leave()
        return 0.0

    def _leave(self) -> None:
        """Let the waves of the layer leave."""
        end_layer(
            self._mean, self._rise, self._share, self.dt, np.array(self._borders),
            np.array(self._pushes), self._clamped, np.array(self._speeds),
        )  # fmt: skip
        self._borders, self._pushes, self._speeds = [0.0], [], [-self._fallen[0]]

    def fields(self) -> tuple[Floats, Floats]:
        """Displacement [m] and velocity [m/s] along the bar at `nodes`, (nodes,) each."""
        displacement, rate = np.zeros((2, len(self.nodes)))
        self._integrals(self.nodes / self.bodies.bar.wave_speed, displacement, rate)
        return displacement + self._fallen[1], rate + self._fallen[0]

    def _integrals(
        self, nodes: Floats = _NOTHING, displacement: Floats = _NOTHING, rate: Floats = _NOTHING
    ) -> tuple[float, float, float, float]:
        place = self._q[0] - self._fallen[1]
        found: tuple[float, float, float, float] = integrals(
            self._mean, self._rise, self._share, self.dt, self._transit, place, nodes,
            displacement, rate,
        )  # fmt: skip
        return found

    def summed(self, work: float) -> list[Sums]:  # noqa: ARG002  (none is done on it)
        """Sums between two layers."""
        bodies, mass = self.bodies, self.bodies.masses[0]
        none = np.zeros(bodies.dim)
        still = np.zeros(bodies.dim * (bodies.dim - 1) // 2)
        if not self.counts:
            return [Sums(0.0, 0.0, 0.0, none, none, still)]
        kinetic, elastic, place, speed = self._integrals()
        fallen, way = self._fallen
        return [
            Sums(
                bodies.impedance * kinetic + mass * fallen * (speed + 0.5 * fallen),
                bodies.impedance * elastic,
                0.0,
                mass * (speed + fallen) * bodies.axis,
                mass * (place + way - self._initial) * bodies.axis,
                still,
            )
        ]

    def memory(self) -> dict[str, Floats]:
        """The ends, the waves, and the observer who falls."""
        own = {"means": self._mean, "rises": self._rise, "fallen": self._fallen}
        return super().memory() | {name: values.copy() for name, values in own.items()}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        super().remember(memory)
        self._mean, self._rise = memory["means"].copy(), memory["rises"].copy()
        self._fallen = memory["fallen"].copy()
        self._speeds = [-self._fallen[0]]


class ShownBar(Shown[WaveBar]):
    """The axis of a bar, with its stress."""

    def shape(self, body: int) -> tuple[Floats, Floats, Integers]:  # noqa: ARG002  (one body)
        """Its axis, undeformed."""
        nodes, bodies = self._march.nodes, self._march.bodies
        places = bodies.at(nodes, np.full(len(nodes), bodies.bar.gap))
        first = np.arange(len(nodes) - 1)
        return places, np.zeros(len(places)), np.stack([first, first + 1], axis=1)

    def material(self, body: int) -> Floats:
        """On a line from the near end, as probes of bars are given; else in space."""
        return self._march.nodes[:, None] if self._bodies.dim == 1 else self.shape(body)[0]

    def motion(self, body: int) -> dict[str, Floats]:  # noqa: ARG002  (one body)
        """Fields at its nodes now: displacement [m], velocity [m/s], (nodes, dim)."""
        (moved, speed), bodies = self._march.fields(), self._march.bodies
        given = {"displacement": moved - bodies.bar.gap, "velocity": speed}
        return {name: values[:, None] * bodies.axis for name, values in given.items()}

    def acting(self, body: int, forces: Floats) -> Floats:  # noqa: ARG002  (one body)
        """Contact forces [N] on these nodes: on the first and the last one."""
        found = np.zeros((len(self._march.nodes), self._bodies.dim))
        found[[0, -1]] = forces
        return found

    def stress(self, body: int) -> Floats:  # noqa: ARG002  (one body)
        """At its nodes [Pa], tension > 0."""
        modulus = self._march.bodies.bar.at("youngs_modulus", self._march.nodes)
        return modulus * np.gradient(self._march.fields()[0], self._march.nodes, edge_order=1)
