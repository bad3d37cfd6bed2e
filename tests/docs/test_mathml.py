"""Formulas of the pages become MathML, all of them."""

import html
import re
from pathlib import Path

import pytest

pytest.importorskip("sphinx")

import mathml
from docutils import nodes

TOP = Path(__file__).resolve().parents[2]


def shown(tex):
    return mathml.mathml(nodes.math("", tex), as_block=False)


@pytest.mark.parametrize(
    ("tex", "same"),
    [
        (r"\frac12 a", r"\frac{1}{2} a"),
        (r"\tfrac34", r"\tfrac{3}{4}"),
        (r"1, \dots, n", r"1, \ldots, n"),
        (r"\big(a\big)", r"\bigl(a\bigr)"),
        (r"\Big[a\Big]", r"\Bigl[a\Bigr]"),
        (r"\sin x", r"\sin\,x"),
        (r"a = b \tag{3}", r"a = b \qquad\text{(3)}"),
    ],
)
def test_what_docutils_does_not_know_is_written_out(tex, same):
    assert "<math" in shown(tex)
    assert shown(tex) == shown(same)


def test_brackets_after_a_function_stay_close():
    assert mathml.known(r"\sin\left(x\right)") == r"\sin\left(x\right)"


def test_a_formula_keeps_its_symbols():
    text = html.unescape(re.sub(r"<[^>]*>|\s", "", shown(r"0 \le \lambda \perp u \ge 0")))
    assert text.replace("⟂", "⊥") == "0≤λ⊥u≥0"


def test_what_cannot_be_shown_is_shown_as_code():
    assert shown(r"\nosuchcommand < 1") == r"<code>\nosuchcommand &lt; 1</code>"


def test_the_formulas_of_all_pages_can_be_shown():
    found = 0
    for page in [*TOP.glob("docs/*.md"), *TOP.glob("demos/*/README.md")]:
        text = page.read_text(encoding="utf-8")
        text = re.sub(r"^```.*?^```|`[^`]*`", "", text, flags=re.MULTILINE | re.DOTALL)
        blocks = re.findall(r"\$\$(.+?)\$\$", text, flags=re.DOTALL)
        rest = re.sub(r"\$\$(.+?)\$\$", "", text, flags=re.DOTALL)
        for tex in [*blocks, *re.findall(r"(?<![\\\d])\$(?!\s)([^$\n]+?)(?<!\s)\$(?!\d)", rest)]:
            assert "<math" in mathml.tex2mathml(mathml.known(tex))
            found += 1
    assert found > 500
