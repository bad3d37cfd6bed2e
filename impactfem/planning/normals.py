"""Do contact normals and pairs of surfaces stay those of t = 0, or do they follow the bodies?"""

import math
from typing import TYPE_CHECKING

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.obstacles.rotation import placement
from impactfem.scene.pairing import named_body_pairs

if TYPE_CHECKING:
    from impactfem.contact.body_pairs import SurfacePair
    from impactfem.models.solids import SolidPart, SolidsModel


_FAR = 0.1  # ways over the size of an obstacle's features from which its normals change much
_PAIRS_FOLLOW = (
    "pairs of surfaces follow the bodies, and energy is right to first order in step and faces "
    '(with method = "conserving" to rounding)'
)
_LOOKS = 65  # at the ways of bodies that do not face each other at t = 0
_SLIDES = 0.5  # of an element: way along each other from which pairs of surfaces follow


def choose_normals(model: "SolidsModel", reasons: dict[str, str]) -> bool:
    """Whether normals and pairs have to follow the bodies, or may stay those of t = 0 (collective).

    They follow if a body that meets another one turns, if two that can meet move along each other
    by more than half an element within the duration, or if one moves far over a curved obstacle.

    Args:
        model: The solids, with pairs that do not follow.
        reasons: Gets the reason for "normals".
    """
    asked = model.scene.solve.normals
    if asked is not None:
        reasons["normals"] = "as asked"
        return asked == "updated"
    looks = (_finite, _turned, _turning, _sliding, _passing, _over_curves)
    follows = next(filter(None, (look(model) for look in looks)), "")
    reasons["normals"] = follows or _why_fixed(model)
    return bool(follows)


def _finite(model: "SolidsModel") -> str:
    for part in model.parts:
        if part.solid.is_finite:
            return f"updated: {part.solid.name} may turn at will, distances follow its nodes"
        if why := part.solid.why_iterated:
            return f"updated: {part.solid.name} {why}, and distances follow its nodes"
    return ""


def _turned(model: "SolidsModel") -> str:
    for part in model.parts:
        for obstacle in part.obstacles:
            if obstacle.rotation:
                return f"updated in each time step: {obstacle.name} turns, and its normals with it"
    return ""


def _turning(model: "SolidsModel") -> str:
    for part in model.parts if model.pairs else ():
        if np.any(np.asarray(part.solid.angular_velocity, dtype=np.float64) != 0.0):
            return f"{part.solid.name} turns: {_PAIRS_FOLLOW}"
    return ""


def _sliding(model: "SolidsModel") -> str:
    for pair in model.pairs:
        way, width = _way_along(model, pair), _face_size(pair)
        if way > _SLIDES * width:
            return (
                f"{pair.names[0]} and {pair.names[1]} move along each other by about {way:.2g} m, "
                f"{way / width:.2g} faces: {_PAIRS_FOLLOW}"
            )
    return ""


def _passing(model: "SolidsModel") -> str:
    """Bodies of which no face looks at the other's at t = 0 may still come into its way."""
    from impactfem.contact.body_pairs import box, boxes_apart  # noqa: PLC0415  (loads SciPy)

    met = [set(pair.names) for pair in model.pairs]
    parts = {part.solid.name: part for part in model.parts}
    for _, (one, _), (two, _) in named_body_pairs(model.scene):
        if one in parts and two in parts and one != two and {one, two} not in met:
            shares = np.linspace(0.0, 1.0, _LOOKS)
            ways = _way(parts[one], shares) - _way(parts[two], shares)
            step = np.abs(np.diff(ways, axis=0)).max()  # nothing passes between two looks
            (low, high), other = (
                _turned_box(parts[name], *box(parts[name].places)) for name in (one, two)
            )
            near = any(boxes_apart((low + way, high + way), other) <= step for way in ways)
            if step > 0.0 and near:
                return f"{one} and {two} face each other later than at t = 0: {_PAIRS_FOLLOW}"
    return ""


def _turned_box(part: "SolidPart", low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Box around a body at t = 0, of one that turns whatever its angle."""
    if np.any(np.asarray(part.solid.angular_velocity, dtype=np.float64) != 0.0):
        middle, half = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
        return middle - half, middle + half
    return low, high


def _over_curves(model: "SolidsModel") -> str:
    for part in model.parts:
        limit = _FAR * min((o.features for o in part.obstacles), default=math.inf)
        if part.contact is None or not part.contact.count or limit == math.inf:
            continue
        nearest = int(np.argmin(part.contact.gap))
        gap = float(part.contact.gap[nearest])
        along = _way_over(part, part.contact.normal[nearest])
        if max(gap, along) > limit:
            return (
                f"updated in each time step: {part.solid.name} moves {gap:.3g} m towards the "
                f"obstacle and about {along:.3g} m along it, where its normal changes; energy is "
                "then kept to the accuracy of the step only"
            )
    return ""


def _why_fixed(model: "SolidsModel") -> str:
    if model.pairs:
        return (
            "small sliding: pairs of surfaces are those of t = 0; "
            'normals = "updated" lets them follow'
        )
    if not model.contact_count:
        return "fixed: nothing can touch"
    if not any(part.obstacles for part in model.parts):
        return "those between bodies without meshes and others follow in each time step"
    features = min((o.features for part in model.parts for o in part.obstacles), default=math.inf)
    if features == math.inf:
        return "fixed: the normal of a plane is the same everywhere, so this is exact"
    return (
        f"fixed: until and along the contact the body moves by less than {_FAR * features:.3g} m, "
        "a tenth of the obstacle's radius or shortest face"
    )


def _way_along(model: "SolidsModel", pair: "SurfacePair") -> float:
    """How far two bodies move along each other, square to the normal where they are nearest [m]."""
    met = pair.met([side.surface.points for side in pair.sides])
    if not met.count:
        return 0.0
    normal = met.normal[int(np.argmin(met.gap))]
    one, two = (model.parts[body] for body in pair.bodies)
    end = np.ones(1)
    return _across(_way(one, end)[0] - _way(two, end)[0], normal)


def _way(part: "SolidPart", shares: Floats) -> Floats:
    """Ways of a body by its mean speed, and by gravity unless a support holds it [m].

    Args:
        part: The body.
        shares: Of the duration, (times,).

    Returns:
        (times, dim).
    """
    times = part.scene.duration * shares[:, None]
    ways: Floats = times * part.system.mean(part.system.velocity)
    if not _is_held(part):
        ways = ways + 0.5 * times**2 * np.asarray(part.scene.vector_gravity.at(0.0))
    return ways


def _is_held(part: "SolidPart") -> bool:
    return any(not support.mirrors for support in part.solid.supports)


def _way_over(part: "SolidPart", normal: Floats) -> float:
    """Way of a body and its obstacles across a normal within the duration [m], at most about."""
    duration, gravity = part.scene.duration, part.scene.vector_gravity
    way = _across(part.system.mean(part.system.velocity), normal) * duration
    if not _is_held(part):
        pulls = (_across(gravity.at(t), normal) for t in gravity.times)
        way += 0.5 * max(pulls) * duration**2
    for obstacle in part.obstacles:
        if obstacle.motion is not None:
            shift = placement(obstacle, duration).shift - placement(obstacle, 0.0).shift
            way += _across(np.asarray(shift), normal)
    return way


def _face_size(pair: "SurfacePair") -> float:
    """Typical width of the carrier's faces [m]."""
    surface = pair.sides[0].surface
    corners = surface.points[surface.corners]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return float(np.median(edges))


def _across(vector: Floats, normal: Floats) -> float:
    """Length of the part of a vector across a unit normal."""
    return float(np.linalg.norm(vector - (vector @ normal) * normal))
