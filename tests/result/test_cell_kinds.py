"""Orders of nodes against DOLFINx's tables and VTK's cells."""

import numpy as np
import pytest

from impactfem.result.cell_kinds import BY_VTK_TYPE, KINDS, boundary_facets, face_triangles

EACH = pytest.mark.parametrize("kind", KINDS.values(), ids=lambda k: f"{k.shape}{k.degree}")


def reference_nodes(kind):
    """Nodes of the reference cell in DOLFINx's order, shape (nodes, 3)."""
    basix = pytest.importorskip("basix")
    element = basix.create_element(
        basix.ElementFamily.P, getattr(basix.CellType, kind.shape), kind.degree,
        basix.LagrangeVariant.equispaced,
    )  # fmt: skip
    nodes = np.zeros((element.dim, 3))
    nodes[:, : kind.dim] = element.points
    return nodes


@EACH
def test_vtk_finds_its_nodes_where_it_expects_them(kind):
    pyvista = pytest.importorskip("pyvista")
    nodes = reference_nodes(kind)[list(kind.order)]
    cell = np.concatenate([[len(nodes)], np.arange(len(nodes))])
    grid = pyvista.UnstructuredGrid(cell, [kind.vtk_type], nodes)
    vtk_cell = grid.GetCell(0)
    assert vtk_cell.GetNumberOfPoints() == len(nodes)
    expected = np.array([vtk_cell.GetParametricCoords()[k] for k in range(3 * len(nodes))]).reshape(
        -1, 3
    )
    assert nodes == pytest.approx(expected)


@EACH
def test_the_way_back_is_the_inverse(kind):
    cells = np.arange(len(kind.order))[None] + 7
    assert np.array_equal(cells[:, kind.order][:, kind.order_of_dolfinx], cells)
    assert BY_VTK_TYPE[kind.vtk_type] is kind


@EACH
def test_facets_bound_the_cell(kind):
    """Corners first, then what lies midway; the normals point outward and close (sum to 0)."""
    nodes = reference_nodes(kind)[list(kind.order)]
    facets, owners = boundary_facets(np.arange(len(nodes))[None], kind)
    assert len(facets) == len(kind.facets)
    assert set(owners) == {0}
    normals, volume = np.zeros(3), 0.0
    if kind.dim == 2:
        for a, b, *middle in facets:
            step = nodes[b] - nodes[a]
            normals += step
            volume += 0.5 * np.cross(nodes[a], nodes[b])[2]
            for m in middle:
                assert nodes[m] == pytest.approx(0.5 * (nodes[a] + nodes[b]))
    else:
        for a, b, c in face_triangles(facets):
            normals += np.cross(nodes[b] - nodes[a], nodes[c] - nodes[a])
            volume += np.dot(nodes[a], np.cross(nodes[b], nodes[c])) / 6.0
    exact = {"triangle": 1 / 2, "quadrilateral": 1.0, "tetrahedron": 1 / 6, "hexahedron": 1.0}
    assert normals == pytest.approx(0.0, abs=1e-14)
    assert volume == pytest.approx(exact[kind.shape])


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("shape", ["triangle", "quadrilateral"])
def test_triangles_of_a_plane_cell_cover_it(shape, degree):
    kind = KINDS[shape, degree]
    nodes = reference_nodes(kind)[list(kind.order)]
    areas = [
        0.5 * np.cross(nodes[b] - nodes[a], nodes[c] - nodes[a])[2]
        for a, b, c in face_triangles(np.arange(len(nodes))[None])
    ]
    assert min(areas) > 0.0
    assert sum(areas) == pytest.approx(0.5 if shape == "triangle" else 1.0)


def test_shared_facets_are_not_on_the_boundary():
    cells = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    facets, owners = boundary_facets(cells, KINDS["quadrilateral", 1])
    found = {tuple(sorted(f)): c for f, c in zip(facets.tolist(), owners, strict=True)}
    assert found == {(0, 1): 0, (0, 3): 0, (3, 4): 0, (1, 2): 1, (2, 5): 1, (4, 5): 1}
