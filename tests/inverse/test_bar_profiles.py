"""Profiles and loads of bars as unknowns: gradients, a design, strains read by the wall."""

import numpy as np
import pytest

import impactfem
from impactfem import Scene, SceneError

PLAIN = {"report": False, "pictures": False, "fields": []}
BAR = {"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0}


def design(start=1.0, pieces=3, **objective):
    """A striker with a heavy tail, whose area before it may vary."""
    return Scene.from_dict({
        "title": "design", "duration": 4.0,
        "body": [BAR | {"area": "where(x < 0.75, profile, 3)", "velocity": -0.5}],
        "obstacle": [{"kind": "wall"}],
        "control": [{"name": "profile", "along": "x", "pieces": pieces, "until": 0.75,
                     "start": start, "bounds": [0.2, 3.0]}],
        "objective": {"minimise": [{"term": "vibration_energy"}], **objective},
        "solve": {"elements": 20}, "output": PLAIN,
    })  # fmt: skip


@pytest.mark.slow
def test_the_gradient_by_a_profile_is_that_of_runs():
    found = impactfem.gradient(design([0.9, 1.3, 0.7]))
    assert found.method == "galerkin"
    assert found.trusted
    assert found.check.rate == pytest.approx(2.0, abs=0.1)


@pytest.mark.slow
def test_a_profile_keeps_less_vibration_at_the_same_mass():
    most = {"constraints": [{"term": "mass", "body": "bar", "max": 1.5}]}
    found = impactfem.optimise(design(1.0, **most)).as_dict()
    assert found["objective"]["initial"] == pytest.approx(0.0572916667, abs=1e-9)
    assert found["objective"]["final"] < 0.0138
    assert found["objective"]["verified"] == pytest.approx(found["objective"]["final"], abs=1e-9)


def test_slope_of_the_momentum_by_a_load_along_the_bar():
    scene = Scene.from_dict({
        "title": "load", "duration": 2.0, "body": [BAR | {"gap": 5.0}],
        "obstacle": [{"kind": "wall"}],
        "control": [{"name": "q", "acts": "body.bar.load", "pieces": 2, "until": 1.0}],
        "objective": {"minimise": [{"term": "speed", "body": "bar"}]},
        "solve": {"elements": 20}, "output": PLAIN,
    })  # fmt: skip
    moved = scene.with_settings({"control.q.start": [0.2, 0.1]})
    found = impactfem.gradient(moved)
    assert found.objective == pytest.approx(0.15, abs=1e-12)  # the bar weighs 1 kg
    np.testing.assert_allclose(list(found.gradient.values()), [0.5, 0.5], atol=1e-9)


def test_a_course_along_x_has_an_end_and_stands_where_x_is_known():
    data = design().to_dict()
    del data["control"][0]["until"]
    with pytest.raises(SceneError, match=r"control\[0\]\.until is missing"):
        Scene.from_dict(data)
    data = design().to_dict()
    data["body"][0]["far_end_force"] = "profile"
    with pytest.raises(SceneError, match="changes with x, and this does not"):
        Scene.from_dict(data)
