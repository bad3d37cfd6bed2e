"""Scenes in words hold the numbers of the scene, for every kind of body and obstacle."""

import pytest

from impactfem import Scene
from impactfem.report.page.numbers import percent, quantity, span
from impactfem.report.page.words import in_words
from impactfem.shipped import shipped_scenes


def told(scene):
    return " ".join(f"{subject}: {text}" for subject, text in in_words(scene))


def shipped(name, **settings):
    return Scene.from_toml(shipped_scenes()[name]).with_settings(settings)


@pytest.mark.parametrize("name", shipped_scenes())
def test_every_shipped_scene_is_told_with_its_names_and_duration(name):
    scene = shipped(name)
    text = told(scene)
    for entry in (*scene.bodies, *scene.obstacles):
        assert entry.name in text
    assert quantity(scene.duration, "s") in text
    for rubbish in ("None", "[]", "()", "Formula", "  "):
        assert rubbish not in text


def test_a_bar_flies_towards_its_wall():
    text = told(shipped("bar_impact"))
    assert "A bar of length 1 m flies at 0.5 m/s towards a rigid wall 0.5 m away." in text
    away = shipped("bar_impact", **{"body.bar.velocity": 2.0, "body.bar.gap": 0.0})
    assert "flies at 2 m/s away from a rigid wall it touches" in told(away)
    waving = shipped("bar_impact", **{"body.bar.velocity": "-0.5*cos(x)"})
    assert "starts with the velocity -0.5*cos(x) m/s" in told(waving)
    # The near end starts where gap and displacement put it.
    shifted = shipped("bar_impact", **{"body.bar.displacement": "0.25 + 0.1*x"})
    assert "a rigid wall 0.75 m away" in told(shifted)


def test_what_a_law_of_contact_says_is_told():
    assert "with the coefficient of restitution 0.8" in told(shipped("bouncing_ball"))
    assert "Coulomb friction of coefficient 0.3" in told(shipped("sliding_block"))
    assert "Every body may meet every other body, unilaterally" in told(shipped("colliding_discs"))


def test_gravity_is_told_in_its_pieces():
    text = told(shipped("step_load"))
    assert "0.1 m/s² from 0 s on; 0 m/s² from 0.91608 s on" in text
    assert "There is none." in told(shipped("bar_impact"))


OBSTACLES = [
    ({"kind": "sphere", "center": [0, -2], "radius": 1.5}, "circle of radius 1.5 m around (0, -2)"),
    ({"kind": "sphere", "center": [0, 0], "radius": 9, "side": "inside"}, "bodies stay inside it"),
    ({"kind": "cylinder", "point": [0, -2], "radius": 1}, "circle of radius 1 m around (0, -2) m"),
    ({"kind": "box", "center": [0, -2], "size": [4, 1], "angle": 0.1},
     "rectangle of 4 × 1 m around (0, -2) m, turned by 0.1 rad"),
    ({"kind": "polyline", "points": [[5, -2], [-5, -2]]}, "(5, -2), (-5, -2) [m]"),
    ({"kind": "half_space", "point": [0, -1], "normal": [0, 2], "motion": [0, "0.1*sin(t)"]},
     "moves by (0, 0.1*sin(t)) m"),
]  # fmt: skip


@pytest.mark.parametrize(("obstacle", "words"), OBSTACLES, ids=[o["kind"] for o, _ in OBSTACLES])
def test_obstacles_are_told(obstacle, words):
    disc = {
        "kind": "solid", "model": "plane_stress", "shape": {"kind": "disc", "radius": 0.5},
        "mesh_size": 0.1, "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3,
        "thickness": 0.25, "angular_velocity": 3.0,
        "pressures": [{"surface": "rim", "value": "2*t"}],
    }  # fmt: skip
    data = {"title": "x", "duration": 1.0, "body": [disc], "obstacle": [obstacle]}
    text = told(Scene.from_dict(data))
    assert words in text
    assert "in plane stress, 0.25 m thick" in text
    assert "turning at 3 rad/s" in text
    assert "A pressure 2*t Pa pushes on rim." in text


def test_many_bodies_are_counted_not_listed():
    points = [{"kind": "point", "name": f"p{k}", "mass": 1.0, "position": [k]} for k in range(40)]
    wall = {"kind": "half_space", "point": [-1.0], "normal": [1.0]}
    text = told(Scene.from_dict({"title": "x", "duration": 1, "body": points, "obstacle": [wall]}))
    assert "28 more, see scene.toml" in text
    assert len(text) < 3000


def test_springs_rods_and_forces_are_told():
    floor = {"kind": "half_space", "point": [0, 0], "normal": [0, 1]}
    point = {
        "kind": "point", "mass": 2.0, "position": [1.0, 2.0], "velocity": [0.5, 0.0],
        "force": ["0", "-y"],
        "springs": [{"anchor": [0, 0], "stiffness": 7.0, "rest_length": 0.5, "damping": 0.25}],
    }  # fmt: skip
    data = {"title": "x", "duration": 1.0, "body": [point], "obstacle": [floor]}
    text = told(Scene.from_dict(data))
    assert (
        "A spring of 7 N/m of free length 0.5 m with damping 0.25 N s/m ties it to (0, 0)" in text
    )
    assert "The force (0, -y) N acts on it." in text
    rod = {
        "kind": "rod",
        "mass": 1,
        "length": 2,
        "center": [0, 2],
        "inclination": 0.5235987755982988,
    }
    data = {"title": "x", "duration": 1.0, "body": [rod], "obstacle": [floor]}
    assert "inclined by 0.523599 rad (30°), at rest" in told(Scene.from_dict(data))


def test_shares_and_times_have_handy_units():
    assert [percent(v) for v in (0.5, 0.0123, 3e-9, 0.0, None, 9.3, -1e4)] == [
        "50 %", "1.2 %", "3e-09", "0 %", "not finite", "930 %", "-1e+04-fold",
    ]  # fmt: skip
    assert [span(v) for v in (2e-9, 3.5e-5, 0.25, 12.0, 4000.0)] == [
        "2 ns", "35 µs", "0.25 s", "12 s", "4000 s",
    ]  # fmt: skip
