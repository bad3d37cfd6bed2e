"""Plates that start in equilibrium."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene, SceneError

STEEL = {"thickness": 0.01, "density": 100.0, "youngs_modulus": 12.0 * 0.91e6, "poisson_ratio": 0.3}
"""With D = rho t = 1."""
SIDES = ("left", "right", "bottom", "top")


def scene(duration=0.05, dt=1e-3, pressure=0.0, held=SIDES, obstacles=(), more=(), **keys):
    plate = {
        "kind": "plate", "name": "plate", "mesh_size": 0.1,
        "outline": {"kind": "rectangle", "size": [1.0, 1.0]},
        "supports": [{"edge": edge, "kind": "clamped"} for edge in held],
        "pressures": [{"face": "top", "value": pressure}],
    } | STEEL  # fmt: skip
    return Scene.from_dict(
        {"title": "rest", "start": "static", "duration": duration, "gravity": [0.0, 0.0, -10.0],
         "body": [plate, *more], "obstacle": list(obstacles), "output": {"fields": []},
         "probe": [{"name": "middle", "body": "plate", "point": [0.0, 0.0, 0.0]}],
         "solve": {"estimate": False, "dt": dt}} | keys
    )  # fmt: skip


def stop(low):
    """A flat stop below the middle of the plate, whose bottom face is at -0.005."""
    return {"kind": "half_space", "name": "stop", "point": [0.0, 0.0, -0.005 - low],
            "normal": [0.0, 0.0, 1.0]}  # fmt: skip


def test_a_plate_at_rest_stays_there():
    """By its weight and a pressure: w = .00126532 q L^4 / D amid it."""
    history = impactfem.solve(scene(pressure=5.0)).history
    w = history["middle.uz"].values
    assert w[0] == pytest.approx(-0.00126532 * 15.0, rel=0.03)
    assert np.ptp(w) < 1e-12 * abs(w[0])
    assert np.abs(history["kinetic_energy"].values).max() < 1e-20
    energy = history["total_energy"].values
    assert np.ptp(energy) < 1e-12 * history["elastic_energy"].values[0]
    height = history["plate.z"].values[0]
    assert height < -0.003
    assert history["potential_energy"].values[0] == pytest.approx(10.0 * height, rel=1e-12)


def test_a_plate_rests_on_a_stop_and_leaves_it():
    """Contact forces balance what bends it; when the load goes it swings up."""
    lies = scene(pressure="40*where(t<0.02,1,0)", obstacles=[stop(0.01)], dt=2.5e-4)
    history = impactfem.solve(lies).history
    force, w = history["contact_force"].values, history["middle.uz"].values
    before = history["time"].values < 0.019
    assert force[1:][before[1:]].min() > 1.0
    assert np.ptp(force[1:][before[1:]]) < 1e-9 * force[1]
    assert np.ptp(w[before]) < 1e-12
    assert force[-1] == 0.0
    assert w[-1] > w[0] + 1e-3


def test_a_plate_rests_on_a_layer():
    """Far from its edges by q = k w: bending fades over (4 D / k)^(1/4) = 0.08."""
    law = {"between": ["plate", "stop"], "stiffness": 1e5}
    history = impactfem.solve(
        scene(pressure=5.0, obstacles=[stop(0.0)], contact=[law], duration=0.01)
    ).history
    w = history["middle.uz"].values
    assert w[0] == pytest.approx(-15.0 / 1e5, rel=0.02)
    assert np.ptp(w) < 1e-9 * abs(w[0])


def test_a_pull_that_goes_by_the_gap():
    """The equilibrium short of pull-in is the one that a damped plate creeps to."""
    pull = "-0.01/(0.02+gap)**2"
    still = scene(pressure=pull, obstacles=[stop(0.03)]).to_dict()
    still["body"][0]["pressures"][0]["face"] = "bottom"
    creeping = dict(still, start="given", duration=3.0, solve={"estimate": False, "dt": 0.01})
    creeping["body"] = [still["body"][0] | {"rayleigh_mass": 40.0}]
    one, two = (
        impactfem.solve(Scene.from_dict(each)).history["middle.uz"].values
        for each in (still, creeping)
    )
    assert one[0] < -0.015
    assert np.ptp(one) < 1e-9
    assert one[0] == pytest.approx(two[-1], rel=1e-4)


def test_a_plate_rests_on_a_solid():
    base = {
        "kind": "solid", "name": "base", "model": "3d", "strain": "small", "mesh_size": 0.1,
        "shape": {"kind": "block", "size": [0.3, 0.3, 0.2], "corner": [-0.15, -0.15, -0.215]},
        "density": 1.0, "youngs_modulus": 1e5, "poisson_ratio": 0.3, "contact_surfaces": ["front"],
        "supports": [{"surface": "back", "kind": "fixed"}],
    }  # fmt: skip
    history = impactfem.solve(scene(pressure=40.0, more=[base], dt=1e-4, duration=2e-3)).history
    force = history["contact_force"].values[1:]
    assert force.min() > 1.0
    # Closest places are those of the way that a layer would go without contact: dt^2.
    assert np.ptp(force) < 1e-5 * force[0]
    energy = history["elastic_energy"].values[0]
    assert np.abs(history["kinetic_energy"].values).max() < 1e-10 * energy


def test_what_no_support_holds_is_refused():
    with pytest.raises(SceneError, match=r"no support holds body plate against .*motion along"):
        impactfem.solve(scene(held=()))
    table = scene().to_dict()
    table["body"][0]["supports"] = [{"edge": "left", "kind": "soft_support"}]
    with pytest.raises(
        SceneError, match=r"against rotation about an axis along \(-?0, -?1\); support"
    ):
        impactfem.solve(Scene.from_dict(table))


def moving():
    return scene(
        pressure="40*where(t<0.004,1,0)", obstacles=[stop(0.01)], duration=0.02, dt=5e-4,
        output={"fields": [], "checkpoint": 5},
    )  # fmt: skip


def test_a_run_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    check_restart(moving(), 17, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_ranks_agree(monkeypatch):
    check_ranks(moving, monkeypatch)
