"""What is seen of bodies: triangles to colour, outlines, lines, balls, where they are pressed."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.report.arrows import once, resultants
from impactfem.report.edges import feature_edges, normals
from impactfem.result import Snapshots
from impactfem.result.cell_kinds import BY_VTK_TYPE, CellKind, boundary_facets, face_triangles
from impactfem.result.shapes import LINE, VERTEX
from impactfem.result.whole import Whole

_SHOWN = ("displacement", "von_mises", "contact_pressure", "contact_force", "gap")
_ALONG = 0.9  # cosine of the angle to x up to which faces of a body with edges are marked
_SAME = 1e-9  # of the size: nodes nearer to a plane of symmetry lie on it


@dataclass(frozen=True)
class Snapshot:
    """The bodies at one time.

    Attributes:
        time: [s].
        place: Where the nodes are [m], shape (nodes, 3).
        von_mises: [Pa], 0 where bodies have none, shape (nodes,).
        pressure: Contact pressure [Pa], 0 where there is none, shape (nodes,).
        may_touch: Whether a node may touch an obstacle, shape (nodes,).
        arrows: Contact forces as `impactfem.report.arrows.resultants`, shape (arrows, 2, 3).
    """

    time: float
    place: Floats
    von_mises: Floats
    pressure: Floats
    may_touch: Booleans
    arrows: Floats = field(default_factory=lambda: np.empty((0, 2, 3)))

    @property
    def is_finite(self) -> bool:
        """Whether it can be drawn."""
        return bool(np.isfinite(self.place).all() and np.isfinite(self.von_mises).all())

    @property
    def largest_force(self) -> float:
        """Of all arrows [N]; 0 without any."""
        return float(np.linalg.norm(self.arrows[:, 1], axis=1).max(initial=0.0))


@dataclass(frozen=True)
class Skin:
    """Parts of the mesh that pictures show.

    Attributes:
        fields: Fields of the bodies.
        points: Undeformed nodes [m], shape (nodes, 3); mirror images follow the nodes of the mesh.
        dim: Dimension of the picture, 2 or 3.
        triangles: All cells of a plane solid, or the surface of a solid in space with its normals
            outward, split at all nodes; shape (triangles, 3).
        facets: Facets of the boundary of the mesh for each kind of cells, nodes as in
            `CellKind.facets`.
        segments: Boundary of a plane solid with the body on the left, shape (segments, 2); empty
            in space.
        lines: Ends of the pieces of rods and beams, shape (pieces, 2).
        balls: Nodes that are points, shape (points,).
        radius: Of lines and balls [m], shape (nodes,).
        bodies: Number of the body of each node, shape (nodes,).
        names: Of the bodies.
        mirrors: Axis and coordinate [m] of the planes that the body is mirrored at, in this order.
        opened: Whether one image is left out, so that cut faces are seen.
        span: How far the bodies move about [m], where that says how large the picture is.
        relief: What magnifies the heights of a plate, with a method ``drawn``.
    """

    fields: Snapshots
    points: Floats
    dim: int
    triangles: Integers
    facets: tuple[Integers, ...]
    segments: Integers
    lines: Integers
    balls: Integers
    radius: Floats
    bodies: Integers
    names: tuple[str, ...]
    mirrors: tuple[tuple[int, float], ...] = ()
    opened: bool = False
    span: float = 0.0
    relief: Any = None

    @classmethod
    def of(
        cls,
        fields: Snapshots,
        whole: Whole | None = None,
        towards: Floats | None = None,
        dim: int | None = None,
    ) -> "Skin":
        """Take the skin of bodies.

        Args:
            fields: Of the bodies.
            whole: What they are a part of, shown with its mirror images.
            towards: Towards the viewer, shape (3,): of quarters and eighths the one in front is
                left out. Absent or zero: none is.
            dim: Dimension of the picture; that of the cells if None.
        """
        layout = fields.layout
        blocks, points = layout.blocks, layout.points
        none = np.empty((0, 2), dtype=np.int64)
        lines, balls = blocks.pop(LINE, none), blocks.pop(VERTEX, none).ravel()
        if dim is None:
            dim = max((BY_VTK_TYPE[kind].dim for kind in blocks), default=2)
        parts = [_surface(points, cells, BY_VTK_TYPE[kind], dim) for kind, cells in blocks.items()]
        skin = cls(
            fields, points, dim,
            np.concatenate([np.empty((0, 3), dtype=np.int64), *(part[0] for part in parts)]),
            tuple(part[1] for part in parts),
            np.concatenate([none, *(part[2] for part in parts)]),
            lines, balls, layout.radius, layout.body_of_nodes.astype(np.int64), layout.names,
        )  # fmt: skip
        mirrors = tuple((whole or Whole()).levels.items())
        return skin._with_images(mirrors, towards) if mirrors else skin

    def _with_images(
        self, mirrors: tuple[tuple[int, float], ...], towards: Floats | None
    ) -> "Skin":
        """The skin with its mirror images; planes between two images are inside."""
        planes = [
            np.abs(self.points[:, axis] - level) <= _SAME * self.size for axis, level in mirrors
        ]
        left_out = -1
        if len(mirrors) > 1 and towards is not None and towards.any():
            middles = _mirrored(self.points.mean(axis=0)[None], mirrors)
            left_out = int(np.argmax(middles @ towards))
        triangles, segments = [], []
        images, count = 2 ** len(mirrors), len(self.points)
        shown = [image for image in range(images) if image != left_out]
        for image in shown:
            cells, edges = self.triangles, self.segments
            for k, inside in enumerate(planes):
                if image ^ 1 << k != left_out:
                    edges = edges[~inside[edges].all(axis=1)]
                    cells = cells[~inside[cells].all(axis=1)] if self.dim == 3 else cells
            way = -1 if image.bit_count() % 2 else 1  # images of odd number are inside out
            triangles.append(cells[:, ::way] + image * count)
            segments.append(edges[:, ::way] + image * count)
        return replace(
            self,
            points=_mirrored(self.points, mirrors),
            triangles=np.concatenate(triangles),
            segments=np.concatenate(segments),
            lines=np.concatenate([self.lines + image * count for image in shown]),
            balls=np.concatenate([self.balls + image * count for image in shown]),
            radius=np.tile(self.radius, images),
            bodies=np.tile(self.bodies, images),
            mirrors=mirrors,
            opened=left_out >= 0,
        )

    @cached_property
    def nodes(self) -> Integers:
        """Nodes that are seen."""
        drawn = (self.triangles.ravel(), self.lines.ravel(), self.balls)
        return np.unique(np.concatenate(drawn))

    @cached_property
    def size(self) -> float:
        """Largest extent of the undeformed bodies, or of their motion if that is known [m]."""
        low, high = self.points - self.radius[:, None], self.points + self.radius[:, None]
        return max(float((high.max(axis=0) - low.min(axis=0)).max()), self.span)

    @cached_property
    def is_stressed(self) -> Booleans:
        """Whether a node is one of an elastic solid, shape (nodes,)."""
        images = 2 ** len(self.mirrors)
        count = len(self.points) // images
        found = np.zeros(count, dtype=bool)
        if "von_mises" in self.fields.point_data:  # rigid bodies have cells, but no stress
            found[self.triangles % count] = True  # the first image may be the one left out
            found &= ~np.isnan(self.fields.read(0, "von_mises")["von_mises"])
        return np.tile(found, images)

    @cached_property
    def stressed(self) -> Booleans:
        """Whether a triangle is one of an elastic solid, shape (triangles,)."""
        return np.asarray(self.is_stressed[self.triangles].all(axis=1))

    @cached_property
    def solid_nodes(self) -> dict[int, Integers]:
        """Seen nodes of each body that has triangles, by its number."""
        nodes = np.unique(self.triangles)
        owners = self.bodies[nodes]
        return {int(k): nodes[owners == k] for k in np.unique(owners)}

    @cached_property
    def open_faces(self) -> Booleans:
        """Whether a triangle in space is one of a plate, which has two sides; (triangles,)."""
        layout = self.fields.layout
        plates = [kind for kind, known in BY_VTK_TYPE.items() if known.dim < self.dim]
        bodies = layout.body_of_cells[np.isin(layout.types, plates)]
        return np.isin(self.bodies[self.triangles[:, 0]], bodies)

    @cached_property
    def marked(self) -> Booleans:
        """Faces in space in another tone, that show a turning body by; shape (triangles,).

        Of a round body every other eighth, of one with edges the faces that look along x.
        """
        owners = self.bodies[self.triangles[:, 0]]
        middles = self.points[self.triangles].mean(axis=1)
        normal = normals(self.points, self.triangles)
        flat = normal[:, 0] > _ALONG * np.linalg.norm(normal, axis=1)
        sharp = np.bincount(owners[self.edges[1][:, 0]], minlength=len(self.names))
        found = np.zeros(len(owners), dtype=bool)
        for body, nodes in self.solid_nodes.items():
            own = owners == body
            box = self.points[nodes]
            arms = middles[own] - 0.5 * (box.min(axis=0) + box.max(axis=0))
            eighth = (arms > 0.0).sum(axis=1) % 2 == 0
            found[own] = flat[own] if sharp[body] else eighth
        return found

    @cached_property
    def edges(self) -> tuple[Integers, Integers]:
        """Edges of the surface of what lies in space; see `feature_edges`."""
        return feature_edges(self.points, self.triangles)

    @cached_property
    def seams(self) -> tuple[Integers, Integers]:
        """The same with those between marked faces and others."""
        return feature_edges(self.points, self.triangles, self.marked)

    def snapshot(self, layer: int) -> Snapshot:
        """Read a layer."""
        known = [name for name in _SHOWN if name in self.fields.point_data]
        values = self.fields.read(layer, *known)
        count = len(values["displacement"])
        stress = np.where(self.is_stressed[:count], values.get("von_mises", np.zeros(count)), 0.0)
        touching = np.isfinite(values.get("gap", np.full(count, np.nan)))
        pressure = np.zeros(count)
        if "contact_pressure" in values:
            pressure[touching] = np.nan_to_num(values["contact_pressure"][touching])
        for facets in self.facets:
            _fill_middles(facets, self.dim, pressure, touching)
        images = 2 ** len(self.mirrors)
        places = self.points[:count] + values["displacement"]
        if self.relief is not None:
            places = self.relief.drawn(self.points[:count], places)
        forces = np.nan_to_num(values.get("contact_force", np.zeros((count, 3))))
        return Snapshot(
            time=float(self.fields.times[layer]),
            place=_mirrored(places, self.mirrors),
            von_mises=np.tile(stress, images),
            pressure=np.tile(pressure, images),
            may_touch=np.tile(touching, images),
            arrows=self._arrows(places, forces),
        )

    def _arrows(self, places: Floats, forces: Floats) -> Floats:
        """Contact forces, each once; those on balls and rods act on their surface."""
        amount = np.linalg.norm(forces, axis=1, keepdims=True)
        inward = np.divide(forces, amount, out=np.zeros_like(forces), where=amount > 0.0)
        surface = places - self.radius[: len(places), None] * inward
        lines = self.lines[(self.lines < len(places)).all(axis=1)]
        found = resultants(forces, surface, [*self.facets, lines], self.mirrors)
        return once(found, self.size)


def _surface(
    points: Floats, cells: Integers, kind: CellKind, dim: int
) -> tuple[Integers, Integers, Integers]:
    """Triangles, facets and boundary segments of solids of one kind of cells; see `Skin`."""
    if kind.dim < dim:  # plates are surfaces already, and forces act inside their outline
        return face_triangles(cells), cells, np.empty((0, 2), dtype=np.int64)
    facets, owners = boundary_facets(cells, kind)
    outward = points[facets].mean(axis=1) - points[cells[owners]].mean(axis=1)
    if kind.dim == 2:
        ends = points[facets[:, 1]] - points[facets[:, 0]]
        turned = ends[:, 1] * outward[:, 0] - ends[:, 0] * outward[:, 1] < 0.0
        facets[turned, :2] = facets[turned, 1::-1]
        chain = facets if facets.shape[1] == 2 else facets[:, [0, 2, 1]]
        pairs = [chain[:, k : k + 2] for k in range(chain.shape[1] - 1)]
        return face_triangles(cells), facets, np.concatenate(pairs)
    triangles = face_triangles(facets)
    beyond = np.repeat(outward, len(triangles) // len(facets), axis=0)
    turned = np.einsum("ij,ij->i", normals(points, triangles), beyond) < 0.0
    triangles[turned] = triangles[turned, ::-1]
    return triangles, facets, np.empty((0, 2), dtype=np.int64)


def _fill_middles(facets: Integers, dim: int, pressure: Floats, touching: Booleans) -> None:
    """Interpolate where corners carry contact and the nodes between them do not."""
    width = facets.shape[1]
    between: list[tuple[int, tuple[int, ...]]]
    if dim == 2:
        between = [(2, (0, 1))] if width == 3 else []
    else:
        corners = {3: 3, 4: 4, 6: 3, 9: 4}[width]
        between = [
            (corners + k, (k, (k + 1) % corners)) for k in range(min(corners, width - corners))
        ]
        between += [(8, (0, 1, 2, 3))] if width == 9 else []
    had = touching.copy()
    for middle, ends in between:
        node, around = facets[:, middle], facets[:, list(ends)]
        missing = ~had[node] & had[around].all(axis=1)
        pressure[node[missing]] = pressure[around[missing]].mean(axis=1)
        touching[node[missing]] = True


def _mirrored(places: Floats, mirrors: tuple[tuple[int, float], ...]) -> Floats:
    """Places (nodes, 3) and their images; bit k of an image's number says mirror k."""
    for axis, level in mirrors:
        image = places.copy()
        image[:, axis] = 2.0 * level - places[:, axis]
        places = np.concatenate([places, image])
    return places


def union(extents: Sequence[Floats], room: float) -> Floats:
    """Smallest window around others and some room, shape (2, 2): rows are directions."""
    all_of_them = np.stack(extents)
    low, high = all_of_them[:, :, 0].min(axis=0), all_of_them[:, :, 1].max(axis=0)
    return np.stack([low - room, high + room], axis=1)


def spread(extents: Sequence[Floats]) -> float:
    """Largest extent of windows together [m]; 0 of none."""
    return 0.0 if not extents else float(np.ptp(union(extents, 0.0), axis=1).max())
