"""Explicit layers: lumped mass, central differences, massless contact nodes in equilibrium.

    u_{m+1} = u_m + s_m,   s_m = s_{m-1} + dt^2 M^-1 (f_m - K u_m + contact forces),

the space-time Petrov-Galerkin form with layer weight beta = 0. Without contact it conserves
v M v / 2 + u_m K u_{m+1} / 2 with v = s_m / dt, which is positive while dt omega < 2.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Booleans, Floats
from impactfem.compiled import compiled
from impactfem.marching.layers import Backward, Ends, MaterialSums, Sums
from impactfem.marching.turning import Turning
from impactfem.system.drive import Drive
from impactfem.system.elastic import ElasticSystem
from impactfem.system.massless import averaged, lumped_mass
from impactfem.system.matrices import to_blocked
from impactfem.system.surface import SurfaceNodes, SurfaceStatics

_WHOLE_COLUMNS = 64  # sums of more columns cost more than two solves with the surface's stiffness


@compiled
def _advance(u, step, internal, load, inverse, gravity, keep, gain):
    """Take a step of all dofs that have mass: step = keep step + gain a, u = u + step.

    Args:
        u, step, internal: Displacement, its last step and K u, shape (dofs,).
        load: Forces besides gravity, shape (dofs,), or empty.
        inverse: Inverse masses, 0 for what is held or massless.
        gravity: Shape (dim,).
        keep, gain: Weights of the last step and of the acceleration.
    """
    dim = len(gravity)
    loaded = len(load) > 0
    for i in range(len(u)):
        if inverse[i] > 0.0:
            force = -internal[i]
            if loaded:
                force += load[i]
            step[i] = keep * step[i] + gain * (force * inverse[i] + gravity[i % dim])
            u[i] += step[i]


@compiled
def _add_up(u, step, internal, mass, inverse, arms, carried, sums):
    """Add up m s^2 / 2, u K u_m / 2, and by component m s, m u and the moments arm x m s.

    Args:
        u, step, internal, mass, inverse: As for `_advance`, with the lumped mass.
        arms: Of the nodes, shape (nodes, dim).
        carried: Mean translation without strain, shape (dim,).
        sums: Filled, shape (2 + 2 dim + 1,), in space (2 + 2 dim + 3,).
    """
    dim = arms.shape[1]
    first = 2 + 2 * dim
    sums[:] = 0.0
    for i in range(len(u)):
        if inverse[i] > 0.0:
            node, k = i // dim, i % dim
            moment = mass[i] * step[i]
            sums[0] += 0.5 * moment * step[i]
            sums[1] += 0.5 * (u[i] - carried[k]) * internal[i]
            sums[2 + k] += moment
            sums[2 + dim + k] += mass[i] * u[i]
            if dim == 2:
                sums[first] += (2 * k - 1) * arms[node, 1 - k] * moment
            else:
                one, two = (k + 1) % 3, (k + 2) % 3
                sums[first + one] += arms[node, two] * moment
                sums[first + two] -= arms[node, one] * moment


class Leapfrog:
    """Explicit interior; see `impactfem.marching.layers.Interior`."""

    rolling = False
    apart: NDArray[np.int64] | None = None

    def __init__(
        self,
        system: ElasticSystem,
        surface: SurfaceNodes,
        statics: SurfaceStatics | None,
        transfer: Any,
        dt: float,
    ) -> None:
        """Prepare vectors; with ``statics`` and ``transfer`` the contact nodes are massless."""
        self.dt = dt
        self.whole_columns: int | None = None if statics is None else _WHOLE_COLUMNS
        self._system, self._surface, self._statics = system, surface, statics
        self.massive = self.radiating = self.volatile = np.zeros(surface.count, dtype=bool)
        self._transfer, self._drive = transfer, Drive(system, transfer)
        self._matrix = to_blocked(system.stiffness)  # its products are faster
        self._now, self._internal = self._matrix.createVecs()
        self._strained: Floats = self._now.getArray()
        self._forces: Floats = self._internal.getArray()
        self._carried = np.zeros(system.dim)
        self.displacement: Floats = system.displacement.copy()
        self._step = dt * system.velocity
        self._mass, self._inverse = lumped_mass(system, transfer, surface)
        self._load = np.zeros(len(self._mass) if self._drive.is_active else 0)
        self._loads, self._lift = np.zeros_like(self._load), np.zeros_like(self._load)
        self._reaction = np.zeros(len(self._drive.moved))
        # Mass damping is taken in the middle of the step, stiffness damping at its start.
        slow = 0.5 * system.rayleigh_mass * dt
        self._keep, self._gain = (1.0 - slow) / (1.0 + slow), dt * dt / (1.0 + slow)
        self._lag = system.rayleigh_stiffness / dt
        # Massless nodes have no momentum of their own.
        moving = np.where(self._inverse > 0.0, self._mass, 0.0)
        self._turning = Turning.of(system, lambda velocity: moving * velocity)
        self._spins: Floats | None = None
        self._sums = np.zeros(2 + 2 * system.dim + len(self._turning.inertia))
        self.share, self._work = 1.0, 0.0
        self._given: Floats | None = None  # the step that the first half step began with
        self.begun = np.zeros_like(self._step)  # what velocities change by in it [m/s]
        self._contact = self._contact_at(0.0)

    @property
    def velocity(self) -> Floats:
        """Velocity during the last layer [m/s]."""
        return self._step / self.dt

    @property
    def surface_displacement(self) -> Floats:
        """Displacement of the contact nodes, massless ones in equilibrium, (count, dim)."""
        return self._contact

    @property
    def surface_iterate(self) -> Floats:
        """The same at the end of the layer, as it is solved now."""
        return self._contact

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:
        """Velocities of contact nodes in the layers beside the level [m/s] (collective)."""
        return self._surface.gather(self.velocity), way / self.dt

    def roots(self) -> None:
        """Nothing is volatile."""

    def answers(self, forces: Floats) -> tuple[Floats, Floats]:
        """Never asked: no answer changes."""
        return self.columns(forces)

    def inertia(self) -> list[Floats]:
        """Moments of inertia [kg m^2]; see `Turning`."""
        return [self._turning.inertia]

    def spins(self) -> Floats:
        """Velocities of the contact nodes by unit spins [m], (turns, count, dim) (collective)."""
        if self._spins is None:
            self._spins = np.stack([self._surface.gather(row) for row in self._turning.rows])
        return self._spins

    def gravity(self, start: float, end: float) -> Floats:  # noqa: ARG002  (as the interface has it)
        """Gravity that acts at the start of a layer [m/s^2], shape (dim,)."""
        return self._drive.gravity(*self._around(start))

    def _around(self, time: float) -> tuple[float, float]:
        """Times between which forces act at a level [s]."""
        return max(0.0, time - 0.5 * self.dt), time + 0.5 * self.dt

    def _contact_at(self, time: float) -> Floats:
        if self._statics is None:
            return self._surface.gather(self.displacement)
        pull = self._drive.pull(time)
        load = None if pull is None else self._surface.gather(pull)
        found = self._statics.equilibrium(self.displacement, load)
        self._surface.spread(found, self.displacement)
        return found

    def begin(self, start: float, end: float) -> None:
        """Take the step without contact forces."""
        drive, first = self._drive, start == 0.0
        self._strain(0.0 if first else self._lag)
        if drive.is_active:
            self._loads = drive.load(*self._around(start))
            self._lift = drive.lift(start)
            self._load[:] = self._loads + self._lift
            self._reaction = drive.reaction(self.displacement)
            self._work = 0.0 if first else self._half_work()
        # What acts at t = 0 acts for half a step. (Contact nodes with mass take half the forces of
        # two layers: the share is in the one that lies before t = 0 and is missing.)
        self.share = 0.5 if first and self._statics is not None else 1.0
        keep, gain = (1.0, 0.5 * self._gain) if first else (self._keep, self._gain)
        self._given = self._step.copy() if first else None
        _advance(
            self.displacement, self._step, self._forces, self._load, self._inverse,
            self.gravity(start, end), keep, gain,
        )  # fmt: skip
        if drive.has_moved:
            place = self._system.supports.motion(end)[0]
            self._step[drive.moved] = place - self.displacement[drive.moved]
            self.displacement[drive.moved] = place
        self._before = self._contact
        self._contact = self._contact_at(end)

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Answers of the contact nodes to several forces in a layer that is not the first."""
        if self._statics is not None:
            near = self._statics.near
            return self._statics.answers(forces, self._gain * self._inverse[near])
        layer, answer = np.empty_like(forces), np.zeros_like(self.displacement)
        for k, force in enumerate(forces):
            self._surface.spread(force, answer)
            layer[k] = self._surface.gather(self._gain * self._inverse * answer)
        return layer, np.zeros_like(forces)

    def static(self, forces: Floats) -> Floats:
        """Displacement of massless contact nodes by static forces on them, (count, dim) each."""
        return np.zeros_like(forces) if self._statics is None else self._statics.response(forces)

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:  # noqa: ARG002  (as the interface has it)
        """Add contact forces; ``change`` is the answer of the contact nodes, if known."""
        if self._statics is None:
            where = self._surface.dofs
            values = forces.ravel()[self._surface.places]
        else:
            where = self._statics.near
            values = -self._statics.pushed(self._statics.response(forces))
        values = self.share * self._gain * self._inverse[where] * values
        self._step[where] += values
        self.displacement[where] += values
        if self._given is not None and self._statics is None:  # nodes that are struck
            struck = where[values != 0.0]
            self._given[struck] = self._step[struck]
        if change is None and self._statics is not None:
            change = self._statics.equilibrium_of_near(values)
        if change is not None:
            self._contact = self._contact + change

    def finish(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """End the layer and sum up."""
        if self._statics is not None:
            self._surface.spread(self._contact, self.displacement)
            self._surface.spread(self._contact - self._before, self._step)
        found = self._summed(1.0)
        if self._given is not None:
            begun = np.where(self._inverse > 0.0, self._step - self._given, 0.0) / self.dt
            self.begun, found[0].early = begun, 0.5 * float(self._mass @ begun**2)
        return found

    def relax(self, loose: Booleans, time: float) -> None:  # noqa: ARG002  (as others)
        """Put contact nodes, which carry no mass, where they are without supports (collective)."""
        self._contact = self._contact_at(time)

    def initial(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """Sums of the initial state."""
        self._strain(0.0)
        if self._drive.is_active:
            self._lift = self._drive.lift(0.0)
        return self._summed(0.0)

    def _strain(self, lag: float) -> None:
        """K u without the translation, whose rounding would push; with ``lag`` steps ahead."""
        dim = self._system.dim
        self._carried = self._system.carried(self.displacement)
        places, strained = (x.reshape(-1, dim) for x in (self.displacement, self._strained))
        np.subtract(places, self._carried, out=strained)
        if lag:
            self._strained += lag * self._step
        self._matrix.mult(self._now, self._internal)

    def _half_work(self) -> float:
        """Work of loads and moved supports at a level along half of the step before or after it."""
        work = 0.5 * float(self._loads @ self._step)
        return work + 0.5 * float(self._reaction @ self._step[self._drive.moved])

    def _summed(self, back: float) -> list[Sums]:
        """Sums at the end of a layer; ``back`` is 0 at t = 0, where there is no step yet."""
        dim, drive = self._system.dim, self._drive
        _add_up(
            self.displacement, self._step, self._forces, self._mass, self._inverse,
            self._turning.arms, self._carried, self._sums,
        )  # fmt: skip
        elastic, work = self._sums[1], 0.0
        if drive.is_active:
            work = self._work + self._half_work()
            self._work = 0.0
        if drive.has_moved:
            before = self.displacement - back * self._step
            elastic += drive.elastic(before, self.displacement)
            if self._statics is not None:  # K u of massless nodes, in balance with moved supports
                massless = self._surface.dofs
                elastic += 0.5 * float(self.displacement[massless] @ self._lift[massless])
        momentum, moment = self._sums[2 : 2 + 2 * dim].reshape(2, dim).copy()
        if drive.has_moved:
            momentum, moment = drive.moments(self._step), drive.moments(self.displacement)
        sums = Sums(
            self._sums[0] / self.dt**2, elastic, work, momentum / self.dt, moment,
            self._sums[2 + 2 * dim :] / self.dt,
        )  # fmt: skip
        return [sums]

    def placed(self, static: Floats) -> Floats:
        """Displacement of the owned dofs with massless nodes where they are, as a new array."""
        found = self.displacement.copy()
        self._surface.spread(self._contact + static, found)
        return found

    @property
    def reversible(self) -> bool:
        """Whether `backward` knows all that happens in a layer."""
        return self._statics is not None and not self._drive.has_moved

    @property
    def dofs(self) -> int:
        """How many owned dofs `backward` takes."""
        return len(self.velocity)

    def backward(
        self, place: Floats, rate: Floats, contact: Floats, *, first: bool,
        parts: Floats | None = None,  # noqa: ARG002  (no solve to spare)
    ) -> Backward:  # fmt: skip
        """Derivatives by what a layer begins with; see `Reversible`."""
        moving = self._inverse > 0.0
        moved = np.where(moving, self.settled(place, contact), 0.0)
        stepped = np.where(moving, rate, 0.0) + moved
        keep, gain, lag = self._keep, self._gain, self._lag
        if first:
            keep, gain, lag = 1.0, 0.5 * gain, 0.0
        loads = gain * self._inverse * stepped
        forces = self._statics.equilibrium(loads) if self._statics else np.zeros_like(contact)
        pulled = self._pulled(loads)
        return Backward(moved - pulled, keep * stepped - lag * pulled, forces, loads)

    def settled(self, place: Floats, contact: Floats) -> Floats:
        """Derivatives by displacements, with those by contact nodes; see `Reversible`."""
        found = place.copy()
        if self._statics is not None:
            found[self._statics.near] -= self._statics.pushed(self._statics.response(contact))
            found[self._surface.dofs] = 0.0
        return found

    def _pulled(self, place: Floats) -> Floats:
        """Elastic forces on what has mass by its displacements; contact nodes follow, (dofs,)."""
        strained = place.copy()
        if self._statics is not None:
            self._surface.spread(self._statics.equilibrium(place), strained)
        self._now.setArray(strained)
        self._matrix.mult(self._now, self._internal)
        return np.where(self._inverse > 0.0, self._internal.getArray(), 0.0)

    def energies_by(self, placed: Floats, velocity: Floats) -> tuple[Floats, Floats]:
        """Elastic energy by displacements, without that of contact, kinetic by velocities."""
        moving = np.where(self._inverse > 0.0, self._mass, 0.0)
        return self._pulled(placed), moving * velocity

    def eased(self, place: Floats | float, contact: Floats) -> Floats | None:  # noqa: ARG002  (of what has mass)
        """How far forces on contact nodes move them; see `Reversible`."""
        return self.on_contact(self.static(contact)) if contact.any() else None

    def on_contact(self, values: Floats) -> Floats:
        """Values of the contact nodes on the owned dofs; see `Reversible`."""
        return self._surface.pulled(values, self._system.constrained)

    def vary(self, into: MaterialSums, loads: Floats, ends: Ends) -> None:
        """Add derivatives by the material that a layer makes; see `Reversible`."""
        first = ends.start == 0.0
        keep, gain = (1.0, 0.5 * self._gain) if first else (self._keep, self._gain)
        before, after = self.dt * ends.velocity, self.dt * ends.end_velocity
        strained = ends.place if first else ends.place + self._lag * before
        dim = self._system.dim
        strained = (strained.reshape(-1, dim) - self._system.carried(strained)).ravel()
        reached = loads.copy()
        if self._statics is not None:
            self._surface.spread(self._statics.equilibrium(strained, ends.forces), strained)
            self._surface.spread(self._statics.equilibrium(loads), reached)
        into.stiff(-reached, strained)
        change = ((after - keep * before) / gain).reshape(-1, dim)
        change -= self.gravity(ends.start, ends.end)
        self.vary_weight(into, -loads * change.ravel())

    def vary_product(self, into: MaterialSums, one: Floats, other: Floats) -> None:
        """Add those of one . M other; see `Reversible`."""
        self.vary_weight(into, one * other)

    def vary_weight(self, into: MaterialSums, values: Floats) -> None:
        """Add those of sums by mass; see `Reversible`."""
        moving = np.where(self._inverse > 0.0, values, 0.0)
        into.weigh(averaged(self._transfer, moving))

    @property
    def lag(self) -> float:
        """Steps by which damping looks ahead of what strains."""
        return self._lag

    def sums_by(self) -> tuple[Floats, Floats]:
        """Mass times displacement and momentum; see `Reversible`."""
        moving = np.where(self._inverse > 0.0, self._mass, 0.0)
        axes = np.tile(np.eye(self._system.dim), len(moving) // self._system.dim) * moving
        return axes, axes / self.dt

    def state(self) -> dict[str, Any]:
        """What the next layer needs."""
        return {"displacement": self.displacement.copy(), "step": self._step.copy()}

    def memory(self) -> dict[str, Floats]:
        """Nothing besides."""
        return {}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Nothing."""

    def restore(self, state: dict[str, Any], surface: Floats) -> None:
        """Continue from a state; ``surface`` was `surface_displacement`, to the last bit."""
        self.displacement[:] = state["displacement"]
        self._step[:] = state["step"]
        self._contact = surface.copy()

    def destroy(self) -> None:
        """Free PETSc's vectors."""
        self._now.destroy()
        self._internal.destroy()
        self._matrix.destroy()
