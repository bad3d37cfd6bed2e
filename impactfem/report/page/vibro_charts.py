"""Interactive charts of points, rods and beams: coordinates, paths, phase portrait, impacts."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.distance import on_a_line
from impactfem.report.page.chart import (
    BLUE,
    COLOURS,
    GREY,
    ORANGE,
    Chart,
    axis,
    is_told,
    layout,
    line,
    numbers,
    over_time,
    stairs,
    thin,
)
from impactfem.report.phase import phase_curve
from impactfem.result import Record
from impactfem.scene import Point

Floats = NDArray[np.float64]

_MOST_CURVES = 8
_MOST_DOTS = 3000
_MANY = 50  # impacts from which dots are small
_ROUNDING = 1e-12  # of the largest impact speed, below which there is no impact
_RANGE = 1e3  # of impact speeds beyond which the axis is logarithmic
_PATH = 2000  # samples of a path


def vibro_charts(result: Record) -> list[Chart]:
    """Charts that only points, rods and beams have."""
    points = isinstance(result.scene.bodies[0], Point)
    alone = len(result.scene.bodies) == 1
    made = [_coordinates(result)]
    if result.scene.dim == 2 and points:
        made.append(_path(result))
    if result.scene.dim == 1 and points and alone:
        made.append(_phase(result))
    made += [_forces(result), _impacts(result)]
    return [chart for chart in made if chart is not None]


def _coordinates(result: Record) -> Chart | None:
    """Coordinates over time, in one dimension with the obstacles."""
    history, scene = result.rows, result.scene
    time = history["time"].values
    letters = "xyz"[: scene.dim]
    curves = [
        (f"{body.name}.{letter}" if scene.dim > 1 else body.name, history[f"{body.name}.{letter}"])
        for body in scene.bodies
        for letter in letters
    ]
    points = isinstance(scene.bodies[0], Point)
    told = [
        (name, column.values if points else column.values - column.values[0])
        for name, column in curves
        if is_told(np.diff(column.values))
    ]
    if not told:
        return None
    if len(told) > 2 * _MOST_CURVES:  # a forest: the first ones stand for all
        told = told[: 2 * _MOST_CURVES]
    traces = [
        line(time, values, name, _colour(k), "m") for k, (name, values) in enumerate(told)
    ]  # fmt: skip
    if scene.dim == 1:
        for obstacle in scene.rigid_obstacles:
            place, _ = on_a_line(obstacle, time)
            traces.append(line(time, place, obstacle.name, GREY, "m", line={"width": 3.0}))
    whole = "Position" if points else "Way of the centre of mass from where it started,"
    caption = f"{whole} over time: kinks are impacts"
    caption += ", the grey line is the obstacle." if scene.dim == 1 and scene.obstacles else "."
    named = "position [m]" if points else "way [m]"
    figure = over_time(time, traces, named, showlegend=True)
    return Chart("motion", "Motion", caption, figure)


def _path(result: Record) -> Chart:
    """Paths in the plane, both axes at one scale."""
    history = result.rows
    data = []
    for k, body in enumerate(result.scene.bodies):
        x, y = (history[f"{body.name}.{letter}"].values for letter in "xy")
        kept = np.union1d(thin(x, _PATH), thin(y, _PATH))
        named = {"showlegend": k < _MOST_CURVES, "legendgroup": body.name, "name": body.name}
        told = numbers(history["time"].values[kept])
        hover = (
            f"x = %{{x:.6g}} m<br>y = %{{y:.6g}} m<br>t = %{{customdata:.6g}} s"
            f"<extra>{body.name}</extra>"
        )
        data.append(
            {
                "type": "scatter", "mode": "lines", "x": numbers(x[kept]), "y": numbers(y[kept]),
                "line": {"color": _colour(k), "width": 1.6}, "customdata": told,
                "hovertemplate": hover, **named,
            }
        )  # fmt: skip
        data.append(
            {
                "type": "scatter", "mode": "markers", "x": numbers(x[:1]), "y": numbers(y[:1]),
                "marker": {"color": _colour(k), "size": 9}, **(named | {"showlegend": False}),
                "hovertemplate": "start<extra></extra>",
            }
        )  # fmt: skip
    vertical = axis("y [m]", scaleanchor="x", scaleratio=1)
    several = len(result.scene.bodies) > 1
    plane = layout(axis("x [m]"), vertical, height=440, showlegend=several)
    figure = {"data": data, "layout": plane}
    caption = "Path in the plane, true to scale; the dot is the start, kinks are impacts."
    return Chart("path", "Path", caption, figure)


def _phase(result: Record) -> Chart:
    """Velocity against position of one point on a line."""
    name = result.scene.bodies[0].name
    times, x, v = phase_curve(result)
    kept = np.union1d(thin(x), thin(v))
    data: list[dict[str, Any]] = [
        {
            "type": "scatter", "mode": "lines", "x": numbers(x[kept]), "y": numbers(v[kept]),
            "line": {"color": BLUE, "width": 1.2}, "name": name,
            "customdata": numbers(times[kept]),
            "hovertemplate": "x = %{x:.6g} m<br>v = %{y:.6g} m/s<br>t = %{customdata:.6g} s"
            "<extra></extra>",
        },
        {
            "type": "scatter", "mode": "markers", "x": numbers(x[:1]), "y": numbers(v[:1]),
            "marker": {"color": ORANGE, "size": 9}, "name": "start",
            "hovertemplate": "start<extra></extra>",
        },
    ]  # fmt: skip
    figure = {
        "data": data,
        "layout": layout(axis("x [m]"), axis("velocity [m/s]"), showlegend=False),
    }
    caption = "Velocity against position: impacts are vertical jumps, the orange dot is the start."
    return Chart("phase", "Phase portrait", caption, figure)


def _forces(result: Record) -> Chart | None:
    """Force of each constraint, where several of them carry any."""
    history = result.rows
    names = [
        str(name)
        for name in history.data_vars
        if str(name).startswith("force.") and is_told(history[name].values)
    ]
    if not 1 < len(names) <= _MOST_CURVES:
        return None
    time = history["time"].values
    traces = [
        stairs(time, history[name].values, str(history[name].attrs.get("label", name)),
               _colour(k), "N")
        for k, name in enumerate(names)
    ]  # fmt: skip
    caption = "Mean force of each lasting contact during a step, without the impulses of impacts."
    return Chart("forces", "Forces by contact", caption, over_time(time, traces, "force [N]"))


def _impacts(result: Record) -> Chart | None:
    """Impact speeds over time, a colour for each constraint."""
    found = result.impacts
    if found is None or not len(found):
        return None
    labels = result.summary.get("details", {}).get("constraints", [])
    speeds = -found.before
    rows = np.flatnonzero(speeds > _ROUNDING * speeds.max())
    if not len(rows):
        return None
    wide = bool(speeds[rows].max() > _RANGE * speeds[rows].min())
    rows = rows[np.union1d(thin(speeds[rows], _MOST_DOTS), [0])]
    data = []
    for k, index in enumerate(np.unique(found.constraint[rows])[:_MOST_CURVES]):
        own = rows[found.constraint[rows] == index]
        label = labels[index] if index < len(labels) else f"constraint {index}"
        data.append(
            {
                "type": "scatter", "mode": "markers", "x": numbers(found.time[own]),
                "y": numbers(speeds[own]), "name": label,
                "customdata": numbers(found.impulse[own]),
                "marker": {"color": _colour(k), "size": 4 if len(rows) > _MANY else 9},
                "hovertemplate": "t = %{x:.7g} s<br>%{y:.6g} m/s<br>impulse %{customdata:.6g} N s"
                f"<extra>{label}</extra>",
            }
        )  # fmt: skip
    scale = {"type": "log"} if wide else {"rangemode": "tozero"}
    time = result.rows["time"].values
    figure = over_time(time, data, "impact speed [m/s]", yaxis=scale, showlegend=True)
    count = f"{len(found)} impacts" if len(found) > 1 else "One impact"
    caption = f"{count}, each with the speed at which the surfaces met"
    if wide and len(found) > _MANY:
        caption += "; falling columns of dots are bounces that die out"
    return Chart("impacts", "Impacts", f"{caption}.", figure)


def _colour(k: int) -> str:
    return COLOURS[k % len(COLOURS)]
