"""Starter scenes: commented files of each kind, written for a user to change."""

import re
import tomllib
from argparse import Namespace
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path

from impactfem.errors import OutputError, SceneError
from impactfem.processes import on_root
from impactfem.report.table import table
from impactfem.shipped import shipped_scenes

SCHEMA_NAME = "impactfem.schema.json"
"""Name of the schema beside a user's scenes."""

_SCHEMA_TITLE = '"title": "Scene of impactfem"'


def starters() -> dict[str, Path]:
    """Paths of the starter scenes by kind."""
    folder = Path(str(files("impactfem") / "starters"))
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def starter_titles() -> list[tuple[str, str]]:
    """Kinds and what they hold, the first line of each file."""
    return [
        (kind, path.read_text(encoding="utf-8").partition("\n")[0].lstrip("# "))
        for kind, path in starters().items()
    ]


def schema_text() -> str:
    """The JSON schema of scenes as it is shipped."""
    return (files("impactfem") / "scene" / "scene.schema.json").read_text(encoding="utf-8")


def new(given: Namespace, say: Callable[[str], None]) -> None:
    """Write a scene as ``impactfem new`` asks for it, or list the kinds.

    Args:
        given: ``kind``, ``out`` and ``schema`` of the command line.
        say: Called with what to print.

    Raises:
        SceneError, OutputError: See `write_starter`.
    """
    if given.kind is None:
        say(table(starter_titles()))
        return
    made: list[Path] = []
    on_root(lambda: made.extend(write_starter(given.kind, given.out, given.schema)))
    if made:
        say(f"wrote {', '.join(map(str, made))}; next: impactfem plan {made[0]}")


def schema(given: Namespace, say: Callable[[str], None]) -> None:
    """Print the schema as the code has it, or write it to the file ``given.out``.

    Raises:
        OutputError: It cannot be written.
    """
    from impactfem.scene.json_schema import json_schema_text  # noqa: PLC0415  (fast `new`)

    text = json_schema_text()
    if given.out is None:
        say(text.rstrip())
    else:
        on_root(lambda: _write(given.out, text))


def write_starter(kind: str, out: Path | None = None, schema: str | None = None) -> list[Path]:
    """Write a starter scene, or a copy of a shipped scene, with what it needs beside it.

    Args:
        kind: A kind of `starters`, or the name of a shipped scene.
        out: File to write, or a folder for it; ``KIND.toml`` if None.
        schema: Path or URL of the schema for editors, the first line of the scene; if None, the
            schema is written beside the scene.

    Returns:
        Paths written, the scene first.

    Raises:
        SceneError: There is no such kind, or a file is there already.
        OutputError: A file cannot be written.
    """
    source = _source(kind)
    path = Path(f"{kind}.toml") if out is None else out / f"{kind}.toml" if out.is_dir() else out
    if path.suffix != ".toml":
        raise SceneError(
            f"{path}: the name of a scene file ends in .toml; give such a name (--out)"
        )
    line = f"#:schema {schema or f'./{SCHEMA_NAME}'}\n"
    made = {path: line + source.read_text(encoding="utf-8")}
    for other in _meshes(source):
        made[path.parent / other.name] = other.read_text(encoding="utf-8")
    for taken in made:
        if taken.exists():
            raise SceneError(f"{taken}: is there already; give another name (--out) or remove it")
    if schema is None:
        beside = path.parent / SCHEMA_NAME
        if not beside.exists() or _SCHEMA_TITLE in _start(beside):  # one of another version
            made[beside] = schema_text()
    for target, text in made.items():
        _write(target, text)
    return list(made)


def _write(path: Path, text: str) -> None:
    """Write a text file.

    Raises:
        OutputError: It cannot be written.
    """
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(
            f"{path}: cannot be written ({error.strerror}); choose another file (--out)"
        ) from None


def _source(kind: str) -> Path:
    known = starters() | shipped_scenes()
    if kind in known:
        return known[kind]
    near = get_close_matches(kind.lower(), known, 1)
    meant = f', did you mean "{near[0]}"?' if near else ";"
    raise SceneError(
        f'new: there is no kind "{kind}"{meant} kinds are {", ".join(starters())}, and the names '
        "that `impactfem scenes` lists"
    )


def _meshes(source: Path) -> Sequence[Path]:
    """Mesh files, heights and mechanisms beside a starter that it names."""
    data = tomllib.loads(source.read_text(encoding="utf-8"))
    keys, entries = ("mesh", "heights", "file"), [*data["body"], *data.get("obstacle", ())]
    meshes = [entry[key] for entry in entries for key in keys if key in entry]
    return [source.parent / name for name in dict.fromkeys(meshes)]


def _start(path: Path) -> str:
    """The first characters of a file, whatever they are."""
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            return re.sub(r"\s+", " ", file.read(500))
    except OSError:
        return ""
