"""The JSON schema of scenes: it takes what the reader takes, and is the one that is shipped."""

import copy
import json
import tomllib

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactfem.errors import SceneError
from impactfem.scene import Scene
from impactfem.scene.json_schema import _schema, json_schema, json_schema_text
from impactfem.scene.kinds import Kind
from impactfem.scene.schema import describe
from impactfem.shipped import shipped_scenes
from impactfem.starting import schema_text, starters

SCHEMA = json_schema()
VALIDATOR = jsonschema.Draft7Validator(SCHEMA)
FILES = shipped_scenes() | {f"starter {name}": path for name, path in starters().items()}
TABLES = {name: tomllib.loads(path.read_text(encoding="utf-8")) for name, path in FILES.items()}


def test_it_is_a_schema():
    jsonschema.Draft7Validator.check_schema(SCHEMA)


def test_the_shipped_file_is_up_to_date():
    assert schema_text() == json_schema_text(), (
        "run: impactfem schema --out impactfem/scene/scene.schema.json"
    )
    assert json.loads(schema_text()) == SCHEMA


@pytest.mark.parametrize("name", FILES)
def test_every_shipped_scene_is_valid_as_it_is_and_with_all_defaults(name):
    VALIDATOR.validate(TABLES[name])
    VALIDATOR.validate(Scene.from_toml(FILES[name]).to_dict())


def properties(schema):
    """Every description of a key in the schema, by its name."""
    tables = [schema, *schema["definitions"].values()]
    return [(name, entry) for table in tables for name, entry in table["properties"].items()]


def test_every_key_is_described_with_its_unit():
    found = properties(SCHEMA)
    for table in describe():
        for row in table.keys:
            texts = [entry["description"] for name, entry in found if name == row.key]
            assert any(row.doc.lower() in text.lower() for text in texts), (table.name, row.key)
            assert any(f"[{row.unit}]" in text for text in texts) or not row.unit


def test_every_default_is_valid():
    for _, entry in properties(SCHEMA):
        if "default" in entry:
            whole = entry | {"definitions": SCHEMA["definitions"]}
            jsonschema.Draft7Validator(whole).validate(entry["default"])


def test_a_kind_of_value_without_schema_is_noticed():
    class Other(Kind):
        type_name = "other"
        allowed = "anything"

        def read(self, value):
            return value

    with pytest.raises(TypeError, match="Other has no JSON schema"):
        _schema(Other(), {})


def places(data, path=()):
    """Paths of all values in tables and lists."""
    yield path
    if isinstance(data, dict):
        for name, value in data.items():
            yield from places(value, (*path, name))
    elif isinstance(data, list):
        for index, value in enumerate(data):
            yield from places(value, (*path, index))


def put(data, path, value):
    """A copy with a value replaced."""
    data = copy.deepcopy(data)
    if not path:
        return value
    inner = data
    for part in path[:-1]:
        inner = inner[part]
    inner[path[-1]] = value
    return data


TEXTS = ["", "x", "bar", "rim", "all", "2*x", "sin(t)", "a b", "\n", "dg", "mesh.msh", "vtx", "é"]
NUMBERS = [-1, 0, 1, 2, 7, 0.0, 0.4, 0.5, -0.5, 1e-3, 1e12]
SIMPLE = [*TEXTS, *NUMBERS, True, False]
LISTS = [[], [0.0], [0.0, 1.0], [1.0, 0.0, 0.0], [0.0, [1.0, 2.0]], [[0.0, 1.0], [1.0, 2.0]]]
VALUES = [*SIMPLE, *LISTS, ["", "t"], ["x", 1], {}, {"kind": "disc", "radius": 1.0}]


@settings(max_examples=400, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_what_the_reader_takes_is_valid(data):
    scene = TABLES[data.draw(st.sampled_from(sorted(TABLES)))]
    path = data.draw(st.sampled_from(list(places(scene))))
    changed = put(scene, path, data.draw(st.sampled_from(VALUES)))
    try:
        Scene.from_dict(changed)
    except SceneError:
        return
    VALIDATOR.validate(changed)


# Mistakes in one value, one each of the kinds of values: the reader and the schema refuse them.
GOOD = TABLES["starter solid"]
WRONG = {
    "unknown key": put(GOOD, ("colour",), "red"),
    "unknown key of a body": put(GOOD, ("body", 0, "lenght"), 1.0),
    "key of another body": put(GOOD, ("body", 0, "far_end"), "free"),
    "missing title": {k: v for k, v in GOOD.items() if k != "title"},
    "missing model": put(
        GOOD, ("body", 0), {k: v for k, v in GOOD["body"][0].items() if k != "model"}
    ),
    "no body": put(GOOD, ("body",), []),
    "one bracket": put(GOOD, ("body",), GOOD["body"][0]),
    "text for number": put(GOOD, ("duration",), "5 s"),
    "true for number": put(GOOD, ("duration",), True),
    "negative": put(GOOD, ("duration",), -1.0),
    "half incompressible": put(GOOD, ("body", 0, "poisson_ratio"), 0.5),
    "unknown kind": put(GOOD, ("body", 0, "kind"), "sold"),
    "unknown shape": put(GOOD, ("body", 0, "shape", "kind"), "disk"),
    "unknown word": put(GOOD, ("body", 0, "model"), "plane"),
    "too long a vector": put(GOOD, ("obstacle", 0, "point"), [0.0] * 4),
    "no direction": put(GOOD, ("obstacle", 0, "normal"), [0.0, 0.0]),
    "text in vector": put(GOOD, ("obstacle", 0, "point"), ["0", "0"]),
    "not a formula": put(GOOD, ("body", 0, "velocity"), ["2^x", 0.0]),
    "name with blank": put(GOOD, ("body", 0, "name"), "my disc"),
    "empty title": put(GOOD, ("title",), " "),
    "half a degree": put(GOOD, ("body", 0, "degree"), 1.5),
    "degree 3": put(GOOD, ("body", 0, "degree"), 3),
    "another file": put(GOOD, ("body", 0, "mesh"), "mesh.pdf"),
    "unknown format": put(GOOD, ("output", "fields"), ["vtk"]),
    "format twice": put(GOOD, ("output", "fields"), ["vtx", "vtx"]),
    "switch": put(GOOD, ("solve", "estimate"), "yes"),
    "one name": put(GOOD, ("contact",), [{"between": ["disc"]}]),
    "table of gravity": put(GOOD, ("gravity",), [[0.0]]),
}


@pytest.mark.parametrize("name", WRONG)
def test_mistakes_in_one_value_are_refused_by_both(name):
    with pytest.raises(SceneError):
        Scene.from_dict(WRONG[name])
    assert not VALIDATOR.is_valid(WRONG[name])
