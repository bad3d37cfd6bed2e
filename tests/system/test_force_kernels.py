"""Compiled forces of cells under finite strain against the forms of the same laws."""

import numpy as np
import pytest

import impactfem
from impactfem.forms.finite_strain import LAWS
from impactfem.system.law_kernels import KERNELS

MODELS = {
    "plane_strain": {"kind": "block", "size": [1.0, 0.6], "corner": [0.5, 0.0]},
    "axisymmetric": {"kind": "block", "size": [1.0, 0.6], "corner": [0.0, 0.0]},
    "3d": {"kind": "block", "size": [1.0, 0.6, 0.8], "corner": [0.0, 0.0, 0.0]},
}
CONSTANTS = {"mooney_rivlin": {"c10": 0.3, "c01": 0.1, "bulk_modulus": 3.0}}
PLAIN = {"youngs_modulus": 1.0, "poisson_ratio": 0.3}


def bodies(law, model, cells):
    """Displaced body: kernels, forms, displacement and nodes."""
    from impactfem.fem import dolfinx_fem
    from impactfem.models.solids import solids_model
    from impactfem.system.element_forces import ElementForces
    from impactfem.system.finite_strain import finite_forms
    from impactfem.system.matrices import body_forms

    body = {
        "name": "body", "kind": "solid", "model": model, "shape": MODELS[model],
        "mesh_size": 0.4, "cells": cells, "material": law, "strain": "finite", "density": 1.0,
    }  # fmt: skip
    body |= CONSTANTS.get(law, PLAIN)
    dim = len(MODELS[model]["size"])
    floor = {"name": "floor", "kind": "half_space"}
    floor |= {"point": [0.0, -9.0, 0.0][:dim], "normal": [0.0, 1.0, 0.0][:dim]}
    made = impactfem.Scene.from_dict(
        {"title": "kernels", "duration": 1.0, "body": [body], "obstacle": [floor]}
    )
    part = solids_model(made, (1,)).parts[0]
    nodes = part.system.nodes
    space = nodes.space
    forms = finite_forms(nodes, body_forms(nodes, part.solid), part.solid)
    place = dolfinx_fem.Function(space)
    x = nodes.positions
    random = np.random.default_rng(1)
    bent = 0.02 * random.standard_normal(x.shape)
    if model != "axisymmetric":  # turned far
        turn = np.eye(x.shape[1])
        turn[:2, :2] = [[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]]
        bent = (x + bent) @ turn.T - x
    else:
        bent[x[:, 0] < 1e-9, 0] = 0.0
    place.x.array[:] = bent.ravel()
    return ElementForces(nodes, part.solid), forms, place, nodes


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("cells", ["simplex", "hexahedron"])
def test_kernels_are_the_forms(law, model, cells):
    from impactfem.fem import dolfinx_fem

    kernels, forms, place, nodes = bodies(law, model, cells)
    kernels.put(place.x.array)
    found, energy, least = kernels.forces()
    vector = dolfinx_fem.assemble_vector(dolfinx_fem.form(forms.force(place, place))).array
    expected = dolfinx_fem.assemble_scalar(dolfinx_fem.form(forms.energy(place)))
    assert least > 0.3
    assert energy == pytest.approx(expected, rel=1e-12)
    assert np.abs(found - vector).max() <= 1e-12 * np.abs(vector).max()
    # The tangent of some nodes is the slope of their forces.
    chosen = np.arange(nodes.owned)[::2]
    row = np.full(nodes.owned, -1)
    row[chosen] = np.arange(len(chosen))
    part = kernels.part(np.arange(len(kernels.cells)))
    first, second = row[kernels.cells][:, :, None], row[kernels.cells][:, None, :]
    both = (first >= 0) & (second >= 0)
    slots = np.where(both, first * len(chosen) + second, -1)
    blocks = np.zeros((len(chosen) ** 2, 3, 3))
    part.tangents(slots, blocks)
    dim = nodes.dim
    way = np.random.default_rng(2).standard_normal((len(chosen), dim))
    tangent = blocks.reshape(len(chosen), len(chosen), 3, 3)[:, :, :dim, :dim]
    moved = np.zeros((nodes.owned, dim))
    moved[chosen] = 1e-6 * way
    slope = 0.0
    for sign in (1.0, -1.0):
        kernels.put(place.x.array + sign * moved.ravel())
        slope = slope + sign * kernels.forces()[0].reshape(-1, dim)[chosen] / 2e-6
    assert (
        np.abs(np.einsum("abij,bj->ai", tangent, way) - slope).max() <= 1e-7 * np.abs(slope).max()
    )


def test_every_law_has_a_kernel():
    assert set(KERNELS) == {"linear", "mooney_rivlin", "ogden", "orthotropic"}
