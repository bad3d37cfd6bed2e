"""Small pieces of HTML with which objects show themselves in a notebook: cards, tables, curves."""

from collections.abc import Sequence
from html import escape

import numpy as np
from numpy.typing import ArrayLike

_CELL = "text-align:left;vertical-align:top;padding:1px 12px 1px 0;border:0;background:none"
_FRAME = (
    "display:inline-block;max-width:56em;padding:8px 12px;border:1px solid #8888;"
    "border-radius:6px;line-height:1.4;font-size:13px"
)
_TABLE = "margin:4px 0;border:0;font-size:inherit"
_WIDTH, _HEIGHT = 320, 56  # of a curve, in pixels
_BINS = 320
_GOOD, _BAD = "#1b7837", "#b2182b"


def card(
    title: str,
    rows: Sequence[tuple[str, str]],
    *,
    badge: str = "",
    good: bool = True,
    parts: Sequence[str] = (),
) -> str:
    """A framed table of names and values under a title; colours are those of the page around it.

    Args:
        title: Escaped here, as are names, values and badge.
        rows: Names with their values.
        badge: A word beside the title.
        good: Whether the badge is green, not red.
        parts: Pieces of HTML below the table, as `table` and `curve` make them.
    """
    colour = _GOOD if good else _BAD
    mark = (
        f' <span style="background:{colour};color:#fff;border-radius:4px;padding:1px 6px;'
        f'font-size:11px">{escape(badge)}</span>'
        if badge
        else ""
    )
    body = "".join(
        f'<tr style="background:none"><td style="{_CELL};opacity:0.7;white-space:nowrap">'
        f'{escape(name)}</td><td style="{_CELL}">{escape(value)}</td></tr>'
        for name, value in rows
    )
    return (
        f'<div class="impactfem-card" style="{_FRAME}"><b>{escape(title)}</b>{mark}'
        f'<table style="{_TABLE}">{body}</table>{"".join(parts)}</div>'
    )


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table with a head; cells are escaped."""
    top = "".join(f'<th style="{_CELL};opacity:0.7">{escape(cell)}</th>' for cell in head)
    lines = "".join(
        '<tr style="background:none">'
        + "".join(
            f'<td style="{_CELL}{";white-space:nowrap" * (k == 0)}">{escape(cell)}</td>'
            for k, cell in enumerate(row)
        )
        + "</tr>"
        for row in rows
    )
    return f'<table style="{_TABLE}"><tr>{top}</tr>{lines}</table>'


def curve(times: ArrayLike, values: ArrayLike, text: str) -> str:
    """A small curve of what holds during each step, as inline SVG; nothing if there is none.

    Args:
        times: Ends of the steps, shape (rows,).
        values: Value of each step, shape (rows,). Where steps are many, the largest of a few
            neighbours is shown, so that short peaks stay visible.
        text: What it shows, below it.
    """
    t, y = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
    known = np.isfinite(t) & np.isfinite(y)
    t, y = t[known], y[known]
    if len(t) < 2 or t[-1] <= t[0] or not (span := y.max() - min(0.0, y.min())) > 0.0:
        return ""
    edges = np.linspace(t[0], t[-1], min(_BINS, len(t) - 1) + 1)
    # A bin holds the steps that end in it, and the one that goes on beyond it.
    first = np.minimum(np.searchsorted(t, edges[:-1], side="right"), len(t) - 1)
    last = np.minimum(np.searchsorted(t, edges[1:], side="left"), len(t) - 1)
    tops = np.array([y[a : max(a, b) + 1].max() for a, b in zip(first, last, strict=True)])
    x = (edges - t[0]) / (t[-1] - t[0]) * _WIDTH
    low = min(0.0, float(y.min()))
    height = _HEIGHT - 2.0 - (tops - low) / span * (_HEIGHT - 4.0)
    points = " ".join(
        f"{a:.1f},{h:.1f} {b:.1f},{h:.1f}" for a, b, h in zip(x[:-1], x[1:], height, strict=True)
    )
    ground = _HEIGHT - 2.0 + low / span * (_HEIGHT - 4.0)
    return (
        f'<svg width="{_WIDTH}" height="{_HEIGHT}" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" '
        f'aria-label="{escape(text)}" style="display:block;overflow:visible">'
        f'<line x1="0" x2="{_WIDTH}" y1="{ground:.1f}" y2="{ground:.1f}" stroke="currentColor" '
        'stroke-opacity="0.4"/>'
        f'<polyline points="{points}" fill="none" stroke="#3b8fd6" stroke-width="1.4"/></svg>'
        f'<div style="opacity:0.7;font-size:11px">{escape(text)}</div>'
    )
