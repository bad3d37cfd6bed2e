"""The same scene of solids, said in two ways, gives the same history and fields."""

import numpy as np
import pytest
from moving_scenes import BALL, DISC, FLOOR, METHODS, differences, driven, pair, rolling, scene

import impactfem
from impactfem import Scene

DIFFERENCES = ("dissipated_energy", "friction_work")  # small beside what they are taken from
SLOPE = FLOOR | {"point": [0.6, 0.0], "normal": [-0.6, 0.8]}


def changed(case, **tables):
    """The scene with other tables."""
    return Scene.from_dict(case.to_dict() | tables)


def every_contact(case, **law):
    """The sentences that are the default anyhow."""
    names = [obstacle.name for obstacle in case.obstacles]
    body = case.bodies[0].name
    return changed(case, contact=[{"between": [body, name]} | law for name in names])


def apart(one, other, columns=None):
    """Largest difference of each column, relative to its largest value, from 1e-12 on."""
    found = {}
    for name in columns or one.history.data_vars:
        a, b = (np.asarray(r.history[name].values, dtype=float) for r in (one, other))
        assert a.shape == b.shape
        np.testing.assert_array_equal(np.isnan(a), np.isnan(b))
        whole = "total_energy" if name in DIFFERENCES else name
        largest = np.nanmax(np.abs(one.history[whole].values), initial=0.0)
        if (wrong := np.nanmax(np.abs(a - b), initial=0.0)) > 1e-12 * largest:
            found[name] = wrong / largest
    return found


@pytest.mark.slow
@pytest.mark.parametrize("made", [driven, rolling])
@pytest.mark.parametrize("method", METHODS)
def test_contacts_that_are_the_default_change_nothing(made, method):
    case = made(method, duration=1.5)
    one = impactfem.solve(case)
    assert one.summary["contact"]["max_force"] > 0.0
    other = every_contact(case)
    assert every_contact(case, friction_coefficient=0.0) == other  # the same scene, word by word
    assert differences(one, impactfem.solve(other)) == {}


@pytest.mark.parametrize("solve", [{}, {"courant": 0.7}, {"method": "massless"}])
def test_the_plan_does_not_depend_on_the_way(solve):
    body = {"shape": DISC, "mesh_size": 0.125, "velocity": [0.1, -0.1]}
    case = scene(body, [BALL, SLOPE], 2.0, [0.0, -0.05], solve, {})
    one, other = impactfem.plan(case), impactfem.plan(every_contact(case))
    assert one == other


def test_the_order_of_obstacles_changes_nothing():
    body = {"shape": DISC, "mesh_size": 0.125, "velocity": [0.15, -0.1]}
    solve = {"method": "explicit", "normals": "updated"}
    one = scene(body, [BALL, SLOPE], 3.0, None, solve, {"fields": []})
    tables = one.to_dict()
    other = changed(one, obstacle=tables["obstacle"][::-1])
    assert apart(impactfem.solve(one), impactfem.solve(other)) == {}


@pytest.mark.slow
@pytest.mark.parametrize("method", [m for m in METHODS if m != "newmark"])  # rounding grows in it
def test_a_body_that_nothing_touches_changes_nothing(method):
    """It takes the other path, which weighs gaps of several bodies, with the same forces."""
    body = {"shape": DISC, "mesh_size": 0.125, "velocity": [0.05, -0.1]}
    one = scene(body, [FLOOR], 2.5, None, {"method": method, "dt": 0.05}, {"fields": []})
    tables = one.to_dict()
    far = tables["body"][0] | {"name": "far", "velocity": ["0", "0"]}
    far["shape"] = far["shape"] | {"center": [9.0, 0.6]}
    other = changed(one, body=[tables["body"][0], far], contact=[{"between": ["body", "o0"]}])
    columns = [f"body.{axis}" for axis in ("x", "y", "vx", "vy")]
    columns += ["contact_force", "gap", "kinetic_energy", "elastic_energy"]
    results = impactfem.solve(one), impactfem.solve(other)
    assert results[0].summary["contact"]["max_force"] > 0.0
    assert apart(*results, columns) == {}


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_the_order_of_bodies_changes_nothing(friction):
    case = pair("conserving", "fixed", friction)
    bodies = case.to_dict()["body"]
    results = impactfem.solve(case), impactfem.solve(changed(case, body=bodies[::-1]))
    names = [name for name in results[0].history.data_vars if name != "momentum"]
    worst = apart(*results, names)
    # With friction a cone is solved to a tolerance of its own.
    assert worst == {} if not friction else max(worst.values(), default=0.0) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("method", ["explicit", "massless", "conserving"])
def test_friction_that_is_next_to_none_changes_nothing(method):
    """It asks for answers in all directions, node by node, where none needs one a gap only."""
    results = [impactfem.solve(pair(method, "fixed", mu)) for mu in (0.0, 1e-14)]
    assert results[0].summary["contact"]["max_force"] > 0.0
    assert max(apart(*results).values(), default=0.0) < 1e-9


def test_the_potential_of_gravity_counts_from_where_bodies_would_touch():
    body = {"shape": DISC, "mesh_size": 0.125}
    one = scene(body, [FLOOR], 0.5, [0.0, -0.3], {"method": "massless"}, {"fields": []})
    tables = one.to_dict()
    above = tables["body"][0] | {"name": "above", "shape": DISC | {"center": [2.0, 0.53]}}
    two = changed(one, body=[tables["body"][0], above])
    for case, heights in ((one, [0.01]), (two, [0.01, 0.03])):
        result = impactfem.solve(case)
        masses = [body["mass"] for body in result.summary["bodies"].values()]
        level = result.history["potential_energy"].values[0]
        assert level == pytest.approx(0.3 * np.dot(masses, heights), rel=1e-3)  # of a polygon
