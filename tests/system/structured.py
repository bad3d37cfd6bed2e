"""Structured meshes of blocks, of any cell and degree, bent as wanted, on any number of ranks."""

from itertools import permutations, product

import numpy as np

from impactfem import fem
from impactfem.fem import MPI, dolfinx_mesh
from impactfem.mesh.body import BodyMesh, MeshCost


def lattice(cell, degree, divisions):
    """Nodes in lattice coordinates and cells of a block, in DOLFINx's order."""
    dim = len(divisions)
    reference = np.rint(fem.reference_nodes(cell, degree) * degree).astype(int)
    corners = []
    for base in map(np.array, product(*(range(n) for n in divisions))):
        if cell in {"quadrilateral", "hexahedron"}:
            corners.append([base, *(base + e for e in np.eye(dim, dtype=int))])
        else:  # one simplex per order in which a path follows the axes (Kuhn)
            for order in permutations(range(dim)):
                path = [base]
                for axis in order:
                    path.append(path[-1] + np.eye(dim, dtype=int)[axis])
                corners.append(path)
    corners = np.array(corners)
    edges = corners[:, 1:] - corners[:, :1]
    nodes = degree * corners[:, :1] + np.einsum("rd,cdx->crx", reference, edges)
    points, cells = np.unique(nodes.reshape(-1, dim), axis=0, return_inverse=True)
    shape = degree * np.array(divisions)
    return points / shape, cells.reshape(len(nodes), -1).astype(np.int64)


def block(cell, degree, divisions, place=lambda s: s, comm=None):
    """Mesh of the unit block in s, put at place(s); surfaces s0-, s0+, s1-, ... by s."""
    comm = MPI.COMM_WORLD if comm is None else comm
    dim = len(divisions)
    s, cells = lattice(cell, degree, divisions)
    points = np.asarray(place(s), dtype=float)
    mine = comm.rank == 0
    mesh = fem.global_mesh(
        comm,
        np.ascontiguousarray(points) if mine else np.empty((0, dim)),
        cells if mine else np.empty((0, cells.shape[1]), dtype=np.int64),
        cell,
        degree,
    )
    numbers = fem.input_numbers(mesh)
    mesh.topology.create_connectivity(dim - 1, dim)
    mesh.topology.create_connectivity(dim - 1, 0)
    outer = boundary_facets(mesh)
    local = fem.cell_nodes(mesh)
    own_s = s[numbers]
    to_cells, to_facets = mesh.topology.connectivity(dim - 1, dim), facets_of_cells(mesh)
    on_facet = fem.facet_nodes(cell, degree)
    surfaces = {f"s{axis}{sign}": [] for axis in range(dim) for sign in "-+"}
    for facet in outer:
        c = to_cells.links(facet)[0]
        side = int(np.flatnonzero(to_facets[c] == facet)[0])
        nodes = own_s[local[c, on_facet[side]]]
        for axis in range(dim):
            for sign, value in (("-", 0.0), ("+", 1.0)):
                if np.all(nodes[:, axis] == value):
                    surfaces[f"s{axis}{sign}"].append(facet)
    surfaces = {name: np.array(f, dtype=np.int32) for name, f in surfaces.items()}
    return BodyMesh(
        mesh, surfaces, numbers, dim, cell, degree, len(s), len(cells), 1.0, MeshCost(0.0, 0.0)
    )


def facets_of_cells(mesh):
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim, dim - 1)
    found = mesh.topology.connectivity(dim, dim - 1)
    return found.array.reshape(found.num_nodes, -1)


def boundary_facets(mesh):
    """All local facets with one local cell that lie on the boundary of the whole mesh."""
    dim = mesh.topology.dim
    owned = dolfinx_mesh.exterior_facet_indices(mesh.topology)
    index_map = mesh.topology.index_map(dim - 1)
    mesh.topology.create_connectivity(dim - 1, dim)
    counts = np.diff(mesh.topology.connectivity(dim - 1, dim).offsets)
    ghosts = np.arange(index_map.size_local, len(counts))
    # Ghost facets with one local cell may lie inside: their owner knows.
    asked = index_map.local_to_global(ghosts.astype(np.int32))
    outside = fem.gather(mesh.comm, index_map.local_to_global(owned))
    return np.concatenate([owned, ghosts[np.isin(asked, outside)]]).astype(np.int32)
