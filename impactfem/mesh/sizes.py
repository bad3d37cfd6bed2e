"""Sizes of elements, as Gmsh's options and fields."""

from collections.abc import Iterable
from typing import Any

GROWTH = 0.3
"""Growth of the mesh size with the distance from a refined ball."""

_FRONTAL, _DELAUNAY, _HXT = 6, 1, 10  # Gmsh's numbers of its algorithms


def options(dim: int, size: float, finer: Iterable[float] = ()) -> dict[str, float]:
    """Gmsh's options for elements of one size, smaller where a field says so.

    Args:
        dim: Dimension of the mesh.
        size: Length of edges; Gmsh keeps it at the boundary, inner edges of tetrahedra are longer
            (1.4 times, median).
        finer: Sizes that fields ask for.
    """
    return {
        "General.NumThreads": 1,  # several threads would not give the same mesh twice
        "Mesh.Algorithm": _FRONTAL,
        "Mesh.Algorithm3D": _HXT if dim == 3 else _DELAUNAY,
        "Mesh.ElementOrder": 1,
        "Mesh.MeshSizeExtendFromBoundary": 0,
        "Mesh.MeshSizeFactor": 1,
        "Mesh.MeshSizeFromCurvature": 0,
        "Mesh.MeshSizeFromPoints": 0,
        "Mesh.MeshSizeMax": size,
        "Mesh.MeshSizeMin": min([size, *finer]),
        "Mesh.Optimize": 1,
        "Mesh.RandomSeed": 1,
        "Mesh.SecondOrderLinear": 0,
    }


def ball_field(ball: Any, size: float, unit: float = 1.0) -> dict[str, float]:
    """Parameters of Gmsh's field "Ball": small inside, growing slowly to the mesh size outside.

    Args:
        ball: With point, radius and size, as `impactfem.scene.solids.Refinement`.
        size: Mesh size outside.
        unit: What these lengths are divided by.
    """
    centre = dict(zip(("XCenter", "YCenter", "ZCenter"), ball.point, strict=False))
    lengths = {
        **centre,
        "Radius": ball.radius,
        "Thickness": max(size - ball.size, 0.0) / GROWTH,
        "VIn": ball.size,
        "VOut": size,
    }
    return {name: float(length) / unit for name, length in lengths.items()}
