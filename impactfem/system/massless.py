"""Massless contact nodes: their mass goes to their neighbours inside the body.

The velocity of a contact node is taken as the mean of its inner neighbours', v = P v_inner. The
mass becomes P^T M P (consistent) or P^T m (lumped), loads P^T f: total mass and momentum are kept.
Source of the idea: Khenous, Laborde, Renard, Eur. J. Mech. A 27 (2008) 918-932; Hager, Hueeber,
Wohlmuth, Int. J. Numer. Meth. Eng. 73 (2008) 205-225.
"""

from typing import Any

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.errors import MeshError, SceneError
from impactfem.fem import cell_nodes, gather, reference_nodes, set_entries, sparse_matrix
from impactfem.mesh.body import BodyMesh
from impactfem.system.elastic import ElasticSystem
from impactfem.system.surface import SurfaceNodes

_SAME = 1e-9  # distance of nodes of the reference cell that counts as none


def mass_transfer(system: ElasticSystem, surface: SurfaceNodes, body: BodyMesh) -> Any:
    """Make the PETSc matrix P: identity, but means of inner neighbours in contact rows.

    Neighbours count once for every element they share with the contact node, in quadrilaterals and
    hexahedra half for every direction in which they differ, as in the consistent mass. So columns
    of elements of one height stay alike, and the half of a symmetric body moves as the whole.

    Columns of constrained dofs are empty: these have no velocity to give.

    Args:
        system: The body.
        surface: The contact nodes.
        body: Its mesh.

    Raises:
        MeshError: No element has a node that carries no contact.
    """
    dim, stiffness, comm = surface.dim, system.stiffness, surface.comm
    first, last = stiffness.getOwnershipRange()
    contact = gather(comm, system.numbers[surface.nodes])
    targets = _targets(_neighbours(body, contact))
    asked = np.unique([other for inner in targets.values() for other in inner]).astype(np.int64)
    own = np.flatnonzero(np.isin(system.numbers, asked))
    order = np.argsort(found := gather(comm, system.numbers[own]))
    places = dict(
        zip(found[order].tolist(), gather(comm, own + first // dim)[order].tolist(), strict=True)
    )
    rows, columns, values = [], [], []
    for node in surface.nodes:
        inner = targets[int(system.numbers[node])]
        for i in range(dim):
            rows += [int(first) + dim * int(node) + i] * len(inner)
            columns += [dim * places[other] + i for other in inner]
            values += list(inner.values())
    others = np.setdiff1d(np.arange(last - first), surface.dofs) + first
    matrix = sparse_matrix(comm, last - first, stiffness.getSize()[0])
    set_entries(
        matrix,
        np.concatenate([others, np.asarray(rows, dtype=np.int64)]).astype(np.int64),
        np.concatenate([others, np.asarray(columns, dtype=np.int64)]).astype(np.int64),
        np.concatenate([np.ones(len(others)), np.asarray(values, dtype=np.float64)]),
        add=False,
    )
    moves = stiffness.createVecRight()
    moves.setArray(np.where(system.constrained, 0.0, 1.0))
    matrix.diagonalScale(R=moves)
    moves.destroy()
    return matrix


def lumped_mass(
    system: ElasticSystem, transfer: Any, surface: SurfaceNodes
) -> tuple[Floats, Floats]:
    """Lumped mass of the owned dofs [kg] and its inverse, 0 for what is held or massless.

    Raises:
        SceneError: The elements have no lumped mass.
    """
    if system.lumped is None:
        raise SceneError(
            "body.degree: elements of this kind and degree have no positive lumped mass, which "
            'explicit methods need; use degree = 1, or solve.method = "massless"'
        )
    # What is held gives its mass, too: held or not by symmetry, a neighbour gets the same.
    mass = transferred(transfer, np.repeat(system.node_mass, surface.dim))
    mass[system.constrained] = 0.0
    moves = ~system.constrained
    if transfer is not None:
        moves[surface.dofs] = False
    inverse = np.zeros_like(mass)
    inverse[moves] = 1.0 / mass[moves]
    return mass, inverse


def _neighbours(body: BodyMesh, contact: Integers) -> dict[int, dict[int, float]]:
    """Weights of the neighbours of each contact node, by canonical numbers (collective)."""
    reference = reference_nodes(body.cell, body.degree)
    weight: Floats = np.ones((len(reference), len(reference)))
    if body.cell in {"quadrilateral", "hexahedron"}:
        apart = np.abs(reference[:, None] - reference[None]) > _SAME
        weight = np.asarray(0.5 ** apart.sum(axis=2), dtype=np.float64)
    owned = body.mesh.topology.index_map(body.mesh.topology.dim).size_local
    cells = body.numbers[cell_nodes(body.mesh)[:owned]]
    cell, place = np.nonzero(np.isin(cells, contact))
    comm = body.mesh.comm
    begins = gather(comm, np.repeat(cells[cell, place], cells.shape[1]))
    ends, weights = gather(comm, cells[cell].ravel()), gather(comm, weight[place].ravel())
    pairs, at = np.unique(np.stack([begins, ends], axis=1), axis=0, return_inverse=True)
    # Sums of powers of 2: rounding cannot tell the ranks apart.
    sums = np.bincount(at.ravel(), weights, minlength=len(pairs))
    found: dict[int, dict[int, float]] = {int(node): {} for node in contact}
    for (begin, end), value in zip(pairs.tolist(), sums.tolist(), strict=True):
        if begin != end:
            found[begin][end] = value
    return found


def _targets(neighbours: dict[int, dict[int, float]]) -> dict[int, dict[int, float]]:
    """Shares of inner neighbours of each contact node; a corner passes on by its neighbours."""
    found = {
        node: _shares({other: w for other, w in beside.items() if other not in neighbours})
        for node, beside in neighbours.items()
    }
    while empty := [node for node in sorted(found) if not found[node]]:
        reached: dict[int, dict[int, float]] = {}
        for node in empty:
            sums: dict[int, float] = {}
            for between, w in neighbours[node].items():
                for other, share in found.get(between, {}).items():
                    sums[other] = sums.get(other, 0.0) + w * share
            reached[node] = _shares(sums)
        if not any(reached.values()):
            raise MeshError(
                "contact: every node of the mesh is a contact node, so that none could carry mass; "
                "use smaller elements, or name the surface that strikes in body.contact_surfaces"
            )
        found |= reached
    return found


def _shares(weights: dict[int, float]) -> dict[int, float]:
    """Weights over their sum."""
    total = sum(weights.values())
    return {node: weight / total for node, weight in weights.items()}


def averaged(transfer: Any, values: Floats) -> Floats:
    """P v of owned values: massless nodes have the means of their neighbours, held dofs 0."""
    return _through(transfer, values, back=False)


def transferred(transfer: Any, values: Floats) -> Floats:
    """P^T f of owned values: what belongs to massless nodes goes to their neighbours."""
    return _through(transfer, values, back=True)


def _through(transfer: Any, values: Floats, *, back: bool) -> Floats:
    """P or P^T times owned values; the same values where every node has its mass."""
    if transfer is None:
        return values.copy()
    right, left = transfer.createVecs()
    given, found = (left, right) if back else (right, left)
    given.setArray(values)
    (transfer.multTranspose if back else transfer.mult)(given, found)
    result = np.array(found.getArray())
    given.destroy()
    found.destroy()
    return result
