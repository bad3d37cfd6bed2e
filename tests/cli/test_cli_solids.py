"""The commands for solids: what they print, write and return."""

import json

import numpy as np
import pytest
from conftest import launch
from processes import BARE, contents

from impactfem.cli import BAD_INPUT, DONE, NOT_TRUSTED
from impactfem.facade import Result
from impactfem.marching.checkpoint import FILE
from impactfem.scene import Scene
from impactfem.signals import InterruptedRunError

DISC = """
title = "a disc"
duration = 4.0

[[body]]
name = "disc"
kind = "solid"
model = "plane_strain"
shape = { kind = "disc", radius = 0.5, center = [0.0, 0.5025] }
mesh_size = 0.125
density = 1.0
youngs_modulus = 0.75
poisson_ratio = 0.3
velocity = [0.0, -0.0125]

[[obstacle]]
name = "floor"
kind = "half_space"
point = [0.0, 0.0]
normal = [0.0, 1.0]
"""
QUICK = (*BARE, "--set", "solve.estimate=false", "--set", "output.fields=[]")


@pytest.fixture
def disc(work):
    (work / "disc.toml").write_text(DISC, encoding="utf-8")
    return work / "disc.toml"


def history(folder):
    return np.genfromtxt(folder / "history.csv", delimiter=",", skip_header=1)


def test_run_writes_result_and_error_estimate(disc, command, work):
    done = command("run", disc, "--set", "body.disc.mesh_size=0.08")
    assert done.code == DONE, done.err
    folder = work / "results/disc"
    assert {"scene.toml", "history.csv", "history.nc", "fields.vtkhdf", "summary.json"} <= {
        path.name for path in folder.iterdir()
    }
    assert "elements twice and four times as large" in done.out
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["status"] == "completed"
    assert summary["num_steps"] == summary["details"]["layers"]
    assert summary["details"]["memory_per_unknown_kib"] > 0
    assert summary["plan"]["estimate"] is True
    assert len(summary["contact"]["intervals"]) == 1
    # Thrown at .1 m/s over .02 m; released at once or after waves have run through the disc.
    assert summary["contact"]["intervals"][0][0] == pytest.approx(0.2, abs=0.1)


def test_scene_as_used_runs_again_to_the_same_history(disc, command, work):
    assert command("run", disc, *QUICK, "--out", "first", "--quiet").code == DONE
    scene = Scene.from_toml(work / "first/scene.toml")
    assert scene.solve.method == "explicit"
    assert scene.solid.degree == 1
    again = command("run", "first/scene.toml", "--out", "second", "--quiet")
    assert again.code == DONE, again.err
    np.testing.assert_array_equal(history(work / "first"), history(work / "second"))


def test_plan_shows_choices_reasons_and_offers(disc, command):
    done = command("plan", disc)
    assert done.code == DONE
    for word in ("model", "linear solver", "why method", "why contact 1", "offer symmetry"):
        assert f"\n{word} " in done.out
    assert 'symmetry = ["x"]' in done.out


def test_plan_and_validate_write_nothing(disc, command, work):
    before = contents(work)
    assert command("plan", disc).code == DONE
    done = command("validate", disc)
    assert (done.code, done.err) == (DONE, "")
    assert done.out.endswith("in order (a disc)\n")
    assert contents(work) == before


@pytest.mark.parametrize("action", ["validate", "plan", "run"])
def test_body_inside_the_obstacle_is_bad_input(disc, command, work, action):
    disc.write_text(DISC.replace("0.5025", "0.42"), encoding="utf-8")
    before = contents(work)
    done = command(action, disc)
    assert done.code == BAD_INPUT
    assert "disc" in done.err
    assert "move the body by" in done.err
    assert contents(work) == before


def test_negative_control_is_kept_and_marked(disc, command, work):
    done = command(
        "run", disc, *QUICK, "--set", "solve.method=newmark", "--set", "solve.courant=0.3"
    )
    assert done.code == NOT_TRUSTED
    assert "unstable" in done.err
    assert 'method = "massless"' in done.err
    assert json.loads((work / "results/disc/summary.json").read_text())["status"] == "unstable"


def test_methods_name_those_of_solids(command):
    out = command("methods").out
    for name in ("massless", "explicit", "moreau_jean", "conserving", "newmark", "galerkin"):
        assert f"\n{name} " in f"\n{out}"


@pytest.mark.slow
def test_plot_draws_again(disc, command, work):
    assert command("run", disc, "--set", "solve.estimate=false", "--quiet").code == DONE
    picture = work / "results/disc/contact_force.png"
    assert not picture.exists()
    assert command("plot", "results/disc").code == DONE
    assert picture.exists()


def test_long_runs_keep_checkpoints_and_history_by_themselves(disc, command, work, monkeypatch):
    """A plan above the limit; what a stop leaves is the history of a whole run up to there."""
    from impactfem.marching import solids
    from impactfem.planning import plan
    from impactfem.runs import run

    keys = (*QUICK, "--quiet")
    assert command("run", disc, *keys, "--out", "whole").code == DONE
    whole, advance = history(work / "whole"), solids.SolidMarch._advance
    limit = len(whole) // 2

    def stopping(self):
        if self.layer == limit:
            raise InterruptedRunError(15)
        return advance(self)

    assert run.checkpoint_every(Scene.from_toml(disc), plan(Scene.from_toml(disc))) == 0.0
    monkeypatch.setattr(run, "_LONG", 0.0)
    monkeypatch.setattr(run, "_BETWEEN", 0.1 * plan(Scene.from_toml(disc)).seconds)
    with monkeypatch.context() as patch:
        patch.setattr(solids.SolidMarch, "_advance", stopping)
        done = command("run", disc, *keys, "--out", "long")
    assert done.code == 143
    assert "continue with: impactfem run --restart long" in done.err
    partial = work / "long" / "history.partial.csv"
    assert str(partial.name) in done.err
    found = np.genfromtxt(partial, delimiter=",", skip_header=1)
    assert 3 < len(found) < limit + 2
    np.testing.assert_array_equal(found, whole[: len(found)])
    assert command("run", "--restart", "long", "--quiet").code == DONE
    np.testing.assert_array_equal(history(work / "long"), whole)
    assert not partial.exists()
    assert not (work / "long" / FILE).exists()
    none = (*keys, "--set", "output.checkpoint=0", "--out", "none")
    with monkeypatch.context() as patch:
        patch.setattr(solids.SolidMarch, "_advance", stopping)
        assert command("run", disc, *none).code == 143
    assert not (work / "none").exists()


@pytest.fixture
def stopped(disc, command, work, monkeypatch):
    """A folder with the checkpoint of a run that was stopped in its midst, and a whole run."""
    from impactfem.marching import solids

    keys = ("--set", "output.checkpoint=10", "--set", "solve.estimate=false")
    whole = command("run", disc, *keys, "--out", "whole", "--quiet")
    assert whole.code == DONE, whole.err
    assert not (work / "whole" / FILE).exists()
    advance, count = solids.SolidMarch._advance, iter(range(10_000))

    def interrupted(self):
        if next(count) == 25:
            raise InterruptedRunError(2)
        return advance(self)

    with monkeypatch.context() as patch:
        patch.setattr(solids.SolidMarch, "_advance", interrupted)
        done = command("run", disc, *keys, "--out", "stopped", "--quiet")
    assert done.code == 130
    assert "continue with: impactfem run --restart stopped" in done.err
    return work / "stopped"


@pytest.mark.slow
def test_restart_goes_on_as_if_it_had_not_stopped(stopped, command, work):
    assert (stopped / FILE).exists()
    done = command("run", "--restart", "stopped", "--quiet")
    assert done.code == DONE, done.err
    np.testing.assert_array_equal(history(stopped), history(work / "whole"))
    assert {path.name for path in stopped.iterdir()} == {
        path.name for path in (work / "whole").iterdir()
    }
    fields, whole = Result.load(stopped).fields, Result.load(work / "whole").fields
    assert len(fields) == len(whole)
    for layer in (0, 10, len(whole) // 2, -1):
        found, wanted = fields.read(layer, "displacement"), whole.read(layer, "displacement")
        np.testing.assert_array_equal(found["displacement"], wanted["displacement"])


@pytest.mark.slow
def test_restart_on_other_ranks_and_into_another_folder(stopped, work):
    done = launch(work, 2, "-m", "impactfem", "run", "--restart", "stopped", "--out", "other")
    assert done.code == DONE, done.err
    assert not (stopped / FILE).exists()
    found, wanted = history(work / "other"), history(work / "whole")
    assert np.abs(found - wanted).max() <= 1e-12


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("run",), BAD_INPUT, "no scene is given"),
        (("run", "disc.toml", "--restart", "stopped"), BAD_INPUT, "leave SCENE"),
        (("run", "--restart", "nowhere"), BAD_INPUT, "no checkpoint that can be read"),
    ],
)
@pytest.mark.usefixtures("disc")
def test_wrong_restarts_are_refused(command, work, arguments, code, message):
    before = contents(work)
    done = command(*arguments)
    assert done.code == code
    assert message in done.err
    assert contents(work) == before


def test_a_checkpoint_that_is_cut_short_is_refused(command, work):
    (work / "cut").mkdir()
    (work / "cut" / FILE).write_bytes(b"PK\x03\x04 and no more")
    done = command("run", "--restart", "cut")
    assert done.code == BAD_INPUT
    assert "no checkpoint that can be read" in done.err


@pytest.mark.slow
def test_bench_measures_methods_against_a_finer_mesh(disc, command, work):
    done = command(
        "bench", disc, "--methods", "massless,explicit", "--sizes", "8,16", "--repeats", 1,
        "--out", "study",
    )  # fmt: skip
    assert done.code == DONE, done.err
    assert {path.name for path in (work / "study").iterdir()} == {
        "study.csv", "study.md", "study.png",
    }  # fmt: skip
    rows = [line.split(",") for line in (work / "study/study.csv").read_text().splitlines()]
    names = rows[0]
    table = [dict(zip(names, row, strict=False)) for row in rows[1:]]
    for method in ("massless", "explicit"):
        coarse, fine = (float(row["displacement_l2"]) for row in table if row["method"] == method)
        assert 0.0 < fine < coarse < 0.1


@pytest.mark.slow
def test_two_ranks_plan_validate_and_run(disc, work):
    for action in ("plan", "validate"):
        done = launch(work, 2, "-m", "impactfem", action, disc)
        assert done.code == DONE, done.err
        assert done.out.count("disc") == launch(work, 1, "-m", "impactfem", action, disc).out.count(
            "disc"
        )
    one = launch(work, 1, "-m", "impactfem", "run", disc, *QUICK, "--out", "one")
    two = launch(work, 2, "-m", "impactfem", "run", disc, *QUICK, "--out", "two")
    assert (one.code, two.code) == (DONE, DONE), two.err
    assert np.abs(history(work / "one") - history(work / "two")).max() <= 1e-12
