"""Hints at the nearest correct name: slips of the finger, and words of textbooks."""

import re

import pytest

from impactfem.errors import SceneError
from impactfem.scene import Joint, describe
from impactfem.scene.grammar import FUNCTIONS
from impactfem.scene.nearest import _SAME, nearest

TABLES = {table.name: [row.key for row in table.keys] for table in describe()}


def slips(word):
    """The word with a letter left out, doubled or exchanged with the next."""
    for i in range(len(word)):
        yield word[:i] + word[i + 1 :]
        yield word[:i] + word[i] + word[i:]
        yield word[:i] + word[i : i + 2][::-1] + word[i + 2 :]


def one_letter(one, two):
    """Whether words differ by one letter, replaced or added at the end."""
    same = sum(a == b for a, b in zip(one, two, strict=False))
    return abs(len(one) - len(two)) < 2 and same == max(len(one), len(two)) - 1


@pytest.mark.parametrize("table", TABLES)
def test_a_slip_is_understood(table):
    known = TABLES[table]
    alike = {wrong for key in known for wrong in slips(key) if wrong != key}
    # Those that are no slips of others, nor differ from them by a letter.
    alike |= {key for key in known for other in known if one_letter(key, other)}
    # Short ones: g12 and nu12 differ by slips.
    alike |= {
        key for key in known if len(key) < 5
        for wrong in slips(key) for other in known if other != key and one_letter(wrong, other)
    }  # fmt: skip
    for key in {*known} - alike:
        for wrong in {*slips(key)} - {*known, *_SAME}:
            if len(wrong) < 2:  # one letter may be anything
                continue
            assert nearest(wrong, known) == key
            assert nearest(wrong.upper(), known) == key


def test_words_of_textbooks_stand_for_what_there_is():
    words = {key for keys in TABLES.values() for key in keys} | set(FUNCTIONS)
    words |= {
        word for t in describe() for r in t.keys for word in re.findall(r'"(\w+)"', r.allowed)
    }
    words |= {"fixed", "sphere", "disc"}  # words of inline tables
    assert {word for words in _SAME.values() for word in words} <= words


@pytest.mark.parametrize(
    ("word", "meant"),
    [("hinge", "revolute"), ("slider", "prismatic"), ("weld", "fixed"), ("rope", "distance"),
     ("spherical", "ball"), ("cardan", "universal"), ("pinned", "revolute")],
)  # fmt: skip
def test_joints_by_their_other_names(word, meant):
    with pytest.raises(SceneError, match=f'did you mean "{meant}"'):
        Joint(kind=word, between=["a", "ground"], point=[0.0, 0.0])


def test_what_is_known_is_not_replaced():
    assert nearest("ANGLE", ["angle", "inclination"]) == "angle"
    assert nearest("angle", ["inclination", "angles"]) == "inclination"


def test_nonsense_has_no_hint():
    assert nearest("whizz", TABLES["[solve]"]) == ""
    assert nearest("x" * 1000, TABLES["[solve]"]) == ""
    assert nearest("\0", TABLES["[solve]"]) == ""
    assert nearest("Left", ["Left side", "Left"]) == "Left"
