"""Choices of the elements of a solid, and what they make of its motion; each with its reason."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from impactfem.errors import SceneError
from impactfem.findings import Finding, warning
from impactfem.methods import is_explicit
from impactfem.planning.solid_costs import (
    Size,
)
from impactfem.scene import Scene
from impactfem.scene.mesh_files import MESHES
from impactfem.scene.shapes import Block, Cylinder, Ring
from impactfem.scene.solids import Solid

if TYPE_CHECKING:
    from impactfem.models.solids import SolidPart

SLENDER = 10.0
"""Length over thickness from which a block bends, as a beam does."""

BENDING = 4.0
"""Length over thickness from which a wall bends as much as it shears."""

_ACROSS = 3.0  # linear elements across a wall from which they follow its bending
_ENDS = {2: 1.0, 3: 2.0}
"""What a plane strip and a plate have more of size by 2 V / A than of length over thickness."""

_RINGING = 5.0  # p waves over s waves from which the noise of the mesh shows in the force


def choose_degrees(
    scene: Scene, reasons: dict[str, str], findings: list[Finding], walls: Mapping[str, str]
) -> tuple[int, ...]:
    """Degree of the elements of each solid (collective).

    Args:
        scene: The scene.
        reasons: Gets those of the degrees.
        findings: Get what is wrong with them.
        walls: Of bodies from files, once they are meshed, why they bend; see `thin_walls`.

    Raises:
        SceneError: The method asked for has no elements of the degree asked for.
    """
    alone, found = len(scene.solids) == 1, []
    for solid in scene.solids:
        key = "degree" if alone else f"degree of {solid.name}"
        stiff = stiff_elements(solid) or walls.get(solid.name, "")
        found.append(_degree(scene, solid, key, stiff, (reasons, findings)))
        findings += _one_pressure(solid, found[-1])
    return tuple(found)


def _degree(
    scene: Scene, solid: Solid, key: str, stiff: str, told: tuple[dict[str, str], list[Finding]]
) -> int:
    method, (reasons, findings) = scene.solve.method, told
    if is_explicit(method):
        if solid.degree == 2:
            raise SceneError(
                f'body {solid.name}: degree = 2 contradicts solve.method = "{method}": its mass is '
                "lumped, which elements of degree 2 do not allow; use degree = 1, or method = "
                '"massless"'
            )
        if solid.degree is None:
            reasons[key] = f"{method} lumps the mass, which needs degree 1"
        if stiff:
            remedy = 'degree = 2 with method = "massless" would be more accurate'
            findings.append(warning("locking", stiff, solid.name, remedy))
    if solid.degree is not None:
        reasons[key] = "as asked"
        if solid.degree == 1 and stiff and not is_explicit(method):
            remedy = "degree = 2 would be more accurate"
            findings.append(warning("locking", stiff, solid.name, remedy))
        return solid.degree
    if is_explicit(method):
        return 1
    stiff = stiff or curved_file(scene, solid)
    if stiff:
        reasons[key] = stiff
        return 2
    if solid.keeps_volume:
        reasons[key] = (
            f"poisson_ratio = {solid.largest_ratio:g}: quadrilaterals and hexahedra of degree 1 "
            "keep their volume in the mean only, so that they do not lock"
        )
        return 1
    reasons[key] = "waves with jumps gain nothing from more, and degree 1 can be stepped explicitly"
    return 1


def _one_pressure(solid: Solid, degree: int) -> list[Finding]:
    """Whether cells of degree 2 have too few pressures for waves of these."""
    few = degree == 2 and solid.is_finite and solid.keeps_volume
    if not few or solid.cells == "simplex":
        return []
    text = f"cells of degree 2 of {solid.name} have one pressure each under finite strain: bending "
    text += "and shear are right, but waves of pressure a few cells long are too slow"
    remedy = "take degree = 1 if these waves matter and the body does not bend, or smaller cells"
    return [warning("setting", text, solid.name, remedy)]


def stiff_elements(solid: Solid) -> str:
    """Why linear elements are too stiff for a body, or nothing."""
    if solid.keeps_volume and solid.cells == "simplex":
        return (
            f"poisson_ratio = {solid.largest_ratio:g} is above 0.45: nearly "
            "incompressible, linear simplices lock"
        )
    ratio = slenderness(solid)
    if ratio is not None and ratio >= SLENDER:
        return f"the body is {ratio:.3g} times as long as thick: it bends, linear elements lock"
    return ""


def thin_walls(filed: Iterable[tuple["SolidPart", float]]) -> dict[str, str]:
    """Why linear elements are too stiff for bodies from mesh files: thin ones bend (collective).

    The thickness of a wall is 2 V / A, with its area A on both sides; of a square bar in space
    half of its own.

    Args:
        filed: These bodies, meshed, with the mean length of their elements' shortest edges [m].
    """
    found = {}
    for part, edge in filed:
        outside = part.outside
        if not len(outside.faces):
            continue
        wall = 2.0 * part.mesh.volume / outside.area
        size = float(np.ptp(outside.points, axis=0).max())
        length = size / wall - _ENDS[part.solid.dim]
        few = wall < _ACROSS * edge
        if length >= SLENDER or (few and length >= BENDING):
            found[part.solid.name] = (
                f"the walls of the mesh are {wall:.3g} m thick in the mean, {size / wall:.3g} "
                "times less than it is large"
                + f", with {wall / edge:.2g} elements across" * few
                + ": it bends, linear elements lock"
            )
    return found


def curved_file(scene: Scene, solid: Solid) -> str:
    """Why the mesh file of a body asks for elements of degree 2, or nothing (collective)."""
    if solid.mesh is None or not solid.mesh.lower().endswith(MESHES):
        return ""
    from impactfem.fem import MPI, on_root  # noqa: PLC0415  (loads DOLFINx)
    from impactfem.reading.opening import look  # noqa: PLC0415

    path = Path(scene.folder or "", solid.mesh)
    holdings = on_root(MPI.COMM_WORLD, lambda: look(path, solid.dim, "body.mesh"))
    if holdings.order == 1 or not holdings.is_curved:
        return ""
    return f"the elements of {path.name} are curved, of order {holdings.order}"


def slenderness(solid: Solid) -> float | None:
    """Largest over smallest size of the shape; None with a mesh file."""
    shape = solid.shape
    if shape is None:
        return None
    sizes = [1.0, 1.0]
    if isinstance(shape, Block):
        sizes = list(shape.size)
    elif isinstance(shape, Cylinder):
        sizes = [2.0 * shape.radius, shape.height]
    elif isinstance(shape, Ring):
        sizes = [2.0 * shape.radius, shape.radius - shape.inner_radius]
    return max(sizes) / min(sizes)


def ringing_findings(solid: Solid, method: str, size: Size) -> list[Finding]:
    """What nearly incompressible bodies need for a smooth force.

    Each node that lands sends out a wave of pressure as strong as its element is large. Nothing
    in the body damps it; the faster it is, the larger its force.
    """
    ratio = solid.p_wave_speed / solid.s_wave_speed
    damped = solid.rayleigh_stiffness > 0.0
    if not solid.keeps_volume or ratio < _RINGING or damped or is_explicit(method):
        return []
    damping = size.mesh_size / solid.p_wave_speed
    text = (
        f"pressure waves are {ratio:.3g} times as fast as shear waves, nothing damps them, and "
        "those that the elements excite ring in the contact force"
    )
    remedy = (
        f"body.rayleigh_stiffness = {damping:.1g} damps waves as short as an element and leaves "
        "slower motion as it is"
    )
    return [warning("ringing", text, solid.name, remedy)]
