"""Checks of scenes with a body under finite strain: what such bodies can do and meet."""

from impactfem.methods import METHODS
from impactfem.scene.content import Content
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show


def check_finite(scene: Content) -> None:
    """Refuse what bodies under finite strain do not do yet.

    Raises:
        KeyedError: naming the key.
    """
    finite = [solid.name for solid in scene.solids if solid.is_finite]
    if not finite:
        return
    _check_company(scene, finite[0])
    _check_settings(scene, finite[0])


def _check_company(scene: Content, name: str) -> None:
    """Refuse other bodies and friction."""
    place = next(k for k, body in enumerate(scene.bodies) if body.name == name)
    if len(scene.bodies) > 1:
        text = f" of {name} meets no other body yet, but there are {len(scene.bodies)}: "
        text += 'give one body, or strain = "small" to all.'
        raise KeyedError(f"body[{place}]", "strain", text)
    for index, contact in enumerate(scene.contacts):
        if contact.friction_coefficient:
            text = f" = {contact.friction_coefficient}: bodies under finite strain slide without "
            text += 'friction yet; remove it, or give the body strain = "small".'
            raise KeyedError(f"contact[{index}]", "friction_coefficient", text)


def _check_settings(scene: Content, name: str) -> None:
    """Refuse methods and settings of small strains."""
    solve = scene.solve
    if solve.method is not None and not METHODS[solve.method].finite:
        fitting = " or ".join(show(name) for name, method in METHODS.items() if method.finite)
        text = f" = {show(solve.method)} is for small strains, but {name} has finite ones: "
        raise KeyedError("solve", "method", f"{text}give {fitting}.")
    if solve.normals == "fixed":
        text = f' = "fixed" contradicts the finite rotation of {name}: remove it.'
        raise KeyedError("solve", "normals", text)
    if solve.active_set == "snes_vi":
        text = f' = "snes_vi" is for small strains, but {name} has finite ones: remove it.'
        raise KeyedError("solve", "active_set", text)
