"""Checks of a single bar before a wall: its drive, and settings that its waves allow."""

from impactfem.methods import METHODS
from impactfem.scene.breaks import check_motion, finite_values
from impactfem.scene.content import Content
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

LAYERED = ("galerkin", "monolithic")
"""Methods of bars that are not uniform, or have a load along them."""

_PLACES = 5
_FOR_WAVES = ("mesh", "accuracy", "degree", "fitted")


def check_drive(scene: Content) -> None:
    """Refuse loads and motions of a bar that jump or are not finite, or that a method misses.

    Raises:
        KeyedError: naming the key.
    """
    (bar,) = scene.bars
    moved, begins = bar.far_end_displacement, bar.displacement.plain == 0.0
    check_motion("body[0]", "far_end_displacement", [moved], scene.duration, from_zero=begins)
    finite_values("body[0]", "far_end_force", bar.far_end_force, scene.duration)
    for k in range(_PLACES + 1):
        at = bar.load.fixed(x=bar.length * k / _PLACES) if bar.is_loaded else bar.load
        finite_values("body[0]", "load", at, scene.duration)
    method = scene.solve.method
    if bar.is_driven and method is not None and not METHODS[method].plannable:  # negative controls
        text = f" = {show(method)} knows no drive of the far end: give another, as exact."
        raise KeyedError("solve", "method", text)
    if bar.has_two_waves:
        return
    why = "waves keep their shape in a uniform bar without a load along it only"
    if method is not None and method not in LAYERED:
        fitting = " or ".join(map(show, LAYERED))
        raise KeyedError("solve", "method", f" = {show(method)}: {why}; give {fitting}.")
    for name in _FOR_WAVES:
        value = getattr(scene.solve, name)
        if value is not None:
            remedy = "remove it, and give elements"
            raise KeyedError("solve", name, f" = {show(value)}: {why}; {remedy}.")
