"""Energies of galerkin at courant 1: those of its waves, with no dip at fronts."""

import numpy as np
import pytest

import impactfem
from impactfem.marching.bar_row import march_row

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


def row(gap):
    """A short bar strikes a long one of another material; a clamped one swings by itself."""
    steel = {"density": 2.0, "youngs_modulus": 8.0}
    swings = {"far_end": "clamped", "displacement": "0.01*(1.5 - x)"}
    return [
        impactfem.Bar(name="a", length=1.0, density=1.0, youngs_modulus=1.0, velocity=0.5),
        impactfem.Bar(name="b", length=4.0, gap=1.0 + gap, velocity=-0.25, **steel),
        impactfem.Bar(name="c", length=1.5, density=1.0, youngs_modulus=1.0, gap=9.0, **swings),
    ]


@pytest.mark.parametrize(("gap", "on_layers"), [(0.075, True), (0.06123, False)])
def test_rows_keep_the_energy_of_their_waves(gap, on_layers):
    motion = march_row(row(gap), [20, 40, 30], 0.05, 100)
    energy = (motion.kinetic + motion.elastic).sum(axis=1)
    assert motion.force[:, 0].any()
    assert np.diff(energy).max() <= 1e-13 * energy[0]
    lost = 1.0 - energy[-1] / energy[0]
    assert abs(lost) <= 1e-12 if on_layers else 1e-3 <= lost <= 0.1
    swinging = motion.kinetic[:, 2] + motion.elastic[:, 2]
    assert np.ptp(swinging) <= 1e-13 * swinging[0]
