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
from impactfem.contact.line_kernels import near_ways
from impactfem.contact.mortar_surface import Surface, unit

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
    here, there = _balls(carrier, ways[0]), _balls(other, ways[1])
    begin, end = -depth, np.full(len(depth), reach)
    begin, end = _clip_to_box(here, there, begin, end)
    looking = np.flatnonzero(end >= begin)
    found = [np.empty((0, 2), dtype=np.int64)]
    level_here, level_there = _levels(here.radius), _levels(there.radius)
    for small in np.unique(level_there):
        mine = np.flatnonzero(level_there == small)
        size = float(there.radius[mine].max())
        tree = KDTree(there.centre[mine]) if len(mine) * len(looking) > _FEW else None
        for level in np.unique(level_here[looking]):
            faces = looking[level_here[looking] == level]
            for start in range(0, len(faces), _CHUNK):
                some = faces[start : start + _CHUNK]
                few = len(some) * len(mine) <= _FEW
                looks = there.centre[mine] if few else tree
                pair = _near(here, some, begin, end, looks, size)
                pair[:, 1] = mine[pair[:, 1]]
                found.append(_opposite(here, there, pair, begin, end))
    pairs = np.concatenate(found)
    # A pair may have been met from several points on the way.
    keys = np.sort(pairs[:, 0] * len(other.faces) + pairs[:, 1])
    keys = keys[np.diff(keys, prepend=-1) > 0]
    return np.stack([keys // len(other.faces), keys % len(other.faces)], axis=1)


def _near(
    here: "_Balls", faces: Integers, begin: Floats, end: Floats, tree: Any, size: float
) -> Integers:
    """Some faces and the centres of a tree near their ways, (pairs, 2); repeated if met twice.

    Args:
        here: Balls of the carrier's faces.
        faces: Some of these, of about the same size.
        begin: Where the ways of all faces begin [m].
        end: Where they end [m].
        tree: Centres of faces of the other, of few of them as an array.
        size: Largest radius of these faces [m].
    """
    step = 2.0 * (float(here.radius[faces].max()) + size)
    counts = np.maximum(np.ceil((end[faces] - begin[faces]) / step), 1.0).astype(np.int64)
    if isinstance(tree, np.ndarray):
        paces, balls = (end[faces] - begin[faces]) / counts, (here.centre, here.radius, here.normal)
        own = faces, counts, paces, begin[faces], balls, here.tilt, tree, size
        return np.asarray(near_ways(*own))
    face = np.repeat(faces, counts)
    part = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts) + 0.5
    pace = np.repeat((end[faces] - begin[faces]) / counts, counts)
    along = begin[face] + part * pace
    radius = here.radius[face] + size + 0.5 * pace
    radius += here.tilt[face] * (np.abs(along) + 0.5 * pace)
    looks = KDTree(here.centre[face] + along[:, None] * here.normal[face])
    near = looks.sparse_distance_matrix(tree, float(radius.max()), output_type="ndarray")
    near = near[near["v"] <= radius[near["i"]]]
    return np.stack([face[near["i"]], near["j"].astype(np.int64)], axis=1)


class _Balls:
    """Centre, radius and normal of faces, and how far their ways turn away from it."""

    def __init__(self, centre: Floats, radius: Floats, normal: Floats, tilt: Floats) -> None:
        self.centre, self.radius, self.normal, self.tilt = centre, radius, normal, tilt


def _balls(side: Surface, ways: Floats) -> _Balls:
    x = side.points[side.faces]
    centre = x.mean(axis=1)
    radius = np.linalg.norm(x - centre[:, None], axis=2).max(axis=1, initial=0.0)
    normal = unit(side.vectors.sum(axis=1))
    tilt = np.linalg.norm(ways - normal[:, None], axis=2).max(axis=1, initial=0.0)
    return _Balls(centre, radius, normal, tilt)


def _levels(radius: Floats) -> Integers:
    """Powers of two of the sizes of faces, shape (faces,)."""
    tiny = np.finfo(np.float64).tiny
    return np.asarray(np.floor(np.log2(np.maximum(radius, tiny))), dtype=np.int64)


def _clip_to_box(here: _Balls, there: _Balls, begin: Floats, end: Floats) -> tuple[Floats, Floats]:
    """Shorten ways to where they can meet the box about all the others; empty ones end first."""
    if not len(there.centre) or not len(here.centre):
        return begin, begin - 1.0
    low = (there.centre - there.radius[:, None]).min(axis=0)
    high = (there.centre + there.radius[:, None]).max(axis=0)
    margin = here.radius + here.tilt * np.maximum(np.abs(begin), np.abs(end))
    for axis, (least, most) in enumerate(zip(low, high, strict=True)):
        slope, start = here.normal[:, axis], here.centre[:, axis]
        flat = np.abs(slope) < 1e-12
        safe = np.where(flat, 1.0, slope)
        first, last = (least - margin - start) / safe, (most + margin - start) / safe
        first, last = np.minimum(first, last), np.maximum(first, last)
        beside = (start < least - margin) | (start > most + margin)
        first = np.where(flat, np.where(beside, np.inf, -np.inf), first)
        last = np.where(flat, np.where(beside, -np.inf, np.inf), last)
        begin, end = np.maximum(begin, first), np.minimum(end, last)
    return begin, end


def _opposite(here: _Balls, there: _Balls, pair: Integers, begin: Floats, end: Floats) -> Integers:
    """Those of some pairs that face each other and lie beside each other's way."""
    f, g = pair.T
    size = here.radius[f] + there.radius[g]
    way = there.centre[g] - here.centre[f]
    along = np.einsum("pd,pd->p", way, here.normal[f])
    aside = np.linalg.norm(way - along[:, None] * here.normal[f], axis=1)
    facing = np.einsum("pd,pd->p", here.normal[f], there.normal[g])
    tilt = here.tilt[f]
    kept = facing < -FACING + 2.0 * (tilt + there.tilt[g])
    kept &= aside <= size + tilt * (np.abs(along) + size)
    slack = size + tilt * np.maximum(np.abs(begin[f]), np.abs(end[f]))
    kept &= (along >= begin[f] - slack) & (along <= end[f] + slack)
    return np.asarray(pair[kept])
