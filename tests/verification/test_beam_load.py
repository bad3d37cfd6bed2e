"""Loads along beams against closed forms."""

import numpy as np
import pytest

import impactfem
from impactfem.errors import SceneError
from impactfem.scene import Beam, Scene
from impactfem.scene.obstacles import HalfSpace
from impactfem.system.beam import free_beam
from impactfem.system.few_bodies import _of_beam

CLAMPED = [{"end": end, "kind": "clamped"} for end in ("first", "last")]
STIFFNESS = 1e5 * 0.05**3 / 12.0


def strip(load: str, **more):
    return Beam(
        length=1.0, height=0.05, width=1.0, density=20.0, youngs_modulus=1e5, elements=4,
        center=[0.5, 0.0], supports=CLAMPED, load=load, **more,
    )  # fmt: skip


def test_a_uniform_load_bends_a_clamped_beam_as_the_closed_form_says():
    bodies = _of_beam(strip("-0.01"))
    force = bodies.load(0.0, 0.0, bodies.position, bodies.velocity)
    bent = np.linalg.solve(bodies.beam.stiffness, force)
    middle = bodies.places(bent)[2, 1]
    assert middle == pytest.approx(-0.01 / (384.0 * STIFFNESS), rel=1e-12)


def test_a_load_linear_in_the_deflection_softens_it_exactly():
    bodies = _of_beam(strip("300*u"))
    q = np.sin(np.arange(len(bodies.position)))
    mass = bodies.beam.mass / (20.0 * 0.05)  # of unit line density: the integrals of N N
    force = bodies.load(0.0, 0.0, q, q)
    bending = np.flatnonzero(np.isin(bodies.beam.kept % 3, [1, 2]))
    assert force[bending] == pytest.approx(300.0 * (mass @ q)[bending], rel=1e-12)


def test_a_load_that_has_no_finite_value_is_refused():
    system = free_beam(strip("-1/(0.001 + u + 0*t)**2")).system(
        HalfSpace(name="stop", point=[0.0, -0.01], normal=[0.0, 1.0])
    )
    bent = np.zeros(system.dofs)
    assert np.isfinite(system.force(0.0, bent, bent)).all()
    assert system.potential(0.0, bent) == 0.0
    infinite = free_beam(strip("1/u")).system(
        HalfSpace(name="stop", point=[0.0, -0.01], normal=[0.0, 1.0])
    )
    with pytest.raises(SceneError, match=r"beam.load = .* no finite value at x = .*obstacle"):
        infinite.force(0.0, bent, bent)


def flight(load, solve=None, **beam):
    body = {
        "kind": "beam",
        "name": "strip",
        "length": 1.0,
        "height": 0.01,
        "width": 0.1,
        "density": 1000.0,
        "youngs_modulus": 1e9,
        "center": [0.5, 0.0],
        "load": load,
    }
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, -0.005], "normal": [0.0, 1.0]}
    return impactfem.solve(Scene.from_dict({
        "title": "strip", "duration": 0.2, "body": [body | beam],
        "obstacle": [floor] if solve else [], "solve": solve or {},
        "output": {"report": False, "pictures": False, "fields": []},
    }))  # fmt: skip


@pytest.mark.parametrize(("load", "speed"), [("-10", -2.0), ("-10 - u", -10.0 * np.sin(0.2))])
def test_a_free_beam_follows_its_load(load, speed):
    """It weighs 1 kg: v = -q t, and -q sin(t) where the load is a spring too."""
    result = flight(load)
    assert result.summary["verdict"]["level"] == "trust"
    assert float(result.history["strip.vy"][-1]) == pytest.approx(speed, rel=1e-5)
    # The load's work is told: what is left of the energy is rounding.
    assert abs(result.summary["energy"]["final"]) < 1e-10


def test_a_held_beam_strikes_by_events():
    held = [{"end": "first", "kind": "clamped"}]
    result = flight("-1", {"method": "event_driven"}, supports=held, elements=3)
    assert result.summary["contact"]["intervals"]
    codes = [finding["code"] for finding in result.summary["verdict"]["findings"]]
    assert codes == ["setting"]  # no [[contact]] gives a restitution
