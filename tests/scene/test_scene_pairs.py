"""Laws of contact between solids: which bodies meet, and what is refused with its remedy."""

import copy
import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

import impactfem
from impactfem.errors import SceneError
from impactfem.scene import Contact, Scene
from impactfem.scene.laws import side_of
from impactfem.scene.pairing import body_pairs, friction_of, name_of, obstacles_of


def block(name, x):
    return {
        "name": name, "kind": "solid", "model": "plane_strain", "mesh_size": 0.1,
        "shape": {"kind": "block", "size": [1.0, 0.5], "corner": [x, 0.0]},
        "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.0,
    }  # fmt: skip


FLOOR = {"name": "floor", "kind": "half_space", "point": [0, -1], "normal": [0, 1]}
ROOF = {"name": "roof", "kind": "half_space", "point": [0, 3], "normal": [0, -1]}
GOOD = {
    "title": "blocks",
    "duration": 1.0,
    "body": [block("left", 0.0), block("middle", 1.1), block("right", 2.2)],
    "obstacle": [FLOOR, ROOF],
}


def scene(*contacts, **changes):
    data = copy.deepcopy(GOOD) | changes
    if contacts:
        data["contact"] = [{"between": list(names)} | rest for *names, rest in contacts]
    return Scene.from_dict(data)


def test_all_bodies_may_meet_all_others_and_all_obstacles():
    every = scene()
    named = [(one[0], two[0]) for one, two in body_pairs(every)]
    assert named == [("left", "middle"), ("left", "right"), ("middle", "right")]
    assert [o.name for o in obstacles_of(every, "middle")] == ["floor", "roof"]


def test_contact_laws_name_who_meets_whom():
    some = scene(
        ("left/right", "middle", {"friction_coefficient": 0.3}), ("floor", "right", {}),
    )  # fmt: skip
    assert body_pairs(some) == [(("left", ("right",)), ("middle", None))]
    assert [o.name for o in obstacles_of(some, "right")] == ["floor"]
    assert obstacles_of(some, "left") == ()
    assert friction_of(some, "middle", "left") == 0.3
    assert friction_of(some, "right", "floor") == 0.0
    assert side_of("ball/skin") == ("ball", ("skin",))


def test_one_body_may_meet_another_at_several_surfaces():
    two = scene(("left/right", "middle/left", {}), ("left/top", "middle/left", {}))
    assert len(body_pairs(two)) == 2


CONTACTS = {
    "an obstacle and itself": ([("floor", "floor", {})], ["floor cannot meet itself", "name two"]),
    "unknown body": ([("left", "rihgt", {})], ['no "rihgt"', 'did you mean "right"']),
    "unknown, far": ([("left", "xyz", {})], ['no "xyz"', "give one of left, middle, right, floor"]),
    "unknown surface": (
        [("left/botom", "right", {})],
        ["contact[0].between", '"left" has no surface "botom"', 'did you mean "bottom"'],
    ),
    "surface of an obstacle": ([("left", "floor/top", {})], ['"floor" has no surfaces', "leave"]),
    "two obstacles": ([("roof", "floor", {})], ["two obstacles", "name a body"]),
    "no surface": ([("left/", "right", {})], ['"left/"', "neither a name nor body/surface"]),
    "three": ([("left", "right", "middle", {})], ["has 3 names", "give two"]),
    "restitution": (
        [("left", "right", {"restitution": 0.5})],
        ["contact[0].restitution = 0.5", "own elasticity", "remove it"],
    ),
    "pulling friction": (
        [("left", "right", {"friction_coefficient": -0.1})],
        ["contact[0].friction_coefficient = -0.1", ">= 0"],
    ),
    "infinite friction": (
        [("left", "right", {"friction_coefficient": float("inf")})],
        ["contact[0].friction_coefficient = inf", "not a finite number"],
    ),
    "twice": (
        [("left", "right", {}), ("right", "left", {})],
        ['contact[1].between = ["right", "left"]', "contact[0]", "remove one"],
    ),
    "twice, once by surface": (
        [("left", "right", {}), ("right/left", "left", {})],
        ["contact[1].between", "same faces"],
    ),
    "two coefficients": (
        [("left/top", "right", {"friction_coefficient": 0.1}), ("left/right", "right", {})],
        ["contact[1].friction_coefficient = 0.0", "contact[0] has 0.1", "both the same"],
    ),
}


@pytest.mark.parametrize("name", CONTACTS)
def test_contact_without_sense_is_refused(name):
    contacts, parts = CONTACTS[name]
    with pytest.raises(SceneError) as error:
        scene(*contacts)
    for part in parts:
        assert part in str(error.value)


SETTINGS = {
    "models": (
        {"body": [block("left", 0.0), block("right", 2.0) | {"model": "plane_stress"}]},
        ['body[1].model = "plane_stress"', "body[0]", "same model"],
    ),
    "names": ({"body": [block("left", 0.0)] * 2}, ['body[1].name = "left"', "another name"]),
    "snes": (
        {
            "solve": {"active_set": "snes_vi"},
            "contact": [{"between": ["left", "right"], "friction_coefficient": 0.1}],
        },
        ['solve.active_set = "snes_vi"', "friction", "remove it"],
    ),
}


@pytest.mark.parametrize("name", SETTINGS)
def test_setting_that_several_solids_cannot_have_is_refused(name):
    changes, parts = SETTINGS[name]
    with pytest.raises(SceneError) as error:
        scene(**changes)
    for part in parts:
        assert part in str(error.value)


def test_pairs_are_named_by_their_sides_or_as_the_scene_says():
    plain = Contact(between=["ball/skin", "floor"])
    assert name_of(plain) == "ball_skin.floor"
    assert name_of(replace(plain, name="hit")) == "hit"


POINTS = {
    "title": "names", "duration": 1.0,
    "body": [{"kind": "point", "name": "a", "mass": 1.0, "position": [0.0, 1.0]}],
    "obstacle": [
        {"kind": "half_space", "name": n, "point": [0.0, 0.0], "normal": [0.0, 1.0]} for n in "fg"
    ],
}  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"contact": [{"between": ["a", "f"], "name": "hit"},
                      {"between": ["a", "g"], "name": "hit"}]}, "contact[1].name", "contact[0]"),
        ({"contact": [{"between": ["a", "f"], "name": "a b"}]}, "contact[0].name", "letters"),
        ({"body": [POINTS["body"][0] | {"name": "momentum"}]}, "body[0].name", "another name"),
    ],
)  # fmt: skip
def test_names_that_make_one_column_twice_are_refused(changes, key, words):
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(POINTS | changes)
    assert key in str(caught.value)
    assert words in str(caught.value)


def grains(*contacts, **more):
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    disc = {"kind": "rigid", "mass": 1.0}
    bodies = [
        disc | {"name": name, "shape": {"kind": "disc", "radius": 0.1, "center": [x, 0.2]}}
        for name, x in (("grain_1", 0.0), ("grain_2", 1.0), ("stone", 2.0))
    ]
    return Scene.from_dict(
        {"title": "grains", "duration": 0.1, "body": bodies, "obstacle": [floor],
         "contact": list(contacts)} | more
    )  # fmt: skip


def test_patterns_stand_for_pairs_that_no_other_law_names():
    scene = grains(
        {"between": ["grain_*", "*"], "friction_coefficient": 0.3},
        {"between": ["stone", "grain_2"], "friction_coefficient": 0.5},
        {"between": ["*", "floor"], "restitution": 0.2},
    )
    said = {tuple(law.between): law.friction_coefficient for law in scene.laws.each}
    assert said == {
        ("grain_1", "grain_2"): 0.3, ("grain_1", "stone"): 0.3, ("grain_1", "floor"): 0.3,
        ("grain_2", "floor"): 0.3, ("stone", "grain_2"): 0.5, ("stone", "floor"): 0.0,
    }  # fmt: skip
    assert scene.laws.origin == (0, 0, 0, 0, 1, 2)
    assert friction_of(scene, "grain_2", "stone") == 0.5
    assert len(scene.to_dict()["contact"]) == 3  # written as it was said
    schema = json.loads((Path(impactfem.__file__).parent / "scene/scene.schema.json").read_text())
    pattern = schema["definitions"]["Contact"]["properties"]["between"]["items"]["pattern"]
    for name, fits in (("grain_*", True), ("*", True), ("ball/skin", True), ("*/skin", False)):
        assert bool(re.search(pattern, name)) == fits
    joint = {"kind": "fixed", "name": "bond", "between": ["grain_1", "grain_2"],
             "point": [0.5, 0.2]}  # fmt: skip
    with pytest.raises(SceneError, match=r"contact\[0\].between .* matches no two that may meet"):
        grains({"between": ["pebble_*", "*"]})
    with pytest.raises(SceneError, match=r"matches no two"):  # a joint holds the only two
        grains({"between": ["grain_*", "grain_*"]}, joint=[joint])
    with pytest.raises(SceneError, match=r'name = "all" would be that of several pairs'):
        grains({"name": "all", "between": ["*", "*"]})
