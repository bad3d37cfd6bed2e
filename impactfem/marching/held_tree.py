"""Links of mechanisms as joints hold them: stations whose ways in a layer are not linear.

A link at place x with rotation R goes by dx = x_b - x_a and turns by Cayley's rotation of T,
exactly as the tree has it at both ends of a layer. Impulses w on it act on the rates by the
discrete Jacobian (O. Gonzalez 1996)

    D = J_m + (s / dt - J_m v) (M_a v)^T / (v . M_a v),    s = (dx, T),    v = (v_a + v_b) / 2,

of which D v = s / dt: what joints do, w . s, is what the mechanism gets, and both are to second
order in the step those of J_m. Of a free base M v is that of the joints alone, forces act at means
of both ends, and the base turns by Cayley's rotation too: all momenta stay, and a chain that turns
as one body needs no second term.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from impactfem.arrays import Floats
from impactfem.marching.held_rows import HeldByRows
from impactfem.marching.stations import Motion
from impactfem.system.stations import Stations
from impactfem.system.tree import cross

if TYPE_CHECKING:
    from impactfem.marching.mechanism import MechanismMidpoint


_SETTLED = 1e-13  # change of rates of stations by forces that are not linear
_ROUNDS = 16.0 * float(np.finfo(float).eps)  # of places, by which ways in a layer round


@dataclass(frozen=True)
class Chords:
    """Straight ways of frames of joints in a step, as the tree is now.

    Attributes:
        ends: Places [m], (frames, 3), and rotations (frames, 3, 3) at its end.
        rates: s / dt [m/s], [rad/s], (frames, 6).
        rounding: Of these, (frames, 6).
        rows: D, (6 frames, v).
    """

    ends: tuple[Floats, Floats]
    rates: Floats
    rounding: Floats
    rows: Floats

    @classmethod
    def of(
        cls, part: "MechanismMidpoint", joints: Sequence[int], begun: tuple[Floats, Floats]
    ) -> "Chords":
        """Of some joints, whose places and rotations at the start of the step are known."""
        tree, dt, count = part.bodies.tree, part.span, len(joints)
        first, before = begun
        turns, places = tree.poses(part.way(1.0), joints)
        halves = _cayley_vectors(before.swapaxes(1, 2) @ turns)
        steps = np.hstack([places - first, 2.0 * np.einsum("sij,sj->si", before, halves)])
        middle = part.way(0.5)
        rows = tree.jacobians(middle, joints)
        if tree.free:  # forces act at the means of both ends, as on what joints hold besides
            arms = 0.5 * (first + places) - middle[:3]
            rows[:, :3, 3:6] = cross(tree.base(middle).T[None], arms[:, None, :]).swapaxes(1, 2)
        size = max(np.abs(places).max(), np.abs(tree.centre(middle)).max())
        rounding = _ROUNDS / dt * np.tile(np.repeat([size, 1.0], 3), count)
        made = part.exact(rows.reshape(6 * count, -1), steps.ravel() / dt, rounding)
        return cls((places, turns), steps / dt, rounding.reshape(count, 6), made)


class HeldTree(HeldByRows["MechanismMidpoint"]):
    """Links of a mechanism: stations at the origins of their frames.

    Attributes:
        part: The mechanism.
    """

    def __init__(self, part: "MechanismMidpoint", stations: Stations) -> None:
        """Hold it."""
        links = part.bodies.tree.links()
        self._joints = [links[name.partition("/")[2]] for name in stations.names]
        self.by = self.part = part
        self._count = len(stations.names)
        self._wrench = np.zeros(6 * self._count)
        self._rows = self._jacobians(part.coordinates)
        self.compliance = stations.compliance

    def set_out(self, start: float, end: float) -> None:
        """Take up a step."""
        self.part.set_out(start, end)
        self._wrench = np.zeros(6 * self._count)
        self._places, self._turns = self.frames
        self._before = self._rates_at(self.part.coordinates, self.part.rates)
        self._renew()

    def _jacobians(self, q: Floats) -> Floats:
        """Velocities and spins in space by the rates, (6 stations, v)."""
        tree = self.part.bodies.tree
        return tree.jacobians(q, self._joints).reshape(6 * self._count, tree.rates)

    def _rates_at(self, q: Floats, rates: Floats) -> Floats:
        """Velocities and spins in space, (stations, 6)."""
        return np.asarray(self._jacobians(q) @ rates).reshape(-1, 6)

    def _poses(self, q: Floats) -> tuple[Floats, Floats]:
        turns, places = self.part.bodies.tree.poses(q, self._joints)
        return places, turns

    def _renew(self) -> None:
        """Ways in the layer, and how impulses act along them."""
        part = self.part
        chords = Chords.of(part, self._joints, (self._places, self._turns))
        self._ends, self._mean, self._rounding = chords.ends, chords.rates, chords.rounding
        self._rows = chords.rows
        answer = self._rows @ part.reach @ self._rows.T
        self.compliance = answer.reshape(self._count, 6, self._count, 6)

    @property
    def frames(self) -> tuple[Floats, Floats]:
        """Where the links are."""
        return self._poses(self.part.coordinates)

    def _split(self, rates: Floats, turns: Floats) -> tuple[Floats, Floats]:
        return rates[:, :3], np.einsum("sji,sj->si", turns, rates[:, 3:])

    @property
    def rates(self) -> tuple[Floats, Floats]:
        """Of the links."""
        part = self.part
        return self._split(self._rates_at(part.coordinates, part.rates), self.frames[1])

    def impulses(self) -> tuple[Floats, Floats]:
        """Changes of their rates without joints, as the layer is now."""
        flat = self.compliance.reshape(6 * self._count, -1)
        changed = 2.0 * (self._mean - self._before) - (flat @ self._wrench).reshape(-1, 6)
        return changed[:, :3], changed[:, 3:]

    def take(self, motion: Motion) -> bool:
        """Move the mechanism by the impulses of the joints."""
        self._wrench = motion.wrenches.ravel()
        self.part.impel(self._rows.T @ self._wrench, jumps=motion.jumps)
        self._renew()
        found = self._split(2.0 * self._mean - self._before, self._turns)
        thought = np.hstack([motion.speeds, motion.spins])
        off = np.abs(np.hstack(found) - thought)
        sizes = np.repeat([np.abs(each).max() for each in found], 3)
        return bool((off <= _SETTLED * sizes + 2.0 * self._rounding).all())

    @property
    def places_ahead(self) -> tuple[Floats, Floats]:
        """At the end of the layer."""
        return self._ends

    @property
    def rates_ahead(self) -> Floats:
        """In space."""
        return self._rates_at(self.part.way(1.0), self.part.rates_ahead)

    @property
    def compliance_ahead(self) -> Floats:
        """At the end of the layer."""
        rows = self._jacobians(self.part.way(1.0))
        answer = rows @ self.part.reach_ahead @ rows.T
        return np.asarray(answer).reshape(self._count, 6, self._count, 6)

    @property
    def jumped(self) -> bool:
        """Whether joints of the mechanism are at limits."""
        return self.part.stopped

    def leave(self, wrenches: Floats) -> None:
        """Change all rates at the end."""
        self.part.kick(self._jacobians(self.part.way(1.0)).T @ wrenches.ravel())

    def finish(self) -> None:
        """Nothing: the tree knows where links are."""

    def settle(self) -> None:
        """Nothing: it knows where it is."""

    def memory(self) -> dict[str, Floats]:
        """Nothing."""
        return {}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Nothing."""


def _cayley_vectors(turns: Floats) -> Floats:
    """Vectors tan(angle / 2) along the axes of rotations (..., 3, 3), (..., 3)."""
    off = turns - turns.swapaxes(-1, -2)
    twice = np.stack([off[..., 2, 1], off[..., 0, 2], off[..., 1, 0]], axis=-1)
    return np.asarray(twice / (1.0 + np.trace(turns, axis1=-2, axis2=-1))[..., None])
