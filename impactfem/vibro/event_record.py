"""What a run from event to event leaves behind: rows, impacts, effort."""

import math
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import ConvergenceError
from impactfem.result.bar_motion import Effort
from impactfem.result.trajectory import Impacts, Trajectory
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.event_contacts import Contacts, Row

Floats = NDArray[np.float64]

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
        duration: End [s].
        rows: Intervals of the uniform output grid.
        max_impacts: Limit of the number of impacts.
        keep: Number of impacts that are kept, the last ones; None for all.

    Attributes:
        times: t_m [s], shape (rows + 1,).
        position: u at t_m, shape (rows + 1, d).
        velocity: u' just after t_m, shape (rows + 1, d).
        impulse: Impulses of impacts since t_{m-1} [N s], shape (rows + 1, J).
        lasting: Integrals of the forces of lasting contact since t_{m-1} [N s], (rows + 1, J).
        peak: Largest sum of these forces so far [N].
        count: Impacts so far.
        steps: Substeps so far.
        rubbed: Work of friction since t_{m-1} [J], shape (rows + 1,).
    """

    def __init__(
        self, system: GeneralizedSystem, duration: float, rows: int, max_impacts: int,
        keep: int | None,
    ) -> None:  # fmt: skip
        self.system = system
        self.times: Floats = np.linspace(0.0, duration, rows + 1)
        self.position: Floats = np.zeros((rows + 1, system.coordinates))
        self.velocity: Floats = np.zeros((rows + 1, system.dofs))
        self.impulse: Floats = np.zeros((rows + 1, system.num_constraints))
        self.lasting: Floats = np.zeros((rows + 1, system.num_constraints))
        self.peak = 0.0
        self.count = 0
        self.steps = 0
        self.rubbed: Floats = np.zeros(rows + 1)
        self._max, self._keep = max_impacts, keep
        self._tables: deque[Floats] = deque()
        self._held = 0

    def near(self, t: float, u: Floats, v: Floats) -> NDArray[np.bool_]:
        """Constraints that are closed to rounding of the state and of the time, shape (J,)."""
        return np.asarray(self.system.gap(t, u) <= gap_rounding(self.system, t, u, v))

    def fill(self, row: int, u: Floats, v: Floats) -> None:
        """Set an output row."""
        if row < len(self.times):
            self.position[row], self.velocity[row] = u, v

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
        self._tables.append(table.copy())
        self._held += len(table)
        while self._keep is not None and self._held - len(self._tables[0]) >= self._keep:
            self._held -= len(self._tables.popleft())

    def trajectory(self, contacts: Contacts) -> Trajectory:
        """The trajectory of the run."""
        system, times = self.system, self.times
        for pushed in (self.impulse, self.lasting, self.rubbed):
            pushed[1] += pushed[0]  # at the start
            pushed[0] = 0.0
        force = np.zeros_like(self.lasting)
        force[1:] = self.lasting[1:] / np.diff(times)[:, None]
        states = list(zip(times, self.position, self.velocity, strict=True))
        table = np.concatenate([np.empty((0, 5)), *self._tables])
        if self._keep is not None:
            table = table[max(0, len(table) - self._keep) :]
        return Trajectory(
            times=times,
            position=self.position,
            velocity=self.velocity,
            gap=np.array([system.gap(t, u) for t, u, _ in states]),
            contact_force=force,
            impulse=self.impulse + self.lasting,
            kinetic=np.array([system.kinetic_energy(u, v) for _, u, v in states]),
            potential=np.array(
                [system.potential(t, u) if system.potential else 0.0 for t, u, _ in states]
            ),
            friction_work=np.cumsum(self.rubbed),
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
