"""Time step and number of layers of solids as planned, held against the stable step."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from impactfem.errors import SceneError
from impactfem.marching.schemes import SolidScheme
from impactfem.models.solids import SolidPart
from impactfem.planning.solid_costs import SHARE_OF_STABLE, count_layers, damped, on_samples
from impactfem.scene import Scene
from impactfem.system.massless import lumped_mass
from impactfem.system.moments import lumped_moments
from impactfem.system.spectrum import largest_eigenvalue
from impactfem.system.surface import SurfaceNodes

if TYPE_CHECKING:
    from impactfem.planning import MarchNumbers, Plan


def planned_steps(
    scene: Scene,
    plan: "Plan[MarchNumbers]",
    scheme: SolidScheme,
    discretised: Mapping[str, tuple[SolidPart, SurfaceNodes, Any]],
) -> tuple[float, int, float | None]:
    """Time step [s], number of layers, and the least stable time step [s] of explicit schemes.

    A planned step is taken as it is; the last layer may then end past the duration. A step that
    follows from the stiffness is shortened so that the layers fill the duration: the same on any
    number of ranks.

    Args:
        scene: The scene.
        plan: What to do.
        scheme: The method as data.
        discretised: Solid, contact nodes and transfer of mass (None without) by name of the body.

    Raises:
        SceneError: The step asked for is beyond the stable one.
    """
    numbers, duration = plan.numbers, scene.duration
    if not scheme.explicit:
        if numbers.dt is None:
            raise SceneError("solve.dt: the plan has no time step; give solve.dt")
        layers = count_layers(duration, numbers.dt)
        if scene.ends and numbers.layers is None and scene.solve.dt is None:  # other elements
            layers = on_samples(scene, layers)
            return duration / layers, layers, None
        return numbers.dt, layers, None
    stable = {name: stable_step(*parts) for name, parts in discretised.items()}
    slowest = min(stable, key=lambda name: stable[name])
    limit = stable[slowest]
    dt = numbers.dt if numbers.dt is not None else (numbers.courant or SHARE_OF_STABLE) * limit
    if dt > limit * (1 + 1e-9):
        asked = "dt" if numbers.dt is not None else "courant"
        raise SceneError(
            f"solve.{asked}: the time step {dt:g} s is beyond the stability limit {limit:g} s of "
            f"method {plan.method} on the mesh of body {slowest}; use solve.dt <= "
            f'{_down(limit):g}, solve.courant <= 1, or method = "massless"'
        )
    amid = starts_amid(scheme)
    layers = on_samples(scene, count_layers(duration, dt), amid=amid)
    return (dt if numbers.dt is not None else duration / layers), layers, limit


def starts_amid(scheme: SolidScheme) -> float:
    """Part of a step by which forces that a step begins with act before it begins."""
    return 0.5 if scheme.staggered else 0.0


def stable_step(model: SolidPart, surface: SurfaceNodes, transfer: Any) -> float:
    """2 / omega_max without contact, less with damping [s].

    Raises:
        SceneError: No node of the body can move by itself.
    """
    system = model.system
    masses = lumped_moments if model.solid.is_finite else lumped_mass
    inverse = masses(system, transfer, surface)[1]
    square = largest_eigenvalue(system.stiffness, inverse, system.numbers)
    if square == 0.0:
        raise SceneError(
            f"body {model.solid.name!r}: no node can move by itself: each is held by supports or "
            "carries contact; use smaller elements, fewer supports or contact_surfaces, or "
            'method = "massless"'
        )
    return damped(2.0 / math.sqrt(square), system.rayleigh_stiffness)


def _down(value: float) -> float:
    """Three digits, not above the value."""
    step = 10.0 ** (math.floor(math.log10(value)) - 2)
    return math.floor(value / step) * step
