"""Plates are drawn with their deflection a tenth of their size, and what touches them touches."""

import numpy as np
import pytest

from impactfem.report.camera import Camera
from impactfem.report.relief import relief_of
from impactfem.report.skin import Skin
from impactfem.report.solid_figures import drawn_skin, scale_of
from impactfem.result import KeptSnapshots, Record, Shape
from impactfem.scene import Scene

SIZE, THICK, GAP, DOWN = 0.2, 0.004, 3e-4, 5e-4


def plate_scene(**more):
    return Scene.from_dict({
        "title": "plate", "duration": 1.0,
        "body": [
            {"kind": "plate", "name": "plate", "mesh_size": 0.1, "thickness": THICK,
             "outline": {"kind": "rectangle", "size": [SIZE, SIZE]}, "density": 1e3,
             "youngs_modulus": 1e9, "poisson_ratio": 0.3,
             "supports": [{"edge": "left", "kind": "clamped"}]},
            {"kind": "rigid", "name": "ball", "mass": 1.0, "velocity": [0.0, 0.0, -1.0],
             "shape": {"kind": "sphere", "radius": 0.02,
                       "center": [0.0, 0.0, 0.02 + 0.5 * THICK + GAP]}},
        ],
        "contact": [{"between": ["ball", "plate"], "stiffness": 1e6}],
        "obstacle": [{"kind": "half_space", "name": "floor", "normal": [0.0, 0.0, 1.0],
                      "point": [0.0, 0.0, -0.5 * THICK - DOWN]}],
    } | more)  # fmt: skip


def plate_fields(scene, plate_ways, ball_ways):
    """A plate whose middle node moves, and the ball."""
    ball = scene.bodies[1]
    edge = 0.5 * SIZE * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1], [0, 0]])
    plate = np.column_stack([edge, np.zeros(5)])
    cells = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    points, count = ball.form.points, len(ball.form.points)
    ways = np.zeros((len(plate_ways), 5 + count, 3))
    ways[:, 4, 2], ways[:, 5:, 2] = plate_ways, np.array(ball_ways)[:, None]
    stress = np.concatenate([np.ones(5), np.full(count, np.nan)])
    return KeptSnapshots(
        np.arange(float(len(ways))),
        [Shape("plate", plate, cells, 5), Shape("ball", points, ball.form.cells, 10)],
        {"displacement": ways, "velocity": 0.0 * ways,
         "von_mises": np.tile(stress, (len(ways), 1))},
    )  # fmt: skip


def test_the_largest_deflection_is_a_tenth_and_gaps_close_where_they_do():
    scene = plate_scene()
    # At rest, at the floor with the ball upon it, and with the ball away.
    fields = plate_fields(scene, [0.0, -DOWN, 0.0], [0.0, -DOWN - GAP, 3.0 * GAP])
    skin = drawn_skin(Record(scene, None, {}, fields), fields)
    factor = skin.relief.factor
    assert factor == pytest.approx(0.1 * SIZE / DOWN, rel=0.05)
    assert f"{factor:g} times" in scale_of(skin)
    low = [skin.snapshot(k).place[5:, 2].min() for k in range(3)]
    middle = [skin.snapshot(k).place[4, 2] for k in range(3)]
    facets = scene.bodies[1].form.points[:, 2].min() - (0.5 * THICK + GAP)
    assert middle == pytest.approx([0.0, -factor * DOWN, 0.0])
    assert np.subtract(low, facets) == pytest.approx(
        [factor * GAP, -factor * DOWN, 4.0 * factor * GAP]
    )
    floor = scene.obstacles[0]
    assert floor.point[2] + skin.relief.shift(floor, 0.0)[2] == pytest.approx(-factor * DOWN)


def test_a_plate_is_seen_from_its_normal_and_large_deflections_are_true():
    scene = plate_scene()
    assert Camera.of(scene).towards @ [0.0, 0.0, 1.0] > 0.5
    fields = plate_fields(scene, [0.0, 0.2 * SIZE], [0.0, 0.3 * SIZE])
    assert relief_of(scene, Skin.of(fields, dim=3)) is None
    assert scale_of(drawn_skin(Record(scene, None, {}, fields), fields)) == "true to scale"
