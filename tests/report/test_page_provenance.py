import re
import shlex
import subprocess
import sys
from datetime import datetime

from impactfem import provenance


def test_versions_are_those_of_loaded_modules_and_nothing_is_loaded_for_them():
    script = (
        "import sys; from impactfem.provenance import run_record; before = set(sys.modules); "
        "record = run_record(); new = set(sys.modules) - before; "
        "heavy = {'numpy', 'numba', 'dolfinx', 'petsc4py', 'mpi4py', 'gmsh'}; "
        "assert not heavy & new, heavy & new; "
        "assert ('NumPy' in record['versions']) == ('numpy' in sys.modules), record"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)
    import numpy as np

    assert provenance.versions()["NumPy"] == np.__version__


def test_date_has_an_offset_and_the_command_can_be_pasted():
    words = ["impactfem", "run", "my scene.toml", "--set", 'solve.method="dg"']
    record = provenance.run_record(provenance.shell_command(words))
    assert datetime.fromisoformat(record["date"]).tzinfo is not None
    assert shlex.split(record["command"]) == words
    assert re.match(r"\d+\.\d+\.\d+", record["versions"]["Python"])
    assert record["machine"]["cores"] >= 1
