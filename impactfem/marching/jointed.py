"""Several bodies in one layer, of which joints hold some together; see `joint_kernels`.

Contact, impacts and friction see bodies with their joints: answers to contact forces are those of
the bodies less what the joints take, and joints are solved again once contact has pushed.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.marching.composite import Composite
from impactfem.marching.joining import Joining
from impactfem.marching.layers import Interior, Sums
from impactfem.marching.stations import Held
from impactfem.system.joints import Joints

_WAYS = {"q": "v", "x": "vx", "y": "vy", "z": "vz"}
"""Coordinates of joints and free bases, with their rates."""


class Jointed(Joining[Interior], Composite):
    """The interiors of several bodies and their joints as one.

    Attributes:
        ahead: Time from where steps end to where coordinates of joints are told [s].
    """

    apart = None
    ahead = 0.0

    def __init__(
        self,
        parts: Sequence[Interior],
        free: Sequence[Floats] | None,
        joints: Joints,
        held: Sequence[Held],
    ) -> None:
        """Join interiors.

        Args:
            parts: The bodies.
            free: See `Composite`.
            joints: What holds some of them.
            held: Those, in the order of `Joints.parts`.
        """
        super().__init__(parts, free)
        self._hold(joints, held, [self.parts.index(body.part) for body in held], self.dt)

    @property
    def volatile(self) -> NDArray[np.bool_]:
        """Joints change answers of what they hold in every layer, if they turn or change."""
        found = super().volatile.copy()
        if self._same:
            return found
        for own in self._owns:
            found[own] = True
        return found

    def begin(self, start: float, end: float) -> None:
        """Move all bodies to the end of a step without contact."""
        self._struck = False
        self._set_out(start, end)
        self._join()
        for body in self._held:
            body.part.look()

    def roots(self) -> None:
        """None: joints take part."""

    def _each(self, forces: Floats, *, keep: bool) -> tuple[Floats, Floats]:
        """Answers of the contact nodes to several forces (several, count, dim)."""
        layer, static = super()._each(forces, keep=keep)
        self._held_back(layer, forces)
        return layer, static

    def twist(self, moments: Floats) -> None:
        """Add the layer's moments on nodes (count, turns) to their bodies."""
        others = moments.copy()
        for body, own in zip(self._held, self._owns, strict=True):
            others[own] = 0.0
            body.whirl(moments[own])
        super().twist(others)
        self._struck = True
        self._join()

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:
        """Add the effect of the layer's contact forces (count, dim) to the bodies they act on."""
        others = forces.copy()
        for body, own in zip(self._held, self._owns, strict=True):
            others[own] = 0.0
            if forces[own].any():
                body.strike(forces[own])
                self._struck = True
        super().push(others, change, parts)
        if self._struck:
            self._join()

    def told(self) -> dict[str, dict[str, float]]:
        """Columns of the joints."""
        found = super().told()
        if self.ahead:
            for columns in found.values():
                for place, rate in _WAYS.items():
                    if place in columns:
                        columns[place] += self.ahead * columns[rate]
        return found

    def finish(self, static: Floats) -> Sequence[Sums]:
        """End the layer of all bodies; sums of each."""
        self._keep_rates()
        found = super().finish(static)
        for body in self._held:
            body.finish()
        stored, driven = self._ended()
        if self.counts and (stored or driven):
            found[self._first].elastic += stored
            found[self._first].work += driven
        return found
