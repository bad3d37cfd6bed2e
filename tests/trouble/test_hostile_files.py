"""A hundred hostile files: `validate` ends soon with 0 or 2, says why, and does nothing else."""

import json
import re
import sys

import pytest
from hostile_files import written
from processes import contents
from trouble_process import started

pytest.importorskip("dolfinx")
pytest.importorskip("pinocchio")

COUNT = 100
LONGEST = 60  # s of wall time for one file, on a busy machine
# One process for all: what the command line says, its exit code, or that it did not end.
PROGRAM = """
import contextlib, io, json, pathlib, resource, signal, time, traceback
from impactfem.cli import main

class Late(BaseException):
    pass

def late(*_):
    raise Late

signal.signal(signal.SIGALRM, late)
_, hard = resource.getrlimit(resource.RLIMIT_AS)
resource.setrlimit(resource.RLIMIT_AS, (6 * 2**30, hard))
found = {}
for name in sorted(path.name for path in pathlib.Path().glob('*.toml')):
    said, start = io.StringIO(), time.monotonic()
    signal.alarm(LONGEST)
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            code = main(["validate", name])
    except BaseException:
        code = traceback.format_exc()[-2000:]
    signal.alarm(0)
    found[name] = code, said.getvalue(), time.monotonic() - start
# Not ru_maxrss, which a process has from the one that began it.
own = int(pathlib.Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])
used = own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
print(json.dumps([found, used]))
"""
# Words of Python and C++ that no user knows.
REPR = re.compile(
    r"Traceback|<class|array\(|dtype|Path\(|Exception|Error\(|std::|nullptr|b'|0x[0-9a-f]{6}"
)


@pytest.mark.slow
def test_files_of_strangers(tmp_path):
    folder, outside = tmp_path / "scenes", tmp_path / "outside"
    folder.mkdir()
    outside.mkdir()
    scenes = written(folder, seed=31, count=COUNT)
    before = sorted(folder.rglob("*"))
    command = (sys.executable, "-c", PROGRAM.replace("LONGEST", str(LONGEST)))
    with started(folder, *command, env={"TMPDIR": str(outside)}) as process:
        out, _ = process.communicate(timeout=600)
    found, (own, others) = json.loads(out.splitlines()[-1])
    assert sorted(found) == sorted(scenes)
    assert len({file for file, _ in scenes.values()}) == COUNT
    wrong = []
    for name, (code, said, _) in found.items():
        file, wanted = scenes[name]
        if (
            code not in ((0, 2) if wanted is None else (2,))
            or REPR.search(said)
            or len(said) > 3000
        ):
            wrong.append((name, code, said))
        elif code == 2 and (file not in said or not re.search(wanted or "", said)):
            wrong.append((name, "said", said))
    assert not wrong, "\n".join(map(str, wrong))
    assert sorted(folder.rglob("*")) == before
    assert not contents(outside)
    assert own < 2**20  # KiB: files are not kept
    assert others < 5 * 2**20  # 4 GiB of what Gmsh and Pinocchio may take to read, and Python
    assert max(seconds for *_, seconds in found.values()) < LONGEST
