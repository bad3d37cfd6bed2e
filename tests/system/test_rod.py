import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from vibro_forms import end_impulse

from impactfem import SceneError
from impactfem.contact.impact_law import resolve_impact
from impactfem.scene.beams import Rod
from impactfem.scene.obstacles import HalfSpace
from impactfem.system.derivatives import differentiate
from impactfem.system.generalized import factor_mass
from impactfem.system.rod import rod_system
from impactfem.system.start_checks import check_start

FLOOR = HalfSpace(point=[1.0, 0.5], normal=[0.0, 3.0])
SLOPE = HalfSpace(point=[-4.0, 0.0], normal=[1.0, 1.0])

angles = st.floats(-math.pi, math.pi)


@settings(max_examples=50, deadline=None)
@given(x=st.floats(-2, 2), y=st.floats(-2, 2), theta=angles, radius=st.floats(0, 0.1))
def test_gaps_are_distances_of_the_ends_with_their_gradients(x, y, theta, radius):
    system = rod_system(2.0, 0.8, [FLOOR, SLOPE], radius=radius)
    u = np.array([x, y, theta])
    arm = 0.4 * np.array([math.cos(theta), math.sin(theta)])
    ends = [u[:2] - arm, u[:2] + arm]
    slope = np.array([1.0, 1.0]) / math.sqrt(2.0)
    expected = [end[1] - 0.5 for end in ends] + [(end - [-4.0, 0.0]) @ slope for end in ends]
    assert np.allclose(system.gap(0.0, u), np.array(expected) - radius, atol=1e-13)
    assert np.allclose(system.jacobian(u), differentiate(system.constraint_function, u), atol=1e-12)


@settings(max_examples=50, deadline=None)
@given(
    theta=st.floats(-math.pi / 2 + 0.01, math.pi / 2 - 0.01),
    e=st.floats(0, 1),
    speed=st.floats(0.01, 10),
)
def test_impact_of_one_end_has_its_closed_form(theta, e, speed):
    mass, length = 2.0, 0.8
    system = rod_system(mass, length, FLOOR, restitution=e)
    low = 0 if theta >= 0 else 1
    u = np.array([0.0, 0.5 + 0.5 * length * abs(math.sin(theta)), theta])
    v = np.array([0.0, -speed, 0.0])
    rows = system.jacobian(u)[low : low + 1]
    impact = resolve_impact(
        factor_mass(system, u), rows, v, np.zeros(1), system.restitution[low : low + 1]
    )
    impulse, loss = end_impulse(mass, theta, speed, e)
    assert impact.impulse[0] == pytest.approx(impulse, rel=1e-12)
    assert impact.after[0] == pytest.approx(e * speed, rel=1e-12, abs=1e-12 * speed)
    energy = system.kinetic_energy(u, v)
    rest = system.kinetic_energy(u, impact.velocity)
    assert (energy - rest) / energy == pytest.approx(loss, rel=1e-9, abs=1e-12)


def test_weight_potential_and_start():
    system = rod_system(2.0, 0.8, FLOOR, gravity=[0.0, -9.81])
    u, v = np.array([0.0, 2.0, 0.3]), np.array([0.0, -1.0, 0.5])
    check_start(system, u, v)
    assert system.force(0.0, u, v) == pytest.approx([0.0, -19.62, 0.0])
    assert system.potential(0.0, u) == pytest.approx(2.0 * 9.81 * 2.0)
    assert system.kinetic_energy(u, v) == pytest.approx(1.0 + 0.5 * 2.0 * 0.64 / 12 * 0.25)
    with pytest.raises(SceneError, match="outside constraint 0"):
        check_start(system, np.array([0.0, 0.6, 0.3]), v)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"mass": -1.0}, "mass"),
        ({"length": math.inf}, "length"),
        ({"radius": -0.1}, "radius"),
        ({"gravity": [1.0]}, "gravity"),
        ({"restitution": 1.5}, "restitution"),
        ({"half_spaces": HalfSpace(point=[0, 0, 0], normal=[0, 0, 1])}, "coordinates"),
    ],
)
def test_what_cannot_be_is_refused(change, text):
    with pytest.raises(SceneError, match=text):
        rod_system(**({"mass": 1.0, "length": 1.0, "half_spaces": FLOOR} | change))


def test_the_table_of_a_rod_refuses_degrees():
    assert Rod(mass=1.0, length=1.0, center=[0.0, 1.0]).radius == 0.0
    with pytest.raises(SceneError, match=r"rod\.inclination = 45.*0\.785398 if degrees"):
        Rod(mass=1.0, length=1.0, center=[0.0, 1.0], inclination=45.0)
