"""Public names: where they are, what they load, what their types say."""

import dataclasses
import importlib
import subprocess
import sys
import traceback
import typing

import pytest

import impactfem
from impactfem.result.summary import Summary
from impactfem.scene.settings import Settings, Solve

ROOMS = (
    "bodies",
    "errors",
    "exact",
    "extend",
    "inverse",
    "obstacles",
    "shapes",
    "studies",
    "systems",
)


def test_every_name_is_there():
    for name in impactfem.__all__:
        assert getattr(impactfem, name) is not None
    assert dir(impactfem) == impactfem.__all__
    assert set(ROOMS) < set(impactfem.__all__)
    assert len(impactfem.__all__) <= 43
    for room in ROOMS:
        module = importlib.import_module(f"impactfem.{room}")
        for name in getattr(module, "__all__", ()):
            assert getattr(module, name) is not None


def test_everything_is_imported_without_dolfinx():
    code = (
        "import sys\n"
        "for name in ('dolfinx', 'petsc4py', 'mpi4py', 'gmsh', 'basix', 'ufl', 'ffcx'):\n"
        "    sys.modules[name] = None\n"
        "from impactfem import *\n"
        "from impactfem import systems\n"
        "print(solve.__name__, Scene.__name__, studies.__name__, systems.LinearSystem)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("solve Scene impactfem.studies")


def test_a_name_that_has_moved_says_where_it_is():
    with pytest.warns(DeprecationWarning, match=r"moved to impactfem\.obstacles\.RigidSphere"):
        assert impactfem.RigidSphere is impactfem.obstacles.RigidSphere
    assert "RigidSphere" not in vars(impactfem)
    moved = {name: room for name, room in impactfem._MOVED.items() if name not in ROOMS}
    for name, room in moved.items():
        with pytest.warns(DeprecationWarning, match="has moved"):
            assert getattr(impactfem, name) is getattr(getattr(impactfem, room), name)
    with pytest.raises(AttributeError, match="no attribute 'Kugel'"):
        impactfem.Kugel  # noqa: B018


def test_the_settings_of_solve_are_the_keys_of_its_table():
    types = typing.get_type_hints(Solve)
    assert typing.get_type_hints(Settings) == {
        f.name: types[f.name] for f in dataclasses.fields(Solve)
    }


def test_the_type_of_the_summary_names_its_keys():
    scene = impactfem.Scene(
        title="Bar",
        duration=2.0,
        bodies=[impactfem.Bar(length=1.0, density=1.0, youngs_modulus=1.0, velocity=-1.0, gap=0.5)],
        obstacles=[impactfem.Wall()],
    )
    summary = impactfem.solve(scene, method="exact").summary
    hints = typing.get_type_hints(Summary)
    assert set(summary) == set(hints) - {"files"}
    for name in ("active_set", "energy", "contact", "verdict"):
        assert set(summary[name]) <= set(typing.get_type_hints(hints[name]))
    of_errors = typing.get_args(hints["error"])[0]
    assert set(summary["error"]) == set(typing.get_type_hints(of_errors))


def test_a_notebook_shows_an_error_in_three_lines():
    with pytest.raises(impactfem.SceneError) as met:
        impactfem.Bar(length=-1.0)
    lines = met.value._render_traceback_()
    assert len(traceback.format_exception(met.value)) > 3
    assert lines[0] == "SceneError:"
    assert "length" in lines[1]
    assert lines[2].endswith("impactfem.Bar(length=-1.0)")
