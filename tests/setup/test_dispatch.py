"""Where the package asks which kind of body, obstacle or method it has before it: it may only fall.

Each such place is one that a new body, obstacle or method has to visit. Protocols and tables of
kinds answer the same question in one place.
"""

import ast
from collections import defaultdict
from pathlib import Path

import impactfem
from impactfem.methods import METHODS

KINDS = {
    "Bar", "Beam", "HalfSpace", "Point", "RigidBox", "RigidCylinder", "RigidPolyline",
    "RigidSphere", "Rod", "Solid", "Wall",
}  # fmt: skip
NAMES = {
    "bar", "beam", "box", "cylinder", "half_space", "leapfrog", "midpoint", "point", "polyline",
    "rod", "solid", "sphere", "wall", *METHODS,
}  # fmt: skip
FAMILIES = {"marches", "solver"}

MOST = {
    "a class of bodies or obstacles": 0,
    "a name of a kind or method": 2,
    "the first body": 2,
    "the kind": 4,
    "the family": 17,
}
"""Places of each sort. Lower them when some are gone; none may come."""


def names(node):
    for part in ast.walk(node):
        yield getattr(part, "id", getattr(part, "attr", ""))


OTHERS = {"dtype", "event"}
"""What has a `kind` that is none of a body, obstacle, method or what these consist of: the type of
an array's numbers, and whether a contact begins or ends."""


def is_kind(side):
    return (
        isinstance(side, ast.Attribute)
        and side.attr == "kind"
        and getattr(side.value, "id", getattr(side.value, "attr", "")) not in OTHERS
    )


def asks(node):
    """What a node asks for; nothing if it asks for no kind.

    Kinds of supports, shapes and faces count too, and who asks which solver a scene has.
    """
    what = ""
    match node:
        case ast.Call(func=ast.Name(id="isinstance" | "issubclass"), args=[_, classes]):
            what = "a class of bodies or obstacles" if KINDS & {*names(classes)} else ""
        case ast.MatchClass():
            what = "a class of bodies or obstacles" if KINDS & {*names(node.cls)} else ""
        case ast.Compare():
            sides = [node.left, *node.comparators]
            parts = [part for side in sides for part in ast.walk(side)]
            texts = {part.value for part in parts if isinstance(part, ast.Constant)}
            if any(map(is_kind, sides)):
                what = "the kind"
            elif NAMES & {text for text in texts if isinstance(text, str)}:
                what = "a name of a kind or method"
        case ast.Attribute(attr=name) if name in FAMILIES:
            what = "the family"
        case ast.Subscript(value=ast.Attribute(attr="bodies"), slice=ast.Constant()):
            what = "the first body"
    return what


def test_no_place_asks_anew_which_kind_it_has_before_it():
    root = Path(impactfem.__file__).parent
    found = defaultdict(list)
    for path in sorted(root.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if what := asks(node):
                found[what].append(f"{path.relative_to(root)}:{node.lineno}")
    for what, places in found.items():
        assert len(places) <= MOST[what], f"{what} is asked for in {len(places)} places: {places}"
