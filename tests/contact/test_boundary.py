"""The outside of bodies: areas, normals and their sums against closed forms."""

from itertools import product

import numpy as np
import pytest
from bodies import TestBody, grid, round_off

from impactfem.contact.boundary import Boundary, boundary
from impactfem.fem import MPI

KINDS = list(product((2, 3), (False, True), (1, 2)))


def block(dim: int, *, simplex: bool, degree: int) -> tuple[TestBody, Boundary]:
    counts, low, high = (4, 3, 2)[:dim], (0.0, 1.0, -1.0)[:dim], (2.0, 4.0, 0.0)[:dim]
    body = grid(MPI.COMM_SELF, counts, low, high, simplex=simplex, degree=degree)
    return body, boundary(body)


@pytest.mark.parametrize(("dim", "simplex", "degree"), KINDS)
def test_a_block_has_its_sides(dim: int, simplex: bool, degree: int) -> None:
    body, outside = block(dim, simplex=simplex, degree=degree)
    sides = {
        "left": ((-1, 0, 0), 3), "right": ((1, 0, 0), 3),
        "bottom": ((0, -1, 0), 2), "top": ((0, 1, 0), 2),
    }  # fmt: skip
    if dim == 3:
        sides |= {"back": ((0, 0, -1), 6), "front": ((0, 0, 1), 6)}
    assert outside.names == tuple(sorted(sides))
    assert outside.members.sum(axis=1).tolist() == [1] * len(outside.faces)
    for name, (normal, area) in sides.items():
        faces = outside.on([name])
        np.testing.assert_allclose(outside.normals[faces], [normal[:dim]] * faces.sum(), atol=1e-14)
        assert outside.areas[faces].sum() == pytest.approx(area, rel=1e-14)
    assert outside.areas.min() > 0
    assert outside.size == pytest.approx(np.linalg.norm([2, 3, 1][:dim]))
    # Numbers and places belong together.
    x = dict(zip(body.numbers.tolist(), body.mesh.geometry.x[:, :dim].tolist(), strict=True))
    np.testing.assert_array_equal(outside.points, [x[n] for n in outside.numbers.tolist()])
    assert (np.diff(outside.numbers) > 0).all()


def test_areas_of_nodes() -> None:
    _, outside = block(2, simplex=True, degree=1)
    bottom = outside.on(["bottom"])
    area = outside.total(outside.areas, bottom)
    order = np.argsort(outside.points[:, 0])
    on_bottom = outside.touched(bottom)[order]
    np.testing.assert_allclose(area[order][on_bottom], [0.25, 0.5, 0.5, 0.5, 0.25], rtol=1e-14)

    _, outside = block(2, simplex=True, degree=2)  # Simpson's rule
    bottom = outside.on(["bottom"])
    area = outside.total(outside.areas, bottom)
    order = np.argsort(outside.points[:, 0])
    weights = np.array([1, 4, 2, 4, 2, 4, 2, 4, 1]) * 0.5 / 6
    np.testing.assert_allclose(area[order][outside.touched(bottom)[order]], weights, rtol=1e-13)

    # Quadratic triangles: 1/19 of a face for a corner, 16/57 for the middle of a side.
    _, outside = block(3, simplex=True, degree=2)
    whole = outside.areas.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(
        outside.areas / whole, np.tile([1 / 19] * 3 + [16 / 57] * 3, (len(whole), 1)), rtol=1e-12
    )


@pytest.mark.parametrize(("dim", "simplex", "degree"), KINDS)
def test_round_bodies_have_their_area_and_radial_normals(
    dim: int, simplex: bool, degree: int
) -> None:
    errors, turns = [], []
    for n in (4, 8):
        center = (3.0, -1.0, 0.5)[:dim]
        body = grid(
            MPI.COMM_SELF, (n,) * dim, (-1.0,) * dim, (1.0,) * dim,
            simplex=simplex, degree=degree, bend=round_off(center, 2.0),
        )  # fmt: skip
        outside = boundary(body)
        errors.append(abs(outside.areas.sum() / (4 * np.pi if dim == 2 else 16 * np.pi) - 1))
        faces = np.ones(len(outside.faces), dtype=bool)
        sums = np.stack([outside.total(outside.shares[:, :, i], faces) for i in range(dim)], axis=1)
        # The integral of the normal over a closed surface is zero; for degree 2 the shares of a
        # face do not sum to its own, but keep the symmetry of the body.
        np.testing.assert_allclose(sums.sum(axis=0), 0.0, atol=1e-12)
        radial = (outside.points - center) / 2
        cosine = np.einsum("ij,ij->i", sums, radial) / np.linalg.norm(sums, axis=1)
        turns.append(np.arccos(np.clip(cosine, -1, 1)).max())
    # Chords and facets miss the area by h^2; quadratic ones by h^3 at least. Normals point out.
    assert errors[1] < errors[0] * (0.3 if degree == 1 else 0.15)
    assert errors[1] < (0.03 if degree == 1 else 1e-3)
    assert turns[1] < 0.2


@pytest.mark.parametrize(("simplex", "degree"), list(product((False, True), (1, 2))))
def test_axisymmetric_areas_are_those_of_the_full_turn(simplex: bool, degree: int) -> None:
    body = grid(
        MPI.COMM_SELF, (4, 3), (0.0, 0.0), (0.5, 2.0), simplex=simplex, degree=degree
    )  # fmt: skip
    outside = boundary(body, axisymmetric=True)
    area = {
        name: outside.areas[outside.members[:, k]].sum() for k, name in enumerate(outside.names)
    }
    assert area["left"] == 0.0  # the axis is no surface
    assert area["right"] == pytest.approx(2 * np.pi * 0.5 * 2)
    assert area["bottom"] == pytest.approx(np.pi * 0.25)
    assert area["top"] == pytest.approx(np.pi * 0.25)
    pole = np.flatnonzero((outside.points == 0).all(axis=1))
    weight = outside.total(outside.areas, np.ones(len(outside.faces), dtype=bool))[pole]
    assert weight > 0
    if degree == 1:
        assert weight == pytest.approx(2 * np.pi * 0.125**2 / 6)


def test_thickness_multiplies_areas() -> None:
    body = grid(MPI.COMM_SELF, (2, 2), (0.0, 0.0), (1.0, 1.0))
    assert boundary(body, thickness=0.1).areas.sum() == pytest.approx(0.4)
