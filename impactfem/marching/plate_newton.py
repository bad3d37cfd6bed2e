"""Plates in steps of any length that are solved by iterates: those that stretch, or beside others.

In a step from a to b, with d the difference, m the mean, K of bending, damping C
(`impactfem.system.plate_damping`) and forces f of the middle (`impactfem.system.membrane`),

    M 2 (d / dt - v_a) / dt + C d / dt + K q_m + f(w_a, w_b) = loads + contact forces at m,
    v_b = 2 d / dt - v_a,

where slopes and vertices that touch have no mass. f does exactly the work of the energy of the
middle, so that all of it is kept to rounding. What friction pulls in the plane is in equilibrium
with the mean of the tensions at both ends, so that its work is right too. Iterates take the factors
of the linear plate, which serve all steps of a length, and the whole tangent where these lead on
too slowly.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix, eye_array
from scipy.sparse.linalg import splu

from impactfem.arrays import Floats
from impactfem.marching.layers import Sums
from impactfem.marching.plate import PlateMidpoint
from impactfem.marching.plate_step import PlateStep
from impactfem.scene import PiecewiseVector
from impactfem.system.kirchhoff import DOFS
from impactfem.system.plate import PlateSystem
from impactfem.system.plate_damping import Answer
from impactfem.system.plate_faces import IN_PLANE
from impactfem.system.plate_rows import pinned

_ACCURACY = 1e-11  # of forces
_ROUNDING = 1e-15  # of the sums of a product with the stiffness
_SLOW = 0.1  # share of its fault that an iterate may leave before the whole tangent is taken
_KEPT = 4  # lengths of steps whose factors are kept


class _Inside(NamedTuple):
    """The middle of a plate that stretches.

    Attributes:
        slopes: Of its triangles, (cells, 2).
        strains: Of these, (cells, 3).
        u: What moves in the plane [m], (freedoms,).
    """

    slopes: Floats
    strains: Floats
    u: Floats


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
        self._kept: dict[float, tuple[PlateStep, dict[tuple[int, int], Floats]]] = {}
        self._steep = False  # whether the last step took the whole tangent
        self._way = np.zeros_like(self._q)
        # Displacements of places in the plane by u, and forces of friction on them [N].
        self._grip: csr_matrix | None = None
        if bodies.membrane is not None and self._faces.rubs:
            self._grip = bodies.membrane.at(self._faces.spots)
        self.pulls = np.zeros(0 if self._grip is None else self._grip.shape[0])
        self._inner = self._outer = self._begun_inside = self.inside(self._q, self.pulls)

    @property
    def missing(self) -> dict[str, float]:
        """Nothing: mass only moves along its normal."""
        return {}

    @property
    def strains(self) -> Floats:  # type: ignore[override]
        """See `PlateMidpoint`."""
        return self._inner.strains

    @property
    def in_plane(self) -> Floats | float:  # type: ignore[override]
        """See `PlateMidpoint`."""
        if self._grip is None or self.bodies.membrane is None:
            return 0.0
        u = self.bodies.membrane.at(csr_matrix(eye_array(len(self.bodies.node_mass))))
        return np.asarray((u @ self._inner.u).reshape(-1, 2) @ self.bodies.plate.frame[1][:2])

    @property
    def surface_displacement(self) -> Floats:
        """Of the contact nodes since t = 0 [m], (count, dim)."""
        return self._between(self._q - self._begun, self._begun_inside, self._inner)

    @property
    def surface_iterate(self) -> Floats:
        """The same at the end of the step, as the last iterate has it."""
        moved = self._q + self._way - self._begun
        return self._between(moved, self._begun_inside, self._outer)

    @property
    def surface_way(self) -> Floats:
        """How far the contact nodes move in the step [m], (count, dim)."""
        return self._between(self._way, self._inner, self._outer)

    def _between(self, change: Floats, before: "_Inside", after: "_Inside") -> Floats:
        """How contact nodes move between two states with a change of q [m], (count, 3)."""
        return self._faces.moved(self._with_plane(change, after.u - before.u))

    def _with_plane(self, change: Floats, u: Floats) -> Floats:
        """What `PlateFaces.moved` takes, by changes of q and of u."""
        told = self._faces.told(change)
        if self._grip is None:
            return told
        return np.concatenate([told, (self._grip @ u).reshape(-1, IN_PLANE).T])

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
        self._loads = self._pushed + weight * self._pull
        # Of places the last digits are lost by which speeds of short steps go.
        self._way = step * self._v
        if self._moves:
            self._led = self.bodies.leading(end)
            led = self.bodies.led
            self._way[led] = (self._led[0] - self._q)[led]
        self._pulled = self.pulls
        self._look_inside()
        self._left = np.inf
        self._whole: Answer | None = None
        self._late = self._steep
        self.generation += 1

    def _look_inside(self) -> None:
        """See how the iterate stretches the middle."""
        self._outer = self.inside(self._q + self._way, self._pulled)

    def inside(self, q: Floats, pulls: Floats) -> "_Inside":
        """The middle at a place, with forces on places in the plane (2 count,)."""
        membrane = self.bodies.membrane
        if membrane is None:
            return _Inside(np.zeros((0, 2)), np.zeros((0, 3)), np.zeros(0))
        slopes = membrane.slopes(self.bodies.deflection(q))
        return _Inside(slopes, *membrane.settled(slopes, self.on_u(pulls)))

    def on_u(self, pulls: Floats) -> Floats:
        """Forces on u by those on places in the plane."""
        if self._grip is not None:
            return np.asarray(self._grip.T @ pulls)
        membrane = self.bodies.membrane
        return np.zeros(0 if membrane is None else membrane.strains.shape[1])

    def unbalanced(self, forces: Floats) -> float:
        """Largest force that the iterate leaves, over what rounding and forces allow.

        Args:
            forces: On the contact nodes at the mean places [N], (count, dim).
        """
        step, mass, damping = self._span, self._mass, self.bodies.damping
        rate, share = self._way / step, 0.5 + damping.stiffness / step
        mean = self._q + share * self._way  # at which K acts
        inside = self.bodies.stiffness @ mean + damping.force(rate)
        if (membrane := self.bodies.membrane) is not None:
            first, last = self._inner, self._outer
            self._tension = 0.5 * membrane.tension(first.strains + last.strains)
            stretching = membrane.force(self._tension, 0.5 * (first.slopes + last.slopes))
            inside = inside + self._of_vertices @ stretching
        inert = mass * (2.0 / step * (rate - self._v) + damping.mass * rate)
        pushed, pulled = self.pulled(forces)
        self._rest = self._loads + pushed - inside - inert
        if self._moves:
            self._rest[self.bodies.led] = 0.0
            self._inside = inside + mass * damping.mass * rate
        self._slack = 2.0 * pulled - self.pulls - self._pulled
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
        grip = float(np.abs(pulled).max(initial=0.0) + np.abs(self.pulls).max(initial=0.0))
        slack = float(np.abs(self._slack).max(initial=0.0))
        found = max(found, slack / (_ACCURACY * grip + np.finfo(float).tiny))
        self._late = bool(self._late or found > _SLOW * self._left)
        self._left = found
        return found

    def pulled(self, forces: Floats) -> tuple[Floats, Floats]:
        """Forces on the contact nodes (count, dim) as those on q, and on places in the plane."""
        pressing = self._faces.pressing(forces)
        pulls = self.pulls if self._grip is None else pressing[DOFS:].T.ravel()
        return self._faces.pulled(pressing), pulls

    def linearise(self) -> Floats:
        """Solve for what balances the iterate; how contact nodes move by it."""
        if self._late and self.bodies.membrane is not None and self._whole is None:
            self._whole, self._steep = self._tangent(), True
            self.generation += 1
        self._change, u = self._solved(self._rest, self._slack)
        return self._faces.moved(self._with_plane(self._change, u))

    def _linear(self) -> tuple[PlateStep, dict[tuple[int, int], Floats]]:
        """The linear plate in steps of this length, and answers of contact nodes by it."""
        if self._span not in self._kept:
            if len(self._kept) == _KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[self._span] = PlateStep(self.bodies, self._span), {}
        return self._kept[self._span]

    def _tangent(self) -> Answer:
        """Of the iterate, with what moves in the plane behind q."""
        membrane = self.bodies.membrane
        assert membrane is not None  # noqa: S101  (`linearise` asks)
        mean = 0.5 * (self._inner.slopes + self._outer.slopes)
        last, vertices, own = self._outer.slopes, self._of_vertices, self._linear()[0].tangent
        matrix = membrane.tangent(vertices, own, self._tension, mean, last)
        more = matrix.shape[0] - len(self._q)
        factor = splu(pinned(matrix, np.pad(self.bodies.led, (0, more))).tocsc())
        return self.bodies.damping.beside(factor.solve, self._span, more)

    def _solved(self, right: Floats, pulls: Floats) -> tuple[Floats, Floats]:
        """Changes of q and u by forces on q, and on places in the plane at the end of the step."""
        membrane = self.bodies.membrane
        if membrane is None:
            linear = self._linear()[0]
            return linear.advance * linear.solve(right), pulls
        on_u = self.on_u(pulls)
        if self._whole is None:
            linear = self._linear()[0]
            u = membrane.answer(on_u) if on_u.any() else on_u
            return linear.advance * linear.solve(right), u
        found = self._whole(np.concatenate([right, on_u]))
        return found[: len(right)], found[len(right) :]

    def answers(self, forces: Floats) -> Floats:  # type: ignore[override]
        """How contact nodes answer to forces on them at the iterate, (several, count, dim)."""
        if self._whole is not None:
            return np.stack([self._faces.moved(self._answer(*self.pulled(f))) for f in forces])
        # Sums of answers to unit forces, one node after the other: what is known then does not tell
        # how they round, and a run can be continued.
        known = self._linear()[1]
        pressing = self._faces.pressing(forces)
        if self._grip is None:
            pressing = pressing[:, : len(self._faces.rows)]
        parts, places = np.nonzero(pressing.any(axis=0))
        for at in zip(parts.tolist(), places.tolist(), strict=True):
            if at not in known:
                unit = np.zeros(pressing.shape[1:])
                unit[at] = 1.0
                known[at] = self._answer(self._faces.pulled(unit), unit[DOFS:].T.ravel()).ravel()
        each = [known[at] for at in zip(parts.tolist(), places.tolist(), strict=True)]
        told = pressing[:, parts, places] @ np.reshape(each, (len(parts), -1))
        return np.stack([self._faces.moved(one.reshape(pressing.shape[1:])) for one in told])

    def _answer(self, pushed: Floats, pulls: Floats) -> Floats:
        """What `PlateFaces.moved` takes, by forces on q and on places in the plane in a step."""
        return self._with_plane(*self._solved(pushed, 2.0 * pulls))

    def correct(self, forces: Floats) -> None:
        """Move the iterate, with a change of the contact forces (count, dim)."""
        self._way = self._way + self._change
        self._pulled = self._pulled + self._slack
        if forces.any():
            pushed, pulls = self.pulled(forces)
            self._way = self._way + self._solved(pushed, 2.0 * pulls)[0]
            self._pulled = self._pulled + 2.0 * pulls
        self._look_inside()

    def accept(self) -> None:
        """End the step at the iterate."""
        self._work = self._work + float(self._pushed @ self._way)
        heavy, had = self._heavy, self._led_energy
        self._v[heavy] = 2.0 / self._span * self._way[heavy] - self._v[heavy]
        if self._moves:
            self._v[self.bodies.led] = self._led[1][self.bodies.led]
            self._work += self._led_work(self._way, self._inside, self._loads, had)
        self._q, self._inner, self.pulls = self._q + self._way, self._outer, self._pulled
        self._steep = self._whole is not None

    def displaced(self, place: Floats, pulls: Floats) -> Floats:
        """See `PlateMidpoint`."""
        return self._between(place - self._begun, self._begun_inside, self.inside(place, pulls))

    def moved(self, place: Floats, pulls: Floats, change: Floats, more: Floats) -> Floats:
        """See `PlateMidpoint`."""
        membrane, u = self.bodies.membrane, pulls
        if self._grip is not None and membrane is not None:
            slopes, ways = (membrane.slopes(self.bodies.deflection(q)) for q in (place, change))
            u = membrane.answer(self.on_u(more) - membrane.contracted(slopes, ways))
        return self._faces.moved(self._with_plane(change, u))

    def settle(self, place: Floats, pulls: Floats) -> Floats:
        """See `PlateMidpoint`."""
        found = super().settle(place, pulls)
        self._inner = self.inside(self._q, self.pulls)
        return found

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
        """What `PlateMidpoint` has, whether steps took the whole tangent, and `pulls`."""
        return super().memory() | {"steep": np.array(self._steep), "pulls": self.pulls.copy()}

    def remember(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory` gave."""
        super().remember(memory)
        self._steep, self.pulls = bool(memory["steep"]), memory["pulls"].copy()
        self._inner = self.inside(self._q, self.pulls)
