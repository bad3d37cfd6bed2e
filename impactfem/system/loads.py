"""Loads of a body: gravity, and tractions and pressures given by formulas."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Booleans, Floats
from impactfem.errors import SceneError
from impactfem.fem import MPI, PETSc, dolfinx_fem
from impactfem.forms.elasticity import ElasticForms
from impactfem.scene import Formula
from impactfem.scene.means import mean_of
from impactfem.system.nodes import Nodes
from impactfem.system.supports import surface_facets

_AXES = "xyz"
_VALUES = 100_000  # of a formula that are looked at together


class FormulaValues:
    """A formula of place and time at some places of a surface, or of another whole.

    Attributes:
        formula: In x, y, z, t and others.
        label: What it is, for messages.
    """

    def __init__(
        self, formula: Formula, label: str, places: Floats, comm: Any, whole: str = "surface"
    ) -> None:
        """Take the places of this rank.

        Args:
            formula: In x, y, z and t.
            label: What it is, for messages.
            places: [m], shape (count, dim).
            comm: MPI communicator.
            whole: Of what the places are, for messages.
        """
        self.formula, self.label, self._comm, self._whole = formula, label, comm, whole
        self._points = dict(zip(_AXES, np.ascontiguousarray(places.T), strict=False))

    @cached_property
    def is_steady(self) -> bool:
        """Whether the formula does not use t."""
        return "t" not in self.formula.used

    @cached_property
    def uses_gap(self) -> bool:
        """Whether the formula uses the gap to an obstacle."""
        return "gap" in self.formula.used

    def some(self, count: int) -> list[dict[str, float]]:
        """Coordinates of at most so many places, of all ranks; one without any if all are alike."""
        names = [name for name in self._points if name in self.formula.used]
        if not names:
            return [{}]
        own = np.stack([self._points[name] for name in names], axis=1)
        every = np.unique(np.concatenate(self._comm.allgather(own)), axis=0)
        chosen = np.linspace(0, len(every) - 1, min(count, len(every))).round().astype(int)
        return [dict(zip(names, place, strict=True)) for place in every[chosen].tolist()]

    def mean(self, start: float, end: float, **more: Floats) -> Floats:
        """Mean values from one time to another, shape (count,) (collective).

        Args:
            start: [s].
            end: [s]; the start for the values there.
            more: Other variables, (count,) each.

        Raises:
            SceneError: One is not finite; on all ranks.
        """
        count = len(next(iter(self._points.values())))
        known = self._points | more
        values: Floats = np.broadcast_to(mean_of(self.formula, start, end, **known), count)
        self._check(values, start)
        return values

    def means(self, start: Floats, end: Floats) -> Floats:
        """The same of many steps at once, (steps, count); times (steps,) each [s]."""
        count = len(next(iter(self._points.values())))
        if not self.formula.used & set(self._points):
            one = np.asarray(mean_of(self.formula, start, end))
            return np.broadcast_to(one[:, None], (len(start), count))
        own = max(1, _VALUES // max(1, count))
        each = [slice(first, first + own) for first in range(0, len(start), own)]
        return np.concatenate(
            [mean_of(self.formula, start[k, None], end[k, None], **self._points) for k in each]
        )

    def _check(self, values: Floats, start: float) -> None:
        """Refuse values that are not finite (collective).

        Raises:
            SceneError: One is; on all ranks.
        """
        bad = np.flatnonzero(~np.isfinite(values))
        if self._comm.allreduce(bad.size, op=MPI.SUM):
            error = None
            if bad.size:
                place = ", ".join(f"{x[bad[0]]:g}" for x in self._points.values())
                error = SceneError(
                    f"the {self.label} = {self.formula.text!r} has no finite value at ({place}), "
                    f"t = {start:g} s; give a formula that is finite on the whole "
                    f"{self._whole}"
                )
            fem.raise_together(self._comm, error)


@dataclass(frozen=True)
class SurfaceLoad:
    """One formula on one surface; its nodal forces are linear in its values at some points.

    The formula is interpolated on each facet by polynomials one degree above the displacements'.

    Attributes:
        formula: At the owned points [Pa].
        matrix: PETSc matrix from values to forces, (owned dofs, owned points).
        values: PETSc vector of the values [Pa].
        forces: PETSc vector of the forces [N].
    """

    formula: FormulaValues
    matrix: Any
    values: Any
    forces: Any

    def mean(self, start: float, end: float) -> Floats:
        """Mean nodal forces [N], shape (owned dofs,): a view that the next call changes.

        Raises:
            SceneError: The formula has no finite value somewhere; on all ranks.
        """
        self.values.array_w[:] = self.formula.mean(start, end)
        self.matrix.mult(self.values, self.forces)
        forces: Floats = self.forces.array_r
        return forces

    def means(self, start: Floats, end: Floats, chosen: Booleans) -> Floats:
        """Mean forces of many steps on some of the owned dofs [N], (steps, chosen)."""
        found = []
        for values in self.formula.means(start, end):
            self.values.array_w[:] = values
            self.matrix.mult(self.values, self.forces)
            found.append(self.forces.array_r[chosen])
        return np.array(found)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for thing in (self.matrix, self.values, self.forces):
            thing.destroy()


class Loads:
    """All loads of a body, without supports.

    Attributes:
        body_forces: Nodal forces per unit of gravity along each direction [kg], shape
            (dim, owned dofs): rows sum up to the mass.
    """

    def __init__(
        self,
        nodes: Nodes,
        forms: ElasticForms,
        surfaces: Mapping[str, NDArray[np.int32]],
        solid: Any,
        gravity: Any,
    ) -> None:
        """Assemble what does not change in time (collective).

        Args:
            nodes: Nodes of the body.
            forms: Its weak forms.
            surfaces: Local facets of each named surface.
            solid: With ``tractions`` and ``pressures`` as in `impactfem.scene`; those that follow
                their surface are left out.
            gravity: `PiecewiseVector` [m/s^2].

        Raises:
            MeshError: A load names an unknown surface.
            SceneError: A formula has no finite value somewhere.
        """
        self.body_forces = unit_forces(nodes, forms)
        self._gravity = gravity
        self._constant_gravity = np.asarray(gravity.at(0.0))
        self._steady = np.zeros(self.body_forces.shape[1])
        if forms.residual is not None:
            self._steady += fem.assemble_vector(fem.compile_form(forms.residual_load))
        self._varying: list[SurfaceLoad] = []
        self._changing = np.zeros_like(self._steady)
        self._time: tuple[float, float] | None = None
        for load in _surface_loads(nodes, forms, surfaces, solid):
            if load.formula.is_steady:
                self._steady += load.mean(0.0, 0.0)
                load.destroy()
            else:
                self._varying.append(load)

    @property
    def varying(self) -> list[FormulaValues]:
        """Formulas that change in time."""
        return [load.formula for load in self._varying]

    @property
    def reached(self) -> Booleans:
        """Owned dofs on which tractions, pressures and residual stress act, (owned dofs,)."""
        found: Booleans = self._steady != 0.0
        for load in self._varying:
            found |= np.diff(load.matrix.getValuesCSR()[0]) > 0
        return found

    @property
    def is_steady(self) -> bool:
        """Whether nothing but gravity can change in time."""
        return not self._varying

    def at(self, t: float, out: Floats, gravity: Floats | None = None) -> Floats:
        """Put nodal forces [N] at time t into ``out``; see `mean`."""
        return self.mean(t, t, out, gravity)

    def mean(self, start: float, end: float, out: Floats, gravity: Floats | None = None) -> Floats:
        """Put mean nodal forces [N] into ``out``, shape (owned dofs,), and return it.

        Args:
            start: Of the time [s].
            end: Its end [s].
            out: Array for the forces.
            gravity: Taken instead of the mean one [m/s^2], shape (dim,).

        Raises:
            SceneError: A formula has no finite value somewhere.
        """
        acceleration = self.mean_gravity(start, end) if gravity is None else gravity
        np.copyto(out, self._steady)
        for g, forces in zip(acceleration, self.body_forces, strict=True):
            if g != 0.0:
                out += g * forces
        if self._varying:
            self._update(start, end)
            out += self._changing
        return out

    def means(self, start: Floats, end: Floats, chosen: Booleans) -> Floats:
        """Mean forces of many steps without gravity on some of the owned dofs [N] (collective).

        Args:
            start: Of the steps [s], (steps,).
            end: [s], (steps,).
            chosen: Which dofs, (owned dofs,).

        Returns:
            Of shape (steps, chosen).
        """
        found = np.tile(self._steady[chosen], (len(start), 1))
        for load in self._varying:
            found += load.means(start, end, chosen)
        return found

    def _update(self, start: float, end: float) -> None:
        """Evaluate the loads that change in time, unless this was their last time."""
        if (start, end) == self._time:
            return
        self._time = None  # an error below must not leave a mixture for the next call
        self._changing[:] = 0.0
        for load in self._varying:
            self._changing += load.mean(start, end)
        self._time = start, end

    def mean_gravity(self, start: float, end: float) -> Floats:
        """Mean gravity [m/s^2] from one time to another, shape (dim,)."""
        if self._gravity.is_constant:  # asked for in every layer
            return self._constant_gravity
        return np.asarray(self._gravity.mean(start, end))

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for load in self._varying:
            load.destroy()


def unit_forces(nodes: Nodes, forms: ElasticForms) -> Floats:
    """Row sums of the mass along each direction [kg], shape (dim, owned dofs)."""
    direction = dolfinx_fem.Constant(nodes.space.mesh, np.zeros(nodes.dim))
    form = fem.compile_form(forms.nodal_mass(direction))
    rows = []
    for axis in np.eye(nodes.dim):
        direction.value[:] = axis
        rows.append(fem.assemble_vector(form))
    return np.array(rows)


def _surface_loads(
    nodes: Nodes, forms: ElasticForms, surfaces: Mapping[str, NDArray[np.int32]], solid: Any
) -> list[SurfaceLoad]:
    if not solid.tractions and not solid.pressures:
        return []
    mesh = nodes.space.mesh
    degree = int(nodes.space.ufl_element().degree) + 1
    space = dolfinx_fem.functionspace(mesh, ("Discontinuous Lagrange", degree))
    loads = []
    for traction in solid.tractions:
        facets = surface_facets(surfaces, traction.surface, "traction")
        for axis, formula in enumerate(traction.acting):
            if not (formula.is_constant and formula() == 0.0):
                label = f"{_AXES[axis]} traction on {traction.surface!r}"
                along = dolfinx_fem.Constant(mesh, np.eye(nodes.dim)[axis])
                form = forms.surface_load(space, fem.tag_facets(mesh, facets), along)
                loads.append(_surface_load(nodes, space, facets, form, formula, label))
    for pressure in solid.pressures:
        if pressure in solid.following:
            continue
        facets = surface_facets(surfaces, pressure.surface, "pressure")
        label = f"pressure on {pressure.surface!r}"
        form = forms.surface_load(space, fem.tag_facets(mesh, facets))
        loads.append(_surface_load(nodes, space, facets, form, pressure.acting, label))
    return loads


def _surface_load(
    nodes: Nodes, space: Any, facets: NDArray[np.int32], form: Any, formula: Formula, label: str
) -> SurfaceLoad:
    """Assemble the matrix of a load, with columns for cells at its surface only (collective)."""
    whole = fem.assemble_petsc(fem.compile_form(form))
    mesh = nodes.space.mesh
    owned_cells = mesh.topology.index_map(mesh.topology.dim).size_local
    cells = np.unique(nodes.cells_of(facets)[0])
    used = np.unique(space.dofmap.list[cells[cells < owned_cells]].ravel())
    first, last = whole.getOwnershipRange()
    first_column = whole.getOwnershipRangeColumn()[0]
    rows = PETSc.IS().createStride(last - first, first, 1, comm=whole.comm)
    columns = PETSc.IS().createGeneral((used + first_column).astype(PETSc.IntType), whole.comm)
    matrix = whole.createSubMatrix(rows, columns)
    for thing in (whole, rows, columns):
        thing.destroy()
    values, forces = matrix.createVecs()
    places = space.tabulate_dof_coordinates()[used, : nodes.dim]
    return SurfaceLoad(FormulaValues(formula, label, places, nodes.comm), matrix, values, forces)
