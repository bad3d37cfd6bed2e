"""Bodies have the colours of their kind, edges, and marks that turn with them."""

import numpy as np
import pytest
from matplotlib.collections import TriMesh
from matplotlib.figure import Figure

from impactfem.report.edges import feature_edges
from impactfem.report.marks import Marks, spoke
from impactfem.report.palette import HELD, fill, tint
from impactfem.report.skin import Skin
from impactfem.report.solid_figures import body, survey
from impactfem.result import KeptSnapshots, Record, Shape
from impactfem.result.table import Series, Table
from impactfem.scene import Scene

TURN = np.radians(70.0)
SQUARE = np.array([[-1.0, -0.5, 0.0], [1.0, -0.5, 0.0], [1.0, 0.5, 0.0], [-1.0, 0.5, 0.0]])


def turning(joint=True):
    """A rigid block that turns about its lower left corner, as a result."""
    scene = {
        "title": "turning", "duration": 1.0,
        "body": [{"kind": "rigid", "name": "block", "mass": 1.0, "angular_velocity": 1.0,
                  "shape": {"kind": "block", "size": [2.0, 1.0], "corner": [-1.0, -0.5]}}],
    }  # fmt: skip
    if joint:
        scene["joint"] = [{"kind": "revolute", "between": ["ground", "block"],
                           "point": [-1.0, -0.5]}]  # fmt: skip
    c, s = np.cos(TURN), np.sin(TURN)
    turned = (SQUARE - SQUARE[0]) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + SQUARE[0]
    fields = KeptSnapshots(
        np.array([0.0, 1.0]), [Shape("block", SQUARE, [[0, 1, 2], [0, 2, 3]], 5)],
        {"displacement": np.stack([0 * SQUARE, turned - SQUARE]),
         "velocity": np.zeros((2, 4, 3)), "von_mises": np.full((2, 4), np.nan)},
    )  # fmt: skip
    return Scene.from_dict(scene), fields, turned


def test_a_rigid_body_has_its_colour_and_a_line_that_turns_with_it():
    scene, fields, turned = turning()
    skin = Skin.of(fields)
    record = Record(scene, None, {}, fields)
    painter, _ = survey(record, skin, [skin.snapshot(0)])
    assert not painter.marks.turned
    painter, _ = survey(record, skin, map(skin.snapshot, (0, 1)))
    assert painter.marks.turned == {0}
    assert spoke(skin, skin.snapshot(1), 0) == pytest.approx(
        np.stack([turned.mean(axis=0), turned[1]])
    )
    axes = Figure().subplots()
    painter.draw(axes, skin.snapshot(1))
    assert not any(isinstance(c, TriMesh) for c in axes.collections)  # no colours of stress
    (pile,) = (c for c in axes.collections if len(c.get_paths()) == 7)  # 2 faces, 4 edges, a line
    assert pile.get_facecolor()[0, :3] == pytest.approx(fill(0))
    assert pile.get_edgecolor()[-1, :3] == pytest.approx(tint(0))
    (pin,) = axes.lines
    assert pin.get_color() == pin.get_markerfacecolor() == HELD
    assert np.ravel(pin.get_data()) == pytest.approx([-1.0, -0.5])


def test_a_joint_moves_with_its_body():
    scene, fields, turned = turning()
    skin = Skin.of(fields)
    data = scene.to_dict()
    data["joint"][0]["point"] = [0.5, 0.0]
    (pin,) = Marks.of(Scene.from_dict(data), skin).pins
    there = 0.25 * turned[[0, 3]].mean(axis=0) + 0.75 * turned[[1, 2]].mean(axis=0)
    assert pin.at(skin.snapshot(1)) == pytest.approx(there)


def test_edges_are_where_faces_meet_at_an_angle_and_where_they_end():
    roof = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.8], [0, 1, 0.8], [0, 2, 0], [1, 2, 0]], float)
    flat = roof * [1.0, 1.0, 0.0]
    cells = np.array([[0, 1, 2], [0, 2, 3], [3, 2, 5], [3, 5, 4]])
    around = {(0, 1), (1, 2), (2, 5), (4, 5), (3, 4), (0, 3)}
    for points, inner in ((flat, set()), (roof, {(2, 3)})):
        ends, _ = feature_edges(points, cells)
        assert {tuple(sorted(each)) for each in ends.tolist()} == around | inner


def test_what_moves_far_is_drawn_in_one_picture_with_its_times():
    scene, _, _ = turning(joint=False)
    times = np.linspace(0.0, 1.0, 40)
    ways = np.zeros((40, 4, 3))
    ways[:, :, 0] = 40.0 * times[:, None]
    fields = KeptSnapshots(
        times, [Shape("block", SQUARE, [[0, 1, 2], [0, 2, 3]], 5)],
        {"displacement": ways, "velocity": 0.0 * ways, "von_mises": np.full((40, 4), np.nan)},
    )  # fmt: skip
    rows = Table.over_time(times, {"contact_force": Series(("time",), 0.0 * times)})
    figure = body(Record(scene, rows, {"status": "completed"}, fields))
    (axes,) = figure.axes
    told = [text.get_text() for text in axes.texts]
    assert len(told) > 8
    assert told[0] == "0 s"
    assert told[-1] == "1 s"
    assert f"at {len(told)} times" in figure.get_suptitle()
    assert sum(len(c.get_paths()) == 6 for c in axes.collections) == len(told)
