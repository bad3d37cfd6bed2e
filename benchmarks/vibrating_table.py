"""Ball on a vibrating table: bifurcations, Lyapunov exponent, statistics of two methods.

Run: python benchmarks/vibrating_table.py. Writes benchmarks/results/vibrating_table.csv and .md and
docs/images/vibrating_table.png and vibrating_table_chaos.png, in about two minutes.

In units with w = g = 1 the table moves as G sin t, G = A w^2 / g, and gamma = 2 (1 + e) G. One
impact takes (t, u), u the absolute speed after it, to the next by the flight (u, -1) and
u_new = -e (u - tau) + (1 + e) G cos(t + tau): the exact map. The high-bounce map takes tau = 2 u.
"""

import csv
import math
import time
from collections.abc import Callable
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from stamp import write_stamp

from impactfem.compiled import compiled
from impactfem.result.trajectory import Trajectory
from impactfem.scene.signal import Signal
from impactfem.system.generalized import LinearSystem
from impactfem.vibro.event_driven import EventSettings, integrate_events
from impactfem.vibro.position_level import PositionSettings, integrate_positions

RESTITUTION = 0.8
CHAOTIC = 4.51  # gamma of the statistics: no chattering there
MEMBERS = 40  # motions of a sample
TURN = 2.0 * math.pi
ROOT = Path(__file__).resolve().parents[1]

Floats = NDArray[np.float64]
Branch = tuple[float, Floats, float]
"""gamma, phases of impact, exponent or nan."""

BLUE, ORANGE, GREY = "#0b559f", "#d95f02", "0.45"


def amplitude(gamma: float, e: float = RESTITUTION) -> float:
    """G of gamma."""
    return gamma / (2.0 * (1.0 + e))


def existence(e: float = RESTITUTION) -> float:
    """From this gamma on period 1 exists, in both maps: cos t = 2 pi (1 - e) / gamma <= 1."""
    return TURN * (1.0 - e)


def flip_high_bounce(e: float = RESTITUTION) -> float:
    """Where period 1 flips in the high-bounce map: determinant e, trace 1 + e - gamma sin t."""
    return math.hypot(TURN * (1.0 - e), 2.0 * (1.0 + e))


def flip_exact(e: float = RESTITUTION) -> float:
    """The same in the exact map: determinant e^2, trace 1 + e^2 - (1 + e)^2 G sin t."""
    return math.hypot(TURN * (1.0 - e), 4.0 * (1.0 + e * e) / (1.0 + e))


def table(gamma: float, phase: float = 0.0, e: float = RESTITUTION) -> LinearSystem:
    """The ball as a system whose time 0 is the time ``phase`` of the table."""
    size = amplitude(gamma, e)
    motion = Signal(harmonics=((1.0, size * math.sin(phase), size * math.cos(phase)),))
    return LinearSystem(
        mass=1.0, load=[-1.0], normals=[[1.0]], offsets=[0.0], restitution=e, motion=[motion]
    )


def launch(
    gamma: float,
    phase: float,
    speed: float,
    turns: float,
    method: str = "events",
    dt: float = TURN / 2000,
    e: float = RESTITUTION,
) -> Trajectory:
    """Impacts of the motion that leaves the table at (phase, speed)."""
    system = table(gamma, phase, e)
    start, duration = [amplitude(gamma, e) * math.sin(phase)], TURN * turns
    if method == "events":
        found = integrate_events(system, start, [speed], duration, EventSettings(rows=1))
    else:
        settings = PositionSettings(dt, every=10**9)
        found = integrate_positions(system, start, [speed], duration, settings)
    return found


def orbit(
    gamma: float, found: Trajectory, phase: float, e: float = RESTITUTION
) -> tuple[Floats, Floats]:
    """Times (of the table) and absolute speeds after the impacts of a motion."""
    times = found.impacts.time + phase
    return times, found.impacts.after + amplitude(gamma, e) * np.cos(times)


def jacobians(gamma: float, times: Floats, speeds: Floats, e: float = RESTITUTION) -> Floats:
    """Jacobians of the exact map at impacts 0 .. n - 2 of an orbit, shape (n - 1, 2, 2).

    With tau the flight and r = u - tau - G cos t_new < 0 the relative speed of the next impact,
    dtau = (G (cos t_new - cos t) dt - tau du) / r.
    """
    size = amplitude(gamma, e)
    tau, u, cos, sin = np.diff(times), speeds[:-1], np.cos(times), np.sin(times)
    r = u - tau - size * cos[1:]
    by_time, by_speed = size * (cos[1:] - cos[:-1]) / r, -tau / r
    pull = e - (1.0 + e) * size * sin[1:]
    return np.array(
        [
            [1.0 + by_time, by_speed],
            [e * by_time - (1.0 + e) * size * sin[1:] * (1.0 + by_time), -e + pull * by_speed],
        ]
    ).transpose(2, 0, 1)


@compiled
def growth(matrices: Floats) -> Floats:
    """Logarithms of the growth of one tangent vector at each step, shape (n,)."""
    x, y = 1.0, 0.3
    logs = np.empty(len(matrices))
    for i in range(len(matrices)):
        a = matrices[i, 0, 0] * x + matrices[i, 0, 1] * y
        b = matrices[i, 1, 0] * x + matrices[i, 1, 1] * y
        size = math.hypot(a, b)
        logs[i], x, y = math.log(size), a / size, b / size
    return logs


@compiled
def fly(size: float, e: float, t: float, u: float) -> tuple[float, float]:
    """The exact map by itself: first root of the height above the table by steps and bisection."""
    low, step = 0.0, 0.02
    base = size * math.sin(t)
    high = step
    if u - size * math.cos(t) > 1e-9:  # leave the root at tau = 0
        low = 1e-9
    while base + u * high - 0.5 * high * high - size * math.sin(t + high) > 0.0:
        low, high = high, high + step
    for _ in range(60):
        middle = 0.5 * (low + high)
        if base + u * middle - 0.5 * middle * middle - size * math.sin(t + middle) > 0.0:
            low = middle
        else:
            high = middle
    tau = 0.5 * (low + high)
    return t + tau, -e * (u - tau) + (1.0 + e) * size * math.cos(t + tau)


@compiled
def separation(size: float, e: float, t: float, u: float, impacts: int, apart: float) -> float:
    """Largest Lyapunov exponent of the map, from two orbits brought together at each impact."""
    other_t, other_u, total = t + apart, u, 0.0
    for i in range(impacts + 100):
        t, u = fly(size, e, t, u)
        other_t, other_u = fly(size, e, other_t, other_u)
        distance = math.hypot(other_t - t, other_u - u)
        if i >= 100:
            total += math.log(distance / apart)
        t, other_t = t % 6.283185307179586, other_t - 6.283185307179586 * (t // 6.283185307179586)
        other_t = t + (other_t - t) * apart / distance
        other_u = u + (other_u - u) * apart / distance
    return total / impacts


def batch_error(values: Floats, batches: int = 50) -> float:
    """Standard error of the mean of a correlated series, from batch means."""
    size = len(values) // batches
    means = values[: size * batches].reshape(batches, size).mean(axis=1)
    return float(means.std(ddof=1) / math.sqrt(batches))


def stays(gamma: float, phase: float = 0.02, impacts: int = 3000) -> bool:
    """Whether the ball stays in step with the table from near the fold."""
    times, _ = orbit(gamma, launch(gamma, phase, math.pi, impacts), phase)
    steps = times - phase - TURN * np.arange(1, len(times) + 1)
    return len(times) >= impacts - 1 and bool(np.abs(steps).max() < 0.3)


def returns(gamma: float, impacts: int = 400, e: float = RESTITUTION) -> bool:
    """Whether a small disturbance of the period-1 motion dies out."""
    phase = math.acos(existence(e) / gamma)
    times, _ = orbit(gamma, launch(gamma, phase, math.pi + 1e-6, impacts, e=e), phase)
    off = np.abs(times - phase - TURN * np.arange(1, len(times) + 1))
    half = len(off) // 2
    early, late = off[half - 8 : half].max(), off[-8:].max()
    return bool(late < max(early, 1e-10))


def bisect(low: float, high: float, test: Callable[[float], bool], width: float = 1e-5) -> float:
    """Point at which the answer of the test changes."""
    first = test(low)
    while high - low > width:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if test(middle) == first else (low, middle)
    return 0.5 * (low + high)


def branch(gamma: float) -> Branch:
    """Phases and exponent of one gamma: (gamma, phases, exponent or nan if the ball sticks)."""
    phase = math.acos(min(1.0, existence() / gamma))
    found = launch(gamma, phase, math.pi + 1e-3, 700)
    times, speeds = orbit(gamma, found, phase)
    keep = (times > 400 * TURN) & (found.impacts.before < -1e-3)
    exponent = math.nan
    if not found.effort.details["sticking"] and len(times) > 600:
        exponent = float(growth(jacobians(gamma, times[200:], speeds[200:])).mean())
    return gamma, times[keep][-200:] % TURN, exponent


def bifurcations(values: int = 400, processes: int = 2) -> tuple[list[Branch], float]:
    """All branches, and the seconds they took."""
    begin = time.perf_counter()
    with Pool(processes) as pool:
        found = pool.map(branch, np.linspace(1.2, 6.5, values), chunksize=20)
    return found, time.perf_counter() - begin


def histogram(phases: Floats, bins: int = 100) -> Floats:
    """Share of impacts in each bin of the phase."""
    counts, _ = np.histogram(np.asarray(phases) % TURN, bins=bins, range=(0.0, TURN))
    return counts / counts.sum()


def distance(one: Floats, other: Floats) -> float:
    """Total variation between the impact phases of two motions, in [0, 1]."""
    return 0.5 * float(np.abs(histogram(one) - histogram(other)).sum())


def statistics(gamma: float, turns: float, divisions: int) -> tuple[Floats, Floats, float, float]:
    """Impact phases by both methods, and their distances.

    Returns:
        Phases of the event-driven method, of the position level, their distance, and the mean
        distance of four event-driven samples of that size. Each sample has many starts: a ball
        that sticks leaves the table in one way only, and goes round in a cycle from then on.
    """
    phase = math.acos(existence() / gamma)

    def phases(method: str, seed: int) -> Floats:
        speeds = math.pi + 0.01 + 0.005 * np.random.default_rng(seed).random(MEMBERS)
        runs = []
        for speed in speeds:
            found = launch(gamma, phase, speed, turns / MEMBERS, method, TURN / divisions)
            hits = found.impacts.before < -1e-3
            runs.append((found.impacts.time[hits] + phase)[100:] % TURN)
        return np.concatenate(runs)

    runs = [phases("events", seed) for seed in range(4)]
    other = phases("position", 0)
    same = [distance(a, b) for i, a in enumerate(runs) for b in runs[:i]]
    apart = [distance(other, a) for a in runs]
    return runs[0], other, float(np.mean(apart)), float(np.mean(same))


def parting(gamma: float, divisions: int, limit: float = 0.1) -> int:
    """Impacts after which two methods differ by more than ``limit`` of phase."""
    phase = math.acos(existence() / gamma)
    one = launch(gamma, phase, math.pi + 0.01, 400).impacts.time
    other = launch(gamma, phase, math.pi + 0.01, 400, "position", TURN / divisions).impacts.time
    count = min(len(one), len(other))
    apart = np.flatnonzero(np.abs(one[:count] - other[:count]) > limit)
    return int(apart[0]) if len(apart) else count


def draw_branches(branches: list[Branch], path: Path) -> None:
    """Impact phase and exponent against gamma."""
    figure = Figure(figsize=(8.0, 6.2), layout="constrained")
    FigureCanvasAgg(figure)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1.0))
    for gamma, phases, _ in branches:
        upper.plot(np.full(len(phases), gamma), phases, ",", color=BLUE, alpha=0.7)
    names = {"period 1 from 1.2566": existence(), "flip, exact map 3.8550": flip_exact()}
    names["flip, high-bounce map 3.8130"] = flip_high_bounce()
    for (name, place), style in zip(names.items(), ("-", "-", ":"), strict=True):
        upper.axvline(place, color=ORANGE, lw=1.0, ls=style, label=name)
        lower.axvline(place, color=ORANGE, lw=1.0, ls=style)
    upper.set_ylabel("phase of impact [rad]")
    upper.set_ylim(0.0, TURN)
    upper.legend(loc="upper left", fontsize=9)
    upper.set_title("Ball on a vibrating table, e = 0.8, exact flights", fontsize=11)
    values = np.array([(gamma, exponent) for gamma, _, exponent in branches])
    lower.axhline(0.0, color=GREY, lw=0.8)
    lower.plot(values[:, 0], values[:, 1], ".", ms=3, color=BLUE)
    lower.set_ylabel("exponent per impact")
    lower.set_xlabel(r"$\gamma = 2 \omega^2 (1 + e) A / g$     (no exponent where the ball sticks)")
    lower.set_ylim(-0.3, 0.25)
    lower.set_xlim(1.1, 6.5)
    figure.savefig(path, dpi=130)


def draw_statistics(found: list[Any], path: Path) -> None:
    """Histograms of the impact phase by two methods."""
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, len(found))
    centers = (np.arange(100) + 0.5) * TURN / 100
    for ax, (gamma, divisions, one, other, apart, same) in zip(axes, found, strict=True):
        width = TURN / 100
        ax.bar(centers, histogram(one) / width, width, color=BLUE, alpha=0.45, label="event driven")
        label = f"position level, h = T/{divisions}"
        ax.step(centers, histogram(other) / width, where="mid", color=ORANGE, lw=1.1, label=label)
        ax.set_title(
            rf"$\gamma$ = {gamma:g}: distance {apart:.3f}, by chance {same:.3f}", fontsize=10
        )
        ax.set_xlabel("phase of impact [rad]")
        ax.set_xlim(0.0, TURN)
        ax.legend(fontsize=8)
    axes[0].set_ylabel("density [1/rad]")
    figure.savefig(path, dpi=130)


def main() -> None:
    """Measure, write the table and the pictures."""
    launch(3.0, 1.0, math.pi, 5)  # compile before the clock starts
    rows = [
        ("period 1 exists from", existence(), bisect(1.2, 1.35, stays)),
        ("flip", flip_exact(), bisect(3.7, 4.0, returns)),
        ("flip of the high-bounce map", flip_high_bounce(), ""),
    ]
    branches, seconds = bifurcations()
    rows.append(("seconds for 400 branches on 2 cores", "", seconds))
    phase = math.acos(existence() / CHAOTIC)
    times, speeds = orbit(CHAOTIC, launch(CHAOTIC, phase, math.pi + 0.01, 200_000), phase)
    logs = growth(jacobians(CHAOTIC, times[500:], speeds[500:]))
    two = separation(amplitude(CHAOTIC), RESTITUTION, phase, math.pi + 0.01, 200_000, 1e-7)
    rows.append((f"exponent per impact at {CHAOTIC}, tangent map", "", logs.mean()))
    rows.append(("its standard error", "", batch_error(logs)))
    rows.append(("exponent from two orbits", "", two))
    free = launch(10.0, phase, math.pi + 0.01, 80_000)
    times, speeds = orbit(10.0, free, phase)
    free_until = free.effort.details["sticking"][0][0] - 20.0 * TURN
    flights = times < free_until + phase
    logs = growth(jacobians(10.0, times[flights], speeds[flights]))
    rows.append((f"exponent per impact at 10, first {len(logs)} impacts", "", logs.mean()))
    shown = []
    for gamma, turns, divisions in (
        (CHAOTIC, 20_000, 500), (CHAOTIC, 20_000, 2000), (CHAOTIC, 20_000, 8000),
        (10.0, 80_000, 500), (10.0, 80_000, 2000),
    ):  # fmt: skip
        one, other, apart, same = statistics(gamma, turns, divisions)
        name = f"{gamma:g}, position level with T/{divisions}"
        rows.append((f"distance of histograms at {name}", same, apart))
        rows.append((f"impacts until 0.1 rad apart at {name}", "", parting(gamma, divisions)))
        if (gamma, divisions) in {(CHAOTIC, 8000), (10.0, 2000)}:
            shown.append((gamma, divisions, one, other, apart, same))
    images = ROOT / "docs" / "images"
    draw_branches(branches, images / "vibrating_table.png")
    draw_statistics(shown, images / "vibrating_table_chaos.png")
    results = ROOT / "benchmarks" / "results"
    with (results / "vibrating_table.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("quantity", "closed form or chance", "measured"), *rows])
    lines = ["| quantity | closed form or chance | measured |", "| --- | --- | --- |"]
    for name, exact, measured in rows:
        cells = [value if isinstance(value, str) else f"{value:.6g}" for value in (exact, measured)]
        lines.append(f"| {name} | {cells[0]} | {cells[1]} |")
    (results / "vibrating_table.md").write_text("\n".join(lines) + "\n")
    write_stamp("vibrating_table")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
