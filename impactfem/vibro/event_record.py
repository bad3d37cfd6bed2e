"""What a run from event to event leaves behind: rows, impacts, effort."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.result.bar_motion import Effort
from impactfem.result.trajectory import Impacts, Trajectory
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.event_contacts import Contacts, Row
from impactfem.vibro.event_legs import Event, Leg, Strike

_EPS = 2.0**-52


def gap_rounding(system: GeneralizedSystem, t: float, u: Floats, v: Floats) -> Floats:
    """Rounding of the gaps by that of the state and of the time, shape (J,)."""
    size = np.abs(system.gradient(u)) @ np.abs(u) + np.abs(system.motion_at(t))
    if isinstance(system, LinearSystem):
        size = size + np.abs(system.offsets)
    speed = np.abs(system.jacobian(u)) @ np.abs(v) + np.abs(system.motion_rate(t))
    return np.asarray(_EPS * (64.0 * size + 4.0 * t * speed))


class Record:
    """Output of a run.

    Args:
        system: The system.
        times: Of the output, from 0 to the end [s], shape (rows + 1,).
        max_impacts: Limit of the number of impacts.
        keep: Number of impacts that are kept, the last ones; None for all.
        legs: List to keep flights in; None for none.

    Attributes:
        position: u at t_m, shape (rows + 1, d).
        velocity: u' just after t_m, shape (rows + 1, d).
        impulse: Impulses of impacts since t_{m-1} [N s], shape (rows + 1, J).
        lasting: Integrals of the forces of lasting contact since t_{m-1} [N s], (rows + 1, J).
        peak: Largest sum of these forces so far [N].
        count: Impacts so far.
        steps: Substeps so far.
        rubbed: Work of friction since t_{m-1} [J], shape (rows + 1,).
        legs: The flights and the events before them; None if they are not kept.
    """

    def __init__(
        self, system: GeneralizedSystem, times: Floats, max_impacts: int, keep: int | None,
        legs: list[Leg] | None = None,
    ) -> None:  # fmt: skip
        rows = len(times) - 1
        self.system = system
        self.times = times
        self.legs = legs
        self.position: Floats = np.zeros((rows + 1, system.coordinates))
        self.velocity: Floats = np.zeros((rows + 1, system.dofs))
        self.impulse: Floats = np.zeros((rows + 1, system.num_constraints))
        self.lasting: Floats = np.zeros((rows + 1, system.num_constraints))
        self.peak = 0.0
        self.count = 0
        self.steps = 0
        self.rubbed: Floats = np.zeros(rows + 1)
        self._max, self._keep = max_impacts, keep
        self.tables: list[Floats] = []
        self._held = 0

    def near(self, t: float, u: Floats, v: Floats) -> NDArray[np.bool_]:
        """Constraints that are closed to rounding of the state and of the time, shape (J,)."""
        return np.asarray(self.system.gap(t, u) <= gap_rounding(self.system, t, u, v))

    def fill(self, row: int, u: Floats, v: Floats) -> None:
        """Set an output row."""
        if row < len(self.times):
            self.position[row], self.velocity[row] = u, v

    def depart(
        self, t: float, before: tuple[Floats, Floats], after: tuple[Floats, Floats], row: int,
        contacts: Contacts, strikes: tuple[Strike, ...], cause: int = -1, kick: int = -1,
        stop: int = -1,
    ) -> None:  # fmt: skip
        """Keep an event at t, u and v before and after it, and the flight that begins there."""
        if self.legs is not None:
            event = Event(t, cause, kick, stop, strikes, *before, row)
            self.legs.append(Leg(event, *after, contacts.closed, contacts.modes))

    def add(self, impacts: list[Row], impulses: Floats, row: int) -> None:
        """Add impacts and their impulses (J,) in the interval that ends at a row."""
        self.impulse[min(row, len(self.times) - 1)] += impulses
        if impacts:
            self.extend(np.array(impacts, dtype=float))

    def extend(self, table: Floats) -> None:
        """Add rows (time, constraint, before, after, impulse); the impulses are added already.

        Raises:
            ConvergenceError: There are more impacts than allowed.
        """
        if not len(table):
            return
        self.count += len(table)
        if self.count > self._max:
            raise ConvergenceError(
                f"events: more than {self._max} impacts before t = {table[-1, 0]:.6g}; give a "
                "larger stick_speed or max_impacts, or a restitution < 1 so that the motion sticks"
            )
        if self._keep == 0:
            return
        self.tables.append(table.copy())
        self._held += len(table)
        while self._keep is not None and self._held - len(self.tables[0]) >= self._keep:
            self._held -= len(self.tables.pop(0))

    def table(self) -> Floats:
        """Impacts that are kept (time, constraint, before, after, impulse), (impacts, 5)."""
        table = np.concatenate([np.empty((0, 5)), *self.tables])
        return table if self._keep is None else table[max(0, len(table) - self._keep) :]

    def trajectory(self, contacts: Contacts) -> Trajectory:
        """The trajectory of the run."""
        system, times = self.system, self.times
        impulse, lasting, rubbed = map(_from_start, (self.impulse, self.lasting, self.rubbed))
        force = np.zeros_like(lasting)
        force[1:] = lasting[1:] / np.diff(times)[:, None]
        states = list(zip(times, self.position, self.velocity, strict=True))
        table = self.table()
        return Trajectory(
            times=times,
            position=self.position,
            velocity=self.velocity,
            gap=np.array([system.gap(t, u) for t, u, _ in states]),
            contact_force=force,
            impulse=impulse + lasting,
            kinetic=np.array([system.kinetic_energy(u, v) for _, u, v in states]),
            potential=np.array(
                [system.potential(t, u) if system.potential else 0.0 for t, u, _ in states]
            ),
            friction_work=np.cumsum(rubbed),
            peak=self.peak if self.peak > 0.0 else None,
            impacts=Impacts(table[:, 0], table[:, 1].astype(np.int64), *table[:, 2:].T),
            effort=Effort(iterations=self.steps, details=self._details(contacts)),
        )

    def _details(self, contacts: Contacts) -> dict[str, Any]:
        end = float(self.times[-1])
        spells = [
            [float(start), end if math.isnan(stop) else float(min(stop, end)), int(j)]
            for j, start, stop in contacts.spells
        ]
        return {
            "impacts": self.count,
            "stick_speed": contacts.threshold,
            "sticking": spells,
            "spells": contacts.spell_count,
            "stuck_at_speed": contacts.dropped_speed,
            "energy_dropped": contacts.dropped_energy,
            **(
                {"friction_work": float(self.rubbed.sum())}
                if self.system.static_friction.any()
                else {}
            ),
            **contacts.details,
        }


def _from_start(pushed: Floats) -> Floats:
    """What was pushed since the row before, that at the start counted in the first interval."""
    moved = pushed.copy()
    moved[1] += moved[0]
    moved[0] = 0.0
    return moved
