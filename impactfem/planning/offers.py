"""Cheaper models that give the same motion: offered only where the scene proves that they do."""

from collections.abc import Mapping

import numpy as np

from impactfem.planning.mirrors import PAIRS, mirror_axes
from impactfem.planning.sampling import is_independent, is_zero, of_formulas, turns
from impactfem.scene import Scene
from impactfem.scene.boundary import Support
from impactfem.scene.obstacles import Rigid
from impactfem.scene.shapes import Block, Cylinder, Sphere
from impactfem.scene.solids import Solid

_AXES = "xyz"
_EQUAL = 1e-9  # of the size of the body, for places of obstacles


def offers(scene: Scene) -> dict[str, str]:
    """Offers by name: "bar", "axisymmetric", "plane_strain", "symmetry"."""
    rubs = any(contact.friction_coefficient > 0.0 for contact in scene.contacts)
    if scene.solid.shape is None or rubs:
        return {}
    found = {
        "bar": _bar(scene),
        "axisymmetric": _axisymmetric(scene),
        "plane_strain": _plane_strain(scene),
    }
    if scene.solid.is_orthotropic:  # bars have one modulus, and axes may lie aslant
        return {}
    if not any(found.values()):
        found["symmetry"] = _symmetry(scene)
    return {name: text for name, text in found.items() if text}


def _is_plainly_loaded(solid: Solid) -> bool:
    """Whether nothing but gravity and obstacles acts on a body that does not turn."""
    damped = (
        solid.rayleigh_mass
        or solid.retardation
        or solid.quality_factor
        or solid.damping_ratio
        or solid.relaxing
    )
    return not (solid.tractions or solid.pressures or damped or turns(solid))


def _moves_along(scene: Scene, axis: int) -> bool:
    """Whether the initial state and gravity point along an axis and vary along it only."""
    solid = scene.solid
    others = [k for k in range(solid.dim) if k != axis]
    initial = (solid.velocity, solid.displacement)
    return (
        all(is_zero(formulas[k]) for formulas in initial for k in others)
        and all(is_independent(scene, of_formulas(formulas), others) for formulas in initial)
        and all(value[k] == 0.0 for value in scene.vector_gravity.values for k in others)
    )


def _bar(scene: Scene) -> str:
    """A block that moves as a bar: nothing in it varies across its axis."""
    solid, shape = scene.solid, scene.solid.shape
    if not isinstance(shape, Block) or shape.angle or len(scene.rigid_obstacles) != 1:
        return ""
    (obstacle,) = scene.rigid_obstacles
    plane = obstacle.plane
    if plane is None or obstacle.moves or not _is_plainly_loaded(solid):
        return ""
    normal = np.array(plane.normal)
    axis = int(np.argmax(np.abs(normal)))
    if abs(normal[axis]) < 1.0 - 1e-12 or (solid.is_axisymmetric and axis != 1):
        return ""
    supports = {support.surface: support for support in solid.all_supports}
    near, far = PAIRS[axis] if normal[axis] > 0 else PAIRS[axis][::-1]
    near, far = _after_cut(solid, axis, near), _after_cut(solid, axis, far)
    modulus, why = _modulus(solid, axis, supports)
    touched = solid.contact_surfaces is None or near in solid.contact_surfaces
    if near in supports or not touched or not why or not _moves_along(scene, axis):
        return ""
    if any(support.moves or support.until is not None for support in solid.supports):
        return ""
    lower, upper = shape.bounds(axisymmetric=solid.is_axisymmetric)
    start = lower[axis] if normal[axis] > 0 else -upper[axis]
    gap = start - float(np.dot(normal, plane.point))
    speed = solid.velocity[axis]
    held = ', far_end = "clamped"' if far in supports else ""
    along = (
        f"velocity = {normal[axis] * float(speed()):g}" if speed.is_constant
        else "velocity as a formula in the distance x from the near end, negative towards the wall"
    )  # fmt: skip
    return (
        f'{why}, this block moves as a bar: kind = "bar" with length = '
        f"{upper[axis] - lower[axis]:g}, density = {solid.density:g}, youngs_modulus = "
        f"{modulus:.9g}, area = {_section(solid, axis):g}, gap = {gap:g}, {along}{held} would be "
        'exact and 1000 times cheaper; with solve.method = "galerkin" and cells = "hexahedron" '
        "(degree 1, courant 1) the block itself moves so to rounding, without a peak of the mesh"
    )


def _after_cut(solid: Solid, axis: int, name: str) -> str:
    """Name of a face, of the plane of symmetry that replaces it, or of the axis."""
    cuts = () if solid.shape is None else solid.shape.symmetry
    first = name == PAIRS[axis][0]
    return f"symmetry_{_AXES[axis]}" if first and _AXES[axis] in cuts else name


def _modulus(solid: Solid, axis: int, supports: Mapping[str, Support]) -> tuple[float, str]:
    """Modulus [Pa] of a bar along an axis, and why it is one; "" if it is none."""
    across = [k for k in range(solid.dim) if k != axis]
    faces = [_after_cut(solid, k, name) for k in across for name in PAIRS[k]]
    if solid.is_axisymmetric:
        faces = [name for name in faces if name in (solid.surface_names or ())]  # none at r = 0
    blocked = all(name in supports and supports[name].mirrors for name in faces)
    loose = all(name not in supports or supports[name].mirrors for name in faces)
    if blocked and faces:
        held = "with blocked sides (symmetry on " + " and ".join(faces) + ")"
        if solid.model == "plane_stress":
            return solid.youngs_modulus / (1.0 - solid.poisson_ratio**2), held + ", E / (1 - nu^2)"
        return solid.lame + 2.0 * solid.shear_modulus, held + ", lambda + 2 mu"
    if solid.poisson_ratio == 0.0 and loose:
        return solid.youngs_modulus, "with nu = 0, thrown flat"
    return 0.0, ""


def _section(solid: Solid, axis: int) -> float:
    """Area across an axis of a block, with all its mirror images beside it [m^2]."""
    shape = solid.shape
    volume = solid.volume
    if shape is None or volume is None:
        raise ValueError("a mesh file has no shape")
    lower, upper = shape.bounds(axisymmetric=solid.is_axisymmetric)
    planes = {support.surface for support in solid.all_supports if support.mirrors}
    beside = [k for k in range(int(solid.is_axisymmetric), solid.dim) if k != axis]
    cuts = [_AXES[k] in shape.symmetry or len(planes & {*PAIRS[k]}) == 1 for k in beside]
    return 2.0 ** sum(cuts) * volume / (upper[axis] - lower[axis])


def _axisymmetric(scene: Scene) -> str:
    """A ball or cylinder in 3D with everything revolved about the vertical through its centre."""
    solid, shape = scene.solid, scene.solid.shape
    if not isinstance(shape, Sphere | Cylinder) or solid.dim != 3 or solid.supports:
        return ""
    if shape.angle and isinstance(shape, Cylinder):
        return ""
    centre = np.array(shape.centre)
    size = max(shape.half_extents)
    around = (_is_revolved(obstacle, centre, size) for obstacle in scene.rigid_obstacles)
    if not _is_plainly_loaded(solid) or not _moves_along(scene, 1) or not all(around):
        return ""
    x, y, z = shape.center
    del x, z
    size_keys = f"radius = {shape.radius:g}"
    if isinstance(shape, Cylinder):
        size_keys += f", height = {shape.height:g}"
    return (
        'everything is round about the vertical through the centre: model = "axisymmetric" with '
        f'shape = {{ kind = "{shape.kind}", {size_keys}, center = [0.0, {y:g}] }} and the '
        "obstacles in the plane of x = r and y would give the same motion in 2D"
    )


def _is_revolved(obstacle: Rigid, centre: np.ndarray, size: float) -> bool:
    """Whether an obstacle is round about the vertical through a point, and moves along it."""
    if obstacle.rotation:
        return False
    if obstacle.motion is not None and not (
        is_zero(obstacle.motion[0]) and is_zero(obstacle.motion[2])
    ):
        return False
    return obstacle.is_revolved(centre, _EQUAL * size)


def _plane_strain(scene: Scene) -> str:
    """A block in 3D between two planes of symmetry along z, along which nothing varies."""
    solid, shape = scene.solid, scene.solid.shape
    if not isinstance(shape, Block) or solid.dim != 3 or not _is_plainly_loaded(solid):
        return ""
    supports = {support.surface: support for support in solid.all_supports}
    ends = [_after_cut(solid, 2, name) for name in PAIRS[2]]
    if not all(name in supports and supports[name].mirrors for name in ends):
        return ""
    flat = all(
        not support.moves or support.value is None or is_zero(support.value[2])
        for support in solid.supports
    )
    initial = (solid.velocity, solid.displacement)
    flat &= all(is_zero(formulas[2]) for formulas in initial)
    flat &= all(is_independent(scene, of_formulas(formulas), [2]) for formulas in initial)
    flat &= all(value[2] == 0.0 for value in scene.vector_gravity.values)
    lower, upper = shape.bounds()
    if not flat or not all(_runs_along_z(o, lower[2], upper[2]) for o in scene.rigid_obstacles):
        return ""
    corner, size = list(shape.corner[:2]), list(shape.size[:2])
    thickness = (upper[2] - lower[2]) * (2.0 if "z" in shape.symmetry else 1.0)
    return (
        f'front and back are planes of symmetry and nothing varies along z: model = "plane_strain" '
        f"with size = {size}, corner = {corner}, thickness = {thickness:g} and the "
        "obstacles in the plane would give the same motion in 2D"
    )


def _runs_along_z(obstacle: Rigid, low: float, high: float) -> bool:
    """Whether an obstacle is the same at all z from low to high."""
    if obstacle.rotation or (obstacle.motion is not None and not is_zero(obstacle.motion[2])):
        return False
    return obstacle.runs_along_z(low, high)


def _symmetry(scene: Scene) -> str:
    """Planes through the centre about which shape and data are symmetric."""
    axes = mirror_axes(scene)
    solid = scene.solid
    if not axes or solid.shape is None:
        return ""
    listed = ", ".join(f'"{axis}"' for axis in (*solid.shape.symmetry, *axes))
    fraction = {1: "half", 2: "a quarter", 3: "an eighth"}[len(axes)]
    return (
        f"the scene is symmetric about {'each plane' if len(axes) > 1 else 'the plane'} "
        f"{' and '.join(f'{axis} = {_centre(solid, axis):g}' for axis in axes)}: shape = {{ ..., "
        f"symmetry = [{listed}] }} would give the same motion with {fraction} of the unknowns "
        "(forces and energies are those of the whole)"
    )


def _centre(solid: Solid, axis: str) -> float:
    return 0.0 if solid.shape is None else solid.shape.centre[_AXES.index(axis)] + 0.0
