"""Explicit levels under finite strain of bodies that rub, or meet each other.

At each level the contact nodes u_c of all bodies and the forces F = (Lambda, T) in the gaps obey

    f_c(u_i, u_c) = loads + G^T F,    0 <= Lambda  _|_  g - g_held >= 0  where gaps are held,
    |T| <= mu Lambda,    T = -mu Lambda s / |s| in slip,    s = 0 in stick,

s the tangential way of the nodes since the last level, less that of what they touch: the cone is
exact, the work T . s is never positive, and slip that turns round sticks for at least a level, as
nothing has a mass that would carry it on. G turns with the bodies
(`impactfem.contact.turning_gaps`), so that forces between bodies have neither sum nor moment.

Each iterate of Newton's method solves the law on the compliance of the surface, as the implicit
march does; its tangent and what was found of its inverse serve for many levels.
"""

from dataclasses import replace

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.followed_pair import FAR
from impactfem.errors import ConvergenceError
from impactfem.marching.level_forces import LevelForces
from impactfem.marching.level_march import MOST, SLOW, USUAL, LevelMarch
from impactfem.marching.rubbing import frames, held_by_static, in_space, obeying, turned

_REGULAR = 1e-12  # share of the largest compliance below which a gap does not yield


class CoupledLevels(LevelMarch):
    """A march of bodies in explicit steps whose gaps weigh several nodes, or rub."""

    def _directed(self, normals: Floats) -> Floats:
        return frames(normals) if self._rubs else normals[:, None]

    def _settle(self, begin: Floats, start: float, time: float) -> int:
        """Bring the surfaces to equilibrium; see `LevelMarch`.

        Raises:
            ConvergenceError: It was not found, or cells turn inside out.
        """
        interior, gaps = self.interior, self._solids
        place = interior.surface_displacement
        count, dim = place.shape
        none, nowhere = np.zeros(count, dtype=bool), np.zeros_like(place)
        self._needed = np.zeros(len(self._held))
        self._sticking = np.zeros_like(self._stuck)
        force, before = np.zeros_like(self._acting.force), np.inf
        slow = SLOW[dim] + interior.lag
        for iterate in range(1, MOST + 1):
            if iterate == 1:  # the guess is of third order: who meets whom is found by it
                base, (gap, _) = place, gaps.at(place, place, place, time)
                held, last = self._handed(), gaps.handed(self._acting.vectors)
                rows = np.flatnonzero(~np.isnan(held) & (gap < 0.5 * FAR))
                shift = gaps.shift(time) - gaps.shift(start)
            directions = self._directed(gaps.normals_at(place, time))
            interior.touch(gaps.spread(directions[:, 0]))
            if iterate == 1:
                force[rows] = turned(directions, last)[rows]
            interior.move_surface(place)
            right = interior.unbalanced() - gaps.spread(in_space(directions, force))
            right = np.where(interior.yields, right, 0.0)
            size = float(np.linalg.norm(right))
            falls = size <= max(slow * before, interior.rounding)
            if self._stale or (iterate > 1 and not falls):
                interior.renew()
                self._stale = False
            if not len(rows):
                free = place - interior.relaxed(right, none, nowhere)
            else:
                free = place - interior.answer(right)
                way = turned(directions, gaps.relative(free - begin + interior.rolled) - shift)
                way[:, 0] = gap - held
                way[:, 0] += turned(directions, gaps.relative(free - base))[:, 0]
                pressed = rows[:0] if iterate > 1 else np.flatnonzero(force[rows, 0] > 0.0)
                force, moved = self._obeying(rows, way, directions, force, pressed)
                free = free + moved
            place, before = free, size
            if iterate >= USUAL[dim] and falls:
                break
        else:
            raise ConvergenceError(f"the surface found no equilibrium at t = {time:g} s")
        interior.move_surface(place)
        normals = gaps.normals_at(place, time)  # forces have no moment about where nodes are
        interior.touch(gaps.spread(normals))
        self._gap = gap + turned(directions, gaps.relative(place - base))[:, 0]
        self._normals, self._active = directions[:, 0], force[:, 0] > 0.0
        self._stuck = self._sticking & self._active
        self._put_forces(directions, force)
        return iterate

    def _handed(self) -> Floats:
        """Where gaps are held, by which carry them now: nodes slide from obstacle to obstacle."""
        if self._solids.shares_nodes:
            known = ~np.isnan(self._held)
            count = self._solids.handed(known.astype(np.float64))
            total = self._solids.handed(np.where(known, self._held, 0.0))
            self._held = np.where(count > 0.0, total / np.maximum(count, 1.0), np.nan)
        return self._held

    def _put_forces(self, directions: Floats, force: Floats) -> None:
        self._force = force[:, 0]
        self._acting = LevelForces.of(self._solids, directions, force)

    def _obeying(
        self, rows: Integers, way: Floats, directions: Floats, force: Floats, pressed: Integers
    ) -> tuple[Floats, Floats]:
        """Forces in some gaps for which the linearised law holds, and how nodes move by the change.

        Args:
            rows: Gaps that are held.
            way: Above these, and increments, if the forces stay [m], (gaps, ways).
            directions: (gaps, ways, dim).
            force: Forces that stay [N], (gaps, ways).
            pressed: Of these those for which to find what would hold nodes still.

        Returns:
            All forces [N], (gaps, ways), and displacements [m], (nodes, dim).
        """
        units = self._solids.units(rows, directions[rows])
        nodes = np.flatnonzero(units.any(axis=(0, 1, 3)))
        answers = self.interior.answers(nodes)
        size = answers.shape[0] * answers.shape[1]
        act = units[:, :, nodes].reshape(-1, size)
        matrix = act @ answers[:, :, nodes].reshape(size, size) @ act.T
        ways, found = way.shape[1], np.zeros_like(force)
        own = force[rows]
        matrix = 0.5 * (matrix + matrix.T)
        offset = way[rows] - (matrix @ own.ravel()).reshape(own.shape)
        if len(pressed):
            inner = matrix[::ways, ::ways][np.ix_(pressed, pressed)]
            still = np.linalg.lstsq(inner, -offset[pressed, 0], rcond=_REGULAR)[0]
            self._needed[rows[pressed]] = still
        solved = found[rows] = self._lawful(matrix, offset, rows, own)
        change = (solved - force[rows]).ravel() @ act
        return found, (change @ answers.reshape(size, -1)).reshape(answers.shape[2:])

    def _lawful(self, matrix: Floats, offset: Floats, rows: Integers, own: Floats) -> Floats:
        """Forces by the law of friction, static one included; see `obeying`."""
        law = self._friction
        if law is None or not (law.static > law.coefficients)[rows].any():
            return obeying(matrix, offset, rows, own, law, self._how)

        def with_friction(mu: Floats) -> tuple[Floats, Floats]:
            some = replace(law.some(rows), coefficients=mu)
            found = obeying(matrix, offset, np.arange(len(rows)), own, some, self._how)
            return found, found

        kinetic, static = law.coefficients[rows], law.static[rows]
        solved, self._sticking[rows] = held_by_static(
            with_friction, self._stuck[rows], kinetic, static
        )
        return solved

    def _balance(self, *, first: bool = False) -> None:
        """Find what the forces of a level leave, which goes inside (collective)."""
        right = self.interior.balance()
        self.interior.receive(right - self._solids.spread(self._acting.vectors), first=first)
