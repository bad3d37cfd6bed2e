"""Derivatives of bars by reversed sweeps: against differences with the same sets."""

import numpy as np
import pytest

from impactfem import Scene
from impactfem.inverse import bar_adjoints, layered_bars
from impactfem.inverse.steps import Changes
from impactfem.inverse.varied import Varied

BAR = {"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0,
       "gap": 0.23, "velocity": -0.5}  # fmt: skip
COLUMNS = ("gap", "force.bar.wall", "impulse.bar.wall", "bar.x", "bar.vx", "momentum",
           "kinetic_energy", "elastic_energy", "rebound_speed.bar", "p.ux", "p.vx")  # fmt: skip
TERMS = [{"term": "terminal_energy"}, {"term": "vibration_energy"}, {"term": "mass", "body": "bar"},
         {"term": "speed", "body": "bar"}, {"term": "peak_force", "pair": "bar.wall"},
         {"term": "effort", "of": "c"}]  # fmt: skip


def varied(body, control, *, columns=COLUMNS, terms=TERMS, elements=8, courant=1.0, **tables):
    """A bar that strikes the wall, with all that may be asked of it."""
    control = {"name": "c", "pieces": 5, "until": 1.0} | control
    count = control["pieces"] + (control.get("kind") == "linear")
    start = np.random.default_rng(0).uniform(0.05, 0.15, count).tolist()
    return Varied.of(Scene.from_dict({
        "title": "adjoint", "duration": 3.1, "body": [BAR | body],
        "gravity": [[0.0, 0.1], [0.61, -0.2]], "obstacle": [{"kind": "wall"}],
        "control": [{"start": start} | control],
        "probe": [{"name": "p", "body": "bar", "point": [0.4]}],
        "measure": [{"name": f"m{k}", "of": of, "at": 2.03} for k, of in enumerate(columns)],
        "objective": {"minimise": terms},
        "solve": {"method": "galerkin", "elements": elements, "courant": courant},
        "output": {"report": False, "pictures": False, "fields": []}, **tables,
    }))  # fmt: skip


def told(asked):
    names = tuple(each.name for each in asked.unknowns)
    return asked.runs.jacobian(
        Changes(asked.at, asked.start, asked.scales, names), asked.quantities
    )


def differences(asked, ways=None):
    """Central ones over two steps, extrapolated, of runs with the sets of the start; (n, ways)."""
    runs, at, times = asked.runs, asked.start, asked.quantities.times
    scene = asked.at(at)
    marks = runs.marks(scene, runs.march(scene, None))

    def read(values):
        moved = asked.at(values)
        return asked.quantities.read(runs.outcome(moved, times, marks), moved)

    found = []
    for way in np.eye(len(at)) if ways is None else ways:
        far, near = ((read(at + h * way) - read(at - h * way)) / (2.0 * h) for h in (2e-4, 1e-4))
        found.append((4.0 * near - far) / 3.0)
    return np.array(found).T


CASES = {
    "push": ({}, {"acts": "body.bar.far_end_force"}, 1.0),
    "squared": ({"far_end_force": "c*c"}, {"kind": "linear"}, 0.9),
    "way": ({"far_end_displacement": "t*t*c"}, {"kind": "linear", "until": 3.1}, 1.0),
    "load": ({"load": "c*(1 + x)"}, {"pieces": 7}, 0.9),
    "velocity": ({"velocity": "-0.5 + c"}, {"along": "x"}, 1.0),
    "strain": ({"displacement": "c*x"}, {"along": "x", "kind": "linear"}, 0.9),
    "area": ({"area": "1 + c"}, {"along": "x", "pieces": 12}, 1.0),
}


@pytest.mark.parametrize("case", CASES)
def test_they_are_those_of_differences(case, monkeypatch):
    monkeypatch.setattr(layered_bars, "differences", None)  # which would be taken else
    body, control, courant = CASES[case]
    columns = COLUMNS if control.get("along") != "x" else (*COLUMNS, "potential_energy")
    asked = varied(body, control, courant=courant, columns=columns)
    np.testing.assert_allclose(told(asked).jacobian, differences(asked), rtol=1e-8, atol=1e-9)


def test_each_side_has_its_sets(monkeypatch):
    """An impact on a layer: unknowns that move it, one by one, by runs and by reversed sweeps."""
    asked = varied({"gap": 0.5, "velocity": "-0.5 + c"}, {"along": "x", "start": 0.0}, gravity=0.0,
                   measure=[{"name": "p", "of": "impulse.bar.wall", "at": 1.06}],
                   terms=[{"term": "value", "of": "p"}],
                   parameter=[{"name": "H", "key": "body.bar.gap"}])  # fmt: skip
    found = told(asked)
    monkeypatch.setattr(layered_bars, "_MANY", 0)
    right = told(asked)
    assert abs(found.sides[1][0, 0] - found.sides[0][0, 0]) > 0.01
    np.testing.assert_allclose(found.sides, right.sides, atol=1e-8)
    np.testing.assert_allclose(found.jacobian, right.jacobian, atol=1e-8)


def test_unknowns_that_change_the_layers_are_among_others():
    asked = varied({}, {"acts": "body.bar.far_end_force", "until": 1.03},
                   parameter=[{"name": "E", "key": "body.bar.youngs_modulus"}])  # fmt: skip
    np.testing.assert_allclose(told(asked).jacobian, differences(asked), rtol=1e-6, atol=1e-7)


def test_more_values_than_layers(monkeypatch):
    """Several pieces in a layer are told apart: 60 in 25 layers, against a sum over all."""
    asked = varied({}, {"acts": "body.bar.far_end_force", "pieces": 60})
    runs = []
    monkeypatch.setattr(bar_adjoints.Given, "of", classmethod(counted(bar_adjoints.Given.of, runs)))
    found, ways = told(asked).jacobian, np.random.default_rng(1).standard_normal((2, 60))
    assert len(runs) < 30
    np.testing.assert_allclose(found @ ways.T, differences(asked, ways), rtol=1e-8, atol=1e-9)


def counted(made, runs):
    def of(_, *args):
        runs.append(args)
        return made(*args)

    return of
