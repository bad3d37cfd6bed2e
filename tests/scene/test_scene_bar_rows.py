"""Rows of bars: what a scene may hold, and what mistakes are told."""

import pytest

from impactfem.errors import SceneError
from impactfem.planning import plan
from impactfem.scene import Scene

BAR = {"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0}


def data(**changes):
    first = {**BAR, "name": "first", "velocity": 1.0}
    return {
        "title": "row", "duration": 4.0,
        "body": [first, {**BAR, "name": "second", "gap": 1.25}], **changes,
    }  # fmt: skip


def second(**changes):
    return {"body": [data()["body"][0], {**BAR, "name": "second", "gap": 1.25, **changes}]}


def first(**changes):
    return {"body": [{**data()["body"][0], **changes}, data()["body"][1]]}


CASES = {
    "overlap": (
        second(gap=0.9),
        ["body[1].gap = 0.9", '"second"', "overlap by 0.1 m", "at least 1"],
    ),
    "overlap by displacement": (
        second(gap=1.0, displacement=-0.05),
        ["body[1].gap", "overlap by 0.05 m"],
    ),
    "overlap by stretch": (first(displacement="0.3*x"), ["body[1].gap", "overlap by 0.05 m"]),
    "order": (first(gap=3.0), ["body[1].gap", "in the order of the axis"]),
    "clamped in the middle": (
        first(far_end="clamped"),
        ['body[0].far_end = "clamped"', "only the last", "remove it"],
    ),
    "gravity vector": ({"gravity": [0.0, -9.81]}, ["gravity = ", "have 1 coordinates"]),
    "method under gravity": (
        {"gravity": 9.81, "solve": {"method": "exact"}},
        ['solve.method = "exact"', "gravity of bars", 'give "conserving"'],
    ),
    "contact": (
        {"contact": [{"between": ["first", "second"], "restitution": 0.5}]},
        ["contact[0]", "their own elasticity", "remove"],
    ),
    "obstacle": (
        {"obstacle": [{"kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}]},
        ['obstacle[0].kind = "half_space"', 'kind = "wall"'],
    ),
    "two walls": (
        {"obstacle": [{"kind": "wall", "name": "a"}, {"kind": "wall", "name": "b"}]},
        ["obstacle = [", "there are 2", "give one or none"],
    ),
    "same names": (second(name="first"), ["body[1].name", "another name"]),
    "two kinds": (
        {"body": [data()["body"][0], {"kind": "point", "name": "ball", "mass": 1.0,
         "position": [0.0, 1.0]}]},
        ["body[1]: ball has 2 coordinates", "by point and axis"],
    ),
    "method": (
        {"solve": {"method": "dg"}},
        ['solve.method = "dg"', "row of 2 bars", '"galerkin", "conserving" or "exact"'],
    ),
    "window": ({"solve": {"window": 5}}, ["solve.window = 5", "single bar", "remove it"]),
    "accuracy": ({"solve": {"accuracy": 0.1}}, ["solve.accuracy = 0.1", "remove it"]),
    "checkpoint": ({"output": {"checkpoint": 5}}, ["output.checkpoint = 5", "remove it"]),
    "elements that cannot match": (
        second(length=0.5) | {"solve": {"elements": 33}},
        ["solve.elements = 33", "same h / c", "give 32 or 34", 'method = "exact"'],
    ),
    "courant": ({"solve": {"courant": 1.5}}, ["solve.courant = 1.5", "stability limit"]),
    "step": ({"solve": {"dt": 0.5, "elements": 10}}, ["solve.dt = 0.5", "h / c = 0.1 s"]),
    "endless": ({"duration": 1e9}, ["duration = 1e+09", "transits", "shorter duration"]),
}  # fmt: skip


@pytest.mark.parametrize(("changes", "parts"), CASES.values(), ids=CASES)
def test_mistake_is_explained(changes, parts):
    with pytest.raises(SceneError) as caught:
        plan(Scene.from_dict(data(**changes)))
    message = str(caught.value)
    for part in parts:
        assert part in message


def test_a_wall_is_optional():
    scene = Scene.from_dict(data())
    assert scene.solver == "bar_row"
    assert [bar.name for bar in scene.bars] == ["first", "second"]
    alone = Scene.from_dict(data(body=data()["body"][:1]))
    assert alone.solver == "bar_row"
    assert plan(alone).model == "an elastic bar, without a wall, far end free"


@pytest.mark.parametrize(
    ("changes", "key", "value"),
    [({"body": {name: "1+x"}}, f"body[0].{name}", "1+x") for name in ("area", "density")]
    + [({"body": {name: "t"}}, f"body[0].{name}", "t") for name in ("load", "far_end_force")],
)
def test_what_only_a_bar_before_a_wall_knows(changes, key, value):
    """It was dropped without a word where a row of one took it."""
    lone = {**data()["body"][0], **changes.get("body", {})}
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(data(**{**changes, "body": [lone]}))
    for part in (key, value, "here is none", "out of"):
        assert part in str(caught.value)


def test_neighbours_may_touch_and_files_keep_the_row():
    scene = Scene.from_dict(data(**second(gap=1.0), obstacle=[{"kind": "wall"}]))
    assert Scene.from_dict(scene.to_dict()) == scene
    assert "[[body]]" in scene.to_toml()


def test_a_row_is_no_single_bar():
    with pytest.raises(SceneError, match="the scene has first, second"):
        _ = Scene.from_dict(data()).bar
