"""Closed surfaces from files: STL is read here, meshes and geometry by Gmsh apart."""

import re
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.errors import MeshError
from impactfem.reading.opening import MESHIO, STEP, Job, opened
from impactfem.reading.regular import read_regular, reason
from impactfem.scene.closed_surface import ClosedSurface, crossed, faults, signed_volume, told
from impactfem.scene.mesh_files import check_part
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

SURFACE_FILES = (".stl", ".msh", ".step", ".stp", *MESHIO)
MESH_SIZE = "length of the edges of a STEP file's elements; required with one"
SCALE = "metres in a unit of the file (a STEP file knows its own)"

MOST_FACES = 2_000_000
"""Largest surface that is read: 56 s and 1.3 GiB."""

_MILLIMETRE = 1e-3  # in m: Gmsh gives the lengths of STEP files in mm
_SAME = 1e-7  # share of the size below which places are one: STL files have single precision
_OFF_PLANE = 1e-9  # share of the size by which a node may miss z = 0
_FACETS = {
    3: ((0, 1), (1, 2), (2, 0)),
    4: ((1, 2, 3), (0, 2, 1), (0, 3, 2), (0, 1, 3)),
}  # by the number of corners of a cell, outwards


def closed_surface(body: Any, dim: int, *, may_end: bool = False) -> ClosedSurface:
    """The surface in the file that a body or obstacle names, in its unit of length.

    Args:
        body: With the keys ``mesh``, ``scale`` and ``mesh_size``, and the folder of its scene.
        dim: Number of coordinates.
        may_end: Whether it may be open.

    Raises:
        KeyedError: The file cannot be read, or its surface is none of a body.
    """
    path = Path(body.folder or "", body.mesh)
    given = f" = {show(body.mesh)}"
    step = path.suffix.lower() in STEP
    check_part(body)
    if step != (body.mesh_size is not None):
        shown = "" if step else f" = {body.mesh_size:g}"
        text = " is missing: a STEP file needs it; give it in m." if step else ": the file holds "
        raise KeyedError(
            body.kind, "mesh_size", shown + text + "its elements; remove it." * (not step)
        )
    try:
        known = path.stat()
        stamp = known.st_mtime_ns, known.st_size
        size = body.mesh_size or 0.0
        return _read(path, stamp, dim, body.scale, size, body.part, may_end)
    except _FaultError as error:
        text = f"{given} {error.args[0]}: {error.args[1]} (the file is {path})."
    except MeshError as error:
        text = (
            f"{given} is not read: {str(error).removeprefix(f'mesh file {path}: ')} (the file is "
        )
        text += f"{path})."
    except (OSError, ValueError) as error:
        text = f"{given} cannot be read ({reason(error)}): check it, relative paths "
        text += f"start at the scene file (looked for {path})."
    raise KeyedError(body.kind, "mesh", text)


class _FaultError(Exception):
    """What is wrong with a file, and what to do."""


@lru_cache(maxsize=32)
def _read(
    path: Path,
    known: tuple[int, int],
    dim: int,
    scale: float,
    size: float,
    part: str | None,
    may_end: bool,
) -> ClosedSurface:
    """The surface in a file; `known` tells its contents apart."""
    del known
    cells: Integers | None = None
    if path.suffix.lower() == ".stl":
        if dim == 2:
            raise _FaultError("is a surface in space", "in the plane give a .msh file")
        corners = _stl(read_regular(path))
        _check_count(len(corners))
        points, simplices = _merged(corners)
    else:
        step = path.suffix.lower() in STEP
        if step and dim == 2:
            raise _FaultError("is geometry in space", "in the plane give a .msh file")
        unit = _MILLIMETRE if step else 1.0
        points, simplices, cells = _by_gmsh(path, dim, size / unit, part)
        points = unit * points
    _check_count(len(simplices))
    points = scale * points
    if fault := next(faults(points, simplices, may_end=may_end), None):
        raise _FaultError(*fault)
    found = ClosedSurface(points, np.ascontiguousarray(simplices), cells)
    if (dim == 2 or not found.border.any()) and signed_volume(points, simplices) < 0.0:
        found = replace(found, simplices=np.ascontiguousarray(simplices[:, ::-1]))
    if dim == 3 and (place := crossed(found)) is not None:
        raise _FaultError(
            f"crosses itself near ({told(place)})", "give the outside of one body only"
        )
    return found


def _check_count(facets: int) -> None:
    """Refuse surfaces that would take too long."""
    if facets > MOST_FACES:
        text = f"has {facets} facets, more than the {MOST_FACES} that are read"
        raise _FaultError(text, "give a coarser surface")


def _stl(content: bytes) -> Floats:
    """Corners of the triangles of an STL file, (triangles, 3, 3)."""
    count = int.from_bytes(content[80:84], "little")
    if len(content) >= 84 and len(content) == 84 + 50 * count:
        layout = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
        return np.frombuffer(content, layout, offset=84)["corners"].astype(np.float64)
    entries = re.findall(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", content)
    try:
        corners = np.array(entries, dtype=np.float64)
    except ValueError:
        corners = np.zeros((1, 3))
    if not content.lstrip().startswith(b"solid") or len(corners) % 3:
        raise _FaultError("is no STL file, or is cut off", "export it again")
    return corners.reshape(-1, 3, 3)


def _merged(corners: Floats) -> tuple[Floats, Integers]:
    """Points, and triangles between them: places that are one in single precision become one."""
    from scipy.sparse import coo_matrix  # noqa: PLC0415  (slow to load)
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415
    from scipy.spatial import cKDTree  # noqa: PLC0415

    points, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    if not len(points) or not np.isfinite(points).all():
        return points, index.reshape(-1, 3)
    near = cKDTree(points).query_pairs(
        _SAME * float(np.ptp(points, axis=0).max()), output_type="ndarray"
    )
    links = coo_matrix((np.ones(len(near)), near.T), shape=(len(points),) * 2)
    _, label = connected_components(links, directed=False)
    _, first = np.unique(label, return_index=True)
    triangles = label[index].reshape(-1, 3)
    some = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return points[first], triangles[some].astype(np.int64)


def _by_gmsh(
    path: Path, dim: int, size: float, part: str | None
) -> tuple[Floats, Integers, Integers | None]:
    """Points, facets of the boundary and cells of a mesh; of a surface mesh its triangles."""
    step = path.suffix.lower() in STEP
    options = {"General.NumThreads": 1.0}
    if step:
        options |= {"Mesh.MeshSizeMin": size, "Mesh.MeshSizeMax": size}
    job = Job(
        key="mesh", surfaces="triangles", endings=SURFACE_FILES[1:], dim=3, options=options,
        unit=_MILLIMETRE if step else 1.0, part=part, arrays=True,
    )  # fmt: skip
    with opened(path, job) as found:
        given = found.arrays
    if others := given["others"].tolist():
        text = f"has elements {', '.join(map(show, others))}"
        raise _FaultError(text, "give triangles or tetrahedra of first order")
    number = np.zeros(int(given["tags"].max(initial=0)) + 1, dtype=np.int64)
    number[given["tags"].astype(np.int64)] = np.arange(len(given["tags"]))
    points = given["points"].reshape(-1, 3)
    flat, solid = (number[given[f"cells{k}"].astype(np.int64)].reshape(-1, k) for k in (3, 4))
    if dim == 2:
        extent = float(np.ptp(points, axis=0).max(initial=0.0))
        if len(solid) or np.abs(points[:, 2]).max(initial=0.0) > _OFF_PLANE * extent:
            raise _FaultError("does not lie in the plane z = 0", 'draw it there, or give "3d"')
        points = np.ascontiguousarray(points[:, :2])
    elif not len(solid):
        return points, flat, None
    cells = flat if dim == 2 else solid
    corners = points[cells]
    turned = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0.0
    cells[turned] = cells[turned][:, [1, 0, *range(2, dim + 1)]]
    facets = cells[:, np.array(_FACETS[dim + 1])].reshape(-1, dim)
    _, index, counts = np.unique(
        np.sort(facets, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return points, facets[counts[index.ravel()] == 1], cells
