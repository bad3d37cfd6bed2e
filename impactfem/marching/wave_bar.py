"""Layers of a bar: its waves, followed as those of bars alone are (`wave_bar_kernels`).

An end that a contact force F pushes moves with a + F / Z, where a is the wave that arrives. In a
layer only the mean of the force is asked for, so that its work is F times the way of the end,
whatever the wave does in the layer. Gravity is left out of the waves: they are those of an observer
who falls freely, for whom a clamped end rises.
"""

from collections.abc import Mapping

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.errors import SceneError
from impactfem.marching.few import FewInterior
from impactfem.marching.layers import Sums
from impactfem.marching.wave_bar_kernels import arriving_means, end_layer, integrals
from impactfem.marching.waves import Delay, left_ends
from impactfem.scene import PiecewiseVector
from impactfem.system.few import ElasticBar

_NODES = 200  # elements of the fields
_NOTHING = np.zeros(0)


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
        delay = Delay.of(bar.transit_time, dt)
        self._share, self._transit = delay.share, bar.transit_time
        self._mean, self._rise = left_ends(bar, delay, dt)
        self._clamped = bar.far_end == "clamped"
        # Speed [m/s] and way [m] of the observer who falls along the bar.
        self._fallen = np.zeros(2)
        self._arriving, self._pushed = np.zeros(2), np.zeros(2)
        self.radiating = np.ones(2, dtype=bool)
        self._across = np.kron(np.eye(2), bodies.axis)  # from forces to those along the bar
        give = np.diag([1.0, 0.0 if self._clamped else 1.0])
        self._compliance = dt / bodies.impedance * self._across.T @ give @ self._across
        self._give = np.diag(give)
        self.nodes = np.linspace(0.0, bar.length, _NODES + 1)
        self._initial = self._integrals()[2]

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:
        """Velocities of the ends in the layer without contact forces: both times their mean."""
        return way / self.dt, way / self.dt

    @property
    def surface_velocity(self) -> Floats:
        """Of the ends, means of the last layer [m/s], (2, dim)."""
        return np.asarray(self._v[:, None] * self.bodies.axis)

    def begin(self, start: float, end: float) -> None:
        """Carry the waves through the layer without contact forces."""
        arriving_means(self._mean, self._rise, self._share, self._arriving)
        self._pull = float(self.gravity(start, end) @ self.bodies.axis)
        speed = self._fallen[0] + 0.5 * self.dt * self._pull
        self._ahead = self._give * (self._arriving + speed)
        self._pushed = np.zeros(2)

    @property
    def surface_iterate(self) -> Floats:
        """Displacements of the ends at the end of the layer without contact forces [m]."""
        return self.bodies.places(self._q + self.dt * self._ahead) - self._start

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:  # noqa: ARG002
        """Add the layer's contact forces (2, dim)."""
        self._pushed = self._pushed + self._give * (forces @ self.bodies.axis)

    def finish(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """Let the waves of the layer leave and sum up."""
        dt, speed = self.dt, self._fallen[0]
        later = speed + dt * self._pull
        turned = self._pushed / self.bodies.impedance
        self._v = self._ahead + turned
        self._q = self._q + dt * self._v
        held = np.array([-speed, -later])
        end_layer(self._mean, self._rise, self._share, dt, 2.0 * turned, self._clamped, held)
        self._fallen += dt * np.array([self._pull, 0.5 * (speed + later)])
        return self._summed()

    def initial(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """Sums of the initial state."""
        return self._summed()

    def shape(self, body: int) -> tuple[Floats, Floats, Integers]:  # noqa: ARG002  (one body)
        """Its axis, undeformed."""
        bar, first = self.bodies.bar, np.arange(len(self.nodes) - 1)
        places = self.bodies.at(self.nodes, np.full(len(self.nodes), bar.gap))
        return places, np.zeros(len(places)), np.stack([first, first + 1], axis=1)

    def material(self, body: int) -> Floats:
        """On a line from the near end, as probes of bars are given; else in space."""
        return self.nodes[:, None] if self.bodies.dim == 1 else self.shape(body)[0]

    def motion(self, body: int) -> dict[str, Floats]:  # noqa: ARG002  (one body)
        """Fields at `nodes` now: displacement [m], velocity [m/s], (nodes, dim)."""
        moved, speed = self._fields()
        axis = self.bodies.axis
        given = {"displacement": moved - self.bodies.bar.gap, "velocity": speed}
        return {name: values[:, None] * axis for name, values in given.items()}

    def acting(self, body: int, forces: Floats) -> Floats:  # noqa: ARG002  (one body)
        """Contact forces [N] on these nodes: on the first and the last one."""
        found = np.zeros((len(self.nodes), self.bodies.dim))
        found[[0, -1]] = forces
        return found

    def stress(self, body: int) -> Floats:  # noqa: ARG002  (one body)
        """At `nodes` [Pa], tension > 0."""
        modulus = self.bodies.bar.at("youngs_modulus", self.nodes)
        return modulus * np.gradient(self._fields()[0], self.nodes, edge_order=1)

    def _fields(self) -> tuple[Floats, Floats]:
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

    def _summed(self) -> list[Sums]:
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
