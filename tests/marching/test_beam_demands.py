"""Loads of beams along the axes of the scene, and quality factors of beams and plates."""

import numpy as np
import pytest

import impactfem
from impactfem.errors import SceneError

BEAM = {"kind": "beam", "name": "beam", "length": 0.5, "height": 0.01, "width": 0.02,
        "density": 7800.0, "youngs_modulus": 2e11, "elements": 8,
        "supports": [{"end": "first", "kind": "clamped"}]}  # fmt: skip
PLATE = {"kind": "plate", "name": "plate", "thickness": 0.002, "mesh_size": 0.05,
         "outline": {"kind": "rectangle", "size": [0.2, 0.1]}, "density": 7800.0,
         "youngs_modulus": 2e11, "poisson_ratio": 0.3}  # fmt: skip
STIFF = 2e11 * 0.02 * 0.01**3 / 12.0


def scene(body, duration, dt, **more):
    table = {"title": "beam", "duration": duration, "body": [body],
             "gravity": [0.0] * len(body["center"]), "solve": {"dt": dt, "estimate": False},
             "output": {"fields": []}}  # fmt: skip
    return impactfem.Scene.from_dict(table | more)


@pytest.mark.parametrize(
    ("place", "load", "axis", "bent"),
    [
        ({"center": [0.25, 0.0]}, ["0", "-30"], "y", -30.0 * 0.5**4 / (8.0 * STIFF)),
        ({"center": [0.0, 0.25], "inclination": np.pi / 2}, [-30, 0], "x",
         -30.0 * 0.5**4 / (8.0 * STIFF)),
        ({"center": [0.25, 0.0, 0.0]}, ["0", "-30", "0"], "y", -30.0 * 0.5**4 / (32.0 * STIFF)),
        ({"center": [0.25, 0.0, 0.0]}, ["1e5", "0", "0"], "x", 1e5 * 0.5**2 / (2.0 * 2e11 * 2e-4)),
    ],
    ids=["as a formula", "upright", "across the width", "along"],
)  # fmt: skip
def test_a_load_along_axes_of_the_scene_bends_and_stretches(place, load, axis, bent):
    """A load q along a cantilever: q L^4 / 8 E I, q L^2 / 2 E A at the tip, and it stays there."""
    beam = BEAM | place | {"load": load}
    tip = 2.0 * np.array(place["center"])
    probe = [{"name": "tip", "body": "beam", "point": tip.tolist()}]
    history = impactfem.solve(scene(beam, 0.01, 1e-3, start="static", probe=probe)).history
    assert history[f"tip.u{axis}"].values == pytest.approx(bent, rel=1e-8)


def test_a_force_that_grows_with_each_own_displacement_softens_alone_that_way():
    """p = -k u along y only: frequencies along z stay, those along y follow K + k."""
    k, square = 5e4, {"width": 0.01, "center": [0.25, 0.0, 0.0], "velocity": [0.0, 0.1, 0.1]}
    beam = BEAM | square | {"load": ["0", f"-{k}*u", "0"], "elements": 4}
    probe = [{"name": "tip", "body": "beam", "point": [0.5, 0.0, 0.0]}]
    h = impactfem.solve(scene(beam, 0.06, 5e-5, probe=probe)).history
    counts = [np.count_nonzero(np.diff(np.sign(h[f"tip.u{way}"].values))) for way in "yz"]
    line, own = 7800.0 * 1e-4, 1.875104**4 * 2e11 * 1e-8 / 12.0 / 0.5**4
    rates = np.sqrt([(own + k) / line, own / line]) / np.pi * 0.06
    np.testing.assert_allclose(counts, rates, atol=1.0)
    assert counts[0] > counts[1] + 1


@pytest.mark.parametrize(
    ("body", "first"),
    [
        (BEAM | {"center": [0.25, 0.0], "velocity": [0.0, 0.1], "elements": 1},
         1.875104**2 / 0.25 * np.sqrt(STIFF / 1.56)),
        (PLATE | {"center": [0.0] * 3, "velocity": 0.1,
                  "supports": [{"edge": e, "kind": "simply_supported"}
                               for e in ("left", "right", "bottom", "top")]},
         np.pi**2 * (25.0 + 100.0) * np.sqrt(2e11 * 0.002**2 / (12.0 * 0.91 * 7800.0))),
    ],
    ids=["beam", "plate"],
)  # fmt: skip
def test_a_held_body_loses_its_energy_at_the_rate_of_its_quality(body, first):
    """E(t) = E(0) exp(-w t / Q), of all modes that steps follow, by the mass."""
    quality, periods = 50.0, 10
    duration = 2.0 * np.pi * periods / first
    given = scene(body | {"quality_factor": quality}, duration, duration / 4000)
    h = impactfem.solve(given).history
    moving = h["kinetic_energy"].values + h["elastic_energy"].values
    left = moving[-1] / moving[0]
    assert left == pytest.approx(np.exp(-2.0 * np.pi * periods / quality), rel=0.05)


def test_a_free_beam_falls_undamped_and_rings_by_its_quality():
    """By the stiffness: its fall is that of a point, and one second of the mode is 1 / (w Q)."""
    free = {k: v for k, v in BEAM.items() if k != "supports"} | {"center": [0.0, 0.0]}
    made = scene(free | {"quality_factor": 20.0}, 0.1, 1e-3).bodies[0]
    assert made.rayleigh_damping == (0.0, pytest.approx(1.0 / (20.0 * made.first_frequency)))


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"load": ["0", "1", "2"]}, "has 3 entries, center has 2"),
        ({"load": ["0", "y"]}, "load[1]"),
        ({"quality_factor": 0.0}, "quality_factor"),
        ({"quality_factor": 50.0, "damping_ratio": 0.01}, "contradicts damping_ratio"),
        ({"rayleigh": [1.0, 0.0], "quality_factor": 50.0}, "contradicts quality_factor"),
        ({"center": [0.25, 0.0, 0.0], "load": "-30"}, "give a list of 3 formulas"),
    ],
)
def test_what_contradicts_is_refused(keys, told):
    with pytest.raises(SceneError) as error:
        scene(BEAM | {"center": [0.25, 0.0]} | keys, 0.01, 1e-3)
    assert told in str(error.value)
