"""First impacts that no step of the integrator sees: bodies that spin, walls that shake."""

import numpy as np
import pytest
from scipy.optimize import brentq

import impactfem
from impactfem.scene import HalfSpace
from impactfem.scene.signal import Signal
from impactfem.system.generalized import GeneralizedSystem
from impactfem.system.rod import rod_system
from impactfem.vibro.event_looks import Look, Looking

G = 9.81
FLOOR = HalfSpace(name="floor", point=[0.0, 0.0], normal=[0.0, 1.0])


def first(gap, end=2.0):
    """When a function of time first falls below 0, by a dense scan."""
    times = np.linspace(0.0, end, 400_001)
    below = np.flatnonzero(gap(times) < 0.0)
    return brentq(gap, times[below[0] - 1], times[below[0]], xtol=1e-15)


def starts(seed, count):
    """Sizes from 1e-6 to 1e3 m, spins up to 300 rad/s: height, speed, angle, spin."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        size, spin = 10.0 ** rng.uniform(-6.0, 3.0), 10.0 ** rng.uniform(0.0, 2.5)
        state = size * rng.uniform(0.6, 2.0), size * rng.uniform(-2.0, 3.0)
        yield size, (*state, rng.uniform(-3.0, 3.0), rng.choice([-1.0, 1.0]) * spin)


def test_spinning_rods_strike_when_their_ends_are_down():
    for size, (y, v, angle, spin) in starts(0, 24):

        def gap(t, y=y, v=v, angle=angle, spin=spin, size=size):
            fall = y + v * t - 0.5 * G * size * t**2
            return fall - 0.3 * size * np.abs(np.sin(angle + spin * t))

        expected = first(gap)
        rod = rod_system(0.5, 0.6 * size, FLOOR, (0.0, -G * size), 1.0)
        motion = impactfem.integrate(rod, [0.0, y, angle], [0.0, v, spin], 1.1 * expected, rows=200)
        assert motion.impacts.time[0] == pytest.approx(expected, rel=1e-9)
        assert motion.gap.min() > -1e-10 * size  # and none was missed later


def test_spinning_blocks_strike_when_their_corners_are_down():
    for size, (y, v, angle, spin) in starts(1, 6):

        def gap(t, y=y, v=v, angle=angle, spin=spin, size=size):
            turned = angle + spin * t
            low = 0.4 * np.abs(np.sin(turned)) + 0.1 * np.abs(np.cos(turned))
            return y + v * t - 0.5 * G * size * t**2 - size * low

        expected = first(gap)
        shape = {"kind": "block", "size": [0.8 * size, 0.2 * size]}
        shape["corner"] = [-0.4 * size, y - 0.1 * size]
        body = {"kind": "rigid", "name": "block", "shape": shape, "mass": 1.0, "angle": angle}
        scene = impactfem.Scene.from_dict({
            "title": "block", "duration": 1.1 * expected, "gravity": [0.0, -G * size],
            "body": [body | {"velocity": [0.0, v], "angular_velocity": spin}],
            "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                          "normal": [0.0, 1.0]}],
            "contact": [{"between": ["block", "floor"], "restitution": 1.0}],
            "solve": {"method": "event_driven", "estimate": False}, "output": {"fields": []},
        })  # fmt: skip
        found = impactfem.solve(scene)
        assert found.impacts.time[0] == pytest.approx(expected, rel=1e-9)
        assert found.history["gap"].values.min() > -1e-10 * size


def test_wall_that_shakes_is_seen_by_what_flies_freely():
    shaking = Signal(harmonics=((150.0, 0.0, 0.2),))
    ball = GeneralizedSystem(
        mass=1.0, force=lambda _t, _u, _v: np.zeros(1), constraints=lambda u: u, motion=[shaking],
        restitution=1.0,
    )  # fmt: skip
    motion = impactfem.integrate(ball, [1.0], [-0.6], 1.6)
    expected = first(lambda t: 1.0 - 0.6 * t - 0.2 * np.sin(150.0 * t))
    assert motion.impacts.time[0] == pytest.approx(expected, rel=1e-12)


def test_looks_at_kinks_and_noise_have_an_end():
    rng = np.random.default_rng(0)
    kink = (lambda t: abs(t - 0.314159) + 1e-9), (lambda t: np.sign(t - 0.314159)), 300
    noise = (lambda _: 1e-9 * rng.uniform(0.0, 1.0)), (lambda _: 0.0), 30_000
    for gap, rate, most in (kink, noise):

        def look(t, gap=gap, rate=rate):
            return Look(t, np.array([gap(t)]), np.array([rate(t)]), np.zeros(0))

        seen = Looking(look, np.array([True]), np.zeros(1)).over(0.0, 1.0)
        times = [each.time for each in seen]
        assert times == sorted(times)
        assert (times[0], times[-1]) == (0.0, 1.0)
        assert 9 < len(seen) < most
