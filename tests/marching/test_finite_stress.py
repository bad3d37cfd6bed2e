"""Stresses and strains of bodies under finite strain, in probes and fields: homogeneous states."""

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

import impactfem

STRESSES = {0.5: -1025111.46, 0.8: -246228.12, 1.2: 171880.58, 2.0: 614577.33}
LATERAL = {0.5: 1.2981356, 0.8: 1.0915819, 1.2: 0.9286987, 2.0: 0.7472396}
"""Uniaxial stretch of the neo-Hookean law, E = 1e6, nu = .4: nominal stress, other stretches."""


ELASTIC = {"youngs_modulus": 1e6, "poisson_ratio": 0.4}
MOONEY = {"c10": 1.2e5, "c01": 0.4e5, "bulk_modulus": 2e6}


def pulled(model, stress, material, cells="simplex"):
    """A block at rest under a dead traction on its right side, E = 1e6, nu = .4."""
    dim = 3 if model == "3d" else 2
    held = ("bottom", "left", "back")[: 1 if model == "axisymmetric" else dim]  # or by the axis
    block = {
        "name": "block", "kind": "solid", "model": model, "material": material, "cells": cells,
        "strain": "finite", "mesh_size": 0.5, "density": 1100.0,
        **(MOONEY if material == "mooney_rivlin" else ELASTIC),
        "shape": {"kind": "block", "size": [1.0] * dim, "corner": [0.0] * dim},
        "supports": [{"surface": side, "kind": "symmetry"} for side in held],
        "tractions": [{"surface": "right", "value": [stress, *[0.0] * (dim - 1)]}],
    }  # fmt: skip
    floor = {"kind": "half_space", "point": [0.0, -9.0, 0.0][:dim], "normal": [0.0, 1.0, 0.0][:dim]}
    probe = {"name": "p", "body": "block", "point": [1.0] * dim}
    return impactfem.Scene.from_dict(
        {
            "title": "pulled", "duration": 1e-4, "body": [block], "obstacle": [floor],
            "start": "static", "solve": {"dt": 1e-4, "estimate": False},
            "probe": [probe | {"quantities": ["displacement", "stress"]}],
        }
    )  # fmt: skip


def found(scene):
    """Stretches, stresses of the probe, and the first fields."""
    result = impactfem.solve(scene)
    axes = "xyz"[: scene.dim]
    stretch = [1.0 + result.history[f"p.u{axis}"].values[0] for axis in axes]
    names = ["xx", "yy", "zz", "xy"]
    return (
        stretch,
        [result.history[f"p.s{name}"].values[0] for name in names],
        result.fields.read(0),
    )


def nominal(material, stretches):
    """Nominal stresses of a law by principal stretches, E = 1e6, nu = .4."""
    mu, lame = 1e6 / 2.8, 1e6 * 0.4 / (1.4 * 0.2)
    a = np.asarray(stretches)
    if material == "mooney_rivlin":
        c10, c01, bulk = MOONEY.values()
        return (
            2.0 * c10 * a + 2.0 * c01 * a * (np.sum(a**2) - a**2)
            + ((bulk - 4.0 * (c10 + 4.0 * c01) / 3.0) * np.log(a.prod()) - 2.0 * (c10 + 2.0 * c01))
            / a
        )  # fmt: skip
    if material == "linear":
        strain = 0.5 * (a**2 - 1.0)
        return a * (lame * strain.sum() + 2.0 * mu * strain)
    return mu * (a - 1.0 / a) + lame * np.log(a.prod()) / a


@pytest.mark.parametrize("stretch", STRESSES)
def test_a_rod_of_rubber_has_the_stress_of_its_law(stretch):
    side = brentq(lambda a: nominal("", [stretch, a, a])[1], 0.3, 2.0, xtol=1e-15)
    stress = nominal("", [stretch, side, side])[0]
    assert [side, stress] == pytest.approx([LATERAL[stretch], STRESSES[stretch]], rel=1e-7)
    stretches, stresses, fields = found(pulled("3d", stress, "neo_hookean"))
    assert stretches == pytest.approx([stretch, side, side], rel=1e-8)
    true = stress / side**2
    assert stresses == pytest.approx([true, 0.0, 0.0, 0.0], abs=1e-8 * abs(true))
    assert fields["cauchy_stress"][:, 0] == pytest.approx(true, rel=1e-8)
    assert fields["von_mises"] == pytest.approx(abs(true), rel=1e-8)
    strain = 0.5 * (np.array([stretch, side, side]) ** 2 - 1.0)
    assert np.abs(fields["green_strain"][:, [0, 4, 8]] - strain).max() <= 1e-8
    assert fields["volume_ratio"] == pytest.approx(stretch * side**2, rel=1e-8)


@pytest.mark.parametrize("model", ["plane_strain", "axisymmetric"])
@pytest.mark.parametrize("material", ["neo_hookean", "linear", "mooney_rivlin"])
def test_bodies_in_the_plane_have_their_stress_across_too(model, material):
    """Pulled along x; at the rim of an axisymmetric block, which stretches its hoops as much."""
    stress, radial = 2e5, model == "axisymmetric"

    def full(unknown):
        return np.array([unknown[0], unknown[1], unknown[0] if radial else 1.0])

    def left(unknown):
        return (nominal(material, full(unknown))[:2] - [stress, 0.0]) / stress

    stretches = full(fsolve(left, [1.1, 0.95], xtol=1e-13))
    true = nominal(material, stretches) * stretches / stretches.prod()
    moved, stresses, fields = found(pulled(model, stress, material))
    assert moved == pytest.approx(stretches[:2], rel=1e-8)
    assert stresses == pytest.approx([*true, 0.0], abs=1e-8 * stress)
    assert np.abs(fields["cauchy_stress"][:, [0, 4, 8]] - true).max() <= 1e-8 * stress


def test_normals_of_contact_are_those_of_a_slope_that_a_disc_meets():
    normal = [0.6, 0.8]
    disc = {
        "name": "disc", "kind": "solid", "model": "plane_strain", "material": "neo_hookean",
        "mesh_size": 0.02, "density": 1100.0, "youngs_modulus": 1e6, "poisson_ratio": 0.4,
        "shape": {"kind": "disc", "radius": 0.05, "center": [0.0301, 0.0401]},
        "velocity": [-1.2, -1.6],
    }  # fmt: skip
    slope = {"kind": "half_space", "point": [0.0, 0.0], "normal": normal}
    result = impactfem.solve(
        impactfem.Scene.from_dict(
            {
                "title": "slope", "duration": 4e-3, "body": [disc], "obstacle": [slope],
                "solve": {"dt": 2e-4, "estimate": False}, "output": {"every": 20},
            }
        )
    )  # fmt: skip
    last = result.fields.read(-1)
    touching = last["active"] > 0
    assert touching.any()
    assert np.abs(last["contact_normal"][touching] - [*normal, 0.0]).max() <= 1e-12
    assert not last["contact_normal"][~touching].any()
