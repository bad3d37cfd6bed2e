"""Signals, full disks and read-only folders: nothing half-written, and an exit code that tells."""

import os
import resource
import shutil
import signal
import subprocess
import time
from functools import partial

import pytest
from conftest import finish, launch, start
from processes import contents

LONG = (
    "run", "prestretched_rod", "--set", "solve.elements=80", "--set", "solve.method=monolithic",
    "--out", "o",
)  # fmt: skip
SHORT = ("run", "bar_impact", "--set", "solve.method=exact", "--out", "o")


def interrupted(folder, number, delay):
    process = start(folder, *LONG)
    time.sleep(delay)
    process.send_signal(number)
    return finish(process)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("delay", [0.4, 0.7, 1.0])
def test_a_signal_leaves_nothing_behind(work, number, delay):
    done = interrupted(work, number, delay)
    if done.code == 0:
        pytest.skip("this machine was done before the signal")
    assert done.code == 128 + number
    assert done.out == ""
    assert done.err.splitlines()[-1] == (
        f"impactfem: interrupted by {number.name}; nothing was written"
    )
    for word in ("Traceback", "PETSC", "MPI_ABORT", "Exception ignored"):
        assert word not in done.err
    assert contents(work) == {}


@pytest.fixture
def older(command, work):
    """An older result in the folder o; its content."""
    assert command(*SHORT, "--quiet").code == 0
    return contents(work)


def data_of(names):
    return {name for name in names if not name.endswith(("png", "gif", "html"))}


def during_writing(monkeypatch, action):
    """Do something while the result is being written, when some files are there already."""
    from impactfem.result import record

    write = record.write_netcdf

    def act(history, path):
        write(history, path)
        action()

    monkeypatch.setattr(record, "write_netcdf", act)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("repeated", [1, 3])
def test_a_signal_while_writing_keeps_the_older_result(
    command, work, older, monkeypatch, number, repeated
):
    from impactfem.result import store

    remove = shutil.rmtree

    def disturbed(*arguments, **options):  # by a second signal, as an impatient user sends it
        os.kill(os.getpid(), number)
        remove(*arguments, **options)

    if repeated > 1:
        monkeypatch.setattr(store.shutil, "rmtree", disturbed)
    during_writing(monkeypatch, lambda: os.kill(os.getpid(), number))
    done = command(*SHORT, "--set", "title=new")
    assert done.code == 128 + number
    assert done.out == ""
    assert contents(work) == older


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_publishing_waits_for_the_whole_result(
    command, work, older, monkeypatch, number
):
    from impactfem.result import store

    remove = store._remove

    def disturbed(*arguments, **options):
        os.kill(os.getpid(), number)
        remove(*arguments, **options)

    monkeypatch.setattr(store, "_remove", disturbed)
    done = command(*SHORT, "--set", "title=new")
    assert done.code == 128 + number
    assert done.err.endswith("the result is in o; draw it with: impactfem plot o\n")
    now = contents(work)
    assert set(now) == data_of(older)
    assert b'"title": "new"' in now["o/summary.json"]
    assert b'title = "new"' in now["o/scene.toml"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_drawing_keeps_the_new_result(command, work, older, monkeypatch, number):
    from impactfem.report import adding

    monkeypatch.setattr(adding, "_draw", lambda *_: os.kill(os.getpid(), number))
    done = command(*SHORT, "--set", "title=new", drawn=True)
    assert done.code == 128 + number
    assert done.err.endswith("the result is in o; draw it with: impactfem plot o\n")
    now = contents(work)
    assert b'"title": "new"' in now["o/summary.json"]
    assert set(now) == data_of(older)


def test_a_signal_before_the_first_result_leaves_no_folder(command, work, monkeypatch):
    during_writing(monkeypatch, lambda: os.kill(os.getpid(), signal.SIGTERM))
    assert command(*SHORT[:-1], "deep/down/o").code == 143
    assert contents(work) == {}


def test_the_handlers_survive_gmsh(command):  # noqa: ARG001  (handlers are put back)
    from impactfem.cli import main
    from impactfem.mesh.session import gmsh_session
    from impactfem.signals import InterruptedRunError

    assert main(["--version"]) == 0  # installs them
    for number in (signal.SIGINT, signal.SIGTERM):
        main(["--version"])
        with gmsh_session(), pytest.raises(InterruptedRunError):
            os.kill(os.getpid(), number)
        main(["--version"])
        with pytest.raises(InterruptedRunError):
            os.kill(os.getpid(), number)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_ranks_ends_all(work, number):
    (work / "run.py").write_text(
        "import os, signal, sys\n"
        "import impactfem.solving\n"
        "solve = impactfem.solving.solve\n"
        "def interrupted(*args, **options):\n"
        f"    os.kill(os.getpid(), {int(number)})\n"
        "    return solve(*args, **options)\n"
        "impactfem.solving.solve = interrupted\n"
        "from impactfem.cli import main\n"
        "sys.exit(main(['run', 'bar_impact', '--set', 'solve.elements=10', '--out', 'o']))\n"
    )
    before = contents(work)
    done = launch(work, 2, "run.py", timeout=240)
    assert done.code != 0
    assert done.err.count(f"interrupted by {number.name}; nothing was written") == 1
    assert "Traceback" not in done.err
    assert contents(work) == before


def limited(size):
    """Let no file grow beyond a size, and have that reported as an error instead of a signal."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def check_full(done):
    assert done.code == 1
    assert done.out == ""
    assert done.err.startswith("impactfem: o: cannot be written (")
    assert "free some space or choose another folder (--out)" in done.err
    for word in ("Traceback", "HDF5", "ADIOS2", "Exception"):
        assert word not in done.err


# The sizes stop the table and the fields.
@pytest.mark.parametrize("size", [1_000, 40_000])
def test_a_limit_of_the_file_size_keeps_the_older_result(work, older, size):
    process = start(work, *SHORT, "--quiet", preexec_fn=partial(limited, size))
    check_full(finish(process))
    assert contents(work) == older


@pytest.mark.parametrize("fields", ["vtkhdf", "vtx", "pvd"])
def test_a_library_that_writes_into_a_full_disk_is_spared(work, fields):
    process = start(work, *SHORT, "--set", f'output.fields=["{fields}"]', "--quiet",
                    preexec_fn=partial(limited, 100_000))  # fmt: skip
    check_full(finish(process))
    assert contents(work) == {}


@pytest.fixture
def mounted(work):
    """A small disk of its own, where root can mount one."""
    disk = work / "disk"
    disk.mkdir()

    def mount(*options):
        command = ["mount", *options, str(disk)]
        if (
            os.geteuid() != 0
            or subprocess.run(command, check=False, capture_output=True).returncode
        ):
            pytest.skip("mounting a disk needs root and its rights")
        return disk

    yield mount
    subprocess.run(["umount", "--lazy", str(disk)], check=False, capture_output=True)


@pytest.mark.parametrize("free", [8, 60, 300])
def test_a_full_disk_keeps_the_older_result(command, mounted, free, monkeypatch):
    disk = mounted("-t", "tmpfs", "-o", "size=20m", "tmpfs")
    monkeypatch.chdir(disk)
    assert command(*SHORT, "--quiet").code == 0
    status = os.statvfs(disk)
    (disk / "pad").write_bytes(b"\0" * (status.f_bavail * status.f_frsize - free * 1024))
    before = contents(disk)
    check_full(command(*SHORT))
    assert contents(disk) == before


def test_a_read_only_disk_is_refused_before_solving(command, mounted, work, monkeypatch):
    import impactfem.solving

    def solved(*_args, **_options):
        raise AssertionError("solved in vain")

    disk = mounted("-t", "tmpfs", "-o", "ro", "tmpfs")
    monkeypatch.setattr(impactfem.solving, "solve", solved)
    done = command(*SHORT[:-1], disk / "o")
    assert done.code == 1
    assert "Read-only file system" in done.err
    assert "choose another folder (--out)" in done.err
    assert contents(work) == {"disk": None}


@pytest.mark.skipif(os.geteuid() == 0, reason="permissions do not bind root")
def test_a_closed_folder_is_refused(command, work):
    (work / "closed").mkdir(mode=0o555)
    done = command(*SHORT[:-1], "closed/o")
    assert done.code == 1
    assert "closed/o: cannot be written" in done.err
    assert "Permission denied" in done.err


def test_a_form_cache_that_cannot_be_written_is_said(work, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/nothing")
    run = ("run", "bar_impact", "--set", "solve.elements=4", "--set", "solve.method=monolithic")
    done = finish(start(work, *run))
    assert done.code == 1
    assert "/proc/nothing" in done.err
    assert "check space and permissions, also of the form cache" in done.err
    assert contents(work) == {}
