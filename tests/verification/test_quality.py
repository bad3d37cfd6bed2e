"""Solids damped by the quality factor of their first mode of vibration."""

import numpy as np
import pytest
from pytest_mpi import parallel_assert

import impactfem
from impactfem import Scene, SceneError
from impactfem.models.solids import solids_model

QUALITY = 20.0


def scene(*, held, duration=4.0, model="plane_strain", method="massless", **own):
    body = {
        "name": "bar", "kind": "solid", "model": model, "density": 1.0, "youngs_modulus": 1.0,
        "poisson_ratio": 0.0, "shape": {"kind": "block", "size": [1.0, 0.1, 0.1]},
        "mesh_size": 0.05, "cells": "hexahedron", "degree": 1, "strain": "small",
        "quality_factor": QUALITY,
    } | own  # fmt: skip
    body["shape"]["size"] = body["shape"]["size"][: 3 if model == "3d" else 2]
    if held:
        body["supports"] = [{"surface": "left", "kind": "fixed"}]
    return Scene.from_dict(
        {
            "title": "it rings", "duration": duration, "body": [body],
            "solve": {"method": method, "dt": 0.01, "estimate": False}, "output": {"fields": []},
        }
    )  # fmt: skip


@pytest.mark.parallel(1)
@pytest.mark.parametrize(
    ("held", "shape", "first"),
    [
        (True, ["1e-3*sin(0.5*pi*x)", "0"], 0.5 * np.pi),
        (False, ["1e-3*cos(pi*x)", "0"], np.pi),
    ],
)
@pytest.mark.parametrize("strain", ["small", "finite"])
def test_energy_falls_by_the_quality_factor(held, shape, first, strain):
    """Of a bar that may not bend, for its sides are held: at one end, or free to fly along."""
    sides = [{"surface": name, "kind": "symmetry"} for name in ("bottom", "top")]
    given = scene(held=held, displacement=shape, strain=strain).to_dict()
    given["body"][0]["supports"] = sides + given["body"][0].get("supports", [])
    if strain == "finite":
        given["body"][0]["material"] = "neo_hookean"
        given["solve"]["method"] = "conserving"
    times = 4.0 * np.pi / first  # two periods
    given["duration"] = times
    history = impactfem.solve(Scene.from_dict(given)).history
    energy, time = history["total_energy"].values, history["time"].values
    rate = -np.log(energy[-1] / energy[0]) / time[-1]
    assert rate == pytest.approx(first / QUALITY, rel=0.02)


@pytest.mark.parallel([1, 2])
@pytest.mark.parametrize(("held", "root"), [(True, 1.8751041), (False, 4.7300407)])
def test_the_first_mode_bends(held, root):
    """A slender block of degree 2 in space, near Euler and Bernoulli's beam: it shears too."""
    part = solids_model(scene(held=held, model="3d", degree=2, mesh_size=0.1), (2,)).parts[0]
    system = part.system
    known = root**2 * 0.1 / np.sqrt(12.0)
    found = QUALITY * system.rayleigh_mass if held else 1.0 / (QUALITY * system.rayleigh_stiffness)
    parallel_assert(abs(found / known - 1.0) <= 0.06, f"{found} {known}")
    parallel_assert((system.rayleigh_mass == 0.0) != held)


@pytest.mark.parallel(1)
@pytest.mark.parametrize(
    ("own", "words"),
    [
        ({"rayleigh_mass": 1.0}, "rayleigh_mass = 1 contradicts quality_factor"),
        ({"viscoelastic": {"kind": "kelvin_voigt", "time": 1.0}}, "and viscoelastic both damp"),
        ({"quality_factor": -1.0}, "quality_factor = -1"),
        ({"strain": "finite", "method": "explicit"}, "quality_factor = 20.0: explicit steps"),
    ],
)
def test_what_damps_twice_is_refused(own, words):
    with pytest.raises(SceneError, match=words):
        scene(held=False, **own)
