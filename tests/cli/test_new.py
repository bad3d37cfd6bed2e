"""Starter scenes: listed, written beside their schema, valid with each optional key, and run."""

import json
import re
import tomllib

import jsonschema
import pytest
from conftest import finish, launch, start
from processes import contents

from impactfem.cli import BAD_INPUT, DONE, FAILED
from impactfem.planning import plan
from impactfem.scene import Scene, describe
from impactfem.scene.json_schema import json_schema, json_schema_text
from impactfem.shipped import shipped_scenes
from impactfem.starting import SCHEMA_NAME, starters

OPTION = re.compile(r"#[a-z\[]")
VALIDATOR = jsonschema.Draft7Validator(json_schema())
# Keys that no starter shows: its file would need a mesh of space and time, or a STEP assembly.
UNSHOWN = {
    ("[solve]", "mesh"), ('[[body]] with kind = "rigid"', "part"),
    ('[[body]] with kind = "solid"', "part"), ('[[obstacle]] with kind = "mesh"', "part"),
}  # fmt: skip


def options(text):
    """Numbers of the lines to uncomment together: one key, or a table with its keys."""
    lines, groups = text.split("\n"), []
    for number, line in enumerate(lines):
        if not OPTION.match(line):
            continue
        inside = groups and groups[-1][-1] == number - 1 and lines[groups[-1][0]][1] == "["
        if inside and line[1] != "[":
            groups[-1].append(number)
        else:
            groups.append([number])
    return groups


def uncommented(text, numbers):
    lines = text.split("\n")
    return "\n".join(line[n in numbers :] for n, line in enumerate(lines))


TEXTS = {kind: path.read_text(encoding="utf-8") for kind, path in starters().items()}
OPTIONS = [(kind, group) for kind, text in TEXTS.items() for group in options(text)]


def needed(kind):
    """Skip what an extra is missing for."""
    if kind == "mechanism":
        pytest.importorskip("pinocchio")


def test_all_kinds_are_listed(command):
    done = command("new")
    assert done.code == DONE
    assert [line.split()[0] for line in done.out.splitlines()] == sorted(TEXTS)


@pytest.mark.slow
@pytest.mark.parametrize("kind", TEXTS)
def test_a_starter_runs_as_it_is(kind, command, work):
    needed(kind)
    done = command("new", kind)
    assert done.code == DONE, done.err
    assert (work / f"{kind}.toml").read_text().startswith(f"#:schema ./{SCHEMA_NAME}\n")
    assert (work / SCHEMA_NAME).read_text() == json_schema_text()
    few = ("--set", "output.fields=[]", "--set", "output.report=false")
    done = command("run", f"{kind}.toml", *few, "--quiet")
    assert done.code == DONE, done.err
    assert done.err == "", "it warns"
    summary = json.loads((work / f"results/{kind}/summary.json").read_text())
    assert summary["status"] == "completed"
    if summary["error"] is not None:
        assert summary["error"]["displacement_max"] < 0.05  # of fields: none calls for care
        assert summary["error"]["force_l1"] < 0.05
    assert summary["verdict"]["level"] == "trust", summary["verdict"]
    assert "\n# Error of the motion as it stands: " in TEXTS[kind]
    assert summary["contact"]["impulse"] > 0


@pytest.mark.parametrize(("kind", "group"), OPTIONS)
def test_each_optional_key_is_valid_alone(kind, group):
    needed(kind)
    data = tomllib.loads(uncommented(TEXTS[kind], group))
    assert data != tomllib.loads(TEXTS[kind])
    VALIDATOR.validate(data)
    scene = Scene.from_dict(data, base=starters()[kind].parent)
    if kind != "solid_3d":  # its meshes take long
        plan(scene)


def test_starters_show_every_key():
    shown = {name for text in TEXTS.values() for name in re.findall(r"([a-z_0-9]+) = ", text)}
    keys = {(table.name, row.key) for table in describe() for row in table.keys}
    tables = {key for table, key in keys if table == "top level" and key not in shown}
    assert tables <= {re.sub(r"[][]", "", table.partition(" ")[0]) for table, _ in keys}
    assert not {(table, key) for table, key in keys - UNSHOWN if key not in shown | tables}


def test_every_key_is_explained():
    """Each line with a key bears a comment, unless the same key stood before."""
    for kind, text in TEXTS.items():
        known = {"title", "mesh_size"}
        for line in text.split("\n"):
            found = re.match(r"#?([a-z_]+) = ", line)
            if found and found[1] not in known:
                assert "  # " in line or found[1] in {"kind", "name", "model"}, (kind, line)
                known.add(found[1])


def test_a_shipped_scene_can_be_copied(command, work):
    assert command("new", "corner", "--out", "my.toml").code == DONE
    text = (work / "my.toml").read_text()
    assert text.partition("\n")[2] == shipped_scenes()["corner"].read_text()


def test_the_path_of_the_schema_can_be_chosen(command, work):
    assert command("new", "bar", "--schema", "../schemas/scene.json").code == DONE
    assert sorted(contents(work)) == ["bar.toml"]
    assert (work / "bar.toml").read_text().startswith("#:schema ../schemas/scene.json\n")


def test_what_is_there_stays(command, work):
    (work / "mesh.geo").write_text("mine")
    (work / SCHEMA_NAME).write_text("{}")
    before = contents(work)
    done = command("new", "mesh")
    assert done.code == BAD_INPUT
    assert "mesh.geo: is there already; give another name (--out) or remove it" in done.err
    assert contents(work) == before
    assert command("new", "bar").code == DONE
    assert (work / SCHEMA_NAME).read_text() == "{}", "a file of someone else"
    done = command("new", "bar")
    assert done.code == BAD_INPUT
    assert "bar.toml: is there already" in done.err


def test_the_schema_of_another_version_is_replaced(command, work):
    (work / SCHEMA_NAME).write_text(json_schema_text().replace("duration", "time"))
    assert command("new", "bar", "--out", ".").code == DONE
    assert (work / SCHEMA_NAME).read_text() == json_schema_text()


@pytest.mark.parametrize(
    ("line", "code", "said"),
    [
        (["brr"], BAD_INPUT, 'no kind "brr", did you mean "bar"?'),
        (["solid3d"], BAD_INPUT, 'did you mean "solid_3d"?'),
        (["bar", "--out", "bar.txt"], BAD_INPUT, "the name of a scene file ends in .toml"),
        (["bar", "--out", "no/bar.toml"], FAILED, "no/bar.toml: cannot be written"),
        (["../bar"], BAD_INPUT, "there is no kind"),
    ],
)
def test_what_cannot_be_written_is_refused(line, code, said, command, work):
    done = command("new", *line)
    assert done.code == code
    assert said in done.err
    assert contents(work) == {}


def test_the_schema_is_printed_or_written(command, work):
    assert command("schema").out == json_schema_text()
    assert command("schema", "--out", "x.json").code == DONE
    assert (work / "x.json").read_text() == json_schema_text()
    assert command("schema", "--out", "no/x.json").code == FAILED


@pytest.mark.slow
def test_on_two_ranks_one_writes(work):
    done = launch(work, 2, "-m", "impactfem", "new", "point")
    assert done.code == DONE, done.err
    assert done.out.count("wrote point.toml") == 1
    assert sorted(contents(work)) == [SCHEMA_NAME, "point.toml"]
    again = launch(work, 2, "-m", "impactfem", "new", "point")
    assert again.code == BAD_INPUT
    assert again.err.count("is there already") == 1


def test_in_a_process_of_its_own(work):
    assert finish(start(work, "new", "point")).code == DONE
    assert finish(start(work, "validate", "point.toml")).code == DONE
