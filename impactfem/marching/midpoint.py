"""Implicit layers: the midpoint rule (layer weight beta = 1/4), with one factorisation.

With w = u + b v in the middle of the layer (b: stiffness damping, a: mass damping, tau = 2 b / dt)

    (K + mu M) w = f + M (mu u_a + 2 v_a / dt) + contact forces,
    mu = 2 (2 / dt + a) / (dt (1 + tau)),
    u_b = u_a + 2 (w - u_a) / (1 + tau),   v_b = 2 (u_b - u_a) / dt - v_a.

With Maxwell terms (`impactfem.system.relaxation`) w = u + sum g r + b v, tau grows by the sum of
g / (1 + k), and u_a + sum g r_a / (1 + k) stands for u_a but in the first term of u_b. Massless
nodes are in equilibrium at the levels, so that they creep:

    K_c (u_b + sum g r_b) = lambda_b,   u_b + sum g r_b = (1 + sum g / (1 + k)) u_b + what is known.

Where theta of their law is 1/2 (`impactfem.contact.layer_law`) that keeps the balance of energy
exactly; in layers in which contact begins or ends it misses theta - 1/2 times the change of the
force times what the nodes creep without it.

Massless contact nodes have zero rows in M: there w is in equilibrium.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.fem import MPI, products_in_order
from impactfem.marching.layers import Backward, Ends, MaterialSums, Sums
from impactfem.marching.turning import Turning
from impactfem.system.drive import Drive
from impactfem.system.elastic import ElasticSystem
from impactfem.system.linear import LinearSolver
from impactfem.system.massless import averaged, transferred
from impactfem.system.relaxation import Relaxation, named
from impactfem.system.surface import SurfaceNodes, SurfaceStatics

_COLUMN_BYTES = 2**28  # kept answers to unit forces; beyond this a layer solves once more


class Midpoint:
    """Implicit interior; see `impactfem.marching.layers.Interior`."""

    rolling = False
    share = 1.0
    apart: NDArray[np.int64] | None = None

    def __init__(
        self,
        system: ElasticSystem,
        surface: SurfaceNodes,
        statics: SurfaceStatics | None,
        transfer: Any,
        dt: float,
        linear_solver: str,
    ) -> None:
        """Factor once; with ``statics`` and ``transfer`` the contact nodes are massless.

        Raises:
            ConvergenceError: The matrix cannot be factored.
        """
        self.dt, self._kind = dt, linear_solver
        self.whole_columns: int | None = None
        self._system, self._surface, self._statics = system, surface, statics
        self.massive = self.radiating = self.volatile = np.zeros(surface.count, dtype=bool)
        self._transfer, self._drive = transfer, Drive(system, transfer)
        lag = 2.0 * system.rayleigh_stiffness / dt + system.relaxation.stiffening(dt)
        self._mu = 2.0 * (2.0 / dt + system.rayleigh_mass) / (dt * (1.0 + lag))
        self._advance = 2.0 / (1.0 + lag)
        with products_in_order(system.comm):
            self._mass = system.mass if transfer is None else system.mass.ptap(transfer)
        matrix = system.stiffness.copy()
        matrix.axpy(self._mu, self._mass)
        self._solver = LinearSolver(matrix, linear_solver, system.stiffness.getNearNullSpace())
        self._vectors = [system.stiffness.createVecRight() for _ in range(4)]
        self._argument, self._right, self._middle, self._product = self._vectors
        # Not the array of `_right`: PETSc keeps norms of vectors that are written behind its back.
        self._sum = np.zeros(len(system.constrained))
        self.displacement: Floats = system.displacement.copy()
        self.velocity: Floats = system.velocity.copy()
        self._relaxing = system.relaxation.rest(len(self.displacement))
        self._stiffened = 1.0 + system.relaxation.stiffening(dt)
        self._held: Floats | None = None  # see `Relaxation.held`
        self._still = system.constrained.copy()
        if statics is not None:
            self._still[surface.dofs] = True
        weights = np.repeat(system.node_mass, system.dim)
        self._weights = np.where(system.constrained, 0.0, transferred(transfer, weights))
        self._turning = Turning.of(system, self._times_mass)
        self._spins: Floats | None = None
        self._columns = np.empty((0, len(self.displacement)))  # answers, in the order of asking
        self._gather_columns = True
        self._loads, self._times = np.zeros(0), (0.0, 0.0)
        self._contact = self._contact_at(0.0)
        if statics is not None:
            surface.spread(self._contact, self.displacement)

    @property
    def surface_displacement(self) -> Floats:
        """Displacement of the contact nodes, massless ones in equilibrium, (count, dim)."""
        return self._contact

    def inertia(self) -> list[Floats]:
        """Moments of inertia [kg m^2]; see `Turning`."""
        return [self._turning.inertia]

    def spins(self) -> Floats:
        """Velocities of the contact nodes by unit spins [m], (turns, count, dim) (collective)."""
        if self._spins is None:
            self._spins = np.stack([self._surface.gather(row) for row in self._turning.rows])
        return self._spins

    @property
    def surface_iterate(self) -> Floats:
        """The same at the end of the layer, as it is solved now."""
        return self._contact

    def gravity(self, start: float, end: float) -> Floats:
        """Mean gravity of a layer [m/s^2], shape (dim,)."""
        return self._drive.gravity(start, end)

    def _contact_at(self, time: float) -> Floats:
        if self._statics is None:
            return self._surface.gather(self.displacement)
        more, held = self._stiffened, self._held
        if held is None:
            pull = self._drive.pull(time)
            load = None if pull is None else self._surface.gather(pull)
            return self._statics.equilibrium(self.displacement, load)
        pull = self._drive.pull(time, more, held)
        load = None if pull is None else self._surface.gather(pull)
        found = self._statics.equilibrium(more * self.displacement + held, load)
        return (found - self._surface.gather(held)) / more

    def _times_mass(self, values: Floats) -> Floats:
        self._argument.setArray(values)
        self._mass.mult(self._argument, self._product)
        found: Floats = self._product.getArray()
        return found

    def begin(self, start: float, end: float) -> None:
        """Solve the layer without contact forces."""
        system, drive, dt = self._system, self._drive, self.dt
        self._times = start, end
        gravity = self.gravity(start, end)
        straining, relaxation = self.displacement, system.relaxation
        if relaxation:
            straining = straining + relaxation.pull(self._relaxing, dt)
            self._held = relaxation.held(self._relaxing, self.displacement, dt)
        motion = self._mu * straining + (2.0 / dt) * self.velocity
        carried = np.tile(system.carried(motion), len(motion) // system.dim)
        motion -= carried
        carried /= self._mu  # of the middle: the equations are solved for what strains
        right = self._sum
        right[:] = self._times_mass(motion)
        right.reshape(-1, system.dim)[:] += self._weights.reshape(-1, system.dim) * gravity
        if drive.is_active:
            self._loads = drive.load(start, end)
            right += self._loads + 0.5 * (drive.lift(start) + drive.lift(end))
            if relaxation and drive.has_moved:
                way = system.supports.motion(end)[0] - self.displacement[drive.moved]
                amid = relaxation.amid(self._relaxing[:, drive.moved], way, dt)
                right += drive.lifted(relaxation.straining(amid))
        right[system.constrained] = 0.0
        if self._solver.is_iterative:  # from where the body would be without forces
            guess = straining + (0.5 * dt) * self.velocity - carried
            guess[system.constrained] = 0.0
            self._middle.setArray(guess)
        self._right.setArray(right)
        self._solver.solve(self._right, self._middle)
        self._before = self.displacement.copy()
        change = self._advance * (self._middle.getArray() - (straining - carried))
        change[self._still] = 0.0
        self.displacement += change
        if drive.has_moved:
            self.displacement[drive.moved] = system.supports.motion(end)[0]
        self._contact_before = self._contact
        self._contact = self._contact_at(end)

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Answers of the contact nodes to several forces in a layer."""
        layer, static = np.empty_like(forces), np.empty_like(forces)
        for k, force in enumerate(forces):
            layer[k], static[k] = self._column(force)
        return layer, static

    def _column(self, forces: Floats) -> tuple[Floats, Floats]:
        answer = self._answer(forces)
        self._keep_column(answer)
        return self._answer_of_contact(answer), self.static(forces)

    def static(self, forces: Floats) -> Floats:
        """Displacement of massless contact nodes by static forces on them, (count, dim) each."""
        if self._statics is None:
            return np.zeros_like(forces)
        return self._statics.response(forces) / self._stiffened

    def _answer_of_contact(self, answer: Floats) -> Floats:
        if self._statics is None:
            return self._surface.gather(answer)
        return self._statics.equilibrium(answer)

    def _answer(self, forces: Floats) -> Floats:
        """Change of all displacements at the end of the layer."""
        return self._solved(self._surface.pulled(forces, self._system.constrained))

    def _solved(self, forces: Floats) -> Floats:
        """The same by forces on the owned dofs (collective)."""
        self._right.setArray(forces)
        # An answer must not depend on what was solved before: restarted runs are equal bit by bit.
        self._middle.set(0.0)
        self._solver.solve(self._right, self._middle)
        answer: Floats = self._advance * self._middle.getArray()
        answer[self._still] = 0.0
        return answer

    def _keep_column(self, answer: Floats) -> None:
        """Keep the answer to a force that was asked for, as long as there is room."""
        count = len(self._columns) + 1
        largest = self._surface.comm.allreduce(len(answer), op=MPI.MAX)
        if count * largest * 8 > _COLUMN_BYTES:
            self._gather_columns = False
        if self._gather_columns:
            self._columns = np.vstack([self._columns, answer])

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:
        """Add contact forces; ``change`` is the answer of the contact nodes, if known."""
        answer = parts @ self._columns if self._gather_columns else self._answer(forces)
        self.displacement += answer
        self._contact = self._contact + (
            self._answer_of_contact(answer) if change is None else change
        )

    def finish(self, static: Floats) -> list[Sums]:
        """End the layer and sum up."""
        system = self._system
        moved = self.displacement - self._before
        moved[self._still] = 0.0
        self.velocity *= -1.0
        self.velocity += (2.0 / self.dt) * moved
        self.velocity[system.constrained] = 0.0
        if self._statics is not None:
            self._surface.spread(self._contact + static, self.displacement)
            drift = (self._contact - self._contact_before) / self.dt
            self._surface.spread(drift, self.velocity)
        amid = self._relax() if system.relaxation else None
        work = float(self._loads @ moved) if self._drive.is_active else 0.0
        if self._drive.has_moved:
            step = self.displacement - self._before
            middle = self.displacement - 0.5 * step
            reaction = self._drive.reaction(middle if amid is None else middle + amid)
            work += float(reaction @ step[self._drive.moved])
        return self._summed(work, self._times[1])

    def _relax(self) -> Floats:
        """Take Maxwell terms to the end of the layer; what they strained amid it, (owned dofs,)."""
        relaxation, way = self._system.relaxation, self.displacement - self._before
        amid = relaxation.straining(relaxation.amid(self._relaxing, way, self.dt))
        self._relaxing = relaxation.after(self._relaxing, way, self.dt)
        return amid

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:
        """Velocities of contact nodes at both ends of the layer [m/s] (collective)."""
        before = self._surface.gather(self._speeds(self._times[0]))
        return before, 2.0 / self.dt * way - before

    def _speeds(self, time: float) -> Floats:
        """Velocities, also of what supports move, whose momentum no scheme keeps [m/s]."""
        if not self._drive.has_moved:
            return self.velocity
        found = self.velocity.copy()
        found[self._drive.moved] = self._system.supports.motion(time)[1]
        return found

    def roots(self) -> None:
        """Nothing is volatile."""

    def answers(self, forces: Floats) -> tuple[Floats, Floats]:
        """Never asked: no answer changes."""
        return self.columns(forces)

    def initial(self, static: Floats) -> list[Sums]:
        """Sums of the initial state."""
        if self._statics is not None:
            self._surface.spread(self._contact + static, self.displacement)
        return self._summed(0.0, 0.0)

    def _summed(self, work: float, time: float) -> list[Sums]:
        system, dim = self._system, self._system.dim
        carried = system.carried(self.displacement)
        strained = (self.displacement.reshape(-1, dim) - carried).ravel()
        self._argument.setArray(strained)
        system.stiffness.mult(self._argument, self._product)
        internal = self._product.getArray()
        free = ~system.constrained
        elastic = 0.5 * float(strained[free] @ internal[free])
        if self._drive.has_moved:
            elastic += self._drive.elastic(self.displacement, self.displacement)
        for share, kept in zip(system.relaxation.shares, self._relaxing, strict=True):
            lasting = (kept.reshape(-1, dim) - system.carried(kept)).ravel()
            self._argument.setArray(lasting)
            system.stiffness.mult(self._argument, self._product)
            stored = 0.5 * float(lasting[free] @ self._product.getArray()[free])
            if self._drive.has_moved:
                stored += self._drive.elastic(kept, kept)
            elastic += float(share) * stored
        momentum = self._times_mass(self.velocity)
        kinetic = 0.5 * float(self.velocity @ momentum)
        whole = momentum.reshape(-1, dim).sum(axis=0)
        moment = (self._weights * self.displacement).reshape(-1, dim).sum(axis=0)
        if self._drive.has_moved:
            whole = self._drive.moments(self._speeds(time))
            moment = self._drive.moments(self.displacement)
        spin = self._turning.rows @ momentum
        return [Sums(kinetic, elastic, work, whole, moment, spin)]

    def placed(self, static: Floats) -> Floats:  # noqa: ARG002  (as the interface has it)
        """Displacement of the owned dofs with massless nodes where they are, as a new array."""
        return self.displacement.copy()

    def straining(self, static: Floats) -> Floats:
        """Displacement whose elastic stress is that of the body, as a new array."""
        return self.placed(static) + self._system.relaxation.straining(self._relaxing)

    @property
    def reversible(self) -> bool:
        """Whether `backward` knows all that happens in a layer."""
        return not self._drive.has_moved

    @property
    def relaxation(self) -> Relaxation:
        """Of what it remembers; see `Reversible`."""
        return self._system.relaxation

    @property
    def dofs(self) -> int:
        """How many owned dofs `backward` takes."""
        return len(self.velocity)

    def backward(
        self, place: Floats, rate: Floats, contact: Floats, *, first: bool,  # noqa: ARG002  (as the interface has it)
        parts: Floats | None = None,
    ) -> Backward:  # fmt: skip
        """Derivatives by what a layer begins with; see `Reversible`."""
        turned = np.where(self._still, 0.0, rate)
        moved = self.settled(place + (2.0 / self.dt) * turned, contact)
        moved[self._still] = 0.0
        if parts is not None and self._gather_columns and self._statics is not None:
            # Forces on massless nodes do inside what the loads do that balance them there.
            middle = parts @ self._columns
            self._surface.spread(self._statics.equilibrium(middle), middle)
        else:
            self._right.setArray(self._advance * moved)
            self._middle.set(0.0)
            self._solver.solve(self._right, self._middle)
            middle = self._middle.getArray()
        loads = np.where(self._system.constrained, 0.0, middle)
        through = self._times_mass(loads)
        begun = (1.0 - self._advance) * moved + self._mu * through - (2.0 / self.dt) * turned
        back = Backward(
            begun, (2.0 / self.dt) * through - turned, self._surface.gather(loads), loads
        )
        if not self.relaxation:
            return back
        # Massless nodes settle with what is held of theirs and of their neighbours (`_contact_at`).
        held = self.settled(np.zeros(len(place)), contact)
        self._surface.spread(-contact, held)
        held = np.where(self._system.constrained, 0.0, held / self._stiffened)
        straining = self._mu * through - self._advance * moved
        return back._replace(
            place=begun - (self._stiffened - 1.0) * held,
            memory=self.relaxation.kept_by(straining, held, self.dt),
        )

    def of_contact(self, values: Floats) -> Floats:
        """Values of the owned dofs on the contact nodes, (count, dim); see `Reversible`."""
        return self._surface.gather(values)

    def settled(self, place: Floats, contact: Floats) -> Floats:
        """Derivatives by displacements, with those by contact nodes; see `Reversible`."""
        if self._statics is None:
            found = np.zeros(len(self._still))
            self._surface.spread(contact, found)
            return found + place
        found = place.copy()
        found[self._statics.near] -= self._statics.pushed(self._statics.response(contact))
        found[self._surface.dofs] = 0.0
        return found

    def eased(self, place: Floats | float, contact: Floats) -> Floats | None:  # noqa: ARG002  (of what has mass)
        """How far forces on contact nodes move them; see `Reversible`."""
        return self.on_contact(self.static(contact)) if contact.any() else None

    def on_contact(self, values: Floats) -> Floats:
        """Values of the contact nodes on the owned dofs; see `Reversible`."""
        return self._surface.pulled(values, self._system.constrained)

    def vary(self, into: MaterialSums, loads: Floats, ends: Ends) -> None:
        """Add derivatives by the material that a layer makes; see `Reversible`."""
        middle = ends.place + (ends.end_place - ends.place) / self._advance
        if self._statics is not None:
            self._surface.spread(self._statics.equilibrium(middle, ends.forces), middle)
        dim = self._system.dim
        strained = (middle.reshape(-1, dim) - self._system.carried(middle)).ravel()
        into.stiff(-loads, strained)
        motion = self._mu * (ends.place - middle) + (2.0 / self.dt) * ends.velocity
        self.vary_product(into, loads, motion)
        gravity = self.gravity(ends.start, ends.end)
        self.vary_weight(into, (loads.reshape(-1, dim) * gravity).ravel())

    def vary_product(self, into: MaterialSums, one: Floats, other: Floats) -> None:
        """Add those of one . M other; see `Reversible`."""
        # Neighbours move what is massless; what is held has no rows in M.
        held, transfer = self._system.constrained, self._transfer
        into.heavy(*(np.where(held, 0.0, averaged(transfer, each)) for each in (one, other)))

    def vary_weight(self, into: MaterialSums, values: Floats) -> None:
        """Add those of sums by mass; see `Reversible`."""
        into.weigh(averaged(self._transfer, np.where(self._system.constrained, 0.0, values)))

    def sums_by(self) -> tuple[Floats, Floats]:
        """Mass times displacement and momentum; see `Reversible`."""
        axes = np.tile(np.eye(self._system.dim), len(self._still) // self._system.dim)
        return axes * self._weights, np.array([self._times_mass(axis).copy() for axis in axes])

    def energies_by(self, placed: Floats, velocity: Floats) -> tuple[Floats, Floats]:
        """Elastic energy by displacements of all nodes, kinetic by velocities, (dofs,) each."""
        carried = self._system.carried(placed)
        self._argument.setArray((placed.reshape(-1, self._system.dim) - carried).ravel())
        self._system.stiffness.mult(self._argument, self._product)
        pulled = np.where(self._system.constrained, 0.0, self._product.getArray())
        return pulled, self._times_mass(velocity).copy()

    def state(self) -> dict[str, Any]:
        """What the next layer needs."""
        moved = {"displacement": self.displacement.copy(), "velocity": self.velocity.copy()}
        return moved | named(self._relaxing)

    def memory(self) -> dict[str, Floats]:
        """Nothing besides."""
        return {}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Nothing."""

    def restore(self, state: dict[str, Any], surface: Floats) -> None:
        """Continue from a state; ``surface`` was `surface_displacement`, to the last bit."""
        self.displacement[:] = state["displacement"]
        self.velocity[:] = state["velocity"]
        for name, kept in zip(named(self._relaxing), self._relaxing, strict=True):
            kept[:] = state[name]
        self._contact = surface.copy()

    def destroy(self) -> None:
        """Free PETSc's objects."""
        self._solver.destroy()
        for vector in self._vectors:
            vector.destroy()
        if self._transfer is not None:
            self._mass.destroy()
