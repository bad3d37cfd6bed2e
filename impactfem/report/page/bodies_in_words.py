"""Each kind of body in words: size, material, initial state, supports and loads."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from impactfem.report.page.numbers import (
    constant,
    counted,
    formula,
    formulas,
    is_zero,
    listed,
    number,
    quantity,
    vector,
)
from impactfem.scene import Scene
from impactfem.scene.schema import keys_of
from impactfem.scene.values import show

_MODELS = {
    "plane_strain": "in plane strain",
    "plane_stress": "in plane stress",
    "axisymmetric": "axisymmetric: x is the radius, y the axis",
    "3d": "in three dimensions",
}


def body_in_words(scene: Scene, body: Any) -> str:
    """Sentences about one body of a scene; plain text."""
    return _BODIES.get(body.kind, any_in_words)(scene, body)


def any_in_words(scene: Scene, body: Any) -> str:  # noqa: ARG001  (as the others)
    """A body or an obstacle by the values of its keys."""
    given = (
        f"{entry.name} = {show(value)}{f' {entry.unit}' if entry.unit else ''}"
        for name, entry in keys_of(type(body)).items()
        if name != "name" and (value := getattr(body, name)) is not None
    )
    article = "An" if body.kind[0] in "aeiouAEIOU" else "A"
    return f"{article} {body.kind}: {', '.join(given)}."


def _bar(scene: Scene, bar: Any) -> str:
    speed, start = constant(bar.velocity), constant(bar.displacement)
    text = f"A bar of length {quantity(bar.length, 'm')} "
    text += _flight_in_row(bar, speed) if len(scene.bars) > 1 else _flight(bar, speed)
    if start is None:
        text += f" It starts strained, with the displacement {formula(bar.displacement, 'm')}."
    if bar.far_end_displacement.plain != 0.0:
        text += f" Its far end is moved by {formula(bar.far_end_displacement, 'm')}."
    elif bar.far_end_force.plain != 0.0:
        text += f" On its far end acts the force {formula(bar.far_end_force, 'N')} along the axis."
    elif bar.far_end == "clamped":
        text += " Its far end is held."
    elif len(scene.bars) < 2:
        text += " Its far end is free."
    if bar.is_loaded:
        text += f" Along it acts the load {formula(bar.load, 'N/m')}."
    return (
        f"{text} Young's modulus {_property(bar, 'youngs_modulus', 'Pa')}, density "
        f"{_property(bar, 'density', 'kg/m³')}, section {_property(bar, 'area', 'm²')}; so waves "
        f"run at {quantity(bar.wave_speed, 'm/s')}{' in the mean' * (not bar.is_uniform)} and its "
        f"mass is {quantity(bar.mass, 'kg')}."
    )


def _property(bar: Any, name: str, unit: str) -> str:
    given = getattr(bar, name)
    return quantity(given, unit) if isinstance(given, float) else formula(given, unit)


def _flight(bar: Any, speed: float | None) -> str:
    """How a single bar starts, seen from the wall."""
    gap = float(bar.initial_displacement(x=0.0))
    wall = "a rigid wall"
    if bar.wall_stiffness is not None:
        wall = f"a wall of {quantity(bar.wall_stiffness, 'N/m')}"
    away = f"{wall} {quantity(gap, 'm')} away" if gap else f"{wall} it touches"
    if speed is None:
        return f"starts with the velocity {formula(bar.velocity, 'm/s')} before {away}."
    if speed < 0.0:
        return f"flies at {quantity(-speed, 'm/s')} towards {away}."
    if speed > 0.0:
        return f"flies at {quantity(speed, 'm/s')} away from {away}."
    return f"starts at rest before {away}."


def _flight_in_row(bar: Any, speed: float | None) -> str:
    near = float(bar.initial_displacement(x=0.0))
    place = f"with its near end at x = {quantity(near, 'm')}"
    if speed is None:
        return f"starts {place}, with the velocity {formula(bar.velocity, 'm/s')}."
    if speed:
        return f"starts {place} and flies at {quantity(speed, 'm/s')} along x."
    return f"starts at rest, {place}."


def _solid(scene: Scene, solid: Any) -> str:
    shape = _shape(solid) if solid.shape else f"A body with the mesh of {solid.mesh}"
    thick = f", {quantity(solid.thickness, 'm')} thick" if solid.is_plane else ""
    text = f"{shape}, {_MODELS[solid.model]}{thick}. {_state(scene, solid)}"
    for group, one in (solid.of_groups or {"": solid}).items():
        law = f"{group}: {one.law_in_words}" if group else one.law_in_words
        text += f" {law[0].upper()}{law[1:]}: {_constants(one)}, density "
        text += _property(one, "density", "kg/m³")
        speed = one.is_uniform and quantity(one.p_wave_speed, "m/s")
        text += f"; its fastest waves run at {speed}." if speed else "."
    if solid.mass is not None and solid.shape is not None:
        parts = 2 ** len(solid.shape.symmetry)
        text += f" Its mass is {quantity(parts * solid.mass, 'kg')}."
    return text + _boundary(solid) + _damping(solid)


def _constants(solid: Any) -> str:
    """Moduli of a material."""
    law = solid.orthotropic
    if law is None:
        modulus = _property(solid, "youngs_modulus", "Pa")
        nu = solid.poisson_ratio
        ratio = number(nu) if isinstance(nu, float | int) else formula(nu, "")
        return f"Young's modulus {modulus}, Poisson's ratio {ratio}"
    along = [law.e1, law.e2] + [law.e3] * (law.e3 is not None)
    moduli = ", ".join(quantity(value, "Pa") for value in along)
    turned = f", axis 1 at {quantity(law.angle, 'rad')} from x" * (law.angle != 0.0)
    return f"Young's moduli {moduli} along axes 1, 2, 3{turned}"


def _block(shape: Any, *, flat: bool, revolved: bool) -> str:  # noqa: ARG001
    edges = listed(shape.size, "m", " × ")
    what = f"A {'rectangle' if flat else 'block'} of {edges}"
    return f"{what} from the corner {vector(shape.corner, 'm')}"


def _cylinder(shape: Any, *, flat: bool, revolved: bool) -> str:  # noqa: ARG001
    size = f"radius {quantity(shape.radius, 'm')} and height {quantity(shape.height, 'm')}"
    return f"A cylinder of {size} on {vector(shape.center, 'm')}"


def _ring(shape: Any, *, flat: bool, revolved: bool) -> str:  # noqa: ARG001
    radii = listed((shape.inner_radius, shape.radius), "m", " and ")
    what = f"A {'ring' if flat else 'hollow body'} of radii {radii}"
    return f"{what} around {vector(shape.center, 'm')}"


def _disc(shape: Any, *, flat: bool, revolved: bool) -> str:
    what = "disc" if flat else "torus of round section" if revolved and shape.center[0] else "ball"
    return f"A {what} of radius {quantity(shape.radius, 'm')} around {vector(shape.center, 'm')}"


_SHAPES: Mapping[str, Callable[..., str]] = {
    "block": _block, "cylinder": _cylinder, "ring": _ring, "disc": _disc, "sphere": _disc,
}  # fmt: skip


def _shape(solid: Any) -> str:
    shape, revolved = solid.shape, solid.is_axisymmetric
    flat = solid.dim == 2 and not revolved
    text = _SHAPES[shape.kind](shape, flat=flat, revolved=revolved)
    if shape.angle:
        text += f", turned by {quantity(shape.angle, 'rad')}"
    if shape.symmetry:
        share = {1: "half", 2: "a quarter", 3: "an eighth"}[len(shape.symmetry)]
        cuts = " and ".join(shape.symmetry)
        text += f" (by symmetry only {share} is modelled, cut square to {cuts})"
    return text


def _state(scene: Scene, solid: Any) -> str:
    spin = solid.angular_velocity
    turns = any(spin) if isinstance(spin, tuple) else bool(spin)
    parts = []
    if not is_zero(solid.velocity):
        parts.append(f"with the velocity {formulas(solid.velocity, 'm/s')}")
    if turns:
        shown = vector(spin, "rad/s") if isinstance(spin, tuple) else quantity(spin, "rad/s")
        parts.append(f"turning at {shown}")
    if not is_zero(solid.displacement):
        parts.append(f"with the displacement {formulas(solid.displacement, 'm')}")
    if scene.starts_at_rest:
        parts.insert(0, "in equilibrium of its loads, supports and contact")
    return f"It starts {' and '.join(parts)}." if parts else "It starts at rest, unstrained."


def _boundary(solid: Any) -> str:
    text = ""
    for support in solid.supports:
        how = {
            "fixed": "is held",
            "symmetry": "does not move along its normal",
            "motion": f"is moved by {formulas(support.value or (), 'm')}",
        }[support.kind]
        text += f" Its surface {support.surface} {how}{_end(support)}."
    for load in solid.tractions:
        text += f" A force per area {formulas(load.value, 'Pa')} acts on {load.surface}"
        text += f"{_end(load)}."
    for load in solid.pressures:
        follows = ", which it follows" if load in solid.following else ""
        text += f" A pressure {formula(load.value, 'Pa')} pushes on {load.surface}{follows}"
        text += f"{_end(load)}."
    return text


def _end(what: Any) -> str:
    return "" if what.until is None else f", until {quantity(what.until, 's')}"


def _damping(body: Any) -> str:
    parts = []
    if body.rayleigh_mass:
        parts.append(f"{quantity(body.rayleigh_mass, '1/s')} times the mass")
    if stiff := getattr(body, "rayleigh_stiffness", 0.0):
        parts.append(f"{quantity(stiff, 's')} times the stiffness")
    for share, time in getattr(body, "relaxing", ()):
        parts.append(f"{number(share)} times the stiffness that relaxes in {quantity(time, 's')}")
    if quality := getattr(body, "quality_factor", None):
        parts.append(f"a quality factor of {number(quality)} for the first mode")
    if ratios := getattr(body, "damping_ratio", None):
        ratios = ratios if isinstance(ratios, tuple) else (ratios,)
        shown = " ".join(number(ratio) for ratio in ratios)
        of = f"first {len(ratios)} modes" if len(ratios) > 1 else "first mode"
        parts.append(f"{shown} of the critical one for the {of}, by the stiffness beyond")
    return f" Damping: {' plus '.join(parts)}." if parts else ""


def _point(scene: Scene, point: Any) -> str:
    what = f"A ball of radius {quantity(point.radius, 'm')} that does not turn, "
    text = what if point.radius else "A point "
    text += f"of mass {quantity(point.mass, 'kg')}"
    if scene.dim == 1:
        text += f", at x = {quantity(point.position[0], 'm')}"
        speed = quantity(point.velocity[0], "m/s")
    else:
        text += f", at {vector(point.position, 'm')}"
        speed = vector(point.velocity, "m/s")
    text += f", with the velocity {speed}." if any(point.velocity) else ", at rest."
    if point.force is not None:
        text += f" The force {formulas(point.force, 'N')} acts on it."
    for spring in point.springs[:4]:
        end = spring.to or vector(spring.anchor, "m")
        rest = f" of free length {quantity(spring.rest_length, 'm')}" if spring.rest_length else ""
        damper = f" with damping {quantity(spring.damping, 'N s/m')}" if spring.damping else ""
        text += f" A spring of {quantity(spring.stiffness, 'N/m')}{rest}{damper} ties it to {end}."
    if len(point.springs) > 4:
        text += f" {len(point.springs) - 4} more springs."
    return text


def _slender_state(body: Any) -> str:
    place = body.middle.tolist() if getattr(body, "centerline", None) else body.center
    text = f"its centre at {vector(place, 'm')}"
    if body.inclination:
        degrees = number(math.degrees(body.inclination), 4)
        text += f", inclined by {quantity(body.inclination, 'rad')} ({degrees}°)"
    moving, spin = body.velocity or (), np.atleast_1d(body.angular_velocity or 0.0).tolist()
    if any(moving):
        text += f", with the velocity {vector(moving, 'm/s')}"
    if any(spin):
        turning = quantity(spin[0], "rad/s") if len(spin) == 1 else vector(spin, "rad/s")
        text += f", turning at {turning}"
    return text if any(moving) or any(spin) else f"{text}, at rest"


def _rod(_: Scene, rod: Any) -> str:
    text = f"A rigid rod of length {quantity(rod.length, 'm')} and mass {quantity(rod.mass, 'kg')}"
    ends = f", its ends rounded with {quantity(rod.radius, 'm')}" if rod.radius else ""
    return f"{text}{ends}; {_slender_state(rod)}. Its ends touch obstacles."


def _beam_axis(beam: Any) -> str:
    """Where a beam in space lies, and how a curved one does."""
    if beam.centerline is not None:
        return f"its axis at rest along {formulas(beam.centerline, 'm')} for s from 0 to 1; "
    if not beam.in_space:
        return ""
    along, _, wide = beam.frame.round(12).tolist()
    return f"its axis along {vector(along)}, its width along {vector(wide)}; "


def _beam(_: Scene, beam: Any) -> str:
    size = f"{quantity(beam.length, 'm')} long, {quantity(beam.height, 'm')} high"
    theory = "Timoshenko" if beam.theory == "timoshenko" else "Euler-Bernoulli"
    shear = f", Poisson's ratio {number(beam.poisson_ratio)}" if theory == "Timoshenko" else ""
    touch = "All nodes of its axis may touch" if beam.touches_along else "Its ends touch"
    held = " and ".join(f"{s.kind.replace('_', ' ')} at its {s.end} end" for s in beam.supports)
    text = (
        f"An elastic beam, {held or 'free'}, {size} and {quantity(beam.width, 'm')} wide; "
        f"{_beam_axis(beam)}{_slender_state(beam)}."
        f" {theory} theory{' at any rotation' * beam.is_finite} on "
        f"{counted(beam.elements, 'element')}: Young's modulus "
        f"{quantity(beam.youngs_modulus, 'Pa')}{shear}, density "
        f"{quantity(beam.density, 'kg/m³')}; its mass is {quantity(beam.mass, 'kg')}. {touch} "
        "obstacles."
    )
    mass, stiffness = beam.rayleigh_damping
    if mass or stiffness:
        text += f" Damping: {quantity(mass, '1/s')} times the mass plus "
        text += f"{quantity(stiffness, 's')} times the stiffness."
    return text


def _springs(_: Scene, body: Any) -> str:
    origin = body.mesh or f"a {body.shape.kind} filled with {body.pattern or 'triangles'}"
    text = f"Masses of {quantity(body.mass, 'kg')} in all and springs of "
    text += f"{quantity(body.stiffness, 'N/m')} on the edges of {origin}"
    start = body.centre_velocity().tolist()
    if any(start):
        text += f", with the velocity {vector(start, 'm/s')}"
    spin = np.atleast_1d(body.angular_velocity or 0.0).tolist()
    if any(spin):
        turning = quantity(spin[0], "rad/s") if len(spin) == 1 else vector(spin, "rad/s")
        text += f", turning at {turning}"
    held = [support.surface for support in body.supports]
    text = f"{text}, held at {', '.join(held)}." if held else f"{text}."
    return (
        text if body.force is None else f"{text} The force {formulas(body.force, 'N')} acts on it."
    )


def _plate(scene: Scene, plate: Any) -> str:
    origin = plate.mesh or f"a {plate.outline.kind}"
    thick = f"{quantity(plate.depth, 'm')} thick"
    if plate.thickness is not None and not plate.thickness.is_constant:
        thick = f"{formula(plate.thickness, 'm')} thick"
    text = f"An elastic plate, {origin} {thick} about "
    text += f"{vector(plate.center, 'm')}, its normal along {vector(plate.frame[1][2], '')}. "
    text += f"{_THEORIES[plate.theory_beside(scene.bodies)]}'s theory on triangles: "
    if plate.layers:
        each = (f"{quantity(e.thickness, 'm')} ({_material(e, e.angle)})" for e in plate.layers)
        text += f"layers from bottom to top of {'; '.join(each)}."
    else:
        text += f"{_material(plate)}."
    if plate.stretches:
        text += " Its middle stretches as it bends (von Karman)."
    if plate.residual_stress:
        text += f" At rest {quantity(plate.residual_stress, 'Pa')} pull in it."
    text += _damping(plate)
    for support in plate.supports:
        text += f" Its edge {support.edge} is {_EDGES[support.kind]}."
        if (moved := support.led(plate.frame[1][2])) is not None:
            text += f" It moves by {formula(moved, 'm')} along the normal."
    for load in plate.pressures:
        text += f" A pressure {formula(load.value, 'Pa')} pushes on its {load.face}"
        text += f"{_end(load)}."
    if not is_zero((plate.displacement,)):
        text += f" It starts with the displacement {formula(plate.displacement, 'm')},"
        text += f" and the velocity {formula(plate.velocity, 'm/s')} along the normal."
    elif not is_zero((plate.velocity,)):
        text += f" It starts with the velocity {formula(plate.velocity, 'm/s')} along the normal."
    touches = bool(scene.obstacles) or len(scene.bodies) > 1
    return text + " Vertices that touch have no mass." * touches


_THEORIES = {"kirchhoff": "Kirchhoff", "reissner_mindlin": "Reissner and Mindlin"}


def _material(owner: Any, turned: float = 0.0) -> str:
    """Moduli and density of a plate or a layer."""
    density = f"density {quantity(owner.density, 'kg/m³')}"
    if (own := owner.orthotropic) is None:
        text = f"Young's modulus {quantity(owner.youngs_modulus, 'Pa')}, Poisson's ratio "
        return f"{text}{number(owner.poisson_ratio)}, {density}"
    text = f"Young's moduli {quantity(own.e1, 'Pa')} along and {quantity(own.e2, 'Pa')} across "
    text += (
        f"an axis at {quantity(own.angle + turned, 'rad')}, Poisson's ratio {number(own.nu12)}, "
    )
    return f"{text}shear modulus {quantity(own.g12, 'Pa')}, {density}"


_EDGES = {
    "clamped": "clamped",
    "simply_supported": "simply supported (hard)",
    "soft_support": "supported, free to turn",
    "free": "free",
    "elastic": "held by springs",
}


def _mechanism(scene: Scene, body: Any) -> str:
    text = f"A mechanism from {body.file}, its base {body.base} at "
    text += f"{vector(body.position, 'm')}."
    if body.place is not None:
        text += f" {body.place.frame} begins at {vector(body.place.target, 'm')}, by "
        text += f"inverse kinematics ({body.place.method})."
    for name, joint in body.joints.items():
        begins = "" if joint.position is None else f" begins at {number(joint.start)}"
        if joint.drive is not None:
            begins = f" is driven to {formula(joint.drive)}"
        drive = "" if joint.motor is None else f" has the motor {formula(joint.motor)}"
        if begins or drive:
            text += f" The joint {name}{' and'.join(filter(None, (begins, drive)))}."
    if scene.starts_at_rest:
        text += " It starts in the nearest equilibrium of its weight, motors and contact."
    return text


def _rigid(_: Scene, body: Any) -> str:
    drawn = "" if body.mesh is None else f" from {body.mesh}"
    text = f"A rigid {body.figure}{drawn} of mass {quantity(body.total_mass, 'kg')}"
    moments = body.moments
    if body.dim == 2:
        text += f" and moment of inertia {quantity(float(moments[0, 0]), 'kg m²')}"
    else:
        own = sorted(float(value) for value in np.linalg.eigvalsh(moments))
        text += f" and principal moments of inertia {vector(own, 'kg m²')}"
    text += f", its centre of mass at {vector(body.center.tolist(), 'm')}"
    start = body.start_velocity.tolist()
    speed, spin = start[: body.dim], start[body.dim :]
    if any(speed):
        text += f", with the velocity {vector(speed, 'm/s')}"
    if any(spin):
        shown = vector(spin, "rad/s") if body.dim == 3 else quantity(spin[0], "rad/s")
        text += f", turning at {shown}"
    text += "." if any(start) else ", at rest."
    for given, unit, what in ((body.force, "N", "force"), (body.moment, "N m", "moment")):
        if given is not None:
            text += f" The {what} {formulas(given, unit)} acts on it."
    return text


_BODIES: Mapping[str, Callable[[Scene, Any], str]] = {
    "bar": _bar,
    "solid": _solid,
    "point": _point,
    "rod": _rod,
    "beam": _beam,
    "rigid": _rigid,
    "springs": _springs,
    "mechanism": _mechanism,
    "plate": _plate,
}
