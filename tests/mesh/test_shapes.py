"""Shapes: volumes, names, orders, turned bodies, cuts and refinement."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactfem import fem
from impactfem.errors import MeshError
from impactfem.mesh.checks import check_body
from impactfem.mesh.raw import outer_facets
from impactfem.mesh.shapes import shape_mesh
from impactfem.mesh.structured import structured_mesh
from impactfem.scene.plate import Plate
from impactfem.scene.plate_outlines import PolygonOutline
from impactfem.scene.shapes import Block, Cylinder, Disc, Ring, Sphere
from impactfem.scene.solids import Refinement
from impactfem.system.plate_mesh import plate_mesh

QUARTER = math.pi / 2
SCALES = [2.0**-30, 1e-9, 1e-7, 1e-3, 0.7, math.pi, 1e4]

PLANE = [
    (Block(size=(1.0, 2.0), corner=(3.0, -1.0)), 0.2),
    (Block(size=(1.0, 2.0), symmetry=("x", "y")), 0.2),
    (Block(size=(1.0, 2.0), angle=QUARTER, symmetry=("x",)), 0.2),
    (Disc(radius=0.5, center=(0.0, 0.52)), 0.1),
    (Disc(radius=0.5, center=(1.0, 0.0), symmetry=("x",)), 0.1),
    (Disc(radius=0.5, angle=0.3, symmetry=("x", "y")), 0.1),
    (Ring(inner_radius=0.3, radius=0.5, center=(0.0, 1.0)), 0.1),
    (Ring(inner_radius=0.3, radius=0.5, symmetry=("y",)), 0.1),
]
SPACE = [
    (Block(size=(1.0, 2.0, 1.5), symmetry=("z",)), 0.4),
    (Cylinder(radius=0.5, height=1.0, center=(0.0, 2.0, 0.0)), 0.25),
    (Cylinder(radius=0.5, height=1.0, symmetry=("x", "y", "z")), 0.25),
    (Cylinder(radius=0.5, height=1.0, angle=QUARTER, symmetry=("x", "y")), 0.25),
    (Sphere(radius=0.5, center=(0.0, 0.5, 0.0)), 0.2),
    (Sphere(radius=0.5, symmetry=("y",)), 0.2),
    (Sphere(radius=0.5, symmetry=("x", "z")), 0.2),
    (Sphere(radius=0.5, symmetry=("x", "y", "z")), 0.2),
]
AXISYMMETRIC = [
    (Block(size=(1.0, 2.0)), 0.25),
    (Block(size=(1.0, 2.0), corner=(0.5, 0.0)), 0.25),
    (Disc(radius=0.5, center=(0.0, 0.5)), 0.1),
    (Disc(radius=0.5, center=(2.0, 0.5)), 0.1),
    (Sphere(radius=0.5, center=(0.0, 0.5), symmetry=("y",)), 0.1),
    (Ring(inner_radius=0.3, radius=0.5, center=(0.0, 0.0)), 0.1),
    (Cylinder(radius=0.5, height=1.0, center=(0.0, 0.0)), 0.1),
]


def labels(cases):
    return [f"{shape.kind}-{''.join(shape.symmetry)}-{shape.angle:.2g}" for shape, _ in cases]


def meshes(shape, size, *, axisymmetric=False, degree=1):
    """The mesh of each kind of cells."""
    keys = {"degree": degree, "axisymmetric": axisymmetric}
    return [shape_mesh(shape, size, **keys), structured_mesh(shape, size, **keys)]


def volume(raw, axisymmetric=False):
    return check_body(raw, "test", axisymmetric=axisymmetric)


def facet_sizes(raw, name):
    """Lengths or areas of the plane facets of a surface."""
    corners = raw.points[raw.surfaces[name]]
    if raw.dim == 2:
        return np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * np.linalg.norm(np.cross(u, v), axis=1)
    if corners.shape[1] == 4:
        w = corners[:, 3] - corners[:, 0]  # opposite corner: DOLFINx's order is 0 1 / 2 3
        area = 0.5 * np.linalg.norm(np.cross(u, w), axis=1)
        area += 0.5 * np.linalg.norm(np.cross(w, v), axis=1)
    return area


@pytest.mark.parametrize(("shape", "size"), PLANE + SPACE, ids=labels(PLANE + SPACE))
def test_names_are_those_the_scene_promises_and_cover_the_boundary_once(shape, size):
    for raw in meshes(shape, size):
        assert sorted(raw.surfaces) == sorted(shape.surface_names())
        named = np.concatenate(list(raw.surfaces.values()))
        assert len(named) == len(outer_facets(raw))
        assert len(np.unique(np.sort(named, axis=1), axis=0)) == len(named)


@pytest.mark.parametrize(("shape", "size"), AXISYMMETRIC, ids=labels(AXISYMMETRIC))
def test_axisymmetric_bodies_end_at_the_axis(shape, size):
    for raw in meshes(shape, size, axisymmetric=True):
        assert sorted(raw.surfaces) == sorted(shape.surface_names(axisymmetric=True))
        assert raw.points[:, 0].min() >= 0.0
        for name, facets in raw.surfaces.items():
            assert (raw.points[facets, 0] == 0.0).all() == (name == "axis")
        # Pappus: the volume of revolution, second order in the size of facets.
        places, weights = fem.cell_quadrature(raw.cell, 3)
        values, gradients = fem.coordinate_basis(raw.cell, 1, places)
        corners = raw.points[raw.cells]
        jacobians = np.einsum("cna,bpn->cpab", corners, gradients)
        radii = np.einsum("cn,pn->cp", corners[:, :, 0], values)
        swept = 2 * math.pi * np.sum(radii * np.abs(np.linalg.det(jacobians)) @ weights)
        assert swept == pytest.approx(shape.revolved_volume, rel=2.5 * (size / 0.5) ** 2 / 6)


@pytest.mark.parametrize(("shape", "size"), PLANE + SPACE, ids=labels(PLANE + SPACE))
def test_the_volume_is_that_of_the_shape(shape, size):
    plane = isinstance(shape, Block)
    for degree in (1, 2):
        for raw in meshes(shape, size, degree=degree):
            assert raw.degree == degree
            # Chords of length h miss (h/R)^2 / 6 of a disc, equilateral triangles 3/8 (h/R)^2 of
            # a ball; some are longer than h. Curved facets are of order 4.
            share = 0.5 if isinstance(shape, Sphere) else 0.3
            relative = share * (size / 0.5) ** 2 if degree == 1 else (size / 0.5) ** 4 / 40
            assert volume(raw) == pytest.approx(shape.volume, rel=1e-12 if plane else relative)


@pytest.mark.parametrize("make", [shape_mesh, structured_mesh])
@pytest.mark.parametrize(("shape", "sizes"), [
    (Disc(radius=1.0), (0.2, 0.1)),
    (Sphere(radius=1.0), (0.4, 0.2)),
    (Cylinder(radius=1.0, height=1.0), (0.4, 0.2)),
])  # fmt: skip
@pytest.mark.parametrize(("degree", "order"), [(1, 2.0), (2, 4.0)])
def test_the_order_of_the_geometry_is_2_or_4(make, shape, sizes, degree, order):
    errors = [abs(volume(make(shape, h, degree=degree)) - shape.volume) for h in sizes]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.35)


@pytest.mark.parametrize("degree", [1, 2])
def test_nodes_of_curved_surfaces_lie_on_them(degree):
    for raw in meshes(Sphere(radius=0.5), 0.2, degree=degree):
        table = fem.facet_nodes(raw.cell, degree)
        facets = raw.cells[:, table].reshape(-1, table.shape[1])
        corners = facets[:, : raw.surfaces["surface"].shape[1]]
        rim = {tuple(row) for row in np.sort(raw.surfaces["surface"], axis=1)}
        outer = np.array([tuple(row) in rim for row in np.sort(corners, axis=1)])
        radii = np.linalg.norm(raw.points[facets[outer]], axis=2)
        np.testing.assert_allclose(radii, 0.5, rtol=0, atol=2e-16)


def test_areas_of_named_faces():
    for raw in meshes(Block(size=(1.0, 2.0, 3.0), symmetry=("x",)), 0.5):
        areas = {name: facet_sizes(raw, name).sum() for name in raw.surfaces}
        assert areas == pytest.approx(
            {"symmetry_x": 6, "right": 6, "bottom": 1.5, "top": 1.5, "back": 1, "front": 1}
        )
        faces = {"right": (0, 1.0), "bottom": (1, 0.0), "top": (1, 2.0), "back": (2, 0.0),
                 "front": (2, 3.0), "symmetry_x": (0, 0.5)}  # fmt: skip
        for name, (axis, value) in faces.items():
            assert (raw.points[raw.surfaces[name], axis] == value).all()


@pytest.mark.parametrize("make", [shape_mesh, structured_mesh])
@pytest.mark.parametrize("angle", [0.3, QUARTER, -2.0])
@pytest.mark.parametrize("kind", ["block", "disc", "ring", "cube", "cylinder"])
def test_a_turned_and_moved_body_has_the_turned_and_moved_mesh(make, angle, kind):
    def shape(angle, x, y):
        return {
            "block": lambda: Block(size=(1.0, 2.0), corner=(x, y), angle=angle),
            "disc": lambda: Disc(radius=0.7, center=(x, y), angle=angle),
            "ring": lambda: Ring(inner_radius=0.3, radius=0.7, center=(x, y), angle=angle),
            "cube": lambda: Block(size=(1.0, 1.0, 1.0), corner=(x, y, 0.25), angle=angle),
            "cylinder": lambda: Cylinder(radius=0.5, height=1.0, center=(x, y, 0.25), angle=angle),
        }[kind]()

    straight, turned = make(shape(0.0, 0.0, 0.0), 0.3), make(shape(angle, 1.5, -0.5), 0.3)
    np.testing.assert_array_equal(straight.cells, turned.cells)
    for name, facets in straight.surfaces.items():
        np.testing.assert_array_equal(facets, turned.surfaces[name])
    centre = np.array(shape(0.0, 0.0, 0.0).centre)
    c, s = math.cos(angle), math.sin(angle)
    rotation = np.eye(straight.dim)
    rotation[:2, :2] = [[c, -s], [s, c]]
    shift = np.array(shape(0.0, 1.5, -0.5).centre)
    expected = shift + (straight.points - centre) @ rotation.T
    np.testing.assert_allclose(turned.points, expected, rtol=0, atol=1e-15)


def scaled(shape, factor):
    """The same form, of other size and place."""
    names = ("size", "corner", "center", "radius", "inner_radius", "height")
    old = {name: np.array(getattr(shape, name)) for name in names if getattr(shape, name, None)}
    return replace(shape, **{name: (factor * value).tolist() for name, value in old.items()})


@pytest.mark.parametrize(("shape", "size", "axisymmetric"), [
    *((shape, size, False) for shape, size in [*PLANE[:1], *PLANE[4:7], *SPACE[:2], SPACE[5]]),
    *((shape, size, True) for shape, size in AXISYMMETRIC[1:3]),
    (Block(size=(1.0, 0.3)), 0.07, False),
])  # fmt: skip
def test_the_unit_of_length_does_not_change_the_mesh(shape, size, axisymmetric):
    def made(factor):
        ball = {"point": shape.centre, "radius": 0.31, "size": 0.6 * size}
        ball = Refinement(**{name: (factor * np.array(v)).tolist() for name, v in ball.items()})
        keys = {"degree": 2, "axisymmetric": axisymmetric}
        return shape_mesh(scaled(shape, factor), size * factor, [ball], **keys)

    expected = made(1.0)
    for factor in SCALES:
        found = made(factor)
        np.testing.assert_array_equal(found.cells, expected.cells)
        for name, facets in expected.surfaces.items():
            np.testing.assert_array_equal(found.surfaces[name], facets)
        atol = 1e-12 * np.abs(expected.points).max()
        np.testing.assert_allclose(found.points / factor, expected.points, rtol=0, atol=atol)


def test_the_unit_of_length_does_not_change_the_mesh_of_a_polygon():
    corners = np.array([[0.0, 0.0], [1.0, 0.1], [0.7, 0.8], [0.3, 0.35]])

    def made(factor):
        outline = PolygonOutline(points=(factor * corners).tolist())
        keys = {"density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3}
        keys |= {"mesh_size": 0.07 * factor, "thickness": 0.01 * factor}
        return plate_mesh(Plate(outline=outline, **keys), Path())

    expected = made(1.0)
    for factor in SCALES:
        found = made(factor)
        np.testing.assert_array_equal(found.cells, expected.cells)
        np.testing.assert_allclose(found.points / factor, expected.points, rtol=0, atol=1e-12)


def test_a_body_is_meshed_alike_every_time():
    one, two = (shape_mesh(Sphere(radius=0.5), 0.12, degree=2) for _ in range(2))
    np.testing.assert_array_equal(one.cells, two.cells)
    np.testing.assert_array_equal(one.points, two.points)


@pytest.mark.parametrize("shape", [Disc(radius=0.5, center=(0, 0.5)), Sphere(radius=0.5)])
def test_round_bodies_have_a_node_where_they_touch_a_plane_first(shape):
    for raw in meshes(shape, 0.15):
        lowest = np.array(shape.centre) - 0.5 * np.eye(raw.dim)[1]
        assert np.abs(raw.points - lowest).sum(axis=1).min() == 0.0


def edges_and_middles(raw):
    a, b = raw.points[raw.cells[:, 0]], raw.points[raw.cells[:, 1]]
    return np.linalg.norm(b - a, axis=1), (a + b) / 2


@pytest.mark.parametrize("shape", [Disc(radius=1.0), Sphere(radius=1.0, symmetry=("x", "z"))])
def test_refined_balls_are_fine_and_graded(shape):
    class Ball:
        point = tuple(-np.eye(shape.dim)[1])
        radius, size = 0.2, 0.04

    raw = shape_mesh(shape, 0.25, [Ball])
    edges, middles = edges_and_middles(raw)
    away = np.linalg.norm(middles - np.array(Ball.point), axis=1)
    inside = edges[away < 0.15]
    assert len(inside) > 40
    assert 0.6 * 0.04 < np.median(inside) < 1.5 * 0.04
    assert np.median(edges[away > 1.3]) > 4 * np.median(inside)
    # Size grows by 0.3 of the distance; tetrahedra inside may be 2.7 times as long.
    assert (edges < 2.7 * (0.04 + 0.3 * np.maximum(away - 0.2, 0) + 0.3 * edges / 2)).all()
    volume(raw)


def test_a_turned_body_is_refined_where_the_ball_lies():
    class Ball:
        point = (1.0, 0.0)
        radius, size = 0.2, 0.02

    raw = shape_mesh(Block(size=(2.0, 2.0), corner=(-1.0, -1.0), angle=QUARTER), 0.3, [Ball])
    edges, middles = edges_and_middles(raw)
    finest = middles[edges < 0.025]
    assert np.linalg.norm(finest - Ball.point, axis=1).max() < 0.35


def test_sizes_are_kept():
    edges, _ = edges_and_middles(shape_mesh(Disc(radius=0.5), 0.05))
    assert 0.8 * 0.05 < np.median(edges) < 1.2 * 0.05
    for shape in (Disc(radius=0.5), Sphere(radius=0.5), Cylinder(radius=0.5, height=1.0)):
        raw = structured_mesh(shape, 0.05)
        corner, *others = raw.points[raw.cells[:, [0, 1, 2]]].swapaxes(0, 1)
        longest = max(np.linalg.norm(other - corner, axis=1).max() for other in others)
        assert longest < 1.1 * 0.05


def test_a_block_is_a_lattice_of_equal_cells():
    raw = structured_mesh(Block(size=(1.0, 0.5, 0.25)), 0.125)
    assert len(raw.cells) == 8 * 4 * 2
    extents = np.ptp(raw.points[raw.cells], axis=1)
    np.testing.assert_allclose(extents, 0.125, rtol=1e-12)


def test_half_a_square_on_its_corner_has_simplices_only():
    shape = Block(size=(1.0, 1.0), angle=math.pi / 4, symmetry=("x",))
    raw = shape_mesh(shape, 0.2)
    assert volume(raw) == pytest.approx(0.5)
    assert sorted(raw.surfaces) == sorted(shape.surface_names())
    with pytest.raises(MeshError, match='use cells = "simplex"'):
        structured_mesh(shape, 0.2)


def test_a_mesh_beyond_all_machines_is_not_begun():
    for make in (shape_mesh, structured_mesh):
        with pytest.raises(MeshError, match=r"mesh_size = 1e-06 would make about .* elements"):
            make(Sphere(radius=0.5), 1e-6)
