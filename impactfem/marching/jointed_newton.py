"""Bodies that joints hold, beside others under finite strain: steps solved by iterates.

Joints are solved in every iterate, with what contact pushes in it, so that the march asks for
contact forces only; answers to these are those of the bodies less what the joints take, as they are
in the iterate. Joints do no work but that of their springs, motors, dampers and friction, on ways
that are exact at both ends of a step: with what slides on rubber too, energy stays.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

import numpy as np

from impactfem.arrays import Floats
from impactfem.marching.joining import Joining
from impactfem.marching.layers import Sums
from impactfem.marching.newton_bodies import NewtonBodies, NewtonStepper
from impactfem.marching.stations import Held
from impactfem.system.joints import Joints

if TYPE_CHECKING:
    from impactfem.marching.iterated import Iterated


_ROUNDED = 4.0  # times by which rows of joints are met, for speeds


class JointedNewton(Joining[NewtonStepper], NewtonBodies):
    """Steppers of several bodies and their joints as one."""

    def __init__(
        self, parts: Sequence[NewtonStepper], joints: Joints, held: Sequence[Held]
    ) -> None:
        """Join steppers.

        Args:
            parts: The bodies.
            joints: What holds some of them.
            held: Those, in the order of `Joints.parts`.
        """
        super().__init__(parts)
        bodies = [getattr(part, "body", None) for part in parts]
        places = [bodies.index(body.part) for body in held]
        self._hold(joints, held, places, self.dt)
        self._steppers = [cast("Iterated", parts[place]) for place in places]
        self._driven = 0.0

    def _meeting_contact(self) -> Floats:
        """Joints as they are in the iterate: what changes in them the next one looks at."""
        return self._laws

    def begin(self, start: float, end: float) -> None:
        """Take up a step between two times."""
        self._acting = np.zeros_like(self._acting)
        self._set_out(start, end)
        self._rejoin()

    def _rejoin(self) -> None:
        """Solve the joints again, and see where what they hold is."""
        self._join()
        for part in self._steppers:
            part.look()

    def unbalanced(self, forces: Floats) -> float:
        """The worst of all bodies."""
        each = enumerate(self.parts)
        worst = [p.unbalanced(forces[self.own(k)]) for k, p in each if k not in self._places]
        known = [part.known() for part in self._steppers]
        for part, own in zip(self._steppers, self._owns, strict=True):
            part.lay(forces[own])
        self._wring()
        self._join()
        # Places round in rows of joints, and speeds of short steps the more.
        slack = _ROUNDED * self._rounding / self.span
        each_held = zip(self._steppers, known, strict=True)
        worst += [part.left(*was, slack) for part, was in each_held]
        return float(np.max(worst))

    def answers(self, forces: Floats) -> Floats:
        """How contact nodes answer to forces on them, (several, count, dim)."""
        found = super().answers(forces)
        self._held_back(found, forces)
        return found

    def correct(self, forces: Floats) -> None:
        """Move all iterates."""
        for k, part in enumerate(self.parts):
            if k not in self._places:
                part.correct(forces[self.own(k)])
        for body, own in zip(self._held, self._owns, strict=True):
            body.strike(forces[own])
        self._wring()
        self._rejoin()

    def _wring(self) -> None:
        """Add moments of contact on what joints hold."""
        for part, body in zip(self._steppers, self._held, strict=True):
            if (new := part.fresh_twists()) is not None:
                body.whirl(new)

    def accept(self) -> None:
        """End the step of all; where limits have turned rates, these keep to the joints."""
        self._keep_rates()
        self._struck = False
        super().accept()
        for body in self._held:
            body.finish()
        self._driven += self._ended()[1]

    def jolt(self, impulses: Floats) -> None:
        """Change all rates now; what the joints do not allow of that the next step takes off."""
        super().jolt(impulses)
        self._struck = True

    def finish(self, static: Floats) -> Sequence[Sums]:
        """End the layer of all bodies; sums of each."""
        found = super().finish(static)
        if self.counts:
            found[self._first].elastic += self._stored(self._terms)
            found[self._first].work += self._driven
        self._driven = 0.0
        return found
