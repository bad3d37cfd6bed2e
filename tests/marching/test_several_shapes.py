"""Rigid bodies of several shapes: the same body said two ways, closed forms, a cup that holds."""

import dataclasses

import numpy as np
import pytest
from moving_scenes import alone, check_restart

import impactfem
from impactfem import Contact, HalfSpace, Output, RigidBody, Scene, SceneError, Solve
from impactfem.obstacles import RigidBox

G = 9.81


def march(bodies, obstacles, duration, dt=1e-3, mu=0.3, e=0.3, down=(0.0, -G, 0.0), method=None):
    dim = bodies[0].dim
    names = [(a.name, b.name) for k, a in enumerate(bodies) for b in bodies[:k]]
    names += [(b.name, o.name) for b in bodies for o in obstacles]
    laws = [Contact(between=list(pair), friction_coefficient=mu, restitution=e) for pair in names]
    return Scene(
        title="several shapes", duration=duration, bodies=bodies, obstacles=list(obstacles),
        contacts=laws, gravity=list(down)[:dim], output=Output(fields=[]),
        solve=Solve(dt=dt, estimate=False, method=method),
    )  # fmt: skip


def largest_difference(one, two):
    """Of all columns of two runs but those of times, over the largest value of each."""
    assert set(one.history) == set(two.history)
    each = [(one.history[n].values, two.history[n].values) for n in one.history]
    return max(np.abs(a - b).max() / max(np.abs(a).max(), 1.0) for a, b in each)


def cube(*corner, size=0.1):
    return {"kind": "block", "size": [size] * len(corner), "corner": list(corner)}


def can(start, height):
    return {"kind": "cylinder", "radius": 0.1, "height": height, "center": [0.0, start, 0.0]}


WHOLE = {
    "bar in the plane": (
        {"kind": "block", "size": [0.2, 0.1], "corner": [0.0, 0.2]},
        [cube(0.0, 0.2), cube(0.1, 0.2)], {"angle": 0.3, "angular_velocity": 2.0},
    ),
    "block": (
        {"kind": "block", "size": [0.2, 0.1, 0.1], "corner": [0.0, 0.2, 0.0]},
        [cube(0.0, 0.2, 0.0), cube(0.1, 0.2, 0.0)],
        {"orientation": {"axis": [1, 2, 3], "angle": 0.4}, "angular_velocity": [2.0, 1.0, 1.0]},
    ),
    "cylinder": (
        can(0.2, 0.3), [can(0.2, 0.1), can(0.3, 0.2)],
        {"orientation": {"axis": [1, 0, 3], "angle": 1.4}, "angular_velocity": [2.0, 1.0, 1.0]},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WHOLE)
def test_a_body_is_the_same_in_one_piece_and_in_two(name):
    shape, shapes, given = WHOLE[name]
    dim = 2 if "plane" in name else 3
    floor = HalfSpace(name="floor", point=[0.0] * dim, normal=[0.1, 1.0, 0.05][:dim])
    runs = [
        impactfem.solve(
            march([RigidBody(name="b", density=1e3, **said, **given)], [floor], 0.4, 2e-3)
        )
        for said in ({"shape": shape}, {"shapes": shapes})
    ]
    assert largest_difference(*runs) < 1e-9


def test_pieces_meet_boxes_and_bodies_as_the_whole_does():
    """Edges and faces: the bar meets a ball and the edge of a box, without friction."""
    box = RigidBox(name="box", center=[-0.475, -0.5, 0.0], size=[1.05, 1.0, 2.0])
    ball = {"kind": "sphere", "radius": 0.05, "center": [0.18, 0.4, 0.05]}
    shape, shapes, _ = WHOLE["block"]
    runs = []
    for said in ({"shape": shape}, {"shapes": shapes}):
        bar = RigidBody(name="b", density=1e3, angular_velocity=[0.0, 0.0, -1.0], **said)
        pair = [bar, RigidBody(name="ball", density=1e3, shape=ball, velocity=[0.0, -2.0, 0.0])]
        scene = march(pair, [box], 0.183, 1e-3, mu=0.0, e=0.5)  # then the seam meets the edge
        runs.append(impactfem.solve(scene))
    assert np.diff(runs[0].history["ball.vy"].values).max() > 0.5
    assert np.diff(runs[0].history["b.wz"].values).max() > 0.5  # both have met
    for column in ("b.x", "b.y", "b.wz", "ball.y", "kinetic_energy"):
        first, second = (run.history[column].values for run in runs)
        np.testing.assert_allclose(first, second, atol=1e-9)


def dumbbell(**given):
    """Balls of 50 mm on a round rod of 10 mm that ends on them; all along y."""
    return RigidBody(
        name="bell",
        shapes=[
            {"kind": "sphere", "radius": 0.05, "center": [0.0, -0.2, 0.0]},
            {"kind": "sphere", "radius": 0.05, "center": [0.0, 0.2, 0.0]},
            {"kind": "cylinder", "radius": 0.01, "height": 0.3, "center": [0.0, -0.15, 0.0]},
        ],
        **{"density": 7800.0} | given,
    )


def test_a_dumbbell_has_the_inertia_of_its_closed_form():
    body = dumbbell()
    ball, rod = 4.0 / 3.0 * np.pi * 0.05**3 * 7800.0, np.pi * 0.01**2 * 0.3 * 7800.0
    along = 2.0 * 0.4 * ball * 0.05**2 + 0.5 * rod * 0.01**2
    across = 2.0 * ball * (0.4 * 0.05**2 + 0.2**2) + rod * (0.3**2 / 12.0 + 0.01**2 / 4.0)
    assert body.total_mass == pytest.approx(2.0 * ball + rod, rel=1e-14)
    np.testing.assert_allclose(body.moments, np.diag([across, along, across]), rtol=1e-13)
    assert body.center == pytest.approx([0.0] * 3, abs=1e-16)


def test_a_dumbbell_rolls_and_is_the_capsule_it_looks_like():
    """Down a slope on its balls: g sin / (1 + I / (m r^2)); a capsule with its mass does it too."""
    lying = {"orientation": {"axis": [1.0, 0.0, 0.0], "angle": np.pi / 2}}
    bell = dumbbell(**lying)
    given = {"mass": bell.total_mass, "inertia": bell.moments.tolist()}
    like = {"kind": "capsule", "radius": 0.05, "length": 0.4}
    floor = HalfSpace(name="floor", point=[0.0, -0.05, 0.0], normal=[0.0, 1.0, 0.0])
    slope = (G * np.sin(0.3), -G * np.cos(0.3), 0.0)
    scenes = [
        march([body], [floor], 0.2, 2e-3, mu=0.5, e=0.0, down=slope)
        for body in (bell, RigidBody(name="bell", shape=like, **given, **lying))
    ]
    runs = [impactfem.solve(scene) for scene in scenes]
    assert largest_difference(*runs) < 1e-9
    mass, moment = bell.total_mass, bell.moments[1, 1]
    speed = 0.2 * G * np.sin(0.3) / (1.0 + moment / (mass * 0.05**2))
    assert runs[0].history["bell.vx"].values[-1] == pytest.approx(speed, rel=1e-10)


def cup(sides=11, lean=0.0, **given):
    """Walls of equal pieces around a floor, its axis along z; 12 convex parts in all."""
    angle = 2.0 * np.pi * np.arange(sides + 1) / sides
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def at(radius, height, k):
        return [*(radius * ring[k]), height]

    walls = [
        {"kind": "hull", "points": [
            at(r + lean * (z - 0.01), z, j) for r in (0.08, 0.09) for z in (0.01, 0.12)
            for j in (k, k + 1)
        ]} for k in range(sides)
    ]  # fmt: skip
    base = {"kind": "hull", "points": [at(0.09, z, k) for z in (0.0, 0.01) for k in range(sides)]}
    return RigidBody(name="cup", shapes=[base, *walls], density=2000.0, **given)


TABLE = HalfSpace(name="table", point=[0.0] * 3, normal=[0.0, 0.0, 1.0])


def filled(start=0.0605, speed=0.0, **given):
    ball = {"kind": "sphere", "radius": 0.05, "center": [0.0, 0.0, start]}
    inside = RigidBody(name="ball", shape=ball, density=1000.0, velocity=[speed, 0.0, 0.0])
    return [cup(**given), inside]


def test_a_cup_of_twelve_parts_holds_a_ball():
    """It falls on the floor of the cup, and is at rest there: all would rest on a hull's lid."""
    bodies = filled(start=0.0605, speed=0.0)
    result = impactfem.solve(march(bodies, [TABLE], 0.05, 1e-3, mu=0.3, e=0.0, down=(0.0, 0.0, -G)))
    weights = [G * body.total_mass for body in bodies]
    last = {name: float(result.history[name].values[-1]) for name in result.history}
    assert last["force.ball.cup"] == pytest.approx(weights[1], rel=1e-9)
    assert last["force.cup.table"] == pytest.approx(sum(weights), rel=1e-9)
    assert last["ball.z"] == pytest.approx(0.06, abs=2e-4)


def test_walls_of_a_cup_throw_a_ball_back_and_momentum_is_kept():
    """On ice: both go to and fro, their momentum stays; the ball never leaves."""
    bodies = filled(start=0.0601, speed=1.0)
    scene = march(bodies, [TABLE], 0.2, 1e-3, mu=0.0, e=1.0, down=(0.0, 0.0, 0.0))
    result = impactfem.solve(scene)
    heavy, light = (body.total_mass for body in bodies)
    found = heavy * result.history["cup.vx"].values + light * result.history["ball.vx"].values
    np.testing.assert_allclose(found, light, rtol=1e-12)
    away = result.history["ball.x"].values - result.history["cup.x"].values
    assert np.abs(away).max() < 0.04
    assert result.history["cup.vx"].values.max() > 0.1
    energy = result.history["total_energy"].values
    np.testing.assert_allclose(energy, energy[0], rtol=1e-10)


def test_parts_that_overlap_are_told():
    def findings(shapes, **given):
        body = RigidBody(name="b", shapes=shapes, **{"density": 1e3} | given)
        floor = HalfSpace(name="floor", point=[0.0, -1.0, 0.0], normal=[0.0, 1.0, 0.0])
        return {f.code: f for f in impactfem.plan(march([body], [floor], 1.0)).findings}

    beside = [cube(0.0, 0.0, 0.0), cube(0.1, 0.0, 0.0), cube(0.2, 0.05, 0.0)]
    assert "overlapping_parts" not in findings(beside)
    told = findings([*beside, cube(0.28, 0.05, 0.0)])["overlapping_parts"]
    assert "shapes[2] and shapes[3] of b overlap by 0.02 m" in told.text
    given = {"density": None, "mass": 1.0, "inertia": [1.0, 1.0, 1.0]}
    assert "overlapping_parts" not in findings([*beside, cube(0.28, 0.05, 0.0)], **given)
    assert "overlapping_parts" not in {
        f.code for f in impactfem.plan(march(filled(), [TABLE], 1.0)).findings
    }


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"shapes": []}, "shape"),
        ({"shapes": [cube(0.0, 0.0)], "shape": cube(0.0, 0.0)}, "shape and shapes are given"),
        ({"shapes": [cube(0.0, 0.0), cube(0.0, 0.0, 0.0)]}, r"shapes\[1\] has 3 coordinates"),
        ({"shapes": [cube(0.0, 0.0), {"kind": "disc", "radius": -1.0}]}, r"shapes\[1\].radius"),
        ({"shapes": [cube(0.0, 0.0), {"kind": "hull", "points": [[0, 0], [1, 1], [2, 2]]}]},
         r"shapes\[1\].points"),
        ({"shapes": [cube(0.0, 0.0), {"kind": "blok"}]}, r"shapes\[1\].kind"),
    ],
)  # fmt: skip
def test_bad_lists_are_refused(given, words):
    with pytest.raises(SceneError, match=words):
        RigidBody(name="b", density=1.0, **given)


def test_restart(tmp_path, monkeypatch):
    made = march(filled(speed=0.5), [TABLE], 0.04, 2e-3, down=(0.0, 0.0, -G))
    output = Output(fields=["vtkhdf"], checkpoint=5)
    check_restart(dataclasses.replace(made, output=output), 12, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    made = march(filled(speed=0.5), [TABLE], 0.03, 2e-3, down=(0.0, 0.0, -G))
    both = impactfem.solve(made)
    with alone(monkeypatch):
        one = impactfem.solve(made)
    assert largest_difference(both, one) < 1e-10


def test_a_scene_with_shapes_is_written_and_read():
    scene = march(filled(), [TABLE], 0.01)
    again = Scene.from_dict(scene.to_dict())
    assert again == scene
    assert dataclasses.asdict(again.bodies[0])["shapes"]
