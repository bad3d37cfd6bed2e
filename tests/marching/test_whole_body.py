"""Whole-body controllers: computed torque, forces that stand, pushes, limits; and refused."""

from types import SimpleNamespace

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene, SceneError
from impactfem.runs.least_tasks import Sample, _minimum, import_clarabel
from impactfem.runs.whole_body import WholeBody
from impactfem.scene.controllers import Foot

pytest.importorskip("pinocchio")
pytest.importorskip("clarabel")

G, MASS = 9.81, 12.0
INERTIAL = '<inertial><origin xyz="{at}"/><mass value="{mass}"/><inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>'  # noqa: E501
LIMIT = '<limit lower="-99" upper="99" effort="999" velocity="999"/>'


def link(name, mass=0.0, at="0 0 0", i=0.0, ball=""):
    touching = (
        f'<collision><origin xyz="{at}"/><geometry><sphere radius="{ball}"/></geometry></collision>'
    )
    own = INERTIAL.format(at=at, mass=mass, i=i) if mass else ""
    return f'<link name="{name}">{own}{touching if ball else ""}</link>'


def joint(name, kind, parent, child, axis, at="0 0 0"):
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
    ends += f'<axis xyz="{axis}"/>' if axis else ""
    return f'<joint name="{name}" type="{kind}">{ends}{LIMIT if axis else ""}</joint>'


ARM = "".join((
    link("base"), link("upper", 2.0, "0.2 0 0.1", 0.02), link("lower", 1.0, "0 0.1 -0.3", 0.01),
    joint("shoulder", "revolute", "base", "upper", "0 1 0"),
    joint("elbow", "revolute", "upper", "lower", "0 0.6 0.8", "0 0 -0.5"),
))  # fmt: skip
# In the plane x, z on two feet, whose legs turn at a hip and slide.
BIPED = "".join((
    link("world"), link("along"), link("above"), link("top", 10.0, "0 0 0.1", 0.5),
    joint("x", "prismatic", "world", "along", "1 0 0"),
    joint("z", "prismatic", "along", "above", "0 0 1"),
    joint("pitch", "revolute", "above", "top", "0 1 0"),
    *(part for side, at in (("left", -0.5), ("right", 0.5)) for part in (
        link(f"{side}_thigh"), link(side, 1.0, i=0.01, ball="0.02"),
        joint(f"{side}_hip", "revolute", "top", f"{side}_thigh", "0 1 0", f"{at} 0 0"),
        joint(f"{side}_leg", "prismatic", f"{side}_thigh", side, "0 0 -1", "0 0 -0.5"),
    )),
))  # fmt: skip
LEGS = [f"{side}_{part}" for side in ("left", "right") for part in ("hip", "leg")]
STAND = [
    {"of": of, "target": target, "kp": 400.0, "kd": 40.0, "weight": weight}
    for of, target, weight in (("centre.x", 0.0, 1.0), ("centre.z", 0.52, 1e6), ("pitch", 0, 1e6))
]
FEET = [{"link": side, "friction": 0.5, "radius": 0.02} for side in ("left", "right")]


def scene(folder, file, joints, *, duration=0.3, dt=2e-3, feet=(), floor=False, **own):
    (folder / "r.urdf").write_text(f'<robot name="r">{file}</robot>')
    own = {"name": "whole", "kind": "whole_body", "acts": "body.r.motors"} | own
    own |= {"feet": list(feet)} if feet else {}
    return Scene.from_dict(
        {
            "title": "whole", "duration": duration, "gravity": [0.0, 0.0, -G],
            "body": [{"kind": "mechanism", "name": "r", "file": "r.urdf", "joints": joints}],
            "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0, 0.0],
                          "normal": [0.0, 0.0, 1.0]}] * floor,
            "contact": [{"between": ["r", "floor"], "friction_coefficient": 0.8,
                         "restitution": 0.0}] * floor,
            "controller": [own], "solve": {"dt": dt, "estimate": False},
            "output": {"fields": [], "checkpoint": 5},
        },
        base=folder,
    )  # fmt: skip


def arm(folder, elbow=None, **own):
    tasks = [{"of": "shoulder", "target": "sin(2*t)", "kp": 100.0, "kd": 20.0, "weight": 3.0},
             {"of": "elbow", "target": "0.5 + t**2", "kp": 50.0, "kd": 10.0}]  # fmt: skip
    joints = {"shoulder": {"position": 0.3}, "elbow": elbow or {"velocity": -1.0}}
    return scene(folder, ARM, joints, **{"motors": ["shoulder", "elbow"], "tasks": tasks} | own)


def biped(folder, vx=0.0, **own):
    joints = {"z": {"position": 0.52}, "x": {"velocity": vx}}
    joints |= {f"{side}_hip": {"velocity": vx / 0.52} for side in ("left", "right")}  # feet roll
    own = {"motors": LEGS, "tasks": STAND, "feet": FEET} | own
    return scene(folder, BIPED, joints, floor=True, **own)


@pytest.mark.parametrize("elbow", [None, {"motor": "-3*q - v"}, {"position": "0.4 - 2*t**2"}])
def test_an_arm_has_the_computed_torque(tmp_path, elbow):
    """M a + C v + g of Pinocchio's recursion, with a of each joint's own law or course."""
    import pinocchio as pin

    driven = elbow and "position" in elbow
    made = arm(tmp_path, elbow, **({"motors": ["shoulder"]} if driven else {}))
    law = WholeBody.of(made, made.controllers[0], 2e-3)
    made.controllers[0].parts[-1].held.value = 7.0  # until now; what follows depends on no such
    model = pin.buildModelFromUrdf(str(tmp_path / "r.urdf"))
    chance = np.random.default_rng(4)
    for t in (0.0, 0.4, 1.3):
        q, v = chance.normal(size=2), chance.normal(size=2)
        asked = np.array([np.sin(2 * t), 0.5 + t**2])
        rate, second = np.array([2 * np.cos(2 * t), 2 * t]), np.array([-4 * np.sin(2 * t), 2.0])
        a = second + [100.0, 50.0] * (asked - q) + [20.0, 10.0] * (rate - v)
        a[1] = -4.0 if driven else a[1]
        exact = pin.rnea(model, model.createData(), q, v, a)
        exact[1] += 3.0 * q[1] + v[1] if elbow and not driven else 0.0
        found, _ = law.outputs(t, np.concatenate([q, v]))
        size = 1e-9 * abs(exact).max()
        np.testing.assert_allclose(list(found.values()), exact[: len(found)], atol=size)


def test_feet_that_roll_drift_as_their_rows_turn(tmp_path):
    """J' v by central differences of J along v."""
    foot = {"link": "lower", "friction": 0.5, "radius": 0.3, "normal": [1.0, 2.0, 2.0]}
    made = arm(tmp_path, feet=[foot])
    law = WholeBody.of(made, made.controllers[0], 2e-3)
    v, step = np.array([1.3, -0.7]), 1e-5

    def feet(shift):
        q = law.tree.neutral()
        for joint, value in zip(law.tree.single, np.array([0.4, 0.9]) + shift * v, strict=True):
            law.tree.put(q, joint, value)
        return law._feet(q, v, law.own.feet)

    turned = (feet(step)[0] - feet(-step)[0]) @ v / (2.0 * step)
    np.testing.assert_allclose(feet(0.0)[1], turned, atol=1e-7)


def pressed(kg=1.0, m=1.0, limits=(-np.inf, np.inf), wanted=(10.0, 0.0, 10.0), feet=1):
    """A body of 2 kg on legs of three slides, with a foot of 1 kg, in other units."""
    unit, g = np.eye(3), 9.81 * np.array([0.0, 0.0, 1.0])
    course = 0.5 * (np.array(wanted) - 3.0 * g)  # of the body, by a force that is wanted
    none = np.zeros((3, 3))
    return Sample(
        inertia=kg * np.block([[3.0 * unit, 2.0 * unit], [2.0 * unit, 2.0 * unit]]),
        bias=kg * m * np.concatenate([3.0 * g, 2.0 * g]), mass=3.0 * kg,
        rows=np.tile(np.hstack([unit, none]), (feet, 1)), calm=np.zeros(3 * feet),
        tasks=np.hstack([none, unit]), wanted=m * course, weights=np.ones(3),
        motors=[3, 4, 5], given={}, limits=tuple(kg * m * end for end in limits),
        feet=[Foot(link="foot", friction=0.5)] * feet,
    ).outputs() / (kg * m)  # fmt: skip


@pytest.mark.parametrize("units", [(1.0, 1.0), (1e3, 1e3), (1e-3, 1.0), (1e-9, 1e6), (1e7, 1e-5)])
def test_a_force_beyond_its_cone_is_the_nearest_in_it(units):
    """Of (10, 0, 10) and friction 0.5: (6, 0, 12), whose share of 1e-6 is to be least itself."""
    foot = [0.0, 0.0, 9.81]  # which its motors do not bear

    def borne(force, feet=1):
        return pytest.approx(np.array(force) / (1.0 + 2e-6 / 3.0 / feet) - foot, rel=1e-7, abs=1e-7)

    assert pressed(*units) == borne([6.0, 0.0, 12.0])
    assert pressed(*units, wanted=(8.0, -6.0, 10.0)) == borne([4.8, -3.6, 12.0])
    assert pressed(*units, wanted=(1.0, 2.0, 30.0)) == borne([1.0, 2.0, 30.0])
    # Two feet in one place say nothing that one does not.
    assert pressed(*units, wanted=(1.0, 2.0, 30.0), feet=2) == borne([1.0, 2.0, 30.0], 2)


def test_limits_are_met_and_wide_ones_change_nothing():
    """The output of a motor is at its limit, to the bit; far ones leave the answer as it is."""
    assert pressed(limits=(-5.0, 2.0), wanted=(1.0, 2.0, 30.0))[2] == 2.0
    plain = pressed()
    for wide in (1e2, 1e3, 1e4, 1e6, 1e12):
        assert pressed(limits=(-wide, wide)) == pytest.approx(plain, rel=1e-6, abs=1e-6)
    assert not len(pressed(limits=(-200.0, -50.0)))  # the foot would have to be pulled


@pytest.mark.parametrize(
    ("answer", "taken"),
    [((1.0, 1.0, 0.0), True), ((1.0, 1.1, 0.0), False), ((1.1, 0.9, 0.0), False),
     ((0.5, 1.5, 0.5), False)],
)  # fmt: skip
def test_answers_are_judged_whatever_the_solver_calls_them(monkeypatch, answer, taken):
    """Of the least (y - 1)^2 / 2 with y <= 2: slack, slope and complementarity all count."""
    clarabel = import_clarabel()
    x, s, z = ([each] for each in answer)
    said = SimpleNamespace(x=x, s=s, z=z, status="Solved")
    solver = SimpleNamespace(solve=lambda: said)
    monkeypatch.setattr(clarabel, "DefaultSolver", lambda *_: solver)
    one = np.ones((1, 1))
    found = _minimum((one, -one[0]), (one, 2.0 * one[0]), [clarabel.NonnegativeConeT(1)])
    assert (found is not None) == taken


def test_a_biped_stands_and_a_push_dies_out(tmp_path):
    """Feet bear its weight; at their cones they brake it by mu g, then as the law has it."""
    found = impactfem.solve(biped(tmp_path, vx=0.6))
    time, x, vx = (found.history[name].values for name in ("time", "r.x", "r.vx"))
    braked = (time > 0.01) & (time < 0.12)
    slope = np.polyfit(time[braked], vx[braked], 1)[0]
    assert slope == pytest.approx(-0.5 * G, rel=2e-3)
    (at,) = np.flatnonzero(np.isclose(time, 0.2))
    way = time[-1] - time[at]  # critically damped, 20/s
    free = (x[at] + (vx[at] + 20.0 * x[at]) * way) * np.exp(-20.0 * way)
    assert x[-1] == pytest.approx(free, rel=1e-2)
    assert found.history["force.r.floor"].values[-1] == pytest.approx(MASS * G, rel=1e-4)
    told = str(found.summary)
    assert "feet that stood, as it was told, moved by" in told
    assert "nothing fulfilled" not in told


def test_legs_that_are_too_weak_give_way(tmp_path):
    """With what their limits leave of the weight; what cannot be at all is told."""
    found = impactfem.solve(biped(tmp_path, limits=[-45.0, 45.0], duration=0.1))
    for side in ("left", "right"):
        np.testing.assert_array_equal(found.history[f"whole_{side}_leg.u"].values[1:], 45.0)
    assert found.history["r.vz"].values[-1] == pytest.approx(
        0.1 * (90.0 - 10.0 * G) / MASS, rel=1e-2
    )
    pulled = impactfem.solve(biped(tmp_path, limits=[-200.0, -50.0], duration=0.02))
    assert "nothing fulfilled dynamics" in str(pulled.summary)


def test_restart_is_equal_to_the_bit(tmp_path, monkeypatch):
    """It remembers nothing but its outputs."""
    check_restart(biped(tmp_path, duration=0.1), 20, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_ranks_agree(tmp_path, monkeypatch):
    """To 1e-10."""
    from impactfem.fem import MPI

    folder = MPI.COMM_WORLD.bcast(tmp_path, root=0)
    check_ranks(lambda: biped(folder, duration=0.05), monkeypatch)


@pytest.mark.parametrize(
    ("changed", "word"),
    [({"motors": ["sholder"]}, "motors"), ({"motors": None}, "motors"),
     ({"acts": "body.s.motors"}, 'acts = "body.s'),
     ({"acts": "body.r.joints.shoulder.motor"}, "acts"), ({"tasks": [{"of": "hand.w"}]}, "tasks"),
     ({"feet": [{"link": "toe", "friction": 0.5}]}, "feet"), ({"kp": 3.0}, "kp")],
)  # fmt: skip
def test_what_is_wrong_is_refused(tmp_path, changed, word):
    """By key, value and remedy."""
    with pytest.raises(SceneError, match=word) as told:
        impactfem.plan(arm(tmp_path, **changed))
    assert len(str(told.value)) < 700
