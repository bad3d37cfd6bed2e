"""Faults of a body's mesh, found on the rank that made it, with their place and remedy."""

import difflib
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.errors import MeshError
from impactfem.mesh.raw import Cell, RawMesh, cell_facets, facet_keys

_CHUNK = 100_000  # cells whose Jacobians are held at a time
_FLAT = 1e-10  # volume over the product of the edges below which a cell has none
_BEHIND = 1e-9  # share of the extent by which a node may lie at r < 0


def check_body(mesh: RawMesh, where: str, *, axisymmetric: bool) -> float:
    """Check the geometry of a body's mesh.

    Args:
        mesh: The whole mesh.
        where: What the messages begin with, as ``mesh file body.msh``.
        axisymmetric: Whether x is the radius.

    Returns:
        Its area [m^2] or volume [m^3].

    Raises:
        MeshError: The mesh is broken.
    """
    if not len(mesh.cells):
        raise MeshError(f"{where}: has no elements; mesh it again")
    if not np.isfinite(mesh.points).all():
        raise MeshError(f"{where}: a node coordinate is not finite; write the mesh again")
    if axisymmetric:
        least = mesh.points[:, 0].min()
        if least < -_BEHIND * np.ptp(mesh.points, axis=0).max():
            raise MeshError(
                f"{where}: nodes reach r = {least:g} < 0, but in an axisymmetric model x is the "
                "radius; draw the half with x >= 0"
            )
    volume, signs = _volume(mesh, where)
    _check_joints(mesh, signs, where)
    return volume


def check_names(surfaces: Iterable[str], used: Iterable[str], where: str) -> None:
    """Refuse surfaces that are used but do not exist.

    Raises:
        MeshError: With what exists and what was probably meant.
    """
    known = sorted(surfaces)
    for name in used:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
            meant = f" Did you mean {near[0]!r}?" if near else ""
            raise MeshError(
                f"{where}: has no surface {name!r}, it has {', '.join(known) or 'none'}; surfaces "
                f"are the physical names of the boundary.{meant}"
            )


def jacobian_chunks(mesh: RawMesh, places: Floats) -> Iterator[tuple[slice, Floats]]:
    """Jacobians d x_a / d xi_b at places of the reference cell, for some cells at a time.

    Returns:
        Cells and their Jacobians, shape (cells, places, dim, dim).
    """
    _, gradients = fem.coordinate_basis(mesh.cell, mesh.degree, places)
    for start in range(0, len(mesh.cells), _CHUNK):
        cells = slice(start, start + _CHUNK)
        yield cells, np.einsum("cna,bpn->cpab", mesh.points[mesh.cells[cells]], gradients)


def _volume(mesh: RawMesh, where: str) -> tuple[float, NDArray[np.bool_]]:
    """Volume, and whether the Jacobian of each cell is negative; refuse cells without a sign."""
    affine = mesh.degree == 1 and mesh.cell in {"triangle", "tetrahedron"}
    places, weights = fem.cell_quadrature(mesh.cell, 1 if affine else 3 * mesh.degree)
    inside = len(places)
    if not affine:  # its nodes too: a Jacobian mostly changes its sign at corners
        places = np.concatenate([places, fem.reference_nodes(mesh.cell, mesh.degree)])
    volume = 0.0
    negative = np.zeros(len(mesh.cells), dtype=bool)
    for cells, jacobians in jacobian_chunks(mesh, places):
        determinants = np.linalg.det(jacobians)
        # Compared with the longest edges of the cell: one corner may be flat with short ones.
        edges = np.linalg.norm(jacobians, axis=2).max(axis=1, keepdims=True).prod(axis=2)
        share = determinants / np.maximum(edges, np.finfo(float).tiny)
        negative[cells] = share.mean(axis=1) < 0.0
        upright = np.where(negative[cells], -share.max(axis=1), share.min(axis=1))
        if upright.min() <= _FLAT:
            bad = int(upright.argmin())
            at = _place(mesh.points[mesh.cells[cells][bad]])
            count = int((upright <= _FLAT).sum())
            more = f" (and {count - 1} more)" if count > 1 else ""
            kind = "is flat: it has no volume" if abs(upright[bad]) <= _FLAT else "is inverted"
            remedy = "mesh again, with smaller elements where the boundary is curved"
            raise MeshError(f"{where}: the {mesh.cell} at {at} {kind}{more}; {remedy}")
        volume += float((np.abs(determinants[:, :inside]) @ weights).sum())
    return volume, negative


def _check_joints(mesh: RawMesh, negative: NDArray[np.bool_], where: str) -> None:
    """Refuse cells that lie over each other, and parts that hang together at no facet."""
    facets = cell_facets(mesh)
    per_cell, corners = facets.shape[1:]
    keys = facet_keys(facets.reshape(-1, corners))[0]
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    same = ordered[1:] == ordered[:-1]
    if (same[1:] & same[:-1]).any():
        bad = order[1:-1][same[1:] & same[:-1]][0]
        at = _place(mesh.points[facets.reshape(-1, corners)[bad]])
        raise MeshError(
            f"{where}: three or more elements share the facet at {at}; remove doubled elements"
        )
    first, second = order[:-1][same], order[1:][same]
    turns = _turns(mesh, facets) ^ np.repeat(negative, per_cell)
    folded = turns[first] == turns[second]
    if folded.any():
        at = _place(mesh.points[facets.reshape(-1, corners)[first[folded][0]]])
        raise MeshError(
            f"{where}: elements lie over each other at {at} (inverted, or doubled with shared "
            "nodes); mesh again"
        )
    count = len(mesh.cells)
    links = coo_array(
        (np.ones(len(first), dtype=bool), (first // per_cell, second // per_cell)),
        shape=(count, count),
    )
    parts, part = connected_components(links, directed=False)
    if parts > 1:
        sizes = np.bincount(part)
        least = int(sizes.argmin())
        at = _place(mesh.points[mesh.cells[part == least][0]])
        raise MeshError(
            f"{where}: falls into {parts} parts that share no facets (one of {sizes[least]} "
            f"elements at {at}); a scene has one body: let the parts share their facets (in Gmsh: "
            "Coherence or BooleanFragments) or remove one"
        )


def _turns(mesh: RawMesh, facets: Integers) -> NDArray[np.bool_]:
    """Sense in which each cell, if its Jacobian is positive, goes around each of its facets.

    Two cells on opposite sides of a facet go around it in opposite senses.

    Returns:
        Shape (cells * facets per cell,).
    """
    around = _outward(mesh.cell)
    ring = np.take_along_axis(facets, np.broadcast_to(around, facets.shape), axis=2)
    ring = ring.reshape(-1, ring.shape[2])
    if ring.shape[1] == 2:
        return np.asarray(ring[:, 0] < ring[:, 1])
    rows = np.arange(len(ring))
    start = ring.argmin(axis=1)
    after, before = (start + 1) % ring.shape[1], start - 1
    return np.asarray(ring[rows, after] < ring[rows, before])


def _outward(cell: Cell) -> Integers:
    """Order in which the vertices of each facet go around its outward normal, (1, facets, n)."""
    corners = fem.reference_nodes(cell, 1)
    rows = []
    for facet in fem.facet_vertices(cell):
        ring = [0, 1, 3, 2] if len(facet) == 4 else list(range(len(facet)))
        points = corners[facet][ring]
        out = points.mean(axis=0) - corners.mean(axis=0)
        along = points[1:3] - points[0]
        if len(facet) == 2:
            outward = along[0, 1] * out[0] - along[0, 0] * out[1] > 0.0
        else:
            outward = np.cross(*along) @ out > 0.0
        rows.append(ring if outward else ring[::-1])
    return np.array([rows], dtype=np.int64)


def _place(points: Floats) -> str:
    """The middle of some nodes, for a message."""
    return "(" + ", ".join(f"{x:.4g}" for x in points.mean(axis=0)) + ")"
