import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactfem import SceneError
from impactfem.scene.beams import Beam
from impactfem.scene.obstacles import HalfSpace
from impactfem.system.beam import FreeBeam, free_beam
from impactfem.system.beam_matrices import euler_bernoulli, timoshenko
from impactfem.system.start_checks import check_start

FLOOR = HalfSpace(point=[0.0, 0.0], normal=[0.0, 2.0])


def steel(elements=8, theory="euler_bernoulli", height=0.01, **more):
    data = {"center": [0.0, 1.0], "inclination": 0.3, "length": 0.2, "width": 0.02} | more
    return Beam(
        height=height,
        density=7800.0,
        youngs_modulus=2.1e11,
        elements=elements,
        theory=theory,
        **data,
    )


def free_free_roots(count):
    """Roots of cos x cosh x = 1 by bisection, independent of any table."""
    roots = []
    for n in range(1, count + 1):
        low, high = (n + 0.5) * math.pi - 0.5, (n + 0.5) * math.pi + 0.5
        sign = math.cos(low) - 1.0 / math.cosh(low)
        for _ in range(60):
            middle = 0.5 * (low + high)
            same = (math.cos(middle) - 1.0 / math.cosh(middle)) * sign > 0
            low, high = (middle, high) if same else (low, middle)
        roots.append(low)
    return np.array(roots)


def bending_frequencies(beam, matrices, count):
    """Frequencies without the axial motion, the two rigid ones left out."""
    axial = 3 * np.arange(beam.elements + 1)
    keep = np.setdiff1d(np.arange(len(matrices.mass)), axial)
    block = np.ix_(keep, keep)
    squares = np.linalg.eigvals(np.linalg.solve(matrices.mass[block], matrices.stiffness[block]))
    return np.sqrt(np.sort(squares.real)[2 : 2 + count])


def closed_frequencies(beam, count):
    stiffness = beam.youngs_modulus * beam.second_moment / (beam.density * beam.area)
    return (free_free_roots(count) / beam.length) ** 2 * math.sqrt(stiffness)


def clamped(matrices, held):
    """Stiffness without held coordinates, and the coordinates left."""
    keep = np.setdiff1d(np.arange(len(matrices.stiffness)), held)
    return matrices.stiffness[np.ix_(keep, keep)], keep


def test_euler_bernoulli_frequencies_converge_with_order_four():
    errors = []
    for elements in (8, 16, 32):
        beam = steel(elements)
        found = bending_frequencies(beam, euler_bernoulli(beam), 3)
        errors.append(np.abs(found / closed_frequencies(beam, 3) - 1.0))
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert (rates > 3.8).all()
    assert (rates < 4.2).all()
    assert errors[-1].max() < 1.1e-5  # (beta h)^4 / 1440 of the third one, 9.7e-6
    assert abs(steel().first_frequency / closed_frequencies(steel(), 1)[0] - 1.0) < 1e-12


@pytest.mark.parametrize(("degree", "order"), [(1, 2), (2, 4)])
def test_timoshenko_beams_do_not_lock_and_converge_to_slender_ones(degree, order):
    errors = []
    for elements in (4, 8):
        # Height 1/500 of the length: shear and rotary inertia change the frequency by 1e-5.
        beam = steel(elements, "timoshenko", height=4e-4)
        found = bending_frequencies(beam, timoshenko(beam, degree), 1)
        errors.append(abs(found[0] / closed_frequencies(beam, 1)[0] - 1.0))
    assert errors[0] < {1: 0.04, 2: 1.2e-3}[degree]
    assert abs(math.log2(errors[0] / errors[1]) - order) < 0.35


def test_timoshenko_frequency_of_a_thick_beam_solves_the_differential_equation():
    beam = steel(32, "timoshenko", height=0.05)
    found = bending_frequencies(beam, timoshenko(beam), 2)
    line, inertia = beam.density * beam.area, beam.density * beam.second_moment
    bending, shear = beam.youngs_modulus * beam.second_moment, beam.shear_stiffness

    def free_end(omega):
        # y = (w, r, M, Q): w' = Q/S + r, r' = M/B, M' = -rho I w^2 r - Q, Q' = -rho A w^2 w
        rate = np.zeros((4, 4))
        rate[0, 1], rate[0, 3], rate[1, 2] = 1.0, 1.0 / shear, 1.0 / bending
        rate[2, 1], rate[2, 3], rate[3, 0] = -inertia * omega**2, -1.0, -line * omega**2
        values, vectors = np.linalg.eig(rate)
        whole = (vectors * np.exp(values * beam.length)) @ np.linalg.inv(vectors)
        return np.linalg.det(whole[2:, :2].real)  # M = Q = 0 at both ends

    for omega in found:
        low, high = free_end(omega * (1 - 1e-5)), free_end(omega * (1 + 1e-5))
        assert low * high < 0  # the closed form's root lies within 1e-5
    assert found[0] < 0.95 * closed_frequencies(beam, 1)[0]  # shear matters here


@pytest.mark.parametrize("theory", ["euler_bernoulli", "timoshenko"])
def test_static_deflections_are_those_of_the_handbook(theory):
    beam = steel(4, theory, height=0.03)
    matrices = free_beam(beam).matrices
    bending, length, force = beam.youngs_modulus * beam.second_moment, beam.length, 100.0
    by_shear = theory == "timoshenko"
    # Clamped at one end, P at the other: P L^3 / 3EI + P L / (kappa G A).
    stiffness, keep = clamped(matrices, [0, 1, 2])
    tip = np.flatnonzero(keep == 13)[0]
    found = np.linalg.solve(stiffness, force * np.eye(len(keep))[tip])[tip]
    expected = force * length**3 / (3 * bending) + by_shear * force * length / beam.shear_stiffness
    assert found == pytest.approx(expected, rel=1e-9)
    # Pinned at both ends, P in the middle: P L^3 / 48EI + P L / (4 kappa G A).
    stiffness, keep = clamped(matrices, [0, 1, 12, 13])
    middle = np.flatnonzero(keep == 7)[0]
    found = np.linalg.solve(stiffness, force * np.eye(len(keep))[middle])[middle]
    shear = by_shear * force * length / (4 * beam.shear_stiffness)
    assert found == pytest.approx(force * length**3 / (48 * bending) + shear, rel=1e-9)


def test_shear_takes_kappa_five_sixths():
    beam = steel(poisson_ratio=0.25)
    assert beam.shear_stiffness == pytest.approx(5 / 6 * 2.1e11 / 2.5 * beam.area, rel=1e-14)


@settings(max_examples=25, deadline=None)
@given(
    inclination=st.floats(-math.pi, math.pi),
    velocity=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    spin=st.floats(-20, 20),
    elements=st.integers(1, 12),
)
def test_rigid_motions_are_exact_and_free_of_force(inclination, velocity, spin, elements):
    body = free_beam(
        steel(elements, inclination=inclination, velocity=velocity, angular_velocity=spin)
    )
    mass, inertia = body.beam.mass, body.beam.mass * body.beam.length**2 / 12
    assert np.allclose(body.rigid_mass, np.diag([mass, mass, inertia]), rtol=1e-12, atol=1e-15)
    _, start = body.start
    assert np.allclose(body.rigid_part(start), [*velocity, spin], atol=1e-12)
    speed = max(1.0, np.abs(start).max())
    assert np.abs(body.matrices.stiffness @ start).max() < 1e-13 * speed * (
        np.abs(body.matrices.stiffness).max()
    )
    kinetic = 0.5 * mass * (velocity[0] ** 2 + velocity[1] ** 2) + 0.5 * inertia * spin**2
    found = 0.5 * start @ body.matrices.mass @ start
    assert found == pytest.approx(kinetic, rel=1e-10, abs=1e-15)


def test_timoshenko_rigid_mass_has_the_rotary_inertia():
    body = free_beam(steel(3, "timoshenko", height=0.03))
    inertia = body.beam.mass * (body.beam.length**2 + body.beam.height**2) / 12
    assert np.allclose(body.rigid_mass, np.diag([body.beam.mass] * 2 + [inertia]), rtol=1e-12)
    force = body.matrices.stiffness @ body.rigid_modes
    assert np.abs(force).max() < 1e-12 * np.abs(body.matrices.stiffness).max()
    with_rotary = euler_bernoulli(steel(3, height=0.03), rotary=True)
    assert FreeBeam(body.beam, with_rotary).rigid_mass[2, 2] == pytest.approx(inertia, rel=1e-12)


@pytest.mark.parametrize("contact", ["ends", "along"])
@pytest.mark.parametrize("theory", ["euler_bernoulli", "timoshenko"])
def test_gaps_are_distances_of_the_nodes(contact, theory):
    beam = steel(5, theory, contact=contact)
    wall = HalfSpace(point=[-3.0, 0.0], normal=[1.0, 0.5])
    body = free_beam(beam)
    system = free_beam(beam).system([FLOOR, wall])
    u = 1e-3 * np.random.default_rng(1).standard_normal(system.dofs)
    points = body.points(u)[[0, -1] if contact == "ends" else slice(None)]
    normal = np.array([1.0, 0.5]) / math.hypot(1.0, 0.5)
    expected = np.concatenate((points[:, 1], points @ normal + 3.0 * normal[0]))
    assert np.allclose(system.gap(0.0, u), expected, atol=1e-14)
    check_start(system, *body.start)


def test_weight_and_damping_act_on_the_right_motions():
    beam = steel(6, damping_ratio=0.02)
    body = free_beam(beam)
    system = free_beam(beam).system(FLOOR, gravity=[0.0, -9.81])
    u, v = body.start
    weight = body.rigid_modes.T @ system.force(0.0, u, v)
    assert np.allclose(weight, [0.0, -9.81 * beam.mass, 0.0], atol=1e-12)
    squares, modes = np.linalg.eig(np.linalg.solve(system.mass(u), system.stiffness))
    bending = np.argmin(np.abs(np.sqrt(np.abs(squares)) - beam.first_frequency))
    mode = modes[:, bending].real
    ratio = (mode @ system.damping @ mode) / (2 * beam.first_frequency)
    assert ratio / (mode @ system.mass(u) @ mode) == pytest.approx(0.02, rel=1e-3)
    assert np.abs(system.damping @ v).max() == 0.0  # the fall itself is not damped


@pytest.mark.parametrize(
    ("change", "key", "remedy"),
    [
        ({"height": 0.05}, "beam.height", "timoshenko"),
        ({"height": 0.15, "theory": "timoshenko"}, "beam.height", "solid"),
        ({"inclination": 30.0}, "beam.inclination", "0.523599"),
        ({"rayleigh": [0.0, 1e-6], "damping_ratio": 0.1}, "beam.rayleigh", "remove one"),
        ({"rayleigh": [0.0, -1e-6]}, "beam.rayleigh", ">= 0"),
        ({"center": [1.0]}, "beam.center", "2 or 3 numbers"),
        ({"theory": "bernoulli"}, "beam.theory", "euler_bernoulli"),
        ({"elements": 0}, "beam.elements", "from 1"),
        ({"youngs_modulus": 1e-300, "density": 1e300}, "beam.density", "SI units"),
    ],
)
def test_what_cannot_be_is_refused(change, key, remedy):
    data = {"length": 0.2, "height": 0.01, "width": 0.01, "density": 7800.0, "center": [0, 1]}
    with pytest.raises(SceneError) as caught:
        Beam(**({"youngs_modulus": 2e11} | data | change))
    assert str(caught.value).startswith(key)
    assert remedy in str(caught.value)


def test_moving_floors_and_gravity_in_space_are_refused():
    moving = HalfSpace(point=[0.0, 0.0], normal=[0.0, 1.0], motion=["0", "sin(t)"])
    with pytest.raises(SceneError, match="motion"):
        free_beam(steel()).system(moving)
    with pytest.raises(SceneError, match="gravity"):
        free_beam(steel()).system(FLOOR, gravity=[0.0, 0.0, -9.81])
    with pytest.raises(SceneError, match="half_spaces is empty"):
        free_beam(steel()).system([])
