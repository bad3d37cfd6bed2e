"""Many collisions in a row of bars: what plan and run say of rounding, and what they choose."""

import numpy as np
import pytest

import impactfem
from impactfem import Bar, Scene, Wall
from impactfem.reference.bar_row import exact_row


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


def farthest(one, other, scene):
    """Largest difference of two exact solutions over the largest way."""
    t = scene.duration * (np.arange(200)[:, None] + 0.5123) / 201
    x = [bar.length * np.linspace(0.0, 1.0, 21) for bar in scene.bars]
    u = [one.displacement(k, t, y) for k, y in enumerate(x)]
    way = max(np.abs(w - one.displacement(k, 0.0, x[k])).max() for k, w in enumerate(u))
    return max(np.abs(w - other.displacement(k, t, x[k])).max() for k, w in enumerate(u)) / way


@pytest.mark.parametrize(
    ("velocity", "most"), [("-1 + 0.3*sin(4*x)", 1e-5), ("where(x < 0.3133, -1, -1.2)", 1e-2)]
)
def test_states_that_vary_have_the_error_of_their_pieces(velocity, most):
    scene = to_and_fro(4.0, velocity=velocity)
    asked = scene.with_settings({"solve.method": "exact"})
    predicted = impactfem.plan(asked).predicted_error
    true = farthest(exact_row(scene, pieces=9973), exact_row(scene), scene)
    assert 0.5 * true <= predicted <= min(10.0 * true, most)
    summary = impactfem.solve(asked).summary
    assert summary["error"]["displacement_max"] == pytest.approx(predicted)
    # A method that is exact at the nodes knows no more than its reference.
    marched = impactfem.solve(scene.with_settings({"solve.method": "galerkin"})).summary
    assert marched["error"]["displacement_max"] >= predicted
    chosen = impactfem.plan(scene)
    assert chosen.method == "exact"
    assert "sampled" in chosen.reasons["method"]


@pytest.mark.slow
def test_conserving_follows_states_that_vary_by_lines():
    scene = to_and_fro(20.0, velocity="-1 + 0.3*sin(4*x)")
    scene = scene.with_settings({"solve.method": "conserving"})
    plan = impactfem.plan(scene)
    summary = impactfem.solve(scene).summary
    assert summary["error"]["displacement_max"] <= plan.predicted_error
    assert summary["energy"]["max_relative_drift"] <= 1e-12
