"""Mortar gaps between curved surfaces against closed forms: orders of the error."""

import numpy as np
import pytest
from mortar_surfaces import facing, segment, sphere, square
from numpy.typing import NDArray

from impactfem.contact.mortar import mortar
from impactfem.contact.mortar_surface import Kind, Surface, surface

Floats = NDArray[np.float64]
GAP = 0.01


def circle(radius: float, count: int, degree: int, *, out: bool, start: float = 0.0) -> Surface:
    """A circle of lines with all nodes on it; its outside is beyond it or within."""
    angle = start + 2 * np.pi * np.arange(count * degree) / (count * degree)
    points = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    first = degree * np.arange(count)
    columns = [first, (first + degree) % len(angle), *([first + 1] if degree == 2 else [])]
    faces = np.stack(columns, axis=1)
    towards = points[faces[:, :2]].mean(axis=1)
    return surface(points, faces, "interval", towards if out else -towards)


def slopes(errors: list[float], ratio: float = 2.0) -> Floats:
    return np.log(np.divide(errors[:-1], errors[1:])) / np.log(ratio)


@pytest.mark.parametrize(("degree", "order"), [(1, 2), (2, 4)])
def test_a_disc_in_a_ring(degree: int, order: int) -> None:
    """Concentric: the gap is the same all round, areas are those of the circle."""
    errors, areas = [], []
    for count in (16, 32, 64):
        disc = circle(1.0, count, degree, out=True)
        ring = circle(1.0 + GAP, int(0.8 * count) + 1, degree, out=False, start=0.1)
        found = mortar(disc, ring, 0.2, points=6)
        assert found.count == count
        errors.append(np.abs(found.gap - GAP * (1 - (np.pi / count) ** 2 / 3)).max())
        areas.append(abs(found.area.sum() - 2 * np.pi))
        # Each normal is that of its corner.
        towards = -disc.points[found.nodes]
        np.testing.assert_allclose(found.normal, towards, atol=0.5 * np.pi / count)
    assert slopes(errors).min() > order - 0.4
    assert slopes(areas).min() > order - 0.1


def cap(kind: Kind, n: int, degree: int) -> Surface:
    """The lowest part of the unit sphere that touches the origin, over a square."""
    x = np.linspace(-0.45, 0.45, n + 1)
    flat = square(kind, x, x, degree, up=False)
    height = 1 - np.sqrt(1 - (flat.points[:, :2] ** 2).sum(axis=1))
    return flat.moved(np.concatenate([flat.points[:, :2], height[:, None]], axis=1))


@pytest.mark.parametrize("kind", ["triangle", "quadrilateral"])
@pytest.mark.parametrize(("degree", "order"), [(1, 2), (2, 3)])
def test_a_sphere_on_a_plane(kind: Kind, degree: int, order: int) -> None:
    """The plane carries: its gaps are means of the sphere's height, by another quadrature."""
    gauss, weights = np.polynomial.legendre.leggauss(8)
    errors = []
    for n in (6, 12, 24):
        x = np.linspace(-0.3, 0.3, n + 1)
        plane = square("quadrilateral", x, x)
        found = mortar(plane, cap(kind, 4 * n // 3, degree), 0.5)
        assert found.count == (n + 1) ** 2
        h = 0.6 / n
        r = (gauss + 1) / 2
        hats = np.stack([1 - r, r])
        exact, area = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
        for i, j in np.ndindex(n, n):
            px, py = x[i] + h * r[:, None], x[j] + h * r
            height = 1 - np.sqrt(1 - px**2 - py**2)
            both = hats * weights
            exact[i : i + 2, j : j + 2] += both @ height @ both.T
            area[i : i + 2, j : j + 2] += np.outer(both.sum(axis=1), both.sum(axis=1))
        errors.append(np.abs(found.gap - (exact / area).ravel()).max())
        np.testing.assert_allclose(
            found.normal, np.tile([0, 0, -1.0], (found.count, 1)), atol=1e-13
        )
    # From mesh to mesh the largest error varies with how the nodes of both happen to lie.
    assert slopes(errors).mean() > order - 0.2


@pytest.mark.parametrize(("degree", "order"), [(1, 2), (2, 4)])
def test_a_ball_in_a_hollow_sphere(degree: int, order: int) -> None:
    gap = 1e-4  # so small that its cosines, gap h^2, stay below the error of the surfaces
    errors, areas = [], []
    for count in (100, 400, 1600):
        ball = sphere(count, 1.0, np.zeros(3), degree)
        hollow = sphere(int(0.7 * count), 1.0 + gap, np.zeros(3), degree)
        out = hollow.points[hollow.corners].mean(axis=1)
        found = mortar(ball, facing(hollow, -out), 0.3, points=5)
        errors.append(float(np.abs(found.gap - gap).max()))
        areas.append(abs(found.area.sum() - 4 * np.pi))
    assert slopes(errors).mean() > order - 0.2
    assert slopes(areas).min() > order - 0.1


def test_a_block_on_its_corner_sees_both_sides() -> None:
    """Lines at a right angle keep their own normals; the corner's multiplier takes the mean."""
    points = np.array([[-1.0, 1.1], [0.0, 0.1], [1.0, 1.1]])
    wedge = facing(surface(points, [[0, 1], [1, 2]], "interval"), np.array([0.0, -1.0]))
    found = mortar(wedge, segment(np.linspace(-3, 3, 14)), 2.0)
    at = found.nodes.tolist().index(1)
    np.testing.assert_allclose(found.normal[at], [0, 1], atol=1e-13)
    assert found.gap[at] > 0.1
    flat = np.array([[-1.0, 1.1], [-1.0, 0.1], [1.0, 0.1], [1.0, 1.1]])
    block = surface(flat, [[0, 1], [1, 2], [2, 3]], "interval", [[-1, 0], [0, -1], [1, 0]])
    found = mortar(block, segment(np.linspace(-3, 3, 14)), 0.5)
    np.testing.assert_array_equal(found.nodes, [1, 2])  # its bottom alone
    np.testing.assert_allclose(found.normal, [[0, 1], [0, 1]], atol=1e-14)
    np.testing.assert_allclose(found.gap, 0.1, rtol=1e-13)
    np.testing.assert_allclose(found.area, 1.0, rtol=1e-13)
