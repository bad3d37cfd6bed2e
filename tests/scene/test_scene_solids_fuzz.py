"""Random solids survive writing and reading; mutated ones give a scene or a SceneError."""

import copy
import tomllib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from impactfem.errors import SceneError
from impactfem.scene import (
    Block,
    Cylinder,
    Disc,
    HalfSpace,
    Output,
    PiecewiseVector,
    Pressure,
    Refinement,
    RigidBox,
    RigidCylinder,
    RigidPolyline,
    RigidSphere,
    Ring,
    Scene,
    Solid,
    Solve,
    Sphere,
    Support,
    Traction,
    describe,
)

lengths = st.floats(1e-3, 1e3)
places = st.floats(-1e3, 1e3).map(lambda x: x if abs(x) > 1e-50 else 0.0)  # less is refused
angles = st.floats(-6.28, 6.28)
texts = st.sampled_from(["0", "x", "0.1*sin(pi*x)", "where(y < 0.5, 1, -1)", "2*pi"])
in_time = st.floats(-1, 1) | st.sampled_from(["t", "0.1*sin(5*t)", "min(t, 1)"])
formulas = st.floats(-1, 1) | texts
of_loads = formulas | in_time
from_zero = st.sampled_from(["t", "0.1*sin(5*t)", "0.0"])
models = st.sampled_from(["plane_strain", "plane_stress", "axisymmetric", "3d"])


def vectors(dim, entries=places):
    return st.lists(entries, min_size=dim, max_size=dim)


def optional(strategy):
    return st.none() | strategy


@st.composite
def shapes(draw, model):
    """A shape that fits the model; axisymmetric ones centred on the axis or beside it."""
    if model == "3d":
        cut = draw(st.lists(st.sampled_from(["x", "y", "z"]), unique=True))
        common = {"symmetry": cut, "angle": 0.0 if cut else draw(angles)}
        center = draw(vectors(3))
        block = Block(size=draw(vectors(3, lengths)), corner=center, **common)
        cylinder = Cylinder(radius=draw(lengths), height=draw(lengths), center=center, **common)
        ball = Sphere(radius=draw(lengths), center=center, **common)
        return draw(st.sampled_from([block, cylinder, ball]))
    radius = draw(lengths)
    share = draw(st.floats(0.1, 0.9))
    if model == "axisymmetric":
        common = {"symmetry": draw(st.sampled_from([[], ["y"]]))}
        center = [draw(st.sampled_from([0.0, 2.5 * radius])), draw(places)]
        corner = [draw(st.just(0.0) | lengths), draw(places)]
        middle = [0.0, center[1]]
        more = [
            Cylinder(radius=radius, height=draw(lengths), center=middle, **common),
            Sphere(radius=radius, center=middle, **common),
        ]
    else:
        cut = draw(st.lists(st.sampled_from(["x", "y"]), unique=True))
        common = {"symmetry": cut, "angle": 0.0 if cut else draw(angles)}
        corner, center, more = draw(vectors(2)), draw(vectors(2)), []
    block = Block(size=draw(vectors(2, lengths)), corner=corner, **common)
    disc = Disc(radius=radius, center=center, **common)
    ring = Ring(inner_radius=share * radius, radius=radius, center=center, **common)
    return draw(st.sampled_from([block, disc, ring, *more]))


@st.composite
def solids(draw):
    model = draw(models)
    dim = 3 if model == "3d" else 2
    drawn = draw(st.booleans())
    shape = draw(shapes(model)) if drawn else None
    # Gmsh's own names may hold anything that fits in a line.
    names = ["part 1", 'a "b"', "top"]
    if shape is not None:
        names = list(shape.surface_names(axisymmetric=model == "axisymmetric"))
    by_model = ("symmetry", "axis")
    free = [name for name in names if not name.startswith(by_model)]
    held = draw(st.lists(st.sampled_from(free), unique=True, max_size=2))
    supports = [
        draw(
            st.builds(Support, surface=st.just(name), kind=st.sampled_from(["fixed", "symmetry"]))
            | st.builds(
                Support,
                surface=st.just(name),
                kind=st.just("motion"),
                value=vectors(dim - 1, from_zero | st.just("")).map(lambda v: ["0", *v]),
            )
        )
        for name in held
    ]
    named = st.sampled_from(names)
    size = None
    if shape is not None:
        lower, upper = shape.bounds(axisymmetric=model == "axisymmetric")
        size = max(b - a for a, b in zip(lower, upper, strict=True)) * draw(st.floats(1e-3, 0.9))
    ball = st.builds(
        Refinement, point=vectors(dim), radius=lengths, size=st.just((size or 1.0) / 2)
    )
    still = shape is None or bool(shape.symmetry) or model == "axisymmetric"
    return Solid(
        name=draw(st.sampled_from(["body", "disc-1", "B_2"])),
        model=model,
        shape=shape,
        mesh=None if drawn else draw(st.sampled_from(["a.msh", "../b.MSH"])),
        mesh_size=size,
        refine=draw(st.lists(ball, max_size=2)) if drawn else [],
        cells=draw(st.sampled_from(["simplex", "hexahedron"])) if drawn else "simplex",
        degree=draw(optional(st.integers(1, 2))),
        thickness=draw(lengths) if model.startswith("plane") else 1.0,
        density=draw(lengths),
        youngs_modulus=draw(st.floats(1e-3, 1e12)),
        poisson_ratio=draw(st.floats(-0.9, 0.49)),
        velocity=draw(optional(vectors(dim, formulas))),
        displacement=draw(optional(vectors(dim, formulas))),
        angular_velocity=None if still else draw(places if dim == 2 else vectors(3)),
        supports=supports,
        tractions=draw(st.lists(st.builds(Traction, surface=named, value=vectors(dim, of_loads)))),
        pressures=draw(st.lists(st.builds(Pressure, surface=named, value=of_loads))),
        rayleigh_mass=draw(st.floats(0, 10)),
        rayleigh_stiffness=draw(st.floats(0, 10)),
        contact_surfaces=draw(optional(st.lists(named, min_size=1, unique=True))),
    )


@st.composite
def obstacles(draw, dim):
    motion = optional(vectors(dim, in_time))
    found = [
        st.builds(
            HalfSpace,
            point=vectors(dim),
            normal=vectors(dim).filter(any),
            motion=motion,
        ),
        st.builds(
            RigidSphere,
            center=vectors(dim),
            radius=lengths,
            side=st.sampled_from(["outside", "inside"]),
            motion=motion,
        ),
        st.builds(
            RigidCylinder,
            point=vectors(dim),
            axis=st.none() if dim == 2 else vectors(3).filter(any),
            radius=lengths,
            motion=motion,
        ),
        st.builds(
            RigidBox, center=vectors(dim), size=vectors(dim, lengths), angle=angles, motion=motion
        ),
        st.builds(
            RigidPolyline,
            points=st.lists(places, min_size=2, unique=True).map(
                lambda xs: [[x, x / 2] for x in sorted(xs)]
            ),
            motion=motion,
        ),
    ]
    picked = draw(st.lists(st.sampled_from(found), min_size=1, max_size=3, unique_by=id))
    return [draw(strategy) for strategy in picked]


@st.composite
def scenes(draw):
    solid = draw(solids())
    dim = solid.dim
    down = [0.0, draw(places), 0.0][:dim]
    return Scene(
        title="random",
        duration=draw(lengths),
        gravity=draw(st.sampled_from([0.0, down, [[0, down], [1.5, [0.0] * dim]]])),
        bodies=[solid],
        obstacles=draw(obstacles(dim)),
        solve=Solve(
            method=draw(optional(st.sampled_from(["massless", "explicit", "conserving"]))),
            normals=draw(optional(st.sampled_from(["fixed", "updated"]))),
            estimate=draw(optional(st.booleans())),
        ),
        output=Output(checkpoint=draw(st.integers(0, 100))),
    )


slow = settings(
    deadline=None,
    max_examples=150,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)


@pytest.mark.slow
@slow
@given(scenes())
def test_written_scene_reads_back_equal(scene):
    text = scene.to_toml()
    again = Scene.from_dict(tomllib.loads(text))
    assert again == scene
    assert again.to_toml() == text
    assert Scene.from_dict(scene.to_dict()) == scene
    assert scene.with_settings({}) == scene
    assert isinstance(scene.gravity, PiecewiseVector)
    assert scene.gravity.dim == scene.solid.dim


KEYS = sorted({row.key for table in describe() for row in table.keys})
GOOD = {
    "title": "a disc",
    "duration": 5.0,
    "gravity": [[0.0, [0.0, -9.81]], [1.0, [0.0, 0.0]]],
    "body": [
        {
            "kind": "solid",
            "model": "plane_stress",
            "shape": {"kind": "block", "size": [1, 1], "symmetry": ["x"]},
            "mesh_size": 0.03,
            "refine": [{"point": [0.0, 0.02], "radius": 0.1, "size": 0.01}],
            "density": 1.0,
            "youngs_modulus": 0.743,
            "poisson_ratio": 0.3,
            "velocity": [0.0, "-0.1"],
            "supports": [{"surface": "top", "kind": "motion", "value": ["", "t"]}],
            "tractions": [{"surface": "top", "value": ["0", "-1*t"]}],
            "pressures": [{"surface": "right", "value": "x*t"}],
            "contact_surfaces": ["bottom"],
        }
    ],
    "obstacle": [
        {"kind": "half_space", "point": [0, 0], "normal": [0, 1], "motion": ["0", "t"]},
        {"kind": "polyline", "points": [[0, -1], [1, -1], [2, -2]]},
    ],
    "solve": {"method": "massless"},
    "output": {"checkpoint": 3},
}
numbers = st.integers() | st.floats() | st.sampled_from([0, 1, 2, 0.5, -1, 1e-300, 1e300, 10**400])
words = ["disc", "3d", "axisymmetric", "plane_strain", "top", "symmetry", "x", "t", "", "a.msh"]
scalars = st.booleans() | numbers | st.sampled_from(words) | st.text(max_size=8)
values = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=6), inner, max_size=4)
    ),
    max_leaves=10,
)


def tables_in(value):
    """Every table inside a value, however deep."""
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    here = [value] if isinstance(value, dict) and value else []
    return here + [table for entry in inner for table in tables_in(entry)]


@st.composite
def mutated(draw):
    """Return the good scene with one to three places changed, removed, renamed or added."""
    data = copy.deepcopy(GOOD)
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.sampled_from(tables_in(data) or [data]))
        name = draw(st.sampled_from(sorted(place) or [""]))
        change = draw(st.sampled_from(["value", "entry", "remove", "rename", "add"]))
        if change == "add":
            place[draw(st.sampled_from(KEYS))] = draw(values)
        elif change == "rename":
            place[draw(st.sampled_from(KEYS))] = place.pop(name, 0)
        elif change == "remove":
            place.pop(name, 0)
        elif change == "entry" and isinstance(place.get(name), list) and place[name]:
            place[name][draw(st.integers(0, len(place[name]) - 1))] = draw(values)
        else:
            place[name] = draw(values)
    return data


@settings(deadline=None, max_examples=200)
@given(mutated())
def test_mutated_scenes(data):
    try:
        scene, message = Scene.from_dict(data), ""
    except SceneError as error:
        scene, message = None, str(error)
    if scene is None:
        assert 0 < len(message) < 2000
        assert message.encode()  # can be printed
        return
    assert Scene.from_dict(tomllib.loads(scene.to_toml())) == scene


def test_the_scene_to_mutate_is_good():
    assert Scene.from_dict(GOOD).solid.mass == 0.5


PATHS = ["body.solid.shape.size", "body.0.supports.0.value", "gravity", "obstacle.0.motion"]


@settings(deadline=None)
@given(st.dictionaries(st.sampled_from(PATHS), values | st.none(), max_size=3))
def test_random_settings(changes):
    scene = Scene.from_dict(GOOD)
    try:
        new = scene.with_settings(changes)
    except SceneError:
        return
    assert Scene.from_dict(tomllib.loads(new.to_toml())) == new
