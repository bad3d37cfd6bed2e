"""What the model of a scene leaves out, and why that may be done or must be known."""

from impactfem.scene import Beam, Point, Rod, Scene, Solid


def omissions(scene: Scene) -> list[str]:
    """Sentences about what is not modelled; plain text."""
    if scene.bars:
        found = _bars()
    elif isinstance(scene.bodies[0], Solid):
        found = _solids(scene)
    else:
        found = _few_freedoms(scene)
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
    solids = [body for body in scene.bodies if isinstance(body, Solid)]
    found = [
        "Large strains and rotations: elasticity is linear about the initial shape.",
        "Plasticity, cracks and heat: the material is elastic whatever the stress.",
        "Contact of a body with itself.",
    ]
    if solids[0].model == "plane_strain":
        found.append("The direction across the plane: nothing moves or strains along it.")
    if solids[0].model == "plane_stress":
        found.append("Stress across the plane: the slice is thin and its faces are free.")
    if solids[0].is_axisymmetric:
        found.append("Whatever differs around the axis, twist included.")
    if not any(solid.rayleigh_mass or solid.rayleigh_stiffness for solid in solids):
        found.append("Damping of the material: the scene gives none.")
    if solids[0].shape is not None and any(s.shape.symmetry for s in solids if s.shape):
        found.append("Whatever is not symmetric about the cuts: one part is computed.")
    return found


def _few_freedoms(scene: Scene) -> list[str]:
    body = scene.bodies[0]
    found = []
    if isinstance(body, Point):
        found.append("Rotation and deformation: points only move; an impact is an instant.")
    if isinstance(body, Rod):
        found.append("Elasticity of the rod: it is rigid, an impact is an instant.")
    if isinstance(body, Beam):
        found.append("Large rotations: displacements are small about the place at t = 0.")
        if body.theory == "euler_bernoulli":
            found.append("Shear deformation: Euler-Bernoulli theory.")
        if not any(body.rayleigh_damping):
            found.append("Damping of the material: the scene gives none.")
        found.append("Local indentation: the contact itself is rigid.")
    else:
        found.append(
            "What happens during an impact: a coefficient of restitution stands for the loss."
        )
    return found
