"""The project of a user that is shown: its tests pass, its command works, its page is right."""

import ast
import inspect
import re
import subprocess
import sys
import tomllib
import typing
from pathlib import Path

import pytest
from processes import environment

import impactfem

TOP = Path(__file__).resolve().parents[2]
PROJECT = TOP / "demos" / "user_project"

# These answer with a number or an array, or what a foreign library makes of their argument.
LIKE_THEIR_ARGUMENT = {
    "Formula.apply(return)", "PiecewiseConstant.integral(return)", "PiecewiseVector.at(return)",
    "PiecewiseConstant.mean(return)", "PiecewiseVector.mean(return)", "Signal.rate(return)",
    "Signal.curvature(return)", "Signal.mean(return)",
}  # fmt: skip


def start(*arguments, **settings):
    env = environment(PYTHONPATH=str(PROJECT / "src"), MPLBACKEND="Agg")
    return subprocess.run(
        [sys.executable, "-P", *map(str, arguments)], capture_output=True, text=True, timeout=900,
        env=env, check=False, **settings,
    )  # fmt: skip


@pytest.mark.slow
def test_its_own_tests_pass():
    done = start("-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", PROJECT / "pyproject.toml",
                 PROJECT / "tests", cwd=PROJECT)  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"\d+ passed", done.stdout)


@pytest.mark.slow
def test_a_row_of_its_page_is_what_the_command_says(tmp_path):
    done = start("-m", "rebound", "--heights", "0.2", "--dampings", "5e-5", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    said = [float(x) for x in done.stdout.split("contact [ms]\n")[1].split("\n")[0].split()]
    page = (PROJECT / "README.md").read_text(encoding="utf-8")
    row = next(line for line in page.splitlines() if line.startswith("| 0.2 | 5e-5"))
    shown = [float(x) for x in row.strip("|").split("|")]
    height, damping, restitution, _, force, contact = said
    assert shown == pytest.approx([height, damping, restitution, force, contact], rel=0.01)


def test_its_page_lists_its_modules():
    page = (PROJECT / "README.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"`(?:src/rebound|tests)/(\w+)\.py`", page))
    there = {
        path.stem for folder in ("src/rebound", "tests") for path in (PROJECT / folder).glob("*.py")
    }
    assert listed <= there
    assert there - listed <= {"__init__", "__main__"}


def test_it_names_what_it_needs():
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = {re.split("[<>=]", entry)[0] for entry in project["dependencies"]}
    imported = set()
    for path in (PROJECT / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {name.name.split(".")[0] for name in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                imported.add(node.module.split(".")[0])
    foreign = imported - set(sys.stdlib_module_names) - {"rebound"}
    assert foreign <= named


def test_type_checkers_know_every_public_name():
    tree = ast.parse(Path(impactfem.__file__).read_text(encoding="utf-8"))
    known = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for part in ast.walk(node):
                if isinstance(part, ast.ImportFrom):
                    known |= {name.asname or name.name for name in part.names}
                elif isinstance(part, ast.AnnAssign):
                    known.add(ast.unparse(part.target))
    assert set(impactfem.__all__) - known == set()
    assert (Path(impactfem.__file__).parent / "py.typed").exists()


def untyped(function, name):
    """Parameters and the return value of a function that have no type, or Any."""
    found = inspect.get_annotations(function)
    expected = [
        p.name for p in inspect.signature(function).parameters.values()
        if p.name not in {"self", "cls"} and p.kind not in {p.VAR_KEYWORD, p.VAR_POSITIONAL}
    ]  # fmt: skip
    bare = {typing.Any, "Any", inspect.Parameter.empty}
    return [
        f"{name}({part})" for part in [*expected, "return"]
        if found.get(part, inspect.Parameter.empty) in bare
    ]  # fmt: skip


def test_public_functions_and_methods_say_their_types():
    faults = []
    # What extensions are written with are classes of the package, some of whose arguments are any.
    rooms = [
        value
        for name in impactfem.__all__
        if inspect.ismodule(value := getattr(impactfem, name)) and name != "extend"
    ]
    names = {(room, name) for room in (impactfem, *rooms) for name in room.__all__}
    public = {name: getattr(room, name) for room, name in names}
    for name, value in public.items():
        if inspect.isfunction(value):
            faults += untyped(value, name)
        elif inspect.isclass(value) and value.__module__.startswith("impactfem"):
            for key, member in vars(value).items():
                method = member.__func__ if isinstance(member, classmethod) else member
                method = method.fget if isinstance(method, property) else method
                if inspect.isfunction(method) and not key.startswith("_"):
                    faults += untyped(method, f"{name}.{key}")
    assert set(faults) == LIKE_THEIR_ARGUMENT
