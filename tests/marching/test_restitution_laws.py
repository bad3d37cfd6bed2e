"""Laws of extensions that tell restitution by the speed of approach, in every time loop."""

import numpy as np
import pytest

import impactfem
from impactfem.extend import RestitutionLaw
from impactfem.extensions import ADDED
from impactfem.scene.contacts import RESTITUTION_LAWS

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
BOX = {
    "kind": "rigid", "name": "box", "density": 1000.0, "velocity": [0.4, -1.0], "angle": 0.0,
    "shape": {"kind": "block", "size": [0.2, 0.1], "corner": [0.0, 0.003]},
}  # fmt: skip
RUBBER = {
    "kind": "solid", "name": "rubber", "model": "plane_strain", "strain": "finite",
    "material": "neo_hookean", "mesh_size": 0.05, "density": 1000.0, "youngs_modulus": 1e6,
    "poisson_ratio": 0.3, "shape": {"kind": "disc", "radius": 0.05, "center": [2.0, 0.0502]},
}  # fmt: skip


@pytest.fixture(autouse=True)
def fresh():
    before = [dict(each) for each in (ADDED, RESTITUTION_LAWS)]
    yield
    for each, was in zip((ADDED, RESTITUTION_LAWS), before, strict=True):
        each.clear()
        each.update(was)


def given(function):
    impactfem.register(RestitutionLaw(function), name="mine", text="a test")


def scene(bodies, law, duration=0.012, gravity=(0.0, -9.81), **solve):
    one, other = [f"{bodies[0]['name'][0]}*", "floor"], {"between": ["rubber", "floor"]}
    return impactfem.Scene.from_dict({
        "title": "t", "duration": duration, "gravity": list(gravity), "body": bodies,
        "obstacle": [FLOOR], "contact": [{"between": one} | law] + [other] * (RUBBER in bodies[1:]),
        "solve": {"dt": 1e-3, "estimate": False} | solve,
    })  # fmt: skip


def points(*speeds):
    return [
        {"kind": "point", "name": f"p{k}", "mass": 1.0 + k, "position": [float(k), 0.0015 * v],
         "velocity": [0.0, -v]}
        for k, v in enumerate(speeds)
    ]  # fmt: skip


def test_each_contact_rebounds_by_its_own_speed():
    given(lambda speed, e: e / (1.0 + speed))
    speeds = np.array([0.25, 1.0, 4.0, 16.0])
    history = impactfem.solve(
        scene(points(*speeds), {"restitution": 0.9, "restitution_law": "mine"}, gravity=(0.0, 0.0))
    ).history
    after = [history[f"p{k}.vy"].values[-1] for k in range(4)]
    np.testing.assert_allclose(after, 0.9 * speeds / (1.0 + speeds), rtol=1e-12)


@pytest.mark.parametrize(
    ("bodies", "law", "solve"),
    [
        (points(1.0, 2.0), {"friction_coefficient": 0.3}, {}),
        ([BOX], {"friction_coefficient": 0.3}, {}),
        ([BOX], {"friction_coefficient": 0.3}, {"impact_law": "sequential"}),
        ([BOX, RUBBER], {"friction_coefficient": 0.3}, {}),
        ([BOX, RUBBER], {}, {"method": "explicit", "dt": 1e-4, "impact_law": "sequential"}),
    ],
)
def test_a_law_that_gives_the_number_changes_nothing(bodies, law, solve):
    asked = []

    def number(speed, e):
        asked.extend(speed)
        return e

    given(number)
    law["restitution"] = 0.6
    told = impactfem.solve(scene(bodies, law | {"restitution_law": "mine"}, **solve)).history
    plain = impactfem.solve(scene(bodies, dict(law), **solve)).history
    assert asked
    assert min(asked) > 0.0
    assert plain["contact_impulse"].values.max() > 0.0
    for name, column in plain.items():
        size = max(1e-3, float(np.nanmax(np.abs(column.values))))  # some are but rounding
        np.testing.assert_allclose(told[name].values, column.values, rtol=0.0, atol=1e-10 * size)


@pytest.mark.parametrize(
    ("function", "text"),
    [
        (lambda speed, e: e + speed, r"mine gives 1\.6 for an approach with 1 m/s; mend it"),
        (lambda speed, e: np.nan * speed * e, "mine gives nan for an approach"),
        (lambda speed, e: 0.5, r"mine gives an array of shape \(\) for speeds"),  # noqa: ARG005
    ],
)
def test_what_is_no_restitution_is_refused(function, text):
    given(function)
    law = {"restitution": 0.6, "restitution_law": "mine"}
    with pytest.raises(impactfem.SceneError, match=text):
        impactfem.solve(scene(points(1.0), law, gravity=(0.0, 0.0)))


@pytest.mark.parametrize(
    ("law", "solve", "text"),
    [
        ({"stiffness": 1e5}, {}, 'restitution_law = "mine" is not available with stiffness'),
        ({}, {"method": "event_driven"}, "restitution by mine"),
        ({"restitution_law": "yours"}, {}, 'restitution_law = "yours"'),
    ],
)
def test_where_it_is_not_known_it_is_refused(law, solve, text):
    given(lambda speed, e: e + 0.0 * speed)
    with pytest.raises(impactfem.SceneError, match=text):
        scene(points(1.0), {"restitution_law": "mine"} | law, **solve)


def test_names_are_taken_once_and_solids_need_none():
    given(lambda speed, e: e + 0.0 * speed)
    for name, text in (("newton", 'name = "newton" is taken by another law'), ("", "needs name")):
        with pytest.raises(impactfem.SceneError, match=text):
            impactfem.register(RestitutionLaw(lambda _, e: e), name=name, text="t")
    with pytest.raises(impactfem.SceneError, match="restitution_law"):
        scene([RUBBER], {"restitution_law": "mine"})
