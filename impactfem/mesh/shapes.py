"""Meshes of named shapes: triangles and tetrahedra by Gmsh, quadrilaterals and hexahedra mapped."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from impactfem import fem
from impactfem.errors import MeshError
from impactfem.mesh.outline import Ball, Outline, Polygon, Round, Sector, outline, told
from impactfem.mesh.raw import Cell, RawMesh, numbering, outer_facets, without_loose_nodes
from impactfem.mesh.session import gmsh_session
from impactfem.mesh.sizes import ball_field, options

MAX_CELLS = 50_000_000
"""Largest mesh that is begun."""


@dataclass(frozen=True)
class Finer:
    """Smaller elements in a ball: `impactfem.scene.solids.Refinement` in another frame.

    Attributes:
        point: Centre, shape (dim,).
        radius: Radius.
        size: Mesh size inside.
    """

    point: Sequence[float]
    radius: float
    size: float

    def told(self, largest: float) -> "Finer":
        """The same in shares of the largest length; a last digit of its place changes nothing."""
        radius, size = told((self.radius, self.size), largest).tolist()
        return Finer(np.round(np.divide(self.point, largest), 9).tolist(), radius, size)


def shape_mesh(
    shape: Any, size: float, refine: Sequence[Any] = (), *, degree: int = 1,
    axisymmetric: bool = False,
) -> RawMesh:  # fmt: skip
    """Mesh a shape with triangles or tetrahedra, on this rank.

    Args:
        shape: A shape of `impactfem.scene.shapes`.
        size: Length of the edges [m].
        refine: Balls with smaller elements, `impactfem.scene.solids.Refinement`.
        degree: Degree of the geometry; 2 follows curved surfaces.
        axisymmetric: Whether x is the radius r >= 0.

    Raises:
        MeshError: The mesh would be too large, or Gmsh failed.
    """
    return drawn_mesh(outline(shape, axisymmetric=axisymmetric), size, refine, degree=degree)


def drawn_mesh(
    plan: Outline, size: float, refine: Sequence[Any] = (), *, degree: int = 1
) -> RawMesh:
    """The same of what is drawn already."""
    balls = [_in_drawing(ball, plan) for ball in refine]
    check_count(plan, size, balls)
    largest = plan.largest
    scaled = float(told(size / plan.frame.scale, largest))
    drawn = [ball.told(largest) for ball in balls]
    with gmsh_session() as gmsh:
        dim = len(plan.frame.origin)
        raw = _meshed(gmsh, plan.drawing.told(largest), dim, scaled, drawn, degree)
    return placed(replace(raw, points=largest * raw.points), plan)


def placed(raw: RawMesh, plan: Outline) -> RawMesh:
    """Name the surfaces of a mesh in the frame of its drawing and bring it into the scene."""
    points = raw.points.copy()
    # Gmsh computes places on surfaces to some digits less than a number has.
    for _, place in sorted(plan.places, key=lambda item: not isinstance(item[1], Round)):
        on = place.holds(points)
        points[on] = place.moved(points[on])
    rim = outer_facets(raw)
    free = np.ones(len(rim), dtype=bool)
    surfaces = {}
    for name, place in plan.places:
        on = free & place.holds(points)[rim].all(axis=1)
        surfaces[name] = rim[on]
        free &= ~on
    points = plan.frame.to_scene(points)
    for axis, level in plan.levels:
        near = np.abs(points[:, axis] - level) <= 1e-12 * plan.frame.scale
        points[near, axis] = level
    surfaces = {name: rows for name, rows in surfaces.items() if len(rows)}
    return RawMesh(points, raw.cells, raw.cell, raw.degree, surfaces)


def _in_drawing(ball: Any, plan: Outline) -> Finer:
    """A ball in the frame of the drawing."""
    scale = plan.frame.scale
    centre = plan.frame.to_drawing(np.array([ball.point], dtype=np.float64))[0]
    return Finer(tuple(centre), ball.radius / scale, ball.size / scale)


def check_count(plan: Outline, size: float, balls: Sequence[Finer] = ()) -> None:
    """Refuse a mesh that would not fit before an hour is spent on it."""
    dim = len(plan.frame.origin)
    scaled = size / plan.frame.scale
    share = 2.6 if dim == 2 else 5.0  # measured: cells of a mesh times size^dim over the volume
    count = share * plan.measure / scaled**dim
    for ball in balls:
        inside = min((4.19 if dim == 3 else 3.14) * ball.radius**dim, plan.measure)
        count += share * inside / ball.size**dim
    if count > MAX_CELLS:
        raise MeshError(
            f"mesh_size = {size:g} would make about {count:.1e} elements (limit {MAX_CELLS:.0e}); "
            "give a larger mesh_size or refine a smaller ball"
        )


def _draw(geo: Any, drawing: Polygon | Sector | Ball) -> None:
    """Fill the model with the drawing; whatever is left of a circle keeps its four cardinal points.

    A body then has a node where it first touches a plane, not somewhere near.
    """
    if isinstance(drawing, Ball):
        _draw_ball(geo, drawing)
        return
    if isinstance(drawing, Polygon):
        low, high = drawing.heights or (0.0, 0.0)
        points = [geo.addPoint(x, y, low) for x, y in drawing.corners]
        curves = [geo.addLine(a, points[(k + 1) % len(points)]) for k, a in enumerate(points)]
        face = geo.addPlaneSurface([geo.addCurveLoop(curves)])
        if drawing.heights:
            geo.extrude([(2, face)], 0.0, 0.0, high - low)
        return
    face = _draw_sector(geo, drawing)
    if drawing.heights:
        geo.extrude([(2, face)], 0.0, drawing.heights[1] - drawing.heights[0], 0.0)


def _draw_sector(geo: Any, sector: Sector) -> int:
    """The face of a sector; in 3D at its least height."""

    def point(a: float, b: float) -> int:
        tag: int = (
            geo.addPoint(b, sector.heights[0], a) if sector.heights else geo.addPoint(a, b, 0.0)
        )
        return tag

    centre = point(0.0, 0.0)

    def arcs(radius: float) -> tuple[list[int], list[int]]:
        whole = sector.count == 4
        ends = [
            point(*(radius * np.array(((1, 0), (0, 1), (-1, 0), (0, -1))[k % 4])))
            for k in range(sector.first, sector.first + sector.count + (not whole))
        ]
        after = ends[1:] + ends[:1] * whole
        return ends, [geo.addCircleArc(a, centre, b) for a, b in zip(ends, after, strict=False)]

    ends, outer = arcs(sector.radius)
    if sector.inner:
        inner_ends, inner = arcs(sector.inner)
        if sector.count == 4:
            loops = [geo.addCurveLoop(outer), geo.addCurveLoop(inner)]
        else:
            back = [-curve for curve in reversed(inner)]
            sides = geo.addLine(ends[-1], inner_ends[-1]), geo.addLine(inner_ends[0], ends[0])
            loops = [geo.addCurveLoop([*outer, sides[0], *back, sides[1]])]
    elif sector.count == 4:
        loops = [geo.addCurveLoop(outer)]
    else:
        sides = geo.addLine(ends[-1], centre), geo.addLine(centre, ends[0])
        loops = [geo.addCurveLoop([*outer, *sides])]
    face: int = geo.addPlaneSurface(loops)
    return face


def _draw_ball(geo: Any, ball: Ball) -> None:
    """The ball from its octants: patches without the poles at which a map would degenerate."""
    centre = geo.addPoint(0.0, 0.0, 0.0)
    kept = [(sign,) if sign else (1, -1) for sign in ball.signs]
    tips = {
        (axis, sign): geo.addPoint(*(ball.radius * sign * np.eye(3)[axis]))
        for axis in range(3)
        for sign in kept[axis]
    }
    arcs: dict[tuple[tuple[int, int], tuple[int, int]], int] = {}
    for a, b in ((0, 1), (1, 2), (2, 0)):
        for first in kept[a]:
            for second in kept[b]:
                one, two = (a, first), (b, second)
                arcs[one, two] = geo.addCircleArc(tips[one], centre, tips[two])
                arcs[two, one] = -arcs[one, two]
    faces = []
    for x in kept[0]:
        for y in kept[1]:
            for z in kept[2]:
                around = [(0, x), (1, y), (2, z)]
                curves = [arcs[around[k], around[(k + 1) % 3]] for k in range(3)]
                faces.append(
                    geo.addSurfaceFilling([geo.addCurveLoop(curves)], sphereCenterTag=centre)
                )
    rays: dict[tuple[int, int], int] = {}
    cuts = [axis for axis in range(3) if ball.signs[axis]]
    faces += [_draw_cut(geo, axis, tips, arcs, rays, centre) for axis in cuts]
    geo.addVolume([geo.addSurfaceLoop(faces)])


def _draw_cut(
    geo: Any, axis: int, tips: Any, arcs: Any, rays: dict[tuple[int, int], int], centre: int
) -> int:  # fmt: skip
    """The plane face at which a ball is cut."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    round_ = [(a, 1), (b, 1), (a, -1), (b, -1)]
    there = [tip in tips for tip in round_]
    count = sum(there)
    start = next(k for k in range(4) if there[k] and (count == 4 or not there[k - 1]))
    way = [round_[(start + k) % 4] for k in range(count)]
    way += way[:1] * (count == 4)
    curves = [arcs[one, two] for one, two in pairwise(way)]
    if count < 4:
        for tip in (way[-1], way[0]):
            if tip not in rays:
                rays[tip] = geo.addLine(tips[tip], centre)
        curves += [rays[way[-1]], -rays[way[0]]]
    face: int = geo.addPlaneSurface([geo.addCurveLoop(curves)])
    return face


def _meshed(
    gmsh: Any, drawing: Polygon | Sector | Ball, dim: int, size: float, balls: Sequence[Finer],
    degree: int,
) -> RawMesh:  # fmt: skip
    """Draw and mesh in the current model."""
    wanted = options(dim, size, [ball.size for ball in balls])
    before = {name: gmsh.option.getNumber(name) for name in wanted}
    try:
        _draw(gmsh.model.geo, drawing)
        gmsh.model.geo.synchronize()
        for name, value in wanted.items():
            gmsh.option.setNumber(name, value)
        _set_sizes(gmsh, size, balls)
        gmsh.model.mesh.generate(dim)
        if degree > 1:
            gmsh.model.mesh.setOrder(degree)
    except Exception as error:
        raise MeshError(f"Gmsh could not mesh the shape: {error}; try another mesh_size") from error
    finally:
        for name, value in before.items():
            gmsh.option.setNumber(name, value)
    return _read(gmsh, dim, degree)


def _set_sizes(gmsh: Any, size: float, balls: Sequence[Finer]) -> None:
    """Make the mesh size of the current model the least that any ball asks for."""
    field = gmsh.model.mesh.field
    tags = []
    for ball in balls:
        tags.append(field.add("Ball"))
        for name, value in ball_field(ball, size).items():
            field.setNumber(tags[-1], name, value)
    if tags:
        least = field.add("Min")
        field.setNumbers(least, "FieldsList", tags)
        field.setAsBackgroundMesh(least)


def _read(gmsh: Any, dim: int, degree: int) -> RawMesh:
    """Take the only mesh of the model out of Gmsh."""
    cell: Cell = "triangle" if dim == 2 else "tetrahedron"
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, _, lists = gmsh.model.mesh.getElements(dim)
    if len(lists) != 1 or not len(lists[0]):
        raise MeshError("Gmsh made no elements of the shape; give a smaller mesh_size")
    nodes = len(fem.reference_nodes(cell, degree))
    cells = numbering(tags)(lists[0]).reshape(-1, nodes)
    cells = cells[:, fem.from_gmsh_order(cell, nodes)]
    points = np.reshape(coordinates, (-1, 3))[:, :dim]
    points, cells, _ = without_loose_nodes(points, cells, {})
    return RawMesh(points, cells, cell, degree)
