"""The command line: new, run, plan, validate, methods, scenes, schema, plot, bench, doctor."""

import argparse
import contextlib
import io
import os
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from impactfem.errors import (
    ConvergenceError,
    ImpactError,
    MeshError,
    OutputError,
    SceneError,
    plain,
)
from impactfem.first_use import announce_to
from impactfem.processes import abort, complain, end_together, join, on_root, rank, ranks
from impactfem.shipped import find_scene, shipped_scenes
from impactfem.signals import InterruptedRunError, held_back, listen

if TYPE_CHECKING:
    from impactfem.log import Progress
    from impactfem.result import Result
    from impactfem.scene import Scene

DONE, FAILED, BAD_INPUT, NOT_CONVERGED = 0, 1, 2, 3

# What to do about a run that did not complete, by the body.
_REMEDIES = {
    "bar": 'courant = 1, a layered mesh, a shorter duration or method = "exact"',
    "solid": 'method = "massless" or "conserving", a smaller step or a shorter duration',
    "vibro": "a smaller dt, a larger stick_speed or another method",
}
"""Exit codes; an interrupted run ends with 128 + the signal's number."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    # More threads than ranks slow every dense kernel down; set before NumPy loads.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    # PETSc would take SIGTERM, print pages about it and leave half-written files.
    options = os.environ.get("PETSC_OPTIONS", "").split()
    os.environ["PETSC_OPTIONS"] = " ".join([*options, "-no_signal_handler"])
    _prepare_streams()
    listen()
    code, reason, patience = DONE, "", 5.0
    try:
        join()
        given = _parsed(arguments)
        code = given.action(given)
    except SystemExit as end:  # argparse has said why
        code = int(end.code or DONE)
    except InterruptedRunError as error:
        reason = f"interrupted by {signal.Signals(error.number).name}; {error.kept}"
        code, patience = 128 + error.number, 1.0
    except ImpactError as error:
        code, reason = _code(error), str(error)
    except MemoryError as error:
        code, reason = FAILED, f"not enough memory ({error}); use fewer elements or layers"
    except OSError as error:  # those of scenes, meshes and results are ImpactErrors
        code = FAILED
        reason = f"{error}; check space and permissions, also of the form cache ~/.cache/fenics"
    except Exception:
        if ranks() > 1:
            abort(FAILED)
        raise
    if reason:
        complain(reason)
    if code != DONE:
        end_together(code, reason, patience)
    return code


def _prepare_streams() -> None:
    """Let no unusual character and no closed stream end a run."""
    # Python has None for a stream that the shell closed with >&-.
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: PTH123, SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: PTH123, SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The arguments; only rank 0 says what is wrong with them, and what is compiled."""
    with contextlib.ExitStack() as stack:
        if rank() != 0:
            null = stack.enter_context(open(os.devnull, "w"))  # noqa: PTH123
            stack.enter_context(contextlib.redirect_stdout(null))
            stack.enter_context(contextlib.redirect_stderr(null))
        given = _parser().parse_args(arguments)
    if rank() == 0 and not getattr(given, "quiet", False):
        announce_to(_announce)
    return given


def _code(error: ImpactError) -> int:
    if isinstance(error, SceneError | MeshError):
        return BAD_INPUT
    return NOT_CONVERGED if isinstance(error, ConvergenceError) else FAILED


class _Version(argparse.Action):
    """Looks for the version when it is asked for: that takes as long as all of --help."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from impactfem import __version__  # noqa: PLC0415

        _say(f"impactfem {__version__}")
        parser.exit()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="impactfem",
        description="Non-smooth impact dynamics: give it a scene, it answers with displacement, "
        "contact force and energy, with their error and cost.",
        epilog="Exit codes: 0 done, 1 failed, 2 bad input, 3 no convergence (result kept and "
        "marked), 128 + signal interrupted.",
    )
    parser.add_argument(
        "--version", action=_Version, nargs=0, help="show the version of impactfem and exit"
    )
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    def command(
        name: str,
        action: Callable[[argparse.Namespace], int],
        text: str,
        *,
        scene: str | int | None = 0,
    ) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text)
        sub.set_defaults(action=action)
        if scene != 0:
            sub.add_argument(
                "scene", metavar="SCENE", nargs=scene,
                help="scene file, or name of a shipped scene",
            )  # fmt: skip
            sub.add_argument(
                "--set", dest="settings", metavar="KEY=VALUE", action="append", default=[],
                help="replace a key of the scene, as solve.elements=80 (repeatable)",
            )  # fmt: skip
        return sub

    new = command("new", _new, "write a commented scene to start from, or list the kinds")
    new.add_argument("kind", metavar="KIND", nargs="?", help="kind, or name of a shipped scene")
    new.add_argument("--out", metavar="FILE", type=Path, help="scene file (default KIND.toml)")
    new.add_argument(
        "--schema", metavar="PATH",
        help="path or URL of the schema for editors (default: written beside the scene)",
    )  # fmt: skip
    run = command("run", _run, "solve a scene and write its result", scene="?")
    run.add_argument("--out", metavar="DIR", type=Path, help="result folder (default results/NAME)")
    run.add_argument(
        "--restart", metavar="DIR", type=Path,
        help="continue the stopped run of a solid from its checkpoint in DIR (output.checkpoint)",
    )  # fmt: skip
    run.add_argument("--quiet", action="store_true", help="no progress, no table")
    command("plan", _plan, "say what would be modelled, why, and what it would cost", scene=None)
    command("validate", _validate, "read a scene and say whether it is in order", scene=None)
    command("methods", _methods, "list the solution methods and their limits")
    command("scenes", _scenes, "list the shipped scenes")
    schema = command("schema", _schema, "print the JSON schema of scenes, for editors")
    schema.add_argument("--out", metavar="FILE", type=Path, help="write it to a file")
    plot = command("plot", _plot, "draw the pictures and the report of a result folder again")
    plot.add_argument("folder", metavar="DIR", type=Path)
    bench = command("bench", _bench, "measure errors of methods against time, or run hard cases")
    bench.add_argument(
        "scene", metavar="SCENE", nargs="?", help="scene file, or name of a shipped scene"
    )
    bench.add_argument("--hard", action="store_true", help="run the board of hard cases instead")
    bench.add_argument(
        "--methods", metavar="A,B", help="methods, with settings as dg@degree=1,fitted=true"
    )
    bench.add_argument("--sizes", metavar="N,M",
        help="numbers of elements along the body, of steps for points, rods and beams (default "
        "20,40,80 for bars, 8,16 for solids, 1000,4000,16000 steps)",
    )  # fmt: skip
    bench.add_argument("--repeats", metavar="N", type=int, default=3, help="runs of each size")
    bench.add_argument("--out", metavar="DIR", type=Path, help="folder for tables and pictures")
    command("doctor", _doctor, "say what is installed, what works and what is missing")
    return parser


def _read(given: argparse.Namespace) -> "tuple[Path, Scene]":
    """Read the scene with its --set assignments."""
    from impactfem.scene import Scene, parse_assignment  # noqa: PLC0415  (fast --help)

    path = find_scene(given.scene)
    scene = Scene.from_toml(path)
    settings = dict(parse_assignment(text) for text in given.settings)
    return path, scene.with_settings(settings) if settings else scene


def _run(given: argparse.Namespace) -> int:
    from impactfem.log import Progress  # noqa: PLC0415
    from impactfem.planning import plan  # noqa: PLC0415
    from impactfem.report.table import summary_table  # noqa: PLC0415
    from impactfem.resuming import claimed, clear, kept  # noqa: PLC0415

    scene, folder = _to_run(given)
    progress = Progress(enabled=rank() == 0 and not given.quiet)
    _prepare(scene)
    chosen = plan(scene)
    for warning in chosen.warnings:
        progress.message(f"warning: {warning}")
    if chosen.method != "exact" and not scene.is_vibro and not scene.is_bar_row:
        _load_finite_elements()
    stages = progress.stages(4 if scene.bodies[0].kind == "bar" else 5)
    place = given.restart or folder
    with claimed(folder, given.restart), stages, kept(place, bool(scene.output.checkpoint)):
        result = _solved(scene, given.restart, folder, progress)
        result = replace(result, summary={**result.summary, "run": _record(given, result)})
        progress.step("writing the result")
        on_root(lambda: result.save(folder))
        clear(place)
    if not given.quiet:
        report = f"Report: {folder / 'report.html'}\n" * result.scene.output.report
        _say(f"{summary_table(result.summary)}\n\n{report}Result and pictures: {folder}")
    if result.summary["status"] != "completed":
        remedy = _REMEDIES["vibro" if scene.is_vibro else scene.bodies[0].kind]
        complain(
            f"{result.summary['status']}: {result.summary['active_set']['message']}; the result "
            f"is kept in {folder}. Remedy: {remedy}"
        )
        return NOT_CONVERGED
    return DONE


def _record(given: argparse.Namespace, result: "Result") -> dict[str, Any]:
    """Date, versions and machine of a run, with the command that repeats it."""
    from impactfem.provenance import shell_command  # noqa: PLC0415

    words = ["impactfem", "run"] if given.scene is None else ["impactfem", "run", given.scene]
    for text in given.settings:
        words += ["--set", text]
    for option in ("out", "restart"):
        if getattr(given, option) is not None:
            words += [f"--{option}", str(getattr(given, option))]
    if result.summary["ranks"] > 1:
        words = ["mpirun", "-n", str(result.summary["ranks"]), *words]
    record: dict[str, Any] = result.summary["run"] | {"command": shell_command(words)}
    return record


def _to_run(given: argparse.Namespace) -> "tuple[Scene, Path]":
    """The scene and the folder of its result.

    Raises:
        SceneError: Neither a scene nor a checkpoint is given, or both.
    """
    if given.restart is None:
        if given.scene is None:
            raise SceneError("run: no scene is given; name one, or use --restart DIR")
        path, scene = _read(given)
        return scene, given.out or Path("results") / _name(path)
    if given.scene is not None or given.settings:
        raise SceneError(
            f"run: --restart {given.restart} continues the scene of its checkpoint; leave SCENE "
            "and --set out"
        )
    _load_finite_elements()
    from impactfem.resuming import scene_to_continue  # noqa: PLC0415

    return scene_to_continue(given.restart), given.out or given.restart


def _solved(scene: "Scene", restart: Path | None, folder: Path, progress: "Progress") -> "Result":
    """Solve a scene, with checkpoints if it asks for them."""
    from impactfem.solving import solve  # noqa: PLC0415

    if not scene.output.checkpoint:
        return solve(scene, progress=progress)
    return solve(scene, progress=progress, checkpoints=restart or folder, restart=restart)


def _is_solid(scene: "Scene") -> bool:
    return scene.bodies[0].kind == "solid"


def _prepare(scene: "Scene") -> None:
    """Load what a plan needs: that of a solid is made of its mesh."""
    body = scene.bodies[0]
    if body.kind == "solid" or getattr(body, "theory", "") == "timoshenko":
        _load_finite_elements()


def _load_finite_elements() -> None:
    """Load DOLFINx: if it is missing, say so now; a signal meanwhile would crash its modules."""
    with held_back():
        import impactfem.fem  # noqa: F401, PLC0415


def _name(path: Path) -> str:
    """Name of a scene's result folder: the file's, or its folder's if it is scene.toml."""
    return (path.stem if path.stem != "scene" else path.absolute().parent.name) or "scene"


def _plan(given: argparse.Namespace) -> int:
    from impactfem.planning import plan  # noqa: PLC0415
    from impactfem.report.table import plan_table  # noqa: PLC0415

    _, scene = _read(given)
    _prepare(scene)
    _say(plan_table(plan(scene)))
    return DONE


def _validate(given: argparse.Namespace) -> int:
    from impactfem.planning import plan  # noqa: PLC0415

    path, scene = _read(given)
    _prepare(scene)
    warnings = plan(scene).warnings
    if scene.mesh_path is not None and not _is_solid(scene):
        _load_finite_elements()
        from impactfem.fem import MPI  # noqa: PLC0415
        from impactfem.mesh.files import read_mesh  # noqa: PLC0415

        bar = scene.bar
        read_mesh(MPI.COMM_WORLD, scene.mesh_path, bar.length, scene.duration, bar.wave_speed)
    _say("\n".join([f"{path}: in order ({scene.title})", *(f"warning: {w}" for w in warnings)]))
    return DONE


def _methods(_: argparse.Namespace) -> int:
    from impactfem.methods import METHODS  # noqa: PLC0415
    from impactfem.report.table import table  # noqa: PLC0415

    _say(table([(name, method.text) for name, method in METHODS.items()]))
    return DONE


def _scenes(_: argparse.Namespace) -> int:
    from impactfem.report.table import table  # noqa: PLC0415
    from impactfem.scene import Scene  # noqa: PLC0415

    _say(table([(name, Scene.from_toml(path).title) for name, path in shipped_scenes().items()]))
    return DONE


def _new(given: argparse.Namespace) -> int:
    from impactfem.starting import new  # noqa: PLC0415

    new(given, _say)
    return DONE


def _schema(given: argparse.Namespace) -> int:
    from impactfem.starting import schema  # noqa: PLC0415

    schema(given, _say)
    return DONE


def _plot(given: argparse.Namespace) -> int:
    from impactfem.report.page.page import write_report  # noqa: PLC0415
    from impactfem.result import Result  # noqa: PLC0415
    from impactfem.result.store import replaced  # noqa: PLC0415
    from impactfem.resuming import claimed  # noqa: PLC0415

    try:
        result = Result.load(given.folder)
    except OutputError as error:
        complain(str(error))
        return BAD_INPUT
    with claimed(given.folder), replaced(given.folder) as stage:
        names = [path.name for path in write_report(result, stage)[1]]
    if result.fields is None and not result.scene.is_vibro:
        complain('no fields.vtkhdf: no pictures of the displacement; run with fields = ["vtkhdf"]')
    _say("\n".join(str(given.folder / name) for name in names))
    return DONE


def _bench(given: argparse.Namespace) -> int:
    from impactfem.report.bench import bench  # noqa: PLC0415  (fast --help)

    return DONE if bench(given, _say) else FAILED


def _doctor(_: argparse.Namespace) -> int:
    from impactfem.doctor import examine  # noqa: PLC0415
    from impactfem.report.table import table  # noqa: PLC0415

    rows, faults = examine()
    _say(table(rows))
    for fault in faults:
        complain(fault)
    _say("everything needed is there" if not faults else f"{len(faults)} faults")
    return FAILED if faults else DONE


def _announce(text: str) -> None:
    """Say on standard error what the run is waiting for, above a progress bar if there is one."""
    from impactfem.log import Progress  # noqa: PLC0415

    Progress(enabled=True).message(text)


def _say(text: str) -> None:
    """Print on standard output, from rank 0.

    Raises:
        OutputError: The output goes to a full disk. A reader that has gone is no fault.
    """
    if rank() != 0:
        return
    try:
        print(plain(text), flush=True)
    except OSError as error:
        # What is buffered could not be written at the end either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            raise OutputError(
                f"standard output: cannot be written ({error.strerror}); free some space"
            ) from error


if __name__ == "__main__":
    sys.exit(main())
