"""Damping of plates: decrements of modes against closed forms, energy, contact, refusals."""

import math

import numpy as np
import pytest

import impactfem
from impactfem import Scene, SceneError

A, SIDES = 1.3, ("left", "right", "bottom", "top")
TONES = sorted((math.pi**2 * ((m / A) ** 2 + n**2), m, n) for m in range(1, 5) for n in range(1, 5))
"""Of a simply supported rectangle with D = rho t = 1."""


def scene(duration, dt, obstacles=(), **more):
    plate = {
        "kind": "plate", "name": "plate", "mesh_size": 0.12, "thickness": 0.01, "density": 100.0,
        "youngs_modulus": 12.0 * 0.91e6, "poisson_ratio": 0.3,
        "outline": {"kind": "rectangle", "size": [A, 1.0]},
        "supports": [{"edge": edge, "kind": "simply_supported"} for edge in SIDES],
    }  # fmt: skip
    return Scene.from_dict(
        {"title": "damped", "duration": duration, "gravity": [0.0, 0.0, 0.0],
         "body": [plate | more], "obstacle": list(obstacles), "output": {"fields": []},
         "solve": {"estimate": False, "dt": dt}}
    )  # fmt: skip


def ratio(mode, **more):
    """By the energy of a mode that vibrates alone for four periods."""
    w, m, n = TONES[mode]
    shape = f"1e-5*sin({m}*pi*(x/{A}+0.5))*sin({n}*pi*(y+0.5))"
    dt = 2.0 * math.pi / w / 100.0
    history = impactfem.solve(scene(400 * dt, dt, displacement=shape, **more)).history
    energy = history["total_energy"].values
    lost = history["dissipated_energy"].values
    assert np.abs(lost + energy - energy[0]).max() < 1e-12 * energy[0]
    return -np.polyfit(dt * np.arange(400), np.log(energy[:400]), 1)[0] / (2.0 * w)


@pytest.mark.slow
@pytest.mark.parametrize(("membrane", "modes"), [("none", [0, 1, 2, 3]), ("von_karman", [1])])
def test_modes_decay_as_they_are_told(membrane, modes):
    """Off by what frequencies are (1 % at most), of their squares twice that."""
    given = [0.01, 0.03, 0.02, 0.05]
    found = [ratio(k, membrane=membrane, damping_ratio=given) for k in modes]
    assert found == pytest.approx([given[k] for k in modes], rel=0.015)
    beyond = ratio(4, membrane=membrane, damping_ratio=given)
    assert beyond == pytest.approx(0.05 * TONES[4][0] / TONES[3][0], rel=0.03)


def test_of_one_ratio_and_of_the_stiffness_they_decay_by_their_frequency():
    found = [ratio(k, damping_ratio=0.02) for k in (0, 2)]
    assert found == pytest.approx([0.02, 0.02 * TONES[2][0] / TONES[0][0]], rel=0.03)
    same = ratio(0, rayleigh_stiffness=2.0 * 0.02 / TONES[0][0], rayleigh_mass=0.03 * TONES[0][0])
    assert same == pytest.approx(0.02 + 0.015, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("membrane", ["none", "von_karman"])
def test_on_a_stop_energy_only_falls_where_modes_are_damped(membrane):
    """Deflections of five thicknesses without the stop: whole tangents of those that stretch."""
    stop = {"kind": "half_space", "name": "stop", "point": [0.0, 0.0, -0.013],
            "normal": [0.0, 0.0, 1.0]}  # fmt: skip
    thrown = scene(
        0.08, 5e-4, [stop], membrane=membrane, mesh_size=0.16, damping_ratio=[0.02] * 5,
        velocity=f"-2*cos(pi*x/{A})*cos(pi*y)",
    )  # fmt: skip
    history = impactfem.solve(thrown).history
    energy = history["total_energy"].values
    assert history["contact_force"].values.max() > 0.0
    assert len(energy) == 161
    assert np.diff(energy).max() < 1e-11 * energy[0]
    assert energy[-1] < 0.95 * energy[0]


def test_strong_damping_of_vertices_without_mass_is_told():
    stop = {"kind": "half_space", "name": "stop", "point": [0.0, 0.0, -0.013],
            "normal": [0.0, 0.0, 1.0]}  # fmt: skip

    def told(**more):
        findings = impactfem.plan(scene(0.1, 1e-3, [stop], **more)).findings
        return [each.text for each in findings if each.code == "setting"]

    assert any("impulses of contacts are too large" in text for text in told(damping_ratio=0.3))
    assert not told(damping_ratio=0.02)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"damping_ratio": 1.0}, "damping_ratio = 1.0 .*give a number >= 0 and < 1"),
        ({"damping_ratio": [0.1, -0.1]}, r"damping_ratio\[1\] = -0.1"),
        ({"damping_ratio": []}, "a list of 1 to 100"),
        ({"damping_ratio": 0.1, "rayleigh_mass": 2.0}, "rayleigh_mass = 2 contradicts damping_rat"),
        ({"damping_ratio": 0.1, "rayleigh_stiffness": 2.0}, "rayleigh_stiffness = 2 contradicts"),
    ],
)
def test_bad_damping_is_refused(more, message):
    with pytest.raises(SceneError, match=message):
        scene(0.1, 1e-3, **more)


def test_more_ratios_than_modes_are_refused():
    with pytest.raises(SceneError, match=r"damping_ratio has 60 entries, more than the .* modes"):
        impactfem.solve(scene(0.1, 1e-3, damping_ratio=[0.1] * 60, mesh_size=0.3))
