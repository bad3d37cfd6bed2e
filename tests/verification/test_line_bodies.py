"""Mass, rotation and strains of bars, beams and rigid bodies in the summary."""

import math

import numpy as np
import pytest

import impactfem
from impactfem.runs.line_bodies import bar_figures, beam_figures
from impactfem.scene.beams import Beam
from impactfem.shipped import shipped_scenes
from impactfem.system.beam import free_beam


def shipped(name, **settings):
    scene = impactfem.Scene.from_toml(shipped_scenes()[name])
    return impactfem.solve(scene.with_settings(settings)).summary


@pytest.mark.parametrize("method", ["galerkin", "exact", "conserving", "dg"])
def test_a_bar_in_contact_is_strained_by_speed_over_wave_speed(method):
    summary = shipped("bar_impact", **{"solve.method": method})
    body = summary["bodies"]["bar"]
    exact = 1e-3 if method in ("conserving", "dg") else 1e-9
    assert (body["mass"], body["rotation_max"]) == (1.0, 0.0)
    assert body["strain_max"] == pytest.approx(0.5, rel=exact)
    assert body["strain_99"] == pytest.approx(0.5, rel=exact)
    assert body["inertia"] is body["volume_ratio_min"] is None
    assert summary["verdict"]["level"] == "trust"


def test_bars_in_a_row():
    # The pressure of both is rho c v / 2: a strain of v / 2c.
    bodies = shipped("two_bars")["bodies"]
    assert [bodies[name]["mass"] for name in ("short", "long")] == pytest.approx([0.78, 1.56])
    for name in ("short", "long"):
        assert bodies[name]["strain_max"] == pytest.approx(4.0 / 5000.0 / 2.0, rel=1e-6)


def test_strain_99_leaves_out_what_less_than_a_hundredth_exceeds():
    bar = impactfem.Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=0.1)
    x = np.linspace(0.0, 1.0, 1001)
    u = np.zeros((3, 1001))
    u[1, 1:] = 1e-4  # one element of a thousand
    u[2] += 2e-3 * np.minimum(x, 0.0105)  # ten and a half of them
    found = bar_figures(bar, x, u)
    assert found["strain_max"] == pytest.approx(0.1)
    assert found["strain_99"] == pytest.approx(1e-3, rel=1e-6)


def steel(velocity, **keys):
    beam = Beam(
        length=0.2, height=0.01, width=0.02, density=7850.0, youngs_modulus=210e9, elements=8,
        center=(0.0, 0.0005), velocity=(0.0, velocity), **keys,
    )  # fmt: skip
    return impactfem.Scene(
        title="beam", duration=5e-4 / abs(velocity) + 1e-4, gravity=(0.0, 0.0), bodies=[beam],
        obstacles=[impactfem.HalfSpace(name="floor", point=(0.0, 0.0), normal=(0.0, 1.0))],
        solve=impactfem.Solve(estimate=False),
    )  # fmt: skip


@pytest.mark.parametrize("theory", ["euler_bernoulli", "timoshenko"])
def test_a_bent_and_stretched_beam(theory):
    beam = Beam(
        length=0.2, height=0.01, width=0.02, density=7850.0, youngs_modulus=210e9, theory=theory,
        center=(0.0, 1.0), elements=8,
    )  # fmt: skip
    free = free_beam(beam)
    u, s = np.zeros((2, len(free.matrices.mass))), free.matrices.nodes
    first = 3 * np.arange(len(s))
    u[1, first], u[1, first + 2] = 1e-3 * s, 2.0 * s  # strain 1e-3, curvature 2 / m
    found = beam_figures(free, u, 0.0)
    assert found["strain_max"] == pytest.approx(1e-3 + 2.0 * 0.005)
    assert found["strain_99"] == pytest.approx(1e-3 + 2.0 * 0.005, rel=0.06)
    assert found["mass"] == pytest.approx(0.2 * 0.01 * 0.02 * 7850.0)
    inertia = found["mass"] * 0.2**2 / 12.0
    assert found["inertia"] == pytest.approx(inertia, rel=0.01)


def test_a_beam_beyond_small_strains_is_not_trusted():
    exceeded = impactfem.solve(steel(-40.0)).summary["bodies"]["beam"]["strain_99"]
    # Waves of bending: strains are of the size of speed over wave speed, and grow with it.
    assert 0.1 < exceeded * math.sqrt(210e9 / 7850.0) / 40.0 < 3.0
    for strain, severity in ((0.025, None), (0.055, "warning"), (0.21, "fault")):
        summary = impactfem.solve(steel(-40.0 * strain / exceeded)).summary
        found = {f["code"]: f["severity"] for f in summary["verdict"]["findings"]}
        assert summary["bodies"]["beam"]["strain_99"] == pytest.approx(strain, rel=1e-3)
        assert found.get("model_strain") == severity
        assert (summary["status"] == "out_of_model") == (severity == "fault")


def test_points_have_a_mass_only():
    body = shipped("bouncing_ball")["bodies"]["ball"]
    assert body.pop("mass") > 0.0
    assert set(body.values()) == {None}
