"""Mark stored figures that are older than the code they describe, while pages are built.

The pages in the repository say when a figure was measured. What has changed since is known to git
only: without it, or in a shallow clone, nothing is added.
"""

import re
import shutil
import subprocess
from functools import cache
from typing import Any

from gallery_runs import ROOT
from stored import RESULTS, names, stamp

BLOCK = re.compile(r"(<!-- figures: (\w+) -->\n.*?)(\n<!-- end of figures -->)", re.DOTALL)
# Blocks that are parts of a result, or made of several.
PARTS = {
    "claims": ("demos", "hard_cases", "comparison", "disc", "large_sphere"),
    "hard_cases_board": ("hard_cases",),
    "hard_cases_figures": ("hard_cases",),
    "table_exponents": ("vibrating_table",),
    "table_distances": ("vibrating_table",),
    "choose_bars": ("doyen_bounces", "k1_off_grid", "irregular_bounces", "prestretched_rod"),
    "choose_solids": ("disc",),
    "choose_bodies": ("bodies",),
    "choose_points": ("vibro_work_precision",),
}
BARS = ("exact", "forms", "spacetime")
POINTS = ("contact", "system", "vibro")
MARCHES = ("contact", "forms", "marching", "mesh", "system")
CODE = {
    **dict.fromkeys(
        ("bar_impact", "comparison", "doyen_bounces", "doyen_750_bounces", "error_constants",
         "irregular_bounces", "k1_off_grid", "prestretched_rod"), BARS),
    **dict.fromkeys(
        ("corner", "corner_conjectures", "corner_portrait", "corner_share", "dropped_beam",
         "oscillator", "schemes", "vibrating_table", "vibro_speed", "vibro_work_precision"),
        POINTS),
    **dict.fromkeys(("demos", "hard_cases", "startup"), (*BARS, *MARCHES, "vibro")),
    **dict.fromkeys(("gradients", "intervals", "soft_landing"), ("inverse", *BARS, *MARCHES)),
}  # fmt: skip
"""Folders of the package that a result depends on; those of the march where it is not named."""


def git(*words: str) -> str | None:
    """What git says about the repository, None without it."""
    program = shutil.which("git")
    if program is None:
        return None
    command = [program, "-C", str(ROOT), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    return done.stdout.strip() if done.returncode == 0 else None


@cache
def is_known() -> bool:
    """Whether the whole history is there."""
    return git("rev-parse", "--is-shallow-repository") == "false"


def taken_at(name: str) -> str | None:
    """The commit that a result names if the history has it, else the one that stored it."""
    named: str | None = stamp(name).get("commit")
    if named and git("cat-file", "-e", f"{named}^{{commit}}") is not None:
        return named
    return git("log", "-1", "--format=%h", "--", str(RESULTS / f"{name}.json"))


@cache
def note(name: str) -> str:
    """How old a result is, and what has changed since; empty if nothing has."""
    commit = taken_at(name) if is_known() else None
    if not commit:
        return ""
    folders = CODE.get(name, MARCHES)
    places = [f"impactfem/{folder}" for folder in folders]
    later = git("log", "--oneline", f"{commit}..HEAD", "--", *places)
    if not later:
        return ""
    changed = (git("diff", "--name-only", commit, "HEAD", "--", *places) or "").splitlines()
    parts = sorted({line.split("/")[1] for line in changed})
    count, title = len(later.splitlines()), name.replace("_", " ").capitalize()
    return (
        f"{title}: taken on {stamp(name)['date']} at commit {commit}; "
        f"{count} later commit{'s' * (count > 1)} changed code of {', '.join(parts)}."
    )


def marked(page: str) -> str:
    """A page whose figures say what has changed since they were taken."""

    def with_note(block: re.Match[str]) -> str:
        results = PARTS.get(block[2], (block[2],))
        notes = [note(name) for name in results if name in names() or name == "demos"]
        said = " ".join(text for text in notes if text)
        return f"{block[1]}\n*Older than the code. {said}*\n{block[3]}" if said else block[0]

    return BLOCK.sub(with_note, page)


def setup(app: Any) -> None:
    """Mark pages as they are read."""

    def read(_app: Any, _name: str, source: list[str]) -> None:
        source[0] = marked(source[0])

    app.connect("source-read", read)
