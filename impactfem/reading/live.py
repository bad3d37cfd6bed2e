"""Meshes of DOLFINx that a program holds, written down as files that bodies can name."""

import atexit
import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.arrays import Integers
from impactfem.errors import MeshError, OutputError

# A kind of cell and its number of nodes: Gmsh's number of it, and where DOLFINx's nodes stand in
# Gmsh's order. Scenes know no DOLFINx, so that this is said here once more (a test compares).
_CELLS: Mapping[tuple[str, int], tuple[int, tuple[int, ...]]] = {
    ("triangle", 3): (2, (0, 1, 2)),
    ("triangle", 6): (9, (0, 1, 2, 4, 5, 3)),
    ("quadrilateral", 4): (3, (0, 1, 3, 2)),
    ("quadrilateral", 9): (10, (0, 1, 3, 2, 4, 7, 5, 6, 8)),
    ("tetrahedron", 4): (4, (0, 1, 2, 3)),
    ("tetrahedron", 10): (11, (0, 1, 2, 3, 8, 9, 5, 7, 6, 4)),
    ("hexahedron", 8): (5, (0, 1, 3, 2, 4, 5, 7, 6)),
    ("hexahedron", 27): (
        12,
        (0, 1, 3, 2, 4, 5, 7, 6, 8, 9, 10, 11, 12, 13, 15, 14, *range(16, 27)),
    ),
}
_FACETS = {2: (1, (0, 1)), 3: (2, (0, 1, 2)), 4: (3, (0, 1, 3, 2))}  # by their corners
_PREFIX = "impactfem-live-"
_KNOWN = "triangles, quadrilaterals, tetrahedra or hexahedra of degree 1 or 2"

type Tags = Any
"""Names and local entities, or a `dolfinx.mesh.MeshTags`, alone or with names and its values."""


class LiveMesh(os.PathLike[str]):
    """A `dolfinx.mesh.Mesh` with names, for the key `mesh` of bodies and obstacles.

    It is written down as a temporary ``.msh`` when it is made; results and checkpoints keep a copy
    beside their scene. Collective on the communicator of the mesh, distributed or not; the file is
    the same on any number of ranks, but for numbers that DOLFINx gives anew.

    Args:
        mesh: A mesh of triangles, quadrilaterals, tetrahedra or hexahedra, of degree 1 or 2 [m],
            or the ``MeshData`` that `dolfinx.io.gmsh` reads, which has tags and names of its own.
        cell_tags: Names of groups of cells, for `materials`: ``{name: local cells}``, a
            ``MeshTags`` (names are its numbers), or a pair ``(MeshTags, {name: number})``.
        facet_tags: Names of surfaces, alike.

    Raises:
        MeshError: The mesh holds other cells, or tags do not fit it.
        OSError: There is no room for the file.
    """

    def __init__(self, mesh: Any, cell_tags: Tags = None, facet_tags: Tags = None) -> None:
        if hasattr(mesh, "physical_groups"):
            dim, data = mesh.mesh.topology.dim, mesh
            mesh = data.mesh
            cell_tags = cell_tags or _of_data(data, data.cell_tags, dim)
            facet_tags = facet_tags or _of_data(data, data.facet_tags, dim - 1)
        self.path: Path = _written(mesh, cell_tags, facet_tags)

    def __fspath__(self) -> str:
        return str(self.path)


def is_live(value: object) -> bool:
    """Whether a value is a mesh of DOLFINx, or the data that it reads."""
    return hasattr(value, "physical_groups") or all(
        hasattr(value, name) for name in ("topology", "geometry", "comm")
    )


def is_copy(name: str) -> bool:
    """Whether a file has such a name as meshes that were written down have."""
    return re.fullmatch(r"mesh-[0-9a-f]{12}\.msh", name) is not None


def is_kept(path: str) -> bool:
    """Whether a path is that of a mesh that a program of ours holds and has written down."""
    return is_copy(Path(path).name) and Path(path).parent.name.startswith(_PREFIX)


def keep(path: str, folder: Path) -> None:
    """Copy a mesh that a program has written down into a folder.

    Raises:
        OutputError: There is no room, or the program has ended.
    """
    name = Path(path).name
    try:
        if not (folder / name).exists():
            shutil.copyfile(path, folder / name)
    except OSError as error:
        raise OutputError(f"{folder / name}: cannot be written ({error.strerror})") from error


@cache
def _folder() -> Path:
    """Where meshes lie as long as this process lives."""
    folder = tempfile.mkdtemp(prefix=_PREFIX)
    owner = os.getpid()

    def remove() -> None:
        if os.getpid() == owner:  # not a fork of it
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return Path(folder)


def _of_data(data: Any, tags: Any, dim: int) -> Tags:
    """Tags of a dimension with the names of Gmsh's physical groups."""
    if tags is None:
        return None
    names = {name: group[1] for name, group in data.physical_groups.items() if group[0] == dim}
    rest = sorted({*map(int, np.unique(tags.values))} - {*names.values()})
    return tags, names | {str(number): number for number in rest}


def _written(mesh: Any, cell_tags: Tags, facet_tags: Tags) -> Path:
    """Gather a mesh on the first of its ranks, which writes it; its path on each."""
    comm, dim = mesh.comm, mesh.topology.dim
    inside = _settled(comm, cell_tags, dim, "cell_tags")
    sides = _settled(comm, facet_tags, dim - 1, "facet_tags")
    parts = comm.gather(_part(mesh, inside, sides), root=0)
    answer: Path | Exception | None = None
    if comm.rank == 0:
        try:
            content = _content(parts, dim)
            name = f"mesh-{hashlib.sha256(content).hexdigest()[:12]}.msh"
            answer = _folder() / name
            answer.write_bytes(content)
        except (MeshError, OSError) as error:
            answer = error
    answer = comm.bcast(answer, root=0)
    if isinstance(answer, Exception):
        raise answer
    assert answer is not None  # noqa: S101  (broadcast)
    return answer


def _part(
    mesh: Any, cell_tags: Mapping[str, Any], facet_tags: Mapping[str, Any]
) -> dict[str, Any] | MeshError:
    """What this rank owns: nodes, cells and groups, by numbers of the whole mesh; or what fails."""
    try:
        return _owned(mesh, cell_tags, facet_tags)
    except MeshError as error:
        return error


def _owned(
    mesh: Any, cell_tags: Mapping[str, Any], facet_tags: Mapping[str, Any]
) -> dict[str, Any]:
    topology, geometry = mesh.topology, mesh.geometry
    dim, several = topology.dim, getattr(topology, "entity_types", [[None]])[-1]
    if len(several) > 1:
        raise MeshError(
            f"it mixes {' and '.join(kind.name for kind in several)} cells; give one of {_KNOWN}"
        )
    dofs = np.asarray(geometry.dofmaps[0] if hasattr(geometry, "dofmaps") else geometry.dofmap)
    word, count = topology.cell_type.name, dofs.shape[1]
    if (word, count) not in _CELLS:
        raise MeshError(f"it has {word} cells of {count} nodes; give {_KNOWN}")
    nodes, cells = geometry.index_map(), topology.index_map(dim).size_local
    everyone = np.arange(nodes.size_local + nodes.num_ghosts, dtype=np.int32)
    numbers = nodes.local_to_global(everyone)
    topology.create_connectivity(dim, 0)
    corners = topology.connectivity(dim, 0).array.reshape(len(dofs), -1)
    place = np.zeros(corners.max(initial=-1) + 1, dtype=np.int64)
    place[corners] = numbers[dofs[:, : corners.shape[1]]]
    found: dict[str, Any] = {
        "kind": (word, count),
        "points": np.asarray(geometry.x, dtype=np.float64)[: nodes.size_local],
        "given": np.asarray(geometry.input_global_indices)[: nodes.size_local],
        "cells": numbers[dofs[:cells]],
        "order": np.asarray(topology.original_cell_index)[:cells],
    }
    inside = dict(_named(mesh, cell_tags, dim, "cell_tags"))
    found["groups"] = {name: np.isin(np.arange(cells), own) for name, own in inside.items()}
    if facet_tags:
        topology.create_entities(dim - 1)
        topology.create_connectivity(dim - 1, 0)
        ends = topology.connectivity(dim - 1, 0)
        found["sides"] = {
            name: np.array([place[ends.links(facet)] for facet in own], dtype=np.int64)
            for name, own in _named(mesh, facet_tags, dim - 1, "facet_tags")
        }
    return found


def _settled(comm: Any, tags: Tags, dim: int, key: str) -> Mapping[str, Any]:
    """Names and local entities, whatever form they are given in (collective)."""
    names: Mapping[str, Any] | None = None
    if isinstance(tags, tuple) and len(tags) == 2 and isinstance(tags[1], Mapping):
        tags, names = tags
    if hasattr(tags, "values") and hasattr(tags, "find"):  # of DOLFINx
        if tags.dim != dim:
            raise MeshError(f"its {key} are of dimension {tags.dim}; give those of {dim}")
        if names is None:
            every = comm.allgather(np.unique(tags.values).tolist())
            names = {str(number): number for number in sorted({n for own in every for n in own})}
        tags = {name: tags.find(number) for name, number in names.items()}
    if not isinstance(tags, Mapping | None):
        raise MeshError(
            f"its {key} are no tags; give {{name: entities}}, MeshTags, or (MeshTags, "
            "{name: number})"
        )
    found = {str(name): own for name, own in (tags or {}).items()}
    for name in found:
        if not name.isprintable() or '"' in name:
            raise MeshError(f"its {key} have the name {name!a}; give one without quotes")
    return found


def _named(
    mesh: Any, tags: Mapping[str, Any], dim: int, key: str
) -> Iterator[tuple[str, Integers]]:
    """Names, and the entities of this rank that each has and this rank owns."""
    mesh.topology.create_entities(dim)
    known = mesh.topology.index_map(dim)
    for name, own in tags.items():
        entities = np.asarray(own, dtype=np.int64).ravel()
        if entities.size and not 0 <= entities.min() <= entities.max() < (
            known.size_local + known.num_ghosts
        ):
            raise MeshError(f"its {key} have in {name!r} entities that the mesh does not have")
        yield name, np.unique(entities[entities < known.size_local])


def _content(parts: list[dict[str, Any] | MeshError], dim: int) -> bytes:
    """The mesh as a file of format MSH 2.2, in which each group has an entity of its own."""
    for part in parts:
        if isinstance(part, MeshError):
            raise part
    every: list[dict[str, Any]] = [part for part in parts if isinstance(part, dict)]

    def whole(name: str) -> Any:
        return np.concatenate([part[name] for part in every])

    # As they were read or made, which is the same on any number of ranks, if that tells them apart.
    given, order = whole("given"), whole("order")
    rank = np.unique(given, return_inverse=True)[1]
    sort = np.argsort(rank) if len(np.unique(given)) == len(given) else np.arange(len(given))
    number = np.empty(len(sort), dtype=np.int64)
    number[sort] = np.arange(1, len(sort) + 1)
    points, at = whole("points")[sort], np.argsort(order, kind="stable")
    kind, nodes = _CELLS[every[0]["kind"]]
    cells = np.empty((len(at), len(nodes)), dtype=np.int64)
    cells[:, list(nodes)] = number[whole("cells")[at]]
    groups = {
        name: np.concatenate([part["groups"][name] for part in every])[at]
        for name in every[0]["groups"]
    }
    entity = _entities(groups, len(cells))
    blocks = [(kind, dim, np.maximum(entity, 1), entity, cells)]
    names = [(dim, tag, name) for tag, name in enumerate(groups, 1)]
    for name in every[0].get("sides", {}):
        own = [part["sides"][name] for part in every if len(part["sides"][name])]
        if not own:
            raise MeshError(f"its facet_tags have {name!r}, and no facet is in it; remove it")
        rows = number[np.concatenate(own)]
        side, corners = _FACETS[rows.shape[1]]
        rows = rows[np.lexsort(np.sort(rows, axis=1).T)][:, list(corners)]
        tags = np.full(len(rows), len(names) + 1)
        blocks.append((side, dim - 1, tags, tags, rows))
        names.append((dim - 1, len(names) + 1, name))
    return _msh(points, blocks, names)


def _entities(groups: Mapping[str, Any], count: int) -> Integers:
    """Number of the group of each cell; 0 if there are no groups."""
    entity = np.zeros(count, dtype=np.int64)
    for tag, (name, own) in enumerate(groups.items(), 1):
        if not own.any():
            raise MeshError(f"its cell_tags have {name!r}, and no cell is in it; remove it")
        if entity[own].any():
            other = list(groups)[entity[own].max() - 1]
            raise MeshError(
                f"its cell_tags {other!r} and {name!r} share cells, which have one material; let "
                "each cell be in one"
            )
        entity[own] = tag
    if groups and not entity.all():
        raise MeshError(
            f"{(entity == 0).sum()} of its {count} cells are in none of its cell_tags, "
            f"{', '.join(map(repr, groups))}; let each cell be in one"
        )
    return entity


def _msh(points: Any, blocks: list[Any], names: list[tuple[int, int, str]]) -> bytes:
    """Nodes, elements and names as text; 17 digits are the number itself."""
    places = np.zeros((len(points), 3))
    places[:, : points.shape[1]] = points
    file = BytesIO()
    said = "".join(f'{dim} {tag} "{name}"\n' for dim, tag, name in names)
    head = f"$PhysicalNames\n{len(names)}\n{said}$EndPhysicalNames\n" * bool(names)
    file.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{head}$Nodes\n{len(places)}\n".encode())
    lines = [f"{k} {x:.17g} {y:.17g} {z:.17g}" for k, (x, y, z) in enumerate(places.tolist(), 1)]
    count = sum(len(rows) for *_, rows in blocks)
    file.write("\n".join([*lines, f"$EndNodes\n$Elements\n{count}\n"]).encode())
    first = 1
    for kind, _, entity, physical, rows in blocks:
        numbers = np.arange(first, first + len(rows))
        same = np.full((len(rows), 2), (kind, 2))
        np.savetxt(file, np.column_stack([numbers, same, physical, entity, rows]), fmt="%d")
        first += len(rows)
    file.write(b"$EndElements\n")
    return file.getvalue()
