"""Blocks of the how-to pages, which tests run too."""

import re
from pathlib import Path

HOWTO = Path(__file__).resolve().parents[2] / "docs" / "howto"
_FLAGS = re.MULTILINE | re.DOTALL


def block(page, caption):
    """Text of the block of a page that has a caption."""
    text = (HOWTO / f"{page}.md").read_text("utf-8")
    found = re.search(rf"^```.*\n:caption: {re.escape(caption)}\n(.*?)^```$", text, _FLAGS)
    return found[1]
