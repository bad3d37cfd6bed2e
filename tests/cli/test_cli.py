"""The commands as a user runs them: what they print, write and return."""

import csv
import json
import os
import pty
import shutil
import subprocess
import sys
import termios
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENE, Done, finish, launch, start
from processes import environment

from impactfem import __version__
from impactfem.cli import main
from impactfem.facade import Result
from impactfem.scene import Scene

HISTORY = [
    "time", "gap", "contact_force", "kinetic_energy", "elastic_energy", "potential_energy",
    "total_energy", "dissipated_energy", "friction_work",
    "momentum", "momentum.x", "momentum.y", "momentum.z", "active", "angular_momentum",
    "bar.x", "bar.y", "bar.z", "bar.vx", "bar.vy", "bar.vz", "force.bar.wall", "gap.bar.wall",
]  # fmt: skip
PICTURES = {
    "contact_force.png", "energy.png", "displacement.png", "world_lines.png", "velocity_map.png",
    "strain.png", "active_set.png", "motion.gif",
}  # fmt: skip
GLOBAL = ("--set", "solve.method=galerkin", "--set", "solve.window=all")  # the active-set loop
FILES = {"scene.toml", "history.csv", "history.nc", "report.html", "summary.json"}
SUMMARY = {
    "": {
        "title", "status", "method", "num_dofs", "num_steps", "wall_time", "compile_time",
        "peak_memory_mib", "active_set", "energy", "contact", "error", "plan",
    },
    "active_set": {"iterations", "set_changes", "converged"},
    "energy": {"initial", "final", "max_relative_drift"},
    "contact": {
        "intervals", "max_force", "max_force_raw", "force_window", "impulse", "max_penetration",
    },
    "error": {"reference", "displacement_max", "displacement_l2", "force_l1", "measured"},
}  # fmt: skip


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """One run with everything that can be written, and what it said."""
    folder = tmp_path_factory.mktemp("run")
    done = finish(
        start(
            folder, "run", "bar_impact", *GLOBAL, "--set", "solve.elements=10",
            "--set", 'output.fields=["vtkhdf", "vtx", "pvd"]',
        )
    )  # fmt: skip
    return folder, done


def names(folder):
    return {path.name for path in Path(folder).iterdir()}


def test_run_writes_the_files_of_the_contract(ran):
    folder, done = ran
    assert done.code == 0
    assert names(folder) == {"results"}
    assert names(folder / "results") == {"bar_impact"}
    fields = {"fields.vtkhdf", "fields.bp", "fields.pvd", "fields_pvd"}
    assert names(folder / "results/bar_impact") == FILES | PICTURES | fields | {"exact.nc"}


def test_run_prints_the_table_and_nothing_else(ran):
    _, done = ran
    assert done.err == ""
    assert done.out.startswith("Elastic bar against a rigid wall\n---")
    for word in ("status", "method", "unknowns", "active set", "contact", "energy", "error"):
        assert f"\n{word} " in done.out
    assert done.out.endswith(f"Result and pictures: {Path('results/bar_impact')}\n")


def test_history_has_the_columns_of_the_contract_in_order(ran):
    folder = ran[0] / "results/bar_impact"
    with (folder / "history.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert rows[0] == HISTORY
    assert len(rows) == 52  # a row per layer and one for the start
    table = np.array(rows[1:], dtype=float)
    history = Result.load(folder).history
    assert [str(name) for name in history.data_vars] == HISTORY[1:]
    for column, name in enumerate(HISTORY):
        np.testing.assert_array_equal(table[:, column], history[name].values)
    assert all(history[name].attrs["units"] for name in HISTORY)


def test_summary_has_the_keys_of_the_contract(ran):
    summary = json.loads((ran[0] / "results/bar_impact/summary.json").read_text())
    for part, keys in SUMMARY.items():
        assert keys <= set(summary[part] if part else summary)
    assert summary["status"] == "completed"
    assert summary["num_steps"] == 50
    assert summary["contact"]["intervals"] == [[1.0, 3.0]]
    assert summary["error"]["displacement_max"] < 1e-11


def test_scene_as_used_has_the_defaults_and_can_be_read(ran):
    path = ran[0] / "results/bar_impact/scene.toml"
    text = path.read_text(encoding="utf-8")
    for line in ("area = 1.0", 'far_end = "free"', "elements = 10", 'method = "', "report = true"):
        assert line in text
    assert Scene.from_toml(path).solve.elements == 10


def test_result_is_as_private_as_other_files(ran):
    mask = os.umask(0)
    os.umask(mask)
    assert (ran[0] / "results/bar_impact").stat().st_mode & 0o777 == 0o777 & ~mask


def test_a_run_again_from_the_scene_as_used_gives_the_same(ran, command, work):
    folder = ran[0] / "results/bar_impact"
    assert command("run", folder / "scene.toml", "--out", "again", "--quiet").code == 0
    assert (work / "again/history.csv").read_text() == (folder / "history.csv").read_text()


@pytest.mark.parametrize("quiet", [False, True])
def test_quiet_prints_nothing(command, work, quiet):
    done = command(
        "run", "bar_impact", "--set", "solve.method=exact", *["--quiet"] * quiet, drawn=True
    )
    assert done.code == 0
    assert done.err == ""
    assert (done.out == "") is quiet
    assert names(work / "results/bar_impact") >= FILES


def test_default_folder_is_named_after_the_scene(command, work):
    (work / "mine.toml").write_text(SCENE)
    (work / "demo").mkdir()
    (work / "demo/scene.toml").write_text(SCENE)
    exact = ("--set", "solve.method=exact", "--quiet")
    assert command("run", "mine.toml", *exact).code == 0
    assert command("run", "demo/scene.toml", *exact).code == 0
    os.chdir("demo")
    assert command("run", "scene.toml", *exact).code == 0
    assert names(work / "results") == {"mine", "demo"}
    assert names(work / "demo/results") == {"demo"}


def test_set_replaces_keys_and_empty_removes_them(command, work):
    (work / "mine.toml").write_text(SCENE)
    settings = ["solve.method=exact", "solve.elements=", "body.0.velocity=-0.25", "title=other"]
    given = [word for setting in settings for word in ("--set", setting)]
    assert command("run", "mine.toml", *given, "--out", "o", "--quiet").code == 0
    scene = Scene.from_toml(work / "o/scene.toml")
    assert (scene.title, scene.solve.method) == ("other", "exact")
    assert scene.solve.elements != 4
    assert float(scene.bodies[0].initial_velocity(x=np.zeros(1))[0]) == -0.25


@pytest.mark.slow
def test_a_second_run_replaces_the_first_whole(command, work):
    exact = ("run", "bar_impact", "--set", "solve.method=exact", "--quiet", "--out", "o")
    assert command(*exact, drawn=True).code == 0
    before = (work / "o/summary.json").read_text()
    assert set(json.loads(before)["files"]) == names(work / "o")
    assert command(*exact, "--set", "output.fields=[]", "--set", "title=b").code == 0
    found = names(work / "o")
    assert found == (FILES - {"report.html"}) | {"exact.nc"}
    assert (work / "o/summary.json").read_text() != before
    assert names(work) == {"o"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("switch", "gone"),
    [("pictures", {".png"}), ("film", {".gif"}), ("report", {".html"})],
)
def test_what_is_drawn_can_be_switched_off(command, work, switch, gone):
    off = ("--set", f"output.{switch}=false", "--set", "duration=1.0")
    run = ("run", "bar_impact", "--set", "solve.method=exact", "--quiet", "--out", "o")
    assert command(*run, *off, drawn=True).code == 0
    drawn = {".png", ".gif", ".html"}
    assert {path.suffix for path in (work / "o").iterdir()} & drawn == drawn - gone


def test_the_files_of_every_result_are_known_to_the_store(ran):
    from impactfem.result import store

    assert names(ran[0] / "results/bar_impact") <= set(store._OWN)


def test_a_link_to_another_disk_is_followed(command, work, tmp_path):
    (tmp_path / "disk").mkdir()
    (work / "o").symlink_to(tmp_path / "disk")
    assert command("run", "bar_impact", "--set", "solve.method=exact", "--out", "o").code == 0
    assert names(tmp_path / "disk") >= FILES - {"report.html"}
    assert (work / "o").is_symlink()


def test_no_convergence_keeps_and_marks_the_result(command, work):
    done = command("run", "bar_impact", "--set", "solve.max_iterations=1", "--set",
                   "solve.elements=10", *GLOBAL)  # fmt: skip
    assert done.code == 3
    assert "not_converged" in done.out
    assert "not_converged" in done.err
    assert "Remedy" in done.err
    assert str(Path("results/bar_impact")) in done.err
    summary = json.loads((work / "results/bar_impact/summary.json").read_text())
    assert summary["status"] == "not_converged"
    assert summary["active_set"]["converged"] is False


def test_plan_says_what_and_why(command, work):
    done = command("plan", "bar_impact")
    assert (done.code, done.err) == (0, "")
    for word in ("model", "method", "elements", "unknowns", "memory", "time", "why model"):
        assert f"\n{word} " in done.out
    assert names(work) == set()


def test_validate_says_so(command, work):
    done = command("validate", "bar_impact")
    assert (done.code, done.err) == (0, "")
    assert done.out.endswith("bar_impact.toml: in order (Elastic bar against a rigid wall)\n")
    assert names(work) == set()


def test_methods_and_scenes_are_listed(command):
    methods = command("methods").out
    assert {"galerkin", "exact"} <= {line.split()[0] for line in methods.splitlines()}
    scenes = [line.split()[0] for line in command("scenes").out.splitlines()]
    assert "bar_impact" in scenes
    assert scenes == sorted(scenes)
    for name in scenes:
        assert command("validate", name).code == 0


@pytest.mark.slow
def test_plot_draws_the_pictures_again(command, work):
    run = ("run", "bar_impact", "--set", "solve.elements=4", *GLOBAL)
    assert command(*run, "--out", "o", "--quiet", drawn=True).code == 0
    others = {path.name: path.read_bytes() for path in (work / "o").glob("[!.]*.[!p]*")}
    for name in PICTURES:
        (work / "o" / name).unlink()
    done = command("plot", "o")
    assert (done.code, done.err) == (0, "")
    assert {Path(line).name for line in done.out.splitlines()} == PICTURES | {"report.html"}
    for name in PICTURES:
        assert (work / "o" / name).read_bytes().startswith((b"\x89PNG", b"GIF89a"))
    assert {path.name: path.read_bytes() for path in (work / "o").glob("[!.]*.[!p]*")} == others


def test_plot_says_what_it_cannot_draw(command):
    exact = ("--set", "solve.method=exact", "--set", "output.fields=[]", "--quiet", "--out", "o")
    assert command("run", "bar_impact", *exact).code == 0
    done = command("plot", "o")
    assert done.code == 0
    assert 'no fields.vtkhdf: no pictures of the motion; run with fields = ["v' in done.err


@pytest.mark.parametrize("name", ["summary.json", "history.nc", "scene.toml", "exact.nc",
                                  "fields.vtkhdf"])  # fmt: skip
@pytest.mark.parametrize("content", [b"", b"\x89noise\0\xff" * 30, None])
def test_plot_refuses_a_broken_result(command, work, ran, name, content):
    shutil.copytree(ran[0] / "results/bar_impact", work / "o")
    whole = (work / "o" / name).read_bytes()
    cut = whole[: len(whole) // 3]  # of a scene more than what has defaults
    (work / "o" / name).write_bytes(cut if content is None else content)
    done = command("plot", "o")
    assert done.code == 2
    assert done.out == ""
    assert "run the scene" in done.err
    assert "Traceback" not in done.err


def test_doctor_finds_what_is_needed(command):
    pytest.importorskip("dolfinx")
    done = command("doctor")
    assert (done.code, done.err) == (0, "")
    found = {line.split()[0] for line in done.out.splitlines()}
    assert {"impactfem", "python", "numpy", "dolfinx", "petsc", "gmsh", "compiler"} <= found
    assert "everything needed is there" in done.out


def test_doctor_reports_faults(command, monkeypatch):
    import impactfem.fem  # noqa: F401  (before imports fail)
    from impactfem import doctor

    def broken(name):
        raise {"h5py": ModuleNotFoundError, "tqdm": RuntimeError}.get(name, ValueError)("bad ABI")

    monkeypatch.setattr(doctor.importlib, "import_module", broken)
    monkeypatch.setattr(doctor, "_finite_elements", lambda _: [])
    monkeypatch.setattr(doctor.shutil, "which", lambda *_args, **_options: None)
    done = command("doctor")
    assert done.code == 1
    assert "h5py is missing: pip install" in done.err
    assert "tqdm is broken (bad ABI): pip install" in done.err
    assert "no C compiler: apt-get install gcc" in done.err


def test_help_and_version(command):
    assert command("--version") == Done(0, f"impactfem {__version__}\n", "")
    done = command("--help")
    assert done.code == 0
    for word in ("run", "plan", "validate", "methods", "scenes", "plot", "doctor", "Exit codes"):
        assert word in done.out


def test_start_up_loads_nothing_heavy(work):
    program = (
        "import sys\nfrom impactfem.cli import main\nmain(['--help'])\n"
        "heavy = {'numpy', 'scipy', 'dolfinx', 'mpi4py', 'petsc4py', 'gmsh', 'matplotlib', 'h5py',"
        " 'xarray', 'tqdm'}\nprint(*sorted(heavy & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=work, env=environment(),
                          capture_output=True, text=True, check=True)  # fmt: skip
    assert done.stderr.strip() == ""


@pytest.mark.parametrize("arguments", [("validate", "bar_impact"), ("plan", "bar_impact")])
def test_light_commands_load_no_finite_elements(command, arguments, monkeypatch):
    monkeypatch.setitem(sys.modules, "dolfinx", None)  # importing it would fail
    monkeypatch.setitem(sys.modules, "gmsh", None)
    assert command(*arguments).code == 0


@pytest.mark.slow
def test_progress_is_drawn_on_a_terminal_only(work):
    try:
        controller, terminal = pty.openpty()
    except OSError as error:
        pytest.skip(f"no terminal to be had here: {error}")
    termios.tcsetwinsize(terminal, (24, 80))
    run = ("run", "bar_impact", "--set", "solve.method=exact", "--out", "o")
    with os.fdopen(controller, "rb", buffering=0) as screen:
        process = start(work, *run, stderr=terminal)
        os.close(terminal)
        shown = b""
        try:
            while part := screen.read(4096):
                shown += part
        except OSError:  # the other end has closed
            pass
    assert finish(process).code == 0
    assert b"following the characteristics" in shown
    assert b"writing the result" in shown
    assert shown.endswith((b"\r", b"\x1b[A"))  # the bar is wiped out


def test_warnings_reach_standard_error(command):
    courant = ("--set", "solve.courant=0.5", "--set", "solve.elements=4")
    done = command("run", "bar_impact", *courant, *GLOBAL)
    assert done.err.startswith("warning: courant = 0.5 < 1")
    assert "warning" not in command("run", "bar_impact", *courant, *GLOBAL, "--quiet").err


def test_a_reader_that_leaves_is_no_fault(work):
    process = start(work, "scenes")
    process.stdout.close()
    assert process.wait(60) == 0
    assert process.stderr.read() == ""
    process.stderr.close()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_full_standard_output(work):
    with Path("/dev/full").open("w") as full:
        done = finish(start(work, "plan", "bar_impact", stdout=full))
    assert done.code == 1
    assert done.err.startswith("impactfem: standard output: cannot be written")
    assert "Traceback" not in done.err
    assert "Exception" not in done.err


@pytest.mark.slow
def test_closed_streams(work):
    run = f"{sys.executable} -m impactfem run bar_impact --set solve.method=exact --out o >&- 2>&-"
    assert subprocess.run(["sh", "-c", run], cwd=work, env=environment(),
                          check=False).returncode == 0  # fmt: skip
    assert names(work / "o") >= FILES


@pytest.mark.slow
def test_unusual_characters_do_not_end_a_run(work):
    env = environment(PYTHONIOENCODING="ascii", PYTHONUTF8="1")
    done = subprocess.run(
        [sys.executable, "-m", "impactfem", "run", "bar_impact", "--set", "solve.method=exact",
         "--set", "title=Stoß λ", "--out", b"o\xff"],
        cwd=work, env=env, capture_output=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.startswith(rb"Sto\xdf \u03bb")


def test_too_little_memory_is_said(command, monkeypatch):
    import impactfem.solving

    def greedy(*_args, **_options):
        raise MemoryError("Unable to allocate 373 GiB")

    monkeypatch.setattr(impactfem.solving, "solve", greedy)
    done = command("run", "bar_impact", "--set", "solve.method=exact")
    assert done == Done(1, "", "impactfem: not enough memory (Unable to allocate 373 GiB); use "
                        "fewer elements or time steps\n")  # fmt: skip


def test_an_unknown_fault_is_not_hidden(command, monkeypatch):
    import impactfem.solving

    def wrong(*_args, **_options):
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(impactfem.solving, "solve", wrong)
    with pytest.raises(ZeroDivisionError):
        command("run", "bar_impact", "--set", "solve.method=exact")


def test_dolfinx_missing_is_said_before_solving(command, monkeypatch):
    for name in [name for name in sys.modules if name.startswith("impactfem.fem")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "dolfinx", None)
    done = command("run", "bar_impact", "--set", "solve.method=monolithic")
    assert done.code == 1
    assert "Remedy" in done.err
    assert "python3-dolfinx" in done.err


def test_main_takes_the_command_line_of_the_process(monkeypatch, command, capsys):  # noqa: ARG001
    monkeypatch.setattr(sys, "argv", ["impactfem", "--version"])
    assert main() == 0
    assert __version__ in capsys.readouterr().out


@pytest.mark.slow
def test_two_ranks_print_and_write_once(work):
    run = ("run", "bar_impact", "--set", "solve.elements=10", *GLOBAL)
    done = launch(work, 2, "-m", "impactfem", *run)
    assert done.code == 0
    assert done.out.count("Elastic bar against a rigid wall") == 1
    assert done.out.count("Result and pictures") == 1
    assert "impactfem" not in done.err
    assert names(work / "results") == {"bar_impact"}
    summary = json.loads((work / "results/bar_impact/summary.json").read_text())
    assert summary["ranks"] == 2
    assert summary["error"]["displacement_max"] < 1e-10
    assert names(work / "results/bar_impact") == FILES | PICTURES | {"exact.nc", "fields.vtkhdf"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("run", "nowhere"), 2, "neither a file nor a shipped scene"),
        (("run", "bar_impact", "--faster"), 2, "unrecognized arguments: --faster"),
        (("run", "bar_impact", "--out", "file"), 1, "is a file; choose another folder"),
    ],
)
def test_errors_of_two_ranks_are_printed_once(work, arguments, code, said):
    (work / "file").touch()
    done = launch(work, 2, "-m", "impactfem", *arguments)
    assert done.code == code
    assert done.err.count(said) == 1
    assert done.out.strip() == ""
    assert "Traceback" not in done.err
    assert names(work) == {"file"}


@pytest.mark.slow
@pytest.mark.parametrize("error", ["ValueError", "SceneError"])
def test_a_rank_that_fails_alone_ends_all(work, error):
    (work / "fail.py").write_text(
        "import sys\n"
        "import impactfem.solving\n"
        "from impactfem.errors import SceneError\n"
        "from impactfem.fem import MPI\n"
        "def solve(*args, **options):\n"
        "    if MPI.COMM_WORLD.rank == 1:\n"
        f"        raise {error}('only here')\n"
        "    MPI.COMM_WORLD.barrier()\n"  # for ever
        "impactfem.solving.solve = solve\n"
        "from impactfem.cli import main\n"
        "sys.exit(main(['run', 'bar_impact', '--set', 'solve.window=all']))\n"
    )
    done = launch(work, 2, "fail.py", timeout=240)
    assert done.code != 0
    assert "only here" in done.err


def test_a_plan_is_made_once_for_a_run(command, tmp_path, monkeypatch):
    import impactfem.planning
    import impactfem.solving

    made = []

    def counted(scene):
        made.append(scene)
        return plan(scene)

    plan = impactfem.planning.plan
    monkeypatch.setattr(impactfem.planning, "plan", counted)
    monkeypatch.setattr(impactfem.solving, "plan", counted)
    off = [f"--set=output.{name}=false" for name in ("pictures", "film", "report")]
    done = command("run", "bar_impact", "--out", str(tmp_path / "result"), *GLOBAL, *off)
    assert done.code == 0
    assert len(made) == 1
