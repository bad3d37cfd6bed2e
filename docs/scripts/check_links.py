"""Check all links without a network: files and anchors exist, external addresses are well formed.

    python docs/scripts/check_links.py [HTML_FOLDER]

Looks at all Markdown files of the repository and, if given, at all pages of the built documentation
(`report.html` of the gallery, which links nowhere, is only looked for). Ends with status 1 and a
list of what is broken.
"""

import os
import re
import sys
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

TOP = Path(__file__).resolve().parents[2]
SKIPPED = {"_build", "build", "dist", "generated", "node_modules", "results"}
ATTRIBUTES = {"a": "href", "img": "src", "link": "href", "script": "src", "source": "src"}
CODE = re.compile(r"^(`{3,}|~{3,})[^\n]*\n.*?^\1\s*$|`[^`\n]+`", flags=re.MULTILINE | re.DOTALL)
FENCE = re.compile(r"^(`{3,}|~{3,})[^\n]*\n.*?^\1\s*$", flags=re.MULTILINE | re.DOTALL)
# Targets may hold one pair of parentheses.
LINK = re.compile(r"\]\(\s*<?((?:[^()\s<>]|\([^()\s]*\))+)>?(?:\s+\"[^\"]*\")?\s*\)")


def is_well_formed(address: str) -> bool:
    """Whether an external address could lead anywhere."""
    parts = urlsplit(address)
    if parts.scheme == "mailto":
        return re.fullmatch(r"[^@\s]+@[^@\s]+\.[^@\s]+", parts.path) is not None
    host = parts.hostname or ""
    return parts.scheme in {"http", "https"} and re.fullmatch(r"[\w.-]+\.\w+", host) is not None


def is_external(address: str) -> bool:
    """Whether an address has a scheme, or names a host."""
    return re.match(r"[a-zA-Z][a-zA-Z0-9+.-]*:|//", address) is not None


class _Page(HTMLParser):
    """Links and anchors of an HTML page."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what the tag links to and what it is called."""
        found = dict(attrs)
        self.anchors.update(value for key in ("id", "name") if (value := found.get(key)))
        target = found.get(ATTRIBUTES.get(tag, ""))
        if target and "preconnect" not in (found.get("rel") or ""):
            self.links.append(target)


@cache
def html_page(path: Path) -> _Page:
    """A parsed page."""
    page = _Page()
    page.feed(path.read_text(encoding="utf-8"))
    return page


def slug(heading: str) -> str:
    """Anchor of a heading, as GitHub and MyST make it."""
    text = re.sub(r"!?\[([^]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")


@cache
def markdown_anchors(path: Path) -> frozenset[str]:
    """Anchors of a Markdown page: headings (numbered if repeated), labels, ids."""
    text = FENCE.sub("", path.read_text(encoding="utf-8"))
    found: set[str] = set(re.findall(r"^\(([\w-]+)\)=", text, flags=re.MULTILINE))
    found.update(re.findall(r"\bid=\"([^\"]+)\"", text))
    for heading in re.findall(r"^#{1,6} (.+)$", text, flags=re.MULTILINE):
        name, number = slug(heading), 0
        while (numbered := f"{name}-{number}" if number else name) in found:
            number += 1
        found.add(numbered)
    return frozenset(found)


def broken_in_html(folder: Path) -> Iterator[str]:
    """Broken links of built pages."""
    for path in sorted(folder.rglob("*.html")):
        if path.name == "report.html":
            continue
        for link in html_page(path).links:
            if is_external(link):
                if not link.startswith(("data:", "javascript:")) and not is_well_formed(link):
                    yield f"{path}: {link}: not a well-formed address"
                continue
            parts = urlsplit(link)
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if target.is_dir():
                target /= "index.html"
            has_anchors = target.suffix == ".html" and target.name != "report.html"
            anchor = unquote(parts.fragment)
            if not target.is_file():
                yield f"{path}: {link}: there is no such file"
            elif anchor and has_anchors and anchor not in html_page(target).anchors:
                yield f"{path}: {link}: there is no such anchor"


def markdown_files(top: Path) -> Iterator[Path]:
    """Markdown files of a repository, without what is generated or hidden."""
    for folder, names, files in os.walk(top):
        names[:] = sorted(n for n in names if n not in SKIPPED and not n.startswith("."))
        yield from (Path(folder) / name for name in sorted(files) if name.endswith(".md"))


def broken_in_markdown(top: Path) -> Iterator[str]:
    """Broken links of Markdown files; those into generated pages count where these exist."""
    for path in markdown_files(top):
        for link in LINK.findall(CODE.sub("", path.read_text(encoding="utf-8"))):
            if is_external(link):
                if not is_well_formed(link):
                    yield f"{path}: {link}: not a well-formed address"
                continue
            name, _, anchor = unquote(link).partition("#")
            target = (path.parent / name).resolve() if name else path
            generated = "generated" in target.parts and not (top / "docs" / "generated").is_dir()
            if not target.exists() and not generated:
                yield f"{path}: {link}: there is no such file"
            elif anchor and target.suffix == ".md" and target.is_file():
                # Pages that include others have their headings too; the built page is checked.
                includes = "{include}" in target.read_text(encoding="utf-8")
                if anchor not in markdown_anchors(target) and not includes:
                    yield f"{path}: {link}: there is no such anchor"


def main() -> None:
    """Check and report."""
    faults = list(broken_in_markdown(TOP))
    if len(sys.argv) > 1:
        faults += broken_in_html(Path(sys.argv[1]).resolve())
    if faults:
        sys.exit("\n".join([*faults, f"{len(faults)} broken links"]))
    print("all links lead somewhere")


if __name__ == "__main__":
    main()
