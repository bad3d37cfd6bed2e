"""Rigid bodies and obstacles whose surface is in a file, against closed forms and shapes."""

import os
import re

import numpy as np
import pytest
from moving_scenes import alone, differences, scene, stopping
from surfaces import box, ell, sphere, swept, write_stl

import impactfem
from impactfem import RigidBody, Scene, SceneError
from impactfem.obstacles import RigidBox, RigidMesh
from impactfem.scene import surface_files

G = 9.81


def body_of(tmp_path, corners, **more):
    path = write_stl(tmp_path / "part.stl", corners)
    keys = {"name": "b", "mesh": path.name, "density": 1.0} | more
    return RigidBody(**keys).opened(tmp_path)


@pytest.mark.parametrize("binary", [False, True])
def test_mass_centre_and_inertia_of_blocks_are_exact(tmp_path, binary):
    write_stl(tmp_path / "block.stl", 100 * box((2.0, 1.0, 0.5), (1.0, 2.0, 3.0)), binary=binary)
    block = RigidBody(mesh="block.stl", scale=1e-2, density=3.0, position=[0.0, 0.0, 1.0])
    block = block.opened(tmp_path)
    assert block.total_mass == pytest.approx(3.0, rel=1e-12)
    assert block.center == pytest.approx([2.0, 2.5, 4.25], rel=1e-12)
    about = [3.0 / 12.0 * side for side in (1.0 + 0.25, 4.0 + 0.25, 4.0 + 1.0)]
    assert block.moments == pytest.approx(np.diag(about), rel=1e-11, abs=1e-11)
    assert len(block.form.nodes) == 8


def test_mass_centre_and_inertia_of_an_angle(tmp_path):
    body = body_of(tmp_path, ell())
    cubes = np.array([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]])
    arms = cubes - cubes.mean(axis=0)
    inertia = sum((a @ a + 1.0 / 6.0) * np.eye(3) - np.outer(a, a) for a in arms)
    assert body.total_mass == pytest.approx(3.0, rel=1e-14)
    assert body.center == pytest.approx(cubes.mean(axis=0), rel=1e-14)
    assert body.moments == pytest.approx(inertia, rel=1e-13, abs=1e-14)
    # The corner that bends inwards can touch nothing that such bodies meet.
    assert len(body.form.nodes) == 10
    # Its triangles turned inside out are the same body.
    other = body_of(tmp_path, ell()[:, ::-1])
    assert other.moments == pytest.approx(body.moments, rel=1e-13, abs=1e-14)


def test_facets_of_balls_and_rings_converge(tmp_path):
    errors = []
    for pieces in (8, 16):
        ball = body_of(tmp_path, sphere(1.0, pieces, (0.3, 0.2, 0.1)))
        turn = 2.0 * np.pi * np.arange(2 * pieces) / (2 * pieces)
        profile = np.stack([3.0 + np.cos(turn), np.sin(turn)], axis=1)
        ring = body_of(tmp_path, swept(profile, 4 * pieces))
        assert ball.center == pytest.approx([0.3, 0.2, 0.1], abs=1e-12)
        mass = 2.0 * np.pi**2 * 3.0  # of a torus, R = 3, r = 1; its inertia about the axis y
        exact = [4.0 / 3.0 * np.pi, 8.0 / 15.0 * np.pi, mass, mass * (9.0 + 0.75)]
        found = [ball.total_mass, ball.moments[1, 1], ring.total_mass, ring.moments[1, 1]]
        errors.append(np.array(exact) / found - 1.0)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert np.abs(errors[1]).max() < 0.04


def test_distances_of_a_block_from_a_file_are_those_of_a_box(tmp_path):
    write_stl(tmp_path / "box.stl", box((2.0, 1.0, 0.5), (1.0, 1.0, 3.0)))
    found = RigidMesh(mesh="box.stl").opened(tmp_path)
    known = RigidBox(center=[2.0, 1.5, 3.25], size=[2.0, 1.0, 0.5])
    rng = np.random.default_rng(1)
    places = np.array(known.center) + rng.uniform(-1.5, 1.5, (4000, 3)) * [1.0, 0.6, 0.35]
    (gap, normal), (exact, direction) = found.gap(places), known.gap(places)
    assert (exact < 0.0).any()
    assert gap == pytest.approx(exact, abs=1e-14)
    assert normal == pytest.approx(direction, abs=1e-13)
    write_stl(tmp_path / "ball.stl", sphere(1.0, 40))
    hollow = RigidMesh(mesh="ball.stl", side="inside").opened(tmp_path)
    places = rng.normal(size=(1000, 3))
    places *= rng.uniform(0.2, 1.5, 1000)[:, None] / np.linalg.norm(places, axis=1)[:, None]
    gap, normal = hollow.gap(places)
    assert gap == pytest.approx(1.0 - np.linalg.norm(places, axis=1), abs=2e-3)
    slopes = [(hollow.gap(places + h)[0] - hollow.gap(places - h)[0]) / 2e-6
              for h in 1e-6 * np.eye(3)]  # fmt: skip
    assert np.median(np.abs(np.stack(slopes, axis=1) - normal)) < 1e-8


def winding(corners, places):
    """How often triangles go around places; Van Oosterom and Strackee (1983)."""
    a, b, c = (corners[None, :, k] - places[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(arm, axis=2) for arm in (a, b, c))
    dots = [np.einsum("pts,pts->pt", *pair) for pair in ((a, b), (b, c), (c, a))]
    over = np.einsum("pts,pts->pt", a, np.cross(b, c))
    under = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return np.arctan2(over, under).sum(axis=1) / (2.0 * np.pi)


@pytest.mark.parametrize("inside_out", [False, True])
def test_the_side_is_right_at_sharp_edges(tmp_path, inside_out):
    spike = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.1, 0.0], [0.45, 0.05, 1.0]])
    spike = spike[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]]
    for corners in (spike, ell() @ np.array([[1.0, 0.0, 0.0], [1.5, 0.3, 0.0], [0.0, 0.7, 1.0]])):
        drawn = corners[:, ::-1] if inside_out else corners
        write_stl(tmp_path / "sharp.stl", drawn)
        sharp = RigidMesh(mesh="sharp.stl").opened(tmp_path)
        low, high = corners.min(axis=(0, 1)) - 0.2, corners.max(axis=(0, 1)) + 0.2
        places = np.random.default_rng(2).uniform(low, high, (2000, 3))
        inside = winding(corners, places) > 0.5
        assert inside.any()
        gap, other = sharp.gap(places)[0], sharp.other_gap(places)[0]
        assert np.array_equal(gap < 0.0, inside)
        assert (other >= gap - 1e-12)[~inside].all()  # no face is seen through the body


def test_a_ball_in_a_corner_that_bends_inwards_sees_both_faces(tmp_path):
    write_stl(tmp_path / "ell.stl", ell())
    angle = RigidMesh(mesh="ell.stl").opened(tmp_path)
    places = np.array([[1.3, 1.2, 0.5], [1.6, 1.1, 0.4], [0.5, 0.5, 1.2], [0.5, 0.5, 0.9]])
    gap, normal = angle.other_gap(places)
    assert gap[:2] == pytest.approx([0.3, 0.6], abs=1e-15)
    assert normal[:2] == pytest.approx(np.array([[1.0, 0.0, 0.0]] * 2), abs=1e-15)
    assert np.isinf(gap[2:]).all()
    write_stl(tmp_path / "plate.stl", box((1.0, 0.05, 1.0)))
    plate = RigidMesh(mesh="plate.stl").opened(tmp_path)
    # Not the back of what it lies on.
    assert np.isinf(plate.other_gap(np.array([[0.5, 0.07, 0.5], [0.5, 0.04, 0.5]]))[0]).all()


FAULTS = {
    "is not closed: 3 of its 18 edges, one at (1, 0.5, 0.5), belong to one": box()[:-1],
    "meets itself: 18 of its 18 edges": np.concatenate([box(), box()]),
    "is not oriented: 3 of its 18 edges": np.concatenate([box()[:-1], box()[-1:, ::-1]]),
    "has 2 separate parts: give each": np.concatenate([box(), box(corner=(3.0, 0.0, 0.0))]),
    "crosses itself near (": np.where(np.isclose(box(), 1.0).all(axis=2)[..., None],
                                      [-0.5, -0.5, 0.5], box()),
    "encloses no volume: give": np.concatenate([box()[:1], box()[:1, ::-1]]),
}  # fmt: skip


def files(kind):
    """A scene with a file in it: a body's, or an obstacle's."""
    plane = {"kind": "half_space", "name": "o", "point": [0, -5, 0], "normal": [0, 1, 0]}
    ball = {"shape": {"kind": "sphere", "radius": 0.1, "center": [0, 3, 0]}}
    given = {"mesh": "x.stl"} if kind == "body" else ball
    stone = {"kind": "mesh", "name": "o", "mesh": "x.stl"}
    return {
        "title": "files", "duration": 0.01,
        "body": [{"kind": "rigid", "name": "b", "mass": 1.0} | given],
        "obstacle": [plane if kind == "body" else stone],
    }  # fmt: skip


@pytest.mark.parametrize("kind", ["body", "obstacle"])
@pytest.mark.parametrize("said", FAULTS)
def test_surfaces_of_no_body_are_told_with_file_and_remedy(tmp_path, kind, said):
    write_stl(tmp_path / "x.stl", FAULTS[said])
    if kind == "obstacle" and said.startswith("is not closed"):
        Scene.from_dict(files(kind), base=tmp_path)  # as terrain
        return
    with pytest.raises(SceneError) as told:
        Scene.from_dict(files(kind), base=tmp_path)
    assert str(told.value).startswith(f'{kind}[0].mesh = "x.stl" {said}'), told.value
    assert str(told.value).endswith(f"(the file is {tmp_path / 'x.stl'}).")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"mesh": "no.stl"}, 'body[0].mesh = "no.stl" cannot be read (No such file or directory)'),
        ({"mesh": "x.pdf"}, "its name does not end in .stl, .msh, .step"),
        ({"mesh_size": 0.1}, "body[0].mesh_size = 0.1: the file holds its elements; remove it"),
        ({"mesh": "x.step"}, "body[0].mesh_size is missing: a STEP file needs it"),
        ({"model": "2d", "velocity": [0, 0]}, "is a surface in space: in the plane give a .msh"),
        ({"scale": 0.0}, "body[0].scale = 0.0"),
        ({"scale": 1e-200}, "below 1e-50, which vanishes: give SI units"),
        ({"position": [0.0, 1.0]}, "position = [0.0, 1.0] has 2 entries, the shape has 3: give 3"),
        ({"shape": {"kind": "sphere", "radius": 1.0}}, "shape and mesh are given; give a shape"),
        ({"mesh": None}, "shape: neither is given; give a shape"),
        ({"mesh": None, "shape": {"kind": "sphere", "radius": 1.0}, "scale": 2.0},
         "scale = 2.0 is for mesh, and a shape is given: remove it"),
    ],
)  # fmt: skip
def test_bad_keys_of_files_are_told(tmp_path, change, said):
    write_stl(tmp_path / "x.stl", box())
    data = files("body")
    data["body"][0] |= change
    with pytest.raises(SceneError) as told:
        Scene.from_dict(data, base=tmp_path)
    assert said in str(told.value), told.value


@pytest.mark.parametrize("content", [b"", b"solid x\nvertex 1 2 3\n", b"solid\nvertex 1 2 a"])
def test_files_that_are_cut_off_are_told(tmp_path, content):
    (tmp_path / "x.stl").write_bytes(content)
    with pytest.raises(SceneError, match="is no STL file, or is cut off: export it again"):
        Scene.from_dict(files("obstacle"), base=tmp_path)


def test_a_mesh_stands_in_space_only(tmp_path):
    write_stl(tmp_path / "x.stl", box())
    data = files("obstacle")
    data["body"][0]["shape"] = {"kind": "disc", "radius": 0.1, "center": [0.0, 3.0]}
    with pytest.raises(SceneError, match=re.escape('obstacle[0].kind = "mesh" is for bodies in s')):
        Scene.from_dict(data, base=tmp_path)


def test_bodies_that_are_not_convex_meet_hollows_only(tmp_path):
    write_stl(tmp_path / "x.stl", ell())
    data = files("body")
    data["obstacle"] = [{"kind": "sphere", "name": "o", "center": [0, -9, 0], "radius": 1.0}]
    with pytest.raises(SceneError, match="of b and o is not available: b is not convex, and meets"):
        Scene.from_dict(data, base=tmp_path)
    ball = {"kind": "rigid", "name": "c", "mass": 1.0}
    data["body"].append(ball | {"shape": {"kind": "sphere", "radius": 1.0, "center": [0, 9, 0]}})
    with pytest.raises(SceneError, match="b is not convex, and meets half-spaces and hollow obst"):
        Scene.from_dict(data, base=tmp_path)
    write_stl(tmp_path / "x.stl", sphere(1.0, 20))
    with pytest.raises(SceneError, match="the hull of b has 762 corners, more than 500: give a co"):
        Scene.from_dict(data, base=tmp_path)
    write_stl(tmp_path / "x.stl", sphere(1.0, 8))
    assert Scene.from_dict(data, base=tmp_path).bodies[0].is_convex


def tumbling(**body):
    """A block thrown on a floor with friction."""
    return {
        "title": "tumbling", "duration": 0.08, "gravity": [0.0, -G, 0.0],
        "body": [{"kind": "rigid", "name": "b", "density": 500.0, "velocity": [1.0, -1.0, 0.0],
                  "orientation": {"axis": [1.0, 1.0, 0.0], "angle": 0.2},
                  "angular_velocity": [1.0, 2.0, 3.0]} | body],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0, 0.0],
                      "normal": [0.0, 1.0, 0.0]}],
        "contact": [{"between": ["b", "floor"], "friction_coefficient": 0.4, "restitution": 0.2}],
        "probe": [{"name": "mark", "body": "b", "point": [0.1, 0.1, 0.07]}],
        "solve": {"dt": 1e-3, "estimate": False}, "output": {"checkpoint": 20, "fields": []},
    }  # fmt: skip


def test_a_block_from_a_file_moves_as_the_shape_and_restarts(tmp_path, monkeypatch):
    write_stl(tmp_path / "block.stl", 1e3 * box((0.2, 0.1, 0.15)))
    drawn = {"mesh": "block.stl", "scale": 1e-3, "position": [0.0, 0.05, 0.0]}
    given = Scene.from_dict(tumbling(**drawn), base=tmp_path)
    assert Scene.from_toml(_written(given, tmp_path / "deep")) == Scene.from_dict(
        tumbling(**drawn | {"mesh": str(tmp_path / "block.stl")})
    )
    whole = impactfem.solve(given)
    block = {"kind": "block", "size": [0.2, 0.1, 0.15], "corner": [0.0, 0.05, 0.0]}
    shaped = impactfem.solve(Scene.from_dict(tumbling(shape=block)))
    for name in shaped.history.data_vars:
        np.testing.assert_allclose(
            whole.history[name].values, shaped.history[name].values, rtol=1e-8, atol=1e-9
        )
    with stopping(monkeypatch, 67):
        impactfem.solve(given, checkpoints=tmp_path)
    assert differences(whole, impactfem.solve(given, checkpoints=tmp_path, restart=tmp_path)) == {}


def test_a_file_that_was_written_anew_is_read_anew(tmp_path):
    data, heights = files("obstacle"), []
    data |= {"duration": 0.05, "solve": {"dt": 1e-3, "estimate": False}}
    data["body"][0]["velocity"] = [0.0, -10.0, 0.0]
    data["body"][0]["shape"]["center"] = [0.5, 1.35, 0.5]
    for top in (1.0, 0.5):
        write_stl(tmp_path / "x.stl", box((1.0, top, 1.0)))
        result = impactfem.solve(Scene.from_dict(data, base=tmp_path))
        heights.append(result.history["b.y"].values[-1])
    assert heights[0] == pytest.approx(1.1, abs=0.01)
    assert heights[1] == pytest.approx(1.35 - 0.5, abs=0.01)


def _written(given, folder):
    folder.mkdir()
    (folder / "scene.toml").write_text(given.to_toml(folder))
    return folder / "scene.toml"


TURNING = {"point": [0.0, 0.0, 0.0], "axis": [1.0, 0.2, 0.1], "angle": "0.5*sin(9*t)"}
SLAB = {"kind": "box", "name": "o", "center": [0.0, -0.1, 0.0], "size": [1.0, 0.2, 0.6]}
FALLING = {
    "rigid": {"kind": "rigid", "mass": 1.0, "velocity": [1.5, -1.0, 0.0],
              "shape": {"kind": "sphere", "radius": 0.05, "center": [0.4, 0.08, 0.1]}},
    "point": {"kind": "point", "mass": 1.0, "position": [0.4, 0.03, 0.1],
              "velocity": [1.5, -1.0, 0.0]},
}  # fmt: skip


def slabs(tmp_path):
    """A box, and the same from a file."""
    write_stl(tmp_path / "slab.stl", box((1.0, 0.2, 0.6), (-0.5, -0.2, -0.3)))
    drawn = {"kind": "mesh", "name": "o", "mesh": str(tmp_path / "slab.stl")}
    return [slab | {"rotation": TURNING} for slab in (SLAB, drawn)]


@pytest.mark.parametrize("kind", FALLING)
def test_balls_meet_a_turning_box_from_a_file_as_the_shape(tmp_path, kind):
    results = []
    for slab in slabs(tmp_path):
        data = tumbling() | {"body": [FALLING[kind] | {"name": "b"}], "obstacle": [slab]}
        data["contact"] = [{"between": ["b", "o"], "friction_coefficient": 0.3, "restitution": 0.5}]
        results.append(impactfem.solve(Scene.from_dict(data | {"probe": []})))
    one, other = (result.history for result in results)
    assert results[0].summary["contact"]["impulse"] > 1.0
    for name in one.data_vars:
        np.testing.assert_allclose(other[name].values, one[name].values, rtol=1e-10, atol=1e-10)


def test_solids_meet_a_turning_box_from_a_file_as_the_shape(tmp_path):
    body = {
        "model": "3d", "mesh_size": 0.2, "velocity": [0.0, -0.3, 0.0],
        "contact_surfaces": ["bottom"],
        "shape": {"kind": "block", "size": [0.2, 0.1, 0.2], "corner": [0.2, 0.03, -0.1]},
    }  # fmt: skip
    results = [
        impactfem.solve(scene(body, [slab | {"name": "o0"}], 0.4, [0.0, -0.5, 0.0],
                              {"method": "conserving"}, {"fields": []}))
        for slab in slabs(tmp_path)
    ]  # fmt: skip
    one, other = (result.history for result in results)
    assert results[0].summary["contact"]["impulse"] > 0.0
    for name in one.data_vars:
        np.testing.assert_allclose(other[name].values, one[name].values, rtol=1e-9, atol=1e-9)


def test_meshes_and_step_files_are_read_by_gmsh(tmp_path):
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addBox(0, 0, 0, 20, 10, 5)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "part.step"))
        gmsh.option.setNumber("Mesh.MeshSizeMax", 5.0)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(tmp_path / "part.msh"))
        gmsh.clear()
        gmsh.model.occ.addDisk(0.5, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.1)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(tmp_path / "disc.msh"))
    finally:
        gmsh.finalize()
    for keys in ({"mesh": "part.step", "mesh_size": 5e-3}, {"mesh": "part.msh", "scale": 1e-3}):
        part = RigidBody(density=1e3, **keys).opened(tmp_path)
        assert part.total_mass == pytest.approx(1e-3, rel=1e-9)
        assert part.center == pytest.approx([1e-2, 5e-3, 2.5e-3], rel=1e-9)
        assert len(part.form.nodes) == 8
    disc = RigidBody(mesh="disc.msh", model="2d", density=1.0).opened(tmp_path)
    assert disc.total_mass == pytest.approx(np.pi, rel=2e-3)
    assert disc.center == pytest.approx([0.5, 0.0], abs=1e-12)
    assert disc.moments[0, 0] == pytest.approx(np.pi / 2.0, rel=4e-3)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b'SystemCall "touch {}";\nSetFactory("OpenCASCADE");\nBox(1) = {0,0,0, 1,1,1};\nMesh 3;',
         r"does not begin with \$MeshFormat"),
        (b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 9 1 9", "Gmsh says: .*correct the file"),
        (None, "it is no regular file"),
    ],
)  # fmt: skip
def test_a_mesh_of_strangers_is_no_program_and_no_pipe(tmp_path, content, said):
    path, target = tmp_path / "bad.msh", tmp_path / "hit"
    if content is None:
        os.mkfifo(path)  # reading it would wait for ever
    else:
        path.write_bytes(content.replace(b"{}", bytes(target)))
    for given in (RigidBody(mesh="bad.msh", density=1.0), RigidMesh(mesh="bad.msh")):
        with pytest.raises(SceneError, match=rf'mesh = "bad.msh" .*{said}'):
            given.opened(tmp_path)
    assert not target.exists()


def test_surfaces_of_more_facets_than_are_read_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(surface_files, "MOST_FACES", 11)
    write_stl(tmp_path / "block.stl", box())
    with pytest.raises(SceneError, match="has 12 facets, more than the 11 that are read: give a c"):
        RigidBody(mesh="block.stl", density=1.0).opened(tmp_path)


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch, tmp_path):
    write_stl(tmp_path / "block.stl", box((0.2, 0.1, 0.15), (0.0, 0.05, 0.0)))
    given = Scene.from_dict(tumbling(mesh="block.stl"), base=tmp_path)
    both = impactfem.solve(given)
    with alone(monkeypatch):
        one = impactfem.solve(given)
    for name in one.history.data_vars:
        np.testing.assert_allclose(
            both.history[name].values, one.history[name].values, rtol=1e-10, atol=1e-10
        )
