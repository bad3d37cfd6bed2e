"""Drops: scenes that start at first touch, equal to the same scene said by hand."""

import math

import numpy as np
import pytest

import impactfem
from impactfem import Scene
from impactfem.errors import SceneError

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, -1.0], "normal": [0.0, 1.0]}
BOX = {"kind": "rigid", "name": "box", "model": "2d", "density": 100.0,
       "shape": {"kind": "block", "size": [0.3, 0.2], "corner": [0.1, 0.4]}}  # fmt: skip
BALL = {"kind": "point", "name": "ball", "mass": 0.5, "position": [0.25, 0.9], "radius": 0.1}
DISC = {"kind": "solid", "name": "disc", "model": "plane_strain", "density": 1000.0,
        "youngs_modulus": 1e6, "poisson_ratio": 0.3, "mesh_size": 0.02,
        "shape": {"kind": "disc", "radius": 0.05, "center": [0.0, 0.3]}}  # fmt: skip
BEAM = {"kind": "beam", "name": "beam", "length": 0.4, "height": 0.02, "width": 0.02,
        "density": 1000.0, "youngs_modulus": 1e9, "center": [0.1, 0.3], "elements": 6}  # fmt: skip
ROD = {"kind": "rod", "name": "rod", "mass": 1.0, "length": 0.6, "center": [0.2, 0.5],
       "radius": 0.02, "inclination": 0.1}  # fmt: skip
PLATE = {"kind": "plate", "name": "plate", "thickness": 0.004, "mesh_size": 0.05, "density": 1000.0,
         "outline": {"kind": "rectangle", "size": [0.2, 0.1]}, "youngs_modulus": 1e9,
         "poisson_ratio": 0.3, "center": [0.1, 0.2, 0.3]}  # fmt: skip
NET = {"kind": "springs", "name": "net", "mass": 0.5, "stiffness": 1e4, "mesh_size": 0.1,
       "pattern": "crossed", "radius": 0.01,
       "shape": {"kind": "block", "size": [0.2, 0.2], "corner": [0.1, 0.4]}}  # fmt: skip
G = 9.81


def scene(*bodies, gravity=(0.0, -G), obstacles=(FLOOR,), duration=0.02, **more):
    return Scene.from_dict(
        {"title": "drop", "duration": duration, "gravity": list(gravity), "body": list(bodies),
         "obstacle": list(obstacles), "output": {"fields": []}, "solve": {"estimate": False}} | more
    )  # fmt: skip


def test_a_box_on_its_corner_is_that_said_by_hand():
    """Turned by 0.4 about its middle: half its height is a sin + b cos."""
    found = scene(BOX, drop={"height": 0.8, "orientation": {"angle": 0.4}})
    high = 0.15 * math.sin(0.4) + 0.1 * math.cos(0.4)
    corner = [0.1, -1.0 + high - 0.1]
    by_hand = BOX | {"angle": 0.4, "velocity": [0.0, -math.sqrt(2 * G * 0.8)],
                     "shape": BOX["shape"] | {"corner": corner}}  # fmt: skip
    one, other = impactfem.solve(found), impactfem.solve(scene(by_hand))
    for name, column in one.history.items():
        scale = max(1e-9, float(np.abs(np.nan_to_num(other.history[name].values)).max()))
        assert np.allclose(column.values, other.history[name].values, rtol=0.0,
                           atol=1e-9 * scale, equal_nan=True), name  # fmt: skip
    assert one.history["contact_impulse"].values[1:3].max() > 0.0
    assert found.bodies[0].velocity == pytest.approx([0.0, -math.sqrt(2 * G * 0.8)], rel=1e-15)


def test_all_bodies_turn_together_with_probes_and_joints():
    joint = {"name": "rope", "kind": "fixed", "between": ["box", "ball"], "point": [0.25, 0.9]}
    probe = {"name": "edge", "body": "box", "point": [0.4, 0.5]}
    spring = {"name": "band", "between": ["box", "ball"], "stiffness": 2.0,
              "points": [[0.25, 0.6], [0.25, 0.9]]}  # fmt: skip
    found = scene(BOX, BALL, joint=[joint], probe=[probe], spring=[spring],
                  drop={"height": 0.0, "orientation": {"angle": math.pi / 2}})  # fmt: skip
    box, ball = found.bodies
    # The middle of [0.1, 0.4] x [0.4, 1.0] is (0.25, 0.7): the box comes to its right.
    assert np.array(ball.position) - box.center == pytest.approx([-0.4, 0.0], abs=1e-12)
    assert box.angle == pytest.approx(math.pi / 2)
    assert box.center[1] == pytest.approx(-1.0 + 0.15)
    assert ball.position[1] == pytest.approx(-1.0 + 0.15)
    assert np.array(found.joints[0].point) - box.center == pytest.approx([-0.4, 0.0], abs=1e-12)
    assert found.springs[0].points[1] == pytest.approx(found.joints[0].point, abs=1e-12)
    assert np.array(found.probes[0].point) - box.center == pytest.approx([0.0, 0.15], abs=1e-12)


def test_along_tilted_gravity_onto_a_hollow_and_in_space():
    """A ball in a bowl: centre at R - r from its middle, along the way of the fall."""
    bowl = {"kind": "sphere", "name": "bowl", "center": [0.0, 0.0], "radius": 1.0, "side": "inside"}
    ball = BALL | {"position": [0.2, 0.1]}
    found = scene(ball, gravity=[3.0, -4.0], obstacles=[bowl], drop={"height": 0.4})
    at = np.array(found.bodies[0].position)
    assert np.linalg.norm(at) == pytest.approx(0.9, rel=1e-12)
    assert (at - [0.2, 0.1]) @ [0.8, 0.6] == pytest.approx(0.0, abs=1e-12)
    assert found.bodies[0].velocity == pytest.approx([0.6 * 2.0, -0.8 * 2.0], rel=1e-12)
    can = {"kind": "rigid", "name": "can", "mass": 1.0,
           "shape": {"kind": "cylinder", "radius": 0.1, "height": 0.4}}  # fmt: skip
    floor = FLOOR | {"point": [0.0, 0.0, -2.0], "normal": [0.0, 0.0, 1.0]}
    turned = {"axis": [1.0, 0.0, 0.0], "angle": 0.3}
    found = scene(can, gravity=[0.0, 0.0, -G], obstacles=[floor],
                  drop={"height": 0.0, "orientation": turned})  # fmt: skip
    body = found.bodies[0]
    axis = body.rotation @ body.form.axis[0]
    lowest = 0.2 * abs(axis[2]) + 0.1 * math.sqrt(1.0 - axis[2] ** 2)
    assert body.center[2] == pytest.approx(-2.0 + lowest, abs=1e-13)


def test_a_solid_falls_as_a_solid_with_that_speed():
    found = impactfem.solve(scene(DISC, drop={"height": 0.05}, duration=0.002))
    by_hand = DISC | {"velocity": [0.0, -math.sqrt(2 * G * 0.05)],
                      "shape": DISC["shape"] | {"center": [0.0, -0.95]}}  # fmt: skip
    other = impactfem.solve(scene(by_hand, duration=0.002))
    force = other.history["contact_force"].values
    assert force.max() > 0.0
    assert found.history["contact_force"].values == pytest.approx(force, abs=1e-6 * force.max())


def same(found, by_hand, bound=1e-9):
    """Histories are equal, and something happens."""
    one, other = impactfem.solve(found), impactfem.solve(by_hand)
    for name, column in other.history.items():
        known = np.nan_to_num(column.values)
        scale = max(1e-2, float(np.abs(known).max()))
        assert np.nan_to_num(one.history[name].values) == pytest.approx(known, abs=bound * scale), (
            name
        )
    assert other.history["contact_force"].values.max() > 0.0 or (
        other.history["contact_impulse"].values.max() > 0.0
    )


SPEED = math.sqrt(2 * G * 0.2)
HIGH = {"height": 0.2, "orientation": {"angle": 0.3}}


@pytest.mark.parametrize(
    ("body", "by_hand"),
    [
        (ROD, {"inclination": 0.4, "center": [0.2, -1.0 + 0.3 * math.sin(0.4) + 0.02]}),
        (BEAM, {"inclination": 0.3, "center": [0.1, -1.0 + 0.2 * math.sin(0.3)]}),
        (NET, {"shape": NET["shape"] | {"angle": 0.3, "corner": [
            0.1, -1.0 + 0.01 + 0.1 * (math.sin(0.3) + math.cos(0.3)) - 0.1]}}),
    ],
    ids=["rod", "beam", "net"],
)  # fmt: skip
def test_bodies_with_an_axis_or_springs_fall_turned(body, by_hand):
    said = body | {"velocity": [0.0, -SPEED]} | by_hand
    coarse = {} if body is ROD else {"solve": {"estimate": False, "dt": 2e-4}}
    # The events of a rod are found to 1e-9, and 6e-9 of its force were seen after 1000 of them.
    same(scene(body, drop=HIGH, **coarse), scene(said, **coarse), 1e-7 if body is ROD else 1e-9)


@pytest.mark.parametrize(
    ("body", "by_hand", "along"),
    [
        (PLATE, {"center": [0.1, 0.2, -0.998], "angle": 0.3, "velocity": -SPEED}, [0, 0, 1]),
        (PLATE | {"normal": [0, -2, 0]}, {"center": [0.1, -0.998, 0.3], "normal": [0, -1, 0],
                                           "angle": 0.3, "velocity": SPEED}, [0, 1, 0]),
        (BEAM | {"center": [0.1, 0.2, 0.3], "axis": [1, 0, 0]},
         {"center": [0.1, 0.2, -1.0], "axis": [math.cos(0.3), math.sin(0.3), 0],
          "velocity": [0, 0, -SPEED]}, [0, 0, 1]),
    ],
    ids=["plate", "plate upside down", "beam"],
)  # fmt: skip
def test_plates_and_beams_fall_in_space(body, by_hand, along):
    floor = FLOOR | {"point": (-np.array(along)).tolist(), "normal": along}
    more = {"gravity": (-G * np.array(along)).tolist(), "obstacles": [floor], "duration": 2e-3,
            "solve": {"estimate": False, "dt": 2e-5}}  # fmt: skip
    turn = {"axis": body.get("normal", along), "angle": 0.3}
    found = scene(body, drop={"height": 0.2, "orientation": turn}, **more)
    same(found, scene(body | by_hand, **more))


def test_a_plate_falls_along_its_normal_alone_and_onto_what_is_round():
    with pytest.raises(SceneError, match="plate, which moves along its normal, and gravity does"):
        scene(PLATE, gravity=[1.0, 0.0, -G], drop={"height": 0.1},
              obstacles=[FLOOR | {"point": [0, 0, -1], "normal": [0, 0, 1]}])  # fmt: skip
    ball = {"kind": "sphere", "name": "ball", "center": [0.13, 0.21, -1.0], "radius": 0.5}
    for outline in ({"kind": "disc", "radius": 0.1}, {"kind": "ring", "inner_radius": 0.05,
                    "radius": 0.1}, {"kind": "polygon", "points": [[-0.1, -0.1], [0.1, -0.1],
                    [0.1, 0.1]]}):  # fmt: skip
        plate = PLATE | {"outline": outline, "center": [0.1, 0.2, 0.3]}
        found = scene(plate, gravity=[0, 0, -G], drop={"height": 0.1}, obstacles=[ball])
        away = 0.05 - math.hypot(0.03, 0.01) if outline["kind"] == "ring" else 0.0
        touch = -1.0 + math.sqrt(0.25 - away**2) + 0.002
        assert found.bodies[0].center[2] == pytest.approx(touch, abs=2e-5)


def test_a_solid_from_a_mesh_file_falls_to_its_position(tmp_path):
    path = tmp_path / "part.msh"
    nodes = ["0.0 0.4 0", "0.1 0.4 0", "0.1 0.5 0", "0.0 0.5 0", "3.0 -9.0 0"]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", "5"]
    lines += [f"{k} {place}" for k, place in enumerate(nodes, 1)]
    lines += ["$EndNodes", "$Elements", "3", "1 2 2 0 1 1 2 3", "2 2 2 0 1 1 3 4", "3 15 2 0 9 5"]
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    solid = {name: value for name, value in DISC.items() if name not in {"shape", "mesh_size"}}
    solid |= {"mesh": str(path), "position": [0.0, 0.5]}
    found = scene(solid, drop={"height": 0.2}, duration=0.004)
    assert found.bodies[0].position == pytest.approx([0.0, -1.4])
    same(found, scene(solid | {"position": [0.0, -1.4], "velocity": [0.0, -SPEED]}, duration=0.004))
    shaped = {"mesh": None, "shape": DISC["shape"], "mesh_size": 0.02}
    for change, words in (
        ({"position": [0.0] * 3}, "has 3 entries"),
        (shaped, "has its own place"),
    ):
        with pytest.raises(SceneError, match=rf"position = .* {words}"):
            scene(solid | change)


def test_settings_change_the_drop_and_files_hold_what_came_of_it(tmp_path):
    found = scene(BOX, drop={"height": 0.8})
    higher = found.with_settings({"drop.height": 3.2})
    assert higher.bodies[0].velocity == pytest.approx([0.0, -math.sqrt(2 * G * 3.2)])
    assert higher.bodies[0].shape.corner == pytest.approx(found.bodies[0].shape.corner)
    path = tmp_path / "scene.toml"
    path.write_text(found.to_toml())
    assert Scene.from_toml(path) == found
    from impactfem.studies import sweep

    heights = sweep(found, {"drop.height": [0.2, 0.8]}, jobs=1).column("max_impulse")
    assert heights[1] == pytest.approx(2.0 * heights[0], rel=1e-2)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gravity": [0.0, 0.0]}, "without a constant gravity"),
        ({"obstacle": []}, "no obstacle to fall onto"),
        ({"gravity": [0.0, G]}, "meet no obstacle"),
        ({"drop": {"height": -1.0}}, "must be >= 0"),
        ({"drop": {}}, "height is missing"),
        ({"drop": {"height": 1.0, "orientation": {"axis": [1, 0, 0], "angle": 0.1}}}, "about z"),
        ({"obstacle": [FLOOR | {"motion": ["0", "0.1*t"]}]}, "floor moves"),
        ({"joint": [{"name": "j", "kind": "revolute", "between": ["ground", "box"],
                     "point": [0.2, 0.5]}]}, "what is held does not fall"),
        ({"spring": [{"between": ["ground", "box"], "stiffness": 3.0}]},
         "what is held does not fall"),
        ({"body": [BEAM | {"supports": [{"end": "first", "kind": "clamped"}]}]},
         "beam has supports, and what is held does not fall"),
        ({"body": [DISC | {"pressures": [{"surface": "rim", "value": "x*t"}]}]},
         r"pressures\[0\]\.value depends on places"),
        ({"body": [DISC | {"density": "1000 + x"}]}, "density.* depends on places"),
    ],
)  # fmt: skip
def test_drops_without_sense_are_refused(change, words):
    tables = scene(BOX).to_dict() | {"drop": {"height": 0.5}}
    with pytest.raises(SceneError, match=words):
        Scene.from_dict(tables | change)


def test_an_ellipsoid_touches_where_it_is_nearest():
    """A plane at sqrt(a^2 sin^2 + c^2 cos^2) from its centre, and a ball beside its middle."""
    shape = {"kind": "ellipsoid", "radii": [0.2, 0.1, 0.05], "center": [0.0, 0.0, 5.0]}
    egg = {"kind": "rigid", "name": "egg", "mass": 1.0, "shape": shape}
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0, 0.0],
             "normal": [0.0, 0.0, 1.0]}  # fmt: skip
    turn = {"axis": [0.0, 1.0, 0.0], "angle": 0.3}
    table = {"title": "egg", "duration": 1e-3, "gravity": [0.0, 0.0, -10.0], "body": [egg],
             "obstacle": [floor], "drop": {"height": 0.8, "orientation": turn}}  # fmt: skip
    body = impactfem.Scene.from_dict(table).bodies[0]
    across = np.hypot(0.2 * np.sin(0.3), 0.05 * np.cos(0.3))
    assert body.center == pytest.approx([0.0, 0.0, across], abs=1e-13)
    assert body.velocity[2] == pytest.approx(-4.0, abs=1e-12)
    ball = {"kind": "sphere", "name": "ball", "center": [0.05, 0.0, -1.0], "radius": 1.0}
    body = impactfem.Scene.from_dict(table | {"obstacle": [ball]}).bodies[0]
    angles = np.linspace(-np.pi, np.pi, 200_001)
    rim = 0.2 * np.sin(angles), 0.05 * np.cos(angles)
    x = np.cos(0.3) * rim[0] + np.sin(0.3) * rim[1]
    z = body.center[2] - np.sin(0.3) * rim[0] + np.cos(0.3) * rim[1]
    assert np.hypot(x - 0.05, z + 1.0).min() == pytest.approx(1.0, abs=1e-9)


TET = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.15, 0.0], [0.0, 0.0, 0.1]])
SQUARE = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.06], [0.0, 0.06], [0.05, 0.03]])
FOUR = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]


def mesh_file(path, points, cells):
    """A file of Gmsh's format 2.2."""
    nodes = [
        " ".join([str(k), *map(repr, [*p, 0.0][:3])]) for k, p in enumerate(points.tolist(), 1)
    ]
    kind = {3: 2, 4: 4}[len(cells[0])]
    rows = [f"{k} {kind} 2 0 1 {' '.join(str(n + 1) for n in c)}" for k, c in enumerate(cells, 1)]
    parts = {"MeshFormat": ["2.2 0 8"], "Nodes": [str(len(nodes)), *nodes],
             "Elements": [str(len(rows)), *rows]}  # fmt: skip
    lines = [line for name, own in parts.items() for line in (f"${name}", *own, f"$End{name}")]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def test_solids_from_files_turn_with_the_axes_of_their_material(tmp_path):
    """The same as a file whose places, and axes, are turned by hand."""
    law = {"e1": 4e6, "e2": 1e6, "e3": 1e6, "nu12": 0.2, "nu13": 0.2, "nu23": 0.3, "g12": 4e5}
    body = {"kind": "solid", "name": "plate", "model": "plane_strain", "density": 1000.0,
            "mesh": mesh_file(tmp_path / "a.msh", SQUARE, FOUR), "position": [0.3, 0.7],
            "orthotropic": law, "orientation": {"angle": 0.2}}  # fmt: skip
    found = scene(body, drop={"height": 0.05, "orientation": {"angle": 0.4}})
    c, s = math.cos(0.6), math.sin(0.6)
    turned = SQUARE @ np.array([[c, s], [-s, c]])
    file = mesh_file(tmp_path / "b.msh", turned, FOUR)
    hand = {name: body[name] for name in ("kind", "name", "model", "density")}
    hand |= {"mesh": file, "orthotropic": law | {"angle": 0.4}}
    hand["position"] = found.bodies[0].position
    hand["velocity"] = [0.0, -math.sqrt(2 * G * 0.05)]
    one, other = impactfem.solve(found).history, impactfem.solve(scene(hand)).history
    assert one["contact_force"].values.max() > 0.0
    for name in ("contact_force", "elastic_energy", "plate.x", "plate.vy"):
        scale = np.abs(other[name].values).max()
        np.testing.assert_allclose(one[name].values, other[name].values, rtol=0, atol=1e-8 * scale)
    assert one["gap"].values[0] == pytest.approx(0.0, abs=1e-14)


def test_solids_from_files_in_space_and_what_takes_no_turn(tmp_path):
    """A tetrahedron that is turned upside down stands on the corner that was its highest."""
    floor = {"kind": "half_space", "name": "floor", "point": [0.0] * 3, "normal": [0.0, 0.0, 1.0]}
    body = {
        "kind": "solid",
        "name": "tet",
        "model": "3d",
        "density": 1000.0,
        "youngs_modulus": 1e6,
        "poisson_ratio": 0.3,
        "mesh": mesh_file(tmp_path / "a.msh", TET, [[0, 1, 2, 3]]),
    }
    more = {"gravity": (0.0, 0.0, -G), "obstacles": (floor,)}
    fall = {"height": 0.1, "orientation": {"axis": [1.0, 0.0, 0.0], "angle": math.pi}}
    (placed,) = scene(body, drop=fall, **more).bodies
    places = TET @ placed.turn.T + placed.position
    assert places[:, 2] == pytest.approx(0.1 - TET[:, 2], abs=1e-12)
    assert places[:, 1] == pytest.approx(0.15 - TET[:, 1], abs=1e-12)
    assert impactfem.solve(scene(body, drop=fall, **more, duration=2e-4)).history is not None
    with pytest.raises(SceneError, match="orientation is for mesh, and shapes have an angle"):
        scene(DISC | {"orientation": {"angle": 0.1}})
    with pytest.raises(SceneError, match=r"orientation.axis is missing"):
        scene(body | {"orientation": {"angle": 0.1}}, **more)
    stressed = DISC | {"residual_stress": ["1e3", "0", "0"]}
    with pytest.raises(SceneError, match="disc has residual_stress, whose components do not turn"):
        scene(stressed, drop={"height": 0.1, "orientation": {"angle": 0.1}})


ROBOT = """<robot name="r"><link name="trunk">{mass}<collision><geometry><box size="0.3 0.2 0.1"/>
</geometry></collision></link><link name="wheel">{mass}<collision><geometry>
<cylinder radius="0.06" length="0.04"/></geometry></collision></link><joint name="hub"
type="revolute"><origin xyz="0.1 0.2 -0.08" rpy="0.3 0 0.2"/><parent link="trunk"/>
<child link="wheel"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
</joint></robot>"""
INERTIAL = """<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0"
iyz="0"/></inertial>"""


@pytest.mark.parametrize("angle", [0.37, 2.13])
def test_a_robot_falls_on_its_lowest_link(tmp_path, angle):
    """Corners of a box and the rim of a cylinder, turned about the middle with a ball beside."""
    pytest.importorskip("pinocchio")
    from scipy.spatial.transform import Rotation

    (tmp_path / "r.urdf").write_text(ROBOT.format(mass=INERTIAL))
    robot = {"kind": "mechanism", "name": "r", "file": "r.urdf", "base": "free",
             "position": [0.3, -0.2, 1.0], "orientation": {"axis": [0, 0, 1], "angle": 0.4},
             "joints": {"hub": {"position": 0.5}}, "velocity": [0.1, 0.0, 0.0]}  # fmt: skip
    ball = {"kind": "rigid", "name": "ball", "mass": 1.0,
            "shape": {"kind": "sphere", "radius": 0.02, "center": [0.5, 0.1, 1.3]}}  # fmt: skip
    floor = FLOOR | {"point": [0.0, 0.0, -1.0], "normal": [0.0, 0.0, 1.0]}
    axis = [1.0, -0.4, 0.6]
    tables = {"title": "robot", "duration": 2e-4, "gravity": [0.0, 0.0, -G], "obstacle": [floor],
              "drop": {"height": 0.8, "orientation": {"axis": axis, "angle": angle}},
              "output": {"fields": []}, "solve": {"estimate": False, "dt": 1e-4}}  # fmt: skip
    drawn = Scene.from_dict(tables | {"body": [robot, ball]}, folder=tmp_path)
    found = impactfem.solve(drawn)
    placed, other = found.scene.bodies
    turned = Rotation.from_rotvec(angle * np.array(axis) / np.linalg.norm(axis))
    own = turned * Rotation.from_rotvec([0.0, 0.0, 0.4])
    assert Rotation.from_matrix(placed.orientation.matrix(3)).as_matrix() == pytest.approx(
        own.as_matrix(), abs=1e-14
    )
    at = np.array(placed.position)
    assert np.array(other.center) - at == pytest.approx(turned.apply([0.2, 0.3, 0.3]), abs=1e-14)
    corners = at + own.apply(np.array(list(np.ndindex(2, 2, 2))) @ np.diag([0.3, 0.2, 0.1])
                             - [0.15, 0.1, 0.05])  # fmt: skip
    hub = own * Rotation.from_euler("xyz", [0.3, 0.0, 0.2]) * Rotation.from_rotvec([0, 0.5, 0])
    rise = hub.apply([0.0, 0.0, 1.0])[2]
    wheel = (at + own.apply([0.1, 0.2, -0.08]))[2]
    wheel -= 0.02 * abs(rise) + 0.06 * math.sqrt(1.0 - rise**2)
    assert min(corners[:, 2].min(), wheel, other.center[2] - 0.02) == pytest.approx(-1.0, abs=1e-12)
    speed = math.sqrt(2 * G * 0.8)
    assert placed.velocity == pytest.approx([0.1, 0.0, -speed], rel=1e-14)
    assert found.history["ball.vz"].values[0] == pytest.approx(-speed, rel=1e-14)
    assert found.history["gap"].values[0] == pytest.approx(0.0, abs=1e-12)
    again = impactfem.solve(Scene.from_dict(found.scene.to_dict(), folder=tmp_path)).history
    assert all(np.array_equal(again[name].values, column.values, equal_nan=True)
               for name, column in found.history.items())  # fmt: skip
    with pytest.raises(SceneError, match=r"body\[0\]\.base .*r is held, and does not fall"):
        impactfem.plan(
            Scene.from_dict(
                tables | {"body": [robot | {"base": "fixed", "velocity": [0.0] * 3}]},
                folder=tmp_path,
            )
        )
