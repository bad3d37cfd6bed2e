"""Implicit steps of a solid under finite strain, held by its tips; see `impactfem.system.tips`.

Forces of joints act at the mean places of a step, by rows J of the tips there, which turn with
their nodes: their work is that on the ways and turns which joints see, and energy stays. In each
iterate of the step the tangent A tells how tips answer to impulses p of the joints,

    du = A^-1 J^T p / dt,    rates 2 J du / dt,

so that joints are met by Newton's iterates as contact is.
"""

from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.marching.finite import FiniteMidpoint
from impactfem.marching.followed_tips import FollowedTips
from impactfem.marching.held_rows import HeldLumped
from impactfem.marching.stations import Held
from impactfem.system.elastic import ElasticSystem
from impactfem.system.linear import LinearSolver, of_mass
from impactfem.system.stations import Stations
from impactfem.system.surface import SurfaceNodes

_ROUNDED = 64.0 * float(np.finfo(float).eps)  # of places, in the ways of tips
_TINY = float(np.finfo(float).tiny)


class FiniteTipped(FiniteMidpoint):
    """Stepper of a solid with tips, by d coordinates of these.

    Attributes:
        body: Itself, as joints name what they hold.
        counts: Whether this rank adds up what the joints of its tips store.
        volatile: True.
    """

    def __init__(
        self,
        system: ElasticSystem,
        solid: Any,
        surface: SurfaceNodes,
        transfer: Any,
        dt: float,
        linear_solver: str,
        nodes: SurfaceNodes,
        stations: Stations,
    ) -> None:
        """Prepare (collective).

        Args:
            system: As of `FiniteMidpoint`, and so are those up to the linear solver.
            solid: See there.
            surface: See there.
            transfer: See there.
            dt: [s].
            linear_solver: See there.
            nodes: Of the tips.
            stations: Tips, whose rows are those of `nodes`.

        Raises:
            ConvergenceError: The tangent cannot be factored.
        """
        super().__init__(system, solid, surface, transfer, dt, linear_solver)
        self.body, self.counts = self, system.comm.rank == 0
        self.volatile = np.ones(surface.count + 1, dtype=bool)  # its answers change with it
        self._nodes, self._tips, self._far = nodes, FollowedTips(stations, system.dim), False
        self._places = nodes.gather(system.positions.ravel()).ravel()
        self._rows = self._tips.rows(self._places)
        self._far = bool(solid.is_finite)
        self._made = -1  # tangent by which the rows' answers are
        self._begun: Floats | None = None  # rates of the tips at the start of the step
        self._looks, self._laid = 0, np.zeros((surface.count, system.dim))
        self._kicks: LinearSolver | None = None
        self._holder: HeldLumped | None = None
        self._fields: tuple[Floats, Floats] | None = None  # contact forces, what answers to them
        self.set_out(0.0, dt)

    # ---- tips ----------------------------------------------------------------------------------

    def held(self, stations: Stations) -> Held:
        """It as joints hold it."""
        self._holder = HeldLumped(self, self._tips.as_coordinates(stations))
        return self._holder

    def _rows_at(self, displacement: Floats) -> Floats:
        """Rates of the tips by those of their nodes, (d, nodes dim) (collective)."""
        if not self._far:
            return self._rows
        return self._tips.rows(self._places + self._of_nodes(displacement))

    def _of_nodes(self, values: Floats) -> Floats:
        return self._nodes.gather(values).ravel()

    def _pull(self, forces: Floats) -> Floats:
        """Forces on the owned dofs by those on nodes of the tips (nodes dim,)."""
        return self._nodes.pulled(forces.reshape(-1, self._system.dim), self._system.constrained)

    def _refresh(self) -> None:
        """Rows as the step is solved now, and how tips answer by them (collective)."""
        rows = self._rows_at(0.5 * (self.displacement + self._after))
        made = self._solvers.generation
        if self._made == made and np.array_equal(rows, self._rows):
            return
        assert self._solver is not None  # noqa: S101  (`_renew` came first)
        self._rows, self._made, self._fields = rows, made, None
        pulls = np.stack([self._pull(row) for row in rows])
        self._by_impulses = np.stack(list(self._solver.solve_all(pulls))) / self._span
        self._touched = np.stack([self._surface.gather(each) for each in self._by_impulses])
        moved = np.stack([self._of_nodes(each) for each in self._by_impulses])
        self.reach = 2.0 / self._span * rows @ moved.T
        if self._holder is not None:
            self._holder.renew()

    @property
    def span(self) -> float:
        """Of the step [s]."""
        return self._span

    @property
    def generation(self) -> int:
        """Of the tangent, and of what joints do."""
        return super().generation + self._looks

    @property
    def noise(self) -> float:
        """Rounding of the tips' rates."""
        far = float(np.abs(self._of_nodes(self._after)).max(initial=0.0)) + 0.1 * self.size
        return _ROUNDED * far / self._span

    @property
    def joined_coordinates(self) -> Floats:
        """Displacements of the tips at the start of the step, and 0 for turns, (d,)."""
        return self._tips.places(self._of_nodes(self.displacement))

    @property
    def rates(self) -> Floats:
        """Of the tips at the start of the step, (d,) (collective)."""
        if self._begun is None:
            self._begun = self._rows_at(self.displacement) @ self._of_nodes(self.velocity)
        return self._begun

    @property
    def rates_ahead(self) -> Floats:
        """Those that with `rates` make the ways and turns of the step, (d,) (collective)."""
        return 2.0 / self._span * self._rows @ self._way - self.rates

    @property
    def _way(self) -> Floats:
        return self._of_nodes(self._after - self.displacement)

    @property
    def rates_left(self) -> Floats:
        """Of the tips at its end, (d,) (collective)."""
        speeds = 2.0 / self._span * self._way - self._of_nodes(self.velocity)
        return self._rows_at(self._after) @ speeds

    @property
    def reach_ahead(self) -> Floats:
        """At its end, of impulses that leave no time for anything else, (d, d) (collective)."""
        rows = self._rows_at(self._after)
        moved = np.stack([self._of_nodes(self._kicked(row)) for row in rows])
        return np.asarray(rows @ moved.T)

    def _kicked(self, impulses: Floats) -> Floats:
        """Velocities by impulses on nodes of the tips, without time (collective)."""
        if self._kicks is None:
            self._kicks = of_mass(self._system.stiffness, self._mass, self._still, self._kind)
        source, image = self._vectors
        source.setArray(self._pull(impulses))
        image.set(0.0)
        self._kicks.solve(source, image)
        return np.where(self._still, 0.0, image.getArray())

    # ---- a step --------------------------------------------------------------------------------

    def set_out(self, start: float, end: float) -> None:
        """Take up a step between two times without forces of contact and joints (collective)."""
        self.begin(start, end)
        self._joined = self._kick = np.zeros(len(self._rows))
        self._begun, self._made = None, -1
        self._renew()
        self._refresh()

    def impel(self, impulse: Floats) -> bool:
        """Move by what an impulse of the joints on the tips changes; others follow in iterates."""
        change, self._joined = impulse - self._joined, impulse
        self._go(change @ self._by_impulses)
        return False

    def strike(self, forces: Floats) -> None:
        """Add the step's contact forces (count, dim) (collective)."""
        if forces.any():
            self._go(self._solved(self._surface.pulled(forces, self._system.constrained)))

    def _go(self, change: Floats) -> None:
        """Move the iterate, by all of a change, as joints count on it."""
        self._after = self._after + change
        if self._strain.is_inverted(self._after):
            raise ConvergenceError("cells turn inside out")

    def _pushed(self, forces: Floats) -> Floats:
        """With those of the joints."""
        joined = self._pull(self._joined / self._span @ self._rows)
        return super()._pushed(forces) + joined

    def known(self) -> tuple[Floats]:
        """Where the step ends by the last iterate."""
        return (self._after.copy(),)

    def lay(self, forces: Floats) -> None:
        """Put the contact forces of the step (count, dim), and balance them (collective)."""
        self._laid, known = forces, (self._stale, self._left)
        self.unbalanced(forces)
        self._stale, self._left = known
        if self._stale:
            self._renew()
        self._move(self._solved(self._rest))
        self._refresh()

    def left(self, before: Floats, slack: float = 0.0) -> float:
        """Largest force or way of joints that the iterate leaves, over what rounding allows.

        Args:
            before: Where the last iterate ended [m].
            slack: Speeds by which joints round [m/s].
        """
        left = self.unbalanced(self._laid)
        self._change = self._after - before
        rows = self._rows_at(0.5 * (self.displacement + self._after))
        off = 2.0 / self._span * float(np.abs((rows - self._rows) @ self._way).max(initial=0.0))
        return max(left, off / (self.noise + slack + _TINY))

    def linearise(self) -> Floats:
        """How contact nodes move by what balances the iterate (collective)."""
        return self._surface.gather(self._change)

    def look(self) -> None:
        """See where tips are, and how they answer (collective)."""
        self._refresh()
        self._looks += 1

    def fresh_twists(self) -> None:
        """None: contact has no moments on it."""

    def reached(self, forces: Floats) -> Floats:
        """Rates of the tips by contact forces (several, count, dim) for a second (collective)."""
        asked = np.flatnonzero(forces.any(axis=(1, 2)))
        found = np.zeros((len(forces), len(self._rows)))
        if len(asked):
            moved = self._answering(np.ascontiguousarray(forces[asked]))
            nodes = np.stack([self._of_nodes(each) for each in moved])
            found[asked] = 2.0 / self._span**2 * nodes @ self._rows.T
        return found

    def _answers(self, forces: Floats) -> Floats:
        return np.stack([self._surface.gather(each) for each in self._answering(forces)])

    def _answering(self, forces: Floats) -> Floats:
        """Displacements by contact forces (several, count, dim), asked for twice (collective)."""
        if self._fields is None or not np.array_equal(self._fields[0], forces):
            assert self._solver is not None  # noqa: S101  (`_renew` came first)
            held = self._system.constrained
            pushed = np.stack([self._surface.pulled(force, held) for force in forces])
            self._fields = forces.copy(), np.stack(list(self._solver.solve_all(pushed)))
        return self._fields[1]

    def carried(self, impulses: Floats) -> Floats:
        """Velocities of the contact nodes by impulses on the tips, (several, count, dim)."""
        return 2.0 / self._span * np.tensordot(impulses, self._touched, axes=1)

    def kick(self, impulse: Floats) -> None:
        """Let the next step start with rates that an impulse (d,) has changed."""
        self._kick = impulse

    def accept(self) -> None:
        """End the step at the iterate (collective)."""
        super().accept()
        if self._kick.any():
            more = self._kicked(self._kick @ self._rows_at(self.displacement))
            self.velocity = self.velocity + more
        self._begun = None

    def restore(self, state: dict[str, Any], surface: Floats) -> None:
        """Continue from a state."""
        super().restore(state, surface)
        self._begun = None

    def destroy(self) -> None:
        """Free PETSc's objects."""
        if self._kicks is not None:
            self._kicks.destroy()
        super().destroy()
