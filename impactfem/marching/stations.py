"""Bodies that joints hold, each by one protocol: stations that move, and answer to pushes there."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from impactfem.arrays import Floats
from impactfem.system.stations import Stations

if TYPE_CHECKING:
    from impactfem.marching.rigid import RigidBodies


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

    def look(self) -> None:
        """See where contact nodes are as the step is solved now, and how forces act on them."""


class Held(Protocol):
    """A body that joints hold, in the order of a layer's calls."""

    @property
    def part(self) -> "Counting":
        """What marches it."""

    def set_out(self, start: float, end: float) -> None:
        """Take up a step between two times, without forces of contact and joints."""

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

    def set_out(self, start: float, end: float) -> None:
        """Take up a step."""
        self.part.set_out(start, end)

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

    @property
    def places_ahead(self) -> tuple[Floats, Floats]:
        """At the end of the layer."""
        part = self.part
        mean = 0.5 * (part.rates[0] + part.rates_ahead[0])
        return part.frame[0] + part.span * mean, part.end

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
