"""Rigid bodies that meet with edges and faces: stacks, impacts, rolling, against closed forms."""

import numpy as np
import pytest
from moving_scenes import alone, check_restart

import impactfem
from impactfem import Contact, HalfSpace, Output, RigidBody, Scene, SceneError, Solve
from impactfem.obstacles import RigidBox, RigidSphere

G = 9.81


def block(name, size, center, **more):
    corner = (np.asarray(center) - 0.5 * np.asarray(size)).tolist()
    given = {"density": 1000.0} if "mass" not in more else {}
    shape = {"kind": "block", "size": list(size), "corner": corner}
    return RigidBody(name=name, shape=shape, **given, **more)


def floor(dim):
    return HalfSpace(name="floor", point=[0.0] * dim, normal=[0.0, 1.0, 0.0][:dim])


def run(bodies, duration, dt, gravity=None, obstacles=(), pairs=None, mu=0.0, e=0.0):
    dim = bodies[0].dim
    names = [(a.name, b.name) for k, a in enumerate(bodies) for b in bodies[:k]]
    names += [(b.name, o.name) for b in bodies for o in obstacles]
    law = [
        Contact(between=list(pair), friction_coefficient=mu, restitution=e)
        for pair in pairs or names
    ]
    scene = Scene(
        title="convex", duration=duration, bodies=bodies, obstacles=list(obstacles), contacts=law,
        gravity=[0.0] * dim if gravity is None else list(gravity),
        solve=Solve(dt=dt, estimate=False), output=Output(fields=[]),
    )  # fmt: skip
    return impactfem.solve(scene)


def column(result, *names):
    return np.stack([result.history[name].values for name in names], axis=1).squeeze()


def stack(dim, masses, mu, duration, dt=1e-3):
    size = [0.2, 0.1, 0.2][:dim]
    bodies = [
        block(f"b{k}", size, [0.0, 0.1 * k + 0.05, 0.0][:dim], mass=m) for k, m in enumerate(masses)
    ]
    pairs = [("b0", "floor"), *((f"b{k}", f"b{k - 1}") for k in range(1, len(masses)))]
    gravity = [0.0, -G, 0.0][:dim]
    result = run(bodies, duration, dt, gravity, [floor(dim)], pairs, mu)
    forces = column(result, *(f"force.{a}.{b}" for a, b in pairs))[1:]
    weights = G * np.cumsum(masses[::-1])[::-1]
    moved = np.array([np.ptp(column(result, *(f"{b.name}.{c}" for c in "xyz"[:dim])), axis=0)
                      for b in bodies])  # fmt: skip
    return np.abs(forces / weights - 1.0).max(), moved.max()


@pytest.mark.parametrize(("dim", "mu"), [(2, 0.0), (3, 0.0), (2, 0.3), (3, 0.3)])
def test_ten_boxes_rest_on_each_other(dim, mu):
    missed, moved = stack(dim, [1.0] * (10 if mu == 0.0 or dim == 2 else 3), mu, 0.02)
    assert missed < 1e-8
    assert moved < 1e-11


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("masses", [[1.0, 1e4], [1e4, 1.0], [1.0, 10.0, 100.0, 1e3, 1e4]])
def test_stacks_of_very_different_masses_rest(masses, mu):
    missed, moved = stack(3, masses, mu, 0.02)
    assert missed < 1e-8
    assert moved < 1e-11


# Impact at one place with the speed w: J = (1 + e) w / k, where k sums 1 / m + (a x n)^2 / I.


def test_two_boxes_collide_face_to_face():
    one = block("one", [0.2, 0.1, 0.1], [-0.2, 0.0, 0.0], mass=1.0, velocity=[1.0, 0.0, 0.0])
    two = block("two", [0.2, 0.3, 0.4], [0.0005, 0.0, 0.0], mass=3.0)
    result = run([one, two], 2e-3, 1e-4, mu=0.3, e=0.5)
    v = column(result, *(f"{b}.v{c}" for b in ("one", "two") for c in "xyz"))[-1]
    spin = column(result, *(f"{b}.w{c}" for b in ("one", "two") for c in "xyz"))[-1]
    assert v == pytest.approx([1.0 - 1.5 * 0.75, 0.0, 0.0, 1.5 * 0.25, 0.0, 0.0], abs=1e-12)
    assert np.abs(spin).max() < 1e-12


def test_overlapping_bodies_are_refused():
    low, high = (block(n, [0.2] * 3, [0.0, y, 0.05]) for n, y in (("low", 0.1), ("high", 0.27)))
    ball = RigidSphere(name="ball", center=[0.0, -0.05, 0.05], radius=0.1)
    with pytest.raises(SceneError, match=r"high and low overlap by 0.03 m at t = 0: move one"):
        run([low, high], 0.01, 1e-3)
    with pytest.raises(SceneError, match=r"low and ball overlap by 0.05 m at t = 0: move one"):
        run([low], 0.01, 1e-3, obstacles=[ball])


@pytest.mark.parametrize("mu", [0.0, 0.4])
def test_a_corner_strikes_a_face(mu):
    # In the plane: a square, turned by 30 degrees, falls on one at rest that nothing holds.
    turn, half = np.radians(30.0), 0.1
    arm = np.array([half * (np.sin(turn) - np.cos(turn)), -half * (np.cos(turn) + np.sin(turn))])
    place = np.array([0.02, 0.0])
    gap, speed, dt = 1e-4, 1.0, 1e-5
    one = block("one", [0.2, 0.2], place - arm + [0.0, gap], mass=1.0, angle=turn,
                velocity=[0.0, -speed])  # fmt: skip
    two = block("two", [0.4, 0.2], [0.0, -0.1], mass=2.0)
    result = run([one, two], 2e-4, dt, mu=mu)
    inertia = np.array([0.2**2 + 0.2**2, 2.0 * (0.4**2 + 0.2**2)]) / 12.0
    arms = np.array([arm, place - [0.0, -0.1]])
    cross = np.stack([arms[:, 0], -arms[:, 1]], axis=1)  # a x n, a x t
    inverse = np.einsum("ki,kj,k->ij", cross, cross, 1.0 / inertia) + 1.5 * np.eye(2)
    impulse = np.array([speed / inverse[0, 0], 0.0])
    if mu:  # sticks if the cone allows; else slides against the slip
        impulse = np.linalg.solve(inverse, [speed, 0.0])
        if abs(impulse[1]) > mu * impulse[0]:
            side = mu * np.sign(impulse[1])
            normal = speed / (inverse[0, 0] + side * inverse[0, 1])
            impulse = normal * np.array([1.0, side])
    expected = (
        -speed + impulse[0],
        cross[0] @ impulse / inertia[0],
        -cross[1] @ impulse / inertia[1],
    )
    found = column(result, "one.vy", "one.spin", "two.spin")[-1]
    # The corner is where it is amid the layer of the impact: off by a share of the gap.
    assert found == pytest.approx(expected, rel=2e-4, abs=1e-4)
    total = column(result, "angular_momentum")
    assert np.abs(total - total[0]).max() < 1e-12 * 0.1
    assert np.abs(column(result, "momentum.x", "momentum.y") - [0.0, -1.0]).max() < 1e-12


@pytest.mark.parametrize("e", [0.0, 1.0])
def test_edges_strike_crosswise(e):
    # Two cubes on edge, one turned by 90 degrees about the vertical: the edges cross.
    low = {"axis": [0.0, 0.0, 1.0], "angle": np.pi / 4}
    high = {"axis": [1.0, 0.0, 0.0], "angle": np.pi / 4}
    far, gap = 0.1 * np.sqrt(2.0), 1e-4
    one = block("one", [0.2] * 3, [0.03, far + gap, 0.02], mass=1.0, orientation=high,
                velocity=[0.0, -1.0, 0.0])  # fmt: skip
    two = block("two", [0.2] * 3, [0.0, -far, 0.0], mass=2.0, orientation=low)
    result = run([one, two], 2e-3, 1e-4, e=e)
    inertia = np.array([1.0, 2.0]) * 0.2**2 / 6.0
    # They cross at x = 0 of the lower edge (along z) and z = 0.02 of the upper one (along x).
    arms = np.array([[-0.03, 0.0], [0.0, 0.02]])  # x, z from both centres
    k = 1.5 + (arms**2).sum(axis=1) @ (1.0 / inertia)
    impulse = (1.0 + e) / k
    assert column(result, "one.vy", "two.vy")[-1] == pytest.approx([-1 + impulse, -impulse / 2])
    spins = column(result, "one.wx", "one.wz", "two.wx", "two.wz")[-1]
    expected = [0.0, -0.03 * impulse / inertia[0], 0.02 * impulse / inertia[1], 0.0]
    assert spins == pytest.approx(expected, rel=1e-9, abs=1e-9)
    total = column(result, *(f"angular_momentum.{c}" for c in "xyz"))
    assert np.abs(total - total[0]).max() < 1e-14
    if e == 1.0:
        energy = column(result, "kinetic_energy")
        assert np.ptp(energy) < 1e-12


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("kind", ["block", "capsule", "cylinder"])
def test_a_slope_may_be_a_box(kind, dim):
    if kind == "cylinder" and dim == 2:
        pytest.skip("cylinders are in space")
    more, slope = [0.0] * (dim - 2), np.radians(20.0)
    shape = {
        "block": {"kind": "block", "size": [0.2, 0.1, 0.1][:dim], "corner": [-0.1, 0.0, *more]},
        "capsule": {"kind": "capsule", "radius": 0.1, "length": 0.3, "center": [0.0, 0.1, *more],
                    "axis": [0.0, 0.0, 1.0] if dim == 3 else [1.0, 0.0]},
        "cylinder": {"kind": "cylinder", "radius": 0.1, "height": 0.3, "center": [0.0, -0.05, 0.0],
                     "angle": np.pi / 2},
    }[kind]  # fmt: skip
    turned = {"orientation": {"axis": [0.0, 1.0, 0.0], "angle": np.pi / 2}}
    turned = turned if kind == "cylinder" else {}
    gravity = [G * np.sin(slope), -G * np.cos(slope), *more]
    large = RigidBox(name="floor", center=[0.0, -1.0, 0.0][:dim], size=[9.0, 2.0, 9.0][:dim])
    body = RigidBody(name="b", shape=shape, mass=1.0, **turned)
    result = run([body], 0.1, 2e-3, gravity, [large], mu=0.3)
    found = column(result, "b.x", "b.y", "b.vx", "b.spin" if dim == 2 else "b.wz")
    pull = G * (np.sin(slope) - 0.3 * np.cos(slope))
    if kind != "block" and dim == 3:  # they roll
        pull = (
            G
            * np.sin(slope)
            / (1.0 + body.moments[0 if turned else 2, 0 if turned else 2] / 0.1**2)
        )
        assert 0.1 * found[-1, 3] == pytest.approx(-found[-1, 2], rel=1e-9)
    assert found[-1, 2] == pytest.approx(0.1 * pull, rel=1e-9)
    assert np.ptp(found[:, 1]) < 1e-10
    if kind == "block" or dim == 2:
        other = run([body], 0.1, 2e-3, gravity, [floor(dim)], mu=0.3)
        same = column(other, "b.x", "b.y", "b.vx", "b.spin" if dim == 2 else "b.wz")
        assert np.abs(found - same).max() < 1e-9


def test_a_box_sits_on_a_ball():
    # It rolls on it without falling, as half its height is less than the radius: a swing.
    radius, half = 0.5, 0.05
    ball = RigidSphere(name="ball", center=[0.0, -radius, 0.0], radius=radius)
    box = block("box", [0.2, 2 * half, 0.2], [0.0, half, 0.0], mass=1.0,
                angular_velocity=[0.0, 0.0, 0.05])  # fmt: skip
    result = run([box], 0.5, 2e-3, [0.0, -G, 0.0], [ball], mu=1.0)
    inertia = (0.2**2 + 0.1**2) / 12.0 + half**2
    period = 2.0 * np.pi * np.sqrt(inertia / (G * (radius - half)))
    time, spin = result.history["time"].values, column(result, "box.wz")
    back = np.flatnonzero(spin[1:] * spin[:-1] < 0.0)
    zeros = time[back] - spin[back] * np.diff(time)[back] / np.diff(spin)[back]
    assert 2.0 * np.diff(zeros).mean() == pytest.approx(period, rel=2e-3)


def tumble():
    """A capsule, a cylinder and a block fall on a ball and each other, with friction."""
    shapes = [
        {"kind": "capsule", "radius": 0.05, "length": 0.1, "center": [0.0, 0.0, 0.0]},
        {"kind": "cylinder", "radius": 0.05, "height": 0.15, "center": [0.02, -0.28, 0.01]},
        {"kind": "block", "size": [0.1] * 3, "corner": [-0.06, 0.14, -0.04]},
    ]
    bodies = [
        RigidBody(
            name=f"b{k}", shape=shape, density=1000.0, velocity=[0.0, -1.0, 0.0],
            orientation={"axis": [1.0, 0.0, 0.5], "angle": 1.0 - k},
        )
        for k, shape in enumerate(shapes)
    ]  # fmt: skip
    ball = RigidSphere(name="ball", center=[0.0, -0.46, 0.0], radius=0.15)
    pairs = [("b0", "b1"), ("b0", "b2"), *((f"b{k}", "ball") for k in range(3))]
    laws = [Contact(between=list(p), friction_coefficient=0.4, restitution=0.3) for p in pairs]
    return Scene(
        title="tumble", duration=0.1, bodies=bodies, obstacles=[ball], contacts=laws,
        gravity=[0.0, -G, 0.0], solve=Solve(dt=1e-3, estimate=False),
        output=Output(fields=[], checkpoint=25),
    )  # fmt: skip


def test_a_restarted_run_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    whole, _ = check_restart(tumble(), 60, tmp_path, monkeypatch)
    assert min(np.abs(column(whole, f"impulse.{p}")).max() for p in ("b0.b1", "b1.ball")) > 0.0


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    both = impactfem.solve(tumble())
    with alone(monkeypatch):
        one = impactfem.solve(tumble())
    for name in one.history.data_vars:
        np.testing.assert_allclose(
            both.history[name].values, one.history[name].values, rtol=1e-10, atol=1e-10
        )
