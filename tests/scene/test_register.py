"""What `impactfem.register` takes, and what it refuses."""

from typing import ClassVar

import numpy as np
import pytest

import impactfem
from impactfem.extend import (
    BarScheme,
    BodyKind,
    Name,
    Real,
    RigidObstacle,
    SolidScheme,
    key,
    rigid_in_plane,
    table,
)
from impactfem.extensions import ADDED
from impactfem.marching.schemes import SCHEMES, SOLID_SCHEMES
from impactfem.methods import METHODS
from impactfem.scene import schema
from impactfem.scene.contacts import RESTITUTION_LAWS
from impactfem.scene.content import BODIES
from impactfem.scene.obstacles import OBSTACLES


@pytest.fixture(autouse=True)
def fresh():
    lists = (ADDED, BODIES, OBSTACLES, METHODS, RESTITUTION_LAWS, SCHEMES, SOLID_SCHEMES)
    lists += (schema._TABLES,)
    before = [dict(each) for each in lists]
    yield
    for each, was in zip(lists, before, strict=True):
        each.clear()
        each.update(was)


def puck(**given):
    """A class of a body with one contact node."""

    class Puck(BodyKind):
        """A puck."""

        kind: ClassVar[str] = "puck"
        dim: ClassVar[int] = 2
        name: str = key(Name(), "name", default="puck")
        mass: float = key(Real(above=0), "mass", unit="kg", default=1.0)

        def system(self):
            return rigid_in_plane(
                self.name, mass=self.mass, inertia=1.0, center=(0.0, 1.0), arms=np.zeros((1, 2)),
                velocity=(0.0, 0.0, 0.0), radius=0.1, lines=np.zeros((0, 2), dtype=int),
                words="a puck",
            )  # fmt: skip

    Puck.__qualname__ = "Puck"
    for name, value in given.items():
        setattr(Puck, name, value)
    return Puck


def test_a_registered_body_is_read_written_and_described():
    made = impactfem.register(table()(puck()))
    data = {
        "title": "t", "duration": 1.0, "body": [{"kind": "puck", "mass": 2.0}],
        "obstacle": [{"kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}],
    }  # fmt: skip
    scene = impactfem.Scene.from_dict(data)
    assert scene.bodies == (made(mass=2.0),)
    assert scene.said == ("body puck", "obstacle half_space")
    assert impactfem.Scene.from_dict(scene.to_dict()) == scene
    given = {"bodies": [made(mass=2.0)], "obstacles": scene.obstacles}
    assert impactfem.Scene(title="t", duration=1.0, **given) == scene
    with pytest.raises(impactfem.SceneError, match=r"body\[0\].mass = -1.0 is not allowed"):
        scene.with_settings({"body.puck.mass": -1.0})
    assert '[[body]] with kind = "puck"' in [name for name, _ in schema.describe()]


def test_a_class_that_is_written_again_replaces_the_one_before():
    impactfem.register(table()(puck()))
    again = table()(puck())
    assert impactfem.register(again) is again
    assert BODIES["puck"] is again


def test_names_that_are_taken_are_refused():
    with pytest.raises(impactfem.SceneError, match=r'Puck.kind = "rod" is taken by impactfem.*Rod'):
        impactfem.register(table()(puck(kind="rod")))
    impactfem.register(table()(puck()))
    with pytest.raises(impactfem.SceneError, match=r'Puck.kind = "puck" is taken by .*\.Puck'):
        impactfem.register(table()(puck(__module__="another")))
    assert {"body puck": __name__} == ADDED


@pytest.mark.parametrize(
    ("given", "lacks"),
    [
        ({"kind": None}, "kind"),
        ({"kind": "two words"}, "kind"),
        ({"system": None}, "system"),
        ({"dim": None}, "dim"),
    ],
)
def test_a_body_without_what_is_needed_is_refused(given, lacks):
    made = puck(**given)
    if given == {"system": None}:
        del made.system
    if given == {"dim": None}:
        del made.dim
    with pytest.raises(impactfem.SceneError, match=f"register: Puck lacks {lacks}"):
        impactfem.register(table()(made))
    assert "puck" not in BODIES


def test_schemes_need_a_name_of_their_own_and_a_text():
    scheme = SolidScheme("midpoint", massless=True, contact="middle")
    for given, message in (
        ({"text": "t"}, "a method needs name"),
        ({"name": "mine"}, "a method needs text"),
        ({"name": "massless", "text": "t"}, 'name = "massless" is taken'),
    ):
        with pytest.raises(impactfem.SceneError, match=message):
            impactfem.register(scheme, **given)
    assert impactfem.register(scheme, name="mine", text="t") is scheme
    impactfem.register(BarScheme("newmark"), name="mine", text="of this module again")
    assert METHODS["mine"].bodies == {"bar"}
    assert impactfem.Solve(method="mine").method == "mine"
    with pytest.raises(impactfem.SceneError, match='"mi" is not known'):
        impactfem.Solve(method="mi")


def test_a_class_that_is_no_table_is_refused():
    with pytest.raises(impactfem.SceneError, match=r"Puck is no table: write @table\(\)"):
        impactfem.register(puck())
    with pytest.raises(impactfem.SceneError, match="neither a body"):
        impactfem.register(3)

    @table()
    class Nameless(BodyKind):
        kind: ClassVar[str] = "nameless"
        dim: ClassVar[int] = 2

        def system(self):
            """None."""

    with pytest.raises(impactfem.SceneError, match="Nameless lacks the key name"):
        impactfem.register(Nameless)


@pytest.mark.parametrize("lacks", ["gap", "is_image", "outline"])
def test_an_obstacle_without_what_is_needed_is_refused(lacks):
    methods = {name: lambda *_: None for name in ("gap", "is_image", "outline") if name != lacks}
    fields = {"name": key(Name(), "name", default="thing"), "kind": "thing"}
    made = type("Thing", (RigidObstacle,), fields | methods)
    made.__annotations__ = {"name": str, "kind": ClassVar[str]}
    with pytest.raises(impactfem.SceneError, match=f"Thing lacks {lacks}"):
        impactfem.register(table()(made))
    assert "thing" not in OBSTACLES


@pytest.mark.parametrize(("shown", "where"), [("outline", "the plane"), ("faces", "space")])
def test_an_obstacle_that_pictures_cannot_show_is_refused(shown, where):
    class Line(RigidObstacle):
        kind: ClassVar[str] = "line"
        name: str = key(Name(), "name", default="line")

        def gap(self, points):
            return points[:, 1], np.tile([0.0, 1.0], (len(points), 1))

        def is_image(self, other, mirror):  # noqa: ARG002
            return False

    setattr(Line, shown, lambda *_: {})
    impactfem.register(table()(Line))
    ball = {"kind": "point", "mass": 1.0}
    data = {"title": "t", "duration": 1.0, "body": [ball], "obstacle": [{"kind": "line"}]}
    fits, fails = [0.0, 1.0], [0.0, 1.0, 0.0]
    if shown == "faces":
        fits, fails = fails, fits
    with pytest.raises(impactfem.SceneError, match=f"is one of {where}"):
        impactfem.Scene.from_dict(data | {"body": [ball | {"position": fails}]})
    assert impactfem.Scene.from_dict(data | {"body": [ball | {"position": fits}]}).marches


def test_a_body_whose_places_are_not_told_is_not_held():
    impactfem.register(table()(puck(takes_joints=True)))
    pin = {"kind": "revolute", "between": ["puck", "ground"], "point": [0.0, 1.0]}
    data = {"title": "t", "duration": 1.0, "body": [{"kind": "puck"}], "joint": [pin]}
    with pytest.raises(impactfem.SceneError, match=r"puck: joints .* give Lumped\(section"):
        impactfem.solve(impactfem.Scene.from_dict(data))
