"""Bodies that joints hold, each by one protocol: stations that move, and answer to pushes there."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.marching.rigid_sums import applied, on_bodies

if TYPE_CHECKING:
    from impactfem.marching.rigid import RigidBodies


@dataclass(frozen=True)
class Motion:
    """A layer of stations as joints have solved it; see `impactfem.marching.joint_kernels.joined`.

    Attributes:
        jumps: Whether limits turn rates.
        noise: Rounding of rates by that of places in rows [m/s].
        speeds, spins, halves: At its end, (stations, 3).
        ends, middles, freedoms: (stations, 3, 3).
        wrenches: Impulses of forces and moments of the joints, (stations, 6).
    """

    jumps: bool
    noise: float
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
    volatile: Booleans

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
    def steady_answer(self) -> Floats | None:
        """Rates of stations by unit impulses on them, the same in all layers of one length.

        Shape (6 stations, 6 stations); None if it changes.
        """

    @property
    def freedoms(self) -> Floats:
        """Inverse moments of inertia of rigid bodies in space amid the layer, (stations, 3, 3)."""

    @property
    def compliance(self) -> Floats:
        """Rates in space by unit impulses in the layer, (stations, 6, stations, 6).

        Rigid bodies have none: (stations, 0).
        """

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
        """Spins by moments (several, count, turns) on nodes [1/s], (several, stations, turns)."""

    def spun(self, moments: Floats) -> Floats:
        """The same of nodes by moments on stations, (several, count, turns); 0 may be broadcast."""

    def whirl(self, moments: Floats) -> None:
        """Add the impulses of moments on nodes (count, turns), to be solved for."""

    def leave(self, wrenches: Floats) -> None:
        """Let the next layer start with rates that impulses (stations, 6) have changed."""

    def finish(self) -> None:
        """End the layer."""

    def settle(self) -> None:
        """Begin where the body has come to rest."""

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs besides the body."""

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""


class HeldRigid:
    """Rigid bodies that are stepped together: a station each.

    Attributes:
        part: The bodies.
        jumped: Never.
    """

    def __init__(self, part: "RigidBodies") -> None:
        """Hold them."""
        self.jumped, self.part, self._light = False, part, 1.0 / part.masses[:, None]
        self.steady_answer = None  # they turn
        self.compliance = self.compliance_ahead = np.zeros((len(self._light), 0))

    def set_out(self, start: float, end: float) -> None:
        """Take up a step."""
        self.part.set_out(start, end)

    @property
    def frames(self) -> tuple[Floats, Floats]:
        """Their centres and rotations."""
        return self.part.frame

    @property
    def rates(self) -> tuple[Floats, Floats]:
        """Of their centres."""
        return self.part.rates

    def impulses(self) -> tuple[Floats, Floats]:
        """On their centres."""
        return self.part.impulses()

    def take(self, motion: Motion) -> bool:
        """Take a solution."""
        return self.part.take(
            motion.speeds, motion.spins, motion.halves, motion.ends, motion.middles,
            motion.freedoms, motion.noise,
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
        speeds, spins = self.part.rates_ahead
        return np.hstack([speeds, applied(self.part.end, spins)])

    @property
    def freedoms(self) -> Floats:
        """Amid the layer."""
        return self.part.freedom

    def _moved(self, wrenches: Floats) -> Floats:
        turned = applied(self.part.freedom, wrenches[..., 3:])
        return np.concatenate([self._light * wrenches[..., :3], turned], axis=-1)

    def reached(self, forces: Floats) -> Floats:
        """By forces and moments about their centres."""
        return self._moved(self.part.wrenches(forces))

    def carried(self, wrenches: Floats) -> Floats:
        """With their centres and turns."""
        return self.part.carried(self._moved(wrenches))

    def strike(self, forces: Floats) -> None:
        """Add contact forces."""
        self.part.strike(forces)

    def whirled(self, moments: Floats) -> Floats:
        """About their centres."""
        return self._whirled(on_bodies(moments, self.part.apart, len(self._light)))

    def _whirled(self, moments: Floats) -> Floats:
        first = 3 - moments.shape[-1]
        return applied(self.part.freedom[:, first:, first:], moments)

    def spun(self, moments: Floats) -> Floats:
        """With their turns."""
        return self._whirled(moments)[:, self.part.apart]

    def whirl(self, moments: Floats) -> None:
        """Add moments."""
        self.part.whirl(on_bodies(moments[None], self.part.apart, len(self._light))[0])

    def leave(self, wrenches: Floats) -> None:
        """Change their rates at the end."""
        (speeds, spins), end = self.part.rates_ahead, self.part.end
        own = applied(end.swapaxes(1, 2), wrenches[:, 3:])
        turned = np.linalg.solve(self.part.inertias, own[..., None])[..., 0]
        self.part.leave(speeds + self._light * wrenches[:, :3], spins + turned)

    def finish(self) -> None:
        """Nothing: they know where they are."""

    settle = finish

    def memory(self) -> dict[str, Floats]:
        """Nothing."""
        return {}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Nothing."""
