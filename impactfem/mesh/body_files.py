"""Meshes of bodies from a user's file, with their faults reported."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.errors import MeshError
from impactfem.mesh.raw import (
    Cell,
    Numbering,
    RawMesh,
    Source,
    cell_facets,
    facet_keys,
    numbering,
    without_loose_nodes,
)
from impactfem.mesh.session import gmsh_session
from impactfem.mesh.sizes import ball_field, options
from impactfem.reading.holdings import Holdings
from impactfem.reading.opening import MESHIO, STEP, Job, opened
from impactfem.scene.values import show

_ENDINGS = (".geo", ".msh", ".step", ".stp", *MESHIO)
_MILLIMETRE = 1e-3  # in m: OpenCASCADE's tolerances are made for lengths in mm
# Gmsh's number of an element: kind and degree.
_KINDS: Mapping[int, tuple[Cell, int]] = {
    2: ("triangle", 1), 9: ("triangle", 2), 3: ("quadrilateral", 1), 10: ("quadrilateral", 2),
    4: ("tetrahedron", 1), 11: ("tetrahedron", 2), 5: ("hexahedron", 1), 12: ("hexahedron", 2),
}  # fmt: skip
_OFF_PLANE = 1e-9  # share of the extent by which a node may miss z = 0, or r = 0 where it is meant


def read_body(
    path: Path, model: str, degree: int, *, mesh_size: float | None = None,
    refine: Sequence[Any] = (), cells: str = "simplex", used: Collection[str] = (),
    materials: Collection[str] = (), part: str | None = None,
) -> RawMesh:  # fmt: skip
    """Read the mesh of a body, or mesh the geometry in a file, on this rank.

    The physical names of the boundary are its surfaces; boundary without a name is allowed. If the
    file has physical groups of elements, elements outside them are left out. Faces of a STEP file
    have their labels as names, or `face_1`, `face_2` and so on as Gmsh counts them; parts that
    touch share faces.

    Args:
        path: ``.msh``, ``.geo`` (runs no commands beyond geometry), ``.step``, or one of meshio.
        model: Model of the body; "3d" needs volumes, the others a plane mesh.
        degree: Degree of the geometry.
        mesh_size: Length of the edges [m] of geometry to be meshed; None leaves it to the script.
        refine: Balls with smaller elements.
        cells: "hexahedron" asks Gmsh to recombine geometry to be meshed.
        used: Surfaces that the body uses: they must lie on the boundary.
        materials: Names of the groups of elements, if each has its own material.
        part: Part of a STEP file, by the name of itself or of the assembly it is in; None for all.

    Raises:
        MeshError: The file cannot be read or holds no mesh that fits.
    """
    dim = 3 if model == "3d" else 2
    step = path.suffix.lower() in STEP
    unit = _MILLIMETRE if step else 1.0
    if refine and mesh_size is None:
        raise MeshError(f"mesh file {path}: refine needs mesh_size, the size outside; give it")
    job = Job(
        key="body.mesh",
        surfaces="elements of the body",
        endings=_ENDINGS,
        dim=dim,
        degree=degree,
        kinds=tuple(number for number, (_, order) in _KINDS.items() if order == degree),
        options=_options(dim, mesh_size, refine, unit, hexahedra=cells == "hexahedron"),
        balls=tuple(ball_field(ball, mesh_size or 0.0, unit) for ball in refine),
        unit=unit,
        part=part,
    )
    with opened(path, job) as found, gmsh_session(f"mesh file {path}") as gmsh:
        gmsh.merge(str(found.path))
        reader = _Reader(gmsh, path, model, dim, found.holdings, found.unit)
        reader.check_kept(degree)
        reader.check_materials(materials)
        raw = reader.mesh(used, materials)
    if cells == "hexahedron" and raw.cell in {"triangle", "tetrahedron"}:
        raise reader.fault(
            f"cells = {cells!r}, but Gmsh made a {raw.cell} mesh of it; make its curves, surfaces "
            'and volumes Transfinite and Recombine them, or use cells = "simplex"'
        )
    return replace(raw, points=unit * raw.points)


@contextmanager
def refined(comm: Any, path: Path, dim: int) -> Iterator[str]:
    """A mesh file with each element cut into four (3D: eight), as a temporary file (collective).

    Args:
        comm: MPI communicator; rank 0 makes it.
        path: ``.geo``, ``.msh`` or one of meshio.
        dim: Dimension of the elements.

    Yields:
        Its path, absolute; only rank 0 may read it.

    Raises:
        MeshError: The file cannot be read, or its curves would be lost; on every rank.
    """
    job = Job(key="body.mesh", endings=_ENDINGS, dim=dim, cut=True)
    with ExitStack() as files:

        def cut() -> str:
            found = files.enter_context(opened(path, job))
            if found.holdings.is_curved:
                raise MeshError(f"mesh file {path}: curved elements cannot be cut into smaller")
            return str(found.path)

        yield fem.on_root(comm, cut)


def _options(
    dim: int, size: float | None, refine: Sequence[Any], unit: float, *, hexahedra: bool
) -> dict[str, float]:
    """Gmsh's options for geometry."""
    found = {"General.NumThreads": 1.0}
    if size is not None:
        found |= options(dim, size / unit, [ball.size / unit for ball in refine])
    if hexahedra:
        found |= {"Mesh.RecombineAll": 1, "Mesh.Algorithm": 8}
        if dim == 2:
            found |= {"Mesh.RecombinationAlgorithm": 3}  # quadrilaterals only
    return found


@dataclass(frozen=True)
class _Reader:
    """Takes a body out of the model that Gmsh has read from ``path``, which holds ``holdings``."""

    gmsh: Any
    path: Path
    model: str
    dim: int
    holdings: Holdings
    unit: str = ""

    def fault(self, text: str) -> MeshError:
        """An error about the file."""
        return MeshError(f"mesh file {self.path}: {text}")

    def check_kept(self, degree: int) -> None:
        """Refuse what elements of a degree would lose, and several materials."""
        order, bent = self.holdings.order, self.holdings.bent
        if order > degree and self.holdings.is_curved:
            lower = "save the mesh with order 1 (gmsh -order 1), fine enough for its curves"
            remedy = f"use body.degree = 2 with an implicit method, or {lower}" * (order == 2)
            raise self.fault(
                f"its elements are curved, of order {order}: nodes lie up to {bent:.2g} of an "
                f"element's size off straight edges, which elements of degree {degree} would lose; "
                + (remedy or f"save it with order 2, or {lower}")
            )

    def check_materials(self, named: Collection[str]) -> None:
        """Refuse groups of elements without material, and materials without group."""
        parts = self.holdings.of_dim(self.dim)
        what = "Volume" if self.dim == 3 else "Surface"
        found = (
            f"{len(parts)} groups of elements, {', '.join(map(str, parts))}"
            if parts
            else ("no group of elements")
        )
        if not named:
            if len(parts) > 1:
                entries = ", ".join(f"{part.name} = {{ ... }}" for part in parts)
                one = f"take one by body.part = {show(parts[0].name)}, " * bool(self.unit)
                raise self.fault(
                    f"holds {found}, and the body says one material for all: {one}give each one by "
                    f"body.materials = {{ {entries} }}, put all elements of the body into one "
                    f'physical group (Physical {what}("body") = {{...}}), or make each group a '
                    "body with a file of its own"
                )
            return
        names = {part.name for part in parts}
        without = sorted(names - {*named})
        unknown = sorted({*named} - names)
        if without or unknown:
            wrong = [f"{', '.join(map(repr, without))} has no material"] * bool(without)
            wrong += [f"{', '.join(map(repr, unknown))} is none of them"] * bool(unknown)
            raise self.fault(
                f"holds {found}: in body.materials {' and '.join(wrong)}; name each group of "
                f'elements and no other (in Gmsh: Physical {what}("core") = {{...}})'
            )
        owners: dict[int, str] = {}
        for part in parts:
            for entity in part.entities:
                other = owners.setdefault(abs(entity), part.name)
                if other != part.name:
                    raise self.fault(
                        f"groups {other!r} and {part.name!r} share elements, which have one "
                        "material; let each element be in one group"
                    )

    def mesh(self, used: Collection[str], materials: Collection[str] = ()) -> RawMesh:
        """Check what the file holds and take it."""
        tags, coordinates, _ = self.gmsh.model.mesh.getNodes()
        number = numbering(tags)
        points = np.reshape(coordinates, (-1, 3))
        entities = self._body_entities()
        kind, cells, owners = self._cells(entities, number)
        self._check_loose(entities, number, cells, len(tags))
        points = self._in_plane(points, cells)
        points, cells, groups = without_loose_nodes(points, cells, self._groups(number))
        parts = [part for part in self.holdings.of_dim(self.dim) if materials]
        inside = {
            part.name: np.flatnonzero(np.isin(owners, np.abs(part.entities))) for part in parts
        }
        raw = RawMesh(points, cells, *_KINDS[kind], groups=inside)
        surfaces = self._on_boundary(raw, groups, used)
        return replace(raw, surfaces=surfaces, source=self._source(raw, surfaces))

    def _source(self, raw: RawMesh, surfaces: Mapping[str, Integers]) -> Source:
        """What the file holds and what of it is used."""
        holdings, dim = self.holdings, self.dim
        sides = [g for g in holdings.of_dim(dim - 1) if g.name in surfaces]
        inside = holdings.of_dim(dim)
        uses = dict.fromkeys(sides, "a surface") | dict.fromkeys(
            inside, "a material of the body" if raw.groups else "the body"
        )
        unused = []
        away = sum(holdings.elements.values()) - len(raw.cells)
        if away:
            unused.append(
                f"{away} of {away + len(raw.cells)} elements are in no physical group and left out"
            )
        unused += [
            f"the {group} does not lie on the boundary of the body and is no surface of it"
            for group in holdings.of_dim(dim - 1)
            if group not in uses
        ]
        if holdings.order > raw.degree:
            unused.append(
                f"its geometry is of order {holdings.order}, but straight: read as {raw.degree}"
            )
        left = "".join(f"; {text}" for text in unused)
        unit = f"; its unit of length: {self.unit}" * bool(self.unit)
        text = f"{self.path.name}: {holdings.told(uses)}{left}{unit}"
        return Source(text, tuple(unused), holdings.is_curved)

    def _body_entities(self) -> list[int]:
        """Gmsh's tags of the parts of the body: all, or those in physical groups."""
        model, dim = self.gmsh.model, self.dim
        if dim == 2 and model.getEntities(3):
            raise self.fault(
                f'has volumes, which model = "{self.model}" cannot use; give model = "3d", or a '
                "plane mesh without volumes"
            )
        if not model.getEntities(dim):
            what, other = (
                ("volumes", "a plane model") if dim == 3 else ("surfaces", "a mesh with surfaces")
            )
            raise self.fault(f'model = "{self.model}" needs {what}, it has none; give {other}')
        groups = model.getPhysicalGroups(dim)
        if not groups:
            return [int(tag) for _, tag in model.getEntities(dim)]
        found = (model.getEntitiesForPhysicalGroup(dim, tag) for _, tag in groups)
        return sorted({int(tag) for tags in found for tag in tags})

    def _cells(self, entities: Sequence[int], number: Numbering) -> tuple[int, Integers, Integers]:
        """Kind of the elements, their nodes in DOLFINx's order, and the entity of each."""
        found: dict[int, list[Integers]] = {}
        counts: list[int] = []
        for entity in entities:
            kinds, tags, lists = self.gmsh.model.mesh.getElements(self.dim, entity)
            counts.append(sum(map(len, tags)))
            for kind, nodes in zip(kinds, lists, strict=True):
                found.setdefault(int(kind), []).append(number(nodes))
        names = [self.gmsh.model.mesh.getElementProperties(kind)[0] for kind in found]
        if not found:
            what = "volumes" if self.dim == 3 else "surfaces"
            raise self.fault(f"no elements in its {what}; mesh it before it is saved")
        if len(found) > 1:
            raise self.fault(
                f"mixes elements: {', '.join(names)}; use one kind only (in Gmsh: recombine all "
                "surfaces or none; volumes of hexahedra must be Transfinite)"
            )
        (kind,) = found
        if kind not in _KINDS:
            raise self.fault(
                f"has elements {names[0]!r}; use triangles, quadrilaterals, tetrahedra or "
                "hexahedra of first or full second order"
            )
        cell, degree = _KINDS[kind]
        nodes = len(fem.reference_nodes(cell, degree))
        cells: Integers = np.concatenate(found[kind]).reshape(-1, nodes)
        return kind, cells[:, fem.from_gmsh_order(cell, nodes)], np.repeat(entities, counts)

    def _check_loose(
        self, entities: Sequence[int], number: Numbering, cells: Integers, count: int
    ) -> None:
        """Refuse nodes of the body that no element has; centres of arcs and the like are none."""
        used = np.zeros(count, dtype=bool)
        used[cells] = True
        for entity in entities:
            tags, coordinates, _ = self.gmsh.model.mesh.getNodes(self.dim, entity)
            loose = ~used[number(tags)]
            if loose.any():
                x, y, z = np.reshape(coordinates, (-1, 3))[loose][0]
                raise self.fault(
                    f"{loose.sum()} nodes belong to no element, one at ({x:.4g}, {y:.4g}, {z:.4g})"
                    "; remove them, or mesh again"
                )

    def _in_plane(self, points: Floats, cells: Integers) -> Floats:
        """Coordinates of the body: (x, y, z), (x, y) or (r, y)."""
        used = points[np.unique(cells)]
        extent = np.ptp(used, axis=0).max()
        if self.dim == 3:
            return points
        if np.abs(used[:, 2]).max() > _OFF_PLANE * extent:
            low, high = used[:, 2].min(), used[:, 2].max()
            raise self.fault(
                f'z runs from {low:g} to {high:g}; model = "{self.model}" needs a mesh in the plane'
                " z = 0: draw it there"
            )
        plane = np.ascontiguousarray(points[:, :2])
        if self.model == "axisymmetric":
            plane[np.abs(plane[:, 0]) <= _OFF_PLANE * extent, 0] = 0.0
        return plane

    def _groups(self, number: Numbering) -> dict[str, Integers]:
        """Vertices of the facets of each physical group of the boundary."""
        mesh, side = self.gmsh.model.mesh, self.dim - 1
        groups: dict[str, Integers] = {}
        for _, group in self.gmsh.model.getPhysicalGroups(side):
            name = self.gmsh.model.getPhysicalName(side, group) or str(group)
            rows = [groups[name]] if name in groups else []
            for entity in self.gmsh.model.getEntitiesForPhysicalGroup(side, group):
                kinds, _, lists = mesh.getElements(side, entity)
                for kind, nodes in zip(kinds, lists, strict=True):
                    _, _, _, count, _, corners = mesh.getElementProperties(kind)
                    elements = number(nodes).reshape(-1, count)[:, :corners]
                    if rows and rows[0].shape[1] != corners:
                        raise self.fault(
                            f"surface {name!r} mixes elements of 3 and 4 corners; use one kind"
                        )
                    rows.append(elements)
            if rows:
                groups[name] = np.concatenate(rows)
        return groups

    def _on_boundary(
        self, raw: RawMesh, groups: Mapping[str, Integers], used: Collection[str]
    ) -> dict[str, Integers]:
        """Surfaces that lie on the boundary; others must not be used."""
        each = cell_facets(raw)
        facets: Integers = each.reshape(-1, each.shape[2])
        fitting = {name: rows for name, rows in groups.items() if rows.shape[1] == each.shape[2]}
        keys, *wanted = facet_keys(facets, *fitting.values())
        present, first, counts = np.unique(keys, return_index=True, return_counts=True)
        outer = present[counts == 1]
        surfaces: dict[str, Integers] = {}
        for (name, rows), own in zip(fitting.items(), wanted, strict=True):
            outside = np.isin(own, outer) & (rows >= 0).all(axis=1)
            if outside.all():
                surfaces[name] = rows
            elif name in used:
                raise self.fault(
                    f"surface {name!r}: {(~outside).sum()} of its {len(rows)} facets are not on "
                    "the boundary of the body; put only curves (3D: faces) of the boundary into it"
                )
        if self.model == "axisymmetric":
            rim = facets[first[counts == 1]]
            at_axis = rim[(raw.points[rim, 0] == 0.0).all(axis=1)]
            if "axis" in surfaces and not (raw.points[surfaces["axis"], 0] == 0.0).all():
                raise self.fault(
                    "surface 'axis' leaves r = 0; this name is kept for the boundary at r = 0: "
                    "give the surface another"
                )
            if len(at_axis):
                surfaces["axis"] = at_axis
        return surfaces
