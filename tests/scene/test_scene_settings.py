"""Changing single keys of a scene, from Python and as texts of a command line."""

import pytest

from impactfem.errors import SceneError
from impactfem.scene import Bar, Scene, Solve, Wall, parse_assignment


@pytest.fixture
def scene(tmp_path):
    bar = Bar(name="rod", length=1, density=1, youngs_modulus=1, gap=0.5, velocity=-0.5)
    return Scene(
        title="t",
        duration=5,
        bodies=[bar],
        obstacles=[Wall(name="stop")],
        solve=Solve(elements=10, courant=0.5),
        folder=tmp_path,
    )


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        ("solve.elements=80", "solve.elements", 80),
        (" solve.dt = 1e-3 ", "solve.dt", 1e-3),
        ("solve.method=galerkin", "solve.method", "galerkin"),
        ('solve.method="galerkin"', "solve.method", "galerkin"),
        ("body.0.velocity=-0.5*x", "body.0.velocity", "-0.5*x"),
        ("body.0.velocity=where(x <= 0.5, 1, 2)", "body.0.velocity", "where(x <= 0.5, 1, 2)"),
        ("gravity=[[0, 1], [1, 0]]", "gravity", [[0, 1], [1, 0]]),
        ("output.fields=[]", "output.fields", []),
        ("title=true", "title", True),
        ("title=2026-01-02", "title", "2026-01-02"),
        ("title=1\nduration=2", "title", "1\nduration=2"),
        ("title=" + "[" * 5000, "title", "[" * 5000),
        ("title=" + "9" * 5000, "title", "9" * 5000),
        ("solve.courant=", "solve.courant", None),
    ],
)
def test_assignments(text, path, value):
    assert parse_assignment(text) == (path, value)


@pytest.mark.parametrize("text", ["", "=", "=3", "solve.elements", " = 3"])
def test_assignments_need_key_and_equals(text):
    with pytest.raises(SceneError, match="write it as key=value"):
        parse_assignment(text)


@pytest.mark.parametrize("path", ["body.0.gap", "body[0].gap", "body.rod.gap", " body . 0 . gap "])
def test_bodies_by_index_or_name(scene, path):
    assert scene.with_settings({path: 0.25}).bodies[0].gap == 0.25
    assert scene.bodies[0].gap == 0.5


def test_several_settings(scene):
    new = scene.with_settings(
        {"duration": 3.0, "solve.elements": 80, "solve.courant": None, "solve.dt": 0.1}
    )
    assert new.duration == 3.0
    assert new.solve == Solve(elements=80, dt=0.1)
    assert new.folder == scene.folder
    assert new.with_settings({}) == new


def test_texts(scene):
    new = scene.with_settings(["solve.elements=80", "obstacle.stop.name=w", "solve.elements=90"])
    assert new.solve.elements == 90
    assert new.obstacles[0].name == "w"
    assert scene.with_settings("duration=2").duration == 2.0


def test_none_restores_the_default(scene):
    new = scene.with_settings({"body.rod.gap": None, "output.every": None, "gravity": None})
    assert new.bodies[0].gap == 0.0
    assert new.output.every is None


def test_whole_tables(scene):
    table = {"dt": 0.1}
    new = scene.with_settings({"solve": table, "solve.elements": 5})
    assert new.solve == Solve(elements=5, dt=0.1)
    assert table == {"dt": 0.1}
    bodies = scene.to_dict()["body"]
    assert scene.with_settings({"body": bodies, "body.0.gap": 2}).bodies[0].gap == 2.0
    assert bodies == scene.to_dict()["body"]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("solve.elments=80", ["setting solve.elments = 80", 'did you mean "elements"?']),
        ("solve.elements=many", ['solve.elements = "many"', "without quotes", "an integer"]),
        ("solve.dt=0.1", ["setting solve.dt = 0.1", "contradicts courant = 0.5", "remove one"]),
        ("slove.dt=0.1", ["setting slove.dt = 0.1", 'no table "slove"', "solve, output"]),
        ("gravity.x=1", ["setting gravity.x = 1", 'no table "gravity"', "the tables are"]),
        ("body.gap=1", ["setting body.gap = 1", "which one is meant, such as body.rod.gap"]),
        ("body.1.gap=1", ["setting body.1.gap = 1", 'there is no "1"; write 0 or rod']),
        ("body.bar.gap=1", ['there is no "bar"; write 0 or rod']),
        ("body.rod.gap.x=1", ['there is no table "gap"', "the tables are"]),
        ("solve.=1", ['solve."" = 1', "remove it"]),
        ("solve=1", ["solve = 1 is not a table"]),
        ("body=1", ["body = 1 is not a list", "two brackets"]),
        ("body.rod.kind=", ["body[0].kind is missing", 'add kind = "bar"']),
        ("duration=", ["duration is missing", "a number > 0"]),
        ("unknown=", ["unknown = None is not a known key"]),
        ("body.0.gap=nan", ["body[0].gap = nan", "a number >= 0"]),
    ],
)
def test_errors_name_the_assignment(scene, text, parts):
    with pytest.raises(SceneError) as caught:
        scene.with_settings([text])
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    "settings",
    [
        {"body": [], "body.0.gap": 1},
        {"body": [3], "body.0.gap": 1},
        {"body": [{"kind": "bar"}], "body.gap": 1},
        {"body": [{"name": {}}], "body.0.gap": 1},
        {"body": [{"name": 3}], "body.x.gap": 1},
        {"solve": None, "solve.dt": 1, 3: 4},
        {"": 3},
    ],
)
def test_strange_settings_are_scene_errors(scene, settings):
    with pytest.raises(SceneError):
        scene.with_settings(settings)
