"""The tutorial and the how-to pages: every scene, command and script on them works as printed.

Fenced blocks of a page are taken in their order, in one scratch folder a page:

- any language with a caption: the text is written to the file of that name; with `diff` as the
  language and a file of the package as the caption, a copy of the package is changed so;
- `sh`: run, with a caption only where VTK can draw off screen; what `impactfem` says comes from
  this process, which is as good as a start and faster, and it draws nothing;
- `text` with the caption "prints": what the last `sh` block printed, word by word. `...` stands for
  any word, `[...]` for all that follows; numbers may differ by 5 %, those below 1e-7 as they like;
- anything else (`console`, `text`) is only shown.
"""

import io
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from contextlib import chdir, redirect_stdout
from pathlib import Path

import pytest
from processes import BARE, as_started

import impactfem
from impactfem.cli import main

DOCS = Path(__file__).resolve().parents[2] / "docs"
TOP_PAGES = ("start", "units", "faq", "coming_from_abaqus", "coming_from_mujoco")
PAGES = sorted(
    [
        *(DOCS / f"{name}.md" for name in TOP_PAGES),
        *(DOCS / "tutorial").glob("*.md"), *(DOCS / "howto").glob("*.md"),
    ]
)  # fmt: skip
# The scenes of these pages need the kinds that the pages add.
ADDING = {DOCS / "howto" / f"{name}.md" for name in ("body", "obstacle", "law")}
SHOWING = sorted({*DOCS.glob("*.md"), *PAGES} - ADDING)
# Up to what another program or file takes from it.
CALL = re.compile(r"impactfem (?P<words>([^'|>;&]|'[^']*')+)(?P<rest>.*)")
BLOCK = re.compile(
    r"^```(?:\{code-block\} )?(?P<language>\w+)\n(?::caption: (?P<caption>[^\n]+)\n)?"
    r"(?::[^\n]*\n)*(?P<text>.*?)^```$",
    re.DOTALL | re.MULTILINE,
)


@pytest.fixture
def folder(tmp_path):
    """A scratch folder with `python` and `impactfem` of this environment in `bin`."""
    tools = tmp_path / "bin"
    tools.mkdir()
    for name, module in (("python", ""), ("impactfem", "-m impactfem ")):
        script = tools / name
        script.write_text(f'#!/bin/sh\nexec {sys.executable} {module}"$@"\n', encoding="utf-8")
        script.chmod(0o755)
    return tmp_path


def environment(folder):
    """Variables of the commands: tools first, a changed package if there is one."""
    # Not as a rank: the MPI of this process may have left its marks.
    marks = ("PMI_", "PMIX_", "OMPI_COMM_")
    clean = {name: value for name, value in os.environ.items() if not name.startswith(marks)}
    places = [str(folder / "bin"), str(Path(sys.executable).parent), os.environ["PATH"]]
    clean |= {"PATH": os.pathsep.join(places), "MPLBACKEND": "Agg"}
    if os.geteuid() == 0:  # Open MPI asks for it
        clean |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    changed = folder / "changed"
    return clean | {"PYTHONPATH": str(changed)} if changed.exists() else clean


def execute(text, folder):
    """What the lines of a block print, each a command of the shell; all must end well."""
    printed = ""
    for line in text.splitlines():
        done = subprocess.run(
            ["sh", "-e", "-c", called(line, folder)], cwd=folder, env=environment(folder),
            timeout=900, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
        printed += done.stdout
    return printed


def called(line, folder):
    """A line for the shell, with what `impactfem` said in this process in the place of its call.

    A page that adds to the package, or another stream than the first, takes a process of its own.
    """
    found = CALL.match(line)
    if found is None or "--extension" in line or "2>" in line or (folder / "changed").exists():
        return line
    words, said = shlex.split(found["words"]), io.StringIO()
    with as_started(), chdir(folder), redirect_stdout(said):
        code = main([*words, *(BARE if words[0] == "run" else ())])
    (folder / ".said").write_text(said.getvalue(), encoding="utf-8")
    return f"(cat .said; exit {code}){found['rest']}"


def can_draw(folder):
    """Whether VTK draws without a display; Debian's ends the process instead."""
    probe = "import pyvista; pyvista.Plotter(off_screen=True).screenshot('probe.png')"
    command = [sys.executable, "-c", probe]
    return subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode == 0


def change(text, name, folder):
    """Change a file of a copy of the package: each hunk's old lines must stand there once."""
    copy = folder / "changed" / "impactfem"
    if not copy.exists():  # with its compiled loops
        shutil.copytree(Path(impactfem.__file__).parent, copy)
    file = copy / Path(name).relative_to("impactfem")
    content = file.read_text(encoding="utf-8") if file.exists() else ""
    for hunk in re.split(r"^@@.*\n", text, flags=re.MULTILINE):
        lines = [line for line in hunk.splitlines() if line]
        old = "\n".join(line[1:] for line in lines if line[0] != "+")
        new = "\n".join(line[1:] for line in lines if line[0] != "-")
        if not old:  # only added: at the end
            content += ("\n\n" if content else "") + new + "\n"
        else:
            assert content.count(old) == 1, f"{name} has not once:\n{old}"
            content = content.replace(old, new)
    file.write_text(content, encoding="utf-8")


def same(wanted, got):
    # Which page meets a loop first, and compiles it, hangs on their order.
    got = re.sub(r" and, this once, \S+ s to compile code,", ",", got)
    words, said = wanted.split(), got.split()
    if words[-1:] == ["[...]"]:
        words, said = words[:-1], said[: len(words) - 1]
    return len(words) == len(said) and all(map(agree, words, said))


def agree(word, said):
    """Whether a printed word is the one on the page, or a number near it."""
    if word in {"...", said}:
        return True
    try:
        one, other = float(word.strip(",;%()")), float(said.strip(",;%()"))
    except ValueError:
        return False
    return math.isclose(one, other, rel_tol=0.05) or max(abs(one), abs(other)) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_works_as_printed(page, folder):
    printed = ""
    for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
        language, caption, text = block["language"], block["caption"], block["text"]
        if language == "sh":
            if caption is None or can_draw(folder):
                printed = execute(text, folder)
        elif language == "diff":
            change(text, caption, folder)
        elif caption == "prints":
            assert same(text, printed), f"the page says\n{text}\nand it printed\n{printed}"
        elif caption is not None:
            (folder / caption).write_text(text, encoding="utf-8")


def test_pages_hold_commands():
    blocks = [block for page in PAGES for block in BLOCK.finditer(page.read_text("utf-8"))]
    assert sum(block["language"] == "sh" for block in blocks) > 10
    named = {"python", "diff"}
    assert all(block["caption"] for block in blocks if block["language"] in named)


def shown(page, language):
    """Texts of the blocks of a language, written `{code-block}` or plainly."""
    found = BLOCK.finditer(page.read_text("utf-8"))
    return [block["text"] for block in found if block["language"] == language]


def test_first_scene_is_the_one_to_start_from():
    starter = Path(impactfem.__file__).parent / "starters" / "bar.toml"
    written = tomllib.loads(starter.read_text("utf-8"))
    (text,) = shown(DOCS / "start.md", "toml")
    assert tomllib.loads(text) == {name: value for name, value in written.items() if value}


@pytest.mark.parametrize("page", SHOWING, ids=lambda page: page.stem)
def test_shown_scenes_can_be_read(page):
    modules = "".join(shown(page, "python"))
    for text in shown(page, "toml"):
        scene = tomllib.loads(text)
        method = scene.get("solve", {}).get("method")  # of one that the page registers: run there
        if {"body", "duration"} <= set(scene) and f'"{method}"' not in modules:
            impactfem.Scene.from_dict(scene)
    for text in shown(page, "python"):
        compile(text, str(page), "exec")


@pytest.mark.parametrize(
    ("word", "said", "agrees"),
    [("1.00,", "1.04,", True), ("1.00", "1.06", False), ("3e-12", "8e-14", True),
     ("done", "failed", False), ("...", "0.3", True), ("energy", "3", False)],
)  # fmt: skip
def test_words_of_a_page_are_compared(word, said, agrees):
    assert agree(word, said) is agrees
