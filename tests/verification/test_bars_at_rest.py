"""Bars that start at rest before a wall: closed forms, and runs that stay so."""

import re

import numpy as np
import pytest

import impactfem
from impactfem import Scene, SceneError

L, RHO, E, A, G, K = 2.0, 8000.0, 2e11, 1e-3, 9.81, 1e8
WEIGHT = RHO * A * L * G
LAYERED = ("galerkin", "monolithic")
BAR = {"kind": "bar", "length": L, "density": RHO, "youngs_modulus": E, "area": A}


def scene(bar, gravity=0.0, method=None, stiffness=None, **top):
    table = {
        "title": "bar at rest", "duration": 1e-3, "gravity": gravity, "start": "static",
        "body": [BAR | bar], "obstacle": [{"kind": "wall"}], "output": {"fields": []},
        "solve": {"method": method, "elements": 50 if method in LAYERED else None},
    } | top  # fmt: skip
    table["solve"] = {name: value for name, value in table["solve"].items() if value is not None}
    if stiffness:
        table["contact"] = [{"between": ["bar", "wall"], "stiffness": stiffness}]
    return Scene.from_dict(table)


def strained(bar, force, bend):
    """Displacements of a bar with the force at x = 0 and what it loses per length."""
    x = np.linspace(0.0, L, 7)
    near = float(bar.initial_displacement(x=0.0))
    exact = near + (force * x - 0.5 * bend * x**2) / (E * A)
    np.testing.assert_allclose(bar.initial_displacement(x=x), exact, rtol=0.0, atol=1e-18)
    return near


@pytest.mark.parametrize("method", ["exact", *LAYERED])
def test_a_bar_stands_under_its_weight_and_a_force(method):
    made = scene({"far_end_force": -300.0}, G, method)
    x = np.linspace(0.0, L, 7)
    exact = -RHO * G * x * (2.0 * L - x) / (2.0 * E) - 300.0 * x / (E * A)
    np.testing.assert_allclose(made.bar.initial_displacement(x=x), exact, atol=1e-18)
    result = impactfem.solve(made)
    found = {name: result.history[name].values for name in result.history.data_vars}
    assert len(found["contact_force"]) > 100
    np.testing.assert_allclose(found["contact_force"][1:], WEIGHT + 300.0, rtol=1e-9)
    assert found["kinetic_energy"].max() < 1e-18 * found["elastic_energy"][0]
    assert np.abs(found["gap"]).max() < 1e-18
    assert np.ptp(found["total_energy"]) < 1e-12 * found["elastic_energy"][0]
    assert result.summary["verdict"]["level"] == "trust"


def test_held_ends_gaps_and_walls_that_give_way():
    hangs = scene({"far_end": "clamped", "gap": 0.01}, G).bar
    assert strained(hangs, 0.0, -RHO * A * G) == pytest.approx(0.01 - RHO * G * L**2 / (2.0 * E))
    # Half of the weight is borne by the wall, half by the clamp.
    assert strained(scene({"far_end": "clamped"}, G).bar, -0.5 * WEIGHT, -RHO * A * G) == 0.0
    pressed = scene({"far_end_displacement": "-1e-5*(1 + t)"})
    assert strained(pressed.bar, -E * A * 1e-5 / L, 0.0) == 0.0
    load = scene({"load": "-50*exp(-t)", "gap": 0.1}).bar
    assert strained(load, -50.0 * L, -50.0) == pytest.approx(0.0, abs=1e-17)
    floats = scene({"gap": 0.1, "far_end_force": WEIGHT}, G).bar
    near = strained(floats, 0.0, -RHO * A * G)
    assert near + RHO * G * L**2 / (8.0 * E) == pytest.approx(0.1, abs=1e-16)
    soft = scene({}, G, "galerkin", K)
    assert strained(soft.bar, -WEIGHT, -RHO * A * G) == pytest.approx(-WEIGHT / K, rel=1e-12)
    for made, force in ((soft, WEIGHT), (pressed, E * A * 1e-5 / L)):
        found = impactfem.solve(made).history["contact_force"].values[1:20]
        np.testing.assert_allclose(found, force, rtol=2e-3 if made is pressed else 1e-9)


def test_an_end_that_is_moved_goes_on_from_where_it_presses():
    drive, ends = {"far_end_displacement": "-1e-5*(1 + 200*t)"}, []
    for method in ("exact", *LAYERED):
        history = impactfem.solve(scene(drive, 0.0, method, duration=1.2e-3)).history
        ends.append([history[n].values[-1] for n in ("elastic_energy", "bar.x", "contact_force")])
    np.testing.assert_allclose(ends[1:], [ends[0]] * 2, rtol=1e-7)


def test_what_nothing_holds_is_named_and_ways_to_the_wall_are_told():
    says = 'start = "static": nothing holds bar against its translation away from the wall, driven'
    with pytest.raises(SceneError, match=re.escape(f"{says} by 843 N")):
        scene({"far_end_force": 1000.0}, G)
    for key, given in (("load", "-5*x"), ("area", "1e-3*(1 + x)")):
        with pytest.raises(SceneError, match=rf"{key} = .* varies along a bar that starts at rest"):
            scene({key: given}, G)
    result = impactfem.solve(scene({"gap": 0.5}, G))
    (told,) = [f for f in result.summary["verdict"]["findings"] if f["code"] == "setting"]
    assert "has moved bar by 0.5 m, 25 % of its length" in told["text"]


def row(bodies, gravity=G, start="static", **top):
    table = {
        "title": "row", "duration": 4e-4, "gravity": gravity, "start": start, "body": bodies,
        "obstacle": [{"kind": "wall", "name": "wall"}], "output": {"fields": []},
        "solve": {"elements": 50},
    } | top  # fmt: skip
    return impactfem.solve(Scene.from_dict(table)).history


def stood(count, gap=0.0, **last):
    """So many bars on each other, with what only the last one has."""
    bars = [BAR | {"name": f"b{k}", "gap": gap * (k + 1) + L * k} for k in range(count)]
    return [*bars[:-1], bars[-1] | last]


def test_bars_in_a_row_bear_what_stands_on_them():
    """On the wall all weights, on each next end one less; a mass on top adds its own."""
    top = {"kind": "point", "name": "top", "mass": 4.0, "position": [2.0 * L]}
    more, own = 4.0 * G, WEIGHT * L / (E * A)  # what a weight on its end presses a bar by
    # Places of about L are rounded in each step, of which forces see Z / dt times the differences.
    room = 64.0 * np.finfo(float).eps * 2.0 * L * RHO * A * np.sqrt(E / RHO) / (L / 2.5e5)
    both = {"b0.wall": 2.0 * WEIGHT, "b0.b1": WEIGHT}
    far = stood(3, far_end="clamped")
    heavy = {"b0.wall": 2.0 * WEIGHT + more, "b0.b1": WEIGHT + more, "b1.top": more}
    for history, forces, added in (
        (row(stood(2)), both, 0.0),
        (row(stood(2, 1e-3), [-G]), both, 0.0),
        (row(far), both | {"b1.b2": 0.0}, 0.0),
        (row([*stood(2), top], [-G]), heavy, 1.5 * more * L / (E * A)),
    ):
        for pair, force in forces.items():
            np.testing.assert_allclose(history[f"force.{pair}"].values, force, rtol=0.0, atol=room)
        energy = history["elastic_energy"].values
        for name in ("kinetic_energy", "elastic_energy"):
            assert np.ptp(history[name].values) < 8.0 * room / WEIGHT * energy[0]
        # The one below by 3/2 of a weight on it, its own half to the middle: u = f x (2 L - x) / 2.
        middle = 1.5 * L - (1.5 + 1.0 / 3.0) * own - added
        assert history["b1.x"].values[0] == pytest.approx(middle, abs=1e-6 * own)


def test_bars_that_fall_in_a_row_strike_as_one():
    """Two that touch, onto the wall, as one of twice the length by characteristics."""
    pull, speed, above, last = 100.0, {"velocity": -0.2}, 2e-6, {"duration": 1.9e-3}
    bars = [bar | speed | {"gap": bar["gap"] + above} for bar in stood(2)]
    found = row(bars, pull, "given", **last, solve={"elements": 100})
    lone = BAR | speed | {"name": "b", "length": 2.0 * L, "gap": above}
    exact = row([lone], pull, "given", **last, solve={"method": "exact"})
    time = found["time"].values
    known = np.interp(time, exact["time"].values, exact["b.vx"].values)
    mean = 0.5 * (found["b0.vx"].values + found["b1.vx"].values)
    np.testing.assert_allclose(mean, known, rtol=0.0, atol=5e-3 * np.abs(known).max())
    assert known[-1] > -0.5 * known[0]  # it has rebounded
    free = row(stood(1), pull, "given", obstacle=[], **last)
    np.testing.assert_allclose(free["b0.vx"].values, -pull * free["time"].values, rtol=1e-12)


def test_a_spring_wall_stops_what_is_driven():
    """What drives a bar was left out where a wall gives way and no method is asked for."""
    law = {"contact": [{"between": ["bar", "wall"], "stiffness": K}]}
    for drive in ({"far_end_force": -300.0}, {"load": -150.0}):
        made = Scene.from_dict(scene(drive, **law, start="given").to_dict())
        assert made.bar.wall_stiffness == K
        assert impactfem.plan(made).method == "galerkin"
    damped = [law["contact"][0] | {"damping": 1.0}]
    with pytest.raises(SceneError, match=r"far_end_force = .* drives a bar .*: remove it"):
        scene({"far_end_force": -300.0}, contact=damped)
