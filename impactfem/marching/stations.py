"""Bodies that joints hold, each by one protocol: stations that move, and answer to pushes there."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from impactfem.system.stations import Stations

if TYPE_CHECKING:
    from impactfem.marching.rigid import RigidBodies

Floats = NDArray[np.float64]

_SETTLED = 1e-13  # change of rates of stations by forces that are not linear


@dataclass(frozen=True)
class Motion:
    """A layer of stations as joints have solved it; see `impactfem.marching.joint_kernels.joined`.

    Attributes:
        jumps: Whether limits turn rates.
        speeds, spins, halves: At its end, (stations, 3).
        ends, middles, freedoms: (stations, 3, 3).
        wrenches: Impulses of forces and moments of the joints, (stations, 6).
    """

    jumps: bool
    speeds: Floats
    spins: Floats
    halves: Floats
    ends: Floats
    middles: Floats
    freedoms: Floats
    wrenches: Floats


class Counting(Protocol):
    """What marches a body that joints hold.

    Attributes:
        counts: Whether this rank sums it up.
    """

    counts: bool


class Held(Protocol):
    """A body that joints hold, in the order of a layer's calls."""

    @property
    def part(self) -> "Counting":
        """What marches it."""

    def prepare(self, layer: int) -> None:
        """Begin a layer."""

    @property
    def frames(self) -> tuple[Floats, Floats]:
        """Places (stations, 3) and rotations (stations, 3, 3) at the start of the layer."""

    @property
    def rates(self) -> tuple[Floats, Floats]:
        """Velocities, and spins along the axes, at its start, (stations, 3) each."""

    def impulses(self) -> tuple[Floats, Floats]:
        """Of forces and moments without joints, or what these make of rates, (stations, 3) each.

        Rates in space of what is not rigid; see `impactfem.marching.joint_kernels.joined`.
        """

    def take(self, motion: Motion) -> bool:
        """Take a solution of the layer; whether forces would be the same again."""

    def foreseen(self) -> Floats:
        """Displacements of the contact nodes at its end, as it is solved now, (count, dim)."""

    @property
    def places_ahead(self) -> tuple[Floats, Floats]:
        """As `frames`, at the end of the layer."""

    @property
    def rates_ahead(self) -> Floats:
        """Velocities and spins in space at its end, (stations, 6)."""

    @property
    def freedoms(self) -> Floats:
        """Inverse moments of inertia of rigid bodies in space amid the layer, (stations, 3, 3)."""

    @property
    def compliance(self) -> Floats:
        """Rates in space by unit impulses in the layer, (stations, 6, stations, 6); 0 of rigid."""

    @property
    def compliance_ahead(self) -> Floats:
        """The same at its end, of impulses that leave no time for anything else."""

    @property
    def jumped(self) -> bool:
        """Whether laws of its own have given impulses in the layer."""

    def reached(self, forces: Floats) -> Floats:
        """Rates in space by contact forces (several, count, dim) [1/s], (several, stations, 6)."""

    def carried(self, wrenches: Floats) -> Floats:
        """Of the contact nodes by impulses there, (several, stations, 6): (several, count, dim)."""

    def strike(self, forces: Floats) -> None:
        """Add the impulses of contact forces (count, dim), to be solved for."""

    def whirled(self, moments: Floats) -> Floats:
        """Spins of the body by moments (several, turns) on it [1/s], (several, turns)."""

    def whirl(self, moment: Floats) -> None:
        """Add the impulse of a moment (turns,), to be solved for."""

    def leave(self, wrenches: Floats) -> None:
        """Let the next layer start with rates that impulses (stations, 6) have changed."""

    def finish(self) -> None:
        """End the layer."""

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs besides the body."""

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""


class HeldRigid:
    """A rigid body: one station.

    Attributes:
        part: The body.
        jumped: Never.
    """

    def __init__(self, part: "RigidBodies", stations: Stations) -> None:
        """Hold it."""
        self.jumped = False
        self.part, self._light, self._inertia = part, stations.light[0], stations.inertia[0]
        self.compliance = self.compliance_ahead = stations.compliance

    def prepare(self, layer: int) -> None:
        """Begin a layer."""
        self.part.prepare(layer)

    @property
    def frames(self) -> tuple[Floats, Floats]:
        """Its centre and rotation."""
        return self.part.frame

    @property
    def rates(self) -> tuple[Floats, Floats]:
        """Of its centre."""
        return self.part.rates

    def impulses(self) -> tuple[Floats, Floats]:
        """On its centre."""
        return self.part.impulses()

    def take(self, motion: Motion) -> bool:
        """Take a solution."""
        return self.part.take(
            motion.speeds, motion.spins, motion.halves, motion.ends, motion.middles,
            motion.freedoms,
        )  # fmt: skip

    def foreseen(self) -> Floats:
        """Displacements of the contact nodes."""
        return self.part.foreseen()

    @property
    def places_ahead(self) -> tuple[Floats, Floats]:
        """At the end of the layer."""
        part = self.part
        mean = 0.5 * (part.rates[0] + part.rates_ahead[0])
        return part.frame[0] + part.dt * mean, part.end

    @property
    def rates_ahead(self) -> Floats:
        """In space."""
        speed, spin = self.part.rates_ahead
        return np.hstack([speed, spin @ self.part.end[0].T])

    @property
    def freedoms(self) -> Floats:
        """Amid the layer."""
        return self.part.freedom

    def _moved(self, wrenches: Floats) -> Floats:
        return np.concatenate(
            [self._light * wrenches[..., :3], wrenches[..., 3:] @ self.part.freedom[0].T], axis=-1
        )

    def reached(self, forces: Floats) -> Floats:
        """By force and moment about its centre."""
        return self._moved(self.part.wrenches(forces))

    def carried(self, wrenches: Floats) -> Floats:
        """With its centre and its turn."""
        return self.part.carried(self._moved(wrenches))

    def strike(self, forces: Floats) -> None:
        """Add contact forces."""
        self.part.strike(forces)

    def whirled(self, moments: Floats) -> Floats:
        """About its centre."""
        first = 3 - moments.shape[-1]
        return np.asarray(moments @ self.part.freedom[0, first:, first:])

    def whirl(self, moment: Floats) -> None:
        """Add a moment."""
        self.part.whirl(moment[None])

    def leave(self, wrenches: Floats) -> None:
        """Change its rates at the end."""
        (speed, spin), end = self.part.rates_ahead, self.part.end[0]
        turned = np.linalg.solve(self._inertia, end.T @ wrenches[0, 3:])
        self.part.leave(speed + self._light * wrenches[:, :3], spin + turned)

    def finish(self) -> None:
        """Nothing: it knows where it is."""

    def memory(self) -> dict[str, Floats]:
        """Nothing."""
        return {}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Nothing."""


class Coordinates(Protocol):
    """Bodies whose contact nodes move by coordinates that stations share."""

    def foreseen(self) -> Floats:
        """Displacements of the contact nodes at the end of the layer, (count, dim)."""

    def strike(self, forces: Floats) -> None:
        """Add contact forces (count, dim)."""

    def reached(self, forces: Floats) -> Floats:
        """Rates by several contact forces (several, count, dim) for a second, (several, d)."""

    def carried(self, impulses: Floats) -> Floats:
        """Velocities of the contact nodes by impulses (several, d), (several, count, dim)."""


class HeldByRows[B: Coordinates]:
    """Stations whose rates are rows of those of coordinates: what contact does goes by these.

    Attributes:
        part: The bodies.
    """

    part: B
    _rows: Floats  # (6 stations, d)

    def _each(self, values: Floats) -> Floats:
        return values.reshape(*values.shape[:-1], -1, 6)

    def foreseen(self) -> Floats:
        """Displacements of the contact nodes."""
        return self.part.foreseen()

    @property
    def freedoms(self) -> Floats:
        """None: see `compliance`."""
        return np.zeros((len(self._rows) // 6, 3, 3))

    def reached(self, forces: Floats) -> Floats:
        """By what contact forces make of all rates."""
        return self._each(self.part.reached(forces) @ self._rows.T)

    def carried(self, wrenches: Floats) -> Floats:
        """With all rates."""
        return self.part.carried(wrenches.reshape(len(wrenches), -1) @ self._rows)

    def strike(self, forces: Floats) -> None:
        """Add contact forces."""
        self.part.strike(forces)

    def whirled(self, moments: Floats) -> Floats:
        """Nothing: contact has no moments on what does not roll."""
        return np.zeros_like(moments)

    def whirl(self, moment: Floats) -> None:
        """Nothing."""


class Linear(Coordinates, Counting, Protocol):
    """Bodies whose stations move with coordinates along lines.

    Attributes:
        dt: Time step [s].
    """

    dt: float

    @property
    def coordinates(self) -> Floats:
        """At the start of the layer, (d,)."""

    @property
    def rates(self) -> Floats:
        """Of the coordinates at the start of the layer, (d,)."""

    @property
    def rates_ahead(self) -> Floats:
        """The same at its end, as it is solved now."""

    @property
    def reach(self) -> Floats:
        """Rates at the end of the layer by unit impulses in it, (d, d)."""

    def set_out(self, layer: int) -> None:
        """Solve the layer without forces of contact and joints."""

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
        jumped: Never.
    """

    def __init__(self, part: Linear, stations: Stations) -> None:
        """Hold them."""
        if stations.rows is None:
            raise NotImplementedError
        self.jumped = False
        self.part, count = part, len(stations.places)
        self.compliance_ahead = stations.compliance
        self._rows = stations.rows.reshape(6 * count, -1)
        self._places = stations.places
        self._turns = self._ends = stations.turns
        self._rest = part.coordinates.copy()
        self._wrench = np.zeros(6 * count)
        self._renew()

    def _renew(self) -> None:
        """How stations answer to impulses in the layer, (6 stations, 6 stations)."""
        self._flat = self._rows @ self.part.reach @ self._rows.T

    def prepare(self, layer: int) -> None:
        """Begin a layer."""
        self._wrench = np.zeros(len(self._rows))
        self.part.set_out(layer)
        self._renew()

    def _moved(self, moved: Floats) -> Floats:
        """Places by ways of the coordinates."""
        return np.asarray(self._places + self._each(self._rows @ moved)[:, :3])

    @property
    def frames(self) -> tuple[Floats, Floats]:
        """Where the stations are."""
        return self._moved(self.part.coordinates - self._rest), self._turns

    def _rates(self, rates: Floats) -> tuple[Floats, Floats]:
        found = self._each(self._rows @ rates)
        return found[:, :3], np.einsum("sji,sj->si", self._turns, found[:, 3:])

    @property
    def rates(self) -> tuple[Floats, Floats]:
        """Of the stations."""
        return self._rates(self.part.rates)

    def impulses(self) -> tuple[Floats, Floats]:
        """Changes of their rates without joints, as forces are now."""
        part = self.part
        changed = self._each(
            self._rows @ (part.rates_ahead - part.rates) - self._flat @ self._wrench
        )
        return changed[:, :3], changed[:, 3:]

    def take(self, motion: Motion) -> bool:
        """Move all coordinates by the impulses of the joints."""
        self._wrench, self._ends = motion.wrenches.ravel(), motion.ends
        linear = self.part.impel(self._rows.T @ self._wrench)
        if linear:
            return True
        thought = np.concatenate([motion.speeds, motion.spins])
        found = np.concatenate(self._rates(self.part.rates_ahead))
        allowed = _SETTLED * np.abs(found).max() + np.finfo(float).tiny
        return bool(np.abs(found - thought).max() <= allowed)

    @property
    def places_ahead(self) -> tuple[Floats, Floats]:
        """At the end of the layer."""
        part = self.part
        mean = 0.5 * (part.rates + part.rates_ahead)
        return self._moved(part.coordinates + part.dt * mean - self._rest), self._ends

    @property
    def rates_ahead(self) -> Floats:
        """In space."""
        return self._each(self._rows @ self.part.rates_ahead)

    @property
    def compliance(self) -> Floats:
        """Of the layer."""
        count = len(self._places)
        return self._flat.reshape(count, 6, count, 6)

    def leave(self, wrenches: Floats) -> None:
        """Change all rates at the end, as impulses without time for anything else do."""
        self.part.kick(self._rows.T @ wrenches.ravel())

    def finish(self) -> None:
        """Keep the rotations."""
        self._turns = self._ends

    def memory(self) -> dict[str, Floats]:
        """Rotations of the stations."""
        return {"turns": self._turns.copy()}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from these."""
        self._turns = self._ends = memory["turns"].copy()
