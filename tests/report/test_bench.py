"""The sub-command bench."""

import pytest

from impactfem.cli import BAD_INPUT, DONE, FAILED, main


@pytest.mark.slow
def test_study_is_printed_and_written(tmp_path, capsys):
    code = main([
        "bench", "bar_impact", "--methods", "galerkin,conserving@courant=2", "--sizes", "8,16",
        "--repeats", "1", "--out", str(tmp_path),
    ])  # fmt: skip
    assert code == DONE
    assert "conserving@courant=2" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"study.csv", "study.md", "study.png"}


@pytest.mark.slow
def test_board_of_one_method(tmp_path, capsys):
    assert main(["bench", "--hard", "--methods", "exact", "--out", str(tmp_path)]) == DONE
    assert "0 fail" in capsys.readouterr().out
    assert (tmp_path / "hard_cases.md").exists()


def test_a_study_in_which_everything_fails_has_its_exit_code(capsys):
    arguments = ["bench", "bar_impact", "--methods", "galerkin@courant=2", "--sizes", "8"]
    assert main(arguments) == FAILED
    assert "stability limit" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bench"], "no scene"),
        (["bench", "bar_impact", "--sizes", "ten"], "whole numbers"),
        (["bench", "bar_impact", "--methods", "magic"], "magic"),
        (["bench", "--hard", "--methods", "magic"], "magic"),
    ],
)
def test_wrong_arguments_are_bad_input(arguments, message, capsys):
    assert main(arguments) == BAD_INPUT
    assert message in capsys.readouterr().err
