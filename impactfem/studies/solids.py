"""Studies of solids: runs on meshes of several sizes, measured against a finer one."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from typing import Any

from impactfem.errors import ImpactError, SceneError
from impactfem.runs.error_estimate import resized
from impactfem.runs.tracks import Track, difference
from impactfem.scene import Scene
from impactfem.solving import solve
from impactfem.studies.variant import Variant

type Attempt = Callable[[Scene, Variant, int], Any]
"""Takes a scene, a variant and a number of elements; the result, or the error it ended with."""

REFERENCE_METHOD = "conserving"


def attempts_at(scene: Scene, sizes: Sequence[int]) -> Attempt:
    """Solve the reference, and return how to solve a variant and measure it.

    Args:
        scene: Scene with a solid that Gmsh draws.
        sizes: Numbers of elements along the largest extent of its shape.

    Raises:
        SceneError: The body has no shape whose elements could be resized.
        ImpactError: The reference cannot be solved.
    """
    finest = 2 * max(sizes)
    reference = solve(_sized(scene, finest, {"method": REFERENCE_METHOD}))
    track = _track(reference)
    name = f"{REFERENCE_METHOD} with {finest} elements along the body"

    def attempt(case: Scene, variant: Variant, elements: int) -> Any:
        settings = {"method": variant.method, **variant.settings}
        try:
            result = solve(_sized(case, elements, settings))
        except ImpactError as error:
            return error
        found = difference(track, _track(result), name)
        return replace(result, summary={**result.summary, "error": asdict(found)})

    return attempt


def _track(result: Any) -> Track:
    summary = result.summary
    return Track.of_history(result.rows, result.scene, summary["details"], summary["bodies"])


def _sized(scene: Scene, elements: int, settings: dict[str, Any]) -> Scene:
    """The scene with so many elements along its body, without output."""
    solid = scene.solid
    if solid.shape is None or solid.mesh_size is None:
        raise SceneError(
            f"body.mesh = {solid.mesh}: a study needs elements of several sizes; give a shape"
        )
    lower, upper = solid.shape.bounds(axisymmetric=solid.is_axisymmetric)
    extent = max(b - a for a, b in zip(lower, upper, strict=True))
    chosen = {k: v for k, v in settings.items() if k != "elements"} | {"estimate": False}
    with resized(scene, extent / elements / solid.mesh_size) as case:
        return case.with_settings({f"solve.{key}": value for key, value in chosen.items()})
