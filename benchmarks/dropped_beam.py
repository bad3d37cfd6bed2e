"""Elastic beams dropped on a rigid floor at an angle: apparent restitution and micro-impacts.

    python benchmarks/dropped_beam.py [--out FOLDER] [--images FOLDER]

After D. Stoianovici and Y. Hurmuzlu, J. Appl. Mech. 63 (1996) 307-316; sizes are our own. Writes
dropped_beam.csv and dropped_beam.md to benchmarks/results, dropped_beam*.png to docs/images, in
about a minute.
"""

import argparse
import csv
import math
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from stamp import write_stamp
from tips import tip_damping_ratio, tip_state, with_tips

from impactfem.scene.beams import Beam
from impactfem.scene.obstacles import HalfSpace
from impactfem.system.beam import FreeBeam, free_beam
from impactfem.system.episode import Episode, contact_episode
from impactfem.vibro.event_driven import EventSettings, integrate_events
from impactfem.vibro.position_level import PositionSettings, integrate_positions
from impactfem.vibro.velocity_level import VelocitySettings, integrate_velocities

FLOOR = HalfSpace(point=[0.0, 0.0], normal=[0.0, 1.0])
LENGTH, SIDE, SPEED = 0.2, 0.0127, 1.0
ANGLES = np.linspace(2.25, 90.0, 40)
GRAVITY = (0.0, -1e-3)
# At the first touch an unbent beam has no force and no acceleration: rounding decides whether it
# sticks. A trace of gravity decides it; it changes the apparent restitution by less than 1e-5.
PERIODS = 1.5  # length of the motion in first bending periods
STEPS = {"position": 32_000, "velocity": 32_000}
ROWS = 3000
SOFT_STEPS = 16_000
SOFT = (0.03, 0.3, 1.0, 4.0)  # time of contact of the rigid rod over the first bending period
TIP_MASS = 1e-5  # of the effective mass of the end
TIP_E = 0.5

FIELDS = (
    "degrees", "theory", "elements", "method", "local_e", "contact_over_period", "restitution",
    "micro_impacts", "last_contact_over_period", "vibration", "lost", "turned_degrees", "is_over",
    "seconds",
)  # fmt: skip


def dropped(degrees: float, elements: int = 16, theory: str = "euler_bernoulli") -> FreeBeam:
    """A steel beam whose lower end meets the floor after 1/100 of its first bending period."""
    angle = math.radians(degrees)
    data = {"length": LENGTH, "height": SIDE, "width": SIDE, "density": 7800.0}
    data |= {"youngs_modulus": 2.1e11, "elements": elements, "theory": theory}
    data |= {"inclination": angle, "velocity": [0.0, -SPEED]}
    probe = Beam(**data, center=[0.0, 1.0])
    height = 0.5 * LENGTH * math.sin(angle) + 0.01 * SPEED * period(probe)
    return free_beam(Beam(**data, center=[0.0, height]))


def period(beam: Beam) -> float:
    """First bending period [s]."""
    return 2.0 * math.pi / beam.first_frequency


def effective_mass(beam: Beam) -> float:
    """Mass that the floor meets at the end of the rigid rod [kg]."""
    return beam.mass / (1.0 + 3.0 * math.cos(beam.inclination) ** 2)


def drop(
    degrees: float,
    method: str,
    *,
    local_e: float = 0.0,
    elements: int = 16,
    theory: str = "euler_bernoulli",
    steps: int | None = None,
) -> tuple[Episode, Any, dict[str, Any]]:
    """Drop a beam on the rigid floor; returns the episode, the motion and a row of the table."""
    body = dropped(degrees, elements, theory)
    system = body.system(FLOOR, GRAVITY, local_e)
    duration = PERIODS * period(body.beam)
    begin = time.perf_counter()
    if method == "events":
        motion = integrate_events(system, *body.start, duration, EventSettings(rows=ROWS))
    elif method == "position":
        dt = duration / (steps or STEPS[method])
        motion = integrate_positions(
            system, *body.start, duration, PositionSettings(dt=dt, implicit=True)
        )
    else:
        dt = duration / (steps or STEPS[method])
        motion = integrate_velocities(system, *body.start, duration, VelocitySettings(dt=dt))
    seconds = time.perf_counter() - begin
    episode = contact_episode(body, system, motion)
    row = _row(body, episode, degrees, method, local_e, 0.0, seconds)
    return episode, motion, row


def drop_softly(degrees: float, ratio: float) -> dict[str, Any]:
    """Drop a beam with a spring and dashpot at its ends that alone give e = 1/2.

    Args:
        degrees: Inclination.
        ratio: Half period of the rigid rod on the spring over the first bending period.
    """
    body = dropped(degrees)
    unit, zeta = period(body.beam), tip_damping_ratio(TIP_E)
    mass = effective_mass(body.beam)
    omega = math.pi / (ratio * unit)
    system = body.system(FLOOR, GRAVITY)
    tips = with_tips(system, mass * omega**2, 2.0 * zeta * mass * omega, TIP_MASS * mass)
    u, v = (tip_state(system, field) for field in body.start)
    begin = time.perf_counter()
    duration = (PERIODS + 1.5 * ratio) * unit
    motion = integrate_velocities(tips, u, v, duration, VelocitySettings(dt=duration / SOFT_STEPS))
    seconds = time.perf_counter() - begin
    episode = contact_episode(body, system, motion)
    return _row(body, episode, degrees, "velocity", TIP_E, ratio, seconds)


def _row(
    body: FreeBeam,
    episode: Episode,
    degrees: float,
    method: str,
    local_e: float,
    ratio: float,
    seconds: float,
) -> dict[str, Any]:
    last = episode.last_contact / period(body.beam)
    values = (
        degrees, body.beam.theory, body.beam.elements, method, local_e, ratio, episode.restitution,
        episode.micro_impacts, last, episode.vibration, episode.lost, math.degrees(episode.angle),
        episode.is_over, seconds,
    )  # fmt: skip
    return dict(zip(FIELDS, values, strict=True))


def sweep() -> list[dict[str, Any]]:
    """All drops of the study."""
    plans: list[tuple[str, dict[str, Any]]] = [
        ("events", {}), ("position", {}), ("velocity", {}),
        ("position", {"local_e": 0.5}),
        ("position", {"elements": 8}), ("position", {"elements": 32}),
        ("position", {"theory": "timoshenko"}),
    ]  # fmt: skip
    rows = []
    for method, choice in plans:
        rows += [drop(float(degrees), method, **choice)[2] for degrees in ANGLES]
        print(method, choice, f"{sum(row['seconds'] for row in rows[-len(ANGLES) :]):.1f} s")
    for ratio in SOFT:
        rows += [drop_softly(float(degrees), ratio) for degrees in ANGLES]
    return rows


def pick(rows: Iterable[Mapping[str, Any]], **wanted: Any) -> list[Mapping[str, Any]]:
    """Rows of one curve, by default on the rigid floor with local e = 0 and 16 elements."""
    usual = {"theory": "euler_bernoulli", "elements": 16, "local_e": 0.0}
    wanted = usual | {"contact_over_period": 0.0} | wanted
    return [row for row in rows if all(row[name] == value for name, value in wanted.items())]


def column(rows: Iterable[Mapping[str, Any]], name: str) -> Any:
    """One column as an array."""
    return np.array([row[name] for row in rows], dtype=float)


def distance(first: Any, second: Any, name: str = "restitution") -> tuple[float, float]:
    """Median and largest difference of two curves."""
    apart = np.abs(column(first, name) - column(second, name))
    return float(np.median(apart)), float(apart.max())


def table(rows: list[dict[str, Any]]) -> str:
    """The findings in Markdown."""
    reference = pick(rows, method="events")
    lines = [
        "# Dropped beam",
        "",
        (
            f"Steel, {LENGTH:g} m long, {SIDE * 1e3:g} mm square, {SPEED:g} m/s, "
            f"{len(ANGLES)} angles from {ANGLES[0]:g} to {ANGLES[-1]:g} degrees; first bending "
            f"period {period(dropped(45).beam) * 1e3:.3f} ms. "
            "Reference: events, 16 elements, local e = 0."
        ),
        "",
        (
            "| curve | difference of apparent e, median | largest | largest but two "
            "| micro-impacts, most | energy lost, most | seconds |"
        ),
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    curves = {
        "events": {"method": "events"},
        "position level": {"method": "position"},
        "velocity level": {"method": "velocity"},
        "position level, local e = 1/2": {"method": "position", "local_e": 0.5},
        "position level, 8 elements": {"method": "position", "elements": 8},
        "position level, 32 elements": {"method": "position", "elements": 32},
        "position level, Timoshenko": {"method": "position", "theory": "timoshenko"},
    }
    for name, wanted in curves.items():
        found = pick(rows, **wanted)
        apart = np.sort(np.abs(column(found, "restitution") - column(reference, "restitution")))
        lines.append(
            f"| {name} | {np.median(apart):.1e} | {apart[-1]:.1e} | {apart[-3]:.1e} "
            f"| {int(column(found, 'micro_impacts').max())} | {column(found, 'lost').max():.3f} "
            f"| {column(found, 'seconds').sum():.1f} |"
        )
    lines += [
        "",
        f"With a spring and dashpot at the end that give e = {TIP_E:g} for the rigid rod:",
        "",
        (
            "| contact of the rigid rod / first period | apparent e from | to | largest distance "
            f"from {TIP_E:g} |"
        ),
        "| --- | --- | --- | --- |",
    ]
    for ratio in SOFT:
        e = column(pick(rows, local_e=TIP_E, contact_over_period=ratio), "restitution")
        lines.append(
            f"| {ratio:g} | {e.min():.4f} | {e.max():.4f} | {np.abs(e - TIP_E).max():.4f} |"
        )
    turned = max(row["turned_degrees"] for row in reference)
    open_ends = sum(not row["is_over"] for row in rows)
    lines += [
        "",
        (
            f"Largest change of angle, neglected: {turned:.2f} degrees on the rigid floor, "
            f"{max(row['turned_degrees'] for row in rows):.2f} with the softest tip. Episodes "
            f"not over at the end: {open_ends} of {len(rows)}."
        ),
        "",
    ]
    return "\n".join(lines)


def _figure(rows: int, height: float) -> tuple[Figure, Any]:
    figure = Figure(figsize=(7.0, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, 1, sharex=True)


def draw_restitution(rows: list[dict[str, Any]]) -> Figure:
    """Apparent restitution and micro-impacts against inclination."""
    figure, (top, bottom) = _figure(2, 6.4)
    styles = {
        "events": {"color": "#0b559f", "lw": 1.6, "label": "event driven"},
        "position": {"color": "#d95f02", "ls": "", "marker": "o", "ms": 5, "mfc": "none",
                     "label": "position level"},
        "velocity": {"color": "#1b7837", "ls": "", "marker": "x", "ms": 5,
                     "label": "velocity level"},
    }  # fmt: skip
    for method, style in styles.items():
        found = pick(rows, method=method)
        top.plot(column(found, "degrees"), column(found, "restitution"), **style)
        bottom.plot(column(found, "degrees"), column(found, "micro_impacts"), **style)
    top.axhline(1.0, color="0.45", lw=1.0, ls="--")
    top.annotate("no energy left in vibrations", (1.5, 1.0), (0, -4), textcoords="offset points",
                 va="top", fontsize=9, color="0.35")  # fmt: skip
    top.set_ylabel("apparent restitution")
    top.set_ylim(0.0, 1.08)
    top.legend(loc="lower left", frameon=False)
    bottom.set_ylabel("micro-impacts")
    bottom.set_xlabel("inclination to the floor [degrees]")
    bottom.set_xlim(0.0, 91.0)
    bottom.set_ylim(0.0, None)
    top.set_title("Elastic steel beam dropped on a rigid floor, 0.2 m, 12.7 mm, 1 m/s")
    return figure


def draw_limit(rows: list[dict[str, Any]]) -> Figure:
    """From the rigid floor to the rigid rod: contact ever longer than the bending period."""
    figure, axes = _figure(1, 4.4)
    rigid = pick(rows, method="events")
    axes.plot(column(rigid, "degrees"), column(rigid, "restitution"), color="black", lw=1.4,
              label="rigid floor")  # fmt: skip
    for ratio, color in zip(SOFT, ("#0b559f", "#1b7837", "#d95f02", "#7b3294"), strict=True):
        found = pick(rows, local_e=TIP_E, contact_over_period=ratio)
        axes.plot(column(found, "degrees"), column(found, "restitution"), color=color, lw=1.4,
                  label=f"contact lasts {ratio:g} T")  # fmt: skip
    axes.axhline(TIP_E, color="0.45", ls="--", lw=1.2, label=f"rigid rod, e = {TIP_E:g}")
    axes.set(xlabel="inclination to the floor [degrees]", ylabel="apparent restitution")
    axes.set(xlim=(0.0, 91.0), ylim=(0.0, 1.08))
    axes.legend(loc="lower left", frameon=False, ncols=2, fontsize=9)
    axes.set_title("Contact that lasts long against the first bending period T: the rigid rod")
    return figure


def draw_motion(degrees: float = 30.0) -> Figure:
    """Gap of the lower end and contact force of one drop."""
    figure, (top, bottom) = _figure(2, 5.2)
    body = dropped(degrees)
    episode, motion, _ = drop(degrees, "events")
    t = motion.times / period(body.beam)
    low = episode.constraint
    normal = body.system(FLOOR).normals[low]
    rigid = body.rigid_part(motion.position) @ (normal @ body.rigid_modes)
    top.plot(t, 1e6 * motion.gap[:, low], color="#0b559f", label="lower end")
    top.plot(t, 1e6 * (motion.gap[0, low] + rigid), color="0.5", ls="--", label="its rigid part")
    top.axhline(0.0, color="black", lw=0.8)
    top.set(ylabel="height [\u00b5m]", ylim=(-75.0, 260.0))
    top.legend(frameon=False)
    impulse = np.cumsum(motion.contact_force[1:, low] * np.diff(motion.times))
    bottom.plot(t[1:], 1e3 * impulse, color="#d95f02")
    bottom.set(xlabel="time over first bending period", ylabel="contact impulse [mN s]")
    bottom.set_xlim(0.0, float(t[-1]))
    top.set_title(
        f"Drop at {degrees:g} degrees: {episode.micro_impacts} micro-impacts, "
        f"apparent e = {episode.restitution:.2f}"
    )
    return figure


def main() -> None:
    """Run the study and write its table and pictures."""
    here = Path(__file__).parent
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=here / "results")
    parser.add_argument("--images", type=Path, default=here.parent / "docs" / "images")
    given = parser.parse_args()
    rows = sweep()
    with (given.out / "dropped_beam.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.8g}" if type(v) is float else v for k, v in row.items()})
    (given.out / "dropped_beam.md").write_text(table(rows), encoding="utf-8")
    write_stamp("dropped_beam", folder=given.out)
    pictures = {"": draw_restitution(rows), "_limit": draw_limit(rows), "_motion": draw_motion()}
    for name, figure in pictures.items():
        figure.savefig(given.images / f"dropped_beam{name}.png", dpi=130)


if __name__ == "__main__":
    main()
