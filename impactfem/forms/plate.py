"""Weak form of bending of a Kirchhoff plate, in slopes instead of second derivatives.

    D ((1 - nu) e(b) : e(c) + nu div b div c) dx,  e(b) = sym grad b,  D = E t^3 / (12 (1 - nu^2)),

for slopes b of the mid-surface. With b = grad w it is the energy of a plate with w in H^2; the
discrete Kirchhoff triangle takes quadratic b that equals grad w at the vertices and along the edges
only (`impactfem.system.kirchhoff`).
"""

from typing import Any

from impactfem.fem import ufl


def bending(slopes: Any, rigidity: Any, poisson_ratio: Any) -> Any:
    """Bilinear form of the bending energy.

    Args:
        slopes: Vector-valued space of slopes in the plane.
        rigidity: D [N m].
        poisson_ratio: nu.
    """
    b, c = ufl.TrialFunction(slopes), ufl.TestFunction(slopes)
    one, two = ufl.sym(ufl.grad(b)), ufl.sym(ufl.grad(c))
    across = (1.0 - poisson_ratio) * ufl.inner(one, two)
    return rigidity * (across + poisson_ratio * ufl.div(b) * ufl.div(c)) * ufl.dx
