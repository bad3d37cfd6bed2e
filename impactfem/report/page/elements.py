"""Building blocks of the page; every text that comes in is plain and is escaped here."""

from collections.abc import Iterable, Sequence
from html import escape
from pathlib import PurePath
from urllib.parse import quote

type Row = Sequence[str]

_SHORT = 24  # characters of a cell that is not broken


def text(words: str) -> str:
    """A text as HTML."""
    return escape(words, quote=True)


def spoken(choice: str) -> str:
    """The name of a choice of the plan as it is shown."""
    return "time steps" if choice == "layers" else choice


def paragraph(words: str, kind: str = "") -> str:
    """A paragraph, perhaps of a class."""
    return f"<p{_class(kind)}>{text(words)}</p>"


def bullets(lines: Iterable[str]) -> str:
    """A list; nothing if there are no lines."""
    entries = "".join(f"<li>{text(line)}</li>" for line in lines)
    return f"<ul>{entries}</ul>" if entries else ""


def terms(pairs: Iterable[tuple[str, str]]) -> str:
    """A list of subjects and what there is to say about them."""
    entries = "".join(f"<dt>{text(a)}</dt><dd>{text(b)}</dd>" for a, b in pairs)
    return f"<dl>{entries}</dl>" if entries else ""


def table(rows: Iterable[Row], head: Row = ()) -> str:
    """A table whose first column names the rows; nothing if there are no rows."""
    body = "".join(_row(row) for row in rows)
    if not body:
        return ""
    # A head without text is no head: screen readers would read an empty one out.
    top = "".join(f'<th scope="col">{text(cell)}</th>' if cell else "<td></td>" for cell in head)
    heading = f"<thead><tr>{top}</tr></thead>" if head else ""
    return f'<div class="wide"><table>{heading}<tbody>{body}</tbody></table></div>'


def code(words: str) -> str:
    """A command or such, to be copied."""
    return f"<pre><code>{text(words)}</code></pre>"


def link(name: str) -> str:
    """A link to a file beside the page."""
    return f'<a href="{escape(quote(str(PurePath(name))))}">{text(name)}</a>'


def section(anchor: str, title: str, *parts: str, kind: str = "") -> str:
    """A section with an anchor; nothing if it has no content."""
    body = "".join(part for part in parts if part)
    if not body:
        return ""
    return f'<section id="{anchor}"{_class(kind)}><h2>{text(title)}</h2>{body}</section>\n'


def _row(row: Row) -> str:
    first, *others = row
    cells = "".join(f"<td{_class(_kind(cell))}>{text(cell)}</td>" for cell in others)
    return f'<tr><th scope="row">{text(first)}</th>{cells}</tr>'


def _kind(cell: str) -> str:
    """Numbers with their units stay on one line."""
    return "short" if len(cell) <= _SHORT else ""


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""
