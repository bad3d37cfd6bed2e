"""Many contacts: what galerkin's rounding grows to, and that the default stays right."""

import numpy as np
import pytest

import impactfem

DOYEN = {"length": 10.0, "youngs_modulus": 900.0, "gap": 5.0}
IRREGULAR = {"gap": 0.5, "velocity": -2.0}


def bounces(duration, gravity=10.0, solve=None, **bar):
    keys = {"length": 1.0, "density": 1.0, "youngs_modulus": 1.0, "gap": 0.5, **bar}
    return impactfem.Scene(
        title="bounces",
        duration=duration,
        gravity=gravity,
        bodies=[impactfem.Bar(**keys)],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(**(solve or {})),
    )


def error(result):
    return result.summary["error"]["displacement_max"]


@pytest.mark.parametrize(
    ("duration", "method"),
    [(20.0, "galerkin"), (25.0, "exact")],  # 8e-10 and 4e-9 of galerkin: both sides of the switch
)
@pytest.mark.parametrize("solve", [{}, {"elements": 40}])
def test_galerkin_is_taken_as_long_as_its_rounding_stays_small(duration, method, solve):
    plan = impactfem.plan(bounces(duration, **DOYEN, solve=solve))
    assert plan.method == method
    assert plan.elements == 40
    assert plan.predicted_error <= 1e-9


@pytest.mark.parametrize(
    "case",
    [
        bounces(50.0, **DOYEN),
        bounces(100.0, **DOYEN),
        bounces(40.0, gravity=0.2500001),
        bounces(40.0, gravity=1.0, **IRREGULAR),
        bounces(30.0, gravity=0.3, velocity="-0.5 + 0.1*sin(3*x)"),
    ],
    ids=["19 bounces", "38 bounces", "off layers", "irregular", "curved start"],
)
def test_the_default_is_right_over_many_contacts(case):
    result = impactfem.solve(case)
    assert error(result) <= 1e-9
    assert result.summary["plan"]["predicted_error"] <= 1e-9
    assert result.summary["energy"]["max_relative_drift"] <= 1e-9


def test_many_bounces_are_those_of_the_closed_form():
    """Contact for 2/3 s every 8/3 s: a figure that no second run of the same code gives."""
    found = impactfem.solve(bounces(100.0, **DOYEN)).summary["contact"]
    begins = 1.0 + 8.0 / 3.0 * np.arange(38)
    expected = np.stack([begins, np.minimum(begins + 2.0 / 3.0, 100.0)], axis=1)
    np.testing.assert_allclose(found["intervals"], expected, rtol=0, atol=1e-10)
    assert found["max_force"] == pytest.approx(500.0, rel=1e-10)


@pytest.mark.parametrize("duration", [20.0, 30.0, 40.0])
def test_the_plan_foretells_what_rounding_grows_to(duration):
    asked = bounces(duration, **DOYEN, solve={"method": "galerkin", "elements": 40})
    result = impactfem.solve(asked)
    assert 0.1 <= result.summary["plan"]["predicted_error"] / error(result) <= 10.0


@pytest.mark.parametrize(
    ("duration", "severity", "level"),
    [(30.0, None, "trust"), (40.0, "warning", "care"), (100.0, "fault", "do_not_trust")],
)
def test_what_rounding_grows_to_is_found_in_plan_and_run(duration, severity, level):
    asked = bounces(duration, **DOYEN, solve={"method": "galerkin", "elements": 40})
    plan = impactfem.plan(asked)
    foreseen = [f.severity for f in plan.findings if f.code == "rounding_growth"]
    verdict = impactfem.solve(asked).summary["verdict"]
    found = [f["severity"] for f in verdict["findings"] if f["code"] == "rounding_growth"]
    assert foreseen == found == ([severity] if severity else [])
    assert verdict["level"] == level


def test_rounding_of_a_clamped_rod_does_not_grow():
    rod = {"far_end": "clamped", "gap": 0.0, "displacement": "(1 - x)/2"}
    plan = impactfem.plan(bounces(300.0, gravity=0.0, **rod))
    assert plan.method == "galerkin"
    assert 1e-14 <= plan.predicted_error <= 1e-11


def test_a_chaotic_motion_is_not_claimed():
    """After 170 s its waves are merged: the plan says so, and the run does."""
    late = bounces(175.0, gravity=1.0, **IRREGULAR, solve={"elements": 8})
    plan = impactfem.plan(late.with_settings({"solve.method": "exact"}))
    assert plan.predicted_error > 1e-6


def test_exact_forces_are_means_over_layers_and_the_impulse_is_exact():
    case = bounces(15.0, gravity=1.0, **IRREGULAR, solve={"method": "exact", "elements": 40})
    result = impactfem.solve(case)
    time = result.history["time"].values
    force = result.history["contact_force"].values
    found = result.summary["contact"]
    assert force[1:] @ np.diff(time) == pytest.approx(found["impulse"], rel=1e-12)
    assert found["impulse"] == pytest.approx(18.472, abs=5e-4)
    momentum = result.history["momentum"].values
    assert momentum[-1] - momentum[0] == pytest.approx(found["impulse"] - 15.0, abs=1e-10)
    # The mean of the layer in which the bar arrives is that of a share of it.
    begin, _ = found["intervals"][0]
    layer = np.searchsorted(time, begin)
    after = force[layer + 1]
    share = (time[layer] - begin) / (time[layer] - time[layer - 1])
    assert force[layer] == pytest.approx(share * after, rel=0.1)
    assert found["max_force"] >= force.max()
