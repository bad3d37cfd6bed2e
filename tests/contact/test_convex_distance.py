"""Distances and depths of convex bodies beside coal's, which finds them by GJK and EPA."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from impactfem.contact.convex_pairs import ConvexPair, Marked
from impactfem.system.convex import Convex

ENDS = np.array([[0.0, 0.0, -0.15], [0.0, 0.0, 0.15]])
BOX = Convex.of(np.array(list(np.ndindex(2, 2, 2))) * [0.2, 0.3, 0.4] - [0.1, 0.15, 0.2])
CAPSULE, BALL = Convex.of(ENDS, 0.1), Convex.of(np.zeros((1, 3)), 0.15)
CYLINDER = Convex.cylinder(ENDS, 0.1)


def nearest(one, two, poses):
    """Least gap of two bodies with some rotations and centres."""
    sides, places = [], []
    for k, (shape, (turn, centre)) in enumerate(zip((one, two), poses, strict=True)):
        sides.append(Marked(shape, 4 * k + np.arange(4), 0.1, 3))
        places.append(centre + 0.1 * np.vstack([np.zeros(3), turn.T]))
    pair, places = ConvexPair(*sides, 8, 0.0), np.concatenate(places)
    return pair(places, places).gap.min()


@pytest.mark.parametrize(
    ("one", "two", "exact"),
    [
        (BOX, BOX, "depth"), (BOX, CAPSULE, "all"), (BOX, BALL, "all"), (CAPSULE, CAPSULE, "all"),
        (CAPSULE, BALL, "all"), (CYLINDER, BALL, "side"), (CYLINDER, CAPSULE, "side"),
    ],
)  # fmt: skip
def test_distances_agree_with_those_of_coal(one, two, exact):
    coal = pytest.importorskip("coal")
    shapes = {
        id(BOX): coal.Box(0.2, 0.3, 0.4), id(CAPSULE): coal.Capsule(0.1, 0.3),
        id(BALL): coal.Sphere(0.15), id(CYLINDER): coal.Cylinder(0.1, 0.3),
    }  # fmt: skip
    random, seen = np.random.default_rng(1), 0
    for _ in range(60):
        turns = Rotation.random(2, random_state=random).as_matrix()
        centres = [np.zeros(3), random.normal(size=3) * 0.17]
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        placed = [coal.Transform3s(t, c) for t, c in zip(turns, centres, strict=True)]
        coal.distance(shapes[id(one)], placed[0], shapes[id(two)], placed[1], request, result)
        theirs, found = (
            result.min_distance,
            nearest(one, two, list(zip(turns, centres, strict=True))),
        )
        core = theirs + one.radius + two.radius
        if found > 1.0:  # balls around them are apart
            assert theirs > 0.0
            continue
        if exact == "side":
            local = turns[0].T @ np.array(result.getNearestPoint1())
            if abs(local[2]) > 0.149 or theirs < -0.05:  # a rim; deep
                continue
        elif exact == "depth" and theirs > 0.0:
            continue  # corners that are apart: the way between them is not looked for
        elif exact == "all" and core < 1e-3:  # cores overlap: the way out may be that of a core
            continue
        seen += 1
        if exact == "depth":  # faces are taken before edges that are up to 2 % better
            assert 1.021 * theirs - 1e-5 <= found <= theirs + 1e-5
        else:
            assert found == pytest.approx(theirs, abs=2e-6)
    assert seen > 4


def test_lines_and_points_have_no_faces_to_go_by():
    turned = Rotation.from_euler("x", 90.0, degrees=True).as_matrix()  # along y
    upright = np.eye(3), np.zeros(3)
    across = turned, np.array([0.25, 0.05, 0.1])
    assert nearest(CAPSULE, CAPSULE, [upright, across]) == pytest.approx(0.05, abs=1e-15)
    beside = np.eye(3), np.array([0.0, 0.2, 0.31])  # closest is the end of the line
    length = np.hypot(0.2, 0.16)
    assert nearest(CAPSULE, BALL, [upright, beside]) == pytest.approx(length - 0.25, abs=1e-15)
