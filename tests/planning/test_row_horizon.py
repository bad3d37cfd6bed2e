"""Many collisions in a row of bars: what plan and run say of rounding, and what they choose."""

import pytest

import impactfem
from impactfem import Bar, Scene, Wall


def to_and_fro(duration, velocity=-1.0):
    """A bar between a wall and a held bar, three collisions each five seconds, all on layers."""
    data = {"density": 1.0, "youngs_modulus": 1.0}
    return Scene(
        title="to and fro",
        duration=duration,
        bodies=[
            Bar(name="a", gap=0.25, velocity=velocity, length=0.5, **data),
            Bar(name="b", gap=1.0, length=1.0, far_end="clamped", **data),
        ],
        obstacles=[Wall()],
    )


@pytest.mark.parametrize(("duration", "method"), [(5.0, "galerkin"), (400.0, "exact")])
def test_the_default_is_right_over_any_horizon(duration, method):
    scene = to_and_fro(duration)
    plan = impactfem.plan(scene)
    assert plan.method == method
    assert plan.predicted_error <= 1e-9
    assert plan.findings == ()
    summary = impactfem.solve(scene).summary
    assert summary["verdict"]["level"] == "trust"
    if summary["error"]:
        assert summary["error"]["displacement_max"] <= plan.predicted_error


@pytest.mark.parametrize(
    ("duration", "foreseen", "level"),
    [(5.0, [], "trust"), (400.0, ["fault"], "do_not_trust")],
)
def test_rounding_that_grows_is_found_in_plan_and_run(duration, foreseen, level):
    scene = to_and_fro(duration).with_settings({"solve.method": "galerkin", "solve.elements": 40})
    plan = impactfem.plan(scene)
    assert [f.severity for f in plan.findings if f.code == "rounding_growth"] == foreseen
    summary = impactfem.solve(scene).summary
    found = [f for f in summary["verdict"]["findings"] if f["code"] == "rounding_growth"]
    assert [f["severity"] for f in found] == foreseen
    assert summary["verdict"]["level"] == level
    assert summary["error"]["displacement_max"] <= 2.0 * plan.predicted_error


def test_a_prediction_at_worst_gives_way_to_what_was_measured():
    scene = to_and_fro(40.0).with_settings({"solve.method": "galerkin", "solve.elements": 40})
    assert "rounding_growth" in [f.code for f in impactfem.plan(scene).findings]
    summary = impactfem.solve(scene).summary
    assert summary["error"]["displacement_max"] <= 1e-9
    assert summary["verdict"] == {"level": "trust", "findings": []}


def test_states_that_vary_are_followed_by_lines():
    scene = to_and_fro(20.0, velocity="-1 + 0.3*sin(4*x)")
    plan = impactfem.plan(scene)
    assert plan.method == "conserving"
    summary = impactfem.solve(scene).summary
    assert summary["error"]["displacement_max"] <= plan.predicted_error
    assert summary["energy"]["max_relative_drift"] <= 1e-12
