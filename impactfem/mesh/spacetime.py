"""Meshes of the space-time rectangle (0, T) x (0, L) of a bar.

All meshes are dimensionless: first coordinate c t / L, second x / L. A bar of a nanometre and one
of a kilometre then give the same numbers.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from impactfem.mesh.session import distribute

BOUNDARIES = ("start", "end", "wall", "far")
"""Names of the sides: t = 0, t = T, x = 0 (can touch the wall), x = L."""

Diagonal = Literal["outgoing", "incoming"]

# Nodes closer than this share of the rectangle's side belong to one layer. Gmsh places the nodes
# of a transfinite curve to about 1e-11.
_SAME = 1e-9


@dataclass(frozen=True)
class Layout:
    """What is known of a space-time mesh before it is distributed.

    Attributes:
        tags: Physical tag of each boundary name.
        num_nodes: Number of nodes.
        times: Dimensionless layer times, shape (layers + 1,); None if there are no layers.
        nodes: Dimensionless node positions, shape (elements + 1,); None if there are no layers.
    """

    tags: dict[str, int]
    num_nodes: int
    times: NDArray[np.float64] | None = None
    nodes: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class SpaceTimeMesh:
    """A distributed space-time mesh with named boundaries.

    Attributes:
        mesh: DOLFINx mesh of triangles, coordinates (c t / L, x / L).
        facet_tags: Tags of the boundary facets.
        layout: Names, and layers if there are any.
    """

    mesh: Any
    facet_tags: Any
    layout: Layout

    def facets(self, name: str) -> NDArray[np.int32]:
        """Local facets (ghosts included) of the boundary ``name``."""
        found: NDArray[np.int32] = self.facet_tags.find(self.layout.tags[name])
        return found


def layered_mesh(
    comm: Any, elements: int, layers: int, courant: float, diagonal: Diagonal = "outgoing"
) -> SpaceTimeMesh:
    """Build the uniform mesh of right triangles with dt = courant * h / c.

    Args:
        comm: MPI communicator.
        elements: Elements along the bar.
        layers: Layers in time.
        courant: c dt / h.
        diagonal: Direction of the diagonals: "outgoing" follows the waves that leave the wall,
            "incoming" those that run towards it. The algebraic system is the same (no edge couples
            along a hypotenuse of a right triangle); only the field between nodes differs.

    Raises:
        MeshError: Gmsh failed.
    """
    duration = layers * courant / elements

    def build(gmsh: Any) -> Layout:
        geo = gmsh.model.geo
        corners = [geo.addPoint(*at, 0) for at in ((0, 0), (duration, 0), (duration, 1), (0, 1))]
        names = ("wall", "end", "far", "start")
        curves = [geo.addLine(corners[i], corners[(i + 1) % 4]) for i in range(4)]
        surface = geo.addPlaneSurface([geo.addCurveLoop(curves)])
        for curve, pieces in zip(curves, (layers, elements, layers, elements), strict=True):
            geo.mesh.setTransfiniteCurve(curve, pieces + 1)
        geo.mesh.setTransfiniteSurface(surface, "Right" if diagonal == "outgoing" else "Left")
        geo.synchronize()
        for curve, name in zip(curves, names, strict=True):
            gmsh.model.addPhysicalGroup(1, [curve], tag=curve, name=name)
        gmsh.model.addPhysicalGroup(2, [surface], tag=surface, name="bar")
        gmsh.model.mesh.generate(2)
        _, coordinates, _ = gmsh.model.mesh.getNodes()
        points = np.reshape(coordinates, (-1, 3))[:, :2]
        return find_layers(points, dict(zip(names, curves, strict=True)))

    return finish(*distribute(comm, build))


def find_layers(points: NDArray[np.float64], tags: dict[str, int]) -> Layout:
    """Recognise layers: a mesh has them if its nodes form a grid times x positions.

    Args:
        points: Dimensionless nodes, shape (nodes, 2).
        tags: Physical tag of each boundary.
    """
    times, nodes = _levels(points[:, 0]), _levels(points[:, 1])
    if len(times) * len(nodes) != len(points):
        return Layout(tags, len(points))
    index = nearest(times, points[:, 0]) * len(nodes) + nearest(nodes, points[:, 1])
    if len(np.unique(index)) != len(points):
        return Layout(tags, len(points))
    return Layout(tags, len(points), times, nodes)


def finish(mesh: Any, facet_tags: Any, layout: Layout) -> SpaceTimeMesh:
    """Put the nodes of a layered mesh exactly on their layers.

    Without this the mesh generator's 1e-11 in the coordinates would be the error of the solution.
    """
    if layout.times is not None and layout.nodes is not None:
        x = mesh.geometry.x
        x[:, 0] = layout.times[nearest(layout.times, x[:, 0])]
        x[:, 1] = layout.nodes[nearest(layout.nodes, x[:, 1])]
    return SpaceTimeMesh(mesh, facet_tags, layout)


def nearest(levels: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Index of the level nearest to each value; levels increase."""
    middles = 0.5 * (levels[1:] + levels[:-1])
    return np.searchsorted(middles, values)


def _levels(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distinct values, those within rounding merged; exactly uniform if they nearly are."""
    ordered = np.sort(values)
    span = ordered[-1] - ordered[0]
    first = np.concatenate([[True], np.diff(ordered) > _SAME * span])
    levels = ordered[first]
    uniform = np.linspace(levels[0], levels[-1], len(levels))
    if np.abs(levels - uniform).max() <= _SAME * span:
        # The ends of the rectangle are meant; 0 is exactly 0.
        uniform -= levels[0] if abs(levels[0]) < _SAME * span else 0.0
        return uniform
    exact: NDArray[np.float64] = levels
    return exact
