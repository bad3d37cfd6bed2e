"""A user's mesh file, opened in a process of its own: Gmsh can crash on a broken one."""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from impactfem.errors import MeshError

MAX_BYTES = 512 * 2**20
"""Largest mesh file that is read."""

# Gmsh's script language can start programs, read and write files: a mesh needs none of it.
_FORBIDDEN = re.compile(
    rb"\b(\w*SystemCall|System|Include|Merge\w*|ShapeFromFile|Save|Printf?|Plugin|Onelab\w*|"
    rb"SendToServer|Open|CreateDir|NewModel|Exit|Abort|Sleep|GetEnv|GetString\w*|Append\w*|"
    rb"StringToName|NameFromString|NameToString|ExternalProcess|Structured|Solver|\w*FileName|"
    rb"\w*Command\w*|\w*Directory|CurrentDir|Executable\w*|Scripting\w*)\b"
)
# Gmsh's strings know no escapes and may span lines; what looks like a comment in one is none.
_TOKEN = re.compile(rb"\"[^\"]*\"|'[^']*'|//[^\n]*|/\*.*?\*/", re.DOTALL)

_PROGRAM = """
import sys
import gmsh

source, target = sys.argv[1:]
gmsh.initialize(readConfigFiles=False, interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.logger.start()
try:
    gmsh.open(source)
    if source.endswith(".geo"):
        gmsh.model.mesh.generate(2)
    gmsh.model.mesh.renumberElements()
    errors = [line for line in gmsh.logger.get() if line.startswith("Error")]
    for option, value in (("SaveAll", 1), ("MshFileVersion", 4.1), ("Binary", 1)):
        gmsh.option.setNumber("Mesh." + option, value)
    gmsh.write(target)
except Exception as error:
    errors = [str(error)]
sys.exit(errors[0] if errors else 0)
"""
# Set by MPI launchers; a library of Gmsh that saw them would take itself for a rank.
_LAUNCHER = re.compile(r"(PMI|MPI|OMPI|PRTE|HYDRA|SLURM)")


@contextmanager
def opened(path: Path) -> Iterator[Path]:
    """Check a ``.geo`` or ``.msh`` file and give it as a temporary ``.msh`` that Gmsh wrote itself.

    Raises:
        MeshError: The file cannot be read, is no mesh, or uses commands that reach beyond it.
    """
    content = _content(path)
    with tempfile.TemporaryDirectory(prefix="impactfem-") as folder:
        source = Path(folder, f"source{path.suffix.lower()}")
        target = Path(folder, "mesh.msh")
        source.write_bytes(content)
        _convert(path, source, target)
        yield target


def _content(path: Path) -> bytes:
    """Read the file and refuse what Gmsh must not see."""
    suffix = path.suffix.lower()
    if suffix not in {".geo", ".msh"}:
        raise MeshError(f"mesh file {path}: the ending {suffix!r} is not known; use .geo or .msh")
    try:
        if path.exists() and not path.is_file():
            raise MeshError(f"mesh file {path}: not a file; check `solve.mesh`")
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
        raise MeshError(
            f"mesh file {path}: empty; write a mesh with the physical curves start, end, wall, far"
        )
    if suffix == ".msh":
        if not content.startswith(b"$MeshFormat"):  # Gmsh would take anything else for a script
            raise MeshError(
                f"mesh file {path}: does not begin with $MeshFormat; save it as .msh (4.1)"
            )
        return content
    command = _FORBIDDEN.search(_TOKEN.sub(_without_comment, content))
    if command:
        raise MeshError(
            f"mesh file {path}: the command {command[0].decode()!r} is not allowed in a scene's "
            "mesh (it could touch other files); write the geometry in this one file"
        )
    return content + b"\n"  # Gmsh overlooks statements on a last line that does not end


def _without_comment(token: re.Match[bytes]) -> bytes:
    return b" " if token[0].startswith(b"/") else token[0]


def _convert(path: Path, source: Path, target: Path) -> None:
    """Have another process read the source, mesh it if it is a script, and write the target."""
    environment = {name: value for name, value in os.environ.items() if not _LAUNCHER.match(name)}
    done = subprocess.run(  # noqa: S603  (our own program)
        [sys.executable, "-P", "-c", _PROGRAM, str(source), str(target)],
        env=environment, stdin=subprocess.DEVNULL, capture_output=True, check=False,
    )  # fmt: skip
    if done.returncode < 0:
        raise MeshError(
            f"mesh file {path}: Gmsh crashed on it (signal {-done.returncode}); the file is broken "
            "or too large: write it again, as .msh (4.1)"
        )
    said = done.stderr.decode(errors="replace").strip().replace(str(source), path.name)
    if done.returncode > 0 or not target.exists():
        last = said.splitlines()[-1] if said else "no mesh"
        raise MeshError(f"mesh file {path}: Gmsh says: {last[:500]}; correct the file")
