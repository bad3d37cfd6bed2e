"""Signatures and docstrings of the Python interface, made ready for Sphinx."""

import re
from typing import Any

COLON = "\N{SYMBOL FOR UNIT SEPARATOR}"  # stands for a colon that separates nothing


def protect(*event: Any) -> None:
    """Take bars for absolute values, and the first line of a property for text without a type."""
    what, lines = event[1], event[-1]
    lines[:] = [line.replace("|", "\\|") for line in lines]
    if what == "property" and lines:
        lines[0] = lines[0].replace(":", COLON)


def restore(*event: Any) -> None:
    """Put back what `protect` has hidden."""
    event[-1][:] = [line.replace(COLON, ":") for line in event[-1]]


def plain_signature(*event: Any) -> tuple[str | None, str | None]:
    """A signature without what is no Python: marks of required keys, long defaults."""
    signature, returned = event[-2:]
    if signature:
        signature = re.sub(r"\s*=\s*<required>", "", signature)
        inner = r"[^()]*(?:\([^()]*\)[^()]*)*"
        signature = re.sub(rf"= (Solve|Output)\({inner}\)", r"= \1()", signature)
    return signature, returned


def setup(app: Any) -> None:
    """Wrap napoleon (priority 500), which writes markup of its own."""
    app.connect("autodoc-process-signature", plain_signature)
    app.connect("autodoc-process-docstring", protect, priority=400)
    app.connect("autodoc-process-docstring", restore, priority=600)
