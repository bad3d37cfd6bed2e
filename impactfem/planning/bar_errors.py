"""The error of a bar that each method is expected to have, before anything is solved by it."""

from impactfem.exact import ExactBar
from impactfem.exact.growth import growth
from impactfem.findings import Finding, by_limits, percent
from impactfem.methods import DISPERSIVE, METHODS
from impactfem.reference.rounding import rounding_of_exact
from impactfem.scene import Scene
from impactfem.sizing import Grid, on_its_own_mesh

EXACT = 1e-9
"""Relative error of displacements below which a plan may say "exact"."""

ROUNDING = 1e-14
"""Relative error of galerkin up to the first impact: 1e-15 to 2e-14 with 20 to 160 elements."""

ROUNDING_LIMITS = (1e-6, 0.5)
"""Relative error by rounding from which it is pointed out, and from which nothing is left."""

_FELT = 0.1  # share of the growth of errors that one made off layers feels, in the same studies
_FITTED = 8e-12  # of dg on fitted meshes: the largest in 150 random scenes with up to ten contacts


_FOLLOWED = 1e-12  # of waves followed on layers: at most 6e-13 over 750 contacts


def growth_of(exact: ExactBar) -> float:
    """How far the contacts of a bar make an error grow."""
    return growth(
        exact.contacts, transit_time=exact.transit_time, clamped=exact.far_end == "clamped"
    )


def rounding_of_galerkin(exact: ExactBar) -> float:
    """Relative error of galerkin where only rounding makes one, at most 1 (nothing is left)."""
    return min(1.0, ROUNDING * growth_of(exact))


def predicted_error(
    scene: Scene, exact: ExactBar, name: str, grid: Grid, *, fitted: bool
) -> float | None:
    """Largest relative error of displacements to expect of a method; None: no prediction.

    Off layers it is the largest seen in the standing studies (`Method.error`).
    """
    method = METHODS[name]
    if method.exact:
        return rounding_of_exact(scene).displacement_max
    if not method.layered:
        return _FITTED if fitted and not exact.sampled else None
    if not method.plannable or grid.elements is None or grid.courant is None:
        return None
    on_mesh = on_its_own_mesh(scene, exact) == grid.elements
    if on_mesh:
        return rounding_of_galerkin(exact) if method.stable == "limited" else _FOLLOWED
    constant, rate = method.error
    if method.stable == "limited" and grid.courant < 1.0 - 1e-9:
        constant, rate = DISPERSIVE
    first = constant / grid.elements**rate * max(1.0, grid.courant)
    return float(min(1.0, first * max(1, len(exact.contacts), _FELT * growth_of(exact))))


def rounding_findings(error: float, verb: str) -> tuple[Finding, ...]:
    """What there is to say of rounding that has grown, or will, to a relative error."""
    text = f"from contact to contact rounding {verb} to {percent(error)} of the displacement"
    remedy = 'take method = "exact"'
    return by_limits("rounding_growth", error, ROUNDING_LIMITS, text, remedy=remedy)
