"""Beams that turn far, at rest: places are displacements of nodes, and vectors of their turns.

Forces on turns are moments in space. What they do to the vector r of a turn is by small turns in
space f, r' = r + D f with the inverse D of the tangent of the exponential map.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from impactfem.arrays import Booleans, Floats
from impactfem.marching.few_start import FewAtRest
from impactfem.system.flexible_beam import Frames

if TYPE_CHECKING:
    from impactfem.marching.flexible_beam import FlexibleMidpoint

_HELD = 1e-12  # share of a motion below which nothing holds it
_LEAST, _MOST, _ABOUT = 1e-3, 20, 1e-6  # parts of loads, iterates, and what these may leave
_FARTHEST = 1.5  # turns by a part of the loads [rad]
_LONGEST, _BENT = 0.5, 0.5  # strains, and squared sines of half turns, of elements in passes
_ROUNDED = 8.0 * float(np.finfo(float).eps)  # share of E A
_TINY = float(np.finfo(float).tiny)
_SMALL = 1e-3  # turns whose series are taken [rad]


class FlexibleAtRest(FewAtRest):
    """A beam that turns far; see `impactfem.marching.resting.Resting`."""

    _march: "FlexibleMidpoint"  # type: ignore[assignment]
    patience = 40  # stresses of thin beams are far off until their bending is found
    _before: Floats | None = None  # where the last tangent was taken
    _stresses: Floats | None = None  # foreseen then

    def __init__(self, march: "FlexibleMidpoint") -> None:
        """Take it where it is, and see how its loads alone bend it if it is held."""
        super().__init__(march)  # type: ignore[arg-type]
        self._known: tuple[Floats, Floats] | None = None
        if not self.modes.count:
            loads = self.residual(self.start)
            way = self._bent() - self.start
            self._before = self._stresses = None
            missed = way - super().tangent(self.start)(loads)
            self._known = missed, loads / max(float(loads @ loads), _TINY)

    def tangent(self, place: Floats) -> Callable[[Floats], Floats]:
        """See `FewAtRest`; at the start of loads the answer is known, the secant of them all."""
        answer = super().tangent(place)
        if self._known is None or (place != self.start).any():
            return answer
        missed, along = self._known
        return lambda forces: np.asarray(answer(forces) + missed * (along @ forces))

    def _bent(self) -> Floats:
        """Where loads that grow bend it; the start where they lead nowhere."""
        whole = self._left(self._frames(self.start))
        kept, done, part = self.start, 0.0, 1.0
        while done < 1.0 and part > _LEAST:
            reached, place = min(1.0, done + part), kept.copy()
            for _ in range(_MOST):
                left = self._left(self._frames(place)) - (1.0 - reached) * whole
                size = float(np.linalg.norm(left))
                if not np.isfinite(size) or size <= _ABOUT * np.linalg.norm(whole):
                    break
                place = place + super().tangent(place)(left)
                turned = float(np.abs(self._march.bodies.spread(place - kept)[:, 3:]).max())
                if turned > _FARTHEST:
                    break
            if size <= _ABOUT * np.linalg.norm(whole):
                kept, done, part = place, reached, 2.0 * part
            else:
                part *= 0.5
                self._before = self._stresses = None
        return kept if done == 1.0 else self.start

    @staticmethod
    def _here(march: "FlexibleMidpoint") -> Floats:  # type: ignore[override]
        return np.zeros(int(march.bodies.moves.sum()))

    def _weighed(self) -> tuple[Floats, Floats, Floats]:
        bodies = self._march.bodies
        dim, turns = bodies.dim, 2 * bodies.dim - 3
        momenta = bodies.freely(self._motions()) @ bodies.mass
        return bodies.mass, momenta[:dim].T, momenta[6 - turns :].T

    def _motions(self) -> Floats:
        """Rigid ones along the axes and about the centre, (6, nodes, 6)."""
        bodies = self._march.bodies
        arms = bodies.start - bodies.node_mass @ bodies.start / bodies.masses[0]
        found = np.zeros((6, bodies.nodes, 6))
        found[:3, :, :3] = np.eye(3)[:, None]
        found[3:, :, :3] = np.cross(np.eye(3)[:, None], arms)
        found[3:, :, 3:] = np.eye(3)[:, None]
        return found

    def _free(self) -> tuple[Floats, Floats]:
        """See `FewAtRest`."""
        # Thin beams bend so easily that stiffness does not tell what is free.
        bodies, size = self._march.bodies, self._march.bodies.beam.length
        moves = np.full((bodies.nodes, 6), bodies.springs[:, None] == 0.0) & bodies.moves
        moves[bodies.sides[bodies.nodes - 1 :, 1], 3:] = False
        raw = self._motions() / np.array([1.0, 1.0, 1.0, size, size, size])[:, None, None]
        plane = [0, 1, 5] if bodies.dim == 2 else list(range(6))
        held = raw[plane][:, ~moves & self._possible]
        hold, ways = np.linalg.eigh(held @ held.T)
        fields = ways[:, hold <= _HELD].T @ bodies.freely(raw[plane])
        if len(fields):
            gram = fields @ bodies.mass @ fields.T
            fields = np.linalg.inv(np.linalg.cholesky(gram)) @ fields
        slow = bodies.beam.first_frequency
        return fields, np.array([slow**2])

    @property
    def _possible(self) -> Booleans:
        """What a node can do in this many coordinates, (6,)."""
        bodies = self._march.bodies
        return np.broadcast_to(
            np.array([True] * 6 if bodies.dim == 3 else [True, True, False, False, False, True]),
            (bodies.nodes, 6),
        )

    def _jacobian(self, place: Floats) -> Floats:  # noqa: ARG002  (places are coordinates)
        bodies = self._march.bodies
        every = np.zeros((bodies.nodes * bodies.dim, bodies.nodes, 6))
        for k in range(bodies.dim):
            nodes = np.arange(bodies.nodes)
            every[bodies.dim * nodes + k, nodes, k] = 1.0
        return bodies.freely(every)

    def _follows(self) -> bool:
        return True

    def _frames(self, place: Floats) -> Frames:
        bodies = self._march.bodies
        each = bodies.spread(place)
        return each[:, :3], Rotation.from_rotvec(each[:, 3:]).as_matrix() @ bodies.turns

    def _stiffness(self, place: Floats) -> Floats:
        bodies, each = self._march.bodies, self._march.bodies.spread(place)
        if self._before is not None and (change := bodies.spread(place - self._before)).any():
            turns = bodies.spread(self._before)[:, 3:]
            change[:, 3:] = (_spun(turns) @ change[:, 3:, None])[..., 0]
            self._stresses = bodies.foreseen(self._frames(self._before), change)
        self._before = place.copy()
        _, by_turns = bodies.standing(self._frames(place), self._stresses)
        # Turns in space by changes of the vectors.
        spun = np.tile(np.eye(6), (bodies.nodes, 1, 1))
        spun[:, 3:, 3:] = _spun(each[:, 3:])
        free, size = bodies.moves.ravel(), 6 * bodies.nodes
        whole = np.einsum("inj,njk->ink", by_turns.reshape(size, bodies.nodes, 6), spun)
        return np.asarray(whole.reshape(size, size)[np.ix_(free, free)])

    def contact(self, place: Floats) -> Floats:
        """Displacements of the contact nodes [m], (count, dim)."""
        bodies = self._march.bodies
        return bodies.spread(place)[:, : bodies.dim]

    def residual(self, place: Floats) -> Floats:
        """Loads less internal forces at t = 0, without contact; not finite far from any rest."""
        bodies, at = self._march.bodies, self._frames(place)
        states, strains, _ = bodies.looked(at)
        own = slice(bodies.nodes - 1)
        if not (np.abs(strains[own, 0]).max() < _LONGEST and states[own, 6].max() < _BENT):
            return np.full(len(place), np.nan)
        return self._left(at)

    def _left(self, at: Frames) -> Floats:
        """Loads less internal forces; 0 where rounding of a stretch makes as much."""
        left = self._march.unbalanced_at(at)
        noise = _ROUNDED * float(np.abs(self._march.bodies.elements[:, 4]).max())
        reach = np.array([1.0, 1.0, 1.0, *([self._march.bodies.elements[0, 3]] * 3)])
        return self._march.bodies.freely(np.where(np.abs(left) <= noise * reach, 0.0, left))

    def turned(self, place: Floats) -> Floats:  # noqa: ARG002  (sums tell how it lies)
        """Nothing: sums tell how it lies."""
        return np.zeros(2 * self._march.bodies.dim - 3)

    def settle(self, place: Floats) -> Floats:
        """Begin at a place; mass times the way there [kg m], (dim,)."""
        self._march.put(self._frames(place))
        bodies = self._march.bodies
        return np.asarray(bodies.node_mass @ self.contact(place))


def _spun(turns: Floats) -> Floats:
    """Turns in space by changes of vectors of turns (nodes, 3): (nodes, 3, 3)."""
    size = np.linalg.norm(turns, axis=1)
    small = size < _SMALL
    safe = np.where(small, 1.0, size)
    first = np.where(small, 0.5 - size**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(small, 1.0 / 6.0 - size**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    cross = np.cross(turns[:, None], np.eye(3)).swapaxes(1, 2)
    return np.eye(3) + first[:, None, None] * cross + second[:, None, None] * (cross @ cross)
