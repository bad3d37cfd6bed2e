"""The time loop of a body under finite strain: Newton's iterates of a step, and its contact law.

Normal forces Lambda act along the normals n at the mean places of the step, and the law is one of
their increments w = n . (way of the node) - (way of the obstacle towards it):

    conserving   0 <= Lambda  _|_  w >= 0                 where the gap was closed before the step,
    massless     0 <= Lambda  _|_  max(gap, 0) + w >= 0   everywhere.

The work Lambda w is 0 for the first, so that energy is kept to rounding for any normals, and
-Lambda max(gap, 0) <= 0 for the second, which does not penetrate. A step in which a node would
close is cut where it does: what the first penetrates and the second loses are both of the order of
the way that is left.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import ConvergenceError
from impactfem.findings import Finding, by_limits, percent
from impactfem.marching.finite import FiniteMidpoint
from impactfem.marching.time_loop import ContactState, TimeLoop

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

_INERTIA_LIMITS = (0.01, 0.1)  # shares of the moment of inertia that masses miss
_ITERATES = 25
_SHORTEST = 2.0**-10  # of a layer
_NEAR = 0.005  # of a layer, less than `_CLOSED`: cuts nearer to the ends of a step are left out
_CUTS = 32  # of a layer at nodes that close
_CLOSED = 0.01  # of the largest change of a gap in a layer: gaps up to it count as closed


@dataclass
class _Step:
    """A step that was solved.

    Attributes:
        force: Lambda [N], (gaps,).
        normals: (gaps, dim).
        iterations: Of Newton's method.
        obstacles: Work of moving obstacles on the body [J].
    """

    force: Floats
    normals: Floats
    iterations: int
    obstacles: float


class NewtonMarch(TimeLoop[FiniteMidpoint]):
    """A march of one body under finite strain."""

    _generation = -1
    _known: dict[int, Floats]

    def findings(self) -> tuple[Finding, ...]:
        """A body whose masses, moved off its contact nodes, have too little inertia."""
        missing = self.interior.missing
        text = f"the masses inside the body have {percent(missing)} too little moment of inertia: "
        text += "nodes that may touch carry none, and it is few elements thick"
        remedy = "take smaller elements, or name the surfaces that may touch (contact_surfaces)"
        return by_limits("setting", missing, _INERTIA_LIMITS, text, "", remedy)

    def _advance(self) -> Floats:
        """One layer, in as many steps as it takes; returns its mean contact forces [N]."""
        layer, interior, state = self.layer, self.interior, self.contact
        dt = interior.dt
        time, end = layer * dt, (layer + 1) * dt
        count = len(state.gap)
        impulse, last, work, iterations, cuts = np.zeros(count), state.multiplier, 0.0, 0, _CUTS
        span, cut = dt, False
        bound = interior.predicted(time, end)
        change = self._gaps.at(bound, bound, bound, end)[0] - state.gap
        near = _CLOSED * np.abs(change)
        while time < end - 1e-9 * dt:
            stop = min(end, time + span)
            if stop > end - 1e-9 * dt:
                stop = end
            begin = interior.surface_displacement
            before = self._gaps.at(begin, begin, begin, time)[0]
            closed = (before <= near) | (last > 0.0)
            share = 1.0
            try:
                if cuts:
                    bound = interior.predicted(time, stop)
                    share = self._closing(before, closed, bound, time, stop)
                if share == 1.0:
                    step = self._step(time, stop, last, before, closed)
                    if cuts:
                        reached = interior.surface_iterate
                        share = self._closing(before, closed, reached, time, stop)
                if share < 1.0:
                    span, cuts, cut = share * (stop - time), cuts - 1, True
                    continue
            except ConvergenceError as error:
                span = 0.5 * (stop - time)
                if span < _SHORTEST * dt:
                    raise ConvergenceError(
                        f"no equilibrium was found in a step from t = {time:g} s, not even in "
                        f"{2 * span:.1e} s ({error}): give a smaller solve.dt, or smaller elements "
                        "where the body is squeezed most"
                    ) from error
                continue
            interior.accept()
            impulse += (stop - time) * step.force
            last, work, iterations = step.force, work + step.obstacles, iterations + step.iterations
            self._normals = step.normals
            time, span = stop, dt if cut else min(dt, 2.0 * span)
            cut = False
        self.layer = layer + 1
        static = np.zeros_like(state.static)
        self.rows.put(self.layer, interior.finish(layer, static))
        self.rows.obstacle_work[self.layer] = work
        place = interior.surface_displacement
        gap, _ = self._gaps.at(place, place, place, end)
        self.contact = ContactState(last, gap, state.multiplier, state.gap, static)
        force: Floats = impulse / dt
        self._close_row(self.layer, force, iterations)
        return force

    def _closing(
        self, before: Floats, closed: Booleans, then: Floats, start: float, end: float
    ) -> float:
        """Share of a step after which the first open gap closes; 1 if none does.

        Args:
            before: Gaps at its start [m], (gaps,).
            closed: Which of them count as closed, (gaps,).
            then: Displacement of the contact nodes at its end [m], (nodes, dim).
            start: [s].
            end: [s].
        """
        after = self._gaps.at(then, then, then, end)[0]
        rows = ~closed & (after < 0.0)
        least, most = _NEAR * self.interior.dt / (end - start), 1.0 - _NEAR
        share = before[rows] / (before[rows] - after[rows])
        share = share[share < most]
        return max(least, float(share.min())) if len(share) and least < most else 1.0

    def _step(
        self, start: float, end: float, last: Floats, before: Floats, closed: Booleans
    ) -> _Step:
        """Solve a step from the guess of the forces of the last one; it is not taken yet.

        Args:
            start: [s].
            end: [s].
            last: Forces of the last step [N], (gaps,).
            before: Gaps at the start [m], (gaps,).
            closed: Which of them count as closed, (gaps,).

        Raises:
            ConvergenceError: Newton's method did not converge.
        """
        interior, gaps = self.interior, self._gaps
        begin = interior.surface_displacement
        holds = self._scheme.holds
        may = closed if holds else np.ones(len(before), dtype=bool)
        room = np.zeros(len(before)) if holds else np.maximum(before, 0.0)
        force = np.where(may, last, 0.0)
        interior.begin(start, end)
        for iteration in range(_ITERATES):
            place = interior.surface_iterate
            middle = 0.5 * (begin + place)
            _, normals = gaps.at(middle, middle, middle, 0.5 * (start + end))
            moved = gaps.advance(normals, end) - gaps.advance(normals, start)
            way = np.einsum("ij,ij->i", normals, gaps.relative(place - begin)) - moved
            left = interior.unbalanced(gaps.spread(force[:, None] * normals))
            apart = room + way
            missed = np.where(force > 0.0, np.abs(apart), np.maximum(-apart, 0.0))[may]
            if left <= 1.0 and missed.max(initial=0.0) <= self.tolerance:
                return _Step(force, normals, iteration, float(force @ moved))
            free = np.einsum("ij,ij->i", normals, gaps.relative(interior.linearise()))
            new = self._complementary(apart + free, normals, force, may)
            interior.correct(gaps.spread((new - force)[:, None] * normals))
            force = new
        raise ConvergenceError(f"{_ITERATES} iterates")

    def _complementary(
        self, apart: Floats, normals: Floats, force: Floats, may: Booleans
    ) -> Floats:
        """Forces for which the linearised law holds.

        Args:
            apart: What must not be negative if the forces stay [m], (gaps,).
            normals: (gaps, dim).
            force: Forces that stay [N], (gaps,).
            may: Gaps in which there may be forces, (gaps,).
        """
        rows = np.flatnonzero(may & ((force > 0.0) | (apart < -self.tolerance)))
        found = np.zeros(len(force))
        while len(rows):
            answers = self._answers_to(rows, normals)
            # Symmetric but for what the step turns; what that leaves the next iterate settles.
            matrix = answers[:, rows]
            matrix = 0.5 * (matrix + matrix.T)
            offset = apart[rows] - matrix @ force[rows]
            solved, _ = self._solver(matrix, offset, force[rows] > 0.0)
            after = apart + (solved - force[rows]) @ answers
            missed = may & (after < -self.tolerance)
            missed[rows] = False
            if not missed.any():
                found[rows] = solved
                return found
            rows = np.union1d(rows, np.flatnonzero(missed))
        return found

    def _answers_to(self, rows: Integers, normals: Floats) -> Floats:
        """Changes of all gaps by unit forces in some, (rows, gaps); kept as long as the tangent."""
        interior, gaps = self.interior, self._gaps
        if self._generation != interior.generation:
            self._generation, self._known = interior.generation, {}
        fresh = [row for row in rows.tolist() if row not in self._known]
        if fresh:
            units = np.zeros((len(fresh), *normals.shape))
            units[np.arange(len(fresh)), fresh] = normals[fresh]
            moved = interior.answers(np.stack([gaps.spread(unit) for unit in units]))
            for row, each in zip(fresh, moved, strict=True):
                self._known[row] = np.einsum("ij,ij->i", normals, gaps.relative(each))
        return np.stack([self._known[row] for row in rows.tolist()])
