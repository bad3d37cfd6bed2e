"""Render formulas as MathML, which browsers show by themselves: no script, no network.

docutils translates; what TeX allows and docutils does not know is written out first.
"""

import re
from html import escape
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

LOGGER = logging.getLogger(__name__)
DIGITS = re.compile(r"\\(t|d)?frac\s*(\d)\s*(\d)")
REWRITTEN = (
    (re.compile(r"\\tag\{([^}]*)\}"), r"\\qquad\\text{(\1)}"),
    (re.compile(r"\\dots\b"), r"\\ldots"),
    (
        re.compile(r"\\(sin|cos|tan|exp|log|ln|max|min)(?=\s*\\?[A-Za-z])(?!\\left|\\[bB]ig)"),
        r"\\\1\\,",
    ),
    # The parser knows the sizes of opening and closing brackets only.
    (re.compile(r"\\(big|Big|bigg|Bigg)(?=\s*[(\[])"), r"\\\1l"),
    (re.compile(r"\\(big|Big|bigg|Bigg)(?=\s*[)\]|])"), r"\\\1r"),
)


def known(tex: str) -> str:
    """TeX in words that docutils knows."""
    tex = DIGITS.sub(lambda found: rf"\{found[1] or ''}frac{{{found[2]}}}{{{found[3]}}}", tex)
    for pattern, text in REWRITTEN:
        tex = pattern.sub(text, tex)
    return tex.strip()


def mathml(node: nodes.Element, as_block: bool) -> str:
    """A formula as MathML; with a warning as code if it cannot be translated."""
    tex = node.astext()
    try:
        found: str = tex2mathml(known(tex), as_block=as_block)
    except MathError as fault:
        LOGGER.warning("formula %r: %s", tex, fault, location=node)
        return f"<code>{escape(tex)}</code>"
    return found


def _inline(translator: Any, node: nodes.Element) -> None:
    translator.body.append(mathml(node, as_block=False))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.Element) -> None:
    translator.body.append(translator.starttag(node, "div", CLASS="math"))
    translator.body.append(mathml(node, as_block=True) + "</div>\n")
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, Any]:
    """Register the renderer; `html_math_renderer = "mathml"` chooses it."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
