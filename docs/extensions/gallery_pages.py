"""Write the gallery: an index with a picture of each demo, and a page a demo with its results."""

import io
import json
from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from gallery_runs import ROOT, Run, is_current, sources
from md_tables import table
from PIL import Image
from placing import Placed
from readmes import GROUPS, MIXED, NO_SCENE, PAGES, Demo, read_demos

EXTRA = ROOT / "docs" / "generated" / "extra" / "gallery"  # copied to the site as it is
THUMB = (480, 320)  # pixels
FIRST = ("body", "bodies", "world_lines", "path", "paths", "position", "motion", "displacement")


def summary(run: Run) -> dict[str, Any]:
    """What the run wrote into summary.json."""
    read: dict[str, Any] = json.loads((run.folder / "summary.json").read_text(encoding="utf-8"))
    return read


def _at(facts: Mapping[str, Any], *keys: str) -> Any:
    """A nested entry, None where there is none."""
    value: Any = facts
    for key in keys:
        value = value.get(key) if isinstance(value, Mapping) else None
    return value


def number(value: Any, form: str = ".3g") -> str:
    """A number as text; a dash if it is none."""
    return format(value, form) if isinstance(value, int | float) else "-"


def _spells(facts: Mapping[str, Any]) -> str:
    """When contact first began and last ended, and in how many spells."""
    found = _at(facts, "contact", "intervals")
    if not found:
        return "-"
    spells = f", {len(found)} spells" if len(found) > 1 else ""
    return f"{found[0][0]:.4g} to {found[-1][-1]:.4g} s{spells}"


def _figure(form: str, *keys: str) -> Callable[[Mapping[str, Any]], str]:
    return lambda facts: number(_at(facts, *keys), form)


FIGURES: dict[str, Callable[[Mapping[str, Any]], str]] = {
    "method": lambda facts: f"`{facts['method']}`",
    "unknowns": _figure("d", "num_dofs"),
    "steps": _figure("d", "num_steps"),
    "contact": _spells,
    "largest contact force [N]": _figure(".4g", "contact", "max_force"),
    "impulse [N s]": _figure(".4g", "contact", "impulse"),
    "deepest penetration [m]": _figure(".1e", "contact", "max_penetration"),
    "change of energy, relative": _figure(".1e", "energy", "final_relative_drift"),
    "error of displacement, largest": _figure(".1e", "error", "displacement_max"),
    "error of force, L1": _figure(".1e", "error", "force_l1"),
    "errors against": lambda facts: _at(facts, "error", "reference") or "-",
    "time of the solution [s]": _figure(".2g", "wall_time"),
    "memory [MiB]": _figure(".0f", "peak_memory_mib"),
}


def pictures(run: Run) -> list[Path]:
    """Pictures of a run, the one that shows most first; a film last."""
    rank = {stem: place for place, stem in enumerate(FIRST)}
    found = sorted(run.folder.glob("*.png"), key=lambda path: (rank.get(path.stem, 99), path.stem))
    return [*found, *sorted(run.folder.glob("*.gif"))]


def results(demo: Demo, digest: str, placed: Placed) -> str:
    """What the runs of a demo gave: commands, figures, pictures, reports."""
    if not demo.runs:
        return ""
    commands = "\n".join(run.command for run in demo.runs)
    facts = [summary(run) for run in demo.runs]
    head = ["", *(f"`{run.scene.name}`" for run in demo.runs)]
    rows = [[name, *(show(each) for each in facts)] for name, show in FIGURES.items()]
    rows = [row for row in rows if set(row[1:]) != {"-"}]
    seconds = ["the whole run [s]", *(number(run.stamp["seconds"], ".2g") for run in demo.runs)]
    parts = [
        "\n## What a run gives\n",
        "Run from the command line for this page, as a user would:\n",
        f"```sh\n{commands}\n```\n",
        table(head, [*rows, seconds]),
    ]
    for run in demo.runs:
        parts.append(_shown(run, demo, placed))
        if not is_current(run, digest):
            date = run.stamp["date"]
            parts.append(f"Run on {date} with earlier sources; `make docs` runs it again.\n")
    return "\n".join(parts)


def _shown(run: Run, demo: Demo, placed: Placed) -> str:
    """Report and pictures of a run, copied to where the page finds them."""
    parts = [f"\n### `{run.scene.name}`\n"] if len(demo.runs) > 1 else []
    report = run.folder / "report.html"
    if report.is_file():
        placed.copy(report, EXTRA / run.name / "report.html")
        link = f"../../gallery/{run.name}/report.html"
        parts.append(f'<p><a class="report" href="{link}">Open the report of this run</a></p>\n')
    shown = []
    for picture in pictures(run):
        placed.copy(picture, PAGES / run.name / picture.name)
        words = picture.stem.replace("_", " ")
        shown.append(f"![{demo.title}: {words}]({run.name}/{picture.name})\n")
    rest = "".join(shown[1:])
    parts += [shown[0], f'<div class="pictures">\n\n{rest}\n</div>\n']
    return "\n".join(parts)


def thumbnail(demo: Demo, placed: Placed) -> None:
    """A small picture of a demo, on white; of its README if it has no runs."""
    found = [*(pictures(demo.runs[0]) if demo.runs else ()), *demo.images]
    if not found:
        return
    with Image.open(found[0]) as picture:
        small = Image.new("RGB", THUMB, "white")
        drawn = picture.convert("RGBA")
    drawn.thumbnail(THUMB)
    small.paste(drawn, ((THUMB[0] - drawn.width) // 2, (THUMB[1] - drawn.height) // 2), drawn)
    content = io.BytesIO()
    small.save(content, "PNG", optimize=True)
    placed.bytes(EXTRA / f"{demo.name}.png", content.getvalue())


def card(demo: Demo) -> str:
    """A demo on the index page, as HTML."""
    words = "not run yet" if demo.has_scene else ""
    if demo.runs:
        facts = summary(demo.runs[0])
        error = number(_at(facts, "error", "displacement_max"), ".1e")
        known = "error not estimated" if error == "-" else f"error {error}"
        seconds = demo.runs[0].stamp["seconds"]
        words = f"{facts['method']}, {facts['num_dofs']} unknowns, {known}, {seconds:.0f} s"
    shown = ""
    if demo.runs or demo.images:
        shown = f'<img src="../../gallery/{demo.name}.png" alt="">'
    return (
        f'<a class="card" href="{demo.name}.html">{shown}'
        f"<strong>{escape(demo.title)}</strong><span>{escape(demo.line)}</span>"
        f"<small>{escape(words)}</small></a>"
    )


def index(demos: Sequence[Demo]) -> str:
    """The index page."""
    stamps = [run.stamp for demo in demos for run in demo.runs]
    lead = "The demos have not been run yet: `make docs` runs them.\n"
    if stamps:
        dates = sorted({stamp["date"] for stamp in stamps})
        total = sum(stamp["seconds"] for stamp in stamps)
        lead = (
            f"Each scene below was run from the command line for these pages: {len(stamps)} runs, "
            f"{' to '.join(dict.fromkeys((dates[0], dates[-1])))}, {total:.0f} s on one core. "
            "Figures and pictures are what came out. Unknowns of bars are those of all times, "
            "otherwise those of one step. The error is the largest of the displacement, relative; "
            "the page of the demo says against what. The time runs from the start of Python to the "
            "last picture.\n"
        )
    parts = ["# Gallery\n", lead]
    for group in (*GROUPS.values(), MIXED, NO_SCENE):
        cards = "\n".join(card(demo) for demo in demos if demo.group == group)
        if not cards:
            continue
        parts.append(f'## {group}\n\n<div class="gallery">\n{cards}\n</div>\n')
    pages = "\n".join(demo.name for demo in demos)
    parts.append(f"```{{toctree}}\n:hidden:\n\n{pages}\n```\n")
    return "\n".join(parts)


def write(runs: Sequence[Run]) -> None:
    """Write all pages from the stored runs."""
    placed = Placed(PAGES, EXTRA)
    digest = sources()
    demos = read_demos(runs)
    for demo in demos:
        text = f"# {demo.title}\n\n{demo.own_lead}\n{results(demo, digest, placed)}\n{demo.rest}"
        placed.text(PAGES / f"{demo.name}.md", text)
        thumbnail(demo, placed)
    placed.text(PAGES / "index.md", index(demos))
    EXTRA.mkdir(parents=True, exist_ok=True)
    placed.clear()
