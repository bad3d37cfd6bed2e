"""The plate of the demo closes, stays and opens as its page says."""

from pathlib import Path

import impactfem

DEMO = Path(__file__).resolve().parents[2] / "demos" / "mems_plate"


def run(**changes):
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml")
    settings = {"output.fields": [], "body.switch.mesh_size": 2e-5, "solve.dt": 8e-9} | changes
    return impactfem.solve(scene.with_settings(settings), estimate=False)


def test_it_closes_and_opens():
    contacts = run().summary["contact"]["intervals"]
    assert 0.37e-6 < contacts[0][0] < 0.43e-6
    closed = max(contacts, key=lambda each: each[1] - each[0])
    assert closed[0] < 1.5e-6
    assert 4e-6 < closed[1] < 4.15e-6


def test_a_lower_voltage_does_not_close_it():
    pull = [{"face": "bottom", "value": "-8.854e-12*100**2/2/(0.2e-6+gap)**2"}]
    slow = {"body.switch.rayleigh_mass": 2e7}
    scene = impactfem.Scene.from_toml(DEMO / "scene.toml").to_dict()
    scene["body"][0]["pressures"] = pull
    scene["output"] = {"fields": []}
    made = impactfem.Scene.from_dict(scene).with_settings(
        slow | {"body.switch.mesh_size": 2e-5, "solve.dt": 1e-8}
    )
    history = impactfem.solve(made, estimate=False).history
    assert history["contact_force"].values.max() == 0.0
    assert -0.35e-6 < history["middle.uz"].values[-1] < -0.2e-6
