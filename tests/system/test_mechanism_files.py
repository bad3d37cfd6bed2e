"""Files of mechanisms: inverse kinematics against closed forms, frames, and what is refused."""

import json
import sys

import numpy as np
import pytest

pytest.importorskip("pinocchio")

import impactfem
from impactfem import Scene, SceneError
from impactfem.cli import main
from impactfem.models.kinematics import kinematics
from impactfem.models.solids import solids_model
from impactfem.starting import starters

MOVING = '<inertial><origin xyz="0.5 0 0"/><mass value="1"/><inertia ixx="0" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'  # noqa: E501
LIMIT = '<limit lower="-2.9" upper="2.9" effort="1" velocity="1"/>'
TWO_R = f"""<robot name="two_r"><link name="base"/>
<link name="upper">{MOVING}</link><link name="lower">{MOVING}</link><link name="hand"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<axis xyz="0 0 1"/>{LIMIT}</joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
<origin xyz="1 0 0"/><axis xyz="0 0 1"/>{LIMIT}</joint>
<joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/>
<origin xyz="1 0 0"/></joint></robot>"""
START = {"shoulder": {"position": 0.3}, "elbow": {"position": 1.0}}


def scene(folder, text=TWO_R, file="arm.urdf", **body):
    (folder / file).write_text(text)
    found = {"kind": "mechanism", "name": "arm", "file": file, "joints": START} | body
    return Scene.from_dict({"title": "arm", "duration": 0.1, "gravity": [0.0, -9.81, 0.0],
                            "body": [found]}, base=folder)  # fmt: skip


@pytest.mark.parametrize(
    ("method", "iterations"),
    [("jacobian_transpose", 187), ("gauss_newton", 4), ("damped", 7), ("gradient", None)],
)
def test_inverse_kinematics_of_two_links(tmp_path, method, iterations):
    place = {"frame": "hand", "target": [1.0, 1.0, 0.0], "method": method}
    (found,) = kinematics(scene(tmp_path, place=place))
    assert found.inverse.method == method
    assert found.inverse.residual <= 1e-10
    assert iterations is None or found.inverse.iterations == iterations
    assert list(found.joints.values()) == pytest.approx([0.0, np.pi / 2], abs=2e-10)
    hand = found.frames["hand"]
    np.testing.assert_allclose(hand.position, [1.0, 1.0, 0.0], atol=1e-10)
    np.testing.assert_allclose(hand.quaternion, [np.sqrt(0.5), 0, 0, np.sqrt(0.5)], atol=1e-9)
    np.testing.assert_allclose(
        hand.jacobian, [[-1, -1], [1, 0], [0, 0], [0, 0], [0, 0], [1, 1]], atol=1e-9
    )


@pytest.mark.parametrize("method", ["jacobian_transpose", "gauss_newton", "damped", "gradient"])
def test_a_place_out_of_reach_gives_the_nearest_within_limits(tmp_path, method):
    place = {"frame": "hand", "target": [0.0, 3.0, 0.0], "method": method}
    body = scene(tmp_path, place=place)
    (found,) = kinematics(body)
    assert not found.inverse.solved
    assert found.inverse.residual == pytest.approx(1.0, abs=1e-9)
    with pytest.raises(impactfem.errors.ConvergenceError, match=r"arm\.place: hand does not reach"):
        impactfem.plan(body)
    held = TWO_R.replace('lower="-2.9" upper="2.9"', 'lower="-1" upper="1"')
    (found,) = kinematics(scene(tmp_path, held, place=place))
    one, two = found.joints.values()
    assert max(abs(one), abs(two)) <= 1.0
    # The shoulder rests on its limit; the elbow turns the forearm towards the target.
    hold = np.array([np.cos(1.0), np.sin(1.0)])
    way = np.array([0.0, 3.0]) - hold
    nearest = np.linalg.norm(way) - 1.0
    assert found.inverse.residual == pytest.approx(nearest, abs=1e-7)


def test_kinematics_on_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "mechanism"]) == 0
    place = ["--set", 'body.arm.place={frame="hand", target=[0.5, 0.0, 0.3]}']
    assert main(["kinematics", "mechanism.toml", "--out", "k", *place]) == 0
    found = json.loads((tmp_path / "k" / "kinematics.json").read_text())
    np.testing.assert_allclose(found["frames"]["hand"]["position"], [0.5, 0.0, 0.3], atol=1e-10)
    assert np.shape(found["frames"]["hand"]["jacobian"]) == (6, 2)
    assert found["rates"] == ["shoulder", "elbow"]
    assert found["inverse"]["method"] == "damped"
    assert found["inverse"]["q"] == list(found["joints"].values())
    assert (tmp_path / "k" / "kinematics.png").stat().st_size > 4000
    far = ["--set", 'body.arm.place={frame="hand", target=[2.0, 0.0, 0.0]}']
    assert main(["kinematics", "mechanism.toml", "--out", "k", *far]) == 3
    found = json.loads((tmp_path / "k" / "kinematics.json").read_text())
    assert found["inverse"]["solved"] is False
    assert found["inverse"]["residual"] == pytest.approx(1.1, abs=1e-6)
    assert "the nearest is 1.1 m off" in capsys.readouterr().err


MJCF = """<mujoco model="arm"><compiler angle="radian"/><worldbody>
<body name="upper"><joint name="shoulder" type="hinge" axis="0 0 1" range="-2.9 2.9" limited="true"
 damping="0.1" frictionloss="0.2"/>
<geom type="capsule" fromto="0 0 0 1 0 0" size="0.05" mass="1"/>
<body name="lower" pos="1 0 0"><joint name="elbow" type="hinge" axis="0 0 1"/>
<geom type="sphere" size="0.1" pos="1 0 0" mass="1"/></body></body></worldbody></mujoco>"""


def test_mjcf_is_read_with_its_joints_and_shapes(tmp_path):
    body = scene(tmp_path, MJCF, "arm.xml", position=[0.0, 0.0, 1.0])
    model = solids_model(body, (), updated=True)
    (arm,) = model.few
    assert arm.joints.damping.tolist() == [0.1, 0.0]
    assert arm.joints.friction.tolist() == [0.2, 0.0]
    assert (arm.joints.upper[0], arm.joints.upper[1]) == (2.9, np.inf)
    c, s = np.cos(0.3), np.sin(0.3)
    tip = np.array([c + np.cos(1.3), s + np.sin(1.3)])
    np.testing.assert_allclose(arm.centers[0], [*(0.25 * np.array([c, s]) + 0.5 * tip), 1.0])


def _replaced(old, new):
    return TWO_R.replace(old, new, 1)


MESH = '<collision><geometry><mesh filename="{}"/></geometry></collision>'


@pytest.mark.parametrize(
    ("text", "body", "said"),
    [
        (TWO_R, {"file": "none.urdf"}, 'file = "none.urdf" cannot be read'),
        (TWO_R, {"joints": {"elbo": {}}}, 'joints.elbo: there is no joint .*mean "elbow"'),
        (TWO_R, {"joints": {"elbow": {"position": 3.0}}}, "position = 3.0 is outside .* -2.9 to"),
        (TWO_R, {"joints": {"elbow": {"motor": "1/q"}}}, 'motor = "1/q" has no finite value'),
        (TWO_R, {"velocity": [1, 0, 0]}, r"velocity = .* is of a first link that moves"),
        (TWO_R, {"place": {"frame": "hnd", "target": [1, 1, 0]}}, 'frame "hnd"; did you mean'),
        (TWO_R.replace('mass value="1"', 'mass value="0"').replace('"0.1"', '"0"'), {},
         'joint "(shoulder|elbow)" moves nothing that has inertia'),
        (_replaced('mass value="1"', 'mass value="-1"'), {}, '"upper" has the mass "-1"'),
        (_replaced('ixx="0"', 'ixx="-0.01"'), {},
         '"shoulder" has the principal moments -0.01, 0.1'),
        (_replaced('izz="0.1"', 'izz="0.2"'), {"strict": True},
         "0, 0.1, 0.2: no body has one above the sum"),
        (_replaced('mass value="1"', 'mass value="0"'), {"strict": True},
         '"upper" has inertia, but no mass'),
        (_replaced('xyz="1 0 0"', 'xyz="nan 0 0"'), {}, '<origin> of "elbow" has xyz = "nan 0 0"'),
        (_replaced('xyz="0.5 0 0"', 'xyz="0.5 0"'), {}, '<origin> of "upper" has xyz = "0.5 0"'),
        (_replaced('iyy="0.1"', ""), {}, '"upper" has no inertia: give <inertia ixx'),
        (_replaced('"-2.9" upper="2.9"', '"1" upper="-1"'), {}, "has the limits 1 to -1"),
        (_replaced('name="elbow"', 'name="shoulder"'), {}, 'two joints have the name "shoulder"'),
        (_replaced("<child", '<dynamics damping="-1"/><child'), {}, 'damping = "-1": give'),
        (_replaced('type="revolute"', 'type="bend"'), {}, '"shoulder" has type = "bend"'),
        (_replaced('parent link="upper"', 'parent link="uper"'), {}, 'link .*"uper"; did you mean'),
        (_replaced("</robot>", ""), {}, "is not valid XML"),
        (_replaced("<robot", "<!DOCTYPE x><robot"), {}, "declares a document type"),
        (_replaced(MOVING, MOVING + MESH.format("a.stl")), {}, '"a.stl", which does not exist'),
        (_replaced(MOVING, MOVING + MESH.format("../a.stl")), {}, "outside the folder"),
        (_replaced(MOVING, MOVING + MESH.format("/a.stl")), {}, "outside the folder"),
        (_replaced(MOVING, MOVING + MESH.format("package://a/a.stl")), {}, "does not exist"),
        (_replaced(MOVING, MOVING + "<collision><geometry><cone/></geometry></collision>"),
         {"strict": True},
         '"upper" has a collision shape that is not read'),
    ],
)  # fmt: skip
def test_bad_files_and_joints_name_key_and_remedy(tmp_path, text, body, said, capfd):
    with pytest.raises(SceneError, match=said) as caught:
        impactfem.plan(scene(tmp_path, text).with_settings(
            {f"body.arm.{key}": value for key, value in body.items()}
        ))  # fmt: skip
    assert "body[0]." in str(caught.value)
    capfd.readouterr()  # what Pinocchio says itself


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("</worldbody>", '<body name="more"><geom size="1" mass="1"/></body></worldbody>',
         "has 2 bodies"),
        ('type="sphere" size="0.1"', 'type="ellipsoid" size="0.1 0.1 0.2"', "is a Ellipsoid"),
        ('name="elbow" type="hinge"', 'name="elbow" class="x"', 'no <default class> .* named "x"'),
        ('name="elbow" type="hinge"', 'name="elbow" type="bend"', '"elbow" has type = "bend"'),
        ('<geom type="sphere" size="0.1" pos="1 0 0" mass="1"/>', '<geom type="mesh" mesh="m"/>',
         '"lower" has its mass from a mesh'),  # Pinocchio takes 1 kg and 1 kg m^2 for any
    ],
)  # fmt: skip
def test_what_mjcf_says_wrongly_is_refused(tmp_path, old, new, said):
    with pytest.raises(SceneError, match=said):
        impactfem.plan(scene(tmp_path, MJCF.replace(old, new), "arm.xml"))


def test_contacts_name_links_with_shapes_that_may_meet(tmp_path):
    for name in ("mechanism.toml", "arm.urdf"):
        source = starters()["mechanism"].with_name(name)
        (tmp_path / name).write_text(source.read_text())
    made = Scene.from_toml(tmp_path / "mechanism.toml")
    for between, said in (
        (["arm/hnd", "wall"], 'no link "arm/hnd"; did you mean "hand"'),
        (["arm/base", "wall"], "base has no collision shape that moves"),
    ):
        with pytest.raises(SceneError, match=said):
            impactfem.plan(made.with_settings({"contact.0.between": between}))
    pole = {"kind": "cylinder", "name": "wall", "center": [0.9, 0.0, 0.3], "axis": [0.0, 1.0, 0.0],
            "radius": 0.1}  # fmt: skip
    data = made.to_dict() | {"obstacle": [pole]}
    impactfem.plan(Scene.from_dict(data, base=tmp_path))
    data["contact"][0]["between"] = ["arm", "wall"]
    impactfem.plan(Scene.from_dict(data, base=tmp_path))
    corners = ("2 0 0", "3 0 0", "2 1 0", "2 0 1")
    faces = "".join(
        f"facet normal 0 0 0 outer loop {' '.join(f'vertex {corners[k]}' for k in face)} "
        "endloop endfacet "
        for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    )
    (tmp_path / "wall.stl").write_text(f"solid wall {faces}endsolid wall")
    data["obstacle"] = [{"kind": "mesh", "name": "wall", "mesh": "wall.stl"}]
    impactfem.plan(Scene.from_dict(data, base=tmp_path))  # triangles meet every shape


def test_without_pinocchio_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(impactfem.errors.MissingDependencyError, match=r"impactfem\[robots\]"):
        impactfem.plan(scene(tmp_path))
