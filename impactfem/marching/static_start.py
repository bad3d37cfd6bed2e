"""Equilibrium before t = 0 of loads, supports and contact, from which a march starts.

Newton's method with the active set of contact in each pass: bodies answer with their tangents, gaps
with their linearisation, and the forces in the gaps solve

    0 <= lambda  _|_  g + G dx + d(lambda) >= 0,    (K + eps M) dx = residual(x) + G^T lambda.

d is by how much contacts with a stiffness give way. eps M holds bodies that are free to move: a
step of the proximal point method (Rockafellar, SIAM J. Control Optim. 14 (1976) 877-898). Where
motions are free and no load works on them it leaves them where they were; where one does, bodies go
on along it until a gap closes, or nothing holds them.

Answers do not know how gaps and normals turn as bodies are squeezed, so that passes overshoot, the
more the harder bodies press: errors change by -0.9 in a pass at 10 % strain. Where that leads
nowhere the search begins anew and takes parts of passes that overshoot; if that fails too it takes
off what acts at the start, and adds it bit by bit. Bodies that stand on too little, as a ball on a
node of its mesh, have tangents that are not positive: they roll to what holds them by answers of
which the rigid part is that of their mass.
"""

from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.errors import ConvergenceError, SceneError
from impactfem.fem import MPI
from impactfem.findings import percent
from impactfem.marching.layers import ContactGaps, DirectedGaps
from impactfem.marching.pressing import Pressing
from impactfem.marching.resting import Rest, Resting
from impactfem.marching.rough_rest import Rough

_SETTLED = 1e-12  # share of the forces that may be left unbalanced
_ROUNDING = 1e-7  # the same where rounding lets no pass better it
_DRIFTING = 0.5  # share of the last pass's rest from which a pass has not bettered it
_NEUTRAL = 1e-3
"""Share of the forces below which one that works on a free motion is the mesh's.

A round body on a floor has no motion that gravity drives, but as a polygon it has."""

_HOPELESS, _LEAST = 0.1, 0.02  # part of the forces that is added at once: the first, others
_ABOUT, _FEW = 1e-6, 30  # what may be left, and passes, before all of them act
_BETTER = 0.95  # share of the best rest that betters it where parts of passes are taken
_SHORTEST = 1 / 16  # part of a pass
_PATIENCE = 6  # passes without a better one
_MOST = 80  # passes
_HALVINGS = 12  # of a step after which a body is not what it was


type Arms = Callable[[Floats, Sequence[Floats]], Floats]
"""Displacements of contact nodes that moments go by, (nodes, dim), by the true ones and those of
the owned dofs of each body."""


class StaticStart:
    """The search for a `Rest`."""

    def __init__(
        self,
        comm: Any,
        bodies: Sequence[Resting],
        owns: Sequence[slice | Integers],
        gaps: ContactGaps,
        pressing: Pressing,
        arms: Arms | None = None,
        rough: Rough | None = None,
    ) -> None:
        """Begin where the bodies are.

        Args:
            comm: MPI communicator.
            bodies: The bodies.
            owns: Places of the contact nodes of each among all.
            gaps: Distances from obstacles and other bodies.
            pressing: What finds forces in them.
            arms: By which the march turns the directions of gaps; None if it does not.
            rough: Friction in the gaps; None without any.
        """
        self._arms = arms
        self._comm, self._bodies, self._owns = comm, bodies, owns
        self._gaps, self._pressing, self._tolerance = gaps, pressing, pressing.tolerance
        self._places = [body.start.copy() for body in bodies]
        # Of each body free motions, by its modes, that go on being held, and how hard.
        self._held: list[list[Floats]] = [[] for _ in bodies]
        self._holding: dict[int, Floats] = {}
        self._tangents: list[Callable[[Floats], Floats]] = []
        self._answers: Any = None
        self._force = self._gross = 0.0  # the first that act, by squares and as a sum [N]
        self._rough = rough
        self._systems = self._gone = 0
        self._patience = _PATIENCE + max((body.patience for body in bodies), default=0)
        self._careful = False  # whether passes that overshoot are taken in part
        self._share = 1.0  # of the forces at the start that act
        self._missing: list[Floats] = []  # these on each body [N]
        self._begun = self._places  # places where passes began

    def find(self) -> Rest:
        """Seek it, at once or with forces that grow where that fails (collective).

        Raises:
            SceneError: Nothing holds a body on which loads act.
            ConvergenceError: None was found.
        """
        try:
            return self._sought()
        finally:
            self._answers = None  # holds this in turn: a circle would keep the meshes of bodies

    def _sought(self) -> Rest:
        """See `find`."""
        try:
            return self._whole(*self._balanced(_SETTLED, _MOST))
        except ConvergenceError as error:
            try:
                return self._whole(*self._grown(error))
            except ConvergenceError as failed:
                # A round body that stands on a node has to roll to a face of its mesh.
                if not any([body.steady() for body in self._bodies]):  # noqa: C419  (tell all)
                    raise
                try:
                    return self._steadily(error)
                except (ConvergenceError, SceneError):
                    raise failed from error

    def _steadily(self, whole: ConvergenceError) -> Rest:
        """As `find`, by answers that tell rigid motions from those that strain.

        Args:
            whole: What became of the search by tangents alone.

        Raises:
            SceneError: See `find`.
            ConvergenceError: See `find`.
        """
        self._begin_anew()
        self._careful, self._share = False, 1.0
        try:
            return self._whole(*self._balanced(_SETTLED, _MOST))
        except (ConvergenceError, SceneError):
            return self._whole(*self._grown(whole))

    def _begin_anew(self) -> None:
        """Go back to where the bodies were, with nothing held."""
        self._places = [body.start.copy() for body in self._bodies]
        self._held, self._holding = [[] for _ in self._bodies], {}
        self._answers = None
        if self._rough is not None:
            self._rough.forget()

    def _grown(self, whole: ConvergenceError) -> tuple[Floats, Floats, float, int]:
        """As `_balanced`, with parts of passes, and of the forces that act at the start if need be.

        Args:
            whole: What became of the search with all of them.

        Raises:
            ConvergenceError: Even small parts of them do not lead on.
        """
        starts = [body.start for body in self._bodies]
        each = zip(self._bodies, starts, strict=True)
        self._missing = [body.residual(place) for body, place in each]
        self._begin_anew()
        self._careful, self._share = True, 1.0
        gaps = len(self._look()[0])
        kept = self._places, np.zeros(gaps)
        done, part, passes = 0.0, 1.0, 0
        while True:
            reached = min(1.0, done + part)
            self._share, self._places = reached, [place.copy() for place in kept[0]]
            last = reached == 1.0
            try:
                found = self._balanced(
                    _SETTLED if last else _ABOUT, _MOST if last else _FEW, kept[1]
                )
            except (ConvergenceError, SceneError):
                part, self._held = 0.5 * part, [[] for _ in starts]
                if part < (_LEAST if done else _HOPELESS):
                    raise ConvergenceError(
                        f"{whole}; with forces that grow {percent(done)} of them were reached"
                    ) from whole
                continue
            passes += found[-1]
            if last:
                return *found[:-1], passes
            kept, done, part = (self._places, found[0]), reached, 1.5 * part

    def _balanced(
        self, settled: float, most: int, multiplier: Floats | None = None
    ) -> tuple[Floats, Floats, float, int]:
        """Forces in the gaps, normals, what is left of the forces, and passes (collective).

        Args:
            settled: Share of the forces that may be left.
            most: Passes at most.
            multiplier: Forces in the gaps to begin with [N], (gaps,); None: 0.

        Raises:
            SceneError: Nothing holds a body on which loads act.
            ConvergenceError: None was found.
        """
        self._begun = [place.copy() for place in self._places]
        gap, normals = self._look()
        multiplier = np.zeros(len(gap)) if multiplier is None else multiplier
        last, best, idle, part = np.inf, np.inf, 0, 1.0  # of a pass that is taken
        for done in range(most + 1):
            left = self._unbalanced(multiplier, normals)
            rest = self._size(left) / self._force if self._force else 0.0
            closed = self._pressing.missed(gap, multiplier) <= 10.0 * self._tolerance
            stalled = _DRIFTING * last < rest <= _ROUNDING
            stalled = stalled and (part < 1.0 or not self._careful)
            if closed and (rest <= settled or stalled):
                return multiplier, normals, rest, done
            if done == most or not np.isfinite(rest):
                break
            before, slow = self._places, _DRIFTING * last < rest
            if slow and self._careful:
                part = max(_SHORTEST, 0.5 * part) if rest > last or part == 1.0 else part
            else:
                part = min(1.0, 2.0 * part)
            try:
                new = self._step(left, gap, normals, multiplier)
            except ConvergenceError as error:
                raise ConvergenceError(
                    f'start = "static": no contact forces were found in pass {done + 1}; what is '
                    "pressed hard at once, or rests on too little to hold it, has to be brought "
                    'there: use start = "given", with damping or loads that grow'
                ) from error
            followed = slow and rest > _ROUNDING and self._follow(before, left, gap, normals)
            if part < 1.0 and not followed:
                pairs = zip(before, self._places, strict=True)
                self._places = [old + part * (there - old) for old, there in pairs]
                new = multiplier + part * (new - multiplier)
                if self._rough is not None:
                    self._rough.take(part)
            multiplier = new
            idle = 0 if rest < (_DRIFTING if part == 1.0 else _BETTER) * best else idle + 1
            if idle == self._patience:
                self._hold_restless(before)
                best, idle = np.inf, 0
            last, best = rest, min(best, rest)
            gap, normals = self._look()
        raise ConvergenceError(
            f'start = "static": no equilibrium was found in {done} passes, {best:.1e} of the '
            "forces were left unbalanced; change the loads or the supports, or use start = "
            '"given"'
        )

    def _look(self) -> tuple[Floats, Floats]:
        """Gaps and normals where the bodies are."""
        there = self._surface(self._places)
        gap, normals = self._gaps.at(there, there, there, 0.0)
        if self._arms is not None:
            normals = self._gaps.normals_at(there, 0.0, self._arms(there, self._places))
        if self._rough is not None:
            towards = self._gaps.spread(normals)
            for body, own in zip(self._bodies, self._owns, strict=True):
                body.touch(towards[own])
        return gap, normals

    def _surface(self, values: Sequence[Floats]) -> Floats:
        """Of all contact nodes, by the values of the owned dofs of each body."""
        each = zip(self._bodies, values, strict=True)
        return self._scattered([body.contact(own) for body, own in each])

    def _scattered(self, each: Sequence[Floats]) -> Floats:
        """Values at the contact nodes of each body, (count, dim), in the order of all nodes."""
        found = np.empty((sum(map(len, each)), each[0].shape[1]))
        for own, values in zip(self._owns, each, strict=True):
            found[own] = values
        return found

    def _pulled(self, forces: Floats) -> list[Floats]:
        """Forces on the owned dofs of each body by those on the contact nodes."""
        each = zip(self._bodies, self._owns, self._places, strict=True)
        return [body.pulled(forces[own], place) for body, own, place in each]

    def _size(self, forces: Sequence[Floats]) -> float:
        """Root of the sum of squares of forces on all bodies."""
        own = sum(float(part @ part) for part in forces)
        return float(np.sqrt(self._comm.allreduce(own, op=MPI.SUM)))

    def _vectors(self, multiplier: Floats, normals: Floats) -> Floats:
        """Forces in the gaps [N], (gaps, dim)."""
        found = multiplier[:, None] * normals
        return found if self._rough is None else found + self._rough.forces

    def _unbalanced(self, multiplier: Floats, normals: Floats) -> list[Floats]:
        """Forces that are left on the bodies [N]."""
        each = zip(self._bodies, self._places, strict=True)
        acting = [body.residual(place) for body, place in each]
        if self._share < 1.0:
            parts = zip(acting, self._missing, strict=True)
            acting = [one - (1.0 - self._share) * part for one, part in parts]
        if not self._force:
            gross = sum(float(np.abs(part).sum()) for part in acting)
            self._force, self._gross = self._size(acting), self._comm.allreduce(gross, op=MPI.SUM)
        pushed = self._pulled(self._gaps.spread(self._vectors(multiplier, normals)))
        left = [one + other for one, other in zip(acting, pushed, strict=True)]
        for k, (body, ways) in enumerate(zip(self._bodies, self._held, strict=True)):
            if ways:
                along = body.modes.along(left[k])
                self._holding[k] = np.asarray(sum((along @ way) * way for way in ways))
                left[k] = left[k] - body.modes.forces(self._holding[k])
        return left

    def _columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """What several forces on the contact nodes do to these; see `contact.responses`."""
        found = np.zeros_like(forces)
        for several, answer in zip(forces, found, strict=True):
            each = zip(self._bodies, self._owns, self._tangents, self._places, strict=True)
            for body, own, solve, place in each:
                if several[own].any():
                    answer[own] = body.moved(place, solve(body.pulled(several[own], place)))
        return found, np.zeros_like(forces)

    def _step(self, left: list[Floats], gap: Floats, normals: Floats, multiplier: Floats) -> Floats:
        """Move the bodies to where the linearised equations are solved; forces in the gaps there.

        Args:
            left: Forces that are left [N].
            gap: Gaps where the bodies are [m], (gaps,).
            normals: Their normals, (gaps, dim).
            multiplier: Forces in them [N], (gaps,).
        """
        each = zip(self._bodies, self._places, strict=True)
        tangents = [body.tangent(place) for body, place in each]
        if self._answers is None or tangents != self._tangents:
            self._tangents = tangents
            columns, gaps = self._columns, self._gaps
            if self._rough is None:
                self._answers = gaps.responses(columns, None)
            else:
                self._answers = cast("DirectedGaps", gaps).directed(columns, None)
            self._look()  # answers that follow the gaps are told of them
        answers, pressed = self._answers, self._vectors(multiplier, normals)
        changes = [solve(force) for solve, force in zip(tangents, left, strict=True)]
        ways = self._moving(changes)
        free = gap + np.einsum("ij,ij->i", ways, normals)
        if self._rough is None:
            found, count = self._pressing.find(answers, free, normals, multiplier)
        else:
            each = zip(self._bodies, self._places, strict=True)
            here = self._gaps.relative(self._scattered([b.touching(place) for b, place in each]))
            found, count = self._rough.find(answers, free, (here, ways), normals, multiplier)
        self._systems += count
        change = self._gaps.spread(self._vectors(found, normals) - pressed)
        for k, (solve, force) in enumerate(zip(tangents, self._pulled(change), strict=True)):
            if self._comm.allreduce(bool(force.any()), op=MPI.LOR):
                changes[k] = changes[k] + solve(force)
        self._places = [self._moved(k, change) for k, change in enumerate(changes)]
        return found

    def _along(self, changes: Sequence[Floats], normals: Floats) -> Floats:
        """How displacements of the bodies change the gaps [m], (gaps,)."""
        return np.asarray(np.einsum("ij,ij->i", self._moving(changes), normals))

    def _moving(self, changes: Sequence[Floats]) -> Floats:
        """What they make for the gaps [m], (gaps, dim)."""
        each = zip(self._bodies, self._places, changes, strict=True)
        ways = [body.moved(place, change) for body, place, change in each]
        return self._gaps.relative(self._scattered(ways))

    def _moved(self, index: int, change: Floats) -> Floats:
        """Place of a body after a step, halved until there is a body (collective)."""
        body, place = self._bodies[index], self._places[index]
        for _ in range(_HALVINGS):
            there = place + change
            fine = bool(np.isfinite(body.residual(there)).all())
            if self._comm.allreduce(fine, op=MPI.LAND):
                break
            change = 0.5 * change
        return there

    def _follow(
        self, before: list[Floats], left: list[Floats], gap: Floats, normals: Floats
    ) -> bool:
        """Go on along a rigid motion that loads drive until a gap closes, or hold it if it is none.

        Args:
            before: Places before the step that went along it.
            left: Forces that were left there [N].
            gap: Gaps there [m], (gaps,).
            normals: Their normals, (gaps, dim).

        Returns:
            Whether the bodies are elsewhere by it.

        Raises:
            SceneError: None closes.
        """
        bodies = self._bodies
        along = [body.modes.along(force) for body, force in zip(bodies, left, strict=True)]
        rigid = [body.modes.forces(part) for body, part in zip(bodies, along, strict=True)]
        sizes = [self._size([force]) for force in rigid]
        worst = int(np.argmax(sizes))
        if sizes[worst] <= _DRIFTING * self._size(left):
            return False
        share = bodies[worst].modes.push(along[worst]) / self._gross
        patience = bodies[worst].patience
        if share <= _NEUTRAL:
            if not patience:
                self._hold(worst, along[worst])
            return not patience
        each = zip(bodies, self._places, before, strict=True)
        ways = [body.modes.of_displacement(after - place) for body, after, place in each]
        rates = self._along(ways, normals)
        farthest = self._comm.allreduce(
            max(float(np.abs(way).max(initial=0.0)) for way in ways), op=MPI.MAX
        )
        if farthest <= self._tolerance:  # what was found in that pass holds it
            return False
        closing = rates < -1e-6 * farthest
        self._gone = 0 if closing.any() else self._gone + 1
        if self._gone > patience:
            raise self._unheld(worst, along[worst])
        if self._gone:
            return False
        steps = max(1.0, float((gap[closing] / -rates[closing]).min()))
        for k, way in enumerate(ways):
            self._places[k] = before[k] + steps * way
        return True

    def _unheld(self, body: int, along: Floats) -> SceneError:
        """What to say where loads work on a motion that nothing holds."""
        modes, name = self._bodies[body].modes, self._bodies[body].name
        return SceneError(
            f'start = "static": nothing holds body {name} against its {modes.words(along)}, '
            f"{percent(modes.push(along) / self._gross)} of the forces at t = 0; add a support, or "
            "an obstacle or body that holds it, or more friction, balance the loads, or use "
            'start = "given"'
        )

    def _hold(self, body: int, along: Floats) -> None:
        """Hold a free motion of a body from now on, and begin anew."""
        free = _beside(along, self._held[body])
        self._held[body].append(free / np.linalg.norm(free))
        self._places = [place.copy() for place in self._begun]
        if self._rough is not None:
            self._rough.forget()

    def _hold_restless(self, before: list[Floats]) -> None:
        """Hold the free motion that a pass has gone on along the most, where no pass is better.

        Args:
            before: Places before that pass.
        """
        each = zip(self._bodies, self._places, before, strict=True)
        along = [body.modes.moved(after - place) for body, after, place in each]
        along = [_beside(part, ways) for part, ways in zip(along, self._held, strict=True)]
        sizes = [float(np.linalg.norm(part)) for part in along]
        if max(sizes) > 0.0:
            self._hold(int(np.argmax(sizes)), along[int(np.argmax(sizes))])

    def _whole(self, multiplier: Floats, normals: Floats, rest: float, done: int) -> Rest:
        forces = self._gaps.spread(self._vectors(multiplier, normals))
        shifted, neutral = {}, {}
        for body, place in zip(self._bodies, self._places, strict=True):
            change = place - body.start
            rigid = body.modes.of_displacement(change)
            sizes = [float(np.abs(part).max(initial=0.0)) for part in (rigid, change - rigid)]
            carried, bent = (self._comm.allreduce(size, op=MPI.MAX) for size in sizes)
            shifted[body.name] = carried, bent
        for k, along in self._holding.items():
            modes = self._bodies[k].modes
            share = modes.push(along) / self._gross
            if share > _NEUTRAL:
                raise self._unheld(k, along)
            neutral[self._bodies[k].name] = share, modes.words(along)
        surface = self._surface(self._places)
        counts = done, self._systems
        rubbing = self._vectors(0.0 * multiplier, normals)
        places = tuple(self._places)
        return Rest(places, surface, multiplier, rubbing, forces, rest, counts, shifted, neutral)


def _beside(along: Floats, ways: Sequence[Floats]) -> Floats:
    """What is left of a vector across some that are orthonormal."""
    return along - sum((along @ way) * way for way in ways)
