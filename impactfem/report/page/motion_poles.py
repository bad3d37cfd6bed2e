"""The moving picture of a rod or a beam: lines placed by centre and gaps of the history."""

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from impactfem.report.page.motion_data import factors_of, packed, telling_frames
from impactfem.report.page.motion_obstacles import plane_obstacles
from impactfem.result import Result
from impactfem.scene import Beam, HalfSpace, Rod
from impactfem.system.points import contact_pairs

Floats = NDArray[np.float64]

_NODES = 13  # of a bent line
_STEEP = 0.2  # sine of the angle between beam and plane below which gaps tell no bending


def poles_motion(result: Result) -> dict[str, Any] | None:
    """Data of a rod or a beam.

    Returns:
        None if no row of the history is finite.
    """
    body = result.scene.bodies[0]
    history = result.history
    start, way = rod_way(result) if isinstance(body, Rod) else beam_way(result)
    finite = np.flatnonzero(np.isfinite(way).all(axis=(1, 2)))
    if not len(finite):
        return None
    frames = finite[telling_frames(result, history["time"].values[finite], 240)]
    times = history["time"].values[frames]
    shown = way[frames]
    length = cast("Rod | Beam", body).length
    factors = factors_of(float(np.linalg.norm(shown, axis=2).max()), length)
    thickness = 2.0 * body.radius if isinstance(body, Rod) else cast("Beam", body).height
    return {
        "kind": "points",
        "dim": 2,
        "caption": _caption(result, factors),
        "times": times,
        "names": [body.name],
        "reference": packed(start),
        "displacement": packed(shown),
        "thickness": thickness,
        "round": isinstance(body, Rod),
        "obstacles": plane_obstacles(result.scene.obstacles, times),
        "factors": factors,
        "factor": factors[-1],
    }


def rod_way(result: Result) -> tuple[Floats, Floats]:
    """Start of both ends of a rod, shape (2, 2), and their ways, (rows, 2, 2) [m].

    The history tells the centre and, by the gaps of both ends, the angle to each plane. Where there
    is one plane only, of the two angles that fit the one is taken that goes on evenly.
    """
    rod = cast("Rod", result.scene.bodies[0])
    normals, gaps = _gaps(result, 2)
    centre = _centre(result)
    theta = np.full(len(centre), rod.inclination)
    if len(normals):
        slopes = (gaps[:, :, 1] - gaps[:, :, 0]) / rod.length
        if np.linalg.matrix_rank(normals, tol=1e-3) == 2:
            across = slopes @ np.linalg.pinv(normals).T
            theta = np.unwrap(np.arctan2(across[:, 1], across[:, 0]))
        else:
            steps = np.diff(result.history["time"].values, prepend=0.0)
            theta = _even(slopes[:, 0], normals[0], rod, steps)
    arm = 0.5 * rod.length * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    ends = np.stack([centre - arm, centre + arm], axis=1)
    return ends[0], ends - ends[0]


def _even(slopes: Floats, normal: Floats, rod: Rod, steps: Floats) -> Floats:
    """Angles whose cosine to a normal is given, that go on as evenly as can be, shape (rows,)."""
    toward = float(np.arctan2(normal[1], normal[0]))
    opened = np.arccos(np.clip(slopes, -1.0, 1.0))
    turn = 2.0 * np.pi
    theta = np.empty(len(slopes))
    now, speed = rod.inclination, rod.angular_velocity
    for m, (angle, step) in enumerate(zip(opened.tolist(), steps.tolist(), strict=True)):
        expected = now + speed * step
        found = [
            base + turn * round((expected - base) / turn)
            for base in (toward + angle, toward - angle)
        ]
        nearest = min(found, key=lambda value: abs(value - expected))
        if step > 0.0:
            speed = (nearest - now) / step
        theta[m] = now = nearest
    return theta


def beam_way(result: Result) -> tuple[Floats, Floats]:
    """Start of places along a beam, shape (places, 2), and their ways, (rows, places, 2) [m].

    The history tells the centre of mass and the gaps of both ends, or of all nodes. Where only both
    ends are known, the parabola is taken that has them and the centre of mass.
    """
    beam = cast("Beam", result.scene.bodies[0])
    along = np.array([np.cos(beam.inclination), np.sin(beam.inclination)])
    across = np.array([-along[1], along[0]])
    count = beam.elements + 1 if beam.contact == "along" else 2
    normals, gaps = _gaps(result, count)
    centre = _centre(result)
    way = centre - centre[0]
    shares = np.linspace(-1.0, 1.0, count if count > 2 else _NODES)
    start = np.asarray(beam.center) + 0.5 * beam.length * shares[:, None] * along
    bent = np.zeros((len(centre), len(shares)))
    slopes = normals @ across
    if len(normals) and np.abs(slopes).max() > _STEEP:
        plane = int(np.argmax(np.abs(slopes)))
        change = gaps[:, plane] - gaps[0, plane]
        known = (change - (way @ normals[plane])[:, None]) / slopes[plane]
        if count > 2:
            bent = known
        else:
            mean, half = 0.5 * known.sum(axis=1), 0.5 * (known[:, 1] - known[:, 0])
            bow = -1.5 * mean  # the mean over the beam is 0
            bent = mean[:, None] + half[:, None] * shares + bow[:, None] * (1.0 - shares**2)
    return start, way[:, None, :] + bent[:, :, None] * across


def _gaps(result: Result, places: int) -> tuple[Floats, Floats]:
    """Normals of the planes (planes, 2) and gaps (rows, planes, places); none if not stored."""
    by_name = {o.name: o for o in result.scene.rigid_obstacles if isinstance(o, HalfSpace)}
    planes = [by_name[pair[1]] for pair, _ in contact_pairs(result.scene)]
    names = [f"gap.{k}" for k in range(len(planes) * places)]
    rows = result.history.sizes["time"]
    if not names or any(name not in result.history for name in names):
        return np.empty((0, 2)), np.empty((rows, 0, places))
    values = np.array([result.history[name].values for name in names])
    normals = np.array([plane.unit_normal for plane in planes], dtype=np.float64)
    return normals, values.T.reshape(rows, len(planes), places)


def _centre(result: Result) -> Floats:
    name = result.scene.bodies[0].name
    return np.stack([result.history[f"{name}.{c}"].values for c in "xy"], axis=1)


def _caption(result: Result, factors: list[float]) -> str:
    body = result.scene.bodies[0]
    text = "The rod" if isinstance(body, Rod) else "The beam, whose axis touches,"
    text += " and where it was at first (grey)"
    if isinstance(body, Beam) and body.contact != "along":
        text += "; bent to a parabola through its ends and centre of mass, which the history tells"
    if len(factors) > 1:
        text += (
            f"; its way is magnified {factors[-1]:g} times at first, the obstacle is not moved: it "
            "may seem to enter it"
        )
    return text + "."
