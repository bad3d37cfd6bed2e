"""Figure 3 of Paoli and Schatzman: the penalised point at a vertex, in the plane of R and R'."""

import math

import numpy as np
import pytest
from corner_portrait import entry, facts, penalised, radial

V = (0.6, 0.8)


@pytest.mark.parametrize(("alpha", "slide"), [(1.5, 1.0), (1.5, 5.0), (2.5, 2.0)])
def test_a_penalised_point_obeys_the_equations_of_the_portrait(alpha, slide):
    start = entry(alpha, V, slide)
    held = penalised(0.02, alpha, V, slide, (100, 3.0))
    assert held[:, 0] == pytest.approx([start.radius, start.speed, 0.0], abs=1e-9)
    path = radial(alpha, start, np.linspace(0.0, 3.0, 101))
    inside = held[2] < math.pi - 0.02  # there wall 2 takes over
    assert inside.sum() > 60
    assert np.abs(held - path)[:, inside].max() < 2e-9


def test_an_acute_corner_gives_the_point_away_when_it_has_turned_by_its_normal_cone():
    theta = math.pi / 3
    held = penalised(theta, 1.5, V, 3.0, (300, 9.0))
    path = radial(1.5, entry(1.5, V, 3.0), np.linspace(0.0, 9.0, 301))
    off = np.abs(held[0] - path[0])
    leaves = int(np.argmax(path[2] > math.pi - theta))
    assert off[:leaves].max() < 2e-9
    assert off[leaves + 10] > 1e-4


@pytest.mark.parametrize("alpha", [1.5, 2.5])
def test_every_path_falls_to_the_point_of_rest_as_its_linearisation_says(alpha):
    start = entry(alpha, V, 4.0)
    times = np.linspace(0.0, 30.0, 30_001)
    r, speed, _ = radial(alpha, start, times)
    energy = 0.5 * (speed**2 + r**2 + (start.spin / r) ** 2)
    lost = np.concatenate([[0.0], np.cumsum(speed[1:] ** 2 + speed[:-1] ** 2)]) * alpha * 1e-3
    assert energy + lost == pytest.approx(energy[0], rel=2e-4)  # trapezoidal rule
    assert (r[-1], speed[-1]) == pytest.approx((start.rest, 0.0), abs=1e-8)
    # Near rest R'' + 2 alpha R' + 4 (R - Rc) = 0: a focus below alpha = 2, a node from there on.
    xi = np.roots([1.0, 2.0 * alpha, 4.0])
    near = slice(int(np.argmax(times > 6.0)), None, 200)
    states = np.array([r[near] - start.rest, speed[near]]).T
    vectors = np.array([[1.0, 1.0], xi])
    step = (vectors @ np.diag(np.exp(xi * 0.2)) @ np.linalg.inv(vectors)).real
    size = np.linalg.norm(states, axis=1)
    fit = np.linalg.norm(states[1:] - states[:-1] @ step.T, axis=1)
    assert (fit < 3.0 * size[:-1] ** 2 + 1e-11).all()


def test_without_damping_paths_close_after_half_a_turn_of_the_spring():
    start = entry(1.5, V, 2.0)
    times = np.linspace(0.0, 2.0 * math.pi, 201)
    r, speed, _ = radial(0.0, start, times)
    across = start.spin / start.radius
    u = np.array([start.radius * np.cos(times) + start.speed * np.sin(times),
                  across * np.sin(times)])  # fmt: skip
    assert r == pytest.approx(np.hypot(*u), rel=1e-8)
    assert (r[100], speed[100]) == pytest.approx((r[0], speed[0]), rel=1e-7)


def test_both_asymptotics_gain_as_the_slide_grows():
    coarse, fine = facts(1.5, 12.0), facts(1.5, 18.0)
    eta = fine[0] / coarse[0]
    assert fine[1] / coarse[1] == pytest.approx(eta, rel=0.1)
    assert fine[2] / coarse[2] < eta**2
    assert math.degrees(fine[4]) == pytest.approx(90.0, abs=0.5)
