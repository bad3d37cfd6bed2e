"""Bodies that lie in each other: against boxes, whose overlap is known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactfem.contact.boundary import Boundary
from impactfem.contact.overlap import folded, in_obstacle, inside, overlap
from impactfem.contact.self_pairs import WithinBody
from impactfem.scene import HalfSpace, RigidBox, RigidCylinder, RigidSphere


def polygon(points):
    """Outside of a polygon given counterclockwise."""
    points = np.asarray(points, dtype=float)
    count = len(points)
    faces = np.stack([np.arange(count), np.roll(np.arange(count), -1)], axis=1)
    along = points[faces[:, 1]] - points[faces[:, 0]]
    return made(points, faces, np.stack([along[:, 1], -along[:, 0]], axis=1))


def box(low, high, parts=3):
    """Outside of a box in space, its sides cut into squares or triangles of them."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    grid = np.linspace(0.0, 1.0, parts + 1)
    points, faces, outward = [], [], []
    for axis in range(3):
        for end in (0.0, 1.0):
            for u in range(parts):
                for v in range(parts):
                    square = np.full((4, 3), end)
                    square[:, (axis + 1) % 3] = grid[[u, u + 1, u, u + 1]]
                    square[:, (axis + 2) % 3] = grid[[v, v, v + 1, v + 1]]
                    faces.append(len(points) + np.arange(4))
                    points += list(low + square * (high - low))
                    outward.append(np.eye(3)[axis] * (2.0 * end - 1.0))
    return made(np.array(points), np.array(faces), np.array(outward))


def made(points, faces, outward):
    none = np.zeros((len(faces), faces.shape[1]))
    return Boundary(
        np.arange(len(points)), points, faces,
        outward / np.linalg.norm(outward, axis=1)[:, None], none, none, (),
        np.zeros((len(faces), 0), dtype=bool),
    )  # fmt: skip


def scaled(body, size):
    """A body of another size."""
    return replace(body, points=size * body.points)


LETTER_L = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]


def test_inside_of_a_body_that_is_not_convex():
    points = np.random.default_rng(0).uniform(-0.5, 2.5, (500, 2))
    x, y = points.T
    expected = (x > 0) & (y > 0) & (x < 2) & (y < 2) & ~((x > 1) & (y > 1))
    body = polygon(LETTER_L)
    assert (inside(body, body.points, points) == expected).all()


def test_inside_of_a_box_in_space():
    points = np.random.default_rng(1).uniform(-0.5, 1.5, (300, 3))
    expected = ((points > 0.0) & (points < 1.0)).all(axis=1)
    body = box([0, 0, 0], [1, 1, 1])
    assert (inside(body, body.points, points) == expected).all()


@settings(max_examples=40, deadline=None)
@given(st.floats(-0.9, 0.9), st.floats(-0.05, 0.05), st.floats(-0.05, 0.05))
def test_boxes_overlap_where_they_do(across, y, z):
    """Shifted along x by less than their width: the depth is that of what is left."""
    one, two = box([0, 0, 0], [1, 1, 1]), box([across, y, z], [1 + across, 1 + y, 1 + z])
    found = overlap(one, one.points, two, two.points)
    assert found is not None
    depth, place = found
    assert 0.0 < depth <= 0.5 + 1e-9  # nothing in a cube is deeper
    assert ((place > -0.1) & (place < 1.1)).any()


@settings(max_examples=40, deadline=None)
@given(st.floats(0.0, 0.5), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_boxes_that_touch_or_are_apart_do_not_overlap(gap, y, z):
    one, two = box([0, 0, 0], [1, 1, 1]), box([1 + gap, y, z], [2 + gap, 1 + y, 1 + z])
    assert overlap(one, one.points, two, two.points) is None
    assert overlap(one, one.points, two, two.points, closely=True) is None


def test_thin_bodies_that_cross_between_middles_of_faces_are_seen_closely():
    lying = polygon([[x, 0.0] for x in (-2, -1, 0, 1, 2)] + [[x, 0.4] for x in (2, 1, 0, -1, -2)])
    standing = polygon([[y, x] for x, y in lying.points[::-1]] - np.array([0.2, 0.0]))
    assert overlap(lying, lying.points, standing, standing.points) is None
    depth, place = overlap(lying, lying.points, standing, standing.points, closely=True)
    assert 0.0 < depth <= 0.2
    assert np.abs(place).max() <= 0.4


CUBE, HELD = box([-1, -1, 0], [1, 1, 2]), box([-1, -1, -0.5], [1, 1, 1.5])


@pytest.mark.parametrize(
    ("obstacle", "body", "seen"),
    [
        (RigidSphere(name="pin", center=[0.1, 0.2, 1.1], radius=0.01), CUBE, True),
        (RigidCylinder(name="needle", point=[0.1, 0.2, 1.1], radius=0.01, axis=[0, 0, 1]),
         CUBE, True),
        (RigidBox(name="blade", center=[0.1, 0.0, 1.0], size=[0.05, 9.0, 9.0]), CUBE, True),
        (RigidBox(name="nail", center=[0.1, 0.1, 1.0], size=[0.01, 0.01, 9.0]), CUBE, True),
        (RigidBox(name="table", center=[-5.0, 0.0, -0.5], size=[10.0, 1.0, 1.0]), CUBE, False),
        (RigidSphere(name="ball", center=[0.1, 0.2, -0.3], radius=0.3), CUBE, False),
        (HalfSpace(name="floor", point=[0, 0, 0], normal=[0, 0, 1]), HELD, False),
        (RigidBox(name="table", center=[0.0, 0.0, 0.0], size=[0.5, 0.5, 2.0],
                  motion=["0", "0", "t - 1"]), CUBE, False),
        (RigidBox(name="table", center=[0.0, 0.0, 0.0], size=[0.5, 0.5, 2.0],
                  motion=["0", "0", "t"]), CUBE, True),
    ],
)  # fmt: skip
@pytest.mark.parametrize("size", [1e-9, 1.0, 1e3])
def test_obstacles_between_nodes_are_seen_where_they_are(obstacle, body, seen, size):
    if obstacle.moves and size != 1.0:
        return
    keys = {key: np.multiply(getattr(obstacle, key), size).tolist()
            for key in ("center", "point", "radius", "size") if hasattr(obstacle, key)}  # fmt: skip
    place = in_obstacle(replace(obstacle, **keys), 0.0, scaled(body, size), size * body.points)
    assert (place is not None) == seen


@pytest.mark.parametrize("depth", [0.01, 0.1, 0.3])
def test_depth_of_boxes_side_by_side(depth):
    left, right = box([0, 0, 0], [1, 1, 1]), box([1 - depth, 0, 0], [2 - depth, 1, 1])
    found, place = overlap(left, left.points, right, right.points)
    assert found == pytest.approx(min(depth, 0.5), abs=1e-12)
    assert place[0] == pytest.approx(1.0) or place[0] == pytest.approx(1.0 - depth)


def test_body_in_the_notch_of_another_is_outside_of_it():
    notch, small = polygon(LETTER_L), polygon([[1.1, 1.1], [1.9, 1.1], [1.9, 1.9], [1.1, 1.9]])
    assert overlap(notch, notch.points, small, small.points) is None
    moved = small.points - [0.3, 0.0]
    depth, _ = overlap(notch, notch.points, small, moved)
    assert depth == pytest.approx(0.2, abs=0.01)


@pytest.mark.parametrize("angle", [0.4, 1.6, 3.0])
def test_bodies_that_have_turned_are_seen_where_they_are(angle):
    """By normals of t = 0 a body turned by half a turn was inside out: bodies beside it in it."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    body, small = polygon(LETTER_L), polygon([[1.1, 1.1], [1.9, 1.1], [1.9, 1.9], [1.1, 1.9]])
    assert overlap(body, body.points @ turn.T, small, small.points @ turn.T) is None
    moved = (small.points - [0.3, 0.0]) @ turn.T
    depth, _ = overlap(body, body.points @ turn.T, small, moved)
    assert depth == pytest.approx(0.2, abs=0.01)


def test_a_body_that_is_bent_into_itself_is_seen():
    """A strip that is bent to a ring, and further."""
    x = np.linspace(0.0, 1.0, 41)
    outside = [[s, 0.0] for s in x] + [[s, 0.05] for s in x[::-1]]
    strip = polygon(outside)

    def bent(turns):
        radius = 1.0 / (2.0 * np.pi * turns)
        angle = strip.points[:, 0] / radius
        arms = radius - strip.points[:, 1]
        return np.stack([arms * np.sin(angle), radius - arms * np.cos(angle)], axis=1)

    def within(body):
        every = np.ones(len(body.faces), dtype=bool)
        return WithinBody.of(body, (every, every))

    assert folded(strip, strip.points, within(strip)) is None
    assert folded(strip, bent(0.95), within(strip)) is None
    assert folded(strip, bent(1.05), within(strip)) is not None
    cube = box([0, 0, 0], [1, 1, 1])
    assert folded(cube, box([0, 0, 0], [1, 2, 1]).points, within(cube)) is None
