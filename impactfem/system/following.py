"""Pressures that act on the surface of a body as it is by then."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.fem import dolfinx_fem
from impactfem.forms.finite_strain import FiniteForms, StVenantKirchhoff
from impactfem.system.loads import FormulaValues
from impactfem.system.matrices import body_forms
from impactfem.system.nodes import Nodes
from impactfem.system.supports import surface_facets


class FollowingPressures:
    """Pressures of a solid as functions, and the form of their forces.

    Attributes:
        any: Whether there are any.
    """

    def __init__(self, nodes: Nodes, surfaces: Mapping[str, NDArray[np.int32]], solid: Any) -> None:
        """Find the facets (collective).

        Args:
            nodes: Nodes of the body.
            surfaces: Local facets of each named surface.
            solid: `impactfem.scene.solids.Solid`.

        Raises:
            MeshError: A pressure names an unknown surface.
        """
        self._values: list[tuple[Any, FormulaValues, NDArray[np.int64]]] = []
        # Facets may belong to several surfaces: no tags, which hold one number for each.
        self._facets: list[tuple[int, NDArray[np.int32]]] = []
        self.any = bool(solid.following)
        mesh = nodes.space.mesh
        owned = mesh.topology.index_map(mesh.topology.dim).size_local
        degree = int(nodes.space.ufl_element().degree) + 1
        for load in solid.following:
            space = dolfinx_fem.functionspace(mesh, ("Discontinuous Lagrange", degree))
            facets = surface_facets(surfaces, load.surface, "pressure")
            cells, sides = nodes.cells_of(facets)
            cells, sides = cells[cells < owned], sides[cells < owned]
            used = np.unique(space.dofmap.list[np.unique(cells)].ravel()).astype(np.int64)
            label = f"pressure on {load.surface!r}"
            places = space.tabulate_dof_coordinates()[used, : nodes.dim]
            values = FormulaValues(load.acting, label, places, nodes.comm)
            self._values.append((dolfinx_fem.Function(space), values, used))
            pairs = np.stack([cells, sides], axis=1).ravel().astype(np.int32)
            self._facets.append((len(self._facets) + 1, pairs))

    def put(self, start: float, end: float) -> None:
        """Take the means of their values between two times [s] (collective).

        Raises:
            SceneError: A formula has no finite value somewhere; on all ranks.
        """
        for function, values, used in self._values:
            function.x.array[used] = values.mean(start, end)

    @property
    def values(self) -> list[FormulaValues]:
        """Their formulas."""
        return [values for _, values, _ in self._values]

    @property
    def largest(self) -> float:
        """The largest of their values on this rank [Pa]."""
        each = (function.x.array for function, _, _ in self._values)
        return max((float(np.abs(values).max(initial=0.0)) for values in each), default=0.0)

    def form(self, forms: FiniteForms, before: Any, after: Any) -> Any:
        """Linear form of their forces in a step between two displacements; there must be any."""
        each = (
            forms.pressure(
                before, after, value, forms.elastic.surface_measure(self._facets, number)
            )
            for (value, _, _), (number, _) in zip(self._values, self._facets, strict=True)
        )
        return sum(each)


class LevelPressures:
    """Forces of pressures that follow a surface, where a displacement has it."""

    def __init__(
        self, nodes: Nodes, solid: Any, following: FollowingPressures, displacement: Any
    ) -> None:
        """Compile the form (collective).

        Args:
            nodes: Nodes of the body.
            solid: `impactfem.scene.solids.Solid` with ``strain = "finite"``.
            following: Its pressures, of which there are some.
            displacement: Function of the nodes' space; its ghosts are up to date.
        """
        forms = FiniteForms(body_forms(nodes, solid), StVenantKirchhoff, 0.0, 0.0)  # no law acts
        self._following = following
        self._form = fem.compile_form(following.form(forms, displacement, displacement))

    def put(self, start: float, end: float) -> None:
        """Take the means of their values between two times [s] (collective)."""
        self._following.put(start, end)

    @property
    def largest(self) -> float:
        """The largest value on this rank [Pa]."""
        return self._following.largest

    def forces(self) -> Floats:
        """Forces on the owned dofs [N] (collective)."""
        return fem.assemble_vector(self._form)
