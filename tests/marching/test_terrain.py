"""Rigid bodies of every shape, and solids, on surfaces of triangles: closed ones and terrain."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from surfaces import box, write_stl

import impactfem
from impactfem import Scene, SceneError
from impactfem.obstacles import RigidMesh

_G = 9.81
_PLANE = {
    "kind": "half_space",
    "name": "floor",
    "point": [0.0, 0.0, 0.0],
    "normal": [0.0, 1.0, 0.0],
}
_BODIES = {
    "box": {"shape": {"kind": "block", "size": [0.3, 0.2, 0.25], "corner": [-0.15, 0.0, -0.12]}},
    "can": {"shape": {"kind": "cylinder", "radius": 0.1, "height": 0.3, "center": [0.0, 0.0, 0.0]}},
    "capsule": {
        "shape": {
            "kind": "capsule", "radius": 0.1, "length": 0.3, "center": [0.0, 0.1, 0.0],
            "axis": [0.0, 0.0, 1.0],
        }
    },
    "ball": {"shape": {"kind": "sphere", "radius": 0.1, "center": [0.0, 0.1, 0.0]}},
    "several": {
        "shapes": [
            {"kind": "block", "size": [0.2, 0.1, 0.2], "corner": [-0.1, 0.0, -0.1]},
            {
                "kind": "hull",
                "points": [[0.1, 0, 0.1], [0.4, 0, 0.1], [0.1, 0, 0.4], [0.1, 0.2, 0.1]],
            },
        ]
    },
}  # fmt: skip


def mesh(**more):
    return {"kind": "mesh", "name": "floor"} | more


@pytest.fixture
def run(tmp_path):
    """Solve a scene of a body over floors."""

    def solve(body, *floors, duration=0.05, gravity=(0.0, -_G, 0.0), friction=0.3, dt=1e-3, **law):
        between = {"friction_coefficient": friction} | law
        given = {
            "title": "terrain", "duration": duration, "gravity": list(gravity),
            "body": [{"kind": "rigid", "name": "b", "density": 1000.0} | body],
            "obstacle": list(floors),
            "contact": [{"between": ["b", floor["name"]]} | between for floor in floors],
            "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
        }  # fmt: skip
        return impactfem.solve(Scene.from_dict(given, base=tmp_path))

    return solve


def differences(one, two):
    """Largest ones of places, turns and speeds of the body, and of energies."""
    names = [n for n in one.history if n.startswith("b.") or n.endswith("_energy")]
    return max(np.abs(one.history[n].values - two.history[n].values).max() for n in names)


def uneven(path, size=4.0, pieces=7):
    """A flat open surface in y = 0 that looks up: no two triangles alike, either diagonal."""
    rng, grid = np.random.default_rng(0), np.linspace(-0.5 * size, 0.5 * size, pieces + 1)
    places = np.zeros((pieces + 1, pieces + 1, 3))
    places[..., 0], places[..., 2] = grid[:, None], grid
    off = rng.uniform(-0.3, 0.3, (pieces - 1, pieces - 1, 2)) * size / pieces
    places[1:-1, 1:-1, ::2] += off
    found = []
    for i, j in np.ndindex(pieces, pieces):
        a, b, c, d = places[i, j], places[i + 1, j], places[i + 1, j + 1], places[i, j + 1]
        found += [[a, c, b], [a, d, c]] if rng.random() < 0.5 else [[a, d, b], [b, d, c]]
    return write_stl(path, np.array(found))


@pytest.mark.parametrize("name", _BODIES)
@pytest.mark.parametrize("speed", [(0.0, 0.0, 0.0), (4.0, 0.0, 0.0)], ids=["rests", "slides"])
def test_what_rests_or_slides_feels_no_seams(tmp_path, run, name, speed):
    uneven(tmp_path / "flat.stl")
    body = _BODIES[name] | {"velocity": list(speed)}
    assert differences(run(body, _PLANE), run(body, mesh(mesh="flat.stl"))) < 1e-11


def test_terrain_may_lean_and_turn(tmp_path, run):
    uneven(tmp_path / "flat.stl")
    turning = {
        "rotation": {"point": [0.0, 0.0, 0.0], "axis": [0.6, 0.0, 0.8], "angle": "0.3+0.5*t"}
    }
    shape = {"kind": "block", "size": [0.3, 0.2, 0.25], "corner": [-0.15, -0.1, -0.12]}
    axis, angle = np.array([0.6, 0.0, 0.8]), 0.3
    up = np.array([0.0, 1.0, 0.0])
    normal = np.cos(angle) * up + np.sin(angle) * np.cross(axis, up)
    shape["corner"] = (np.array(shape["corner"]) + 0.1 * normal).tolist()
    body = {
        "shape": shape, "orientation": {"axis": axis.tolist(), "angle": angle},
        "angular_velocity": (0.5 * axis).tolist(),
    }  # fmt: skip
    slab = {"kind": "box", "name": "floor", "size": [4.0, 1.0, 4.0], "center": [0.0, -0.5, 0.0]}
    both = [run(body, floor | turning) for floor in (slab, mesh(mesh="flat.stl"))]
    assert differences(*both) < 1e-9


@pytest.mark.parametrize("name", ["capsule", "box", "can"])
def test_a_valley_is_two_half_spaces(tmp_path, run, name):
    """Leaning by 45 degrees in a groove; seams run across it too."""
    low = [[x, 0.0, 0.0] for x in (-1.0, 0.1, 1.0)]
    high = [[[x, 1.0, side] for x in (-1.0, -0.2, 1.0)] for side in (1.0, -1.0)]
    triangles = []
    for edge, way in zip(high, (1, -1), strict=True):
        for k in range(2):
            pair = [[low[k], edge[k], low[k + 1]], [low[k + 1], edge[k], edge[k + 1]]]
            triangles += [one[::way] for one in pair]
    write_stl(tmp_path / "groove.stl", np.array(triangles))
    wall, half = _PLANE | {"point": [0.0, 0.0, 0.0]}, 2.0**-0.5
    walls = [
        wall | {"name": f"w{k}", "normal": [0.0, half, -s * half]}
        for k, s in enumerate((1.0, -1.0))
    ]
    lean = {"axis": [1.0, 0.0, 0.0], "angle": 0.25 * np.pi}
    bodies = {
        "capsule": {
            "shape": {
                "kind": "capsule", "radius": 0.1, "length": 0.3, "axis": [1.0, 0.0, 0.0],
                "center": [0.0, 0.1 * 2.0**0.5, 0.0],
            }
        },
        "box": {
            "shape": {
                "kind": "block", "size": [0.3, 0.2, 0.2],
                "corner": [-0.15, 0.1 * 2.0**0.5 - 0.1, -0.1],
            },
            "orientation": lean,
        },
        "can": {
            "shape": {
                "kind": "cylinder", "radius": 0.1, "height": 0.2,
                "center": [0.0, 0.1 * 2.0**0.5 - 0.1, 0.0],
            },
            "orientation": lean,
        },
    }  # fmt: skip
    body = bodies[name] | {"velocity": [1.5, 0.0, 0.0]}
    both = run(body, *walls, friction=0.0), run(body, mesh(mesh="groove.stl"), friction=0.0)
    assert differences(*both) < 1e-9


def test_a_closed_surface_is_met_like_the_box_that_it_is(tmp_path, run):
    """A capsule falls aslant on it, hits an edge, and slides off."""
    write_stl(tmp_path / "box.stl", box((1.0, 1.0, 1.0), (-0.5, -1.0, -0.5)))
    shape = {
        "kind": "capsule", "radius": 0.1, "length": 0.3, "center": [0.3, 0.101, 0.0],
        "axis": [0.0, 0.0, 1.0],
    }  # fmt: skip
    body = {"shape": shape, "velocity": [2.0, 0.0, 0.3], "angular_velocity": [1.0, 0.0, -3.0]}
    floor = {"kind": "box", "name": "floor", "size": [1.0, 1.0, 1.0], "center": [0.0, -0.5, 0.0]}
    both = [run(body, f, duration=0.3, friction=0.0) for f in (floor, mesh(mesh="box.stl"))]
    assert differences(*both) < 1e-9
    assert both[0].history["b.y"].values[-1] < 0.0


def test_a_box_slides_along_a_table_past_its_edge(tmp_path, run):
    """It tips when its centre is past the border, as over the edge of a box."""
    np.savetxt(tmp_path / "table.csv", np.zeros((5, 9)), delimiter=",")
    shape = {"kind": "block", "size": [0.3, 0.2, 0.1], "corner": [0.5, 0.1, 0.0]}
    body = {"shape": shape, "velocity": [1.0, 0.0, 0.0]}
    floor = {"kind": "box", "name": "floor", "size": [1.0, 1.0, 1.0], "center": [0.3, 0.2, -0.5]}
    terrain = mesh(heights="table.csv", spacing=0.1)
    both = [
        run(body, f, duration=0.25, gravity=(0.0, 0.0, -_G), friction=0.0) for f in (floor, terrain)
    ]
    z, turns = ([each.history[name].values for each in both] for name in ("b.z", "b.wy"))
    assert np.abs(turns[0][:150]).max() < 1e-9  # its centre is over the border at 0.15 s
    assert np.abs(turns[1][:150]).max() < 1e-9
    assert turns[1][-1] == pytest.approx(turns[0][-1], rel=0.02)
    assert turns[1][-1] > 0.5
    assert z[1] == pytest.approx(z[0], abs=2e-4)


def test_a_ball_that_rolls_over_the_border_falls(tmp_path, run):
    np.savetxt(tmp_path / "table.csv", np.zeros((5, 9)), delimiter=",")
    shape = {"kind": "sphere", "radius": 0.05, "center": [0.79, 0.2, 0.05]}
    body = {"shape": shape, "velocity": [2.0, 0.0, 0.0]}
    terrain = mesh(heights="table.csv", spacing=0.1)
    found = run(body, terrain, duration=0.2, gravity=(0.0, 0.0, -_G), friction=0.0)
    left = found.history["b.z"].values
    assert left[5] == pytest.approx(0.05, abs=1e-12)
    # From the border on it falls freely: v^2 / r > g, so that it parts at once.
    assert left[-1] == pytest.approx(0.05 - 0.5 * _G * 0.195**2, abs=2e-3)
    assert found.history["contact_force"].values[8:].max() == 0.0


def test_a_solid_rests_on_terrain_as_on_a_half_space(tmp_path):
    np.savetxt(tmp_path / "flat.csv", np.zeros((8, 8)), delimiter=",")
    solid = {
        "name": "b", "kind": "solid", "model": "3d", "density": 1.0, "youngs_modulus": 1.0,
        "poisson_ratio": 0.3, "strain": "small", "mesh_size": 0.5, "velocity": [0.0, 0.0, -0.1],
        "shape": {"kind": "block", "size": [0.5, 0.5, 0.5], "corner": [1.3, 1.2, 0.01]},
    }  # fmt: skip
    plane = _PLANE | {"normal": [0.0, 0.0, 1.0]}
    both = []
    for floor in (plane, mesh(heights="flat.csv", spacing=0.5)):
        scene = {
            "title": "block", "duration": 0.3, "body": [solid], "obstacle": [floor],
            "solve": {"dt": 0.02, "estimate": False, "method": "conserving"},
            "output": {"fields": []},
        }  # fmt: skip
        both.append(impactfem.solve(Scene.from_dict(scene, base=tmp_path)))
    assert both[0].history["contact_force"].values.max() > 0.0
    assert differences(*both) < 1e-12


def test_heights_are_met_where_they_are(tmp_path):
    heights = 0.1 * np.array([[0.0, 1.0, 0.0], [2.0, 3.0, 1.0]])
    np.savetxt(tmp_path / "h.csv", heights, delimiter=",", header="heights")
    found = RigidMesh(heights="h.csv", spacing=0.5).opened(tmp_path)
    places = np.array([[0.5 * j, 0.5 * i, heights[i, j]] for i, j in np.ndindex(2, 3)])
    gap, _ = found.gap(places)
    assert np.abs(gap).max() < 1e-15
    assert (found.gap(places + np.array([0.01, 0.01, 0.5]))[0][:2] > 0.0).all()
    assert found.gap(np.array([[0.3, 0.2, 0.0], [0.6, 0.3, 0.0]]))[0].max() < 0.0
    # Off the border nothing is inside, however low.
    assert (found.gap(np.array([[-0.1, 0.2, -5.0], [1.2, 0.2, 0.4]]))[0] > 0.0).all()


@pytest.mark.parametrize(
    ("keys", "content", "message"),
    [
        ({"heights": "h.csv", "spacing": 1.0}, "0,1\n0,nan\n", 'has "nan" in line 2'),
        ({"heights": "h.csv", "spacing": 1.0}, "0,1\n0,one\n", 'has "one" in line 2'),
        ({"heights": "h.csv", "spacing": 1.0}, "0,1,2\n", "has 1 rows of 3 heights"),
        ({"heights": "h.csv", "spacing": 1.0}, "", "has 0 rows of 0 heights"),
        ({"heights": "h.csv", "spacing": 1.0}, "0,1\n0\n", "has 1 heights in line 2, before 2"),
        ({"heights": "h.csv"}, "0,1\n0,1\n", "spacing is missing"),
        ({"heights": "h.csv", "spacing": -1.0}, "0,1\n0,1\n", "spacing = -1"),
        ({"heights": "other.csv", "spacing": 1.0}, "", "cannot be read"),
        ({"heights": "h.csv", "mesh": "m.stl", "spacing": 1.0}, "", "both are given"),
        ({"mesh": "m.stl", "spacing": 1.0}, "", "spacing = 1 is for heights"),
        ({}, "", "mesh is missing"),
        ({"heights": "h.csv", "spacing": 1.0, "scale": 2.0}, "", "scale = 2.0 is for mesh"),
    ],
)  # fmt: skip
def test_bad_heights_are_refused(tmp_path, run, keys, content, message):
    (tmp_path / "h.csv").write_text(content)
    with pytest.raises(SceneError, match=message):
        run(_BODIES["box"], mesh(**keys))


def test_surfaces_that_are_no_terrain_are_refused(tmp_path, run):
    one = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    two = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]])
    fin = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    for faces, message in (
        ([one, two], "is not oriented"),
        ([one[::-1], two, fin], "belong to more than two triangles"),
    ):
        write_stl(tmp_path / "bad.stl", np.array(faces))
        with pytest.raises(SceneError, match=message):
            run(_BODIES["box"], mesh(mesh="bad.stl"))
    uneven(tmp_path / "flat.stl")
    with pytest.raises(SceneError, match="inside obstacle floor"):
        run(_BODIES["box"], mesh(mesh="flat.stl", side="inside"))
    with pytest.raises(SceneError, match="is not closed"):
        run({"mesh": "flat.stl"}, _PLANE)


@pytest.mark.parametrize("base", ["free", "fixed"])
def test_links_of_a_mechanism_feel_no_seams(tmp_path, base):
    """An arm falls on terrain, or swings down on it, as on a half-space."""
    pytest.importorskip("pinocchio")
    uneven(tmp_path / "flat.stl")
    shutil.copy(Path(impactfem.__file__).parent / "starters" / "arm.urdf", tmp_path)
    arm = {
        "kind": "mechanism", "name": "arm", "file": "arm.urdf", "base": base,
        "position": [0.05, 0.5, -0.1],
        "orientation": {"axis": [1.0, 0.0, 0.0], "angle": -0.5 * np.pi},
        "joints": {"shoulder": {"position": 0.5, "velocity": 2.0}, "elbow": {"velocity": 1.0}},
    }  # fmt: skip
    found = []
    for floor in (_PLANE, mesh(mesh="flat.stl")):
        given = {
            "title": "arm", "duration": 0.12, "gravity": [0.0, -_G, 0.0], "body": [arm],
            "obstacle": [floor], "solve": {"dt": 2e-3, "estimate": False}, "output": {"fields": []},
            "contact": [{"between": ["arm", "floor"], "friction_coefficient": 0.3}],
        }  # fmt: skip
        found.append(impactfem.solve(Scene.from_dict(given, base=tmp_path)).history)
    one, two = found
    assert one["contact_force"].values.max() > 1.0
    names = [n for n in one if n.startswith("arm.") or n.endswith(("_energy", "_force"))]
    for name in names:
        size = max(1.0, np.abs(one[name].values).max())
        assert np.abs(one[name].values - two[name].values).max() < 1e-9 * size, name
