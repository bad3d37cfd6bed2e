"""A march that fails in the midst keeps what was computed, and says why it ended."""

import numpy as np
import pytest

from impactfem import Scene, solve
from impactfem.errors import ConvergenceError
from impactfem.marching import solids


@pytest.fixture
def disc():
    return Scene.from_dict(
        {
            "title": "disc",
            "duration": 2.0,
            "body": [
                {
                    "kind": "solid", "model": "plane_strain", "density": 1.0,
                    "youngs_modulus": 1.0, "poisson_ratio": 0.3, "mesh_size": 0.2,
                    "strain": "small",
                    "shape": {"kind": "disc", "radius": 0.5, "center": [0.0, 0.51]},
                    "velocity": [0.0, -0.1],
                }
            ],
            "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                          "normal": [0.0, 1.0]}],
        }
    )  # fmt: skip


def _failing_after(calls, monkeypatch):
    solve_layer, count = solids.solve_layer, iter(range(1000))

    def fail(*arguments):
        if next(count) >= calls:
            raise ConvergenceError("contact: the test lets this layer fail; remedy: none")
        return solve_layer(*arguments)

    monkeypatch.setattr(solids, "solve_layer", fail)


@pytest.mark.slow
def test_what_was_computed_is_kept_and_marked(disc, monkeypatch, tmp_path):
    whole = solve(disc, estimate=False)
    _failing_after(5, monkeypatch)
    part = solve(disc, estimate=True)  # which then is not made
    assert part.summary["status"] == "not_converged"
    assert "lets this layer fail" in part.summary["active_set"]["message"]
    rows = part.history.sizes["time"]
    assert 5 < rows < whole.history.sizes["time"]
    for name in ("time", "gap", "total_energy", "solid.y"):
        assert np.array_equal(part.history[name], whole.history[name][:rows])
    part.save(tmp_path / "out")
    assert (tmp_path / "out" / "body.png").exists()


def test_a_failure_in_the_first_layer_is_an_error(disc, monkeypatch):
    _failing_after(0, monkeypatch)
    touching = disc.with_settings({"body.0.shape.center": [0.0, 0.5]})
    with pytest.raises(ConvergenceError, match="lets this layer fail"):
        solve(touching, estimate=False)
