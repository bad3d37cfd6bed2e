"""Points, beams, links and tips of solids as joints hold them: by coordinates that they share."""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from impactfem.arrays import Floats
from impactfem.marching.stations import Counting, Motion
from impactfem.system.stations import Stations

_SETTLED = 1e-13  # change of rates of stations by forces that are not linear


class Coordinates(Protocol):
    """Bodies whose contact nodes move by coordinates that stations share."""

    def strike(self, forces: Floats) -> None:
        """Add contact forces (count, dim)."""

    def reached(self, forces: Floats) -> Floats:
        """Rates by several contact forces (several, count, dim) for a second, (several, d)."""

    def carried(self, impulses: Floats) -> Floats:
        """Velocities of the contact nodes by impulses (several, d), (several, count, dim)."""


class HeldByRows[B: Coordinates]:
    """Stations whose rates are rows of those of coordinates: what contact does goes by these.

    Attributes:
        by: What moves the coordinates.
    """

    by: B
    _rows: Floats  # (6 stations, d)

    def _each(self, values: Floats) -> Floats:
        return values.reshape(*values.shape[:-1], -1, 6)

    @property
    def steady_answer(self) -> Floats | None:
        """None: it may turn."""
        return None

    @property
    def freedoms(self) -> Floats:
        """None: see `compliance`."""
        return np.zeros((len(self._rows) // 6, 3, 3))

    def reached(self, forces: Floats) -> Floats:
        """By what contact forces make of all rates."""
        return self._each(self.by.reached(forces) @ self._rows.T)

    def carried(self, wrenches: Floats) -> Floats:
        """With all rates."""
        return self.by.carried(wrenches.reshape(len(wrenches), -1) @ self._rows)

    def strike(self, forces: Floats) -> None:
        """Add contact forces."""
        self.by.strike(forces)

    def whirled(self, moments: Floats) -> Floats:
        """Nothing: contact has no moments on what does not roll."""
        return np.zeros((len(moments), len(self._rows) // 6, moments.shape[2]))

    def spun(self, moments: Floats) -> Floats:  # noqa: ARG002  (of rigid bodies)
        """Nothing."""
        return np.zeros((1, 1, 1))

    def whirl(self, moments: Floats) -> None:
        """Nothing."""


class Linear(Coordinates, Counting, Protocol):
    """Bodies whose stations move with coordinates along lines."""

    @property
    def span(self) -> float:
        """Of the step [s]."""

    @property
    def joined_coordinates(self) -> Floats:
        """At the start of the layer, (d,)."""

    @property
    def rates(self) -> Floats:
        """Of the coordinates at the start of the layer, (d,)."""

    @property
    def rates_ahead(self) -> Floats:
        """Those that with `rates` make the ways of the layer, as it is solved now."""

    @property
    def rates_left(self) -> Floats:
        """Of the coordinates at its end; `rates_ahead` if these move along lines."""

    @property
    def reach(self) -> Floats:
        """Rates at the end of the layer by unit impulses in it, (d, d)."""

    @property
    def reach_ahead(self) -> Floats:
        """The same at its end, of impulses that leave no time for anything else."""

    @property
    def noise(self) -> float:
        """Rounding of rates where it does not answer linearly."""

    def set_out(self, start: float, end: float) -> None:
        """Solve a step between two times without forces of contact and joints."""

    def impel(self, impulse: Floats) -> bool:
        """Solve the layer with an impulse of joints (d,); whether it answers linearly."""

    def kick(self, impulse: Floats) -> None:
        """Let the next layer start with rates that an impulse (d,) has changed."""


class HeldLumped(HeldByRows[Linear]):
    """Points, a beam, tips of a solid: stations whose rates are rows of the coordinates' rates.

    Rotations of the stations are those of the steps that joints have seen: these do the work of
    moments exactly. They are the rotation of the coordinates to the third order of a step's turn.

    Attributes:
        part: The bodies.
        jumped: Whether rates are told where forces have changed them after the step.
    """

    def __init__(self, by: Linear, stations: Stations, part: Counting | None = None) -> None:
        """Hold them; what marches them if it is not what moves their coordinates."""
        self.jumped = False
        self.by, self.part, count = by, part or by, len(stations.places)
        self._rows = stations.rows.reshape(6 * count, -1)
        self._places = stations.places
        self._turns = self._ends = stations.turns
        self._rest = by.joined_coordinates.copy()
        self._wrench = np.zeros(6 * count)
        self._reach: Floats | None = None
        self._reach_ahead: Floats | None = None
        self._flat_ahead = np.zeros((0, 0))
        self.renew()
        moved, turned = np.diag(self._flat).reshape(count, 2, 3).sum(axis=(0, 2))
        # By which spins are compared with speeds [m].
        self._arm = float(np.sqrt(moved / turned)) if turned > 0.0 else 0.0

    def renew(self) -> None:
        """How stations answer to impulses in the layer, (6 stations, 6 stations)."""
        reach = self.by.reach
        if reach is not self._reach:
            self._reach, self._flat = reach, self._rows @ reach @ self._rows.T

    @property
    def steady_answer(self) -> Floats | None:
        """See `Held`."""
        return None if np.any(self.part.volatile) else self._flat

    @property
    def compliance_ahead(self) -> Floats:
        """At its end."""
        count, reach = len(self._places), self.by.reach_ahead
        if reach is not self._reach_ahead:
            self._reach_ahead, self._flat_ahead = reach, self._rows @ reach @ self._rows.T
        return self._flat_ahead.reshape(count, 6, count, 6)

    def set_out(self, start: float, end: float) -> None:
        """Take up a step."""
        self.by.set_out(start, end)
        self._wrench = np.zeros(len(self._rows))
        self.renew()

    def _moved(self, moved: Floats) -> Floats:
        """Places by ways of the coordinates."""
        return np.asarray(self._places + self._each(self._rows @ moved)[:, :3])

    @property
    def frames(self) -> tuple[Floats, Floats]:
        """Where the stations are."""
        return self._moved(self.by.joined_coordinates - self._rest), self._turns

    def _rates(self, rates: Floats) -> tuple[Floats, Floats]:
        found = self._each(self._rows @ rates)
        return found[:, :3], np.einsum("sji,sj->si", self._turns, found[:, 3:])

    @property
    def rates(self) -> tuple[Floats, Floats]:
        """Of the stations."""
        return self._rates(self.by.rates)

    def impulses(self) -> tuple[Floats, Floats]:
        """Changes of their rates without joints, as forces are now."""
        part = self.by
        changed = self._each(
            self._rows @ (part.rates_ahead - part.rates) - self._flat @ self._wrench
        )
        return changed[:, :3], changed[:, 3:]

    def take(self, motion: Motion) -> bool:
        """Move all coordinates by the impulses of the joints."""
        self._wrench, self._ends = motion.wrenches.ravel(), motion.ends
        linear = self.by.impel(self._rows.T @ self._wrench)
        if linear:
            return True
        self.renew()
        found, size, off = self._rates(self.by.rates_ahead), 0.0, 0.0
        each = zip(found, (motion.speeds, motion.spins), (1.0, self._arm), strict=True)
        for rates, thought, arm in each:
            size = max(size, arm * float(np.abs(rates).max()))
            off = max(off, arm * float(np.abs(rates - thought).max()))
        return bool(off <= _SETTLED * size + self.by.noise)

    @property
    def places_ahead(self) -> tuple[Floats, Floats]:
        """At the end of the layer."""
        part = self.by
        mean = 0.5 * (part.rates + part.rates_ahead)
        return self._moved(part.joined_coordinates + part.span * mean - self._rest), self._ends

    @property
    def rates_ahead(self) -> Floats:
        """In space."""
        return self._each(self._rows @ self.by.rates_left)

    @property
    def compliance(self) -> Floats:
        """Of the layer."""
        count = len(self._places)
        return self._flat.reshape(count, 6, count, 6)

    def leave(self, wrenches: Floats) -> None:
        """Change all rates at the end, as impulses without time for anything else do."""
        self.by.kick(self._rows.T @ wrenches.ravel())

    def finish(self) -> None:
        """Keep the rotations."""
        self._turns = self._ends

    def settle(self) -> None:
        """Begin where the body has come to rest."""
        moved = self._each(self._rows @ (self.by.joined_coordinates - self._rest))
        self._turns = self._ends = Rotation.from_rotvec(moved[:, 3:]).as_matrix() @ self._turns

    def memory(self) -> dict[str, Floats]:
        """Rotations of the stations."""
        return {"turns": self._turns.copy()}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from these."""
        self._turns = self._ends = memory["turns"].copy()
