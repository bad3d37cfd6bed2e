"""A body whose tips joints hold, in steps that are solved by iterates; see `impactfem.system.tips`.

Forces of joints act at the mean places of a step, by rows J of the tips there, which turn with
their nodes: their work is that on the ways and turns which joints see, and energy stays. In each
iterate of the step its operator A tells how tips answer to impulses p of the joints,

    du = A^-1 J^T p / dt,    rates 2 J du / dt,

so that joints are met by Newton's iterates as contact is. A is the tangent of a solid in implicit
steps, and of nodes of one in explicit steps 2 M / dt^2 (`impactfem.marching.free_nodes`). Steppers
tell where a step starts (``displacement``, ``velocity``) and ends by the iterate (``after``), the
answers of owned dofs to forces (``answered``, ``moved`` of contact) and to impulses that leave no
time (``freed``), move by all of a change (``shift``) or by what balances the iterate with the
forces of joints (``joined``, ``lay``), and say whether rates are told where forces have changed
them after the step (``leaps``).
"""

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from impactfem.arrays import Floats
from impactfem.marching.followed_tips import FollowedTips
from impactfem.marching.held_rows import HeldLumped
from impactfem.marching.stations import Held
from impactfem.system.stations import Stations
from impactfem.system.surface import SurfaceNodes

if TYPE_CHECKING:
    from impactfem.marching.finite import FiniteMidpoint
    from impactfem.marching.free_nodes import FreeNodes

_ROUNDED = 64.0 * float(np.finfo(float).eps)  # of places, in the ways of tips
_TINY = float(np.finfo(float).tiny)


class FiniteTipped:
    """Stepper of a body with tips, by d coordinates of these; what is not said here is its own.

    Attributes:
        stepper: Of the body.
        counts: Whether this rank adds up what the joints of its tips store.
        volatile: Whether its answers change.
    """

    def __init__(
        self,
        stepper: "FiniteMidpoint | FreeNodes",
        nodes: SurfaceNodes,
        stations: Stations,
        places: Floats | None,
        *,
        counts: bool,
    ) -> None:
        """Take the tips (collective).

        Args:
            stepper: Of the body.
            nodes: Of the tips.
            stations: Tips, whose rows are those of `nodes`.
            places: Of the owned nodes without displacement [m], (dofs,); None: arms do not turn.
            counts: See above.
        """
        self.stepper, self.counts, dim = stepper, counts, nodes.dim
        self._nodes, self._tips = nodes, FollowedTips(stations, dim)
        self._places = None if places is None else nodes.gather(places).ravel()
        self._rows = self._tips.first
        steady = stepper.leaps and (places is None or not self._tips.turns)
        self.volatile = np.full(stepper.surface.count + 1, not steady)
        self._made = -1  # operator by which the rows' answers are
        self._begun: tuple[Floats, Floats] | None = None  # velocity, and rates of tips by it
        self._looks, self._laid = 0, np.zeros((stepper.surface.count, dim))
        self._change = stepper.joined = np.zeros_like(stepper.displacement)
        self._joined = self._kick = np.zeros(len(self._rows))
        self._ahead: tuple[Floats, Floats] | None = None  # rows at the end, how these are reached
        self._holder: HeldLumped | None = None
        self.set_out(0.0, stepper.dt)

    def __getattr__(self, name: str) -> Any:
        """What the body has."""
        if name == "stepper":
            raise AttributeError
        return getattr(self.stepper, name)

    @property
    def body(self) -> "FiniteTipped":
        """Itself, as joints name what they hold."""
        return self

    def held(self, stations: Stations) -> Held:
        """It as joints hold it."""
        self._holder = HeldLumped(cast("Any", self), self._tips.as_coordinates(stations))
        self._holder.jumped = self.stepper.leaps
        return self._holder

    # ---- tips ----------------------------------------------------------------------------------

    def _rows_at(self, displacement: Floats) -> Floats:
        """Rates of the tips by those of their nodes, (d, nodes dim) (collective)."""
        if self._places is None:
            return self._rows
        return self._tips.rows(self._places + self._of_nodes(displacement))

    def _of_nodes(self, values: Floats) -> Floats:
        return self._nodes.gather(values).ravel()

    def _pulled(self, rows: Floats) -> Floats:
        """Forces on the owned dofs by several on nodes of the tips, (several, dofs)."""
        held = self.stepper.constrained
        each = rows.reshape(len(rows), -1, self._nodes.dim)
        return np.stack([self._nodes.pulled(row, held) for row in each])

    def _refresh(self) -> None:
        """Rows as the step is solved now, and how tips answer by them (collective)."""
        stepper = self.stepper
        rows = self._rows_at(0.5 * (stepper.displacement + stepper.after))
        if self._made == stepper.generation and np.array_equal(rows, self._rows):
            return
        self._rows, self._made = rows, stepper.generation
        self._by_impulses = stepper.answered(self._pulled(rows)) / stepper.span
        self._touched = np.stack([stepper.surface.gather(each) for each in self._by_impulses])
        moved = np.stack([self._of_nodes(each) for each in self._by_impulses])
        self.reach = 2.0 / stepper.span * rows @ moved.T
        if self._holder is not None:
            self._holder.renew()

    @property
    def generation(self) -> int:
        """Of the operator, and of what joints do."""
        return self.stepper.generation + self._looks

    @property
    def noise(self) -> float:
        """Rounding of the tips' rates."""
        stepper = self.stepper
        far = float(np.abs(self._of_nodes(stepper.after)).max(initial=0.0)) + 0.1 * stepper.size
        return _ROUNDED * far / stepper.span

    @property
    def joined_coordinates(self) -> Floats:
        """Displacements of the tips at the start of the step, and 0 for turns, (d,)."""
        return self._tips.places(self._of_nodes(self.stepper.displacement))

    @property
    def rates(self) -> Floats:
        """Of the tips at the start of the step, (d,) (collective)."""
        stepper = self.stepper
        if self._begun is None or self._begun[0] is not stepper.velocity:
            rates = self._rows_at(stepper.displacement) @ self._of_nodes(stepper.velocity)
            self._begun = stepper.velocity, rates
        return self._begun[1]

    @property
    def rates_ahead(self) -> Floats:
        """Those that with `rates` make the ways and turns of the step, (d,) (collective)."""
        return 2.0 / self.stepper.span * self._rows @ self._way - self.rates

    @property
    def _way(self) -> Floats:
        return self._of_nodes(self.stepper.after - self.stepper.displacement)

    @property
    def rates_left(self) -> Floats:
        """Of the tips at its end, (d,) (collective)."""
        stepper = self.stepper
        speeds = 2.0 / stepper.span * self._way - self._of_nodes(stepper.velocity)
        return self._rows_at(stepper.after) @ speeds

    @property
    def reach_ahead(self) -> Floats:
        """At its end, of impulses that leave no time for anything else, (d, d) (collective)."""
        rows = self._rows_at(self.stepper.after)
        if self._ahead is None or not np.array_equal(self._ahead[0], rows):
            freed = self.stepper.freed(self._pulled(rows))
            self._ahead = rows, rows @ np.stack([self._of_nodes(each) for each in freed]).T
        return self._ahead[1]

    # ---- a step --------------------------------------------------------------------------------

    def set_out(self, start: float, end: float) -> None:
        """Take up a step between two times without forces of contact and joints (collective)."""
        self.stepper.begin(start, end)
        self.stepper.renew()
        self._joined = self._kick = np.zeros(len(self._rows))
        self._refresh()

    def impel(self, impulse: Floats) -> bool:
        """Move by what an impulse of the joints on the tips changes; others follow in iterates."""
        change, self._joined = impulse - self._joined, impulse
        self.stepper.shift(change @ self._by_impulses)
        return not self.volatile[-1]

    def strike(self, forces: Floats) -> None:
        """Add the step's contact forces (count, dim) (collective)."""
        if forces.any():
            self.stepper.shift(self.stepper.moved(forces[None])[0])

    def _join(self) -> None:
        """Tell the forces of the joints."""
        acting = self._joined / self.stepper.span @ self._rows
        self.stepper.joined = self._pulled(acting[None])[0]

    def known(self) -> tuple[Floats]:
        """Where the step ends by the last iterate."""
        return (self.stepper.after.copy(),)

    def lay(self, forces: Floats) -> None:
        """Put the contact forces of the step (count, dim), and balance them (collective)."""
        self._laid = forces
        self._join()
        self.stepper.lay(forces)
        self._refresh()

    def left(self, before: Floats, slack: float = 0.0) -> float:
        """Largest force or way of joints that the iterate leaves, over what rounding allows.

        Args:
            before: Where the last iterate ended [m].
            slack: Speeds by which joints round [m/s].
        """
        stepper = self.stepper
        self._join()
        left = stepper.unbalanced(self._laid)
        self._change = stepper.after - before
        rows = self._rows_at(0.5 * (stepper.displacement + stepper.after))
        off = 2.0 / stepper.span * float(np.abs((rows - self._rows) @ self._way).max(initial=0.0))
        return max(left, off / (self.noise + slack + _TINY))

    def linearise(self) -> Floats:
        """How contact nodes move by what balances the iterate (collective)."""
        return self.stepper.surface.gather(self._change)

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
            moved = self.stepper.moved(np.ascontiguousarray(forces[asked]))
            nodes = np.stack([self._of_nodes(each) for each in moved])
            found[asked] = 2.0 / self.stepper.span**2 * nodes @ self._rows.T
        return found

    def carried(self, impulses: Floats) -> Floats:
        """Velocities of the contact nodes by impulses on the tips, (several, count, dim)."""
        return 2.0 / self.stepper.span * np.tensordot(impulses, self._touched, axes=1)

    def kick(self, impulse: Floats) -> None:
        """Let the next step start with rates that an impulse (d,) has changed."""
        self._kick = impulse

    def accept(self) -> None:
        """End the step at the iterate (collective)."""
        stepper = self.stepper
        stepper.accept()
        if self._kick.any():
            pulled = self._pulled((self._kick @ self._rows_at(stepper.displacement))[None])
            stepper.velocity = stepper.velocity + stepper.freed(pulled)[0]

    def destroy(self) -> None:
        """Free PETSc's objects, and let go of what holds this in turn."""
        self._holder = None
        self.stepper.destroy()
