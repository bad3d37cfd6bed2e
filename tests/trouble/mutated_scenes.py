"""Scenes made from shipped ones and starters by seeded mutations, each run in a child with limits.

As a script: `mutated_scenes.py FOLDER FIRST LAST SECONDS` prints a line of JSON for each seed: the
scene, what was changed, the exit codes of `plan` and `run`, and what is wrong; its exit status is 1
if something is. After so many seconds it begins no other, and tells how many were tried.
"""

import contextlib
import copy
import json
import math
import os
import random
import resource
import signal
import sys
import time
import tomllib
import traceback
from pathlib import Path

from impactfem.cli import main
from impactfem.scene.toml import write_value
from impactfem.shipped import shipped_scenes
from impactfem.starting import starters

SECONDS, MEMORY, WRITTEN = 60, 6 << 30, 50 << 20  # limits of one scene
CHEAP = 0.1  # seconds that the plan may foresee: of longer runs the beginning
HEAVY = {
    "linkage",
    "mechanism",
    "mesh",
    "plate",
    "rigid",
    "springs",
    "surface",
}  # seconds each: drawn less often
RARE = 0.85
BARE = ("output.pictures=false", "output.film=false", "output.report=false", "output.fields=[]")


def numbers(table, path=()):
    """Tables (or lists) with the key of each number in them."""
    entries = table.items() if isinstance(table, dict) else enumerate(table)
    for key, value in entries:
        if isinstance(value, dict | list):
            yield from numbers(value, (*path, key))
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield table, key, ".".join(map(str, (*path, key)))


def mutated(scene, draw):
    """Change a scene in one to three places; returns what was done."""
    done = []
    for _ in range(draw.choice([1, 1, 2, 3])):
        found = list(numbers(scene))
        table, key, place = draw.choice(found)
        old = table[key]
        new = draw.choice([
            old * 10.0 ** draw.uniform(-6, 6), old * draw.uniform(0.3, 3.0), -old, 0.0,
            draw.choice([1e-30, 1e-9, 1.0, 1e9, 1e30]), old + draw.uniform(-1, 1),
            float(draw.randrange(-3, 4)),
        ])  # fmt: skip
        table[key] = int(new) if isinstance(old, int) and abs(new) < 1e15 else float(new)
        done.append(f"{place}: {old} -> {table[key]}")
    return done


def sources():
    """Scenes to begin with, by name."""
    return dict(sorted((shipped_scenes() | starters()).items()))


def made(seed):
    """Text of the mutated scene of a seed, its source and what was changed."""
    draw = random.Random(seed)  # noqa: S311
    found = sources()
    name = draw.choice([*found])
    if name in HEAVY and draw.random() < RARE:
        name = draw.choice([name for name in found if name not in HEAVY])
    path = found[name]
    scene = copy.deepcopy(tomllib.loads(path.read_text(encoding="utf-8")))
    done = mutated(scene, draw)
    text = "".join(f"{key} = {write_value(value)}\n" for key, value in scene.items())
    return name, path.parent, text, done


def warmed(folder):
    """Load in this process what children need: libraries and compiled code of every kind."""
    folder.mkdir(parents=True)
    for number, path in enumerate(sources().values()):
        begin = tomllib.loads(path.read_text(encoding="utf-8"))["duration"] * 1e-3
        settings = [word for each in (*BARE, f"duration={begin!r}") for word in ("--set", each)]
        with contextlib.redirect_stdout(None), contextlib.redirect_stderr(None):
            main(["run", str(path), "--out", str(folder / str(number)), "--quiet", *settings])


def limited(folder, *words):
    """Run the command line in a child with limits; returns its exit code and what it said."""
    pid = os.fork()
    if pid == 0:
        code = 99
        try:
            for limit, value in (
                (resource.RLIMIT_CPU, SECONDS), (resource.RLIMIT_AS, MEMORY),
                (resource.RLIMIT_FSIZE, WRITTEN),
            ):  # fmt: skip
                resource.setrlimit(limit, (value, value))
            signal.signal(signal.SIGXCPU, signal.SIG_DFL)
            with open(folder / "said", "w", encoding="utf-8") as said:  # noqa: PTH123
                os.dup2(said.fileno(), 1)
                os.dup2(said.fileno(), 2)
                os.chdir(folder)
                code = main(list(words))
                sys.stdout.flush()
                sys.stderr.flush()
        except BaseException:  # noqa: BLE001
            traceback.print_exc()
            sys.stderr.flush()
        os._exit(code)
    _, status = os.waitpid(pid, 0)
    return os.waitstatus_to_exitcode(status), (folder / "said").read_text(encoding="utf-8")


def wrong_numbers(value, path="summary"):
    """Numbers that are none."""
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    for key, each in entries:
        if isinstance(each, dict | list):
            yield from wrong_numbers(each, f"{path}.{key}")
        elif isinstance(each, float) and math.isnan(each):
            yield f"{path}.{key} is not a number"


def judged(code, summary):
    """Complaints about the summary of a run that ended with 0 or 3."""
    level = summary["verdict"]["level"]
    if (code == 3) != (level == "do_not_trust"):
        yield f"exit code {code} beside the verdict {level}"
    yield from wrong_numbers(summary)


def tried(seed, folder):
    """What a seed does: a dictionary with the complaints under "wrong"."""
    name, beside, text, done = made(seed)
    folder.mkdir(parents=True)
    for other in beside.iterdir():
        if other.suffix in {".geo", ".stl", ".urdf"}:
            (folder / other.name).symlink_to(other)
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    before = {path.name for path in folder.iterdir()} | {"said"}
    told = {"seed": seed, "scene": name, "changed": done, "wrong": []}
    complain = told["wrong"].append
    code, said = limited(folder, "plan", "scene.toml", "--json")
    told["plan"] = code
    if code not in {0, 2} or "Traceback" in said:
        complain(f"plan ended with {code}: {said[-600:]}")
    if code == 0:
        seconds = json.loads(said[said.index("{") :])["cost"]["seconds"] or 0.0
        words = [*BARE]
        if seconds > CHEAP:  # its beginning
            words.append(f"duration={tomllib.loads(text)['duration'] * CHEAP / seconds!r}")
        settings = [word for each in words for word in ("--set", each)]
        code, said = limited(folder, "run", "scene.toml", "--out", "out", "--quiet", *settings)
        told["run"] = code
        if code not in {0, 2, 3} or "Traceback" in said:
            complain(f"run ended with {code}: {said[-600:]}")
        if code in {0, 3}:
            before.add("out")
            summary = json.loads((folder / "out" / "summary.json").read_text(encoding="utf-8"))
            told["verdict"] = summary["verdict"]
            told["wrong"] += judged(code, summary)
    if {path.name for path in folder.iterdir()} - before:
        complain("files beside what was asked for")
    told["cpu"] = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    return told


if __name__ == "__main__":
    where, (first, last, seconds) = Path(sys.argv[1]).resolve(), map(int, sys.argv[2:])
    warmed(where / "warm")
    bad, count, until = 0, 0, time.monotonic() + seconds
    for number in range(first, last):
        found = tried(number, where / str(number))
        print(json.dumps(found), flush=True)
        bad, count = bad + bool(found["wrong"]), count + 1
        if time.monotonic() > until:
            break
    told = f"{count - bad} of {count} scenes ended with a word, {last - first - count} not tried"
    print(told, file=sys.stderr)
    sys.exit(bool(bad))
