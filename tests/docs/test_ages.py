"""Stored figures that are older than the code they describe are marked by the build."""

import json

import ages
import pytest

FIRST, PAGE = (
    "a" * 7,
    "# Page\n\n<!-- figures: disc -->\n\n| a |\n\n<!-- end of figures -->\n\nText.\n",
)


@pytest.fixture
def history(monkeypatch, tmp_path):
    """A result at a commit, and what git says to the words it is asked."""
    (tmp_path / "disc.json").write_text(json.dumps({"date": "2026-11-21", "commit": FIRST}))
    said = {
        "rev-parse": "false",
        "cat-file": "",
        "log": "b one\nc two",
        "diff": "impactfem/contact/x.py",
    }
    monkeypatch.setattr(ages, "RESULTS", tmp_path)
    monkeypatch.setattr(
        ages, "stamp", lambda name: json.loads((tmp_path / f"{name}.json").read_text())
    )
    monkeypatch.setattr(ages, "git", lambda *words: said[words[0]])
    ages.is_known.cache_clear()
    ages.note.cache_clear()
    yield said
    ages.is_known.cache_clear()
    ages.note.cache_clear()


@pytest.mark.usefixtures("history")
def test_a_table_older_than_its_code_says_so():
    said = f"Disc: taken on 2026-11-21 at commit {FIRST}; 2 later commits changed code of contact."
    assert f"| a |\n\n*Older than the code. {said}*\n\n<!-- end" in ages.marked(PAGE)


def test_a_commit_that_the_history_has_not_is_the_one_that_stored_the_result(history):
    history.update({"cat-file": None, "log": "d" * 7})
    assert ages.taken_at("disc") == "d" * 7


@pytest.mark.parametrize("change", [{"log": ""}, {"rev-parse": "true"}, {"rev-parse": None}])
def test_a_table_is_left_alone_if_nothing_changed_or_nothing_is_known(history, change):
    history.update(change)
    assert ages.marked(PAGE) == PAGE


def test_every_result_with_folders_of_its_own_is_stored():
    stored = ages.names() | {"demos"}
    assert set(ages.CODE) <= stored
    assert {name for parts in ages.PARTS.values() for name in parts} <= stored
    for folders in {ages.MARCHES, *ages.CODE.values()}:
        assert all((ages.ROOT / "impactfem" / folder).is_dir() for folder in folders)
