"""The moving picture of the page shows the motion of the result, within the rounding it states."""

import base64
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.path import Path as Outline
from synthetic import CONTACT, RADIUS, points_and_cells, solid_result

from impactfem import Result, solve
from impactfem.contact.distance import signed_distance
from impactfem.report.page import motion_bodies
from impactfem.report.page.motion import motion
from impactfem.report.page.motion_bodies import choose
from impactfem.report.page.motion_data import (
    MOST_FRAMES,
    factors_of,
    packed,
    packed_indices,
    packed_signs,
    telling_frames,
)
from impactfem.report.page.motion_obstacles import plane_obstacles, space_obstacles
from impactfem.report.skin import Skin
from impactfem.result import FieldSpool, KeptSnapshots, Shape, StoredSnapshots
from impactfem.result.cell_kinds import KINDS
from impactfem.scene import (
    HalfSpace,
    Point,
    RigidBox,
    RigidCylinder,
    RigidPolyline,
    RigidSphere,
    Rod,
    Scene,
)
from impactfem.shipped import find_scene

FLOOR = HalfSpace(name="floor", point=[0.0, 0.0], normal=[0.0, 1.0])


def unpacked(entry):
    """Numbers that were packed, shape (count,): what the page reads."""
    whole = np.frombuffer(base64.b64decode(entry["data"]), dtype=f"<u{entry['bits'] // 8}")
    return entry["low"] + entry["step"] * whole.astype(np.float64)


@given(
    st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=60), st.sampled_from([8, 16])
)  # fmt: skip
def test_packed_numbers_are_wrong_by_half_a_step_at_most(values, bits):
    entry = json.loads(json.dumps(packed(values, bits)))
    span = max(values) - min(values)
    wrong = np.abs(unpacked(entry) - values).max()
    assert wrong <= 0.5001 * span / (2**bits - 1) + 1e-9


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=60))
def test_signed_numbers_keep_zero_exactly(values):
    found = unpacked(packed_signs([*values, 0.0], 3.0))
    assert found[-1] == 0.0
    assert np.abs(found[:-1] - values).max() <= 3.0 / 254 * 1.0001


@given(st.lists(st.integers(0, 2**31 - 1), max_size=60))
def test_indices_are_exact(values):
    assert unpacked(packed_indices(values)).astype(int).tolist() == values


def test_frames_have_ends_peak_and_are_denser_in_contact(tmp_path):
    coarse = solid_result(tmp_path / "fields.vtkhdf", layers=25)
    times = np.linspace(0.0, 1.2, 2401)
    result = replace(coarse, history=coarse.history.interp(time=times))
    frames = telling_frames(result, times)
    assert len(frames) <= MOST_FRAMES
    assert (np.diff(frames) > 0).all()
    assert frames[0] == 0
    assert frames[-1] == len(times) - 1
    assert int(np.argmax(result.history["contact_force"].values)) in frames
    inside = (times[frames] >= CONTACT[0]) & (times[frames] <= CONTACT[1])
    share = (CONTACT[1] - CONTACT[0]) / times[-1]
    assert inside.mean() > 1.4 * share
    # Nowhere is there a gap of more than some frames at even distances.
    assert np.diff(times[frames]).max() < 3.0 * times[-1] / MOST_FRAMES


def test_few_contact_rows_do_not_cost_frames():
    result = solve(Scene.from_toml(find_scene("corner")))
    times = result.history["time"].values
    frames = telling_frames(result, times, 200)
    assert len(frames) > 190
    assert set(np.flatnonzero(result.history["contact_force"].values > 0.0)) <= set(frames)


def test_small_motion_can_be_magnified():
    assert factors_of(0.02, 1.0) == [1.0]
    assert factors_of(0.0, 1.0) == [1.0]
    factors = factors_of(1e-4, 1.0)
    assert factors[0] == 1.0
    assert 0.05 < factors[-1] * 1e-4 <= 0.2


@pytest.mark.parametrize("name", ["bar_impact", "gravity_impact", "wave_cradle", "two_bars"])
def test_bars_are_where_the_fields_say(name):
    result = solve(Scene.from_toml(find_scene(name)))
    shown = motion(result)
    fields = result.fields
    layers = [int(np.abs(fields.times - t).argmin()) for t in shown["times"]]
    moved = unpacked(shown["motion"]).reshape(len(layers), -1)
    base = np.array(shown["base"])
    starts = np.cumsum([0, *(fields.counts or (len(fields.positions),))])
    shown_starts = np.cumsum([0, *shown["counts"]])
    lengths = np.cumsum([0.0, *(bar.length for bar in result.scene.bars)])
    for bar, first in enumerate(starts[:-1]):
        own = slice(shown_starts[bar], shown_starts[bar + 1])
        # Nodes by their place in the bar at rest; all bars touch at factor 0.
        at = base[own] - lengths[bar]
        nodes = first + np.array(
            [np.abs(fields.positions[first : starts[bar + 1]] - x).argmin() for x in at]
        )
        assert nodes[0] == first
        assert nodes[-1] == starts[bar + 1] - 1
        place = (fields.positions + fields.displacement)[np.ix_(layers, nodes)]
        drawn = (base + moved)[:, own]
        rounding = 0.51 * shown["motion"]["step"] + 1e-6 * lengths[-1]
        assert np.abs(drawn - place).max() <= rounding
    assert shown["kind"] == "bars"
    assert shown["wall"] == bool(result.scene.obstacles)


def test_a_pressed_bar_is_drawn_with_the_strain_of_its_force():
    result = solve(Scene.from_toml(find_scene("bar_impact")))
    shown = motion(result)
    frame = int(np.abs(np.array(shown["times"]) - 2.0).argmin())
    pieces = unpacked(shown["value"]).reshape(len(shown["times"]), -1)[frame]
    # Half way through the contact the whole bar is pressed by rho c v = 0.5 N on 1 m^2 of 1 Pa.
    assert pieces == pytest.approx(-0.5, abs=1.01 / 254)


@pytest.mark.parametrize("dim", [2, 3])
def test_bodies_are_where_the_fields_say(dim, tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf", dim, layers=40)
    shown = motion(result)
    assert shown["kind"] == ("plane" if dim == 2 else "space")
    fields = result.fields
    skin = Skin.of(fields)
    reference = unpacked(shown["reference"]).reshape(-1, dim)
    assert len(reference) == len(skin.nodes)  # none left out
    moved = unpacked(shown["displacement"]).reshape(len(shown["times"]), -1, dim)
    stress = unpacked(shown["value"]).reshape(len(shown["times"]), -1)
    rounding = 0.51 * (shown["reference"]["step"] + shown["displacement"]["step"])
    assert rounding < 1e-4 * skin.size
    for frame, time in enumerate(shown["times"]):
        layer = int(np.abs(fields.times - time).argmin())
        values = fields.read(layer)
        place = (fields.points + values["displacement"])[skin.nodes, :dim]
        assert np.abs(reference + moved[frame] - place).max() <= rounding
        known = np.minimum(values["von_mises"][skin.nodes], shown["limit"])
        assert np.abs(stress[frame] - known).max() <= 0.51 * shown["value"]["step"]
        force = np.interp(time, result.history["time"], result.history["contact_force"])
        assert shown["force"][frame] == pytest.approx(force, abs=1e-3)
    triangles = unpacked(shown["triangles"]).astype(int).reshape(-1, 3)
    known = {frozenset(triangle) for triangle in skin.triangles.tolist()}
    assert {frozenset(triangle) for triangle in skin.nodes[triangles].tolist()} == known


def test_pressed_faces_are_those_under_pressure(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf", layers=25)
    shown = motion(result)
    skin = Skin.of(result.fields)
    segments = unpacked(shown["segments"]).astype(int).reshape(-1, 2)
    for frame, listed in enumerate(shown["pressed"]):
        layer = int(np.abs(result.fields.times - shown["times"][frame]).argmin())
        pressure = result.fields.read(layer)["contact_pressure"]
        loaded = (pressure[skin.nodes[segments]] > 0.0).all(axis=1)
        assert listed == np.flatnonzero(loaded).tolist()
    assert any(shown["pressed"])


@pytest.mark.parametrize("dim", [2, 3])
def test_a_large_mesh_is_thinned_but_keeps_its_shape(dim, tmp_path):
    points, cells = points_and_cells(dim, rings=30 if dim == 2 else 12)
    kind = KINDS["triangle" if dim == 2 else "tetrahedron", 1]
    with FieldSpool(tmp_path / "f.vtkhdf", [Shape("body", points, cells, kind.vtk_type)]):
        pass
    skin = Skin.of(StoredSnapshots(tmp_path / "f.vtkhdf"))
    most = len(skin.nodes) // 4
    shown = choose(skin, most)
    assert 0.3 * most < len(shown.nodes) <= most
    assert shown.triangles.max() < len(shown.nodes)
    places = skin.points[shown.nodes]
    a, b, c = (places[shown.triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    whole = np.pi * RADIUS**2 * (1.0 if dim == 2 else 4.0)
    assert area == pytest.approx(whole, rel=0.12)


def test_bodies_that_touch_are_not_drawn_as_one(tmp_path):
    points, cells = points_and_cells(2)
    beside, kind = points + np.array([2.0 * RADIUS, 0.0]), KINDS["triangle", 1].vtk_type
    shapes = [Shape("one", points, cells, kind), Shape("other", beside, cells, kind)]
    with FieldSpool(tmp_path / "f.vtkhdf", shapes):
        pass
    skin = Skin.of(StoredSnapshots(tmp_path / "f.vtkhdf"))
    shown = choose(skin, 40)
    owner = skin.bodies[shown.nodes][shown.triangles]
    assert (owner == owner[:, :1]).all()
    assert set(owner.ravel().tolist()) == {0, 1}


def test_size_stays_below_the_budget(tmp_path, monkeypatch):
    result = solid_result(tmp_path / "fields.vtkhdf", layers=60)
    full = motion(result)
    monkeypatch.setattr(motion_bodies, "BUDGET", 10_000)
    small = motion(result)
    packs = ("reference", "displacement", "value", "triangles", "segments")
    assert sum(len(small[name]["data"]) for name in packs) < 12_000
    assert sum(len(full[name]["data"]) for name in packs) > 30_000
    assert len(small["times"]) == 60
    assert "nodes are drawn" in small["caption"]
    assert "nodes are drawn" not in full["caption"]


def test_a_layer_that_is_not_finite_is_no_frame(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf", broken=True)
    shown = motion(result)
    assert len(shown["times"]) == len(result.fields) - 1
    json.dumps(shown, allow_nan=False)


OUTLINES = [
    HalfSpace(point=[0.1, 0.2], normal=[1.0, 2.0]),
    RigidSphere(center=[0.1, -0.2], radius=0.7),
    RigidSphere(center=[0.1, -0.2], radius=0.7, side="inside"),
    RigidBox(center=[0.1, 0.2], size=[0.9, 0.5], angle=0.4),
    RigidPolyline(points=[[-0.5, -0.5], [0.5, -0.4], [0.2, 0.6], [-0.5, -0.5]]),
    RigidPolyline(points=[[-0.5, -0.5], [0.2, 0.6], [0.5, -0.4], [-0.5, -0.5]]),
]


@pytest.mark.parametrize("obstacle", OUTLINES, ids=lambda o: f"{o.kind}")
def test_what_is_filled_is_where_the_distance_is_negative(obstacle):
    drawn = plane_obstacles([obstacle], np.zeros(2))[0]
    places = np.random.default_rng(1).uniform(-1.0, 1.0, size=(400, 2))
    if drawn["shape"] == "half":
        filled = (places - drawn["point"]) @ drawn["normal"] < 0.0
    else:
        if drawn["shape"] == "circle":
            within = np.hypot(*(places - drawn["point"]).T) < drawn["radius"]
        else:
            corners = np.array(drawn["points"]).reshape(-1, 2)
            within = Outline(corners).contains_points(places)
        filled = ~within if drawn["inside"] else within
    gap = signed_distance(obstacle, places, 0.0)[0]
    clear = np.abs(gap) > 1e-6
    assert np.array_equal(filled[clear], gap[clear] < 0.0)
    assert filled.any()


def test_obstacles_of_space_lie_on_their_surface_and_move():
    times = np.array([0.0, 0.5, 2.0])
    obstacles = [
        RigidSphere(center=[0.0, -1.0, 0.3], radius=0.7, motion=["0.1*t", "0", "-t"]),
        RigidCylinder(point=[0.0, 0.0, 0.0], axis=[1.0, 1.0, 0.0], radius=0.4),
        HalfSpace(point=[0.0, 0.0, 0.0], normal=[0.0, 1.0, 0.0]),
    ]
    drawn = space_obstacles(obstacles, times, np.zeros(3), 1.0)
    for entry, obstacle in zip(drawn, obstacles, strict=True):
        corners = unpacked(entry["corners"]).reshape(-1, 3)
        gap = signed_distance(obstacle, corners, 0.0)[0]
        assert np.abs(gap).max() < 1e-4
        assert unpacked(entry["triangles"]).max() < len(corners)
    assert np.array(drawn[0]["way"]).reshape(-1, 3) == pytest.approx(
        np.array([[0.1 * t, 0.0, -t] for t in times])
    )
    assert "way" not in drawn[1]


@pytest.mark.parametrize("dim", [2, 3])
def test_obstacles_that_turn_are_drawn_turned(dim):
    more = [0.0] * (dim - 2)
    axis = {"axis": [0.0, 0.0, 1.0]} if dim == 3 else {}
    box = RigidBox(
        center=[0.5, 0.0, *more], size=[0.4, 0.2, *[1.0] * (dim - 2)],
        motion=["0.1*t", "0", *more],
        rotation={"point": [0.2, 0.1, *more], "angle": "2*t", **axis},
    )  # fmt: skip
    times = np.array([0.0, 0.7])
    if dim == 2:
        (drawn,) = plane_obstacles([box], times)
        rest = np.array(drawn["points"]).reshape(-1, 2)
    else:
        (drawn,) = space_obstacles([box], times, np.zeros(3), 1.0)
        rest = unpacked(drawn["corners"]).reshape(-1, 3)
    turn = np.array(drawn["turn"]).reshape(2, dim, dim)[1]
    there = rest @ turn.T + np.array(drawn["way"]).reshape(2, dim)[1]
    assert np.abs(signed_distance(box, there, 0.7)[0]).max() < 1e-4
    assert np.abs(signed_distance(box, rest, 0.7)[0]).max() > 0.1


def test_a_beam_is_drawn_where_its_nodes_are():
    """Its true shape, which no parabola through its ends has."""
    result = solve(Scene.from_toml(find_scene("dropped_beam")))
    shown = motion(result)
    times = np.array(shown["times"])
    rows = np.abs(result.fields.times[None] - times[:, None]).argmin(axis=1)
    places = result.fields.places(result.scene.bodies[0].name)[:, :, :2]
    way = unpacked(shown["displacement"]).reshape(len(times), -1, 2)
    known = places[rows] - places[0]
    assert np.abs(way - known).max() <= 1e-4 * np.abs(known).max()
    assert motion(Result(result.scene, result.history, result.summary)) is None


def test_points_are_where_the_history_says():
    for name in ("corner", "oscillator", "cradle"):
        result = solve(Scene.from_toml(find_scene(name)))
        shown = motion(result)
        at, time = shown["at"], np.array(shown["time"])
        assert time[at] == pytest.approx(shown["times"])
        for body, places in zip(result.scene.bodies, shown["places"], strict=True):
            columns = [f"{body.name}.{c}" for c in "xyz"[: result.scene.dim]]
            drawn = np.array(places).reshape(len(time), -1)
            rows = np.abs(result.history["time"].values[None] - time[:, None]).argmin(axis=1)
            known = np.stack([result.history[c].values[rows] for c in columns], axis=1)
            assert drawn == pytest.approx(known, rel=1e-6)


def test_the_obstacle_of_a_point_moves_with_it():
    result = solve(Scene.from_toml(find_scene("vibrating_table")))
    shown = motion(result)
    table, ball = np.array(shown["obstacles"][0]["place"]), np.array(shown["places"][0])
    assert table == pytest.approx(0.001215 * np.sin(99.3 * np.array(shown["time"])), abs=1e-8)
    assert (ball - table).min() > -1e-6
    assert np.ptp(table) > 0.002


SPACE = Scene(
    title="Points in space", duration=0.5, gravity=[0.0, -9.81, 0.0],
    bodies=[
        Point(name="a", mass=1.0, position=[0.0, 0.3, 0.0],
              springs=[{"anchor": [0.0, 1.0, 0.0], "stiffness": 5.0}]),
        Point(name="b", mass=1.0, position=[0.3, 0.4, 0.2],
              springs=[{"to": "a", "stiffness": 5.0}]),
    ],
    obstacles=[
        HalfSpace(name="floor", point=[0.0, 0.0, 0.0], normal=[0.0, 1.0, 0.0]),
        RigidSphere(name="ball", center=[1.0, 0.0, 0.0], radius=0.2),
    ],
)  # fmt: skip
ROD = Scene(
    title="Rod", duration=0.3, gravity=[0.0, -9.81], obstacles=[FLOOR],
    bodies=[Rod(mass=1.0, length=0.5, center=[0.0, 0.4], inclination=0.5)],
)  # fmt: skip


@pytest.mark.parametrize("scene", [SPACE, ROD, "dropped_beam"], ids=["space", "rod", "beam"])
def test_other_bodies_have_a_motion_too(scene):
    result = solve(Scene.from_toml(find_scene(scene)) if isinstance(scene, str) else scene)
    shown = motion(result)
    assert shown["kind"] == "points"
    assert len(shown["times"]) == len(shown["force"]) == len(shown["gap"]) > 20
    assert shown["caption"].endswith(".")
    assert len(json.dumps(shown, allow_nan=False)) < 400_000


def beside(kinds, dim):
    """Fields of bodies without meshes that fly and turn, beside those of others."""
    along = np.linspace(0.0, 0.4, 5)
    rod = np.pad(along[:, None], ((0, 0), (0, dim - 1)))
    shapes = {
        "ball": Shape.vertices("ball", [[1.0] * dim], 0.2),
        "rod": Shape.line("rod", rod, 0.05),
    }
    angle = np.linspace(0.0, 1.0, 6)
    turned = along[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None]
    rods = np.pad(turned, ((0, 0), (0, 0), (0, 1))) - np.pad(rod, ((0, 0), (0, 3 - dim)))
    ways = {"ball": angle[:, None, None] * [0.3, 0.2, 0.0], "rod": rods}
    moved = np.concatenate([ways[kind] for kind in kinds], axis=1)
    values = {"displacement": moved, "velocity": 0.0 * moved}
    return KeptSnapshots(1.2 * angle, [shapes[kind] for kind in kinds], values)


@pytest.mark.parametrize("dim", [2, 3])
def test_balls_and_rods_are_drawn_as_thick_as_they_are(dim, tmp_path):
    result = replace(solid_result(tmp_path / "f.vtkhdf", dim), fields=beside(["ball", "rod"], dim))
    shown = motion(result)
    assert shown["kind"] == ("plane" if dim == 2 else "space")
    assert shown["coloured"] == 0
    assert "stress" not in shown["caption"]
    count = len(shown["times"])
    reference = unpacked(shown["reference"]).reshape(-1, dim)
    place = reference + unpacked(shown["displacement"]).reshape(count, -1, dim)
    drawn = np.unique(unpacked(shown["triangles"]).astype(int))
    fields = result.fields
    for frame, time in enumerate(shown["times"]):
        where = fields.places()[int(np.abs(fields.times - time).argmin())][:, :dim]
        centre, axis = where[0], where[1:]
        apart = np.linalg.norm(place[frame, drawn] - centre, axis=1)
        along = (axis[-1] - axis[0]) / np.linalg.norm(axis[-1] - axis[0])
        arm = place[frame, drawn] - axis[0]
        off = np.linalg.norm(arm - np.outer(arm @ along, along), axis=1)
        ball = np.abs(apart - 0.2) < 2e-3
        assert ball.sum() >= 20
        assert off[~ball] == pytest.approx(0.05, abs=2e-3)
        assert (~ball).sum() >= 10


def test_bodies_of_different_kinds_on_a_line_are_drawn_in_the_plane():
    table = solve(Scene.from_toml(find_scene("vibrating_table")))
    shown = motion(replace(table, fields=beside(["ball", "rod"], 2)))
    assert shown["kind"] == "plane"
    (obstacle,) = shown["obstacles"]
    assert obstacle["normal"] == [1.0, 0.0]
    assert len(obstacle["point"]) == 2
    assert len(obstacle["way"]) == 2 * len(shown["times"])


def test_one_line_has_its_own_picture_and_a_solid_keeps_its_colours(tmp_path):
    result = solid_result(tmp_path / "f.vtkhdf")
    solid = motion(result)
    assert 3 * solid["coloured"] == len(unpacked(solid["triangles"]))
    rod = replace(solve(ROD), impacts=None)
    assert "coloured" not in motion(rod)


def test_without_fields_there_is_no_picture_of_solids_and_bars(tmp_path):
    result = solid_result(tmp_path / "fields.vtkhdf")
    assert motion(replace(result, fields=None)) is None
