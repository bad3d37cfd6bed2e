"""Probes: displacement, velocity and stress of places, of every kind of body."""

import numpy as np
import pytest

import impactfem
from impactfem import Probe, Scene
from impactfem.errors import SceneError
from impactfem.shipped import shipped_scenes

ALL = ["displacement", "velocity", "stress"]
E, NU = 2.0, 0.3
SHAPES = {
    "plane": {"kind": "block", "size": [1.0, 0.5], "corner": [0.2, 0.0]},
    "3d": {"kind": "block", "size": [1.0, 0.5, 0.4], "corner": [0.2, 0.0, 0.1]},
    "disc": {"kind": "disc", "radius": 0.5, "center": [0.7, 0.5]},
    "cylinder": {"kind": "block", "size": [1.0, 0.5], "corner": [0.0, 0.0]},
}


def solid(model, shape, point, *, nu=NU, duration=0.01, quantities=ALL, method="massless", **more):
    dim = len(SHAPES[shape].get("size", [0, 0]))
    body = {
        "name": "body", "kind": "solid", "model": model, "density": 1.0, "youngs_modulus": E,
        "poisson_ratio": nu, "mesh_size": 0.2, "shape": SHAPES[shape],
    }  # fmt: skip
    below = [0.0] * dim
    below[1] = -9.0
    floor = {"kind": "half_space", "name": "floor", "point": below,
             "normal": [0.0, 1.0, 0.0][:dim]}  # fmt: skip
    return Scene.from_dict(
        {
            "title": "probe", "duration": duration, "body": [body | more], "obstacle": [floor],
            "probe": [{"name": "tip", "body": "body", "point": point, "quantities": quantities}],
            "solve": {"method": method, "estimate": False}, "output": {"fields": []},
        }
    )  # fmt: skip


def first(result, *names):
    return np.array([float(result.history[f"tip.{name}"].values[0]) for name in names])


CASES = [
    ("plane_strain", "plane", {}), ("plane_stress", "plane", {"cells": "hexahedron"}),
    ("plane_strain", "plane", {"degree": 2}),
    ("plane_strain", "plane", {"cells": "hexahedron", "nu": 0.49}),
    ("plane_strain", "plane", {"cells": "hexahedron", "degree": 2, "nu": 0.49}),
    ("axisymmetric", "cylinder", {}), ("3d", "3d", {}), ("3d", "3d", {"cells": "hexahedron"}),
]  # fmt: skip


@pytest.mark.parametrize(("model", "shape", "more"), CASES)
def test_a_uniform_strain_is_found_wherever_it_is_asked(model, shape, more):
    """Places are those of t = 0, and the strain is that of the undeformed body."""
    dim = 3 if model == "3d" else 2
    a, b, c, shear = 0.01, -0.02, 0.015, 0.004
    shear = 0.0 if model == "axisymmetric" else shear
    start = np.array([0.63, 0.31, 0.33][:dim])
    fields = [f"{a}*x + {shear}*y", f"{b}*y", f"{c}*z"][:dim]
    rates = ["0.3*x" if model == "axisymmetric" else "0.1 + 0.3*x", "0.2*y", "-0.1"][:dim]
    scale = np.array([1.0 + a, 1.0 + b, 1.0 + c][:dim])
    point = scale * start
    point[0] += shear * start[1]
    case = solid(model, shape, point.tolist(), displacement=fields, velocity=rates, **more)
    result = impactfem.solve(case)
    nu = more.get("nu", NU)
    moved = point - start
    letters = "xyz"[:dim]
    assert first(result, *(f"u{x}" for x in letters)) == pytest.approx(moved, abs=1e-12)
    speed = [0.3 * start[0] + 0.1 * (model != "axisymmetric"), 0.2 * start[1], -0.1][:dim]
    assert first(result, *(f"v{x}" for x in letters)) == pytest.approx(speed, abs=1e-12)
    strain = np.diag([a, b, {"3d": c, "axisymmetric": a}.get(model, 0.0)])
    strain[0, 1] = strain[1, 0] = 0.5 * shear
    if model == "plane_stress":
        strain[2, 2] = -nu / (1.0 - nu) * (a + b)
    lame, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), 0.5 * E / (1 + nu)
    stress = lame * np.trace(strain) * np.eye(3) + 2.0 * mu * strain
    names = ["sxx", "syy", "sxy", *(["szz"] if model != "plane_stress" else [])]
    exact = [stress["xyz".index(n[1]), "xyz".index(n[2])] for n in names]
    assert first(result, *names) == pytest.approx(exact, rel=1e-9, abs=1e-12)
    units = {n: result.history[f"tip.{n}"].attrs["units"] for n in ("ux", "vx", "sxx")}
    assert units == {"ux": "m", "vx": "m/s", "sxx": "Pa"}


@pytest.mark.parametrize("method", ["explicit", "massless"])
def test_a_place_of_a_flying_body_moves_with_it(method):
    case = solid("plane_strain", "disc", [0.7, 0.0], velocity=[0.3, 0.1], method=method,
                 duration=0.5, quantities=["displacement", "velocity"])  # fmt: skip
    result = impactfem.solve(case)
    time = result.history["time"].values
    assert result.history["tip.ux"].values == pytest.approx(0.3 * time, rel=1e-9, abs=1e-12)
    assert result.history["tip.vy"].values == pytest.approx(np.full(len(time), 0.1), rel=1e-9)
    assert "tip.sxx" not in result.history


def test_a_place_outside_a_solid_is_refused_by_its_plan():
    case = solid("plane_strain", "plane", [0.7, 0.53])
    words = r"probe\[0\].point = \[0.7, 0.53\] is outside .*nearest .*0\.5\], 0\.03\d* m away"
    with pytest.raises(SceneError, match=words):
        impactfem.plan(case)


@pytest.mark.parametrize("cells", ["simplex", "hexahedron"])
def test_the_corner_of_a_thin_strip_may_be_told_by_its_cells(cells):
    """A turned strip a hundred times as long as thick: four digits are a tenth of its thickness."""
    length, thick, turn = 0.1, 3e-4, 0.3
    shape = {"kind": "block", "size": [length, thick], "angle": turn}
    body = {"kind": "solid", "name": "strip", "model": "plane_strain", "mesh_size": 0.02,
            "shape": shape, "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3,
            "cells": cells, "degree": 1, "velocity": ["x", "y"]}  # fmt: skip
    c, s = np.cos(turn), np.sin(turn)
    arm = 0.5 * np.array([c * length - s * thick, s * length + c * thick])
    corner = np.array([0.5 * length, 0.5 * thick]) + arm

    def found(point):
        probe = {"name": "tip", "body": "strip", "point": list(point), "quantities": ["velocity"]}
        scene = {"title": "strip", "duration": 1e-3, "body": [body], "probe": [probe],
                 "solve": {"dt": 1e-3, "estimate": False}, "output": {"fields": []}}  # fmt: skip
        history = impactfem.solve(Scene.from_dict(scene)).history
        return [history[f"tip.{name}"].values[0] for name in ("vx", "vy")]

    assert np.abs(corner - corner.round(4)).max() > 0.05 * thick
    assert found(corner.round(4)) == pytest.approx(corner, abs=5e-5)
    with pytest.raises(SceneError, match=r"is outside .* 0\.00021\d m away"):
        found(corner + 0.5 * thick * np.array([1.0, 1.0]))


def test_bars_tell_their_waves_in_every_layer_whatever_is_kept():
    probes = [Probe(name="near", body="bar", point=[0.0], quantities=ALL),
              Probe(name="mid", body="bar", point=[0.33], quantities=["stress"])]  # fmt: skip
    scene = Scene.from_toml(shipped_scenes()["bar_impact"])
    tables = scene.to_dict() | {"probe": [vars(probe) for probe in probes]}
    thin = Scene.from_dict(tables).with_settings(["output.every=7"])
    result = impactfem.solve(thin)
    history = result.history
    assert len(result.fields.times) < len(history["time"]) // 6
    gap = history["gap"].values
    assert history["near.ux"].values == pytest.approx(gap - 0.5, abs=1e-12)
    force = history["contact_force"].values
    assert history["near.sxx"].values.min() == pytest.approx(-force.max(), rel=1e-9)
    assert history["mid.sxx"].values.min() == pytest.approx(-0.5, rel=1e-9)
    assert "mid.ux" not in history
    for name in ("gap", "contact_force", "total_energy"):
        plain = impactfem.solve(scene).history[name].values
        assert np.array_equal(history[name].values, plain)
    with pytest.raises(SceneError, match=r"nearest point that is known is \[1\]"):
        impactfem.solve(Scene.from_dict(tables | {"probe": [vars(probes[0]) | {"point": [1.5]}]}))


def test_the_middle_of_a_rod_moves_as_its_centre_and_an_end_as_its_gap():
    rod = impactfem.Rod(name="rod", mass=1.0, length=0.6, center=[0.0, 0.5], inclination=0.5,
                        velocity=[0.1, -1.0], angular_velocity=2.0)  # fmt: skip
    low = [-0.3 * np.cos(0.5), 0.5 - 0.3 * np.sin(0.5)]
    scene = Scene(
        title="rod", duration=0.4, bodies=[rod],
        obstacles=[impactfem.HalfSpace(name="floor", point=[0.0, 0.0], normal=[0.0, 1.0])],
        probes=[Probe(name="mid", body="rod", point=[0.0, 0.5]),
                Probe(name="low", body="rod", point=low)],
    )  # fmt: skip
    history = impactfem.solve(scene).history
    for axis in "xy":
        way = history[f"rod.{axis}"].values - history[f"rod.{axis}"].values[0]
        assert history[f"mid.u{axis}"].values == pytest.approx(way, abs=1e-12)
        speed = history[f"rod.v{axis}"].values
        assert history[f"mid.v{axis}"].values == pytest.approx(speed, abs=1e-12)
    arm = 0.3 * np.sin(history["rod.angle"].values)
    height = history["rod.y"].values - arm - low[1]
    assert history["low.uy"].values == pytest.approx(height, abs=1e-12)


POINT = {"kind": "point", "name": "ball", "mass": 1.0, "position": [0.0, 1.0], "radius": 0.1}
SCENE = {
    "title": "p", "duration": 0.1, "body": [POINT],
    "obstacle": [{"kind": "half_space", "name": "f", "point": [0.0, 0.0], "normal": [0.0, 1.0]}],
}  # fmt: skip


@pytest.mark.parametrize(
    ("probe", "key", "words"),
    [
        ({"name": "ball"}, "probe[0].name", "a body"),
        ({"name": "force"}, "probe[0].name", "a column"),
        ({"body": "bal"}, "probe[0].body", "did you mean"),
        ({"point": [0.0]}, "probe[0].point", "give 2"),
        ({"quantities": ["stress"]}, "probe[0].quantities", "remove"),
        ({"quantities": []}, "probe[0].quantities", "name one"),
    ],
)
def test_probes_without_sense_are_refused(probe, key, words):
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(
            SCENE | {"probe": [{"name": "tip", "body": "ball", "point": [0, 1]} | probe]}
        )
    assert key in str(caught.value)
    assert words in str(caught.value)


def test_a_point_is_probed_within_its_radius():
    probe = {"name": "tip", "body": "ball", "point": [0.05, 1.05]}
    history = impactfem.solve(Scene.from_dict(SCENE | {"probe": [probe]})).history
    assert np.array_equal(history["tip.vy"].values, history["ball.vy"].values)
    with pytest.raises(SceneError, match="outside"):
        impactfem.solve(Scene.from_dict(SCENE | {"probe": [probe | {"point": [0.0, 1.2]}]}))
