"""What holds for every system: no penetration, no pulling, no energy from impacts, momentum."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactfem.errors import ConvergenceError
from impactfem.scene.signal import Signal
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.event_driven import EventSettings, integrate_events

DURATION = 3.0


def spd(random, d, least):
    root = random.normal(size=(d, d))
    return root @ root.T + least * np.eye(d)


def random_system(seed, d, count, e, **more):
    """A bounded motion against count walls, the first of which is closed at the start."""
    random = np.random.default_rng(seed)
    normals = random.normal(size=(count, d))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    start = random.normal(size=d)
    gaps = np.concatenate([[0.0], random.uniform(0.0, 1.0, count)])[:count]
    system = LinearSystem(
        mass=spd(random, d, 0.3), stiffness=spd(random, d, 0.1) * random.integers(0, 2),
        damping=spd(random, d, 0.0) * 0.1 * random.integers(0, 2), normals=normals,
        offsets=gaps - normals @ start, load=list(more.pop("load", random.normal(size=d))),
        restitution=e, **more,
    )  # fmt: skip
    return system, start, random.normal(size=d)


def momentum_balance(system, velocity, run):
    """M v(end) - M v(0) minus the integral of all forces, by fine sums over the rows."""
    u, v, h = run.position, run.velocity, run.times[1]
    steady = np.array([system.load_at(t) for t in run.times]) - u @ system.stiffness.T
    # u is continuous: the trapezoidal rule; the damping force integrates to -C (u(end) - u(0)).
    force = h * (steady.sum(axis=0) - 0.5 * (steady[0] + steady[-1]))
    force -= system.damping @ (u[-1] - u[0])
    force += run.impulse[1:].sum(axis=0) @ system.normals
    return system.mass(u[0]) @ (v[-1] - velocity) - force


restitution = st.one_of(st.just(0.0), st.just(1.0), st.floats(0.0, 1.0))


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 10**6), st.integers(1, 3), st.integers(1, 3), restitution,
    st.sampled_from(["simultaneous", "sequential"]),
)  # fmt: skip
def test_random_linear_systems(seed, d, count, e, law):
    system, start, velocity = random_system(seed, d, count, e)
    settled = EventSettings(rows=3000, impact_law=law)
    try:
        run = integrate_events(system, start, velocity, DURATION, settled)
    except ConvergenceError as error:  # impacts one after the other may have no end, and it is said
        assert law == "sequential"
        assert "did not separate" in str(error)  # noqa: PT017
        return
    size = 1.0 + np.abs(run.position).max()
    assert run.gap.min() >= -1e-11 * size
    assert (run.impacts.impulse > 0.0).all()
    force = 1.0 + np.abs(run.contact_force).max()
    assert run.contact_force.min() >= -1e-11 * force
    scale = 1.0 + np.abs(run.kinetic).max() + np.abs(run.potential).max()
    assert np.diff(run.total).max() <= 1e-11 * scale
    if e == 1.0 and not system.damping.any() and not run.effort.details["spells"]:
        drop = run.kinetic[0] + run.potential[0] - run.total[1:]
        assert np.abs(drop).max() <= 1e-10 * scale
    jump = momentum_balance(system, velocity, run)
    assert np.abs(jump).max() <= 1e-5 * (1.0 + np.abs(run.impulse).max())


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 2), st.integers(1, 2), st.floats(0.0, 0.95))
def test_walls_and_loads_that_oscillate(seed, d, count, e):
    count = min(count, d)  # more moving walls than dimensions may leave no room
    random = np.random.default_rng(seed + 1)
    w = float(random.uniform(1.0, 9.0))
    motion = [Signal(harmonics=((w, 0.0, float(random.uniform(0.0, 0.2))),)) for _ in range(count)]
    load = [Signal(-1.0, harmonics=((2.0 * w, 1.0, 0.5),)) for _ in range(d)]
    system, start, velocity = random_system(seed, d, count, e, load=load, motion=motion)
    run = integrate_events(system, start, velocity, DURATION, EventSettings(rows=3000))
    assert run.gap.min() >= -1e-11 * (1.0 + np.abs(run.position).max())
    assert run.contact_force.min() >= -1e-11 * (1.0 + np.abs(run.contact_force).max())
    jump = momentum_balance(system, velocity, run)
    assert np.abs(jump).max() <= 1e-4 * (1.0 + np.abs(run.impulse).max())


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.1, 0.9))
def test_both_ways_of_flying_agree(seed, e):
    system, start, velocity = random_system(seed, 2, 1, e)
    same = GeneralizedSystem(
        mass=system.mass(start), force=system.force, restitution=e,
        constraints=lambda u: system.normals @ u + system.offsets,
    )  # fmt: skip
    options = EventSettings(rows=20, stick_speed=1e-5)
    one, two = (integrate_events(s, start, velocity, 1.5, options) for s in (system, same))
    assert two.position == pytest.approx(one.position, abs=1e-6)
    assert abs(len(one.impacts) - len(two.impacts)) <= 2
