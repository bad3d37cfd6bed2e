"""The space-time Petrov-Galerkin primal-dual form of a bar, dimensionless in t and x.

With t := c t / L, x := x / L, the displacement u in metres and lambda := u_x on the wall,

    int_Q (-u_t v_t + u_x v_x + p v) - int_0^1 v0 v|_{t=0} = - int_wall lambda v dt

for all v that vanish at t = T; v0 is the initial velocity times L/c and p the gravity times
(L/c)^2, both in metres. Of a bar whose properties vary, x is the travel time of waves to a place,
as a share of that to the other end, L/c; all but lambda is then weighted with the impedance
rho c A over its mean, constant in each element (`impactfem.scene.profile`).

Source: V. A. Kovtunenko, slides "Analytical and numerical optimization methods for solution of
non-smooth dynamic impact problems", equation (3) (where u_t = -v0).
"""

from dataclasses import dataclass
from typing import Any

from impactfem.fem import ufl
from impactfem.scene import Formula

# Functions of the scene's formulas, for UFL expressions.
UFL_FUNCTIONS = {
    "sin": ufl.sin, "cos": ufl.cos, "tan": ufl.tan, "asin": ufl.asin, "acos": ufl.acos,
    "atan": ufl.atan, "sinh": ufl.sinh, "cosh": ufl.cosh, "tanh": ufl.tanh, "exp": ufl.exp,
    "log": ufl.ln, "sqrt": ufl.sqrt, "abs": abs, "min": ufl.min_value, "max": ufl.max_value,
    "lt": ufl.lt, "le": ufl.le, "gt": ufl.gt, "ge": ufl.ge, "where": ufl.conditional,
}  # fmt: skip


@dataclass(frozen=True)
class GalerkinForms:
    """UFL forms of equation (3): stiffness(u, v) + coupling(lambda, v) = load(v)."""

    stiffness: Any
    coupling: Any
    load: Any


def galerkin_forms(
    displacements: Any,
    multipliers: Any,
    boundary: Any,
    tags: dict[str, int],
    weights: Any,
    velocity: Formula,
    velocity_scale: float,
    length: float,
    gravity: Any,
) -> GalerkinForms:
    """Write equation (3) in UFL.

    Args:
        displacements: P1 space on the space-time mesh.
        multipliers: P0 space on the wall's facets.
        boundary: Measure of the boundary with the facet tags.
        tags: Tag of each boundary name.
        weights: UFL expression of the impedance of the bar over its mean, constant in cells.
        velocity: Initial velocity [m/s] as a formula in x [m].
        velocity_scale: L/c [s].
        length: L [m]; the formula sees x [m], the mesh x/L.
        gravity: UFL expression of p (L/c)^2 [m].
    """
    u, v = ufl.TrialFunction(displacements), ufl.TestFunction(displacements)
    multiplier = ufl.TrialFunction(multipliers)
    x = ufl.SpatialCoordinate(displacements.mesh)[1]
    initial = velocity_scale * velocity.apply(UFL_FUNCTIONS, x=length * x)
    return GalerkinForms(
        stiffness=weights * (-u.dx(0) * v.dx(0) + u.dx(1) * v.dx(1)) * ufl.dx,
        coupling=multiplier * v * boundary(tags["wall"]),
        load=-gravity * v * ufl.dx + initial * v * boundary(tags["start"]),
    )
