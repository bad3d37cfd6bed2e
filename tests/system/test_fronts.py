"""Energies of galerkin at courant 1: those of its waves, with no dip at fronts."""

import pytest

import impactfem

DOYEN = {"length": 10.0, "youngs_modulus": 900.0, "gap": 5.0}
ROD = {"far_end": "clamped", "gap": 0.0, "displacement": "(1 - x)/2"}


def energy(duration, gravity=0.0, elements=40, **bar):
    keys = {"length": 1.0, "density": 1.0, "youngs_modulus": 1.0, "gap": 0.5, **bar}
    scene = impactfem.Scene(
        title="fronts",
        duration=duration,
        gravity=gravity,
        bodies=[impactfem.Bar(**keys)],
        obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(method="galerkin", elements=elements),
    )
    return impactfem.solve(scene).summary["energy"]


@pytest.mark.parametrize(
    ("case", "limit"),
    [
        ({"duration": 5.0, "velocity": -0.5}, 1e-13),  # 1.25e-2 of nodal values
        ({"duration": 12.0, **ROD}, 1e-13),
        ({"duration": 12.0, "gravity": 10.0, **DOYEN}, 1e-10),
        ({"duration": 3.25, "gravity": [[0.0, 0.0], [0.5, 0.25]], "velocity": -0.25}, 1e-12),
    ],
    ids=["K1", "clamped", "bounces in gravity", "gravity switched on"],
)
def test_exact_motions_keep_their_energy(case, limit):
    assert energy(**case)["max_relative_drift"] <= limit


@pytest.mark.parametrize("elements", [17, 40])
@pytest.mark.parametrize(
    "case",
    [
        {"duration": 5.0, "velocity": -0.5, "gap": 0.5123},
        {"duration": 15.0, "gravity": 1.0, "velocity": -2.0},
        {"duration": 6.0, "gravity": 0.3, "gap": 0.1, "far_end": "clamped"},
    ],
)
def test_off_layers_energy_is_lost_and_never_won(case, elements):
    found = energy(**case, elements=elements)
    assert found["max_relative_growth"] <= 1e-13
    assert found["final_relative_drift"] < -1e-5
