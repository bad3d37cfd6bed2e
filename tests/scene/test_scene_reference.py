"""The description of the language, from which the scene reference is made."""

import inspect
from dataclasses import fields

from impactfem import scene as language
from impactfem.scene import Bar, Output, Scene, Solid, Solve, Support, describe
from impactfem.scene.contacts import Adhesion
from impactfem.scene.controllers import Foot, Hip, LinearModel, Noise, Task
from impactfem.scene.damping import Damping
from impactfem.scene.drop import Drop
from impactfem.scene.schema import TableDoc, keys_of
from impactfem.scene.trajectory import Cost, TrajectoryKeys

TABLES = {
    '[[body]] with kind = "bar"': Bar,
    '[[body]] with kind = "solid"': Solid,
    '[[body]] with kind = "point"': language.Point,
    '[[body]] with kind = "rod"': language.Rod,
    '[[body]] with kind = "beam"': language.Beam,
    '[[body]] with kind = "rigid"': language.RigidBody,
    '[[body]] with kind = "mechanism"': language.Mechanism,
    '[[body]] with kind = "springs"': language.SpringNet,
    '[[body]] with kind = "plate"': language.Plate,
    '[[obstacle]] with kind = "box"': language.RigidBox,
    '[[obstacle]] with kind = "cylinder"': language.RigidCylinder,
    '[[obstacle]] with kind = "half_space"': language.HalfSpace,
    '[[obstacle]] with kind = "mesh"': language.RigidMesh,
    '[[obstacle]] with kind = "polyline"': language.RigidPolyline,
    '[[obstacle]] with kind = "sphere"': language.RigidSphere,
    '[[obstacle]] with kind = "wall"': language.Wall,
    "[[contact]]": language.Contact,
    "[[joint]]": language.Joint,
    "[[spring]]": language.SpringElement,
    "[[tie]]": language.Tie,
    "[[point_mass]]": language.PointMass,
    "[[probe]]": language.Probe,
    "[[parameter]]": language.Parameter,
    "[[control]]": language.Control,
    "[[controller]]": language.Controller,
    "[[measure]]": language.Measure,
    "[objective]": language.Objective,
    "[trajectory]": TrajectoryKeys,
    "[drop]": Drop,
    "[solve]": Solve,
    "[output]": Output,
    "supports = [{ ... }]": Support,
    "supports = [{ end = ... }]": language.BeamSupport,
    "supports = [{ edge = ... }]": language.EdgeSupport,
    "tractions = [{ ... }]": language.Traction,
    "pressures = [{ ... }]": language.Pressure,
    "pressures = [{ face = ... }]": language.FacePressure,
    'outline = { kind = "rectangle" }': language.RectangleOutline,
    'outline = { kind = "disc" }': language.DiscOutline,
    'outline = { kind = "ring" }': language.RingOutline,
    'outline = { kind = "polygon" }': language.PolygonOutline,
    'shape = { kind = "block" }': language.Block,
    'shape = { kind = "disc" }': language.Disc,
    'shape = { kind = "ring" }': language.Ring,
    'shape = { kind = "cylinder" }': language.Cylinder,
    'shape = { kind = "sphere" }': language.Sphere,
    'shape = { kind = "capsule" }': language.Capsule,
    'shape = { kind = "hull" }': language.Hull,
    'shape = { kind = "ellipsoid" }': language.Ellipsoid,
    "refine = [{ ... }]": language.Refinement,
    "springs = [{ ... }]": language.Spring,
    "orientation = { ... }": language.Orientation,
    "rotation = { ... }": language.Rotation,
    "joints = { NAME = { ... } }": language.JointStart,
    "place = { ... }": language.Place,
    "soft = { ... }": language.Soft,
    "materials = { NAME = { ... } }": language.Material,
    "orthotropic = { e1 = ..., e3 = ... }": language.OrthotropicSolid,
    "orthotropic = { e1 = ... }": language.Orthotropic,
    "layers = [{ thickness = ... }]": language.Layer,
    "damping = { ... }": Damping,
    "model = { ... }": LinearModel,
    "noise = { ... }": Noise,
    "minimise = [{ ... }]": language.Term,
    "constraints = [{ ... }]": language.Limit,
    "cost = [{ ... }]": Cost,
    "end_loads = [{ end = ... }]": language.EndLoad,
    "adhesion = { ... }": Adhesion,
    "hip = { ... }": Hip,
    "tasks = [{ ... }]": Task,
    "feet = [{ ... }]": Foot,
    "terms = [{ mu = ... }]": language.OgdenTerm,
    'viscoelastic = { kind = "kelvin_voigt" }': language.KelvinVoigt,
    "terms = [{ ... }]": language.MaxwellTerm,
    'viscoelastic = { kind = "maxwell" }': language.Maxwell,
}


TOLD = {"folder", "wall_stiffness"}
"""Fields that are no keys: the scene tells them."""
OTHERWISE = {
    (language.Parameter, "path"): "key", (language.Controller, "law"): "kind",
     (language.Control, "course"): "kind",
    (language.Objective, "searched_by"): "solver", (language.Control, "begin"): "from",
    (language.Control, "end"): "until", (language.Limit, "least"): "min",
    (language.Limit, "most"): "max",
}  # fmt: skip
"""Keys whose field has another name."""


def test_every_table_and_key_is_described():
    tables = {table.name: [row.key for row in table.keys] for table in describe()}
    assert list(tables) == ["top level", *TABLES]
    assert tables["top level"] == [
        "title",
        "duration",
        "gravity",
        "start",
        "body",
        "obstacle",
        "contact",
        "joint",
        "spring",
        "tie",
        "point_mass",
        "probe",
        "parameter",
        "control",
        "controller",
        "measure",
        "objective",
        "trajectory",
        "drop",
        "solve",
        "output",
    ]
    for heading, cls in TABLES.items():
        names = (field.name for field in fields(cls) if field.name not in {"kind", *TOLD})
        expected = [key for name in names if (key := OTHERWISE.get((cls, name), name)) != "kind"]
        assert [key for key in tables[heading] if key != "kind"] == expected
    assert tables['[[body]] with kind = "bar"'][0] == "kind"


def test_every_row_is_complete():
    for table in describe():
        assert isinstance(table, TableDoc)
        for row in table.keys:
            assert all(isinstance(entry, str) for entry in row)
            assert all((row.key, row.type, row.default, row.doc, row.allowed))


def test_some_rows():
    rows = {(table.name, row.key): row for table in describe() for row in table.keys}
    length = rows['[[body]] with kind = "bar"', "length"]
    assert length == ("length", "number", "m", "required", "length L of the bar", "a number > 0")
    assert rows['[[body]] with kind = "bar"', "far_end"].default == '"free"'
    assert rows["[solve]", "elements"].default == "chosen by the plan"
    assert rows["[solve]", "tolerance"].allowed == "a number > 0 and < 1"
    assert rows["[output]", "fields"].default == '["vtkhdf"]'
    assert rows["top level", "gravity"].unit == "m/s^2"
    solid = '[[body]] with kind = "solid"'
    assert rows[solid, "contact_surfaces"].default == "every surface that can"
    assert rows[solid, "supports"].type == "list of tables"
    assert rows[solid, "supports"].default == "[]"
    assert rows['shape = { kind = "disc" }', "center"].default == "origin"
    assert rows["supports = [{ ... }]", "kind"].allowed == '"fixed" or "symmetry" or "motion"'


def test_arguments_are_the_keys():
    for cls in (Scene, *TABLES.values()):
        assert set(inspect.signature(cls).parameters) - TOLD == set(keys_of(cls))


def test_no_signature_is_written_by_hand():
    """Type checkers learn what may be given from the annotations of the keys."""
    for cls in (Scene, *TABLES.values()):
        assert "__init__" not in inspect.getsource(cls)
