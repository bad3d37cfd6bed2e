"""Adhesion of bodies that touch at single places: what holds them once they have touched.

The simplest law that has a pull-off force F [N] and an energy W [J] exactly: bodies that have
touched pull each other with the constant force F until they are W / F apart, and then no more (the
cohesive zone of D. S. Dugdale, J. Mech. Phys. Solids 8 (1960) 100-104, as one force). Beside the
law of contact F is a load along the gap,

    N = lambda - F,    0 <= lambda _|_ gap >= 0,

so that N reaches -F before the gap opens, and parting takes F (W / F) = W. Approaching bodies pull
nothing, so that W is lost with each contact from which they part.

The time step in which they part has the share of F that does what is left of W; that in which a
contact with a stiffness begins the share by which it is pressed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers

_NAMES = ("bound", "origin", "stored", "pull")


@dataclass
class Bonds:
    """What holds the bodies of gaps together.

    Attributes:
        force, energy: F [N] and W [J] of each gap, 0 without adhesion, (gaps,).
        bound: 1 of those that hold.
        origin: Gaps from which they are counted [m].
        stored: Work done against them since [J].
        pull: Forces of this layer [N].
    """

    force: Floats
    energy: Floats
    bound: Floats = field(init=False)
    origin: Floats = field(init=False)
    stored: Floats = field(init=False)
    pull: Floats = field(init=False)

    def __post_init__(self) -> None:
        """Begin apart."""
        self.bound, self.origin, self.stored, self.pull = np.zeros((4, len(self.force)))

    def some(self, rows: Integers) -> "Bonds":
        """Those of some gaps, apart."""
        return Bonds(self.force[rows], self.energy[rows])

    def touch(self, gaps: Booleans) -> None:
        """Bind those that touch at t = 0, (gaps,)."""
        self.bound = np.where(gaps & (self.force > 0.0), 1.0, 0.0)

    def begin(self, before: Floats, after: Floats, soft: Booleans) -> Floats:
        """Forces of a layer [N], (gaps,), if all that acts besides is known.

        Args:
            before: Gaps without springs at its start [m], (gaps,).
            after: At its end without these forces [m], (gaps,).
            soft: Which have springs, (gaps,).
        """
        enters = soft & (self.bound == 0.0) & (after < 0.0) & (self.force > 0.0)
        way = np.where(enters, after - np.maximum(before, 0.0), 1.0)
        self.pull = np.where(enters, self.force * after / way, self.force * self.bound)
        return self.pull

    def shorten(self, before: Floats, free: Floats, after: Floats) -> Floats:
        """What less acts in a layer in which they part [N], (gaps,).

        Args:
            before: Gaps without springs at its start [m], (gaps,).
            free: At its end without these forces [m], (gaps,).
            after: With them [m], (gaps,).
        """
        room = self._room
        parts = (self.bound > 0.0) & (after - self.origin > room)
        if not parts.any():
            return np.zeros_like(before)
        # p (g_free - a p - g_a) is what is left of the energy, 0 <= p <= F; a by both ends.
        whole = np.where(parts, self.pull, 1.0)
        yields, way = np.where(parts, (free - after) / whole, 0.0), free - before
        left = np.where(parts, self.force * (room - (before - self.origin)), 0.0)
        root = np.sqrt(np.maximum(way**2 - 4.0 * yields * left, 0.0))
        share = np.where(parts, 2.0 * left / np.where(parts, way + root, 1.0), self.pull)
        less = np.where(parts, self.pull - np.clip(share, 0.0, self.pull), 0.0)
        self.pull = self.pull - less
        return less

    def end(
        self, way: Floats, gap: Floats, pressed: Booleans, soft: Booleans
    ) -> tuple[float, float]:
        """End a layer; energy stored then, and lost in it [J].

        Args:
            way: By which gaps have opened along their normals [m], (gaps,).
            gap: Gaps without springs at its end [m], (gaps,).
            pressed: Which pressed in the layer, (gaps,).
            soft: Which have springs, (gaps,).
        """
        self.stored = self.stored + self.pull * way
        parted = (self.bound > 0.0) & (self.pull < self.force)
        touched = pressed & (self.force > 0.0) & (self.bound == 0.0)
        self.origin = np.where(touched, np.where(soft, 0.0, gap), self.origin)
        self.bound = np.where(touched, 1.0, np.where(parted, 0.0, self.bound))
        loose = self.bound == 0.0
        lost = float(self.stored[loose].sum())
        self.stored = np.where(loose, 0.0, self.stored)
        return float(self.stored.sum()), lost

    @property
    def _room(self) -> Floats:
        return self.energy / np.where(self.force > 0.0, self.force, np.inf)

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs."""
        return {f"bonds.{name}": getattr(self, name) for name in _NAMES}

    def restore(self, memory: Mapping[str, Floats]) -> None:
        """Go on as `memory` has it."""
        for name in _NAMES:
            setattr(self, name, memory[f"bonds.{name}"].copy())
