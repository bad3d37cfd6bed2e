"""Meshes of a body whose shape changes: nodes move, elements stay."""

from dataclasses import replace
from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.mesh.body import BodyMesh
from impactfem.mesh.outline import outline

SHAPES = ("shape", "position", "orientation")
"""Keys of solids by which nodes move."""


def shaped(solid: Any, other: Any) -> bool:
    """Whether nodes of a body are elsewhere in another one, by keys that only solids have."""
    return any(getattr(solid, name, None) != getattr(other, name, None) for name in SHAPES)


def morphed(mesh: BodyMesh, solid: Any, other: Any) -> BodyMesh:
    """The mesh of a solid for another one of the same elements (collective).

    Lengths of blocks, discs, balls and cylinders stretch it evenly, which is the harmonic extension
    of what their faces do; radii of rings move its nodes in proportion along radii. Meshes of files
    are moved and turned.

    Args:
        mesh: Of the solid.
        solid: `impactfem.scene.solids.Solid`.
        other: Of the same kind of shape, cuts and surfaces, or the same file.

    Raises:
        SceneError: It is not.
    """
    if not shaped(solid, other):
        return mesh
    points = np.asarray(mesh.mesh.geometry.x[:, : mesh.gdim], dtype=np.float64)
    if solid.shape is None:
        first, last = (np.zeros(mesh.gdim) if s.position is None else np.array(s.position)
                       for s in (solid, other))  # fmt: skip
        moved = last + (points - first) @ solid.turn @ other.turn.T
        return replace(mesh, mesh=fem.moved_mesh(mesh.mesh, moved))
    revolved = solid.model == "axisymmetric"
    one, two = solid.shape, other.shape
    like = [(s.kind, *s.surface_names(axisymmetric=revolved)) for s in (one, two)]
    if like[0] != like[1]:
        raise SceneError(
            f"shape of {solid.name}: its kind, cuts and surfaces are {', '.join(like[0])} at the "
            f"start and {', '.join(like[1])} here; gradients move the nodes of the mesh of the "
            "start: vary lengths within which these stay"
        )
    begin, end = (outline(shape, axisymmetric=revolved).frame for shape in (one, two))
    along = begin.scale * begin.to_drawing(points)
    moved = end.to_scene(_stretched(along, one.figure, two.figure) / end.scale)
    share = two.volume / one.volume
    return replace(mesh, mesh=fem.moved_mesh(mesh.mesh, moved), volume=share * mesh.volume)


def _stretched(points: Floats, one: Any, two: Any) -> Floats:
    """Points of a figure, from its origin, in another one of its kind."""
    if one.edges:
        return np.asarray(points * np.divide(two.edges, one.edges))
    radii = list(zip(one.radii.values(), two.radii.values(), strict=True))
    (outer, larger), *holes = radii
    if holes:
        ((inner, other),) = holes
        away = np.linalg.norm(points, axis=1, keepdims=True)
        share = (larger - other) / (outer - inner)
        return np.asarray((other + share * (away - inner)) / away * points)
    shares = np.full(points.shape[1], larger / outer)
    if one.height is not None:
        shares[1] = two.height / one.height
    return np.asarray(points * shares)
