"""Bodies that solve their own steps, beside solids in explicit steps.

What an explicit step conserves pairs the velocities amid its layers with forces F_m at the levels.
Other bodies take their own step of a layer's length from amid one layer to amid the next, with F_m,
and go on from there to the level at the rates they have:

    x_{m+1} = x_{m+1/2} + dt v_{m+1/2} / 2,    v_{m+1/2} = v_{m-1/2} + dt M^-1 (f + H^T F_m),

x_{m+1/2} and v_{m+1/2} the ends of the step. F_m then does the work F_m (x_{m+1} - x_{m-1}) / 2 on
them, as the law of contact has it, whose energies are those amid layers; of a body that turns that
is so to second order. Gaps see the levels, where the bodies are shown too. The first step is half
as long, and so is what contact pushes in it.
"""

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.contact.pair_responses import Roots
from impactfem.marching.composite import Composite
from impactfem.marching.layers import Interior, Sums

FIRST = 0.75
"""Way to the first level over that at the velocity in the first, half step, from none."""


class Staggered:
    """Such bodies as an interior of an explicit march; see `impactfem.marching.layers.Interior`.

    What is not said here is that of the bodies.

    Attributes:
        bodies: They, joined or not.
        dt: Time step [s].
        share: Part of the layer's contact force that acts.
        rolled: Ways that surfaces that roll have gone in the last layer besides the contact nodes
            [m], (count, dim).
    """

    def __init__(self, bodies: Composite) -> None:
        """Begin at t = 0."""
        self.bodies, self.dt, self.share = bodies, bodies.dt, 1.0
        self._reach = 2.0  # how far answers at levels go, over those at the ends of steps
        self._first = 1.0  # share of the velocity at the end of the step in the way to the level
        self._early = True  # answers are not those of all layers, or have just come to be
        self.rolled = np.zeros_like(bodies.surface_displacement)

    def __getattr__(self, name: str) -> Any:
        """What all bodies have."""
        return getattr(self.bodies, name)

    def as_interior(self) -> Interior:
        """It by its type."""
        return cast("Interior", self)

    def begin(self, start: float, end: float) -> None:
        """Solve the step that ends amid the layer, without contact forces."""
        first, half = start == 0.0, 0.5 * self.dt
        if not first:
            self._drift(-half)
        self.bodies.begin(0.0 if first else start - half, end - half)
        self.share, self._reach = (0.5, 6.0) if first else (1.0, 2.0)
        self._early = start < 1.5 * self.dt
        self._first = FIRST if first else 1.0

    @property
    def volatile(self) -> Booleans:
        """Those of the first layer, which is shorter, are asked again in the second."""
        found = self.bodies.volatile
        return np.ones_like(found) if self._early else found

    def _drift(self, span: float) -> None:
        for part in cast("tuple[Any, ...]", self.bodies.parts):
            part.drift(span)

    @property
    def surface_iterate(self) -> Floats:
        """Displacement of the contact nodes at the level that ends the layer [m], (count, dim)."""
        parts = cast("tuple[Any, ...]", self.bodies.parts)
        return np.concatenate([part.reaching(0.5 * self.dt) for part in parts])

    def touched(self, normals: Floats) -> Floats:
        """Learn where nodes touch; ways that their surface goes in the layer besides [m]."""
        self.bodies.touched(normals)
        before, after = self.bodies.contact_speeds(normals)
        parts = cast("tuple[Any, ...]", self.bodies.parts)
        begin, end = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("surface_velocity", "velocity_ahead")
        )
        return self._way(before - begin, after - end)

    def _way(self, before: Floats, after: Floats) -> Floats:
        """From level to level by velocities at both ends of the step."""
        return np.asarray(self.dt * ((1.0 - self._first) * before + self._first * after))

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Answers at the level to several forces (several, count, dim)."""
        moved, static = self.bodies.columns(forces)
        return self._reach * moved, static

    def answers(self, forces: Floats) -> tuple[Floats, Floats]:
        """The same, but not numbered."""
        moved, static = self.bodies.answers(forces)
        return self._reach * moved, static

    def roots(self) -> Roots | None:
        """Answers of the bodies that have some."""
        found = self.bodies.roots()
        return None if found is None else (found[0], np.sqrt(self._reach) * found[1])

    def twisted(self, moments: Floats) -> tuple[Floats, Floats]:
        """Displacements of all nodes, and turns of their bodies, by moments on nodes."""
        moved, turned = self.bodies.twisted(moments)
        return self._reach * moved, self._reach * turned

    def _beside(self) -> Floats:
        """Velocities of what touches besides those of the contact nodes [m/s], (count, dim)."""
        if not self.bodies.rolling:
            return 0.0 * self.rolled
        parts = cast("tuple[Any, ...]", self.bodies.parts)
        return np.concatenate([part.touching_velocity - part.surface_velocity for part in parts])

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs besides."""
        return self.bodies.memory() | {"rolled": self.rolled.copy()}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        self.bodies.remember(memory)
        self.rolled = memory["rolled"].copy()

    def finish(self, static: Floats) -> Sequence[Sums]:
        """End the step and go on to the level; sums amid the layer, but moments of the level."""
        half, begun = 0.5 * self.dt, self._beside()
        found = self.bodies.finish(static)
        self.rolled = self._way(begun, self._beside())
        self._drift(half)
        cast("Any", self.bodies).ahead = half
        for sums in found:
            sums.first_moment = sums.first_moment + half * sums.momentum
        return found
