"""Integrate a system of few degrees of freedom by the method of a name."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from impactfem.errors import ImpactWarning, SceneError
from impactfem.result.trajectory import Trajectory
from impactfem.system.generalized import GeneralizedSystem
from impactfem.vibro.event_driven import EventSettings, integrate_events
from impactfem.vibro.position_level import PositionSettings, integrate_positions
from impactfem.vibro.textbook import SCHEMES, TextbookSettings, integrate_textbook
from impactfem.vibro.together import find_together
from impactfem.vibro.velocity_level import VelocitySettings, integrate_velocities


class _Entry(NamedTuple):
    settings: type[Any]
    integrate: Callable[..., Trajectory]
    rubs: bool = False  # whether it knows friction
    sticks: bool = False  # whether it knows static friction and tangential restitution
    joins: bool = False  # whether it knows bilateral rows, and rates of coordinates


INTEGRATORS: Mapping[str, _Entry] = {
    "event_driven": _Entry(EventSettings, integrate_events, rubs=True, sticks=True, joins=True),
    "paoli_schatzman": _Entry(PositionSettings, integrate_positions, joins=True),
    "moreau_jean": _Entry(VelocitySettings, integrate_velocities, rubs=True, joins=True),
    **{
        name: _Entry(TextbookSettings, partial(integrate_textbook, scheme=name), joins=scheme.joins)
        for name, scheme in SCHEMES.items()
    },
}
"""Settings and function of each method."""


def integrate(
    system: GeneralizedSystem,
    position: ArrayLike,
    velocity: ArrayLike,
    duration: float,
    *,
    method: str = "event_driven",
    **settings: Any,
) -> Trajectory:
    """Integrate a system with unilateral constraints.

    Args:
        system: A `GeneralizedSystem` or `LinearSystem`.
        position: u at t = 0, shape (coordinates,).
        velocity: u' at t = 0, shape (d,).
        duration: [s].
        method: "event_driven", "paoli_schatzman", "moreau_jean", "energy_momentum", or as a control
            "explicit_euler", "implicit_euler", "symplectic_euler", "midpoint", "trapezoid", "rk4".
        **settings: Those of the method: see `EventSettings`, `PositionSettings`,
            `VelocitySettings` and, of all others, `TextbookSettings`. All but the first need
            ``dt``.

    Returns:
        The motion. Where coupled constraints are hit within the resolution of the method, an
        `ImpactWarning` says what that means, and ``effort.details["together"]`` where it was.

    Raises:
        SceneError: The system or a setting cannot work.
        ConvergenceError: A step or an event could not be solved.
    """
    if method not in INTEGRATORS:
        raise SceneError(f'method = "{method}" is not known: give {" or ".join(INTEGRATORS)}')
    if not (np.isfinite(duration) and duration > 0.0):
        raise SceneError(f"duration = {duration} is not allowed: give a finite number > 0")
    entry = INTEGRATORS[method]
    _check_laws(system, method)
    known = [field.name for field in fields(entry.settings)]
    for name in settings:
        if name not in known:
            raise SceneError(
                f'{name} is no setting of method = "{method}": give {", ".join(known)}'
            )
    if "dt" in known and "dt" not in settings:
        raise SceneError(f'method = "{method}" needs dt: give it')
    if "dt" in settings and settings["dt"] > duration:
        raise SceneError(
            f"dt = {settings['dt']} exceeds duration = {duration:g}: give a smaller step"
        )
    chosen = entry.settings(**settings)
    u, v = (np.atleast_1d(np.asarray(value, dtype=float)) for value in (position, velocity))
    motion = entry.integrate(system, u, v, float(duration), chosen)
    several = motion.effort.details.get("friction_nonunique")
    if several is not None:
        text = (
            f"friction leaves {several['solutions']} motions at t = {several['time']:.6g} s; taken "
            f"is the one in which constraint {several['taken']}"
        )
        warnings.warn(text, ImpactWarning, stacklevel=2)
    together = find_together(system, motion, chosen.resolution(duration))
    if together is None:
        return motion
    warnings.warn(together.text(), ImpactWarning, stacklevel=2)
    details = {**motion.effort.details, "together": asdict(together)}
    return replace(motion, effort=replace(motion.effort, details=details))


def _check_laws(system: GeneralizedSystem, method: str) -> None:
    """Refuse laws of contact that a method does not know.

    Raises:
        SceneError: There is one.
    """
    entry = INTEGRATORS[method]
    if system.static_friction.any() and not entry.rubs:
        fitting = " or ".join(f'"{name}"' for name, other in INTEGRATORS.items() if other.rubs)
        raise SceneError(f'method = "{method}" knows no friction: give {fitting}')
    others = {"bilateral": system.bilateral, "rates": system.rates}
    for name in (name for name, given in others.items() if given is not None and not entry.joins):
        fitting = " or ".join(f'"{name}"' for name, other in INTEGRATORS.items() if other.joins)
        raise SceneError(f'method = "{method}" knows no {name}: give method = {fitting}')
    special = {
        "static_friction": (system.static_friction > system.friction).any(),
        "tangential_restitution": system.tangential_restitution.any(),
    }
    for name in (name for name, given in special.items() if given and not entry.sticks):
        fitting = " or ".join(f'"{name}"' for name, other in INTEGRATORS.items() if other.sticks)
        raise SceneError(f'method = "{method}" knows no {name}: give method = {fitting}')
