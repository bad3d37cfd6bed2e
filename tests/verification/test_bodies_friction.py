"""Solids that rub move as rigid bodies do: sticking, slopes, stopping, rolling, any direction."""

import math

import numpy as np
import pytest
from rubbing import FLOOR, FLOOR_3D, GRAVITY, rubbing, settled, work
from solid_pairs import block, disc, velocity

import impactfem


def tilting(mu, slope, steps=80):
    """A damped block on a floor that is tilted smoothly from 10 s to 30 s, to ``slope``."""
    last = math.atan(slope)
    table = [[0.0, [0.0, -GRAVITY]]]
    for k in range(1, steps + 1):
        part = (k - 0.5 if k < steps else steps) / steps
        angle = 0.5 * last * (1.0 - math.cos(math.pi * part))
        pull = [GRAVITY * math.sin(angle), -GRAVITY * math.cos(angle)]
        table.append([10.0 + 20.0 * (k - 1) / steps, pull])
    body = block("block", [0.0, 0.0], [1.0, 0.5], 0.125, rayleigh_stiffness=0.5)
    return rubbing([body], [("block", "floor", mu)], 45.0, table, method="massless", dt=0.1)


def late(result, start=35.0):
    """Mean acceleration [m/s^2] after ``start``."""
    time, speed = result.history.time.values, result.history["block.vx"].values
    chosen = time > start
    return np.polyfit(time[chosen], speed[chosen], 1)[0]


def test_block_on_a_slope_sticks_if_friction_is_one_percent_more():
    slope = 0.5
    result = impactfem.solve(tilting(1.01 * slope, slope))
    pull = GRAVITY * math.sin(math.atan(slope))
    assert abs(late(result)) < 1e-3 * pull
    # It is at rest: its vibrations are a thousandth of what it would slide at in the last 15 s.
    speed = result.history["block.vx"].values[result.history.time.values > 40.0]
    assert np.abs(speed).max() < 1e-3 * pull


def test_block_on_a_slope_slides_if_friction_is_one_percent_less():
    slope = 0.5
    result = impactfem.solve(tilting(0.99 * slope, slope))
    angle = math.atan(slope)
    expected = GRAVITY * (math.sin(angle) - 0.99 * slope * math.cos(angle))
    assert late(result) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("method", ["massless", "moreau_jean"])
def test_sliding_block_stops_after_the_right_distance(method):
    mu, speed = 0.4, 0.1
    body = block(
        "block", [0.0, 0.0], [1.0, 0.5], 0.125, poisson_ratio=0.0, rayleigh_stiffness=0.5,
        velocity=[speed, 0.0], displacement=settled(GRAVITY, 0.5),
    )  # fmt: skip
    case = rubbing(
        [body], [("block", "floor", mu)], 35.0, [0.0, -GRAVITY], method=method, dt=0.05
    )  # fmt: skip
    result = impactfem.solve(case)
    place = result.history["block.x"].values
    assert place[-1] - place[0] == pytest.approx(speed**2 / (2.0 * mu * GRAVITY), rel=0.01)
    assert abs(velocity(result, "block")[0]) < 1e-3 * speed
    # What it had has gone into friction, but for the vibrations that are damped.
    assert work(result) == pytest.approx(-0.5 * 0.5 * speed**2, rel=0.01)


@pytest.mark.parametrize("on", ["floor", "bed"])
def test_sliding_disc_ends_rolling(on):
    """Two thirds of the speed are left, whatever the force, after the disc has turned by 0.02.

    Small-displacement elasticity bounds the angle: a disc that turns by a grows by R a^2 / 2, and
    must climb that. The run ends at 0.04.
    """
    mu, gravity, radius, angle = 0.8, 1e-4, 0.5, 0.02
    speed = math.sqrt(9.0 * angle * mu * gravity * radius)
    slides = speed / (3.0 * mu * gravity)
    fine = {"point": [0.0, 0.0], "radius": 0.1, "size": 0.02}
    bodies = [
        disc(
            "disc", [0.0, radius], radius, 0.1, refine=[fine], velocity=[speed, 0.0],
            rayleigh_stiffness=0.2,
        )
    ]  # fmt: skip
    if on == "bed":
        held = [{"surface": "bottom", "kind": "fixed"}]
        bodies.append(
            block(
                "bed", [-0.5, -0.2], [1.0, 0.2], 0.1, refine=[fine | {"radius": 0.15}],
                supports=held, youngs_modulus=10.0, rayleigh_stiffness=0.2,
            )
        )  # fmt: skip
    result = impactfem.solve(
        rubbing(
            bodies, [("disc", on, mu)], 2.0 * slides, [0.0, -gravity],
            [FLOOR] if on == "floor" else (), method="massless", normals="updated", dt=0.05,
        )
    )  # fmt: skip
    time = result.history.time.values
    rolls = result.history["disc.vx"].values[time > 1.2 * slides]
    assert rolls.mean() == pytest.approx(2.0 / 3.0 * speed, rel=0.02)
    assert rolls[-1] == pytest.approx(2.0 / 3.0 * speed, rel=0.02)
    # Friction takes a third of the kinetic energy. The elastic support is struck at t = 0.
    mass = math.pi * radius**2
    assert work(result) == pytest.approx(-mass * speed**2 / 6.0, rel=0.04 if on == "floor" else 0.1)


def pushed(degrees, mu=0.4, speed=0.1, duration=10.0):
    """Way of a square block in space that slides at an angle to its axes [m], (2,)."""
    along = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    body = block(
        "block", [0.0, 0.0, 0.0], [1.0, 1.0, 0.5], 0.25, model="3d", cells="hexahedron",
        poisson_ratio=0.0, rayleigh_stiffness=0.5, velocity=[*(speed * along), 0.0],
        displacement=settled(GRAVITY, 0.5, 3),
    )  # fmt: skip
    result = impactfem.solve(
        rubbing(
            [body], [("block", "floor", mu)], duration, [0.0, 0.0, -GRAVITY], [FLOOR_3D],
            method="massless", dt=0.1,
        )
    )  # fmt: skip
    return np.array([np.ptp(result.history[f"block.{axis}"].values) for axis in "xy"])


def test_a_diagonal_push_meets_the_same_friction():
    """A pyramid would stop the diagonal by sqrt(2) more, and turn the way at 22.5 degrees."""
    ways = {degrees: pushed(degrees) for degrees in (0.0, 22.5, 45.0)}
    braked = {degrees: 1.0 - np.linalg.norm(way) for degrees, way in ways.items()}
    assert braked[0.0] == pytest.approx(0.5 * 0.4 * GRAVITY * 10.0**2, rel=0.02)
    for degrees, way in ways.items():
        assert braked[degrees] == pytest.approx(braked[0.0], rel=1e-3)
        assert math.degrees(math.atan2(way[1], way[0])) == pytest.approx(degrees, abs=1e-3)
