"""Full disks, closed folders, folders that go: one message with its remedy, exit code 1."""

import os
import resource
import shutil
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from processes import contents
from trouble_process import DISC, DRAWN, SHORT, run, started, until

from impactfem.errors import OutputError
from impactfem.facade import Result
from impactfem.result.claim import Claim
from impactfem.result.store import CHECKPOINT, LAST, PARTIAL, SPOOL, reserve, staged


def limited(size):
    """Let no file grow beyond a size: stands in for a quota, and needs no rights."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def run_limited(folder, size, *arguments):
    """Limit a run of a solid once MPI, which makes files of its own, is there."""
    (folder / "limited.py").write_text(
        "import resource, signal, sys\n"
        "import impactfem.fem\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({size}, {size}))\n"
        "from impactfem.cli import main\n"
        f"sys.exit(main({list(arguments)}))\n"
    )
    try:
        return run(folder, "limited.py")
    finally:
        (folder / "limited.py").unlink()


def said(done, *parts):
    code, out, err = done
    assert (code, out) == (1, "")
    lines = [line for line in err.splitlines() if line.startswith("impactfem: ")]
    assert len(lines) == 1
    for part in parts:
        assert part in lines[0]
    for word in ("Traceback", "HDF5", "Exception"):
        assert word not in err


@pytest.mark.slow
def test_a_full_disk_while_the_report_is_written(tmp_path):
    """Pictures still fit; the page with its scripts does not: the data are there."""
    code, out, err = run(tmp_path, *DRAWN, "o", preexec_fn=partial(limited, 1_000_000))
    assert (code, out) == (0, "")
    assert err == (
        "impactfem: warning: not drawn: o: cannot be written (File too large); free some space or "
        "choose another folder (--out), then draw with: impactfem plot o\n"
    )
    assert Result.load(tmp_path / "o").history.sizes["time"] > 1
    assert not {".png", ".gif", ".html"} & {path.suffix for path in (tmp_path / "o").iterdir()}
    code, out, err = run(tmp_path, "plot", "o")
    assert (code, err) == (0, "")
    assert (tmp_path / "o/report.html").exists()


# The first layer, a later one, and a checkpoint, which holds the histories so far.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "every", "fields", "part"),
    [(90_000, 5, True, "MiB are needed"), (9_000, 5, False, "the checkpoint of")],
)
def test_a_full_disk_while_a_solid_moves(tmp_path, size, every, fields, part):
    text = DISC.replace("checkpoint = 5", f"checkpoint = {every}\nevery = 20")
    text = text if fields else text + "fields = []\n"
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    before = contents(tmp_path)
    done = run_limited(tmp_path, size, "run", "scene.toml", "--out", "o", "--quiet")
    said(done, "o/", "cannot be written (File too large", part, "free some space")
    assert contents(tmp_path) == before


@pytest.mark.slow
def test_the_last_checkpoint_outlives_a_full_disk(tmp_path):
    """Fields no longer fit: the run says how to go on, and can be gone on with."""
    (tmp_path / "scene.toml").write_text(DISC, encoding="utf-8")
    arguments = ("run", "scene.toml", "--out", "o", "--quiet")
    done = run_limited(tmp_path, 300_000, *arguments)
    said(done, "File too large", "MiB are needed", "continue with: impactfem run --restart o")
    assert set(contents(tmp_path / "o")) == {CHECKPOINT, PARTIAL, SPOOL}
    code, _, err = run(tmp_path, "run", "--restart", "o", "--quiet")
    assert (code, err) == (0, "")


def test_what_is_needed_is_said(tmp_path):
    with pytest.raises(OSError, match=r"(No space left on device|File too large); .* MiB are need"):
        reserve(tmp_path, 2**60)


def test_where_no_folder_can_be_made(tmp_path):
    """Also for root, whom permissions do not bind."""
    done = run(tmp_path, *SHORT, "/proc/impactfem/o")
    said(done, "/proc/impactfem/o: cannot be written", "choose another folder (--out)")


def test_a_folder_without_permission(tmp_path):
    """As another user where this one is root."""
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o555)
    command = [sys.executable, "-m", "impactfem", *SHORT, str(closed / "o")]
    if os.geteuid() == 0:
        other = ["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"]
        reads = [*other, sys.executable, "-c", "import impactfem"]
        if not shutil.which("setpriv") or subprocess.run(reads, check=False).returncode:
            pytest.skip("setpriv is missing, or another user cannot read this Python")
        command = other + command
    env = {"MPLCONFIGDIR": os.devnull, "HOME": "/"}
    with started("/", *command, env=env) as process:
        out, err = (text.decode() for text in process.communicate(timeout=240))
    said((process.returncode, out, err), "closed/o: cannot be written", "Permission denied")
    assert contents(closed) == {}


@pytest.fixture
def read_only(tmp_path):
    """A folder that is mounted to be read only."""
    folder = tmp_path / "shut"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "ro", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(mount, check=False, capture_output=True).returncode:
        pytest.skip("mounting a disk needs root and its rights")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=False, capture_output=True)


def test_a_claim_of_a_read_only_folder(read_only):
    for folder in (read_only, read_only / "a/b"):
        with pytest.raises(OutputError, match=r"cannot be written .*Read-only file system"):
            Claim(folder).take()


def test_a_claim_of_a_file(tmp_path):
    (tmp_path / "o").touch()
    for folder in (tmp_path / "o", tmp_path / "o/below"):
        with pytest.raises(OutputError, match="is a file; choose another folder"):
            Claim(folder).take()
    assert contents(tmp_path) == {"o": b""}


def test_a_folder_that_goes_is_made_again(tmp_path):
    claim = Claim(tmp_path / "o")
    claim.take()
    shutil.rmtree(tmp_path / "o")
    with staged(tmp_path / "o") as stage:
        (stage / LAST).write_text("new")
    claim.release()
    assert contents(tmp_path) == {"o": None, f"o/{LAST}": b"new"}


@pytest.mark.slow
def test_a_folder_that_goes_while_a_solid_moves(tmp_path):
    (tmp_path / "scene.toml").write_text(DISC, encoding="utf-8")
    words = (sys.executable, "-m", "impactfem", "run", "scene.toml", "--out", "o", "--quiet")
    with started(tmp_path, *words) as process:
        assert until(Path(tmp_path / "o" / CHECKPOINT).exists)
        os.kill(process.pid, signal.SIGSTOP)
        shutil.rmtree(tmp_path / "o")
        os.kill(process.pid, signal.SIGCONT)
        out, err = (text.decode() for text in process.communicate(timeout=240))
    said((process.returncode, out, err), "o/", "cannot be written", "No such file or directory")
    assert set(contents(tmp_path)) == {"scene.toml"}
