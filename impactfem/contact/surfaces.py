"""Which nodes on the outside of a body carry contact unknowns, and why the others do not."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.boundary import Boundary, everywhere
from impactfem.contact.facing import ROUNDING, gap_fields
from impactfem.contact.pressure import pressure_map
from impactfem.contact.reach import Reach
from impactfem.contact.reasons import check_start, explain
from impactfem.errors import SceneError

_GRAZING = 0.05  # least facing for which the way along the node's own normal is told


@dataclass(frozen=True)
class ContactNodes:
    """Nodes with contact unknowns in canonical order, on every rank, and those of this rank.

    Each node is held off one obstacle: for fixed normals gap + normal . (u - u(0)) - normal . (the
    obstacle's way since t = 0) is its gap.

    Attributes:
        numbers: Canonical numbers, increasing, shape (count,).
        positions: Places at t = 0, initial displacement included [m], shape (count, dim).
        outward: Outward unit normals of the body, means over the faces that can touch weighted
            with their areas, shape (count, dim).
        gap: Gap at t = 0 [m], shape (count,).
        normal: Unit normal of the obstacle at t = 0, towards the body, shape (count, dim).
        obstacle: Index of the obstacle, shape (count,).
        area: Area of the node [m^2], shape (count,).
        pressures: Matrix from forces [N] to pressures [Pa]; see `impactfem.contact.pressure`.
        nodes: Contact nodes among the nodes this rank owns, shape (own,).
        rows: Their places in ``numbers``, shape (own,).
        watched: Other nodes of the outside among those this rank owns; see `contact.watch`.
        why: What was left out for which reason, in sentences for the plan.
    """

    numbers: Integers
    positions: Floats
    outward: Floats
    gap: Floats
    normal: Floats
    obstacle: Integers
    area: Floats
    pressures: csr_matrix
    nodes: Integers
    rows: Integers
    watched: Integers
    why: tuple[str, ...]

    @property
    def count(self) -> int:
        """Number of contact nodes on all ranks."""
        return len(self.numbers)


def contact_nodes(
    comm: Any,
    outside: Boundary,
    obstacles: Sequence[Any],
    numbers: Integers,
    constrained: ArrayLike,
    displacement: ArrayLike,
    reach: Reach,
    *,
    name: str = "body",
    surfaces: Collection[str] | None = None,
    symmetry: Collection[str] = (),
    axisymmetric: bool = False,
    turns: bool = False,
    joined: Booleans | bool = False,
) -> ContactNodes:
    """Choose the nodes that can touch an obstacle within the duration (collective).

    Args:
        comm: MPI communicator of the body.
        outside: Its faces.
        obstacles: At least one, as `signed_distance` takes them.
        numbers: Canonical numbers of the nodes this rank owns, shape (owned nodes,).
        constrained: Which of their displacement components are prescribed, (owned nodes * dim,).
        displacement: Their initial displacement [m], (owned nodes * dim,).
        reach: Bound of the approach within the duration.
        name: Name of the body, for messages.
        surfaces: Surfaces that may touch, or None for the whole outside.
        symmetry: Surfaces in planes of symmetry: cuts through the body, not its outside. (The axis
            of an axisymmetric body is known to be none.)
        axisymmetric: Whether the first coordinate is the radius.
        turns: Whether the body may turn at will, so that what faces away now may touch later.
        joined: Which nodes of the outside joints hold, (nodes,): they keep their mass.

    Raises:
        SceneError: On all ranks: the body is inside an obstacle at t = 0, or a surface is unknown.
    """
    real = ~outside.on(symmetry)
    asked = real if surfaces is None else real & _asked(outside, surfaces, name)
    dim = outside.points.shape[1]
    own = np.concatenate(
        [np.reshape(displacement, (-1, dim)), np.reshape(constrained, (-1, dim))], axis=1
    ).astype(np.float64)
    spread = everywhere(comm, outside.numbers, numbers, own)
    places = outside.points + spread[:, :dim]
    fields = gap_fields(outside, asked, real, obstacles, places, spread[:, dim:] > 0.5)
    on_asked = outside.touched(asked)
    check_start(name, obstacles, places, fields, on_asked, outside.size)
    fields = replace(fields, held=fields.held | joined)
    holding = "joints, or by supports" if np.any(joined) else "supports"

    if turns:
        nowhere = np.zeros_like(fields.away)
        fields = replace(fields, away=nowhere, hidden=nowhere)
    faces = ~fields.away & ~fields.hidden
    able = on_asked & ~fields.held & faces & (fields.gap <= reach.distance)
    # Between several: the obstacle met first on the way along the node's own normal.
    way = np.where(able, fields.gap / np.maximum(-fields.facing, _GRAZING), np.inf)
    chosen = _first_met(way)
    kept = np.flatnonzero(able.any(axis=0))
    pick = chosen[kept], kept
    outward = np.stack([outside.total(outside.shares[:, :, i], asked)[kept] for i in range(dim)], 1)
    length = np.linalg.norm(outward, axis=1)
    canonical = outside.numbers[kept]
    nodes = np.flatnonzero(np.isin(numbers, canonical))
    # What starts inside an obstacle is held or was declared to have no contact.
    others = outside.touched(real) & (fields.gap >= -ROUNDING * outside.size).all(axis=0)
    others[kept] = False
    return ContactNodes(
        canonical,
        places[kept],
        outward / np.where(length > 0.0, length, 1.0)[:, None],
        fields.gap[pick],
        fields.normal[pick],
        chosen[kept],
        outside.total(outside.areas, asked)[kept],
        pressure_map(outside, asked, axisymmetric=axisymmetric)[kept][:, kept],
        nodes,
        np.searchsorted(canonical, numbers[nodes]),
        np.flatnonzero(np.isin(numbers, outside.numbers[others])),
        explain(outside, asked, real, obstacles, fields, able, chosen, reach, holding),
    )


def _asked(outside: Boundary, surfaces: Collection[str], name: str) -> NDArray[np.bool_]:
    """Faces on some surfaces, each of which must have some."""
    for surface in surfaces:
        if surface not in outside.names:
            raise SceneError(
                f"body {name!r}: contact_surfaces names {surface!r}, but its surfaces are "
                f"{list(outside.names)}; use one of these, or name it in the mesh"
            )
        if not outside.on([surface]).any():
            raise SceneError(
                f"body {name!r}: contact_surfaces names {surface!r}, which has no face on the "
                "outside of the body; name a surface of the outside"
            )
    return outside.on(surfaces)


def _first_met(way: Floats) -> Integers:
    """Row of the smallest value in each column; of those equal to rounding the first."""
    chosen = np.zeros(way.shape[1], dtype=np.int64)
    least = way[0].copy()
    for k, other in enumerate(way[1:], start=1):
        shorter = other < least * (1.0 - ROUNDING)
        chosen[shorter] = k
        least[shorter] = other[shorter]
    return chosen
