"""What the model of a scene leaves out, and why that may be done or must be known."""

from impactfem.scene import Scene


def omissions(scene: Scene) -> list[str]:
    """Sentences about what is not modelled; plain text."""
    found = _bars() if scene.bars else []
    if scene.solids:
        found += _solids(scene)
    found += _few_freedoms(scene)
    if not _rubs(scene):
        found.append("Friction: no contact of the scene asks for it, so it costs no unknowns.")
    return found


def _rubs(scene: Scene) -> bool:
    return any(entry.friction_coefficient for entry in scene.contacts)


def _bars() -> list[str]:
    return [
        "Bending and sideways motion: nothing in the scene pushes a bar off its axis.",
        "Widening of the section, and with it the dispersion of waves as short as it is wide.",
        "Damping, plasticity and heat: the bar is linear elastic, only contact changes its motion.",
    ]


def _solids(scene: Scene) -> list[str]:
    solids = scene.solids
    small = "Large strains and rotations: elasticity is linear about the initial shape."
    found = [
        *([] if all(solid.is_finite for solid in solids) else [small]),
        "Plasticity, cracks and heat: the material is elastic whatever the stress.",
        "Contact of a body with itself.",
    ]
    if solids[0].model == "plane_strain":
        found.append("The direction across the plane: nothing moves or strains along it.")
    if solids[0].model == "plane_stress":
        found.append("Stress across the plane: the slice is thin and its faces are free.")
    if solids[0].is_axisymmetric:
        found.append("Whatever differs around the axis, twist included.")
    if not any(
        solid.rayleigh_mass
        or solid.retardation
        or solid.quality_factor
        or solid.damping_ratio
        or solid.relaxing
        for solid in solids
    ):
        found.append("Damping of the material: the scene gives none.")
    if solids[0].shape is not None and any(s.shape.symmetry for s in solids if s.shape):
        found.append("Whatever is not symmetric about the cuts: one part is computed.")
    return found


_INSTANT = "What happens during an impact: a coefficient of restitution stands for the loss."


def _few_freedoms(scene: Scene) -> list[str]:
    """Of points, rods and beams, each kind that the scene has."""
    kinds = dict.fromkeys(body.kind for body in scene.bodies)
    found = [text for kind in _LEFT_OUT if kind in kinds for text in _LEFT_OUT[kind]]
    if any(body.kind == "beam" and body.small_strains for body in scene.bodies):
        found.append("Large rotations of beams: displacements are small about the place at t = 0.")
    found += _plates(scene)
    if found and not scene.meshed:
        found.append(_INSTANT)
    for body in scene.bodies:
        theory = getattr(body, "theory", None)
        if theory == "euler_bernoulli":
            found.append(f"Shear deformation of {body.name}: Euler-Bernoulli theory.")
        if theory is not None and not any(getattr(body, "rayleigh_damping", ())):
            found.append(f"Damping of the material of {body.name}: the scene gives none.")
    return found


def _plates(scene: Scene) -> list[str]:
    """Of plates, by their theories."""
    plates = [body for body in scene.meshed if body not in scene.solids]
    if not plates:
        return []
    found = ["Waves along the middle of plates: what moves there follows at once."]
    if not all(plate.shears_beside(scene.bodies) for plate in plates):
        text = "Shear and rotary inertia of plates, and with them waves as short as they are thick."
        found.append(text)
    if not all(plate.stretches for plate in plates):
        found.append("Stretching of the middle of plates: deflections are small beside it.")
    if not scene.gives_way:
        found.append("Local indentation of plates: the contact itself is rigid.")
    return found


_LEFT_OUT = {
    "point": ["Rotation and deformation of points: they only move; an impact is an instant."],
    "rod": ["Elasticity of rods: they are rigid, an impact is an instant."],
    "mechanism": [
        "Elasticity and play of mechanisms: links are rigid, an impact is an instant.",
        "Links of one mechanism do not meet each other.",
    ],
    "rigid": ["Elasticity of rigid bodies: they have no waves, an impact is an instant."],
    "springs": ["What lies between the springs: masses and edges touch, cells are empty."],
    "beam": [
        "Local indentation of beams: the contact itself is rigid.",
        "Corners of beams: others meet them as round, half their height around the axis.",
    ],
}
