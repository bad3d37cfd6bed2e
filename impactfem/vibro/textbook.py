"""One-step schemes of the textbooks, with impacts at the end of each step.

Free motion is y' = F(t, y) with y = (u, v), F = (v, M^-1 f). With steps h:

    explicit_euler    y+ = y + h F(t, y)
    implicit_euler    y+ = y + h F(t + h, y+)
    symplectic_euler  v+ = v + h a(t, u, v),   u+ = u + h v+
    midpoint          y+ = y + h F(t + h / 2, (y + y+) / 2)
    trapezoid         y+ = y + h (F(t, y) + F(t + h, y+)) / 2
    rk4               the classical method of Kutta
    energy_momentum   z+ = z + h int_0^1 G(t + s h, z + s (z+ - z)) ds,   z = (u, M v)

G is F in momenta. The last one is the discrete gradient of mean values (Harten, Lax and van Leer;
Quispel and McLaren, J. Phys. A 41 (2008) 045206): with forces of a potential it keeps the energy,
and the momenta of coordinates that energy does not depend on, to the rounding of the integral.
Angular momentum in Cartesian coordinates is no such momentum: of it order h^2 is missed.

Where a gap is closed at the end of a step, impulses 0 <= P _|_ w+ + e w >= 0 act, w the normal
velocity at the end of the free step. e is 0 where the pair did not approach at its start already:
that is lasting contact, whose impulse moves the end of the step too, as far as the scheme weighs
the velocity there.

Bilateral rows b(u) = 0 are held by multipliers in the accelerations, and by the nearest place and
velocity, in the metric of M, at the end of each step.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.contact.impact_law import Law
from impactfem.errors import ConvergenceError
from impactfem.result.trajectory import Trajectory
from impactfem.system.generalized import GeneralizedSystem
from impactfem.system.joined import Forced
from impactfem.system.joined import answers as answers_to
from impactfem.system.joined import closed as closed_rows
from impactfem.system.start_checks import check_start
from impactfem.vibro.position_kernels import ROUNDING
from impactfem.vibro.stepping import Stepped, Walls, march
from impactfem.vibro.vibro_rows import count_steps, solve_impulses

Rate = Callable[[float, Floats], Floats]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_MOST_ITERATIONS = 50
_OLD = 6  # iterations from which on Newton's tangent is renewed
_SETTLED = 4.0 * 2.0**-52
_STALLED = 1e-11  # share of the state below which a change that no longer shrinks is rounding


@dataclass(frozen=True)
class TextbookSettings:
    """Settings of a textbook scheme.

    Attributes:
        dt: Longest time step h [s]; the one used divides the duration.
        every: Steps between two rows of the trajectory.
        impact_law: Only "simultaneous".
    """

    dt: float
    every: int = 1
    impact_law: Law = "simultaneous"

    def resolution(self, _: float) -> float:
        """Impacts closer in time than this are one [s]."""
        return 2.0 * self.dt


class FreeStep(ABC):
    """Steps of a system without contact: a scheme overrides `ends`."""

    def __init__(self, system: GeneralizedSystem, h: float) -> None:
        """Begin with steps of length h [s]."""
        self.system, self.h = system, h
        self._tangent: Floats | None = None

    def __call__(self, t: float, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        """U and u' at the end of the step, shape (d,) each."""
        end = self.ends(t, np.concatenate([u, v]))
        return end[: len(u)], end[len(u) :]

    @abstractmethod
    def ends(self, t: float, y: Floats) -> Floats:
        """State at the end of the step."""

    def rate(self, t: float, y: Floats) -> Floats:
        """F(t, y), shape (2 d,)."""
        u, v = np.split(y, [len(y) - self.system.dofs])
        system = self.system
        forces = Forced.at(system, t, u, v)
        return np.concatenate([system.coordinate_rates(u, v), forces.free])

    def solve(self, t: float, y: Floats, mean: Callable[[Floats], Floats]) -> Floats:
        """y+ = y + h mean(y+), by Newton's method with a tangent that is kept while it does.

        Raises:
            ConvergenceError: It did not converge.
        """
        end, last = y + self.h * mean(y), np.inf
        for iteration in range(_MOST_ITERATIONS):
            if self._tangent is None or (iteration and iteration % _OLD == 0):
                self._tangent = np.linalg.inv(np.eye(len(y)) - self.h * _derivative(mean, end))
            change = self._tangent @ (end - y - self.h * mean(end))
            end = end - change
            if not np.isfinite(end).all():
                break
            share = float(np.abs(change / _sizes(end, y, self.system.dofs)).max())
            if share <= _SETTLED or (share <= _STALLED and share >= 0.5 * last):
                return end
            last = share
        raise ConvergenceError(
            f"the step at t = {t:.6g} s was not solved in {_MOST_ITERATIONS} iterations; use a "
            "smaller dt"
        )


class _ExplicitEuler(FreeStep):
    def ends(self, t: float, y: Floats) -> Floats:
        return y + self.h * self.rate(t, y)


class _SymplecticEuler(FreeStep):
    def ends(self, t: float, y: Floats) -> Floats:
        d = len(y) - self.system.dofs
        faster = y + self.h * np.concatenate([np.zeros(d), self.rate(t, y)[d:]])
        return y + self.h * np.concatenate([self.rate(t, faster)[:d], self.rate(t, y)[d:]])


class _ImplicitEuler(FreeStep):
    def ends(self, t: float, y: Floats) -> Floats:
        return self.solve(t, y, lambda end: self.rate(t + self.h, end))


class _Midpoint(FreeStep):
    def ends(self, t: float, y: Floats) -> Floats:
        return self.solve(t, y, lambda end: self.rate(t + 0.5 * self.h, 0.5 * (y + end)))


class _Trapezoid(FreeStep):
    def ends(self, t: float, y: Floats) -> Floats:
        begin = self.rate(t, y)
        return self.solve(t, y, lambda end: 0.5 * (begin + self.rate(t + self.h, end)))


class _Kutta(FreeStep):
    def ends(self, t: float, y: Floats) -> Floats:
        h, rate = self.h, self.rate
        first = rate(t, y)
        second = rate(t + 0.5 * h, y + 0.5 * h * first)
        third = rate(t + 0.5 * h, y + 0.5 * h * second)
        fourth = rate(t + h, y + h * third)
        return y + h / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)


class _EnergyMomentum(FreeStep):
    """In momenta, or where M is constant in velocities."""

    def __call__(self, t: float, u: Floats, v: Floats) -> tuple[Floats, Floats]:
        mass, d = self.system.mass, len(u)
        if self.system.constant_mass is not None:
            return super().__call__(t, u, v)
        end = self.ends(t, np.concatenate([u, mass(u) @ v]))
        return end[:d], np.linalg.solve(mass(end[:d]), end[d:])

    def ends(self, t: float, y: Floats) -> Floats:
        rate = self.rate if self.system.constant_mass is not None else self._of_momenta

        def mean(end: Floats) -> Floats:
            way = end - y
            at = (rate(t + s * self.h, y + s * way) for s in _NODES)
            return np.asarray(sum(w * r for w, r in zip(_WEIGHTS, at, strict=True)))

        return self.solve(t, y, mean)

    def _of_momenta(self, t: float, z: Floats) -> Floats:
        """Rates of u and of M v, f + (dM/dt) v."""
        u, p = np.split(z, 2)
        v = np.linalg.solve(self.system.mass(u), p)
        turned = self.system.mass_rate(u, v) @ v
        return np.concatenate([v, self.system.force(t, u, v) + turned])


class _Scheme(NamedTuple):
    free: type[FreeStep]
    weight: float  # of the velocity at the end in the way of a step
    joins: bool = True  # whether it knows bilateral rows, and rates of coordinates


SCHEMES: Mapping[str, _Scheme] = {
    "explicit_euler": _Scheme(_ExplicitEuler, 0.0),
    "implicit_euler": _Scheme(_ImplicitEuler, 1.0),
    "symplectic_euler": _Scheme(_SymplecticEuler, 1.0),
    "midpoint": _Scheme(_Midpoint, 0.5),
    "trapezoid": _Scheme(_Trapezoid, 0.5),
    "rk4": _Scheme(_Kutta, 0.5),
    "energy_momentum": _Scheme(_EnergyMomentum, 0.5, joins=False),
}
"""The schemes by name."""


def integrate_textbook(
    system: GeneralizedSystem,
    position: ArrayLike,
    velocity: ArrayLike,
    duration: float,
    settings: TextbookSettings,
    *,
    scheme: str,
) -> Trajectory:
    """Integrate by a textbook scheme.

    Args:
        system: The system.
        position: u0, shape (d,).
        velocity: v0, shape (d,).
        duration: [s].
        settings: Step and choices.
        scheme: Its name.

    Raises:
        SceneError: Bad input.
        ConvergenceError: A step was not solved, or the motion is not finite.
    """
    u, v = (np.array(value, dtype=float).reshape(-1) for value in (position, velocity))
    steps, h = count_steps(duration, settings.dt, settings.every, settings.impact_law)
    check_start(system, u, v)
    u, v = closed_rows(system, u, v)
    chosen = SCHEMES[scheme]
    step = partial(_step, system, h, chosen.free(system, h), chosen.weight)
    return march(system, (u, v), (steps, h, settings.every), step, {})


def _step(
    system: GeneralizedSystem, h: float, free: FreeStep, weight: float,
    t: float, u: Floats, v: Floats, walls: Walls,
) -> Stepped:  # fmt: skip
    """A step without contact, and the impulses at its end."""
    with np.errstate(over="ignore", invalid="ignore"):  # told of by the rows
        end, fast = free(t, u, v)
        if np.isfinite(end).all() and np.isfinite(fast).all():
            end, fast = closed_rows(system, end, fast)
    count = system.num_constraints
    impulse, before, after = np.zeros((3, count))
    tolerance = ROUNDING * float(np.abs(end).max(initial=0.0))
    finite = bool(np.isfinite(end).all())
    closed = np.flatnonzero(system.gap(t + h, end) <= tolerance) if finite else np.arange(0)
    if len(closed):
        jacobian, rate = system.jacobian(end)[closed], walls[1][closed]
        answers = answers_to(system, end, jacobian)
        coupling = jacobian @ answers
        begin = system.jacobian(u)[closed] @ v - walls[0][closed]
        arriving = jacobian @ fast - rate
        strikes = begin < -ROUNDING * float(np.abs(v).max())
        returned = np.where(strikes, system.restitution[closed] * np.minimum(arriving, 0.0), 0.0)
        pushing = solve_impulses(coupling, arriving + returned)
        fast = fast + answers @ pushing
        back = answers @ np.where(strikes, 0.0, pushing)
        end = closed_rows(system, end + weight * h * (system.moving(end) @ back), fast)[0]
        impulse[closed], before[closed] = pushing, np.where(strikes, arriving, begin)
        after[closed] = jacobian @ fast - rate
    return Stepped(end, fast, impulse, before, after)


def _derivative(function: Callable[[Floats], Floats], at: Floats) -> Floats:
    """Jacobian by central differences, (n, n)."""
    steps = 6e-6 * np.maximum(np.abs(at), float(np.abs(at).max(initial=0.0)) * 1e-3 + 1e-9)
    columns = [(function(at + e) - function(at - e)) / (2.0 * e.max()) for e in np.diag(steps)]
    return np.stack(columns, axis=1)


def _sizes(one: Floats, two: Floats, dofs: int) -> Floats:
    """Size of the places and of the velocities of two states, for each of their entries."""
    parts = np.split(np.maximum(np.abs(one), np.abs(two)), [len(one) - dofs])
    each = [np.full(len(part), part.max(initial=0.0) + np.finfo(float).tiny) for part in parts]
    return np.concatenate(each)
