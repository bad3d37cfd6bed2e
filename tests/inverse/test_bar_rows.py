"""Bars in a row: gradients of their exact solution."""

import pytest

import impactfem
from impactfem import Scene, SceneError

BAR = {"kind": "bar", "density": 2.0, "area": 0.5, "youngs_modulus": 8.0}  # c = 2, Z = 2


def striker(a, speed=1.0, **keys):
    """A bar of length a strikes one of length 1 at rest: a share of energy stays in vibration."""
    return Scene.from_dict(
        {
            "title": "striker", "duration": 4.0,
            "body": [BAR | {"name": "striker", "length": a, "velocity": str(speed)},
                     BAR | {"name": "bar", "length": 1.0, "gap": 3.0}],
            "parameter": [{"name": "a", "key": "body.striker.length", "bounds": [0.2, 2.5]}],
            "objective": {"minimise": [{"term": "vibration_energy"}]},
            "output": {"report": False, "pictures": False, "fields": []},
        } | keys
    )  # fmt: skip


def left(a):
    """Share of the energy left in vibration, and its slope (one bar of the same material)."""
    return (1.0 - a, -1.0) if a <= 1.0 else ((a - 1.0) / a**2, (2.0 - a) / a**3)


@pytest.mark.parametrize("a", [0.6, 1.7])
def test_the_share_left_in_vibration(a):
    found = impactfem.gradient(striker(a))
    share, slope = left(a)
    energy = 0.5 * a  # of mass a and speed 1
    assert found.objective == pytest.approx(share * energy, abs=1e-12)
    assert found.gradient["a"] == pytest.approx(slope * energy + 0.5 * share, abs=1e-7)
    assert found.trusted


def test_bars_of_one_length_are_a_kink():
    """Both slopes are told, and their mean is no gradient to be trusted."""
    found = impactfem.gradient(striker(1.0))
    assert found.sides["a"] == pytest.approx((-0.5, 0.5), abs=1e-7)
    assert not found.trusted


def test_the_length_that_leaves_nothing():
    found = impactfem.optimise(striker(0.7))
    assert found.parameters["a"]["value"] == pytest.approx(1.0, abs=1e-6)
    assert found.objective["final"] == pytest.approx(0.0, abs=1e-6)
    assert found.trusted, found.doubts  # it rises on both sides


def test_impulse_and_duration_of_a_row():
    """Until the first wave is back: Z v / 2 for 2 a / c; the bar leaves with all of it at a = 1."""
    of = ("impulse.striker.bar", "duration.striker.bar", "rebound_speed.bar")
    measures = [{"name": f"m{k}", "of": name} for k, name in enumerate(of)]
    wanted = [{"term": "value", "of": m["name"]} for m in measures]
    found = impactfem.gradient(
        striker(0.5, measure=measures, objective={"minimise": wanted})
    )  # impulse Z v/2 2a/c = a, duration a (c = 2), speed impulse / mass = a
    for measure in found.measures.values():
        assert measure["values"] == pytest.approx([0.5], abs=1e-12)
        assert measure["gradient"]["a"] == pytest.approx([1.0], abs=1e-8)


def test_rows_by_layers_have_no_gradients():
    with pytest.raises(SceneError, match=r'"galerkin".*bars in a row.*"exact"'):
        impactfem.gradient(striker(0.5, solve={"method": "galerkin"}))
