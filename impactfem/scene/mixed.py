"""Scenes of several kinds of bodies, or of points, rods and beams, that only the one march solves.

Methods of single families know smooth obstacles at rest, points that meet, and no friction. The
march takes any bodies, any obstacle, and friction in the plane or in space.
"""

from collections.abc import Mapping
from itertools import pairwise

from impactfem.methods import METHODS
from impactfem.scene.contacts import Contact
from impactfem.scene.content import Body, Content
from impactfem.scene.laws import side_of
from impactfem.scene.pair_checks import check_laws
from impactfem.scene.pairing import named_body_pairs, obstacles_of
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

_MOST_CORNERS = 500  # of a body from a file whose edges and faces are looked at
"""Methods that take bodies of different kinds together."""


def check_mixed(scene: Content) -> None:
    """Refuse a scene for the march that contradicts itself.

    Args:
        scene: The scene, its fields checked one by one.

    Raises:
        KeyedError: naming the key.
    """
    check_laws(scene)
    known = {body.name: body for body in scene.bodies}
    checked: set[tuple[int, str]] = set()  # what one law of many pairs asks of a body
    for contact, origin in zip(scene.laws.each, scene.laws.origin, strict=True):
        new = [(origin, name) for name in contact.between if (origin, name) not in checked]
        if new or contact.rolling_resistance or contact.spinning_resistance:
            _check_contact(scene, contact, f"contact[{origin}]", known)
            checked.update(new)
    _check_partners(scene)
    alone = not (scene.obstacles or scene.couplings) and len(scene.bodies) == 1
    if alone and not all(body.may_meet_nothing for body in scene.bodies):
        raise KeyedError("obstacle", "", " is missing: nothing can be hit; add an [[obstacle]].")
    _check_method(scene)


def check_dimensions(scene: Content) -> None:
    """Refuse bodies of different kinds in different spaces, and friction on a line.

    Raises:
        KeyedError: naming the key.
    """
    alike = len(scene.solids) == len(scene.bodies) and not scene.couplings
    if alike or not scene.marches:
        return  # several solids are checked by their models
    for index, (before, body) in enumerate(pairwise(scene.bodies), start=1):
        if body.dim != before.dim:
            text = f": {body.name} has {body.dim} coordinates, but {before.name} has {before.dim}: "
            text += "give all the same number, to a bar by point and axis, to a beam by "
            text += "center and axis; in space a capsule of kind rigid is a rod."
            raise KeyedError(f"body[{index}]", "", text)
    if any(solid.is_axisymmetric for solid in scene.solids):
        for index, body in enumerate(scene.bodies):
            body.check_on_axis(f"body[{index}]")
        if scene.couplings:
            text = ": joints are not available beside axisymmetric solids, where balls stay on the "
            raise KeyedError("joint[0]", "", f"{text}axis; remove it.")
    if scene.dim > 1:
        return
    rubbing = [k for k, law in enumerate(scene.contacts) if law.friction_coefficient > 0.0]
    if rubbing:
        text = f" = {show(scene.contacts[rubbing[0]].friction_coefficient)}: on a line nothing "
        text += "slides; remove it, or give two coordinates."
        raise KeyedError(f"contact[{rubbing[0]}]", "friction_coefficient", text)


def _check_partners(scene: Content) -> None:
    """Refuse contact of edges and faces with what has none."""
    bodies = {body.name: body for body in scene.bodies}
    doubtful = {
        body.name
        for body in scene.bodies
        if body.has_corners or not body.is_convex or body.hull_corners > _MOST_CORNERS
    }
    for name, *sides in named_body_pairs(scene) if doubtful else ():
        if sides[0][0] not in doubtful and sides[1][0] not in doubtful:
            continue
        one, two = (bodies[body] for body, _ in sides)
        what = f" of {one.name} and {two.name} ({name}) is not available: "
        for body, other in ((one, two), (two, one)):
            if body.has_corners and not other.sees_edges:
                text = f"{body.name} has edges and faces, which a {other.kind} does not meet; "
                text += "list the pairs that may meet by [[contact]]."
                raise KeyedError("contact", "", what + text)
            _check_curved(body, other, what)
            _check_convex(body, what)
    for body in (body for body in scene.bodies if body.has_corners):
        for obstacle in obstacles_of(scene, body.name):
            ridges = obstacle.meets_sides(body)
            if obstacle.meets_corners and not ridges:
                continue
            if body.is_curved:
                ridges = obstacle.plane is not None or obstacle.surface is not None
            text = f" of {body.name} and {obstacle.name} is not available: "
            _check_convex(body, text)
            if not (obstacle.is_convex or ridges):
                text += f"{obstacle.name} may meet edges and faces of {body.name}, and is not "
                text += "convex; give boxes, a half_space, a mesh, or a body that is a ball."
                raise KeyedError("contact", "", text)


def _check_curved(body: Body, other: Body, what: str) -> None:
    """Refuse ellipsoids on what is not rigid."""
    if body.is_curved and not (other.rolls or other.has_corners or other.has_links):
        text = f"{body.name} is an ellipsoid, which meets rigid bodies, links and obstacles "
        text += "only; list the pairs that may meet by [[contact]], or give a hull."
        raise KeyedError("contact", "", what + text)


def _check_convex(body: Body, what: str) -> None:
    """Refuse edges and faces of bodies that are not convex, or whose hull has very many."""
    if not body.is_convex:
        text = f"{body.name} is not convex, and meets half-spaces and hollow obstacles only; list "
        text += "the pairs that may meet by [[contact]], or give convex bodies."
        raise KeyedError("contact", "", what + text)
    if body.hull_corners > _MOST_CORNERS:
        text = f"the hull of {body.name} has {body.hull_corners} corners, more than "
        text += f"{_MOST_CORNERS}: give a coarser mesh, or a shape."
        raise KeyedError("contact", "", what + text)


def _check_contact(scene: Content, contact: Contact, where: str, known: Mapping[str, Body]) -> None:
    sides = [known[name] for entry in contact.between if (name := side_of(entry)[0]) in known]
    stiff = any(not body.waves for body in sides)
    for body in sides:
        if body.waves:
            _check_waves(body, contact, where, stiff=stiff)
    for law in ("rolling_resistance", "spinning_resistance"):
        value = getattr(contact, law)
        if value and (not any(body.is_round for body in sides) or scene.dim + (law[0] == "r") < 3):
            text = f" = {show(value)}: none of {' and '.join(contact.between)} is round and turns "
            text += "so; remove it, or give a body of kind rigid that is a disc or capsule, in "
            raise KeyedError(where, law, f"{text}space a sphere, capsule or cylinder.")
        names = {side_of(entry)[0] for entry in contact.between}
        turning = [o.name for o in scene.obstacles if o.name in names and o.rotation is not None]
        if value and turning:
            text = f" = {show(value)} is not available on {turning[0]}, which turns; remove it."
            raise KeyedError(where, law, text)


def _check_waves(body: Body, contact: Contact, where: str, *, stiff: bool) -> None:
    """Refuse laws that need mass where a body touches; ``stiff`` is whether the other one has."""
    for law in contact.laws_of_mass:
        text = f" = {show(getattr(contact, law))}"
        if "restitution" in law:
            text += f": {body.name} rebounds by its own elasticity, which needs no such law; "
            raise KeyedError(where, law, f"{text}remove it.")
        if not stiff:
            text += f" is not available on {body.name}: it is for points and rigid bodies, on each "
            raise KeyedError(where, law, f"{text}other or on what gives; remove it.")


def _check_method(scene: Content) -> None:
    method = scene.solve.method
    limited = method is not None and METHODS[method].stable == "limited"
    mixes = method is not None and METHODS[method].mixes
    if limited and scene.solids and mixes:
        _check_explicit(scene)
    if method is None or (mixes and (scene.solids or not limited)):
        return
    fitting = " or ".join(
        show(name)
        for name, each in METHODS.items()
        if each.mixes and (scene.solids or each.stable == "always")
    )
    what = scene.why_marched or f"bodies of kind {' and '.join(sorted(scene.kinds))}"
    text = f" = {show(method)} does not solve {what}: give {fitting}."
    raise KeyedError("solve", "method", text)


def _check_explicit(scene: Content) -> None:
    """Refuse what is not stepped amid the layers of explicit solids."""
    remedy = 'remove it, or give solve.method = "conserving".'
    solids = {solid.name for solid in scene.solids}
    for index, body in enumerate(scene.bodies):
        if body.name not in solids and (body.has_surface or not body.staggers):
            text = f" = {show(body.kind)}: beside solids in explicit steps {body.name} has none "
            raise KeyedError(f"body[{index}]", "kind", f"{text}that end amid theirs; {remedy}")
