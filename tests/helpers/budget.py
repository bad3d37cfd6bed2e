"""Measures of the package's structure, that `.ci/budget.toml` bounds.

python tests/helpers/budget.py        prints what is measured now, as that file has it
"""

import ast
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import impactfem
from impactfem.methods import METHODS
from impactfem.scene.content import BODIES
from impactfem.scene.obstacles import OBSTACLES

ROOT = Path(impactfem.__file__).parent
KINDS = {each.__name__ for each in (*BODIES.values(), *OBSTACLES.values())}
NAMES = {*BODIES, *OBSTACLES, *METHODS, "leapfrog", "midpoint"}
FAMILIES = {"marches", "solver"}
NO_KINDS = {"dtype", "event"}
"""What has a `kind` that is none of a body, obstacle, method or what these consist of: the type of
an array's numbers, and whether a contact begins or ends."""
CHECKS = ("scene/*checks.py", "scene/mixed.py")
"""Where combinations of what a scene holds are refused."""


@cache
def trees() -> dict[str, ast.Module]:
    """Each file of the package by its path in it."""
    paths = sorted(ROOT.rglob("*.py"))
    return {str(p.relative_to(ROOT)): ast.parse(p.read_text(encoding="utf-8")) for p in paths}


def nodes[T: ast.AST](kind: type[T]) -> Iterator[tuple[str, T]]:
    """All nodes of a kind with the paths of their files."""
    for path, tree in trees().items():
        yield from ((path, node) for node in ast.walk(tree) if isinstance(node, kind))


def lines() -> dict[str, int]:
    """Lines of Python by folder; `.` holds the files at the top."""
    found: dict[str, int] = {}
    for path in ROOT.rglob("*.py"):
        folder = path.relative_to(ROOT).parts[0] if path.parent != ROOT else "."
        found[folder] = found.get(folder, 0) + path.read_text(encoding="utf-8").count("\n")
    return dict(sorted(found.items()))


def protocols() -> int:
    """Classes that are protocols."""
    return sum(any("Protocol" in ast.unparse(b) for b in c.bases) for _, c in nodes(ast.ClassDef))


def refusals() -> int:
    """Places that refuse a combination of what a scene holds."""
    return sum(any(Path(path).match(c) for c in CHECKS) for path, _ in nodes(ast.Raise))


@cache
def _classes() -> dict[str, ast.ClassDef]:
    return {node.name: node for _, node in nodes(ast.ClassDef)}


def _parents(name: str) -> list[str]:
    bases = _classes()[name].bases if name in _classes() else []
    found = [ast.unparse(base).partition("[")[0].rpartition(".")[2] for base in bases]
    return [parent for parent in found if parent in _classes() and parent != name]


def _depth(name: str) -> int:
    return 1 + max(map(_depth, _parents(name)), default=0)


def inheritance() -> int:
    """Longest chain of classes of ours that inherit."""
    return max(map(_depth, _classes()))


def _members(name: str) -> set[str]:
    found = set().union(*map(_members, _parents(name)))
    for part in _classes()[name].body:
        if isinstance(part, ast.FunctionDef):
            found.add(part.name)
        elif isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name):
            found.add(part.target.id)
    return {each for each in found if not each.startswith("_")}


def members() -> int:
    """Public members of the class that has most, inherited ones of ours included."""
    return max(len(_members(name)) for name in _classes())


def flags() -> int:
    """Reads, outside the scene, of the capabilities that its classes declare."""
    declared = set()
    for path, node in nodes(ast.ClassDef):
        if path.startswith("scene/"):
            for part in node.body:
                if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name):
                    if ast.unparse(part.annotation) == "ClassVar[bool]":
                        declared.add(part.target.id)
                elif isinstance(part, ast.FunctionDef) and part.returns is not None:
                    marks = {ast.unparse(mark) for mark in part.decorator_list}
                    if ast.unparse(part.returns) == "bool" and "property" in marks:
                        declared.add(part.name)
    reads = [
        p for p, n in nodes(ast.Attribute) if n.attr in declared and isinstance(n.ctx, ast.Load)
    ]
    return sum(not path.startswith("scene/") for path in reads)


def _names(node: ast.AST) -> set[str]:
    return {getattr(part, "id", getattr(part, "attr", "")) for part in ast.walk(node)}


def _is_kind(side: ast.AST) -> bool:
    if not isinstance(side, ast.Attribute) or side.attr != "kind":
        return False
    return getattr(side.value, "id", getattr(side.value, "attr", "")) not in NO_KINDS


def asks(node: ast.AST) -> str:
    """Which kind of thing a node asks for; empty if for none."""
    what = ""
    match node:
        case ast.Call(func=ast.Name(id="isinstance"), args=[_, classes]):
            what = "class" if KINDS & _names(classes) else ""
        case ast.MatchClass():
            what = "class" if KINDS & _names(node.cls) else ""
        case ast.Compare():
            sides = [node.left, *node.comparators]
            texts = {p.value for s in sides for p in ast.walk(s) if isinstance(p, ast.Constant)}
            if any(map(_is_kind, sides)):
                what = "kind"
            elif NAMES & {text for text in texts if isinstance(text, str)}:
                what = "name"
        case ast.Attribute(attr=name) if name in FAMILIES:
            what = "family"
        case ast.Subscript(value=ast.Attribute(attr="bodies"), slice=ast.Constant()):
            what = "first_body"
    return what


def dispatch() -> dict[str, list[str]]:
    """Places that ask which kind they have before them, by what they ask for."""
    found: dict[str, list[str]] = {
        what: [] for what in ("class", "family", "first_body", "kind", "name")
    }
    for path, node in nodes(ast.AST):
        if what := asks(node):
            found[what].append(f"{path}:{getattr(node, 'lineno', '?')}")
    return found


def traced(solve: Callable[[], object]) -> tuple[int, int]:
    """Files of the package that a call enters, and calls in these, of Python."""
    files: set[str] = set()
    calls = 0

    def look(frame: object, event: str, _: object) -> None:
        nonlocal calls
        code = frame.f_code  # type: ignore[attr-defined]
        if event == "call" and code.co_filename.startswith(str(ROOT)):
            calls += 1
            files.add(code.co_filename)

    sys.setprofile(look)
    try:
        solve()
    finally:
        sys.setprofile(None)
    return len(files), calls


def structure() -> dict[str, object]:
    """All that is read from the code."""
    return {
        "protocols": protocols(),
        "refusals": refusals(),
        "inheritance": inheritance(),
        "members": members(),
        "flags": flags(),
        "lines": lines(),
        "dispatch": {what: len(places) for what, places in dispatch().items()},
    }


def main() -> None:
    """Print the measures as TOML."""
    found = structure()
    for name, value in found.items():
        if not isinstance(value, dict):
            print(f"{name} = {value}")
    for name, value in found.items():
        if isinstance(value, dict):
            print(f"\n[{name}]")
            for key, number in value.items():
                print(f"{key if key != '.' else chr(34) + '.' + chr(34)} = {number}")


if __name__ == "__main__":
    main()
