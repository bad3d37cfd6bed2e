"""Motion with friction between events: which contacts open, stick or slide, and with what forces.

With modes given, the accelerations and forces of

    M a = f + N^T lambda + T^T tau,   N a + n = 0 of closed contacts,
    T a + t = 0 of those that stick,  tau = -mu d lambda of those that slide in the direction d,

are one linear system; n and t are what the motion alone adds to normal and tangential rates. The
modes must fit: lambda >= 0, |tau| <= mu_s lambda of what sticks, d T a >= 0 of what begins to
slide, N a + n >= 0 of what opens. All modes of the few contacts are tried: none may fit, or
several (Painleve, Leçons sur le frottement, 1895; Lötstedt, SIAM J. Appl. Math. 42 (1982) 281-296).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import prod

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.system.generalized import GeneralizedSystem
from impactfem.system.joined import Forced
from impactfem.vibro.event_legs import Mode
from impactfem.vibro.event_motion import End, Motion
from impactfem.vibro.event_spread import spread

_FITS = 1e-9  # share of the forces and accelerations by which modes may miss
_SAME = 1e-7  # share of the accelerations by which two solutions may differ
_DEPENDENT = 1e-12  # least share of a singular value that counts
_MOST = 4096  # combinations of modes that are tried


@dataclass(frozen=True)
class Pushed:
    """Accelerations and forces with given modes.

    Attributes:
        acceleration: a, shape (d,).
        normal: lambda of each candidate [N], 0 of what opens, shape (candidates,).
        tangential: tau of each candidate [N], shape (candidates,).
        opening: Second rates of the gaps, shape (candidates,).
        sliding: Rates of the tangential velocities, shape (candidates,).
        undetermined: Dimensions of the normal and tangential forces that change no motion.
    """

    acceleration: Floats
    normal: Floats
    tangential: Floats
    opening: Floats
    sliding: Floats
    undetermined: int = 0


@dataclass(frozen=True)
class Rubbing:
    """Contacts that touch, at one state, in the k velocities that bilateral rows leave.

    Attributes:
        forced: Mass and load, shape (k, k) and (k,).
        normals, tangents: N and T of the candidates, shape (candidates, k).
        bends: n and t, shape (2, candidates).
        friction: mu of what slides, and of what sticks, shape (2, candidates).
    """

    forced: Forced
    normals: Floats
    tangents: Floats
    bends: Floats
    friction: Floats

    @classmethod
    def at(
        cls, system: GeneralizedSystem, t: float, u: Floats, v: Floats, rows: Sequence[int]
    ) -> "Rubbing":
        """The constraints ``rows`` of a system in a state."""
        own, forced = list(rows), Forced.at(system, t, u, v)
        bends = np.stack([system.gap_curvature(t, u, v), system.slip_curvature(u, v)[:, 0]])[:, own]
        both = np.stack([system.jacobian(u)[own], system.slip(u)[own, 0]])
        normals, tangents = forced.room.rows(both)
        friction = np.stack([system.friction, system.static_friction])[:, own]
        return cls(forced, normals, tangents, bends + both @ forced.drift, friction)

    def pushed(self, modes: Sequence[Mode]) -> Pushed:
        """Accelerations and forces with given modes."""
        closed = [i for i, mode in enumerate(modes) if mode is not None]
        stuck = [i for i in closed if modes[i] == 0]
        ways = np.array([modes[i] or 0 for i in closed], dtype=float)
        normals, held = self.normals[closed], self.tangents[stuck]
        slides = (self.friction[0, closed] * ways)[:, None] * self.tangents[closed]
        push = np.concatenate([normals - slides, held])
        stay = np.concatenate([normals, held])
        rest = np.concatenate([self.bends[0, closed], self.bends[1, stuck]])
        mass, load = self.forced.room.mass, self.forced.load
        free = np.linalg.solve(mass, np.concatenate([load[:, None], push.T], axis=1))
        forces = np.zeros(len(push))
        acceleration = free[:, 0]
        matrix = stay @ free[:, 1:]
        answers = np.linalg.pinv(matrix, _DEPENDENT) if len(push) else matrix
        for _ in range(2 if len(push) else 0):  # once more takes rounding away
            change = -answers @ (stay @ acceleration + rest)
            forces, acceleration = forces + change, acceleration + free[:, 1:] @ change
        undetermined = len(push) - int(np.linalg.matrix_rank(push)) if len(push) else 0
        if undetermined:
            limits = [(closed.index(i), self.friction[1, i]) for i in stuck]
            forces = spread(forces, push, len(closed), limits)
        normal, tangential = np.zeros((2, len(modes)))
        normal[closed] = forces[: len(closed)]
        tangential[closed] = -self.friction[0, closed] * ways * normal[closed]
        tangential[stuck] = forces[len(closed) : len(closed) + len(stuck)]
        opening = self.normals @ acceleration + self.bends[0]
        sliding = self.tangents @ acceleration + self.bends[1]
        full = self.forced.full(acceleration)
        return Pushed(full, normal, tangential, opening, sliding, undetermined)

    def fits(self, modes: Sequence[Mode], found: Pushed, moving: Sequence[bool]) -> bool:
        """Whether modes fit what they give; ``moving`` tells which candidates slide already."""
        size = np.abs(self.forced.load).max(initial=0.0) + np.abs(found.normal).max(initial=0.0)
        size += np.abs(found.tangential).max(initial=0.0)
        quick = np.abs([found.acceleration, self.forced.free]).max(initial=0.0)
        for i, mode in enumerate(modes):
            slow = _FITS * (np.abs(self.normals[i]).sum() * quick + abs(self.bends[0, i]))
            aside = _FITS * (np.abs(self.tangents[i]).sum() * quick + abs(self.bends[1, i]))
            limit = self.friction[1, i] * found.normal[i]
            wrong = (
                found.opening[i] < -slow
                if mode is None
                else found.normal[i] < -_FITS * size
                or found.opening[i] > slow
                or (mode == 0 and abs(found.tangential[i]) > limit + _FITS * size)
                or (mode == 0 and abs(found.sliding[i]) > aside)
                or (mode != 0 and not moving[i] and mode * found.sliding[i] < -aside)
            )
            if wrong:
                return False
        return True


@dataclass(frozen=True)
class Solutions:
    """What the laws of contact leave.

    Attributes:
        modes: Those taken.
        pushed: What they give.
        count: How many different accelerations fit; 1 where static friction is larger, so that
            what sticks has a past.
    """

    modes: tuple[Mode, ...]
    pushed: Pushed
    count: int


def solutions(contacts: Rubbing, choices: Sequence[Sequence[Mode]], moving: Sequence[bool]) -> (
    Solutions | None
):  # fmt: skip
    """Modes that fit, the first by the order of the choices of each contact; None if none do.

    Raises:
        ConvergenceError: There are too many contacts to try all.
    """
    taken: tuple[tuple[Mode, ...], Pushed] | None = None
    others: list[Floats] = []
    for modes in _trials(choices):
        found = contacts.pushed(modes)
        if not contacts.fits(modes, found, moving):
            continue
        if taken is None:
            taken = modes, found
            if (contacts.friction[1] > contacts.friction[0]).any():
                break
        pair = found.acceleration, taken[1].acceleration, contacts.forced.free
        size = np.abs(pair).max()
        if all(np.abs(found.acceleration - a).max() > _SAME * size for a in others):
            others.append(found.acceleration)
    return None if taken is None else Solutions(*taken, max(1, len(others)))


def _trials(choices: Sequence[Sequence[Mode]]) -> Iterator[tuple[Mode, ...]]:
    """All combinations, those first in which few contacts take a late choice."""
    if prod(len(c) for c in choices) > _MOST:
        raise ConvergenceError(
            f"events: {len(choices)} contacts with friction at once are too many to try all ways "
            'they may stick, slide or open; use method = "moreau_jean"'
        )
    every = product(*(range(len(c)) for c in choices))
    for places in sorted(every, key=lambda places: (sum(places), places)):
        yield tuple(c[k] for c, k in zip(choices, places, strict=True))


@dataclass(frozen=True)
class RubbingMotion(Motion):
    """Equations of motion with closed contacts that stick or slide.

    Attributes:
        modes: Of the closed constraints.
    """

    modes: tuple[Mode, ...] = field(default=())

    @property
    def integrals(self) -> int:
        """Normal forces of the closed constraints, and the power of friction."""
        return len(self.closed) + 1

    def pushed(self, t: float, u: Floats, v: Floats) -> Pushed:
        """Accelerations and forces."""
        return Rubbing.at(self.system, t, u, v, self.closed).pushed(self.modes)

    def forces(self, t: float, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Acceleration (d,), normal forces (S,) [N]."""
        found = self.pushed(t, u, v)
        return found.acceleration, found.normal

    def __call__(self, t: float, y: Floats) -> Floats:
        """Rates of u, v and the integrals."""
        u, v = self.split(y)
        found = self.pushed(t, u, v)
        slides = np.array([mode != 0 for mode in self.modes], dtype=bool)
        speed = np.where(slides, self.system.slip(u)[list(self.closed), 0] @ v, 0.0)
        # Rounding of what sticks is no power: the integrator would try to resolve it.
        moved = self.system.coordinate_rates(u, v)
        power = [float(found.tangential @ speed)]
        return np.concatenate([moved, found.acceleration, found.normal, power])

    def loose(self, t: float, u: Floats, v: Floats) -> Floats:
        """How far below 0 `guards` may fall by rounding."""
        own = Rubbing.at(self.system, t, u, v, self.closed)
        found = own.pushed(self.modes)
        size = np.abs(own.forced.load).max(initial=0.0) + np.abs(found.normal).max(initial=0.0)
        ways = np.abs(self.system.slip(u)[list(self.closed), 0]).sum(axis=1)
        speed = 1e-13 * ways * max(float(np.abs(v).max(initial=0.0)), self.rtol)
        stuck = np.array([mode == 0 for mode in self.modes], dtype=bool)
        force = np.full(len(self.modes), 1e-12 * size)
        return np.concatenate([force, np.where(stuck, force, speed)])

    def guards(self, t: float, u: Floats, v: Floats) -> Floats:
        """Normal forces, then room of what sticks in its cone [N], speed of what slides [m/s]."""
        own = Rubbing.at(self.system, t, u, v, self.closed)
        found = own.pushed(self.modes)
        room = own.friction[1] * found.normal - np.abs(found.tangential)
        ways = np.array([mode or 0 for mode in self.modes], dtype=float)
        speed = self.system.slip(u)[list(self.closed), 0] @ v
        return np.concatenate([found.normal, np.where(ways == 0, room, ways * speed)])

    def ended(self, guard: int) -> End:
        """What ends with a guard."""
        count = len(self.closed)
        if guard < count:
            return End(self.closed[guard])
        place = guard - count
        return End(self.closed[place], "slips" if self.modes[place] == 0 else "stops")


def unsolved(t: float, rows: Sequence[int], system: GeneralizedSystem) -> ConvergenceError:
    """No modes fit."""
    largest = float(system.friction[list(rows)].max(initial=0.0))
    return ConvergenceError(
        f"events: contact with friction on constraints {list(rows)} has no solution at t = "
        f"{t:.9g} s (Painleve's paradox): neither open, nor sticking or sliding with finite forces "
        f'and friction up to {largest:g}; take less friction, or method = "moreau_jean", whose '
        "steps pass this by an impulse"
    )
