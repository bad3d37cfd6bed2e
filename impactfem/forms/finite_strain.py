"""Weak forms of finite strain and rotation; stresses do exactly the work of their energy.

Total Lagrangian: F = I + grad u, C = F^T F, E = (C - I) / 2, W(E) per undeformed volume. Between
two states 0 and 1, m the mean, d the difference, a law gives a discrete gradient S of its energy,

    S : dE = W_1 - W_0   (to rounding, for steps of any size),   dE = sym(F_m^T dF),

and P = F_m S is the stress of the step: its forces do the work of the energy, and since S is
symmetric and only E enters, they have neither a sum nor a moment about the mean places. Source of
the idea: J. C. Simo, N. Tarnow, ZAMP 43 (1992) 757-792; O. Gonzalez, Comput. Methods Appl. Mech.
Eng. 190 (2000) 1763-1783, whose quotient by dC : dC the laws below do without.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from impactfem.fem import ufl
from impactfem.forms.elasticity import ElasticForms, contracted, symmetric

_SMALL = 0.03
"""Below it logarithms of ratios near 1 are summed as series, which leave out y^10 / 11."""


class Moduli(NamedTuple):
    """What laws take [Pa].

    Attributes:
        first_lame: lambda of small strains.
        shear_modulus: mu of small strains.
        c01: Of Mooney's and Rivlin's law.
    """

    first_lame: Any
    shear_modulus: Any
    c01: Any


class Law(Protocol):
    """A hyperelastic law, isotropic."""

    @staticmethod
    def energy(strain: Any, moduli: Moduli) -> Any:
        """W [J/m^3] of Green's strain E, (2, 2) in plane strain, else (3, 3)."""

    @staticmethod
    def stress(before: Any, after: Any, change: Any, moduli: Moduli) -> Any:
        """Discrete gradient S [Pa] between two strains, whose difference is given."""


class StVenantKirchhoff:
    """W = lambda (tr E)^2 / 2 + mu E : E, linear between S and E; weak under much compression."""

    @staticmethod
    def energy(strain: Any, moduli: Moduli) -> Any:
        """See `Law`."""
        squares = moduli.shear_modulus * ufl.inner(strain, strain)
        return 0.5 * moduli.first_lame * ufl.tr(strain) ** 2 + squares

    @staticmethod
    def stress(before: Any, after: Any, change: Any, moduli: Moduli) -> Any:  # noqa: ARG004  (as the interface has it)
        """The mean of both stresses: W is quadratic."""
        mean = 0.5 * (before + after)
        unit = ufl.Identity(_size(mean))
        return moduli.first_lame * ufl.tr(mean) * unit + 2.0 * moduli.shear_modulus * mean


class MooneyRivlin:
    """W = c10 (I1 - 3) + c01 (I2 - 3) + U(D), U = -(c10 + 2 c01) ln(D) + lambda' ln(D)^2 / 8.

    I1 and I2 are those of C in space, D = det C; c10 + c01 = mu / 2 and lambda' = lambda - 4 c01,
    so that a body without strain has no stress and lambda and mu of small strains.

    D is a cubic of C, so that its difference is exactly that of its mean gradient:
    D_1 - D_0 = (cof C_m + cof(dC) / 12) : dC, and with the divided difference U[D_0, D_1]

        S = (2 c10 + 4 c01 (1 + tr E_m)) I - 4 c01 E_m + 2 U[D_0, D_1] (cof C_m + cof(dC) / 12),

    the last term in space only. Without 0 / 0, as ln(D_1 / D_0) / (D_1 - D_0) is a series for D_1
    near D_0. Energies are found from E, not C: tr C - d would leave rounding of size mu.
    """

    @staticmethod
    def energy(strain: Any, moduli: Moduli) -> Any:
        """See `Law`."""
        first, second, pressing, bulk = _mooney(moduli)
        trace, log = ufl.tr(strain), _log_ratio(1.0, 1.0 + _excess(strain), _excess(strain))
        sheared = 2.0 * (first + 2.0 * second) * trace
        sheared += 2.0 * second * (trace**2 - ufl.inner(strain, strain))
        return sheared - pressing * log + 0.125 * bulk * log**2

    @staticmethod
    def stress(before: Any, after: Any, change: Any, moduli: Moduli) -> Any:
        """See `Law`."""
        first, second, pressing, bulk = _mooney(moduli)
        unit = ufl.Identity(_size(before))
        # cof C_m, in which the strain's part is added to that of the unit, and the cubic's rest.
        gradient = _cofactor(unit + before + after)
        if _size(before) == 3:
            gradient += _cofactor(2.0 * change) / 12.0
        start, end = 1.0 + _excess(before), 1.0 + _excess(after)
        logs = _log_ratio(1.0, start, _excess(before)) + _log_ratio(1.0, end, _excess(after))
        slope = _log_slope(start, end, 2.0 * ufl.inner(gradient, change))
        divided = slope * (-pressing + 0.125 * bulk * logs)
        twice = before + after
        shearing = 2.0 * (first + second * (2.0 + ufl.tr(twice))) * unit - 2.0 * second * twice
        return shearing + 2.0 * divided * gradient


def _mooney(moduli: Moduli) -> tuple[Any, Any, Any, Any]:
    """c10, c01, c10 + 2 c01 and lambda'."""
    first = 0.5 * moduli.shear_modulus - moduli.c01
    return first, moduli.c01, first + 2.0 * moduli.c01, moduli.first_lame - 4.0 * moduli.c01


LAWS: Mapping[str, type[Law]] = {
    "linear": StVenantKirchhoff,
    "neo_hookean": MooneyRivlin,
    "mooney_rivlin": MooneyRivlin,
}
"""Laws with forms of their own by the name of the scene's key ``material``; the others are found
point by point, see `PointLaw`.

The neo-Hookean law is that of Mooney and Rivlin with c01 = 0."""


class PointLaw(Protocol):
    """What a law says at the points of the quadrature: see `impactfem.system.point_stress`."""

    stress: Any
    slopes: Any
    across: Any


class Memory(Protocol):
    """What Maxwell terms remember: see `impactfem.system.point_memory.PointMemory`."""

    @property
    def shares(self) -> Sequence[Any]:
        """Of each term in the stiffness."""

    @property
    def weights(self) -> Sequence[Any]:
        """Of what each has amid a step."""

    @property
    def kept(self) -> Sequence[Any]:
        """What each keeps from the start of a step, components in space."""

    def pressures(self, swept: Any) -> Any:
        """By changes of the mean dilatation of cells amid a step, over the bulk moduli."""

    @property
    def stiffening(self) -> Any:
        """Their derivatives by these changes."""

    def stored(self, moduli: Any) -> float:
        """Energy of the mean dilatation by moduli times volumes [J]."""


@dataclass(frozen=True)
class FiniteForms:
    """UFL forms of a body under finite strain.

    Attributes:
        elastic: Measures and the data of the material.
        law: Of the material, or its values at points.
        c01: Of Mooney's and Rivlin's law [Pa].
        viscosity: Kelvin's and Voigt's, of a step: S gains viscosity (lambda tr(dE) I + 2 mu dE),
            with the time of retardation over the time step.
        local: lambda at points [Pa], of bodies only some cells of which keep their volume in the
            mean; None: that of small strains, or what `pressing` leaves of it.
        damped: Share of the viscosity, of bodies of several materials.
        memory: Of bodies with Maxwell terms; else None.
        pressing: Of nearly incompressible bodies, whose lambda' is asked of the mean of J in each
            cell: the pressure p there [Pa], by which S gains p dJ/dE; else None. See
            `impactfem.system.mean_dilatation`.
    """

    elastic: ElasticForms
    law: type[Law] | PointLaw
    c01: Any
    viscosity: Any
    pressing: Any = None
    local: Any = None
    damped: Any = 1.0
    memory: Memory | None = None

    def energy(self, displacement: Any) -> Any:
        """Functional W [J] of laws with forms, without what means of cells have of it."""
        if not isinstance(self.law, type):
            return self.elastic.measured(0.0 * displacement[0])
        return self.elastic.measured(self.law.energy(self._strain(displacement), self._moduli))

    def force(self, before: Any, after: Any) -> Any:
        """Linear form of the internal forces of a step from ``before`` to ``after``."""
        v = ufl.TestFunction(self.elastic.space)
        moved = after - before
        middle = 0.5 * (before + after)
        gradient = self._gradient(middle)
        mean = ufl.Identity(_size(gradient)) + gradient
        change = ufl.sym(mean.T * self._gradient(moved))
        stress = self._stress(before, after, change)
        stress += self.viscosity * self.damped * self._linear(change)
        for share, weight, kept in self._terms:
            amid = symmetric(kept, _size(change)) + 0.5 * change
            stress += share * weight * self._linear(amid)
        density = ufl.inner(mean * stress, self._gradient(v))
        if self.pressing is not None:
            density += self.pressing * self.swept(before, after, v)
        return self.elastic.measured(density)

    @property
    def _terms(self) -> Iterable[tuple[Any, Any, Any]]:
        """Share, weight and r at the start of the step of each Maxwell term."""
        if self.memory is None:
            return ()
        return zip(self.memory.shares, self.memory.weights, self.memory.kept, strict=True)

    def remembered(self) -> Any:
        """Functional of the energy of Maxwell terms [J], but for what means of cells have of it."""
        size = 3 if self.elastic.model in {"axisymmetric", "3d"} else 2
        total = 0.0 * self.elastic.shear_modulus
        for share, _, kept in self._terms:
            strain = symmetric(kept, size)
            total += 0.5 * share * ufl.inner(self._linear(strain), strain)
        return self.elastic.measured(total)

    def _linear(self, change: Any) -> Any:
        """Stress of a strain by small strains [Pa], but for what means of cells have of it."""
        moduli, full = self._moduli, self.elastic
        unit = ufl.tr(change) * ufl.Identity(_size(change))
        if full.whole is None:
            return moduli.first_lame * unit + 2.0 * moduli.shear_modulus * change
        found = full.elastic_stress(change)
        return found if self.local is None else found - (full.first_lame - self.local) * unit

    def _stress(self, before: Any, after: Any, change: Any) -> Any:
        """Discrete gradient S [Pa], as `Law` has it."""
        if isinstance(self.law, type):
            strains = self._strain(before), self._strain(after)
            return self.law.stress(*strains, change, self._moduli)
        return symmetric(self.law.stress, _size(change))

    def stiffening(self, before: Any, after: Any) -> Any:
        """Bilinear form by which values at points change with the end of a step; 0 of forms."""
        if isinstance(self.law, type):
            return 0.0
        v, u = ufl.TestFunction(self.elastic.space), ufl.TrialFunction(self.elastic.space)
        unit = ufl.Identity(_size(self._gradient(after)))
        change = ufl.sym((unit + self._gradient(after)).T * self._gradient(u))
        more = symmetric(contracted(self.law.slopes, change), _size(change))
        mean = unit + self._gradient(0.5 * (before + after))
        return self.elastic.measured(ufl.inner(mean * more, self._gradient(v)))

    def dilatation(self, displacement: Any) -> Any:
        """J - 1, without cancellation."""
        excess = _excess(self._strain(displacement))
        return excess / (1.0 + ufl.sqrt(1.0 + excess))

    def swept(self, before: Any, after: Any, v: Any) -> Any:
        """Discrete gradient of J along v: that along the way of a step is the change of J.

        With D = J^2, J_1 - J_0 = (D_1 - D_0) / (J_0 + J_1) and the gradient of D as in `Law`.
        """
        start, end = self._strain(before), self._strain(after)
        full = ufl.Identity(_size(start)) + self._gradient(0.5 * (before + after))
        gradient = _cofactor(ufl.Identity(_size(start)) + start + end)
        if _size(start) == 3:
            change = ufl.sym(full.T * self._gradient(after - before))
            gradient += _cofactor(2.0 * change) / 12.0
        both = ufl.sqrt(1.0 + _excess(start)) + ufl.sqrt(1.0 + _excess(end))
        return 2.0 / both * ufl.inner(full * gradient, self._gradient(v))

    def pressure(self, before: Any, after: Any, values: Any, surface: Any) -> Any:
        """Linear form of a pressure that follows its surface in a step.

        Its work is the pressure times the volume that the surface sweeps inwards on straight ways,
        exactly: area vectors are cof F N, of degree 1 in the plane and 2 in space, whose mean over
        the step is cof F_m [+ cof(dF) / 12]. Closed surfaces get no force. Nor do they get a
        moment, but for the last term, which is of third order in the step.

        Args:
            before: Displacement at the start of the step.
            after: At its end.
            values: Pressure by undeformed places [Pa].
            surface: As of `ElasticForms.surface_measure`.
        """
        v, normal = ufl.TestFunction(self.elastic.space), ufl.FacetNormal(self.elastic.space.mesh)
        gradient = self._gradient(0.5 * (before + after))
        size, dim = _size(gradient), self.elastic.space.mesh.geometry.dim
        area = _cofactor(ufl.Identity(size) + gradient)
        if size == 3:
            area += _cofactor(self._gradient(after - before)) / 12.0
        pushed = sum(area[i, j] * normal[j] * v[i] for i in range(dim) for j in range(dim))
        return -values * pushed * self.elastic.weight * surface

    def inverted(self, displacement: Any) -> Any:
        """Functional that is positive where cells are turned inside out (volume [m^3])."""
        upright = ufl.gt(self._volume_ratio(displacement), 0.0)
        return self.elastic.measured(ufl.conditional(upright, 0.0, 1.0))

    def fields(self, displacement: Any) -> Mapping[str, Any]:
        """As `ElasticForms.fields`: true (Cauchy) stress [Pa], Green's strain, ratio of volumes."""
        strain = _in_space(self._strain(displacement))
        full = ufl.Identity(3) + _in_space(self._gradient(displacement))
        if isinstance(self.law, type):
            stress = self.law.stress(strain, strain, 0.0 * strain, self._moduli)
        else:
            stress = symmetric(self.law.stress, 3)
        flat = self.elastic.model == "plane_stress"
        for share, _, kept in self._terms:
            stress += _in_space(share * self._linear(symmetric(kept, 2 if flat else 3)))
        if flat and not isinstance(self.law, type):
            normal = ufl.as_tensor([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
            strain += self.law.across * normal
            full += (ufl.sqrt(1.0 + 2.0 * self.law.across) - 1.0) * normal
        ratio = ufl.det(full)
        true = full * stress * full.T / ratio
        if self.pressing is not None:
            true += self.pressing * ufl.Identity(3)
        deviatoric = ufl.dev(true)
        return {
            "von_mises": ufl.sqrt(1.5 * ufl.inner(deviatoric, deviatoric)),
            "cauchy_stress": true,
            "green_strain": strain,
            "volume_ratio": ratio,
        }

    @property
    def _moduli(self) -> Moduli:
        # Of nearly incompressible bodies lambda' is no matter of points.
        first = self.elastic.first_lame if self.pressing is None else 4.0 * self.c01
        first = first if self.local is None else self.local
        return Moduli(first, self.elastic.shear_modulus, self.c01)

    def _gradient(self, u: Any) -> Any:
        """Displacement gradient; with the hoop part u_r / r if axisymmetric."""
        gradient = ufl.grad(u)
        if self.elastic.model != "axisymmetric":
            return gradient
        hoop = u[0] / ufl.SpatialCoordinate(self.elastic.space.mesh)[0]
        return ufl.as_tensor(
            (
                (gradient[0, 0], gradient[0, 1], 0.0),
                (gradient[1, 0], gradient[1, 1], 0.0),
                (0.0, 0.0, hoop),
            )
        )

    def _strain(self, u: Any) -> Any:
        """Green's strain E = sym H + H^T H / 2, without the rounding of C - I."""
        gradient = self._gradient(u)
        return ufl.sym(gradient) + 0.5 * gradient.T * gradient

    def _volume_ratio(self, u: Any) -> Any:
        gradient = self._gradient(u)
        return ufl.det(ufl.Identity(_size(gradient)) + gradient)


def _in_space(tensor: Any) -> Any:
    """A tensor in the plane as one in space."""
    if _size(tensor) == 3:
        return tensor
    return ufl.as_tensor(
        [[tensor[i, j] if max(i, j) < 2 else 0.0 for j in range(3)] for i in range(3)]
    )


def _excess(strain: Any) -> Any:
    """Det C - 1 = det(I + 2 E) - 1, without cancellation."""
    trace = ufl.tr(strain)
    if _size(strain) == 2:
        return 2.0 * trace + 4.0 * ufl.det(strain)
    second = 0.5 * (trace**2 - ufl.inner(strain, strain))
    return 2.0 * trace + 4.0 * second + 8.0 * ufl.det(strain)


def _cofactor(tensor: Any) -> Any:
    """Cofactors of a tensor, whose transpose times the tensor is its determinant times I."""
    trace, flipped = ufl.tr(tensor), tensor.T
    if _size(tensor) == 2:
        return trace * ufl.Identity(2) - flipped
    second = 0.5 * (trace**2 - ufl.inner(tensor, flipped))
    return second * ufl.Identity(3) - trace * flipped + flipped * flipped


def _log_slope(first: Any, last: Any, change: Any) -> Any:
    """ln(last / first) / (last - first), a series where ``change`` = last - first is small."""
    y = change / (first + last)
    square = y**2
    series = 1.0 + square * (1.0 / 3.0 + square * (1.0 / 5.0 + square * (1.0 / 7.0 + square / 9.0)))
    far = ufl.gt(abs(y), _SMALL)
    safe = ufl.conditional(far, y, 1.0)
    # Both branches are evaluated: that which is not taken must have no 0 / 0.
    whole = 0.5 * ufl.ln(ufl.conditional(far, last / first, 1.0)) / safe
    return 2.0 / (first + last) * ufl.conditional(far, whole, series)


def _log_ratio(first: Any, last: Any, change: Any) -> Any:
    """ln(last / first)."""
    return change * _log_slope(first, last, change)


def _size(tensor: Any) -> int:
    """Rows of a tensor."""
    return int(tensor.ufl_shape[0])
