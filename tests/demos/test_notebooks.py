"""The notebooks, kept as text: cells are what jupytext reads, and each shows what it ends with.

The quickest is run here, one of a plate with the slow tests; `.ci/run demos` runs each as a script.
"""

import ast
import re
import runpy
from io import BytesIO
from pathlib import Path

import pytest
from matplotlib.figure import Figure

TOP = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((TOP / "demos" / "notebooks").glob("*.py"))
SHOWN = {"thrown_ball": (), "plate_switch": pytest.mark.slow}
MARK = re.compile(r"^# %%( \[markdown\])?\n", re.MULTILINE)


def cells(path):
    """Words and code of the cells, in their order: (is it code, text)."""
    head, *parts = MARK.split(path.read_text(encoding="utf-8"))
    assert not head
    return [(kind is None, text) for kind, text in zip(parts[::2], parts[1::2], strict=True)]


def show(value, shown):
    """Keep what a notebook would show of a value, by the name of its class."""
    if isinstance(value, Figure):
        picture = BytesIO()
        value.savefig(picture)
        shown["Figure"] = picture.getvalue()
    elif value is not None:  # as print
        shown[type(value).__name__] = value._repr_html_()


def run(path, folder):
    """Run all cells in turn; what they show."""
    script, shown = folder / path.name, {}
    parts = []
    for is_code, text in cells(path):
        tree = ast.parse(text if is_code else "")
        if tree.body and isinstance(tree.body[-1], ast.Expr):
            last = ast.unparse(tree.body.pop())
            tree.body += ast.parse(f"show({last})").body
        parts.append(ast.unparse(tree))
    script.write_text("\n".join(parts), encoding="utf-8")
    runpy.run_path(str(script), {"show": lambda value: show(value, shown)})
    return shown


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_cells_of_words_and_code(path):
    read = cells(path)
    words = [text for is_code, text in read if not is_code]
    assert read[0][1].startswith("# # ")
    assert all(line[:1] in {"", "#"} for text in words for line in text.splitlines())
    code = [text for is_code, text in read if is_code]
    assert all(ast.parse(text).body for text in code)
    assert 'summary["error"]' in "".join(code)


def test_notebooks_are_listed():
    page = (TOP / "docs" / "howto" / "notebooks.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `(\w+)\.py`", page, re.MULTILINE)
    assert {path.stem for path in NOTEBOOKS} == set(listed)


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=SHOWN[path.stem], id=path.stem)
        for path in NOTEBOOKS
        if path.stem in SHOWN
    ],
)
def test_a_notebook_shows_cards_and_curves(path, tmp_path):
    shown = run(path, tmp_path)
    assert "<table" in shown["Result"]
    assert len(shown["Figure"]) > 4096
