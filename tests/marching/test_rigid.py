"""Rigid bodies: the free top, rolling, sliding, impacts with friction, against closed forms."""

import numpy as np
import pytest
from moving_scenes import alone, check_restart
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import impactfem
from impactfem import Contact, HalfSpace, Output, RigidBody, Scene, SceneError, Solve
from impactfem.marching.meshless import step_length
from impactfem.marching.turn_kernels import turn
from impactfem.obstacles import RigidSphere
from impactfem.shapes import Hull

G = 9.81
SPHERE = {"kind": "sphere", "radius": 0.1, "center": [0.0, 0.1, 0.0]}
ROLLER = {"kind": "cylinder", "radius": 0.1, "height": 0.3, "center": [0.0, -0.05, 0.0],
          "angle": np.pi / 2}  # fmt: skip
DISC = {"kind": "disc", "radius": 0.1, "center": [0.0, 0.1]}


def floor(dim, height=0.0):
    point, normal = np.zeros(dim), np.eye(dim)[1]
    point[1] = height
    return HalfSpace(name="floor", point=point.tolist(), normal=normal.tolist())


def run(body, duration, dt, gravity=None, obstacles=(), mu=0.0, e=0.0, **more):
    law = [
        Contact(between=[body.name, o.name], friction_coefficient=mu, restitution=e)
        for o in obstacles
    ]
    pulled = [0.0] * body.dim if gravity is None else list(gravity)
    scene = Scene(
        title="rigid", duration=duration, bodies=[body], obstacles=list(obstacles), contacts=law,
        gravity=pulled, solve=Solve(dt=dt, estimate=False), output=Output(fields=[]), **more,
    )  # fmt: skip
    return impactfem.solve(scene)


def column(result, *names):
    return np.stack([result.history[name].values for name in names], axis=1).squeeze()


def spin_along_the_body(result, name):
    quaternion = column(result, *(f"{name}.q{c}" for c in "wxyz"))
    spin = column(result, *(f"{name}.w{c}" for c in "xyz"))
    return Rotation.from_quat(np.roll(quaternion, -1, axis=1)).inv().apply(spin)


def test_the_free_top_tumbles_on_time_and_keeps_energy_and_momentum():
    exact = np.array([14.90593888, 42.43677944, 69.96761999])
    errors = []
    for dt in (0.2, 0.1):
        top = RigidBody(
            name="top", shape={"kind": "block", "size": [1.0, 1.0, 1.0]}, mass=1.0,
            inertia=[1.0, 2.0, 3.0], angular_velocity=[1e-3, 1.0, 1e-3],
        )  # fmt: skip
        result = run(top, 75.0, dt)
        time, spin = result.history["time"].values, spin_along_the_body(result, "top")
        errors.append(CubicSpline(time, spin[:, 1]).roots(extrapolate=False) - exact)
        energy = column(result, "kinetic_energy")
        momentum = column(result, *(f"angular_momentum.{axis}" for axis in "xyz"))
        assert np.ptp(energy) <= 1e-13 * energy[0]
        assert np.abs(momentum - momentum[0]).max() <= 1e-13 * np.linalg.norm(momentum[0])
    assert np.abs(errors[1]).max() < 0.08
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.01)


def test_small_turns_about_an_axis_are_exact_on_both_sides_of_their_series():
    inertia, dt = np.diag([1.0, 2.0, 3.0]), 0.5
    inverse, still = np.linalg.inv(inertia), np.zeros(3)
    for angle in (1e-9, 5e-5, 1.99e-4, 2.01e-4, 1e-2, 1.0):
        new, half, found = np.zeros(3), np.zeros(3), np.zeros((3, 3, 3))
        spin = np.array([0.0, 0.0, angle / dt])
        assert turn(inertia, inverse, np.eye(3), spin, still, dt, False, False, new, half, *found)
        assert np.arctan2(found[0][1, 0], found[0][0, 0]) == pytest.approx(
            angle, rel=4e-15, abs=0.0
        )
        assert new == pytest.approx(spin, rel=4e-15, abs=0.0)


@pytest.mark.parametrize(
    ("shape", "inertia", "share"), [(SPHERE, None, 5 / 7), (DISC, None, 2 / 3), (DISC, 0.01, 0.5)]
)
def test_what_slides_comes_to_roll(shape, inertia, share):
    dim, speed = len(shape["center"]), 3.0  # a roller's axis is x
    still = [0.0] * (dim - 2)
    body = RigidBody(
        name="b", shape=shape, mass=1.0, inertia=inertia, velocity=[speed, 0.0, *still]
    )
    result = run(body, 0.8, 4e-3, [0.0, -G, *still], [floor(dim)], 0.2)
    v, time = column(result, "b.vx"), result.history["time"].values
    turned = column(result, "b.spin" if dim == 2 else "b.wz")
    assert v[-1] == pytest.approx(share * speed, rel=1e-12)
    assert turned[-1] == pytest.approx(-share * speed / 0.1, rel=1e-12)
    rolls = (1.0 - share) * speed / (0.2 * G)
    assert time[np.argmax(v - v[-1] < 1e-9)] == pytest.approx(rolls, abs=4e-3)
    friction = result.summary["energy"]["taken"]["friction"]
    assert friction == pytest.approx(0.5 * speed**2 * (1.0 - share), rel=1e-10)
    assert abs(result.summary["energy"]["unexplained"]) < 1e-12


@pytest.mark.parametrize(("degrees", "mu"), [(20.0, 0.3), (20.0, 0.1041), (40.0, 0.1)])
def test_a_ball_rolls_down_or_slides(degrees, mu):
    slope = np.radians(degrees)
    gravity = [G * np.sin(slope), -G * np.cos(slope), 0.0]
    ball = RigidBody(name="b", shape=SPHERE, mass=2.0)
    result = run(ball, 0.2, 2e-3, gravity, [floor(3)], mu)
    rolling = mu >= 2 / 7 * np.tan(slope)
    pull = 5 / 7 * G * np.sin(slope) if rolling else G * (np.sin(slope) - mu * np.cos(slope))
    spin = pull if rolling else 2.5 * mu * G * np.cos(slope)
    assert column(result, "b.vx")[-1] == pytest.approx(0.2 * pull, rel=1e-10)
    assert -0.1 * column(result, "b.wz")[-1] == pytest.approx(0.2 * spin, rel=1e-10)


def test_a_marble_rolls_across_a_slope_by_many_turns_in_a_step():
    """At 100 turns in 20 steps, whose number its spin does not ask for; it moves by 5/7 of g."""
    spin = 2.0 * np.pi * 100.0 / 0.2
    gravity = [0.0, -G * np.cos(0.3), G * np.sin(0.3)]
    ball = RigidBody(name="b", shape=SPHERE, mass=2.0, velocity=[0.1 * spin, 0.0, 0.0],
                     angular_velocity=[0.0, 0.0, -spin])  # fmt: skip
    pull = 5 / 7 * G * np.sin(0.3)
    result = run(ball, 0.2, 1e-2, gravity, [floor(3)], 0.3)
    assert column(result, "b.vx")[-1] == pytest.approx(0.1 * spin, rel=1e-10)
    assert column(result, "b.vz")[-1] == pytest.approx(0.2 * pull, rel=1e-10)
    assert column(result, "b.z")[-1] == pytest.approx(0.5 * 0.04 * pull, rel=1e-10)
    assert column(result, "b.wx")[-1] == pytest.approx(2.0 * pull, rel=1e-10)
    assert abs(result.summary["energy"]["unexplained"]) < 1e-10
    scene = Scene(title="t", duration=0.2, gravity=gravity, bodies=[ball], obstacles=[floor(3)])
    assert impactfem.plan(scene).numbers.layers == 2000


def test_a_disc_counts_all_its_turns_in_long_steps():
    disc = RigidBody(name="b", shape={"kind": "disc", "radius": 0.1, "center": [0.0, 0.0]},
                     mass=1.0, angular_velocity=1e3)  # fmt: skip
    result = run(disc, 0.1, 1e-2)
    assert column(result, "b.angle")[-1] == pytest.approx(100.0, rel=1e-13)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_block_slides_down(dim):
    slope, more = np.radians(20.0), [0.0] * (dim - 2)
    shape = {"kind": "block", "size": [0.2, 0.1, 0.1][:dim], "corner": [-0.1, 0.0, *more]}
    block = RigidBody(name="b", shape=shape, density=1000.0)
    gravity = [G * np.sin(slope), -G * np.cos(slope), *more]
    result = run(block, 0.2, 2e-3, gravity, [floor(dim)], 0.3)
    assert column(result, "b.vx")[-1] == pytest.approx(0.2 * 0.5897022, rel=1e-7)
    assert np.ptp(column(result, "b.y")) < 1e-12


@pytest.mark.parametrize(
    ("mu", "impulse", "spin"), [(0.3, (0.1463415, 0.4878049), -1.4487066), (0.0, (0.0, 0.4), None)]
)
def test_the_impulses_of_a_dropped_rod(mu, impulse, spin):
    rod = RigidBody(
        name="b", shape=Hull(points=[[-0.5, 0.0], [0.5, 0.0], [0.0, 1e-3]]), mass=1.0,
        inertia=1 / 12, center_of_mass=[0.0, 0.0], angle=np.pi / 4, velocity=[0.0, -1.0],
    )  # fmt: skip
    result = run(rod, 2e-4, 1e-6, None, [floor(2, -np.sqrt(0.125) - 1e-4)], mu)
    assert column(result, "b.vx")[-1] == pytest.approx(impulse[0], rel=1e-6, abs=1e-12)
    assert column(result, "b.vy")[-1] + 1.0 == pytest.approx(impulse[1], rel=1e-6)
    if spin is not None:
        assert column(result, "b.spin")[-1] == pytest.approx(spin, rel=1e-6)


def test_a_roller_slides_until_it_rolls_on_both_rims():
    roller = RigidBody(name="b", shape=ROLLER, mass=1.0, velocity=[0.0, 0.0, 3.0])
    result = run(roller, 0.6, 4e-3, [0.0, -G, 0.0], [floor(3)], 0.2)
    assert column(result, "b.vz")[-1] == pytest.approx(2.0, rel=1e-12)
    assert column(result, "b.wx")[-1] == pytest.approx(20.0, rel=1e-12)
    assert np.ptp(column(result, "b.y")) < 1e-12
    assert result.summary["energy"]["taken"]["friction"] == pytest.approx(1.5, rel=1e-10)


def test_a_flat_cylinder_slides_on_its_rim():
    shape = {"kind": "cylinder", "radius": 0.1, "height": 0.05}
    result = run(
        RigidBody(name="b", shape=shape, mass=1.0, velocity=[1.0, 0.0, 0.0]),
        0.2, 4e-3, [0.0, -G, 0.0], [floor(3)], 0.2,
    )  # fmt: skip
    assert column(result, "b.vx")[-1] == pytest.approx(1.0 - 0.04 * G, rel=1e-9)
    assert np.ptp(column(result, "b.y")) < 1e-9


def test_a_tilted_coin_touches_with_the_lowest_place_of_its_rim():
    lean, shape = 0.3, {"kind": "cylinder", "radius": 0.1, "height": 0.02}
    coin = RigidBody(
        name="b", shape={**shape, "center": [0.0, 0.2, 0.0]}, mass=1.0,
        orientation={"axis": [1.0, 0.0, 0.0], "angle": lean}, angular_velocity=[0.0, 20.0, 0.0],
    )  # fmt: skip
    result = run(coin, 0.3, 1e-3, [0.0, -G, 0.0], [floor(3)], e=1.0)
    quaternion = column(result, *(f"b.q{c}" for c in "wxyz"))
    axis = Rotation.from_quat(np.roll(quaternion, -1, axis=1)).apply([0.0, 1.0, 0.0])[:, 1]
    low = column(result, "b.y") - 0.01 * np.abs(axis) - 0.1 * np.sqrt(1.0 - axis**2)
    np.testing.assert_allclose(column(result, "gap.b.floor"), low, atol=2e-5)
    assert result.summary["contact"]["impulse"] > 1.0
    energy = column(result, "total_energy")
    assert np.abs(energy - energy[0]).max() < 2e-3 * energy[0]


def test_a_rocking_block_loses_what_housner_says():
    """It turns about one corner until both lie on the floor: plastic, without slip."""
    lean, spin = 1e-4, -0.5
    size = 2.0 * np.array([np.sin(0.2), np.cos(0.2)])
    block = RigidBody(
        name="b", shape={"kind": "block", "size": size.tolist()}, mass=1.0, angle=lean,
    )  # fmt: skip
    arms = 0.5 * size * [[-1.0, -1.0], [1.0, -1.0]]
    turned = arms @ [[np.cos(lean), np.sin(lean)], [-np.sin(lean), np.cos(lean)]]
    low = turned[np.argmin(turned[:, 1])]
    velocity = spin * np.array([low[1], -low[0]])  # of the centre about the lower corner
    block = RigidBody(
        name="b", shape=block.shape, mass=1.0, angle=lean, velocity=velocity.tolist(),
        angular_velocity=spin,
    )  # fmt: skip
    height = float(block.center[1] + low[1])
    result = run(block, 3e-4, 2e-6, [0.0, -G], [floor(2, height)], 5.0)
    after = column(result, "b.spin")
    assert after[-1] / after[0] == pytest.approx(0.9407957, rel=2e-3)


def test_a_ball_rolls_in_a_hollow_sphere_and_keeps_its_energy():
    hollow = RigidSphere(name="bowl", center=[0.0, 0.0], radius=1.0, side="inside")
    where = 0.8 * np.array([np.sin(0.5), -np.cos(0.5)])
    ball = RigidBody(
        name="b", shape={"kind": "disc", "radius": 0.2, "center": where.tolist()}, mass=1.0
    )
    result = run(ball, 0.7, 2e-3, [0.0, -G], [hollow], 2.0)
    energy = column(result, "kinetic_energy")
    angle = np.arctan2(column(result, "b.x"), -column(result, "b.y"))
    # Rolling without slip: (3/2) (R - r) a'' = -g sin a; a quarter of the period by quadrature.
    lean = np.sin(0.25)
    a = (np.arange(2000) + 0.5) * np.pi / 4000
    quarter = np.sqrt(1.5 * 0.8 / G) * np.mean(1 / np.sqrt(1 - (lean * np.sin(a)) ** 2)) * np.pi / 2
    time = result.history["time"].values
    first = np.argmax(angle < 0.0)
    assert time[first] == pytest.approx(quarter, abs=4e-3)
    top = 0.8 * G * (1.0 - np.cos(0.5))
    assert energy.max() == pytest.approx(top, rel=1e-2)
    assert -0.2 * column(result, "b.spin")[first] == pytest.approx(
        column(result, "b.vx")[first], rel=2e-2
    )


def test_moments_and_forces_do_their_work():
    """A motor with damping: w = (m / d) (1 - exp(-d t / I)); a force along x accelerates."""
    disc = RigidBody(
        name="b", shape={"kind": "disc", "radius": 0.1}, mass=2.0, moment=["0.3 - 0.1*w"],
        force=["4*t", "0"],
    )  # fmt: skip
    result = run(disc, 1.0, 4e-3)
    inertia = 0.5 * 2.0 * 0.1**2
    assert column(result, "b.spin")[-1] == pytest.approx(3.0 * (1 - np.exp(-0.1 / inertia)), 1e-3)
    assert column(result, "b.vx")[-1] == pytest.approx(1.0, rel=1e-12)
    energy = column(result, "total_energy")
    assert np.ptp(energy) < 1e-12
    assert result.summary["bodies"]["b"]["inertia"] == pytest.approx(inertia)
    turned = column(result, "b.angle")
    assert result.summary["bodies"]["b"]["rotation_max"] == pytest.approx(turned[-1])


def tumbling():
    shape = {"kind": "block", "size": [0.2, 0.1, 0.15], "corner": [0.0, 0.05, 0.0]}
    return {
        "title": "tumbling", "duration": 0.08, "gravity": [0.0, -G, 0.0],
        "body": [
            {"kind": "rigid", "name": "b", "shape": shape, "density": 500.0,
             "orientation": {"axis": [1.0, 1.0, 0.0], "angle": 0.2},
             "velocity": [1.0, -1.0, 0.0], "angular_velocity": [1.0, 2.0, 3.0],
             "force": ["-0.2*vx", "0", "0"], "moment": ["0", "-0.01*wy", "0"]},
        ],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0, 0.0],
                      "normal": [0.0, 1.0, 0.0]}],
        "contact": [{"between": ["b", "floor"], "friction_coefficient": 0.4, "restitution": 0.2}],
        "probe": [{"name": "mark", "body": "b", "point": [0.1, 0.1, 0.07]}],
        "solve": {"dt": 1e-3, "estimate": False}, "output": {"checkpoint": 20},
    }  # fmt: skip


@pytest.mark.parallel([1, 2])
@pytest.mark.parametrize("shape", [None, {"kind": "cylinder", "radius": 0.08, "height": 0.1}])
def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch, shape):
    data = tumbling()
    if shape is not None:
        data["body"][0] |= {"shape": {**shape, "center": [0.1, 0.1, 0.07]}}
    scene = Scene.from_dict(data)
    whole, again = check_restart(scene, 67, tmp_path, monkeypatch)
    assert whole.summary["contact"]["impulse"] > 0.0
    assert again.summary["bodies"] == whole.summary["bodies"]


def test_probes_and_fields_move_as_the_body_does():
    result = impactfem.solve(Scene.from_dict(tumbling()))
    turn, start = (
        Rotation.from_quat(np.roll(column(result, *(f"b.q{c}" for c in "wxyz"))[row], -1))
        for row in (-1, 0)
    )
    centre = column(result, "b.x", "b.y", "b.z")
    arm = start.inv().apply([0.1, 0.1, 0.07] - centre[0])
    moved = centre[-1] + turn.apply(arm) - [0.1, 0.1, 0.07]
    np.testing.assert_allclose(
        column(result, "mark.ux", "mark.uy", "mark.uz")[-1], moved, atol=1e-12
    )
    fields = result.fields
    assert fields.layout.names == ("b",)
    places = fields.layout.points + fields.read(-1 % len(fields))["displacement"]
    apart = np.linalg.norm(places - centre[-1], axis=1)
    np.testing.assert_allclose(apart.max(), 0.5 * np.linalg.norm([0.2, 0.1, 0.15]), rtol=1e-12)


def test_orientations_in_the_plane_are_angles():
    def body(**more):
        return impactfem.RigidBody(
            shape={"kind": "block", "size": [0.2, 0.1], "corner": [0.0, 0.0]}, density=1.0, **more
        )

    half = 0.5 * 0.4
    for given in (
        {"angle": 0.4},
        {"axis": [0.0, 0.0, -2.0], "angle": -0.4},
        {"quaternion": [np.cos(half), 0.0, 0.0, np.sin(half)]},
    ):
        assert body(orientation=given).angle == pytest.approx(0.4, rel=1e-15)
        np.testing.assert_allclose(body(orientation=given).rotation, body(angle=0.4).rotation)
    with pytest.raises(SceneError, match="orientation turns the body out of its plane"):
        body(orientation={"axis": [1.0, 0.0, 0.0], "angle": 0.4})
    with pytest.raises(SceneError, match="orientation is given beside angle"):
        body(orientation={"angle": 0.4}, angle=0.2)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"orientation": {"quaternion": [0.0, 0.0, 0.0, 0.0]}}, "is no rotation: give [1.0,"),
        ({"orientation": {"quaternion": [1.0, 1.0, 0.0, 0.0]}}, "has length 1.41421, not 1: give"),
        ({"orientation": {"axis": [0.0, 0.0, 1.0]}}, "orientation.angle is missing: give axis and"),
        ({"orientation": {"angle": 0.2}}, "orientation.axis is missing: give axis and angle"),
        ({"density": None, "mass": 1.0, "inertia": [1.0, 1.0, 3.0]}, "has one above the sum"),
        ({"density": None, "mass": 1.0, "inertia": [1.0, -1.0, 1.0]}, "inertia = [1.0, -1.0, 1.0]"),
        ({"density": None, "mass": 1.0, "inertia": 2.0}, "does not fit 3 coordinates: give [Ixx"),
        ({"inertia": [1.0, 1.0, 1.0]}, "needs mass: give it instead of density"),
        ({"mass": 1.0}, "both are given; give density, or mass"),
        ({"density": None}, "neither is given; give density, or mass"),
        ({"center_of_mass": [0.0, 0.1, 0.0]}, "give inertia too"),
        ({"angle": 0.2}, "is for the plane: give orientation"),
        ({"model": "2d"}, 'the shape has 3 coordinates: give "3d"'),
        ({"velocity": [1.0, 0.0]}, "has 2 entries, the shape has 3: give 3"),
        ({"moment": ["w"]}, "has 1 entries: give 3"),
        ({"force": ["wx", "0", "0"]}, "wx"),
        ({"shape": {"kind": "hull", "points": [[0, 1, 0], [1, 1, 0], [0, 2, 0], [1, 2, 0]]}},
         "[1.0, 2.0, 0.0]] lie in one plane: give points that span a volume"),
        ({"shape": {"kind": "block", "size": [1.0, 1.0, 1.0], "symmetry": ["x"]}}, "body is whole"),
        ({"shape": {"kind": "block", "size": [0.2, 0.1, 0.1], "corner": [0.0, -0.2, 0.0]}},
         "m inside at t = 0; move it"),
    ],
)  # fmt: skip
def test_bad_input_is_told_with_key_and_remedy(change, said):
    data = tumbling()
    data["body"][0] |= change
    data["probe"] = []
    with pytest.raises(SceneError) as told:
        impactfem.solve(Scene.from_dict(data))
    assert said in str(told.value), told.value


def test_contacts_that_are_not_there_yet_are_refused():
    with pytest.raises(SceneError, match="needs friction_coefficient: without friction"):
        Contact(between=["a", "b"], tangential_restitution=1.0)
    edge = tumbling()
    step = {"kind": "polyline", "name": "step", "points": [[0, -3], [1, -3], [2, -2]]}
    edge["obstacle"].append(step)
    edge["contact"].append({"between": ["b", "step"]})
    with pytest.raises(SceneError, match="step may meet edges and faces of b, and is not convex"):
        Scene.from_dict(edge)


def test_a_body_that_turns_too_far_in_a_step_is_told():
    cube = {"kind": "block", "size": [0.1, 0.1, 0.1], "corner": [0.0, 0.0, 0.0]}
    top = RigidBody(name="b", shape=cube, mass=1.0, angular_velocity=[0.0, 3e3, 0.0])
    with pytest.raises(
        impactfem.errors.ConvergenceError, match="b turns too far in a step at t = "
    ):
        run(top, 0.1, 1e-3)


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    both = impactfem.solve(Scene.from_dict(tumbling()))
    with alone(monkeypatch):
        one = impactfem.solve(Scene.from_dict(tumbling()))
    for name in one.history.data_vars:
        np.testing.assert_allclose(
            both.history[name].values, one.history[name].values, rtol=1e-10, atol=1e-10
        )


def test_a_superball_bounces_between_floor_and_ceiling():
    """R. L. Garwin, Am. J. Phys. 37 (1969) 88-92: (v, Rw) -> (3 v - 4 Rw, -10 v - 3 Rw) / 7."""
    ball = RigidBody(
        name="b", shape={**SPHERE, "center": [0.0, 0.2, 0.0]}, mass=1.0, velocity=[1.0, -2.0, 0.0],
        angular_velocity=[0.0, 0.0, 5.0],
    )  # fmt: skip
    ceiling = HalfSpace(name="ceiling", point=[0.0, 0.5, 0.0], normal=[0.0, -1.0, 0.0])
    law = {"friction_coefficient": 100.0, "restitution": 1.0, "tangential_restitution": 1.0}
    scene = Scene(
        title="superball", duration=0.45, bodies=[ball], obstacles=[floor(3), ceiling],
        contacts=[Contact(between=["b", name], **law) for name in ("floor", "ceiling")],
        solve=Solve(dt=2e-3, estimate=False), output=Output(fields=[]),
    )  # fmt: skip
    result = impactfem.solve(scene)
    v, spun = column(result, "b.vx"), 0.1 * column(result, "b.wz")
    after = np.flatnonzero(np.abs(np.diff(v)) > 1e-9) + 1
    assert len(after) == 3
    speed, turning = 1.0, 0.5
    for row, side in zip(after, (1.0, -1.0, 1.0), strict=True):  # at a ceiling Rw counts backwards
        turning *= side
        speed, turning = (3 * speed - 4 * turning) / 7, (-10 * speed - 3 * turning) / 7
        turning *= side
        assert v[row] == pytest.approx(speed, rel=1e-12)
        assert spun[row] == pytest.approx(turning, rel=1e-12)
    energy = column(result, "kinetic_energy")
    assert np.ptp(energy) < 1e-12 * energy[0]


@pytest.mark.parametrize("mu", [0.1, 10.0])
def test_balls_that_strike_aslant_keep_their_momenta(mu):
    one = RigidBody(
        name="a", shape={"kind": "sphere", "radius": 0.1}, mass=1.0, velocity=[1.0, 0.3, 0.0],
        angular_velocity=[1.0, 2.0, 3.0],
    )  # fmt: skip
    two = RigidBody(
        name="b", shape={"kind": "sphere", "radius": 0.15, "center": [0.27, 0.1, 0.05]}, mass=2.0
    )
    law = Contact(between=["a", "b"], friction_coefficient=mu, restitution=0.5)
    scene = Scene(
        title="balls", duration=0.06, bodies=[one, two], contacts=[law],
        solve=Solve(dt=1e-4, estimate=False), output=Output(fields=[]),
    )  # fmt: skip
    result = impactfem.solve(scene)
    (hit,) = np.flatnonzero(column(result, "contact_impulse"))
    momentum = column(result, *(f"momentum.{axis}" for axis in "xyz"))
    spun = column(result, *(f"angular_momentum.{axis}" for axis in "xyz"))
    assert np.abs(momentum - momentum[0]).max() < 1e-13
    # Both sides are pushed where they touch: apart by what impacts that are not located leave.
    gap = np.abs(column(result, "gap.a.b")[hit - 1 : hit + 1]).max()
    assert np.abs(spun - spun[0]).max() <= gap * np.linalg.norm(momentum[0])

    def slips(row):
        place, speed, spin = (
            [column(result, *(f"{name}.{prefix}{axis}" for axis in "xyz"))[row] for name in "ab"]
            for prefix in ("", "v", "w")
        )
        normal = (place[0] - place[1]) / np.linalg.norm(place[0] - place[1])
        slip = speed[0] - speed[1] - np.cross(0.1 * spin[0] + 0.15 * spin[1], normal)
        return normal @ slip, slip - normal * (normal @ slip)

    (closing, rubbing), (opening, left) = slips(hit - 1), slips(hit)
    assert opening == pytest.approx(-0.5 * closing, rel=1e-3)
    # Effective masses: 2/3 along the normal, 2/7 of it along the surface.
    whole = 1.5 * abs(closing) * 2 / 3
    needed = np.linalg.norm(rubbing) * 2 / 3 * 2 / 7
    share = min(1.0, mu * whole / needed)
    np.testing.assert_allclose(left, (1.0 - share) * rubbing, atol=1e-3)


@pytest.mark.slow
def test_a_rigid_disc_strikes_a_solid_as_a_point_with_its_radius_does():
    block = {
        "kind": "solid", "name": "s", "model": "plane_strain", "density": 500.0, "strain": "small",
        "youngs_modulus": 1e7, "poisson_ratio": 0.3, "mesh_size": 0.05,
        "shape": {"kind": "block", "size": [0.3, 0.1], "corner": [-0.15, -0.1]},
    }  # fmt: skip
    round_body = {"name": "b", "mass": 2.0, "velocity": [0.3, -1.0]}
    found = []
    for how in (
        {"kind": "point", "position": [0.01, 0.121], "radius": 0.12},
        {"kind": "rigid", "shape": {"kind": "disc", "radius": 0.12, "center": [0.01, 0.121]}},
    ):
        scene = Scene.from_dict(
            {
                "title": "disc", "duration": 0.02, "body": [block, round_body | how],
                "contact": [{"between": ["s", "b"]}], "solve": {"dt": 2e-4, "estimate": False},
                "output": {"fields": []},
            }
        )  # fmt: skip
        found.append(column(impactfem.solve(scene), "b.vy", "b.vx", "s.vy", "contact_force"))
    assert found[0][:, 3].max() > 0.0
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9, atol=1e-9 * np.abs(found[0]).max())


def test_the_estimated_error_of_a_free_top_is_that_of_its_rotation():
    top = RigidBody(
        name="b", shape={"kind": "block", "size": [1.0, 1.0, 1.0]}, mass=1.0,
        inertia=[1.0, 2.0, 3.0], angular_velocity=[1e-3, 1.0, 1e-3],
    )  # fmt: skip
    scene = Scene(title="top", duration=20.0, bodies=[top], solve=Solve(dt=0.1))
    result = impactfem.solve(scene.with_settings(["output.fields=[]"]))
    assert not impactfem.plan(scene).findings
    fine = impactfem.solve(scene.with_settings(["solve.dt=0.02", "solve.estimate=false"]))
    turns = [
        Rotation.from_quat(np.roll(column(each, *(f"b.q{c}" for c in "wxyz"))[::steps], -1, axis=1))
        for each, steps in ((result, 1), (fine, 5))
    ]
    apart = (turns[0] * turns[1].inv()).magnitude().max()
    told = result.summary["error"]["displacement_max"]
    assert 0.2 * apart < told < 2.0 * apart


def test_a_law_by_patterns_is_that_of_the_pairs():
    disc = {"kind": "rigid", "mass": 1.0, "velocity": [0.5, 0.0]}
    bodies = [
        disc | {"name": f"grain_{k}", "shape": {"kind": "disc", "radius": 0.1, "center": c}}
        for k, c in enumerate(([0.0, 0.101], [0.21, 0.12], [0.1, 0.3]))
    ]
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    law = {"friction_coefficient": 0.3, "restitution": 0.2}
    names = [["grain_0", "grain_1"], ["grain_0", "grain_2"], ["grain_1", "grain_2"]]
    names += [[f"grain_{k}", "floor"] for k in range(3)]
    said = [[law | {"between": pair} for pair in names], [law | {"between": ["*", "*"]}]]
    one, two = (
        impactfem.solve(
            Scene.from_dict(
                {"title": "grains", "duration": 0.2, "gravity": [0.0, -9.81], "body": bodies,
                 "obstacle": [floor], "contact": contacts,
                 "solve": {"dt": 2e-3, "estimate": False}, "output": {"fields": []}}
            )
        ).history
        for contacts in said
    )  # fmt: skip
    assert one["friction_work"].values[-1] < -1e-4
    assert set(one.data_vars) == set(two.data_vars)
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name].values, two[name].values)


def test_whole_steps_have_one_length_however_late():
    dt = 1e-3 / 3.0
    assert {step_length(k * dt, (k + 1) * dt, dt) for k in (0, 1, 12345, 10**7)} == {dt}
    assert step_length(12345 * dt, 12345.5 * dt, dt) == pytest.approx(0.5 * dt, rel=1e-9)
