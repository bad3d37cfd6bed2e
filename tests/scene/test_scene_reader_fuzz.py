"""Fuzzing of the reader: whatever comes, it gives a valid scene or a SceneError, nothing else."""

import copy
import tomllib
from datetime import UTC, date, datetime, time

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from impactfem.errors import SceneError
from impactfem.scene import (
    Bar,
    Output,
    PiecewiseConstant,
    Scene,
    Solve,
    Wall,
    describe,
    parse_assignment,
)

KEYS = sorted({row.key for table in describe() for row in table.keys})
WORDS = ["bar", "wall", "all", "free", "clamped", "galerkin", "exact", "pdas", "vtx", "vtkhdf"]
TEXTS = ["x", "-0.5", "0.1*sin(pi*x)", "1/x", "a.msh", "", "nan"]

numbers = st.integers() | st.floats() | st.sampled_from([0, 1, 2, 0.5, 40, 1e-300, 1e300, 10**400])
texts = st.text(max_size=20) | st.sampled_from(WORDS + TEXTS)
dates = st.sampled_from([date(2026, 1, 2), datetime(2026, 1, 2, tzinfo=UTC), time(1, 2)])
scalars = st.booleans() | numbers | texts | dates
keys = st.sampled_from(KEYS) | st.text(max_size=10)
values = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=5),
    max_leaves=12,
)
GOOD = {
    "title": "a bar",
    "duration": 5.0,
    "gravity": [[0.0, 1.0], [0.5, 0.0]],
    "body": [
        {
            "kind": "bar",
            "name": "bar",
            "length": 1.0,
            "density": 1.0,
            "youngs_modulus": 1.0,
            "area": 1.0,
            "far_end": "free",
            "gap": 0.5,
            "velocity": -0.5,
            "displacement": "0.1*x",
        }
    ],
    "obstacle": [{"kind": "wall", "name": "wall"}],
    "solve": {"method": "galerkin", "elements": 40, "courant": 1.0, "gamma": 2.0},
    "output": {"fields": ["vtkhdf"], "every": 1},
}


def check(read):
    """Run a reader; a scene that comes out must survive writing and reading."""
    try:
        scene = read()
    except SceneError as error:
        scene, message = None, str(error)
    if scene is None:
        assert 0 < len(message) < 2000
        assert message.encode()  # can be printed
        return
    assert isinstance(scene, Scene)
    assert Scene.from_dict(tomllib.loads(scene.to_toml()), base=scene.folder) == scene


@settings(deadline=None)
@given(st.dictionaries(keys, values, max_size=8) | values)
def test_random_tables(data):
    check(lambda: Scene.from_dict(data))


@st.composite
def mutated(draw):
    """Return the good scene with one to three places changed, removed, renamed or added."""
    data = copy.deepcopy(GOOD)
    for _ in range(draw(st.integers(1, 3))):
        places = [data, *data.get("body", []), *data.get("obstacle", [])]
        places += [data.get("solve"), data.get("output")]
        place = draw(st.sampled_from([p for p in places if isinstance(p, dict) and p]))
        name = draw(st.sampled_from(sorted(place)))
        change = draw(st.sampled_from(["value", "scalar", "remove", "rename", "add"]))
        if change == "add":
            place[draw(keys)] = draw(values)
        elif change == "rename":
            place[draw(keys)] = place.pop(name)
        elif change == "remove":
            del place[name]
        else:
            place[name] = draw(values if change == "value" else scalars)
        for key in ("body", "obstacle"):
            if not isinstance(data.get(key), list):
                return data
    return data


@settings(deadline=None, max_examples=300)
@given(mutated())
def test_mutated_scenes(data):
    check(lambda: Scene.from_dict(data))


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz") / "scene.toml"


TEXT = Scene.from_dict(GOOD).to_toml()
LINES = TEXT.splitlines()


@settings(deadline=None, max_examples=200)
@given(
    st.one_of(
        st.binary(max_size=200),
        st.text(max_size=200).map(lambda text: text.encode("utf-8", "surrogatepass")),
        st.lists(st.sampled_from([*LINES, "[", "]]", "=", '"', "a.b = 1"]), max_size=30).map(
            lambda lines: "\n".join(lines).encode()
        ),
        st.permutations(LINES).map(lambda lines: "\n".join(lines).encode()),
        st.tuples(st.integers(0, len(TEXT)), st.integers(0, 9), st.binary(max_size=5)).map(
            lambda cut: TEXT.encode()[: cut[0]] + cut[2] + TEXT.encode()[cut[0] + cut[1] :]
        ),
    )
)
def test_random_files(file, content):
    file.write_bytes(content)
    check(lambda: Scene.from_toml(file))


PATHS = ["solve.elements", "solve.dt", "body.0.gap", "body.bar.velocity", "gravity", "body", "x.y"]


@settings(deadline=None)
@given(
    st.dictionaries(st.sampled_from(PATHS) | st.text(max_size=12), values | st.none(), max_size=3)
)
def test_random_settings(changes):
    scene = Scene.from_dict(GOOD)
    check(lambda: scene.with_settings(changes))


@settings(deadline=None)
@given(st.builds("{}={}".format, st.sampled_from(PATHS), st.text(max_size=20)) | st.text())
def test_random_assignments(text):
    scene = Scene.from_dict(GOOD)
    check(lambda: scene.with_settings([text]))
    try:
        path, _ = parse_assignment(text)
    except SceneError:
        return
    assert path


def optional(strategy):
    return st.none() | strategy


positive = st.floats(1e-12, 1e12)
names = st.from_regex(r"[A-Za-z][A-Za-z0-9_-]{0,39}", fullmatch=True)
titles = st.text(
    st.characters(exclude_categories=["Cc", "Cs", "Zl", "Zp"]), min_size=1, max_size=200
).filter(str.strip)
formulas = st.floats(-1, 1) | st.sampled_from(
    ["x", "0.1*sin(pi*x)", "(\n1+\tx)", "0", "1e-3", "2*pi"]
)


@st.composite
def gravities(draw):
    times = [0.0, *sorted(draw(st.sets(st.floats(1e-9, 1e9), max_size=4)))]
    size = len(times)
    entries = st.lists(st.floats(-1e9, 1e9), min_size=size, max_size=size)
    return PiecewiseConstant(tuple(times), tuple(draw(entries)))


@st.composite
def scenes(draw):
    bar = Bar(
        name=draw(names),
        length=draw(st.floats(1e-3, 1e3)),
        density=draw(positive),
        youngs_modulus=draw(positive),
        area=draw(positive),
        far_end=draw(st.sampled_from(["free", "clamped"])),
        gap=draw(st.floats(1, 1e6)),
        velocity=draw(formulas),
        displacement=draw(formulas),
    )
    wall = Wall(name=draw(names))
    assume(wall.name != bar.name)
    grid = draw(st.sampled_from(["courant", "dt", "mesh"]))
    duration = draw(positive)
    solve = Solve(
        method=draw(optional(st.just("monolithic"))),
        elements=None if grid == "mesh" else draw(optional(st.integers(2, 10**6))),
        courant=draw(optional(positive)) if grid == "courant" else None,
        dt=draw(optional(st.floats(duration / 1e6, duration))) if grid == "dt" else None,
        mesh=draw(titles)[:180] + ".msh" if grid == "mesh" else None,
        window=draw(optional(st.just("all"))),
        active_set=draw(optional(st.sampled_from(["pdas", "snes_vi"]))),
        gamma=draw(optional(positive)),
        tolerance=draw(optional(st.floats(1e-16, 0.5))),
        max_iterations=draw(optional(st.integers(1, 10**6))),
    )
    fields = draw(st.lists(st.sampled_from(["vtkhdf", "vtx", "pvd"]), unique=True))
    output = Output(fields=fields, every=draw(st.integers(1, 10**9)))
    return Scene(
        title=draw(titles),
        duration=duration,
        gravity=draw(gravities() | st.floats(-1e3, 1e3)),
        bodies=[bar],
        obstacles=[wall],
        solve=solve,
        output=output,
    )


@settings(deadline=None)
@given(scenes())
def test_written_scene_reads_back_equal(scene):
    assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene
    assert Scene.from_dict(scene.to_dict()) == scene
    assert scene.with_settings({}) == scene


@settings(deadline=None, max_examples=30)
@given(scenes())
def test_written_file_reads_back_equal(file, scene):
    file.write_text(scene.to_toml(), encoding="utf-8", newline="")
    assert Scene.from_toml(file) == scene


def test_numbers_are_written_as_numbers_and_formulas_as_texts():
    text = Scene.from_dict(GOOD).to_toml()
    assert "velocity = -0.5  # [m/s]\n" in text
    assert 'displacement = "0.1*x"  # [m]\n' in text
    assert "gravity = [[0.0, 1.0], [0.5, 0.0]]  # [m/s^2]\n" in text
    assert "area = 1.0" in text
    assert "dt" not in text.split("[solve]")[1]


def test_titles_are_escaped():
    title = '"quoted" \\ back = 1 # [x] \u00e9\U0001f600'
    data = GOOD | {"title": title}
    assert tomllib.loads(Scene.from_dict(data).to_toml())["title"] == title
