"""Order, stability and cost of textbook schemes: a pendulum, a double pendulum, stiff springs."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError, OutputError, SceneError
from impactfem.report.sheet import Sheet
from impactfem.result.trajectory import Trajectory
from impactfem.studies.study import conditions, markdown_table
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.integrating import integrate
from impactfem.vibro.textbook import SCHEMES

GRAVITY = 9.81
STEPS = (40, 80, 160, 320)
"""In a period of the pendulum."""

HORIZON = 100
"""Periods over which its energy is watched, in steps of the first length."""

DOUBLE_STEPS = (2e-3, 1e-3, 5e-4)
SPRINGS = ((1e4, 0.0, 0.01), (1e6, 10.0, 0.01), (1.0, 10.0, 0.1))
"""Stiffness [N/m], damping [N s/m] and step [s] of a unit mass."""

_PENDULUM = (
    "Pendulum from 1 rad: error of the state after a quarter of its period T [rad]; largest change "
    f"of its energy in {HORIZON} T in steps of T/{STEPS[0]}, as a share of m g L:"
)
_GROWTH = (
    "A spring and a damper, x'' = -k x - c x': factor by which a step multiplies what grows most "
    "(stable up to 1):"
)
_ROUNDING = 1e-11  # errors of the pendulum from which on orders are told


def period(largest: float, length: float = 1.0) -> float:
    """Period of a pendulum from rest at an angle [s], by the arithmetic-geometric mean."""
    a, b = 1.0, float(np.cos(0.5 * largest))
    while abs(a - b) > 1e-15:
        a, b = 0.5 * (a + b), sqrt(a * b)
    return 2.0 * pi * sqrt(length / GRAVITY) / a


def pendulum() -> GeneralizedSystem:
    """A pendulum of 1 kg and 1 m; u is its angle from the vertical."""
    return GeneralizedSystem(
        mass=1.0,
        force=lambda _, u, v: -GRAVITY * np.sin(u) + 0.0 * v,
        potential=lambda _, u: -GRAVITY * float(np.cos(u[0])),
    )


def double_pendulum() -> GeneralizedSystem:
    """Two of them in a chain; u are both angles from the vertical."""

    def mass(u: Floats) -> Floats:
        across = np.cos(u[0] - u[1])
        return np.array([[2.0, across], [across, 1.0]])

    def force(_: float, u: Floats, v: Floats) -> Floats:
        turn = np.sin(u[0] - u[1]) * np.array([-(v[1] ** 2), v[0] ** 2])
        return np.asarray(turn - GRAVITY * np.array([2.0, 1.0]) * np.sin(u))

    def potential(_: float, u: Floats) -> float:
        return float(-GRAVITY * np.array([2.0, 1.0]) @ np.cos(u))

    return GeneralizedSystem(mass=mass, force=force, potential=potential, dofs=2)


@cache
def double_end() -> Floats:
    """Angles of the double pendulum from (2, 1) at rest after 2 s, by DOP853."""
    motion = integrate(double_pendulum(), [2.0, 1.0], [0.0, 0.0], 2.0, rtol=1e-13, atol=1e-13)
    return np.array(motion.position[-1])


def growth(method: str, stiffness: float, damping: float, dt: float) -> float:
    """Spectral radius of a step on x'' = -k x - c x'."""
    spring = LinearSystem(
        mass=1.0, stiffness=stiffness, damping=damping, normals=np.zeros((0, 1)), offsets=[]
    )
    ends = [integrate(spring, [x], [v], dt, method=method, dt=dt) for x, v in np.eye(2)]
    matrix = np.array([[m.position[-1, 0], m.velocity[-1, 0]] for m in ends])
    return float(np.abs(np.linalg.eigvals(matrix)).max())


@dataclass(frozen=True)
class SchemeRow:
    """What one scheme does.

    Attributes:
        method: Its name.
        errors: Of the pendulum's state after a quarter of its period, for each of `STEPS` [rad].
        drift: Largest change of its energy over `HORIZON` periods, as a share of m g L; infinite
            if the motion broke down.
        double: Errors of the double pendulum's angles after 2 s, for each of `DOUBLE_STEPS` [rad].
        growth: Spectral radius of a step on each of `SPRINGS`.
        step: Time of a step of the pendulum [s].
    """

    method: str
    errors: tuple[float, ...]
    drift: float
    double: tuple[float, ...]
    growth: tuple[float, ...]
    step: float

    @property
    def order(self) -> float | None:
        """Observed order from the pendulum's errors; None where these are rounding."""
        pairs = [(n, e) for n, e in zip(STEPS, self.errors, strict=True) if e > _ROUNDING]
        if len(pairs) < 2:
            return None
        sizes, errors = np.log(np.array(pairs[-2:])).T
        return float(-np.polyfit(sizes, errors, 1)[0])


@dataclass(frozen=True)
class SchemeStudy:
    """Order, stability and cost of schemes."""

    rows: tuple[SchemeRow, ...]

    def markdown(self) -> str:
        """Both tables as Markdown."""
        head = ["scheme", *(f"T/{n}" for n in STEPS), "order", "energy", "step [us]"]
        lines = [
            [
                row.method, *(f"{e:.1e}" for e in row.errors),
                "-" if row.order is None else f"{row.order:.2f}", f"{row.drift:.1e}",
                f"{1e6 * row.step:.0f}",
            ]
            for row in self.rows
        ]  # fmt: skip
        double = ["scheme", *(f"h = {h:g}" for h in DOUBLE_STEPS)]
        others = [[row.method, *(f"{e:.1e}" for e in row.double)] for row in self.rows]
        stiff = ["scheme", *(f"k = {k:g}, c = {c:g}, h = {h:g}" for k, c, h in SPRINGS)]
        radii = [[row.method, *(f"{g:.7g}" for g in row.growth)] for row in self.rows]
        return "\n".join([
            f"{_PENDULUM}\n",
            markdown_table(head, lines),
            "\nDouble pendulum from (2, 1): error of the angles after 2 s [rad]:\n",
            markdown_table(double, others),
            f"\n{_GROWTH}\n",
            markdown_table(stiff, radii),
            f"\n{conditions()}",
        ])  # fmt: skip

    def figure(self) -> Figure:
        """Errors against steps, and the factor of a step against h omega."""
        figure = Sheet(10.5, 4.6)
        left, right = figure.subplots(1, 2)
        reach = np.geomspace(0.1, 10.0, 25)
        for k, row in enumerate(self.rows):
            style = {"color": f"C{k}", "label": row.method}
            left.loglog(STEPS, np.maximum(row.errors, 1e-12), marker="o", markersize=4, **style)
            right.loglog(reach, [growth(row.method, 1.0, 0.0, h) for h in reach], **style)
        left.set_xlabel("steps in a period")
        left.set_ylabel("error of the state after a quarter of a period [rad]")
        right.set_xlabel(r"$h\,\omega$ of an undamped spring")
        right.set_ylabel("factor of amplitudes in a step")
        right.set_ylim(0.04, 30.0)
        for ax in (left, right):
            ax.grid(visible=True, which="major", linewidth=0.3)
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
        return figure

    def save(self, folder: str | Path, name: str = "schemes") -> list[Path]:
        """Write NAME.md and NAME.png.

        Raises:
            OutputError: The folder cannot be written.
        """
        folder = Path(folder)
        paths = [folder / f"{name}.{kind}" for kind in ("md", "png")]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            paths[0].write_text(self.markdown() + "\n", encoding="utf-8")
            self.figure().savefig(paths[1], dpi=100)
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error
        return paths


def scheme_study(names: Sequence[str] | None = None) -> SchemeStudy:
    """Measure schemes on the pendulum, the double pendulum and stiff springs.

    Args:
        names: Which; all if None.

    Raises:
        SceneError: A name is none of a scheme.
    """
    for name in names or ():
        if name not in SCHEMES:
            raise SceneError(f'method = "{name}" is no textbook scheme; give {", ".join(SCHEMES)}')
    return SchemeStudy(tuple(map(_measured, names or SCHEMES)))


def _missed(motion: Trajectory) -> float:
    """Error after a quarter of a period, where it hangs: velocities by sqrt(g / L) [rad]."""
    speed = motion.velocity[-1, 0] / sqrt(GRAVITY)
    return float(np.hypot(motion.position[-1, 0], speed + 2.0 * np.sin(0.5)))


def _measured(name: str) -> SchemeRow:
    whole, start = period(1.0), ([1.0], [0.0])
    system = pendulum()

    def run(steps: int, periods: float) -> Trajectory:
        given: dict[str, Any] = {"method": name, "dt": whole / steps}
        return integrate(system, *start, periods * whole, **given)

    errors = tuple(_missed(run(n, 0.25)) for n in STEPS)
    begin = time.perf_counter()
    try:
        total = run(STEPS[0], HORIZON).total
        drift = float(np.abs(total - total[0]).max()) / GRAVITY
    except ConvergenceError:
        drift = float("inf")
    step = (time.perf_counter() - begin) / (STEPS[0] * HORIZON)
    twice = double_pendulum()
    ends = (
        integrate(twice, [2.0, 1.0], [0.0, 0.0], 2.0, method=name, dt=h, every=10**6).position[-1]
        for h in DOUBLE_STEPS
    )
    double = tuple(float(np.abs(end - double_end()).max()) for end in ends)
    return SchemeRow(name, errors, drift, double, tuple(growth(name, *s) for s in SPRINGS), step)
