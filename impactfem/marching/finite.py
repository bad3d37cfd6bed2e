"""Implicit steps of a body under finite strain: an energy-momentum midpoint rule.

In a step from a to b, with d the difference, m the mean and mu the damping by mass,

    M (2 (d / dt - v_a) / dt + mu d / dt) + f(u_a, u_b) = loads + contact forces at m,
    v_b = 2 d / dt - v_a,

where f does exactly the work of the elastic energy, without sum or moment about the mean places
(`impactfem.forms.finite_strain`). M has no mass on contact nodes, whose rows are statics with the
same f, but the body's moments (`impactfem.system.moments`). So energy, momentum and angular
momentum are kept to rounding in flight, and in contact as far as its law does
(`impactfem.marching.newton_march`). Each step is solved by Newton's method.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.errors import ConvergenceError
from impactfem.fem import MPI, products_in_order
from impactfem.marching.finite_body import FiniteBody
from impactfem.marching.layers import Sums
from impactfem.marching.turning import Turning
from impactfem.system.elastic import ElasticSystem
from impactfem.system.finite_statics import FiniteAtRest
from impactfem.system.finite_strain import FiniteStrain
from impactfem.system.linear import LinearSolver, of_mass
from impactfem.system.moments import kept_moments
from impactfem.system.small_strain import SmallStrain
from impactfem.system.surface import SurfaceNodes

if TYPE_CHECKING:
    from impactfem.system.step_solvers import StepSolver


_SHARE = 1e-3  # of the inertia that sets the scale of forces, where a body flies without strain
_SLOW = 0.1  # share of its fault that an iterate may leave before the tangent is renewed
_ACCURACY = 1e-11  # of forces
_ROUNDING = 5e-16  # of what moves the stiffest node as far as the body goes
_SOON = 1e-3  # of a layer, in which what has mass stays where it is
_RELAXED, _BALANCED = 20, 1e-9  # iterates, and share of the forces that they leave
_HALVINGS = 6  # of a Newton step that turns cells inside out


class FiniteMidpoint(FiniteBody):
    """Stepper of a solid; see `impactfem.marching.newton_bodies.NewtonStepper`.

    Attributes:
        surface: Contact nodes.
        constrained: Owned dofs that supports hold.
        span: Of the step [s].
        after: Displacement of the owned dofs at its end, by the last iterate [m].
        joined: Forces of joints on the owned dofs in the step [N]; None where none hold it.
        leaps: False.
    """

    leaps = False

    def __init__(
        self,
        system: ElasticSystem,
        solid: Any,
        surface: SurfaceNodes,
        transfer: Any,
        dt: float,
        linear_solver: str,
    ) -> None:
        """Prepare (collective).

        Args:
            system: The body at t = 0, as linear elasticity has it: mass, loads, supports.
            solid: `impactfem.scene.solids.Solid`.
            surface: Contact nodes.
            transfer: Of their mass; None if there are none.
            dt: Time step [s].
            linear_solver: "mumps" or "gamg".
        """
        with products_in_order(system.comm):
            mass = system.mass.copy() if transfer is None else system.mass.ptap(transfer)
        self._mass, sums, missing = kept_moments(system, mass, transfer)
        weights = np.where(system.constrained, 0.0, np.repeat(sums, system.dim))
        super().__init__(system, surface, dt, weights, {solid.name: missing})
        self._vectors = [system.stiffness.createVecRight() for _ in range(2)]
        self._strain: FiniteStrain | SmallStrain = (
            FiniteStrain(system.nodes, solid, system.following, system.memory)
            if solid.is_finite
            else SmallStrain(system.nodes, solid, system.memory)
        )
        self._turning = Turning.of(system, self._times_mass) if self._strain.arms_stay else None
        damping = system.rayleigh_mass, system.rayleigh_stiffness
        near = system.stiffness.getNearNullSpace()
        self._solvers: StepSolver = self._strain.step_solver(
            self._mass, system.constrained, dt, damping, linear_solver, near
        )
        self._kind = linear_solver
        self._solver: LinearSolver | None = None
        self._columns: dict[int, Floats] = {}
        self.displacement: Floats = system.displacement.copy()
        self.velocity: Floats = system.velocity.copy()
        self._still = system.constrained.copy()
        self._still[surface.dofs] = True
        self._inertia_scale = 0.0
        diagonal = system.stiffness.getDiagonal()
        largest = float(np.abs(diagonal.getArray()).max(initial=0.0))
        diagonal.destroy()
        self._stiffest = system.comm.allreduce(largest, op=MPI.MAX)
        heaviest = float(np.abs(self._weights).max(initial=0.0))
        self._heaviest = system.comm.allreduce(heaviest, op=MPI.MAX)
        self._rounding = 0.0
        self._work = 0.0
        self._stale, self._left = True, np.inf
        self._change = np.zeros_like(self.displacement)
        self.surface, self.constrained = surface, system.constrained
        self.joined: Floats | None = None
        self._freeing: LinearSolver | None = None
        self._moved: tuple[int, Floats, Floats] | None = None  # generation, forces, ways

    def at_rest(self, name: str, gravity: Floats, spin: Floats) -> FiniteAtRest:
        """The body as the search for equilibrium asks it (collective); see `FiniteAtRest`."""
        system, surface = self._system, self._surface
        return FiniteAtRest(
            name, system, self._strain, surface, self._mass, self._weights, self._kind, gravity,
            spin,
        )  # fmt: skip

    @property
    def generation(self) -> int:
        """Of the tangent: answers to forces change with it."""
        return self._solvers.generation

    @property
    def massive(self) -> Booleans:
        """None of the contact nodes, (count,)."""
        return np.zeros(self._surface.count, dtype=bool)

    @property
    def surface_velocity(self) -> Floats:
        """Not asked for where there is no mass, (count, dim)."""
        return np.zeros((self._surface.count, self._system.dim))

    @property
    def surface_iterate(self) -> Floats:
        """The same at the end of the step, as the last iterate has it (collective)."""
        return self._surface.gather(self.after)

    def arms(self, middle: Floats) -> Floats:
        """Displacement of contact nodes amid the step, as moments have it, (count, dim).

        Args:
            middle: The true one [m], (count, dim).
        """
        if self._turning is None:
            return middle
        dim = self._system.dim
        mean = 0.5 * (self.displacement + self.after)
        own = np.stack([self._weights * mean, self._weights]).reshape(2, -1, dim).sum(axis=1)
        moved, mass = np.asarray(self._system.comm.allreduce(own, op=MPI.SUM))
        centre = moved / np.where(mass > 0.0, mass, 1.0)
        return np.broadcast_to(centre, middle.shape)

    def _times_mass(self, values: Floats) -> Floats:
        source, image = self._vectors
        source.setArray(values)
        self._mass.mult(source, image)
        found: Floats = np.array(image.getArray())
        return found

    def begin(self, start: float, end: float) -> None:
        """Take up a step between two times from the present state (collective).

        Raises:
            ConvergenceError: Its first guess turns cells inside out.
        """
        system, drive = self._system, self._drive
        self.span = step = end - start
        self._strain.retard(system.rayleigh_stiffness, step)
        self._strain.press(start, end)
        gravity = drive.gravity(start, end)
        self._stale, self._left = True, np.inf
        self._loads = self._weights * np.tile(gravity, len(self._weights) // system.dim)
        if drive.is_active:
            self._dead = drive.load(start, end)
            self._loads = self._loads + self._dead
        self.after = self.displacement.copy()
        if drive.has_moved:
            self.after[drive.moved] = system.supports.motion(end)[0]
        change = step * self.velocity
        change[system.constrained] = 0.0
        self._move(change)
        momentum = np.abs(self._times_mass(self.velocity)).max(initial=0.0)
        far = system.comm.allreduce(float(np.abs(self.after).max(initial=0.0)), op=MPI.MAX)
        self._inertia_scale = _SHARE * 2.0 / step * float(momentum)
        # Coordinates round, and so does what strain and inertia make of their differences.
        stiffness = self._stiffest + 2.0 / step**2 * self._heaviest
        self._rounding = _ROUNDING * stiffness * (far + 0.1 * self.size)

    @property
    def surface_way(self) -> Floats:
        """How far the contact nodes move in the step [m], (count, dim) (collective)."""
        return self._surface.gather(self.after - self.displacement)

    def touch(self, normals: Floats) -> None:
        """Nothing: nodes touch themselves."""

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim) (collective)."""
        return self._surface.gather(self.displacement + (end - start) * self.velocity)

    def unbalanced(self, forces: Floats) -> float:
        """Largest force that the iterate leaves, over what rounding and forces allow (collective).

        Args:
            forces: On the contact nodes at the mean places [N], (count, dim).
        """
        system, step = self._system, self.span
        moved = self.after - self.displacement
        inside = self._strain.force(self.displacement, self.after)
        pushed = self._pushed(forces)
        self._pressed = self._strain.pressed(self.displacement, self.after)
        rate = moved / step
        inert = self._times_mass(
            (2.0 / step) * (rate - self.velocity) + system.rayleigh_mass * rate
        )
        self._rest = self._loads + self._pressed + pushed - inside - inert
        self._inside = inside
        self._rest[system.constrained] = 0.0
        own = [
            np.abs(self._rest).max(initial=0.0),
            np.abs(inside).max(initial=0.0),
            self._inertia_scale,
        ]
        if not np.isfinite(own).all():
            own = [np.inf, 0.0, 0.0]
        largest = np.array(own)
        system.comm.Allreduce(MPI.IN_PLACE, largest, op=MPI.MAX)
        left, force, inertia = largest
        found = float(left / (_ACCURACY * max(force, inertia) + self._rounding))
        self._stale = self._stale or found > _SLOW * self._left
        self._left = found
        return found

    def _pushed(self, forces: Floats) -> Floats:
        """Forces (count, dim) on the contact nodes as those on the owned dofs, and of joints."""
        found = self._surface.pulled(forces, self._system.constrained)
        return found if self.joined is None else found + self.joined

    def linearise(self) -> Floats:
        """Solve for what balances the iterate; how contact nodes move by it (collective).

        The tangent is that of the step's first iterate as long as it brings the others on. (Kept
        from step to step, a run that is taken up again would round otherwise than the whole one.)

        Raises:
            ConvergenceError: The tangent is singular.
        """
        if self._stale:
            self.renew()
        self._change = self._solved(self._rest)
        return self._surface.gather(self._change)

    def renew(self) -> None:
        """Factor the tangent of the iterate (collective)."""
        self._stale = False
        self._strain.put(self.displacement, self.after)
        self._solver = self._solvers.renew(self.span)

    def answers(self, forces: Floats) -> Floats:
        """How contact nodes answer to forces on them at the iterate, (several, count, dim)."""
        if not self._solvers.stays:
            return self._answers(forces)
        # Sums of answers to unit forces, one node after the other: what is known then does not tell
        # how they round, and a run can be continued.
        nodes = np.flatnonzero(forces.any(axis=(0, 2)))
        count, dim = forces.shape[1:]
        for node in nodes.tolist():
            if node not in self._columns:
                units = np.zeros((dim, count, dim))
                units[range(dim), node, range(dim)] = 1.0
                self._columns[node] = self._answers(units)
        known = np.stack([self._columns[node] for node in nodes.tolist()])
        found: Floats = np.tensordot(forces[:, nodes], known, axes=([1, 2], [0, 1]))
        return found

    def _answers(self, forces: Floats) -> Floats:
        return np.stack([self._surface.gather(each) for each in self.moved(forces)])

    def moved(self, forces: Floats) -> Floats:
        """Displacements by several contact forces (several, count, dim), (several, dofs)."""
        kept, made = self._moved, self.generation  # joints ask for them twice
        if kept is not None and kept[0] == made and np.array_equal(kept[1], forces):
            return kept[2]
        held = self._system.constrained
        found = self.answered(np.stack([self._surface.pulled(force, held) for force in forces]))
        if self.joined is not None:
            self._moved = made, forces.copy(), found
        return found

    def correct(self, forces: Floats) -> None:
        """Move the iterate, with a change of the contact forces (count, dim) (collective).

        Raises:
            ConvergenceError: Cells turn inside out, however short the step.
        """
        change = self._change
        if forces.any():
            change = change + self._solved(self._surface.pulled(forces, self._system.constrained))
        self._move(change)

    def _move(self, change: Floats) -> None:
        """Add as much of a change as turns no cell inside out."""
        for _ in range(_HALVINGS):
            after = self.after + change
            if not self._strain.is_inverted(after):
                self.after = after
                return
            change = 0.5 * change
        raise ConvergenceError("cells turn inside out")

    def _solved(self, right: Floats) -> Floats:
        source, image = self._vectors
        source.setArray(right)
        image.set(0.0)
        assert self._solver is not None  # noqa: S101  (`linearise` came first)
        self._solver.solve(source, image)
        found: Floats = np.array(image.getArray())
        return found

    def accept(self) -> None:
        """End the step at the iterate."""
        step = self.span
        moved = self.after - self.displacement
        free = ~self._system.constrained
        self._work += float(self._pressed[free] @ moved[free])
        if self._drive.is_active:
            self._work += float(self._dead @ moved)
            held = self._drive.moved
            self._work += float(self._inside[held] @ moved[held])
        new = (2.0 / step) * moved - self.velocity
        drift = moved / step
        self.velocity = np.where(self._still, drift, new)
        self._strain.settle(self.displacement, self.after)
        self.displacement = self.after

    def finish(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """End the layer and sum up (collective)."""
        work, self._work = self._work, 0.0
        return self._summed(self._strain.energy(self.displacement), work)

    def initial(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """Sums of the initial state (collective)."""
        return self._summed(self._strain.energy(self.displacement), 0.0)

    def state(self) -> dict[str, Any]:
        """What the next layer needs."""
        moved = {"displacement": self.displacement.copy(), "velocity": self.velocity.copy()}
        return moved | self._strain.state()

    def memory(self) -> dict[str, Floats]:
        """What it needs besides, the same on all ranks (collective)."""
        return self._strain.memory()

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        self._strain.remember(memory)

    def straining(self, static: Floats) -> Floats:
        """Displacement whose elastic stress is that of the body, as a new array."""
        return self._strain.straining(self.placed(static))

    def restore(self, state: dict[str, Any], surface: Floats) -> None:  # noqa: ARG002
        """Continue from a state."""
        self.displacement = np.array(state["displacement"])
        self.velocity = np.array(state["velocity"])
        self._strain.restore(state)

    def relax(self, loose: Booleans, time: float) -> None:
        """Balance contact nodes that supports let go, without the inside moving (collective).

        They carry no mass. Midpoints of steps alone would be in equilibrium, and their forces
        change signs from step to step.

        Raises:
            ConvergenceError: Cells turn inside out, or no equilibrium was found.
        """
        strain, surface = self._strain, self._still & ~self.constrained
        self.begin(time, time + _SOON * self.dt)
        strain.retard(0.0, self.span)
        kept, first = None, 0.0
        for _ in range(_RELAXED):
            here = self.after = self.displacement
            rest = self._loads + strain.pressed(here, here) - strain.force(here, here)
            # What contact and joints press does not change.
            kept = np.where(loose, 0.0, rest) if kept is None else kept
            rest = np.where(surface, rest - kept, 0.0)
            own = float(np.abs(rest).max(initial=0.0))
            left = self._system.comm.allreduce(own, op=MPI.MAX)
            first = first or left
            if left <= _BALANCED * first:
                return
            self.renew()
            # Of a step that begins and ends there both ends move.
            self._move(np.where(surface, 0.5 * self._solved(rest), 0.0))
            self.displacement = self.after
        raise ConvergenceError(f"the surface found no equilibrium at t = {time:g} s")

    def destroy(self) -> None:
        """Free PETSc's objects."""
        if self._freeing is not None:
            self._freeing.destroy()
        for thing in (self._solvers, self._strain, *self._vectors, self._mass):
            thing.destroy()

    # ---- what joints ask, see `impactfem.marching.finite_tipped` -------------------------------

    def answered(self, forces: Floats) -> Floats:
        """Displacements by several forces on owned dofs at the iterate, (several, dofs)."""
        assert self._solver is not None  # noqa: S101  (`renew` came first)
        return np.stack(list(self._solver.solve_all(forces)))

    def freed(self, impulses: Floats) -> Floats:
        """Velocities by several impulses that leave no time for anything else, (several, dofs)."""
        if self._freeing is None:
            self._freeing = of_mass(self._system.stiffness, self._mass, self._still, self._kind)
        return np.where(self._still, 0.0, self._freeing.solve_all(impulses))

    def shift(self, change: Floats) -> None:
        """Move the iterate by all of a change, as joints count on it (collective).

        Raises:
            ConvergenceError: Cells turn inside out.
        """
        self.after = self.after + change
        if self._strain.is_inverted(self.after):
            raise ConvergenceError("cells turn inside out")

    def lay(self, forces: Floats) -> None:
        """Balance the iterate with contact forces (count, dim) (collective)."""
        known = self._stale, self._left
        self.unbalanced(forces)
        self._stale, self._left = known
        if self._stale:
            self.renew()
        self._move(self._solved(self._rest))
