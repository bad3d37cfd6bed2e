"""Sphinx configuration; writes the tables that come from the code into generated/ first."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import impactfem
from impactfem.result.history import COLUMNS
from impactfem.scene.schema import describe

project = "impactfem"
author = "The impactfem developers"
copyright = author  # noqa: A001  (the name that Sphinx reads)
version = release = impactfem.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build", "generated", "limits_table.md"]
suppress_warnings = ["config.cache"]

html_theme = "furo"
html_title = f"impactfem {version}"

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
# Docstrings are plain text with code in single backticks.
default_role = "code"
napoleon_google_docstring = True
napoleon_numpy_docstring = False

GENERATED = Path(__file__).parent / "generated"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table; bars inside a cell are escaped."""
    lines = [head, ["---"] * len(head), *rows]
    cells = ([cell.replace("|", "\\|") for cell in line] for line in lines)
    return "".join("| " + " | ".join(line) + " |\n" for line in cells)


def code(text: str) -> str:
    """Text as code, nothing as nothing."""
    return f"`{text}`" if text else ""


def scene_reference() -> str:
    """Every table and key of the scene language, from the schema that reads scenes."""
    parts = []
    for group in describe():
        rows = [
            (
                code(row.key), row.doc, row.unit,
                row.default if row.default.isalpha() or " " in row.default else code(row.default),
                row.allowed,
            )
            for row in group.keys
        ]  # fmt: skip
        title = "Top level" if group.name == "top level" else f"`{group.name}`"
        parts.append(f"## {title}\n\n")
        parts.append(table(("key", "meaning", "unit", "default", "allowed"), rows) + "\n")
    return "".join(parts)


def history_columns() -> str:
    """Columns of a history, from the module that writes it."""
    rows = [(code("time"), "s", "end of layer m; row 0 is the initial state")]
    rows += [(code(name), unit, text) for name, (unit, text) in COLUMNS.items()]
    rows += [
        (code("NAME.x"), "m", "centre of mass of body NAME; likewise `NAME.y`, `NAME.z`"),
        (code("NAME.vx"), "m/s", "its velocity; likewise `NAME.vy`, `NAME.vz`"),
    ]
    return table(("column", "unit", "meaning"), rows)


def setup(app: Any) -> None:
    """Take bars in docstrings for absolute values, not for substitutions."""

    def escape(*event: Any) -> None:
        lines = event[-1]
        lines[:] = [line.replace("|", "\\|") for line in lines]

    # Before napoleon (500), which writes markup of its own.
    app.connect("autodoc-process-docstring", escape, priority=400)


GENERATED.mkdir(exist_ok=True)
for name, text in (("scene", scene_reference()), ("columns", history_columns())):
    (GENERATED / f"{name}.md").write_text(text, encoding="utf-8")
