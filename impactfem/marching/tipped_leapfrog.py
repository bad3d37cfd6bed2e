"""Explicit layers of solids of which joints, ties or springs hold some, with what they hold.

They are solved with all bodies beside (`impactfem.marching.staggered`): a step from amid one layer
to amid the next, in which forces F_m of the level and impulses L of joints act on lumped masses M,

    v_{m+1/2} = v_{m-1/2} + dt M^-1 (F_m - K u_m) + M^-1 G^T L,
    x_{m+1/2} = u_m + dt v_{m+1/2} / 2,

is the leapfrog with u_{m+1} = x_{m+1/2} + dt v_{m+1/2} / 2, and its x moves with the mean of both
velocities. Rows g(x_{m+1/2}) = 0 make W = G M^-1 G^T: no elastic force answers within the step. As
its energy is v (M - dt^2 K / 4) v / 2 + x K x / 2, impulses along G do no work where the rows hold,
and springs that are strained by x need no shorter step.

The first step is half as long, so that x_{1/2} = u_0 + dt (v_0 + v_{1/2}) / 4 and u_1 is what
`impactfem.marching.staggered` has, as if u_0 had been u_1 - dt v_{1/2}.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.marching.layers import Sums
from impactfem.marching.leapfrog import Leapfrog
from impactfem.marching.meshless import step_length
from impactfem.marching.staggered import FIRST
from impactfem.marching.tipped import Tipped
from impactfem.system.stations import Stations
from impactfem.system.surface import SurfaceNodes


class TippedLeapfrog(Tipped, Leapfrog):
    """Explicit interior as a part of `impactfem.marching.staggered.Staggered`; tips if it has any.

    Attributes:
        counts: Whether this rank adds up what the joints of its tips store.
        span: Of the step [s].
    """

    reversible = False
    blocks = 2

    def with_tips(self, nodes: SurfaceNodes, stations: Stations | None) -> "TippedLeapfrog":
        """Take tips, whose rows are those of nodes, and find what impulses on them do (collective).

        Args:
            nodes: Of the tips.
            stations: Tips; None: nothing holds it.
        """
        surface = self._surface
        self.counts, self.span, self.noise = surface.comm.rank == 0, self.dt, 0.0
        self._still = self._inverse == 0.0
        self._free = surface.gather((~self._system.constrained).astype(float))
        # Way to the first level over that with the velocity in the step, as of all that is held.
        self._first = 1.0 if stations is None else FIRST
        self._starts, self._behind, self._began = False, 0.0, 0.0
        self._before = self._contact
        self._take_tips(nodes, stations)
        self._find_answers()
        self._renew()
        return self

    def _find_answers(self) -> None:
        """What impulses on tips that leave no time for anything else do (collective)."""
        own = self._tips.dofs
        count = len(self._rows)
        self._by_kicks = np.zeros((count, len(own)))
        self._touched = np.zeros((count, self._surface.count, self._surface.dim))
        self.reach_ahead = np.zeros((count, count))
        for k, row in enumerate(self._rows):
            kick = self._inverse * self._pull(row)
            self._by_kicks[k], self._touched[k] = kick[own], self._followed(kick)
            self.reach_ahead[:, k] = self._of_tips(kick)
        self.reach = self._slowed * self.reach_ahead

    @property
    def _slowed(self) -> float:
        """Velocities that damping by the mass leaves of those by impulses in a step."""
        return self._gain / self.dt**2

    def _followed(self, values: Floats) -> Floats:
        """How contact nodes move with owned dofs, (count, dim) (collective)."""
        if self._statics is None:
            return self._surface.gather(values)
        return self._statics.equilibrium(values)

    def _kicked(self, forces: Floats) -> Floats:
        """Velocities of the owned dofs by impulses on contact nodes (count, dim) in a step."""
        found = np.zeros_like(self.displacement)
        mobility = self._slowed * self._inverse
        if self._statics is None:
            self._surface.spread(forces, found)
            return mobility * found
        near = self._statics.near
        found[near] = -self._statics.pushed(self._statics.response(forces))
        return mobility * found

    def _unit(self, force: Floats) -> list[Floats]:
        """See `Tipped`."""
        kicked = self._kicked(force)
        return [self._followed(kicked), self.static(force), self._of_tips(kicked)]

    def _renew(self) -> None:
        """Take coordinates and rates of the tips from the body amid the layer (collective)."""
        self.rates = self.rates_ahead = self._of_tips(self._step) / self.dt
        self.joined_coordinates = self._of_tips(self.displacement) - self._behind * self.rates
        self._joined = self._kick = np.zeros(len(self._rows))

    @property
    def rates_left(self) -> Floats:
        """Of the coordinates at the end of the step, (d,)."""
        return self.rates_ahead

    @property
    def surface_velocity(self) -> Floats:
        """Of the contact nodes in the last layer [m/s], (count, dim) (collective)."""
        return self._surface.gather(self.velocity)

    touching_velocity = surface_velocity

    @property
    def velocity_ahead(self) -> Floats:
        """Of the contact nodes in the layer, as it is solved now [m/s], (count, dim)."""
        return (self._contact - self._before) / self.dt

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:  # noqa: ARG002  (of others)
        """Velocities of contact nodes in the layers beside the level [m/s] (collective)."""
        return self.surface_velocity, self.velocity_ahead

    def reaching(self, span: float) -> Floats:  # noqa: ARG002  (of others)
        """Displacement of the contact nodes at the level, (count, dim): they are told there."""
        return self._contact

    def drift(self, span: float) -> None:
        """Nothing: it is kept as it is at levels."""

    def begin(self, start: float, end: float) -> None:
        """Solve the step between times amid layers, without forces of contact and joints."""
        self.span, half = step_length(start, end, self.dt), 0.5 * self.dt
        self._starts = first = start == 0.0
        self._began, slow = 0.0 if first else start + half, self._step.copy() if first else None
        super().begin(self._began, end + half)
        if slow is not None and self._leads < 1.0:
            self.displacement += np.where(
                self._still, 0.0, (1.0 - self._leads) * (slow - self._step)
            )
            self._contact = self._contact_at(end + half)
            self._given = None  # this way has the energy of the start
        self.rates_ahead = self._of_tips(self._step) / self.dt
        self._joined = self._kick = np.zeros(len(self._rows))

    set_out = begin

    def _hasten(self, where: Any, kicked: Floats) -> None:
        """Let velocities of some dofs change in the step."""
        self._step[where] += self.dt * kicked
        self.displacement[where] += self._leads * self.dt * kicked

    @property
    def _leads(self) -> float:
        """Way to the level over that with the velocity in the step."""
        return self._first if self._starts else 1.0

    def impel(self, impulse: Floats) -> bool:
        """Solve the layer with an impulse of joints (d,); it answers linearly."""
        change = self._slowed * (impulse - self._joined)
        self._joined = impulse
        self._hasten(self._tips.dofs, change @ self._by_kicks)
        moved = np.tensordot(change, self._touched, axes=1)
        self._contact = self._contact + self._leads * self.dt * moved
        self.rates_ahead = self.rates_ahead + self.reach_ahead @ change
        return True

    def strike(self, forces: Floats) -> None:
        """Add the layer's contact forces (count, dim)."""
        kicked = self._kicked(self.span * self._free * forces)
        self._hasten(slice(None), kicked)
        self._contact = self._contact + self._leads * self.dt * self._followed(kicked)
        self.rates_ahead = self.rates_ahead + self._of_tips(kicked)

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:  # noqa: ARG002
        """Add the layer's contact forces, where nothing holds the body."""
        kicked = self._kicked(self.span * forces)
        self._hasten(slice(None), kicked)
        followed = self._leads * self.dt * self._followed(kicked) if change is None else change
        self._contact = self._contact + followed

    def reached(self, forces: Floats) -> Floats:
        """Rates by several contact forces (several, count, dim) for a second, (several, d)."""
        return self._by_units(self._free * forces)[2]

    def carried(self, impulses: Floats) -> Floats:
        """Velocities of the contact nodes by impulses on the tips, (several, count, dim)."""
        return self._slowed * np.tensordot(impulses, self._touched, axes=1)

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Answers at the end of the step to several forces, without joints."""
        moved, static, _ = self._by_units(forces)
        # `Staggered` makes those of the level of them.
        return (self._first / 6.0 if self._starts else 0.5) * self.dt**2 * moved, static

    answers = columns

    def finish(self, static: Floats) -> list[Sums]:
        """End the step, go on to the level and sum up amid the layer."""
        kicked = bool(self._kick.any())
        if kicked:
            speeds = self._kick @ self._by_kicks
            self._step[self._tips.dofs] += self.dt * speeds
            self.displacement[self._tips.dofs] += 0.5 * self.dt * speeds
            moved = np.tensordot(self._kick, self._touched, axes=1)
            self._contact = self._contact + 0.5 * self.dt * moved
        if kicked or self._leads < 1.0:
            self._look_back()
        found = super().finish(static)
        self._behind = 0.5 * self.dt
        self._renew()
        for sums in found:  # `Staggered` goes on to the level
            sums.first_moment = sums.first_moment - 0.5 * self.dt * sums.momentum
        return found

    def _look_back(self) -> None:
        """Take the forces of the level that it would have come from as it moves now."""
        kept, contact = self.displacement.copy(), self._contact
        self.displacement -= self._step
        self._contact_at(self._began)
        self._strain(0.0)
        self.displacement[:], self._contact = kept, contact

    def memory(self) -> dict[str, Floats]:
        """How far it is behind its level."""
        return {"behind": np.array([self._behind])}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        self._behind = float(memory["behind"][0])
        self._renew()

    def restore(self, state: dict[str, Any], surface: Floats) -> None:
        """Continue from a state."""
        super().restore(state, surface)
        self._renew()
