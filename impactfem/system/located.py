"""Where a place lies in a body: its cell, and what the nodes there say of its motion and stress."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.fem import dolfinx_fem
from impactfem.scene.orthotropic import PLACES, seen_by
from impactfem.scene.solids import RESIDUAL
from impactfem.system.elastic import ElasticSystem
from impactfem.system.materials import CellMaterials, law_rows, materials_of
from impactfem.system.true_stress import TrueStress

OUTSIDE = 0.05
"""Share of a cell's size by which a place may lie outside: meshes cut corners off round bodies."""

_ROUNDING = 1e-9  # share of a cell below which a place is in it
_NEAR = 12  # cells by their middles among which that of a place is sought
_STEPS = 20  # of Newton's method, which straight cells need one of
_ORDER = {2: ((0, 0), (1, 1), (0, 1)), 3: ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))}


@dataclass(frozen=True)
class Located:
    """A place in a body, the same on every rank; rows of weights belong to nodes.

    Attributes:
        numbers: Canonical numbers of the nodes of its cell, shape (nodes,).
        values: Shape functions there, shape (nodes,).
        stress: Components of the stress by name: weights of the displacements [Pa/m], shape
            (nodes, dim); under finite strain what `law` needs instead.
        law: Of the true stress under finite strain, which is not linear.
        residual: Components of the residual stress there [Pa], by name.
        cell: Of this rank; None if it is another's.
    """

    numbers: Integers
    values: Floats
    stress: dict[str, Floats]
    law: TrueStress | None = None
    residual: Mapping[str, float] = field(default_factory=dict)
    cell: int | None = None


def locate(system: ElasticSystem, solid: Any, begun: Floats, point: Floats) -> Located | Floats:
    """Find a place of t = 0 in a body (collective).

    The stress is that of the strain at the place, under finite strain the true one; of nearly
    incompressible bodies its pressure is the mean of the cell, as in the equations of motion.

    Args:
        system: The body.
        solid: `impactfem.scene.solids.Solid`.
        begun: Displacement of the owned dofs at t = 0 [m], (owned dofs,).
        point: [m], shape (dim,).

    Returns:
        Where it lies, or a place of the body near it [m], shape (dim,), if it is outside.
    """
    nodes, comm = system.nodes, system.comm
    mesh = nodes.space.mesh
    start = dolfinx_fem.Function(nodes.space)
    start.x.array[: len(begun)] = begun
    start.x.scatter_forward()
    places = nodes.positions + start.x.array.reshape(nodes.positions.shape)
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    cells = np.asarray(nodes.space.dofmap.list[:owned])
    cell = _Cell(mesh.topology.cell_type.name, int(nodes.space.ufl_element().degree))
    found, known = _cells_about(point, places, cells, cell, mesh.topology.original_cell_index)
    best = min(found, key=lambda entry: entry[:2], default=None)
    asked = (math.inf, 0, comm.rank) if best is None else (best[0], best[1], comm.rank)
    winner = min(comm.allgather(asked))
    if winner[0] == math.inf:
        return np.asarray(min(comm.allgather(min(known)))[1])
    answer, every = None, materials_of(nodes, solid)
    if comm.rank == winner[2] and best is not None:
        own, at = cells[best[2]], cell.clipped(best[3])
        x, made = nodes.positions[own], every.at(best[2])
        law = None
        if solid.is_finite:
            slopes, hoop = _strains(cell, x, at, axisymmetric=system.axisymmetric)
            one = every.at([best[2]])
            row, mean = law_rows(one, solid, one.local)[0], float(one.bulk[0])
            points = _points(cell, x, axisymmetric=system.axisymmetric)
            law = TrueStress(slopes, hoop[:, 0], row, mean, points, _linear(made, solid.model))
            stress = law.weights
        else:
            stress = _stress(cell, x, at, made, solid.model)
        basis = cell.basis(at)[0]
        place = dict(zip("xyz", (basis @ x).tolist(), strict=False))
        each = (name for name, cells in nodes.groups.items() if best[2] in cells)
        of = solid.of_groups[next(each)] if solid.materials else solid
        given = zip(RESIDUAL[len(point)], of.residual_stress or (), strict=False)
        residual = {name: float(formula(**place)) for name, formula in given}
        answer = Located(nodes.numbers[own], basis, stress, law, residual)
    located: Located = comm.bcast(answer, root=winner[2])
    return replace(located, cell=None if answer is None or best is None else best[2])


def _cells_about(
    point: Floats, places: Floats, cells: Integers, cell: "_Cell", numbers: Integers
) -> tuple[list[tuple[float, int, int, Floats]], list[tuple[float, list[float]]]]:
    """Cells in which a point lies, or next to it, and places of the body near it.

    Returns:
        Of each cell how far outside the point is, as a share of its size, its number on all ranks
        and on this one, and the place in it; of each place how far it is, and where [m].
    """
    corners = places[cells]
    low, high = corners.min(axis=1), corners.max(axis=1)
    room = 0.2 * (high - low) + OUTSIDE * (high - low).max(axis=1, keepdims=True)
    near = np.flatnonzero(((point >= low - room) & (point <= high + room)).all(axis=1))
    apart = np.linalg.norm(places - point, axis=1)
    mine = int(np.argmin(apart))
    known, found = [(float(apart[mine]), places[mine].tolist())], []
    for index in near:
        at = cell.inverse(corners[index], point)
        if at is None:
            continue
        foot = cell.basis(cell.clipped(at))[0] @ corners[index]
        away = float(np.linalg.norm(foot - point))
        known.append((away, foot.tolist()))
        beside = away / cell.size(corners[index])
        if beside <= OUTSIDE or cell.excess(at) <= OUTSIDE:
            # To rounding, so that it is the same cell on any number of ranks.
            away = round(beside, 9) if cell.excess(at) > _ROUNDING else 0.0
            found.append((away, int(numbers[index]), int(index), at))
    return found, known


def followed(system: ElasticSystem, places: Floats) -> tuple[Integers, Floats]:
    """Find undeformed places in a body, or next to it (collective).

    Meshes of other sizes cut corners off round bodies: what lies outside is continued from the cell
    it is nearest to.

    Args:
        system: The body.
        places: [m], shape (places, dim).

    Returns:
        Canonical numbers of the nodes of their cells and the shape functions there, the same on
        every rank, (places, nodes) each.
    """
    nodes, comm = system.nodes, system.comm
    mesh = nodes.space.mesh
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    cells = np.asarray(nodes.space.dofmap.list[:owned])
    cell = _Cell(mesh.topology.cell_type.name, int(nodes.space.ufl_element().degree))
    corners = nodes.positions[cells]
    middles, widths = corners.mean(axis=1), np.ptp(corners, axis=1).max(axis=1)
    found: list[Any] = []
    for place in places:
        away = np.linalg.norm(middles - place, axis=1) / widths
        known = []
        for k in map(int, np.argsort(away)[:_NEAR]):
            at = cell.inverse(corners[k], place)
            if at is not None:
                excess = max(round(cell.excess(at), 9), 0.0)
                # The same cell on any number of ranks, but where cells meet, which say the same.
                known.append((excess, int(mesh.topology.original_cell_index[k]), k, at))
                if not excess:
                    break
        best = min(known, key=lambda entry: entry[:2], default=None)
        if best is not None:
            found.append((*best[:2], nodes.numbers[cells[best[2]]], cell.basis(best[3])[0]))
        else:  # no cells here, or all of them degenerate: then any node of the nearest one
            own = nodes.numbers[cells[np.argmin(away)]] if owned else np.zeros(1, dtype=np.int64)
            found.append((math.inf, 0 if owned else 1, own, np.eye(len(own))[0]))
    each = [
        min(tolds, key=lambda entry: entry[:2])
        for tolds in zip(*comm.allgather(found), strict=True)
    ]
    return np.array([told[2] for told in each]), np.array([told[3] for told in each])


@dataclass(frozen=True)
class _Cell:
    """A kind of cell with its shape functions."""

    name: str
    degree: int

    @property
    def is_simplex(self) -> bool:
        return self.name in {"triangle", "tetrahedron"}

    def basis(self, at: Floats) -> tuple[Floats, Floats]:
        """Shape functions (nodes,) and their reference gradients (nodes, dim) at a place."""
        values, grads = fem.coordinate_basis(self.name, self.degree, at[None])
        return np.asarray(values[0]), np.asarray(grads[:, 0].T)

    def inverse(self, corners: Floats, point: Floats) -> Floats | None:
        """Reference place of a point by Newton's method; None if it is not found."""
        at = np.full(len(point), 1.0 / (len(point) + 1) if self.is_simplex else 0.5)
        for _ in range(_STEPS):
            values, grads = self.basis(at)
            try:
                step = np.linalg.solve(corners.T @ grads, point - values @ corners)
            except np.linalg.LinAlgError:
                return None
            at = at + step
            if np.abs(step).max() < 1e-13:
                return at
            if np.abs(at).max() > 10.0:
                return None
        return at if np.abs(step).max() < 1e-9 else None

    def size(self, corners: Floats) -> float:
        """Edge of a cube of its volume, or of a square [m]."""
        dim = corners.shape[1]
        _, grads = self.basis(np.full(dim, 1.0 / (dim + 1) if self.is_simplex else 0.5))
        share = 1.0 / math.factorial(dim) if self.is_simplex else 1.0
        return float((share * abs(np.linalg.det(corners.T @ grads))) ** (1.0 / dim))

    def excess(self, at: Floats) -> float:
        """How far outside a reference place lies; <= 0 inside."""
        beyond = float(at.sum()) - 1.0 if self.is_simplex else float(at.max()) - 1.0
        return max(beyond, -float(at.min()))

    def clipped(self, at: Floats) -> Floats:
        """A place in the cell instead of one a little outside."""
        inside = np.clip(at, 0.0, 1.0)
        return inside / max(1.0, float(inside.sum())) if self.is_simplex else inside

    def quadrature(self) -> tuple[Floats, Floats]:
        """Places and weights that integrate dilatations."""
        return fem.cell_quadrature(self.name, 2 * self.degree + 2)


def _stress(
    cell: _Cell, x: Floats, at: Floats, made: CellMaterials, model: str
) -> dict[str, Floats]:
    """Weights of the nodal displacements in each component of the stress [Pa/m]."""
    lame, shear, dim = made.lame, made.shear, x.shape[1]
    flat, axisymmetric = model == "plane_stress", model == "axisymmetric"
    if flat:
        lame = 2.0 * lame * shear / (lame + 2.0 * shear)
    slopes, hoop = _strains(cell, x, at, axisymmetric=axisymmetric)
    trace = slopes + hoop
    if len(made.whole) and not made.keeps:
        return _whole_stress(seen_by(made.whole, model), slopes, hoop)
    if made.keeps and not (cell.is_simplex and cell.degree == 1):
        trace = _mean_trace(cell, x, axisymmetric=axisymmetric)
    found = {}
    for i, j in _ORDER[dim]:
        part = np.zeros_like(x)
        part[:, i] += shear * slopes[:, j]
        part[:, j] += shear * slopes[:, i]
        found[f"s{'xyz'[i]}{'xyz'[j]}"] = part + (lame * trace if i == j else 0.0)
    if dim == 2 and not flat:
        found["szz"] = lame * trace + 2.0 * shear * hoop
    return found


def _linear(made: CellMaterials, model: str) -> Floats:
    """C of small strains of a cell [Pa], without what the mean of its volume is asked for."""
    whole = made.whole.copy() if made.whole.size else made.shear * np.diag([2.0] * 3 + [1.0] * 3)
    whole[:3, :3] += made.local - (made.lame if made.whole.size else 0.0)
    return seen_by(whole, model)


def _whole_stress(whole: Floats, slopes: Floats, hoop: Floats) -> dict[str, Floats]:
    """The same of a stiffness that is orthotropic."""
    dim, count = slopes.shape[1], len(whole)
    strains = np.zeros((count, *slopes.shape))
    for row, (i, j) in enumerate(PLACES[:count]):
        if max(i, j) < dim:
            strains[row, :, i] += slopes[:, j]
            strains[row, :, j] += slopes[:, i] * (i != j)
    strains[2] += hoop
    found = dict(zip(("sxx", "syy", "szz", "sxy", "syz", "sxz"), np.tensordot(whole, strains, 1),
                     strict=False))  # fmt: skip
    if not whole[2].any():  # in plane stress
        del found["szz"]
    return found


def _strains(cell: _Cell, x: Floats, at: Floats, *, axisymmetric: bool) -> tuple[Floats, Floats]:
    """Gradients of the shape functions and weights of the hoop strain, (nodes, dim) each."""
    values, grads = cell.basis(at)
    slopes = grads @ np.linalg.inv(x.T @ grads)
    hoop = np.zeros_like(x)
    if axisymmetric:
        radius = float(values @ x[:, 0])
        # On the axis u_r / r is du_r / dr.
        on_axis = radius <= 1e-9 * float(np.abs(x).max())
        hoop[:, 0] = slopes[:, 0] if on_axis else values / radius
    return slopes, hoop


def _mean_trace(cell: _Cell, x: Floats, *, axisymmetric: bool) -> Floats:
    """Weights of the mean dilatation of a cell, (nodes, dim)."""
    slopes, hoop, volumes = _points(cell, x, axisymmetric=axisymmetric)
    slopes[:, :, 0] += hoop
    mean: Floats = np.tensordot(volumes, slopes, 1) / volumes.sum()
    return mean


def _points(cell: _Cell, x: Floats, *, axisymmetric: bool) -> tuple[Floats, Floats, Floats]:
    """Slopes, weights of the hoop strain and volumes at points of a cell, (points, ...)."""
    found = []
    for at, weight in zip(*cell.quadrature(), strict=True):
        values, grads = cell.basis(at)
        slopes, hoop = _strains(cell, x, at, axisymmetric=axisymmetric)
        size = weight * abs(float(np.linalg.det(x.T @ grads)))
        found.append((slopes, hoop[:, 0], size * float(values @ x[:, 0]) if axisymmetric else size))
    slopes, hoops, sizes = (np.array(part) for part in zip(*found, strict=True))
    return slopes, hoops, sizes
