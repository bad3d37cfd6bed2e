"""Error against time of computation: the methods for vibro-impact, and SciPy's events beside them.

Run: python benchmarks/vibro_work_precision.py. Writes benchmarks/results/vibro_work_precision.csv
and .md and docs/images/vibro_work_precision.png, in about a minute.

Errors are means of |u - u_exact| over 100 times, as a share of the largest distance from the wall.
"""

import csv
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from penalty import PenaltySettings, integrate_penalty
from scipy.integrate import solve_ivp
from stamp import write_stamp

from impactfem.result.trajectory import Trajectory
from impactfem.scene.signal import Signal
from impactfem.system.generalized import LinearSystem
from impactfem.vibro.event_driven import EventSettings, integrate_events
from impactfem.vibro.position_level import PositionSettings, integrate_positions
from impactfem.vibro.velocity_level import VelocitySettings, integrate_velocities

Floats = NDArray[np.float64]
Point = tuple[float, float, float]
"""Parameter, seconds, error."""

ROOT = Path(__file__).resolve().parents[1]
ROWS = 100
STEPS = [ROWS * 2**k for k in range(1, 13)]
COLORS = {
    "position level": "#0b559f", "velocity level": "#d95f02", "event driven": "#1b7837",
    "penalty": "#7b3294", "scipy events": "0.35",
}  # fmt: skip

PROBLEMS = {
    "oscillator": (
        LinearSystem(
            mass=1.0, damping=1.0, stiffness=1.0, load=[Signal(harmonics=((50.0, 5.0, 0.0),))],
            normals=[[1.0]], offsets=[-0.8], restitution=0.5,
        ), 0.8, 0.1, 0.8,
    ),
    "bouncing ball": (
        LinearSystem(mass=1.0, load=[-9.81], normals=[[1.0]], offsets=[0.0], restitution=0.8),
        1.0, 0.0, 3.0,
    ),
}  # fmt: skip


def bouncing_ball(times: Floats) -> Floats:
    """Height of the ball in closed form."""
    g, e = 9.81, 0.8
    speed = float(np.sqrt(2.0 * g))
    height, start = 1.0 - 0.5 * g * times**2, speed / g
    for _ in range(60):
        speed *= e
        t = times - start
        height = np.where(t >= 0.0, speed * t - 0.5 * g * t * t, height)
        start += 2.0 * speed / g
    return np.asarray(height)


def scipy_events(system: LinearSystem, u: float, v: float, end: float, rtol: float) -> Floats:
    """Positions by SciPy: DOP853 up to each terminal event, restarted after it."""
    e, wall = float(system.restitution[0]), -float(system.offsets[0])
    damping, stiffness = float(system.damping[0, 0]), float(system.stiffness[0, 0])
    load = system.load[0]

    def rhs(t: float, z: Floats) -> list[float]:
        return [z[1], float(load(t)) - damping * z[1] - stiffness * z[0]]

    def hit(_t: float, z: Floats) -> float:
        return float(z[0]) - wall

    hit.terminal, hit.direction = True, -1.0  # type: ignore[attr-defined]
    times = np.linspace(0.0, end, ROWS + 1)
    found = np.empty(ROWS + 1)
    t, state = 0.0, [u, v]
    while t < end:
        run = solve_ivp(
            rhs, (t, end), state, method="DOP853", rtol=rtol, atol=rtol, events=hit,
            dense_output=True, max_step=0.05,
        )  # fmt: skip
        inside = (times >= t) & (times <= run.t[-1])
        found[inside] = run.sol(times[inside])[0]
        t, state = float(run.t[-1]), [wall, -e * float(run.y[1, -1])]
    return found


def methods(problem: str) -> dict[str, list[tuple[float, Callable[[], Any]]]]:
    """Runs of each method, with their parameters."""
    system, u, v, end = PROBLEMS[problem]
    start: tuple[Any, ...] = (system, [u], [v], end)

    def march(scheme: Any, choice: Any, steps: int) -> tuple[float, Callable[[], Any]]:
        return end / steps, lambda: scheme(*start, choice(end / steps, every=steps // ROWS))

    def penalty(k: float) -> Trajectory:
        return integrate_penalty(*start, PenaltySettings(k, end / ROWS))

    return {
        "position level": [march(integrate_positions, PositionSettings, n) for n in STEPS],
        "velocity level": [march(integrate_velocities, VelocitySettings, n) for n in STEPS],
        "event driven": [(0.0, lambda: integrate_events(*start, EventSettings(rows=ROWS)))],
        "penalty": [(k, lambda k=k: penalty(k)) for k in (1e4, 1e6, 1e8, 1e10)],  # type: ignore[misc]
        "scipy events": [
            (r, lambda r=r: scipy_events(system, u, v, end, r))  # type: ignore[misc]
            for r in (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
        ],
    }


def measure(problem: str) -> dict[str, list[Point]]:
    """Time and error of every run."""
    system, u, v, end = PROBLEMS[problem]
    times = np.linspace(0.0, end, ROWS + 1)
    if problem == "bouncing ball":
        exact = bouncing_ball(times)
    else:  # no closed form: the outside reference with tight tolerances
        exact = scipy_events(system, u, v, end, 2.3e-14)
    size = float(np.abs(exact + system.offsets[0]).max())
    found: dict[str, list[Point]] = {}
    for name, runs in methods(problem).items():
        runs[0][1]()  # compile
        found[name] = []
        for parameter, run in runs:
            begin = time.perf_counter()
            answer = run()
            seconds = time.perf_counter() - begin
            position = answer if isinstance(answer, np.ndarray) else answer.position[:, 0]
            error = float(np.abs(position - exact).mean()) / size
            found[name].append((parameter, seconds, max(error, 1e-17)))
    return found


def order(points: list[Point]) -> float:
    """Exponent of the error in the parameter, by least squares over the finer two thirds."""
    finer = np.log(np.array(points)[len(points) // 3 :])
    return float(np.polyfit(finer[:, 0], finer[:, 2], 1)[0])


def stopping_rates() -> list[tuple[str, float, float]]:
    """(method, h, error) of the time from which the ball keeps contact with the floor."""
    system = PROBLEMS["bouncing ball"][0]
    stop = float(np.sqrt(2.0 / 9.81) * 1.8 / 0.2)
    rows = []
    for h in (4e-3, 1e-3, 2.5e-4, 6.25e-5, 1.5625e-5):
        position = integrate_positions(system, [1.0], [0.0], 5.0, PositionSettings(h, every=9999))
        velocity = integrate_velocities(system, [1.0], [0.0], 5.0, VelocitySettings(h, every=9999))
        for name, found in (("position level", position), ("velocity level", velocity)):
            assert found.impacts is not None  # noqa: S101  # these schemes list them
            rows.append((name, h, float(found.impacts.time[-1]) - stop))
    return rows


def draw(found: dict[str, dict[str, list[Point]]], path: Path) -> None:
    """Error against time."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    for ax, (problem, runs) in zip(figure.subplots(1, 2), found.items(), strict=True):
        for name, points in runs.items():
            _, seconds, errors = np.array(points).T
            ax.loglog(seconds, errors, "o-", ms=4, lw=1.2, color=COLORS[name], label=name)
        ax.set_title(problem, fontsize=11)
        ax.set_xlabel("time of computation [s]")
        ax.grid(visible=True, color="0.9")
    figure.axes[0].set_ylabel("mean error of u, relative")
    figure.axes[1].legend(fontsize=9)
    figure.savefig(path, dpi=130)


def main() -> None:
    """Measure, write tables and picture."""
    found = {problem: measure(problem) for problem in PROBLEMS}
    results = ROOT / "benchmarks" / "results"
    with (results / "vibro_work_precision.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["problem", "method", "h, k or rtol", "seconds", "error"])
        for problem, runs in found.items():
            for name, points in runs.items():
                writer.writerows((problem, name, *point) for point in points)
    lines = [
        "| problem | method | order | best error | seconds |",
        "| --- | --- | --- | --- | --- |",
    ]
    for problem, runs in found.items():
        for name, points in runs.items():
            rate = f"{order(points):.2f}" if len(points) > 1 else ""
            _, seconds, error = min(points, key=lambda point: point[2])
            lines.append(f"| {problem} | {name} | {rate} | {error:.1e} | {seconds:.4f} |")
    lines += [
        "",
        "Order is in h, for the penalty in k, for SciPy in rtol. Stopping time of the ball:",
    ]
    lines += ["", "| method | h [s] | error [s] |", "| --- | --- | --- |"]
    lines += [f"| {name} | {h:g} | {error:.2e} |" for name, h, error in stopping_rates()]
    (results / "vibro_work_precision.md").write_text("\n".join(lines) + "\n")
    write_stamp("vibro_work_precision")
    print("\n".join(lines))
    draw(found, ROOT / "docs" / "images" / "vibro_work_precision.png")


if __name__ == "__main__":
    main()
