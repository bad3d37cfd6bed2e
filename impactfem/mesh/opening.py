"""A user's mesh file, opened in a process of its own: Gmsh can crash on a broken one."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from impactfem.errors import MeshError
from impactfem.mesh.holdings import Holdings

MAX_BYTES = 512 * 2**20
"""Largest mesh file that is read."""

MAX_SCRIPT_BYTES = 16 * 2**20
"""Largest script (.geo) that is read: Gmsh takes minutes for more."""

_MOST_ALONG = 1e5  # elements along a body's largest extent; their square would fill any memory

# For reading a file, not for meshing it: processor time [s] and address space, by its size.
_SECONDS, _SECONDS_PER_MIB = 20, 60
_BYTES, _BYTES_PER_BYTE = 2**32, 50

# Gmsh's script language can start programs, read and write files: a mesh needs none of it.
_FORBIDDEN = re.compile(
    rb"\b(\w*SystemCall|System|Include|Merge\w*|ShapeFromFile|Save|Printf?|Plugin|Onelab\w*|"
    rb"SendToServer|Open|CreateDir|NewModel|Exit|Abort|Sleep|GetEnv|GetString\w*|Append\w*|"
    rb"StringToName|NameFromString|NameToString|ExternalProcess|Structured|Solver|\w*FileName|"
    rb"\w*Command\w*|\w*Directory|CurrentDir|Executable\w*|Scripting\w*)\b"
)
# Gmsh's strings know no escapes and may span lines; what looks like a comment in one is none.
_TOKEN = re.compile(rb"\"[^\"]*\"|'[^']*'|//[^\n]*|/\*.*?\*/", re.DOTALL)

# What only Gmsh knows is done here; the rest happens outside, where it can be tested.
_PROGRAM = """
import ctypes
import json
import os
import resource
import signal
import sys
import time

# Whatever ends the parent ends this process; it may have gone already.
ctypes.CDLL(None, use_errno=True).prctl(1, signal.SIGKILL)  # 1: PR_SET_PDEATHSIG
source, target, job, parent = sys.argv[1:]
if os.getppid() != int(parent):
    sys.exit("the run has ended")
import gmsh

# A mesh that is too fine must end this process, not the machine.
def limit(kind, most):
    _, hard = resource.getrlimit(kind)
    resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))

resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
memory = max(2**33, os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
job = json.loads(job)
dim, degree = job["dim"], job["degree"]
gmsh.initialize(readConfigFiles=False, interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
gmsh.logger.start()
errors = []

def label():
    for side in (dim, dim - 1):
        named = {}
        for entity, tag in gmsh.model.getEntities(side):
            name = gmsh.model.getEntityName(entity, tag).split("/")[-1]
            fallback = "body" if side == dim else ("edge_", "face_")[side - 1] + str(tag)
            named.setdefault(name or fallback, []).append(tag)
        for name, tags in named.items():
            gmsh.model.addPhysicalGroup(side, tags, name=name)

def grade():
    field = gmsh.model.mesh.field
    tags = []
    for values in job["balls"]:
        tags.append(field.add("Ball"))
        for name, value in values.items():
            field.setNumber(tags[-1], name, value)
    if tags:
        least = field.add("Min")
        field.setNumbers(least, "FieldsList", tags)
        field.setAsBackgroundMesh(least)

def off_straight(kind):
    # Largest distance of nodes from where the corners alone would have them, over the element.
    import numpy as np
    mesh = gmsh.model.mesh
    name, _, order, count, local, corners = mesh.getElementProperties(kind)
    if order == 1:
        return 0.0
    first = mesh.getElementType(name.split()[0], 1)
    places = np.zeros((count, 3))
    places[:, :dim] = np.reshape(local, (count, dim))
    _, values, _ = mesh.getBasisFunctions(first, places.ravel(), "Lagrange")
    shapes = np.reshape(values, (count, corners))
    tags, points, _ = mesh.getNodes()
    sort = np.argsort(tags)
    tags, points = tags[sort], np.reshape(points, (-1, 3))[sort]
    nodes = np.reshape(mesh.getElementsByType(kind)[1], (-1, count))
    worst = 0.0
    for some in np.array_split(nodes, 1 + len(nodes) // 100000):
        at = points[np.searchsorted(tags, some)]
        away = np.linalg.norm(at - np.einsum("nc,ecd->end", shapes, at[:, :corners]), axis=2)
        size = np.ptp(at, axis=1).max(axis=1)
        worst = max(worst, float((away.max(axis=1) / size).max(initial=0.0)))
    return worst

def holdings():
    mesh = gmsh.model.mesh
    elements, order, bent, groups = {}, 1, 0.0, []
    for kind in mesh.getElementTypes(dim):
        name, _, degree, *_ = mesh.getElementProperties(kind)
        name = name.split()[0].lower()
        elements[name] = elements.get(name, 0) + len(mesh.getElementsByType(kind)[0])
        order = max(order, degree)
        if source.endswith(".msh"):  # others are meshed here, with nodes on the geometry
            bent = max(bent, off_straight(kind))
    for side, tag in gmsh.model.getPhysicalGroups():
        entities = [int(entity) for entity in gmsh.model.getEntitiesForPhysicalGroup(side, tag)]
        lists = [tags for entity in entities for tags in mesh.getElements(side, abs(entity))[1]]
        points = mesh.getNodesForPhysicalGroup(side, tag)[1]
        axes = [points[axis::3] for axis in range(3)]
        groups.append({
            "name": gmsh.model.getPhysicalName(side, tag) or str(tag), "dim": side,
            "elements": sum(len(tags) for tags in lists), "entities": entities,
            "low": [float(min(axis, default=0.0)) for axis in axes],
            "high": [float(max(axis, default=0.0)) for axis in axes],
        })
    return {"elements": elements, "order": order, "bent": bent, "groups": groups}

try:
    # A file may ask for more than it holds, and the loops of a script need not end.
    limit(resource.RLIMIT_AS, min(memory, job["bytes"]))
    before = resource.getrlimit(resource.RLIMIT_CPU)
    limit(resource.RLIMIT_CPU, int(time.process_time() + job["seconds"]))
    gmsh.open(source)
    resource.setrlimit(resource.RLIMIT_CPU, before)
    limit(resource.RLIMIT_AS, memory)
    step = source.endswith((".step", ".stp"))
    if step:
        label()
    if step or source.endswith(".geo"):
        box = gmsh.model.getBoundingBox(-1, -1)
        extent = max(b - a for a, b in zip(box[:3], box[3:]))
        along = [(extent, job["size"] or extent)]
        along += [(min(extent, 2.0 * ball["Radius"]), ball["VIn"]) for ball in job["balls"]]
        for length, size in along:
            if length > job["most"] * size:
                sys.exit(
                    f"{length / size:.2g} elements of {job['unit'] * size:.2g} m would lie along "
                    "the body or a ball of refine, which no memory holds; give larger sizes"
                )
        for name, value in job["options"].items():
            gmsh.option.setNumber(name, value)
        grade()
        gmsh.model.mesh.generate(dim)
    found = holdings()
    if job["cut"]:
        gmsh.model.mesh.refine()
    kinds = [int(kind) for kind in gmsh.model.mesh.getElementTypes(dim)]
    if degree and kinds and not set(kinds) <= set(job["kinds"]):
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 0)
        gmsh.model.mesh.setOrder(degree)
    gmsh.model.mesh.renumberElements()
    errors += [line for line in gmsh.logger.get() if line.startswith("Error")]
    for option, value in (("SaveAll", 1), ("MshFileVersion", 4.1), ("Binary", 1)):
        gmsh.option.setNumber("Mesh." + option, value)
    gmsh.write(target)
    with open(target + ".json", "w", encoding="utf-8") as file:
        json.dump(found, file)
except UnicodeError:  # Gmsh repeats what it cannot read, which here is no text
    errors.insert(0, "the file holds bytes that are no text where a mesh file has words")
except Exception as error:
    errors.insert(0, str(error))
sys.exit(errors[0] if errors else 0)
"""
# Set by MPI launchers; a library of Gmsh that saw them would take itself for a rank.
_LAUNCHER = re.compile(r"(PMI|MPI|OMPI|PRTE|HYDRA|SLURM)")


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
        cut: Whether each element is cut into smaller ones of the same kind.
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
    cut: bool = False


SPACE_TIME = Job()
"""Triangles of a space-time mesh, as the file has them."""


@dataclass(frozen=True)
class Opened:
    """A file that Gmsh has read and written anew.

    Attributes:
        path: The temporary ``.msh``.
        holdings: What the user's file holds.
    """

    path: Path
    holdings: Holdings


@contextmanager
def opened(path: Path, job: Job = SPACE_TIME) -> Iterator[Opened]:
    """Check a file and give it as a temporary ``.msh`` that Gmsh wrote itself.

    Args:
        path: A ``.geo``, ``.msh``, ``.step`` or ``.stp`` file, as far as the job allows.
        job: What is done with it. Lengths of STEP files come in millimetres.

    Raises:
        MeshError: The file cannot be read, is no mesh, or uses commands that reach beyond it.
    """
    content = _content(path, job)
    with tempfile.TemporaryDirectory(prefix="impactfem-") as folder:
        source = Path(folder, f"source{path.suffix.lower()}")
        target = Path(folder, "mesh.msh")
        source.write_bytes(content)
        _convert(path, source, target, job)
        holdings = Holdings.of(json.loads(Path(f"{target}.json").read_text(encoding="utf-8")))
        _check_told_apart(path, content, holdings)
        yield Opened(target, holdings)


def look(path: Path, dim: int = 2, key: str = "solve.mesh") -> Holdings:
    """What a mesh or a script holds; that of the last files looked at is kept.

    Args:
        path: A ``.geo`` or ``.msh`` file.
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
    with opened(path, Job(key=key, dim=dim)) as found:
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
        return content
    if suffix in {".step", ".stp"}:
        if not content.lstrip().startswith(b"ISO-10303-21"):
            raise MeshError(
                f"mesh file {path}: does not begin with ISO-10303-21; export it as STEP again"
            )
        return content
    command = _FORBIDDEN.search(_TOKEN.sub(_without_comment, content))
    if command:
        raise MeshError(
            f"mesh file {path}: the command {command[0].decode()!r} is not allowed in a scene's "
            "mesh (it could touch other files); write the geometry in this one file"
        )
    return content + b"\n"  # Gmsh overlooks statements on a last line that does not end


def _bytes(path: Path, job: Job) -> bytes:
    """Read the file."""
    try:
        if path.exists() and not path.is_file():
            raise MeshError(f"mesh file {path}: not a file; check `{job.key}`")
        size = path.stat().st_size
        is_script = path.suffix.lower() == ".geo"
        most = MAX_SCRIPT_BYTES if is_script else MAX_BYTES
        if size > most:
            remedy = "save its mesh as .msh" if is_script else "use a coarser mesh"
            raise MeshError(
                f"mesh file {path}: {size} bytes, more than the {most} that are read; {remedy}"
            )
        content = path.read_bytes()
    except (OSError, UnicodeError) as error:  # names this locale cannot spell
        why = getattr(error, "strerror", None) or error
        raise MeshError(
            f"mesh file {path}: cannot be read ({why}); check `{job.key}`, which is "
            "relative to the scene file"
        ) from error
    if not content.strip():
        raise MeshError(f"mesh file {path}: empty; write a mesh with {job.surfaces}")
    return content


def _without_comment(token: re.Match[bytes]) -> bytes:
    return b" " if token[0].startswith(b"/") else token[0]


def _convert(path: Path, source: Path, target: Path, job: Job) -> None:
    """Have another process read the source, mesh it if it is a script, and write the target."""
    environment = {name: value for name, value in os.environ.items() if not _LAUNCHER.match(name)}
    orders = json.dumps({
        "dim": job.dim, "degree": job.degree, "kinds": job.kinds, "options": dict(job.options),
        "balls": [dict(ball) for ball in job.balls],
        "size": job.options.get("Mesh.MeshSizeMax"), "most": _MOST_ALONG, "unit": job.unit,
        "cut": job.cut,
        "seconds": int(_SECONDS + _SECONDS_PER_MIB * source.stat().st_size / 2**20),
        "bytes": _BYTES + _BYTES_PER_BYTE * source.stat().st_size,
    })  # fmt: skip
    done = subprocess.run(  # noqa: S603  (our own program)
        [sys.executable, "-P", "-c", _PROGRAM, str(source), str(target), orders, str(os.getpid())],
        env=environment, stdin=subprocess.DEVNULL, capture_output=True, check=False,
    )  # fmt: skip
    if done.returncode == -signal.SIGXCPU:
        raise MeshError(
            f"mesh file {path}: reading it takes too long (a loop without end?); write fewer "
            "commands, or save its mesh as .msh"
        )
    if done.returncode < 0:
        raise MeshError(
            f"mesh file {path}: Gmsh crashed on it (signal {-done.returncode}); the file is broken "
            "or too large: write it again, as .msh (4.1)"
        )
    said = done.stderr.decode(errors="replace").strip().replace(str(source), path.name)
    if done.returncode > 0 or not target.exists():
        last = said.splitlines()[-1] if said else "no mesh"
        raise MeshError(f"mesh file {path}: Gmsh says: {last[:500]}; correct the file")
