"""Friction of systems in generalised coordinates: the exact cone on any Delassus operator."""

import numpy as np
import pytest

import impactfem
from impactfem import SceneError

G = 9.81


def block(mu, dim=2, **more):
    """A point mass on a floor, its last coordinate the height."""
    normals = np.eye(dim)[-1:]
    return impactfem.systems.GeneralizedSystem(
        mass=np.full(dim, 2.0),
        force=lambda *_: -2.0 * G * np.eye(dim)[-1],
        constraints=lambda u: u[-1:],
        friction=mu,
        slip=lambda _: np.eye(dim)[None, : dim - 1],
        potential=lambda _, u: 2.0 * G * u[-1],
        **more,
    ), normals


def test_a_block_stops_where_coulomb_says():
    """Time v / (mu g), way v^2 / (2 mu g), in the direction of its speed; the step divides it."""
    mu, speed = 0.25, np.array([1.2, 1.6, 0.0])
    stop = 2.0 / (mu * G)
    motion = impactfem.integrate(
        block(mu, 3)[0], np.zeros(3), speed, 1.5 * stop, method="moreau_jean", dt=stop / 200
    )
    way = 4.0 / (2.0 * mu * G)
    assert motion.position[-1][:2] == pytest.approx(way * speed[:2] / 2.0, rel=1e-9)
    assert np.abs(motion.velocity[-1]).max() < 1e-12
    before = motion.times < 0.99 * stop
    assert np.linalg.norm(motion.velocity[before], axis=1) == pytest.approx(
        2.0 - mu * G * motion.times[before], rel=1e-9
    )
    assert motion.effort.details["friction_work"] == pytest.approx(-4.0, rel=1e-9)


@pytest.mark.parametrize("mu", [0.1, 0.4])
def test_a_disc_rolls_after_it_has_slid(mu):
    """It rolls from v / (3 mu g) on with 2 v / 3, whatever the friction."""
    radius, speed = 0.2, 3.0
    disc = impactfem.systems.GeneralizedSystem(
        mass=np.array([1.0, 1.0, 0.5 * radius**2]),
        force=lambda *_: np.array([0.0, -G, 0.0]),
        constraints=lambda u: u[1:2] - radius,
        friction=mu,
        slip=lambda _: [[1.0, 0.0, radius]],
    )
    begins = speed / (3.0 * mu * G)
    motion = impactfem.integrate(
        disc, [0.0, radius, 0.0], [speed, 0.0, 0.0], 2.0 * begins, method="moreau_jean",
        dt=begins / 300,
    )  # fmt: skip
    assert motion.velocity[-1][0] == pytest.approx(2.0 * speed / 3.0, rel=1e-9)
    assert motion.velocity[-1][2] == pytest.approx(-2.0 * speed / 3.0 / radius, rel=1e-9)
    rolling = np.abs(motion.velocity[:, 0] + radius * motion.velocity[:, 2]) < 1e-9
    assert motion.times[rolling].min() == pytest.approx(begins, rel=0.01)


def test_a_linear_system_with_friction_is_the_same():
    system, normals = block(0.25)
    linear = impactfem.systems.LinearSystem(
        mass=np.full(2, 2.0), normals=normals, offsets=[0.0], load=[0.0, -2.0 * G], friction=0.25,
        slip=lambda _: np.eye(2)[:1],
    )  # fmt: skip
    one, other = (
        impactfem.integrate(s, [0.0, 0.1], [1.0, 0.0], 0.5, method="moreau_jean", dt=1e-3)
        for s in (system, linear)
    )
    assert np.abs(one.position - other.position).max() < 1e-13
    assert one.velocity[-1][0] < 0.6


def test_an_aslant_impact_takes_mu_times_the_normal_impulse():
    system, _ = block(0.3, restitution=0.5)
    motion = impactfem.integrate(
        system, [0.0, 0.1], [3.0, -2.0], 0.1, method="moreau_jean", dt=1e-4
    )
    down = np.sqrt(4.0 + 2.0 * G * 0.1)
    assert motion.velocity[-1][0] == pytest.approx(3.0 - 0.3 * 1.5 * down, rel=1e-3)


def test_what_cannot_be_is_refused():
    given = {"mass": [1.0, 1.0], "force": lambda *_: [0.0, -G], "constraints": lambda u: u[1:]}
    with pytest.raises(SceneError, match="friction needs slip"):
        impactfem.systems.GeneralizedSystem(**given, friction=0.3)
    with pytest.raises(SceneError, match=r"friction = -1 of constraint 0.*give a number >= 0"):
        impactfem.systems.GeneralizedSystem(**given, friction=-1.0, slip=lambda _: [[1.0, 0.0]])
    wrong = impactfem.systems.GeneralizedSystem(**given, friction=0.3, slip=lambda _: [1.0, 0.0])
    with pytest.raises(SceneError, match=r"slip has shape \(2,\); it must be \(1, 2\)"):
        impactfem.integrate(wrong, [0.0, 0.0], [1.0, 0.0], 1.0, method="moreau_jean", dt=0.1)
    system, _ = block(0.3)
    told = '"paoli_schatzman" knows no friction: give "event_driven" or "moreau_jean"'
    with pytest.raises(SceneError, match=told):
        impactfem.integrate(system, [0.0, 0.0], [1.0, 0.0], 1.0, method="paoli_schatzman", dt=0.1)
