"""Whether a body has enough inside to hold its massless contact nodes."""

import numpy as np

from impactfem.errors import SceneError
from impactfem.fem import gather
from impactfem.system.elastic import ElasticSystem
from impactfem.system.surface import SurfaceNodes

_LINE = 1e-6  # second extent over the size of the body below which points lie on a line


def check_inside(name: str, system: ElasticSystem, surface: SurfaceNodes) -> None:
    """Refuse a body whose massless nodes could turn about those inside (collective).

    Massless nodes are in equilibrium with the nodes inside and those that supports hold. If these
    are one point, or in space lie on a line, the rest turns about them without force.

    Args:
        name: Of the body.
        system: The body.
        surface: Its massless nodes.

    Raises:
        SceneError: So it is, with what helps.
    """
    if system.axisymmetric:
        return  # a section only moves along the axis
    held = system.constrained.reshape(-1, system.dim).all(axis=1)
    held |= ~np.isin(np.arange(len(held)), surface.nodes)
    size = float(np.ptp(gather(surface.comm, system.positions), axis=0).max())
    points = gather(surface.comm, system.positions[held])
    if len(points) >= system.dim:
        extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if extents[system.dim - 2] > _LINE * size:
            return
    raise SceneError(
        f"body {name}: its mesh has {len(points)} nodes that carry no contact, too few to hold "
        "those that do, which have no mass; use a smaller mesh_size, name the surfaces that strike "
        'in body.contact_surfaces, or use solve.method = "moreau_jean"'
    )
