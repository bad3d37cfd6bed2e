"""Checks across the keys of a solid: what is drawn, dimensions, surfaces, scales."""

import contextlib
import math
from typing import TYPE_CHECKING, Any

from impactfem.scene.boundary import SPACE
from impactfem.scene.formula import Formula
from impactfem.scene.kinds import FormulaOf
from impactfem.scene.mesh_files import MESHES, check_part
from impactfem.scene.nearest import meant
from impactfem.scene.rigid_keys import Orientation
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import NotAllowedError, show

if TYPE_CHECKING:
    from collections.abc import Sequence

    from impactfem.scene.solids import Solid

VARYING = ("density", "youngs_modulus", "poisson_ratio")
"""Constants of the material that may be formulas."""
_FAR = 1e8  # times its extent, beyond which rounding of places shows in contact
_THIN = 1e-7  # of its extent: Gmsh takes points nearer than 1e-8 of it for one


def check_solid(solid: "Solid") -> None:
    """Refuse a solid whose keys contradict each other.

    Raises:
        KeyedError: naming the key.
    """
    _check_source(solid)
    _check_materials(solid)
    _check_mesh_file(solid)
    _check_sizes(solid)
    _check_lengths(solid)
    _check_plane(solid)
    _check_rotation(solid)
    _check_law(solid)
    _check_element(solid)
    _check_surface_names(solid)
    _check_supports(solid)
    _check_scales(solid)


def _fail(solid: "Solid", name: str, text: str) -> KeyedError:
    return KeyedError(solid.kind, name, text)


def _check_source(solid: "Solid") -> None:
    """Refuse a body that cannot be drawn, or that is given twice."""
    shape, mesh = solid.shape, solid.mesh
    if solid.part is not None:
        check_part(solid)
    if solid.position is not None and (mesh is None or len(solid.position) != solid.dim):
        why = "is for mesh, and a shape has its own place; remove it"
        if mesh is not None:
            why = f'has {len(solid.position)} entries, model = "{solid.model}" has {solid.dim}'
        raise _fail(solid, "position", f" = {show(list(solid.position))} {why}.")
    if solid.position is not None and solid.is_axisymmetric and solid.position[0] != 0.0:
        text = f" = {show(list(solid.position))} leaves the axis x = 0; give 0 along x."
        raise _fail(solid, "position", text)
    if solid.orientation is not None:
        _check_orientation(solid, solid.orientation)
    if shape is None and mesh is None:
        raise _fail(solid, "shape", " is missing: give shape = { kind = ... }, or mesh = a file.")
    if shape is not None and mesh is not None:
        why = "contradicts the shape: each draws the body; remove one of them"
        raise _fail(solid, "mesh", f" = {show(mesh)} {why}.")
    if shape is not None:
        try:
            shape.check_model(solid.model)
        except KeyedError as error:
            raise error.moved("").under("shape", solid.kind) from None


def _check_orientation(solid: "Solid", given: Orientation) -> None:
    """Refuse turns of what is drawn turned, or out of the plane."""
    if solid.mesh is not None and solid.dim == 3:
        given.check_in_space(solid.kind)
        return
    text = ": in the plane all turns are about z: give angle."
    if solid.mesh is None or solid.is_axisymmetric:
        why = "bodies on an axis stay on it" if solid.is_axisymmetric else "shapes have an angle"
        text = f" is for mesh, and {why}; remove it."
    elif given.in_plane is not None:
        return
    raise _fail(solid, "orientation", text)


def _check_materials(solid: "Solid") -> None:
    """Refuse materials without groups, and what of one of them is missing or not allowed."""
    if not solid.materials:
        return
    if solid.mesh is None:
        text = " belong to physical groups of a mesh file, and a shape has none: give mesh = a "
        text += "file, or density and youngs_modulus as formulas in x, y, z."
        raise _fail(solid, "materials", text)
    solid.of_groups  # noqa: B018  (it checks each)


def _check_mesh_file(solid: "Solid") -> None:
    """Refuse sizes that a file holds already, and a geometry without a size."""
    mesh = "" if solid.mesh is None else solid.mesh.lower()
    if not mesh.endswith((*MESHES, ".geo")) and solid.mesh_size is None:
        what = "a STEP file" if mesh else "a shape"
        raise _fail(solid, "mesh_size", f" is missing: {what} needs it; give it in m.")
    if not mesh.endswith(MESHES):
        return
    given = (
        ("mesh_size", solid.mesh_size is not None, solid.mesh_size),
        ("refine", bool(solid.refine), "[...]"),
        ("cells", solid.cells != "simplex", solid.cells),
    )
    for name, is_given, value in given:
        if is_given:
            why = f"the file {show(solid.mesh)} holds its elements; remove it"
            raise _fail(solid, name, f" = {value}: {why}.")


def _check_sizes(solid: "Solid") -> None:
    """Refuse elements larger than the body, and refinements that coarsen."""
    if solid.mesh_size is None:
        return
    if solid.shape is not None:
        lower, upper = solid.shape.bounds(axisymmetric=solid.is_axisymmetric)
        extents = [b - a for a, b in zip(lower, upper, strict=True)]
        extent, least = max(extents), min(extents)
        far = max(abs(place) for place in (*lower, *upper))
        if far > _FAR * extent:
            text = f" lies {far:.3g} m from the origin and is {extent:.3g} m large: rounding would"
            raise _fail(solid, "shape", f"{text} spoil its places; put the origin near it.")
        if least < _THIN * extent:
            text = f" is {least:.3g} m across and {extent:.3g} m long: a mesh generator takes both"
            raise _fail(solid, "shape", f"{text} sides of it for one; make it thicker, or a plate.")
        if solid.mesh_size > extent:
            text = f" = {solid.mesh_size} exceeds the largest extent {extent:.6g} of the shape"
            raise _fail(solid, "mesh_size", f"{text}: give a smaller one in m.")
    for index, ball in enumerate(solid.refine):
        if ball.size > solid.mesh_size:
            text = f" = {ball.size} exceeds mesh_size = {solid.mesh_size}: give a smaller one."
            raise _fail(solid, f"refine[{index}].size", text)


def _check_lengths(solid: "Solid") -> None:
    """Refuse vectors of another dimension than the model's."""
    found: list[tuple[str, Sequence[Any] | None]] = [
        ("velocity", solid.velocity),
        ("displacement", solid.displacement),
        *((f"refine[{i}].point", ball.point) for i, ball in enumerate(solid.refine)),
        *((f"supports[{i}].value", entry.value) for i, entry in enumerate(solid.supports)),
        *((f"tractions[{i}].value", entry.value) for i, entry in enumerate(solid.tractions)),
    ]
    for name, value in found:
        if value is not None and len(value) != solid.dim:
            text = f' has {len(value)} entries, but model = "{solid.model}" has {solid.dim}'
            raise _fail(solid, name, f"{text} coordinates: give {solid.dim}.")
    if isinstance(solid.angular_velocity, tuple) != (solid.dim == 3):
        form = "a number" if solid.dim == 2 else "a list of 3 numbers"
        text = f' = {_plain(solid.angular_velocity)} does not fit model = "{solid.model}"'
        raise _fail(solid, "angular_velocity", f"{text}: give {form}.")


def _check_plane(solid: "Solid") -> None:
    """Refuse a thickness where there is none, and z in formulas of 2D models."""
    if not solid.is_plane and solid.thickness != 1.0:
        text = f' = {solid.thickness} does not fit model = "{solid.model}": remove it.'
        raise _fail(solid, "thickness", text)
    if solid.dim == 3:
        return
    found: list[tuple[str, Sequence[Formula], tuple[str, ...]]] = [
        ("velocity", solid.velocity, ()),
        ("displacement", solid.displacement, ()),
        *((name, [value], ()) for name, value in _varying(solid)),
        *((f"tractions[{i}].value", e.value, ("t",)) for i, e in enumerate(solid.tractions)),
        *((f"pressures[{i}].value", [e.value], ("t",)) for i, e in enumerate(solid.pressures)),
    ]
    for name, formulas, more in found:
        for formula in formulas:
            try:
                FormulaOf((*SPACE[:2], *more)).read(formula)
            except NotAllowedError as error:
                text = f' = {show(formula.text)} does not fit model = "{solid.model}": {error}.'
                raise _fail(solid, name, text) from None


def _varying(solid: "Solid") -> "list[tuple[str, Formula]]":
    """Constants of the material that are formulas."""
    each = ((name, getattr(solid, name)) for name in VARYING)
    return [(name, value) for name, value in each if isinstance(value, Formula)]


def _check_rotation(solid: "Solid") -> None:
    """Refuse a rotation that an axisymmetric or a cut body cannot have."""
    spin = solid.angular_velocity
    vector = spin if isinstance(spin, tuple) else (0.0, 0.0, spin)
    cuts = () if solid.shape is None else solid.shape.symmetry
    turned = [axis for axis, rate in zip(SPACE, vector, strict=True) if rate != 0.0]
    if solid.is_axisymmetric and turned:
        why = "an axisymmetric body can turn about no other line than its axis; remove it"
        raise _fail(solid, "angular_velocity", f" = {_plain(spin)}: {why}.")
    for cut in cuts:
        if any(axis != cut for axis in turned):
            why = f'contradicts symmetry "{cut}" of the shape: remove one of them'
            raise _fail(solid, "angular_velocity", f" = {_plain(spin)} {why}.")


def _check_law(solid: "Solid") -> None:
    """Refuse laws that small strains do not have, and what finite strain does not know."""
    if solid.strain == "small" and solid.material != "linear":
        text = f' = {show(solid.material)} contradicts strain = "small", which sees no more of a '
        raise _fail(solid, "material", text + 'law than "linear": remove one of them.')
    if not solid.is_finite:
        for index, load in enumerate(solid.pressures):
            if load.follows:
                text = " = true needs a surface that moves far, but strains are small: remove it, "
                text += 'or give strain = "finite".'
                raise _fail(solid, f"pressures[{index}].follows", text)
        return
    if not solid.materials and solid.keeps_volume and solid.material == "linear":
        text = f" = {solid.poisson_ratio}: the linear law has no mean dilatation under finite "
        text += 'strain, and locks: give material = "neo_hookean", or strain = "small".'
        raise _fail(solid, "poisson_ratio", text)


def _check_element(solid: "Solid") -> None:
    """Refuse a mean dilatation where there is none, and where it does not help."""
    if solid.element == "mean_dilatation" and solid.model == "plane_stress":
        text = ' = "mean_dilatation" does not fit model = "plane_stress", which gives way across: '
        raise _fail(solid, "element", text + "remove it.")
    if solid.element == "mean_dilatation" and solid.material == "foam":
        text = ' = "mean_dilatation" does not fit material = "foam", whose volume gives way: '
        raise _fail(solid, "element", text + "remove it.")
    asked = solid.is_finite or solid.element is not None
    if asked and solid.keeps_volume and solid.cells == "simplex" and solid.degree == 1:
        text = " = 1: linear triangles and tetrahedra lock in nearly incompressible bodies, with a "
        text += 'mean dilatation too: give degree = 2, or cells = "hexahedron".'
        raise _fail(solid, "degree", text)


def _check_surface_names(solid: "Solid") -> None:
    """Refuse surfaces that the shape does not have."""
    known = solid.surface_names
    if known is None:
        return
    named = [
        (f"{key}[{index}].surface", entry.surface)
        for key in ("supports", "tractions", "pressures")
        for index, entry in enumerate(getattr(solid, key))
    ]
    named += [
        (f"contact_surfaces[{index}]", name)
        for index, name in enumerate(solid.contact_surfaces or ())
    ]
    for name, surface in named:
        if surface not in known:
            text = f" = {show(surface)} is not a surface of this shape; {meant(surface, known)}."
            raise _fail(solid, name, text)


def _check_supports(solid: "Solid") -> None:
    """Refuse two supports on one surface, and one where the model holds it already."""
    cuts = () if solid.shape is None else solid.shape.symmetry
    by_model = {f"symmetry_{axis}" for axis in cuts} | (
        {"axis"} if solid.is_axisymmetric else set()
    )
    held: set[str] = set()
    for index, support in enumerate(solid.supports):
        if support.surface in by_model | held:
            how = "by the model" if support.surface in by_model else "by another support"
            text = f" = {show(support.surface)} is held {how} already: remove this support."
            raise _fail(solid, f"supports[{index}].surface", text)
        held.add(support.surface)


def _check_scales(solid: "Solid") -> None:
    """Refuse values, each fine alone, whose wave speed or mass overflows."""
    if not solid.is_uniform:  # elements are looked at one by one, once there are some
        return
    slow, fast, mass = math.nan, math.nan, math.nan
    with contextlib.suppress(OverflowError, ValueError, ZeroDivisionError):
        slow, fast = solid.s_wave_speed, solid.p_wave_speed
    if not (0 < slow < math.inf and 0 < fast < math.inf):
        text = f" = {solid.youngs_modulus} with density = {solid.density} gives no usable wave"
        raise _fail(solid, "youngs_modulus", f"{text} speed: give SI units.")
    if solid.shape is None:
        return
    with contextlib.suppress(OverflowError):
        mass = solid.mass or 0.0
    if not 0 < mass < math.inf:
        text = f" = {solid.density} gives no usable mass with this shape: give SI units."
        raise _fail(solid, "density", text)


def _plain(value: float | tuple[float, ...]) -> str:
    return show(list(value) if isinstance(value, tuple) else value)
