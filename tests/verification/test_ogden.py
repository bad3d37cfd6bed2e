"""Laws by principal stretches (Ogden, foams), and plane stress under finite strain."""

import numpy as np
import pytest
from pytest_mpi import parallel_assert
from scipy.optimize import brentq

import impactfem
from impactfem import Scene, SceneError
from impactfem.models.solids import solids_model
from impactfem.system.element_forces import ElementForces
from impactfem.system.finite_strain import FiniteStrain
from impactfem.system.law_kernels import KERNELS, stiffness, stress

NEO = {"material": "neo_hookean", "youngs_modulus": 2.6, "poisson_ratio": 0.3}
OGDEN = {
    "material": "ogden", "bulk_modulus": 3.0,
    "terms": [{"mu": 1.0, "alpha": 2.0}, {"mu": 0.5, "alpha": -2.0}, {"mu": 0.1, "alpha": 6.0}],
}  # fmt: skip
FOAM = {
    "material": "foam",
    "terms": [{"mu": 1.0, "alpha": 8.0, "beta": 0.2}, {"mu": 0.5, "alpha": -2.0, "beta": 0.3}],
}  # fmt: skip
FLAT_FOAM = {"material": "foam", "terms": [{"mu": 1.0, "alpha": 3.0}], "poisson_ratio": 0.0}
LAWS = {"neo": NEO, "ogden": OGDEN, "foam": FOAM, "flat_foam": FLAT_FOAM}
FLOOR = {"name": "floor", "kind": "half_space", "point": [0, 0], "normal": [0, 1]}


def scene(model, law, *, duration=1.0, more=None, size=1.0, **own):
    dim = 3 if model == "3d" else 2
    body = {
        "name": "part", "kind": "solid", "model": model, "density": 2.0, "degree": 1,
        "shape": {"kind": "block", "size": [2.0, 1.0, 0.5][:dim]}, "mesh_size": size,
        "cells": "hexahedron",
    }  # fmt: skip
    return Scene.from_dict(
        {
            "title": "stretched", "duration": duration, "body": [body | law | own],
            "solve": {"estimate": False}, "output": {"fields": []},
        } | (more or {})
    )  # fmt: skip


def made(model, law, **own):
    part = solids_model(scene(model, law, **own), (1,)).parts[0]
    return part.system, FiniteStrain(part.system.nodes, part.solid, part.system.following), part


def power(law, *stretches):
    """W of a law by principal stretches, as it is written down."""
    if law is NEO:
        mu, lame, log = 1.0, 1.5, np.log(np.prod(stretches))
        return 0.5 * mu * (sum(s**2 for s in stretches) - 3 - 2 * log) + 0.5 * lame * log**2
    total, volume, shear = 0.0, np.prod(stretches), sum(t["mu"] for t in law["terms"])
    for term in law["terms"]:
        mu, a, b = term["mu"], term["alpha"], term.get("beta", 0.0)
        filled = (volume ** (-a * b) - 1) / b if b else -a * np.log(volume)
        total += 2 * mu / a**2 * (sum(s**a for s in stretches) - 3 + filled)
    if law["material"] == "ogden":
        total += 0.5 * (law["bulk_modulus"] - 2 / 3 * shear) * np.log(volume) ** 2
    return total


def slope(function, x, h=1e-4):
    """Derivative to the fourth order, and once more of its fault."""

    def at(h):
        near, far = (function(x + k * h) - function(x - k * h) for k in (1, 2))
        return (8 * near - far) / (12 * h)

    return (16 * at(h / 2) - at(h)) / 15


@pytest.mark.parallel(1)
@pytest.mark.parametrize("model", ["plane_stress", "3d"])
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("stretch", [0.5, 0.8, 1.3, 2.0])
def test_pulled_and_pressed_a_block_is_the_closed_form(model, name, stretch):
    """Its sides are free where it narrows as the law says, its ends bear the nominal stress."""
    law = LAWS[name]
    across = brentq(
        lambda t: slope(lambda s: power(law, stretch, s, t), t), 0.2, 3.0, xtol=1e-14
    )  # fmt: skip
    pulled = slope(lambda s: power(law, s, across, across), stretch)
    system, strain, _ = made(model, law)
    dim = system.dim
    moved = (system.positions * (np.array([stretch, across, across])[:dim] - 1.0)).ravel()
    forces = strain.force(moved, moved).reshape(-1, dim)
    right = np.isclose(system.positions[:, 0], 2.0)
    area = 0.5 if dim == 3 else 1.0
    assert forces[right, 0].sum() == pytest.approx(pulled * area, rel=1e-8)
    assert np.abs(forces[:, 1:]).max() <= 1e-8 * abs(pulled)


@pytest.mark.parallel(1)
@pytest.mark.parametrize("flat", [0.0, 1.0])
def test_stress_and_stiffness_are_derivatives_also_of_equal_stretches(flat):
    head = [KERNELS["ogden"], flat, 0.7, 1.6, 0.0]
    material = np.array([*head, 1.0, 8.0, 0.2, 0.5, -2.0, 0.3, 0.1, 1.0, 0.0])
    kept = [0, 1, 3] if flat else list(range(6))
    draw, h = np.random.default_rng(0), 1e-6
    for given in (
        0.1 * draw.normal(size=6), np.array([0.1, 0.1, 0.1, 0, 0, 0]), np.zeros(6),
        np.array([0.1, 0.1, -0.2, 0, 0, 0]), np.array([0.1, 0.1, -0.2, 1e-6, 2e-6, 0.0]),
    ):  # fmt: skip
        strain = given * np.array([1, 1, 1, 1, 1 - flat, 1 - flat])
        slopes = np.zeros((6, 6))
        stiffness(material, *strain, slopes)
        found = np.array(stress(material, *strain)[1:])
        for i in kept:
            way = np.eye(6)[i] * h * (1.0 if i < 3 else 0.5)
            low, high = (np.array(stress(material, *(strain + s * way))) for s in (-1, 1))
            change = (high - low) / (2 * h)
            assert change[0] == pytest.approx(found[i], abs=1e-8)
            np.testing.assert_allclose(change[1:][kept], slopes[kept, i], atol=1e-7)


@pytest.mark.parallel(1)
@pytest.mark.parametrize(("model", "law"), [("plane_stress", FOAM), ("3d", OGDEN)])
def test_forces_do_the_work_and_the_tangent_is_their_derivative(model, law):
    """In steps of a third of strain, and in steps of next to nothing."""
    system, strain, part = made(model, law)
    draw = np.random.default_rng(1)
    before, way, other = 0.05 * draw.normal(size=(3, len(system.displacement)))
    for share in (1.0, 1e-3, 1e-9):
        after = before + share * way
        force = strain.force(before, after)
        work = float(force @ (share * way))
        change = strain.energy(after) - strain.energy(before)
        assert work == pytest.approx(change, abs=4e-15 * strain.energy(after) * 10)
        tangent = strain.tangent(before, after)
        source, image = tangent.createVecs()
        source.setArray(other)
        tangent.mult(source, image)
        h = 1e-5
        known = (strain.force(before, after + h * other)
                 - strain.force(before, after - h * other)) / (2 * h)  # fmt: skip
        np.testing.assert_allclose(image.getArray(), known, atol=1e-8 * np.abs(known).max())
    # Compiled kernels of explicit steps say the same.
    kernels = ElementForces(system.nodes, part.solid)
    kernels.put(before)
    forces, energy, _ = kernels.forces()
    known = strain.force(before, before)
    np.testing.assert_allclose(forces, known, atol=1e-13 * np.abs(known).max() * 10)
    assert energy == pytest.approx(strain.energy(before), rel=1e-12)
    # Small strains are those of linear elasticity.
    tiny = 1e-6 * before
    assert strain.energy(tiny) == pytest.approx(system.elastic_energy(tiny), rel=1e-5)


@pytest.mark.parallel(1)
def test_the_power_two_is_the_neo_hookean_law():
    """The one by its forms, the other point by point; forces of a large step too."""
    same = {"material": "ogden", "bulk_modulus": 1.5 + 2 / 3, "terms": [{"mu": 1.0, "alpha": 2.0}]}
    system, strain, _ = made("3d", same)
    _, other, _ = made("3d", NEO)
    draw = np.random.default_rng(2)
    place = 0.05 * draw.normal(size=len(system.displacement))
    known = other.force(place, place)
    np.testing.assert_allclose(strain.force(place, place), known, atol=1e-12 * np.abs(known).max())
    assert strain.energy(place) == pytest.approx(other.energy(place), rel=1e-12)


@pytest.mark.parallel(1)
def test_plane_stress_is_a_thin_body_in_space():
    """A strip held at one end and pulled by half its modulus: its far end moves as far."""
    pull, moved = 1.0, []
    for model, shape in (("plane_stress", [2.0, 1.0]), ("3d", [2.0, 1.0, 0.02])):
        dim = len(shape)
        given = scene(
            model, NEO, duration=1e-3, size=0.25, shape={"kind": "block", "size": shape}, degree=2,
            supports=[{"surface": "left", "kind": "motion", "value": ["0", "0", ""][:dim]}],
            tractions=[{"surface": "right", "value": [pull, 0.0, 0.0][:dim]}],
            more={"start": "static", "probe": [
                {"name": "end", "body": "part", "point": [2.0, 0.5, 0.0][:dim],
                 "quantities": ["displacement", "stress"]}]},
        )  # fmt: skip
        history = impactfem.solve(given).history
        moved.append([history[f"end.{name}"].values[0] for name in ("ux", "sxx", "szz")])
    assert moved[0][0] == pytest.approx(moved[1][0], rel=1e-3)
    assert moved[0][1] == pytest.approx(moved[1][1], rel=1e-2)
    assert moved[0][2] == 0.0


@pytest.mark.parallel(1)
def test_volumes_in_plane_stress_are_those_of_the_law():
    """Pulled to three times its length by its initial displacement: no cell is turned over."""
    law = OGDEN | {"bulk_modulus": 300.0}
    result = impactfem.solve(
        scene("plane_stress", law, duration=1e-4, displacement=["2*x", "(3**-0.5 - 1)*y"])
    )
    told = result.summary["bodies"]["part"]
    assert told["volume_ratio_min"] == pytest.approx(1.0, abs=1e-2)
    assert told["strain_max"] == pytest.approx(2.0, rel=1e-3)


BLOW = {
    "duration": 2.0, "size": 0.34, "density": 1.0, "velocity": [0.0, -0.4], "degree": 1,
    "shape": {"kind": "block", "size": [2.0, 1.0], "corner": [0.0, 0.01]},
    "more": {"obstacle": [FLOOR], "gravity": [0.0, 0.0]},
}  # fmt: skip
IMPULSE = 1.5379774028757347


@pytest.mark.parallel([1, 2])
def test_a_blow_of_foam_keeps_its_energy():
    result = impactfem.solve(scene("plane_stress", FOAM, **BLOW))
    energy = result.history["total_energy"].values
    impulse = result.summary["contact"]["impulse"]
    parallel_assert(np.abs(energy / energy[0] - 1.0).max() <= 1e-10)
    parallel_assert(abs(impulse - IMPULSE) <= 1e-9 * IMPULSE, str(impulse))


@pytest.mark.parallel(1)
@pytest.mark.parametrize(
    ("law", "own", "words"),
    [
        (OGDEN, {"terms": []}, 'terms is missing: material = "ogden" needs it'),
        (OGDEN, {"bulk_modulus": 1.0}, "bulk_modulus = 1.0 must exceed 2/3 of the shear modulus"),
        (OGDEN, {"c10": 1.0}, 'c10 = 1.0 belongs to material = "mooney_rivlin"'),
        (OGDEN, {"youngs_modulus": 7.0}, "youngs_modulus = 7.0 contradicts terms"),
        (OGDEN, {"strain": "small"}, 'material = "ogden" contradicts strain = "small"'),
        (OGDEN, {"terms": FOAM["terms"]}, 'terms.beta belongs to material = "foam"'),
        (OGDEN, {"terms": [{"mu": 1.0, "alpha": 0.0}]}, r"terms\[0\].alpha = 0 makes no term"),
        (OGDEN, {"terms": [{"mu": -1.0, "alpha": 2.0}]}, "make a shear modulus of -1"),
        (FOAM, {"bulk_modulus": 1.0}, 'bulk_modulus = 1.0 belongs to material = "mooney_rivlin"'),
        (FLAT_FOAM, {"poisson_ratio": None}, "poisson_ratio is missing"),
        (FLAT_FOAM, {"poisson_ratio": 0.48}, "a foam has at most 0.45"),
        (FLAT_FOAM, {"element": "mean_dilatation"}, "whose volume gives way"),
        (NEO, {"terms": FOAM["terms"]}, 'terms = .* belongs to material = "ogden" or "foam"'),
    ],
)
def test_what_is_no_law_is_refused_by_key(law, own, words):
    with pytest.raises(SceneError, match=words):
        scene("plane_strain", law, **own)
