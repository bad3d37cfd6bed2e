"""Whether the plain P1 Galerkin form is stable on a mesh: computed, not guessed."""

from pathlib import Path

import numpy as np

from impactfem.errors import MeshError
from impactfem.mesh.spacetime import SpaceTimeMesh
from impactfem.scene import Bar, PiecewiseConstant

LIMIT = 10.0
"""Growth of a disturbance over the whole mesh from which a mesh is refused.

On a stable mesh a disturbance of size 1 stays of size 1 (leapfrog at its limit: below 3); on
unstable ones the growth is exponential in the number of elements.
"""


def growth(space: SpaceTimeMesh) -> float:
    """Largest displacement that follows from a rough initial displacement of size 1, no contact.

    The disturbance alternates from node to node, where every instability is strongest.
    """
    from impactfem.spacetime.galerkin import GalerkinSettings, solve_galerkin  # noqa: PLC0415

    # Far from the wall, so that nothing touches; the formula alternates fast and irregularly.
    probe = Bar(
        length=1.0,
        density=1.0,
        youngs_modulus=1.0,
        gap=1e3,
        displacement="0.5*sin(997*x)*sin(1613*x)*0.001",
    )
    motion = solve_galerkin(
        space,
        probe,
        PiecewiseConstant((0.0,), (0.0,)),
        GalerkinSettings(max_iterations=1),
    )
    moved = motion.displacement - 1e3
    start = np.abs(moved[0]).max()
    if not np.isfinite(moved).all():
        return float("inf")
    return float(np.abs(moved).max() / start)


def refuse_growth(space: SpaceTimeMesh, path: Path) -> None:
    """Refuse a mesh on which disturbances grow.

    Raises:
        MeshError: With the growth and the remedy.
    """
    grown = growth(space)
    if not grown <= LIMIT:
        raise MeshError(
            f"mesh file {path}: the method is unstable on it, a disturbance grows {grown:.1e}-fold "
            f'(at most {LIMIT:g} are accepted); use thinner slabs (c dt <= h), or method = "dg"'
        )
