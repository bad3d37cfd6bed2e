"""Bodies that solve their own steps, beside others whose steps are solved by Newton's iterates.

Points, beams, rigid bodies and mechanisms have few coordinates: for given contact forces they solve
a step themselves, as they do where all bodies are linear but for contact. An iterate is balanced
where laying its forces anew changes their rates no more.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, cast

import numpy as np

from impactfem.arrays import Floats
from impactfem.marching.layers import Interior, Rolling, Sums
from impactfem.marching.meshless import Meshless

SHARE = 1e-3
"""Of rates that sets their scale where nothing changes."""

_ACCURACY = 1e-13  # of rates
_NONE = np.zeros(0)


def by_energy(mass: Floats, change: Floats, causes: Sequence[Floats]) -> tuple[float, float]:
    """Size of a change of rates, and of the largest of what causes it, as the energy has them.

    Args:
        mass: Of the coordinates, (d, d).
        change: Rates, (d,).
        causes: Rates, (d,) each.
    """
    whole = float(np.trace(mass))
    size, *sizes = (float(np.sqrt(rates @ mass @ rates / whole)) for rates in (change, *causes))
    return size, max(sizes)


class Resolving(Interior, Protocol):
    """A body that solves its own step for given contact forces.

    Attributes:
        counts: Whether this rank sums it up.
    """

    counts: bool

    @property
    def touching_velocity(self) -> Floats:
        """Of what touches, at the start of the step [m/s], (count, dim)."""

    @property
    def surface_way(self) -> Floats:
        """How far what touches moves in the step, as it is solved now [m], (count, dim)."""

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim)."""

    def touch(self, normals: Floats) -> None:
        """Learn where bodies that roll touch, by the normals of their nodes (count, dim)."""

    def look(self) -> None:
        """See where contact nodes are as the step is solved now, and how forces act on them."""

    def known(self) -> Any:
        """Rates at the end of the step as it is solved now, to compare others with."""

    def changed(self, ahead: Any) -> tuple[float, float, float]:
        """By how much rates have changed since, what changes them in the step, and rounding."""

    def lay(self, forces: Floats) -> None:
        """Put the contact forces of the step (count, dim), to be solved for."""

    def settle(self) -> None:
        """Solve for the rates at the end of the step, with what has pushed so far."""

    def advance(self) -> Any:
        """End the step at what was found; the work of loads [J]."""

    def jolt(self, impulses: Floats) -> None:
        """Change the rates now by impulses on what touches [N s], (count, dim)."""

    def summed(self, work: Any) -> list[Sums]:
        """Sums now, with the work of loads since the last ones [J]."""


class Iterated(Meshless):
    """One of them as a stepper; see `impactfem.marching.newton_bodies.NewtonStepper`.

    Attributes:
        body: It.
        generation: Of its answers to forces, which change with each iterate.
        missing: Nothing of its moments of inertia: its mass is all there.
    """

    def __init__(self, body: Resolving) -> None:
        """Begin at t = 0."""
        self.body, self.dt, self.counts, self.massive = body, body.dt, body.counts, body.massive
        self.generation, self.missing = 0, dict[str, float]()
        self._work: Any = 0.0
        self._twists: Floats | None = None  # moments on nodes in the step
        self._laid: Floats | float = 0.0  # of these what acts already

    @property
    def rolling(self) -> bool:
        """Whether it touches at places that change."""
        return self.body.rolling

    def turning(self) -> tuple[Floats, Floats]:
        """Spins of nodes at both ends of the step, as it is solved now [rad/s]."""
        return cast("Rolling", self.body).turning()

    def twisted(self, moments: Floats) -> tuple[Floats, Floats]:
        """What several moments on nodes do; see `Rolling`."""
        return cast("Rolling", self.body).twisted(moments)

    def twist(self, moments: Floats) -> None:
        """Moments on nodes (count, turns) of the step, with the forces that come next."""
        self._twists = moments

    def fresh_twists(self) -> Floats | None:
        """Moments on nodes (count, turns) that are to be added; None: none."""
        if self._twists is None:
            return None
        new, self._laid = self._twists - self._laid, self._twists
        return new

    @property
    def surface_displacement(self) -> Floats:
        """Of the contact nodes [m], (count, dim)."""
        return self.body.surface_displacement

    @property
    def surface_iterate(self) -> Floats:
        """The same at the end of the step, by the last iterate."""
        return self.body.surface_iterate

    @property
    def surface_velocity(self) -> Floats:
        """Of what touches, at the start of the step [m/s], (count, dim)."""
        return self.body.touching_velocity

    @property
    def surface_way(self) -> Floats:
        """How far what touches moves in the step, by the last iterate [m], (count, dim)."""
        return self.body.surface_way

    def touch(self, normals: Floats) -> None:
        """Learn where bodies that roll touch, by the normals of their nodes (count, dim)."""
        self.body.touch(normals)

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim)."""
        return self.body.predicted(start, end)

    def arms(self, middle: Floats) -> Floats:
        """Where contact nodes are."""
        return middle

    def gravity(self, start: float, end: float) -> Floats:
        """Gravity that a layer between two times uses [m/s^2], shape (dim,)."""
        return self.body.gravity(start, end)

    def inertia(self) -> Sequence[Floats]:
        """Of each body [kg m^2]."""
        return self.body.inertia()

    def spins(self) -> Floats:
        """Velocities of the contact nodes by unit spins of their bodies [m]."""
        return self.body.spins()

    def initial(self, static: Floats) -> Sequence[Sums]:
        """Sums of the initial state."""
        return self.body.initial(static)

    def begin(self, start: float, end: float) -> None:
        """Take up a step between two times."""
        self.body.begin(start, end)
        self._twists, self._laid = None, 0.0
        self.generation += 1

    def look(self) -> None:
        """See where nodes are by the iterate, and how they answer."""
        self.body.look()
        self.generation += 1

    def unbalanced(self, forces: Floats) -> float:
        """Largest change of rates that the iterate leaves, over what rounding allows."""
        known = self.known()
        self.lay(forces)
        self._wring()
        self.body.settle()
        return self.left(*known)

    def lay(self, forces: Floats) -> None:
        """Put the contact forces of the step (count, dim), and no moments, to be solved for."""
        self.body.lay(forces)
        self._laid = 0.0

    def _wring(self) -> None:
        if (new := self.fresh_twists()) is not None:
            cast("Rolling", self.body).twist(new)

    def known(self) -> tuple[Any, Floats]:
        """Rates at the end of the step, and ways, by the last iterate."""
        return self.body.known(), self.body.surface_way

    def left(self, ahead: Any, way: Floats, slack: float = 0.0) -> float:
        """Largest change of rates since they were as given, over what rounding allows.

        Args:
            ahead: Those rates.
            way: The ways with them [m], (count, dim).
            slack: Speeds by which joints round [m/s].
        """
        self._change = self.body.surface_way - way
        left, scale, rounding = self.body.changed(ahead)
        return left / (_ACCURACY * scale + rounding + slack + float(np.finfo(float).tiny))

    def linearise(self) -> Floats:
        """How contact nodes move by what balances the iterate."""
        return self._change

    def answers(self, forces: Floats) -> Floats:
        """How contact nodes answer to forces on them at the iterate, (several, count, dim)."""
        return self.body.columns(forces)[0]

    def correct(self, forces: Floats) -> None:
        """Move the iterate, with a change of the contact forces (count, dim)."""
        self.body.push(forces, None, _NONE)
        self._wring()
        self.look()

    def accept(self) -> None:
        """End the step at the iterate."""
        self._work = self._work + self.body.advance()

    def jolt(self, impulses: Floats) -> None:
        """Change its rates now by impulses on what touches [N s], (count, dim)."""
        self.body.jolt(impulses)

    def finish(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """End the layer and sum up."""
        work, self._work = self._work, 0.0
        return self.body.summed(work)

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs."""
        return self.body.memory()

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        self.body.remember(memory)
