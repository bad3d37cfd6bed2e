"""What is said of compilation, and to whom."""

import logging
from pathlib import Path

import pytest

from impactfem import first_use
from impactfem.log import Progress


@pytest.fixture
def told(monkeypatch):
    monkeypatch.setattr(first_use, "_said", set())
    monkeypatch.setattr(first_use, "_listeners", [logging.getLogger("impactfem").info])
    return []


def test_each_kind_is_announced_once(told):
    first_use.announce_to(told.append)
    for what in ("forms", "loops", "forms", "loops"):
        first_use.compiling(what, Path("/cache"))
    assert told == [
        "compiling forms (once, kept in /cache) ...",
        "compiling loops (once, kept in /cache) ...",
    ]


def test_the_logger_is_told_until_somebody_listens(told, caplog):
    caplog.set_level(logging.INFO, "impactfem")
    first_use.compiling("forms", Path("/cache"))
    first_use.announce_to(told.append)
    first_use.compiling("loops", Path("/cache"))
    assert caplog.messages == ["compiling forms (once, kept in /cache) ..."]
    assert told == ["compiling loops (once, kept in /cache) ..."]


@pytest.mark.parametrize("enabled", [False, True])
def test_messages_are_logged_and_where_enabled_printed(enabled, caplog, capsys):
    caplog.set_level(logging.DEBUG, "impactfem")
    progress = Progress(enabled)
    progress.step("assemble")
    progress.message("a note\x1b[2J")
    said = [(record.levelname, record.name, record.message) for record in caplog.records]
    assert said[0] == ("DEBUG", "impactfem", "assemble")
    assert said[1][:2] == ("INFO", "impactfem")
    assert said[1][2].startswith("a note")
    assert "\x1b" not in said[1][2]
    assert capsys.readouterr().err == f"{said[1][2]}\n" * enabled


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
