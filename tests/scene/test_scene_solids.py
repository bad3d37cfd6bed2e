"""Solids and rigid obstacles made in Python: defaults, derived quantities, gravity, settings."""

import copy
import math
import pickle
import re
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from impactfem.errors import SceneError
from impactfem.scene import (
    Bar,
    Block,
    Cylinder,
    Disc,
    Formula,
    HalfSpace,
    Output,
    PiecewiseVector,
    Refinement,
    RigidCylinder,
    RigidPolyline,
    RigidSphere,
    Scene,
    Solid,
    Solve,
    Support,
    Wall,
)
from impactfem.scene.json_schema import json_schema
from impactfem.scene.obstacles.rotation import placement

VALIDATOR = jsonschema.Draft7Validator(json_schema())
STEEL = {"density": 7800.0, "youngs_modulus": 2.1e11, "poisson_ratio": 0.3}


def disc(**changes):
    given = {
        "name": "disc",
        "model": "plane_strain",
        "shape": Disc(radius=0.5, center=[0, 0.52]),
        "mesh_size": 0.03,
        **STEEL,
    }
    return Solid(**(given | changes))


def floor(dim=2, **changes):
    up = [0, 1, 0][:dim]
    return HalfSpace(**({"name": "floor", "point": [0] * dim, "normal": up} | changes))


def make(**changes):
    given = {"title": "t", "duration": 5, "bodies": [disc()], "obstacles": [floor()]}
    return Scene(**(given | changes))


def test_defaults():
    scene = make()
    solid = scene.solid
    zero = Formula("0.0", ("x", "y", "z"))
    assert solid.velocity == solid.displacement == (zero, zero)
    assert solid.angular_velocity == 0.0
    assert (solid.cells, solid.degree, solid.thickness) == ("simplex", None, 1.0)
    assert solid.supports == solid.tractions == solid.pressures == solid.refine == ()
    assert solid.contact_surfaces is None
    assert scene.vector_gravity == scene.gravity == PiecewiseVector((0.0,), ((0.0, 0.0),))
    assert scene.output == Output(checkpoint=None)
    assert scene.rigid_obstacles == scene.obstacles
    cube = disc(model="3d", shape=Block(size=[1, 1, 1]))
    assert cube.velocity == (zero, zero, zero)
    assert cube.angular_velocity == (0.0, 0.0, 0.0)


def test_tables_may_be_plain():
    plain = disc(
        shape={"kind": "disc", "radius": 0.5, "center": (0, 0.52)},
        refine=[{"point": np.zeros(2), "radius": 0.1, "size": 0.01}],
        supports=[{"surface": "rim", "kind": "motion", "value": ["", "0.1*sin(t)"]}],
    )
    made = disc(
        refine=[Refinement(point=[0, 0], radius=0.1, size=0.01)],
        supports=[Support(surface="rim", kind="motion", value=[None, "0.1*sin(t)"])],
    )
    assert plain == made
    assert hash(plain) == hash(made)
    assert made.supports[0].value[0] is None
    assert made.supports[0].value[1](t=math.pi / 2) == pytest.approx(0.1)


def test_elastic_constants():
    solid = disc()
    # Of steel with E = 210 GPa, nu = 0.3 (tables of isotropic constants).
    assert solid.shear_modulus == pytest.approx(80.769230769e9)
    assert solid.lame == pytest.approx(121.153846154e9)
    bulk = solid.youngs_modulus / (3 * (1 - 2 * 0.3))
    assert solid.p_wave_speed == pytest.approx(
        math.sqrt((bulk + 4 / 3 * solid.shear_modulus) / 7800)
    )
    assert solid.s_wave_speed == pytest.approx(math.sqrt(80.769230769e9 / 7800))
    plate = disc(model="plane_stress")
    assert plate.p_wave_speed == pytest.approx(math.sqrt(2.1e11 / (1 - 0.09) / 7800))


@pytest.mark.parametrize(
    ("changes", "volume"),
    [
        ({}, math.pi / 4),
        ({"thickness": 0.01, "model": "plane_stress"}, math.pi / 400),
        ({"shape": Disc(radius=0.5, symmetry=["x"])}, math.pi / 8),
        ({"model": "axisymmetric", "shape": Disc(radius=0.5)}, math.pi / 6),
        ({"model": "axisymmetric", "shape": Block(size=[1, 2], corner=[1, 0])}, 6 * math.pi),
        ({"model": "3d", "shape": Cylinder(radius=1, height=2)}, 2 * math.pi),
    ],
)
def test_mass(changes, volume):
    assert disc(**changes).mass == pytest.approx(7800 * volume)


def test_a_mesh_file_tells_neither_mass_nor_surfaces(tmp_path):
    solid = disc(shape=None, mesh="body.msh", mesh_size=None)
    assert solid.mass is None
    assert solid.surface_names is None
    assert solid.all_supports == ()
    scene = make(bodies=[solid], folder=tmp_path)
    assert scene.mesh_path == tmp_path / "body.msh"
    assert 'mesh = "body.msh"' in scene.to_toml(tmp_path)
    assert f'mesh = "{tmp_path}/body.msh"' in scene.to_toml(tmp_path / "results")


def test_symmetry_cuts_are_supports():
    held = Support(surface="top", kind="fixed")
    solid = disc(shape=Block(size=[1, 1], symmetry=["x"]), supports=[held])
    assert solid.all_supports == (held, Support(surface="symmetry_x", kind="symmetry"))


def test_obstacles():
    assert floor(normal=[3, 4]).unit_normal == pytest.approx((0.6, 0.8))
    assert floor(normal=[1e30, 1e30]).unit_normal == pytest.approx((0.5**0.5, 0.5**0.5))
    assert floor(normal=[1e-40, 0]).unit_normal == (1.0, 0.0)
    pin = RigidCylinder(point=[0, 0, 0], axis=[0, 0, 2], radius=1)
    assert pin.unit_axis == (0.0, 0.0, 1.0)
    moving = floor(motion=["0", "0.01*sin(t)"])
    assert not floor().moves
    np.testing.assert_allclose(placement(moving, math.pi / 2).shift, [0, 0.01])


@pytest.mark.parametrize(
    ("known", "other", "rest"),
    [
        ("point", "center", {"kind": "half_space", "normal": [0.0, 1.0]}),
        ("point", "center", {"kind": "cylinder", "radius": 1.0}),
        ("center", "point", {"kind": "sphere", "radius": 1.0}),
        ("center", "point", {"kind": "box", "size": [1.0, 1.0]}),
    ],
)
def test_the_place_of_an_obstacle_goes_by_two_names(known, other, rest):
    data = make().to_dict() | {"obstacle": [rest | {"name": "it", other: [0.0, -1.0]}]}
    scene = Scene.from_dict(data)
    VALIDATOR.validate(data)
    assert getattr(scene.obstacles[0], known) == (0.0, -1.0)
    assert scene.to_dict()["obstacle"][0][known] == [0.0, -1.0], "one name is written"
    for wrong in (rest, rest | {known: [0.0, -1.0], other: [0.0, -1.0]}):
        assert not VALIDATOR.is_valid(data | {"obstacle": [wrong]})


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0], [1, 0]],
        [[0, 0], [1, 0], [2, 1], [3, 0], [3, -1]],
        [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]],  # closed
        [[0, 0], [1, 0], [1, 1], [0.5, 0.5], [0.2, 0.9]],
    ],
)
def test_polylines(points):
    assert RigidPolyline(points=points).points == tuple(tuple(map(float, p)) for p in points)


def test_gravity_of_solids():
    scene = make(gravity=[[0, [0, -9.81]], [1.5, [0, 0]]])
    load = scene.vector_gravity
    assert load == PiecewiseVector((0, 1.5), ((0, -9.81), (0, 0)))
    assert tomllib.loads(scene.to_toml())["gravity"] == [[0.0, [0.0, -9.81]], [1.5, [0.0, 0.0]]]
    assert make(gravity=[0, -9.81]).to_dict()["gravity"] == [0.0, -9.81]


class TestPiecewiseVector:
    load = PiecewiseVector((0.0, 1.0, 3.0), ((2.0, 0.0), (-1.0, 4.0), (5.0, 0.0)))

    def test_value_from_each_time_on(self):
        expected = [[2, 0], [2, 0], [-1, 4], [5, 0]]
        np.testing.assert_array_equal(self.load.at([-1.0, 0.5, 1.0, 9.0]), expected)
        np.testing.assert_array_equal(self.load.at(1.0), [-1, 4])
        assert self.load.at(np.zeros((2, 3))).shape == (2, 3, 2)

    def test_mean(self):
        np.testing.assert_allclose(self.load.mean(0, 4), [(2 - 2 + 5) / 4, 8 / 4])
        np.testing.assert_allclose(self.load.mean(0.5, 1.5), [0.5, 2.0])
        np.testing.assert_array_equal(self.load.mean(1.0, 1.0), [-1, 4])

    def test_constant(self):
        assert self.load.dim == 2
        assert not self.load.is_constant
        assert PiecewiseVector((0,), ((0, 0, -9.81),)).is_constant

    @pytest.mark.parametrize(
        ("times", "values", "part"),
        [
            ((0,), ((1, 2), (3, 4)), "1 times and 2 vectors"),
            ((0, 1), ((1, 2), (3, 4, 5)), "different numbers of entries"),
            ((0,), ((1, 2, 3, 4),), "no vector of 1, 2 or 3 entries"),
            ((0,), 3, "is not a list"),
            ((1,), ((1, 2),), "must be 0.0"),
        ],
    )
    def test_mistakes(self, times, values, part):
        with pytest.raises(SceneError, match=part):
            PiecewiseVector(times, values)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))])  # noqa: S301
def test_scenes_are_values(copied):
    scene = make(gravity=[0, -1], obstacles=[floor(), RigidSphere(center=[3, 0], radius=1)])
    twin = copied(scene)
    assert twin == scene
    assert hash(twin) == hash(scene)


@pytest.mark.parametrize(
    ("path", "value", "read"),
    [
        ("body.disc.shape.radius", 0.4, lambda s: s.solid.shape.radius == 0.4),
        ("body.0.shape.center", [0, 1], lambda s: s.solid.shape.center == (0.0, 1.0)),
        ("body.disc.supports.0.kind", "symmetry", lambda s: s.solid.supports[0].kind == "symmetry"),
        ("body.disc.velocity", [0, "-x"], lambda s: s.solid.velocity[1](x=2.0) == -2),
        ("obstacle.floor.normal", [0, 2], lambda s: s.obstacles[0].normal == (0.0, 2.0)),
        ("gravity", [0, -1], lambda s: s.vector_gravity.at(0.0)[1] == -1),
        ("gravity", None, lambda s: not s.vector_gravity.at(0.0).any()),
        ("output.checkpoint", 10, lambda s: s.output.checkpoint == 10),
        ("solve.method", "massless", lambda s: s.solve.method == "massless"),
    ],
)
def test_settings_inside_tables(path, value, read):
    scene = make(gravity=[0, -9.81], bodies=[disc(supports=[Support(surface="rim", kind="fixed")])])
    new = scene.with_settings({path: value})
    assert read(new)
    assert new.with_settings({}) == new


def test_settings_keep_the_tables_of_the_caller():
    scene = make()
    bodies = scene.to_dict()["body"]
    before = copy.deepcopy(bodies)
    new = scene.with_settings({"body": bodies, "body.disc.shape.radius": 0.25})
    assert new.solid.shape.radius == 0.25
    assert bodies == before


def test_text_settings():
    new = make().with_settings(["body.disc.shape.radius=0.4", "solve.normals=updated"])
    assert (new.solid.shape.radius, new.solve.normals) == (0.4, "updated")


def test_bars_and_solids_are_asked_for_by_name():
    bar = Bar(length=1, density=1, youngs_modulus=1)
    of_bar = Scene(title="t", duration=1, bodies=[bar], obstacles=[Wall()], gravity=2)
    assert of_bar.bar == bar
    assert of_bar.axial_gravity(0.0) == 2
    with pytest.raises(SceneError, match="needs a Solid"):
        _ = of_bar.solid
    for name in ("vector_gravity", "rigid_obstacles"):
        with pytest.raises(SceneError, match="moves in space"):
            getattr(of_bar, name)
    for name in ("bar", "axial_gravity"):
        with pytest.raises(SceneError, match="needs a Bar"):
            getattr(make(), name)


def test_example_of_the_scene_reference():
    page = (Path(__file__).parents[2] / "docs" / "scene.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```toml\n(title.*?)```", page, re.DOTALL)
    scene = Scene.from_dict(tomllib.loads(example))
    assert scene.solid.surface_names == ("rim", "symmetry_x")
    assert scene.solid.mass == pytest.approx(1000 * math.pi / 8)
    assert len(scene.rigid_obstacles) == 2


def test_settings_of_solids():
    solve = Solve(method="conserving", active_set="snes_vi", normals="updated", estimate=True)
    assert make(solve=solve).solve.active_set == "snes_vi"
