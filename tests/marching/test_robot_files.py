"""Robot files as they are found: what of them is read, against equations of motion written here."""

import numpy as np
import pytest
from moving_scenes import check_restart
from scipy.integrate import solve_ivp

pytest.importorskip("pinocchio")

import impactfem
from impactfem import Scene, SceneError
from impactfem.system.mechanism_file import read_mechanism

G = 9.81
CART = """
  <mujoco model="cart">
  <compiler angle="radian"/><option timestep="0.01"/>
  <default><motor ctrlrange="-3 3" ctrllimited="true" gear="4"/></default>
  <worldbody>
    <geom name="ground" type="plane" size="1 1 1" pos="0 0 -2"/>
    <body name="cart">
      <inertial pos="0 0 0" mass="1.5" diaginertia="1 1 1"/>
      <joint name="slider" type="slide" axis="1 0 0" damping="0.3"/>
      <body name="pole"><inertial pos="0 0 -0.5" mass="0.4" diaginertia="0.03 0.03 0.01"/>
        <geom type="sphere" size="0.05" pos="0 0 -1"/>
        <joint name="hinge" type="hinge" axis="0 -1 0" stiffness="0.7" springref="0.2"/></body>
    </body></worldbody>
  <actuator>{actuator}</actuator>
  </mujoco>"""
LINK = (
    '<link name="{}"><inertial><origin xyz="{} 0 0"/><mass value="{}"/>'
    '<inertia ixx="0" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/><origin xyz="{} 0 0"/>'
    '<axis xyz="0 0 1"/>{}</joint>'
)
TWO = (
    "  \n<robot>"
    '<link name="base"/>'
    + LINK.format("upper", 0.5, 1.0, i=0.1)
    + LINK.format("lower", 0.4, 0.5, i=0.05)
    + JOINT.format("one", "continuous", "base", "upper", 0.0, '<dynamics damping="0.2"/>')
    + JOINT.format("two", "continuous", "upper", "lower", 1.0, "{}")
    + "</robot>"
)


def scene(folder, text, file="robot.urdf", more=None, solve=None, **body):
    (folder / file).write_text(text)
    own = {"kind": "mechanism", "name": "arm", "file": file} | body
    found = {"title": "robot", "duration": 0.4, "gravity": [0.0, -G, 0.0], "body": [own]}
    found["solve"] = {"dt": 1e-3, "estimate": False} | (solve or {})
    return Scene.from_dict(found | (more or {}), base=folder)


def ends(result, *names):
    return np.array([result.history[name][-1] for name in names])


def balance(result):
    return np.asarray(result.history["total_energy"]) + np.asarray(result.history["arm.one.lost"])


def two_links(t, y, force):
    """Coordinates and rates of two links in the plane; `force` gives what acts in the joints."""
    (a, b), v = y[:2], y[2:]
    m, ll, i1, i2 = 0.5, 1.0, 0.1 + 0.25, 0.05
    c, s = np.cos(b), np.sin(b)
    h = m * ll * 0.4
    inertia = np.array([[i1 + m * ll**2 + i2 + m * 0.16 + 2 * h * c, i2 + m * 0.16 + h * c],
                        [i2 + m * 0.16 + h * c, i2 + m * 0.16]])  # fmt: skip
    whirl = h * s * np.array([2 * v[0] * v[1] + v[1] ** 2, -(v[0] ** 2)])
    fall = -G * np.array([0.5 * np.cos(a) + m * (ll * np.cos(a) + 0.4 * np.cos(a + b)),
                          m * 0.4 * np.cos(a + b)])  # fmt: skip
    return inertia, whirl + fall + force(t, y)


@pytest.mark.parametrize(
    ("actuator", "joint", "pushed"),
    [
        ('<motor name="m" joint="slider"/>', {"control": "3.5*sin(30*t) - 0.2*v"},
         lambda t, _, v: 4 * np.clip(3.5 * np.sin(30 * t) - 0.2 * v, -3, 3)),
        ('<position joint="slider" kp="20" kv="2" forcerange="-6 6"/>', {"control": 0.5},
         lambda _, x, v: np.clip(20 * (0.5 - x) - 2 * v, -6, 6)),
        ('<position joint="slider" kp="20"/>', {"motor": "5*cos(7*t)"},
         lambda t, *_: 5 * np.cos(7 * t)),
    ],
    ids=["motor", "servo", "replaced"],
)  # fmt: skip
def test_cart_and_pole_of_mjcf_with_actuator_and_spring(tmp_path, actuator, joint, pushed):
    text = CART.format(actuator=actuator)

    def rates(t, y):
        x, q, u, w = y
        inertia = [[1.9, 0.2 * np.cos(q)], [0.2 * np.cos(q), 0.13]]
        force = pushed(t, x, u) - 0.3 * u + 0.2 * np.sin(q) * w**2
        return [u, w, *np.linalg.solve(inertia, [force, -0.2 * G * np.sin(q) - 0.7 * (q - 0.2)])]

    exact = solve_ivp(rates, (0, 0.08), [0, 1.0, 0, 0], rtol=1e-11, atol=1e-12, max_step=1e-3)
    result = impactfem.solve(
        scene(tmp_path, text, "cart.xml", {"gravity": [0.0, 0.0, -G], "duration": 0.08},
              {"dt": 2.5e-4},
              joints={"slider": joint, "hinge": {"position": 1.0}})
    )  # fmt: skip
    found = ends(result, "arm.slider.q", "arm.hinge.q", "arm.slider.v", "arm.hinge.v")
    np.testing.assert_allclose(found, exact.y[:, -1], rtol=0, atol=1e-6)
    assert [each.name for each in result.scene.obstacles] == ["ground"]  # the plane


def test_a_joint_that_mimics_is_a_gear(tmp_path):
    text = TWO.format('<mimic joint="one" multiplier="-1.5" offset="0.3"/>')
    gear = np.array([1.0, -1.5])

    def rates(t, y):
        a, v = y
        full = np.array([a, 0.3 - 1.5 * a, *(gear * v)])
        inertia, force = two_links(t, full, lambda *_: [-0.2 * v, 0.0])
        return [v, gear @ force / (gear @ inertia @ gear)]

    exact = solve_ivp(rates, (0, 0.4), [0.2, 1.0], rtol=1e-11, atol=1e-12)
    result = impactfem.solve(
        scene(tmp_path, text, joints={"one": {"position": 0.2, "velocity": 1.0}})
    )
    found = ends(result, "arm.one.q", "arm.one.v", "arm.two.q", "arm.two.v")
    a, v = exact.y[:, -1]
    np.testing.assert_allclose(found, [a, v, 0.3 - 1.5 * a, -1.5 * v], rtol=0, atol=2e-5)
    np.testing.assert_allclose(balance(result), balance(result)[0], rtol=0, atol=1e-11)
    with pytest.raises(SceneError, match=r'joints.two follows "one" in .*: give that'):
        impactfem.plan(scene(tmp_path, text, joints={"two": {"velocity": 1.0}}))


@pytest.mark.parametrize("formula", ["0.3*sin(8*t)", "max(0, 2*(t - 0.1))"])
def test_a_formula_drives_a_joint(tmp_path, formula):
    kinked = "max" in formula
    place, rate, second = (
        (lambda t: max(0, 2 * (t - 0.1)), lambda t: 2.0 * (t > 0.1), lambda _: 0.0)
        if kinked
        else (lambda t: 0.3 * np.sin(8 * t), lambda t: 2.4 * np.cos(8 * t),
              lambda t: -19.2 * np.sin(8 * t))
    )  # fmt: skip

    def rates(t, y):
        a, v = y
        inertia, force = two_links(t, np.array([a, place(t), v, rate(t)]), lambda *_: [-0.2 * v, 0])
        return [v, (force[0] - inertia[0, 1] * second(t)) / inertia[0, 0]]

    y = [0.2, 0.0]
    for start, end in ((0, 0.1), (0.1, 0.4)):
        if kinked and start:  # what its motor does on the way is an impulse
            inertia, _ = two_links(0, np.array([y[0], 0.0, y[1], 0.0]), lambda *_: [0, 0])
            y = [y[0], y[1] - 2 * inertia[0, 1] / inertia[0, 0]]
        y = solve_ivp(rates, (start + 1e-13, end), y, rtol=1e-11, atol=1e-12).y[:, -1]
    result = impactfem.solve(
        scene(
            tmp_path,
            TWO.format(""),
            joints={"one": {"position": 0.2}, "two": {"position": formula}},
        )
    )
    h = result.history
    np.testing.assert_allclose(ends(result, "arm.one.q", "arm.one.v"), y, rtol=0, atol=1e-4)
    np.testing.assert_allclose(h["arm.two.q"], [place(t) for t in h["time"]], rtol=0, atol=1e-13)
    assert ends(result, "arm.two.v") == pytest.approx(rate(0.4), abs=1e-12)
    np.testing.assert_allclose(balance(result), balance(result)[0], rtol=0, atol=1e-11)
    assert not h["arm.two.lost"].any()


def test_a_driven_joint_and_one_that_mimics_restart_to_the_last_bit(tmp_path, monkeypatch):
    text = TWO.format("").replace(
        "</robot>",
        LINK.format("hand", 0.1, 0.2, i=0.01)
        + JOINT.format("three", "continuous", "lower", "hand", 0.5, '<mimic joint="one"/>')
        + "</robot>",
    )
    more = {"duration": 0.1, "output": {"checkpoint": 20}}
    made = scene(tmp_path, text, joints={"two": {"position": "0.3*sin(8*t)"}}, more=more)
    check_restart(made, 60, tmp_path, monkeypatch)


def test_a_spherical_joint_is_a_ball_of_mjcf(tmp_path):
    body = 'mass="1" diaginertia="0.01 0.02 0.015" pos="0.3 0.1 0"'
    mjcf = f'<mujoco><worldbody><body name="b"><inertial {body}/><joint type="ball"/></body></worldbody></mujoco>'  # noqa: E501
    urdf = (
        '<robot name="r"><link name="w"/><link name="b"><inertial><origin xyz="0.3 0.1 0"/>'
        '<mass value="1"/><inertia ixx="0.01" iyy="0.02" izz="0.015" ixy="0" ixz="0" iyz="0"/>'
        '</inertial></link><joint name="j" type="spherical"><parent link="w"/><child link="b"/>'
        "</joint></robot>"
    )
    found = []
    for text, file in ((mjcf, "b.xml"), (urdf, "b.urdf")):
        h = impactfem.solve(scene(tmp_path, text, file)).history
        found.append(ends(impactfem.solve(scene(tmp_path, text, file)), "arm.x", "arm.y", "arm.z"))
        np.testing.assert_allclose(h["total_energy"], h["total_energy"][0], atol=1e-11)
    np.testing.assert_allclose(*found, rtol=0, atol=1e-11)


def test_several_joints_of_a_body_of_mjcf_keep_their_names(tmp_path):
    body = '<inertial mass="1" diaginertia="0.01 0.02 0.015" pos="0.3 0.1 0"/>'
    first, second = (f'<joint name="{n}" type="{k}" axis="{a}"/>'
                     for n, k, a in (("a", "hinge", "1 0 0"), ("b", "slide", "0 1 0")))  # fmt: skip
    none = '<inertial mass="0" pos="0 0 0" diaginertia="0 0 0"/>'
    wrap = "<mujoco><worldbody>{}</worldbody></mujoco>"
    texts = [
        wrap.format(f'<body name="w">{first}{second}{body}</body>'),
        wrap.format(f'<body name="v">{first}{none}<body name="w">{second}{body}</body></body>'),
    ]
    names = "arm.a.q", "arm.a.v", "arm.b.q", "arm.b.v"
    one, other = (
        ends(
            impactfem.solve(scene(tmp_path, text, f"{k}.xml", joints={"a": {"velocity": 2.0}})),
            *names,
        )
        for k, text in enumerate(texts)
    )
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)
    assert abs(other[2]) > 0.1


def test_a_robot_of_one_link_is_a_rigid_body(tmp_path):
    text = '<robot name="r"><link name="b"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>'  # noqa: E501
    result = impactfem.solve(scene(tmp_path, text, velocity=[1.0, 0.0, 0.0]))
    np.testing.assert_allclose(ends(result, "arm.x", "arm.y"), [0.4, -0.5 * G * 0.16], atol=1e-12)


def test_what_is_left_out_is_listed_or_refused(tmp_path):
    text = TWO.format('<limit effort="1"/>').replace("</robot>", "<transmission/></robot>")
    joints = {"two": {"motor": "-q"}}
    robot = scene(tmp_path, text, joints=joints)
    said = [each.text for each in impactfem.plan(robot).findings if each.code == "robot_file"]
    left = [
        "arm: limits of effort do nothing: write them into motor",
        "arm: transmissions of the file",
    ]
    assert said == left
    told = impactfem.solve(robot).summary["verdict"]["findings"]
    assert [each["text"] for each in told if each["code"] == "robot_file"] == left
    with pytest.raises(SceneError, match=r"limits of effort .*remove strict = true"):
        impactfem.plan(scene(tmp_path, text, joints=joints, strict=True))


CUBE = (
    "".join(f"v {x} {y} {z}\n" for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1))
    + "f 1 2 4\nf 1 4 3\nf 5 7 8\nf 5 8 6\nf 1 5 6\nf 1 6 2\n"
    + "f 3 4 8\nf 3 8 7\nf 1 3 7\nf 1 7 5\nf 2 6 8\nf 2 8 4\n"
)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("package://arm_description/meshes/box.obj", None),
        ("../meshes/box.obj", None),
        ("package://arm_description/../secret/box.obj", "outside the folder"),
        ("package://arm_description/meshes/link.obj", "outside the folder"),
        ("package://other/meshes/box.obj", "outside the folder|which does not exist"),
        ("http://somewhere/box.obj", "only ROS knows"),
    ],
)
def test_packages_are_looked_for_in_the_folders_of_the_file(tmp_path, given, said):
    for name in ("arm_description/urdf", "arm_description/meshes", "secret"):
        (tmp_path / name).mkdir(parents=True)
    for name in ("arm_description/meshes/box.obj", "secret/box.obj"):
        (tmp_path / name).write_text(CUBE)
    (tmp_path / "arm_description/package.xml").write_text("<package/>")
    (tmp_path / "arm_description/meshes/link.obj").symlink_to(tmp_path / "secret/box.obj")
    shape = f'<collision><geometry><mesh filename="{given}"/></geometry></collision></link>'
    text = TWO.format("").replace("</inertial></link>", "</inertial>" + shape, 1)
    robot = scene(tmp_path / "arm_description/urdf", text)
    if said is None:
        impactfem.plan(robot)
        return
    with pytest.raises(SceneError, match=said):
        impactfem.plan(robot)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<robot>", '<!DOCTYPE r [<!ENTITY a "aaaa">]><robot>', "declares a document type"),
        ("<robot>", "<robot>" + "<link>" * 600 + "</link>" * 600, "deeper than 500"),
        ("<mimic", '<mimic joint="no"/><not', 'no other joint for "two" to mimic, "no"'),
        ('joint="one"', 'joint="two"', 'for "two" to mimic, "two"'),
        ('type="continuous"><parent link="base"', 'type="planar"><parent link="base"',
         "is no joint of one degree of freedom"),
    ],
)  # fmt: skip
def test_hostile_and_contradictory_files_are_refused(tmp_path, old, new, said):
    text = TWO.format('<mimic joint="one"/>').replace(old, new, 1)
    with pytest.raises(SceneError, match=said):
        impactfem.plan(scene(tmp_path, text))


@pytest.mark.parametrize(
    ("joint", "said"),
    [
        ({"position": "t", "velocity": 1.0}, "velocity = 1.0, but the formula of position drives"),
        ({"position": "where(t < 0.1, 0, 1)"}, "jumps from 0 to 1"),
        ({"position": "1/(0.1 - t)"}, "position"),
        ({"control": 1.0}, "has no actuator of this joint"),
        ({"control": 1.0, "motor": 1.0}, "motor replaces it"),
        ({"position": "q"}, "position"),
    ],
)
def test_keys_of_joints_that_contradict_are_refused(tmp_path, joint, said):
    with pytest.raises(SceneError, match=said):
        impactfem.plan(scene(tmp_path, TWO.format(""), joints={"two": joint}))


@pytest.mark.parametrize("angle", ["radian", "degree"])
def test_slides_end_at_metres(tmp_path, angle):
    """MuJoCo's degrees are of joints that turn only; also where a class gives the range."""
    text = f"""<mujoco><compiler angle="{angle}"/>
      <default><default class="far"><joint range="-3 2.5" limited="true"/></default></default>
      <worldbody><body name="cart"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      <joint class="far" name="slider" type="slide" axis="1 0 0"/>
      <body name="pole"><inertial pos="0 0 -0.5" mass="0.4" diaginertia="0.03 0.03 0.01"/>
      <joint name="free" type="slide" axis="0 1 0"/></body></body></worldbody></mujoco>"""
    made = scene(tmp_path, text, "cart.xml")
    tree = read_mechanism(made.bodies[0], made.folder).tree
    assert [ends.tolist() for ends in tree.limits()] == [[-3.0, -np.inf], [2.5, np.inf]]
