"""What is seen of a solid: triangles to colour, its outline, and where it carries pressure."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from impactfem.result import SolidFields
from impactfem.result.cell_kinds import BY_VTK_TYPE, boundary_facets, face_triangles
from impactfem.result.whole import Whole

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_SAME = 1e-9  # of the size: nodes nearer to a plane of symmetry lie on it


@dataclass(frozen=True)
class Snapshot:
    """The solid at one time.

    Attributes:
        time: [s].
        place: Where the nodes are [m], shape (nodes, 3).
        von_mises: [Pa], shape (nodes,).
        pressure: Contact pressure [Pa], 0 where there is none, shape (nodes,).
        may_touch: Whether a node may touch an obstacle, shape (nodes,).
    """

    time: float
    place: Floats
    von_mises: Floats
    pressure: Floats
    may_touch: NDArray[np.bool_]

    @property
    def is_finite(self) -> bool:
        """Whether it can be drawn."""
        return bool(np.isfinite(self.place).all() and np.isfinite(self.von_mises).all())


@dataclass(frozen=True)
class Skin:
    """Parts of the mesh that pictures show.

    Attributes:
        fields: Fields of the solid.
        points: Undeformed nodes [m], shape (nodes, 3); mirror images follow the nodes of the mesh.
        dim: Dimension of the cells, 2 or 3.
        triangles: All cells of a plane solid, or the surface of a solid in space with its normals
            outward, split at all nodes; shape (triangles, 3).
        facets: Facets of the boundary of the mesh, nodes as in `CellKind.facets`.
        segments: Boundary of a plane solid with the body on the left, shape (segments, 2); empty
            in space.
        mirrors: Axis and coordinate [m] of the planes that the body is mirrored at, in this order.
        opened: Whether one image is left out, so that cut faces are seen.
    """

    fields: SolidFields
    points: Floats
    dim: int
    triangles: Integers
    facets: Integers
    segments: Integers
    mirrors: tuple[tuple[int, float], ...] = ()
    opened: bool = False

    @classmethod
    def of(
        cls, fields: SolidFields, whole: Whole | None = None, towards: Floats | None = None
    ) -> "Skin":
        """Take the skin of a solid.

        Args:
            fields: Of the solid.
            whole: What it is a part of, shown with its mirror images.
            towards: Towards the viewer, shape (3,): of quarters and eighths the one in front is
                left out. Absent or zero: none is.
        """
        kind = BY_VTK_TYPE[fields.vtk_cell_type]
        points, cells = fields.points, fields.cells
        facets, owners = boundary_facets(cells, kind)
        outward = points[facets].mean(axis=1) - points[cells[owners]].mean(axis=1)
        if kind.dim == 2:
            ends = points[facets[:, 1]] - points[facets[:, 0]]
            turned = ends[:, 1] * outward[:, 0] - ends[:, 0] * outward[:, 1] < 0.0
            facets[turned, :2] = facets[turned, 1::-1]
            chain = facets if facets.shape[1] == 2 else facets[:, [0, 2, 1]]
            pairs = [chain[:, k : k + 2] for k in range(chain.shape[1] - 1)]
            triangles, segments = face_triangles(cells), np.concatenate(pairs)
        else:
            triangles = face_triangles(facets)
            segments = np.empty((0, 2), dtype=np.int64)
            beyond = np.repeat(outward, len(triangles) // len(facets), axis=0)
            turned = np.einsum("ij,ij->i", normals(points, triangles), beyond) < 0.0
            triangles[turned] = triangles[turned, ::-1]
        skin = cls(fields, points, kind.dim, triangles, facets, segments)
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
        for image in range(2 ** len(mirrors)):
            if image == left_out:
                continue
            cells, edges = self.triangles, self.segments
            for k, inside in enumerate(planes):
                if image ^ 1 << k != left_out:
                    edges = edges[~inside[edges].all(axis=1)]
                    cells = cells[~inside[cells].all(axis=1)] if self.dim == 3 else cells
            way = -1 if image.bit_count() % 2 else 1  # images of odd number are inside out
            triangles.append(cells[:, ::way] + image * len(self.points))
            segments.append(edges[:, ::way] + image * len(self.points))
        return replace(
            self,
            points=_mirrored(self.points, mirrors),
            triangles=np.concatenate(triangles),
            segments=np.concatenate(segments),
            mirrors=mirrors,
            opened=left_out >= 0,
        )

    @cached_property
    def nodes(self) -> Integers:
        """Nodes that are seen."""
        return np.unique(self.triangles)

    @cached_property
    def size(self) -> float:
        """Largest extent of the undeformed body [m]."""
        return float(np.ptp(self.points, axis=0).max())

    @cached_property
    def bodies(self) -> Integers:
        """Which of the parts without common cells a node belongs to, in the order of nodes."""
        # Loaded here: pictures of bars and points need none of it.
        from scipy.sparse import coo_array  # noqa: PLC0415
        from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

        cells, count = self.fields.cells, self.fields.num_points
        ends = np.broadcast_to(cells[:, :1], cells.shape).ravel()
        graph = coo_array((np.ones(cells.size), (ends, cells.ravel())), shape=(count, count))
        found: Integers = connected_components(graph, directed=False)[1].astype(np.int64)
        first = np.unique(found, return_index=True)[1]
        return np.tile(np.argsort(np.argsort(first))[found], 2 ** len(self.mirrors))

    def snapshot(self, layer: int) -> Snapshot:
        """Read a layer."""
        values = self.fields.read(layer, "displacement", "von_mises", "contact_pressure", "gap")
        touching = np.isfinite(values["gap"])
        pressure = np.where(touching, np.nan_to_num(values["contact_pressure"]), 0.0)
        self._fill_middles(pressure, touching)
        place = self.points[: self.fields.num_points] + values["displacement"]
        images = 2 ** len(self.mirrors)
        return Snapshot(
            float(self.fields.times[layer]),
            _mirrored(place, self.mirrors),
            *(np.tile(part, images) for part in (values["von_mises"], pressure, touching)),
        )

    def _fill_middles(self, pressure: Floats, touching: NDArray[np.bool_]) -> None:
        """Interpolate where corners carry contact and the nodes between them do not."""
        width = self.facets.shape[1]
        between: list[tuple[int, tuple[int, ...]]]
        if self.dim == 2:
            between = [(2, (0, 1))] if width == 3 else []
        else:
            corners = {3: 3, 4: 4, 6: 3, 9: 4}[width]
            between = [
                (corners + k, (k, (k + 1) % corners)) for k in range(min(corners, width - corners))
            ]
            between += [(8, (0, 1, 2, 3))] if width == 9 else []
        had = touching.copy()
        for middle, ends in between:
            node, around = self.facets[:, middle], self.facets[:, list(ends)]
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


def normals(points: Floats, triangles: Integers) -> Floats:
    """Normals of triangles, as long as twice their areas; shape (triangles, 3)."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def union(extents: Sequence[Floats], room: float) -> Floats:
    """Smallest window around others and some room, shape (2, 2): rows are directions."""
    all_of_them = np.stack(extents)
    low, high = all_of_them[:, :, 0].min(axis=0), all_of_them[:, :, 1].max(axis=0)
    return np.stack([low - room, high + room], axis=1)
