"""Explicit steps of a body under finite strain: central differences inside, a surface at rest.

    v_{m+1/2} = v_m + dt a_m / 2,   u_{m+1} = u_m + dt v_{m+1/2},   v_{m+1} likewise by a_{m+1}

with a = M^-1 (loads - f(u)) for the nodes inside, whose lumped mass has the body's moments
(`impactfem.system.moments`). Contact nodes carry none: at each level they are where forces of
cells, loads and contact balance, but for some percent; what is left goes to the nodes inside
(`impactfem.system.inward`), so that momentum and angular momentum are kept to rounding.

The energy told is that which such steps keep, to second order in the step: with K = df / du that
of the levels and dt^2 (v K v / 12 - a M a / 24), the first in the form in which each mode of linear
forces has it exactly, dt^2 (v K v + a M a_last) / 12 - dt^2 a M a / 8. Without it energy that goes
from slow modes to fast ones would seem lost. It is counted as elastic.
"""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.errors import ConvergenceError
from impactfem.fem import MPI, PETSc
from impactfem.marching.finite_body import FiniteBody
from impactfem.marching.layers import Sums
from impactfem.marching.level_kernels import accelerated, drifted
from impactfem.system.elastic import ElasticSystem
from impactfem.system.element_forces import ElementForces
from impactfem.system.finite_statics import FiniteAtRest
from impactfem.system.finite_strain import FiniteStrain
from impactfem.system.following import LevelPressures
from impactfem.system.inward import Inward
from impactfem.system.moments import lumped_moments
from impactfem.system.surface import SurfaceNodes
from impactfem.system.surface_layer import SurfaceLayer

if TYPE_CHECKING:
    from impactfem.marching.free_nodes import FreeNodes
    from impactfem.scene import PiecewiseVector

_SHARE = {2: 0.01, 3: 0.1}  # of the forces on the surface that its solver leaves
_STABLE = 0.9  # share of the stable step up to which layers are taken whole
_PIECES = 64  # of a layer at most
_SQUEEZE = 0.1  # change of the least det F after which the stable step is looked at anew
_ROUNDING = 1e-14  # of what moves the stiffest node as far as the body is large
_LAGGING = 0.5  # see `FiniteLeapfrog.lag`
_OFTEN = 200  # steps after which it is in any case


class FiniteLeapfrog(FiniteBody):
    """Stepper of a body under finite strain; see `impactfem.marching.layers.Stepper`.

    In each step the march asks for `predict`, then `unbalanced`, `relaxed` and `move_surface` in
    turns, then for `balance`, `receive` and `close`.

    Attributes:
        most: Steps of the layers so far, at most.
        yields: Whether no support holds contact nodes along each direction, (count, dim).
        rolled: That they touch themselves: 0 [m], (count, dim).
    """

    def __init__(
        self,
        system: ElasticSystem,
        solid: Any,
        surface: SurfaceNodes,
        transfer: Any,
        dt: float,
        linear_solver: str,
        limit: float,
    ) -> None:
        """Prepare (collective).

        Args:
            system: The body at t = 0, as linear elasticity has it: mass, loads, supports.
            solid: `impactfem.scene.solids.Solid`.
            surface: Contact nodes.
            transfer: Of their mass; None if there are none.
            dt: Length of a layer [s].
            linear_solver: Of the search for equilibrium: "mumps" or "gamg".
            limit: Stable step of the body at rest [s].
        """
        mass, self._inverse, missing = lumped_moments(system, transfer, surface)
        super().__init__(system, surface, dt, mass, {solid.name: missing})
        self._elements = elements = ElementForces(system.nodes, solid)
        elements.put(system.displacement)
        self.displacement = elements.displacement.reshape(-1)[: len(mass)]
        self.velocity = system.velocity.copy()
        self._solid, self._kind = solid, linear_solver
        self._matrix: Any = None
        self._moves = self._inverse > 0.0
        self.yields = free = surface.gather((~system.constrained).astype(np.float64)) > 0.0
        self.rolled = np.zeros(free.shape)
        self._layer = SurfaceLayer(elements, system.nodes, surface, free)
        self._inward = Inward(
            elements, system.nodes, self._layer.canonical, surface.gather(system.positions.ravel()),
            mass.reshape(-1, system.dim), turns=not system.axisymmetric,
        )  # fmt: skip
        self._surface_now = surface.gather(self.displacement)
        self._older = [self._surface_now, self._surface_now]
        self._tangent_at: Floats | None = None
        self._following = (
            LevelPressures(system.nodes, solid, system.following, elements.place)
            if system.following.any
            else None
        )
        self._driven = self._drive.is_active or self._following is not None
        self._dead = np.zeros_like(mass)
        self._load, self._surface_load = np.zeros_like(mass), np.zeros_like(self._surface_now)
        self._force, self._internal = np.zeros_like(mass), np.zeros_like(mass)
        self._acceleration = np.zeros_like(mass)
        self._last_force, self._energy, self._work, self._step = self._force, 0.0, 0.0, dt
        self._over = self._rate_sum = 0.0
        self._tips: tuple[SurfaceNodes, FreeNodes] | None = None
        self._least, self._looked, self._steps, self.most = 1.0, 1.0, 0, 1
        self._rest_rate = self._rate = elements.rate(self._inverse) if len(mass) else 0.0
        self._share = dt / limit
        diagonal = system.stiffness.getDiagonal()
        stiffest = float(np.abs(diagonal.getArray()).max(initial=0.0))
        diagonal.destroy()
        self._level(0.0)
        self.rounding = _ROUNDING * system.comm.allreduce(stiffest, op=MPI.MAX) * self.size

    def at_rest(self, name: str, gravity: Floats, spin: Floats) -> FiniteAtRest:
        """The body as the search for equilibrium asks it (collective); see `FiniteAtRest`."""
        system = self._system
        masses = system.stiffness.createVecRight()
        masses.setArray(self._weights)
        self._matrix = PETSc.Mat().createDiagonal(masses)
        strain = FiniteStrain(system.nodes, self._solid, system.following)
        return FiniteAtRest(
            name, system, strain, self._surface, self._matrix, self._weights, self._kind, gravity,
            spin,
        )  # fmt: skip

    def hold(self, nodes: SurfaceNodes, gravity: "PiecewiseVector") -> "FreeNodes":
        """Let joints hold some nodes, which then take their own steps (collective)."""
        from impactfem.marching.free_nodes import FreeNodes  # noqa: PLC0415  (if joints hold it)

        system, inverse = self._system, nodes.gather(self._inverse)
        free = FreeNodes(
            gravity, self.dt, inverse, system.rayleigh_mass, self.size,
            counts=system.comm.rank == 0,
        )  # fmt: skip
        self._tips = nodes, free
        self._take_up()
        return free

    def _take_up(self) -> None:
        """Tell the nodes that joints hold where they are at a level (collective)."""
        if self._tips is not None:
            nodes, free = self._tips
            known = self.displacement, self.velocity, self._acceleration
            free.take_up(*(nodes.gather(each).ravel() for each in known))

    def carry(self) -> None:
        """Take these to where they have gone; what is wanting of their rates `close` adds."""
        if self._tips is None:
            return
        nodes, free = self._tips
        dofs, step = nodes.dofs[~free.constrained[nodes.places]], self._step
        at = nodes.places[~free.constrained[nodes.places]]
        slow = 0.5 * self._system.rayleigh_mass * step
        self.velocity[dofs] += (free.displacement[at] - self.displacement[dofs]) / step
        self.displacement[dofs] = free.displacement[at]
        half = (1.0 - slow) * self.velocity[dofs] + 0.5 * step * self._acceleration[dofs]
        self._wanting = dofs, free.velocity[at] - half
        self._elements.share()

    @property
    def surface_displacement(self) -> Floats:
        """Displacement of the contact nodes [m], (count, dim)."""
        return self._surface_now

    def _times_mass(self, values: Floats) -> Floats:
        return self._weights * values

    def pieces(self) -> int:
        """Steps that the next layer takes, so that squeezed cells are stable (collective).

        Raises:
            ConvergenceError: These would be too many.
        """
        self._steps += 1
        if abs(self._least / self._looked - 1.0) > _SQUEEZE or self._steps % _OFTEN == 0:
            self._looked = self._least
            self._rate = self._elements.rate(self._inverse)
        stiffer = math.sqrt(max(1.0, self._rate / self._rest_rate))
        if not self._share * stiffer < _PIECES * _STABLE:
            raise ConvergenceError(
                f"cells are squeezed until they are {stiffer**2:.3g} times as stiff as at rest, "
                f"which no step of {self.dt / _PIECES:.2g} s bears"
            )
        # Each change of the step costs some energy: what was cut stays so.
        self.most = max(self.most, math.ceil(self._share * stiffer / _STABLE))
        return self.most

    @property
    def surface_iterate(self) -> Floats:
        """Where the contact nodes have been put [m], (count, dim) (collective)."""
        return self.surface_displacement

    def begin(self, start: float, end: float) -> None:
        """Take the inside to the end of a step, and guess where the surface is (collective)."""
        step = self._step = end - start
        self._take_up()
        slow = 0.5 * self._system.rayleigh_mass * step
        drive = self._drive
        self._before = self.displacement.copy() if self._driven else self.displacement
        drifted(self.displacement, self.velocity, self._acceleration, self._inverse, step, slow)
        if drive.has_moved:
            self.displacement[drive.moved] = self._system.supports.motion(end)[0]
        self._elements.share()
        now, (older, oldest) = self._surface_now, self._older
        self._older = [now, older]
        guess = 3.0 * (now - older) + oldest
        held = self._surface.gather(self.displacement) if drive.has_moved else now
        self.move_surface(np.where(self.yields, guess, held))
        self._level(end)

    def _level(self, time: float) -> None:
        """Loads at a time: means of half a step around it (collective)."""
        self._last_load = self._load
        around = max(0.0, time - 0.5 * self._step), time + 0.5 * self._step
        if self._drive.is_active:
            self._load = self._dead = self._drive.load(*around)
            self._surface_load = self._surface.gather(self._load)
        if self._following is not None:
            self._following.put(*around)
        self._pull = self._drive.gravity(*around)

    def relax(self, loose: Booleans, time: float) -> None:  # noqa: ARG002  (the march does it)
        """Take the loads of a level at which supports let go (collective)."""
        self._level(time)

    def touch(self, normals: Floats) -> None:
        """Nothing: nodes touch themselves."""

    def move_surface(self, place: Floats) -> None:
        """Put the contact nodes somewhere, (count, dim) [m]."""
        self._surface_now = place
        self._layer.place(place)

    def unbalanced(self) -> Floats:
        """Forces with which contact nodes press outwards [N], (count, dim) (collective).

        Raises:
            ConvergenceError: A cell is turned inside out.
        """
        found = self._layer.forces() - self._surface_load
        if self._following is not None:
            found -= self._surface.gather(self._following.forces())
        return np.where(self.yields, found, 0.0)

    @property
    def lag(self) -> float:
        """Share of forces that an iterate leaves as the tangent knows no pressures (collective)."""
        if self._following is None:
            return 0.0
        largest = self._system.comm.allreduce(self._following.largest, op=MPI.MAX)
        return float(min(_LAGGING, 2.0 * largest / self._elements.softest))

    def renew(self) -> None:
        """Take the tangent of the surface where the body is now (collective)."""
        self._tangent_at = self._elements.displacement.copy()
        self._layer.renew()

    def relaxed(self, right: Floats, held: Booleans, normals: Floats) -> Floats:
        """How contact nodes move by forces [m], (count, dim); see `SurfaceLayer.solve`."""
        return self._layer.solve(right, held, normals, _SHARE[self._system.dim])

    def answer(self, right: Floats) -> Floats:
        """The same without any held, as exactly as `answers` [m], (count, dim)."""
        return self._layer.answer(right)

    def answers(self, nodes: Integers) -> Floats:
        """How contact nodes move by unit forces on some of them [m/N], (some, dim, count, dim)."""
        return self._layer.answers(nodes)

    def balance(self) -> Floats:
        """All forces at the level; those of contact nodes as `unbalanced` has them (collective).

        Raises:
            ConvergenceError: A cell is turned inside out.
        """
        self._last_internal = self._internal
        self._internal, self._energy, self._least = self._elements.forces()
        if not self._least > 0.0:
            raise ConvergenceError(
                f"a cell is turned inside out (det F = {self._least:.2g}): give a smaller "
                'solve.courant, smaller elements, or method = "conserving"'
            )
        if self._following is not None:
            pushed = self._following.forces()
            self._load = self._dead + np.where(self._system.constrained, 0.0, pushed)
        self._last_force, self._force = self._force, self._load - self._internal
        found = -self._surface.gather(self._force)
        return np.where(self.yields, found, 0.0)

    def receive(self, left: Floats, *, first: bool = False) -> None:
        """Hand what the surface leaves unbalanced (count, dim) [N] to the inside; accelerate it.

        Args:
            left: See above.
            first: Whether no level came before.
        """
        if first:
            self._last_force = self._force
        if len(left):
            self._force -= self._inward.forces(left, self._surface_now, self.displacement)
        inverse = self._inverse
        self._over, self._rate_sum = accelerated(
            self._force, self._last_force, self.velocity, inverse, self._pull, self._step,
            self._acceleration,
        )  # fmt: skip

    def close(self, left: Floats) -> None:
        """End the step; forces (count, dim) [N] are taken off it alone, with those of the level."""
        step, system = self._step, self._system
        slow = 0.5 * system.rayleigh_mass * step
        self.velocity = self.velocity * (1.0 - slow) + 0.5 * step * self._acceleration
        if self._tips is not None:
            dofs, wanting = self._wanting
            self.velocity[dofs] += wanting
        if left.any():
            pushed = self._inward.forces(left, self._surface_now, self.displacement)
            self.velocity -= 0.5 * step * self._inverse * pushed
        self._surface.spread(self._surface_now, self.displacement)
        drift = (self._surface_now - self._older[0]) / step
        self._surface.spread(np.where(self.yields, drift, 0.0), self.velocity)
        if self._driven:
            way, held = self.displacement - self._before, self._drive.moved
            self.velocity[held] = way[held] / step
            self._work += 0.5 * float((self._last_load + self._load) @ way)
            reaction = self._last_internal[held] + self._internal[held]
            self._work += 0.5 * float(reaction @ way[held])
            pulled = self._internal[held] - self._last_internal[held]  # v K v of moved supports
            self._rate_sum += float(pulled @ way[held]) / step**2

    def finish(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """End the layer and sum up (collective)."""
        work, self._work = self._work, 0.0
        return self._told(work)

    def initial(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """Sums of the initial state (collective)."""
        self._level(0.0)
        speed = self._surface.gather(self.velocity)
        self._older = [self._surface_now - k * self.dt * speed for k in (1, 2)]
        self.receive(self.balance(), first=True)
        return self._told(0.0)

    def _told(self, work: float) -> list[Sums]:
        over = self._step**2 * self._over / 8.0
        return self._summed(self._energy - over + float(self.between[0]), work)

    @property
    def between(self) -> Floats:
        """Part of the energy that comes from two levels, of this rank [J]; wanting at t = 0."""
        return np.array([self._step**2 / 12.0 * self._rate_sum])

    def state(self) -> dict[str, Any]:
        """What the next layer needs."""
        return {
            "displacement": self.displacement.copy(), "velocity": self.velocity.copy(),
            "acceleration": self._acceleration.copy(), "internal": self._internal.copy(),
            "load": self._load.copy(), "force": self._force.copy(),
            "tangent": (
                self.displacement if self._tangent_at is None else self._tangent_at
            ).reshape(-1)[: len(self.velocity)].copy(),
        }  # fmt: skip

    def memory(self) -> dict[str, Floats]:
        """Places of the surface at the last levels, and how squeezed cells are."""
        counts = [self._steps, self.most]
        squeezed = np.array([self._least, self._looked, self._rate, self._energy, *counts])
        return {"older": np.stack(self._older), "squeezed": squeezed}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        self._older = list(memory["older"])
        self._least, self._looked, self._rate, self._energy, *counts = memory["squeezed"].tolist()
        self._steps, self.most = map(int, counts)

    def restore(self, state: dict[str, Any], surface: Floats) -> None:
        """Continue from a state; ``surface`` was `surface_displacement`, to the last bit."""
        if "tangent" in state:
            self._elements.put(state["tangent"])
            self.renew()
        self._elements.put(state["displacement"])
        self.velocity = np.array(state["velocity"])
        if "acceleration" in state:
            self._acceleration, self._internal = state["acceleration"], state["internal"]
            self._load, self._force = state["load"], state["force"]
        self.move_surface(surface.copy())
        self._take_up()

    def destroy(self) -> None:
        """Free what PETSc holds."""
        if self._matrix is not None:
            self._matrix.destroy()
