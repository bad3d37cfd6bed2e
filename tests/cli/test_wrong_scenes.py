"""Wrong scenes, more than a hundred: exit code 2, one message with a remedy, nothing written."""

import jsonschema
import pytest
from conftest import finish, start
from mutations import by_hand, mutations
from processes import contents

from impactfem.cli import BAD_INPUT
from impactfem.scene.json_schema import json_schema

BY_HAND = {wrong.name: wrong for wrong in by_hand()}
MADE = {wrong.name: wrong for wrong in mutations()}
WRONG = BY_HAND | MADE
SAMPLE = sorted(WRONG)[:: len(WRONG) // 10][:10]
# Lines of a message without the list of known keys, which is as long as the table has keys.
LONGEST = 700


def write(folder, wrong):
    (folder / "scene.toml").write_bytes(wrong.text)
    for name, text in wrong.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return contents(folder)


def check(done, wrong):
    assert done.code == BAD_INPUT, done.out
    assert done.out == ""
    for part in wrong.says:
        assert part in done.err
    assert "Traceback" not in done.err
    message = done.err.partition(" Known keys:")[0].strip()
    assert "\n" not in message
    assert message.startswith("impactfem: ")
    assert len(message) < LONGEST


def test_there_are_many_of_all_kinds():
    assert len(BY_HAND) >= 90
    assert len(MADE) >= 150
    assert len({name.rpartition(", ")[2] for name in MADE}) == 8
    assert len({wrong.text for wrong in WRONG.values()}) >= 250


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_scene_is_refused_with_a_remedy(name, command, work):
    wrong = WRONG[name]
    before = write(work, wrong)
    for action in ("validate", "run"):
        check(command(action, "scene.toml"), wrong)
    assert contents(work) == before


DOUBTED = {
    "velocity away from the wall": (
        ("bar_impact", "body.bar.velocity=0.5"), "never presses on the wall",
    ),
    "gravity upwards": (("dropped_disc", "gravity=[0.0, 9.81]"), "disc meets nothing"),
    "obstacle forgotten": (("dropped_disc", "obstacle=[]"), "disc meets nothing"),
    "too short": (("dropped_disc", "duration=0.01"), "flies freely"),
    "modulus in GPa": (("dropped_beam", "body.beam.youngs_modulus=210"), "check the units"),
    "no restitution": (("bouncing_ball", "contact=[]"), "add [[contact]]"),
    "degree that locks": (
        ("dropped_disc", "body.disc.poisson_ratio=0.4995", "body.disc.degree=1"), "lock",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DOUBTED)
def test_what_is_probably_not_meant_is_in_order_with_a_warning(name, command, work):
    (scene, *changes), warning = DOUBTED[name]
    before = contents(work)
    done = command("validate", scene, *(part for text in changes for part in ("--set", text)))
    assert done.code == 0, done.err
    assert "in order" in done.out.splitlines()[0]
    assert any(
        line.startswith("warning: ") and warning in line for line in done.out.splitlines()[1:]
    ), done.out
    assert contents(work) == before


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLE)
def test_a_wrong_scene_in_a_process_of_its_own(name, work):
    wrong = WRONG[name]
    before = write(work, wrong)
    check(finish(start(work, "run", "scene.toml")), wrong)
    assert contents(work) == before


@pytest.mark.parametrize("name", MADE)
def test_the_schema_refuses_mistakes_in_one_value_too(name):
    assert not jsonschema.Draft7Validator(json_schema()).is_valid(MADE[name].data)
