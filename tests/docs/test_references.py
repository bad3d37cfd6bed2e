"""References: every citation has an entry, every entry a section and, if it has one, a DOI."""

import re
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]
CITED = re.compile(r"\{cite(?::\w)?\}`([^`]+)`")
ENTRIES = {
    match[1]: dict(re.findall(r"^  (\w+) = \{(.*)\},?$", match[2], re.MULTILINE))
    for match in re.finditer(
        r"^@\w+\{(\w+),\n(.*?)^\}", (TOP / "docs" / "references.bib").read_text("utf-8"),
        re.MULTILINE | re.DOTALL,
    )
}  # fmt: skip


def test_entries_are_shown_in_a_section_and_their_dois_are_well_formed():
    page = (TOP / "docs" / "references.md").read_text("utf-8")
    sections = set(re.findall(r'keywords % "(\w+)"', page))
    assert {entry["keywords"] for entry in ENTRIES.values()} == sections
    dois = [entry["doi"] for entry in ENTRIES.values() if "doi" in entry]
    assert len(set(dois)) == len(dois) > 40
    assert all(re.fullmatch(r"10\.\d{4,5}/\S+", doi) for doi in dois)


@pytest.mark.parametrize("page", sorted((TOP / "docs").glob("*.md")), ids=lambda page: page.stem)
def test_what_a_page_cites_has_an_entry_and_is_typed_nowhere_else(page):
    text = page.read_text("utf-8")
    cited = {key.strip() for keys in CITED.findall(text) for key in keys.split(",")}
    assert cited <= set(ENTRIES)
    typed = r"\d+ \((?:19|20)\d\d\) \d+[–-]\d+"  # volume, year and pages
    assert not re.search(typed, text), "cite the entry of docs/references.bib instead"
