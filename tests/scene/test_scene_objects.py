"""Scenes made in Python: defaults, derived quantities, conversion, immutability."""

import copy
import math
import pickle
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from impactfem.scene import Bar, Formula, Output, PiecewiseConstant, Scene, Solve, Wall

BAR = {"length": 10.0, "density": 1.0, "youngs_modulus": 900.0}


def make(**changes):
    given = {"title": "t", "duration": 5, "bodies": [Bar(**BAR)], "obstacles": [Wall()]}
    return Scene(**(given | changes))


def test_defaults():
    scene = make()
    (bar,) = scene.bodies
    assert (bar.name, bar.area, bar.far_end, bar.gap) == ("bar", 1.0, "free", 0.0)
    assert bar.velocity == bar.displacement == Formula("0.0")
    assert scene.gravity == PiecewiseConstant((0.0,), (0.0,))
    assert scene.solve == Solve()
    assert set(vars(Solve()).values()) == {None}
    assert scene.output == Output(fields=("vtkhdf",), every=None)
    assert scene.folder is None
    assert scene.mesh_path is None
    assert scene.obstacles[0].kind == "wall"


def test_derived_quantities():
    bar = Bar(length=10, density=2, youngs_modulus=1800, area=0.5)
    assert bar.wave_speed == 30.0
    assert bar.transit_time == pytest.approx(1 / 3)
    assert bar.mass == 10.0


def test_initial_state():
    bar = Bar(**BAR, gap=0.5, velocity=-0.5, displacement="0.1*cos(pi*x/10)")
    x = np.linspace(0, 10, 7)
    np.testing.assert_allclose(bar.initial_displacement(x=x), 0.5 + 0.1 * np.cos(np.pi * x / 10))
    np.testing.assert_array_equal(bar.initial_velocity(x=x), np.full(7, -0.5))


def test_initial_displacement_of_a_rigid_shift_is_constant():
    shifted = Bar(**BAR, gap=0.5).initial_displacement
    assert shifted.is_constant
    assert shifted() == 0.5


def test_initial_displacement_of_the_longest_formula():
    text = "0*x" + "+0.1" * 249
    bar = Bar(**BAR, gap=0.5, displacement=text)
    assert bar.initial_displacement(x=3.0) == pytest.approx(25.4)


@pytest.mark.parametrize("value", [-1, -1.0, np.float64(-1), np.float32(-1), np.int32(-1), "-1.0"])
def test_numbers_of_any_kind(value):
    assert Bar(**BAR, velocity=value) == Bar(**BAR, velocity=Formula("-1.0"))
    assert isinstance(Bar(**(BAR | {"length": np.float32(2)})).length, float)


def test_integers_of_numpy():
    assert Solve(elements=np.int64(20)).elements == 20
    assert type(Solve(elements=np.int64(20)).elements) is int


def test_contact_at_the_start_is_allowed():
    bar = Bar(**BAR, gap=0.5, displacement="-0.5 + 0.01*x")
    assert bar.initial_displacement(x=0.0) == 0.0


def test_pre_stretched_rod_of_the_literature():
    bar = Bar(length=1, density=1, youngs_modulus=1, far_end="clamped", displacement="(1 - x)/2")
    np.testing.assert_array_equal(bar.initial_displacement(x=[0, 0.5, 1]), [0.5, 0.25, 0])


def test_lists_become_tuples():
    scene = make(output=Output(fields=["pvd", "vtx"]), gravity=[[0, 1], [0.5, 0]])
    assert isinstance(scene.bodies, tuple)
    assert isinstance(scene.obstacles, tuple)
    assert scene.output.fields == ("pvd", "vtx")
    assert scene.gravity == PiecewiseConstant((0.0, 0.5), (1.0, 0.0))
    assert make(gravity=np.array([[0, 1], [0.5, 0]])).gravity == scene.gravity


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))])  # noqa: S301
def test_scenes_are_values(copied):
    scene = make(solve=Solve(elements=8), gravity=9.81)
    twin = copied(scene)
    assert twin == scene
    assert hash(twin) == hash(scene)
    assert twin.bodies[0].velocity(x=1.0) == 0.0


def test_scenes_are_frozen():
    scene = make()
    for target, name in ((scene, "title"), (scene.bodies[0], "gap"), (scene.solve, "dt")):
        with pytest.raises(FrozenInstanceError):
            setattr(target, name, 1)


@pytest.mark.parametrize("fields", [(), ("vtx",), ("pvd", "vtkhdf", "vtx")])
def test_output_fields(fields):
    assert Output(fields=fields).fields == fields


def test_mesh_path_may_be_a_path(tmp_path):
    scene = make(solve=Solve(mesh=tmp_path / "bar.geo"))
    assert scene.solve.mesh == str(tmp_path / "bar.geo")
    assert scene.mesh_path == tmp_path / "bar.geo"


def test_extreme_but_good_scales():
    micro = Bar(length=1e-6, density=2330, youngs_modulus=1.6e11, area=1e-12, gap=1e-9)
    assert math.isclose(micro.wave_speed, 8286.71, rel_tol=1e-5)


class TestPiecewiseConstant:
    load = PiecewiseConstant((0.0, 1.0, 3.0), (2.0, -1.0, 5.0))

    def test_value_from_each_time_on(self):
        t = [-1.0, 0.0, 0.999, 1.0, 2.0, 3.0, 1e9]
        np.testing.assert_array_equal(self.load(t), [2, 2, 2, -1, -1, 5, 5])
        assert self.load(1.0) == -1.0
        assert self.load(np.zeros((2, 3))).shape == (2, 3)

    def test_integral(self):
        assert self.load.integral(0, 4) == pytest.approx(2 - 2 + 5)
        assert self.load.integral(4, 0) == pytest.approx(-5)
        assert self.load.integral(-1, 0.5) == pytest.approx(3)
        np.testing.assert_allclose(self.load.integral(0.5, [0.5, 1, 2]), [0, 1, 0])
        assert self.load.integral([[0.0], [1.0]], [1.0, 2.0, 3.0]).shape == (2, 3)

    def test_integral_against_quadrature(self):
        t = np.linspace(-1, 5, 60001)
        middle = (t[1:] + t[:-1]) / 2
        steps = self.load(middle) * np.diff(t)
        np.testing.assert_allclose(self.load.integral(t[0], t[1:]), np.cumsum(steps), atol=2e-12)

    def test_short_late_intervals_keep_their_digits(self):
        load = PiecewiseConstant((0.0, 0.7), (1e6, 0.1))
        start, end = 1e6, np.nextafter(1e6, 2e6)
        assert load.integral(start, end) == 0.1 * (end - start)

    def test_constant(self):
        assert PiecewiseConstant((0.0,), (9.81,)).is_constant
        assert not self.load.is_constant
        assert PiecewiseConstant((0,), (9,)).values == (9.0,)
