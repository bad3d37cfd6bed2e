"""Controls and controllers act on loads of solids by the names of their surfaces."""

import pytest

from impactfem import Scene, SceneError

STRIP = {
    "kind": "solid", "name": "strip", "model": "plane_strain", "mesh_size": 0.05,
    "shape": {"kind": "block", "size": [0.1, 0.02], "corner": [0.0, 0.0]},
    "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.3,
    "tractions": [{"surface": "right", "value": ["3*t", "0"]}],
    "supports": [{"surface": "left", "kind": "motion", "value": ["0.1*t", ""]}],
}  # fmt: skip


def acted(acts, heading="control", **more):
    given = {"name": "push", "acts": acts} | more
    return Scene.from_dict({"title": "acted", "duration": 1.0, "body": [STRIP], heading: [given]})


@pytest.mark.parametrize(
    ("acts", "key", "texts"),
    [
        ("traction.right.x", "tractions", {"right": ["(3*t) + push", "0"]}),
        ("traction.top.y", "tractions", {"right": ["3*t", "0"], "top": ["0.0", "push"]}),
        ("motion.left.x", "supports", {"left": ["(0.1*t) + push", None]}),
    ],
)
def test_loads_are_named_by_their_surface(acts, key, texts):
    for words in (f"body.strip.{acts}", f"body.0.{acts}"):
        (body,) = acted(words).bodies
        found = {e.surface: [v and v.text for v in e.value] for e in getattr(body, key)}
        assert found == texts


def test_pressures_and_controllers_too():
    (body,) = acted("body.strip.pressure.top").bodies
    assert [(each.surface, each.value.text) for each in body.pressures] == [("top", "push")]
    law = {"kind": "p", "of": "strip.x", "kp": 2.0}
    (body,) = acted("body.strip.traction.bottom.x", "controller", **law).bodies
    assert [each.surface for each in body.tractions] == ["right", "bottom"]


@pytest.mark.parametrize(
    ("acts", "told"),
    [
        ("body.strip.traction.nose.x", '"nose" is not a surface'),
        ("body.strip.traction.right.z", "no entry of a list of 2"),
        ("body.strap.traction.right.x", 'there is no "strap"'),
        ("body.strip.motion.right.x", 'there is no "right"'),
    ],
)
def test_what_is_not_there_is_said(acts, told):
    with pytest.raises(SceneError, match=told):
        acted(acts)
