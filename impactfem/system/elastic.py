"""What time schemes see of an elastic body: M u'' + C u' + K u = f(t) with supports."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.errors import MeshError, SceneError
from impactfem.fem import MPI
from impactfem.forms.elasticity import ElasticForms
from impactfem.mesh.body import BodyMesh
from impactfem.scene import Formula
from impactfem.system.finite_strain import shown
from impactfem.system.following import FollowingPressures
from impactfem.system.loads import Loads
from impactfem.system.matrices import BodyMatrices, body_forms, body_matrices
from impactfem.system.nodes import Nodes, body_nodes
from impactfem.system.point_memory import PointMemory, TermPlaces
from impactfem.system.relaxation import Relaxation
from impactfem.system.stress import NodalFields
from impactfem.system.supports import Supports, find_supports

_AXES = "xyz"


@dataclass(frozen=True)
class ElasticSystem:
    """An elastic body after discretisation in space, on this rank.

    Vectors hold the owned degrees of freedom, node by node (dim * node + direction). Constrained
    ones keep their place: their rows and columns are empty in the mass, and in the stiffness but
    for 1 on the diagonal; they get no load and follow `prescribed`.

    Attributes:
        nodes: Nodes of the displacements.
        supports: What is held and moved.
        matrices: Mass and stiffness.
        loads: Gravity, tractions and pressures, but for those that follow.
        following: Pressures that act on the surface as it is by then.
        lumped: Row sums of the mass [kg], 0 where constrained, shape (owned dofs,); None where
            not all are positive, as with simplices of degree 2.
        node_mass: Row sums of the mass without supports [kg], shape (owned nodes,).
        displacement: Displacement at t = 0 [m], shape (owned dofs,).
        velocity: Velocity at t = 0 [m/s], shape (owned dofs,).
        rayleigh_mass: Damping C = rayleigh_mass M + rayleigh_stiffness K [1/s].
        rayleigh_stiffness: [s].
        relaxation: Maxwell terms; see there.
        fields: Stress, under finite strain strain too, at the nodes.
        memory: `impactfem.system.point_memory.PointMemory` or `TermPlaces` of Maxwell terms whose
            stress displacements do not say: the march moves it, fields show it; else None.
        axisymmetric: Whether x is the distance from the axis: then the whole body's momentum and
            mean displacement along x are zero, and its centre of mass lies on the axis.
    """

    nodes: Nodes
    supports: Supports
    matrices: BodyMatrices
    loads: Loads
    following: FollowingPressures
    lumped: Floats | None
    node_mass: Floats
    displacement: Floats
    velocity: Floats
    rayleigh_mass: float
    rayleigh_stiffness: float
    relaxation: Relaxation
    fields: NodalFields
    axisymmetric: bool = False
    memory: Any = None

    @property
    def comm(self) -> Any:
        """MPI communicator."""
        return self.nodes.comm

    @property
    def dim(self) -> int:
        """Number of directions."""
        return self.nodes.dim

    @property
    def num_dofs(self) -> int:
        """Degrees of freedom of the whole body."""
        return int(self.nodes.space.dofmap.index_map.size_global) * self.dim

    @property
    def stiffness(self) -> Any:
        """PETSc matrix K [N/m]."""
        return self.matrices.stiffness

    @property
    def mass(self) -> Any:
        """PETSc matrix M of the consistent mass [kg]."""
        return self.matrices.mass

    @property
    def constrained(self) -> NDArray[np.bool_]:
        """Whether each owned degree of freedom is held or moved."""
        return self.supports.constrained

    @property
    def positions(self) -> Floats:
        """Undeformed places of the owned nodes [m], shape (owned nodes, dim)."""
        return self.nodes.positions[: self.nodes.owned]

    @property
    def numbers(self) -> NDArray[np.int64]:
        """Canonical numbers of the owned nodes, the same for any number of ranks."""
        return self.nodes.numbers[: self.nodes.owned]

    @cached_property
    def total_mass(self) -> float:
        """Mass of the body [kg]."""
        return float(self.comm.allreduce(float(self.node_mass.sum()), op=MPI.SUM))

    def mean(self, field: Floats) -> Floats:
        """Mean of a field of the owned dofs by mass, shape (dim,) (collective).

        Of a displacement it is that of the centre of mass.
        """
        return self.momentum(field) / self.total_mass

    def momentum(self, velocity: Floats) -> Floats:
        """Linear momentum [kg m/s], shape (dim,), for both masses (collective)."""
        momentum = np.asarray(
            self.comm.allreduce(self.node_mass @ velocity.reshape(-1, self.dim), op=MPI.SUM)
        )
        if self.axisymmetric:
            momentum[0] = 0.0
        return momentum

    @cached_property
    def adrift(self) -> Floats:
        """1 for directions in which the body moves without strain, else 0, (dim,) (collective)."""
        held = self.constrained.reshape(-1, self.dim).any(axis=0)
        held[0] |= self.axisymmetric
        return np.where(self.comm.allreduce(held.astype(np.int64), op=MPI.SUM) > 0, 0.0, 1.0)

    def carried(self, field: Floats) -> Floats:
        """Mean translation in a field of the owned dofs that strains nothing, (dim,) (collective).

        Products with K of what is large by it lose as many digits: K annihilates it to rounding.
        """
        return self.adrift * self.mean(field)

    @property
    def center_of_mass(self) -> Floats:
        """Undeformed centre of mass [m], shape (dim,) (collective)."""
        return self.mean(self.positions.ravel())

    def load(
        self,
        t: float,
        out: Floats | None = None,
        *,
        lumped: bool = False,
        start: float | None = None,
    ) -> Floats:
        """Forces on the free degrees of freedom at time t [N], 0 at constrained ones (collective).

        Gravity, tractions and pressures, and what moved supports do to the rest: with their
        displacement u_d, -K_fd u_d - C_fd u_d' - M_fd u_d''.

        Args:
            t: Time [s].
            out: Array that takes the forces; absent: a new one.
            lumped: Whether the scheme's mass is the lumped one, for which M_fd = 0.
            start: Mean gravity of the time from here to t is taken instead of that at t, as the
                impulse of a time step needs.

        Raises:
            SceneError: A formula has no finite value at that time.
        """
        forces = np.empty(len(self.constrained)) if out is None else out
        gravity = None if start is None else self.loads.mean_gravity(start, t)
        self.loads.at(t, forces, gravity)
        if self.matrices.moved_stiffness is not None:
            u, v, a = self.supports.motion(t, inertia=not lumped)
            alpha, beta = self.rayleigh_mass, self.rayleigh_stiffness
            forces -= _product(self.matrices.moved_stiffness, u + beta * v)
            if not lumped:
                forces -= _product(self.matrices.moved_mass, a + alpha * v)
        forces[self.constrained] = 0.0
        return forces

    def elastic_energy(self, displacement: Floats) -> float:
        """Elastic energy [J], with that of moved supports (collective)."""
        return self._energy(self.stiffness, self.matrices.moved_stiffness, displacement)

    def kinetic_energy(self, velocity: Floats, *, lumped: bool = False) -> float:
        """Kinetic energy [J], with that of moved supports (collective)."""
        if lumped:
            own = 0.5 * float(self.node_mass @ np.sum(velocity.reshape(-1, self.dim) ** 2, axis=1))
            return float(self.comm.allreduce(own, op=MPI.SUM))
        return self._energy(self.mass, self.matrices.moved_mass, velocity)

    def _energy(self, matrix: Any, moved: Any, x: Floats) -> float:
        """Half of x^T A x with the whole matrix A; what is held but not moved counts as zero."""
        free = np.where(self.constrained, 0.0, x)
        own = 0.5 * float(free @ _product(matrix, free))
        if moved is not None:
            with_moved = _product(moved, x[self.supports.moved])
            shares = np.where(self.constrained, 0.5 * x, x)
            own += float(shares @ with_moved)
        return float(self.comm.allreduce(own, op=MPI.SUM))

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for part in (self.matrices, self.loads, self.fields):
            part.destroy()


def elastic_system(solid: Any, gravity: Any, body: BodyMesh) -> ElasticSystem:
    """Discretise a solid in space, with elements of the degree of the mesh's geometry (collective).

    Initial displacement and velocity take the values of their formulas at the nodes: a constant
    velocity has its exact momentum, and so has a rotation, about the centre of mass of the mesh.
    Constrained degrees of freedom start as their supports say.

    Args:
        solid: `impactfem.scene.solids.Solid`.
        gravity: `PiecewiseVector` [m/s^2].
        body: Its mesh.

    Raises:
        MeshError: The mesh does not fit the supports or loads, or a mass is not positive.
        SceneError: A formula has no finite value, or two supports contradict each other.
    """
    nodes = body_nodes(body)
    axisymmetric = solid.model == "axisymmetric"
    supports = find_supports(nodes, body.surfaces, solid.all_supports, axisymmetric=axisymmetric)
    forms = body_forms(nodes, solid)
    loads = Loads(nodes, forms, body.surfaces, solid, gravity)
    node_mass = loads.body_forces[0, :: nodes.dim].copy()
    lumped = _lumped(nodes, forms, node_mass, supports)
    displacement, velocity = _initial_state(nodes, supports, solid, node_mass)
    memory: Any = None
    if solid.remembered:
        finite = solid.is_finite
        memory = PointMemory(nodes, solid, forms.degree) if finite else TermPlaces(nodes, solid)
    return ElasticSystem(
        nodes=nodes,
        supports=supports,
        matrices=body_matrices(nodes, forms, supports, keeps_volume=solid.keeps_volume),
        loads=loads,
        following=FollowingPressures(nodes, body.surfaces, solid),
        lumped=lumped,
        node_mass=node_mass,
        displacement=displacement,
        velocity=velocity,
        rayleigh_mass=solid.rayleigh_mass,
        rayleigh_stiffness=solid.retardation,
        relaxation=Relaxation.of(() if solid.remembered else solid.relaxing),
        fields=NodalFields(nodes, forms, partial(shown, nodes, forms, solid, memory)),
        axisymmetric=axisymmetric,
        memory=memory,
    )


def _lumped(
    nodes: Nodes, forms: ElasticForms, node_mass: Floats, supports: Supports
) -> Floats | None:
    """Lumped mass, if all row sums are positive (collective).

    Raises:
        MeshError: They are not, though the elements are linear.
    """
    largest = nodes.comm.allreduce(float(node_mass.max(initial=0.0)), op=MPI.MAX)
    bad = np.flatnonzero(~(node_mass > 1e-14 * largest))
    linear = int(forms.space.ufl_element().degree) == 1
    if not nodes.comm.allreduce(bad.size, op=MPI.SUM):
        return np.where(supports.constrained, 0.0, np.repeat(node_mass, nodes.dim))
    error = None
    if bad.size and linear:
        place = ", ".join(f"{x:g}" for x in nodes.positions[bad[0]])
        error = MeshError(
            f"the node at ({place}) has the mass {node_mass[bad[0]]:g} kg, which must be positive: "
            "elements around it are turned inside out or have no volume; mesh the body anew"
        )
    fem.raise_together(nodes.comm, error)
    return None


def _initial_state(
    nodes: Nodes, supports: Supports, solid: Any, node_mass: Floats
) -> tuple[Floats, Floats]:
    displacement = _nodal(nodes, solid.displacement, "displacement")
    velocity = _nodal(nodes, solid.velocity, "velocity")
    x = nodes.positions[: nodes.owned]
    own = np.append(node_mass @ x, node_mass.sum())
    sums = np.asarray(nodes.comm.allreduce(own, op=MPI.SUM))
    arm = x - sums[:-1] / sums[-1]
    spin = np.asarray(solid.angular_velocity, dtype=np.float64)
    if nodes.dim == 2:
        velocity += spin * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    else:
        velocity += np.cross(spin, arm)
    u, v = displacement.ravel(), velocity.ravel()
    u[supports.constrained] = 0.0
    v[supports.constrained] = 0.0
    u[supports.moved], v[supports.moved], _ = supports.motion(0.0)
    return u, v


def _nodal(nodes: Nodes, formulas: Sequence[Formula], what: str) -> Floats:
    """Values of formulas at the owned nodes, shape (owned nodes, dim) (collective).

    Raises:
        SceneError: A value is not finite.
    """
    x = nodes.positions[: nodes.owned]
    variables = {name: x[:, axis] for axis, name in enumerate(_AXES[: nodes.dim])}
    values = np.stack([np.asarray(formula(**variables)) for formula in formulas], axis=1)
    bad = np.argwhere(~np.isfinite(values))
    error = None
    if len(bad):
        node, direction = bad[0]
        place = ", ".join(f"{c:g}" for c in x[node])
        error = SceneError(
            f"the initial {what} along {_AXES[direction]}, {formulas[direction].text!r}, is "
            f"{values[node, direction]} at the node ({place}); give a formula that is finite in "
            "the whole body"
        )
    fem.raise_together(nodes.comm, error)
    return values


def _product(matrix: Any, x: Floats) -> Floats:
    """Product of a matrix and a vector of this rank's entries (collective)."""
    source, image = matrix.createVecs()
    source.array_w[:] = x
    matrix.mult(source, image)
    result: Floats = image.array_r.copy()
    source.destroy()
    image.destroy()
    return result
