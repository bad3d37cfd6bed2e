"""Checks of a single bar before a wall: its drive, and settings that its waves allow."""

import numpy as np

from impactfem.methods import METHODS
from impactfem.scene.bodies import SAMPLES, Bar
from impactfem.scene.breaks import check_motion, finite_values
from impactfem.scene.content import Content
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

LAYERED = ("galerkin", "monolithic")
"""Methods of bars that are not uniform, or have a load along them."""

_PLACES = 5
_FOR_WAVES = ("mesh", "accuracy", "degree", "fitted")


def _check_along(bar: Bar, end: float) -> None:
    """Refuse loads with poles along the bar.

    Raises:
        KeyedError: naming the key.
    """
    x = np.linspace(0.0, bar.length, SAMPLES + 1)
    for t in (0.0, 0.5 * end, end):
        bad = np.flatnonzero(~np.isfinite(bar.load(t=t, x=x) + np.zeros_like(x)))
        if bad.size:
            text = f" = {show(bar.load.text)} has no finite value at x = {x[bad[0]]:.6g} m, t = "
            raise KeyedError("body[0]", "load", f"{text}{t:.6g} s: give one along all of the bar.")


def _check_feedback(bar: Bar, method: str | None) -> None:
    """Refuse feedback at the far end where waves do not tell its velocity.

    Raises:
        KeyedError: naming the key.
    """
    why = "falls with v, which is followed in a uniform bar at a rigid wall, without a load along"
    if not bar.has_two_waves:
        text = f" = {show(bar.far_end_force.plain)} {why}: remove v, or what else there is."
        raise KeyedError("body[0]", "far_end_force", text)
    if method not in {None, "exact", "galerkin"}:
        text = f" = {show(method)} does not know the force of a far end that falls with its "
        raise KeyedError("solve", "method", f'{text}velocity: give "exact" or "galerkin".')


def check_drive(scene: Content) -> None:
    """Refuse loads and motions of a bar that jump or are not finite, or that a method misses.

    Raises:
        KeyedError: naming the key.
    """
    (bar,) = scene.bars
    moved, begins = bar.far_end_displacement, bar.displacement.plain == 0.0
    check_motion("body[0]", "far_end_displacement", [moved], scene.duration, from_zero=begins)
    finite_values("body[0]", "far_end_force", bar.end_force, scene.duration)
    if bar.is_loaded:
        for k in range(_PLACES + 1):
            at = bar.load.fixed(x=bar.length * k / _PLACES)
            finite_values("body[0]", "load", at, scene.duration)
        _check_along(bar, scene.duration)
    method = scene.solve.method
    if bar.is_driven and method is not None and not METHODS[method].plannable:  # negative controls
        text = (
            f" = {show(method)} knows no prescribed motion of the far end: give another, as exact."
        )
        raise KeyedError("solve", "method", text)
    if bar.end_damping:
        _check_feedback(bar, method)
    if bar.has_two_waves:
        return
    why = "waves keep their shape in a uniform bar at a rigid wall, without a load along it, only"
    if bar.wall_stiffness is not None and scene.solve.active_set == "snes_vi":
        text = ' = "snes_vi" knows bounds, and the wall gives way: remove it, or stiffness.'
        raise KeyedError("solve", "active_set", text)
    if method is not None and method not in LAYERED:
        fitting = " or ".join(map(show, LAYERED))
        raise KeyedError("solve", "method", f" = {show(method)}: {why}; give {fitting}.")
    for name in _FOR_WAVES:
        value = getattr(scene.solve, name)
        if value is not None:
            remedy = "remove it, and give elements"
            raise KeyedError("solve", name, f" = {show(value)}: {why}; {remedy}.")
