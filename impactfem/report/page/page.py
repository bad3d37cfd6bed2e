"""Put the report of a run together: one HTML file with everything in it."""

import io
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

from impactfem.report.animation import film_if_any
from impactfem.report.faults import Faults
from impactfem.report.figures import draw_all, write_pictures
from impactfem.report.page import facts
from impactfem.report.page.chart import Chart
from impactfem.report.page.charts import charts
from impactfem.report.page.drawing import drawing
from impactfem.report.page.elements import bullets, paragraph, section, terms, text
from impactfem.report.page.embedding import (
    PLOTLY,
    compressed,
    json_text,
    packed,
    picture_address,
    script_text,
)
from impactfem.report.page.motion import SCRIPTS, motion
from impactfem.report.page.numbers import largest, percent, span
from impactfem.report.page.verdict import headline, reasons
from impactfem.report.page.words import in_words
from impactfem.report.panel import is_exact
from impactfem.report.sheet import write_png
from impactfem.report.table import beyond_model
from impactfem.result import Record
from impactfem.scene import Output

FILM, PAGE = "motion.gif", "report.html"
"""Names of the film and the report in the folder of a result."""

_HERE = Path(__file__).parent
_FORCE = "contact_force"  # the chart that the moving picture has beside it
_BODY = "body"  # the picture that no chart replaces on paper

_TITLES = {
    "verdict": "Verdict",
    "scene": "Scene",
    "motion": "Motion",
    "charts": "Charts",
    "still-pictures": "Pictures",
    "model": "Model",
    "error": "Error",
    "checks": "Checks",
    "contact": "Contact",
    "cost": "Cost",
    "origin": "Repeat",
    "files": "Files",
}


def write_report(result: Record, folder: Path, faults: Faults, wanted: Output) -> list[Path]:
    """Write pictures, film and page.

    Args:
        result: What to report.
        folder: Where.
        faults: Told of what cannot be drawn.
        wanted: Which of them.

    Returns:
        The paths of all files.
    """
    paths = list[Path]()
    if wanted.pictures:
        paths += write_pictures(result, folder, faults)
    if wanted.film:
        film = folder / FILM
        if faults.guarded(FILM, lambda: film_if_any(result, film), film):
            paths.append(film)
    if wanted.report:
        target = folder / PAGE
        if faults.guarded(PAGE, lambda: write_page(result, target, paths, faults), target):
            paths.append(target)
    return paths


def write_page(
    result: Record, path: Path, pictures: Sequence[Path] | None = None, faults: Faults | None = None
) -> Path:
    """Write the page of a result.

    Args:
        result: What to report.
        path: Target.
        pictures: Files that lie beside the page; those in PNG are put into it. Drawn anew, and
            not written, if None.
        faults: Told of parts that cannot be drawn.

    Returns:
        The path.
    """
    # Paths in the command may hold bytes that are no text.
    made = page(result, pictures, faults)
    path.write_text(made, encoding="utf-8", errors="backslashreplace")
    return path


def page(
    result: Record, pictures: Sequence[Path] | None = None, faults: Faults | None = None
) -> str:
    """The page of a result as HTML.

    Args:
        result: What to report.
        pictures: As for `write_page`.
        faults: As for `write_page`.
    """
    faults = faults or Faults()
    if pictures is None:
        images, names = _drawn(result), []
    else:
        images = [(path.stem, path.read_bytes()) for path in pictures if path.suffix == ".png"]
        names = [path.name for path in pictures]
    moving = faults.guarded("the motion on the page", lambda: motion(result))
    drawn = faults.guarded("the charts on the page", lambda: charts(result)) or []
    sections = [
        _scene(result, faults),
        _motion(moving, {each.name: each.caption for each in drawn}.get(_FORCE)),
        _charts(drawn, {_FORCE} if moving else set()),
        _still(images),
        facts.model(result),
        facts.error(result),
        facts.obeyed(result),
        facts.contact(result),
        facts.cost(result),
        facts.origin(result),
        facts.files(result, names, faults.lines),
    ]
    data = [{"element": f"chart-{each.name}", "figure": each.figure} for each in drawn]
    return shell(
        result.summary["title"], _byline(result), sections, _verdict(result),
        _scripts(moving, data),
    )  # fmt: skip


def shell(
    title: str, byline: str, sections: Sequence[str], verdict: str = "", scripts: str = ""
) -> str:
    """A page of sections as HTML, which needs no network.

    Args:
        title: Plain text.
        byline: Plain text below it.
        sections: HTML of `elements.section`.
        verdict: HTML above them.
        scripts: HTML at the end.
    """
    template = Template((_HERE / "page.html").read_text(encoding="utf-8"))
    return template.substitute(
        title=text(title),
        byline=text(byline),
        css=(_HERE / "page.css").read_text(encoding="utf-8"),
        verdict=verdict,
        contents=_contents(sections),
        sections="".join(sections),
        scripts=scripts,
    )


def _drawn(result: Record) -> list[tuple[str, bytes]]:
    images = []
    for name, figure in draw_all(result).items():
        buffer = io.BytesIO()
        write_png(figure, buffer)
        images.append((name, buffer.getvalue()))
    return images


def _byline(result: Record) -> str:
    summary = result.summary
    parts = [f"method {summary['method']}"]
    if run := summary.get("run"):
        parts += [run["date"][:16].replace("T", " "), f"impactfem {run['versions']['impactfem']}"]
    return ", ".join(parts)


def _verdict(result: Record) -> str:
    """What a person must see first: whether to trust it, and the main figures."""
    summary = result.summary
    error, energy = summary["error"], summary["energy"]
    shown = "exact" if is_exact(summary) else "not measured"
    if error is not None:
        shown = f"{percent(error['displacement_max'])} / {percent(error['force_l1'])}"
    change = "driven by loads" if energy.get("driven") else percent(energy["final_relative_drift"])
    glance = [
        ("Status", summary["status"].replace("_", " ")),
        (f"Error{' of the mesh' * bool(beyond_model(summary))} (displacement / force)", shown),
        ("Change of energy", change),
        *_pushes(summary["contact"]),
        ("Cost", f"{span(summary['wall_time'])}, {summary['peak_memory_mib']:.0f} MiB"),
    ]
    cells = "".join(f"<div><dt>{text(a)}</dt><dd>{text(b)}</dd></div>" for a, b in glance)
    return (
        f'<section id="verdict" class="verdict {summary["verdict"]["level"]}">'
        f"<h2>{text(headline(summary))}</h2>"
        f'{bullets(reasons(summary))}<dl class="glance">{cells}</dl></section>'
    )


def _pushes(contact: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Largest force; where impacts act at instants, that of lasting contact and their impulse."""
    force = largest(contact, "max_force", "N", 4)
    if "max_impulse" not in contact:
        return [("Largest contact force", force)]
    impulse = largest(contact, "max_impulse", "N s", 4)
    return [("Largest force of lasting contact", force), ("Largest impulse", impulse)]


def _contents(sections: Sequence[str]) -> str:
    present = "".join(sections)
    return " ".join(
        f'<a href="#{anchor}">{text(title)}</a>'
        for anchor, title in _TITLES.items()
        if f'<section id="{anchor}"' in present
    )


def _scene(result: Record, faults: Faults) -> str:
    picture = faults.guarded("the drawing on the page", lambda: drawing(result))
    caption = (
        "The scene at t = 0. Orange: velocities, purple: supports and loads, green: gravity; "
        "arrows show directions, not sizes. Grey: rigid obstacles."
    )
    figure = f"<figure>{picture}<figcaption>{caption}</figcaption></figure>" if picture else ""
    return section("scene", "The scene", figure, terms(in_words(result.scene)))


def _motion(payload: dict[str, Any] | None, force: str | None) -> str:
    """The moving picture beside the contact force, which has the caption of its chart."""
    if payload is None:
        return ""
    view = '<div id="motion-view"></div>' + (paragraph(force) if force else "")
    part = section("motion", "Motion and contact force", view)
    return _interactive(part, "interactive unprinted")


def _charts(drawn: Sequence[Chart], seen: Collection[str]) -> str:
    """Charts with their captions; those that are seen elsewhere on the screen only in print."""
    figures = "".join(
        f'<figure class="chart{" printed" if each.name in seen else ""}" '
        f'id="figure-{text(each.name)}"><h3>{text(each.title)}</h3>'
        f'<div class="plot" id="chart-{text(each.name)}"></div>'
        f"<figcaption>{text(each.caption)}</figcaption></figure>"
        for each in drawn
    )
    return _interactive(section("charts", "Charts", figures))


def _interactive(part: str, kind: str = "interactive") -> str:
    """What needs scripts: hidden until they run."""
    return f'<div class="{kind}" hidden>{part}</div>' if part else ""


def _still(images: Sequence[tuple[str, bytes]]) -> str:
    """Pictures that need no scripts; of those the body is printed beside the charts too."""
    figures = "".join(
        f'<figure id="still-{text(name)}"><img src="{picture_address(data)}" '
        f'alt="{text(name.replace("_", " "))}">'
        f"<figcaption>{text(name.replace('_', ' '))}</figcaption></figure>"
        for name, data in images
    )
    if not figures:
        return ""
    body = f'<details class="still" id="still" open><summary>Still pictures</summary>{figures}'
    kind = "bodily" if any(name == _BODY for name, _ in images) else ""
    return section("still-pictures", "Pictures", f"{body}</details>", kind=kind)


def _scripts(moving: dict[str, Any] | None, charts_data: Sequence[dict[str, Any]]) -> str:
    """Data and scripts at the end of the page."""
    parts = [packed("charts-data", compressed(json_text(charts_data)))]
    if moving is not None:
        parts.append(packed("motion-data", compressed(json_text(moving))))
    parts.append(packed("plotly", PLOTLY.read_bytes()))
    for name in (*SCRIPTS, "page.js"):
        code = (_HERE / name).read_text(encoding="utf-8")
        parts.append(f"<script>{script_text(code)}</script>")
    return "\n".join(parts)
