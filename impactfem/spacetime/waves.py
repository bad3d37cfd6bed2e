"""The two waves of a bar on a triangulation of space-time, and their reflection at its ends."""

from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.errors import MeshError
from impactfem.fem import dolfinx_fem
from impactfem.forms.discontinuous import advection_form
from impactfem.mesh.unstructured import Triangulation
from impactfem.scene import Bar, PiecewiseConstant
from impactfem.spacetime import sweep

_EDGES = ((1, 2), (0, 2), (0, 1))  # edge k of a triangle lies opposite node k
_START_POINTS = 16  # Gauss points for formulas of x
_SOURCE_DEGREE = 8  # of the quadrature of gravity, exact where it does not jump in a cell


class Field:
    """Discontinuous polynomials on triangles: numbering and evaluation.

    Args:
        mesh: Triangles.
        degree: 0, 1 or 2.
    """

    def __init__(self, mesh: Triangulation, degree: int) -> None:
        self.degree = degree
        self.mesh = fem.serial_mesh(mesh.points, mesh.cells)
        self.space = dolfinx_fem.functionspace(self.mesh, ("DG", degree))
        self.nodes = fem.cell_nodes(self.mesh)
        self.corners = self.mesh.geometry.x[self.nodes][:, :, :2]
        self.duration = float(self.corners[:, :, 0].max())
        self.first = np.ascontiguousarray(self.corners[:, :, 0].min(axis=1))
        self.last = self.corners[:, :, 0].max(axis=1)
        sides = self.corners[:, 1:] - self.corners[:, :1]
        self.area2 = np.abs(np.linalg.det(sides))
        self._to_reference = np.linalg.inv(sides)
        self._element = self.space.element.basix_element

    @property
    def dofs(self) -> int:
        """Coefficients in each cell."""
        return (self.degree + 1) * (self.degree + 2) // 2

    def basis(self, cells: Integers, points: Floats) -> Floats:
        """Basis functions of cells at points (t, x) in them, (cells,) and (cells, n, 2) -> dofs."""
        local = (points - self.corners[cells, :1]) @ self._to_reference[cells]
        values = self._element.tabulate(0, local.reshape(-1, 2))[0]
        return np.asarray(values).reshape(*points.shape[:2], self.dofs)

    def source(self, gravity: PiecewiseConstant, transit: float) -> Floats:
        """Integrals of -p (L/c)^2 times each basis function, shape (cells, dofs) [m]."""
        points, weights = basix.make_quadrature(basix.CellType.triangle, _SOURCE_DEGREE)
        phi = np.asarray(self._element.tabulate(0, points))[0].reshape(len(points), self.dofs)
        t = self.corners[:, 0, :1] + (
            (self.corners[:, 1:, 0] - self.corners[:, :1, 0]) @ np.asarray(points).T
        )
        load = -(transit**2) * gravity(transit * t)
        return np.asarray(self.area2[:, None] * ((load * weights) @ phi))

    def edges(self, axis: int, value: float, points: int) -> "Edges":
        """Edges on a side of the rectangle, in order, with a Gauss rule."""
        on_side = np.abs(self.corners[:, :, axis] - value) < 1e-12 * max(1.0, abs(value))
        cells, ends = [], []
        for a, b in _EDGES:
            found = np.flatnonzero(on_side[:, a] & on_side[:, b])
            cells.append(found)
            ends.append(self.corners[found][:, [a, b], 1 - axis])
        cell, end = np.concatenate(cells), np.sort(np.concatenate(ends), axis=1)
        order = np.argsort(end[:, 0])
        cell, end = cell[order], end[order]
        nodes, weights = np.polynomial.legendre.leggauss(points)
        width = end[:, 1] - end[:, 0]
        place = end[:, :1] + 0.5 * width[:, None] * (1.0 + nodes)
        at = np.empty((*place.shape, 2))
        at[:, :, axis], at[:, :, 1 - axis] = value, place
        phi = self.basis(cell, at)
        return Edges(cell, end[:, 0], end[:, 1], place, 0.5 * width[:, None] * weights, phi)


@dataclass(frozen=True)
class Edges:
    """Edges on one side of the rectangle, in order.

    Attributes:
        cells: Cell of each edge, shape (edges,).
        begin: First coordinate along the side.
        end: Last coordinate.
        places: Gauss points, shape (edges, points).
        weights: Their weights, the same shape.
        basis: Basis functions of the cell at them, shape (edges, points, dofs).
    """

    cells: Integers
    begin: Floats
    end: Floats
    places: Floats
    weights: Floats
    basis: Floats

    @property
    def widths(self) -> Floats:
        """Length of each edge."""
        return self.end - self.begin

    def located(self, places: Floats) -> tuple[Integers, Floats]:
        """Edge of each place along the side, and the share of it before the place."""
        edge = np.searchsorted(self.begin, places, side="right") - 1
        edge = np.clip(edge, 0, len(self.cells) - 1)
        return edge, (places - self.begin[edge]) / self.widths[edge]

    def partial(self, values: Floats, edge: Integers, share: Floats) -> Floats:
        """Integrals over the first shares of some edges of polynomials given at the Gauss points.

        Args:
            values: (edges, points).
            edge: As `located` gives it, (n,).
            share: Likewise.
        """
        nodes = np.polynomial.legendre.leggauss(self.places.shape[1])[0]
        inverse = np.linalg.inv(np.polynomial.legendre.legvander(nodes, len(nodes) - 1))
        waves = values[edge] @ inverse.T
        legendre = np.polynomial.legendre.legvander(2.0 * share - 1.0, len(nodes))
        # The integral of P_n from -1 on is (P_{n+1} - P_{n-1}) / (2 n + 1), that of P_0 is 1 + s.
        found = waves[:, 0] * (1.0 + legendre[:, 1])
        for n in range(1, len(nodes)):
            found += waves[:, n] * (legendre[:, n + 1] - legendre[:, n - 1]) / (2 * n + 1)
        return np.asarray(0.5 * self.widths[edge] * found)

    def trace(self, wave: Floats) -> Floats:
        """Values of a wave at the Gauss points, shape (edges, points)."""
        return np.asarray(np.einsum("epd,ed->ep", self.basis, wave[self.cells]))

    def load(self, values: Floats) -> Floats:
        """Integrals of given values times the basis functions, shape (edges, dofs)."""
        return np.asarray(np.einsum("ep,epd->ed", self.weights * values, self.basis))


class Wave:
    """One of the two waves: its equation cell by cell, its values, and what must be recomputed.

    Args:
        field: The polynomials.
        form: Compiled `advection_form`.
        load: Load of each cell, shape (cells, dofs).
    """

    def __init__(self, field: Field, form: Any, load: Floats) -> None:
        dofs, cells = field.dofs, len(field.first)
        numbering = field.space.dofmap.list.ravel()
        matrix = dolfinx_fem.assemble_matrix(form).to_scipy()[numbering][:, numbering]
        blocks = matrix.tobsr((dofs, dofs))
        rows = np.repeat(np.arange(cells), np.diff(blocks.indptr))
        columns, data = blocks.indices.astype(np.int64), blocks.data
        own = rows == columns
        diagonal = np.empty((cells, dofs, dofs))
        diagonal[rows[own]] = data[own]
        self.inverse = np.linalg.inv(diagonal)
        beside = ~own & (np.abs(data).max(axis=(1, 2)) > 0.0)
        rows, columns, data = rows[beside], columns[beside], data[beside]
        slot = np.arange(len(rows)) - np.searchsorted(rows, rows)
        self.upstream = np.full((cells, 3), -1, dtype=np.int64)
        self.upstream[rows, slot] = columns
        self.transfer = np.zeros((cells, 3, dofs, dofs))
        self.transfer[rows, slot] = self.inverse[rows] @ data
        self.order = sweep.causal_order(self.upstream)
        if len(self.order) != cells:
            raise MeshError(
                "the triangles of the space-time mesh cannot be passed in the order of the waves: "
                "some overlap; mend the mesh"
            )
        self.first = field.first
        self.load = np.einsum("cij,cj->ci", self.inverse, load)
        self.base = self.load.copy()
        self.values = np.zeros((cells, dofs))
        self.dirty = np.ones(cells, dtype=bool)
        self._changed = np.zeros(cells, dtype=bool)

    def sweep(self, horizon: float, tolerance: float) -> None:
        """Recompute what has changed before the horizon."""
        sweep.sweep(
            self.order, self.upstream, self.transfer, self.load, self.first, horizon, tolerance,
            self.dirty, self._changed, self.values,
        )  # fmt: skip

    def feed(self, edges: Edges, values: Floats, tolerance: float) -> NDArray[np.bool_]:
        """Let given values enter through edges; returns which edges' loads have changed."""
        cells = edges.cells
        new = self.base[cells] + np.einsum("eij,ej->ei", self.inverse[cells], edges.load(values))
        changed: NDArray[np.bool_] = ~(np.abs(new - self.load[cells]).max(axis=1) <= tolerance)
        self.load[cells[changed]] = new[changed]
        self.dirty[cells[changed]] = True
        return changed


def wave_equations(
    mesh: Triangulation, degree: int, bar: Bar, gravity: PiecewiseConstant
) -> tuple[Field, Wave, Wave]:
    """Assemble both waves of a bar, r = V + S towards the wall and q = V - S away from it [m].

    Args:
        mesh: Triangles of space-time.
        degree: 0, 1 or 2.
        bar: Its initial state enters exactly where it is piecewise polynomial between nodes.
        gravity: p(t) [m/s^2].
    """
    field = Field(mesh, degree)
    source = field.source(gravity, bar.transit_time)
    velocity, strain = _start(field, bar)
    waves = []
    for speed, start in ((-1.0, velocity + strain), (1.0, velocity - strain)):
        constant = dolfinx_fem.Constant(field.mesh, speed)
        form = fem.compile_form(advection_form(field.space, constant))
        waves.append(Wave(field, form, source + start))
    return field, waves[0], waves[1]


def _start(field: Field, bar: Bar) -> tuple[Floats, Floats]:
    """Integrals over t = 0 of V and of S times the basis functions, shape (cells, dofs) each.

    Those of S = u_x are made by parts from u: no derivative of a formula is taken, and the sum of
    S is exactly the difference of u.
    """
    edges = field.edges(0, 0.0, _START_POINTS)
    velocity, strain = (
        np.zeros((len(field.first), field.dofs)),
        np.zeros((len(field.first), field.dofs)),
    )
    length = bar.length
    v = bar.transit_time * bar.initial_velocity(x=length * edges.places)
    np.add.at(velocity, edges.cells, edges.load(v + np.zeros_like(edges.places)))
    ends = np.stack([edges.begin, edges.end], axis=1)
    at = np.stack([np.zeros_like(ends), ends], axis=2)
    phi = field.basis(edges.cells, at)
    near = bar.initial_displacement(x=0.0)
    u = bar.initial_displacement(x=length * ends) - near
    inside = bar.initial_displacement(x=length * edges.places) - near + np.zeros_like(edges.places)
    # Derivative of the basis along the edge, exact for polynomials: through the Gauss points.
    slope = _slopes(edges)
    parts = u[:, 1, None] * phi[:, 1] - u[:, 0, None] * phi[:, 0]
    parts -= np.einsum("ep,epd->ed", edges.weights * inside, slope)
    np.add.at(strain, edges.cells, parts)
    return velocity, strain


def _slopes(edges: Edges) -> Floats:
    """Derivative of the basis functions along each edge at its Gauss points."""
    nodes = np.polynomial.legendre.leggauss(edges.places.shape[1])[0]
    vander = np.polynomial.legendre.legvander(nodes, 2)
    change = np.stack([np.zeros_like(nodes), np.ones_like(nodes), 3.0 * nodes], axis=1)
    derivative = change @ np.linalg.pinv(vander)
    scale = 2.0 / edges.widths
    return np.asarray(scale[:, None, None] * np.einsum("pq,eqd->epd", derivative, edges.basis))
