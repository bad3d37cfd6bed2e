"""How the solids of a scene meet: small or large sliding, who carries what, who meets nobody."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from impactfem.findings import Finding, warning
from impactfem.scene.pairing import body_pairs, friction_of, obstacles_of

if TYPE_CHECKING:
    from impactfem.contact.body_pairs import SurfacePair
    from impactfem.models.bodies import BodiesModel

Floats = NDArray[np.float64]

_SLIDES = 0.5  # of an element: way along each other from which pairs of surfaces follow


def choose_sliding(model: "BodiesModel", reasons: dict[str, str]) -> bool:
    """Whether pairs of surfaces have to follow the bodies, or may stay those of t = 0 (collective).

    They follow if a body turns, or if two bodies that can meet move along each other by more than
    half an element in the duration, by their speeds at t = 0 and gravity on bodies that are free.

    Args:
        model: The solids.
        reasons: Gets the reason for "normals".
    """
    scene = model.scene
    if scene.solve.normals is not None:
        reasons["normals"] = "as asked"
        return scene.solve.normals == "updated"
    for part in model.parts:
        if np.any(np.asarray(part.solid.angular_velocity, dtype=np.float64) != 0.0):
            reasons["normals"] = f"{part.solid.name} turns: pairs of surfaces follow the bodies"
            return True
    for pair in model.pairs:
        way, width = _way_along(model, pair), _face_size(pair)
        if way > _SLIDES * width:
            reasons["normals"] = (
                f"{pair.names[0]} and {pair.names[1]} move along each other by about {way:.2g} m, "
                f"{way / width:.2g} faces: pairs of surfaces follow the bodies"
            )
            return True
    reasons["normals"] = (
        'small sliding: pairs of surfaces are those of t = 0; normals = "updated" lets them follow'
    )
    return False


def _way_along(model: "BodiesModel", pair: "SurfacePair") -> float:
    """How far two bodies move along each other, square to the normal where they are nearest [m]."""
    met = pair.met([side.surface.points for side in pair.sides])
    if not met.count:
        return 0.0
    normal = met.normal[int(np.argmin(met.gap))]
    relative = _way(model, pair.bodies[0]) - _way(model, pair.bodies[1])
    return float(np.linalg.norm(relative - (relative @ normal) * normal))


def _way(model: "BodiesModel", body: int) -> Floats:
    """Way of a body by its mean speed, and by gravity unless a support holds it [m]."""
    part, scene = model.parts[body], model.scene
    dim, duration = part.solid.dim, scene.duration
    way: Floats = duration * part.system.mean(part.system.velocity)
    if any(support.kind != "symmetry" for support in part.solid.supports):
        return way
    gravity = np.asarray(scene.vector_gravity.at(0.0), dtype=np.float64)[:dim]
    return way + 0.5 * duration**2 * gravity


def _face_size(pair: "SurfacePair") -> float:
    """Typical width of the carrier's faces [m]."""
    surface = pair.sides[0].surface
    corners = surface.points[surface.corners]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return float(np.median(edges))


def told_pairs(model: "BodiesModel") -> dict[str, str]:
    """Reasons for the plan, one for each pair of bodies that can meet."""
    found = {}
    for pair in model.pairs:
        friction = friction_of(model.scene, *pair.names)
        words = f", friction {friction:g}" if friction else ""
        found[f"contact {pair.names[0]} and {pair.names[1]}"] = f"{pair.why} ({pair.count}{words})"
    return found


def findings_of(model: "BodiesModel") -> tuple[Finding, ...]:
    """What may be a mistake: bodies that nothing can touch, and pairs that cannot meet."""
    scene, found = model.scene, []
    met = {name for pair in model.pairs for name in pair.names}
    for part in model.parts:
        name, touches = part.solid.name, part.obstacle is not None and part.obstacle.count
        if name not in met and not touches:
            asked = any(name in {one, two} for (one, _), (two, _) in body_pairs(scene))
            why = "no face of it looks at another body or an obstacle"
            if not asked and not obstacles_of(scene, name):
                why = "no [[contact]] names it"
            found.append(warning("meets_nothing", f"body {name} touches nothing: {why}", name))
    pairs = [set(pair.names) for pair in model.pairs]
    for (one, _), (two, _) in body_pairs(scene) if scene.contacts else []:
        if {one, two} <= met and {one, two} not in pairs:
            text = f"bodies {one} and {two} cannot meet: none of their faces are opposite"
            found.append(warning("meets_nothing", text, f"{one}.{two}"))
    return tuple(found)
