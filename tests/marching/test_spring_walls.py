"""A bar at a wall that gives way, by galerkin: OC-6, F = Z v (1 - e^(-kappa s)) up to 2 L/c."""

import math

import numpy as np
import pytest
from moving_scenes import check_ranks
from scipy.optimize import brentq

import impactfem
from impactfem import Scene, SceneError


def scene(kappa, gap=0.1, **solve):
    return Scene.from_dict({
        "title": "spring wall", "duration": 4.0,
        "body": [{"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0,
                  "gap": gap, "velocity": -1.0}],
        "obstacle": [{"kind": "wall"}],
        "contact": [{"between": ["bar", "wall"], "stiffness": kappa}],
        "solve": {"method": "galerkin", "elements": 40, **solve},
        "output": {"report": False, "pictures": False, "fields": []},
    })  # fmt: skip


def force_error(kappa, history, gap=0.1):
    """Largest difference from the means of the exact force in layers."""
    time, force = history["time"].values, history["contact_force"].values
    ends = time - gap
    inside = (ends > 0.06) & (ends < 1.98)
    late, soon = np.exp(-kappa * ends[inside]), np.exp(-kappa * (ends[inside] - time[1]))
    return np.abs(force[inside] - 1.0 + (soon - late) / (kappa * time[1])).max()


@pytest.mark.parametrize(("kappa", "gap"), [(1.0, 0.1), (10.0, 0.1), (10.0, 0.1234)])
def test_the_force_converges_with_the_square_of_elements(kappa, gap):
    errors = []
    for elements in (40, 80, 160):
        run = impactfem.solve(scene(kappa, gap, elements=elements))
        errors.append(force_error(kappa, run.history, gap))
        time, force = run.history["time"].values, run.history["contact_force"].values
        energy = run.history["total_energy"].values
        # Where contact begins and ends inside layers; else energy stays to rounding.
        assert np.abs(energy / energy[0] - 1.0).max() < 1.3 * kappa / elements**2
        more = brentq(
            lambda y: kappa * y - math.log(2 - math.exp(-2 * kappa) + 2 * kappa * y), 1e-3, 3
        )
        assert time[force > 0.0].max() == pytest.approx(gap + 2.0 + more, abs=1.0 / elements)
        assert run.history["gap"].values.min() == 0.0
    assert math.log2(errors[0] / errors[2]) / 2.0 > 1.7


def test_windows_and_the_assembled_system_are_the_same():
    swept, *others = (
        impactfem.solve(scene(10.0, 0.1234, elements=20, **how)).history
        for how in ({}, {"window": "all"}, {"method": "monolithic"})
    )
    for other in others:
        for name in ("contact_force", "bar.x", "total_energy"):
            np.testing.assert_allclose(other[name].values, swept[name].values, atol=1e-11)


def test_the_error_is_told():
    """Against many elements, whose own error is a hundredth; gains within it are no news."""
    run, fine = (impactfem.solve(scene(10.0, 0.1234, elements=n)) for n in (40, 400))
    wrong = np.abs(run.history["bar.x"].values - fine.history["bar.x"].values[::10]).max()
    assert wrong > 1e-6
    assert wrong < run.summary["error"]["displacement_max"]
    assert run.summary["energy"]["max_relative_growth"] > 1e-6
    assert run.summary["verdict"]["level"] == "trust"


def test_elements_follow_the_rise_and_coarse_ones_are_doubted():
    free = impactfem.plan(scene(100.0).with_settings({"solve.elements": None}))
    assert free.numbers.elements == 500
    codes = [each.code for each in impactfem.plan(scene(100.0)).findings]
    assert "contact_unresolved" in codes


def test_what_does_not_know_such_walls_is_refused():
    with pytest.raises(SceneError, match=r"does not know contacts that give way"):
        scene(10.0, method="exact", elements=None)
    with pytest.raises(SceneError, match=r"solve\.active_set.*remove it, or stiffness"):
        scene(10.0, method="monolithic", active_set="snes_vi")


@pytest.mark.parallel(2)
def test_two_ranks_agree(monkeypatch):
    check_ranks(lambda: scene(10.0, elements=10, method="monolithic"), monkeypatch)
