"""Points, rods and beams beside solids in moving pictures: the triangles of balls and tubes."""

from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.report.skin import Skin

_THIN = 0.008  # share of the size that what has no radius is thick
_AROUND, _HIGH = 24, 9  # corners of a disc, and around a ball or tube; rings of a ball


@dataclass(frozen=True)
class Tubes:
    """What is drawn of lines and balls.

    Attributes:
        ends: Nodes before and after each ring of corners along its line, the same of a ball,
            shape (rings, 2).
        nodes: Node in the middle of each ring, shape (rings,).
        shift: How far the ring is from the node along its axis, and its radius [m], (rings, 2).
        triangles: Corners by number, ring after ring, shape (triangles, 3).
        segments: Outline in the plane, likewise, shape (segments, 2).
        dim: Of the picture.
    """

    ends: Integers
    nodes: Integers
    shift: Floats
    triangles: Integers
    segments: Integers
    dim: int

    @property
    def width(self) -> int:
        """Corners of a ring: in the plane two ends of a diameter."""
        return 2 if self.dim == 2 else _AROUND

    def places(self, place: Floats) -> Floats:
        """Corners, shape (corners, 3), where the nodes are at some places (nodes, 3)."""
        along = place[self.ends[:, 1]] - place[self.ends[:, 0]]
        length = np.linalg.norm(along, axis=1, keepdims=True)
        upright = np.eye(3)[1]
        along = np.where(length > 0.0, along / np.maximum(length, 1e-300), upright)
        first = np.cross(np.eye(3)[2], along)
        flat = np.linalg.norm(first, axis=1, keepdims=True)
        first = np.where(flat > 1e-6, first / np.maximum(flat, 1e-300), np.eye(3)[0])
        second = np.cross(along, first)
        turn = 2.0 * np.pi * np.arange(self.width) / self.width
        ring = np.cos(turn)[:, None] * first[:, None] + np.sin(turn)[:, None] * second[:, None]
        middle = place[self.nodes] + self.shift[:, :1] * along
        corners: Floats = middle[:, None] + self.shift[:, 1:, None] * ring
        return corners.reshape(-1, 3)


def tubes_of(skin: Skin) -> Tubes:
    """Balls as rings from pole to pole, lines as a ring at each end of each piece."""
    thin = _THIN * skin.size
    radius = np.where(skin.radius > 0.0, skin.radius, thin)
    polar = np.linspace(0.0, np.pi, _HIGH if skin.dim == 3 else _AROUND // 2 + 1)
    strips: list[tuple[Integers, Integers, Floats]] = []
    for node in skin.balls:
        rings = np.full(len(polar), node)
        shift = radius[node] * np.stack([-np.cos(polar), np.sin(polar)], axis=1)
        strips.append((np.stack([rings, rings], axis=1), rings, shift))
    for a, b in skin.lines:
        shift = np.array([[0.0, radius[a]], [0.0, radius[b]]])
        strips.append((np.array([[a, b], [a, b]]), np.array([a, b]), shift))
    none = np.empty((0, 2), dtype=np.int64)
    ends = np.concatenate([none, *(strip[0] for strip in strips)])
    nodes = np.concatenate([none[:, 0], *(strip[1] for strip in strips)])
    shifts = np.concatenate([np.empty((0, 2)), *(strip[2] for strip in strips)])
    width = 2 if skin.dim == 2 else _AROUND
    faces, edges, first = [np.empty((0, 3), dtype=np.int64)], [none], 0
    for strip in strips:
        count = len(strip[1])
        grid = (first + np.arange(count))[:, None] * width + np.arange(width)
        beside = np.roll(grid, -1, axis=1) if width > 2 else grid[:, ::-1]
        a, b, c, d = grid[:-1], beside[:-1], beside[1:], grid[1:]
        if width == 2:
            a, b, c, d = (part[:, :1] for part in (a, b, c, d))
            edges.append(np.concatenate([np.stack([grid[:-1, k], grid[1:, k]], axis=1)
                                         for k in (0, 1)]))  # fmt: skip
        faces.append(np.stack([a, b, c], axis=-1).reshape(-1, 3))
        faces.append(np.stack([a, c, d], axis=-1).reshape(-1, 3))
        first += count
    return Tubes(ends, nodes, shifts, np.concatenate(faces), np.concatenate(edges), skin.dim)
