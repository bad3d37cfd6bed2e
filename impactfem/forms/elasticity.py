"""Weak forms of linear elasticity: plane strain, plane stress, axisymmetric, 3D.

Per unit of the reference measure ``weight`` dx, which is the thickness for plane models, 2 pi r for
axisymmetric ones (x = r, y = axis; everything then holds for the whole circumference) and 1 in 3D:

    rho u_tt - div sigma = b,   sigma = lambda tr(eps) I + 2 mu eps,

or sigma = C : eps with a stiffness of less symmetry, all directions of which are in C.

Nearly incompressible bodies (`impactfem.scene.Solid.keeps_volume`) lock when every
point of an element must keep its volume. Then only the mean dilatation of each element counts:
tr(eps) in the lambda term is replaced by its projection P onto a small discontinuous space Q,
which the assembly forms as G^T D^-1 G with

    G_qu = int q tr(eps(u)) weight dx,   D_qp = int q p / lambda weight dx.

Q is constant on an element for degree 1 and for simplices of degree 2, linear for quadrilaterals
and hexahedra of degree 2. The integrals of a constant dilatation stay exact, hence patch tests do,
also on curved and axisymmetric elements, where reduced quadrature would fail them. Linear
simplices are beyond that cure: use degree 2. Sources: J. C. Nagtegaal, D. M. Parks, J. R. Rice,
Comput. Methods Appl. Mech. Eng. 4 (1974) 153-177; T. J. R. Hughes, The Finite Element Method
(Dover, 2000), sections 4.4 and 4.5.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from impactfem.fem import ufl
from impactfem.scene.orthotropic import PLACES


@dataclass(frozen=True)
class ElasticForms:
    """UFL forms of an elastic body.

    The material's data may be numbers or UFL constants; the latter let bodies share compiled code.

    Attributes:
        space: Vector-valued Lagrange space of displacements.
        model: "plane_strain", "plane_stress", "axisymmetric" or "3d".
        simplex: Whether the cells are triangles or tetrahedra.
        density: rho [kg/m^3].
        first_lame: lambda [Pa]; for plane stress the reduced 2 lambda mu / (lambda + 2 mu).
        shear_modulus: mu [Pa].
        across: Strain across a plane-stress body over the trace of that in its plane,
            -nu / (1 - nu); 0 for the others.
        thickness: [m], of plane models.
        kept: 1 in cells that keep their volume in the mean, 0 in others, of bodies with both; None:
            all cells are alike.
        whole: C [Pa] of bodies that are orthotropic somewhere, (6, 6) of xx, yy, zz, xy, yz, zx and
            shears 2 eps_xy, in the plane its first four; None: lambda and mu say all.
        residual: Stress without displacement [Pa], (dim, dim) of the place; None: there is none.
    """

    space: Any
    model: str
    simplex: bool
    density: Any
    first_lame: Any
    shear_modulus: Any
    across: Any = 0.0
    thickness: Any = 1.0
    kept: Any = None
    whole: Any = None
    residual: Any = None

    @property
    def weight(self) -> Any:
        """What one unit of the reference measure stands for [m], or [] in 3D."""
        if self.model == "axisymmetric":
            return 2.0 * math.pi * ufl.SpatialCoordinate(self.space.mesh)[0]
        return 1.0 if self.model == "3d" else self.thickness

    @property
    def mass(self) -> Any:
        """Bilinear form of the consistent mass."""
        u, v = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
        return self.density * self.weight * ufl.inner(u, v) * self._dx(self.mass_degree)

    def nodal_mass(self, direction: Any) -> Any:
        """Linear form rho direction . v: row sums of the mass, and gravity per unit of it."""
        v = ufl.TestFunction(self.space)
        return self.density * self.weight * ufl.dot(direction, v) * self._dx(self.mass_degree)

    @property
    def stiffness(self) -> Any:
        """Bilinear form of the stiffness."""
        u, v = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
        if self.whole is not None:
            density = ufl.inner(self.elastic_stress(self.strain(u)), self.strain(v))
            return self._stiffened(self.measured(density))
        volumetric = self.first_lame * self.dilatation(u) * self.dilatation(v)
        return self.deviatoric_stiffness + volumetric * self.weight * self._dx(self.degree)

    @property
    def deviatoric_stiffness(self) -> Any:
        """The stiffness without its lambda term, where the dilatation counts in the mean."""
        u, v = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
        if self.whole is not None:
            meant = 0.0 if self.kept is None else self.kept * self.first_lame
            density = ufl.inner(self.elastic_stress(self.strain(u)), self.strain(v))
            density -= meant * self.dilatation(u) * self.dilatation(v)
            return self._stiffened(self.measured(density))
        density = 2.0 * self.shear_modulus * ufl.inner(self.strain(u), self.strain(v))
        if self.kept is not None:
            local = (1.0 - self.kept) * self.first_lame
            density += local * self.dilatation(u) * self.dilatation(v)
        return self._stiffened(density * self.weight * self._dx(self.degree))

    def _stiffened(self, form: Any) -> Any:
        """A stiffness with that of the residual stress, by which it turns with its material."""
        if self.residual is None:
            return form
        u, v = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
        return form + self.measured(ufl.inner(ufl.grad(u) * self.residual, ufl.grad(v)))

    @property
    def residual_load(self) -> Any:
        """Linear form of the forces that the residual stress has on the nodes."""
        v = ufl.TestFunction(self.space)
        return -self.measured(ufl.inner(self.residual, ufl.sym(ufl.grad(v))))

    def mean_dilatation(self, dilatations: Any) -> tuple[Any, Any]:
        """Forms G and D of the dilatation in the mean (see the module).

        Args:
            dilatations: Scalar discontinuous space Q.
        """
        u, p, q = (
            ufl.TrialFunction(self.space),
            ufl.TrialFunction(dilatations),
            ufl.TestFunction(dilatations),
        )
        dx = self._dx(self.degree)
        # Where it does not count 1 stands for lambda, which may be 0 there.
        first, squares = self.first_lame, q * p
        if self.kept is not None:
            q, first = self.kept * q, self.kept * first + (1.0 - self.kept)
        return q * self.dilatation(u) * self.weight * dx, squares / first * self.weight * dx

    def surface_load(self, values: Any, tags: Any, direction: Any = None) -> Any:
        """Bilinear form of a load on the facets tagged 1, in the load's values [Pa].

        Args:
            values: Scalar discontinuous space of the values.
            tags: Facet tags.
            direction: Unit vector of the load; None for a pressure, which pushes inwards.
        """
        value, v = ufl.TrialFunction(values), ufl.TestFunction(self.space)
        along = -ufl.FacetNormal(self.space.mesh) if direction is None else direction
        return value * ufl.dot(along, v) * self.weight * self.surface_measure(tags, 1)

    def surface_measure(self, facets: Any, number: int) -> Any:
        """Measure ds of facets with the quadrature of loads on them.

        Args:
            facets: Tags, or pairs of a number and cells beside their places of facets.
            number: Of the facets that are meant.
        """
        degree = self.mass_degree + self._order
        metadata = {"quadrature_degree": degree}
        return ufl.Measure("ds", self.space.mesh, subdomain_data=facets, metadata=metadata)(number)

    def volume(self, cells: Any) -> Any:
        """Linear form whose entries are the cells' volumes [m^3].

        Args:
            cells: Space of functions that are constant on each cell.
        """
        return self.weight * ufl.TestFunction(cells) * self._dx(self.mass_degree)

    def fields(self, displacement: Any, terms: Iterable[tuple[Any, Any]] = ()) -> Mapping[str, Any]:
        """What can be shown of a state, scalars or 3 x 3 tensors: von Mises stress [Pa].

        Args:
            displacement: [m].
            terms: Shares of the stiffness, and displacements that strain it besides.
        """
        strain, trace = self.strain(displacement), self.dilatation(displacement)
        for share, moved in terms:
            strain += share * self.strain(moved)
            trace += share * self.dilatation(moved)
        if self.residual is not None:
            shear = ufl.dev(self._total(strain))
            return {"von_mises": ufl.sqrt(1.5 * ufl.inner(shear, shear))}
        if self.whole is not None:
            shear = ufl.dev(symmetric(contracted(self.whole, strain), 3))
            return {"von_mises": ufl.sqrt(1.5 * ufl.inner(shear, shear))}
        # Squares of the full strain, whose direct component out of the plane needs its own term.
        squares = ufl.inner(strain, strain)
        if self.model == "plane_stress":
            squares += (self.across * trace) ** 2
            trace *= 1.0 + self.across
        deviatoric = ufl.max_value(squares - trace**2 / 3.0, 0.0)
        return {"von_mises": self.shear_modulus * ufl.sqrt(6.0 * deviatoric)}

    def _total(self, strain: Any) -> Any:
        """Stress with the residual one, (3, 3); that across a plane is the elastic one."""
        size = int(strain.ufl_shape[0])
        elastic: Any
        if self.whole is not None:
            elastic = symmetric(contracted(self.whole, strain), 3)
        else:
            trace = self.first_lame * ufl.tr(strain)
            across = 0.0 if self.model == "plane_stress" else trace
            own = [
                [
                    2.0 * self.shear_modulus * strain[i, j] if max(i, j) < size else 0.0
                    for j in range(3)
                ]
                for i in range(3)
            ]
            for k in range(3):
                own[k][k] += trace if k < size else across
            elastic = ufl.as_tensor(own)
        rows = [
            [self.residual[i, j] if max(i, j) < size else 0.0 for j in range(3)] for i in range(3)
        ]
        return elastic + ufl.as_tensor(rows)

    def measured(self, integrand: Any) -> Any:
        """Integral over the body, with the quadrature of the stiffness."""
        return integrand * self.weight * self._dx(self.degree)

    def strain(self, u: Any) -> Any:
        """Strain tensor; with the hoop strain u_r / r as third direct component if axisymmetric."""
        strain = ufl.sym(ufl.grad(u))
        if self.model != "axisymmetric":
            return strain
        hoop = u[0] / ufl.SpatialCoordinate(self.space.mesh)[0]
        return ufl.as_tensor(
            ((strain[0, 0], strain[0, 1], 0.0), (strain[1, 0], strain[1, 1], 0.0), (0.0, 0.0, hoop))
        )

    def elastic_stress(self, strain: Any) -> Any:
        """Stress tensor C : eps [Pa] of a strain, of its size, where there is a C."""
        return symmetric(contracted(self.whole, strain), int(strain.ufl_shape[0]))

    def dilatation(self, u: Any) -> Any:
        """Trace of the strain; for plane stress of that in the plane."""
        return ufl.tr(self.strain(u))

    @property
    def _order(self) -> int:
        return int(self.space.ufl_element().degree)

    @property
    def degree(self) -> int:
        """Quadrature degree of the stiffness: full integration, also on curved elements."""
        if self.simplex and self.model != "axisymmetric":
            return 1 if self._order == 1 else 2 * self._order
        return 2 * self._order + 1

    @property
    def mass_degree(self) -> int:
        """Quadrature degree of the mass: exact volumes, also of curved elements."""
        order = self._order
        curved = self.space.mesh.geometry.dim * (order - 1) if self.simplex else 1
        return 2 * order + curved + (order if self.model == "axisymmetric" else 0)

    def _dx(self, degree: int) -> Any:
        return ufl.Measure("dx", self.space.mesh, metadata={"quadrature_degree": degree})


def contracted(whole: Any, strain: Any) -> list[Any]:
    """Components of C : eps [Pa], as many as C has rows."""
    count = whole.ufl_shape[0]
    given = [
        (strain[i, j] + strain[j, i]) * (0.5 if i == j else 1.0)
        if max(i, j) < strain.ufl_shape[0]
        else 0.0
        for i, j in PLACES[:count]
    ]
    return [sum(whole[a, b] * given[b] for b in range(count)) for a in range(count)]


def symmetric(components: Any, size: int) -> Any:
    """Symmetric tensor of a size by its components in space, the first four or all six."""
    count = components.ufl_shape[0] if hasattr(components, "ufl_shape") else len(components)
    xx, yy, zz, xy, yz, zx = (*(components[k] for k in range(count)), 0.0, 0.0)[:6]
    rows = [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]
    return ufl.as_tensor([row[:size] for row in rows[:size]])
