"""Mortar integrals between flat surfaces: patch tests, partial overlaps, polynomials, balance."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mortar_surfaces import cloud, cuts, facing, loads, segment, square, turned
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from impactfem.contact.mortar import MortarPairs, faces_in_reach, mortar
from impactfem.contact.mortar_surface import Kind, Surface, surface

Floats = NDArray[np.float64]
FACES: tuple[Kind, ...] = ("triangle", "quadrilateral")
HEIGHT, PRESSURE = 0.1, 3.0


def couple(dim: int, kinds: tuple[Kind, Kind], degrees: tuple[int, int], seed: int = 0):
    """Two meshes of the same line or square, HEIGHT apart."""
    rng = np.random.default_rng(seed)
    if dim == 2:
        return (
            segment(cuts(rng, 4), degrees[0], height=HEIGHT, up=False),
            segment(cuts(rng, 6), degrees[1]),
        )
    return (
        square(kinds[0], cuts(rng, 4), cuts(rng, 3), degrees[0], height=HEIGHT, up=False),
        square(kinds[1], cuts(rng, 5), cuts(rng, 6), degrees[1]),
    )


def check_patch(carrier: Surface, other: Surface, found: MortarPairs, tolerance: float) -> None:
    """A uniform pressure gives both sides the loads of their shape functions."""
    up = np.zeros(carrier.dim)
    up[-1] = 1.0
    np.testing.assert_array_equal(found.nodes, np.unique(carrier.corners))
    np.testing.assert_allclose(found.normal, np.tile(up, (found.count, 1)), atol=1e-13)
    np.testing.assert_allclose(found.gap, HEIGHT, rtol=1e-13)
    pushes = found.forces(PRESSURE * found.area)
    for side, push, sign in zip((carrier, other), pushes, (1.0, -1.0), strict=True):
        exact = np.outer(sign * PRESSURE * loads(side), up)
        np.testing.assert_allclose(push, exact, atol=tolerance * np.abs(exact).max())


def couple_of(arms: Floats, forces: Floats) -> Floats:
    """Sum of the moments of forces, as the skew part of sum arm x force^T, shape (dim, dim)."""
    outer = arms.T @ forces
    return np.asarray(outer - outer.T)


CASES = [(2, ("interval", "interval")), *((3, kinds) for kinds in product(FACES, FACES))]
DEGREES = list(product((1, 2), (1, 2)))


@pytest.mark.parametrize(("dim", "kinds"), CASES)
@pytest.mark.parametrize("degrees", DEGREES)
def test_patch(dim: int, kinds: tuple[Kind, Kind], degrees: tuple[int, int]) -> None:
    carrier, other = couple(dim, kinds, degrees)
    check_patch(carrier, other, mortar(carrier, other, 0.5), 1e-12)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), degrees=st.sampled_from(DEGREES))
def test_patch_of_irregular_triangles(seed: int, degrees: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    carrier = cloud(rng, 12, degrees[0], height=HEIGHT, up=False)
    other = cloud(rng, 20, degrees[1])
    check_patch(carrier, other, mortar(carrier, other, 0.5), 1e-12)


def test_patch_of_quadrilaterals_of_any_shape() -> None:
    def bend(x: Floats, size: float) -> Floats:
        wave = np.sin(np.pi * x), np.sin(2 * np.pi * x)
        return x + size * np.stack(
            [wave[0][:, 0] * wave[1][:, 1], wave[1][:, 0] * wave[0][:, 1]], 1
        )

    carrier, other = (
        square("quadrilateral", *(np.linspace(0, 1, n),) * 2, height=z, up=up,
               bend=lambda x, size=size: bend(x, size))
        for n, z, up, size in ((5, HEIGHT, False, 0.08), (7, 0.0, True, -0.08))
    )  # fmt: skip
    check_patch(carrier, other, mortar(carrier, other, 0.5), 1e-7)
    check_patch(carrier, other, mortar(carrier, other, 0.5, points=10), 1e-12)


@pytest.mark.parametrize(("dim", "kinds"), CASES)
@pytest.mark.parametrize("degrees", DEGREES)
def test_polynomials_are_seen_alike_from_both_sides(
    dim: int, kinds: tuple[Kind, Kind], degrees: tuple[int, int]
) -> None:
    carrier, other = couple(dim, kinds, degrees, seed=1)
    found = mortar(carrier, other, 0.5)

    def field(side: Surface) -> Floats:
        x, y = side.points[:, 0], side.points[:, -2]
        linear = 1 + 2 * x - 3 * y
        return linear if min(degrees) == 1 else linear + x**2 - 4 * x * y + 2 * y**2

    np.testing.assert_allclose(
        found.carrier_weights @ field(carrier), found.other_weights @ field(other), atol=1e-13
    )


@pytest.mark.parametrize("kinds", list(product(FACES, FACES)))
def test_two_squares_at_45_degrees_overlap_in_an_octagon(kinds: tuple[Kind, Kind]) -> None:
    x = np.linspace(-0.5, 0.5, 6)
    carrier = square(kinds[0], x, x, height=HEIGHT, up=False)
    other = square(kinds[1], np.linspace(-0.5, 0.5, 4), x)
    turn = Rotation.from_euler("z", 45, degrees=True).as_matrix()
    found = mortar(carrier, turned(other, turn, np.zeros(3)), 0.2)
    assert found.area.sum() == pytest.approx(2 * (np.sqrt(2) - 1), rel=1e-13)
    far = np.abs(carrier.points[:, :2]).sum(axis=1) > np.sqrt(0.5) + 0.4  # beyond its edge
    assert not np.isin(np.flatnonzero(far), found.nodes).any()


def test_part_of_a_line() -> None:
    carrier = segment(np.array([0.0, 0.5, 1.0]), height=HEIGHT, up=False)
    found = mortar(carrier, segment(np.array([0.75, 1.1, 2.0])), 0.2, thickness=4.0)
    # Hats of the last half over its second half: 1/8 and 3/8 of 1/2, times the thickness.
    assert found.nodes.tolist() == [1, 2]
    np.testing.assert_allclose(found.area, [4 * 0.5 / 8, 4 * 0.5 * 3 / 8], rtol=1e-14)
    weights = found.carrier_weights.toarray()  # int psi_i psi_j over it, by hand
    exact = np.array([[1 / 24, 1 / 12], [1 / 12, 7 / 24]]) / np.array([[1 / 8], [3 / 8]])
    np.testing.assert_allclose(weights[:, 1:], exact, rtol=1e-13)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_cone_turns_its_lines_into_the_lateral_surface(degree: int) -> None:
    along, out = np.array([3.0, 4.0]) / 5, np.array([4.0, -3.0]) / 5
    s = np.sort(np.random.default_rng(0).uniform(0.0, 5.0, 4))
    sides = []
    for cut, shift, sign in (([0.0, *s, 5.0], 0.0, 1.0), ([-1.0, 2.0, 6.0], 0.1, -1.0)):
        flat = segment(np.array(cut), degree)
        points = np.array([1.0, 0.0]) + np.outer(flat.points[:, 0], along) + shift * out
        sides.append(facing(flat.moved(points), sign * out))
    found = mortar(*sides, 0.3, axisymmetric=True)
    assert found.area.sum() == pytest.approx(np.pi * (1 + 4) * 5, rel=1e-13)
    np.testing.assert_allclose(found.gap, 0.1, rtol=1e-12)


@pytest.mark.parametrize(("dim", "kinds"), CASES)
def test_swapped_carriers_have_the_transposed_integrals(dim: int, kinds: tuple[Kind, Kind]) -> None:
    first, second = couple(dim, kinds, (1, 1), seed=2)
    first = first.moved(first.points + 0.3 * np.eye(dim)[0])  # part of each is free
    one, two = mortar(first, second, 0.5), mortar(second, first, 0.5)
    integrals = [found.other_weights.toarray() * found.area[:, None] for found in (one, two)]
    np.testing.assert_allclose(integrals[0][:, two.nodes], integrals[1][:, one.nodes].T, atol=1e-14)
    assert one.area.sum() == pytest.approx(0.7, rel=1e-12)
    pushes = one.forces(one.area)[0], two.forces(two.area)[1]
    np.testing.assert_allclose(pushes[0].sum(axis=0), pushes[1].sum(axis=0), atol=1e-14)


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1), case=st.sampled_from(CASES), degrees=st.sampled_from(DEGREES)
)
def test_balance_and_rigid_motions(
    seed: int, case: tuple[int, tuple[Kind, Kind]], degrees: tuple[int, int]
) -> None:
    """Warped surfaces: rows sum to 1, forces balance, and all turns with the bodies."""
    dim, kinds = case
    rng = np.random.default_rng(seed)
    carrier, other = (
        side.moved(side.points + 0.02 * rng.normal(size=side.points.shape))
        for side in couple(dim, kinds, degrees, seed)
    )
    found = mortar(carrier, other, 0.5)
    assert found.count > 0
    assert found.area.min() > 0
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=1), 1.0, rtol=1e-14)
    for weights in (found.carrier_weights, found.other_weights):
        np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-12)
    force = rng.random(found.count)
    pushes = found.forces(force)
    assert np.abs(pushes[0].sum(axis=0) + pushes[1].sum(axis=0)).max() < 1e-12 * force.sum()
    np.testing.assert_allclose(found.gaps(carrier.points, other.points), found.gap, atol=1e-14)

    # The couple is that of each force and the mean way it bridges.
    way = found.carrier_weights @ carrier.points - found.other_weights @ other.points
    moment = sum(
        couple_of(side.points, push) for side, push in zip((carrier, other), pushes, strict=True)
    )
    exact = couple_of(way, force[:, None] * found.normal)
    np.testing.assert_allclose(moment, exact, atol=1e-12)

    turn = Rotation.random(rng=rng).as_matrix()
    if dim == 2:
        angle = rng.uniform(0, 2 * np.pi)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    shift = rng.normal(size=dim)
    moved = mortar(turned(carrier, turn, shift), turned(other, turn, shift), 0.5)
    np.testing.assert_array_equal(moved.nodes, found.nodes)
    np.testing.assert_allclose(moved.area, found.area, rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(moved.gap, found.gap, atol=1e-10)
    np.testing.assert_allclose(moved.normal, found.normal @ turn.T, atol=1e-9)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), reach=st.floats(0.05, 3.0))
def test_the_broad_phase_misses_nothing(seed: int, reach: float) -> None:
    """Against all pairs of faces; few large faces among many small ones."""
    rng = np.random.default_rng(seed)
    large, small = cloud(rng, 3), cloud(rng, 30)
    points = np.concatenate([large.points, small.points * [0.2, 0.2, 1] + [1.2, 0.3, 0]])
    faces = np.concatenate([large.faces, small.faces + len(large.points)])
    other = facing(surface(points, faces, "triangle"), np.array([0.0, 0.0, 1.0]))
    carrier = cloud(rng, 10, height=rng.uniform(0, reach), up=False)
    carrier = carrier.moved(carrier.points * [1.4, 1, 1])
    warp = [side.moved(side.points + 0.02 * rng.normal(size=side.points.shape))
            for side in (carrier, other)]  # fmt: skip
    every = np.array(list(product(range(len(carrier.faces)), range(len(other.faces)))))
    found, all_pairs = mortar(*warp, reach), mortar(*warp, reach, pairs=every)
    np.testing.assert_array_equal(found.faces, all_pairs.faces)
    np.testing.assert_array_equal(found.gap, all_pairs.gap)
    assert len(faces_in_reach(*warp, reach)) < len(every)


@pytest.mark.parametrize(("dim", "kinds"), [CASES[0], CASES[1], CASES[4]])
def test_what_does_not_meet(dim: int, kinds: tuple[Kind, Kind]) -> None:
    carrier, other = couple(dim, kinds, (1, 1))
    up = np.eye(dim)[-1]
    assert mortar(carrier, other, 0.99 * HEIGHT).count == 0
    assert mortar(carrier, other, 1.01 * HEIGHT).count > 0
    assert mortar(carrier, facing(other, -up), 0.5).count == 0  # same way out
    sunk = other.moved(other.points + 2 * HEIGHT * up)
    assert mortar(carrier, sunk, 0.5, depth=0.99 * HEIGHT).count == 0
    deep = mortar(carrier, sunk, 0.5, depth=1.01 * HEIGHT)
    np.testing.assert_allclose(deep.gap, -HEIGHT, rtol=1e-12)
    gone = other.moved(other.points + 3 * np.eye(dim)[0])
    none = mortar(carrier, gone, 0.5)
    assert none.carrier_weights.shape == (0, len(carrier.points))
    assert none.forces(np.zeros(0))[1].shape == other.points.shape


@pytest.mark.parametrize("kind", ["interval", *FACES])
def test_what_lies_behind_is_hidden(kind: Kind) -> None:
    """A shelf above a floor, both towards the carrier and within reach."""
    rng = np.random.default_rng(3)
    if kind == "interval":
        carrier = segment(cuts(rng, 5), height=HEIGHT, up=False)
        shelf, floor = segment(cuts(rng, 4)), segment(cuts(rng, 7), height=-0.3)
    else:
        carrier = square(kind, cuts(rng, 4), cuts(rng, 4), height=HEIGHT, up=False)
        shelf = square(kind, cuts(rng, 3), cuts(rng, 4))
        floor = square(kind, cuts(rng, 5), cuts(rng, 3), height=-0.3)
    both = surface(
        np.concatenate([shelf.points, floor.points]),
        np.concatenate([shelf.faces, floor.faces + len(shelf.points)]),
        kind,
        np.tile(np.eye(carrier.dim)[-1], (len(shelf.faces) + len(floor.faces), 1)),
    )
    alone, found = mortar(carrier, shelf, 1.0), mortar(carrier, both, 1.0)
    np.testing.assert_allclose(found.gap, alone.gap, rtol=1e-13)
    np.testing.assert_allclose(found.area, alone.area, rtol=1e-13)


def test_a_surface_of_the_wrong_shape_is_refused() -> None:
    with pytest.raises(ValueError, match=r"takes points of shape \(nodes, 3\)"):
        surface(np.zeros((3, 2)), [[0, 1, 2]], "triangle")
