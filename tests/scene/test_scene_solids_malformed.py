"""Malformed scenes with solids: each is refused with a message that names key, value and remedy."""

import copy

import pytest

from impactfem.errors import SceneError
from impactfem.scene import Scene, Support

GOOD = {
    "title": "a disc",
    "duration": 5.0,
    "gravity": [0.0, -9.81],
    "body": [
        {
            "kind": "solid",
            "name": "disc",
            "model": "plane_strain",
            "shape": {"kind": "disc", "radius": 0.5, "center": [0.0, 0.52]},
            "mesh_size": 0.03,
            "refine": [{"point": [0.0, 0.02], "radius": 0.1, "size": 0.01}],
            "density": 1.0,
            "youngs_modulus": 0.743,
            "poisson_ratio": 0.3,
            "velocity": [0.0, -0.1],
            "supports": [{"surface": "rim", "kind": "motion", "value": ["", "0.1*sin(t)"]}],
            "tractions": [{"surface": "rim", "value": ["0", "-1*t"]}],
            "pressures": [{"surface": "rim", "value": "1e3*sin(t)*x"}],
        }
    ],
    "obstacle": [
        {"kind": "half_space", "name": "floor", "point": [0, 0], "normal": [0, 1]},
        {"kind": "cylinder", "name": "pin", "point": [3, 0], "radius": 1.0},
    ],
    "solve": {"method": "massless"},
    "output": {"checkpoint": 10},
}
ABSENT = object()
BODY = GOOD["body"][0]
BALL = {"model": "3d", "shape": {"kind": "sphere", "radius": 1}}
BAR = {"kind": "bar", "name": "b", "length": 1, "density": 1, "youngs_modulus": 1}
OF_BAR = {"gravity": 0.0, "body": [BAR], "obstacle": [{"kind": "wall"}], "solve": {}, "output": {}}
NO_LOADS = {"body.0.supports": [], "body.0.tractions": [], "body.0.pressures": []}
AXIS = {"body.0.model": "axisymmetric", **NO_LOADS}


def changed(changes):
    """Return the good scene with values put at paths, or removed."""
    data = copy.deepcopy(GOOD)
    for path, value in changes.items():
        *parents, last = path.split(".")
        place = data
        for part in parents:
            place = place[int(part)] if isinstance(place, list) else place[part]
        if value is ABSENT:
            del place[last]
        else:
            place[int(last) if isinstance(place, list) else last] = copy.deepcopy(value)
    return data


CASES = {
    # missing, misspelt
    "no model": ({"body.0.model": ABSENT}, ["body[0].model is missing", '"plane_strain" or']),
    "model": ({"body.0.model": "plain_strain"}, ['"plain_strain"', 'did you mean "plane_strain"']),
    "no shape": ({"body.0.shape": ABSENT}, ["body[0].shape is missing", "or mesh"]),
    "no mesh size": ({"body.0.mesh_size": ABSENT}, ["body[0].mesh_size is missing", "in m"]),
    "no ratio": ({"body.0.poisson_ratio": ABSENT}, ["poisson_ratio is missing", "< 0.5"]),
    "misspelt": ({"body.0.meshsize": 1}, ["body[0].meshsize = 1", 'mean "mesh_size"?']),
    "misspelt in shape": (
        {"body.0.shape.radios": 1},
        ["body[0].shape.radios = 1", 'did you mean "radius"?', "Known keys: kind, radius"],
    ),
    "no kind of shape": (
        {"body.0.shape.kind": ABSENT},
        ["body[0].shape.kind is missing", '"block" or "disc"'],
    ),
    "kind of shape": ({"body.0.shape.kind": "disk"}, ["body[0].shape.kind", 'did you mean "disc"']),
    "shape as text": ({"body.0.shape": "disc"}, ['body[0].shape = "disc"', "{ kind = "]),
    "no surface": (
        {"body.0.supports.0.surface": ABSENT},
        ["body[0].supports[0].surface is missing", "give a text"],
    ),
    "support as text": ({"body.0.supports": ["left"]}, ['body[0].supports[0] = "left"', "{"]),
    "support as table": (
        {"body.0.supports": {"surface": "rim"}},
        ["body[0].supports = ", "a table, not a list"],
    ),
    "key of a bar": (
        {"body.0.length": 1},
        ["body[0].length", 'only kind = "bar" or "rod" or "beam" has it'],
    ),
    "key of a shape": (
        {"body.0.radius": 1},
        ["body[0].radius = 1", "shape = { kind = ..., radius = ... }"],
    ),
    "key of a body": ({"solve.mesh_size": 1}, ["solve.mesh_size", '[[body]] with kind = "solid"']),
    "key of a solid": (
        {**OF_BAR, "body.0.mesh_size": 0.1},
        ["body[0].mesh_size", 'only kind = "solid" or "rigid" or "springs" or "plate" has it'],
    ),
    "friction": ({"obstacle.0.friction_coefficient": 0.3}, ["belongs to [[contact]]", "move it"]),
    "restitution": ({"obstacle.0.restitution": 0.3}, ["belongs to [[contact]]", "move it"]),
    "mass of an obstacle": (
        {"obstacle.0.mass": 1.0},
        ["obstacle[0].mass = 1.0", "it belongs to bodies", "remove it"],
    ),
    "kind of a contact": (
        {"contact": [{"between": ["disc", "floor"], "kind": "tied"}]},
        ['contact[0].kind = "tied" is not a known key: remove it'],
    ),
    "place twice": (
        {"obstacle.1.center": [3, 1]},
        ["obstacle[1].center = [3, 1] and point = [3, 0] say the same place", "remove one"],
    ),
    "no place": ({"obstacle.1.point": ABSENT}, ["obstacle[1].point is missing"]),
    "place of a chain": (
        {"obstacle.1": {"kind": "polyline", "center": [3, 0]}},
        ["obstacle[1].center", 'did you mean "points"?'],
    ),
    "law": ({"solve.law": "sequential"}, ["solve.law", 'did you mean "impact_law"?']),
    # bounds
    "ratio": ({"body.0.poisson_ratio": 0.5}, ["poisson_ratio = 0.5", "must be < 0.5"]),
    "negative ratio": ({"body.0.poisson_ratio": -1}, ["poisson_ratio = -1", "must be > -1"]),
    "density": ({"body.0.density": 0}, ["body[0].density = 0", "must be > 0"]),
    "radius": ({"body.0.shape.radius": -1}, ["body[0].shape.radius = -1", "must be > 0"]),
    "degree": ({"body.0.degree": 3}, ["body[0].degree = 3", "from 1 to 2"]),
    "coarse": ({"body.0.mesh_size": 2}, ["mesh_size = 2.0", "largest extent 1 ", "smaller"]),
    "coarsening": (
        {"body.0.refine.0.size": 0.1},
        ["body[0].refine[0].size = 0.1", "mesh_size = 0.03", "smaller"],
    ),
    "no wave speed": (
        {"body.0.youngs_modulus": 1e-300, "body.0.density": 1e300},
        ["body[0].density = 1e+300", "beyond 1e+50", "give SI units"],
    ),
    "no mass": (
        {"body.0.density": 1e-320, "body.0.shape.radius": 1e-5, "body.0.mesh_size": 1e-6,
         "body.0.youngs_modulus": 1e-300, "body.0.refine": []},
        ["body[0].density = ", "give SI units"],
    ),
    # mesh files
    "both": ({"body.0.mesh": "a.msh"}, ['body[0].mesh = "a.msh"', "remove one"]),
    "ending": ({"body.0.mesh": "a.pdf"}, ['"a.pdf"', ".msh, .geo, .step"]),
    "size of a mesh": (
        {"body.0.shape": ABSENT, "body.0.mesh": "a.msh"},
        ["body[0].mesh_size = 0.03", "a.msh", "remove it"],
    ),
    "refined mesh": (
        {"body.0.shape": ABSENT, "body.0.mesh": "a.msh", "body.0.mesh_size": ABSENT},
        ["body[0].refine = ", "a.msh", "remove it"],
    ),
    "no size of STEP": (
        {"body.0.shape": ABSENT, "body.0.mesh": "a.STEP", "body.0.mesh_size": ABSENT,
         "body.0.refine": []},
        ["body[0].mesh_size is missing", "STEP"],
    ),
    # model and shape
    "flat shape": ({"body.0.model": "3d"}, ["body[0].shape.kind", '"disc"', "3d", '"sphere"']),
    "3D shape": (
        {"body.0.shape": {"kind": "sphere", "radius": 1}},
        ["body[0].shape.kind", '"plane_strain"', '"disc"'],
    ),
    "over the axis": (
        {**AXIS, "body.0.shape.center": [0.1, 0]},
        ["body[0].shape.center = [0.1, 0.0]", "r = -0.4 < 0", "r = 0"],
    ),
    # dimensions
    "long velocity": (
        {"body.0.velocity": [0, 0, -1]},
        ["body[0].velocity has 3 entries", '"plane_strain" has 2', "give 2"],
    ),
    "short velocity": ({"body.0.velocity": [-1]}, ["body[0].velocity", "1 entries, not 2 or 3"]),
    "number": ({"body.0.velocity": -1}, ["body[0].velocity = -1", "a number, not a list"]),
    "formula": ({"body.0.velocity": ["0", "sinn(x)"]}, ["velocity", "'sinn'", "mean 'sin'"]),
    "z in 2D": (
        {"body.0.velocity": ["0", "z"]},
        ['body[0].velocity = "z"', '"plane_strain"', "'z'"],
    ),
    "z in pressure": ({"body.0.pressures.0.value": "z*t"}, ['body[0].pressures[0].value = "z*t"']),
    "t in velocity": ({"body.0.velocity": ["0", "t"]}, ["body[0].velocity", "'t'", "x, y, z"]),
    "x in motion": (
        {"body.0.supports.0.value": ["0", "x"]},
        ["body[0].supports[0].value", "'x'", "formulas in t"],
    ),
    "long motion": (
        {"body.0.supports.0.value": ["0", "0", "0"]},
        ["body[0].supports[0].value has 3 entries", "give 2"],
    ),
    "long traction": (
        {"body.0.tractions.0.value": [0, 0, 0]},
        ["body[0].tractions[0].value has 3", "give 2"],
    ),
    "long point": ({"body.0.refine.0.point": [0, 0, 0]}, ["refine[0].point has 3", "give 2"]),
    "vector of rotation": (
        {"body.0.angular_velocity": [0, 0, 1]},
        ["body[0].angular_velocity = [0.0, 0.0, 1.0]", "give a number"],
    ),
    "rotation about the axis": (
        {**AXIS, "body.0.shape.center": [0, 0.52], "body.0.angular_velocity": 1},
        ["body[0].angular_velocity = 1.0", "axisymmetric", "remove it"],
    ),
    "rotation of a cut body": (
        {"body.0.shape.symmetry": ["x"], "body.0.angular_velocity": 1},
        ["body[0].angular_velocity = 1.0", 'symmetry "x"', "remove one"],
    ),
    # surfaces
    "unknown surface": (
        {"body.0.supports.0.surface": "left"},
        ['body[0].supports[0].surface = "left"', "give one of rim"],
    ),
    "unknown traction": (
        {"body.0.tractions.0.surface": "top"},
        ['body[0].tractions[0].surface = "top"', "give one of rim"],
    ),
    "unknown pressure": ({"body.0.pressures.0.surface": "top"}, ["pressures[0].surface", "rim"]),
    "unknown contact": ({"body.0.contact_surfaces": ["top"]}, ["contact_surfaces[0]", "rim"]),
    "no contact": ({"body.0.contact_surfaces": []}, ["contact_surfaces = []", "at least 1"]),
    "contact twice": ({"body.0.contact_surfaces": ["rim"] * 2}, ["rim", "given twice"]),
    "cut surface": (
        {"body.0.shape": {"kind": "block", "size": [1, 1], "symmetry": ["x"]},
         **NO_LOADS, "body.0.contact_surfaces": ["left"]},
        ['contact_surfaces[0] = "left"', "right, bottom, top, symmetry_x"],
    ),
    "two supports": (
        {"body.0.supports": [{"surface": "rim", "kind": "fixed"}] * 2},
        ['body[0].supports[1].surface = "rim"', "another support", "remove"],
    ),
    "support on the axis": (
        {**AXIS, "body.0.shape.center": [0, 0.52],
         "body.0.supports": [{"surface": "axis", "kind": "fixed"}]},
        ['body[0].supports[0].surface = "axis"', "by the model", "remove"],
    ),
    "no motion": (
        {"body.0.supports.0.value": ABSENT},
        ["body[0].supports[0].value is missing", "formulas in t"],
    ),
    "free motion": (
        {"body.0.supports.0.value": ["", ""]},
        ["body[0].supports[0].value", "every direction free"],
    ),
    "fixed motion": (
        {"body.0.supports.0.kind": "fixed"},
        ["body[0].supports[0].value", 'kind = "fixed"', "remove it"],
    ),
    "endless motion": (
        {"body.0.supports.0.value": ["", "1/(t - 2.5)"]},
        ["body[0].supports[0].value", "at t = 2.5", "0 <= t <= 5"],
    ),
    # obstacles
    "wall": ({"obstacle.0": {"kind": "wall"}}, ['obstacle[0].kind = "wall"', '"half_space"']),
    "many": ({"obstacle": [GOOD["obstacle"][0]] * 101}, ["obstacle = ", "are 101", "up to 100"]),
    "same names": (
        {"obstacle.1.name": "floor"},
        ['obstacle[1].name = "floor"', "obstacle[0] too", "another name"],
    ),
    "name of the body": ({"obstacle.1.name": "disc"}, ["obstacle[1].name", "body[0] too"]),
    "normal": ({"obstacle.0.normal": [0, 0]}, ["obstacle[0].normal = [0, 0]", "all 0"]),
    "long normal": ({"obstacle.0.normal": [0, 0, 1]}, ["obstacle[0].normal", "has 3", "give 2"]),
    "axis in 2D": ({"obstacle.1.axis": [0, 0, 1]}, ["obstacle[1].axis", "circle", "remove"]),
    "side": ({"obstacle.1.side": "in"}, ["obstacle[1].side", '"outside" or "inside"']),
    "obstacle motion": (
        {"obstacle.0.motion": ["0", "log(t)"]},
        ["obstacle[0].motion", "no finite value at t = 0"],
    ),
    "long obstacle motion": ({"obstacle.0.motion": [0, 0, 0]}, ["obstacle[0].motion", "give 2"]),
    "blank obstacle motion": ({"obstacle.0.motion": ["", "0"]}, ["obstacle[0].motion", "empty"]),
    "one point": (
        {"obstacle.0": {"kind": "polyline", "points": [[0, 0]]}},
        ["obstacle[0].points", "1 entries", "at least 2"],
    ),
    "same points": (
        {"obstacle.0": {"kind": "polyline", "points": [[0, 0], [1, 0], [1, 0]]}},
        ["obstacle[0].points[2] = [1.0, 0.0]", "repeats", "remove it"],
    ),
    "crossing": (
        {"obstacle.0": {"kind": "polyline", "points": [[0, 0], [1, 0], [1, 1], [0.5, -1]]}},
        ["obstacle[0].points: pieces 0 and 2", "no left side"],
    ),
    "touching": (
        {"obstacle.0": {"kind": "polyline", "points": [[0, 0], [2, 0], [2, 1], [1, 0]]}},
        ["obstacle[0].points: pieces 0 and 2", "move its points"],
    ),
    # gravity
    "number of gravity": ({"gravity": 9.81}, ["gravity = 9.81", "give a vector [0.0, -9.81]"]),
    "long gravity": ({"gravity": [0, 0, -9.81]}, ["gravity = [0, 0, -9.81]", "has 3", "vector [0"]),
    "mixed gravity": ({"gravity": [[0, [0, 1]], [1, [0, 0, 1]]]}, ["gravity", "different numbers"]),
    "half gravity": ({"gravity": [[0, [0, 1]], [1, 2]]}, ["gravity", "2 is not a list of numbers"]),
    "radial gravity": (
        {**AXIS, "body.0.shape.center": [0, 0.52], "gravity": [1, 0]},
        ["gravity = [1, 0]", "radial", "give [0.0, g]"],
    ),
    # settings
    "method": ({"solve.method": "dg"}, ['solve.method = "dg"', "a solid", '"massless"']),
    "elements": ({"solve.elements": 40}, ["solve.elements = 40", "bars", "set body.mesh_size"]),
    "window": ({"solve": {"window": 4}}, ["solve.window = 4", "step by step"]),
    "degree of dg": ({"solve": {"degree": 1}}, ["solve.degree = 1", "set body.degree"]),
    "fitted": ({"solve": {"fitted": True}}, ["solve.fitted = true", "remove it"]),
    "accuracy": ({"solve.accuracy": 0.1}, ["solve.accuracy = 0.1", "estimate = true"]),
    "mesh": ({"solve.mesh": "a.msh"}, ['solve.mesh = "a.msh"', "set body.mesh"]),
    "normals": ({"solve.normals": "new"}, ["solve.normals", '"fixed" or "updated"']),
    "solver": ({"solve.linear_solver": "cg"}, ["solve.linear_solver", '"mumps" or "gamg"']),
    "estimate": ({"solve.estimate": 1}, ["solve.estimate = 1", "true or false"]),
    "checkpoint": ({"output.checkpoint": -1}, ["output.checkpoint = -1", "must be >= 0"]),
    "long step": ({"solve.dt": 6}, ["solve.dt = 6.0", "duration = 5.0", "smaller step"]),
    # bars
    "obstacle of a bar": (
        {**OF_BAR, "obstacle": GOOD["obstacle"][:1]},
        ["obstacle[0].kind", '"half_space" is for solids', '"wall"'],
    ),
    "method of a bar": (
        {**OF_BAR, "solve": {"method": "massless"}},
        ['solve.method = "massless"', "a bar", '"galerkin"'],
    ),
    "normals of a bar": ({**OF_BAR, "solve": {"normals": "fixed"}}, ["solve.normals", "remove it"]),
    "estimate of a bar": ({**OF_BAR, "solve": {"estimate": True}}, ["solve.estimate", "remove it"]),
    "checkpoint of a bar": (
        {**OF_BAR, "output": {"checkpoint": 5}},
        ["output.checkpoint = 5", "remove it"],
    ),
    "gravity of a bar": (
        {**OF_BAR, "gravity": [[0, [0, 1]]]},
        ["gravity = ", "one axis", "gravity = 9.81"],
    ),
}  # fmt: skip


def test_the_scene_to_change_is_good():
    assert Scene.from_dict(GOOD).solid.mesh_size == 0.03


@pytest.mark.parametrize(("changes", "parts"), CASES.values(), ids=CASES)
def test_malformed_scene_is_explained(changes, parts):
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(changed(changes))
    message = str(caught.value)
    for part in parts:
        assert part in message
    assert len(message) < 700
    assert message.isprintable()


def test_3d_needs_the_axis_of_a_cylinder():
    body = {**BODY, **BALL, "velocity": [0, 0, 0], "supports": [], "tractions": [], "refine": []}
    body |= {"pressures": [{"surface": "surface", "value": "z"}]}
    data = GOOD | {"body": [body], "gravity": [0, 0, 0]}
    pin = {"kind": "cylinder", "point": [0, 0, 9], "radius": 1}
    with pytest.raises(SceneError, match=r"obstacle\[0\].axis is missing: in 3D give"):
        Scene.from_dict(data | {"obstacle": [pin]})
    scene = Scene.from_dict(data | {"obstacle": [pin | {"axis": [0, 0, 1]}]})
    assert scene.solid.dim == 3
    with pytest.raises(SceneError, match=r"thickness = 2.0 does not fit model = \"3d\""):
        scene.with_settings({"body.disc.thickness": 2})
    with pytest.raises(SceneError, match=r"angular_velocity = 1.0 .*a list of 3 numbers"):
        scene.with_settings({"body.disc.angular_velocity": 1})


def test_python_objects_are_checked_alike():
    with pytest.raises(SceneError, match=r"support.surface is missing"):
        Support(kind="fixed")
