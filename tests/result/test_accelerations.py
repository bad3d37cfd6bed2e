"""Accelerations of probes: means over steps, and as the filters of SAE J211 let them pass."""

import numpy as np
import pytest

import impactfem
from impactfem import Scene
from impactfem.errors import SceneError
from impactfem.runs.accelerations import acceleration, cfc
from impactfem.scene.probes import FILTERS

EPS = np.finfo(float).eps
BALL = {"kind": "point", "name": "ball", "mass": 0.1, "position": [0.0, 1.0], "velocity": [0.5, 0]}
FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}


def scene(body, point, *, solve=(), obstacles=(FLOOR,), quantities=("acceleration",), **more):
    probe = {"name": "a", "body": body["name"], "point": point, "quantities": list(quantities)}
    passed = {"filter": more.pop("filter")} if "filter" in more else {}
    return Scene.from_dict(
        {"title": "acceleration", "duration": 0.5, "body": [body], "obstacle": list(obstacles),
         "probe": [probe | passed], "solve": {"estimate": False} | dict(solve),
         "output": {"fields": []}} | more
    )  # fmt: skip


@pytest.mark.parametrize("name", FILTERS)
def test_a_class_has_the_coefficients_of_the_standard(name):
    """SAE J211-1 appendix C, run by its own recursion forwards and backwards."""
    number = FILTERS[name]
    step = 0.05 / number
    wd = 2.0 * np.pi * number * 2.0775
    wa = np.sin(0.5 * wd * step) / np.cos(0.5 * wd * step)
    whole = 1.0 + np.sqrt(2.0) * wa + wa * wa
    a0, b1 = wa * wa / whole, -2.0 * (wa * wa - 1.0) / whole
    b2 = (-1.0 + np.sqrt(2.0) * wa - wa * wa) / whole
    values = np.zeros(4000)
    values[1000:1100] = np.sin(np.pi * np.arange(100) / 100)

    def passed(x):
        y = np.zeros_like(x)
        for k in range(2, len(x)):
            y[k] = a0 * (x[k] + 2.0 * x[k - 1] + x[k - 2]) + b1 * y[k - 1] + b2 * y[k - 2]
        return y

    exact = passed(passed(values)[::-1])[::-1]
    assert cfc(values, step, number) == pytest.approx(exact, abs=1e-10)
    # A class passes its own frequency, and has -3 dB at 5/3 of it.
    times = step * np.arange(8000)
    for frequency, gain in ((number, 0.949), (number / 0.6, 0.707)):
        found = cfc(np.sin(2.0 * np.pi * frequency * times), step, number)
        assert np.abs(found[2000:6000]).max() == pytest.approx(gain, abs=0.02)


@pytest.mark.parametrize("length", [400, 4000])
def test_a_last_sample_of_noise_is_not_taken_for_what_follows(length):
    """Of records shorter and longer than what a class looks back on, 1 / class = 1000 samples."""
    noise = np.zeros(length)
    noise[-1] = 1.0
    assert np.abs(cfc(noise, 1e-3, 1.0)).max() < 0.03
    assert cfc(np.full(length, -9.81), 1e-3, 1.0) == pytest.approx(-9.81, rel=1e-9)


def test_the_integral_is_the_change_of_velocity_whatever_the_steps():
    times = np.cumsum([0.0, *np.tile([1e-4, 3e-5, 2e-4], 1000)])
    velocity = -9.81 * times + 4.0 * (times > 0.0999)
    rates = acceleration(times, velocity)
    assert rates[1:] @ np.diff(times) == pytest.approx(velocity[-1] - velocity[0], rel=1e-12)
    even = np.linspace(0.0, times[-1], 3001)
    one = acceleration(times, velocity, "CFC180")
    other = acceleration(even, -9.81 * even + 4.0 * (even > 0.0999), "CFC180")
    assert one == pytest.approx(np.interp(times, even, other), abs=0.15 * other.max())
    assert one.max() == pytest.approx(other.max(), rel=5e-2)  # rows beside the peak
    assert one[-1] == pytest.approx(-9.81, rel=1e-6)


@pytest.mark.parametrize("method", ["event_driven", "moreau_jean"])
def test_what_an_impact_changes_reads_alike_through_a_filter(method):
    """Peaks without a filter are as high as steps are short; through it they are not."""
    falls = scene(BALL, [0, 1], gravity=[0.0, -9.81], filter="CFC180",
                  contact=[{"between": ["ball", "floor"], "restitution": 0.8}])  # fmt: skip
    peaks = []
    for dt in (5e-4, 1e-4):
        history = impactfem.solve(falls, method=method, dt=dt).history
        assert "a.vy" not in history
        peaks.append(history["a.ay"].values.max())
        assert history["a.ay"].values[:100] == pytest.approx(-9.81, rel=1e-9)
        assert history["a.ay"].attrs["units"] == "m/s^2"
    # 1.8 sqrt(2 g h) times the response to a unit impulse, which is that of the two passes.
    unit = np.zeros(4001)
    unit[2000] = 1.0 / 2e-5
    height = 1.8 * np.sqrt(2 * 9.81) * cfc(unit, 2e-5, 180.0).max() - 9.81
    assert peaks[0] == pytest.approx(height, rel=0.09)  # nearly the longest steps allowed
    assert peaks[1] == pytest.approx(height, rel=1e-2)


SPIN = 3.0
RIGID = {"kind": "rigid", "name": "disc", "model": "2d", "density": 1.0,
         "shape": {"kind": "disc", "radius": 0.5, "center": [0.0, 2.0]},
         "angular_velocity": SPIN}  # fmt: skip
SOLID = {"kind": "solid", "name": "block", "model": "plane_strain", "density": 1.0,
         "youngs_modulus": 100.0, "poisson_ratio": 0.3, "mesh_size": 0.3,
         "shape": {"kind": "block", "size": [1.0, 0.5], "corner": [0.0, 2.0]}}  # fmt: skip
BEAM = {"kind": "beam", "name": "beam", "length": 1.0, "center": [0.0, 2.0], "width": 0.1,
        "thickness": 0.05, "density": 1.0, "youngs_modulus": 10.0, "elements": 4}  # fmt: skip


@pytest.mark.parametrize("method", ["massless", "conserving", "explicit"])
def test_a_solid_that_falls_is_accelerated_by_gravity(method):
    found = impactfem.solve(scene(SOLID, [0.5, 2.2], gravity=[0.0, -9.81], solve={"method": method},
                                  quantities=["acceleration", "velocity"]))  # fmt: skip
    assert found.history["a.ay"].values[2:] == pytest.approx(-9.81, rel=1e-9)
    assert -9.82 < found.history["a.ay"].values[1] < -4.9  # velocities amid the first step
    assert {"a.vx", "a.vy", "a.ax", "a.ay"} <= set(found.history)


def test_a_place_of_a_body_that_turns_has_its_centripetal_acceleration():
    """The mean over a step: 2 w R sin(w dt / 2) / dt towards the centre."""
    history = impactfem.solve(scene(RIGID, [0.4, 2.0], obstacles=[], solve={"dt": 1e-2})).history
    found = np.hypot(history["a.ax"].values, history["a.ay"].values)
    mean = 2.0 * SPIN * 0.4 * np.sin(0.5 * SPIN * 1e-2) / 1e-2
    assert found == pytest.approx(mean, rel=1e-3)
    assert history["a.ax"].values[0] == pytest.approx(-mean, rel=1e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"filter": "CFC61"}, "did you mean"),
        ({"filter": "CFC60", "quantities": ["velocity"]}, "filters accelerations only"),
    ],
)
def test_filters_without_sense_are_refused(change, words):
    with pytest.raises(SceneError, match=words):
        scene(BALL, [0, 1], **change)


@pytest.mark.parametrize(("body", "point"), [(BALL, [0, 1]), (SOLID, [0.5, 2.2])])
def test_steps_too_long_for_a_class_are_refused(body, point):
    case = scene(body, point, filter="CFC1000", solve={"dt": 2e-3})
    with pytest.raises(SceneError, match=r"probe\[0\].filter = .*give solve.dt = 0.0001 or less"):
        impactfem.solve(case)
