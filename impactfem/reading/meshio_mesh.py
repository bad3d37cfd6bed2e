"""A mesh by meshio, given to Gmsh. Runs in the process of `gmsh_program`, as its beginning."""

import contextlib
import io
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

# meshio's word for an element: its dimension, Gmsh's number, and the order of nodes Gmsh has.
_ELEMENTS = {
    "vertex": (0, 15), "line": (1, 1), "line3": (1, 8), "triangle": (2, 2), "triangle6": (2, 9),
    "quad": (2, 3), "quad8": (2, 16), "quad9": (2, 10), "tetra": (3, 4), "tetra10": (3, 11),
    "hexahedron": (3, 5), "hexahedron20": (3, 17), "hexahedron27": (3, 12), "wedge": (3, 6),
    "wedge15": (3, 18), "pyramid": (3, 7), "pyramid13": (3, 19),
}  # fmt: skip
_TWENTY = [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14]
_ORDERS = {
    "tetra10": [0, 1, 2, 3, 4, 5, 6, 7, 9, 8],
    "hexahedron20": _TWENTY,
    "hexahedron27": [*_TWENTY, 24, 22, 20, 21, 23, 25, 26],
}
_FACETS = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)),
    "hexahedron": (
        (0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7),
    ),
}  # fmt: skip
_SIMPLE = {2: "line", 3: "triangle", 4: "quad"}  # facets by the number of their corners
# Numbers that formats keep for groups; another array of integers counts if it is the only one.
_TAGS = (
    "gmsh:physical", "cell_tags", "medit:ref", "su2:tag", "avsucd:material", "ugrid:ref",
    "netgen:index", "nastran:ref", "tetgen:ref", "CellEntityIds",
)  # fmt: skip
_MOST_TAGS = 100  # of an array that may be something else


class _Parts:
    """Elements by the groups they are in: each set of groups is a part of the geometry."""

    def __init__(self) -> None:
        self.elements: dict[tuple[int, tuple[str, ...]], list[tuple[int, Any]]] = {}

    def add(self, word: str, nodes: Any, names: tuple[str, ...]) -> None:
        """Add elements of one kind that are in the same groups."""
        dim, kind = _ELEMENTS[word]
        ordered = nodes[:, _ORDERS.get(word, slice(None))]
        self.elements.setdefault((dim, names), []).append((kind, ordered))

    def give(self, gmsh: Any, points: Any) -> None:
        """Make a discrete model of Gmsh of them."""
        new = np.ones(len(points), dtype=bool)
        groups: dict[tuple[int, str], list[int]] = {}
        for tag, (dim, names) in enumerate(sorted(self.elements, reverse=True), 1):
            blocks = self.elements[dim, names]
            gmsh.model.addDiscreteEntity(dim, tag)
            mine = np.unique(np.concatenate([nodes.ravel() for _, nodes in blocks]))
            mine = mine[new[mine]]
            new[mine] = False
            gmsh.model.mesh.addNodes(dim, tag, mine + 1, points[mine].ravel())
            for kind, nodes in blocks:
                gmsh.model.mesh.addElementsByType(tag, kind, [], nodes.ravel() + 1)
            for name in names:
                groups.setdefault((dim, name), []).append(tag)
        for (dim, name), tags in groups.items():
            gmsh.model.addPhysicalGroup(dim, tags, name=name)


def load(source: str, words: str, gmsh: Any) -> None:
    """Read a file by meshio and make it Gmsh's model.

    Sets of elements, or their numbers, are groups; those of no set are the group "rest", if others
    have one. Sets of nodes are groups of the facets of the boundary all of whose corners they hold.

    Args:
        source: The file.
        words: meshio's name of its format.
        gmsh: The module, initialised.
    """
    mesh = _read(source, words)
    points, blocks = _arrays(mesh)
    top = max((_ELEMENTS[word][0] for word, nodes in blocks if len(nodes)), default=0)
    groups = _sets(mesh, blocks)
    _add_tagged(groups, mesh, blocks, _tags(mesh, words), top)
    _settle([k for k, (word, _) in enumerate(blocks) if _ELEMENTS[word][0] == top], groups)
    parts = _Parts()
    for k, (word, nodes) in enumerate(blocks):
        # Elements of the same groups have the same number.
        code = np.zeros(len(nodes), dtype=np.int64)
        for members in groups.values():
            code = np.unique(2 * code + members[k], return_inverse=True)[1]
        for number in np.unique(code):
            some = code == number
            first = int(np.argmax(some))
            parts.add(word, nodes[some], tuple(n for n, own in groups.items() if own[k][first]))
    for name, facets in _of_nodes(mesh.point_sets, blocks, top, len(points)):
        parts.add(_SIMPLE[facets.shape[1]], facets, (name,))
    parts.give(gmsh, points)


def _read(source: str, words: str) -> Any:
    """What meshio makes of a file."""
    said = io.StringIO()
    try:
        import meshio  # noqa: PLC0415

        _check_links(source, words)
        if words == "abaqus":
            _check_abaqus(source)
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            return meshio.read(source, words)
    except ImportError as error:
        print(f"{error}: this mesh needs pip install 'impactfem[meshes]'", file=sys.stderr)
        sys.exit(3)
    except SystemExit as error:
        if isinstance(error.code, str):
            raise
        sys.exit(_unread(words, said.getvalue()))  # meshio has printed what is wrong
    except Exception as error:  # noqa: BLE001  (meshio's readers raise whatever comes of a file)
        sys.exit(_unread(words, f"{type(error).__name__}: {error}"))


def _arrays(mesh: Any) -> tuple[Any, list[tuple[str, Any]]]:
    """Places of the nodes, (nodes, 3), and the elements of each block by kind and nodes."""
    given = np.ma.filled(np.ma.asarray(mesh.points, dtype=float), np.nan)
    if given.ndim != 2 or given.shape[1] not in {2, 3}:
        sys.exit(f"its nodes have the shape {given.shape}, not two or three coordinates each")
    points = np.zeros((len(given), 3))
    points[:, : given.shape[1]] = given
    if not np.isfinite(points).all():
        sys.exit("a node has a coordinate that is no finite number")
    if unknown := sorted({str(block.type) for block in mesh.cells} - {*_ELEMENTS}):
        sys.exit(
            f"it has elements {', '.join(unknown)}, which are not known here; use triangles, "
            "quadrilaterals, tetrahedra or hexahedra"
        )
    blocks = [(block.type, np.ma.filled(block.data).astype(np.int64)) for block in mesh.cells]
    for word, nodes in blocks:
        if nodes.size and not 0 <= nodes.min() <= nodes.max() < len(points):
            sys.exit(f"a {word} names a node that the file does not have")
    return points, blocks


def _unread(words: str, why: str) -> str:
    return f"it cannot be read as {words} ({' '.join(why.split())[:300]})"


def _check_links(source: str, words: str) -> None:
    """End where a file points to others than those beside it."""
    import h5py  # noqa: PLC0415

    away = []
    if words == "xdmf":
        for item in ET.parse(source).iter("DataItem"):  # noqa: S314  (in this process)
            name = (item.text or "").split(":")[0].strip()
            if item.get("Format", "XML") != "XML" and name != Path(name).name:
                away.append(name)

    def link(name: str, found: Any) -> None:
        if isinstance(found, h5py.ExternalLink):
            away.append(name)

    def entry(name: str, found: Any) -> None:
        if isinstance(found, h5py.Dataset) and (found.external or found.is_virtual):
            away.append(name)

    for file in filter(h5py.is_hdf5, Path(source).parent.iterdir()):
        with h5py.File(file, "r") as found:
            found.visititems_links(link)
            found.visititems(entry)
    if away:
        sys.exit(f"its {away[0]!r} is in another file; put all into this one")


def _check_abaqus(source: str) -> None:
    """End where meshio would mix up sets of elements.

    It counts those that *ELEMENT names from the first block on, and takes what *ELSET lists by name
    for one set a block.
    """
    text = Path(source).read_text(encoding="utf-8", errors="replace")
    set_of = re.compile(r",\s*elset\s*=\s*([^,\s]+)", re.IGNORECASE)
    blocks = re.findall(r"^\*element[ \t]*(,.*|)$", text, re.IGNORECASE | re.MULTILINE)
    named = [found[1] for line in blocks if (found := set_of.search(line))]
    lists = re.findall(r"^\*elset[ \t]*(,.*)\n([^*]*)", text, re.IGNORECASE | re.MULTILINE)
    listed = [found[1] for line, _ in lists if (found := set_of.search(line))]
    if named and (len(named) < len(blocks) or len({*named, *listed}) < len(named) + len(listed)):
        sys.exit("some *ELEMENT have an ELSET of their own and others none or a shared one; give "
                 "each its own, or remove them and list elements by *ELSET")  # fmt: skip
    for line, entries in lists:
        if re.search(r"[^\d\s,]", entries):
            sys.exit(f"*ELSET{line.rstrip()} lists sets by name; list the numbers of its elements")


def _sets(mesh: Any, blocks: Any) -> dict[str, list[Any]]:
    """By the names of sets of elements, which elements of each block are in them."""
    found = {}
    for name, sets in mesh.cell_sets.items():
        if str(name).startswith("gmsh:"):
            continue
        found[str(name)] = _none(blocks)
        for k, own in enumerate(sets):
            index = np.zeros(0, dtype=int) if own is None or not len(own) else np.asarray(own)
            known = len(blocks[k][1]) if k < len(blocks) else 0
            if index.dtype.kind not in "iu" or index.max(initial=-1) >= known:
                sys.exit(f"its set {name!r} names elements that the file does not have")
            found[str(name)][k][index] = True
    return found


def _none(blocks: Any) -> list[Any]:
    return [np.zeros(len(nodes), dtype=bool) for _, nodes in blocks]


def _add_tagged(
    groups: dict[str, list[Any]], mesh: Any, blocks: Any, tags: list[Any], top: int
) -> None:
    """Add the groups that numbers of elements stand for."""
    for k, own in enumerate(tags):
        for tag in np.unique(own):
            for name in _names(mesh, int(tag), _ELEMENTS[blocks[k][0]][0], top):
                groups.setdefault(name, _none(blocks))[k] |= own == tag


def _settle(body: list[int], groups: dict[str, list[Any]]) -> None:
    """Let each element of the body be in a group if any is."""
    some = {name: own for name, own in groups.items() if any(own[k].any() for k in body)}
    every = [name for name, own in some.items() if all(own[k].all() for k in body)]
    parts = [own for name, own in some.items() if name not in every]
    rest = [~np.any([own[k] for own in parts], axis=0) for k in body] if parts else []
    if parts and not any(left.any() for left in rest):
        for name in every:  # what holds all elements tells no part from another
            for k in body:
                groups[name][k][:] = False
    elif parts and not every:
        own = groups.setdefault("rest", [np.zeros_like(each) for each in parts[0]])
        for k, left in zip(body, rest, strict=True):
            own[k] |= left


def _tags(mesh: Any, words: str) -> list[Any]:
    """Number of the group of each element of each block; empty if there are none."""
    if words == "exodus":  # its blocks are its groups
        return [np.full(len(block.data), k) for k, block in enumerate(mesh.cells, 1)]
    found = {name: [np.asarray(own) for own in data] for name, data in mesh.cell_data.items()}
    whole = {
        name: data
        for name, data in found.items()
        if name != "gmsh:geometrical"
        and all(own.dtype.kind in "iu" and own.ndim == 1 for own in data)
    }
    for name in _TAGS:
        if name in whole:
            return whole[name]
    if len(whole) == 1:
        (data,) = whole.values()
        if data and len(np.unique(np.concatenate(data))) <= _MOST_TAGS:
            return data
    return []


def _names(mesh: Any, tag: int, dim: int, top: int) -> list[str]:
    """Names of the groups that a number of elements of a dimension stands for."""
    families = getattr(mesh, "cell_tags", None)
    if families is not None:  # MED
        return [str(name) for name in families.get(tag, ())]
    for name, entry in mesh.field_data.items():
        known = np.ravel(entry)
        if known.dtype.kind in "iu" and len(known) == 2 and tuple(known) == (tag, dim):
            return [str(name)]
    return [str(tag)] if tag or dim == top else []


def _of_nodes(sets: Any, blocks: Any, top: int, count: int) -> Iterator[tuple[str, Any]]:
    """Facets of the boundary whose corners lie in sets of nodes, by the names of the sets."""
    rows: dict[int, list[Any]] = {}
    for word, nodes in blocks if sets else ():
        local = np.array(_FACETS.get(word.rstrip("0123456789"), ()))
        if _ELEMENTS[word][0] == top and len(local):
            corners = local.shape[1]
            rows.setdefault(corners, []).append(nodes[:, local].reshape(-1, corners))
    outer = []
    for each in rows.values():
        facets = np.concatenate(each)
        _, first, counts = np.unique(
            np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True
        )
        outer.append(facets[first[counts == 1]])
    for name, own in sets.items():
        index = np.ma.filled(np.ma.asarray(own)).ravel()
        known = index.dtype.kind in "iu" and index.max(initial=-1) < count
        if not known or index.min(initial=0) < 0:
            sys.exit(f"its set {name!r} names nodes that the file does not have")
        inside = np.zeros(count, dtype=bool)
        inside[index] = True
        for facets in outer:
            if (within := inside[facets].all(axis=1)).any():
                yield str(name), facets[within]
