"""Obstacles that turn: turntables, paddles and drums against closed forms, for every body."""

import numpy as np
import pytest
from moving_scenes import alone, check_restart, scene
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import impactfem
from impactfem import Contact, HalfSpace, Output, Point, RigidBody, Rod, Scene, SceneError, Solve
from impactfem.obstacles import RigidCylinder

G = 9.81


def run(body, duration, dt, gravity, obstacle, mu=0.0, e=0.0, **solve):
    law = Contact(between=[body.name, obstacle.name], friction_coefficient=mu, restitution=e)
    given = Scene(
        title="turning", duration=duration, bodies=[body], obstacles=[obstacle], contacts=[law],
        gravity=gravity, solve=Solve(dt=dt, estimate=False, **solve), output=Output(fields=[]),
    )  # fmt: skip
    return impactfem.solve(given)


def column(result, *names):
    return np.stack([result.history[name].values for name in names], axis=1).squeeze()


def turntable(speed, point=(0.0, 0.0, 0.0)):
    """A floor that turns about the vertical."""
    turning = {"point": list(point), "axis": [0.0, 1.0, 0.0], "angle": f"{speed!r}*t"}
    return HalfSpace(name="table", point=[0.0, 0.0, 0.0], normal=[0.0, 1.0, 0.0], rotation=turning)


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_block_on_a_turntable_slips_beyond_the_speed_at_which_friction_holds_it(share):
    mu, radius, size = 0.5, 0.2, 0.004
    duration = 0.2 if share < 1.0 else 0.4
    speed = float(share * np.sqrt(mu * G / radius))
    block = RigidBody(
        name="b", shape={"kind": "block", "size": [size] * 3, "corner": [radius - size / 2, 0.0,
                                                                         -size / 2]},
        density=1e3, velocity=[0.0, 0.0, -speed * radius], angular_velocity=[0.0, speed, 0.0],
    )  # fmt: skip
    result = run(block, duration, 2e-3, [0.0, -G, 0.0], turntable(speed), mu)
    places = column(result, "b.x", "b.z")
    assert abs(result.summary["energy"]["unexplained"]) < 1e-12
    if share < 1.0:
        turned = -np.unwrap(np.arctan2(places[:, 1], places[:, 0]))
        assert np.hypot(*places.T) == pytest.approx(radius, rel=1e-6)
        assert turned == pytest.approx(speed * result.history["time"].values, abs=1e-5)
        return

    def slides(_, state):  # a point: its speed against the table below it
        slip = state[2:] - speed * np.array([state[1], -state[0]])
        return [*state[2:], *(-mu * G * slip / np.hypot(*slip))]

    # It starts without slip, on the side to which the pull exceeds what holds it.
    start = [radius, 0.0, 1e-9, -speed * radius]
    exact = solve_ivp(slides, (0.0, duration), start, rtol=1e-9, atol=1e-12).y[:2, -1]
    assert np.hypot(*exact) > 1.04 * radius
    assert places[-1] == pytest.approx(exact, abs=0.01 * radius)


def test_a_paddle_hits_a_ball_as_the_speed_of_its_face_says():
    speed, reach, radius, e, fall = 3.0, 0.4, 0.05, 0.7, -1.2
    ball = RigidBody(
        name="b", shape={"kind": "disc", "radius": radius, "center": [reach, 0.07]}, mass=1.0,
        velocity=[0.0, fall],
    )  # fmt: skip
    paddle = HalfSpace(
        name="p", point=[0.0, 0.0], normal=[0.0, 1.0],
        rotation={"point": [0.0, 0.0], "angle": f"{speed}*t"},
    )  # fmt: skip

    def height(t):
        return (0.07 + fall * t) * np.cos(speed * t) - reach * np.sin(speed * t) - radius

    hit = brentq(height, 0.0, 0.02)
    normal = np.array([-np.sin(speed * hit), np.cos(speed * hit)])
    touched = np.array([reach, 0.07 + fall * hit]) - radius * normal
    face = speed * np.array([-touched[1], touched[0]])
    before = np.array([0.0, fall])
    after = before - (1.0 + e) * ((before - face) @ normal) * normal
    errors = []
    for steps in (10.5, 20.5):  # it strikes amid a step
        dt = hit / steps
        result = run(ball, 30 * dt, dt, [0.0, 0.0], paddle, e=e)
        errors.append(np.abs(column(result, "b.vx", "b.vy")[-1] - after).max())
        assert abs(result.summary["energy"]["unexplained"]) < 1e-14
    lost = 0.5 * (1.0 - e**2) * ((before - face) @ normal) ** 2
    assert result.summary["energy"]["taken"]["impacts"] == pytest.approx(lost, rel=1e-3)
    assert errors[1] < 1e-6
    assert errors[0] / errors[1] == pytest.approx(3.8, rel=0.05)


def test_a_disc_in_a_drum_that_spins_up_stays_at_its_angle():
    """The drum drives its spin: m g sin(angle) = I alpha R / a^2, of a disc m alpha R / 2."""
    radius, small, rise = 0.5, 0.1, 4.0
    angle = np.arcsin(0.5 * radius * rise / G)
    centre = (radius - small) * np.array([np.sin(angle), -np.cos(angle)])
    disc = RigidBody(
        name="d", shape={"kind": "disc", "radius": small, "center": centre.tolist()}, mass=2.0
    )
    drum = RigidCylinder(
        name="drum", point=[0.0, 0.0], radius=radius, side="inside",
        rotation={"point": [0.0, 0.0], "angle": f"{rise / 2}*t**2"},
    )  # fmt: skip
    errors = []
    for dt in (4e-3, 2e-3):
        result = run(disc, 0.4, dt, [0.0, -G], drum, 0.5)
        x, y = column(result, "d.x", "d.y").T
        errors.append(np.abs(np.arctan2(x, -y) - angle).max())
        spin = column(result, "d.spin")
        assert spin[-1] == pytest.approx(0.4 * rise * radius / small, rel=1e-4)
        assert np.hypot(x, y).max() <= radius - small + 1e-14
        assert abs(result.summary["energy"]["unexplained"]) < 1e-13
    assert errors[1] < 1e-5
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_a_point_in_a_drum_lies_at_the_angle_of_friction():
    mu, radius, speed = 0.4, 0.5, 5.0
    angle = np.arctan(mu)
    start = [radius * np.sin(angle), -radius * np.cos(angle)]
    drum = RigidCylinder(
        name="drum", point=[0.0, 0.0], radius=radius, side="inside",
        rotation={"point": [0.0, 0.0], "angle": f"{speed}*t"},
    )  # fmt: skip
    result = run(Point(name="p", mass=1.0, position=start), 0.3, 1e-3, [0.0, -G], drum, mu)
    x, y = column(result, "p.x", "p.y").T
    assert np.arctan2(x, -y) == pytest.approx(angle, abs=1e-5)
    rubbed = result.summary["energy"]["taken"]["friction"]
    assert rubbed == pytest.approx(0.3 * mu * G * np.cos(angle) * speed * radius, rel=5e-3)


DISC = {"shape": {"kind": "disc", "radius": 0.5, "center": [0.0, 0.51]}, "mesh_size": 0.2}
ALIKE = {
    "small": (DISC | {"strain": "small"}, {"method": "conserving"}),
    "small explicit": (DISC | {"strain": "small"}, {"method": "explicit", "dt": 0.02}),
    "moreau_jean": (DISC | {"strain": "small"}, {"method": "moreau_jean"}),
    "finite": (DISC | {"strain": "finite", "material": "neo_hookean"}, {"method": "conserving"}),
    "finite explicit": (
        DISC | {"strain": "finite", "material": "neo_hookean"}, {"method": "explicit", "dt": 0.02},
    ),
}  # fmt: skip


def far_floors(way):
    """A floor that moves aslant, and one that turns about a point so far off that it does too."""
    far, half = 1e5, float(np.sqrt(0.5))
    aslant = f"({way})*{half!r}"
    turning = {"point": [-far * half, far * half], "angle": f"({way})/{far}"}
    plane = {"kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0], "name": "o0"}
    still = {"point": [0.0, 0.0], "angle": 0.0}  # solids choose their contact nodes alike
    return plane | {"motion": [aslant, aslant], "rotation": still}, plane | {"rotation": turning}


@pytest.mark.parametrize("kind", ALIKE)
def test_solids_meet_what_turns_far_away_as_what_moves(kind):
    body, settings = ALIKE[kind]
    law = [{"between": ["body", "o0"], "friction_coefficient": 0.3}]
    results = []
    for floor in far_floors("0.6*t"):
        made = scene(body, [floor], 1.0, [0.0, -0.05], settings, {"fields": []})
        results.append(impactfem.solve(Scene.from_dict(made.to_dict() | {"contact": law})))
    one, other = (column(r, "body.x", "body.y", "body.vx", "body.vy") for r in results)
    assert np.ptp(one[:, 2]) > 0.05  # it is dragged along
    np.testing.assert_allclose(other, one, atol=2e-5)
    for name in ("friction_work", "total_energy"):
        a, b = (column(r, name) for r in results)
        np.testing.assert_allclose(b, a, atol=1e-4 * np.abs(a).max())


@pytest.mark.parametrize(
    "body",
    [
        Point(name="b", mass=0.1, position=[0.0, 0.02], radius=0.01, velocity=[0.0, -0.5]),
        Rod(name="b", length=0.1, mass=0.1, center=[0.0, 0.05], radius=0.01, inclination=0.6),
        RigidBody(name="b", mass=0.1, angle=0.3, velocity=[0.0, -0.5],
                  shape={"kind": "block", "size": [0.1, 0.05], "corner": [-0.05, 0.03]}),
    ],
    ids=["point", "rod", "rigid"],
)  # fmt: skip
def test_bodies_meet_what_turns_far_away_as_what_moves(body):
    floors = [HalfSpace(**{k: v for k, v in f.items() if k != "kind"}) for f in far_floors("t")]
    one, other = (
        run(body, 0.15, 5e-4, [0.0, -G], floor, 0.3, 0.4, method="moreau_jean") for floor in floors
    )
    names = [name for name in one.history.data_vars if name.startswith("b.")]
    a, b = column(one, *names), column(other, *names)
    assert np.ptp(column(one, "b.vx")) > 0.05
    np.testing.assert_allclose(b, a, atol=2e-5)
    unexplained = [r.summary["energy"]["unexplained"] for r in (one, other)]
    assert unexplained[1] == pytest.approx(unexplained[0], abs=1e-8)


def stirred(**change):
    """A block thrown on a tilted table that turns and rises."""
    shape = {"kind": "block", "size": [0.2, 0.1, 0.15], "corner": [0.0, 0.05, 0.0]}
    turning = {"point": [0.1, 0.0, 0.0], "axis": [0.1, 1.0, 0.0], "angle": "3*t + sin(20*t)"}
    return {
        "title": "stirred", "duration": 0.08, "gravity": [0.0, -G, 0.0],
        "body": [{"kind": "rigid", "name": "b", "shape": shape, "density": 500.0,
                  "velocity": [1.0, -1.0, 0.0], "angular_velocity": [1.0, 2.0, 3.0]}],
        "obstacle": [{"kind": "half_space", "name": "table", "point": [0.0, 0.0, 0.0],
                      "normal": [0.0, 1.0, 0.0], "motion": ["0", "0.01*t", "0"],
                      "rotation": turning} | change],
        "contact": [{"between": ["b", "table"], "friction_coefficient": 0.4, "restitution": 0.2}],
        "solve": {"dt": 1e-3, "estimate": False}, "output": {"checkpoint": 20, "fields": []},
    }  # fmt: skip


def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    given = Scene.from_dict(stirred())
    assert Scene.from_dict(given.to_dict()) == given
    whole, _ = check_restart(given, 67, tmp_path, monkeypatch)
    assert whole.summary["contact"]["impulse"] > 0.0
    assert abs(whole.summary["energy"]["unexplained"]) < 2e-6  # as on what stands still


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    both = impactfem.solve(Scene.from_dict(stirred()))
    with alone(monkeypatch):
        one = impactfem.solve(Scene.from_dict(stirred()))
    for name in one.history.data_vars:
        np.testing.assert_allclose(
            both.history[name].values, one.history[name].values, rtol=1e-10, atol=1e-10
        )


@pytest.mark.parametrize(
    ("rotation", "said"),
    [
        ({"angle": "t"}, "rotation.point is missing"),
        ({"point": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0]}, "rotation.angle is missing"),
        ({"point": [0.0, 0.0, 0.0], "angle": "t"}, "obstacle[0].rotation.axis is missing: with"),
        ({"point": [0.0, 0.0], "axis": [0.0, 1.0, 0.0], "angle": "t"}, "give 3, or in 2D no axis"),
        ({"point": [0.0, 0.0], "angle": "t"}, "has 2 coordinates, but the body has 3: give point"),
        ({"point": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, 0.0], "angle": "t"}, "not all 0"),
        ({"point": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0], "angle": "x"}, "formula in t"),
        ({"point": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0], "angle": "where(t < 0.04, 0, 1)"},
         'obstacle[0].rotation.angle = "where(t < 0.04, 0, 1)" jumps from 0 to 1 rad at t = 0.04'),
        ({"point": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0], "angle": "log(t - 0.01)"},
         "has no finite value at t = 0"),
    ],
)  # fmt: skip
def test_bad_rotations_are_told_with_key_and_remedy(rotation, said):
    with pytest.raises(SceneError) as told:
        Scene.from_dict(stirred(rotation=rotation))
    assert said in str(told.value), told.value


def test_what_does_not_turn_with_its_obstacle_is_refused():
    turning = {"point": [0.0, 0.0], "angle": "t"}
    body = {"model": "axisymmetric", **DISC}
    with pytest.raises(SceneError, match="rotation: the body is axisymmetric and does not twist"):
        scene(body, [{"kind": "sphere", "center": [0.0, -1.0], "radius": 1.0,
                      "rotation": turning}], 1.0, None, {}, {})  # fmt: skip
    floor = {"kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    with pytest.raises(SceneError, match='normals = "fixed", but o0 turns and its normals with it'):
        scene(DISC, [floor | {"rotation": turning}], 1.0, None, {"normals": "fixed"}, {})
    line = {"kind": "point", "name": "b", "mass": 1.0, "position": [1.0]}
    with pytest.raises(SceneError, match="on a line nothing turns; remove it"):
        Scene.from_dict({
            "title": "line", "duration": 1.0, "body": [line],
            "obstacle": [{"kind": "half_space", "point": [0.0], "normal": [1.0],
                          "rotation": turning}],
        })  # fmt: skip
