"""The penalty method: rigid constraints replaced by stiff springs and dampers, a baseline.

    from penalty import PenaltySettings, integrate_penalty

    u'' + 2 alpha sqrt(k) G(u, u') + k (u - P_K u) = M(u)^-1 f(t, u, u')

Source: Paoli and Schatzman, Ill-posedness in vibro-impact and its numerical consequences (2000),
equation (10); projection P_K and damping G are in `penalty_projection`. For one constraint and no
other force the restitution is e = exp(-pi alpha / sqrt(1 - alpha^2)), and 0 from alpha = 1 on. An
acceleration g towards the constraint changes it to e - 2 alpha (1 + e) g / (sqrt(k) v) at the
impact speed v: the error falls as k^-1/2.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from penalty_legs import Legs, Record
from penalty_projection import Projector
from scipy import integrate

from impactfem.errors import SceneError
from impactfem.result.bar_motion import Effort
from impactfem.result.trajectory import Impacts, Trajectory
from impactfem.system.generalized import GeneralizedSystem
from impactfem.system.start_checks import check_start
from impactfem.vibro.vibro_rows import largest_force

Floats = NDArray[np.float64]
Integrator = Literal["radau", "bdf", "lsoda", "dop853", "rk45"]

_SOLVERS: Mapping[str, Any] = {
    "radau": integrate.Radau,
    "bdf": integrate.BDF,
    "lsoda": integrate.LSODA,
    "dop853": integrate.DOP853,
    "rk45": integrate.RK45,
}
_KEPT_RATIOS = 1000
_SETTLED = 10.0  # times of an impact after which contact lasts


@dataclass(frozen=True)
class PenaltySettings:
    """How the penalty method runs.

    Attributes:
        stiffness: k > 0 [1/s^2], of the acceleration: the spring of a mass m has stiffness k m.
        dt: Longest output step [s], the one used divides the duration; also the longest
            step of the integrator.
        damping: alpha >= 0; that of the system's restitution if None.
        integrator: SciPy's. LSODA is the cheapest of the stiff ones here.
        rtol: Relative tolerance; 1e-9 if None.
        atol: Absolute tolerance of velocities, 1e-11 if None; positions have atol / sqrt(k).
    """

    stiffness: float
    dt: float
    damping: float | None = None
    integrator: Integrator = "lsoda"
    rtol: float | None = None
    atol: float | None = None

    def __post_init__(self) -> None:
        """Refuse values that make no sense."""
        for name, value in (("stiffness", self.stiffness), ("dt", self.dt)):
            if not (value > 0.0 and math.isfinite(value)):
                raise SceneError(f"penalty: {name} = {value:g} is not allowed; give a number > 0")
        if self.damping is not None and not (self.damping >= 0.0 and math.isfinite(self.damping)):
            raise SceneError(
                f"penalty: damping = {self.damping:g} is not allowed; give alpha >= 0, or None for "
                "that of the restitution"
            )
        if self.integrator not in _SOLVERS:
            raise SceneError(
                f"penalty: integrator = {self.integrator!r} is unknown; choose one of "
                f"{', '.join(_SOLVERS)}"
            )

    def resolution(self, _: float) -> float:
        """Impacts closer in time than this are one: they last so long [s]."""
        return math.pi / math.sqrt(self.stiffness)


def damping_of(restitution: float) -> float:
    """alpha(e) = -ln e / sqrt(pi^2 + ln^2 e); 1 for e = 0, 0 for e = 1."""
    if restitution == 0.0:
        return 1.0
    loss = -math.log(restitution)
    return loss / math.hypot(math.pi, loss)


def integrate_penalty(
    system: GeneralizedSystem,
    position: ArrayLike,
    velocity: ArrayLike,
    duration: float,
    settings: PenaltySettings,
) -> Trajectory:
    """Integrate the penalised motion.

    The potential energy includes that of the springs, k |u - P_K u|_M^2 / 2. `Trajectory.impacts`
    lists contacts with their start, normal velocities in and out, and impulse; of several
    constraints each has its own, and one that lasts to the end is given as it is then. Details of
    the effort: "restitution" {count, min, mean, max, ratios}, speed out over speed in of each
    finished contact (the first 1000 in ratios); "max_penetration" [m]; "stiffness"; "damping";
    "steps"; "evaluations".

    Args:
        system: The system.
        position: u at t = 0, shape (d,), in K.
        velocity: u' at t = 0, shape (d,).
        duration: End of the motion [s], > 0.
        settings: Stiffness, damping, integrator and tolerances.

    Raises:
        SceneError: The start is not allowed, or constraints of different restitution have no alpha
            given.
        ConvergenceError: The integrator or the projection failed.
    """
    return trajectory(*follow(system, position, velocity, duration, settings))


def follow(
    system: GeneralizedSystem,
    position: ArrayLike,
    velocity: ArrayLike,
    duration: float,
    settings: PenaltySettings,
) -> tuple[Projector, Record]:
    """The penalty forces and the record of the motion, with its contacts; errors as above."""
    projector, record, u, v = begin(system, position, velocity, duration, settings)
    slack = (settings.atol or 1e-11) / math.sqrt(settings.stiffness)
    Legs(projector, record, _solver(system, u, settings), slack).run(u, v, duration)
    return projector, record


def begin(
    system: GeneralizedSystem,
    position: ArrayLike,
    velocity: ArrayLike,
    duration: float,
    settings: PenaltySettings,
) -> tuple[Projector, Record, Floats, Floats]:
    """The penalty forces, the record with its first row, and the checked start u and v.

    Raises:
        SceneError: As of `integrate_penalty`.
    """
    u, v = (np.atleast_1d(np.asarray(x, dtype=float)) for x in (position, velocity))
    check_start(system, u, v)
    if not (duration > 0.0 and math.isfinite(duration)):
        raise SceneError(f"penalty: duration = {duration:g} is not allowed; give a number > 0")
    projector = Projector(system, settings.stiffness, _damping(system, settings))
    rows = math.ceil(duration / settings.dt - 1e-9) + 1
    times = np.linspace(0.0, duration, rows)
    d, count = system.dofs, system.num_constraints
    record = Record(times, np.zeros((rows, d)), np.zeros((rows, d)), np.zeros((rows, count)))
    record.fill(0.0, lambda _: (u, v, np.zeros(count)))
    return projector, record, u, v


def _damping(system: GeneralizedSystem, settings: PenaltySettings) -> float:
    if settings.damping is not None:
        return settings.damping
    values = np.unique(system.restitution)
    if len(values) > 1:
        raise SceneError(
            f"penalty: the constraints have restitutions {values.tolist()}, but one damping acts "
            "along u - P_K u; give damping"
        )
    return damping_of(float(values[0])) if len(values) else 0.0


def _solver(
    system: GeneralizedSystem, u: Floats, settings: PenaltySettings
) -> Any:  # a maker of solvers
    """Makes an integrator of a leg from (fun, t, y, end)."""
    atol = settings.atol or 1e-11
    mass = float(np.trace(system.mass(u))) / system.dofs
    scales = np.concatenate([
        np.full(system.dofs, 1.0 / math.sqrt(settings.stiffness)),
        np.ones(system.dofs),
        np.full(system.num_constraints, mass),
    ])  # fmt: skip
    kind = _SOLVERS[settings.integrator]
    implicit = settings.integrator in {"radau", "bdf"}
    steps = 1e-7 * scales[: 2 * system.dofs] * max(1.0, float(np.abs(u).max()))

    def make(fun: Any, t: float, y: Floats, end: float) -> Any:
        def jacobian(t: float, y: Floats) -> Floats:  # nothing depends on the impulses
            columns = np.zeros((len(y), len(y)))
            for i, step in enumerate(steps):
                ahead = y.copy()
                ahead[i] += step
                columns[:, i] = (fun(t, ahead) - fun(t, y)) / (ahead[i] - y[i])
            return columns

        return kind(
            fun, t, y, end, max_step=settings.dt, rtol=settings.rtol or 1e-9,
            atol=atol * scales, **({"jac": jacobian} if implicit else {}),
        )  # fmt: skip

    return make


def trajectory(projector: Projector, record: Record) -> Trajectory:
    """The motion of a record that is full."""
    system, times = projector.system, record.times
    rows = range(len(times))
    place, speed = record.position, record.velocity
    gap = np.array([system.gap(times[m], place[m]) for m in rows])
    spring = [0.5 * projector.stiffness * projector.project(times[m], place[m]).squared_distance
              for m in rows]  # fmt: skip
    potential = np.array(spring)
    if system.potential is not None:
        potential += np.array([system.potential(times[m], place[m]) for m in rows])
    impulse = np.diff(record.impulse, axis=0, prepend=0.0)
    ratios = [out / -come for _, _, come, out, _ in record.episodes if come < 0.0]
    summary = {"count": len(ratios), "ratios": ratios[:_KEPT_RATIOS]}
    if ratios:
        summary |= {"min": min(ratios), "mean": sum(ratios) / len(ratios), "max": max(ratios)}
    details = {
        "restitution": summary,
        "max_penetration": max(record.penetration, -float(gap.min(initial=0.0))),
        "stiffness": projector.stiffness,
        "damping": projector.damping,
        "steps": record.steps,
        "evaluations": record.evaluations,
    }
    last = system.gap_rate(times[-1], place[-1], speed[-1])
    lasting = [(start, j, come, float(last[j]), float(record.impulse[-1, j]) - earlier)
               for j, (start, come, earlier) in record.open.items()]  # fmt: skip
    contacts = [*record.episodes, *lasting]
    ends = [*record.ends, *(float(times[-1]) for _ in lasting)]
    held = _lasting(projector, times, impulse, contacts, ends)
    force = np.zeros_like(gap)
    force[1:] = held[1:] / np.diff(times)[:, None]
    peak, window = largest_force(times, held, float(times[1] - times[0]) / 4.0)
    return Trajectory(
        times, place, speed, gap, force, impulse,
        np.array([system.kinetic_energy(place[m], speed[m]) for m in rows]), potential,
        peak, window, Impacts.of_rows(sorted(contacts)), Effort(details=details),
    )  # fmt: skip


def _lasting(
    projector: Projector, times: Floats, impulse: Floats,
    contacts: list[tuple[float, int, float, float, float]], ends: list[float],
) -> Floats:  # fmt: skip
    """The impulses of rows within lasting contact [N s], (rows, J).

    A contact lasts after the time of `_SETTLED` impacts, pi / sqrt(k) each; what its rows push then
    is taken from its impulse, of which that of the impact remains.
    """
    settled = _SETTLED * math.pi / math.sqrt(projector.stiffness)
    held = np.zeros_like(impulse)
    for k, ((start, j, come, out, pushed), end) in enumerate(zip(contacts, ends, strict=True)):
        rows = np.flatnonzero((times[:-1] >= start + settled) & (times[1:] <= end)) + 1
        if not len(rows):
            continue
        held[rows, j] = impulse[rows, j]
        force = float(held[rows, j].sum() / (times[rows[-1]] - times[rows[0] - 1]))
        contacts[k] = (start, j, come, out, max(0.0, pushed - force * (end - start)))
    return held
