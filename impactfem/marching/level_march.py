"""The time loop of a body under finite strain in explicit steps, and its contact law.

A node that is found inside an obstacle at a level is held at that distance from the next level on,
until its force turns:

    0 <= Lambda  _|_  g - g_held >= 0.

While it is held its force does no work but that of moving obstacles; it penetrates by at most the
way of a step. At each level the contact nodes, which carry no mass, are brought to equilibrium by
Newton's method with an active set; see `impactfem.system.surface_layer`.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.complementarity import Solver
from impactfem.errors import ConvergenceError
from impactfem.findings import Finding
from impactfem.marching.finite_leapfrog import FiniteLeapfrog
from impactfem.marching.layers import ContactGaps
from impactfem.marching.newton_march import inertia_findings
from impactfem.marching.schemes import SolidScheme
from impactfem.marching.time_loop import ContactState, TimeLoop

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_USUAL = {2: 3, 3: 2}  # iterates of a level; in the plane they cost little
_MOST = 20
_SLOW = {2: 0.05, 3: 0.15}  # share of forces that an iterate leaves with a tangent that is good
_BEGINNING = 0.2  # of a node's first force; 1/6 by theory, gains nothing a little above it
_START = 1e-10  # of the forces that the first level leaves


class LevelMarch(TimeLoop[FiniteLeapfrog]):
    """A march of one body in explicit steps."""

    def __init__(
        self,
        comm: Any,
        interior: FiniteLeapfrog,
        scheme: SolidScheme,
        gaps: ContactGaps,
        solver: Solver,
        layers: int,
        tolerance: float,
        rest: tuple[Floats, Floats] | None = None,
    ) -> None:
        """Balance the initial state; see `TimeLoop`."""
        super().__init__(comm, interior, scheme, gaps, solver, layers, tolerance, rest)
        count = len(self.contact.gap)
        self._nodes = gaps.entries(np.arange(count))[1]
        self._force = self.contact.multiplier.copy()
        self._active = self._force > 0.0
        self._held = np.where(self._active, self.contact.gap, np.nan)
        self._fresh = np.zeros_like(self._active)
        self._stale = True
        if rest is not None:
            self._balance(first=True)
            self.rows.put(0, interior.finish(0, self.contact.static))

    def findings(self) -> tuple[Finding, ...]:
        """Masses that have too little inertia, and cells that shorten the steps."""
        found, most = inertia_findings(self.interior.missing), self.interior.most
        if most > 1:
            text = f"squeezed cells bear only shorter steps: layers were taken in {most} of them"
            found += (Finding("setting", "note", text, value=float(most), limit=1.0),)
        return found

    def _initial_contact(self, gap: Floats, normals: Floats) -> tuple[Floats, Floats]:  # noqa: ARG002
        """Bring the surface to equilibrium, untouched, before the first level is summed up."""
        interior = self.interior
        right = interior.unbalanced()
        none = np.zeros(len(right), dtype=bool)
        first = np.abs(right).max(initial=0.0)
        for _ in range(_MOST):
            if np.abs(right).max(initial=0.0) <= _START * first:
                break
            interior.renew()
            way = interior.relaxed(right, none, np.zeros_like(right))
            interior.move_surface(interior.surface_displacement - way)
            right = interior.unbalanced()
        return np.zeros(len(gap)), np.zeros_like(interior.surface_displacement)

    def memory(self) -> dict[str, Floats]:
        """See `TimeLoop.memory`."""
        flags = np.array([self._stale, *self._fresh], dtype=np.float64)
        return super().memory() | {"level.held": self._held, "level.flags": flags}

    def restore(
        self, state: dict[str, Any], memory: Mapping[str, Floats], asked: Integers, layer: int
    ) -> None:
        """See `TimeLoop.restore`."""
        super().restore(state, memory, asked, layer)
        self._held, self._force = memory["level.held"], self.contact.multiplier
        self._active, flags = self._force > 0.0, memory["level.flags"] > 0.0
        self._stale, self._fresh = bool(flags[0]), flags[1:]
        place = self.interior.surface_displacement
        _, self._normals = self._gaps.at(place, place, place, layer * self.interior.dt)

    def _advance(self) -> Floats:
        """One layer; returns its mean contact forces [N]."""
        layer, interior, gaps = self.layer, self.interior, self._gaps
        dt, pieces, wanting = interior.dt, interior.pieces(), interior.between
        impulse, work, iterations, time = np.zeros(len(self._force)), 0.0, 0, layer * dt
        for piece in range(1, pieces + 1):
            end = (layer + piece / pieces) * dt
            interior.predict(time, end)
            ends = [(self._force, self._normals)]
            iterations += self._settle(end)
            last = self._force
            self._balance()
            turning = self._turning(last)
            interior.close(-self._spread(turning))
            ends.append((self._force + turning, self._normals))
            for force, normals in ends:
                impulse += 0.5 * (end - time) * force
                moved = gaps.advance(normals, end) - gaps.advance(normals, time)
                work += 0.5 * float(force @ moved)
            self._catch()
            time = end
        self.layer, state = layer + 1, self.contact
        static = np.zeros_like(state.static)
        self.rows.put(self.layer, interior.finish(layer, static))
        if layer == 0:  # of linear steps this part stays
            self.rows.sums[0, 0, 1] += interior.between - wanting
        self.rows.obstacle_work[self.layer] = work
        self.contact = ContactState(self._force, self._gap, state.multiplier, state.gap, static)
        mean: Floats = impulse / dt
        self._close_row(self.layer, mean, iterations)
        return mean

    def _settle(self, time: float) -> int:
        """Bring the surface to equilibrium at a time; returns the iterates (collective).

        Raises:
            ConvergenceError: It was not found, or cells turn inside out.
        """
        interior, nodes, held = self.interior, self._nodes, self._held
        place = interior.surface_displacement.copy()
        may = ~np.isnan(held)
        active = may.copy()
        self._put(place, active, time)
        before, dim = np.inf, place.shape[1]
        for iterate in range(1, _MOST + 1):
            interior.move_surface(place)
            right = interior.unbalanced()
            push = np.einsum("ij,ij->i", self._normals, right[nodes])
            if iterate == 1:
                self._needed = push
            new = may & (self._gap <= held + self.tolerance) & (push > 0.0)
            same, active = bool((new == active).all()), new
            size = self._size(right, active, push)
            falls = size <= max(_SLOW[dim] * before, interior.rounding)
            if self._stale or (same and not falls):
                interior.renew()
                self._stale = False
            fixed, normals = np.zeros(len(place), dtype=bool), np.zeros_like(place)
            fixed[nodes[active]], normals[nodes[active]] = True, self._normals[active]
            place = place - interior.relaxed(right, fixed, normals)
            self._put(place, active, time)
            low = may & ~active & (self._gap < held)
            if low.any():
                active = active | low
                self._put(place, active, time)
            elif iterate >= _USUAL[dim] and same and falls:
                break
            before = size
        else:
            raise ConvergenceError(f"the surface found no equilibrium at t = {time:g} s")
        interior.move_surface(place)
        self._active = active
        return iterate

    def _size(self, right: Floats, active: Any, push: Floats) -> float:
        """What forces leave that no obstacle carries [N]."""
        left = right.copy()
        left[self._nodes[active]] -= push[active, None] * self._normals[active]
        return float(np.linalg.norm(left))

    def _put(self, place: Floats, active: Any, time: float) -> None:
        """Find gaps and normals, and put active nodes where they are held."""
        self._gap, self._normals = self._gaps.at(place, place, place, time)
        if active.any():
            off = self._held[active] - self._gap[active]
            place[self._nodes[active]] += off[:, None] * self._normals[active]
            self._gap = np.where(active, self._held, self._gap)

    def _balance(self, *, first: bool = False) -> None:
        """Find the forces of a level; what they leave goes inside (collective)."""
        right = self.interior.balance()
        push = np.einsum("ij,ij->i", self._normals, right[self._nodes])
        self._force = np.where(self._active, np.maximum(push, 0.0), 0.0)
        right[self._nodes] -= self._force[:, None] * self._normals
        self.interior.receive(right, first=first)

    def _turning(self, last: Floats) -> Floats:
        """What forces that begin or end in a step act more at its end [N], (gaps,).

        Those that end fall linearly from their last one to that which would hold the node still:
        they act until they are 0, not until the end. Those that begin grow for the first time by
        k v dt. Levels sample both so that the modified energy of the steps jumps by k v^2 dt^2 / 12
        (`impactfem.marching.finite_leapfrog`), which is a gain; what is added takes it off.
        """
        gone = ~self._active & (last > 0.0) & (self._needed < 0.0)
        share = self._needed / np.where(gone, self._needed - last, 1.0)
        fresh = self._fresh & (self._force > 0.0)
        return np.where(gone, -share * last, np.where(fresh, _BEGINNING * self._force, 0.0))

    def _spread(self, forces: Floats) -> Floats:
        """Forces on the contact nodes (count, dim) by those along normals (gaps,)."""
        found = np.zeros_like(self.interior.surface_displacement)
        found[self._nodes] = forces[:, None] * self._normals
        return found

    def _catch(self) -> None:
        """Let nodes go that nothing presses, and hold those that are inside an obstacle."""
        was = ~np.isnan(self._held)
        self._held[was & (self._force <= 0.0)] = np.nan
        caught = ~was & (self._gap < 0.0)
        self._fresh = caught
        self._held[caught] = self._gap[caught]
