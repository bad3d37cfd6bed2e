"""Joints on marked surfaces of solids: rigid tips in the mean, held to closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from moving_scenes import alone, check_restart
from scipy.optimize import brentq, least_squares

from impactfem import (
    Contact,
    HalfSpace,
    Joint,
    Output,
    Probe,
    RigidBody,
    Scene,
    Solid,
    Solve,
    solve,
)
from impactfem.errors import SceneError
from impactfem.models.solids import solids_model
from impactfem.planning import plan


def made(bodies, joints, duration, dt, gravity=(0.0, 0.0), **more):
    return Scene(
        title="tips", duration=duration, gravity=list(gravity), bodies=bodies, joints=joints,
        solve=Solve(dt=dt, estimate=False, method="conserving"), output=Output(fields=[]), **more,
    )  # fmt: skip


def run(*given, **more):
    return solve(made(*given, **more)).history


def drift(values):
    return np.abs(values - values[0]).max()


def block(modulus=1e7, **more):
    keys = {
        "shape": {"kind": "block", "size": [0.2, 0.1], "corner": [-0.1, -0.1]}, "mesh_size": 0.05,
        "model": "plane_stress", "poisson_ratio": 0.3, "density": 1000.0,
    }  # fmt: skip
    return Solid(name="block", youngs_modulus=modulus, **(keys | more))


def hinge(*between, **more):
    return Joint(name="pin", **({"kind": "revolute", "point": [0.0, 0.0]} | more), between=between)


def bob(spin, velocity=(0.0, 0.0)):
    """A disc above the origin that swings about it, which moves with a velocity."""
    swung = [velocity[0] - 0.3 * spin, velocity[1]]
    shape = {"kind": "disc", "radius": 0.05, "center": [0.0, 0.3]}
    return RigidBody(name="bob", shape=shape, mass=5.0, velocity=swung, angular_velocity=spin)


def test_body_on_the_end_of_a_cantilever_swings_as_beam_theory_has_it():
    length, height, width, modulus, density = 0.2, 0.01, 0.01, 1e8, 1000.0
    mass, side, weight = 0.02, 0.02, 9.81
    ei, line, arm = modulus * width * height**3 / 12.0, density * width * height, side / 2.0

    def off(w):
        """Euler and Bernoulli: (clamped) cosh - cos, sinh - sin, with the body at the end."""
        k = (line * w * w / ei) ** 0.25
        c, s, ch, sh = (
            np.cos(k * length),
            np.sin(k * length),
            np.cosh(k * length),
            np.sinh(k * length),
        )
        moved, turned = np.array([ch - c, sh - s]), k * np.array([sh + s, ch - c])
        bent, sheared = k**2 * np.array([ch + c, sh + s]), k**3 * np.array([sh - s, ch + c])
        middle = moved + arm * turned
        moment = ei * bent - w * w * (mass * side**2 / 6.0 * turned + mass * arm * middle)
        force = ei * sheared + mass * w * w * middle
        return moment[0] * force[1] - moment[1] * force[0]

    rate = brentq(off, 20.0, 50.0)
    load, own = mass * weight, line * weight
    sunk = (load * (length**3 / 3 + arm * length**2 / 2) + own * length**4 / 8) / ei
    sunk += arm * (load * (length**2 / 2 + arm * length) + own * length**3 / 6) / ei
    strip = Solid(
        name="strip", model="plane_stress", mesh_size=height, degree=2, density=density,
        shape={"kind": "block", "size": [length, height], "corner": [0.0, -height / 2]},
        youngs_modulus=modulus, poisson_ratio=0.0, thickness=width,
        supports=[{"surface": "left", "kind": "fixed"}],
    )  # fmt: skip
    shape = {"kind": "block", "size": [side, side], "corner": [length, -arm]}
    body = RigidBody(name="bob", shape=shape, mass=mass, thickness=width)
    weld = Joint(name="weld", kind="fixed", between=["strip/right", "bob"], point=[length, 0.0])
    period = 2.0 * np.pi / rate
    history = run([strip, body], [weld], 2 * period, period / 200, gravity=(0.0, -weight))
    time, y = history["time"].values, history["bob.y"].values

    def misfit(p):
        return p[0] + p[1] * np.cos(p[2] * time) + p[3] * np.sin(p[2] * time) - y

    found = least_squares(misfit, [y.mean(), -y.mean(), rate, 0.0], x_scale=[0.01, 0.01, 10, 0.01])
    # Shear, which the beam has not, is 0.6 (height / length)^2 = 1.5e-3 of the deflection at most.
    assert found.x[2] == pytest.approx(rate, rel=1.5e-3)
    assert -found.x[0] == pytest.approx(sunk, rel=3e-3)
    assert drift(history["total_energy"].values) < 1e-7 * history["kinetic_energy"].values.max()
    assert history["weld.force"].values.mean() == pytest.approx(load, rel=0.1)


def test_pendulum_on_a_free_block_keeps_momentum_and_energy():
    way = {"velocity": [0.1, 0.2]}
    history = run([block(**way), bob(2.0, (0.1, 0.2))], [hinge("block/top", "bob")], 0.2, 1e-3)
    # To the rounding of the solid's solutions: the block alone is off by 4e-10 after 500 steps.
    assert drift(history["momentum.x"].values) < 1e-8
    assert drift(history["momentum.y"].values) < 1e-8
    assert drift(history["total_energy"].values) < 1e-8
    assert np.abs(history["pin.moment"].values).max() < 1e-12
    # The other way round it is the same motion; the coordinate is that of the second side.
    other = run([bob(2.0, (0.1, 0.2)), block(**way)], [hinge("bob", "block/top")], 0.2, 1e-3)
    for name in ("bob.x", "bob.angle", "block.x", "pin.force"):
        np.testing.assert_allclose(other[name].values, history[name].values, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(other["pin.q"].values, -history["pin.q"].values, atol=1e-8)


def test_angular_momentum_is_kept_to_the_order_of_the_turn():
    # Arms in a solid of small strain do not turn: what is lost is the force's moment about them.
    lost = []
    for spin in (2.0, 0.2):
        history = run([block(1e8), bob(spin)], [hinge("block/top", "bob")], 0.3, 1e-3)
        lost.append(
            drift(history["angular_momentum"].values) / history["angular_momentum"].values[0]
        )
    assert lost[0] < 5e-3
    assert lost[1] < 0.02 * lost[0]


def test_hinge_on_a_stiff_block_is_the_hinge_on_what_is_rigid():
    rigid = run([bob(2.0)], [hinge("ground", "bob")], 0.3, 1e-3, gravity=(0.0, -9.81))
    off = []
    for modulus in (1e7, 1e8):
        base = block(modulus, supports=[{"surface": "bottom", "kind": "fixed"}])
        history = run([base, bob(2.0)], [hinge("block/top", "bob")], 0.3, 1e-3, (0.0, -9.81))
        off.append(np.abs(history["bob.angle"].values - rigid["bob.angle"].values).max())
    assert off[1] < 2e-5
    assert off[1] == pytest.approx(0.1 * off[0], rel=0.3)


def test_free_block_that_hardly_turns_moves_as_a_rigid_one():
    # The hinge is not in the middle of the surface, so that moments turn it.
    shape = {"kind": "block", "size": [0.2, 0.1], "corner": [-0.04, -0.1]}
    still = RigidBody(name="block", density=1000.0, shape=shape)
    rigid = run([still, bob(0.2)], [hinge("block", "bob")], 0.3, 1e-3)
    history = run([block(1e9, shape=shape), bob(0.2)], [hinge("block/top", "bob")], 0.3, 1e-3)
    for name in ("bob.x", "bob.angle", "block.x", "block.angle"):
        want = rigid[name].values
        assert np.abs(history[name].values - want).max() < 2e-3 * drift(want)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_tip_is_the_mean_by_area_on_any_mesh(degree):
    corner = {"point": [-0.1, 0.0], "radius": 0.05, "size": 0.01}
    turning = {"velocity": [0.3, 0.2], "angular_velocity": 2.0}
    body = block(refine=[corner], degree=degree, **turning)
    rope = hinge(
        "ground", "block/top", kind="distance", point=None, limits=[0, 1], radius=1.0,
        points=[[0.0, 0.2], [0.05, 0.0]],
    )  # fmt: skip
    scene = made([body], [rope], 0.1, 1e-3)
    found = solids_model(scene, (degree,), updated=True).joints
    np.testing.assert_allclose(found.places[1], [0.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.spins[1], [0.0, 0.0, 2.0], atol=1e-12)
    # The centre of mass is 0.05 below, the surface turns about it.
    np.testing.assert_allclose(found.speeds[1], [0.2, 0.2, 0.0], atol=1e-12)


@pytest.mark.parametrize("kind", ["fixed", "universal"])
def test_a_stiff_block_in_space_is_moved_and_turned_about_all_axes_as_a_rigid_one(kind):
    shape = {"kind": "block", "size": [0.2, 0.16, 0.1], "corner": [-0.08, -0.05, -0.1]}
    ball = RigidBody(
        name="bob", shape={"kind": "sphere", "radius": 0.05, "center": [0.1, 0.05, 0.3]}, mass=2.0,
        force=["0.03", "-0.02", "0.01"], moment=["0.001", "0.002", "-0.003"],
    )  # fmt: skip
    axes = {"axis": [1.0, 0.0, 0.0], "second_axis": [0.0, 1.0, 0.0]} if kind == "universal" else {}
    still = RigidBody(name="block", density=1000.0, shape=shape)
    solid = block(1e11, shape=shape, model="3d")
    rigid, history = (
        run([base, ball], [hinge(side, "bob", kind=kind, point=[0.0] * 3, **axes)], 0.1, 1e-3,
            [0.0] * 3)
        for base, side in ((still, "block"), (solid, "block/top"))
    )  # fmt: skip
    for body in ("bob", "block"):
        for names in (("vx", "vy", "vz"), ("wx", "wy", "wz")):
            found, want = (
                np.array([each[f"{body}.{name}"].values for name in names])
                for each in (history, rigid)
            )
            off = np.linalg.norm(found - want, axis=0).max()
            assert off < 3e-3 * np.linalg.norm(want, axis=0).max()  # 3e-4: it turns by 7e-4 rad


def test_a_spring_between_a_block_and_a_mass_has_the_frequency_of_both():
    stiffness, heavy, light = 2000.0, 20.0, 5.0
    mass = RigidBody(
        name="mass", mass=light, velocity=[0.1, 0.0],
        shape={"kind": "disc", "radius": 0.02, "center": [0.3, -0.05]},
    )  # fmt: skip
    slide = hinge(
        "block/right", "mass", kind="prismatic", axis=[1.0, 0.0], point=[0.1, -0.05],
        stiffness=stiffness,
    )  # fmt: skip
    rate = np.sqrt(stiffness * (1.0 / heavy + 1.0 / light))
    history = run([block(1e9), mass], [slide], 2 * np.pi / rate, 2 * np.pi / rate / 200)
    want = 0.1 / rate * np.sin(rate * history["time"].values)
    np.testing.assert_allclose(history["pin.q"].values, want, atol=1e-3 * 0.1 / rate)
    assert drift(history["total_energy"].values) < 1e-8


def test_limits_turn_the_rate_of_the_coordinate():
    mass = RigidBody(
        name="mass", mass=5.0, velocity=[1.0, 0.0],
        shape={"kind": "disc", "radius": 0.02, "center": [0.3, -0.05]},
    )  # fmt: skip
    slide = hinge(
        "block/right", "mass", kind="prismatic", axis=[1.0, 0.0], point=[0.1, -0.05],
        limits=[-0.01, 0.00999], restitution=0.5,
    )  # fmt: skip
    history = run([block(1e7), mass], [slide], 0.015, 1e-4)
    rates = history["pin.v"].values
    k = int(np.flatnonzero(rates < 0.0)[0])
    assert rates[k - 1] == pytest.approx(1.0, abs=1e-9)
    assert rates[k] == pytest.approx(-0.5, abs=1e-6)  # 5e-9: rates are projected
    assert drift(history["momentum.x"].values) < 1e-8
    assert np.diff(history["total_energy"].values).max() < 1e-8


def landing(dim=2, corner=-0.05, kind="fixed", **more):
    """A block that lands with a rigid body on its top."""
    size, top = ([0.2, 0.1], [0.1, 0.05]) if dim == 2 else ([0.2, 0.2, 0.1], [0.1, 0.1, 0.05])
    across = [0.0] * (dim - 2)
    low, high = [-0.1, *(-0.1 for _ in across), 0.002], [corner, *(-0.05 for _ in across), 0.102]
    down, up = [0.0, *across, -1.0], [0.0, *across, 1.0]
    sizes = {"mesh_size": 0.03 if dim == 2 else 0.05, "model": "plane_stress" if dim == 2 else "3d"}
    below = block(1e6, shape={"kind": "block", "size": size, "corner": low}, velocity=down, **sizes)
    above = RigidBody(
        name="bob", mass=10.0, shape={"kind": "block", "size": top, "corner": high}, velocity=down
    )
    axis = {"axis": [0.0, 1.0, 0.0]} if dim == 3 and kind == "revolute" else {}
    joint = hinge("block/top", "bob", kind=kind, point=[0.0, *across, 0.102], **axis)
    floor = HalfSpace(name="floor", point=[0.0] * dim, normal=up)
    contacts = [Contact(between=["block", "floor"], **more)]
    return made(
        [below, above], [joint], 0.03, 5e-4, [0.0] * dim, contacts=contacts, obstacles=[floor]
    )


@pytest.mark.parametrize(("dim", "kind"), [(2, "fixed"), (2, "revolute"), (3, "fixed")])
def test_block_that_lands_with_a_body_on_it_keeps_its_energy(dim, kind):
    history = solve(landing(dim, kind=kind)).history
    energy = history["total_energy"].values
    # Answers of a layer are linear, tips turn within it: 1.5e-5 in space, 1e-7 in the plane.
    assert drift(energy) < 1e-4 * energy[0]
    assert history["contact_force"].values.max() > 1000.0


@pytest.mark.parallel([1, 2])
def test_restart_goes_on_to_the_last_bit(tmp_path, monkeypatch):
    rubbing = landing(corner=-0.02, kind="revolute", friction_coefficient=0.3)
    rubbing = replace(rubbing, output=Output(checkpoint=10))
    check_restart(rubbing, 35, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    both = solve(landing(corner=-0.02, kind="revolute"))
    with alone(monkeypatch):
        one = solve(landing(corner=-0.02, kind="revolute"))
    for name in one.history.data_vars:
        if name in {"active", "gap"}:  # which of touching nodes counts is a matter of rounding
            continue
        values = one.history[name].values
        size = max(1.0, np.nanmax(np.abs(values)))
        np.testing.assert_allclose(both.history[name].values, values, atol=1e-10 * size)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"between": ["block/topp", "bob"]}, 'no surface "block/topp"; did you mean "top"'),
        ({"between": ["block", "bob"]}, 'joints hold surfaces: give "block/SURFACE"'),
        ({"radius": 0.01}, r"radius = 0.01: 0 nodes of block/top .*; give 0.0144 or more"),
        ({"between": ["ground", "bob"], "radius": 0.1}, "pin holds none: remove it"),
    ],
)
def test_surfaces_that_cannot_be_held_are_refused(change, text):
    scene, contacts = landing(), [Contact(between=["block/bottom", "floor"])]
    with pytest.raises(SceneError, match=text):
        plan(replace(scene, joints=[replace(scene.joints[0], **change)], contacts=contacts))


BOARD = {"kind": "block", "size": [0.06, 1e-3], "corner": [-0.03, 0.0]}
PADS = """SetFactory("OpenCASCADE");
Point(1)={-.03,0,0}; Point(2)={-.029,0,0}; Point(3)={-.027,0,0}; Point(4)={.027,0,0};
Point(5)={.029,0,0}; Point(6)={.03,0,0}; Point(7)={.03,.001,0}; Point(8)={-.03,.001,0};
For k In {1:7}
  Line(k)={k,k+1};
EndFor
Line(8)={8,1};
Curve Loop(1)={1:8}; Plane Surface(1)={1};
Physical Surface("fr4")={1}; Physical Curve("pad1")={2}; Physical Curve("pad2")={4};
"""


def board(sides, **more):
    """A board on two screws under its weight, at rest."""
    body = Solid(
        name="board", model="plane_strain", mesh_size=5e-4, degree=2, density=1900.0,
        youngs_modulus=2.2e10, poisson_ratio=0.15, **({"shape": BOARD} | more),
    )  # fmt: skip
    screws = [
        Joint(name=f"screw{k}", kind="fixed", between=["ground", side], point=[x, 0.0], radius=r)
        for k, (x, side, r) in enumerate(sides)
    ]
    probe = Probe(name="mid", body="board", point=[0.0, 0.0])
    return made([body], screws, 4e-6, 4e-6, (0.0, -1000.0), probes=[probe], start="static")


def test_screws_on_one_surface_hold_the_regions_about_them(tmp_path):
    path = tmp_path / "board.geo"
    path.write_text(PADS)
    places = (-0.028, 0.028)
    marked = board(
        [(x, f"board/pad{k + 1}", 1.0) for k, x in enumerate(places)], shape=None, mesh=str(path)
    )
    scenes = [marked] + [board([(x, "board/bottom", r) for x in places]) for r in (1e-3, None)]
    sags = [-solve(scene).history["mid.uy"].values[0] for scene in scenes]
    stiffness = 2.2e10 / (1.0 - 0.15**2) * 1e-9 / 12.0
    theory = 1900.0 * 1e-3 * 1000.0 * 0.056**4 / (384.0 * stiffness)  # clamped, of Euler
    assert sags[0] == pytest.approx(theory, rel=0.03)
    np.testing.assert_allclose(sags[1:], sags[0], rtol=0.01)  # 0.4 %: meshes differ
    said = plan(scenes[2]).reasons["joint on board/bottom at (0.028, 0)"]
    assert "9 of 241 nodes" in said
    assert "half way to its nearest edge" in said


@pytest.mark.parametrize(("other", "given"), [(0.03, r"0.004: .* below 0.001"), (0.028, "one rad")])
def test_regions_that_share_nodes_are_refused(other, given):
    scene = board([(0.028, "board/bottom", 2e-3), (other, "board/bottom", 4e-3)])
    with pytest.raises(SceneError, match=rf"joint\[1\].radius = .*{given}"):
        plan(scene)


def test_what_joints_hold_does_not_touch():
    scene = landing(kind="revolute")
    low = replace(scene.joints[0], between=["ground", "block/bottom"], point=[0.05, 0.002])
    above = {"kind": "block", "size": [0.2, 0.1], "corner": [-0.1, 0.104]}
    lid = replace(block(mesh_size=0.03, shape=above), name="lid")
    joints = [replace(low, name="low", radius=0.03), replace(scene.joints[0], radius=0.03)]
    laws = [*scene.contacts, Contact(between=["block", "lid"])]
    both = replace(scene, bodies=[*scene.bodies, lid], joints=joints, contacts=laws)
    model = solids_model(both, (1, 1))
    held = np.concatenate([region.numbers for region in model.parts[0].regions.values()])
    assert len(held) == 4
    assert not np.isin(held, model.numbers[0]).any()
    assert model.pairs
    said = [text for text in model.parts[0].contact.why if "held by joints" in text]
    assert said
    assert said[0].startswith("4 nodes (bottom 2, top 2)")


def test_plans_foresee_no_flight_of_what_joints_hold_and_say_what_counts():
    scene = made(
        [block()], [hinge("ground", "block/left", point=[-0.1, -0.05])], 0.5, 1e-3, (0.0, -9.81),
        obstacles=[HalfSpace(name="floor", point=[0.0, -0.12], normal=[0.0, 1.0])],
    )  # fmt: skip
    found = plan(scene)
    said = found.reasons["joint on block/left at (-0.1, -0.05)"]
    assert said.startswith("the mean of all 3 nodes, those within 0.05 m")
    assert not any(name.startswith("offer") for name in found.reasons)
    assert "meets_nothing" not in {finding.code for finding in found.findings}
