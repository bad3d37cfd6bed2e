"""The commands for points, rods and beams: what they print, write and return."""

import json

import numpy as np
import pytest
from conftest import launch

from impactfem.cli import BAD_INPUT, DONE
from impactfem.shipped import shipped_scenes

SHORT = {
    "oscillator": ("--set", "duration=0.5"),
    "corner": (),
    "bouncing_ball": (),
    "cradle": (),
    "vibrating_table": ("--set", "duration=0.5"),
    "dropped_beam": ("--set", "duration=0.001"),
}


def history(folder):
    return np.genfromtxt(folder / "history.csv", delimiter=",", names=True)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "settings"), SHORT.items(), ids=SHORT)
def test_run_writes_history_impacts_and_pictures(name, settings, command, work):
    drawn = name in {"bouncing_ball", "dropped_beam"}
    done = command("run", name, *settings, drawn=drawn)
    assert done.code == DONE, done.err
    folder = work / "results" / name
    written = {path.name for path in folder.iterdir()}
    assert {"scene.toml", "history.csv", "history.nc", "impacts.csv", "summary.json"} <= written
    assert ({"contact_force.png", "energy.png", "gap.png", "impacts.png"} <= written) is drawn
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["status"] == "completed"
    codes = [finding["code"] for finding in summary["verdict"]["findings"]]
    assert (summary["error"] is None) == ("no_estimate" in codes)
    assert "impacts" in done.out
    # What was used can be run again and gives the same.
    again = command("run", folder / "scene.toml", "--out", work / "again")
    assert again.code == DONE, again.err
    first, second = history(folder), history(work / "again")
    assert np.array_equal(first["gap"], second["gap"])


@pytest.mark.parametrize("name", SHORT)
def test_plan_says_what_and_why(name, command):
    done = command("plan", name)
    assert done.code == DONE
    assert "why method" in done.out
    assert "constraint" in done.out


def test_shipped_scenes_are_in_order(command):
    for name in SHORT:
        assert name in shipped_scenes()
        assert command("validate", name).code == DONE


@pytest.mark.parametrize("method", ["event_driven", "paoli_schatzman", "moreau_jean"])
def test_every_method_runs(method, command, work):
    done = command("run", "oscillator", "--set", f"solve.method={method}", "--set", "duration=0.3",
                   "--out", work / "out")  # fmt: skip
    assert done.code == DONE, done.err
    assert json.loads((work / "out/summary.json").read_text())["method"] == method


def test_warning_reaches_the_terminal_and_the_summary(command, work):
    both = "body.ball.position=[0.8090169943749475, 0.5877852522924731]"
    done = command("run", "corner", "--set", both, "--out", work / "out")
    assert done.code == DONE
    assert "two constraints meet" in done.err
    (found,) = json.loads((work / "out/summary.json").read_text())["verdict"]["findings"]
    text = found["text"]
    assert "no part pi/n" in text


MISTAKES = {
    "restitution": ("contact.0.restitution=2", "contact[0].restitution"),
    "position": ("body.mass.position=[0.7]", "overlap by 0.1 m"),
    "method": ("solve.method=explicit", "does not solve a point"),
    "force": ('body.mass.force=["q"]', "force"),
    "accuracy": ("solve.accuracy=1e-3", "solve.accuracy"),
}


@pytest.mark.parametrize(("setting", "text"), MISTAKES.values(), ids=MISTAKES)
@pytest.mark.parametrize("order", ["run", "plan", "validate"])
def test_mistake_ends_with_its_name_and_writes_nothing(order, setting, text, command, work):
    done = command(order, "oscillator", "--set", setting)
    assert done.code == BAD_INPUT
    assert text in done.err
    assert not (work / "results").exists()


def test_step_beyond_the_stability_limit_is_refused(command, work):
    stiff = ("--set", 'body.mass.force=["-1e6*x*(1 + x**2)"]', "--set", "solve.dt=0.1")
    done = command("run", "oscillator", *stiff, "--set", "solve.method=paoli_schatzman")
    assert done.code == BAD_INPUT
    assert "dt = 0.1" in done.err
    assert "use a smaller" in done.err
    assert not (work / "results").exists()


def test_restart_is_refused(command, work):
    command("run", "corner", "--out", work / "out")
    done = command("run", "--restart", work / "out")
    assert done.code == BAD_INPUT


@pytest.mark.slow
def test_two_ranks_give_the_same(command, work):
    assert command("run", "oscillator", "--out", work / "one").code == DONE
    done = launch(work, 2, "-m", "impactfem", "run", "oscillator", "--out", work / "two")
    assert done.code == DONE, done.err
    assert done.out.count("Driven oscillator") == 1
    assert (work / "one/history.csv").read_bytes() == (work / "two/history.csv").read_bytes()


@pytest.mark.slow
def test_mistake_on_two_ranks_is_said_once(work):
    done = launch(work, 2, "-m", "impactfem", "run", "oscillator", "--set", "body.mass.mass=-1",
                  timeout=240)  # fmt: skip
    assert done.code == BAD_INPUT
    assert done.err.count("body[0].mass = -1") == 1
