"""One rank fails: all stop within seconds, and what happened is said once."""

import time
from itertools import product

import pytest
from processes import contents
from trouble_process import DISC, SHORT, launched

PAIR = """
title = "two discs"
duration = 50.0

[[body]]
name = "left"
kind = "solid"
model = "plane_strain"
shape = { kind = "disc", radius = 0.5, center = [-0.51, 0.0] }
mesh_size = 0.2
density = 1.0
youngs_modulus = 0.75
poisson_ratio = 0.3
velocity = [0.01, 0.0]

[[body]]
name = "right"
kind = "solid"
model = "plane_strain"
shape = { kind = "disc", radius = 0.5, center = [0.51, 0.0] }
mesh_size = 0.2
density = 1.0
youngs_modulus = 0.75
poisson_ratio = 0.3

[output]
fields = []
report = false
"""
SCENES = {"solid": DISC.replace("duration = 6.0", "duration = 600.0"), "solids": PAIR}

# In the midst of the march, on one rank only: the others wait for it in a sum or in an exchange.
SCRIPT = """
import os, signal, sys, time
from impactfem.errors import OutputError
from impactfem.fem import MPI
import impactfem.cli
from impactfem.marching.solids import SolidMarch
usual = SolidMarch._advance
def failing(self):
    if self.layer == 3 and MPI.COMM_WORLD.rank == 1:
        print(f"failed at {{time.time()}}", file=sys.stderr, flush=True)
        {action}
    return usual(self)
SolidMarch._advance = failing
sys.exit(impactfem.cli.main(["run", "scene.toml", "--out", "o", "--quiet"]))
"""
ACTIONS = {
    "defect": ("raise ZeroDivisionError('by chance')", "ZeroDivisionError: by chance"),
    "known error": ("raise OutputError('no answer')", "impactfem: rank 1 alone: no answer"),
    "kill": ("os.kill(os.getpid(), signal.SIGKILL)", "failed at"),
}
SLOW = pytest.mark.slow  # ranks that end by themselves are given seconds


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "action"),
    [
        pytest.param(*case, marks=() if case in {("solid", "defect"), ("solids", "kill")} else SLOW)
        for case in product(SCENES, ACTIONS)
    ],
)
def test_one_rank_fails(tmp_path, scene, action):
    code, message = ACTIONS[action]
    (tmp_path / "scene.toml").write_text(SCENES[scene], encoding="utf-8")
    (tmp_path / "run.py").write_text(SCRIPT.format(action=code))
    done, err = launched(tmp_path, 2, "run.py", timeout=240)
    ended = time.time()
    assert done != 0
    failed = float(err.partition("failed at ")[2].split()[0])
    assert ended - failed < 120  # seconds it takes on an idle machine: less than 7
    assert err.count(message) == 1
    assert err.count("Traceback") <= (action == "defect")
    left = set(contents(tmp_path)) - {"scene.toml", "run.py"}
    assert not any(name.endswith(("summary.json", "history.csv")) for name in left)


@pytest.mark.slow
def test_a_folder_in_use_is_refused_on_all_ranks(tmp_path):
    from impactfem.result.claim import Claim

    claim = Claim(tmp_path / "o")
    claim.take()
    try:
        words = ("-m", "impactfem", *SHORT, "o")
        done, err = launched(tmp_path, 2, *words)
    finally:
        claim.release()
    assert done == 1
    assert err.count("another run writes into this folder") == 1
    assert contents(tmp_path) == {}
