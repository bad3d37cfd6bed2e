"""How the outside of a body lies to the obstacles at t = 0."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.boundary import Boundary
from impactfem.contact.distance import signed_distance

FACING_AWAY = 0.2
"""A face whose outward normal has at least this share of the obstacle's normal faces away.

Exactly, it is 0: such a face has its own body between itself and the obstacle. But faces turn with
the body. Linear elasticity takes a rotation by an angle a for a strain of 1 - cos(a): at 0.2 (11.5
degrees) 2 %, more than most of its materials bear. What turns further needs another model anyway.
"""

UPRIGHT = -0.2
"""The same for obstacles whose normal is the same everywhere.

A face that stands upright on a plane, to 11.5 degrees, comes to lie on it only if it turns by a
right angle less that much; its lower edge belongs to the next face. Without contact unknowns it
keeps the mass that massless nodes lose.
"""

ROUNDING = 1e-9
"""Share of the body's size by which it may be inside an obstacle at t = 0."""

_HELD = 1e-6  # a node whose free directions have less than this share of the normal is held
_ASIDE = 1e-6  # share of the body's size between a way and those looked at on either side of it
_BLOCK = 256  # ways looked at together


@dataclass(frozen=True)
class Fields:
    """Gaps of all boundary nodes from all obstacles at t = 0.

    Attributes:
        gap: [m], shape (obstacles, nodes).
        normal: Shape (obstacles, nodes, dim).
        facing: Least component of the outward normals of a node's faces along the obstacle's
            normal, -1 face to face, shape (obstacles, nodes); 2 for nodes of no face in question.
        away: Nodes whose faces all face away, shape (obstacles, nodes).
        held: Nodes that supports keep from moving along the normal, shape (obstacles, nodes).
        hidden: Nodes that face the obstacle with other parts of the body between (the inside of a
            ring), shape (obstacles, nodes). Looked for in the plane only.
    """

    gap: Floats
    normal: Floats
    facing: Floats
    away: Booleans
    held: Booleans
    hidden: Booleans


def gap_fields(
    outside: Boundary,
    asked: Booleans,
    real: Booleans,
    obstacles: Sequence[Any],
    places: Floats,
    constrained: Booleans,
) -> Fields:
    """Measure gaps, normals, and how the faces of each node lie to each obstacle.

    Args:
        outside: The outside of the body.
        asked: Faces that may touch, shape (faces,).
        real: Faces that are no cuts through the body, shape (faces,).
        obstacles: The obstacles.
        places: Places of the nodes at t = 0 [m], shape (nodes, dim).
        constrained: Their prescribed components, shape (nodes, dim).
    """
    gaps, normals = zip(*(signed_distance(o, places, 0.0) for o in obstacles), strict=True)
    gap, normal = np.stack(gaps), np.stack(normals)
    facing = np.full(gap.shape, 2.0)
    hidden = np.zeros(gap.shape, dtype=bool)
    faces = outside.faces[asked]
    for k, field in enumerate(normal):
        along = np.einsum("fd,fkd->fk", outside.normals[asked], field[faces])
        np.minimum.at(facing[k], faces, along)
        if places.shape[1] == 2:
            # Where a way starts along a face or into it, the body is no hindrance but its own.
            clear = np.flatnonzero((facing[k] < -FACING_AWAY) & (gap[k] > 0.0))
            ways = -gap[k, clear, None] * field[clear]
            hidden[k, clear] = _behind(clear, ways, places, outside.faces[real], outside.size)
    free = np.linalg.norm(np.where(constrained, 0.0, normal), axis=2)
    limits = [UPRIGHT if obstacle.is_flat else FACING_AWAY for obstacle in obstacles]
    away = facing >= np.array(limits)[:, None]
    return Fields(gap, normal, facing, away, free <= _HELD, hidden)


def _behind(
    nodes: Integers, ways: Floats, places: Floats, faces: Integers, size: float
) -> Booleans:
    """Whether chords of the outside cross the straight ways of nodes in the plane.

    Faces are no hindrance to their own nodes, the one in the middle of degree 2 included. A way may
    pass exactly through the end of a chord, or run along one: two ways to either side of it are
    looked at, and both must be crossed.

    Args:
        nodes: Shape (nodes,).
        ways: From the nodes to the obstacle [m], shape (nodes, 2).
        places: Of all nodes [m].
        faces: Nodes of the faces, the two ends of the chords first, shape (faces, nodes per face).
        size: Size of the body [m].
    """
    found = np.zeros(len(nodes), dtype=bool)
    for start in range(0, len(nodes), _BLOCK):
        part = slice(start, start + _BLOCK)
        node, way = nodes[part], ways[part]
        length = np.hypot(*way.T)
        along = way / length[:, None]
        arms = places[faces[:, :2]][None] - places[node][:, None, None]  # (nodes, chords, 2, 2)
        ahead = np.einsum("ncei,ni->nce", arms, along)
        aside = arms[..., 1] * along[:, None, None, 0] - arms[..., 0] * along[:, None, None, 1]
        own = (faces[None] == node[:, None, None]).any(axis=2)
        crossed = np.ones(len(node), dtype=bool)
        for shift in (-_ASIDE * size, _ASIDE * size):
            left, right = aside[..., 0] - shift, aside[..., 1] - shift
            opposite = (left < 0.0) != (right < 0.0)
            share = left / np.where(opposite, left - right, 1.0)
            at = ahead[..., 0] + share * (ahead[..., 1] - ahead[..., 0])
            between = (at > 0.0) & (at < length[:, None])
            crossed &= (opposite & between & ~own).any(axis=1)
        found[part] = crossed
    return found
