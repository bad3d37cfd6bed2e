"""Which faces of a body meet others of it: a U whose arms close, in the plane and in space."""

from itertools import pairwise

import numpy as np
import pytest

from impactfem.contact.body_pairs import Side, make_pair
from impactfem.contact.boundary import Boundary
from impactfem.contact.mortar import mortar
from impactfem.contact.self_pairs import WithinBody

GAP, WALL, LENGTH, H = 0.01, 0.02, 0.2, 0.01


def outline(width=H):
    """A U that lies on its side, counterclockwise from the lower left corner, (nodes, 2)."""
    top, inside = 2 * WALL + GAP, WALL + GAP
    corners = [
        (0, 0), (LENGTH, 0), (LENGTH, WALL), (WALL, WALL), (WALL, inside), (LENGTH, inside),
        (LENGTH, top), (0, top), (0, 0),
    ]  # fmt: skip
    found = []
    for one, two in pairwise(np.array(corners, dtype=float)):
        count = max(1, round(np.linalg.norm(two - one) / width))
        found += [one + (two - one) * k / count for k in range(count)]
    return np.array(found)


def u_shape(dim=2, first=0):
    """Outside of the U, faces numbered from some node on; in space its walls between two planes."""
    flat = np.roll(outline(), -first, axis=0)
    count = len(flat)
    around = np.stack([np.arange(count), np.roll(np.arange(count), -1)], axis=1)
    along = flat[around[:, 1]] - flat[around[:, 0]]
    normals = np.stack([along[:, 1], -along[:, 0]], axis=1)
    points, faces = flat, around
    if dim == 3:
        heights = np.linspace(0.0, 0.03, 4)
        points = np.concatenate([np.column_stack([flat, np.full(count, z)]) for z in heights])
        faces = np.concatenate(
            [np.hstack([around + k * count, around + (k + 1) * count]) for k in range(3)]
        )
        normals = np.tile(np.column_stack([normals, np.zeros(count)]), (3, 1))
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    none = np.zeros(faces.shape)
    return Boundary(
        np.arange(len(points)), points, faces, normals, np.zeros((*faces.shape, dim)), none, (),
        np.zeros((len(faces), 0), dtype=bool),
    )  # fmt: skip


def closing(points, share):
    """The arms bent towards each other, by a share of the gap at their ends."""
    moved = points.copy()
    upper = np.where(points[:, 1] > WALL + 0.5 * GAP, -1.0, 1.0)
    moved[:, 1] += 0.5 * upper * share * GAP * np.maximum(points[:, 0] - WALL, 0.0) / LENGTH
    return moved


def pair_of(outside, reach=0.05):
    every = np.ones(len(outside.faces), dtype=bool)
    part = (outside, outside.points, every)
    found = make_pair((0, 0), (part, part), ("u", "u"), reach, updated=True, label="u.u")
    return found, [outside.points[side.nodes] for side in found.sides]


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("first", [0, 25, 40])
def test_arms_meet_as_two_surfaces_would_and_once(dim, first):
    """Also where the numbers of faces begin amid one of the arms."""
    outside = u_shape(dim, first)
    pair, _ = pair_of(outside)
    points = closing(outside.points, 0.8)
    found = pair.met([points, points])
    middle = outside.points[outside.faces].mean(axis=1)
    inner = (middle[:, 0] > WALL) & (np.abs(middle[:, 1] - WALL - 0.5 * GAP) < 0.51 * GAP)
    lower = inner & (middle[:, 1] < WALL + 0.5 * GAP) & (middle[:, 0] < LENGTH - 1e-9)
    upper = inner & (middle[:, 1] > WALL + 0.5 * GAP) & (middle[:, 0] < LENGTH - 1e-9)
    sides = [Side.of(outside, points, faces).surface for faces in (lower, upper)]
    carried = set(np.unique(found.faces[:, 0]))
    low = carried <= set(np.flatnonzero(lower))
    assert low or carried <= set(np.flatnonzero(upper))
    apart = mortar(*(sides if low else sides[::-1]), 0.05)
    # But for the bottom of the U, where neighbours do not meet.
    own = np.unique(outside.faces[lower if low else upper])
    away = np.isin(found.nodes, own[outside.points[own, 0] > WALL + 3 * H])
    same = outside.points[own[apart.nodes], 0] > WALL + 3 * H
    assert np.allclose(found.gap[away], apart.gap[same], rtol=0, atol=1e-12)
    assert np.allclose(found.area[away], apart.area[same], rtol=1e-9)
    length = 0.03 if dim == 3 else 1.0
    assert found.area.sum() == pytest.approx((LENGTH - WALL - 0.5 * H) * length, rel=0.06)
    assert (found.gap > 0.0).all()


def test_walls_as_thin_as_faces_do_not_meet_their_back():
    """By their distance along the normal they would lie in each other by their thickness."""
    outside = u_shape()
    squeezed = outside.points * [1.0, 0.4]  # walls of .8 faces
    pair, _ = pair_of(outside)
    assert pair.met([squeezed, squeezed]).gap.min() > 0.0
    every = np.ones(len(outside.faces), dtype=bool)
    bare = WithinBody.of(outside, [every, every])
    bare.near[:] = -1
    object.__setattr__(bare, "widths", np.zeros(len(outside.faces)))  # no wall is thin
    object.__setattr__(pair, "within", bare)
    assert pair.met([squeezed, squeezed]).gap.min() < -0.5 * H * 0.4


def test_the_side_that_carries_goes_on_while_the_patches_meet():
    outside = u_shape()
    pair, _ = pair_of(outside)
    near = closing(outside.points, 0.9)
    fresh = pair.met([near, near])
    roles = -pair.roles()
    roles[fresh.faces[:, 0]], roles[fresh.faces[:, 1]] = -1, 1  # as if the others had carried
    for share in (0.9, 0.5, 0.95):
        there = closing(outside.points, share)
        found = pair.met([there, there], None, roles)
        assert set(found.faces[:, 0]) == set(fresh.faces[:, 1])
    assert set(pair.met([near, near]).faces[:, 0]) == set(fresh.faces[:, 0])


def test_memory_of_a_followed_pair_goes_on_with_the_same_side():
    outside = u_shape()
    pair, _ = pair_of(outside)
    rows, count = [side.nodes for side in pair.sides], len(outside.points)
    one, two = (pair.meeting(rows, count) for _ in range(2))
    for share in (0.1, 0.6, 0.9):
        there = closing(outside.points, share)
        one(there, there)
    two.recall(one.memory)
    there = closing(outside.points, 0.95)
    assert np.array_equal(one(there, there).weights.toarray(), two(there, there).weights.toarray())
    assert np.array_equal(one.memory, two.memory, equal_nan=True)
