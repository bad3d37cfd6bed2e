"""The moving picture of solids: deformed triangles coloured by stress, obstacles, pressed faces."""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from impactfem.report.page.chart import numbers
from impactfem.report.page.motion_data import (
    BUDGET,
    MOST_FRAMES,
    factors_of,
    packed,
    packed_indices,
    telling_frames,
)
from impactfem.report.page.motion_obstacles import plane_obstacles, space_obstacles
from impactfem.report.skin import Skin, Snapshot
from impactfem.report.space_picture import Camera
from impactfem.result import Result, SolidFields
from impactfem.scene import HalfSpace, Solid

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

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


def bodies_motion(result: Result, fields: SolidFields) -> dict[str, Any] | None:
    """Data of one or several solids in the plane or in space.

    Returns:
        None if no kept layer is finite.
    """
    skin = Skin.of(fields)
    weight = (2 * skin.dim + 1) * 4 / 3  # bytes of a node in a frame
    most = int(np.clip(BUDGET / (weight * len(skin.nodes)), _LEAST_FRAMES, MOST_FRAMES))
    layers = telling_frames(result, fields.times, most)
    shown = choose(skin, int(BUDGET / (weight * len(layers))))
    snapshots = [skin.snapshot(int(layer)) for layer in layers]
    snapshots = [snapshot for snapshot in snapshots if snapshot.is_finite]
    if not snapshots:
        return None
    times = np.array([snapshot.time for snapshot in snapshots])
    way = np.array([s.place[shown.nodes] for s in snapshots]) - skin.points[shown.nodes]
    stress = np.array([s.von_mises[shown.nodes] for s in snapshots])
    limit = float(max(np.quantile(part, _MOST_STRESSED) for part in stress)) or 1.0
    farthest = float(np.linalg.norm(way, axis=2).max())
    factors = factors_of(farthest, skin.size)
    own = _plane(result, shown, snapshots) if skin.dim == 2 else _space(result, skin, times)
    return {
        "caption": _caption(result, skin, shown, factors, limit),
        "times": times,
        "reference": packed(skin.points[shown.nodes, : skin.dim]),
        "displacement": packed(way[:, :, : skin.dim]),
        "triangles": packed_indices(shown.triangles),
        "value": packed(np.minimum(stress, limit), bits=8),
        "limit": limit,
        "valueName": "von Mises stress [Pa]",
        "size": skin.size,
        "factors": factors,
        "factor": 1.0,
    } | own


def choose(skin: Skin, most: int) -> Shown:
    """Draw all nodes, or one for each cell of a grid that is as coarse as needed.

    Args:
        skin: Of the solids.
        most: Nodes at most.
    """
    nodes = skin.nodes
    spacing = skin.size / np.sqrt(max(most, 4))
    groups, kept = np.arange(len(nodes)), np.arange(len(nodes))
    while len(kept) > most:
        cells = np.floor(skin.points[nodes] / spacing).astype(np.int64)
        keys = np.column_stack([skin.bodies[nodes], cells])  # bodies stay apart
        _, kept, groups = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        groups = groups.ravel()
        spacing *= 1.15
    place = np.full(len(skin.points), -1, dtype=np.int64)
    place[nodes] = groups
    return Shown(nodes[kept], _proper(place[skin.triangles]), _proper(place[skin.segments]))


def _proper(parts: Integers) -> Integers:
    """Triangles or segments whose corners are still apart, each once."""
    ordered = np.sort(parts, axis=1)
    apart = (np.diff(ordered, axis=1) > 0).all(axis=1)
    first = np.unique(ordered[apart], axis=0, return_index=True)[1]
    return np.asarray(parts[apart][np.sort(first)])


def _plane(result: Result, shown: Shown, snapshots: list[Snapshot]) -> dict[str, Any]:
    body = cast("Solid", result.scene.bodies[0])
    times = np.array([snapshot.time for snapshot in snapshots])
    ends = shown.nodes[shown.segments]
    pressed = [np.flatnonzero((s.pressure[ends] > 0.0).all(axis=1)).tolist() for s in snapshots]
    return {
        "kind": "plane",
        "mirror": body.is_axisymmetric,
        "segments": packed_indices(shown.segments),
        "pressed": pressed,
        "obstacles": plane_obstacles(result.scene.obstacles, times),
    }


def _space(result: Result, skin: Skin, times: Floats) -> dict[str, Any]:
    points = skin.points[skin.nodes]
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    gravity = np.asarray(result.scene.vector_gravity.at(0.0), dtype=np.float64)
    size = float(np.linalg.norm(gravity))
    vertical = -gravity / size if size > 0.0 else np.eye(3)[1]
    planes = [np.array(o.unit_normal) for o in result.scene.obstacles if isinstance(o, HalfSpace)]
    shapes = [cast("Solid", body).shape for body in result.scene.bodies]
    axes = sorted({axis for shape in shapes if shape is not None for axis in shape.symmetry})
    cuts = [-np.eye(3)["xyz".index(axis)] for axis in axes]
    camera = Camera.facing(vertical, [*planes, *cuts])
    reach = _REACH * skin.size
    return {
        "kind": "space",
        "towards": numbers(camera.towards),
        "up": numbers(vertical),
        "obstacles": space_obstacles(result.scene.obstacles, times, centre, reach),
    }


def _caption(result: Result, skin: Skin, shown: Shown, factors: list[float], limit: float) -> str:
    several = len(result.scene.bodies) > 1
    text = "Deformed bodies" if several else "Deformed body"
    text += f", coloured by the von Mises stress up to {limit:.3g} Pa"
    text += ", true to scale" if len(factors) == 1 else (
        ", true to scale at first; displacements can be magnified, but obstacles and gaps are not, "
        "so that magnified bodies may seem to overlap them"
    )  # fmt: skip
    if skin.dim == 2:
        text += "; orange is the boundary under contact pressure"
        if cast("Solid", result.scene.bodies[0]).is_axisymmetric:
            text += "; the section through the axis, mirrored"
    elif any(shape.symmetry for b in result.scene.bodies if (shape := cast("Solid", b).shape)):
        text += "; the part that is computed, cut at its planes of symmetry"
    if len(shown.nodes) < len(skin.nodes):
        text += f"; {len(shown.nodes)} of {len(skin.nodes)} nodes are drawn"
    return text + "."
