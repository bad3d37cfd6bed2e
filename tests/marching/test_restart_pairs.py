"""Several solids, and solids that rub, stopped and continued: the same to the last bit."""

import numpy as np
import pytest
from moving_scenes import METHODS, differences, pair, stopping

import impactfem
from impactfem.marching.checkpoint import FILE

solve = impactfem.solve


CASES = [
    *((method, "updated", 0.4) for method in METHODS),
    ("explicit", "fixed", 0.0), ("conserving", "fixed", 0.4), ("massless", "updated", 0.0),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("method", "normals", "friction"), CASES)
def test_a_continued_run_equals_the_whole_one(method, normals, friction, tmp_path, monkeypatch):
    case = pair(method, normals, friction)
    whole = solve(case)
    layers = whole.summary["num_steps"]
    assert whole.summary["contact"]["max_force"] > 0.0
    with stopping(monkeypatch, int(0.45 * layers)):
        solve(case, checkpoints=tmp_path)
    with stopping(monkeypatch, int(0.8 * layers)):
        solve(case, checkpoints=tmp_path, restart=tmp_path)
    again = solve(case, checkpoints=tmp_path, restart=tmp_path)
    assert differences(whole, again) == {}
    assert again.summary["energy"] == whole.summary["energy"]
    assert again.summary["bodies"] == whole.summary["bodies"]
    for name in ("friction_work", "contact_nodes", "mean_iterations_in_contact", "overlap"):
        assert again.summary["details"][name] == whole.summary["details"][name]


def test_a_checkpoint_has_what_every_body_needs(tmp_path, monkeypatch):
    case = pair("massless", "updated", 0.4)
    with stopping(monkeypatch, 20):
        solve(case, checkpoints=tmp_path)
    with np.load(tmp_path / FILE) as file:
        names = set(file.files)
        nodes = len(file["node.displacement"])
    wanted = {"node.velocity", "march.tangential", "march.place", "march.met", "march.surface"}
    assert wanted <= names
    found = solve(case, restart=tmp_path)
    assert nodes == found.summary["details"]["nodes"]


def test_snes_vi_finds_the_same_forces_between_bodies():
    case = pair("conserving", "fixed", 0.0)
    one, other = solve(case), solve(case, active_set="snes_vi")
    for name in ("contact_force", "one.x", "two.y", "total_energy"):
        a, b = (result.history[name].values for result in (one, other))
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-9 * np.abs(a).max())
