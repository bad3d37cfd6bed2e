"""Space-time meshes from a user's .geo or .msh file, with their faults reported."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import MeshError
from impactfem.mesh.session import distribute
from impactfem.mesh.spacetime import BOUNDARIES, Layout, SpaceTimeMesh, find_layers, finish
from impactfem.reading.holdings import Holdings
from impactfem.reading.opening import look, opened
from impactfem.scene.values import show

_LINE, _TRIANGLE = 1, 2  # Gmsh's numbers of the 2-node line and the 3-node triangle
_TOLERANCE = 1e-6  # share of a side by which a boundary may miss its place
_FLAT = 1e-10  # share of the mean area below which a triangle has none


def read_mesh(
    comm: Any, path: Path, length: float, duration: float, wave_speed: float
) -> SpaceTimeMesh:
    """Read a space-time mesh: first coordinate t [s], second x [m] from the near end.

    Args:
        comm: MPI communicator.
        path: A ``.geo`` script (meshed here) or a ``.msh`` file.
        length: Length of the bar [m].
        duration: End of the scene [s].
        wave_speed: Wave speed [m/s]; with the length it makes the mesh dimensionless.

    Raises:
        MeshError: The file cannot be read, or the mesh is not one of the rectangle
            (0, duration) x (0, length) with the boundaries start, end, wall and far.
    """
    scale = np.array([wave_speed / length, 1.0 / length])

    def build(gmsh: Any) -> Layout:
        with opened(path) as found:
            gmsh.merge(str(found.path))
            _check_one_material(path, found.holdings, length)
        reader = _Reader(gmsh, path, np.array([duration, length]))
        triangulation = reader.triangulation()
        tags = reader.boundaries(triangulation)
        _keep_groups(gmsh, tags)
        return find_layers(triangulation.points * scale, tags)

    mesh, facet_tags, layout = distribute(comm, build)
    mesh.geometry.x[:, :2] *= scale
    return finish(mesh, facet_tags, layout)


@dataclass(frozen=True)
class _Triangulation:
    """Nodes and edges of a mesh.

    Attributes:
        tags: Gmsh's node tags, increasing, shape (nodes,).
        points: Nodes (t, x) in s and m, shape (nodes, 2).
        rim: Edges of one triangle only, as increasing pairs of node indices, shape (edges, 2).
    """

    tags: NDArray[np.int64]
    points: NDArray[np.float64]
    rim: NDArray[np.int64]


@dataclass(frozen=True)
class _Reader:
    """Checks the model that Gmsh has read from ``path``; ``sides`` are duration and length."""

    gmsh: Any
    path: Path
    sides: NDArray[np.float64]

    def fault(self, text: str) -> MeshError:
        """An error about the file."""
        return MeshError(f"mesh file {self.path}: {text}")

    def triangulation(self) -> _Triangulation:
        """Check elements, extent and coherence."""
        mesh = self.gmsh.model.mesh
        kinds = [int(kind) for kind in mesh.getElementTypes(2)]
        if kinds != [_TRIANGLE] or list(mesh.getElementTypes(3)):
            held = [*kinds, *map(int, mesh.getElementTypes(3))]
            names = [str(mesh.getElementProperties(kind)[0]) for kind in held]
            raise self.fault(
                f"needs 3-node triangles only, it has {', '.join(names) or 'none'}; mesh one "
                "plane surface with first-order triangles"
            )
        if not self.gmsh.model.getPhysicalGroups(2):
            raise self.fault('no physical surface; add `Physical Surface("bar") = {...};`')
        found, coordinates, _ = mesh.getNodes()
        order = np.argsort(found)
        tags = np.asarray(found, dtype=np.int64)[order]
        points = np.reshape(coordinates, (-1, 3))[order]
        self._check_extent(points)
        _, _, nodes = mesh.getElements(2)
        triangles = np.searchsorted(tags, np.asarray(nodes[0], dtype=np.int64)).reshape(-1, 3)
        loose = len(points) - len(np.unique(triangles))
        if loose:
            raise self.fault(
                f"{loose} of {len(points)} nodes belong to no triangle; remove loose nodes"
            )
        plane = np.ascontiguousarray(points[:, :2])
        return _Triangulation(tags, plane, self._check_coherence(plane, triangles))

    def _check_extent(self, points: NDArray[np.float64]) -> None:
        duration, length = self.sides
        if not np.isfinite(points).all():
            raise self.fault("a node coordinate is not finite; write the mesh again")
        if np.abs(points[:, 2]).max() > _TOLERANCE * length:
            raise self.fault("nodes leave the plane z = 0; draw (t, x) in the plane")
        low, high = points.min(axis=0), points.max(axis=0)
        wanted = (("t", "s", duration), ("x", "m", length))
        for axis, (name, unit, size) in enumerate(wanted):
            if max(abs(low[axis]), abs(high[axis] - size)) > _TOLERANCE * size:
                turned = (
                    " The mesh seems turned: the first coordinate is time."
                    if np.allclose(high[:2], [length, duration], rtol=_TOLERANCE, atol=0)
                    else ""
                )
                raise self.fault(
                    f"{name} runs from {low[axis]:g} to {high[axis]:g} {unit}, the scene needs 0 "
                    f"to {size:g} {unit}; make the mesh or the scene fit.{turned}"
                )

    def _check_coherence(
        self, points: NDArray[np.float64], triangles: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Check that the triangles fill the rectangle without a gap; returns their rim."""
        a, b, c = (points[triangles[:, i]] / self.sides for i in range(3))
        u, v = b - a, c - a
        areas = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
        if areas.min() <= _FLAT / len(areas):
            at = points[triangles[areas.argmin()]].mean(axis=0)
            raise self.fault(
                f"the triangle at t = {at[0]:g}, x = {at[1]:g} has no area; remove it or mesh again"
            )
        edges = np.sort(np.concatenate([triangles[:, p] for p in ([0, 1], [1, 2], [2, 0])]))
        edges, counts = np.unique(edges, axis=0, return_counts=True)
        rim: NDArray[np.int64] = edges[counts == 1]
        inner = np.ones(len(rim), dtype=bool)
        for axis in (0, 1):
            for value in (0.0, self.sides[axis]):
                inner &= ~self._on_side(points[rim], axis, value)
        if inner.any() or counts.max() > 2 or abs(areas.sum() - 1.0) > _TOLERANCE:
            where = points[rim[inner][0]].mean(axis=0) if inner.any() else points.mean(axis=0)
            raise self.fault(
                "the triangles do not fill the rectangle once, without holes, overlaps and "
                f"unjoined parts (look near t = {where[0]:g}, x = {where[1]:g}); let neighbouring "
                "surfaces share their curves"
            )
        return rim

    def _on_side(self, edges: NDArray[np.float64], axis: int, value: float) -> NDArray[np.bool_]:
        """Which edges (ends, shape (edges, 2, 2)) lie where t or x has the value."""
        near = np.abs(edges[:, :, axis] - value) <= _TOLERANCE * self.sides[axis]
        return np.asarray(near.all(axis=1))

    def boundaries(self, triangulation: _Triangulation) -> dict[str, int]:
        """Check names and places of the four boundaries; returns their physical tags."""
        model = self.gmsh.model
        tags = {model.getPhysicalName(1, tag): tag for _, tag in model.getPhysicalGroups(1)}
        missing = [name for name in BOUNDARIES if name not in tags]
        if missing:
            raise self.fault(
                f"physical curves {', '.join(missing)} are missing, found "
                f"{', '.join(map(show, sorted(tags))) or 'none'}; name the sides "
                "start (t = 0), end (t = T), wall (x = 0) and far (x = L)"
            )
        duration, length = self.sides
        # name: axis held fixed, its value
        places = {"start": (0, 0.0), "end": (0, duration), "wall": (1, 0.0), "far": (1, length)}
        counts = {}
        for name, (axis, value) in places.items():
            edges = self._edges(tags[name], triangulation)
            ends = triangulation.points[edges]
            if not len(edges) or not self._on_side(ends, axis, value).all():
                fixed = ends[:, :, axis]
                lie = f"between {fixed.min():g} and {fixed.max():g}" if len(edges) else "nowhere"
                raise self.fault(
                    f"boundary {name!r} must lie at {'tx'[axis]} = {value:g}, its edges lie {lie}; "
                    "wrong orientation? First coordinate t, second x from the near end"
                )
            rim = triangulation.rim
            side = rim[self._on_side(triangulation.points[rim], axis, value)]
            if sorted(edges.tolist()) != sorted(side.tolist()):
                raise self.fault(
                    f"boundary {name!r} has {len(edges)} edges, that side of the mesh "
                    f"{len(side)}; put every curve of that side, and each once, into the group"
                )
            counts[name] = len(side) + 1
        if counts["start"] != counts["end"]:
            raise self.fault(
                f"{counts['start']} nodes at start, {counts['end']} at end; the Petrov-Galerkin "
                "system is square only with equal numbers: divide both sides alike"
            )
        return {name: tags[name] for name in BOUNDARIES}

    def _edges(self, group: int, triangulation: _Triangulation) -> NDArray[np.int64]:
        """Edges of a physical curve, as increasing pairs of node indices."""
        found = [np.empty(0, dtype=np.int64)]
        for curve in self.gmsh.model.getEntitiesForPhysicalGroup(1, group):
            kinds, _, nodes = self.gmsh.model.mesh.getElements(1, curve)
            found += [n for kind, n in zip(kinds, nodes, strict=True) if kind == _LINE]
        pairs = np.searchsorted(triangulation.tags, np.concatenate(found).astype(np.int64))
        return np.sort(pairs.reshape(-1, 2))


def told(path: Path) -> str:
    """What a space-time mesh holds and what of it is used, in words.

    Raises:
        MeshError: The file cannot be read.
    """
    holdings = look(path)
    uses = {group: f"the side {group.name!r}" for group in holdings.of_dim(1)}
    uses = {group: use for group, use in uses.items() if group.name in BOUNDARIES}
    uses |= dict.fromkeys(holdings.of_dim(2), "the bar")
    return f"{path.name}: {holdings.told(uses)}"


def _check_one_material(path: Path, holdings: Holdings, length: float) -> None:
    """Refuse groups of triangles that divide the bar along its axis: it has one material."""
    groups = holdings.of_dim(2)
    for group in groups:
        low, high = group.low[1], group.high[1]
        if max(low, length - high) > _TOLERANCE * length and len(groups) > 1:
            raise MeshError(
                f"mesh file {path}: holds {', '.join(map(str, groups))}; {group.name!r} covers x = "
                f"{low:g} to {high:g} m of a bar of {length:g} m, which has one material: put all "
                'triangles into one group (Physical Surface("bar")), or make each material a bar '
                "of its own, without solve.mesh"
            )


def _keep_groups(gmsh: Any, tags: dict[str, int]) -> None:
    """Leave the four boundaries and one group of all triangles: further ones would overlap."""
    others = [group for group in gmsh.model.getPhysicalGroups() if group[0] != 1]
    others += [(1, tag) for _, tag in gmsh.model.getPhysicalGroups(1) if tag not in tags.values()]
    gmsh.model.removePhysicalGroups(others)
    gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], tag=1)
