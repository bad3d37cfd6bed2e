"""`impactfem compare`: what it prints and its exit codes."""

from processes import BARE

from impactfem.commands import BAD_INPUT, DONE, NOT_TRUSTED


def test_results_are_compared(command, work):
    for name, gap in (("one", 0.5), ("same", 0.5), ("other", 0.4)):
        out = ("--out", work / name, "--set", f"body.bar.gap={gap}", "--quiet")
        assert command("run", "bar_impact", *out, *BARE).code == DONE
    same = command("compare", work / "one", work / "same")
    assert same.code == DONE
    assert "columns  equal" in same.out
    other = command("compare", work / "one", work / "other")
    assert other.code == NOT_TRUSTED
    assert "contact_force" in other.out
    assert "of 0.5 N" in other.out
    assert command("compare", work / "one", work / "other", "--tolerance", "5").code == DONE
    absent = command("compare", work / "one", work / "absent")
    assert absent.code == BAD_INPUT
    assert "no complete result" in absent.err
    wrong = command("compare", work / "one", work / "same", "--tolerance", "-1")
    assert wrong.code == BAD_INPUT
    assert "--tolerance" in wrong.err
