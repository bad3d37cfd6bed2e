"""Pictures of points, rods and beams: where they go, and where they hit."""

from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from impactfem.contact.distance import on_a_line
from impactfem.report.phase import phase_curve
from impactfem.report.sheet import Sheet
from impactfem.report.slender_picture import COLOURS
from impactfem.result import Record
from impactfem.scene import HalfSpace, Point, RigidCylinder, RigidSphere

Floats = NDArray[np.float64]

_MAX_DOTS = 2000
_MAX_CURVES = 8


def vibro_painters(result: Record) -> dict[str, Callable[[], Figure]]:
    """What draws every figure of points, a rod or a beam, by name."""
    points = isinstance(result.scene.bodies[0], Point)
    dim = result.scene.dim
    found: dict[str, Callable[[Axes, Record], None]] = {}
    if points and dim == 2:
        found["path"] = path
    if points and dim != 2:
        found["motion"] = motion
    if points and dim == 1 and len(result.scene.bodies) == 1:
        found["phase"] = phase
    found["gaps"] = gaps
    if result.impacts is not None and len(result.impacts):
        found["impacts"] = impacts
    return {name: partial(_figure, painter, result) for name, painter in found.items()}


def _figure(painter: Callable[[Axes, Record], None], result: Record) -> Figure:
    figure = Sheet(7.0, 4.2)
    axes = figure.add_subplot()
    painter(axes, result)
    return figure


def path(axes: Axes, result: Record) -> None:
    """Paths of points in the plane, with the obstacles."""
    names = [body.name for body in result.scene.bodies]
    for k, name in enumerate(names):
        x, y = result.rows[f"{name}.x"].values, result.rows[f"{name}.y"].values
        colour = COLOURS[k % len(COLOURS)]
        axes.plot(x, y, color=colour, linewidth=1.2, label=name if k < _MAX_CURVES else None)
        axes.plot(x[0], y[0], "o", color=colour, markersize=5)
    spans = [np.ptp([result.rows[f"{n}.{c}"].values for n in names]) for c in "xy"]
    margin = 0.08 * max(*spans, 1e-12)
    low = [min(result.rows[f"{n}.{c}"].values.min() for n in names) for c in "xy"]
    high = [max(result.rows[f"{n}.{c}"].values.max() for n in names) for c in "xy"]
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal")
    _obstacles(axes, result, 4.0 * max(*spans, margin))
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(f"{result.scene.title}: path (dot: start)")
    if len(names) > 1:
        axes.legend(frameon=False)


def _obstacles(axes: Axes, result: Record, size: float) -> None:
    """Half-spaces and circles as they are at t = 0."""
    for obstacle in result.scene.rigid_obstacles:
        if isinstance(obstacle, HalfSpace):
            point, normal = np.array(obstacle.point), np.array(obstacle.unit_normal)
            along = size * np.array([-normal[1], normal[0]])
            ends = np.array([point - along, point + along])
            back = ends - 0.02 * size * normal
            axes.plot(*ends.T, color="0.35", linewidth=1.5, scalex=False, scaley=False)
            corners = np.vstack([ends, back[::-1]])
            axes.fill(*corners.T, color="0.8", zorder=0)
        elif isinstance(obstacle, RigidSphere | RigidCylinder):
            center = obstacle.center if isinstance(obstacle, RigidSphere) else obstacle.point
            filled = obstacle.side == "outside"
            axes.add_patch(
                Circle(
                    (center[0], center[1]), obstacle.radius, fill=filled, facecolor="0.85",
                    edgecolor="0.35", linewidth=1.5, zorder=0,
                )
            )  # fmt: skip


def motion(axes: Axes, result: Record) -> None:
    """Coordinates of points over time; on a line with the obstacles."""
    time = result.rows["time"].values
    letters = "xyz"[: result.scene.dim]
    curves = [(body.name, c) for body in result.scene.bodies for c in letters]
    for k, (name, letter) in enumerate(curves):
        label = (f"{name}.{letter}" if len(letters) > 1 else name) if k < _MAX_CURVES else None
        axes.plot(
            time, result.rows[f"{name}.{letter}"].values, color=COLOURS[k % len(COLOURS)],
            linewidth=1.2, label=label,
        )  # fmt: skip
    if result.scene.dim == 1:
        for obstacle in result.scene.rigid_obstacles:
            axes.plot(
                time, on_a_line(obstacle, time)[0], color="0.35", linewidth=2.0, label=obstacle.name
            )
    _time(axes, result)
    axes.set_ylabel("position [m]")
    axes.set_title(f"{result.scene.title}: motion")
    axes.legend(frameon=False)


def phase(axes: Axes, result: Record) -> None:
    """Velocity against position of one point on a line; impacts are vertical jumps."""
    _, x, v = phase_curve(result)
    axes.plot(x, v, color=COLOURS[0], linewidth=0.8)
    axes.plot(x[0], v[0], "o", color=COLOURS[1], markersize=5)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("velocity [m/s]")
    axes.set_title(f"{result.scene.title}: phase portrait (dot: start)")


def gaps(axes: Axes, result: Record) -> None:
    """Gaps of the constraints over time, those that come closest first."""
    names = [name for name in result.rows.data_vars if name.startswith("gap.")] or ["gap"]
    lows = {name: float(np.fmin.reduce(result.rows[name].values)) for name in names}
    nearest = sorted(names, key=lows.__getitem__)
    least = lows[nearest[0]]
    span = max(float(np.fmax.reduce(result.rows[name].values)) for name in names) - least
    close = [name for name in nearest if lows[name] <= least + 0.2 * span]
    for k, name in enumerate(n for n in names if n in close[:_MAX_CURVES]):
        column = result.rows[name]
        axes.plot(result.rows["time"].values, column.values, color=COLOURS[k % len(COLOURS)],
                  linewidth=1.2, label=column.attrs.get("label", name))  # fmt: skip
    axes.axhline(0.0, color="0.35", linewidth=1.0)
    _time(axes, result)
    axes.set_ylabel("gap [m]")
    axes.set_title(f"{result.scene.title}: gaps")
    axes.legend(frameon=False)


def impacts(axes: Axes, result: Record) -> None:
    """Impact speeds over time, a colour for each constraint."""
    found = result.impacts
    if found is None:
        return
    labels = result.summary["details"].get("constraints", [])
    kept = np.unique(np.linspace(0, len(found) - 1, min(len(found), _MAX_DOTS)).astype(int))
    for k, index in enumerate(np.unique(found.constraint)[:_MAX_CURVES]):
        own = kept[found.constraint[kept] == index]
        label = labels[index] if index < len(labels) else f"constraint {index}"
        axes.plot(found.time[own], -found.before[own], ".", color=COLOURS[k % len(COLOURS)],
                  markersize=4 if len(kept) > 50 else 9, label=label)  # fmt: skip
    speeds = -found.before
    axes.set_ylim(bottom=min(0.0, float(speeds.min())))
    if speeds.min() > 0.0 and speeds.max() > 1e3 * speeds.min():
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.5 * float(speeds.min()))
    _time(axes, result)
    axes.set_ylabel("impact speed [m/s]")
    axes.set_title(f"{result.scene.title}: {len(found)} impacts")
    axes.legend(frameon=False)


def _time(axes: Axes, result: Record) -> None:
    axes.set_xlabel("time [s]")
    axes.set_xlim(0.0, float(result.rows["time"].values[-1]))
