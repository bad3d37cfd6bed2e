"""DOLFINx, h5py and impactfem in any order: each brings a library of its own for the same files."""

import subprocess
import sys

import pytest

pytest.importorskip("dolfinx")

SOLVE = """
import sys
import impactfem
from impactfem import Result, Scene
from impactfem.shipped import shipped_scenes
scene = Scene.from_toml(shipped_scenes()["bar_impact"])
result = impactfem.solve(scene, method="monolithic", elements=4)
folder = result.save(sys.argv[1], pictures=False)
assert (Result.load(folder).fields.displacement == result.fields.displacement).all()
import dolfinx.io
import h5py
from mpi4py import MPI
mesh = dolfinx.mesh.create_unit_square(MPI.COMM_WORLD, 2, 2)
with dolfinx.io.XDMFFile(MPI.COMM_WORLD, sys.argv[1] + "/mesh.xdmf", "w") as file:
    file.write_mesh(mesh)
with h5py.File(sys.argv[1] + "/mesh.h5") as file:
    assert file["Mesh"]
"""


@pytest.mark.parametrize(
    "first",
    [
        "from mpi4py import MPI\nfrom dolfinx.fem.petsc import LinearProblem",
        pytest.param(
            "import impactfem\nfrom mpi4py import MPI\nimport dolfinx.io",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "import h5py\nfrom mpi4py import MPI\nimport dolfinx.io",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "import gmsh\nfrom mpi4py import MPI\nimport impactfem.fem.loading",
            marks=pytest.mark.slow,
        ),
    ],
)  # fmt: skip
def test_any_order_of_imports(tmp_path, first):
    done = subprocess.run(
        [sys.executable, "-c", first + SOLVE, str(tmp_path / "o")],
        capture_output=True, text=True, timeout=480, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
