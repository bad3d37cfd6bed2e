"""Systems of few degrees of freedom with unilateral constraints: M(u) u'' = f + J(u)^T lambda.

The constraints are phi_j(u) - b_j(t) >= 0, with multipliers 0 <= lambda _|_ phi - b >= 0 and
Newton's law of restitution in the metric of M(u). Source: Paoli and Schatzman, Ill-posedness in
vibro-impact and its numerical consequences (2000), equations (1) to (5); there f is a function of
t, u and p = M(u) u', here of t, u and v = u'.
"""

from collections.abc import Callable, Hashable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene.breaks import Break, Kick
from impactfem.scene.signal import Signal
from impactfem.system.derivatives import Derivative, MatrixRate, differentiate, slope
from impactfem.system.generalized_input import (
    Constraints,
    as_function,
    constant_mass,
    entries_of,
    friction_of,
    restitution_of,
    square,
    static_friction_of,
)

Mass = Callable[[Floats], ArrayLike]
Force = Callable[[float, Floats, Floats], ArrayLike]


class Kin(NamedTuple):
    """Systems that are one function of t, u, v and what each alone is given.

    Attributes:
        alike: The same for all of them.
        given: What this one is given at a time, (m,).
        accelerations: Of several without contact by t, u, v, given of each in a row, (k, d).
    """

    alike: Hashable
    given: Callable[[float], Floats]
    accelerations: Callable[[Floats, Floats, Floats, Floats], Floats]


class GeneralizedSystem:
    """A mechanical system in generalised coordinates u with unilateral constraints.

    Args:
        mass: M(u) as a function u (d,) -> (d, d), or a constant: (d, d), (d,) for a diagonal, or
            a number. Symmetric positive definite.
        force: f(t, u, v) -> (d,): applied forces, with the inertial ones that depend on v. If it
            has a method mean(start, end, u, v), steps take this.
        constraints: phi(u) -> (J,), or J functions phi_j(u) -> number; >= 0 where allowed; None:
            there are none.
        restitution: Newton's e in [0, 1]: a number, or one a constraint.
        jacobian: d phi / d u as a function u -> (J, d), or (J, d) itself where constraints are
            flat; None for complex steps, or central differences where phi takes no complex
            numbers.
        motion: b(t), one `Signal` a constraint that moves it to phi(u) - b(t) >= 0; None for none.
        potential: Potential energy (t, u) -> number [J] for the history; None if unknown.
        dofs: Number d of velocities; needed only if no constant mass matrix tells it.
        bilateral: b(u) -> (B,), held at 0, as of joints and closed loops; rows may depend on each
            other. Not by energy_momentum.
        rates: du/dt as a function (u, v), linear in v, where u has other entries than the
            velocities v, as quaternions. Then mass, force and slip are for v, and phi, b, V and
            their derivatives for u. Not by energy_momentum.
        coordinates: Number of entries of u, with rates.
        unit_vectors: With rates, the entries of u of each vector of length 1, as of a quaternion,
            which is scaled to it after each step.
        names: Names of the coordinates, for messages.
        friction: Coulomb's coefficient: a number, or one a constraint.
        static_friction: Coulomb's coefficient of what sticks, >= friction; None: the same.
        tangential_restitution: With friction, the share in [0, 1] of the tangential velocity that
            an impact turns back: a number, or one a constraint; 1: a superball.
        slip: With friction, how what touches slides: a function u -> (J, d) whose rows times u' are
            velocities along the one tangent of each constraint, or (J, 2, d) along two.

    Raises:
        SceneError: A value has the wrong shape, e lies outside [0, 1], or friction is negative.
    """

    def __init__(
        self,
        *,
        mass: Mass | ArrayLike,
        force: Force,
        constraints: Constraints | None = None,
        restitution: float | Sequence[float] = 0.0,
        jacobian: Callable[[Floats], ArrayLike] | ArrayLike | None = None,
        friction: float | Sequence[float] = 0.0,
        static_friction: float | Sequence[float] | None = None,
        tangential_restitution: float | Sequence[float] = 0.0,
        slip: Callable[[Floats], ArrayLike] | None = None,
        motion: Sequence[Signal] | None = None,
        potential: Callable[[float, Floats], float] | None = None,
        dofs: int | None = None,
        names: Sequence[str] | None = None,
        bilateral: Constraints | None = None,
        rates: Callable[[Floats, Floats], ArrayLike] | None = None,
        coordinates: int | None = None,
        unit_vectors: Sequence[Sequence[int]] = (),
    ) -> None:
        self._mass = None if callable(mass) else constant_mass(mass)
        self._mass_function: Mass | None = mass if callable(mass) else None
        if self._mass is None and dofs is None:
            raise SceneError("GeneralizedSystem: mass is a function; give dofs, the length of u")
        self.dofs: int = len(self._mass) if self._mass is not None else int(dofs or 0)
        if (rates is None) != (coordinates is None):
            raise SceneError("GeneralizedSystem: give rates and coordinates, the length of u, both")
        self.coordinates: int = self.dofs if coordinates is None else coordinates
        self.rates = rates
        self.unit_vectors = entries_of(unit_vectors, self.coordinates, moved=rates is not None)
        self.bilateral = None if bilateral is None else as_function(bilateral)
        self.joins = None if self.bilateral is None else Derivative(self.bilateral)
        self._mass_rates = MatrixRate(mass) if callable(mass) else None
        self._force = force
        self.constraint_function = as_function(constraints)
        self._given_jacobian = jacobian if callable(jacobian) else None
        self._rows: Floats | None = None
        if jacobian is not None and not callable(jacobian):
            self._rows = np.atleast_2d(np.asarray(jacobian, dtype=float))
        self.names = tuple(names or (f"u[{i}]" for i in range(self.coordinates)))
        count = len(self._constraints_at(np.zeros(self.coordinates)))
        self.restitution: Floats = restitution_of(restitution, count)
        self.friction: Floats = friction_of(friction, count)
        self.static_friction: Floats = static_friction_of(static_friction, self.friction)
        given = restitution_of(tangential_restitution, count, "tangential_restitution")
        self.tangential_restitution: Floats = given
        self._slip = slip
        if self.static_friction.any() and slip is None:
            raise SceneError("GeneralizedSystem: friction needs slip, a function u -> (J, d)")
        self.motion = tuple(motion) if motion is not None else (Signal(),) * count
        if len(self.motion) != count:
            raise SceneError(
                f"GeneralizedSystem: motion has {len(self.motion)} entries for {count} constraints"
            )
        self.moves = any(not signal.is_zero for signal in self.motion)
        self.potential = potential

    @property
    def applied(self) -> Force:
        """The forces as they were given."""
        return self._force

    @property
    def num_constraints(self) -> int:
        """Number J of constraints."""
        return len(self.restitution)

    @property
    def constant_mass(self) -> Floats | None:
        """M (d, d) if it does not depend on u, else None."""
        return self._mass

    @property
    def is_flat(self) -> bool:
        """Whether only forces change with u: mass and constraints' Jacobian do not."""
        known = self._mass is not None and self._rows is not None
        return known and self.rates is None and self.bilateral is None

    @property
    def kin(self) -> Kin | None:
        """Those with which it may be in flight at once; None: it has none."""
        return None

    def mass(self, u: Floats) -> Floats:
        """Mass matrix M(u), shape (d, d)."""
        if self._mass is not None:
            return self._mass
        given = self._mass_function
        matrix = np.asarray(given(u) if given else None, dtype=float)
        return np.diag(matrix) if matrix.ndim == 1 else np.atleast_2d(matrix)

    def mass_rate(self, u: Floats, v: Floats) -> Floats:
        """Rate of M along a motion, shape (d, d), by complex steps or differences."""
        if self._mass_rates is None:
            return np.zeros((self.dofs, self.dofs))
        return self._mass_rates(u, v)

    def force(self, t: float, u: Floats, v: Floats, span: float = 0.0) -> Floats:
        """Forces f(t, u, v), shape (d,); their means over a span of time around t, if known."""
        mean = getattr(self._force, "mean", None) if span else None
        ends = t - 0.5 * span, t + 0.5 * span
        found = self._force(t, u, v) if mean is None else mean(*ends, u, v)
        return np.atleast_1d(np.asarray(found, dtype=float))

    def gap(self, t: float, u: Floats) -> Floats:
        """phi(u) - b(t), shape (J,)."""
        return self._constraints_at(u) - self.motion_at(t)

    def motion_at(self, t: float) -> Floats:
        """b(t), shape (J,)."""
        if not self.moves:
            return np.zeros(self.num_constraints)
        return np.array([float(signal(t)) for signal in self.motion])

    def motion_rate(self, t: float) -> Floats:
        """Rate of b(t), shape (J,)."""
        if not self.moves:
            return np.zeros(self.num_constraints)
        return np.array([float(signal.rate(t)) for signal in self.motion])

    def motion_curvature(self, t: float) -> Floats:
        """Second derivative of b(t), shape (J,)."""
        if not self.moves:
            return np.zeros(self.num_constraints)
        return np.array([float(signal.curvature(t)) for signal in self.motion])

    def kicks(self, end: float) -> list[Kick]:
        """Where motions change their velocity at once, up to a time [s], in the order of time."""
        found = [
            Kick(at, constraint, before, after)
            for constraint, signal in enumerate(self.motion)
            for at, before, after in signal.kicks(end)
        ]
        return sorted(found, key=lambda kick: kick.at.before)

    def stops(self, end: float) -> list[Break]:
        """Where forces and motions change, up to an end [s], in the order of time, if known."""
        found = {t for s in (*self.motion, *getattr(self, "load", ())) for t in s.stops(end)}
        every = found.union(getattr(self._force, "stops", lambda _: ())(end))
        return sorted(every, key=lambda at: (at.before, at.after))

    def gradient(self, u: Floats) -> Floats:
        """Derivatives d phi / d u, shape (J, coordinates)."""
        if self._rows is not None:
            return self._rows
        if self._given_jacobian is not None:
            return np.atleast_2d(np.asarray(self._given_jacobian(u), dtype=float))
        return differentiate(self.constraint_function, np.asarray(u, dtype=float))

    def jacobian(self, u: Floats) -> Floats:
        """Jacobian of phi for velocities, shape (J, d)."""
        found = self.gradient(u)
        return found if self.rates is None else found @ self.moving(u)

    def coordinate_rates(self, u: Floats, v: Floats) -> Floats:
        """Rates of u, shape (coordinates,)."""
        return v if self.rates is None else np.asarray(self.rates(u, v), dtype=float)

    @property
    def is_joined(self) -> bool:
        """Whether states have to be kept where bilateral rows and unit vectors want them."""
        return self.bilateral is not None or bool(self.unit_vectors)

    def moving(self, u: Floats) -> Floats:
        """Rates of u by unit velocities, shape (coordinates, d)."""
        if self.rates is None:
            return np.eye(self.dofs)
        return np.stack([self.coordinate_rates(u, e) for e in np.eye(self.dofs)], axis=1)

    def joined(self, u: Floats) -> Floats:
        """Jacobian of the bilateral rows for velocities, shape (B, d)."""
        if self.joins is None:
            return np.zeros((0, self.dofs))
        found = self.joins(np.asarray(u, dtype=float))
        return found if self.rates is None else found @ self.moving(u)

    def slip(self, u: Floats) -> Floats:
        """Rows that make velocities along the tangents of u', shape (J, tangents, d).

        Raises:
            SceneError: It has another shape.
        """
        if self._slip is None:
            return np.zeros((self.num_constraints, 1, self.dofs))
        given = np.asarray(self._slip(u), dtype=float)
        rows = np.expand_dims(given, 1) if given.ndim == 2 else given
        fitting = [(self.num_constraints, count, self.dofs) for count in (1, 2)]
        if rows.shape not in fitting:
            raise SceneError(
                f"slip has shape {given.shape}; it must be ({self.num_constraints}, {self.dofs}), "
                f"or {fitting[1]} with two tangents"
            )
        return rows

    def slip_curvature(self, u: Floats, v: Floats) -> Floats:
        """Part (d slip / dt) v of the rates of the tangential velocities, (J, tangents)."""
        return self._turning(self.slip, u, v)

    def gap_rate(self, t: float, u: Floats, v: Floats) -> Floats:
        """Normal velocities J v - b'(t), shape (J,)."""
        return self.jacobian(u) @ v - self.motion_rate(t)

    def gap_curvature(self, t: float, u: Floats, v: Floats) -> Floats:
        """Part (dJ/dt) v - b''(t) of the second rate of the gaps, shape (J,)."""
        turning = 0.0 if self.is_flat else self._turning(self.jacobian, u, v)
        return turning - self.motion_curvature(t)

    def kinetic_energy(self, u: Floats, v: Floats) -> float:
        """Kinetic energy v . M(u) v / 2 [J]."""
        return 0.5 * float(v @ (self.mass(u) @ v))

    def _turning(self, rows: Callable[[Floats], Floats], u: Floats, v: Floats) -> Floats:
        """Rate of rows (..., d) of u along the motion, times v."""
        way = self.coordinate_rates(u, v)
        speed = float(np.abs(way).max(initial=0.0))
        if speed == 0.0:
            return np.zeros(rows(u).shape[:-1])
        size = float(np.abs(u).max(initial=0.0))
        step = 1e-6 * max(1.0, size)
        return speed * slope(lambda s: rows(u + s / speed * way), step, size) @ v

    def _constraints_at(self, u: Floats) -> Floats:
        return np.atleast_1d(np.asarray(self.constraint_function(u), dtype=float))


class LinearSystem(GeneralizedSystem):
    """A system whose free motion is linear: M u'' + C u' + K u = p(t), with flat constraints.

    The constraints are G u + c - b(t) >= 0. Such systems are compiled, and flown exactly where the
    loads p and the motions b are `Signal.is_exact`.

    Args:
        mass: M (d, d), (d,) for a diagonal, or a number.
        stiffness: K (d, d), symmetric or not; None for 0.
        damping: C (d, d); None for 0.
        load: p(t): numbers or `Signal`, shape (d,); None for 0.
        normals: G (J, d); rows need not have length 1.
        offsets: c (J,).
        restitution: As for `GeneralizedSystem`.
        friction: As for `GeneralizedSystem`.
        static_friction: As for `GeneralizedSystem`.
        tangential_restitution: As for `GeneralizedSystem`.
        slip: As for `GeneralizedSystem`.
        motion: As for `GeneralizedSystem`.
        potential: As for `GeneralizedSystem`; that of K and constant loads if None.
        names: Names of the coordinates, for messages.

    Raises:
        SceneError: A value has the wrong shape, or e lies outside [0, 1].
    """

    def __init__(
        self,
        *,
        mass: ArrayLike,
        normals: ArrayLike,
        offsets: ArrayLike,
        stiffness: ArrayLike | None = None,
        damping: ArrayLike | None = None,
        load: Sequence[Signal | float] | None = None,
        restitution: float | Sequence[float] = 0.0,
        friction: float | Sequence[float] = 0.0,
        static_friction: float | Sequence[float] | None = None,
        tangential_restitution: float | Sequence[float] = 0.0,
        slip: Callable[[Floats], ArrayLike] | None = None,
        motion: Sequence[Signal] | None = None,
        potential: Callable[[float, Floats], float] | None = None,
        names: Sequence[str] | None = None,
    ) -> None:
        matrix = constant_mass(mass)
        d = len(matrix)
        self.normals: Floats = np.atleast_2d(np.asarray(normals, dtype=float))
        self.offsets: Floats = np.atleast_1d(np.asarray(offsets, dtype=float))
        self.stiffness = square("stiffness", stiffness, d)
        self.damping = square("damping", damping, d)
        if self.normals.shape != (len(self.offsets), d):
            raise SceneError(
                f"LinearSystem: normals has shape {self.normals.shape}, offsets "
                f"{self.offsets.shape}; give shapes (J, {d}) and (J,)"
            )
        entries = [0.0] * d if load is None else list(load)
        if len(entries) != d:
            raise SceneError(f"LinearSystem: load has {len(entries)} entries; give {d}")
        self.load = tuple(e if isinstance(e, Signal) else Signal(float(e)) for e in entries)
        super().__init__(
            mass=matrix,
            force=self.force,
            constraints=lambda u: self.normals @ u + self.offsets,
            restitution=restitution,
            jacobian=self.normals,
            friction=friction,
            static_friction=static_friction,
            tangential_restitution=tangential_restitution,
            slip=slip,
            motion=motion,
            potential=potential or self._linear_potential,
            names=names,
        )

    @property
    def is_exact(self) -> bool:
        """Whether loads and motions have a form that can be followed exactly."""
        return all(signal.is_exact for signal in (*self.load, *self.motion))

    def load_at(self, t: ArrayLike, until: ArrayLike | None = None) -> Floats:
        """p(t), or its mean until later: shape (d,) for a number t, (times, d) for an array."""
        times, end = np.asarray(t, dtype=float), t if until is None else until
        return np.stack([signal.mean(times, end) + 0.0 * times for signal in self.load], axis=-1)

    def force(self, t: float, u: Floats, v: Floats, span: float = 0.0) -> Floats:
        """Forces f(t, u, v), shape (d,); their means over a span of time around t."""
        load = self.load_at(t - 0.5 * span, t + 0.5 * span)
        return load - self.stiffness @ u - self.damping @ v

    def _linear_potential(self, _: float, u: Floats) -> float:
        constant = np.array([signal.constant for signal in self.load])
        return float(0.5 * u @ (self.stiffness @ u) - constant @ u)


def factor_mass(system: GeneralizedSystem, u: Floats, t: float | None = None) -> Floats:
    """Lower Cholesky factor of M(u), shape (d, d).

    Raises:
        SceneError: M(u) is not symmetric positive definite.
    """
    matrix = system.mass(u)
    when = "" if t is None else f" at t = {t:g}"
    if matrix.shape != (system.dofs, system.dofs) or not np.isfinite(matrix).all():
        raise SceneError(
            f"mass{when} has shape {matrix.shape} with entries {matrix.tolist()}: it must be "
            f"({system.dofs}, {system.dofs}) and finite"
        )
    size = float(np.abs(matrix).max())
    if np.abs(matrix - matrix.T).max() > 1e-10 * size:
        raise SceneError(
            f"mass{when} at u = {u.tolist()} is not symmetric: {matrix.tolist()}; give a symmetric "
            "positive definite matrix"
        )
    from scipy.linalg import LinAlgError, cholesky  # noqa: PLC0415  (pictures need none of it)

    try:
        factor: Floats = cholesky(matrix, lower=True)
    except LinAlgError:
        least = float(np.linalg.eigvalsh(matrix)[0])
        raise SceneError(
            f"mass{when} at u = {u.tolist()} is not positive definite: its least eigenvalue is "
            f"{least:.6g}; give a symmetric positive definite matrix"
        ) from None
    return factor
