"""Plates in steps of any length that are solved by iterates: those that stretch, or beside others.

In a step from a to b, with d the difference, m the mean, K of bending, damping C
(`impactfem.system.plate_damping`) and forces f of the middle (`impactfem.system.membrane`),

    M 2 (d / dt - v_a) / dt + C d / dt + K q_m + f(w_a, w_b) = loads + contact forces at m,
    v_b = 2 d / dt - v_a,

where slopes and vertices that touch have no mass. f does exactly the work of the energy of the
middle, so that all of it is kept to rounding. Iterates take the factors of the linear plate, which
serve all steps of a length, and the whole tangent where these lead on too slowly.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse.linalg import splu

from impactfem.arrays import Floats
from impactfem.marching.layers import Sums
from impactfem.marching.plate import PlateMidpoint
from impactfem.marching.plate_step import PlateStep
from impactfem.scene import PiecewiseVector
from impactfem.system.plate import PlateSystem
from impactfem.system.plate_damping import Answer

_ACCURACY = 1e-11  # of forces
_ROUNDING = 1e-15  # of the sums of a product with the stiffness
_SLOW = 0.1  # share of its fault that an iterate may leave before the whole tangent is taken
_KEPT = 4  # lengths of steps whose factors are kept


class PlateNewton(PlateMidpoint):
    """Stepper of a plate; see `impactfem.marching.newton_bodies.NewtonStepper`."""

    generation = 0
    _work = 0.0

    def __init__(
        self, bodies: PlateSystem, gravity: PiecewiseVector, dt: float, *, counts: bool
    ) -> None:
        """Begin at t = 0; see `PlateMidpoint`."""
        super().__init__(bodies, gravity, dt, counts=counts)
        self._sizes = abs(bodies.stiffness)
        self._kept: dict[float, tuple[PlateStep, dict[int, Floats]]] = {}
        self._steep = False  # whether the last step took the whole tangent
        self._way = np.zeros_like(self._q)

    @property
    def missing(self) -> dict[str, float]:
        """Nothing: mass only moves along its normal."""
        return {}

    @property
    def surface_displacement(self) -> Floats:
        """Of the contact nodes since t = 0 [m], (count, dim)."""
        return self.displaced(self._q)

    @property
    def surface_iterate(self) -> Floats:
        """The same at the end of the step, as the last iterate has it."""
        return self.displaced(self._q + self._way)

    @property
    def surface_way(self) -> Floats:
        """How far the contact nodes move in the step [m], (count, dim)."""
        return self._of_touching(self._way)

    def touch(self, normals: Floats) -> None:
        """Nothing: nodes touch themselves."""

    def predicted(self, start: float, end: float) -> Floats:
        """Where contact nodes go if nothing changes [m], (count, dim)."""
        return self.surface_displacement + (end - start) * self.surface_velocity

    def arms(self, middle: Floats) -> Floats:
        """Where contact nodes are."""
        return middle

    def begin(self, start: float, end: float) -> None:
        """Take up a step between two times."""
        self._span = step = end - start
        weight = float(np.asarray(self._gravity.mean(start, end)) @ self._normal)
        self._pushed = self._pressed(start, end)
        self._loads = self._pushed + weight * self._mass
        # Of places the last digits are lost by which speeds of short steps go.
        self._way = step * self._v
        self._inner = self._stretched(self._q)
        self._left = np.inf
        self._whole: Answer | None = None
        self._late = self._steep
        self.generation += 1

    def _stretched(self, q: Floats) -> tuple[Floats, Floats]:
        """Slopes and strains of triangles at a place, none of a plate that does not stretch."""
        membrane = self.bodies.membrane
        if membrane is None:
            return np.zeros((0, 2)), np.zeros((0, 3))
        slopes = membrane.slopes(self.bodies.deflection(q))
        return slopes, membrane.stretched(slopes)

    def unbalanced(self, forces: Floats) -> float:
        """Largest force that the iterate leaves, over what rounding and forces allow.

        Args:
            forces: On the contact nodes at the mean places [N], (count, dim).
        """
        step, mass, damping = self._span, self._mass, self.bodies.damping
        rate, share = self._way / step, 0.5 + damping.stiffness / step
        mean = self._q + share * self._way  # at which K acts
        inside = self.bodies.stiffness @ mean + damping.force(rate)
        self._outer = self._stretched(self._q + self._way)
        if (membrane := self.bodies.membrane) is not None:
            (first, before), (last, after) = self._inner, self._outer
            self._tension = 0.5 * membrane.tension(before + after)
            stretching = membrane.force(self._tension, 0.5 * (first + last))
            inside = inside + self._of_vertices @ stretching
        inert = mass * (2.0 / step * (rate - self._v) + damping.mass * rate)
        pushed = self.pulled(forces)
        self._rest = self._loads + pushed - inside - inert
        sizes = self._sizes @ (np.abs(self._q) + share * np.abs(self._way))
        allowed = np.maximum(np.abs(inside), np.abs(self._loads))
        found = max(
            float(np.abs(self._rest[rows]).max(initial=0.0))
            / (
                _ACCURACY * float(allowed[rows].max(initial=0.0))
                + _ROUNDING * float(sizes[rows].max(initial=0.0))
                + np.finfo(float).tiny
            )
            for rows in (self._deflected, self._slopes)
        )
        self._late = bool(self._late or found > _SLOW * self._left)
        self._left = found
        return found

    def linearise(self) -> Floats:
        """Solve for what balances the iterate; how contact nodes move by it."""
        if self._late and self.bodies.membrane is not None and self._whole is None:
            self._whole, self._steep = self._tangent(), True
            self.generation += 1
        self._change = self._solved(self._rest)
        return self._of_touching(self._change)

    def _linear(self) -> tuple[PlateStep, dict[int, Floats]]:
        """The linear plate in steps of this length, and answers of contact nodes by it."""
        if self._span not in self._kept:
            if len(self._kept) == _KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[self._span] = PlateStep(self.bodies, self._span), {}
        return self._kept[self._span]

    def _tangent(self) -> Answer:
        """Of the iterate, with what moves in the plane."""
        membrane = self.bodies.membrane
        assert membrane is not None  # noqa: S101  (`linearise` asks)
        mean = 0.5 * (self._inner[0] + self._outer[0])
        last, vertices, own = self._outer[0], self._of_vertices, self._linear()[0].tangent
        factor = splu(membrane.tangent(vertices, own, self._tension, mean, last))

        def answer(right: Floats) -> Floats:
            more = np.zeros((factor.shape[0] - len(right), *right.shape[1:]))
            return np.asarray(factor.solve(np.concatenate([right, more]))[: len(right)])

        return self.bodies.damping.beside(answer, self._span)

    def _solved(self, right: Floats) -> Floats:
        if self._whole is None:
            linear = self._linear()[0]
            return linear.advance * linear.solve(right)
        return self._whole(right)

    def answers(self, forces: Floats) -> Floats:  # type: ignore[override]
        """How contact nodes answer to forces on them at the iterate, (several, count, dim)."""
        if self._whole is not None:
            each = [self._of_touching(self._solved(self.pulled(force))) for force in forces]
            return np.stack(each)
        # Sums of answers to unit forces, one node after the other: what is known then does not tell
        # how they round, and a run can be continued.
        linear, known = self._linear()
        along = forces @ self._normal
        nodes = np.flatnonzero(along.any(axis=0))
        for node in nodes.tolist():
            if node not in known:
                unit = np.asarray(self._reading[:, [node]].todense()).ravel()
                known[node] = self.bodies.reading @ (linear.advance * linear.solve(unit))
        moved = along[:, nodes] @ np.stack([known[node] for node in nodes.tolist()])
        return np.asarray(moved[:, :, None] * self._normal)

    def _of_touching(self, change: Floats) -> Floats:
        """Ways of the contact nodes [m], (count, dim)."""
        return np.asarray(np.outer(self.bodies.reading @ change, self._normal))

    def correct(self, forces: Floats) -> None:
        """Move the iterate, with a change of the contact forces (count, dim)."""
        more = self._solved(self.pulled(forces)) if forces.any() else 0.0
        self._way = self._way + self._change + more

    def accept(self) -> None:
        """End the step at the iterate."""
        self._work = self._work + float(self._pushed @ self._way)
        heavy = self._heavy
        self._v[heavy] = 2.0 / self._span * self._way[heavy] - self._v[heavy]
        self._q = self._q + self._way
        self._steep = self._whole is not None

    def finish(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface has it)
        """End the layer and sum up."""
        work, self._work = self._work, 0.0
        self._look()
        return self._summed(work)

    def initial(self, static: Floats) -> list[Sums]:  # noqa: ARG002  (as the interface)
        """Sums of the initial state."""
        self._look()
        return self._summed(0.0)

    def memory(self) -> dict[str, Floats]:
        """What `PlateMidpoint` has, and whether steps took the whole tangent."""
        return super().memory() | {"steep": np.array(self._steep)}

    def remember(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory` gave."""
        super().remember(memory)
        self._steep = bool(memory["steep"])
