"""Beams in space: frequencies, statics and torsion known in closed form; beams said in the plane,
by joints or turned in space; contact with plates, points and obstacles."""

import numpy as np
import pytest
from scipy.linalg import eigh

from impactfem import (
    Beam,
    Contact,
    HalfSpace,
    Joint,
    Output,
    Plate,
    Point,
    Probe,
    Scene,
    Solid,
    Solve,
    solve,
)
from impactfem.errors import SceneError
from impactfem.shapes import Block, RectangleOutline
from impactfem.system.beam_parts import beam_parts, torsion_constant

STEEL = {"density": 7800.0, "youngs_modulus": 2.1e11}
SIZES = {"length": 0.2, "height": 0.004, "width": 0.01}
ODD = {"axis": [1.0, 2.0, 2.0], "width_axis": [0.0, 1.0, -0.3]}
CLAMPED = {"end": "first", "kind": "clamped"}
LAST = {"end": "last"}
ROOTS = [
    ([], [4.730041, 7.853205]),
    ([CLAMPED], [1.875104, 4.694091]),
    ([CLAMPED, LAST | {"kind": "clamped"}], [4.730041, 7.853205]),
    ([CLAMPED, LAST | {"kind": "simply_supported"}], [3.926602, 7.068583]),
    ([{"end": e, "kind": "simply_supported"} for e in ("first", "last")], [np.pi, 2 * np.pi]),
]


def run(bodies, duration, dt, gravity, *, obstacles=(), joints=(), contacts=(), probes=()):
    scene = Scene(
        title="beams", duration=duration, gravity=list(gravity), bodies=bodies,
        obstacles=obstacles, joints=joints, contacts=contacts, probes=probes,
        solve=Solve(dt=dt, estimate=False), output=Output(fields=[]),
    )  # fmt: skip
    return solve(scene).history


@pytest.mark.parametrize(("supports", "roots"), ROOTS)
def test_bending_frequencies_about_both_axes_and_the_first_is_that_of_the_scene(supports, roots):
    beam = Beam(**STEEL, **SIZES, **ODD, center=[1.0, 2.0, 3.0], supports=supports)
    parts = beam_parts(beam)
    found = np.sqrt(np.maximum(eigh(parts.stiffness, parts.mass, eigvals_only=True), 0.0))
    found = found[found > 1.0]
    speed = np.sqrt(2.1e11 / 7800.0 / 12.0)
    for size in (0.004, 0.01):
        for root in roots:
            known = (root / 0.2) ** 2 * size * speed
            # Cubic elements, 16 of them: 4e-5 for the second mode (docs/beams.md).
            assert np.abs(found / known - 1.0).min() < 1e-4
    assert found[0] == pytest.approx(beam.first_frequency, rel=1e-4)


def test_a_twisted_cantilever_and_a_bent_one():
    """M L / G J with J of Saint-Venant (a square: .140577 a^4), F L^3 / 3 E I about both axes."""
    assert torsion_constant(1.0, 1.0) == pytest.approx(0.1405770, abs=1e-6)
    assert torsion_constant(0.1, 1.0) == pytest.approx(0.3123250e-3, rel=1e-5)
    beam = Beam(**STEEL, **SIZES, **ODD, center=[0.0, 0.0, 0.0], supports=[CLAMPED])
    parts, frame = beam_parts(beam), beam.frame
    tip = parts.section(0.1)
    shear = 2.1e11 / 2.6
    stiff = [shear * torsion_constant(0.004, 0.01) / 0.2]
    stiff += [3 * 2.1e11 * 0.01 * 0.004**3 / 12 / 0.2**3]
    stiff += [3 * 2.1e11 * 0.004 * 0.01**3 / 12 / 0.2**3, 2.1e11 * 4e-5 / 0.2]
    loads = [np.r_[0, 0, 0, frame[0]], np.r_[frame[1], 0, 0, 0], np.r_[frame[2], 0, 0, 0]]
    loads += [np.r_[frame[0], 0, 0, 0]]
    for load, known in zip(loads, stiff, strict=True):
        moved = tip @ np.linalg.solve(parts.stiffness, tip.T @ load)
        assert load @ moved == pytest.approx(1.0 / known, rel=1e-9)


@pytest.mark.parametrize("theory", ["euler_bernoulli", "timoshenko"])
def test_rigid_motions_move_sections_as_they_should_and_strain_nothing(theory):
    beam = Beam(**STEEL, **SIZES, **ODD, center=[1.0, 2.0, 3.0], theory=theory)
    parts, turn = beam_parts(beam), np.array([1.0, -2.0, 0.5])
    q = parts.rigid_modes @ np.r_[3.0, 4.0, 5.0, turn]
    for s in (-0.1, 0.013, 0.1):
        known = np.r_[np.array([3.0, 4.0, 5.0]) + np.cross(turn, s * beam.frame[0]), turn]
        np.testing.assert_allclose(parts.section(s) @ q, known, atol=1e-12)
    pushed = np.abs(parts.stiffness) @ np.abs(q)
    assert np.abs(parts.stiffness @ q).max() < 1e-13 * pushed.max()
    mass = parts.momenta.T @ parts.rigid_modes
    np.testing.assert_allclose(mass[:3, :3], beam.mass * np.eye(3), atol=1e-12 * beam.mass)
    along, height, wide = (a @ parts.inertia @ a for a in beam.frame)
    assert along == pytest.approx(beam.mass * (0.004**2 + 0.01**2) / 12, rel=1e-9)
    # Sections of an Euler-Bernoulli beam have no inertia of their own.
    thick = np.array([0.01, 0.004]) * (theory == "timoshenko")
    for found, size in zip((height, wide), thick, strict=True):
        assert found == pytest.approx(beam.mass * (0.2**2 + size**2) / 12, rel=1e-9)


def test_springs_at_an_end_carry_a_rigid_beam():
    """Softer than the beam by far: sqrt(k / m) thrice, and M / k_t of a moment about the axis."""
    support = {"end": "first", "kind": "elastic", "stiffness": 10.0, "rotational_stiffness": 2.0}
    beam = Beam(**STEEL, **SIZES, **ODD, center=[0.0, 0.0, 0.0], supports=[support])
    parts = beam_parts(beam)
    start = parts.section(-0.1)
    for k, stiffness in enumerate([10.0] * 3 + [2.0] * 3):
        load = np.eye(6)[k]
        moved = start @ np.linalg.solve(parts.stiffness, start.T @ load)
        assert load @ moved == pytest.approx(1.0 / stiffness, rel=1e-6)


def fall(space):
    """A beam that falls onto a floor with one end first, in the plane or in a plane of space."""
    own = {"elements": 8, "contact": "along", "theory": "timoshenko"}
    turn = np.array([[0.6, 0.8], [0.0, 0.0], [-0.8, 0.6]]) if space else np.eye(2)
    along = turn @ [np.cos(0.3), np.sin(0.3)]
    across = [0.0, -1.0, 0.0]  # of x and z the way from x to z turns about -y
    more = {"axis": along.tolist(), "width_axis": across} if space else {"inclination": 0.3}
    beam = Beam(
        **STEEL, **SIZES, **own, **more, center=(turn @ [0.1, 0.0302]).tolist(),
        velocity=(turn @ [0.5, -1.0]).tolist(),
        angular_velocity=[0.0, -2.0, 0.0] if space else 2.0,
    )  # fmt: skip
    zero = (turn @ [0.0, 0.0]).tolist()
    floor = HalfSpace(name="floor", point=zero, normal=(turn @ [0.0, 1.0]).tolist())
    law = Contact(between=["beam", "floor"], restitution=0.3, friction_coefficient=0.2)
    history = run(
        [beam], 1e-3, 1e-6, turn @ [0.0, -9.81], obstacles=[floor], contacts=[law]
    )  # fmt: skip
    return history, turn


def test_a_beam_in_a_plane_of_space_moves_as_in_the_plane():
    plane, _ = fall(space=False)
    space, turn = fall(space=True)
    forces = plane["contact_force"].values
    assert forces.max() > 0.0
    np.testing.assert_allclose(space["contact_force"].values, forces, atol=1e-8 * forces.max())
    centre = np.array([plane[f"beam.{k}"].values for k in "xy"])
    found = np.array([space[f"beam.{k}"].values for k in "xyz"])
    np.testing.assert_allclose(found, turn @ centre, atol=1e-12)
    np.testing.assert_allclose(
        space["total_energy"].values, plane["total_energy"].values, rtol=1e-9
    )


def test_a_clamped_end_is_one_that_a_joint_holds():
    """The joint holds the section by forces: both have the same motion."""
    gravity = (3.0, 0.0, -9.81)
    own = {"elements": 6, "center": [0.1, 0.0, 0.0], "contact": "ends"}
    tip = Probe(name="tip", body="beam", point=[0.2, 0.0, 0.0])
    floor = HalfSpace(name="floor", point=[0.0, 0.0, -1.5e-5], normal=[0.0, 0.0, 1.0])
    given = {"obstacles": [floor], "probes": [tip]}
    one = run([Beam(**STEEL, **SIZES, **own, supports=[CLAMPED])], 0.006, 1e-5, gravity, **given)
    clamp = Joint(name="clamp", kind="fixed", between=["ground", "beam"], point=[0.0, 0.0, 0.0])
    two = run([Beam(**STEEL, **SIZES, **own)], 0.006, 1e-5, gravity, joints=[clamp], **given)
    moved = one["tip.uz"].values
    assert moved.min() < -1.4e-5
    np.testing.assert_allclose(two["tip.uz"].values, moved, atol=1e-6 * np.ptp(moved))


def test_a_free_beam_strikes_a_free_plate_and_keeps_what_it_should():
    """Momentum of both, and energy but for what closest places that slide cost (first order)."""
    plate = Plate(
        name="plate", outline=RectangleOutline(size=[0.2, 0.1]), thickness=0.004, mesh_size=0.025,
        poisson_ratio=0.3, center=[0.0, 0.0, 0.0], **STEEL,
    )  # fmt: skip
    beam = Beam(
        **STEEL, **SIZES, elements=8, center=[0.0, 0.0, 0.0046], axis=[1.0, 0.4, 0.005],
        velocity=[0.0, 0.0, -0.5],
    )  # fmt: skip
    history = run([plate, beam], 4e-3, 4e-6, (0.0, 0.0, 0.0))
    momentum, energy = history["momentum.z"].values, history["total_energy"].values
    assert history["contact_force"].values.max() > 100.0
    assert np.ptp(momentum) < 1e-10 * np.abs(momentum[0])
    assert np.ptp(energy) < 1e-4 * energy[0]
    assert history["plate.vz"].values[-1] < -0.02


def test_a_ball_that_falls_onto_a_supported_beam_has_the_force_of_its_modes():
    """Hertz' contact at midspan against an ordinary differential equation of 40 modes."""
    stiffness, mass, speed, length = 1e9, 0.02, 0.5, 0.2
    ends = [{"end": e, "kind": "simply_supported"} for e in ("first", "last")]
    beam = Beam(
        **STEEL, **SIZES, elements=40, center=[0.0, 0.0, 0.0], supports=ends,
    )  # fmt: skip
    ball = Point(
        name="ball", mass=mass, radius=0.005, position=[0.0, 0.0, 0.007], velocity=[0, 0, -speed]
    )
    law = Contact(between=["ball", "beam"], stiffness=stiffness, stiffness_exponent=1.5)
    dt = 5e-7
    history = run([ball, beam], 4e-4, dt, (0.0, 0.0, 0.0), contacts=[law])
    odd = np.arange(1, 80, 2)
    rate = (odd * np.pi / length) ** 2 * np.sqrt(2.1e11 / 7800.0 / 12.0) * 0.004
    own, step = 0.5 * beam.mass, dt / 8
    q, v, z, w = np.zeros(len(odd)), np.zeros(len(odd)), 0.0, -speed
    forces = []
    phase, sign = np.cos(rate * step), np.sin(rate * step)
    for _ in range(round(4e-4 / step)):  # modes exactly between forces, the ball by leapfrog
        dent = max(np.sin(odd * np.pi / 2) @ q - z, 0.0)
        force = stiffness * dent**1.5
        forces.append(force)
        v = v - step * force * np.sin(odd * np.pi / 2) / own
        w, z = w + step * force / mass, z + step * (w + step * force / mass)
        q, v = phase * q + sign / rate * v, phase * v - rate * sign * q
    peak, impulse = max(forces), step * sum(forces)
    assert history["contact_force"].values.max() == pytest.approx(peak, rel=5e-3)
    assert mass * (history["ball.vz"].values[-1] + speed) == pytest.approx(impulse, rel=5e-3)


def test_what_held_ends_would_stretch_is_told():
    """A simply supported beam with w = a sin is stiffer by 3 (a / h)^2: u + u^3 / 4 r^2."""
    ends = [{"end": e, "kind": "simply_supported"} for e in ("first", "last")]
    parts = beam_parts(Beam(**STEEL, **SIZES, elements=64, center=[0.0] * 3, supports=ends))
    _, modes = eigh(parts.stiffness, parts.mass, subset_by_index=(0, 0))
    moved = (parts.jacobian @ modes[:, 0]).reshape(-1, 3)
    q = modes[:, 0] * 0.002 / np.abs(moved).max()
    stiffer = 2.0 * parts.stretching(q) / parts.elastic(q)
    assert stiffer == pytest.approx(3.0 * 0.5**2, rel=2e-3)


def test_it_is_told_beside_bodies_whose_steps_are_iterated():
    """As it is without: 170 to 180 % of a beam that a ball bends by two heights."""
    ends = [{"end": e, "kind": "clamped"} for e in ("first", "last")]
    sizes = SIZES | {"height": 0.002, "elements": 8}
    beam = Beam(**STEEL, **sizes, center=[0.0, 0.0], supports=ends)
    ball = Point(name="ball", mass=0.05, radius=0.01, position=[0.0, 0.0112], velocity=[0.0, -3.0])
    rubber = Solid(
        name="rubber", model="plane_strain", shape=Block(size=[0.02, 0.02], corner=[1.0, 1.0]),
        mesh_size=0.01, density=1e3, youngs_modulus=1e6, poisson_ratio=0.3, strain="finite",
    )  # fmt: skip
    for more in ([], [rubber]):
        scene = Scene(
            title="beams", duration=2e-3, gravity=[0.0, 0.0], bodies=[beam, ball, *more],
            solve=Solve(dt=2e-5, estimate=False), output=Output(fields=[]),
        )  # fmt: skip
        found = solve(scene).summary["verdict"]["findings"]
        [share] = [each["value"] for each in found if each["code"] == "model_strain"]
        assert share > 1.0


@pytest.mark.parametrize(
    ("change", "key", "remedy"),
    [
        ({"inclination": 0.1}, "beam.inclination", "axis and width_axis"),
        ({"center": [0.0, 0.0], "axis": [1.0, 0.0, 0.0]}, "beam.axis", "inclination"),
        ({"velocity": [1.0, 0.0]}, "beam.velocity", "give 3"),
        ({"angular_velocity": 1.0}, "beam.angular_velocity", "3 numbers"),
        ({"width_axis": [2.0, 0.0, 0.0]}, "beam.width_axis", "across"),
        ({"width": 0.1}, "beam.width", "timoshenko"),
        ({"supports": [CLAMPED, CLAMPED]}, "beam.supports", "one support"),
        ({"supports": [CLAMPED | {"stiffness": 1.0}]}, "stiffness", "elastic"),
        ({"supports": [LAST | {"kind": "elastic"}]}, "stiffness", "free"),
    ],
)
def test_what_cannot_be_is_refused(change, key, remedy):
    with pytest.raises(SceneError) as caught:
        Beam(**STEEL | SIZES | {"center": [0.0, 0.0, 0.0]} | change)
    assert key in str(caught.value)
    assert remedy in str(caught.value)
