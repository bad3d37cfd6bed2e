"""Mechanisms against closed forms: swinging, limits, friction, contact, free trees, restarts."""

from pathlib import Path

import numpy as np
import pytest
from moving_scenes import alone, check_restart

pytest.importorskip("pinocchio")

import impactfem
from impactfem import Scene
from impactfem.report.figures import draw_all

G = 9.81
POINT = '<inertial><origin xyz="{at}"/><mass value="{mass}"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'  # noqa: E501


def robot(*parts: str) -> str:
    return f'<robot name="r" version="1.2">{"".join(parts)}</robot>'


def link(
    name: str, *, at: str = "0 0 0", mass: float = 1.0, shape: str = "", place: str = ""
) -> str:
    touching = f'<collision><origin xyz="{place or at}"/><geometry>{shape}</geometry></collision>'
    return f'<link name="{name}">{POINT.format(at=at, mass=mass)}{touching * bool(shape)}</link>'


def joint(name: str, kind: str, parent: str, child: str, axis: str, more: str = "") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{more}</joint>'


BALL = '<sphere radius="0.1"/>'
SWING = robot(
    '<link name="base"/>', link("bob", at="0 0 -1", shape=BALL),
    joint("hinge", "continuous", "base", "bob", "0 1 0"),
)  # fmt: skip
DOUBLE = robot(
    '<link name="base"/>', link("one", at="0 0 -1"), link("two", at="0 0 -1"),
    joint("top", "continuous", "base", "one", "0 -1 0"),
    joint("knee", "continuous", "one", "two", "0 -1 0", '<origin xyz="0 0 -1"/>'),
)  # fmt: skip
WALL = {"kind": "half_space", "name": "wall", "point": [0.1, 0.0, 0.0], "normal": [-1.0, 0.0, 0.0]}


def slider(damping: float = 0.0, friction: float = 0.0) -> str:
    limit = '<limit lower="-1" upper="1" effort="9" velocity="9"/>'
    limit += f'<dynamics damping="{damping}" friction="{friction}"/>'
    return robot(
        '<link name="base"/>', link("car", mass=2.0, shape=BALL),
        joint("x", "prismatic", "base", "car", "1 0 0", limit),
    )  # fmt: skip


def scene(
    folder: Path, file: str, duration: float, dt: float, *, gravity: tuple = (0.0, 0.0, -G),
    joints: dict | None = None, obstacles: tuple = (), contacts: tuple = (), **more: object,
) -> Scene:  # fmt: skip
    (folder / "arm.urdf").write_text(file)
    body = {"kind": "mechanism", "name": "arm", "file": "arm.urdf", "joints": joints or {}} | more
    return Scene.from_dict(
        {
            "title": "mechanism", "duration": duration, "gravity": list(gravity), "body": [body],
            "obstacle": list(obstacles), "contact": list(contacts),
            "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
        },
        base=folder,
    )  # fmt: skip


def columns(made: Scene) -> dict[str, np.ndarray]:
    history = impactfem.solve(made).history
    return {name: history[name].values for name in history.data_vars} | {
        "time": history["time"].values
    }


def test_pendulum_has_its_period_to_second_order_and_keeps_energy(tmp_path):
    errors = []
    for dt in (1.6e-2, 8e-3):
        found = columns(scene(tmp_path, SWING, 2.4, dt, joints={"hinge": {"position": 1.0}}))
        rate, time = found["arm.hinge.v"], found["time"]
        last = np.flatnonzero((rate[1:-1] > 0.0) & (rate[2:] <= 0.0))[-1] + 1
        period = time[last] + dt * rate[last] / (rate[last] - rate[last + 1])
        errors.append(period - 2.1391376)
        energy = found["total_energy"]
        assert np.abs(energy - energy[0]).max() < 1e-12
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)
    assert abs(errors[1]) < 1e-4


def test_double_pendulum_is_of_second_order(tmp_path):
    exact = np.array([-0.64373045, -1.76608996, 2.54184381, 3.54561584])
    start = {"top": {"position": 2.0}, "knee": {"position": -1.0}}
    errors = []
    for dt in (8e-3, 4e-3):
        found = columns(scene(tmp_path, DOUBLE, 2.0, dt, joints=start))
        (one, two), (v1, v2) = (
            [found[f"arm.{name}.{letter}"][-1] for name in ("top", "knee")] for letter in "qv"
        )
        errors.append(np.array([one, one + two, v1, v1 + v2]) - exact)
        energy = found["total_energy"]
        assert np.abs(energy - energy[0]).max() < 1e-11
    ratio = np.linalg.norm(errors[0]) / np.linalg.norm(errors[1])
    assert ratio == pytest.approx(4.0, rel=0.02)
    assert np.abs(errors[1]).max() < 1e-3


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_limits_send_back_with_their_restitution(tmp_path, e):
    start = {"x": {"velocity": 3.0, "restitution": e}}
    made = scene(tmp_path, slider(), 0.6, 1e-3, gravity=(0.0, 0.0, 0.0), joints=start)
    found = columns(made)
    assert found["arm.x.v"][-1] == pytest.approx(-3.0 * e, abs=1e-14)
    assert found["arm.x.q"].max() < 1.0 + 0.0016
    assert found["arm.x.lost"][-1] == pytest.approx(9.0 * (1.0 - e**2), abs=1e-12)


def test_joints_locked_by_equal_limits_hold_a_load_at_rest(tmp_path):
    """The rates are 0, and change by the rounding of the moments that hold the load: by a few units
    of rounding of what they would be without limits."""

    def run(kind: str, limit: str) -> dict:
        made = robot(
            '<link name="base"/>', link("one", at="0 0 0.05", mass=0.2),
            link("two", at="0 0 0.1", mass=0.3),
            joint("a", kind, "base", "one", "1 0 0", limit),
            joint("b", kind, "one", "two", "1 0 0", f'<origin xyz="0 0 0.1"/>{limit}'),
        )  # fmt: skip
        return columns(scene(tmp_path, made, 0.01, 1e-3, gravity=(0.0, -G, 0.0)))

    found = run("revolute", '<limit lower="0" upper="0" effort="0" velocity="0"/>')
    fallen = np.abs(run("continuous", "")["arm.a.q"]).max()
    assert 1e-3 < fallen < 1e-2
    for name in "ab":
        assert np.abs(found[f"arm.{name}.q"]).max() < 1e-15 * fallen
    assert np.abs(found["arm.a.lost"]).max() < 1e-17


def test_damping_friction_and_motors_follow_their_laws(tmp_path):
    def run(file: str, start: dict, pull: float = 0.0, duration: float = 1.0) -> dict:
        joints = {"x": start} if start else {}
        made = scene(tmp_path, file, duration, 2e-3, gravity=(pull, 0.0, 0.0), joints=joints)
        return columns(made)

    damped = run(slider(damping=3.0), {"velocity": 0.5})
    assert damped["arm.x.v"][-1] == pytest.approx(0.5 * np.exp(-1.5), abs=1e-6)
    rubbed = run(slider(friction=4.0), {"velocity": 1.0})
    assert rubbed["arm.x.v"][125] == pytest.approx(0.5, abs=1e-12)
    assert rubbed["arm.x.q"][-1] == pytest.approx(0.25, abs=1e-12)
    assert rubbed["arm.x.lost"][-1] == pytest.approx(1.0, abs=1e-12)
    assert not run(slider(friction=4.0), {}, pull=1.99, duration=0.1)["arm.x.q"].any()
    slides = run(slider(friction=4.0), {}, pull=2.5, duration=0.5)
    assert slides["arm.x.v"][-1] == pytest.approx(0.25, abs=1e-12)
    driven = run(slider(), {"position": 0.5, "motor": "-200*q - 4*v"})
    w = np.sqrt(99.0)
    assert driven["arm.x.q"][-1] == pytest.approx(
        0.5 * np.exp(-1.0) * (np.cos(w) + np.sin(w) / w), abs=1e-4
    )
    balance = driven["total_energy"]
    assert np.abs(balance - balance[0]).max() < 1e-12  # the motor's work is told
    # Far stiffer than steps follow: it settles all the same.
    assert abs(run(slider(), {"position": 0.5, "motor": "-2e8*q - 4e6*v"})["arm.x.q"][-1]) < 1e-5


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_pendulum_strikes_a_wall(tmp_path, e):
    contacts = ({"between": ["arm/bob", "wall"], "restitution": e, "name": "hit"},)
    start = {"hinge": {"position": 1.0}}
    found = columns(scene(tmp_path, SWING, 0.56, 1e-3, joints=start, obstacles=(WALL,),
                          contacts=contacts))  # fmt: skip
    struck = int(np.flatnonzero(found["contact_impulse"] > 0.0)[0])
    before, after = found["arm.hinge.v"][struck - 1 : struck + 1]
    assert before == pytest.approx(-np.sqrt(2.0 * G * (1.0 - np.cos(1.0))), rel=1e-5)
    assert after == pytest.approx(-e * before, abs=3e-5)
    assert found["contact_impulse"][struck] == pytest.approx((1.0 + e) * -before, rel=3e-5)


def test_contact_and_limit_share_a_load(tmp_path):
    # The limit at 1 lets the car not reach a wall behind it; a wall before it carries all.
    for place, q, force in ((1.15, 1.0, 0.0), (1.0, 0.9, 6.0)):
        wall = WALL | {"point": [place, 0.0, 0.0]}
        found = columns(scene(tmp_path, slider(), 1.5, 5e-3, gravity=(3.0, 0.0, 0.0),
                              obstacles=(wall,)))  # fmt: skip
        assert found["arm.x.q"][-1] == pytest.approx(q, abs=0.01)
        assert found["arm.x.v"][-1] == pytest.approx(0.0, abs=1e-12)
        assert found["force.arm.wall"][-1] == pytest.approx(force, abs=1e-9)


@pytest.mark.parametrize("held", ['lower="0" upper="1"', 'lower="-1" upper="1"'])
def test_a_joint_that_a_wall_pushes_holds_by_its_limit_or_friction(tmp_path, held):
    # A slanted wall turns 3 N up into 3 N back, against 1 N, and the limit or friction of 4 N.
    friction = 0.0 if 'lower="0"' in held else 4.0
    made = '<limit {} effort="9" velocity="9"/><dynamics damping="0" friction="{}"/>'
    file = robot(
        '<link name="base"/>', link("cart", mass=2.0), link("rod", shape=BALL),
        joint("x", "prismatic", "base", "cart", "1 0 0", made.format(held, friction)),
        joint("z", "prismatic", "cart", "rod", "0 0 1",
              made.format('lower="-1" upper="1"', 0.0)),
    )  # fmt: skip
    wall = WALL | {"point": [0.1 / np.sqrt(2.0), 0.0, 0.1 / np.sqrt(2.0)],
                   "normal": [-1.0, 0.0, -1.0]}  # fmt: skip
    start = {"x": {"motor": "1"}, "z": {"motor": "3"}}
    found = columns(scene(tmp_path, file, 0.5, 5e-3, gravity=(0.0, 0.0, 0.0), joints=start,
                          obstacles=(wall,)))  # fmt: skip
    assert found["force.arm.wall"][-50:] == pytest.approx(3.0 * np.sqrt(2.0), abs=1e-9)
    assert abs(found["arm.x.q"][-1]) < 1e-3
    assert abs(found["arm.z.q"][-1]) < 1e-3
    assert abs(found["arm.z.v"][-1]) < 1e-9


def test_free_ball_rolls_as_the_rigid_one_does(tmp_path):
    a = np.radians(20.0)
    ball = '<link name="b"><inertial><mass value="1"/><inertia ixx="0.004" iyy="0.004" izz="0.004" '
    ball += (
        f'ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry>{BALL}</geometry></collision>'
    )
    ball += "</link>"
    floor = {"kind": "half_space", "name": "floor", "point": [0.0] * 3, "normal": [0.0, 0.0, 1.0]}
    for mu, pull in ((0.2, 5.0 / 7.0 * np.sin(a)), (0.05, np.sin(a) - 0.05 * np.cos(a))):
        law = ({"between": ["arm", "floor"], "friction_coefficient": mu},)
        made = scene(
            tmp_path, robot(ball), 0.5, 5e-3, gravity=(G * np.sin(a), 0.0, -G * np.cos(a)),
            base="free", position=[0.0, 0.0, 0.1], obstacles=(floor,), contacts=law,
        )  # fmt: skip
        found = columns(made)
        assert found["arm.vx"][-1] == pytest.approx(0.5 * G * pull, abs=1e-12)
        assert found["arm.z"][-1] == pytest.approx(0.1, abs=1e-14)
        assert found["force.arm.floor"][-1] == pytest.approx(G * np.cos(a), abs=1e-11)


def test_free_chain_keeps_energy_momentum_and_angular_momentum(tmp_path):
    inertia = '<inertial><origin xyz="0.1 0 -0.5"/><mass value="1"/><inertia ixx="0.09" iyy="0.08" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>'  # noqa: E501
    links = [f'<link name="l{k}">{inertia}</link>' for k in range(3)]
    hinges = [
        joint(f"j{k}", "continuous", f"l{k - 1}", f"l{k}", axis, '<origin xyz="0 0 -1"/>')
        for k, axis in ((1, "1 0 0"), (2, "0 1 0"))
    ]
    start = {"j1": {"velocity": 3.0}, "j2": {"velocity": -5.0, "position": 1.0}}
    made = scene(tmp_path, robot(*links, *hinges), 1.0, 4e-3, gravity=(0.0, 0.0, 0.0), base="free",
                 joints=start, orientation={"axis": [1.0, 2.0, 0.0], "angle": 0.7})  # fmt: skip
    found = columns(made)
    energy = found["total_energy"]
    assert np.abs(energy - energy[0]).max() < 1e-12 * energy[0]
    for name in ("momentum", "angular_momentum"):
        whole = np.stack([found[f"{name}.{axis}"] for axis in "xyz"])
        assert np.linalg.norm(whole[:, 0]) > 1.0
        assert np.abs(whole - whole[:, :1]).max() < 2e-12
    assert np.ptp(found["arm.j2.v"]) > 1.0


FALLING = """<mujoco model="tree"><compiler angle="radian"/><worldbody><body name="a" pos="0 0 1">
<freejoint/><geom type="capsule" size="0.05 0.3" mass="1"/><body name="b" pos="0.2 0 -0.3">
<joint name="ball" type="ball"/><geom type="box" size="0.1 0.15 0.2" pos="0.1 0 -0.2" mass="2"/>
<body name="c" pos="0.2 0 -0.3"><joint name="hinge" type="hinge" axis="1 1 0"/>
<geom type="sphere" size="0.1" pos="0.1 0 -0.2" mass="2"/></body></body></body>
</worldbody></mujoco>"""


def test_a_tree_from_mjcf_with_a_ball_joint_falls_and_tumbles(tmp_path):
    (tmp_path / "tree.xml").write_text(FALLING)
    tree = {"kind": "mechanism", "name": "arm", "file": "tree.xml",
            "orientation": {"axis": [1.0, 0.0, 0.0], "angle": 0.4},
            "joints": {"hinge": {"velocity": 4.0}}}  # fmt: skip
    data = scene(tmp_path, SWING, 1.0, 4e-3, gravity=(0.0, 0.0, -1.0)).to_dict() | {"body": [tree]}
    made = Scene.from_dict(data, base=tmp_path)
    found = columns(made)
    assert found["time"][-1] == 1.0  # small inertia of a spin beside large ones: it still settles
    energy = found["total_energy"]
    assert np.abs(energy - energy[0]).max() < 1e-12
    falls = found["momentum.z"] - found["momentum.z"][0]
    assert falls == pytest.approx(-5.0 * found["time"], abs=1e-12)
    assert np.ptp(found["momentum.x"]) < 1e-12
    assert np.ptp(found["arm.hinge.v"]) > 1.0


def test_links_without_shapes_have_motions_and_no_pictures_of_shapes(tmp_path):
    """Pictures of no cells failed: "not drawn: body.png (ValueError: zero-size array ..."."""
    made = scene(tmp_path, DOUBLE, 0.04, 1e-2, joints={"top": {"position": 1.0}})
    result = impactfem.solve(made.with_settings({"output.fields": ["vtkhdf"]}))
    assert result.fields is None
    assert "motion" in draw_all(result)


def striking(folder: Path) -> Scene:
    law = ({"between": ["arm/bob", "wall"], "restitution": 0.3, "friction_coefficient": 0.2},)
    made = scene(folder, SWING, 0.6, 4e-3, joints={"hinge": {"position": 1.0}},
                 obstacles=(WALL,), contacts=law)  # fmt: skip
    return made.with_settings({"output.checkpoint": 50})


@pytest.mark.parallel([1, 2])
def test_restart_goes_on_to_the_last_bit(tmp_path, monkeypatch):
    made = striking(tmp_path)
    whole, _ = check_restart(made, 140, tmp_path, monkeypatch)
    assert whole.summary["contact"]["impulse"] > 0.0


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(tmp_path, monkeypatch):
    made = striking(tmp_path)
    both = impactfem.solve(made)
    with alone(monkeypatch):
        one = impactfem.solve(made)
    for name in one.history.data_vars:
        np.testing.assert_allclose(
            both.history[name].values, one.history[name].values, rtol=1e-10, atol=1e-10
        )


def test_a_free_base_is_thrown_and_spins_as_a_rigid_body_does(tmp_path):
    """The link's frame is not its centre: the top's spin turns the centre about it."""
    moments = 'ixx="1" iyy="2" izz="3" ixy="0" ixz="0" iyz="0"'
    top = '<link name="top"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>'
    top += f"<inertia {moments}/></inertial></link>"
    spin = {"velocity": [1.0, 2.0, 3.0], "angular_velocity": [0.3, 1.0, -0.2]}
    turned = {"orientation": {"axis": [0.0, 0.0, 1.0], "angle": 0.5}}
    made = scene(tmp_path, robot(top), 5.0, 5e-3, gravity=(0.0, 0.0, 0.0), base="free",
                 **spin, **turned)  # fmt: skip
    found = columns(made)
    arm = 0.1 * np.array([np.cos(0.5), np.sin(0.5), 0.0])
    speed = np.array(spin["velocity"]) + np.cross(spin["angular_velocity"], arm)
    body = {"kind": "rigid", "name": "arm", "mass": 2.0, "inertia": [1.0, 2.0, 3.0],
            "shape": {"kind": "sphere", "radius": 0.1, "center": arm.tolist()},
            "velocity": speed.tolist(), "angular_velocity": spin["angular_velocity"],
            **turned}  # fmt: skip
    rigid = columns(Scene.from_dict(made.to_dict() | {"body": [body]}))
    for own in ("qw", "qx", "qy", "qz", "wx", "wy", "wz"):
        assert found[f"arm.root_joint.{own}"] == pytest.approx(rigid[f"arm.{own}"], abs=2e-4)
    for axis in "xyz":
        assert found[f"arm.{axis}"] == pytest.approx(rigid[f"arm.{axis}"], abs=1e-6)  # dt^2
    assert np.abs(found["arm.root_joint.wy"] - 1.0).max() > 0.1
