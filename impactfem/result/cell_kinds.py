"""The cells of solids as VTK orders them: types, DOLFINx's order, facets and their triangles."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from impactfem.arrays import Integers

type Facets = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class CellKind:
    """A kind of Lagrange cell.

    Attributes:
        shape: Name of the shape in DOLFINx.
        degree: Degree of the geometry, 1 or 2.
        vtk_type: VTK's number of the cell. Of degree 2 these are its quadratic cells, whose order
            of nodes never changed, but the Lagrange hexahedron (in its order since VTK 9.1): VTK
            9.3 cannot split the triquadratic one, and finds no volume in it.
        order: ``cells[:, order]`` are VTK's nodes of cells whose nodes are in DOLFINx's order.
        facets: Nodes of each facet in VTK's order: an edge (ends, middle) or a face (corners,
            middles of edges, middle), as seen from outside.
    """

    shape: str
    degree: int
    vtk_type: int
    order: tuple[int, ...]
    facets: Facets

    @property
    def dim(self) -> int:
        """Topological dimension."""
        return {"interval": 1, "triangle": 2, "quadrilateral": 2}.get(self.shape, 3)

    @property
    def order_of_dolfinx(self) -> Integers:
        """``cells[:, order_of_dolfinx]`` are DOLFINx's nodes of cells in VTK's order."""
        return np.argsort(np.array(self.order))


_HEX_ORDER = (0, 1, 3, 2, 4, 5, 7, 6)

_KINDS = (
    CellKind("triangle", 1, 5, (0, 1, 2), ((0, 1), (1, 2), (2, 0))),
    CellKind("triangle", 2, 22, (0, 1, 2, 5, 3, 4), ((0, 1, 3), (1, 2, 4), (2, 0, 5))),
    CellKind("quadrilateral", 1, 9, (0, 1, 3, 2), ((0, 1), (1, 2), (2, 3), (3, 0))),
    CellKind(
        "quadrilateral", 2, 28, (0, 1, 3, 2, 4, 6, 7, 5, 8),
        ((0, 1, 4), (1, 2, 5), (2, 3, 6), (3, 0, 7)),
    ),
    CellKind("tetrahedron", 1, 10, (0, 1, 2, 3), ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))),
    CellKind(
        "tetrahedron", 2, 24, (0, 1, 2, 3, 9, 6, 8, 7, 5, 4),
        ((0, 2, 1, 6, 5, 4), (0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (0, 3, 2, 7, 9, 6)),
    ),
    CellKind(
        "hexahedron", 1, 12, _HEX_ORDER,
        ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)),
    ),
    CellKind(
        "hexahedron", 2, 72,
        (*_HEX_ORDER, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 15, 14, 22, 23, 21, 24, 20, 25, 26),
        (
            (0, 4, 7, 3, 16, 15, 19, 11, 20), (1, 2, 6, 5, 9, 18, 13, 17, 21),
            (0, 1, 5, 4, 8, 17, 12, 16, 22), (3, 7, 6, 2, 19, 14, 18, 10, 23),
            (0, 3, 2, 1, 11, 10, 9, 8, 24), (4, 5, 6, 7, 12, 13, 14, 15, 25),
        ),
    ),
)  # fmt: skip

KINDS: Mapping[tuple[str, int], CellKind] = MappingProxyType(
    {(kind.shape, kind.degree): kind for kind in _KINDS}
)
"""Kinds by DOLFINx's name of the shape and degree."""

BY_VTK_TYPE: Mapping[int, CellKind] = MappingProxyType({kind.vtk_type: kind for kind in _KINDS})
"""Kinds by VTK's number."""

# Flat triangles of a face by its number of nodes (of 2D cells too: they are faces).
_TRIANGLES: Mapping[int, Facets] = {
    3: ((0, 1, 2),),
    4: ((0, 1, 2), (0, 2, 3)),
    6: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    9: (
        (0, 4, 8), (0, 8, 7), (4, 1, 5), (4, 5, 8), (8, 5, 2), (8, 2, 6), (7, 8, 6), (7, 6, 3),
    ),
}  # fmt: skip


def boundary_facets(cells: Integers, kind: CellKind) -> tuple[Integers, Integers]:
    """Find the facets that belong to one cell only.

    Returns:
        Nodes of each, shape (facets, nodes of a facet), and the cell it belongs to, (facets,).
    """
    facets = np.concatenate([cells[:, list(facet)] for facet in kind.facets])
    corners = 2 if kind.dim == 2 else {3: 3, 6: 3, 4: 4, 9: 4}[facets.shape[1]]
    _, first, counts = np.unique(
        np.sort(facets[:, :corners], axis=1), axis=0, return_index=True, return_counts=True
    )
    single = np.sort(first[counts == 1])
    return facets[single], single % len(cells)


def face_triangles(faces: Integers) -> Integers:
    """Split faces (or cells of the plane) at all their nodes, shape (triangles, 3)."""
    parts = _TRIANGLES[faces.shape[1]]
    triangles: Integers = np.stack([faces[:, list(part)] for part in parts], axis=1)
    return triangles.reshape(-1, 3)
