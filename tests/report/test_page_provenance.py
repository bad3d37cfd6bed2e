import json
import os
import re
import shlex
import subprocess
import sys
from datetime import datetime

import pytest

from impactfem import provenance


def test_versions_are_those_of_loaded_modules_and_nothing_is_loaded_for_them():
    script = (
        "import sys; from impactfem.provenance import run_record; before = set(sys.modules); "
        "record = run_record(); new = set(sys.modules) - before; "
        "heavy = {'numpy', 'numba', 'dolfinx', 'petsc4py', 'mpi4py', 'gmsh'}; "
        "assert not heavy & new, heavy & new; "
        "assert ('NumPy' in record['versions']) == ('numpy' in sys.modules), record"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=240)
    import numpy as np

    assert provenance.versions()["NumPy"] == np.__version__


def test_date_has_an_offset_and_the_command_can_be_pasted():
    words = ["impactfem", "run", "my scene.toml", "--set", 'solve.method="dg"']
    record = provenance.run_record(provenance.shell_command(words))
    assert datetime.fromisoformat(record["date"]).tzinfo is not None
    assert shlex.split(record["command"]) == words
    assert re.match(r"\d+\.\d+\.\d+", record["versions"]["Python"])
    assert record["machine"]["cores"] >= 1


@pytest.mark.slow
def test_the_command_noted_by_a_run_repeats_it(tmp_path):
    """With a folder whose name needs quotes, and a setting with quotes of its own."""
    words = ["impactfem", "run", "bar_impact", "--set", 'solve.method="exact"', "--quiet"]
    words += ["--set", "output.fields=[]", "--set", "output.report=false"]
    environment = os.environ | {"PATH": f"{os.path.dirname(sys.executable)}:{os.environ['PATH']}"}  # noqa: PTH120

    def run(command, folder):
        subprocess.run(
            command,
            check=True,
            timeout=480,
            cwd=tmp_path,
            env=environment,
            shell=isinstance(command, str),
        )
        summary = json.loads((tmp_path / folder / "summary.json").read_text())
        return (tmp_path / folder / "history.csv").read_text(), summary["run"]["command"]

    history, command = run([*words, "--out", "my results"], "my results")
    assert command.startswith("impactfem run bar_impact --set 'solve.method=\"exact\"' --set ")
    assert command.endswith(" --out 'my results'")
    (tmp_path / "my results/history.csv").unlink()
    assert run(command, "my results") == (history, command)
