"""Springs that are damped, moved at their supports, and at rest at t = 0."""

import math

import numpy as np
import pytest
from moving_scenes import check_restart

import impactfem
from impactfem.errors import SceneError

# One square: two masses of 1/4 kg over two that are held, on two edges of half the stiffness.
SQUARE = {"kind": "springs", "name": "net", "mesh_size": 0.5, "pattern": "squares", "mass": 1.0,
          "stiffness": 200.0,
          "shape": {"kind": "block", "size": [0.5, 0.5], "corner": [0.0, 1.0]}}  # fmt: skip
RATE = math.sqrt(100.0 / 0.25)


def scene(net, duration, dt=1e-3, **more):
    bottom = [{"surface": "bottom", "kind": "fixed"}]
    table = {"title": "held", "duration": duration, "gravity": [0.0, 0.0],
             "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
             "body": [{**SQUARE, "supports": bottom, **net}]}  # fmt: skip
    return impactfem.Scene.from_dict(table | more)


@pytest.mark.parametrize(
    "given",
    [{"damping": {"stiffness": 0.01}}, {"damping": {"ratio": 0.1}}, {"rayleigh_stiffness": 0.01},
     {"damping_ratio": 0.1}, {"damping": {"mass": 4.0}}, {"quality_factor": 5.0}],
)  # fmt: skip
def test_dampers_are_those_of_one_degree_of_freedom(given):
    """One tenth of the critical damping, said in six ways."""
    found = impactfem.solve(scene({"velocity": [0.0, 0.3], **given}, 0.12)).history
    time = found["time"].values
    slow = 0.1 * RATE
    fast = math.sqrt(RATE**2 - slow**2)
    # The centre is that of all masses, of which half move.
    y = 0.3 / fast * np.exp(-slow * time) * np.sin(fast * time)
    error = RATE**3 * 1e-6 * 0.3 * 0.12
    assert found["net.y"].values == pytest.approx(1.25 + 0.5 * y, abs=error)
    speed = 0.3 * np.exp(-slow * time) * np.cos(fast * time) - slow * y
    kept = 0.25 * (speed**2 + RATE**2 * y**2)
    assert found["dissipated_energy"].values == pytest.approx(kept[0] - kept, abs=RATE**2 * error)


def test_damping_by_the_mass_brakes_a_fall():
    """Speed g / a (1 - exp(-a t)), and the table of damping is what a scene file keeps."""
    given = scene(
        {"damping": {"mass": 3.0}, "supports": []}, 0.2, dt=2e-3, gravity=[0.0, -9.81]
    )  # fmt: skip
    assert "rayleigh_mass" not in given.to_dict()["body"][0]
    assert given.with_settings({"body.net.damping.mass": 5.0}).bodies[0].rayleigh_mass == 5.0
    found = impactfem.solve(given).history
    exact = -9.81 / 3.0 * (1.0 - np.exp(-3.0 * found["time"].values))
    assert found["net.vy"].values == pytest.approx(exact, abs=9.81 * 0.2 * 36e-6 / 12 * 2)


def test_masses_follow_a_moved_support(tmp_path, monkeypatch):
    """A base that shakes drives what stands on it; its work is what energies gain."""
    moved = {"surface": "bottom", "kind": "motion", "value": ["0", "0.01*sin(30*t)**2"]}
    given = scene({"supports": [moved], "damping": {"stiffness": 0.02}}, 0.2)
    found = impactfem.solve(given).history
    time = found["time"].values
    # y'' + 2 z w y' + w^2 y = 2 z w b' + w^2 b by small steps of an independent rule.
    fine = np.linspace(0.0, 0.2, 4001)
    base, rate = 0.01 * np.sin(30 * fine) ** 2, 0.3 * np.sin(60 * fine)
    y, v, step = np.zeros(len(fine)), 0.0, fine[1]
    for k in range(len(fine) - 1):
        half = v + 0.5 * step * (RATE**2 * (base[k] - y[k]) + 0.02 * RATE**2 * (rate[k] - v))
        y[k + 1] = y[k] + step * half
        push = RATE**2 * (base[k + 1] - y[k + 1]) + 0.02 * RATE**2 * rate[k + 1]
        v = (half + 0.5 * step * push) / (1.0 + 0.01 * step * RATE**2)
    centre = 1.25 + 0.5 * (np.interp(time, fine, y) + np.interp(time, fine, base))
    assert found["net.y"].values == pytest.approx(centre, abs=5e-6)
    slide = np.interp(time, fine, np.gradient(y - base, fine))
    lost = 0.5 * 0.02 * RATE**2 * np.trapezoid(slide**2, time)
    assert found["dissipated_energy"].values[-1] == pytest.approx(lost, rel=2e-3)
    short = {"duration": 0.03, "output.checkpoint": 10}
    check_restart(given.with_settings(short), 15, tmp_path, monkeypatch)


def test_a_net_hangs_at_rest_at_once():
    """It is longer by m g / k at t = 0, and stays so; a pull that nothing holds is named."""
    held = [{"surface": "top", "kind": "fixed"}]
    more = {"start": "static", "gravity": [0.0, -9.81]}
    found = impactfem.solve(scene({"supports": held}, 0.02, **more)).history
    sag = 0.25 * 9.81 / 100.0
    assert found["net.y"].values == pytest.approx(1.25 - 0.5 * sag, abs=1e-12)
    with pytest.raises(SceneError, match="nothing holds body net against its translation along y"):
        impactfem.solve(scene({"supports": []}, 0.02, **more))


def test_a_net_leans_on_a_slope():
    """Friction holds it with its weight, or says that it does not."""
    more = {"start": "static", "gravity": [2.0, -9.6],
            "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 1.0],
                          "normal": [0.0, 1.0]}]}  # fmt: skip
    net = {"supports": [], "pattern": "crossed", "mesh_size": 0.25, "stiffness": 2000.0}
    rubs = {"between": ["net", "floor"], "friction_coefficient": 0.3}
    found = impactfem.solve(scene(net, 0.005, contact=[rubs], **more)).history
    assert found["contact_force"].values == pytest.approx(9.6, rel=1e-3)
    assert found["kinetic_energy"].values.max() < 1e-16
    rubs["friction_coefficient"] = 0.2
    with pytest.raises(SceneError, match="nothing holds body net against its translation along x"):
        impactfem.solve(scene(net, 0.005, contact=[rubs], **more))


def test_what_is_no_support_or_damping_of_a_net_is_refused():
    """With the key, and what to give."""
    moved = {"surface": "bottom", "kind": "motion", "value": ["0", ""]}
    with pytest.raises(SceneError, match=r"supports\[0\].value.*along all 2 axes"):
        scene({"supports": [moved]}, 0.1)
    moved["value"] = ["0", "0.1"]
    with pytest.raises(SceneError, match=r"supports\[0\].value.*jumps from 0"):
        scene({"supports": [moved]}, 0.1)
    moved["value"] = ["0", "t"]
    fixed = {"surface": "left", "kind": "fixed"}
    with pytest.raises(SceneError, match="hold 1 masses of left twice"):
        impactfem.solve(scene({"supports": [moved, fixed]}, 0.1))
    with pytest.raises(SceneError, match="rayleigh_mass = 1 contradicts damping_ratio"):
        scene({"damping": {"mass": 1.0, "ratio": 0.1}}, 0.1)
    with pytest.raises(SceneError, match=r"damping.ratio = \[0.1, 0.2\] has 2 entries"):
        scene({"damping": {"ratio": [0.1, 0.2]}}, 0.1)


def test_a_force_drives_all_of_it_as_weight_does(tmp_path, monkeypatch):
    """Of a held net as one oscillator, of a free one as a point; its work is what they gain."""
    size, turn, last = 3.0, 12.0, 0.3
    made = scene({"force": ["0", f"{size}*sin({turn}*t)"]}, last)
    found = impactfem.solve(made).history
    time = found["time"].values
    # Half of the force acts on half of the mass, the rest on what holds the others.
    rest = 0.5 * size / (RATE**2 - turn**2)
    y = rest * (np.sin(turn * time) - turn / RATE * np.sin(RATE * time))
    slow = 2.0 * rest * last * RATE**3 * 1e-6 / 12.0
    assert found["net.y"].values == pytest.approx(1.25 + y, abs=slow)
    power = size * np.sin(turn * time) * rest * turn * (np.cos(turn * time) - np.cos(RATE * time))
    work = np.concatenate([[0.0], np.cumsum(0.5e-3 * (power[1:] + power[:-1]))])
    gained = found["kinetic_energy"].values + found["elastic_energy"].values
    assert gained == pytest.approx(work, abs=3.0 * slow * size)
    assert np.abs(found["total_energy"].values).max() < 1e-12 * work.max()
    still = impactfem.solve(scene({"force": ["0", "-8"]}, 0.02, start="static")).history
    assert still["net.y"].values == pytest.approx(1.25 - 0.5 * 4.0 / 200.0, abs=1e-12)
    free = {"supports": [], "force": ["2*t", "0"], "angular_velocity": 3.0}
    thrown = impactfem.solve(scene(free, 0.05)).history
    assert thrown["net.vx"].values == pytest.approx(thrown["time"].values ** 2, abs=1e-13)
    short = {"duration": 0.02, "output.checkpoint": 5}
    check_restart(made.with_settings(short), 12, tmp_path, monkeypatch)


@pytest.mark.parametrize(
    ("force", "says"),
    [(["t", "0", "0"], "force = .* has 3 entries"), (["0", "x"], "force"),
     (["0", "1/t"], r"force\[1\] = .* no finite value at the start")],
)  # fmt: skip
def test_forces_that_are_none(force, says):
    with pytest.raises(SceneError, match=says):
        scene({"force": force}, 0.1)
