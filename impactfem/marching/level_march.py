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

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.gaps_beside import GapsBeside
from impactfem.errors import ConvergenceError
from impactfem.findings import Finding
from impactfem.marching.between_levels import BetweenLevels
from impactfem.marching.leapfrog_bodies import LevelStepper
from impactfem.marching.level_forces import LevelForces
from impactfem.marching.newton_steps import LayerSums
from impactfem.marching.rubbing import turned
from impactfem.marching.time_loop import ContactState, LoopSettings, TimeLoop

USUAL = {2: 3, 3: 2}  # iterates of a level; in the plane they cost little
MOST = 20
SLOW = {2: 0.05, 3: 0.15}  # share of forces that an iterate leaves with a tangent that is good
_BEGINNING = 0.2  # of a first force; 1/6 by theory, gains little a little above it
_START = 1e-10  # of the forces that the first level leaves


class LevelMarch(TimeLoop[LevelStepper]):
    """A march of one body in explicit steps."""

    def __init__(
        self, interior: LevelStepper, settings: LoopSettings, beside: BetweenLevels | None = None
    ) -> None:
        """Balance the initial state; see `TimeLoop`.

        Args:
            interior: What the scheme does inside the bodies.
            settings: All else; with bodies beside solids their gaps are `GapsBeside`.
            beside: Those bodies; None without any.
        """
        self._beside = beside
        gaps = settings.gaps
        self._solids = gaps.first if isinstance(gaps, GapsBeside) else gaps
        super().__init__(interior, settings)
        gaps = self._solids
        own = slice(len(gaps.pair_of()))
        self._nodes = gaps.entries(np.arange(own.stop))[1]
        self._force, gap = self.contact.multiplier[own].copy(), self.contact.gap[own]
        self._active = self._force > 0.0
        self._held = np.where(self._active, gap, np.nan)
        self._fresh, self._stuck = np.zeros_like(self._active), self._active.copy()
        self._stale, self._released = True, False
        directions = self._directed(self._normals[own])
        force = np.zeros(directions.shape[:2])
        if settings.rest is not None:
            force = turned(directions, settings.rest[2][own])
        force[:, 0] = self._force
        self._acting = LevelForces.of(gaps, directions, force)
        interior.touch(gaps.spread(directions[:, 0]))
        if settings.rest is not None:
            self._balance(first=True)
            self.rows.put(0, interior.finish(self.contact.static))

    def findings(self) -> tuple[Finding, ...]:
        """Cells that shorten the steps, and what is to say of bodies beside."""
        most, found = self.interior.most, tuple[Finding, ...]()
        if self._beside is not None:
            found = self._beside.march.findings()
        if most <= 1:
            return found
        text = f"squeezed cells bear only shorter steps: time steps were divided into {most}"
        return (*found, Finding("setting", "note", text, value=float(most), limit=1.0))

    def figures(self) -> Mapping[str, Any]:
        """Those of bodies beside."""
        return {} if self._beside is None else self._beside.march.figures()

    def _initial_contact(self, gap: Floats, normals: Floats) -> tuple[Floats, Floats]:  # noqa: ARG002
        """Bring the surface to equilibrium, untouched, before the first level is summed up."""
        interior = self.interior
        right = interior.unbalanced()
        none = np.zeros(len(right), dtype=bool)
        first = np.abs(right).max(initial=0.0)
        for _ in range(MOST):
            if np.abs(right).max(initial=0.0) <= _START * first:
                break
            interior.renew()
            way = interior.relaxed(right, none, np.zeros_like(right))
            interior.move_surface(interior.surface_displacement - way)
            right = interior.unbalanced()
        return np.zeros(len(gap)), np.zeros_like(interior.surface_displacement)

    def memory(self) -> dict[str, Floats]:
        """See `TimeLoop.memory`."""
        flags = np.array([self._stale, *self._fresh, *self._stuck], dtype=np.float64)
        own = {"level.held": self._held, "level.flags": flags}
        acting = {f"level.{name}": values for name, values in vars(self._acting).items()}
        return super().memory() | own | acting

    def restore(
        self, state: dict[str, Any], memory: Mapping[str, Floats], asked: Integers, layer: int
    ) -> None:
        """See `TimeLoop.restore`."""
        super().restore(state, memory, asked, layer)
        self._held = memory["level.held"]
        self._force = self.contact.multiplier[: len(self._held)]
        self._active, flags = self._force > 0.0, memory["level.flags"] > 0.0
        self._stale, (self._fresh, self._stuck) = bool(flags[0]), flags[1:].reshape(2, -1)
        names = ("directions", "force", "rubbing")
        self._acting = LevelForces(*(memory[f"level.{name}"] for name in names))
        self._normals = self._acting.directions[:, 0]

    def release(self, loose: Booleans) -> None:
        """Go on with the forces of the level as it is without supports; see `TimeLoop`."""
        super().release(loose)
        interior, rows, time = self.interior, self.rows, self.layer * self.interior.dt
        before, begin = interior.unbalanced(), interior.surface_displacement
        self._stale = self._released = True
        self._settle(begin, time, time)
        after, way = interior.unbalanced(), interior.surface_displacement - begin
        self._balance(first=True)
        # Other forces make other terms of the step in the energy of the same motion. What nodes
        # without mass give off as they are let go is lost.
        told = rows.sums[self.layer, :, 1].sum() - sum(
            each.elastic for each in interior.finish(self.contact.static)
        )
        lost = 0.5 * float(((before + after) * way).sum()) * (self._comm.rank == 0)
        rows.early[self.layer + 1] = told + lost

    def _directed(self, normals: Floats) -> Floats:
        """Directions of forces in the gaps, (gaps, ways, dim)."""
        return normals[:, None]

    def _advance(self) -> Floats:
        """One layer; returns its mean contact forces [N]."""
        layer, interior, gaps, state = self.layer, self.interior, self._solids, self.contact
        dt, pieces, wanting = interior.dt, interior.pieces(), interior.between
        done = LayerSums(len(self._force), state.static.shape[1])
        time = layer * dt
        for piece in range(1, pieces + 1):
            end = (layer + piece / pieces) * dt
            begin, last = interior.surface_displacement, self._acting
            interior.begin(time, end)
            done.iterations += self._settle(begin, time, end)
            self._balance()
            shift = gaps.shift(end) - gaps.shift(time)
            extra = self._turning(last)
            interior.close(-gaps.spread(extra.vectors))
            moved = interior.surface_displacement - begin + interior.rolled
            way = gaps.relative(moved) - shift
            for acting in (last, self._acting, extra):
                acting.act(done, moved, shift, end - time)
            self._acting.slid(done, way, (self._force > 0.0) | (last.force[:, 0] > 0.0))
            self._catch()
            time = end
        self.layer = layer + 1
        static = np.zeros_like(state.static)
        self.rows.put(self.layer, interior.finish(static))
        begun = interior.between - wanting  # of linear steps this part stays
        if self._released:
            self.rows.early[self.layer] -= begun.sum()
        elif layer == 0:
            self.rows.sums[0, :, 1] += begun
        self._released = False
        force, gap = self._force, self._gap
        if (beside := self._beside) is not None:
            also, normals = beside.march.contact, self._acting.directions[:, 0]
            self._normals = np.concatenate([normals, beside.march.normals])
            force, gap = np.append(force, also.multiplier), np.append(gap, also.gap)
            done = done.beside(beside.taken())
        self.contact = ContactState(force, gap, state.multiplier, state.gap, static)
        self._close_layer(done)
        mean: Floats = done.impulse / dt
        self._close_row(self.layer, mean, done.iterations)
        return mean

    def _settle(self, begin: Floats, start: float, time: float) -> int:  # noqa: ARG002
        """Bring the surface to equilibrium at a time; returns the iterates (collective).

        Args:
            begin: Displacement of the contact nodes at the last level [m], (nodes, dim).
            start: Time of that level [s].
            time: [s].

        Raises:
            ConvergenceError: It was not found, or cells turn inside out.
        """
        interior, nodes, held = self.interior, self._nodes, self._held
        place = interior.surface_displacement.copy()
        may = ~np.isnan(held)
        active = may.copy()
        self._put(place, active, time)
        before, dim = np.inf, place.shape[1]
        slow = SLOW[dim] + interior.lag
        for iterate in range(1, MOST + 1):
            interior.move_surface(place)
            right = interior.unbalanced()
            push = np.einsum("ij,ij->i", self._normals, right[nodes])
            if iterate == 1:
                self._needed = push
            new = may & (self._gap <= held + self.tolerance) & (push > 0.0)
            same, active = bool((new == active).all()), new
            size = self._size(right, active, push)
            falls = size <= max(slow * before, interior.rounding)
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
            elif iterate >= USUAL[dim] and same and falls:
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
        self._gap, self._normals = self._solids.at(place, place, place, time)
        if active.any():
            off = self._held[active] - self._gap[active]
            place[self._nodes[active]] += off[:, None] * self._normals[active]
            self._gap = np.where(active, self._held, self._gap)

    def _balance(self, *, first: bool = False) -> None:
        """Find the forces of a level; what they leave goes inside (collective)."""
        right = self.interior.balance()
        push = np.einsum("ij,ij->i", self._normals, right[self._nodes])
        self._force = np.where(self._active, np.maximum(push, 0.0), 0.0)
        directions = self._normals[:, None]
        self._acting = LevelForces.of(self._solids, directions, self._force[:, None])
        self.interior.receive(right - self._solids.spread(self._acting.vectors), first=first)

    def _turning(self, last: LevelForces) -> LevelForces:
        """What forces that begin or end in a step act more at its end.

        Those that begin, where nodes are held, grow by k v dt in their first step: from there on
        the energy that steps keep (`impactfem.marching.finite_leapfrog`) is larger by
        k v^2 dt^2 / 12. Those that end after the share s of a step would fall by k v dt in it, too;
        that they are cut off at 0 changes it by k v^2 dt^2 (s (1 - s) / 2 - 1 / 12). A force acts
        for half a step at v, which makes the sixths; a little more at the beginning is a loss.
        """
        force, before, needed = self._force, last.force[:, 0], self._needed
        gone = ~self._active & (before > 0.0) & (needed < 0.0)
        fresh = self._fresh & (force > 0.0)
        fall, first = np.where(gone, [before - needed, before], 1.0)  # k v dt, s k v dt
        share = np.where(gone, fall / (6.0 * first) + needed / fall, 0.0)
        ended, begun = share[:, None] * last.force, _BEGINNING * self._acting.force
        acting = np.where(fresh[:, None], begun, ended)
        return LevelForces.of(self._solids, self._acting.directions, acting)

    def _catch(self) -> None:
        """Let nodes go that nothing presses, and hold those that are inside an obstacle."""
        was = ~np.isnan(self._held)
        self._held[was & (self._force <= 0.0)] = np.nan
        caught = ~was & (self._gap < 0.0)
        self._fresh = caught
        self._held[caught] = self._gap[caught]
