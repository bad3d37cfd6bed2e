"""Supports that let go and loads that end: closed forms, impulses, restart, ranks, refusals."""

from functools import partial

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene, SceneError

PULL = 1e-3  # of the end of the rod, 1 m long [m]
SPEED = 5000.0  # of waves [m/s]
WALL = {"name": "wall", "kind": "half_space", "normal": [-1, 0], "point": [2, 0]}


def said(until, *, duration=4e-4, strain="small", start="static", more=(), **solve):
    """A rod that is pulled at its right end, which is let go of; waves have no dispersion."""
    held = {"surface": "right", "kind": "motion", "value": [str(PULL), ""], "until": until}
    body = {
        "name": "rod", "kind": "solid", "model": "plane_strain", "mesh_size": 0.05,
        "shape": {"kind": "block", "size": [1.0, 0.1], "corner": [0.0, 0.0]},
        "cells": "hexahedron", "density": 8000.0, "youngs_modulus": 2e11, "poisson_ratio": 0.0,
        "supports": [{"surface": "left", "kind": "fixed"}, held, *more], "strain": strain,
        "degree": 1,
    }  # fmt: skip
    return {
        "title": "rod", "duration": duration, "start": start, "body": [body], "obstacle": [],
        "solve": {"estimate": False} | solve, "output": {"fields": [], "checkpoint": 1},
        "probe": [{"name": "end", "body": "rod", "point": [1.0, 0.05]}],
    }  # fmt: skip


def rod(until, **others):
    """The scene of it."""
    return Scene.from_dict(said(until, **others))


def touching_rod(until, **others):
    """The same with an end that may touch a wall that is far away: its nodes carry no mass."""
    scene = said(until, **others)
    scene["body"][0]["contact_surfaces"] = ["right"]
    scene["obstacle"] = [WALL]
    return Scene.from_dict(scene)


def end_of_rod(t, until):
    """By d'Alembert up to 2 L / c after it is let go of [m]."""
    return PULL - PULL * SPEED * np.maximum(t - until, 0.0)


@pytest.mark.parametrize("until", [0.0, 1.3e-5])
@pytest.mark.parametrize(
    ("strain", "method"), [
        ("small", "massless"), ("small", "explicit"), ("finite", "conserving"),
        ("finite", "explicit"),
    ])  # fmt: skip
def test_a_rod_released_from_a_stretch_is_dalemberts(strain, method, until):
    result = impactfem.solve(rod(until, strain=strain, duration=3.77e-4, method=method))
    t = result.history["time"].values
    found = result.history["end.ux"].values
    # Elements of 1/20 of the rod smear the front over some of them.
    assert np.abs(found - end_of_rod(t, until)).max() < 0.05 * PULL
    assert np.mean(found - end_of_rod(t, until)) == pytest.approx(0.0, abs=2e-3 * PULL)
    # Until the wave arrives there, the fixed end feels the same force.
    force = 2e11 * PULL * 0.1 * (1.0 if strain == "small" else (1.0 + 1.5 * PULL))
    first = (t > until) & (t < until + 1e-4)
    pulled = -np.polyfit(t[first], result.history["momentum.x"].values[first], 1)[0]
    assert pulled == pytest.approx(force, rel=2e-3)
    energy = result.history["total_energy"].values  # explicit steps keep it to their order
    kept = 5e-5 if (strain, method) == ("finite", "explicit") else 1e-9
    assert np.ptp(energy) < kept * energy[0]


METHODS = [
    ("small", "massless"), ("small", "explicit"), ("finite", "massless"), ("finite", "explicit"),
]  # fmt: skip


@pytest.mark.parametrize("until", [0.0, 1e-4])
@pytest.mark.parametrize(("strain", "method"), METHODS)
def test_an_end_that_may_touch_loses_what_strains_its_elements(strain, method, until):
    """Its nodes carry no mass: they are in equilibrium at once, in every step from then on."""
    scene = touching_rod(until, strain=strain, duration=3.77e-4, method=method)
    result = impactfem.solve(scene)
    t, found = (result.history[name].values for name in ("time", "end.ux"))
    energy = result.history["total_energy"].values
    after = t > until + 1.01 * t[1]
    assert energy[0] == pytest.approx(1e4, rel=2e-3)
    # One of 20 elements, and with it .05 of the energy.
    np.testing.assert_allclose(energy[after], 0.95 * energy[0], rtol=5e-5)
    assert np.mean(found - end_of_rod(t, until)) == pytest.approx(0.0, abs=3e-3 * PULL)
    assert np.abs(np.diff(found[after], 2)).max() < 0.01 * PULL  # no change of sign in each step


def test_a_bent_strip_let_go_over_a_stop():
    """Up to where it strikes: modes of a cantilever with a force at its tip [Timoshenko 1974].

    All that may touch is known from the beginning, though supports bend the strip and leave it.
    """
    length, height, lift = 0.1, 0.004, 0.002
    body = {
        "name": "strip", "kind": "solid", "model": "plane_strain", "mesh_size": 0.004, "degree": 2,
        "shape": {"kind": "block", "size": [length, height], "corner": [0.0, 0.0]},
        "cells": "hexahedron", "density": 7800.0, "youngs_modulus": 210e9, "poisson_ratio": 0.0,
        "supports": [
            {"surface": "left", "kind": "fixed"},
            {"surface": "right", "kind": "motion", "value": ["", str(lift)], "until": 0.0}],
    }  # fmt: skip
    stop = {"name": "stop", "kind": "sphere", "center": [0.08, -0.0105], "radius": 0.01}
    solve = {"estimate": False, "method": "conserving", "dt": 4e-6}
    result = impactfem.solve(Scene.from_dict({
        "title": "strip", "duration": 1e-3, "start": "static", "body": [body], "obstacle": [stop],
        "probe": [{"name": "tip", "body": "strip", "point": [length, 0.0]}], "solve": solve,
        "output": {"fields": []},
    }))  # fmt: skip
    t, found, gap = (result.history[name].values for name in ("time", "tip.uy", "gap"))
    free = t < 0.8e-3
    assert found[0] == pytest.approx(lift, rel=1e-9)
    assert gap[free].min() > 0.0
    assert result.history["contact_force"].values.max() > 0.0
    roots = np.array([1.875104, 4.694091, 7.854757, 10.995541])
    speeds = (roots / length) ** 2 * np.sqrt(210e9 * height**2 / 12.0 / 7800.0)
    modes = 12.0 * lift * np.cos(np.outer(t, speeds)) @ roots**-4
    np.testing.assert_allclose(found[free], modes[free], atol=0.03 * lift)
    energy = result.history["total_energy"].values
    np.testing.assert_allclose(energy, energy[0], rtol=1e-5)


@pytest.mark.parametrize(("strain", "method"), [("small", "massless"), ("finite", "conserving")])
def test_a_rod_pressed_on_a_wall_leaves_it_once_the_wave_is_there(strain, method):
    """In contact as it is let go of: E A e on the wall for L / c, then all of it flies at c e."""
    until = 1.03e-4
    scene = said(until, strain=strain, method=method, duration=7e-4)
    scene["body"][0]["supports"] = [
        {"surface": "right", "kind": "motion", "value": [str(-PULL), "0"], "until": until}
    ]
    scene["body"][0]["contact_surfaces"] = ["left"]  # an end that may touch has no mass
    scene["obstacle"] = [WALL | {"normal": [1, 0], "point": [0, 0]}]
    result = impactfem.solve(Scene.from_dict(scene))
    t, force, speed = (result.history[n].values for n in ("time", "contact_force", "rod.vx"))
    pressed = 2e11 * PULL * 0.1
    held = t < until + 0.6 / SPEED  # elements smear the front
    np.testing.assert_allclose(force[held], pressed, rtol=2e-3 if strain == "small" else 4e-3)
    impulse = np.trapezoid(force, t)
    assert impulse == pytest.approx(pressed * (until + 1.0 / SPEED), rel=6e-3)
    assert force[t > until + 1.2 / SPEED].max() < 1e-6 * pressed
    assert speed[-1] == pytest.approx(SPEED * PULL, rel=0.03)
    energy = result.history["total_energy"].values
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9 if strain == "small" else 1e-6)


@pytest.mark.parametrize("until", [1e-4, 3.3e-4])
@pytest.mark.parametrize(("strain", "method"), METHODS)
def test_a_moving_body_keeps_its_energy_when_it_is_let_go(strain, method, until):
    """With full speed amid the rod, and with large forces at its end."""
    scene = said(until, strain=strain, duration=5e-4, method=method, start="given")
    wave = f"sin({np.pi}*x)"
    scene["body"][0] |= {
        "displacement": [f"1e-3*{wave}", "0"], "velocity": [f"5*sin(2*{np.pi}*x)", "0"],
        "supports": [{"surface": "left", "kind": "fixed"},
                     {"surface": "right", "kind": "fixed", "until": until}],
    }  # fmt: skip
    energy = impactfem.solve(Scene.from_dict(scene)).history["total_energy"].values
    np.testing.assert_allclose(energy, energy[0], rtol=5e-5)


def test_steps_end_where_supports_let_go():
    """Explicit ones have it amid steps: there their forces begin to act."""
    implicit = impactfem.solve(rod(1.3e-5, method="massless", duration=3.77e-4))
    t = implicit.history["time"].values
    assert np.abs(t / 1.3e-5 - 1.0).min() < 0.011 * t[1] / 1.3e-5
    assert "ends" in impactfem.plan(rod(1.3e-5, method="massless")).reasons
    held = implicit.history["kinetic_energy"].values[t < 1.29e-5]
    assert np.abs(held).max() < 1e-12 * implicit.history["total_energy"].values[0]


def test_a_moved_support_lets_go_at_its_speed():
    """What it moved goes on: a block that is led as a whole flies on without a wave."""
    scene = said(1e-4, start="given")
    scene["body"][0]["supports"] = [
        {"surface": "left", "kind": "motion", "value": ["2*t", "0"], "until": 1e-4},
        {"surface": "right", "kind": "motion", "value": ["2*t", "0"], "until": 1e-4},
    ]
    scene["body"][0]["velocity"] = [2.0, 0.0]
    scene["obstacle"] = [WALL]  # out of reach of its own speed: contact nodes stay
    for method in ("massless", "explicit"):
        scene["solve"]["method"] = method
        result = impactfem.solve(Scene.from_dict(scene))
        speed = result.history["rod.vx"].values[1:]
        np.testing.assert_allclose(speed, 2.0, rtol=1e-9)
        assert result.history["elastic_energy"].values.max() < 1e-9


@pytest.mark.parametrize(("strain", "method"), [
    ("small", "massless"), ("small", "explicit"), ("finite", "conserving"), ("finite", "explicit"),
])  # fmt: skip
def test_a_load_that_ends_within_a_step_has_its_impulse(strain, method):
    """3 kPa on .1 m for 1.37e-4 s, and a pressure on the whole outline, which sums up to none."""
    scene = said(None, start="given", method=method)
    body = scene["body"][0] | {"supports": [], "strain": strain}
    body["tractions"] = [{"surface": "right", "value": [3e3, "0"], "until": 1.37e-4}]
    body["pressures"] = [
        {"surface": name, "value": 1e3, "until": 2.11e-5} for name in ("left", "right")
    ]
    scene["body"] = [body]
    result = impactfem.solve(Scene.from_dict(scene))
    momentum = result.history["momentum.x"].values
    assert momentum[-1] == pytest.approx(3e3 * 0.1 * 1.37e-4, rel=1e-12)


def test_a_load_of_the_equilibrium_alone():
    """A strip bent by a pressure, released: the equilibrium is that of the load, and none acts."""
    scene = said(None, method="massless")
    scene["body"][0]["supports"] = [{"surface": "left", "kind": "fixed"}]
    scene["body"][0]["tractions"] = [{"surface": "right", "value": [2e8, "0"], "until": 0.0}]
    result = impactfem.solve(Scene.from_dict(scene))
    t = result.history["time"].values
    assert np.abs(result.history["end.ux"].values - end_of_rod(t, 0.0)).max() < 0.05 * PULL
    energy = result.history["total_energy"].values
    assert np.ptp(energy) < 1e-10 * energy[0]


def test_a_plate_is_released_from_a_pressure():
    plate = {
        "name": "plate", "kind": "plate", "outline": {"kind": "rectangle", "size": [0.2, 0.2]},
        "thickness": 0.004, "mesh_size": 0.05, "density": 7800.0, "youngs_modulus": 210e9,
        "poisson_ratio": 0.3, "supports": [
            {"edge": e, "kind": "clamped"} for e in ("left", "right", "bottom", "top")],
        "pressures": [{"face": "top", "value": 1e3, "until": 0.0}],
    }  # fmt: skip
    result = impactfem.solve(Scene.from_dict({
        "title": "plate", "duration": 2e-3, "start": "static", "body": [plate], "obstacle": [],
        "solve": {"estimate": False}, "output": {"fields": [], "checkpoint": 1},
        "probe": [{"name": "mid", "body": "plate", "point": [0.0, 0.0, 0.0]}],
    }))  # fmt: skip
    deflection, energy = (result.history[n].values for n in ("mid.uz", "total_energy"))
    assert deflection[0] == pytest.approx(-1.26e-3 * 1e3 * 0.2**4 / 1230.8, rel=0.1)
    assert deflection.max() > 0.8 * abs(deflection[0])  # it swings to the other side
    assert np.ptp(energy) < 1e-9 * energy[0]


@pytest.mark.parametrize("layer", [3, 40])
@pytest.mark.parametrize(("strain", "method"), METHODS)
def test_a_restarted_run_is_equal_to_the_last_bit(strain, method, layer, tmp_path, monkeypatch):
    """Before a support lets go, and after it."""
    scene = touching_rod(1e-4, strain=strain, method=method)
    check_restart(scene, layer, tmp_path, monkeypatch)


def test_a_run_restarted_where_it_lets_go_is_equal_to_the_last_bit(tmp_path, monkeypatch):
    scene = touching_rod(1e-4, strain="finite", method="explicit")
    scene_steps = impactfem.solve(scene).history["time"].values
    layer = int(np.argmin(np.abs(scene_steps - 1e-4)))
    check_restart(scene, layer, tmp_path, monkeypatch)


@pytest.mark.parallel([2])
def test_ranks_agree(monkeypatch):
    for strain, method in METHODS[1:]:
        check_ranks(partial(touching_rod, 1e-4, strain=strain, method=method), monkeypatch)


def test_steps_by_hand_are_those_of_the_run():
    scene = rod(1e-4)
    simulation = impactfem.Simulation(scene)
    begun = simulation.state
    for again in (False, True):
        while not simulation.done:
            simulation.step()
        found = simulation.result().history
        whole = impactfem.solve(scene).history
        assert all(np.array_equal(found[n], whole[n], equal_nan=True) for n in whole.data_vars)
        if not again:
            simulation.restore(begun)
    simulation.close()


@pytest.mark.parametrize(("changed", "words"), [
    ({"until": -1.0}, "until"),
    ({"kind": "symmetry", "value": None, "until": 1e-4}, "plane of symmetry"),
])  # fmt: skip
def test_supports_that_cannot_let_go_are_refused(changed, words):
    scene = said(1e-4)
    support = scene["body"][0]["supports"][1] | changed
    scene["body"][0]["supports"][1] = {k: v for k, v in support.items() if v is not None}
    with pytest.raises(SceneError, match=words):
        Scene.from_dict(scene)


NET = {
    "pattern": "squares", "model": "2d", "mass": 1.0, "stiffness": 10.0, "mesh_size": 0.5,
    "shape": {"kind": "block", "size": [1.0, 1.0], "corner": [0.0, 0.0]},
}  # fmt: skip
BEAM = {
    "length": 0.1, "height": 0.01, "width": 0.01, "center": [0.0, 0.0], "density": 1e3,
    "youngs_modulus": 1e9,
}  # fmt: skip


@pytest.mark.parametrize(("kind", "keys", "support", "words"), [
    ("plate", {}, {"edge": "rim", "kind": "clamped"}, "of other bodies has it; remove it"),
    ("beam", BEAM, {"end": "first", "kind": "clamped"}, "of other bodies has it; remove it"),
    ("springs", NET, {"surface": "left", "kind": "fixed"}, "are held for ever; remove it"),
])  # fmt: skip
def test_other_bodies_are_held_for_ever(kind, keys, support, words):
    body = keys | {"name": "b", "kind": kind, "supports": [support | {"until": 1e-4}]}
    with pytest.raises(SceneError, match=rf"supports\[0\].until = 0.0001.*{words}"):
        Scene.from_dict({"title": "held", "duration": 1.0, "body": [body]})


def test_what_ends_before_it_did_anything_is_refused():
    scene = said(None, start="given")
    scene["body"][0]["supports"] = []
    scene["body"][0]["tractions"] = [{"surface": "right", "value": [2e8, "0"], "until": 0.0}]
    with pytest.raises(SceneError, match=r"tractions\[0\].until = 0 ends before .*static"):
        Scene.from_dict(scene)
