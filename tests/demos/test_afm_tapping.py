"""A lever above a sample: forces on its tip by its place, and the attractive branch."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "afm_tapping"


def test_force_by_the_place_of_the_end_is_a_spring_there():
    stiff = 210e9 * 0.01 * 0.002**3 / 12.0 * 3.0 / 0.2**3
    for strain in ("small", "finite"):
        beam = impactfem.Beam(
            length=0.2, height=0.002, width=0.01, density=7800.0, youngs_modulus=210e9,
            elements=2, center=[0.1, 0.0], strain=strain,
            supports=[{"end": "first", "kind": "clamped"}],
            end_loads=[{"end": "last", "force": ["0", f"1e-3 - {stiff}*u"]}],
        )  # fmt: skip
        found = impactfem.solve(
            impactfem.Scene(
                title="spring", duration=0.2, gravity=[0.0, 0.0], bodies=[replace(
                    beam, rayleigh=[400.0, 0.0])],
                solve=impactfem.Solve(dt=1e-3, estimate=False),
                output=impactfem.Output(fields=[]),
                probes=[impactfem.Probe(name="tip", body="beam", point=[0.2, 0.0])],
            )
        ).history  # fmt: skip
        assert found["tip.uy"].values[-1] == pytest.approx(1e-3 / (2.0 * stiff), rel=1e-3)


@pytest.mark.slow
def test_the_attractive_branch_is_that_of_a_point_mass():
    found = impactfem.solve(impactfem.Scene.from_toml(DEMO / "scene.toml")).history
    way = found["tip.uy"].values[-1500:]
    whole = 2.0 * np.mean(way * np.exp(-2j * np.pi * np.arange(1, 1501) / 150))
    # 6.964 nm, -135.83 degrees by Runge and Kutta's method (script.py).
    assert abs(whole) == pytest.approx(6.964e-9, rel=0.02)
    assert np.degrees(np.angle(whole)) == pytest.approx(-135.83, abs=2.7)
