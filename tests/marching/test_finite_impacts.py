"""Impacts between bodies with mass beside one under finite strain: Newton's e, Coulomb, energy."""

import numpy as np
import pytest
from moving_scenes import check_restart

import impactfem
from impactfem.errors import SceneError

FLOOR = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
RUBBER = {
    "kind": "solid", "name": "block", "model": "plane_strain", "mesh_size": 0.03,
    "material": "neo_hookean", "density": 1100.0, "youngs_modulus": 1e6, "poisson_ratio": 0.4,
    "shape": {"kind": "block", "size": [0.1, 0.03], "corner": [0.3, 0.2]},
}  # fmt: skip


def point(name, mass, position, velocity):
    return {
        "kind": "point", "name": name, "mass": mass, "radius": 0.01, "position": position,
        "velocity": velocity,
    }  # fmt: skip


def scene(bodies, laws, duration, dt=1e-3, **more):
    contacts = [{"between": names.split(), **law} for names, law in laws.items()]
    return impactfem.Scene.from_dict(
        {
            "title": "impacts", "duration": duration, "body": [RUBBER, *bodies],
            "obstacle": [FLOOR], "contact": contacts, "output": {"fields": []},
            "solve": {"dt": dt, "method": "conserving", "estimate": False},
        } | more
    )  # fmt: skip


def columns(result, *names):
    return (result.history[name].values for name in names)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_points_leave_by_the_law_of_newton(e):
    bodies = [point("p", 0.1, [0.0, 0.5], [1.0, 0.0]), point("q", 0.2, [0.1, 0.5], [-1.0, 0.0])]
    result = impactfem.solve(scene(bodies, {"p q": {"restitution": e}}, 0.08))
    p, q, energy = columns(result, "p.vx", "q.vx", "total_energy")
    assert p[-1] == pytest.approx(-1.0 / 3.0 - 4.0 / 3.0 * e, abs=1e-9)
    assert q[-1] == pytest.approx(-1.0 / 3.0 + 2.0 / 3.0 * e, abs=1e-9)
    assert np.ptp(0.1 * p + 0.2 * q) <= 1e-13
    taken = 0.5 * (0.1 * 0.2 / 0.3) * 4.0 * (1.0 - e**2)
    assert energy[0] - energy[-1] == pytest.approx(taken, abs=1e-12)
    assert np.diff(energy).max() <= 1e-13
    assert sum(result.summary["energy"]["taken"].values()) == pytest.approx(taken, abs=1e-12)
    # An impact has no force, but an impulse.
    assert result.history["contact_force"].values.max() == 0.0
    impulse = 0.1 * 0.2 / 0.3 * 2.0 * (1.0 + e)
    assert result.summary["contact"]["max_impulse"] == pytest.approx(impulse, rel=1e-9)


@pytest.mark.parametrize(("mu", "after"), [(0.2, 1.0 - 0.2 * 1.5), (0.9, 0.0)])
def test_friction_of_an_impact_slips_or_sticks(mu, after):
    law = {"restitution": 0.5, "friction_coefficient": mu}
    bodies = [point("p", 0.1, [0.0, 0.03], [1.0, -1.0])]
    result = impactfem.solve(scene(bodies, {"p floor": law}, 0.04))
    along, up = columns(result, "p.vx", "p.vy")
    assert along[-1] == pytest.approx(after, abs=1e-9)
    assert up[-1] == pytest.approx(0.5, abs=1e-9)


def tumbling():
    """A rod and a point that fall, rebound, rub and meet."""
    rod = {
        "kind": "rod", "name": "rod", "length": 0.2, "mass": 0.3, "center": [0.05, 0.12],
        "inclination": 0.3, "velocity": [0.0, -0.5],
    }  # fmt: skip
    law = {"restitution": 0.6, "friction_coefficient": 0.4}
    laws = {"rod floor": law, "p floor": law, "p rod": law, "block rod": {}, "block floor": {}}
    bodies = [rod, point("p", 0.1, [0.3, 0.05], [-1.0, 0.0])]
    output = {"fields": [], "checkpoint": 10}
    return scene(bodies, laws, 0.15, gravity=[0.0, -9.81], output=output)


def test_no_layer_of_a_rod_and_a_point_gains_energy():
    case = tumbling()
    result = impactfem.solve(case)
    (energy,) = columns(result, "total_energy")
    assert np.diff(energy).max() <= 1e-8 * energy[0]
    assert energy[-1] < 0.99 * energy[0]
    assert result.summary["contact"]["max_impulse"] > 0.1


@pytest.mark.parallel([1, 2])
@pytest.mark.slow
def test_a_continued_run_with_impacts_equals_the_whole_one(tmp_path, monkeypatch):
    case = tumbling()
    check_restart(case, 70, tmp_path, monkeypatch)


def test_what_has_no_law_is_refused():
    point_ = point("p", 0.1, [0.35, 0.5], [0.0, -1.0])
    with pytest.raises(SceneError, match=r"contact\[0\].restitution = 0.5.*own elasticity"):
        scene([point_], {"p block": {"restitution": 0.5}}, 0.1)
