"""Scenes of points, rods and beams: what is refused, and that files read back."""

import copy

import pytest

import impactfem
from impactfem.errors import SceneError
from impactfem.planning import plan
from impactfem.scene import Contact, HalfSpace, Point, Scene, Spring

BALL = {"kind": "point", "name": "ball", "mass": 1.0, "position": [0.0, 1.0]}
OTHER = {"kind": "point", "name": "other", "mass": 2.0, "position": [1.0, 1.0], "radius": 0.1}
FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
ROD = {"kind": "rod", "mass": 1.0, "length": 0.2, "center": [0.0, 0.5]}
BEAM = {
    "kind": "beam", "length": 0.2, "height": 0.005, "width": 0.005, "density": 7800.0,
    "youngs_modulus": 2e11, "center": [0.0, 0.5],
}  # fmt: skip
LAW = {"between": ["ball", "floor"], "restitution": 0.5}
GOOD = {
    "title": "balls", "duration": 1.0, "gravity": [0.0, -9.81], "body": [BALL, OTHER],
    "obstacle": [FLOOR], "contact": [LAW], "solve": {}, "output": {},
}  # fmt: skip


def made(**changes):
    data = copy.deepcopy(GOOD)
    for path, value in changes.items():
        place, keys = data, path.split("__")
        for name in keys[:-1]:
            place = place[int(name) if name.isdigit() else name]
        last = int(keys[-1]) if keys[-1].isdigit() else keys[-1]
        place[last] = value
    return data


CASES = {
    "mass": (made(body__0__mass=0), ["body[0].mass = 0", "> 0"]),
    "dimensions": (made(body__0__position=[1.0]), ["body[1].position", "has 2", "give 1"]),
    "four dimensions": (made(body__0__position=[0, 0, 0, 0]), ["1 or 2 or 3 numbers"]),
    "velocity": (made(body__0__velocity=[1.0]), ["body[0].velocity", "1 entries", "give 2"]),
    "force": (made(body__0__force=["0"]), ["body[0].force", "give 2"]),
    "force of z": (made(body__0__force=["z", "0"]), ["force[0]", "uses z", "use x, y, vx, vy, t"]),
    "force of nothing": (made(body__0__force=["q", "0"]), ["force", "'q'"]),
    "force at the start": (made(body__0__force=["1/x", "0"]), ["force[0]", "no finite value"]),
    "spring ends": (made(body__0__springs=[{"stiffness": 1.0}]), ["springs[0].anchor", "neither"]),
    "spring anchor": (
        made(body__0__springs=[{"anchor": [1.0], "stiffness": 1.0}]),
        ["springs[0].anchor", "1 entries", "give 2"],
    ),
    "spring to nobody": (
        made(body__0__springs=[{"to": "wall", "stiffness": 1.0}]),
        ["springs[0].to", '"wall" is no other point', '"other"'],
    ),
    "spring without direction": (
        made(body__0__springs=[{"anchor": [0.0, 1.0], "rest_length": 1.0, "stiffness": 1.0}]),
        ["ball", "no direction"],
    ),
    "gravity": (made(gravity=9.81), ["gravity = 9.81", "give a vector [0.0, -9.81]"]),
    "long gravity": (made(gravity=[0, 0, 1]), ["gravity", "has 3 entries", "2 coordinates"]),
    "restitution": (
        made(contact__0__restitution=1.2),
        ["contact[0].restitution", "0 (no rebound)"],
    ),
    "negative restitution": (
        made(contact__0__restitution=-0.1),
        ["contact[0].restitution", ">= 0"],
    ),
    "one name": (made(contact__0__between=["ball"]), ["contact[0].between", "at least 2"]),
    "three names": (made(contact__0__between=["ball", "floor", "other"]), ["give two"]),
    "unknown name": (
        made(contact__0__between=["ball", "roof"]),
        ['no "roof"', "ball, other, floor"],
    ),
    "two obstacles": (
        made(obstacle=[FLOOR, {**FLOOR, "name": "roof"}], contact__0__between=["roof", "floor"]),
        ["two obstacles"],
    ),
    "twice": (made(contact=[LAW, {**LAW, "between": ["floor", "ball"]}]), ["contact[1]", "twice"]),
    "same names": (made(body__1__name="ball"), ["body[1].name", "body[0] too"]),
    "a wall": (made(obstacle=[{"kind": "wall"}], contact=[]), ["obstacle[0].kind", "half_space"]),
    "3D obstacle": (made(obstacle__0__normal=[0, 0, 1]), ["obstacle[0].normal", "2 coordinates"]),
    "point and bar": (
        made(body=[BALL, {"kind": "bar", "length": 1, "density": 1, "youngs_modulus": 1}]),
        ["body[1]: bar has 1 coordinates", "by point and axis"],
    ),
    "elements": (made(solve={"elements": 10}), ["solve.elements", "bars and solids", "point"]),
    "normals": (made(solve={"normals": "fixed"}), ["solve.normals", "belongs to solids"]),
    "method": (made(solve={"method": "galerkin"}), ["does not solve a point", '"event_driven"']),
    "law of a method": (
        made(solve={"method": "moreau_jean", "impact_law": "sequential"}),
        ['needs method = "event_driven"'],
    ),
    "stick speed": (
        made(solve={"method": "moreau_jean", "stick_speed": 1e-3}),
        ["solve.stick_speed", 'belongs to method = "event_driven"'],
    ),
    "checkpoint": (made(output={"checkpoint": 5}), ["output.checkpoint", "not checkpointed"]),
    "VTX": (made(output={"fields": ["vtx"]}), ["output.fields", '["vtkhdf"]', "or []"]),
    "steps": (made(solve={"method": "moreau_jean", "dt": 1e-9}), ["solve.dt = 1e-09", "larger dt"]),
    "rows": (made(duration=1e4, solve={"dt": 1e-4}), ["output.every = 1", "use a larger one"]),
    "inside": (made(body__0__position=[0.0, -0.25]), ["ball on floor", "overlap by 0.25 m"]),
    "inside each other": (
        made(
            body__0__position=[0.95, 1.0],
            contact=[LAW, {"between": ["ball", "other"]}],
        ),
        ["ball on other", "overlap by 0.05 m"],
    ),
    "same place": (
        made(body__0__position=[1.0, 1.0], contact=[{"between": ["ball", "other"]}]),
        ["both start at", "no direction"],
    ),
    "rod inside": (
        made(body=[{**ROD, "center": [0, -0.1]}], contact=[]),
        ["rod", "inside at t = 0"],
    ),
    "event_driven with friction": (
        made(contact__0__friction_coefficient=0.3, solve={"method": "event_driven"}),
        ["does not solve friction between ball and floor", '"moreau_jean"'],
    ),
    "thick beam": (made(body=[{**BEAM, "height": 0.1}], contact=[]), ["body[0].height", "thick"]),
}


@pytest.mark.parametrize(("data", "parts"), CASES.values(), ids=CASES)
def test_mistake_is_explained(data, parts):
    with pytest.raises(SceneError) as caught:
        plan(Scene.from_dict(data))
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize("kind", ["points", "rod", "beam"])
def test_scene_is_written_and_read_back(kind, tmp_path):
    data = made(
        body__0__springs=[{"to": "other", "stiffness": 3.0, "rest_length": 0.5}],
        body__0__force=["-vx", "cos(t)"],
        solve={"method": "event_driven", "impact_law": "sequential", "stick_speed": 1e-6},
    )
    if kind != "points":
        data = made(body=[ROD if kind == "rod" else BEAM], contact=[{"between": [kind, "floor"]}])
    scene = Scene.from_dict(data)
    path = tmp_path / "scene.toml"
    path.write_text(scene.to_toml(), encoding="utf-8")
    assert Scene.from_toml(path) == scene
    assert scene.solver == "vibro"
    assert scene.dim == 2


def test_settings_reach_laws_by_index():
    changed = Scene.from_dict(GOOD).with_settings({"contact.0.restitution": 0.9})
    assert changed.contacts[0].restitution == 0.9


def test_python_scene():
    scene = Scene(
        title="t",
        duration=1.0,
        bodies=[Point(mass=1, position=[1.0], springs=[Spring(anchor=[0.0], stiffness=2.0)])],
        obstacles=[HalfSpace(name="stop", point=[0.5], normal=[1.0])],
        contacts=[Contact(between=["point", "stop"], restitution=1.0)],
    )
    assert scene.bodies[0].velocity == (0.0,)
    assert plan(scene).method == "event_driven"


def test_without_a_law_nothing_rebounds_and_the_plan_says_so():
    chosen = plan(Scene.from_dict(made(contact=[])))
    assert any("restitution: 0 is taken" in warning for warning in chosen.warnings)
    assert chosen.contact_pairs == 2


def test_a_rod_flies_without_an_obstacle():
    rod = ROD | {"velocity": [0.5, 1.0], "angular_velocity": 3.0, "inclination": 0.6}
    data = {"title": "rod", "duration": 1.0, "gravity": [0.0, -9.81], "body": [rod | {"name": "r"}]}
    history = impactfem.solve(Scene.from_dict(data)).history
    end = {name: float(history[f"r.{name}"][-1]) for name in ("x", "y", "angle")}
    assert end == pytest.approx({"x": 0.5, "y": 0.5 + 1.0 - 4.905, "angle": 3.6}, abs=1e-10)
