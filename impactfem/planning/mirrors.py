"""Planes through the centre of a shape about which a whole scene is symmetric."""

from collections.abc import Sequence

import numpy as np

from impactfem.planning.sampling import Field, equal, of_formulas, samples, sum_of
from impactfem.scene import Scene
from impactfem.scene.formula import Formula
from impactfem.scene.obstacles import Rigid
from impactfem.scene.obstacles.mirror import Mirror, signs
from impactfem.scene.shapes import Block, Cylinder

PAIRS = (("left", "right"), ("bottom", "top"), ("back", "front"))
"""Faces of a block that lie opposite, by their axis."""


def mirror_axes(scene: Scene) -> tuple[str, ...]:
    """Axes ("x", "y", "z") across which the scene is symmetric and not cut yet."""
    solid, shape = scene.solid, scene.solid.shape
    if shape is None:
        return ()
    if isinstance(shape, Block | Cylinder) and shape.angle:
        return ()  # names of faces turn with the shape
    axes = range(1 if solid.is_axisymmetric else 0, solid.dim)
    return tuple(
        "xyz"[axis] for axis in axes if "xyz"[axis] not in shape.symmetry and _mirrors(scene, axis)
    )


def _mirrors(scene: Scene, axis: int) -> bool:
    """Whether everything of a scene is symmetric across an axis."""
    solid = scene.solid
    if any(value[axis] != 0.0 for value in scene.vector_gravity.values):
        return False
    spin = solid.angular_velocity
    vector = spin if isinstance(spin, tuple) else (0.0, 0.0, spin)
    if any(rate != 0.0 for k, rate in enumerate(vector) if k != axis):
        return False
    fields = (of_formulas(solid.velocity), of_formulas(solid.displacement))
    return (
        all(_is_even(scene, field, field, axis) for field in fields)
        and _surfaces_mirror(scene, axis)
        and _obstacles_mirror(scene, axis)
    )


def _is_even(scene: Scene, left: Field, right: Field, axis: int, *, scalar: bool = False) -> bool:
    """Whether ``right`` is the mirror image of ``left``: a vector turns its component round."""
    shape = scene.solid.shape
    if shape is None:
        return False
    points, times = samples(scene)
    mirrored = points.copy()
    mirrored[:, axis] = 2.0 * shape.centre[axis] - points[:, axis]
    image = left(points, times)
    if not scalar:
        image = image * signs(axis, image.shape[1])
    return equal(image, right(mirrored, times))


def _surfaces_mirror(scene: Scene, axis: int) -> bool:
    """Whether supports, tractions, pressures and contact surfaces come in mirrored pairs."""
    solid = scene.solid
    names = solid.surface_names or ()
    touching = solid.contact_surfaces
    if touching is not None and {_image(name, axis) for name in touching} != set(touching):
        return False
    return all(
        _supports_mirror(scene, name, axis) and _loads_mirror(scene, name, axis) for name in names
    )


def _image(name: str, axis: int) -> str:
    first, second = PAIRS[axis]
    return {first: second, second: first}.get(name, name)


def _supports_mirror(scene: Scene, name: str, axis: int) -> bool:
    held = {support.surface: support for support in scene.solid.all_supports}
    one, other = held.get(name), held.get(_image(name, axis))
    if one is None or other is None:
        return one is other
    if (one.kind, one.until) != (other.kind, other.until):
        return False
    if one.value is None or other.value is None:
        return True
    return _mirrored(scene, one.value, other.value, axis)


def _mirrored(
    scene: Scene, left: Sequence[Formula | None], right: Sequence[Formula | None], axis: int
) -> bool:
    """Whether two motions in time are mirror images; what one leaves free the other does too."""
    if [f is None for f in left] != [f is None for f in right]:
        return False
    _, times = samples(scene)
    nowhere = np.zeros((len(times), 0))
    image = of_formulas(left)(nowhere, times) * signs(axis, len(left))
    return equal(image, of_formulas(right)(nowhere, times))


def _loads_mirror(scene: Scene, name: str, axis: int) -> bool:
    solid = scene.solid

    def traction(surface: str) -> Field:
        found = [of_formulas(e.acting) for e in solid.tractions if e.surface == surface]
        return sum_of(found, solid.dim)

    def pressure(surface: str) -> Field:
        found = [of_formulas([e.acting]) for e in solid.pressures if e.surface == surface]
        return sum_of(found, 1)

    image = _image(name, axis)
    return _is_even(scene, traction(name), traction(image), axis) and _is_even(
        scene, pressure(name), pressure(image), axis, scalar=True
    )


def _obstacles_mirror(scene: Scene, axis: int) -> bool:
    """Whether the image of every obstacle is an obstacle."""
    shape = scene.solid.shape
    if shape is None:
        return False
    obstacles = scene.rigid_obstacles
    mirror = Mirror(axis, shape.centre[axis], max(shape.half_extents))
    return all(
        any(
            _moves_as_image(scene, one, other, axis) and one.mirrors(other, mirror)
            for other in obstacles
        )
        for one in obstacles
    )


def _moves_as_image(scene: Scene, one: Rigid, other: Rigid, axis: int) -> bool:
    if one.rotation or other.rotation:
        return False
    if one.motion is None or other.motion is None:
        return one.motion is other.motion
    return _mirrored(scene, one.motion, other.motion, axis)
