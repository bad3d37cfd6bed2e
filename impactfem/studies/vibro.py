"""Studies of points, rods and beams: runs with several numbers of steps."""

from typing import Any

from impactfem.errors import ImpactError
from impactfem.scene import Scene
from impactfem.solving import solve
from impactfem.studies.variant import Variant


def attempt_steps(scene: Scene, variant: Variant, steps: int) -> Any:
    """Solve a scene in so many steps; the result with its error, or the error it ended with."""
    keys = {
        "method": variant.method,
        "dt": scene.duration / steps,
        "estimate": True,
        **{key: value for key, value in variant.settings.items() if key != "elements"},
    }
    try:
        return solve(scene.with_settings({f"solve.{key}": value for key, value in keys.items()}))
    except ImpactError as error:
        return error
