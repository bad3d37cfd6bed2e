"""Feedback at the far end of a bar: F = d (V* - V), by waves and by layers."""

import numpy as np
import pytest

from impactfem import Scene, SceneError, solve

EPS = np.finfo(float).eps
RHO, AREA, E = 7800.0, 1e-4, 210e9
SPEED = float(np.sqrt(E / RHO))
IMPEDANCE = RHO * AREA * SPEED


def scene(method, *, ratio=1.0, target=0.25, velocity=0.3, transits=2.5, control=None, **more):
    """A bar of 1 m with a controller at its far end, of so many times its impedance."""
    body = {"kind": "bar", "name": "bar", "length": 1.0, "area": AREA, "density": RHO,
            "youngs_modulus": E, "velocity": velocity}  # fmt: skip
    numbers = {"elements": 40, "courant": 1.0} if method == "galerkin" else {}
    held = {"name": "damper", "kind": "p", "acts": "body.bar.far_end_force",
            "of": "bar.far_end.vx", "target": target, "kp": ratio * IMPEDANCE}  # fmt: skip
    tables = {
        "title": "damper", "duration": transits / SPEED, "controller": [held | (control or {})],
        "obstacle": [{"kind": "wall", "name": "wall"}], "solve": {"method": method} | numbers,
    }  # fmt: skip
    own = {k: more.pop(k) for k in ("gap", "load", "displacement") if k in more}
    return Scene.from_dict(tables | {"body": [body | own]} | more)


@pytest.mark.parametrize("method", ["exact", "galerkin"])
def test_no_wave_comes_back(method):
    """After an impact and two transits the bar flies on at the target; and the work is exact."""
    result = solve(scene(method, target=0.5, velocity=-1.0, transits=6.0))
    history, mass = result.history, RHO * AREA
    assert history["bar.vx"].values[-1] == pytest.approx(0.5, abs=1e-12)
    assert history["bar.far_end.vx"].values[-3:] == pytest.approx(0.5, abs=1e-11)
    assert history["elastic_energy"].values[-1] < 1e-20 * mass
    assert np.ptp(history["total_energy"].values) < 1e-12 * mass
    work = result.summary["controllers"]["damper"]["work"]
    assert work == pytest.approx(0.5 * mass * (0.5**2 - 1.0), rel=1e-12)
    error = result.summary["error"]["displacement_max"]
    assert error < 1e-13


@pytest.mark.parametrize("method", ["exact", "galerkin"])
@pytest.mark.parametrize("ratio", [0.4, 3.0])
def test_what_comes_back_is_the_share_of_the_impedances(method, ratio):
    """In free flight: V* + (1 + r)/2 r^n (v0 - V*) in the n-th round, r = (1 - d)/(1 + d)."""
    history = solve(scene(method, ratio=ratio, transits=9.0, gap=1e-3)).history
    back, time = (1.0 - ratio) / (1.0 + ratio), history["time"].values * SPEED
    inside = np.abs(time % 2.0 - 1.0) < 0.9
    rounds = np.floor(0.5 * time)
    wanted = 0.25 + 0.5 * (1.0 + back) * back**rounds * 0.05
    found = history["bar.far_end.vx"].values
    # Velocities are differences of places: roundings of these over a step, n of them.
    room = 10 * len(time) * EPS * 1e-3 * SPEED * 40
    assert np.abs(found - wanted)[inside].max() < max(room, 1e-12)
    force = history["damper.u"].values - ratio * IMPEDANCE * (0.25 - wanted)
    assert np.abs(force[inside]).max() < 10 * room * ratio * IMPEDANCE


def test_waves_and_layers_agree_under_gravity():
    """A bent start and a target in time, before the wall is met: exact at the nodes."""
    given = scene("galerkin", ratio=0.7, target="0.5*sin(1e4*t)", transits=4.0, gravity=1e3,
                  gap=1e-3, displacement="1e-4*x*x")  # fmt: skip
    error = solve(given).summary["error"]
    assert error["measured"]
    assert error["displacement_max"] < 1e-11


def test_what_is_not_followed_is_refused():
    for more, told in (
        ({"control": {"limits": [-1.0, 1.0]}}, "without limits"),
        ({"control": {"sample": 1e-5}}, "without limits, sample"),
        ({"control": {"of": "bar.x"}}, r"feedback of bar\.far_end\.vx alone"),
        ({"ratio": -0.5}, "does not fall in proportion to v"),
        ({"load": "1"}, "load along"),
    ):
        with pytest.raises(SceneError, match=told):
            scene("exact", **more)
    for method in ("conserving", "monolithic", "dg"):
        with pytest.raises(SceneError, match='give "exact" or "galerkin"'):
            scene(method)
