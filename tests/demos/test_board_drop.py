"""The board of the demo feels its base as one that is at rest feels loads of inertia."""

from pathlib import Path

import numpy as np
import pytest

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "board_drop"


def test_a_shaken_base_is_a_base_at_rest_under_loads_of_inertia():
    """Relative to the screws: the same motion under -rho t a(t) on the board, -m a(t) outside."""
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    coarse = {"output.fields": [], "duration": 0.002, "body.board.mesh_size": 0.007}
    moved = impactfem.solve(scene.with_settings(coarse), estimate=False)
    table = moved.scene.to_dict()
    push = "where(t<0.0005, 300*9.81*sin(pi*t/0.0005), 0)"
    board, package = table["body"]
    board["pressures"] = [{"face": "top", "value": f"1900*0.001*{push}"}]
    package["force"] = ["0", "0", f"-0.001*{push}"]
    for joint in table["joint"]:
        joint.pop("motion", None)
    still = impactfem.solve(impactfem.Scene.from_dict(table), estimate=False).history
    base = [moved.history["corner.uz"].values, still["corner.uz"].values]
    for name in ("middle.uz", "package.z"):
        one = moved.history[name].values - base[0]
        two = still[name].values - base[1]
        assert np.abs(one - two).max() < 5e-3 * np.ptp(two)
    assert np.ptp(moved.history["total_energy"].values) < np.ptp(still["kinetic_energy"].values)
    peak = moved.spectrum("corner.az", q=10.0)
    # A vertex under a screw, whose region has the base's motion in the mean.
    assert np.abs(moved.history["corner.az"].values).max() == pytest.approx(300 * 9.81, rel=0.1)
    # A half sine shocks what is much faster than it by its own height.
    assert peak.shock[-1] == pytest.approx(300 * 9.81, rel=0.2)
