"""Commands load only what they need and say once what they compile: no clock is asked."""

import json
import os
import re
import subprocess
import sys

import pytest

from impactfem.quick import without

HEAVY = (
    "dolfinx",
    "h5py",
    "matplotlib",
    "numba",
    "pandas",
    "petsc4py",
    "pyvista",
    "xarray",
)

LOADED = """
import contextlib, io, json, sys
from impactfem.cli import main
with contextlib.redirect_stdout(io.StringIO()):
    code = main(sys.argv[1:])
print(json.dumps([code, sorted({name.partition(".")[0] for name in sys.modules})]))
"""


def python(code: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
        env=os.environ | environment,
    )


def loaded(*arguments: str) -> set[str]:
    """Top-level modules that a command has loaded."""
    code, names = json.loads(python(LOADED, *arguments).stdout)
    assert code == 0
    return set(names)


@pytest.mark.parametrize("command", [["--help"], ["run", "--help"]])
def test_help_loads_not_even_numpy(command):
    assert not loaded(*command) & {*HEAVY, "numpy", "scipy", "tqdm"}


@pytest.mark.parametrize(
    "command",
    [
        ["plan", "bar_impact"],
        ["plan", "bar_impact", "--set", 'solve.method="newmark"'],
        ["validate", "bar_impact"],
        ["scenes"],
        ["methods"],
    ],
    ids=" ".join,
)
def test_a_plan_of_a_bar_loads_arrays_only(command):
    names = loaded(*command)
    assert not names & {*HEAVY, "scipy"}
    assert "impactfem" in names  # otherwise nothing was looked at


@pytest.mark.parametrize("scene", ["cradle", "bouncing_ball", "oscillator", "dropped_beam"])
def test_a_plan_without_meshes_needs_no_finite_elements_and_no_files(scene):
    assert not loaded("plan", scene) & set(HEAVY)


def test_a_plan_of_a_solid_needs_no_pictures():
    names = loaded("plan", "dropped_disc")
    assert not names & {"matplotlib", "pandas", "pyvista", "xarray"}
    assert "dolfinx" in names  # its mesh is made


def test_importing_the_package_loads_nothing_else():
    done = python("import sys, impactfem; print(*sys.modules)")
    assert not set(done.stdout.split()) & {*HEAVY, "numpy", "scipy", "importlib.metadata"}


@pytest.mark.slow
def test_a_run_loads_no_data_frames_and_compilers_that_it_does_not_use(tmp_path):
    """xarray, with pandas behind it, is there for who asks for a data set."""
    names = loaded("run", "bar_impact", "--quiet", "--out", str(tmp_path / "result"))
    assert not names & {"numba", "pandas", "scipy", "tqdm", "xarray"}
    assert {"dolfinx", "matplotlib"} <= names


@pytest.mark.slow
def test_a_march_of_a_bar_loads_no_finite_elements(tmp_path):
    quiet = ("--quiet", "--set", "output.report=false", "--set", "output.pictures=false")
    names = loaded("run", "doyen_impact", "--out", str(tmp_path / "result"), *quiet)
    assert "numba" in names
    assert not names & {"dolfinx", "petsc4py"}


def test_a_library_is_hidden_only_meanwhile():
    with pytest.raises(ModuleNotFoundError), without("this"):
        import this  # noqa: F401
    assert "this" not in sys.modules
    with without("json"):
        import json as again
    assert again is json


def test_nothing_is_looked_through_at_the_end():
    code = (
        "import atexit, gc; atexit.register(lambda: print(gc.get_freeze_count() > 1000));"
        "from impactfem.cli import main; main(['scenes'])"
    )
    assert python(code).stdout.endswith("True\n")


def test_setters_work_without_signatures():
    code = (
        "from impactfem.quick import spare_signatures; spare_signatures();"
        "from matplotlib.lines import Line2D; line = Line2D([0], [0]); line.set(linewidth=3.0);"
        "print(line.get_linewidth(), 'antialiased' in (Line2D.set.__doc__ or ''))"
    )
    assert python(code).stdout == "3.0 False\n"


RUN = "import sys; from impactfem.cli import main; sys.exit(main(sys.argv[1:]))"


@pytest.mark.slow
def test_compilation_is_announced_once(tmp_path):
    caches = {"XDG_CACHE_HOME": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "numba")}
    setting = ["--set", 'solve.method="dg"', "--set", "solve.fitted=true"]
    run = ["run", "step_load", "--out", str(tmp_path / "result"), *setting]
    first, second = (python(RUN, *run, **caches) for _ in range(2))
    assert first.returncode == second.returncode == 0, first.stderr + second.stderr
    for what, folder in (("finite-element forms", "fenics"), ("time loops", "numba")):
        assert f"compiling {what} (once, kept in {tmp_path / folder}) ...\n" in first.stderr
        assert any((tmp_path / folder).rglob("*"))
    assert first.stderr.count("compiling") == 2
    assert "compiling" not in second.stderr
    took = [re.search(r"cost +([\d.]+) s(.*)", done.stdout) for done in (first, second)]
    assert float(re.search(r"([\d.]+) s to compile code", took[0][2])[1]) > 1.0
    assert "compile" not in took[1][2]
    # What is compiled is no part of the cost: it took several times as long as the solution.
    assert float(took[0][1]) < 3.0 * float(took[1][1]) + 0.5


@pytest.mark.slow
def test_quiet_says_nothing_of_compilation(tmp_path):
    caches = {"XDG_CACHE_HOME": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "numba")}
    run = ["run", "bar_impact", "--quiet", "--out", str(tmp_path / "result")]
    done = python(RUN, *run, **caches)
    assert done.stderr == ""
    assert any((tmp_path / "fenics").glob("*.so"))
