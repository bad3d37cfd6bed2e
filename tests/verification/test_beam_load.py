"""Loads along beams against closed forms."""

import numpy as np
import pytest
from scipy.optimize import fsolve

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


def cantilever(pull, elements, **more):
    """With EI = rho A = L = 1 and a gap of 1e-3: EI w'''' = pull / (1 - w)^2 in gaps."""
    h, d = 0.01, 1e-3
    return {
        "kind": "beam", "name": "strip", "length": 1.0, "height": h, "width": 1.0,
        "density": 1.0 / h, "youngs_modulus": 12.0 / h**3, "elements": elements,
        "center": [0.5, 0.0], "supports": [{"end": "first", "kind": "clamped"}],
        "load": f"-{pull * d**3}/({d} + max(u, {-0.9 * d}))**2",
    } | more  # fmt: skip


def largest_pull(elements):
    """Of equilibria, one for each place of the tip."""
    data = cantilever(1.0, elements)
    beam = Beam(**{key: value for key, value in data.items() if key != "kind"})
    system = free_beam(beam).system(HalfSpace(name="stop", point=[0.0, -1.0], normal=[0.0, 1.0]))
    still, tip = np.zeros(system.dofs), system.names.index(f"deflection[{elements}]")
    stiffness, found = free_beam(beam).parts.stiffness, np.zeros(system.dofs + 1)
    pulls = []
    for place in np.linspace(0.02e-3, 0.7e-3, 35):

        def left(each, place=place):
            q, pull = each[:-1], each[-1]
            load = system.force(0.0, q, still) + stiffness @ q
            return np.append(q - pull * np.linalg.solve(stiffness, load), -q[tip] - place) * 1e3

        found = fsolve(left, found)
        pulls.append(found[-1])
    return max(pulls)


def test_pull_in_of_a_cantilever_as_in_the_literature():
    """1.68: 6 x 0.28 of Osterberg and Senturia, J. Microelectromech. Syst. 6 (1997) 107-118."""
    assert largest_pull(8) == pytest.approx(largest_pull(4), rel=1e-4)
    assert largest_pull(4) == pytest.approx(1.68, abs=0.005)


@pytest.mark.parametrize(("share", "closes"), [(0.97, False), (1.03, True)])
def test_a_strip_is_pulled_in(share, closes):
    """Damped so that it creeps."""
    strip = cantilever(share * largest_pull(4), 4, rayleigh=[30.0, 0.0])
    stop = {"kind": "half_space", "name": "stop", "point": [0.0, -0.8e-3], "normal": [0.0, 1.0]}
    run = impactfem.solve(Scene.from_dict({
        "title": "pull", "duration": 60.0, "body": [strip], "obstacle": [stop],
        "solve": {"estimate": False, "dt": 0.05}, "output": {"fields": []},
        "probe": [{"name": "tip", "body": "strip", "point": [1.0, 0.0]}],
    }))  # fmt: skip
    tip = run.history["tip.uy"].values
    assert (run.history["contact_force"].values.max() > 0.0) == closes
    if not closes:
        assert -0.6e-3 < tip[-1] < -0.3e-3
        assert abs(tip[-1] - tip[-100]) < 1e-6
