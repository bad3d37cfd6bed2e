"""Joints between rigid bodies: what they hold, what acts in them, and what contact sees of them."""

import numpy as np
import pytest
from moving_scenes import alone, differences, stopping
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

from impactfem import Contact, HalfSpace, Joint, Output, RigidBody, Scene, Solve, solve
from impactfem.errors import SceneError
from impactfem.planning import plan
from impactfem.shapes import Block, Capsule, Disc

FAR = HalfSpace(name="far", point=[-100.0, 0.0], normal=[1.0, 0.0])
KINDS = {
    "ball": {}, "universal": {"axis": [1.0, 0.0, 0.0]}, "revolute": {"axis": [0.0, 0.0, 1.0]},
    "cylindrical": {"axis": [0.0, 1.0, 1.0]}, "planar": {"axis": [0.0, 1.0, 1.0]},
    "prismatic": {"axis": [0.0, 1.0, 1.0]}, "fixed": {},
}  # fmt: skip


def disc(name, x, y, **more):
    shape = Disc(radius=0.05, center=[x, y])
    return RigidBody(**{"name": name, "shape": shape, "mass": 1.0, **more})


def rod(name, one, two, mass=1.0, **more):
    one, two = np.array(one, float), np.array(two, float)
    length = float(np.linalg.norm(two - one))
    middle, axis = (0.5 * (one + two)).tolist(), ((two - one) / length).tolist()
    shape = Capsule(radius=0.02, length=length, center=middle, axis=axis)
    return RigidBody(name=name, shape=shape, mass=mass, **more)


def run(bodies, joints, duration, dt, gravity=(0.0, -9.81), obstacles=(), contacts=()):
    if not contacts:  # bodies then meet nothing
        far = FAR if len(gravity) == 2 else HalfSpace(
            name="far", point=[-100.0, 0.0, 0.0], normal=[1.0, 0.0, 0.0]
        )  # fmt: skip
        obstacles, contacts = (far,), (Contact(between=[bodies[0].name, "far"]),)
    scene = Scene(
        title="joints", duration=duration, gravity=list(gravity), bodies=bodies, joints=joints,
        obstacles=obstacles, contacts=contacts, solve=Solve(dt=dt, estimate=False),
        output=Output(fields=[]),
    )  # fmt: skip
    return solve(scene).history


def drift(values):
    return np.abs(values - values[0]).max()


def pendulum(dt, **joint):
    """From 1 rad, as good as a point: periods are those of a point to 1e-9."""
    bob = disc("bob", np.sin(1.0), -np.cos(1.0), inertia=1e-9)
    pin = Joint(name="pin", kind="revolute", between=["ground", "bob"], point=[0.0, 0.0], **joint)
    return run([bob], [pin], 2.2, dt)


def test_pendulum_has_its_period_to_second_order_and_keeps_energy():
    exact = 4.0 * ellipk(np.sin(0.5) ** 2) / np.sqrt(9.81)
    errors = []
    for dt in (0.01, 0.005):
        history = pendulum(dt)
        rate, time = history["pin.v"].values, history["time"].values
        k = int(np.flatnonzero((rate[1:-1] > 0.0) & (rate[2:] <= 0.0))[0]) + 1
        errors.append(time[k] + rate[k] * dt / (rate[k] - rate[k + 1]) - exact)
        assert drift(history["total_energy"].values) < 1e-13
        # The angle told is that of the body, not the sum of its spins.
        assert np.abs(history["bob.angle"].values - history["pin.q"].values).max() < 1e-13
        reach = np.hypot(history["bob.x"].values, history["bob.y"].values)
        assert np.abs(reach - 1.0).max() < 1e-15
        # The pull of the pin by hand: weight along the string and the centripetal force.
        angle, middle = 1.0 + history["pin.q"].values, slice(1, None)
        pull = np.cos(angle) * 9.81 + rate**2
        assert history["pin.force"].values[middle] == pytest.approx(
            pull[middle], abs=0.4 * dt * 100
        )
    assert errors[0] == pytest.approx(2.1e-4, rel=0.02)
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.02)


@pytest.mark.parametrize("kind", ["revolute", "distance"])
def test_double_pendulum_to_second_order(kind):
    """Both angles from the vertical (2, 1) at rest, m = l = 1, 2 s."""
    first = np.array([np.sin(2.0), -np.cos(2.0)])
    second = first + np.array([np.sin(1.0), -np.cos(1.0)])
    bodies = [disc("a", *first, inertia=1e-9), disc("b", *second, inertia=1e-9)]
    ends = ([0.0, 0.0], first.tolist(), second.tolist())
    joints = [
        Joint(
            name=f"joint{k}", kind=kind, between=between,
            **({"point": ends[k]} if kind == "revolute" else {"points": [ends[k], ends[k + 1]]}),
        )
        for k, between in enumerate((["ground", "a"], ["a", "b"]))
    ]  # fmt: skip
    errors = []
    for dt in (0.005, 0.0025):
        history = run(bodies, joints, 2.0, dt)
        x1, y1, x2, y2 = (history[name].values[-1] for name in ("a.x", "a.y", "b.x", "b.y"))
        angles = np.array([np.arctan2(x1, -y1), np.arctan2(x2 - x1, y1 - y2)])
        errors.append(angles - [-0.64373045, -1.76608996])
        assert drift(history["total_energy"].values) < 1e-12
    assert errors[0] == pytest.approx(4.0 * errors[1], rel=0.01)
    assert errors[0] == pytest.approx([4.5e-4, -1.17e-3], rel=0.02)


@pytest.mark.parametrize("kind", KINDS)
def test_free_chains_keep_energy_and_momenta(kind):
    """Three rods that turn as one at t = 0, and no longer do where a joint lets them."""
    spin = np.array([0.3, 1.0, 2.0])
    ends = {"a": ([0, 0, 0], [1, 0, 0]), "b": ([1, 0, 0], [1, 1, 0]), "c": ([1, 1, 0], [1, 1, 1])}
    bodies = [
        rod(
            name, *both, angular_velocity=spin.tolist(),
            velocity=np.cross(spin, np.mean(both, axis=0)).tolist(),
        )
        for name, both in ends.items()
    ]  # fmt: skip
    joints = [
        Joint(name="one", kind=kind, between=["a", "b"], point=[1.0, 0.0, 0.0], **KINDS[kind]),
        Joint(name="two", kind="ball", between=["b", "c"], point=[1.0, 1.0, 0.0]),
    ]
    history = run(bodies, joints, 1.0, 0.01, gravity=(0.0, 0.0, 0.0))
    assert drift(history["total_energy"].values) < 1e-13
    for axis in "xyz":
        assert drift(history[f"angular_momentum.{axis}"].values) < 2e-13
        assert drift(history[f"momentum.{axis}"].values) < 1e-13
    turned = [history[f"{name}.{part}"].values for name in "ab" for part in ("wx", "wy", "wz")]
    parted = max(np.abs(a - b).max() for a, b in zip(turned[:3], turned[3:], strict=True))
    assert (parted < 1e-10) == (kind in {"fixed", "prismatic"})


def four_bar(spin):
    """Crank 1, coupler 3.5, rocker 2 on a ground of 4, in space: its bars, joints and geometry."""
    crank = np.array([np.cos(1.0), np.sin(1.0)])

    def knee(crank):
        way = np.array([4.0, 0.0]) - crank
        far = np.linalg.norm(way)
        along = (3.5**2 - 2.0**2 + far**2) / (2.0 * far)
        across = np.array([-way[1], way[0]]) / far
        return crank + along * way / far + np.sqrt(3.5**2 - along**2) * across

    def rocker(angle):
        x, y = knee(np.array([np.cos(angle), np.sin(angle)])) - [4.0, 0.0]
        return np.arctan2(y, x)

    tip, hinge = knee(crank), np.array([4.0, 0.0])
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    moved = spin * turn @ crank
    coupler, rocking = np.linalg.solve(
        np.column_stack([turn @ (tip - crank), -turn @ (tip - hinge)]), -moved
    )

    def bar(name, one, two, mass, rate, speed):
        velocity = [*(speed + rate * turn @ (two - one) / 2.0), 0.0]
        return rod(
            name, [*one, 0.0], [*two, 0.0], mass, velocity=velocity,
            angular_velocity=[0.0, 0.0, rate],
        )  # fmt: skip

    still = np.zeros(2)
    bodies = [
        bar("crank", still, crank, 1.0, spin, still),
        bar("coupler", crank, tip, 2.0, coupler, moved),
        bar("rocker", hinge, tip, 1.5, rocking, still),
    ]
    pins = (
        ("ground", "crank", still), ("crank", "coupler", crank), ("coupler", "rocker", tip),
        ("ground", "rocker", hinge),
    )  # fmt: skip
    joints = [
        Joint(
            name=f"pin{k}", kind="revolute", between=[one, two], point=[*at, 0.0],
            axis=[0.0, 0.0, 1.0],
        )
        for k, (one, two, at) in enumerate(pins)
    ]  # fmt: skip
    return bodies, joints, rocker


def test_four_bar_in_space_follows_its_geometry_though_three_equations_are_too_many():
    bodies, joints, rocker = four_bar(6.0)
    history = run(bodies, joints, 3.0, 0.01, gravity=(0.0, -9.81, 0.0))
    crank, angle = 1.0 + history["pin0.q"].values, rocker(1.0) + history["pin3.q"].values
    assert np.abs([rocker(each) for each in crank] - angle).max() < 1e-13
    assert drift(history["total_energy"].values) < 1e-11
    assert np.abs(history["coupler.z"].values).max() < 1e-13
    assert crank[-1] - crank[0] > 2.0 * np.pi
    # Limits of the rocker: crank and coupler in line; told by a parabola through the extreme steps.
    for extreme, reach in ((angle.min(), 4.5), (angle.max(), 2.5)):
        cosine = (4.0**2 + 2.0**2 - reach**2) / (2.0 * 4.0 * 2.0)
        assert extreme == pytest.approx(np.pi - np.arccos(cosine), abs=2e-4)


def test_redundant_equations_are_told():
    bodies, joints, _ = four_bar(0.0)
    scene = Scene(
        title="four-bar", duration=1.0, gravity=[0.0, 0.0, 0.0], bodies=bodies, joints=joints,
        obstacles=[HalfSpace(name="far", point=[-100.0, 0.0, 0.0], normal=[1.0, 0.0, 0.0])],
        contacts=[Contact(between=["crank", "far"])],
    )  # fmt: skip
    found = plan(scene)
    told = next(each for each in found.findings if each.code == "overconstrained")
    assert (told.value, told.severity) == (3.0, "note")
    assert "4 joints that leave 1 degree of freedom" in found.model


SLIDER = {"kind": "prismatic", "between": ["ground", "a"], "point": [0.0, 0.0], "axis": [1.0, 0.0]}


def slider(duration=2.0, gravity=(0.0, -9.81), dt=0.005, speed=1.0, **joint):
    return run(
        [disc("a", 0.0, 0.0, velocity=[speed, 0.0])], [Joint(name="rail", **SLIDER, **joint)],
        duration, dt, gravity,
    )  # fmt: skip


@pytest.mark.parametrize("law", [{"stiffness": 4.0, "damping": 0.5}, {"motor": "-4*q - 0.5*v"}])
def test_spring_and_damper_or_the_same_by_a_motor(law):
    history = slider(**law)
    time, rate = history["time"].values, np.sqrt(4.0 - 0.0625)
    exact = np.exp(-0.25 * time) * np.sin(rate * time) / rate
    assert np.abs(history["rail.q"].values - exact).max() < 1e-5


def test_spring_keeps_energy():
    history = slider(stiffness=4.0, rest=0.1)
    assert drift(history["total_energy"].values) < 1e-14
    assert history["elastic_energy"].values[0] == pytest.approx(0.02)


def test_joint_friction_stops_and_holds():
    history = slider(friction=2.0, duration=1.0)
    assert history["rail.q"].values[-1] == pytest.approx(0.25, abs=1e-12)  # v^2 / (2 f)
    assert history["rail.v"].values[-1] == pytest.approx(0.0, abs=1e-12)
    for most, moved in ((4.9, 0.0025), (4.91, 0.0)):  # pulled with 4.905 N
        pulled = slider(friction=most, duration=1.0, gravity=(4.905, -9.81), speed=0.0)
        assert pulled["rail.q"].values[-1] == pytest.approx(moved, abs=1e-12)


@pytest.mark.parametrize(
    ("force", "speed", "steps"), [(1.5, 1.0, 30), (3.0, 0.7, 30), (8.0, 2.0, 60)]
)
def test_joint_friction_stops_just_at_the_end_of_a_step(force, speed, steps):
    stop = speed / force
    history = slider(friction=force, speed=speed, duration=1.2 * stop, dt=stop / steps)
    assert history["time"].values[-1] == pytest.approx(1.2 * stop)  # it settled
    assert history["rail.q"].values[-1] == pytest.approx(0.5 * speed * stop, abs=1e-12)


def test_limits_turn_rates_and_hold():
    history = slider(limits=[-0.1, 0.3], restitution=0.5)
    rates = history["rail.v"].values
    assert set(np.round(rates, 12)) == {1.0, -0.5, 0.25}
    way = history["rail.q"].values
    assert way.min() > -0.1 - 0.005
    assert way.max() < 0.3 + 0.005
    rope = Joint(
        name="rope", kind="distance", between=["ground", "a"], points=[[0.0, 1.0], [0.0, 0.0]],
        limits=[0.0, 1.5],
    )  # fmt: skip
    hung = run([disc("a", 0.0, 0.0)], [rope], 1.0, 0.005)
    assert hung["rope.q"].values.max() < 1.5 + 0.016
    assert hung["rope.force"].values[-1] == pytest.approx(9.81, rel=1e-9)
    assert hung["rope.force"].values[10] == 0.0


def test_gear_hands_on_torque():
    bodies = [disc("a", 0.0, 0.0, inertia=0.01), disc("b", 0.3, 0.0, inertia=0.002)]
    joints = [
        Joint(name="p", kind="revolute", between=["ground", "a"], point=[0.0, 0.0], motor=0.01),
        Joint(name="q", kind="revolute", between=["ground", "b"], point=[0.3, 0.0]),
        Joint(name="mesh", kind="gear", joints=["p", "q"], ratio=-2.0),
    ]
    history = run(bodies, joints, 1.0, 0.01)
    assert history["p.v"].values[-1] == pytest.approx(0.01 / (0.01 + 4.0 * 0.002), rel=1e-5)
    assert history["q.q"].values == pytest.approx(-2.0 * history["p.q"].values, abs=1e-14)
    assert history["mesh.force"].values[-1] == pytest.approx(-2.0 * 0.002 * 0.01 / 0.018, rel=1e-4)
    assert drift(history["total_energy"].values) < 1e-15


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_hinged_rod_strikes_a_floor(restitution):
    """Its rate turns to -e of that before, and it stays on its hinge."""
    bar = RigidBody(name="bar", shape=Block(size=[1.0, 0.02], corner=[0.0, 0.49]), mass=3.0)
    pin = Joint(name="pin", kind="revolute", between=["ground", "bar"], point=[0.0, 0.5])
    floor = HalfSpace(name="floor", point=[0.0, 0.0], normal=[0.0, 1.0])
    history = run(
        [bar], [pin], 0.45, 0.001, obstacles=[floor],
        contacts=[Contact(between=["bar", "floor"], restitution=restitution)],
    )  # fmt: skip
    rate = history["pin.v"].values
    k = int(np.argmax(np.diff(rate)))
    # Gravity acts within the step too.
    assert -rate[k + 1] / rate[k] == pytest.approx(restitution, abs=1.2e-3)
    reach = np.hypot(history["bar.x"].values, history["bar.y"].values - 0.5)
    assert np.abs(reach - 0.5).max() < 1e-15


def test_struck_chain_takes_what_lagrange_says():
    """Two hinged rods: the impulse at a corner, by mass and rows of both as one system."""
    bars = [
        RigidBody(
            name=name, shape=Block(size=[1.0, 0.02], corner=[x, 0.49]), mass=2.0,
            velocity=[0.0, -1.0],
        )
        for name, x in (("a", 0.0), ("b", 1.0))
    ]  # fmt: skip
    bump = HalfSpace(name="floor", point=[2.0, 0.4899], normal=[-0.05, 1.0])
    knee = Joint(name="knee", kind="revolute", between=["a", "b"], point=[1.0, 0.5])
    history = run(
        bars, [knee], 0.002, 0.001, gravity=(0.0, 0.0), obstacles=[bump],
        contacts=[Contact(between=["b", "floor"]), Contact(between=["a", "floor"])],
    )  # fmt: skip
    mass = np.diag([2.0, 2.0, 2.0 * (1.0 + 0.02**2) / 12.0] * 2)
    rows = np.array([[-1.0, 0, 0, 1.0, 0, 0], [0, -1.0, -0.5, 0, 1.0, -0.5]])
    normal = np.array([-0.05, 1.0]) / np.hypot(0.05, 1.0)
    arm = np.array([0.5, -0.01])
    struck = np.array([0, 0, 0, *normal, arm[0] * normal[1] - arm[1] * normal[0]])
    start = np.array([0.0, -1.0, 0.0, 0.0, -1.0, 0.0])
    together = np.vstack([rows, struck])
    system = np.block([[mass, -together.T], [together, np.zeros((3, 3))]])
    after = np.linalg.solve(system, [*(mass @ start), 0.0, 0.0, 0.0])
    found = [history[f"{n}.{c}"].values[-1] for n in "ab" for c in ("vx", "vy", "spin")]
    assert found == pytest.approx(after[:6], abs=2e-3)
    assert history["impulse.b.floor"].values.sum() == pytest.approx(after[8], rel=2e-3)


def linkage():
    """A hinged rod with spring, friction, stop and motor, on which another hangs and strikes."""
    return {
        "title": "linkage", "duration": 0.3, "gravity": [0.0, -9.81],
        "body": [
            {"kind": "rigid", "name": name, "mass": 1.0,
             "shape": {"kind": "block", "size": [1.0, 0.05], "corner": [x, -0.025]}}
            for name, x in (("upper", 0.0), ("lower", 1.0))
        ],
        "joint": [
            {"name": "hip", "kind": "revolute", "between": ["ground", "upper"], "point": [0.0, 0.0],
             "stiffness": 2.0, "friction": 0.3, "motor": "1 - 0.1*v", "limits": [-0.25, 1.0]},
            {"name": "knee", "kind": "revolute", "between": ["upper", "lower"],
             "point": [1.0, 0.0], "damping": 0.05},
        ],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, -0.3],
                      "normal": [0.1, 1.0]}],
        "contact": [{"between": ["lower", "floor"], "friction_coefficient": 0.4,
                     "restitution": 0.3}],
        "solve": {"dt": 2e-3, "estimate": False}, "output": {"checkpoint": 20},
    }  # fmt: skip


def test_energy_that_joints_take_is_told():
    result = solve(Scene.from_dict(linkage()))
    taken = result.summary["details"]["energy_taken"]
    lost = (
        result.history["dissipated_energy"].values[-1] + result.history["friction_work"].values[-1]
    )
    # Rates are projected after impacts: what is missing.
    assert taken["impacts"] + taken["joints"] == pytest.approx(lost, rel=0.02)
    assert taken["joints"] > 0.1
    assert result.history["hip.q"].values.min() == pytest.approx(-0.25, abs=0.01)
    assert result.history["impulse.lower.floor"].values.sum() > 0.0


@pytest.mark.parametrize("stop", [37, 121])
def test_a_restarted_linkage_is_equal_to_the_last_bit(tmp_path, monkeypatch, stop):
    scene = Scene.from_dict(linkage())
    whole = solve(scene)
    with stopping(monkeypatch, stop):
        solve(scene, checkpoints=tmp_path)
    again = solve(scene, checkpoints=tmp_path, restart=tmp_path)
    assert differences(whole, again) == {}


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    both = solve(Scene.from_dict(linkage()))
    with alone(monkeypatch):
        one = solve(Scene.from_dict(linkage()))
    for name in one.history.data_vars:
        np.testing.assert_allclose(
            both.history[name].values, one.history[name].values, rtol=1e-10, atol=1e-10
        )


def test_bodies_that_part_in_a_joint_are_refused_with_what_fits():
    pin = Joint(name="pin", kind="revolute", between=["ground", "a"], point=[0.0, 0.0])
    with pytest.raises(
        SceneError, match=r"pin.*a: velocity = \[0, 1.99\d*\], angular_velocity = 1.99"
    ):
        run([disc("a", 1.0, 0.0, velocity=[1.0, 2.0])], [pin], 1.0, 0.01)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"between": ["ground", "wheel"]}, r'joint\[0\].between .* no body "wheel"'),
        ({"between": ["a", "a"]}, "names one twice"),
        ({"kind": "ball"}, 'for bodies in space: give "revolute"'),
        ({"axis": [0.0, 1.0]}, "turns about the axis across it"),
        ({"limits": [0.5, 1.0]}, "leave out the coordinate 0 of t = 0"),
        ({"restitution": 0.5}, "that of limits"),
        ({"rest": 0.5}, "that of a spring"),
        ({"kind": "fixed", "stiffness": 1.0}, "no single coordinate"),
        ({"kind": "prismatic"}, "axis is missing"),
        ({"kind": "gear", "between": None, "joints": ["x", "y"], "ratio": 1.0}, "does not go with"),
        ({"motor": "2*z"}, "motor"),
        ({"points": [[0.0, 0.0], [1.0, 0.0]]}, "points .* does not go with"),
        ({"soft": {"erp": 2.0}}, "soft.erp"),
        ({"name": "a"}, "is the name of body a too"),
    ],
)
def test_bad_joints_are_refused(change, message):
    given = {"name": "pin", "kind": "revolute", "between": ["ground", "a"], "point": [0.0, 0.0]}
    body = {"kind": "rigid", "name": "a", "mass": 1.0}
    body["shape"] = {"kind": "disc", "radius": 0.1, "center": [1.0, 0.0]}
    data = {"title": "bad", "duration": 1.0, "body": [body], "joint": [given | change]}
    with pytest.raises(SceneError, match=message):
        Scene.from_dict(data)


def test_planar_and_universal_joints_hold_by_their_own_axes():
    """Odd axes: a planar joint lets gravity act in its plane, a universal one keeps its cross."""
    normal = np.array([2.0, -1.0, 2.0]) / 3.0
    spin, pull = 1.5 * normal, np.array([0.7, -9.81, 1.3])
    block = Block(size=[0.1, 0.2, 0.3], corner=[1.0, 2.0, 3.0])
    places = {"point": [1.05, 2.1, 3.15], "axis": normal.tolist()}  # the centre: only it is held
    body = RigidBody(name="body", shape=block, density=500.0, angular_velocity=spin.tolist())
    flat = Joint(name="flat", kind="planar", between=["ground", "body"], **places)
    history = run([body], [flat], 0.5, 0.005, gravity=pull)
    place = np.stack([history[f"body.{x}"].values for x in "xyz"], axis=-1)
    fall = 0.5 * history["time"].values[:, None] ** 2 * (pull - (pull @ normal) * normal)
    assert np.abs(place - place[0] - fall).max() < 1e-12
    turned = np.stack([history[f"body.w{x}"].values for x in "xyz"], axis=-1)
    # Its axis is not principal: the joint has to keep it there.
    assert np.abs(turned - spin).max() < 1e-11

    second = np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0)
    body = RigidBody(
        name="body", shape=block, density=500.0, angular_velocity=(spin + 2.0 * second).tolist()
    )
    cross = Joint(
        name="cross", kind="universal", between=["ground", "body"], second_axis=second.tolist(),
        **places,
    )  # fmt: skip
    history = run([body], [cross], 1.0, 0.005, gravity=pull)
    q = np.stack([history[f"body.q{x}"].values for x in "xyzw"], axis=-1)
    carried = Rotation.from_quat(q).apply(second)
    assert np.abs(carried @ normal).max() < 1e-12
    assert (carried @ second).min() < 0.9  # it did turn
    assert drift(history["total_energy"].values) < 1e-11
