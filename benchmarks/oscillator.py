"""The founding paper's oscillator: detection, position-level scheme, penalty (some minutes).

    python benchmarks/oscillator.py [--results FOLDER] [--images FOLDER]

u'' = -2 beta u' - u + a cos(50 t), u >= 0.8, beta = 0.5, restitution 0.5, from u = 0.8, u' = 0.1 to
t = 2.5. The residual factor is max u - min u over the last six forcing periods, divided by that of
impact detection. Source: Paoli and Schatzman (2000), section 5, figures 4 to 7.
"""

import csv
import math
import time
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from penalty import PenaltySettings, integrate_penalty
from plain_penalty import integrate_plainly
from stamp import study_arguments, write_stamp

from impactfem.result.trajectory import Trajectory
from impactfem.scene.signal import Signal
from impactfem.system.generalized import LinearSystem
from impactfem.vibro.event_driven import EventSettings, integrate_events
from impactfem.vibro.position_level import PositionSettings, integrate_positions

AMPLITUDE, FREQUENCY, WALL, END = 1.0, 50.0, 0.8, 2.5
STIFFNESSES = (1e4, 1e6, 1e8)
STEPS = {5: 0.005, 6: 0.00125, 7: 0.0003125}
WINDOW = END - 6 * 2 * math.pi / FREQUENCY
COLOURS = ("#d95f02", "#1b7837", "#0b559f")
METHODS = {
    "LSODA": {"restarted": False},
    "LSODA restarted": {"restarted": True},
    "LSODA, rtol 1e-3": {"restarted": False, "rtol": 1e-3, "atol": 1e-4},
    "switch located": {},
}


def oscillator(amplitude: float = AMPLITUDE) -> LinearSystem:
    """The system, for an amplitude a of the forcing."""
    load = [Signal(harmonics=((FREQUENCY, amplitude, 0.0),))]
    return LinearSystem(
        mass=1.0, damping=1.0, stiffness=1.0, load=load, normals=[[1.0]], offsets=[-WALL],
        restitution=0.5,
    )  # fmt: skip


def residual(motion: Trajectory) -> float:
    """Size max - min of the oscillation that remains [m]."""
    return float(np.ptp(motion.position[motion.times >= WINDOW, 0]))


def hops(motion: Trajectory) -> int:
    """Forcing periods since t = 1, of 11, in which the body leaves the wall by 0.037 mm or more.

    That is half of what detection finds in each of them.
    """
    period = 2 * math.pi / FREQUENCY
    begin = END - 11 * period
    count = 0
    for n in range(11):
        inside = (motion.times >= begin + n * period) & (motion.times < begin + (n + 1) * period)
        count += bool(motion.position[inside, 0].max() - WALL >= 3.7e-5)
    return count


def detect(amplitude: float = AMPLITUDE) -> Trajectory:
    """The motion by impact detection, exact between impacts."""
    return integrate_events(oscillator(amplitude), [WALL], [0.1], END, EventSettings(rows=8000))


def march(dt: float, amplitude: float = AMPLITUDE) -> Trajectory:
    """The motion by the position-level scheme."""
    return integrate_positions(oscillator(amplitude), [WALL], [0.1], END, PositionSettings(dt=dt))


def penalise(
    k: float, dt: float, amplitude: float = AMPLITUDE, *, restarted: bool | None = None,
    rtol: float | None = None, atol: float | None = None,
) -> Trajectory:  # fmt: skip
    """The motion by penalty; by LSODA alone if it is said whether that is restarted."""
    chosen = PenaltySettings(k, dt, rtol=rtol, atol=atol)
    given = (oscillator(amplitude), [WALL], [0.1], END, chosen)
    if restarted is None:
        return integrate_penalty(*given)
    return integrate_plainly(*given, restarted=restarted)


def main() -> None:
    """Run the study and write tables and pictures."""
    arguments = study_arguments(__doc__).parse_args()
    exact = detect()
    rows, plain = study(exact)
    amplitudes = other_amplitudes()
    write(arguments.results, exact, rows, amplitudes)
    figure_4(exact, march(STEPS[5])).savefig(arguments.images / "oscillator_4.png", dpi=130)
    starts = attractors()
    write_attractors(arguments.results, starts)
    write_stamp("oscillator", folder=arguments.results)
    figure_attractors(exact, starts).savefig(
        arguments.images / "oscillator_attractors.png", dpi=130
    )
    for number, dt in STEPS.items():
        picture = figure_5(exact, {k: plain[dt, k] for k in STIFFNESSES}, dt)
        picture.savefig(arguments.images / f"oscillator_{number}.png", dpi=130)


def study(exact: Trajectory) -> tuple[list[list[object]], dict[tuple[float, float], Trajectory]]:
    """All stiffnesses, steps and ways to integrate: rows of the table, motions of plain LSODA."""
    rows: list[list[object]] = []
    plain = {}
    size = residual(exact)
    for dt in STEPS.values():
        motion = march(dt)
        gap = np.abs(np.interp(motion.times, exact.times, exact.position[:, 0])
                     - motion.position[:, 0]).max()  # fmt: skip
        rows.append(
            ["position level", "", dt, residual(motion) / size, gap, hops(motion), "", "", "", ""]
        )
        for k in STIFFNESSES:
            for name, settings in METHODS.items():
                start = time.perf_counter()
                motion = penalise(k, dt, **settings)
                seconds = time.perf_counter() - start
                if name == "LSODA":
                    plain[dt, k] = motion
                details = motion.effort.details
                error = np.abs(
                    np.interp(motion.times, exact.times, exact.position[:, 0])
                    - motion.position[:, 0]
                ).max()
                rows.append([
                    name, k, dt, residual(motion) / size, error, hops(motion),
                    details["restitution"]["ratios"][0], details["max_penetration"],
                    details["evaluations"], seconds,
                ])  # fmt: skip
                print(*rows[-1], flush=True)
    return rows, plain


def other_amplitudes() -> list[list[float]]:
    """Peak, residual size and factors of plain LSODA for other amplitudes a."""
    rows = []
    for a in (0.5, 0.85, 0.9, 1.0, 1.1, 1.2, 1.5, 2.0, 5.0):
        exact = detect(a)
        size = residual(exact)
        found = [residual(penalise(k, 0.005, a, restarted=False)) for k in STIFFNESSES]
        scheme = residual(march(0.005, a))
        factors = [x / size if size > 0.0 else math.inf for x in (scheme, *found)]
        rows.append([a, float(exact.position.max()), size, *factors])
        print(*rows[-1], flush=True)
    return rows


def attractors() -> list[list[float]]:
    """Rows (v0, residual by detection, by the position-level scheme) of motions to t = 5."""
    rows = []
    for v0 in np.linspace(0.05, 0.15, 101):
        system, start = oscillator(), ([WALL], [float(v0)])
        found = (
            integrate_events(system, *start, 5.0, EventSettings(rows=4000, keep_impacts=10)),
            integrate_positions(system, *start, 5.0, PositionSettings(dt=STEPS[6])),
        )
        rows.append([float(v0), *(float(np.ptp(m.position[m.times >= 4.3, 0])) for m in found)])
    return rows


def write_attractors(folder: Path, rows: list[list[float]]) -> None:
    """Append to oscillator.md how many starts end in which motion."""
    table = np.array(rows)
    large = table[:, 1:] > 1e-3
    sizes = table[large[:, 0], 1].mean(), table[~large[:, 0], 1].mean()
    agree = (large[:, 0] == large[:, 1]).sum()
    text = (
        f"\nStarts v0 = 0.05 to 0.15, {len(rows)} of them, that end in the large motion:\n"
        f"{large[:, 0].sum()} by detection, {large[:, 1].sum()} by the position-level scheme with\n"
        f"h = {STEPS[6]:g}; {agree} agree. "
        f"Sizes by detection: {sizes[0]:.3e} m and {sizes[1]:.3e} m.\n"
    )
    with (folder / "oscillator.md").open("a") as file:
        file.write(text)


def write(
    folder: Path, exact: Trajectory, rows: list[list[object]], amplitudes: list[list[float]]
) -> None:
    """Write oscillator.csv (all runs) and oscillator.md (the tables of the documentation)."""
    columns = ["method", "k", "h", "residual_factor", "max_error", "hops", "first_restitution",
               "max_penetration", "evaluations", "seconds"]  # fmt: skip
    with (folder / "oscillator.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([columns, *rows])
    found = {(row[0], row[1], row[2]): (row[3], row[5]) for row in rows}
    steps = list(STEPS.values())
    lines = [
        f"Residual oscillation by detection: {residual(exact):.4e} m (a = {AMPLITUDE:g}),",
        f"{hops(exact)} hops in 11 forcing periods. Factors, and the periods with a hop:",
        "",
        "| method | k | " + " | ".join(f"h = {h:g}" for h in steps) + " |",
        "| --- | --- |" + " --- |" * len(steps),
    ]
    for name, k in [("position level", ""), *((n, k) for n in METHODS for k in STIFFNESSES)]:
        values = " | ".join(f"{found[name, k, h][0]:.3g} ({found[name, k, h][1]})" for h in steps)
        lines.append(f"| {name} | {f'{k:.0e}' if k else ''} | {values} |")
    lines += [
        "", "Other amplitudes, h = 0.005, plain LSODA:", "",
        "| a | peak | detection | position level | k = 1e4 | 1e6 | 1e8 |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]  # fmt: skip
    for a, peak, size, *factors in amplitudes:
        cells = " | ".join(f"{x:.3g}" if math.isfinite(x) else "-" for x in factors)
        lines.append(f"| {a:g} | {peak:.5f} | {size:.2e} | {cells} |")
    (folder / "oscillator.md").write_text("\n".join(lines) + "\n")


def axes_pair(title: str) -> tuple[Figure, tuple[object, object]]:
    """A figure with the whole motion, and its end magnified."""
    figure = Figure(figsize=(10, 3.9), layout="constrained")
    FigureCanvasAgg(figure)
    whole, end = figure.subplots(1, 2, width_ratios=(3, 2))
    figure.suptitle(title, fontsize=11)
    whole.set(xlim=(0, END), ylim=(0.799, 0.806), xlabel="time [s]", ylabel="u [m]")
    end.set(xlim=(2.1, END), xlabel="time [s]", ylabel="u - 0.8 [mm]")
    for axes in (whole, end):
        axes.grid(alpha=0.25)
        axes.axhline(WALL if axes is whole else 0.0, color="0.6", lw=0.8)
    whole.ticklabel_format(useOffset=False)
    return figure, (whole, end)


def draw(axes: tuple[object, object], motion: Trajectory, **style: object) -> None:
    """One motion on both axes."""
    axes[0].plot(motion.times, motion.position[:, 0], **style)  # type: ignore[attr-defined]
    late = motion.times > 2.08
    axes[1].plot(motion.times[late], 1e3 * (motion.position[late, 0] - WALL), **style)  # type: ignore[attr-defined]


def figure_4(exact: Trajectory, scheme: Trajectory) -> Figure:
    """Detection and the position-level scheme."""
    figure, axes = axes_pair("Figure 4: impact detection and the position-level scheme, h = 0.005")
    draw(axes, exact, color="k", lw=1.2, label="detection")
    draw(axes, scheme, color=COLOURS[0], lw=1.0, ls="--", label="position level")
    axes[0].legend(frameon=False)  # type: ignore[attr-defined]
    return figure


def figure_5(exact: Trajectory, motions: dict[float, Trajectory], dt: float) -> Figure:
    """The penalty method at three stiffnesses, as figures 5 to 7."""
    number = {h: n for n, h in STEPS.items()}[dt]
    figure, axes = axes_pair(f"Figure {number}: penalty, LSODA with stock tolerances, h = {dt:g}")
    for (k, motion), colour in zip(motions.items(), COLOURS, strict=True):
        factor = residual(motion) / residual(exact)
        label = f"$k = 10^{math.log10(k):.0f}$: residual x {factor:.3g}"
        draw(axes, motion, color=colour, lw=1.0, label=label)
    draw(axes, exact, color="k", lw=0.9, ls=":", label="detection")
    axes[0].legend(frameon=False, fontsize=9)  # type: ignore[attr-defined]
    return figure


def figure_attractors(exact: Trajectory, rows: list[list[float]]) -> Figure:
    """The two motions of the rigid oscillator, and which start leads to which."""
    figure = Figure(figsize=(10, 3.9), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    large = integrate_events(oscillator(), [WALL], [0.11], END, EventSettings(rows=8000))
    soft = penalise(1e4, 0.00125)
    for motion, colour, style, label in (
        (exact, "k", "-", "detection, $v_0 = 0.1$"),
        (large, COLOURS[2], "-", "detection, $v_0 = 0.11$"),
        (soft, COLOURS[0], "--", "penalty $k = 10^4$, $v_0 = 0.1$"),
    ):
        place = 1e3 * (motion.position[:, 0] - WALL)
        left.plot(motion.times, place, color=colour, ls=style, lw=1.1, label=label)
    left.set(xlim=(0, END), ylim=(-1, 9.5), xlabel="time [s]", ylabel="u - 0.8 [mm]")
    left.legend(frameon=False, fontsize=9, loc="upper right")
    v0, detected, marched = np.array(rows).T
    right.semilogy(v0, 1e3 * detected, "ko", ms=4, mfc="none", label="detection")
    right.semilogy(v0, 1e3 * marched, "x", ms=4, color=COLOURS[0],
                   label=f"position level, h = {STEPS[6]:g}")  # fmt: skip
    right.axvline(0.1, color="0.6", lw=0.8)
    right.set(xlabel="initial velocity [m/s]", ylabel="size of the final motion [mm]")
    right.legend(frameon=False, fontsize=9, loc="center left")
    for axes in (left, right):
        axes.grid(alpha=0.25)
    return figure


if __name__ == "__main__":
    main()
