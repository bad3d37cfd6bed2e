"""Which faces of two surfaces can meet: those opposite each other along the normals, within reach.

A face is a ball about its centre. The other's centres are looked up in k-d trees, at points along
the way that the carrier's face sees (its normal, `depth` backwards and `reach` forwards), so that
the work grows with the number of faces and with reach over size of the faces, not with its square.
Faces are sorted by size in powers of two: few large ones do not make many small ones costly.
"""

from typing import Any

import numpy as np
from scipy.spatial import KDTree

from impactfem.arrays import Floats, Integers
from impactfem.contact.line_kernels import Balls, balls_of, clipped_ways, opposite, pairs_among
from impactfem.contact.mortar_surface import Surface

FACING = 0.2
"""Least cosine between one normal and the other reversed for two faces to be opposite."""

_FEW = 50_000  # pairs of faces up to which each is looked at
_CHUNK = 5_000  # faces looked at in one go: bounds the memory


def candidates(
    carrier: Surface,
    other: Surface,
    reach: float,
    depth: Floats,
    ways: tuple[Floats, Floats],
) -> Integers:
    """Pairs of faces that can meet; some will turn out not to overlap.

    Args:
        carrier: The surface that looks.
        other: The surface that is looked for.
        reach: How far each face looks outwards [m].
        depth: How far it looks inwards [m], shape (carrier's faces,).
        ways: Directions in which the parts of the faces look, of both surfaces, shape
            (faces, directions, dim), unit vectors.

    Returns:
        Faces of the carrier and of the other, sorted, shape (pairs, 2).
    """
    here, there = (
        balls_of(side.points, side.faces, side.vectors, own)
        for side, own in zip((carrier, other), ways, strict=True)
    )
    begin, end = clipped_ways(here, there, -depth, np.full(len(depth), reach))
    looking = np.flatnonzero(end >= begin)
    if len(looking) * len(other.faces) <= _FEW:
        return np.asarray(pairs_among(looking, here, there, begin, end, FACING))
    found = [np.empty((0, 2), dtype=np.int64)]
    level_here, level_there = (_levels(balls.radius) for balls in (here, there))
    for small in np.unique(level_there):
        mine = np.flatnonzero(level_there == small)
        size, tree = float(there.radius[mine].max()), KDTree(there.centre[mine])
        for level in np.unique(level_here[looking]):
            faces = looking[level_here[looking] == level]
            for start in range(0, len(faces), _CHUNK):
                some = faces[start : start + _CHUNK]
                pair = _near(here, some, begin, end, tree, size)
                pair[:, 1] = mine[pair[:, 1]]
                found.append(opposite(pair, here, there, begin, end, FACING))
    pairs = np.concatenate(found)
    # A pair may have been met from several points on the way.
    keys = np.sort(pairs[:, 0] * len(other.faces) + pairs[:, 1])
    keys = keys[np.diff(keys, prepend=-1) > 0]
    return np.stack([keys // len(other.faces), keys % len(other.faces)], axis=1)


def _near(
    here: Balls, faces: Integers, begin: Floats, end: Floats, tree: Any, size: float
) -> Integers:
    """Some faces and the centres of a tree near their ways, (pairs, 2); repeated if met twice.

    Args:
        here: Balls of the carrier's faces.
        faces: Some of these, of about the same size.
        begin: Where the ways of all faces begin [m].
        end: Where they end [m].
        tree: Centres of faces of the other.
        size: Largest radius of these faces [m].
    """
    centre, radius, normal, tilt = here
    step = 2.0 * (float(radius[faces].max()) + size)
    counts = np.maximum(np.ceil((end[faces] - begin[faces]) / step), 1.0).astype(np.int64)
    face = np.repeat(faces, counts)
    part = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts) + 0.5
    pace = np.repeat((end[faces] - begin[faces]) / counts, counts)
    along = begin[face] + part * pace
    around = radius[face] + size + 0.5 * pace
    around += tilt[face] * (np.abs(along) + 0.5 * pace)
    looks = KDTree(centre[face] + along[:, None] * normal[face])
    near = looks.sparse_distance_matrix(tree, float(around.max()), output_type="ndarray")
    near = near[near["v"] <= around[near["i"]]]
    return np.stack([face[near["i"]], near["j"].astype(np.int64)], axis=1)


def _levels(radius: Floats) -> Integers:
    """Powers of two of the sizes of faces, shape (faces,)."""
    tiny = np.finfo(np.float64).tiny
    return np.asarray(np.floor(np.log2(np.maximum(radius, tiny))), dtype=np.int64)
