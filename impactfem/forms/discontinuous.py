"""The upwind discontinuous Galerkin form of waves that run along characteristics.

With t := c t / L, x := x / L and V = u_t, S = u_x [m], the bar's first-order system

    V_t - S_x = -P,   S_t - V_x = 0

has the waves r = V + S, which runs towards the wall, and q = V - S, which leaves it:

    r_t - r_x = -P,   q_t + q_x = -P.

The upwind flux in the space-time normal (n_t, n_x) of the system, A^+(n) w(+) + A^-(n) w(-) with
A(n) = [[n_t, -n_x], [-n_x, n_t]], has the eigenvalues n_t - n_x (for r) and n_t + n_x (for q): the
form of the system is this scalar form for r and for q; only the ends of the bar couple them.
Source: Cockburn, Shu, J. Sci. Comput. 16 (2001) 173-261 (the scheme); Falk, Richter, SIAM J. Numer.
Anal. 36 (1999) 935-952 (symmetric hyperbolic systems on unstructured space-time meshes).
"""

from typing import Any

from impactfem.fem import ufl

# An edge whose normal is this close to a right angle with the direction lies along it: no flux.
PARALLEL = 1e-10


def advection_form(space: Any, speed: Any) -> Any:
    """Bilinear form of w_t + speed w_x, inflow sides excepted.

    Args:
        space: Discontinuous space on a mesh of (t, x), dimensionless.
        speed: -1 for the wave that runs towards the wall, 1 for the one that leaves it.

    Returns:
        UFL form; given values on the inflow sides enter the load as their integral times
        |n_t + speed n_x| = 1 times the test function.
    """
    w, z = ufl.TrialFunction(space), ufl.TestFunction(space)
    along = ufl.as_vector((1.0, speed))
    through = ufl.dot(along, ufl.FacetNormal(space.mesh))
    leaving = ufl.conditional(ufl.gt(through, PARALLEL), through, 0.0)
    flux = leaving("+") * w("+") - leaving("-") * w("-")
    return (
        -w * ufl.dot(along, ufl.grad(z)) * ufl.dx
        + flux * (z("+") - z("-")) * ufl.dS
        + leaving * w * z * ufl.ds
    )
