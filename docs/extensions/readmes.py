"""The demos as the gallery shows them: their READMEs, cut into parts and with links moved."""

import os
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gallery_runs import ROOT, Run

PAGES = ROOT / "docs" / "generated" / "gallery"
# Target of a relative link or picture, and its anchor.
LINK = re.compile(r"(?<=\]\()(?!https?:|mailto:|#)([^)#\s]+)(#[^)\s]*)?(?=\))")
GREEK = {"omega": "ω", "mu": "µ", "alpha": "α", "beta": "β"}
SHORT, LONG = 45, 150  # characters of a sentence that says too little alone, of one to cut
GROUPS = {
    "bar": "Bars",
    "solid": "Solids",
    "point": "Points, rods and beams",
    "mechanism": "Mechanisms",
}
MIXED = "Bodies of different kinds"
NO_SCENE = "Without a scene"


@dataclass(frozen=True)
class Demo:
    """A demo.

    Attributes:
        name: Of its folder.
        title: First heading of its README.
        lead: What stands before the second heading.
        rest: What follows.
        runs: Its scenes that have results.
    """

    name: str
    title: str
    lead: str
    rest: str
    runs: tuple[Run, ...]

    @property
    def line(self) -> str:
        """First sentence, or two if the first is short, without markup."""
        text = next(part for part in self.lead.split("\n\n") if part and not part.startswith("!["))
        plain = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", " ".join(text.split()))
        plain = re.sub(r"\\(\w+)", lambda name: GREEK.get(name[1], name[1]), plain)
        sentences = re.split(r"(?<=[a-z0-9)$])\. ", re.sub("[`*]", "", plain).rstrip("."))
        line = ". ".join(sentences[: 2 if len(sentences[0]) < SHORT else 1])
        head, _, tail = line.partition(": ")
        line = head if len(line) > LONG or "$" in tail else line
        return line.replace("$", "").rstrip(":") + "."

    @property
    def own_lead(self) -> str:
        """The lead without pictures that its runs give too: they are called like the demo."""
        if not self.runs:
            return self.lead
        parts = self.lead.split("\n\n")
        return "\n\n".join(part for part in parts if f"/{self.name}.png)" not in part)

    @property
    def has_scene(self) -> bool:
        """Whether there is anything to run."""
        return any((ROOT / "demos" / self.name).glob("scene*.toml"))

    @property
    def group(self) -> str:
        """Kind of its first body, as a heading; the rods and beams are with the points."""
        path = ROOT / "demos" / self.name / "scene.toml"
        if not path.is_file():
            return NO_SCENE
        kinds = {body["kind"] for body in tomllib.loads(path.read_text(encoding="utf-8"))["body"]}
        return MIXED if len(kinds) > 1 else GROUPS.get(*kinds, GROUPS["point"])

    @property
    def images(self) -> list[Path]:
        """Pictures that its README shows."""
        targets = (link[1] for link in LINK.finditer(self.lead + self.rest))
        return [(PAGES / target).resolve() for target in targets if target.endswith(".png")]


def relink(text: str, folder: Path) -> str:
    """Markdown text from `folder` with its relative links as seen from a page of the gallery."""

    def moved(link: re.Match[str]) -> str:
        target, anchor = (folder / link[1]).resolve(), link[2] or ""
        if target.name == "README.md" and target.parent.parent == ROOT / "demos":
            return f"{target.parent.name}.md{anchor}"
        return Path(os.path.relpath(target, PAGES)).as_posix() + anchor

    return LINK.sub(moved, text)


def read_demos(runs: Sequence[Run]) -> list[Demo]:
    """All demos that have a README, with those of the runs that have results."""
    demos = []
    for path in sorted(ROOT.glob("demos/*/README.md")):
        title, _, text = path.read_text(encoding="utf-8").partition("\n")
        lead, heading, rest = relink(text, path.parent).partition("\n## ")
        stored = tuple(run for run in runs if run.demo == path.parent and run.stamp)
        title = title.removeprefix("# ")
        demos.append(Demo(path.parent.name, title, lead.strip(), heading + rest, stored))
    return demos
