"""Steps of solids that no contact reaches: what they need follows from how the bodies vibrate.

A held body that nothing drives after t = 0 vibrates about its equilibrium by what it begins with:
d, its way from there, and a velocity v. Lanczos' iterations with K^-1 M on these give frequencies
and their shares of the motion, Gauss's rule for the sum over all modes (G. H. Golub, G. Meurant,
Matrices, Moments and Quadrature (2010), chapter 6). The midpoint rule turns a mode of frequency w
by 2 atan(w dt / 2) in a step instead of w dt, which tells the error of any step.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import eigh_tridiagonal

from impactfem.arrays import Floats
from impactfem.fem import MPI
from impactfem.findings import Finding
from impactfem.planning.solid_choices import COURANT, Steps, fitting_solver
from impactfem.scene import Scene
from impactfem.system.elastic import ElasticSystem
from impactfem.system.linear import LinearSolver
from impactfem.system.rigid_modes import RigidModes

_LEAST = 200  # layers
_WORTH = 3.0  # times fewer layers
_ACCURACY = 1e-3, 0.1  # of the displacement, and in the norm of the energy
_MODES = 40
_KNOWN = 1e-9  # of the first answer, below which nothing more is found
_FURTHEST = 4.0  # times the largest initial deflection, which waves may add up to
_LEVELS = 4096  # at which loads are looked at
_PLACES = 8


@dataclass(frozen=True)
class _Motion:
    """How a body moves about its equilibrium.

    Attributes:
        periods: 1 / w of its vibrations [s], (modes,).
        displacement: Their shares of the squared displacement by mass [kg m^2], (modes,).
        energy: Their energies, doubled [J], (modes,).
        way: By how much nodes may leave the places that they are given at t = 0 [m].
    """

    periods: Floats
    displacement: Floats
    energy: Floats
    way: float

    def errors(self, dt: float, duration: float) -> Floats:
        """Of the displacement and in the norm of the energy, relative, (2,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            half = 0.5 * dt / self.periods
            late = 1.0 - np.arctan(half) / half
            shifted = duration / self.periods * late
        turned = np.minimum(2.0, shifted) ** 2
        whole = self.displacement.sum(), self.energy.sum()
        found = np.array([turned @ self.displacement, turned @ self.energy])
        shares: Floats = np.divide(found, whole, out=np.zeros(2), where=np.array(whole) > 0.0)
        return np.sqrt(shares)


def follow_vibration(
    scene: Scene, model: Any, steps: Steps, reasons: dict[str, str]
) -> tuple[Steps, bool]:
    """Longer steps where nothing is struck and nothing drives; whether that is so (collective).

    Args:
        scene: The scene.
        model: Its `impactfem.models.solids.SolidsModel`.
        steps: By waves; those of explicit methods, and those that are asked for, stay.
        reasons: Gets the reason.
    """
    duration, layers, solve = scene.duration, steps.layers or 1, scene.solve
    fixed = solve.dt is not None or solve.courant is not None or steps.dt is None
    fixed = fixed or any(solid.relaxing for solid in scene.solids)
    other = model.few or scene.couplings or scene.iterated or scene.ends
    if fixed or other or layers <= _WORTH * _LEAST or not _is_steady(scene, model, steps):
        return steps, False
    if scene.starts_at_rest and all(_rests(scene, part.system) for part in model.parts):
        reasons["dt"] = (
            f"1/{_LEAST} of the duration: bodies begin at rest and nothing changes in time"
        )
        return steps.of_layers(duration, _LEAST), False
    if model.pairs or any(RigidModes.of(part.system).count for part in model.parts):
        return steps, False
    motions = [_motion(scene, part.system) for part in model.parts]
    for part, motion in zip(model.parts, motions, strict=True):
        if part.contact is not None and part.contact.gap.min(initial=math.inf) <= motion.way:
            return steps, False
    count = _LEAST
    while count * _WORTH <= layers:
        dt = duration / count
        worst = np.array([motion.errors(dt, duration) for motion in motions]).max(axis=0)
        if (worst <= _ACCURACY).all():
            reasons["dt"] = _reason(motions, dt, worst, layers)
            reasons.pop("offer dt", None)
            return steps.of_layers(duration, count), True
        count = math.ceil(1.1 * count)
    return steps, False


def struck_after_all(force: float) -> Finding:
    """Contact where steps were chosen for none, with its largest force [N]."""
    text = f"steps were chosen for bodies that nothing strikes, but there was contact ({force:.3g}"
    return Finding(
        "contact_unresolved", "fault", f"{text} N)", remedy=f"give solve.courant = {COURANT:g}"
    )


def _reason(motions: list[_Motion], dt: float, worst: Floats, layers: int) -> str:
    period = 2.0 * math.pi * max(float(motion.periods.max()) for motion in motions)
    share = max(
        float(motion.energy[motion.periods < dt].sum()) / max(float(motion.energy.sum()), 1e-300)
        for motion in motions
    )
    return (
        f"1/{period / dt:.3g} of the slowest vibration, of {period:.3g} s: nothing is struck, and "
        f"what vibrates is known. Errors of {worst[0]:.1g} of the displacement and {worst[1]:.1g} "
        f"of speeds and stresses are foreseen; vibrations faster than {0.5 / math.pi / dt:.3g} Hz, "
        f"with {share:.1g} of the energy, are not followed: solve.courant = {COURANT:g} follows "
        f"all waves, in {layers} time steps"
    )


def _is_steady(scene: Scene, model: Any, steps: Steps) -> bool:
    """Whether nothing changes after t = 0, as the levels of short steps see it."""
    if not scene.vector_gravity.is_constant:
        return False
    if any(part.contact is not None and any(o.moves for o in part.obstacles)
           for part in model.parts):  # fmt: skip
        return False
    count = min(_LEVELS, steps.layers or 1)
    times = np.linspace(scene.duration / count, scene.duration, count)
    for part in model.parts:
        solid, system = part.solid, part.system
        if any(load.follows for load in solid.pressures) or system.supports.formulas:
            return False
        formulas = [formula for load in solid.tractions for formula in load.acting]
        formulas += [load.acting for load in solid.pressures]
        low, high = part.outside.points.min(axis=0), part.outside.points.max(axis=0)
        places = np.random.default_rng(0).uniform(low, high, (_PLACES, system.dim))
        for formula in formulas:
            for place in places if "t" in formula.used else ():
                named = dict(zip("xyz", place, strict=False))
                own = {name: value for name, value in named.items() if name in formula.used}
                values = formula(t=times, **own)
                if not (np.isfinite(values).all() and np.ptp(values) == 0.0):
                    return False
    return True


def _rests(scene: Scene, system: ElasticSystem) -> bool:
    """Whether a body in equilibrium stays there (collective)."""
    change = system.load(scene.duration) - system.load(0.0)
    still = not (system.velocity.any() or change.any())
    return bool(system.comm.allreduce(still, op=MPI.LAND))


def _motion(scene: Scene, system: ElasticSystem) -> _Motion:
    """What a held body does about its equilibrium (collective)."""
    comm, kind = system.comm, fitting_solver("none", system.num_dofs, system.dim)
    solver = LinearSolver(system.stiffness.copy(), kind, system.stiffness.getNearNullSpace())
    source, image = system.stiffness.createVecs()

    def times_mass(values: Floats) -> Floats:
        source.setArray(values)
        system.mass.mult(source, image)
        return np.array(image.getArray())

    def answer(forces: Floats) -> Floats:
        source.setArray(forces)
        image.set(0.0)
        solver.solve(source, image)
        return np.array(image.getArray())

    def largest(values: Floats) -> float:
        return float(comm.allreduce(float(np.abs(values).max(initial=0.0)), op=MPI.MAX))

    first, last = system.load(0.0), system.load(scene.duration)
    later = answer(last)
    start = answer(first) if scene.starts_at_rest else system.displacement
    squares, shares = _spectrum(comm, start - later, answer, times_mass)
    fast, given = _spectrum(comm, system.velocity, answer, times_mass)
    solver.destroy()
    source.destroy()
    image.destroy()
    inverse = np.divide(1.0, squares, out=np.zeros_like(squares), where=squares > 0.0)
    periods = np.sqrt(np.concatenate([squares, fast]))
    slowest = float(periods.max(initial=0.0))
    moved = largest(start - later) + slowest * largest(system.velocity)
    return _Motion(
        periods, np.concatenate([shares, given * fast]), np.concatenate([shares * inverse, given]),
        math.sqrt(system.dim) * (largest(later - system.displacement) + _FURTHEST * moved),
    )  # fmt: skip


def _spectrum(
    comm: Any, start: Floats, answer: Callable[[Floats], Floats],
    times_mass: Callable[[Floats], Floats],
) -> tuple[Floats, Floats]:  # fmt: skip
    """1 / w^2 of the vibrations that make up a field, and their shares of its square by mass."""

    def product(one: Floats, two: Floats) -> Any:
        return comm.allreduce(one @ two, op=MPI.SUM)

    heavy = times_mass(start)
    whole = float(product(start, heavy))
    if not whole > 0.0:
        return np.zeros(0), np.zeros(0)
    fields, weighed = [start / math.sqrt(whole)], [heavy / math.sqrt(whole)]
    diagonal: list[float] = []
    beside: list[float] = []
    while True:
        ahead = answer(weighed[-1])
        diagonal.append(float(product(ahead, weighed[-1])))
        for _ in range(2):  # rounding would bring back what is known
            ahead = ahead - product(np.array(weighed), ahead) @ np.array(fields)
        heavy = times_mass(ahead)
        length = math.sqrt(max(0.0, float(product(ahead, heavy))))
        if len(diagonal) == _MODES or length <= _KNOWN * diagonal[0]:
            break
        beside.append(length)
        fields.append(ahead / length)
        weighed.append(heavy / length)
    squares, vectors = eigh_tridiagonal(np.array(diagonal), np.array(beside))
    return np.maximum(squares, 0.0), whole * vectors[0] ** 2
