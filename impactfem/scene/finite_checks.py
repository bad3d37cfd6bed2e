"""Checks of scenes whose steps are solved by iterates: what such bodies can do and meet."""

import math

from impactfem.methods import METHODS
from impactfem.scene.content import Content
from impactfem.scene.laws import side_of
from impactfem.scene.schema import KeyedError
from impactfem.scene.solids import NEARLY_INCOMPRESSIBLE, Solid
from impactfem.scene.values import show


def check_finite(scene: Content) -> None:
    """Refuse what bodies under finite strain, and plates that stretch, do not do yet.

    Raises:
        KeyedError: naming the key.
    """
    why = scene.iterated
    if not why:
        return
    _check_settings(scene, why)
    method = scene.solve.method
    if method is not None and METHODS[method].stable == "limited":
        _check_explicit(scene, why)


def check_relaxing(scene: Content) -> None:
    """Refuse explicit steps of bodies with Maxwell terms.

    Raises:
        KeyedError: naming the key.
    """
    method, relaxing = scene.solve.method, [s.name for s in scene.solids if s.relaxing]
    if relaxing and method is not None and METHODS[method].stable == "limited":
        text = f" = {show(method)} takes explicit steps, whose forces are those of one place, while"
        text += f" Maxwell terms of {relaxing[0]} (viscoelastic) follow its way amid a step: give "
        text += '"massless" or "conserving".'
        raise KeyedError("solve", "method", text)


def _check_settings(scene: Content, why: str) -> None:
    """Refuse methods and settings of linear steps."""
    solve = scene.solve
    if solve.method is not None and not METHODS[solve.method].finite:
        fitting = " or ".join(show(name) for name, method in METHODS.items() if method.finite)
        text = f" = {show(solve.method)} solves linear steps, but {why}: "
        raise KeyedError("solve", "method", f"{text}give {fitting}.")
    if solve.normals == "fixed":
        text = f' = "fixed" contradicts directions that turn, for {why}: remove it.'
        raise KeyedError("solve", "normals", text)
    if solve.active_set == "snes_vi":
        text = f' = "snes_vi" solves linear steps, but {why}: remove it.'
        raise KeyedError("solve", "active_set", text)


def _check_explicit(scene: Content, why: str) -> None:
    """Refuse what explicit steps under finite strain do not do.

    Raises:
        KeyedError: naming the key.
    """
    remedy = 'remove it, or give solve.method = "conserving".'
    conserving = 'or solve.method = "conserving".'
    finite = {solid.name for solid in scene.solids if solid.is_finite}
    solids = {solid.name for solid in scene.solids}
    for place, body in enumerate(scene.bodies):
        if body.name in solids - finite:
            text = f' = "small" of {body.name}: '
            if finite:
                text += "beside explicit steps under finite strain all solids have it"
            else:
                text += f"explicit steps follow who meets whom under finite strain, and {why}"
            text += f': give strain = "finite", {conserving}'
            raise KeyedError(f"body[{place}]", "strain", text)
    for place, contact in enumerate(scene.contacts):
        if not solids & {side_of(entry)[0] for entry in contact.between}:
            continue
        for law in ("rolling_resistance", "spinning_resistance"):
            if value := getattr(contact, law):
                text = f" = {show(value)}: forces of explicit steps act from one level to the next,"
                text += " where a moment that resists would turn round what it should stop: "
                raise KeyedError(f"contact[{place}]", law, f"{text}{remedy}")
    for place, solid in enumerate(scene.solids):
        _refuse_damping(place, solid, remedy)
        if solid.is_finite and solid.keeps_volume:
            _refuse_volume(place, solid)


def _refuse_damping(place: int, solid: Solid, remedy: str) -> None:
    """Refuse a body that its stiffness damps.

    Raises:
        KeyedError: naming the key.
    """
    given: dict[str, float | None] = {
        "rayleigh_stiffness": solid.retardation, "damping_ratio": solid.damping_ratio,
    }  # fmt: skip
    if not solid.supports:  # what nothing holds
        given["quality_factor"] = solid.quality_factor
    for name, value in given.items():
        if value:
            text = f" = {value}: explicit steps under finite strain are damped by mass only: "
            raise KeyedError(f"body[{place}]", name, f"{text}{remedy}")


def _refuse_volume(place: int, solid: Solid) -> None:
    """Refuse a nearly incompressible body, by the key that makes it one.

    Raises:
        KeyedError: naming the key.
    """
    ratio = solid.largest_ratio
    if ratio <= NEARLY_INCOMPRESSIBLE:
        text = f" = {show(solid.element)}: explicit steps under finite strain have standard "
        text += 'elements only: remove it, or give solve.method = "conserving".'
        raise KeyedError(f"body[{place}]", "element", text)
    shorter = math.sqrt(_waves(ratio) / _waves(NEARLY_INCOMPRESSIBLE))
    text = f" = {ratio}: standard elements would lock, and explicit steps would have to be "
    text += f"{shorter:.2g} times as short as those of {NEARLY_INCOMPRESSIBLE}: give "
    text += f'solve.method = "conserving", or at most {NEARLY_INCOMPRESSIBLE}.'
    raise KeyedError(f"body[{place}]", "poisson_ratio", text)


def _waves(ratio: float) -> float:
    """Square of the speed of pressure waves, over E / rho."""
    return (1.0 - ratio) / ((1.0 + ratio) * (1.0 - 2.0 * ratio))
