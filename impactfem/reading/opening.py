"""A user's mesh file, opened in a process of its own: Gmsh can crash on a broken one."""

import errno
import json
import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from impactfem.errors import MeshError
from impactfem.reading.apart import ApartError, apart
from impactfem.reading.gmsh_program import PROGRAM
from impactfem.reading.holdings import Holdings
from impactfem.reading.regular import MAX_BYTES, read_regular, reason

MAX_SCRIPT_BYTES = 16 * 2**20
"""Largest script (.geo) that is read: Gmsh takes minutes for more."""

MESHIO: Mapping[str, str] = MappingProxyType({
    ".vtk": "vtk", ".vtu": "vtu", ".xdmf": "xdmf", ".xmf": "xdmf", ".inp": "abaqus",
    ".med": "med", ".e": "exodus", ".exo": "exodus", ".ex2": "exodus", ".mesh": "medit",
    ".meshb": "medit", ".bdf": "nastran", ".fem": "nastran", ".nas": "nastran", ".cgns": "cgns",
    ".h5m": "h5m", ".avs": "avsucd", ".xml": "dolfin-xml", ".hmf": "hmf", ".vol": "netgen",
    ".obj": "obj", ".off": "off", ".ply": "ply", ".post": "permas", ".dato": "permas",
    ".su2": "su2", ".dat": "tecplot", ".tec": "tecplot", ".f3grid": "flac3d", ".mdpa": "mdpa",
    ".ugrid": "ugrid", ".wkt": "wkt", ".ele": "tetgen", ".node": "tetgen",
})  # fmt: skip
"""Endings of the meshes that meshio reads, and its words for their formats."""

STEP = (".step", ".stp")
"""Endings of STEP files."""

_MOST_ALONG = 1e5  # elements along a body's largest extent; their square would fill any memory

# Gmsh's script language can start programs, read and write files: a mesh needs none of it.
_FORBIDDEN = re.compile(
    rb"\b(\w*SystemCall|System|Include|Merge\w*|\w*FromFile|FileExists|Save|Printf?|Plugin|Onelab\w*|"
    rb"SendToServer|Open|CreateDir|NewModel|Exit|Abort|Sleep|GetEnv|GetString\w*|Append\w*|"
    rb"StringToName|NameFromString|NameToString|ExternalProcess|Structured|Solver|\w*FileName|"
    rb"\w*Command\w*|\w*Directory|CurrentDir|Executable\w*|Scripting\w*)\b"
)
# Which nodes are copies of which: nothing here asks for it, and Gmsh rewrites old sections so that
# it cannot read them again.
_PERIODIC = re.compile(rb"\n\$Periodic\s.*?\n\$EndPeriodic[^\n]*", re.DOTALL)
# Other files that those of meshio may name: a mesh is one file, but for the arrays of XDMF beside.
_INCLUDED = re.compile(rb"^\s*\*\s*include\b[^\n]*", re.IGNORECASE | re.MULTILINE)
_ITEM = re.compile(rb"<DataItem\b([^>]*)>([^<]*)<", re.IGNORECASE)
_IN_FILE = re.compile(rb"Format\s*=\s*[\"'](?!XML[\"'])", re.IGNORECASE)
_HALVES = {".ele": ".node", ".node": ".ele"}  # of TetGen's meshes
_CONVERSION = re.compile(rb"CONVERSION_BASED_UNIT\s*\(\s*'([^']*)'")
_SI_UNIT = re.compile(rb"SI_UNIT\s*\(\s*(?:\$|\.([A-Z]*)\.)\s*,\s*\.METRE\.")
# Gmsh's strings know no escapes and may span lines; what looks like a comment in one is none.
_TOKEN = re.compile(rb"\"[^\"]*\"|'[^']*'|//[^\n]*|/\*.*?\*/", re.DOTALL)


@dataclass(frozen=True)
class Job:
    """What Gmsh shall do with a file.

    Attributes:
        key: Key of the scene that names the file.
        surfaces: What an empty file lacks, for the message.
        endings: Endings that are read.
        dim: Dimension up to which geometry is meshed.
        degree: Degree to which elements are brought; None leaves them.
        kinds: Gmsh's numbers of the elements that have the degree already.
        options: Gmsh's options for meshing geometry.
        balls: Parameters of Gmsh's fields "Ball", of which the least is the mesh size.
        unit: Length in the file [m], for messages.
        part: Name of the part of a STEP file that is meant; None for all.
        cut: Whether each element is cut into smaller ones of the same kind.
        arrays: Whether nodes, triangles and tetrahedra of first order are wanted as arrays.
    """

    key: str = "solve.mesh"
    surfaces: str = "the physical curves start, end, wall, far"
    endings: tuple[str, ...] = (".geo", ".msh")
    dim: int = 2
    degree: int | None = None
    kinds: tuple[int, ...] = ()
    options: Mapping[str, float] = field(default_factory=dict)
    balls: tuple[Mapping[str, float], ...] = ()
    unit: float = 1.0
    part: str | None = None
    cut: bool = False
    arrays: bool = False


SPACE_TIME = Job()
"""Triangles of a space-time mesh, as the file has them."""


@dataclass(frozen=True)
class Opened:
    """A file that Gmsh has read and written anew.

    Attributes:
        path: The temporary ``.msh``; of a job with arrays the file with these.
        holdings: What the user's file holds.
        arrays: ``tags``, ``points``, ``cells3``, ``cells4`` of a job with them, and names of
            ``others`` among its elements.
        unit: Of a STEP file, the unit of its lengths, in words.
    """

    path: Path
    holdings: Holdings
    arrays: Mapping[str, Any] = field(default_factory=dict)
    unit: str = ""


@contextmanager
def opened(path: Path, job: Job = SPACE_TIME) -> Iterator[Opened]:
    """Check a file and give it as a temporary ``.msh`` that Gmsh wrote itself.

    Args:
        path: A ``.geo``, ``.msh``, ``.step`` or ``.stp`` file, or one of `MESHIO`, as far as the
            job allows.
        job: What is done with it. Lengths of STEP files come in millimetres.

    Raises:
        MeshError: The file cannot be read, is no mesh, or uses commands that reach beyond it.
    """
    content = _content(path, job)
    with tempfile.TemporaryDirectory(prefix="impactfem-") as folder:
        source = Path(folder, f"source{_suffix(path)}")
        target = Path(folder, "mesh.npz" if job.arrays else "mesh.msh")
        source.write_bytes(content)
        for name, beside in _beside(path, content).items():
            Path(folder, name).write_bytes(beside)
        _convert(path, source, target, job)
        holdings = Holdings.of(json.loads(Path(f"{target}.json").read_text(encoding="utf-8")))
        _check_told_apart(path, content, holdings)
        arrays: dict[str, Any] = {}
        if job.arrays:
            with np.load(target) as file:
                arrays = dict(file)
        unit = _unit(content) if path.suffix.lower() in STEP else ""
        yield Opened(target, holdings, arrays, unit)


def look(path: Path, dim: int = 2, key: str = "solve.mesh") -> Holdings:
    """What a mesh or a script holds; that of the last files looked at is kept.

    Args:
        path: A ``.geo`` or ``.msh`` file, or of a body one of meshio.
        dim: Dimension of the elements.
        key: Key of the scene that names the file.

    Raises:
        MeshError: As `opened`.
    """
    try:
        known = path.stat()
    except OSError:
        return _look(path, dim, key, 0, 0)  # which says what is wrong
    return _look(path, dim, key, known.st_mtime_ns, known.st_size)


@lru_cache(maxsize=8)
def _look(path: Path, dim: int, key: str, _changed: int, _size: int) -> Holdings:
    job = Job(key=key, dim=dim)
    if key != SPACE_TIME.key:
        endings = (*job.endings, *MESHIO)
        job = replace(job, surfaces="elements of the body", endings=endings)
    with opened(path, job) as found:
        return found.holdings


def _check_told_apart(path: Path, content: bytes, holdings: Holdings) -> None:
    """Refuse groups that Gmsh has mixed: in format 2 a part of the geometry has one group."""
    if not re.match(rb"\$MeshFormat\s+2", content):
        return
    shared = holdings.shared()
    if shared is not None:
        one, other, entity = shared
        raise MeshError(
            f"mesh file {path}: the {one} and the {other} share the elementary entity {entity}, "
            "and format 2 does not tell which of its elements belong to which; save it as .msh "
            "4.1, or give each group entities of its own"
        )


def _content(path: Path, job: Job) -> bytes:
    """Read the file and refuse what Gmsh must not see."""
    suffix = path.suffix.lower()
    if suffix not in job.endings:
        known = f"{', '.join(job.endings[:-1])} or {job.endings[-1]}"
        raise MeshError(f"mesh file {path}: the ending {suffix!r} is not known; use {known}")
    content = _bytes(path, job)
    if suffix == ".msh":
        if not content.startswith(b"$MeshFormat"):  # Gmsh would take anything else for a script
            raise MeshError(
                f"mesh file {path}: does not begin with $MeshFormat; save it as .msh (4.1)"
            )
        return _PERIODIC.sub(b"", content)
    if suffix in STEP:
        if not content.lstrip().startswith(b"ISO-10303-21"):
            raise MeshError(
                f"mesh file {path}: does not begin with ISO-10303-21; export it as STEP again"
            )
        return content
    if suffix in MESHIO:
        return content
    command = _FORBIDDEN.search(_TOKEN.sub(_without_comment, content))
    if command:
        raise MeshError(
            f"mesh file {path}: the command {command[0].decode()!r} is not allowed in a scene's "
            "mesh (it could touch other files); write the geometry in this one file"
        )
    return content + b"\n"  # Gmsh overlooks statements on a last line that does not end


def _unit(content: bytes) -> str:
    """Unit of the lengths in a STEP file, which Gmsh takes into account."""
    found = set()
    for entity in content.split(b";"):
        if b"LENGTH_UNIT" not in entity:
            continue
        if name := _CONVERSION.search(entity):
            found.add(name[1].decode(errors="replace").lower())
        elif name := _SI_UNIT.search(entity):
            found.add(f"{(name[1] or b'').decode().lower()}metre")
    return " and ".join(sorted(found)) or "millimetre (none is stated)"


def _bytes(path: Path, job: Job) -> bytes:
    """Read the file."""
    is_script = path.suffix.lower() == ".geo"
    try:
        content = read_regular(path, MAX_SCRIPT_BYTES if is_script else MAX_BYTES)
    except (OSError, ValueError) as error:
        large = isinstance(error, OSError) and error.errno == errno.EFBIG
        remedy = "save its mesh as .msh" if is_script else "use a coarser mesh"
        remedy = remedy if large else f"check `{job.key}`, which is relative to the scene file"
        raise MeshError(f"mesh file {path}: cannot be read ({reason(error)}); {remedy}") from error
    if not content.strip():
        raise MeshError(f"mesh file {path}: empty; write a mesh with {job.surfaces}")
    return content


def _suffix(path: Path) -> str:
    """Ending of a file; of UGRID with the letters of its numbers before, as ".b8.ugrid"."""
    suffix = path.suffix.lower()
    return "".join(path.suffixes[-2:]).lower() if suffix == ".ugrid" else suffix


def _beside(path: Path, content: bytes) -> dict[str, bytes]:
    """The files that a mesh of meshio needs, from its folder, by the names it gives them.

    Raises:
        MeshError: It names files elsewhere, or they cannot be read.
    """
    suffix = path.suffix.lower()
    names: dict[str, Path] = {}
    if suffix == ".inp" and (line := _INCLUDED.search(content)):
        shown = line[0].decode(errors="replace").strip()
        raise MeshError(f"mesh file {path}: {shown!r} is another file; write all into this one")
    if MESHIO.get(suffix) == "xdmf":
        items = (text for kind, text in _ITEM.findall(content) if _IN_FILE.search(kind))
        asked = {text.decode(errors="replace").split(":")[0].strip() for text in items}
        names = {name: path.parent / name for name in asked if name}
    if suffix in _HALVES:
        names = {f"source{_HALVES[suffix]}": path.with_suffix(_HALVES[suffix])}
    found = {}
    for name, own in sorted(names.items()):
        if Path(name).name != name:
            raise MeshError(
                f"mesh file {path}: its arrays are in {name!r}; put that file into the same folder "
                "and name it without a folder"
            )
        try:
            found[name] = read_regular(own)
        except (OSError, ValueError) as error:
            raise MeshError(
                f"mesh file {path}: {own.name}, which it needs, cannot be read ({reason(error)}); "
                "put it into the same folder"
            ) from error
    return found


def _without_comment(token: re.Match[bytes]) -> bytes:
    return b" " if token[0].startswith(b"/") else token[0]


def _convert(path: Path, source: Path, target: Path, job: Job) -> None:
    """Have another process read the source, mesh it if it is a script, and write the target."""
    orders = json.dumps({
        "dim": job.dim, "degree": job.degree, "kinds": job.kinds, "options": dict(job.options),
        "balls": [dict(ball) for ball in job.balls],
        "size": job.options.get("Mesh.MeshSizeMax"), "most": _MOST_ALONG, "unit": job.unit,
        "part": job.part, "cut": job.cut, "arrays": job.arrays,
        "meshio": MESHIO.get(path.suffix.lower()),
    })  # fmt: skip
    size = sum(file.stat().st_size for file in source.parent.iterdir())
    name = "meshio" if path.suffix.lower() in MESHIO else "Gmsh"
    try:
        apart(PROGRAM, [str(source), str(target), orders], size, name)
    except ApartError as error:
        text = str(error).replace(str(source), path.name)
        raise MeshError(f"mesh file {path}: {text}") from None
    if not target.exists():
        raise MeshError(f"mesh file {path}: Gmsh says: no mesh; correct the file")
