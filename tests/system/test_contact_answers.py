"""Answers of massless contact nodes to many forces at once."""

from dataclasses import replace

import numpy as np
import pytest

from impactfem.log import Progress
from impactfem.marching import leapfrog
from impactfem.models.solids import solids_model
from impactfem.planning import plan
from impactfem.runs.solids import run_solids
from impactfem.scene import Scene
from impactfem.system.massless import lumped_mass, mass_transfer
from impactfem.system.surface import SurfaceNodes, SurfaceStatics


@pytest.fixture(scope="module")
def scene():
    body = {
        "kind": "solid", "name": "ball", "model": "3d", "mesh_size": 0.15,
        "shape": {"kind": "sphere", "radius": 0.5, "center": [0.0, 0.55, 0.0]},
        "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3, "velocity": [0.0, -0.2, 0.0],
    }  # fmt: skip
    floor = {"kind": "half_space", "name": "floor", "point": [0, 0, 0], "normal": [0, 1, 0]}
    return Scene.from_dict({
        "title": "ball", "duration": 1.5, "body": [body], "obstacle": [floor],
        "solve": {"method": "explicit", "estimate": False}, "output": {"fields": []},
    })  # fmt: skip


def test_many_answers_are_those_of_single_forces_to_the_last_bit_of_any_grouping(scene):
    model = solids_model(scene, [1]).parts[0]
    system = model.system
    surface = SurfaceNodes.of(model.comm, 3, model.contact.numbers, system.numbers)
    statics = SurfaceStatics(system.stiffness, surface)
    transfer = mass_transfer(system, surface, model.mesh)
    mobility = lumped_mass(system, transfer, surface)[1][statics.near]
    transfer.destroy()
    forces = np.random.default_rng(1).normal(size=(11, surface.count, 3))
    layer, static = statics.answers(forces, mobility)
    for force, moved, pressed in zip(forces, layer, static, strict=True):
        expected = statics.response(force)
        np.testing.assert_allclose(pressed, expected, rtol=0, atol=1e-13 * abs(expected).max())
        near = -mobility * statics.pushed(expected)
        expected = statics.equilibrium_of_near(near)
        np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-13 * abs(expected).max())
    for part in (slice(0, 1), slice(3, 10), slice(2, 11)):
        again = statics.answers(forces[part], mobility)
        assert (again[0] == layer[part]).all()
        assert (again[1] == static[part]).all()


def test_a_motion_does_not_depend_on_how_many_columns_are_kept_whole(scene, monkeypatch):
    chosen = plan(scene)
    expected = run_solids(scene, chosen, Progress())[0].history
    assert expected["active"].values.max() > 6
    monkeypatch.setattr(leapfrog, "_WHOLE_COLUMNS", 4)
    found = run_solids(scene, replace(chosen), Progress())[0].history
    one, other = (history["contact_force"].values for history in (expected, found))
    np.testing.assert_allclose(other, one, atol=1e-9 * one.max())
    energy = found["total_energy"].values
    assert abs(energy / energy[0] - 1.0).max() < 1e-12
