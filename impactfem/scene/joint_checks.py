"""Checks of joints against the bodies of their scene, and against each other."""

import numpy as np

from impactfem.scene.breaks import check_motion
from impactfem.scene.content import BODIES, Content
from impactfem.scene.cut_joints import check_cuts
from impactfem.scene.joints import GROUND, JOINTS, Joint
from impactfem.scene.laws import side_of
from impactfem.scene.nearest import meant
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show


def check_joints(scene: Content) -> None:
    """Refuse joints that hold what is not there, or what cannot be held.

    Raises:
        KeyedError: naming the key.
    """
    bodies = {body.name: body for body in scene.bodies}
    taken = {**{name: f"body {name}" for name in bodies}}
    taken |= {obstacle.name: f"obstacle {obstacle.name}" for obstacle in scene.obstacles}
    if scene.joints and GROUND in taken:
        text = f" = {show(GROUND)} is what joints call what does not move: give another name."
        raise KeyedError(taken[GROUND], "name", text)
    known = {joint.name: joint for joint in scene.joints}
    for index, joint in enumerate(scene.joints):
        where = scene.table_of(index)
        carries = [body for body in joint.bodies if body in bodies and bodies[body].attached]
        if joint.name in taken and not carries:
            text = f" = {show(joint.name)} is the name of {taken[joint.name]} too: give another."
            raise KeyedError(where, "name", text)
        taken[joint.name] = where
        for name in joint.joints or ():
            if name not in known or not known[name].moves:
                moving = [each.name for each in scene.joints if each.moves]
                text = f" = {show(list(joint.joints or ()))}: {show(name)} is no joint with a "
                text += f"coordinate; give two of {', '.join(moving) or 'these, there is none'}."
                raise KeyedError(where, "joints", text)
        for name in joint.between or ():
            _check_side(scene, where, name, joint.between or (), springs=bool(carries))
        _check_turns(scene, where, joint)
        dim = joint.dim
        if dim is not None and dim != scene.dim:
            key = "point" if joint.points is None else "points"
            text = f" has {dim} coordinates, the bodies have {scene.dim}: give {scene.dim}."
            raise KeyedError(where, key, text)
        if joint.preload is not None and not scene.starts_at_rest:
            text = f' = {show(joint.preload)} is reached by a static start: give start = "static".'
            raise KeyedError(where, "preload", text)
        _check_places(scene, where, joint)
        _check_radius(scene, where, joint)
        _check_motions(scene, where, joint)
        _check_in_steps(scene, where, joint)
        check_cuts(scene, where, joint)


def check_couplings(scene: Content) -> None:
    """Refuse springs between what is not there.

    Raises:
        KeyedError: naming the key.
    """
    bodies = {body.name: body for body in scene.bodies}
    taken = {*bodies, GROUND} | {each.name for each in (*scene.obstacles, *scene.joints)}
    for index, spring in enumerate(scene.springs):
        where = f"spring[{index}]"
        if spring.name in taken:
            text = f" = {show(spring.name)} is the name of something else: give another."
            raise KeyedError(where, "name", text)
        taken.add(spring.name)
        for name in spring.between:
            _check_side(scene, where, name, spring.between, springs=True)
        if scene.dim not in {2, 3}:
            text = f" = {show(list(spring.between))}: bodies have {scene.dim} coordinate, springs "
            text += "act in the plane or in space: give these positions of 2 or 3 numbers."
            raise KeyedError(where, "between", text)
        spring.check_in(where, scene.dim)
        for first, row in enumerate(spring.rows(scene.dim)):
            check_cuts(scene, where, row)
            if first > 0:
                continue
            _check_in_steps(scene, where, row)
            if spring.has_places:
                _check_places(scene, where, row)
        for name in spring.between:
            body, part = side_of(name)
            if not (spring.has_places or part or name == GROUND or bodies[body].has_centre):
                text = f" is missing: {name} is a {bodies[body].kind}; give the place on it."
                raise KeyedError(where, "point", text)


def check_ties(scene: Content) -> None:
    """Refuse ties of what has no surface that is glued, or is not there.

    Raises:
        KeyedError: naming the key.
    """
    bodies = {body.name: body for body in scene.bodies}
    others = *scene.obstacles, *scene.joints, *scene.springs
    taken = {*bodies, GROUND} | {each.name for each in others}
    for index, tie in enumerate(scene.ties):
        where = f"tie[{index}]"
        if tie.name in taken:
            text = f" = {show(tie.name)} is the name of something else: give another."
            raise KeyedError(where, "name", text)
        taken.add(tie.name)
        given = f" = {show(list(tie.between))}: "
        for name in tie.between:
            _check_side(scene, where, name, tie.between)
            whole = side_of(name)[0]
            if name != GROUND and not bodies[whole].tied:
                text = f"{whole} is a {bodies[whole].kind}, ties hold surfaces of solids to each "
                text += "other, to rigid bodies or the ground; give these, or a joint of kind "
                raise KeyedError(where, "between", f'{given}{text}"fixed".')
        sides = [side_of(name) for name in tie.between]
        if sides[0][0] == sides[1][0]:
            text = f"both are of {sides[0][0]}: give surfaces of two bodies."
            raise KeyedError(where, "between", given + text)
        if not any(part for _, part in sides):
            text = "neither is a surface of a solid: give one, or a joint of kind "
            raise KeyedError(where, "between", f'{given}{text}"fixed".')
        _check_in_steps(scene, where, tie.rows(scene.dim))


def _check_in_steps(scene: Content, where: str, joint: Joint) -> None:
    """Refuse what joints do not hold in steps by iterates."""
    bodies = {body.name: body for body in scene.bodies}
    fixed = [n for n in sorted(joint.bodies & set(bodies)) if not bodies[n].joined_in_steps]
    if fixed and scene.iterated:
        kinds = " and ".join(kind for kind, cls in BODIES.items() if cls.joined_in_steps)
        text = f" = {show(list(joint.between or ()))}: joints hold bodies of kind {kinds} "
        text += f"where {scene.iterated}, but {fixed[0]} is a {bodies[fixed[0]].kind}; model "
        raise KeyedError(where, "between", f"{text}it as one of these, or change that.")


def _check_motions(scene: Content, where: str, joint: Joint) -> None:
    """Refuse motions that jump."""
    check_motion(where, "motion", joint.motion or (), scene.duration, from_zero=True)
    if joint.is_driven:
        unit = joint.kind_of.unit or ""
        check_motion(where, "position", [joint.position], scene.duration, unit)


def _check_turns(scene: Content, where: str, joint: Joint) -> None:
    """Refuse kinds that hold turns of what has none."""
    bodies = {body.name: body for body in scene.bodies}
    each = (name.partition("/") for name in joint.between or () if name != GROUND)
    still = [body + slash + on for body, slash, on in each if not bodies[body].turns_at(on)]
    if not still:
        return
    kind, text = joint.kind_of, f" = {show(joint.kind)}: {' and '.join(still)} "
    if not kind.pins:
        able = " or ".join(
            show(name) for name, each in JOINTS.items() if each.pins and scene.dim in each.dims
        )
        raise KeyedError(where, "kind", f"{text}does not turn; give {able}, or a rigid body.")
    if kind.axis[scene.dim - 2] and len(still) == 2:
        text += 'do not turn, so that neither leads its axis; give "distance", or a rigid body.'
        raise KeyedError(where, "kind", text)


def _check_places(scene: Content, where: str, joint: Joint) -> None:
    """Refuse places that are not on what is held there."""
    bodies = {body.name: body for body in scene.bodies}
    for side, name in enumerate(joint.between or ()):
        place, (whole, _, part) = np.asarray(joint.places[side], dtype=float), name.partition("/")
        if name == GROUND or (near := bodies[whole].missed(place, part)) is None:
            continue
        key = "point" if joint.points is None else f"points[{side}]"
        text = f" = {show(list(joint.places[side]))} is not on {name}, which joints hold {near}: "
        raise KeyedError(where, key, f"{text}give a place there.")


def _check_radius(scene: Content, where: str, joint: Joint) -> None:
    """Refuse a radius of what has no surface."""
    bodies = {body.name: body for body in scene.bodies}
    each = [side_of(name) for name in joint.between or ()]
    known = [(bodies[body].parts_in_joints, part) for body, part in each if body in bodies]
    if any(body in bodies and bodies[body].attached for body, _ in each):
        return
    if joint.radius is None or any(
        parts == "regions" or (part and parts == "surfaces") for parts, part in known
    ):
        return
    text = f" = {show(joint.radius)} is that of a region of a surface, and joint {joint.name} holds"
    text += ' none: remove it, or name a plate, or a surface of solids or springs, as "block/top".'
    raise KeyedError(where, "radius", text)


def _check_side(
    scene: Content, where: str, name: str, between: object, *, springs: bool = False
) -> None:
    """Refuse a side of a joint that is no body that joints hold, nor the ground."""
    bodies = {body.name: body for body in scene.bodies}
    if name == GROUND:
        return
    given = f" = {show(list(between))}: "  # type: ignore[call-overload]
    whole, part = side_of(name)
    body = bodies.get(whole)
    if body is not None and springs and body.sprung_inside and not part:
        return
    if body is not None and not (body.joined_by_surface if part else body.joined_whole):
        text = f"{whole} is a {body.kind}, "
        if part is None:
            parts = body.parts_in_joints
            text += f"of which joints hold {parts}: give {show(f'{name}/{parts[:-1].upper()}')}."
        else:
            text += f"which joints hold as a whole: give {show(whole)}."
        raise KeyedError(where, "between", given + text)
    known = None if body is None or not part else body.joint_parts
    if part and known is not None and part[0] not in known:
        text = f"there is no surface {show(name)}; {meant(part[0], known or [whole])}."
        raise KeyedError(where, "between", given + text)
    if part is not None:
        name = whole
    if name not in bodies:
        able = [*(body.name for body in scene.bodies if body.takes_joints), GROUND]
        text = f"there is no body {show(name)}; {meant(name, able)}."
        raise KeyedError(where, "between", given + text)
    if not bodies[name].takes_joints:
        kinds = " and ".join(kind for kind, cls in BODIES.items() if cls.takes_joints)
        text = f"{name} is a {bodies[name].kind}, joints hold bodies of kind {kinds}; model it as "
        raise KeyedError(where, "between", given + text + "one of these, or remove the joint.")
