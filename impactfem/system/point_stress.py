"""Stress of laws that are evaluated point by point, for the weak forms of finite strain."""

from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.fem import dolfinx_fem
from impactfem.system.element_tables import tabulated
from impactfem.system.materials import law_rows, materials_of
from impactfem.system.nodes import Nodes
from impactfem.system.point_kernels import step_stress, stored


class PointStress:
    """What laws say at the points of the quadrature, of the cells of this rank.

    Attributes:
        stress: Function of points: S of a step [Pa], n components, xx, yy, zz, xy, yz, zx or the
            first four.
        slopes: The same of its derivatives by the strain at the end of the step, (n, n).
        across: The same of the strain zz at the end.
    """

    def __init__(self, nodes: Nodes, solid: Any, degree: int) -> None:
        """Tabulate shape functions (collective).

        Args:
            nodes: Nodes of the body.
            solid: `impactfem.scene.solids.Solid`.
            degree: Of the quadrature of the forms.
        """
        mesh, count = nodes.space.mesh, 6 if nodes.dim == 3 else 4
        self._cells, *table, self._weights = tabulated(nodes, solid, degree)
        self._table, self._hoop = table
        own = materials_of(nodes, solid).at(slice(len(self._cells)))
        self._material = law_rows(own, solid, own.local)
        self.stress, self.slopes, self.across = (
            dolfinx_fem.Function(fem.point_space(mesh, degree, shape))
            for shape in ((count,), (count, count), ())
        )
        places = self.across.function_space.dofmap.list[: len(self._cells)]
        self._shape = places.shape
        self._first = places.ravel()
        self._values = [np.zeros((*places.shape, n)) for n in (count, count * count)]
        self._across = np.zeros(places.shape)
        self._dim = nodes.dim

    def update(self, before: Any, after: Any, *, slopes: bool) -> None:
        """Set the functions of a step.

        Args:
            before: Displacement at its start, a function whose ghosts are up to date.
            after: The same at its end.
            slopes: Whether derivatives are asked for.
        """
        ends = (each.x.array.reshape(-1, self._dim) for each in (before, after))
        wanted = self._values[1] if slopes else np.zeros((0, 0, 0))
        step_stress(
            self._material, *ends, self._cells, self._table, self._hoop, self._values[0], wanted,
            self._across,
        )  # fmt: skip
        self._put(self.stress, self._values[0])
        self._put(self.across, self._across)
        if slopes:
            self._put(self.slopes, self._values[1])

    def energy(self, displacement: Any) -> float:
        """Elastic energy of the cells of this rank [J]."""
        u = displacement.x.array.reshape(-1, self._dim)
        data = self._cells, self._table, self._hoop, self._weights
        return float(stored(self._material, u, *data))

    def _put(self, function: Any, values: Floats) -> None:
        size = values.size // max(len(self._first), 1)
        function.x.array.reshape(-1, max(size, 1))[self._first] = values.reshape(-1, max(size, 1))
