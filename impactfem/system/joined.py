"""Bilateral rows b(u) = 0 of systems in generalised coordinates, and coordinates that are no rates.

At one place the velocities that keep the rows are v = Z w, with Z an orthonormal basis of what
their Jacobian B sends to 0. In w a system has the mass Z^T M Z, constraints the Jacobian J Z, and
impacts the same laws: multipliers of the rows, which are equalities of the same complementarity
problem, are eliminated, and rows that depend on each other count once.
"""

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.system.generalized import GeneralizedSystem, factor_mass

_DEPENDENT = 1e-9  # least share of a singular value of rows of length 1 that counts
_MOST_CLOSING, _CLOSED = 20, 1e-14  # iterates that close bilateral rows, and their change
_STALLED = 1e-11  # change below which one that no longer shrinks is rounding
_STEP = 1e-3  # of differences of the Jacobian along the motion, as a share of the lengths
_LONG_STEP = 3e-3  # of second differences
_FIRST = ((1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0))
_SECOND = ((0.0, -30.0), (1.0, 16.0), (-1.0, 16.0), (2.0, -1.0), (-2.0, -1.0))


@dataclass(frozen=True)
class Room:
    """The room that bilateral rows leave at one place, of k dimensions.

    Attributes:
        system: The system.
        u: The place, shape (coordinates,).
        t: Time for messages [s].
        whole: M, shape (d, d).
        mass: Z^T M Z, shape (k, k).
        basis: Z, shape (d, k); None without rows, where w is v.
        back: Least velocities that change one row each by its unit, shape (d, B).
    """

    system: GeneralizedSystem
    u: Floats
    t: float | None
    whole: Floats
    mass: Floats
    basis: Floats | None = None
    back: Floats | None = None

    @classmethod
    def at(cls, system: GeneralizedSystem, u: Floats, t: float | None = None) -> "Room":
        """That of a system at u."""
        mass = system.mass(u)
        if system.bilateral is None:
            return cls(system, u, t, mass, mass)
        rows = system.joined(u)
        length = np.maximum(np.linalg.norm(rows, axis=1), np.finfo(float).tiny)
        left, sizes, right = np.linalg.svd(rows / length[:, None])
        count = int((sizes > _DEPENDENT).sum())
        basis = right[count:].T
        back = (right[:count].T / sizes[:count]) @ left[:, :count].T / length
        return cls(system, u, t, mass, basis.T @ mass @ basis, basis, back)

    @cached_property
    def factor(self) -> Floats:
        """Lower Cholesky factor of the mass, (k, k).

        Raises:
            SceneError: M(u) is not symmetric positive definite.
        """
        if self.basis is not None and (np.diag(self.mass) > 0.0).all():
            with suppress(np.linalg.LinAlgError):
                return np.linalg.cholesky(self.mass)
        return factor_mass(self.system, self.u, self.t)

    def rows(self, jacobian: Floats) -> Floats:
        """Rows (..., d) as they act on w, (..., k)."""
        return jacobian if self.basis is None else jacobian @ self.basis

    def full(self, w: Floats) -> Floats:
        """V of w."""
        return w if self.basis is None else self.basis @ w

    def load(self, force: Floats) -> Floats:
        """Forces (d,) on w, (k,)."""
        return force if self.basis is None else self.basis.T @ force

    def own(self, v: Floats) -> Floats:
        """W of the nearest v in the metric of M."""
        if self.basis is None:
            return v
        return np.asarray(cho_solve((self.factor, True), self.basis.T @ (self.whole @ v)))

    def answers(self, rows: Floats) -> Floats:
        """Velocities (d, n) by unit impulses along rows (n, d)."""
        return self.full(np.asarray(cho_solve((self.factor, True), self.rows(rows).T)))

    @property
    def inverse(self) -> Floats:
        """Velocities by unit impulses on each coordinate, (d, d): Z (Z^T M Z)^-1 Z^T."""
        return self.answers(np.eye(len(self.whole)))


@dataclass(frozen=True)
class Forced:
    """Forces at one state: the acceleration is Z a + drift, with Z^T M Z a = load.

    Attributes:
        room: What bilateral rows leave.
        load: On w, less what the drift takes, shape (k,).
        drift: Acceleration that the rows ask for as they turn, shape (d,).
    """

    room: Room
    load: Floats
    drift: Floats

    @classmethod
    def at(
        cls, system: GeneralizedSystem, t: float, u: Floats, v: Floats, room: Room | None = None,
        span: float = 0.0,
    ) -> "Forced":  # fmt: skip
        """Those of a system, or their means over a span of time; ``room`` if it is known."""
        room, force = room or Room.at(system, u, t), system.force(t, u, v, span)
        if room.back is None:
            return cls(room, force, np.zeros(system.dofs))
        drift = -room.back @ _bend(system, u, v)
        return cls(room, room.load(force - room.whole @ drift), drift)

    def full(self, a: Floats) -> Floats:
        """The acceleration (d,) of w' = a."""
        return a if self.room.basis is None else self.room.full(a) + self.drift

    @property
    def free(self) -> Floats:
        """The acceleration without contact, (d,)."""
        return self.full(np.linalg.solve(self.room.mass, self.load))


def answers(system: GeneralizedSystem, u: Floats, rows: Floats) -> Floats:
    """Velocities (d, n) by unit impulses along rows (n, d) that bilateral rows let pass."""
    if system.bilateral is None:
        return np.asarray(np.linalg.solve(system.mass(u), rows.T))
    return Room.at(system, u).answers(rows)


def advanced(system: GeneralizedSystem, u: Floats, way: Floats) -> Floats:
    """U moved along a way of the velocities (d,), to third order, with unit vectors."""
    if system.rates is None:
        return np.asarray(u + way)
    middle = u + 0.5 * system.coordinate_rates(u, way)
    return unit(system, u + system.coordinate_rates(middle, way))


def unit(system: GeneralizedSystem, u: Floats) -> Floats:
    """U with the unit vectors of a system scaled to 1."""
    if not system.unit_vectors:
        return u
    u = u.copy()
    for entries in system.unit_vectors:
        u[entries] /= np.linalg.norm(u[entries])
    return u


def closed(system: GeneralizedSystem, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """The nearest u and v, in the metric of M, that keep the bilateral rows, and unit vectors.

    Raises:
        ConvergenceError: None was found near.
    """
    u = unit(system, u)
    if system.bilateral is None:
        return u, v
    last = np.inf
    for _ in range(_MOST_CLOSING):
        wrong, room = np.atleast_1d(np.asarray(system.bilateral(u), float)), Room.at(system, u)
        way = wrong if room.back is None else room.back @ wrong
        way = way - room.full(room.own(way))
        share = float(np.abs(way).max()) / max(1e-300, float(np.abs(u).max()))
        u = advanced(system, u, -way)
        if share <= _CLOSED or (share <= _STALLED and share >= 0.5 * last):
            return u, room.full(room.own(v))
        last = share
    raise ConvergenceError(
        f"the bilateral rows do not close: {wrong.tolist()} is left of them at u = "
        f"{u.tolist()}; use a smaller dt, or a start from which they can be closed"
    )


def _bend(system: GeneralizedSystem, u: Floats, v: Floats) -> Floats:
    """Part (d/dt of the Jacobian) v of the second rates of the rows, (B,)."""
    joins, way = system.joins, system.coordinate_rates(u, v)
    speed = float(np.abs(way).max(initial=0.0))
    length = float(np.abs(u).max(initial=0.0)) or 1.0
    if joins is None or speed == 0.0:
        return np.zeros(len(system.joined(u)))
    if system.rates is None and not joins.is_exact:
        h = _LONG_STEP * length / speed
        parts = (k * np.asarray(system.bilateral(u + s * h * way)) for s, k in _SECOND)  # type: ignore[misc]  # asked for with rows only
        return np.atleast_1d(sum(parts)) / (12.0 * h * h)
    h = _STEP * length / speed
    places = [(u + s * h * way, k) for s, k in _FIRST]
    rates = (k * joins.along(at, system.coordinate_rates(at, v)) for at, k in places)
    return np.asarray(sum(rates) / (12.0 * h))
