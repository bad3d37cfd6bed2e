"""Which nodes of the surfaces of a solid joints hold."""

from typing import TYPE_CHECKING

import numpy as np

from impactfem.arrays import Booleans, Floats
from impactfem.contact.boundary import everywhere
from impactfem.scene.laws import side_of
from impactfem.scene.schema import KeyedError
from impactfem.scene.ties import TieRows
from impactfem.scene.values import show
from impactfem.system.cuts import Cuts
from impactfem.system.link_shapes import named
from impactfem.system.located import Located, locate
from impactfem.system.regions import HeldRegion, HeldRegions, Key, region, triangles
from impactfem.system.surface import SurfaceNodes
from impactfem.system.tips import Tips

_NONE = 1e-12  # value of a shape function that is but rounding

if TYPE_CHECKING:
    from impactfem.models.solids import SolidPart


def held_regions(part: "SolidPart") -> dict[Key, HeldRegion]:
    """What joints hold of a solid (collective if there are joints).

    Raises:
        KeyedError: It has no such surface, or a region is empty or shared.
    """
    outside, found = part.outside, HeldRegions()
    for index, joint in enumerate(part.scene.couplings):
        if isinstance(joint, TieRows):
            continue
        for side, place in zip(joint.between or (), joint.places, strict=False):
            body, surfaces = side_of(side)
            if body != part.solid.name:
                continue
            (name,) = surfaces or ("",)
            where = part.scene.table_of(index)
            if surfaces and name not in outside.names:
                raise named(where, "between", side, outside.names, "surface")
            at = np.array(place or (0.0,) * part.solid.dim, dtype=np.float64)
            key = side, tuple(at.tolist()), joint.radius
            if surfaces:
                made = _region(part, name, at, joint.radius, (where, side))
            else:
                made = _inside(part, at, where)
            found.add(index, joint.name, key, made, alone=part.scene.holds_alone(index))
    return found.regions


def _region(
    part: "SolidPart", name: str, place: Floats, radius: float | None, where: tuple[str, str]
) -> HeldRegion:
    outside, cuts = part.outside, Cuts(part.solid.cuts)
    faces = outside.on([name])
    on = outside.touched(faces)
    points, corners = outside.points[on], triangles(outside.faces[faces], part.solid.dim)
    areas = outside.total(outside.areas, faces)[on]
    free = ~(part.supported[on] & ~cuts.on(points)).any(axis=1)
    numbers = np.searchsorted(np.flatnonzero(on), corners)
    whole, images = cuts.unfolded(points), cuts.numbers(points)
    weights = np.bincount(images.ravel(), np.tile(areas, len(images)), len(whole))
    faced = np.concatenate([image[numbers] for image in images])
    found = region(place, whole, faced, radius, weights, np.tile(free, len(images)), where)
    kept = found.nodes[: len(points)]
    return HeldRegion(
        outside.numbers[on][kept], points[kept], areas[kept], int(on.sum()), found.radius,
        found.why, cuts=cuts,
    )  # fmt: skip


def _inside(part: "SolidPart", place: Floats, where: str) -> HeldRegion:
    """Nodes of the cell about a place in a solid, by the values of their shape functions there."""
    system = part.system
    found = locate(system, part.solid, part.begun, place)
    if not isinstance(found, Located):
        near = ", ".join(f"{x:.6g}" for x in found)
        text = f" = {show(place.tolist())} is outside of {part.solid.name} by "
        text += f"{np.linalg.norm(found - place):.3g} m, near its place [{near}]: give one in it."
        raise KeyedError(where, "point", text)
    order = np.argsort(found.numbers)
    order = order[np.abs(found.values[order]) > _NONE]
    numbers = found.numbers[order]
    nodes = SurfaceNodes.of(part.comm, part.solid.dim, numbers, system.numbers)
    points = nodes.gather(system.positions.ravel())
    return HeldRegion(
        numbers, points, found.values[order], len(order), 0.0, "", turns=False,
        cuts=Cuts(part.solid.cuts),
    )  # fmt: skip


def supported(part: "SolidPart") -> Booleans:
    """Which nodes of the outside of a solid supports hold, (nodes, dim) (collective)."""
    system, outside = part.system, part.outside
    own = np.reshape(system.supports.lasting, (-1, part.solid.dim)).astype(np.float64)
    return everywhere(part.comm, outside.numbers, system.numbers, own) > 0.0


def tips_of(part: "SolidPart") -> Tips:
    """Tips of a solid, none if joints do not hold it (collective)."""
    return Tips(part.solid.name, part.system, part.regions)
