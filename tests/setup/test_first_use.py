"""What is said of compilation, and to whom."""

from pathlib import Path

import pytest

from impactfem import first_use


@pytest.fixture
def told(monkeypatch):
    monkeypatch.setattr(first_use, "_said", set())
    monkeypatch.setattr(first_use, "_listeners", [])
    return []


def test_each_kind_is_announced_once(told):
    first_use.announce_to(told.append)
    for what in ("forms", "loops", "forms", "loops"):
        first_use.compiling(what, Path("/cache"))
    assert told == [
        "compiling forms (once, kept in /cache) ...",
        "compiling loops (once, kept in /cache) ...",
    ]


def test_nobody_is_told_until_somebody_listens(told):
    first_use.compiling("forms", Path("/cache"))
    first_use.announce_to(told.append)
    first_use.compiling("forms", Path("/cache"))
    assert len(told) == 1


def test_the_home_is_shortened(told, monkeypatch):
    monkeypatch.setenv("HOME", "/home/somebody")
    first_use.announce_to(told.append)
    first_use.compiling("forms", Path("/home/somebody/.cache/fenics"))
    assert "kept in ~/.cache/fenics)" in told[0]


def test_what_cannot_be_kept_is_said(told):
    first_use.announce_to(told.append)
    first_use.compiling("loops", None)
    assert "no cache folder can be written: each time" in told[0]


def test_seconds_are_counted_from_a_start_on_and_shown(monkeypatch):
    monkeypatch.setattr(first_use, "_spans", [])
    shown = []
    first_use.count_to(shown.append)
    first_use.compiled(1.0, 3.0)
    first_use.compiled(5.0, 5.5)
    first_use.count_to(None)
    first_use.compiled(7.0, 8.0)
    assert shown == ["compiling: 1 pieces, 2 s", "compiling: 2 pieces, 2 s"]
    assert first_use.compiled_since(0.0) == 3.5
    assert first_use.compiled_since(4.0) == 1.5
    assert first_use.compiled_since(9.0) == 0.0
