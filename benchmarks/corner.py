"""A point thrown into a corner: what each method makes of it (about one minute).

    python benchmarks/corner.py [--results FOLDER] [--images FOLDER]

The corner is that of Paoli and Schatzman (2000), section 3: x1 <= 0 and
x1 cos(theta) - x2 sin(theta) >= 0. Three studies: the outgoing angle against the offset of the ray
from the vertex (e = 1); the limits of the undamped penalty method, starts (0, -beta v2) / sqrt(k);
the limit of the over-damped one, alpha = 1.5.
"""

import csv
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from penalty import PenaltySettings, integrate_penalty
from scipy.integrate import solve_ivp
from stamp import study_arguments, write_stamp

from impactfem.system.generalized import LinearSystem
from impactfem.vibro.event_driven import EventSettings, integrate_events
from impactfem.vibro.position_level import PositionSettings, integrate_positions
from impactfem.vibro.velocity_level import VelocitySettings, integrate_velocities

Floats = NDArray[np.float64]

ANGLES = {"pi/2": math.pi / 2, "pi/3": math.pi / 3, "2pi/5": 2 * math.pi / 5}
OFFSETS = np.linspace(-0.03, 0.03, 81)
END = 2.5
METHODS: dict[str, tuple[Callable[..., Any], Any]] = {
    "event driven": (integrate_events, EventSettings(rows=50)),
    "position level, h = 0.01": (integrate_positions, PositionSettings(dt=0.01)),
    "Moreau-Jean, h = 0.01": (integrate_velocities, VelocitySettings(dt=0.01)),
    "penalty, k = 1e4": (integrate_penalty, PenaltySettings(1e4, 0.05)),
    "penalty, k = 1e6": (integrate_penalty, PenaltySettings(1e6, 0.05)),
}
STYLES = (("k", "o", 5), ("#d95f02", "x", 5), ("#7570b3", "+", 6), ("#1b7837", "", 0),
          ("#0b559f", "", 0))  # fmt: skip
THROWN = np.array([0.6, 0.8])


def corner(theta: float) -> LinearSystem:
    """A point of mass 1 in the corner of angle theta."""
    normals = [[-1.0, 0.0], [math.cos(theta), -math.sin(theta)]]
    return LinearSystem(mass=[1.0, 1.0], normals=normals, offsets=[0.0, 0.0], restitution=1.0)


def angle(v: Floats) -> float:
    """Direction of a velocity [degrees], in [0, 360)."""
    return float(np.degrees(np.arctan2(v[1], v[0])) % 360.0)


def incoming(theta: float) -> tuple[Floats, Floats]:
    """Direction of the ray through the vertex, 0.12 theta off the bisector, and its normal."""
    heading = -math.pi / 2 - theta / 2 + 0.12 * theta
    v = -np.array([math.cos(heading), math.sin(heading)])
    return v, np.array([-v[1], v[0]])


def unfold(theta: float, v: Floats, first: int) -> Floats:
    """Outgoing velocity of a ray that hits wall ``first`` first."""
    normals = np.array([[-1.0, 0.0], [math.cos(theta), -math.sin(theta)]])
    wall, out = first, v
    while (normals @ out).min() < -1e-13:
        if normals[wall] @ out < 0.0:
            out = out - 2.0 * (normals[wall] @ out) * normals[wall]
        wall = 1 - wall
    return out


def sweep() -> list[list[Any]]:
    """Outgoing angles of all methods, rows (corner, method, offset, angle)."""
    rows = []
    for name, theta in ANGLES.items():
        v, n = incoming(theta)
        for method, (integrate, settings) in METHODS.items():
            for offset in OFFSETS:
                found = integrate(corner(theta), -v + offset * n, v, END, settings)
                # The last row but one: central differences reach over the last.
                rows.append([name, method, float(offset), angle(found.velocity[-2])])
            print(name, method, flush=True)
    return rows


def polar_limit(theta: float, v: Floats, beta: float) -> Floats:
    """Outgoing velocity of the undamped penalty by (14) to (17), beta in (0, pi).

    R'' - Gamma^2 / R^3 + R = 0 and R^2 Theta' = Gamma until Theta = pi - theta, then a half swing
    against wall 2 alone.
    """
    i, j = _axes(theta)
    gamma = v[0] * v[1] * math.sin(beta)

    def leaves(_: float, y: Floats) -> float:
        return float(y[2] - (math.pi - theta))

    leaves.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(
        lambda _, y: [y[1], gamma**2 / y[0] ** 3 - y[0], gamma / y[0] ** 2], (0.0, 10.0),
        [v[0] * math.sin(beta), v[0] * math.cos(beta), 0.0], events=leaves, rtol=1e-11, atol=1e-13,
    )  # fmt: skip
    r, speed, turn = found.y[:, -1]
    radial = np.array([math.cos(turn), math.sin(turn)])
    across = np.array([-math.sin(turn), math.cos(turn)])
    place, rate = r * radial, speed * radial + gamma / r * across
    return -math.hypot(place @ i, rate @ i) * i + (rate @ j) * j


def arc(theta: float, k: float = 1e8) -> list[list[float]]:
    """Rows (beta, angle by the penalty method, angle by the polar equations)."""
    rows = []
    root = math.sqrt(k)
    for beta in np.linspace(0.0, math.pi, 41):
        start = [0.0, -beta * THROWN[1] / root]
        settings = PenaltySettings(k, 10.0 / root, rtol=1e-10)
        found = integrate_penalty(corner(theta), start, THROWN, 40.0 / root, settings)
        inside = 0.0 < beta < math.pi - 1e-9
        check = angle(polar_limit(theta, THROWN, beta)) if inside else math.nan
        rows.append([float(beta), angle(found.velocity[-1]), check])
    return rows


def overdamped() -> list[list[Any]]:
    """Rows (theta, k, |v - P2 P1 v0|, |v|, |v - Moreau's projection|) for alpha = 1.5."""
    rows = []
    for name, theta in {"2pi/3": 2 * math.pi / 3, **ANGLES}.items():
        _, j = _axes(theta)
        twice = THROWN[1] * j[1] * j  # P2 P1 v
        moreau = max(THROWN[1] * j[1], 0.0) * j  # P_T (P1 v)
        for k in (1e2, 1e3, 1e4, 1e5, 1e6):
            settings = PenaltySettings(k, 0.01, damping=1.5)
            v = integrate_penalty(corner(theta), [0.0, -0.2], THROWN, 2.0, settings).velocity[-1]
            sizes = [float(np.linalg.norm(v - x)) for x in (twice, np.zeros(2), moreau)]
            rows.append([name, k, *sizes])
            print(*rows[-1], flush=True)
    return rows


def _axes(theta: float) -> tuple[Floats, Floats]:
    """The paper's i, outward normal of wall 2, and j, along wall 2."""
    return (
        np.array([-math.cos(theta), math.sin(theta)]),
        np.array([-math.sin(theta), -math.cos(theta)]),
    )


def main() -> None:
    """Run the studies and write tables and pictures."""
    arguments = study_arguments(__doc__).parse_args()
    damped = overdamped()
    third, right, fifths = 2 * math.pi / 3, math.pi / 2, 2 * math.pi / 5
    arcs = {"2pi/3": arc(third), "pi/2": arc(right), "2pi/5": arc(fifths)}
    rows = sweep()
    write(arguments.results, rows, arcs, damped)
    write_stamp("corner", folder=arguments.results)
    draw_sweep(rows).savefig(arguments.images / "corner_angles.png", dpi=130)
    draw_arcs(arcs).savefig(arguments.images / "corner_arc.png", dpi=130)
    draw_overdamped(damped).savefig(arguments.images / "corner_overdamped.png", dpi=130)


def exact_angle(name: str, offset: float) -> float:
    """Outgoing angle by unfolding; the ray of positive offset is to the left of the vertex."""
    theta = ANGLES[name]
    v, n = incoming(theta)
    ahead = -v + offset * n
    # The wall that the ray meets first: time to both, along v.
    normals = np.array([[-1.0, 0.0], [math.cos(theta), -math.sin(theta)]])
    times = [-(row @ ahead) / (row @ v) if row @ v < 0.0 else math.inf for row in normals]
    return angle(unfold(theta, v, int(np.argmin(times))))


def write(
    folder: Path, rows: list[list[Any]], arcs: dict[str, list[list[float]]], damped: list[list[Any]]
) -> None:
    """Write corner.csv (the sweep) and corner.md (tables)."""
    with (folder / "corner.csv").open("w", newline="") as file:
        table = [["corner", "method", "offset", "angle"], *rows]
        csv.writer(file, lineterminator="\n").writerows(table)
    lines = [
        "Largest error of the outgoing angle [degrees] off the vertex, and the width [mm] of the",
        "offsets where it exceeds 0.01 degrees:", "",
        "| method | " + " | ".join(ANGLES) + " |", "| --- |" + " --- |" * len(ANGLES),
    ]  # fmt: skip
    spacing = OFFSETS[1] - OFFSETS[0]
    for method in METHODS:
        cells = []
        for name in ANGLES:
            errors = [abs(row[3] - exact_angle(name, row[2])) for row in rows
                      if row[:2] == [name, method] and abs(row[2]) > 1e-9]  # fmt: skip
            wrong = sum(e > 0.01 for e in errors)
            cells.append(f"{max(errors):.2g}, {1e3 * wrong * spacing:.2f}")
        lines.append(f"| {method} | " + " | ".join(cells) + " |")
    lines += ["", "At the vertex (offset 0), angle in degrees:", "",
              "| corner | wall 1 first | wall 2 first | " + " | ".join(METHODS) + " |",
              "| --- | --- | --- |" + " --- |" * len(METHODS)]  # fmt: skip
    for name, theta in ANGLES.items():
        v, _ = incoming(theta)
        pair = [angle(unfold(theta, v, wall)) for wall in (0, 1)]
        at = [
            row[3] for m in METHODS for row in rows if row[:2] == [name, m] and abs(row[2]) < 1e-9
        ]
        lines.append(f"| {name} | " + " | ".join(f"{x:.2f}" for x in [*pair, *at]) + " |")
    lines += ["", "Arc of limits of the undamped penalty (degrees), v = (0.6, 0.8):", "",
              "| corner | beta = 0 | beta = pi | largest difference from the polar equations |",
              "| --- | --- | --- | --- |"]  # fmt: skip
    for name, found in arcs.items():
        worst = max(abs(row[1] - row[2]) for row in found if math.isfinite(row[2]))
        lines.append(f"| {name} | {found[0][1]:.3f} | {found[-1][1]:.3f} | {worst:.1e} |")
    lines += ["", "Over-damped penalty, alpha = 1.5, distance of the outgoing velocity from:", "",
              "| corner | k | P2 P1 v | 0 | Moreau's projection |",
              "| --- | --- | --- | --- | --- |"]  # fmt: skip
    lines += [f"| {n} | {k:.0e} | {a:.2e} | {b:.2e} | {c:.2e} |" for n, k, a, b, c in damped]
    (folder / "corner.md").write_text("\n".join(lines) + "\n")


def draw_sweep(rows: list[list[Any]]) -> Figure:
    """Outgoing angle against offset, one panel a corner."""
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 3)
    titles = ("pi/2: continuous", "pi/3: continuous", "2pi/5: discontinuous")
    for axes, name, title in zip(panels, ANGLES, titles, strict=True):
        for method, (colour, marker, size) in zip(METHODS, STYLES, strict=True):
            line = [row[2:] for row in rows if row[:2] == [name, method]]
            x, y = np.array(line).T
            axes.plot(
                1e3 * x, y, color=colour, marker=marker, ms=size, ls="" if marker else "-",
                lw=1.3, label=method, markerfacecolor="none",
            )  # fmt: skip
        axes.set(title=title.replace("pi", "π"), xlabel="offset from the vertex [mm]")
        axes.grid(alpha=0.25)
        low, high = axes.get_ylim()
        if high - low < 10.0:
            axes.set_ylim(0.5 * (low + high) - 10.0, 0.5 * (low + high) + 10.0)
    panels[0].set_ylabel("outgoing direction [degrees]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False)
    return figure


def draw_arcs(arcs: dict[str, list[list[float]]]) -> Figure:
    """Outgoing angle against beta."""
    figure = Figure(figsize=(7, 4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for (name, rows), colour in zip(arcs.items(), ("#d95f02", "k", "#0b559f"), strict=True):
        beta, found, check = np.array(rows).T
        label = f"{name.replace('pi', 'π')}, penalty k = 1e8"
        axes.plot(beta / math.pi, found, color=colour, lw=1.4, label=label)
        axes.plot(beta / math.pi, check, color=colour, marker="o", ms=4, ls="", mfc="none")
    axes.plot([], [], color="0.4", marker="o", ls="", mfc="none", label="polar equations")
    axes.set(xlabel="β / π", ylabel="outgoing direction [degrees]")
    axes.grid(alpha=0.25)
    axes.legend(frameon=False)
    return figure


def draw_overdamped(rows: list[list[Any]]) -> Figure:
    """Distance from Moreau's projection against k."""
    figure = Figure(figsize=(6.5, 4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    markers = dict(zip(("2pi/3", *ANGLES), "os^d", strict=True))
    for name, marker in markers.items():
        line = np.array([row[1:] for row in rows if row[0] == name])
        floor = np.maximum(line[:, 3], 1e-16)
        axes.loglog(line[:, 0], floor, marker=marker, label=name.replace("pi", "π"))
    axes.set(xlabel="k [1/s²]", ylabel="|v - P v|, P: on the tangent cone [m/s]")
    axes.grid(alpha=0.25)
    axes.legend(frameon=False, title="corner")
    return figure


if __name__ == "__main__":
    main()
