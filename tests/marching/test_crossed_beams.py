"""Beams in space that meet between nodes: crossed beams, and edges of rigid bodies, in statics,
impacts and sliding."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene

STEEL = {"density": 7800.0, "youngs_modulus": 2.1e11}
HELD = {"end": "first", "kind": "clamped"}
GRAVITY = 9.81


def beam(name, length, height, width, **more):
    sizes = {"length": length, "height": height, "width": width}
    return {"kind": "beam", "name": name} | STEEL | sizes | more


def scene(bodies, duration, dt, **more):
    given = {"title": "crossed", "duration": duration, "gravity": [0.0, 0.0, 0.0], "body": bodies,
             "solve": {"dt": dt, "estimate": False}, "output": {"fields": []}}  # fmt: skip
    return Scene.from_dict(given | more)


def sag_and_give(length, height, width, x):
    """Deflection of a cantilever by its weight, and by a unit force, at x."""
    weight, bending = 7800.0 * height * width * GRAVITY, 2.1e11 * width * height**3 / 12.0
    return weight * x**2 * (6 * length**2 - 4 * length * x + x**2) / (24 * bending), x**3 / (
        3 * bending
    )


STATIC = {"gravity": [0.0, 0.0, -GRAVITY], "start": "static"}


@pytest.mark.parametrize(
    ("angle", "upper", "lower", "friction"),
    [(0.5 * np.pi, 0.3, 0.33, 0.0), (1.1, 0.31, 0.29, 0.3), (0.3, 0.31, 0.29, 0.0)],
    ids=["node on node", "askew", "nearly along"],
)
def test_crossed_cantilevers_press_with_the_force_of_euler_and_bernoulli(
    angle, upper, lower, friction
):
    """Of 1 / (c_1 + c_2) by what their weights would bend them into each other."""
    up, low, gap = (0.4, 0.003, 0.02), (0.44, 0.01, 0.01), 1e-5
    way = np.array([np.cos(angle), np.sin(angle), 0.0])
    one = beam("up", *up, center=[0.2, 0.0, 0.0065 + gap], supports=[HELD])
    centre = np.array([upper, 0.0, 0.0]) + (0.22 - lower) * way
    two = beam("low", *low, center=centre.tolist(), axis=way.tolist(), supports=[HELD])
    law = {"between": ["up", "low"], "friction_coefficient": friction}
    history = impactfem.solve(scene([one, two], 1e-4, 1e-5, contact=[law], **STATIC)).history
    (sag, give), (less, gives) = sag_and_give(*up, upper), sag_and_give(*low, lower)
    force = history["force.up.low"].values
    # Slopes of .4 %, and what a curve through nodes makes of a force between them.
    np.testing.assert_allclose(force, (sag - less - gap) / (give + gives), rtol=2e-4)
    assert np.ptp(force) < 1e-6 * force[0]
    assert np.abs(history["gap.up.low"].values).max() < 1e-10


def box(name, size, corner, **more):
    shape = {"kind": "block", "size": size, "corner": corner}
    return {"kind": "rigid", "name": name, "density": 7800.0, "shape": shape} | more


@pytest.mark.parametrize(("edge", "angle"), [(0.27, 0.4), (0.275, 0.0)])
def test_a_cantilever_lies_on_the_edge_of_a_rigid_box(edge, angle):
    """The edge that is farther out, askew between nodes, or at one: the beam bends over it."""
    size, gap = (0.4, 0.003, 0.01), 1e-5
    far = np.array([edge - 0.05 * np.cos(angle), -0.05 * np.sin(angle)])
    turned = {"axis": [0.0, 0.0, 1.0], "angle": angle}
    under = box("box", [0.1, 0.08, 0.05], [*(far - [0.05, 0.04]), 0.0], orientation=turned)
    over = beam("beam", *size, center=[0.2, 0.0, 0.0515 + gap], supports=[HELD])
    floor = {"kind": "half_space", "name": "floor", "point": [0, 0, 0], "normal": [0, 0, 1]}
    laws = [{"between": ["beam", "box"]}]
    laws.append({"between": ["box", "floor"], "friction_coefficient": 0.3})
    made = scene([over, under], 5e-5, 1e-5, obstacle=[floor], contact=laws, **STATIC)
    force = impactfem.solve(made).history["force.beam.box"].values
    sag, give = sag_and_give(*size, edge)
    np.testing.assert_allclose(force, (sag - gap) / give, rtol=2e-5)


def crossed(kind, law=None, duration=1.2e-3, dt=1e-5, stiff=2.1e11, fast=0.5, **more):
    """A slender body that falls across another one, askew: beams, or capsules, or one of each."""
    length, thick = 0.2, 0.004
    mass = 7800.0 * length * thick**2
    bodies = []
    for name, centre, axis, speed in (
        ("a", [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
        ("b", [0.043, 0.027, 0.0042], [0.3, 1.0, 0.0], [0.1, 0.0, -fast]),
    ):
        if kind in ("beams", name):
            own = beam(name, length, thick, thick, elements=6, center=centre, axis=axis)
            bodies.append(own | {"velocity": speed, "youngs_modulus": stiff} | more)
            continue
        shape = {"kind": "capsule", "radius": 0.5 * thick, "length": length, "center": centre,
                 "axis": axis}  # fmt: skip
        way = np.array(axis) / np.linalg.norm(axis)
        across, along = mass * length**2 / 12.0, mass * thick**2 / 6.0
        inertia = across * np.eye(3) + (along - across) * np.outer(way, way)
        bodies.append({"kind": "rigid", "name": name, "shape": shape, "mass": mass,
                       "inertia": inertia.tolist(), "velocity": speed})  # fmt: skip
    return scene(bodies, duration, dt, contact=[{"between": ["a", "b"]} | (law or {})])


@pytest.mark.parametrize("kind", ["beams", "a"])
@pytest.mark.parametrize("restitution", [0.0, 1.0])
def test_crossed_bodies_keep_their_momenta_and_their_energy(kind, restitution):
    history = impactfem.solve(crossed(kind, {"restitution": restitution})).history
    assert history["b.vz"].values[-1] > -0.49
    momentum, angular = (
        np.array([history[f"{name}.{k}"].values for k in "xyz"])
        for name in ("momentum", "angular_momentum")
    )
    assert np.ptp(momentum, axis=1).max() < 1e-12 * np.abs(momentum).max()
    # Arms of small strains.
    assert np.ptp(angular, axis=1).max() < 1e-5 * np.abs(angular).max()
    energy = history["total_energy"].values
    assert np.diff(energy).max() < 1e-9 * energy[0]
    if restitution:
        np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


@pytest.mark.parametrize("kind", ["beams", "a"])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_beams_so_stiff_that_they_hardly_bend_are_as_rigid_capsules(kind, restitution):
    """Their bending is damped within a step."""
    law, damped = {"restitution": restitution}, {"rayleigh": [0.0, 1e-5]}
    found, known = (
        impactfem.solve(each).history
        for each in (crossed(kind, law, stiff=2e17, **damped), crossed("none", law))
    )
    for name in "ab":
        for axis in ("vx", "vz", "wx", "wy"):
            speed = known[f"{name}.{axis}"].values[-1]
            assert found[f"{name}.{axis}"].values[-1] == pytest.approx(speed, rel=2e-3, abs=1e-6)


def sliding(friction, **more):
    """A strip that lies on two rails askew and slides over them: over nodes of all."""
    ends = [{"end": end, "kind": "clamped"} for end in ("first", "last")]
    own = {"elements": 4, "axis": [0.3, 1.0, 0.0], "supports": ends, "damping_ratio": 0.3}
    bodies = [
        beam(name, 0.1, 0.006, 0.01, center=[x, 0.003, 0.0], **own)
        for name, x in (("left", -0.065), ("right", 0.059))
    ]
    bodies.append(
        beam("strip", 0.3, 0.004, 0.01, elements=12, center=[0.0, 0.0, 0.005],
             velocity=[1.0, 0.0, 0.0], rayleigh=[0.0, 2e-4])
    )  # fmt: skip
    laws = [{"between": ["strip", n], "friction_coefficient": friction} for n in ("left", "right")]
    gravity = [0.0, 0.0, -GRAVITY]
    return scene(bodies, 0.012, 4e-5, contact=laws, gravity=gravity, **more)


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_a_strip_slides_over_rails_without_a_jump_of_force(friction):
    """Nodes pass over the rails at 9 ms: on chords the force would jump by a third."""
    history, weight = impactfem.solve(sliding(friction)).history, 7800.0 * 1.2e-5 * GRAVITY
    late = history["time"].values > 6e-3
    forces = [history[f"force.strip.{n}"].values[late] for n in ("left", "right")]
    for force in forces:
        assert np.abs(np.diff(force)).max() < 5e-3 * weight
    assert np.mean(forces) == pytest.approx(0.5 * weight, rel=0.02)
    speed = history["strip.vx"].values[-1]
    assert speed == pytest.approx(1.0 - friction * GRAVITY * 0.012, abs=1e-3)


def test_a_beam_that_would_pass_through_another_one_in_a_step_is_told():
    found = impactfem.solve(crossed("beams", dt=1e-4, duration=2e-4, fast=60.0))
    told = [f for f in found.summary["verdict"]["findings"] if f["code"] == "contact_unresolved"]
    assert "pass through" in told[0]["text"]


def falling(output=None):
    """A box, edge first, and a beam that fall across another one."""
    lower = beam("low", 0.2, 0.004, 0.01, elements=5, center=[0.0, 0.0, 0.0])
    upper = beam("up", 0.2, 0.004, 0.01, elements=4, center=[0.03, 0.01, 0.0042],
                 axis=[0.2, 1.0, 0.0], velocity=[0.2, 0.0, -0.5])  # fmt: skip
    turned = {"axis": [0.1, 1.0, 0.0], "angle": 0.5}
    third = box("box", [0.03, 0.05, 0.02], [-0.075, -0.02, 0.0085], orientation=turned,
                velocity=[0.1, 0.0, -0.5])  # fmt: skip
    law = {"between": ["*", "*"], "friction_coefficient": 0.2, "restitution": 0.3}
    return scene(
        [lower, upper, third], 1.2e-3, 1e-5, contact=[law], output=output or {"fields": []}
    )


def test_a_continued_run_equals_the_whole_one(tmp_path, monkeypatch):
    made = falling({"fields": [], "checkpoint": 25})
    whole, _ = check_restart(made, 70, tmp_path, monkeypatch)
    for pair in ("low.up", "low.box"):
        assert whole.history[f"force.{pair}"].values.max() > 0.0


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    check_ranks(falling, monkeypatch)
