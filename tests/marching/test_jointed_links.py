"""Joints on links of mechanisms: motion by other models, energy, loops, contact, restarts."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from moving_scenes import alone, differences, stopping
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

pytest.importorskip("pinocchio")

import impactfem
from impactfem import Scene, SceneError
from impactfem.errors import ConvergenceError
from impactfem.scene.mechanism import Place
from impactfem.scene.rigid_keys import Orientation

G = 9.81


def link(name: str, along: float, mass: float, inertia: float, ball: str = "") -> str:
    """A link whose centre is on its first axis, with a ball at its end."""
    moments = " ".join(f'{n}="{inertia * (n[1] == n[2])}"' for n in
                       ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))  # fmt: skip
    inner = f'<origin xyz="{along} 0 0"/><mass value="{mass}"/><inertia {moments}/>'
    touching = f'<collision>{ball}<geometry><sphere radius="0.05"/></geometry></collision>'
    return f'<link name="{name}"><inertial>{inner}</inertial>{touching * bool(ball)}</link>'


def hinge(name: str, parent: str, child: str, at: float, limits: str = "") -> str:
    """One about -y, which takes x to z."""
    kind = "revolute" if limits else "continuous"
    ends = f'<parent link="{parent}"/><child link="{child}"/><axis xyz="0 -1 0"/>'
    place = f'<origin xyz="{at} 0 0"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{place}{limits}</joint>'


def scene(
    folder: Path, parts: list[str], angles: dict, bodies: list, joints: list, dt: float,
    duration: float, **more: object,
) -> Scene:  # fmt: skip
    file = f'<robot name="r" version="1.2"><link name="base"/>{"".join(parts)}</robot>'
    (folder / "arm.urdf").write_text(file)
    arm = {"kind": "mechanism", "name": "arm", "file": "arm.urdf"}
    arm["joints"] = {name: {"position": float(angle)} for name, angle in angles.items()}
    return Scene.from_dict(
        {
            "title": "links", "duration": duration, "gravity": [0.0, 0.0, -G],
            "body": [arm, *bodies], "joint": joints,
            "solve": {"dt": dt, "estimate": False}, "output": {"fields": [], "checkpoint": 20},
        } | more,
        base=folder,
    )  # fmt: skip


BOX = {"kind": "rigid", "name": "box", "mass": 1.5}
ROD = [link("one", 1.0, 1.0, 0.0), hinge("top", "base", "one", 0.0)]


def hung(folder: Path, dt: float, name: str = "arm/one", box: str = "box") -> Scene:
    """A box pinned to the end of a swinging link, beside its centre."""
    at = [np.sin(0.7), 0.0, -np.cos(0.7)]
    shape = {"kind": "block", "size": [0.3, 0.4, 0.2], "corner": [at[0] + 0.05, -0.2, at[2] - 0.1]}
    pin = {"name": "pin", "kind": "revolute", "between": [name, box], "point": at,
           "axis": [0.0, -1.0, 0.0]}  # fmt: skip
    return scene(folder, ROD, {"top": 0.7 - np.pi / 2}, [BOX | {"shape": shape}], [pin], dt, 1.0)


def test_a_body_on_a_link_moves_as_lagranges_equations_have_it(tmp_path):
    one, two, arm, inertia = 1.0, 1.5, 0.2, 1.5 / 12 * (0.3**2 + 0.2**2)

    def rates(_, y):
        a, b, w, u = y
        c, s = two * arm * np.cos(a - b), two * arm * np.sin(a - b)
        mass = [[one + two, c], [c, two * arm**2 + inertia]]
        force = [-s * u * u - (one + two) * G * np.sin(a), s * w * w - two * G * arm * np.sin(b)]
        return [w, u, *np.linalg.solve(mass, force)]

    a, b = solve_ivp(rates, (0, 1), [0.7, np.pi / 2, 0, 0], rtol=1e-11, atol=1e-12).y[:2, -1]
    errors = []
    for dt in (8e-3, 4e-3):
        h = impactfem.solve(hung(tmp_path, dt)).history
        angle = h["arm.top.q"].values
        errors.append(
            (angle[-1] + np.pi / 2 - a, h["pin.q"].values[-1] - (b - a - np.pi / 2 + 0.7))
        )
        assert np.ptp(h["total_energy"].values) < 1e-12
        apart = np.hypot(h["box.x"] - np.cos(angle), h["box.z"] - np.sin(angle)) - 0.2
        assert np.abs(apart.values).max() < 1e-14
    assert np.array(errors[0]) / errors[1] == pytest.approx(4.0, rel=0.02)
    assert np.abs(errors[1]).max() < 6e-4


def places() -> tuple[list[np.ndarray], np.ndarray]:
    """Ends of crank, coupler and rocker in the plane of x and z, and their angles."""
    first = 0.3 * np.array([np.cos(1.2), np.sin(1.2)])
    way = np.array([0.9, 0.0]) - first
    far = np.hypot(*way)
    second = np.arctan2(*way[::-1]) + np.arccos((far**2 + 0.8**2 - 0.6**2) / (1.6 * far))
    knee = first + 0.8 * np.array([np.cos(second), np.sin(second)])
    angles = np.array([1.2, second, np.arctan2(-knee[1], 0.9 - knee[0])])
    return [np.zeros(2), first, knee, np.array([0.9, 0.0])], angles


BARS = {"crank": (0.15, 0.5, 0.004), "coupler": (0.4, 1.0, 0.05), "rocker": (0.3, 0.8, 0.03)}
PIN = {"name": "pin", "kind": "revolute", "axis": [0.0, -1.0, 0.0], "point": [0.9, 0.0, 0.0]}


def four_bar(
    folder: Path, dt: float, duration: float = 0.5, limits: str = "", *, pin: dict | None = None,
    rates: tuple = (0.0, 0.0, 0.0), ball: str = "", **more: object,
) -> Scene:  # fmt: skip
    """A chain of three links whose last one is pinned to the ground: a loop."""
    parts = [link(name, *bar, ball * (name == "rocker")) for name, bar in BARS.items()]
    parts += [
        hinge("a", "base", "crank", 0.0, limits), hinge("b", "crank", "coupler", 0.3),
        hinge("c", "coupler", "rocker", 0.8),
    ]  # fmt: skip
    angles = np.diff(places()[1], prepend=0.0)
    closing = PIN | {"between": ["ground", "arm/rocker"]} | (pin or {})
    made = scene(folder, parts, dict(zip("abc", angles, strict=True)), [], [closing], dt, duration,
                 **more)  # fmt: skip
    arm = made.bodies[0]
    joints = {n: replace(arm.joints[n], velocity=v) for n, v in zip("abc", rates, strict=True)}
    return replace(made, bodies=[replace(arm, joints=joints)])


def bars(folder: Path, dt: float, duration: float, pin: dict) -> Scene:
    """The same of three rigid bodies and four joints."""
    ends, _ = places()
    bodies, joints = [], []
    for (name, (along, mass, inertia)), one, two in zip(BARS.items(), ends, ends[1:], strict=False):
        x, z = one + along * (two - one) / np.hypot(*(two - one))
        shape = {"kind": "sphere", "radius": 0.02, "center": [x, 0.0, z]}
        bodies.append({"kind": "rigid", "name": name, "mass": mass, "shape": shape,
                       "inertia": (inertia * np.eye(3)).tolist()})  # fmt: skip
    names = ["ground", *BARS, "ground"]
    for k, (x, z) in enumerate(ends):
        both = names[k : k + 2] if k < 3 else ["ground", "rocker"]
        joint = PIN | {"name": f"j{k}", "between": both, "point": [x, 0.0, z]}
        joints.append(joint | (pin | {"name": "pin"} if k == 3 else {}))
    return Scene.from_dict(
        {
            "title": "bars", "duration": duration, "gravity": [0.0, 0.0, -G], "body": bodies,
            "joint": joints, "contact": [{"between": ["crank", "rocker"]}],
            "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
        },
        base=folder,
    )  # fmt: skip


@pytest.mark.parametrize(
    "pin",
    [
        {"stiffness": 3.0, "damping": 0.2},
        {"motor": "2*cos(5*t) - 0.1*v"},
        {"friction": 0.3},
        {"limits": [-0.1, 0.2], "restitution": 1.0},
    ],
)
def test_a_loop_moves_as_the_same_linkage_of_rigid_bodies(tmp_path, pin):
    """Its closing joint with a spring, a motor, friction or limits."""
    errors = []
    for dt in (8e-3, 4e-3):
        one = impactfem.solve(four_bar(tmp_path, dt, 0.304, pin=pin)).history
        two = impactfem.solve(bars(tmp_path, dt, 0.304, pin)).history
        errors.append([np.abs(one[n] - two[n]).values.max() for n in ("pin.q", "pin.v")])
        np.testing.assert_allclose(one["pin.lost"], two["pin.lost"], atol=4.0 * dt**2)
    assert np.array(errors[0]) / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] < [2e-4, 2e-3]


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_a_loop_strikes_a_wall(tmp_path, restitution):
    ends, angles = places()
    at = ends[2][0] + 0.1 * np.cos(angles[2]) - 0.13
    wall = {
        "kind": "half_space",
        "name": "wall",
        "point": [at, 0.0, 0.0],
        "normal": [1.0, 0.0, 0.0],
    }
    made = four_bar(
        tmp_path, 4e-3, 0.56, ball='<origin xyz="0.1 0 0"/>', obstacle=[wall],
        contact=[{"between": ["arm/rocker", "wall"], "restitution": restitution}],
    )  # fmt: skip
    h = impactfem.solve(made).history
    rate, k = h["pin.v"].values, int(np.argmax(h["contact_impulse"].values > 0.0))
    # Gravity acts within the step.
    assert -rate[k] / rate[k - 1] == pytest.approx(restitution, abs=1e-2)
    assert np.diff(h["total_energy"].values).max() < 1e-12
    q = np.cumsum([h[f"arm.{name}.q"].values for name in "abc"], axis=0)
    end = np.array([0.3, 0.8, 0.6]) @ np.exp(1j * q)
    assert np.abs(end - 0.9).max() < 1e-13


def free(folder: Path, dt: float, duration: float) -> Scene:
    """A free chain in space that bears a box on a ball joint; all turn as one, but for a motor."""
    parts = [
        link("one", 0.2, 1.0, 0.02), link("two", 0.15, 0.5, 0.01), link("three", 0.2, 0.7, 0.02),
        hinge("a", "one", "two", 0.4).replace("0 -1 0", "0 0.6 0.8"),
        hinge("b", "two", "three", 0.3).replace("0 -1 0", "0.8 0 0.6"),
    ]  # fmt: skip
    (folder / "arm.urdf").write_text(f'<robot name="r">{"".join(parts)}</robot>')
    at, centre = np.array([0.1, 0.2, 0.3]), np.array([0.25, 0.5, 0.5])
    speed, spin = np.array([0.3, -0.2, 0.1]), np.array([1.0, 2.0, -1.5])
    arm = {
        "kind": "mechanism", "name": "arm", "file": "arm.urdf", "base": "free",
        "position": at.tolist(), "velocity": speed.tolist(), "angular_velocity": spin.tolist(),
        "joints": {"a": {"position": 0.5, "motor": "0.1*sin(3*t)"}, "b": {"position": -0.7}},
    }  # fmt: skip
    box = BOX | {
        "shape": {"kind": "block", "size": [0.3, 0.4, 0.2], "corner": [0.1, 0.3, 0.4]},
        "velocity": (speed + np.cross(spin, centre - at)).tolist(),
        "angular_velocity": spin.tolist(),
    }
    pin = {"kind": "ball", "between": ["arm/three", "box"], "point": [0.2, 0.4, 0.5]}
    return Scene.from_dict(
        {
            "title": "free", "duration": duration, "gravity": [0.0] * 3, "body": [arm, box],
            "joint": [pin], "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
        },
        base=folder,
    )  # fmt: skip


def test_a_free_chain_and_what_it_bears_keep_energy_and_momenta(tmp_path):
    h = impactfem.solve(free(tmp_path, 8e-3, 0.8)).history
    # The joints, which make up what energy lacks, begin at rest.
    assert np.ptp(h["total_energy"].values) < 1e-10
    for axis in "xyz":
        assert np.ptp(h[f"momentum.{axis}"].values) < 3e-12
        assert np.ptp(h[f"angular_momentum.{axis}"].values) < 3e-12


def test_a_loop_keeps_its_energy_and_closes(tmp_path):
    """The rate of the crank follows from energy and geometry alone."""
    h = impactfem.solve(four_bar(tmp_path, 4e-3)).history
    energy = h["total_energy"].values
    assert np.ptp(energy) < 1e-11 * h["kinetic_energy"].values.max()
    one = h["arm.a.q"].values
    two = one + h["arm.b.q"].values
    three = two + h["arm.c.q"].values
    for turn, end in ((np.cos, 0.9), (np.sin, 0.0)):
        across = 0.3 * turn(one) + 0.8 * turn(two) + 0.6 * turn(three) - end
        assert np.abs(across).max() < 5e-14
    w = np.cumsum([h[f"arm.{name}.v"].values for name in "abc"], axis=0)
    ends = [length * np.array([-np.sin(q), np.cos(q)]) * rate for length, q, rate in
            zip((0.3, 0.8, 0.6), (one, two, three), w, strict=True)]  # fmt: skip
    # Velocities of the pin: of second order in the step.
    assert np.abs(sum(ends)).max() < 2e-2 * np.abs(ends[0]).max()
    heights = [0.5 * ends[0], ends[0] + 0.5 * ends[1], ends[0] + ends[1] + 0.5 * ends[2]]
    kinetic = sum(
        0.5 * m * (v**2).sum(axis=0) + 0.5 * inertia * rate**2
        for m, inertia, v, rate in zip(
            (0.5, 1.0, 0.8), (0.004, 0.05, 0.03), heights, w, strict=True
        )
    )
    np.testing.assert_allclose(kinetic, h["kinetic_energy"].values, atol=1e-11)


def striking(folder: Path) -> Scene:
    """A link that bears a box, and a ball that strikes a wall, e = 0.5."""
    parts = [link("one", 1.0, 1.0, 0.0, '<origin xyz="1 0 0"/>'), ROD[1]]
    at = [np.sin(0.5), 0.0, -np.cos(0.5)]
    shape = {"kind": "sphere", "radius": 0.04, "center": [0.5 * at[0], 0.0, 0.5 * at[2]]}
    weld = {"name": "weld", "kind": "fixed", "between": ["arm/one", "box"], "point": at}
    wall = {"kind": "half_space", "name": "wall", "point": [-0.05, 0.0, 0.0],
            "normal": [1.0, 0.0, 0.0]}  # fmt: skip
    hits = {"between": ["arm/one", "wall"], "restitution": 0.5}
    far = {"between": ["box", "wall"]}
    return scene(
        folder, parts, {"top": 0.5 - np.pi / 2}, [BOX | {"shape": shape}], [weld], 4e-3, 0.6,
        obstacle=[wall], contact=[hits, far],
    )  # fmt: skip


def test_a_link_with_what_it_bears_strikes_a_wall(tmp_path, monkeypatch):
    made = striking(tmp_path)
    whole = impactfem.solve(made)
    h = whole.history
    rate, energy = h["arm.top.v"].values, h["total_energy"].values
    inertia = 1.0 + 1.5 * (0.5**2 + 0.4 * 0.04**2)
    speed = np.sqrt(2.0 * G * (1.0 + 0.75) * (1.0 - np.cos(0.5)) / inertia)
    assert rate.min() == pytest.approx(-speed, rel=5e-3)
    assert rate.max() == pytest.approx(0.5 * speed, rel=1e-2)
    taken = 0.5 * inertia * speed**2 * 0.75
    assert energy[0] - energy[-1] == pytest.approx(taken, rel=2e-2)
    assert np.diff(energy).max() < 1e-12
    apart = np.hypot(h["box.x"].values, h["box.z"].values)
    assert np.abs(apart - 0.5).max() < 1e-13
    with stopping(monkeypatch, 130):
        impactfem.solve(made, checkpoints=tmp_path)
    again = impactfem.solve(made, checkpoints=tmp_path, restart=tmp_path)
    assert differences(whole, again) == {}


def test_a_flat_loop_moves_alike_in_any_plane(tmp_path):
    """Three of its equations follow from others, but for rounding; `place` closes it."""
    turn = Rotation.from_euler("xyz", [0.3, 0.5, -1.1])
    parts = [link(name, *bar) for name, bar in BARS.items()]
    parts += [
        hinge("a", "base", "crank", 0.0), hinge("b", "crank", "coupler", 0.3),
        hinge("c", "coupler", "rocker", 0.8), '<link name="tip"/>',
        hinge("d", "rocker", "tip", 0.6).replace("continuous", "fixed"),
    ]  # fmt: skip
    found = []
    for way in (Rotation.identity(), turn):
        at, axis, pull = (
            way.apply(v).tolist() for v in ([0.9, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -G])
        )
        pin = {"kind": "revolute", "between": ["arm/tip", "ground"], "point": at, "axis": axis}
        made = scene(tmp_path, parts, {"a": 1.2, "b": -1.0, "c": -1.4}, [], [pin], 4e-3, 0.2,
                     gravity=pull)  # fmt: skip
        start = {"orientation": Orientation(quaternion=np.roll(way.as_quat(), 1).tolist()),
                 "place": Place(frame="tip", target=at)}  # fmt: skip
        found.append(impactfem.solve(replace(made, bodies=[replace(made.bodies[0], **start)])))
    one, two = (each.history for each in found)
    assert len(one.time) == len(two.time) == 51
    for name in ("arm.a.q", "joint.q", "joint.v"):
        np.testing.assert_allclose(one[name], two[name], rtol=1e-8, atol=1e-8)


def test_limits_of_a_mechanism_act_in_its_loop(tmp_path):
    limits = '<limit lower="0.9" upper="2.0" effort="9" velocity="9"/>'
    h = impactfem.solve(four_bar(tmp_path, 4e-3, 1.0, limits)).history
    assert np.diff(h["total_energy"].values).max() < 1e-10
    assert 0.85 < h["arm.a.q"].values.min() <= h["arm.a.q"].values.max() < 2.05
    ends = {name: h[f"arm.{name}.q"].values for name in "abc"}
    three = ends["a"] + ends["b"] + ends["c"]
    across = 0.3 * np.sin(ends["a"]) + 0.8 * np.sin(ends["a"] + ends["b"]) + 0.6 * np.sin(three)
    assert np.abs(across).max() < 1e-13


@pytest.mark.parametrize(
    ("name", "box", "said"),
    [
        ("arm", "box", 'give "arm/LINK"'),
        ("arm/won", "box", 'did you mean "one"'),
        ("arm/one", "box/left", 'as a whole: give "box"'),
        ("harm/one", "box", "there is no body"),
    ],
)
def test_bad_sides_are_refused(tmp_path, name, box, said):
    with pytest.raises(SceneError, match="between") as error:
        impactfem.solve(hung(tmp_path, 4e-3, name, box))
    assert said in str(error.value)


def test_a_single_free_link_is_refused(tmp_path):
    made = free(tmp_path, 8e-3, 0.1)
    (tmp_path / "arm.urdf").write_text(f'<robot name="r">{link("three", 0.2, 1.0, 0.02)}</robot>')
    with pytest.raises(SceneError, match='of kind "rigid"'):
        impactfem.plan(replace(made, bodies=[replace(made.bodies[0], joints={}), made.bodies[1]]))


def test_rates_that_open_a_loop_are_refused_with_those_that_close_it(tmp_path):
    with pytest.raises(SceneError, match=r"joint pin: its bodies part") as error:
        impactfem.plan(four_bar(tmp_path, 4e-3, rates=(2.0, 0.0, 0.0)))
    found = [float(x) for x in re.findall(r"joints\.[abc]\.velocity = ([-.\d]+)", str(error.value))]
    impactfem.plan(four_bar(tmp_path, 4e-3, rates=tuple(found)))


def test_a_loop_that_cannot_close_is_refused(tmp_path):
    (tmp_path / "arm.urdf").write_text(
        f'<robot name="r"><link name="base"/>{"".join(ROD)}{link("tip", 0.0, 0.1, 1e-4)}'
        f"{hinge('knee', 'one', 'tip', 1.0)}</robot>"
    )
    arm = {"kind": "mechanism", "name": "arm", "file": "arm.urdf",
           "place": {"frame": "tip", "target": [1.4, 0.0, 0.0]}}  # fmt: skip
    pin = {
        "name": "pin",
        "kind": "ball",
        "between": ["arm/tip", "ground"],
        "point": [1.4, 0.0, 0.0],
    }
    made = Scene.from_dict(
        {"title": "x", "duration": 0.1, "gravity": [0.0, 0.0, -G], "body": [arm], "joint": [pin]},
        base=tmp_path,
    )
    with pytest.raises(ConvergenceError, match="place"):
        impactfem.solve(made)


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
