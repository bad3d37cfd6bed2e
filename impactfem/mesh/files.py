"""Space-time meshes from a user's .geo or .msh file, with their faults reported."""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import MeshError
from impactfem.mesh.session import distribute
from impactfem.mesh.spacetime import BOUNDARIES, Layout, SpaceTimeMesh, find_layers, finish

MAX_BYTES = 512 * 2**20
"""Largest mesh file that is read."""

# Gmsh's script language can start programs, read and write other files: a mesh needs none of it.
_FORBIDDEN = re.compile(
    rb"\b(SystemCall|NonBlockingSystemCall|Include|Merge|MergeFile|ShapeFromFile|Save|Print|"
    rb"Printf|Plugin|OnelabRun|Open|NewModel|Exit|Abort|GetEnv|GetString|GetStringValue|"
    rb"AppendToExistingFile|General\.[A-Za-z]*FileName)\b"
)
_COMMENT = re.compile(rb"//[^\n]*|/\*.*?\*/", re.DOTALL)
_TRIANGLE = 2  # Gmsh's number of the 3-node triangle
_TOLERANCE = 1e-6  # share of a side by which a boundary may miss its place


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
        _open(gmsh, path)
        points = _check_mesh(gmsh, path, length, duration)
        tags = _check_boundaries(gmsh, path, length, duration)
        return find_layers(points * scale, tags)

    mesh, facet_tags, layout = distribute(comm, build)
    mesh.geometry.x[:, :2] *= scale
    return finish(mesh, facet_tags, layout)


def _open(gmsh: Any, path: Path) -> None:
    """Load the file into Gmsh and mesh it if it is a script."""
    suffix = path.suffix.lower()
    if suffix not in {".geo", ".msh"}:
        raise MeshError(f"mesh file {path}: the ending {suffix!r} is not known; use .geo or .msh")
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise MeshError(
                f"mesh file {path}: {size} bytes, more than the {MAX_BYTES} that are read; "
                "use a coarser mesh"
            )
        content = path.read_bytes()
    except OSError as error:
        raise MeshError(
            f"mesh file {path}: cannot be read ({error.strerror}); check `solve.mesh`, which is "
            "relative to the scene file"
        ) from error
    if not content.strip():
        raise MeshError(f"mesh file {path}: empty; write a mesh with physical curves {BOUNDARIES}")
    if suffix == ".msh" and not content.lstrip().startswith(b"$MeshFormat"):
        # Gmsh would read anything else as a script.
        raise MeshError(f"mesh file {path}: does not begin with $MeshFormat; save it as .msh (4.1)")
    command = _FORBIDDEN.search(_COMMENT.sub(b" ", content))
    if suffix == ".geo" and command:
        raise MeshError(
            f"mesh file {path}: the command {command[0].decode()!r} is not allowed in a scene's "
            "mesh (it could touch other files); write the geometry in this one file"
        )
    gmsh.logger.start()
    try:
        gmsh.open(str(path))
        if suffix == ".geo":
            gmsh.model.mesh.generate(2)
    except Exception as error:
        raise MeshError(f"mesh file {path}: Gmsh says: {error}") from error
    finally:
        said = [line for line in gmsh.logger.get() if line.startswith("Error")]
        gmsh.logger.stop()
    if said:
        raise MeshError(f"mesh file {path}: Gmsh says: {said[0]}")


def _check_mesh(gmsh: Any, path: Path, length: float, duration: float) -> NDArray[np.float64]:
    """Check elements and extent; returns the nodes, shape (nodes, 2), in s and m."""
    kinds = list(gmsh.model.mesh.getElementTypes(2))
    if kinds != [_TRIANGLE]:
        raise MeshError(
            f"mesh file {path}: needs 3-node triangles only, has Gmsh element types "
            f"{kinds or 'none'}; mesh the surface with first-order triangles"
        )
    if not gmsh.model.getPhysicalGroups(2):
        raise MeshError(
            f'mesh file {path}: no physical surface; add `Physical Surface("bar") = {{...}};`'
        )
    _, coordinates, _ = gmsh.model.mesh.getNodes()
    points = np.reshape(coordinates, (-1, 3))
    if not np.isfinite(points).all():
        raise MeshError(f"mesh file {path}: a node coordinate is not finite; write the mesh again")
    if np.abs(points[:, 2]).max() > _TOLERANCE * length:
        raise MeshError(f"mesh file {path}: nodes leave the plane z = 0; draw (t, x) in the plane")
    low, high = points.min(axis=0), points.max(axis=0)
    wanted = (("t", "s", duration), ("x", "m", length))
    for axis, (name, unit, size) in enumerate(wanted):
        if max(abs(low[axis]), abs(high[axis] - size)) > _TOLERANCE * size:
            turned = (
                " The mesh seems turned: the first coordinate is time."
                if abs(high[axis] - wanted[1 - axis][2]) <= _TOLERANCE * wanted[1 - axis][2]
                else ""
            )
            raise MeshError(
                f"mesh file {path}: {name} runs from {low[axis]:g} to {high[axis]:g} {unit}, the "
                f"scene needs 0 to {size:g} {unit}; make the mesh or the scene fit.{turned}"
            )
    _, _, node_tags = gmsh.model.mesh.getElements(2)
    used = len(np.unique(node_tags[0]))
    if used != len(points):
        raise MeshError(
            f"mesh file {path}: {len(points) - used} of {len(points)} nodes belong to no triangle; "
            "remove loose nodes"
        )
    return np.ascontiguousarray(points[:, :2])


def _check_boundaries(gmsh: Any, path: Path, length: float, duration: float) -> dict[str, int]:
    """Check names and places of the four boundaries; returns their physical tags."""
    tags = {gmsh.model.getPhysicalName(1, tag): tag for _, tag in gmsh.model.getPhysicalGroups(1)}
    missing = [name for name in BOUNDARIES if name not in tags]
    if missing:
        raise MeshError(
            f"mesh file {path}: physical curves {missing} are missing, found {sorted(tags)}; name "
            "the sides start (t = 0), end (t = T), wall (x = 0) and far (x = L)"
        )
    counts = {}
    # name: (axis held fixed, its value, extent along the other axis)
    places = {
        "start": (0, 0.0, length),
        "end": (0, duration, length),
        "wall": (1, 0.0, duration),
        "far": (1, length, duration),
    }
    for name, (axis, value, extent) in places.items():
        _, coordinates = gmsh.model.mesh.getNodesForPhysicalGroup(1, tags[name])
        points = np.reshape(coordinates, (-1, 3))
        counts[name] = len(points)
        size = (duration, length)[axis]
        fixed, along = points[:, axis], points[:, 1 - axis]
        if len(points) == 0 or np.abs(fixed - value).max() > _TOLERANCE * size:
            where = f"between {fixed.min():g} and {fixed.max():g}" if len(points) else "nowhere"
            raise MeshError(
                f"mesh file {path}: boundary {name!r} must lie at {'tx'[axis]} = {value:g}, "
                f"its nodes lie {where}; wrong orientation? First coordinate t, second x from the "
                "near end"
            )
        if along.max() - along.min() < (1 - _TOLERANCE) * extent:
            raise MeshError(
                f"mesh file {path}: boundary {name!r} covers only {along.min():g} to "
                f"{along.max():g} of 0 to {extent:g}; put every curve of that side into the "
                "physical group"
            )
    if counts["start"] != counts["end"]:
        raise MeshError(
            f"mesh file {path}: {counts['start']} nodes at start, {counts['end']} at end; the "
            "Petrov-Galerkin system is square only with equal numbers: divide both sides alike"
        )
    return {name: tags[name] for name in BOUNDARIES}
