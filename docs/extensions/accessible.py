"""Make written pages readable by screen readers and keys: what axe finds in theme and docutils."""

import re
from html import escape
from pathlib import Path
from typing import Any

PLAIN = (
    ('<p class="caption" role="heading">', '<p class="caption" role="heading" aria-level="2">'),
    ('<aside class="sidebar-drawer">', '<aside class="sidebar-drawer" aria-label="Pages">'),
    ('<aside class="toc-drawer">', '<aside class="toc-drawer" aria-label="On this page">'),
    # What scrolls.
    ("<pre>", '<pre tabindex="0">'),
    ('<div class="math">', '<div class="math" tabindex="0">'),
    ('<div class="table-wrapper colwidths-auto docutils container">',
     '<div class="table-wrapper colwidths-auto docutils container" tabindex="0">'),
    ('<th class="head"><p></p></th>', '<td class="head"></td>'),
    ('<div role="list" class="citation-list">', '<div class="citation-list">'),
    (' role="doc-biblioentry"', ""),
)  # fmt: skip
# Parameters of a long signature, a line each, are no definitions.
PARAMETERS = re.compile(r"<dl>\n((?:<dd>(?:(?!<dl>).)*?</dd>\n?)+)</dl>", re.DOTALL)
HIDDEN = '<{0} class="visually-hidden">{1}</{0}>'
MAIN = re.compile(r'<article [^>]*id="furo-main-content"[^>]*>')
FORMULA = re.compile(r'<th class="head"><p>(<math.*?</math>)</p></th>', re.DOTALL)


def repaired(page: str) -> str:
    """A page of HTML without what axe finds; one that has been repaired stays as it is."""
    for old, new in PLAIN:
        page = page.replace(old, new)
    page = PARAMETERS.sub(
        lambda found: f'<div class="sig-lines">{re.sub("(</?)dd>", r"\1div>", found[1])}</div>',
        page,
    )

    def named(found: re.Match[str]) -> str:
        said = " ".join(re.sub(r"<[^>]*>", " ", found[1]).split())
        formula = found[1].replace("<math", '<math aria-hidden="true"', 1)
        return f'<th class="head"><p>{formula}{HIDDEN.format("span", escape(said))}</p></th>'

    page = FORMULA.sub(named, page)
    if "<h1" not in page:  # the page of the search
        page = MAIN.sub(lambda found: found[0] + HIDDEN.format("h1", "Search"), page, count=1)
    return page


def repair(app: Any, fault: Exception | None) -> None:
    """Repair all pages of a build that went well."""
    if fault or app.builder.format != "html":
        return
    for name in (*app.env.found_docs, "genindex", "search"):
        path = Path(app.builder.get_outfilename(name))
        if path.is_file():
            text = path.read_text(encoding="utf-8")
            if (new := repaired(text)) != text:
                path.write_text(new, encoding="utf-8")


def setup(app: Any) -> None:
    """Repair pages when they are written."""
    app.connect("build-finished", repair)
