"""Panels of the ways of bodies: coordinates, velocities, paths, phase portraits, impacts."""

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.contact.distance import on_a_line
from impactfem.report.panel import GREY, MOST_NAMES, Curve, Panel, colour, is_told, over_time
from impactfem.report.phase import phase_curve
from impactfem.result import Fields, Record

_MOST_CURVES = 16
_MOST_DOTS, _MANY = 3000, 50  # impacts that are drawn; from which on dots are small
_STILL = 1e-3  # of the largest component, below which one is not seen
_APART = 0.05  # share of the distances between bodies above which their ways are seen
_FLAT = 0.02  # height over width below which a path is a line
_ROUNDING = 1e-12  # of the largest impact speed, below which there is no impact
_RANGE = 1e3  # of impact speeds beyond which the axis is logarithmic
_AT = "t = %{x:.7g} s<br>"


def motion(result: Record) -> Panel | None:
    """Coordinates of all bodies over time, on a line with the obstacles."""
    line = result.scene.dim == 1
    if line and isinstance(result.fields, Fields):  # world lines tell it, of all points
        return None
    line = line and _is_seen(result)
    curves = _coordinates(result, "", "m", relative=not line)
    if not curves:
        return None
    time = result.rows["time"].values
    for obstacle in result.scene.obstacles if line else ():
        place, _ = on_a_line(obstacle, time)
        curves.append(Curve(obstacle.name, time, place, "m", GREY, width=3.0))
    what = "Position" if line else "Displacement of the centre of mass from where it started,"
    caption = f"{what} over time: kinks are impacts"
    caption += ", the grey line is the obstacle." if line and result.scene.obstacles else "."
    y = "position [m]" if line else "displacement [m]"
    return over_time(result, "motion", "Motion", caption, curves, y, named=True)


def _is_seen(result: Record) -> bool:
    """Whether ways of bodies on a line are seen beside the distances between them."""
    places = np.array([result.rows[f"{body.name}.x"].values for body in result.scene.bodies])
    way = np.abs(places - places[:, :1])
    return bool(np.nanmax(way, initial=0.0) > _APART * np.ptp(places[:, 0]))


def velocity(result: Record) -> Panel | None:
    """Velocities of the centres of mass, components that stay zero left out."""
    curves = _coordinates(result, "v", "m/s", relative=False)
    if not curves:
        return None
    caption = "Velocity of the centre of mass"
    caption += " of each body" if len(result.scene.bodies) > 1 else ""
    caption += ": contact changes it." if result.scene.dim == 1 else " along each axis."
    title = "Velocity of the centre of mass"
    return over_time(result, "velocity", title, caption, curves, "velocity [m/s]",
                     named=True, still=result.scene.dim > 1 or len(curves) > 1)  # fmt: skip


def _coordinates(result: Record, prefix: str, unit: str, *, relative: bool) -> list[Curve]:
    """Components of places or velocities that are seen; of a forest the first stand for all."""
    letters, time = "xyz"[: result.scene.dim], result.rows["time"].values
    found = []
    for body in result.scene.bodies:
        for letter in letters:
            values = result.rows[f"{body.name}.{prefix}{letter}"].values
            label = f"{body.name}.{prefix}{letter}" if len(letters) > 1 else body.name
            found.append((label, values - values[0] if relative else values))
    ways = [float(np.abs(v[np.isfinite(v)]).max(initial=0.0)) for _, v in found]
    least = _STILL * max(ways)
    seen = [one for one, way in zip(found, ways, strict=True) if way > least][:_MOST_CURVES]
    return [
        Curve(label, time, values, unit, colour(k), named=len(seen) <= MOST_NAMES)
        for k, (label, values) in enumerate(seen)
    ]


def path(result: Record) -> Panel | None:
    """Paths of the centres of mass in the plane, both axes at one scale."""
    if result.scene.dim != 2:
        return None
    time, curves, ways = result.rows["time"].values, [], []
    for k, body in enumerate(result.scene.bodies):
        x, y = (result.rows[f"{body.name}.{letter}"].values for letter in "xy")
        told = "x = %{x:.6g} m<br>y = %{y:.6g} m<br>t = %{customdata:.6g} s"
        named = k < MOST_NAMES
        ways.append([np.ptp(part[np.isfinite(part)]) if np.isfinite(part).any() else 0.0
                     for part in (x, y)])  # fmt: skip
        curves.append(
            Curve(body.name, x, y, "m", colour(k), named=named, beside=time, told=told, begins=True)
        )
    across, up = np.max(ways, axis=0)
    if min(across, up) <= _FLAT * max(across, up):  # along a line: coordinates tell it
        return None
    what = "Paths of the centres of mass" if len(curves) > 1 else "Path of the centre of mass"
    caption = f"{what}, true to scale; the dot is the start, kinks are impacts."
    return Panel("path", "Path", caption, curves, "y [m]", "x [m]", equal=True, high=True)


def phase(result: Record) -> Panel | None:
    """Velocity against position of one body on a line; impacts are vertical jumps."""
    names = [body.name for body in result.scene.bodies]
    alone = len(names) == 1 and result.scene.dim == 1
    if not alone or isinstance(result.fields, Fields):
        return None
    time, x, v = phase_curve(result)
    told = "x = %{x:.6g} m<br>v = %{y:.6g} m/s<br>t = %{customdata:.6g} s"
    curve = Curve(names[0], x, v, "m/s", width=1.2, beside=time, told=told, begins=True)
    caption = "Velocity against position: impacts are vertical jumps, the dot is the start."
    return Panel(
        "phase", "Phase portrait", caption, [curve], "velocity [m/s]", "x [m]", named=False
    )


def impacts(result: Record) -> Panel | None:
    """Impact speeds over time, a colour for each constraint."""
    if (found := result.impacts) is None or not len(found):
        return None
    speeds = -found.before
    rows = np.flatnonzero(speeds > _ROUNDING * speeds.max())
    if not len(rows):
        return None
    wide = bool(speeds[rows].max() > _RANGE * speeds[rows].min())
    curves = _dots(result, rows, speeds, "m/s")
    count = f"{len(found)} impacts" if len(found) > 1 else "One impact"
    caption = f"{count}, each with the speed at which the surfaces met"
    if wide and len(found) > _MANY:
        caption += "; falling columns of dots are bounces that die out"
    y = "impact speed [m/s]"
    return over_time(result, "impacts", "Impacts", f"{caption}.", curves, y, log=wide, named=True)


def impulses(result: Record) -> Panel | None:
    """Impulses of impacts over time, a colour for each constraint."""
    if (found := result.impacts) is None or not is_told(found.impulse):
        return None
    curves = _dots(result, np.flatnonzero(found.impulse > 0.0), found.impulse, "N s")
    if not curves:
        return None
    caption = "Impulse of each impact, which the contact force does not have."
    return over_time(result, "impulses", "Impulses", caption, curves, "impulse [N s]", named=True)


def _dots(result: Record, rows: Integers, values: Floats, unit: str) -> list[Curve]:
    """Impacts of some rows, the largest and lowest of many."""
    found = result.impacts
    if found is None:
        return []
    most = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), _MOST_DOTS)).astype(int))]
    kept = np.union1d(most, rows[[np.argmax(values[rows])]]) if len(rows) else most
    labels = result.summary.get("details", {}).get("constraints", [])
    curves = []
    for k, index in enumerate(np.unique(found.constraint[kept])[:_MOST_CURVES]):
        own = kept[found.constraint[kept] == index]
        label = labels[index] if index < len(labels) else f"constraint {index}"
        told = f"{_AT}%{{y:.6g}} {unit}<br>impulse %{{customdata:.6g}} N s"
        curves.append(
            Curve(
                label, found.time[own], values[own], unit, colour(k), look="dots",
                width=4.0 if len(kept) > _MANY else 9.0, beside=found.impulse[own], told=told,
            )
        )  # fmt: skip
    return curves
