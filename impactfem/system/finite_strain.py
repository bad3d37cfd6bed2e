"""Internal forces, tangents and energies of a body under finite strain, assembled by DOLFINx."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.fem import MPI, dolfinx_fem, ufl
from impactfem.forms.elasticity import ElasticForms
from impactfem.forms.finite_strain import LAWS, FiniteForms, Law
from impactfem.system.following import FollowingPressures
from impactfem.system.materials import constants_of, materials_of
from impactfem.system.matrices import body_forms
from impactfem.system.mean_dilatation import CondensedMatrix, MeanDilatation
from impactfem.system.nodes import Nodes
from impactfem.system.point_memory import PointMemory, TermPlaces
from impactfem.system.point_stress import PointStress
from impactfem.system.step_solvers import RenewedSolver


def finite_forms(
    nodes: Nodes, forms: ElasticForms, solid: Any, viscosity: Any = 0.0,
    memory: PointMemory | None = None,
) -> FiniteForms:  # fmt: skip
    """Forms of a solid with ``strain = "finite"``, by those that linear elasticity has of it."""
    cells = dolfinx_fem.functionspace(forms.space.mesh, ("Discontinuous Lagrange", 0))
    pressing = dolfinx_fem.Function(cells) if solid.keeps_volume else None
    law = _law(nodes, forms, solid)
    if not solid.materials:
        # A number where it is 0: the compiled code has no more terms than it needs.
        c01 = dolfinx_fem.Constant(forms.space.mesh, solid.c01) if solid.c01 else 0.0
        return FiniteForms(forms, law, c01, viscosity, pressing, memory=memory)
    made, material = constants_of(nodes, solid), materials_of(nodes, solid)
    local = made(material.local) if solid.keeps_volume else None
    damped = made(material.damped)
    c01 = made(material.c01)
    return FiniteForms(forms, law, c01, viscosity, pressing, local, damped, memory)


def _law(nodes: Nodes, forms: ElasticForms, solid: Any) -> type[Law] | PointStress:
    """The law of a body: by forms where they know it, of one law everywhere, else by points."""
    names = {each.material for each in (solid.of_groups or {"": solid}).values()}
    laws = {LAWS.get(name) for name in names}
    law = laws.pop()
    if laws or law is None or solid.is_orthotropic or solid.model == "plane_stress":
        return PointStress(nodes, solid, forms.degree)
    return law


def mean_dilatation(
    nodes: Nodes, forms: FiniteForms, solid: Any, before: Any, after: Any
) -> MeanDilatation | None:
    """What sets the pressures of nearly incompressible cells in a step (collective); else None."""
    if forms.pressing is None:
        return None
    topology = nodes.space.mesh.topology
    owned = topology.index_map(topology.dim).size_local
    own = materials_of(nodes, solid).at(slice(owned))
    return MeanDilatation(forms, before, after, own.bulk, own.damped)


def shown(
    nodes: Nodes,
    elastic: ElasticForms,
    solid: Any,
    memory: PointMemory | TermPlaces | None,
    displacement: Any,
) -> tuple[Any, Any]:
    """Fields of a displacement as `ElasticForms.fields`, and what is called before they are read.

    Args:
        nodes: Nodes of the body.
        elastic: Forms of linear elasticity.
        solid: The body.
        memory: What its Maxwell terms remember, where displacements do not say it.
        displacement: Function of the space.
    """
    if isinstance(memory, TermPlaces):
        return elastic.fields(displacement, memory.terms), memory.refresh
    if not solid.is_finite:
        return elastic.fields(displacement), None
    forms = finite_forms(nodes, elastic, solid, memory=memory)
    # Amid a step terms have weights; what is shown lies between two steps.
    still = replace(forms, memory=None)
    mean = mean_dilatation(nodes, still, solid, displacement, displacement)
    points = _points(forms)

    def refresh() -> None:
        if mean is not None:
            mean.update(0.0 if memory is None else memory.held)
        if points is not None:
            points.update(displacement, displacement, slopes=False)

    return forms.fields(displacement), refresh


def _points(forms: FiniteForms) -> PointStress | None:
    """What a law says at points, where forms do not know it."""
    return forms.law if isinstance(forms.law, PointStress) else None


class FiniteStrain:
    """What a body under finite strain does in a step between two displacements.

    Vectors hold the owned degrees of freedom; nothing is held here, supports are the caller's.

    Attributes:
        arms_stay: Whether forces have no moment with the arms of the undeformed body, instead of
            the mean ones of the step.
    """

    arms_stay = False

    def __init__(
        self,
        nodes: Nodes,
        solid: Any,
        following: FollowingPressures,
        memory: PointMemory | None = None,
    ) -> None:
        """Compile the forms (collective).

        Args:
            nodes: Nodes of the body.
            solid: `impactfem.scene.solids.Solid` with ``strain = "finite"``.
            following: Its pressures that follow the surface.
            memory: Of its Maxwell terms, if others look at it too; it is cleared.
        """
        space = nodes.space
        self._comm = nodes.comm
        self._viscosity = dolfinx_fem.Constant(space.mesh, 0.0)
        elastic = body_forms(nodes, solid)
        self._memory = memory if solid.relaxing else None
        if self._memory is not None:
            self._memory.forget()
        elif solid.relaxing:
            self._memory = PointMemory(nodes, solid, elastic.degree)
        forms = finite_forms(nodes, elastic, solid, self._viscosity, self._memory)
        self._before, self._after = dolfinx_fem.Function(space), dolfinx_fem.Function(space)
        self._mean = mean_dilatation(nodes, forms, solid, self._before, self._after)
        self._points = _points(forms)
        self._stiffening = forms.stiffening(self._before, self._after)
        force = forms.force(self._before, self._after)
        self._force, self._internal = fem.compile_form(force), force
        self._following, self._pressure = following, None
        if following.any:
            pressure = following.form(forms, self._before, self._after)
            self._pressure = fem.compile_form(pressure)
            force -= pressure
        tangent = ufl.derivative(force, self._after) + self._stiffening
        self._tangent = fem.compile_form(tangent)
        self._energy = fem.compile_form(forms.energy(self._after))
        self._remembered = None if self._memory is None else fem.compile_form(forms.remembered())
        self._inverted = fem.compile_form(forms.inverted(self._after))

    def retard(self, retardation: float, step: float) -> None:
        """Take a time of retardation (Kelvin and Voigt) and a time step [s] from now on."""
        self._viscosity.value = retardation / step
        if self._memory is not None:
            self._memory.begin(step)

    def settle(self, before: Floats, after: Floats) -> None:
        """Take Maxwell terms to the end of a step (collective)."""
        if self._memory is None:
            return
        self._put_both(before, after, slopes=False)
        swept = None if self._mean is None else self._mean.swept()
        self._memory.settle(self._before, self._after, swept)

    def memory(self) -> dict[str, Floats]:
        """What it remembers at points, the same on all ranks (collective)."""
        return {} if self._memory is None else self._memory.memory()

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        if self._memory is not None:
            self._memory.remember(memory)

    def straining(self, displacement: Floats) -> Floats:
        """The displacement itself."""
        return displacement

    def state(self) -> dict[str, Floats]:
        """Nothing."""
        return {}

    def restore(self, state: Mapping[str, Floats]) -> None:
        """Nothing."""

    def force(self, before: Floats, after: Floats) -> Floats:
        """Forces of the nodes on the body in a step [N], (owned dofs,) (collective)."""
        self._put_both(before, after, slopes=False)
        return fem.assemble_vector(self._force)

    def press(self, start: float, end: float) -> None:
        """Begin a step: take the mean of pressures that follow at two times [s] (collective)."""
        self._following.put(start, end)
        if self._mean is not None:
            self._mean.forget()

    def pressed(self, before: Floats, after: Floats) -> Floats:
        """Forces of these pressures on the nodes in a step [N], (owned dofs,) (collective)."""
        if self._pressure is None:
            return np.zeros(len(before))
        self._put_both(before, after, slopes=False)
        return fem.assemble_vector(self._pressure)

    @cached_property
    def _stiffness(self) -> Any:
        """Compiled where it is asked for: without pressures it is the tangent."""
        if self._pressure is None:
            return self._tangent
        tangent = ufl.derivative(self._internal, self._after) + self._stiffening
        return fem.compile_form(tangent)

    def tangent(self, before: Floats, after: Floats, *, pressed: bool = True) -> Any:
        """Derivative of `force`, less `pressed` unless told otherwise, by ``after`` [N/m].

        A new PETSc matrix, not symmetric (collective).
        """
        self.put(before, after)
        if self._mean is not None:
            self._mean.linearise()
        matrix = fem.assemble_petsc(self._tangent if pressed else self._stiffness)
        if self._mean is not None:
            self._mean.stiffen(matrix, np.zeros(len(before), dtype=bool))
        return matrix

    def step_solver(
        self,
        mass: Any,
        held: NDArray[np.bool_],
        dt: float,  # noqa: ARG002  (of tangents that stay)
        damping: tuple[float, float],
        kind: str,
        near: Any,
    ) -> RenewedSolver:
        """What solves with that tangent in steps, with inertia and damping by mass (collective).

        Args:
            mass: PETSc matrix.
            held: Owned dofs that supports hold.
            dt: Length of a layer [s].
            damping: By mass [1/s] and by stiffness [s]; see `retard` for the second.
            kind: "mumps" or "gamg".
            near: PETSc null space of rigid motions.
        """
        matrix = fem.RepeatedMatrix(self._tangent, mass, held)
        mean = self._mean
        tangent = matrix if mean is None else CondensedMatrix(matrix, mean, held)
        return RenewedSolver(tangent, damping[0], kind, near)

    def destroy(self) -> None:
        """Nothing: what is assembled belongs to the solver."""

    def put(self, before: Floats, after: Floats) -> None:
        """Set both ends of a step, of which a repeated tangent is assembled (collective)."""
        self._put_both(before, after, slopes=True)

    def _put_both(self, before: Floats, after: Floats, *, slopes: bool) -> None:
        self._put(self._before, before)
        self._put(self._after, after)
        if self._mean is not None:
            self._mean.update()
        if self._points is not None:
            self._points.update(self._before, self._after, slopes=slopes)

    def energy(self, displacement: Floats) -> float:
        """Elastic energy of the cells of this rank [J] (collective)."""
        self._put(self._after, displacement)
        cells = 0.0 if self._mean is None else self._mean.energy()
        if self._remembered is not None:
            cells += float(dolfinx_fem.assemble_scalar(self._remembered))
        if self._points is not None:
            return cells + self._points.energy(self._after)
        return cells + float(dolfinx_fem.assemble_scalar(self._energy))

    def is_inverted(self, displacement: Floats) -> bool:
        """Whether a cell is turned inside out, or a number is not finite (collective)."""
        self._put(self._after, displacement)
        bad = not float(dolfinx_fem.assemble_scalar(self._inverted)) == 0.0  # noqa: SIM201  (NaN)
        bad = bad or not np.isfinite(displacement).all()
        return bool(self._comm.allreduce(bad, op=MPI.LOR))

    @staticmethod
    def _put(function: Any, values: Floats) -> None:
        function.x.array[: len(values)] = values
        function.x.scatter_forward()
