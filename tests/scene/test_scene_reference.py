"""The description of the language, from which the scene reference is made."""

from dataclasses import fields

from impactfem.scene import Bar, Output, Scene, Solve, Wall, describe
from impactfem.scene.schema import TableDoc, keys_of


def test_every_table_and_key_is_described():
    tables = {table.name: [row.key for row in table.keys] for table in describe()}
    assert list(tables) == [
        "top level",
        '[[body]] with kind = "bar"',
        '[[obstacle]] with kind = "wall"',
        "[solve]",
        "[output]",
    ]
    assert tables["top level"] == [
        "title",
        "duration",
        "gravity",
        "body",
        "obstacle",
        "solve",
        "output",
    ]
    for heading, cls in zip(list(tables)[1:], (Bar, Wall, Solve, Output), strict=True):
        expected = [field.name for field in fields(cls)]
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


def test_signatures_for_type_checkers_agree_with_the_keys():
    """`Bar` and `Scene` tell type checkers their arguments by hand; none may be forgotten."""
    import ast
    import inspect

    for cls in (Bar, Scene):
        tree = ast.parse(inspect.getsource(cls))
        (init,) = [
            node
            for node in ast.walk(tree)
            if isinstance(node, ast.FunctionDef) and node.name == "__init__"
        ]
        by_hand = {arg.arg for arg in init.args.kwonlyargs}
        assert by_hand - {"folder"} == set(keys_of(cls))
