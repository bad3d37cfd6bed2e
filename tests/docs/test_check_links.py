"""The checker of links finds what is broken, and nothing is broken in the repository."""

import importlib.util
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]
SPEC = importlib.util.spec_from_file_location(
    "check_links", TOP / "docs" / "scripts" / "check_links.py"
)
links = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(links)


def test_all_links_of_the_repository_lead_somewhere():
    assert list(links.broken_in_markdown(TOP)) == []


@pytest.mark.parametrize(
    ("link", "fault"),
    [
        ("other.md", None),
        ("other.md#part-2-forces-and-moments", None),
        ("other.md#part-2-forces-and-moments-1", None),
        ("other.md#label", None),
        ("#here", None),
        ("https://example.org/a_(b)", None),
        ("missing.md", "no such file"),
        ("other.md#nothing", "no such anchor"),
        ("#nowhere", "no such anchor"),
        ("https:/example.org", "not a well-formed address"),
        ("https://nohost", "not a well-formed address"),
        ("mailto:nobody", "not a well-formed address"),
    ],
)
def test_links_of_markdown(tmp_path, link, fault):
    other = "# Part 2: forces, and moments\n\n(label)=\n## Part 2: forces and moments!\n\n"
    other = other.replace("forces, and", "forces and")
    (tmp_path / "other.md").write_text(other, encoding="utf-8")
    text = f"# Here\n\n[text]({link}), `[code](missing.md)`\n\n```\n[x](missing.md)\n```\n"
    (tmp_path / "page.md").write_text(text, encoding="utf-8")
    found = list(links.broken_in_markdown(tmp_path))
    assert len(found) == (fault is not None)
    assert all(fault in each for each in found)


@pytest.mark.parametrize(
    ("tag", "fault"),
    [
        ('<a href="b.html#x">', None),
        ('<a href="sub/">', None),
        ('<a href="#top">', None),
        ('<img src="data:image/png;base64,AA==">', None),
        ('<img src="a%20b.png">', None),
        ('<a href="b.html#y">', "no such anchor"),
        ('<a href="c.html">', "no such file"),
        ('<img src="c.png">', "no such file"),
        ('<script src="c.js"></script>', "no such file"),
        ('<a href="http://">', "not a well-formed address"),
    ],
)
def test_links_of_html(tmp_path, tag, fault):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "index.html").write_text("", encoding="utf-8")
    (tmp_path / "a b.png").write_bytes(b"")
    (tmp_path / "b.html").write_text('<p id="x"></p>', encoding="utf-8")
    (tmp_path / "a.html").write_text(f'<body id="top">{tag}</body>', encoding="utf-8")
    found = list(links.broken_in_html(tmp_path))
    assert len(found) == (fault is not None)
    assert all(fault in each for each in found)
