"""The moving picture of bodies: triangles coloured by stress, balls, tubes, pressed faces."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.report.camera import Camera, vertical_of
from impactfem.report.page.chart import numbers
from impactfem.report.page.motion_data import (
    BUDGET,
    MOST_FRAMES,
    factors_of,
    packed,
    packed_indices,
    telling_frames,
)
from impactfem.report.page.motion_obstacles import line_obstacles, plane_obstacles, space_obstacles
from impactfem.report.page.motion_slender import Tubes, tubes_of
from impactfem.report.page.numbers import quantity
from impactfem.report.skin import Skin
from impactfem.report.space_picture import skin_of
from impactfem.result import Record, Snapshots

_LEAST_FRAMES = 60
_REACH = 0.8  # sizes that planes are drawn beyond the middle of a body
_MOST_STRESSED = 0.999  # quantile of the stress at which the colours end


@dataclass(frozen=True)
class Shown:
    """Part of a skin that is drawn.

    Attributes:
        nodes: Nodes of the mesh, shape (shown,).
        triangles: Their corners as indices into the nodes, shape (triangles, 3).
        segments: Boundary in the plane, likewise, shape (segments, 2).
    """

    nodes: Integers
    triangles: Integers
    segments: Integers


@dataclass(frozen=True)
class Frame:
    """What is kept of a layer.

    Attributes:
        time: [s].
        way: Displacement of the nodes that are drawn and of the corners of balls and tubes [m],
            shape (drawn, 3).
        stress: Von Mises stress there [Pa], shape (drawn,); 0 of balls and tubes.
        pressed: Segments under contact pressure at both ends.
    """

    time: float
    way: Floats
    stress: Floats
    pressed: list[int]


def bodies_motion(result: Record, fields: Snapshots) -> dict[str, Any] | None:
    """Data of bodies in the plane or in space.

    Returns:
        None if no kept layer is finite.
    """
    skin = skin_of(result, fields)
    weight = (2 * skin.dim + 1) * 4 / 3  # bytes of a node in a frame
    most = int(np.clip(BUDGET / (weight * len(skin.nodes)), _LEAST_FRAMES, MOST_FRAMES))
    layers = telling_frames(result, fields.times, most)
    shown = choose(skin, int(BUDGET / (weight * len(layers))))
    tubes = tubes_of(_spanned(skin, layers))
    corners = tubes.places(skin.points)
    made = (_frame(skin, shown, tubes, int(layer)) for layer in layers)
    frames = [frame for frame in made if frame is not None]
    if not frames:
        return None
    times = np.array([frame.time for frame in frames])
    way = np.array([frame.way for frame in frames])
    stress = np.array([frame.stress for frame in frames])
    limit = float(max(np.quantile(part, _MOST_STRESSED) for part in stress)) or 1.0
    farthest = float(np.linalg.norm(way, axis=2).max())
    factors = factors_of(farthest, skin.size)
    drawn, first = len(shown.triangles), len(shown.nodes)
    segments = np.concatenate([shown.segments, tubes.segments + first])
    own = _plane(result, segments, frames) if skin.dim == 2 else _space(result, skin, times)
    return {
        "caption": _caption(result, skin, shown, factors, limit),
        "times": times,
        "reference": packed(np.concatenate([skin.points[shown.nodes], corners])[:, : skin.dim]),
        "displacement": packed(way[:, :, : skin.dim]),
        "triangles": packed_indices(np.concatenate([shown.triangles, tubes.triangles + first])),
        "coloured": drawn,
        "value": packed(np.minimum(stress, limit), bits=8),
        "limit": limit,
        "valueName": "von Mises stress [Pa]",
        "size": skin.size,
        "factors": factors,
        "factor": 1.0,
    } | own


def choose(skin: Skin, most: int) -> Shown:
    """Draw all nodes, or one for each cell of a grid that is as coarse as needed.

    Nodes of different bodies, and those on and off the boundary in the plane, stay apart; the
    boundary gets a grid of half the width.

    Args:
        skin: Of the solids.
        most: Nodes at most.
    """
    nodes = skin.nodes
    points = skin.points[nodes] - skin.points.min(axis=0)
    rim = np.isin(nodes, skin.segments)
    width = skin.size / np.sqrt(max(most, 4)) / np.where(rim, 2.0, 1.0)
    groups, kept = np.arange(len(nodes)), np.arange(len(nodes))
    while len(kept) > most:
        cells = np.floor(points / width[:, None]).astype(np.int64)
        keys = np.column_stack([skin.bodies[nodes], rim, cells])
        groups = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
        kept = _middles(points, groups)
        width *= 1.15
    place = np.full(len(skin.points), -1, dtype=np.int64)
    place[nodes] = groups
    return Shown(nodes[kept], _proper(place[skin.triangles]), _proper(place[skin.segments]))


def _middles(points: Floats, groups: Integers) -> Integers:
    """Index of the point of each group that is nearest to the mean of the group."""
    counts = np.bincount(groups)
    means = np.stack([np.bincount(groups, axis) / counts for axis in points.T], axis=1)
    order = np.lexsort([np.linalg.norm(points - means[groups], axis=1), groups])
    return np.asarray(order[np.append(0, np.cumsum(counts)[:-1])])


def _spanned(skin: Skin, layers: Integers) -> Skin:
    """The skin with the extent of the motion, by which the thickness of thin things goes."""
    if len(skin.triangles):
        return skin
    places = [skin.snapshot(int(layer)).place for layer in layers]
    return replace(skin, span=float(np.nanmax(np.ptp(np.concatenate(places), axis=0))))


def _frame(skin: Skin, shown: Shown, tubes: Tubes, layer: int) -> Frame | None:
    """Read a layer and keep what is drawn of it: all layers at once may not fit in memory."""
    snapshot = skin.snapshot(layer)
    if not snapshot.is_finite:
        return None
    ends = snapshot.pressure[shown.nodes[shown.segments]]
    corners = tubes.places(snapshot.place) - tubes.places(skin.points)
    return Frame(
        snapshot.time,
        np.concatenate([(snapshot.place - skin.points)[shown.nodes], corners]),
        np.concatenate([snapshot.von_mises[shown.nodes], np.zeros(len(corners))]),
        np.flatnonzero((ends > 0.0).all(axis=1)).tolist(),
    )


def _proper(parts: Integers) -> Integers:
    """Triangles or segments whose corners are still apart, each once."""
    ordered = np.sort(parts, axis=1)
    apart = (np.diff(ordered, axis=1) > 0).all(axis=1)
    first = np.unique(ordered[apart], axis=0, return_index=True)[1]
    return np.asarray(parts[apart][np.sort(first)])


def _plane(result: Record, segments: Integers, frames: list[Frame]) -> dict[str, Any]:
    axial = any(solid.is_axisymmetric for solid in result.scene.solids)
    times = np.array([frame.time for frame in frames])
    place = line_obstacles if result.scene.dim == 1 else plane_obstacles
    return {
        "kind": "plane",
        "mirror": axial,
        "segments": packed_indices(segments),
        "pressed": [frame.pressed for frame in frames],
        "obstacles": place(result.scene.obstacles, times),
    }


def _space(result: Record, skin: Skin, times: Floats) -> dict[str, Any]:
    points = skin.points[skin.nodes]
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    reach = _REACH * skin.size
    return {
        "kind": "space",
        "towards": numbers(Camera.of(result.scene).towards),
        "up": numbers(vertical_of(result.scene)),
        "obstacles": space_obstacles(result.scene.obstacles, times, centre, reach),
    }


def _caption(result: Record, skin: Skin, shown: Shown, factors: list[float], limit: float) -> str:
    several = len(result.scene.bodies) > 1
    text = "Deformed bodies" if several else "Deformed body"
    if len(skin.triangles):
        text += f", coloured by the von Mises stress up to {quantity(limit, 'Pa', 3)}"
    text += ", true to scale" if len(factors) == 1 else (
        ", true to scale at first; displacements can be magnified, but obstacles and gaps are not, "
        "so that magnified bodies may seem to overlap them"
    )  # fmt: skip
    if skin.dim == 2 and len(skin.triangles):
        text += "; orange is the boundary under contact pressure"
        if any(solid.is_axisymmetric for solid in result.scene.solids):
            text += "; the section through the axis, mirrored"
    if skin.mirrors:
        text += f"; 1 of {2 ** len(skin.mirrors)} parts is computed, the others are mirror images"
        text += ", the one in front left out" if skin.opened else ""
    if len(shown.triangles) and len(shown.nodes) < len(skin.nodes):
        text += f"; {len(shown.nodes)} of {len(skin.nodes)} nodes are drawn"
    return text + "."
