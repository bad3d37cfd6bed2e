"""Screws: joints with a preload, in equilibrium at t = 0."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

from impactfem import Scene, solve
from impactfem.errors import SceneError
from impactfem.planning import plan


def screwed(dim=2, swapped=False, joint=None, **more):
    """A plate that a screw presses on a base."""

    def block(name, low, high, **keys):
        size, corner = [0.1, high - low, 0.1][:dim], [0.0, low, 0.0][:dim]
        return {
            "kind": "solid", "name": name, "model": "3d" if dim == 3 else "plane_strain",
            "shape": {"kind": "block", "size": size, "corner": corner},
            "mesh_size": 0.025 if dim == 3 else 0.0125,
            "density": 1000.0, "youngs_modulus": 1e7, "poisson_ratio": 0.3, "strain": "small",
        } | keys  # fmt: skip

    base = block("base", 0.0, 0.05, supports=[{"surface": "bottom", "kind": "fixed"}])
    between, axis = ["base/top", "plate/bottom"], [0.0, 1.0, 0.0][:dim]
    screw = {
        "name": "screw", "kind": "fixed", "between": between[::-1] if swapped else between,
        "point": [0.05, 0.05, 0.05][:dim], "radius": 0.026 if dim == 3 else 0.013, "preload": 50.0,
        "axis": [-x for x in axis] if swapped else axis,
    } | (joint or {})  # fmt: skip
    return Scene.from_dict(
        {
            "title": "screw", "duration": 4e-4, "start": "static", "joint": [screw],
            "body": [base, block("plate", 0.05, 0.07)],
            "contact": [{"name": "met", "between": ["base", "plate"]}],
            "solve": {"dt": 2e-5, "estimate": False, "method": "conserving"},
            "output": {"fields": [], "checkpoint": 4},
        } | more
    )  # fmt: skip


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("swapped", [False, True])
def test_screw_pulls_with_its_preload_and_all_rest(dim, swapped):
    history = solve(screwed(dim, swapped)).history
    np.testing.assert_allclose(history["screw.force"].values, 50.0, rtol=1e-8)
    np.testing.assert_allclose(history["force.met"].values, 50.0, rtol=1e-8)
    assert history["kinetic_energy"].values.max() < 1e-16 * history["elastic_energy"].values[0]


@pytest.mark.parametrize("dim", [2, 3])
def test_a_rigid_plate_as_wide_as_its_base_is_pressed_on_it(dim):
    """Corners of both lie on each other: which is outside is rounding, and pushed none aside."""
    table = screwed(dim).to_dict()
    shape = {"kind": "block", "size": [0.1, 0.02, 0.1][:dim], "corner": [0.0, 0.05, 0.0][:dim]}
    table["body"][1] = {"kind": "rigid", "name": "plate", "mass": 0.1, "shape": shape}
    table["joint"][0]["between"] = ["base/top", "plate"]
    table["solve"]["method"] = "massless"
    history = solve(Scene.from_dict(table | {"gravity": [0.0, -9.81, 0.0][:dim]})).history
    np.testing.assert_allclose(history["screw.force"].values, 50.0, rtol=1e-6)
    np.testing.assert_allclose(history["force.met"].values, 50.0 + 0.981, rtol=1e-6)


def test_spring_of_a_slide_is_drawn_to_its_preload():
    stiff = {"kind": "prismatic", "stiffness": 1e6}
    one, other = solve(screwed()).history, solve(screwed(joint=stiff)).history
    np.testing.assert_allclose(other["screw.force"].values, 50.0, rtol=1e-8)
    stored = other["elastic_energy"].values - one["elastic_energy"].values
    np.testing.assert_allclose(stored, 50.0**2 / (2.0 * 1e6), rtol=1e-6)


def test_screw_holds_what_pulls_more():
    # Less than the preload: the joint hardly feels it; more: all of it, once the plate has parted.
    pull = screwed().to_dict()
    pull["body"][1]["tractions"] = [{"surface": "top", "value": ["0", "8e5*t"]}]
    history = solve(Scene.from_dict(pull | {"duration": 2e-3})).history
    force, time = history["screw.force"].values, history["time"].values
    assert 50.0 <= force[time < 2e-4].max() < 52.0
    assert force[-1] > 80.0
    assert not history["force.met"].values[-1]


@pytest.mark.parametrize("joint", [{}, {"kind": "prismatic", "stiffness": 1e6}])
@pytest.mark.parallel([1, 2])
def test_restart_equals_the_whole_run(joint, tmp_path, monkeypatch):
    table = screwed(joint=joint).to_dict()
    table["body"][1]["tractions"] = [{"surface": "top", "value": ["0", "8e5*t"]}]
    check_restart(Scene.from_dict(table), 11, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_ranks_agree(monkeypatch):
    check_ranks(screwed, monkeypatch)


@pytest.mark.parametrize(
    ("joint", "more", "words"),
    [
        ({"kind": "revolute", "axis": None}, {}, r"preload = 50\.0: a revolute joint has none"),
        ({"axis": None}, {}, "axis is missing: preload acts along it"),
        ({"kind": "prismatic"}, {}, "give stiffness"),
        ({"preload": 0.0}, {}, "must be > 0"),
        ({}, {"start": "given"}, 'give start = "static"'),
    ],
)
def test_bad_preloads_are_refused(joint, more, words):
    with pytest.raises(SceneError, match=r"joint\[0\]\." + ".*" + words):
        plan(screwed(joint=joint, **more))


def test_what_nothing_presses_on_is_named():
    with pytest.raises(SceneError, match=r"nothing holds body base and plate .* along y"):
        solve(screwed(contact=[]))


def test_a_weightless_rigid_body_that_a_screw_draws_through_is_named():
    table = screwed(contact=[]).to_dict()
    shape = {"kind": "block", "size": [0.1, 0.02], "corner": [0.0, 0.05]}
    table["body"][1] = {"kind": "rigid", "name": "plate", "mass": 0.1, "shape": shape}
    table["joint"][0]["between"] = ["base/top", "plate"]
    with pytest.raises(SceneError, match=r"nothing holds body base and plate .* along y"):
        solve(Scene.from_dict(table))
