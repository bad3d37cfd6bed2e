"""Balls on plates: the elements that their forces and speeds need, before and after runs."""

import math

import numpy as np
import pytest
from plate_cases import SQUARE, grid, plate_of
from scipy.integrate import solve_ivp

import impactfem
from impactfem import Scene

THICK, DENSITY, MODULUS, NU = 0.002, 7800.0, 2e11, 0.3
RADIUS = 0.1  # of the plate that weighs as the ball
SPEED = 0.01
AREAL = DENSITY * THICK
RIGIDITY = MODULUS * THICK**3 / (12.0 * (1.0 - NU**2))
MASS = math.pi * RADIUS**2 * AREAL
IMPEDANCE = 8.0 * math.sqrt(RIGIDITY * AREAL)
BRAKING = MASS / IMPEDANCE


def scene(size, side=6.0, duration=0.8, steps=80, ball=None, law=None, **keys):
    """A ball on a clamped square of so many radii, for so many times of its braking."""
    plate = {
        "kind": "plate", "name": "plate", "thickness": THICK, "density": DENSITY,
        "outline": {"kind": "rectangle", "size": [side * RADIUS, side * RADIUS]},
        "mesh_size": size * RADIUS, "youngs_modulus": MODULUS, "poisson_ratio": NU,
        "supports": [{"edge": e, "kind": "clamped"} for e in ("left", "right", "bottom", "top")],
    } | keys  # fmt: skip
    struck = {
        "kind": "rigid", "name": "ball", "mass": MASS, "velocity": [0.0, 0.0, -SPEED],
        "shape": {"kind": "sphere", "radius": 0.001, "center": [0.013, 0.007, 0.002001]},
    } | (ball or {})  # fmt: skip
    laws = [{"between": ["ball", "plate"], **law}] if law else []
    return Scene.from_dict(
        {"title": "struck", "duration": duration * BRAKING, "gravity": [0.0, 0.0, 0.0],
         "body": [plate, struck], "contact": laws, "output": {"fields": []},
         "solve": {"dt": BRAKING / steps, "estimate": False}}
    )  # fmt: skip


def told(findings):
    return [f for f in findings if f.code == "force_peak"]


def test_elements_that_are_too_large_are_told_with_those_that_are_not():
    (finding,) = told(impactfem.plan(scene(0.6)).findings)
    assert (finding.severity, finding.subject) == ("warning", "ball.plate")
    assert finding.limit == pytest.approx(RADIUS / 3.0)
    assert 0.5 * RADIUS < finding.value < 0.7 * RADIUS
    assert not told(impactfem.plan(scene(0.3)).findings)


def test_points_are_told_too():
    made = scene(0.6).to_dict()
    made["body"][1] = {
        "kind": "point", "name": "ball", "mass": MASS, "velocity": [0.0, 0.0, -SPEED],
        "position": [0.013, 0.007, 0.0011],
    }  # fmt: skip
    assert told(impactfem.plan(Scene.from_dict(made)).findings)


@pytest.mark.parametrize(
    "ball",
    [
        {"shape": {"kind": "sphere", "radius": 0.001, "center": [0.0, 0.0, 10.0]}},
        {"shape": {"kind": "block", "size": [0.2, 0.2, 0.2], "corner": [-0.1, -0.1, 0.002]}},
    ],
)
def test_nothing_is_told_of_what_is_far_and_of_faces(ball):
    assert not told(impactfem.plan(scene(0.6, ball=ball)).findings)


def test_elements_count_where_the_line_of_the_ball_meets_the_plate():
    plate = plate_of(SQUARE, 0.1, mesh=grid(10, shift=0.3))
    widths = {round(plate.width_at(np.array([x, y, 1.0]), np.zeros(3)), 9)
              for x in (-0.4, 0.0, 0.3) for y in (-0.4, 0.1)}  # fmt: skip
    assert len(widths) > 2
    slanted = plate.width_at(np.array([0.2, 0.1, 0.4]), np.array([-0.5, 0.0, -1.0]))
    assert slanted == plate.width_at(np.array([0.0, 0.1, 0.4]), np.zeros(3))


def test_nothing_is_told_of_drums():
    assert not told(impactfem.plan(scene(0.6, residual_stress=1e8)).findings)


def braked(result):
    """By how much of the first speed the ball's is off at the end of the run."""
    left = result.history["ball.vz"].values[-1] / -SPEED
    return left - math.exp(-result.history["time"].values[-1] / BRAKING)


def test_force_and_speed_where_nothing_is_told():
    result = impactfem.solve(scene(0.3))
    contact, findings = result.summary["contact"], result.summary["verdict"]["findings"]
    share = contact["force_window"] / BRAKING
    assert contact["max_force_raw"] > 2.0 * IMPEDANCE * SPEED  # of the mesh
    mean = -math.expm1(-share) / share * IMPEDANCE * SPEED
    assert contact["max_force"] == pytest.approx(mean, rel=0.12)
    assert abs(braked(result)) < 0.09
    assert [f["severity"] for f in findings if f["code"] == "force_peak"] == ["note"]


def test_speed_where_elements_are_told():
    result = impactfem.solve(scene(1.0, side=8.0, duration=1.2))
    assert abs(braked(result)) > 0.3
    codes = {(f["code"], f["severity"]) for f in result.summary["verdict"]["findings"]}
    assert ("force_peak", "warning") in codes


def zener(number):
    """Stiffness by Hertz' law with Zener's number, largest force of his equation, and when."""
    stiffness = (number * IMPEDANCE / (SPEED**0.2 * MASS**0.6)) ** 2.5

    def rate(_, y):
        force = stiffness * max(y[0], 0.0) ** 1.5
        return [y[1] - force / IMPEDANCE, -force / MASS]

    run = solve_ivp(rate, (0.0, 2.5 * BRAKING), [0.0, SPEED], rtol=1e-10, atol=1e-16,
                    max_step=BRAKING / 2000)  # fmt: skip
    force = stiffness * np.maximum(run.y[0], 0.0) ** 1.5
    return stiffness, force.max(), run.t[force.argmax()] / BRAKING


@pytest.mark.parametrize(
    ("number", "size", "off"),
    [(3.0, 1.0, 1.5), (3.0, 0.25, None), pytest.param(1.0, 1.0, 0.25, marks=pytest.mark.slow),
     pytest.param(1.0, 0.7, None, marks=pytest.mark.slow)],
)  # fmt: skip
def test_peaks_of_dents_are_within_a_tenth_where_nothing_is_told(number, size, off):
    stiffness, known, at = zener(number)
    law = {"stiffness": stiffness, "stiffness_exponent": 1.5}
    made = scene(size, side=7.0 if size > 0.3 else 4.0, duration=1.4 * at, steps=100, law=law)
    result = impactfem.solve(made)
    over = result.summary["contact"]["max_force"] / known - 1.0
    findings = [f for f in result.summary["verdict"]["findings"] if f["code"] == "force_peak"]
    assert bool(findings) == (off is not None)
    assert over > off if off else abs(over) < 0.11
