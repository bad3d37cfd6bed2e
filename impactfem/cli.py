"""The command line: run, plan, validate, methods, scenes, plot, doctor."""

import argparse
import os
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from impactfem import __version__
from impactfem.errors import ConvergenceError, ImpactError, MeshError, SceneError
from impactfem.shipped import find_scene, shipped_scenes

if TYPE_CHECKING:
    from impactfem.scene import Scene

DONE, FAILED, BAD_INPUT, NOT_CONVERGED = 0, 1, 2, 3
"""Exit codes; an interrupted run ends with 128 + the signal's number."""

_RANK_VARIABLES = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "PMIX_RANK", "MPI_LOCALRANKID")


class InterruptedRunError(BaseException):
    """A signal asked the run to end; not an Exception, so that nothing swallows it."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    # More threads than ranks slow every dense kernel down; set before NumPy loads.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    given = _parser().parse_args(arguments)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)
    try:
        code: int = given.action(given)
    except InterruptedRunError as error:
        _complain(f"interrupted by {signal.Signals(error.number).name}; nothing was written")
        code = 128 + error.number
    except ImpactError as error:
        _complain(str(error))
        code = _code(error)
    except BrokenPipeError:
        # The reader of our output has gone; there is nobody left to tell.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = FAILED
    except Exception:
        if _ranks() > 1:
            _abort()
        raise
    if code > 128 and _ranks() > 1:
        _abort(code)
    return code


def _code(error: ImpactError) -> int:
    if isinstance(error, SceneError | MeshError):
        return BAD_INPUT
    return NOT_CONVERGED if isinstance(error, ConvergenceError) else FAILED


def _interrupt(number: int, _: object) -> NoReturn:
    raise InterruptedRunError(number)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="impactfem",
        description="Non-smooth impact dynamics: give it a scene, it answers with displacement, "
        "contact force and energy, with their error and cost.",
        epilog="Exit codes: 0 done, 1 failed, 2 bad input, 3 no convergence (result kept and "
        "marked), 128 + signal interrupted.",
    )
    parser.add_argument("--version", action="version", version=f"impactfem {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    def command(
        name: str, action: Callable[[argparse.Namespace], int], text: str, *, scene: bool = False
    ) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text)
        sub.set_defaults(action=action)
        if scene:
            sub.add_argument(
                "scene", metavar="SCENE", help="scene file, or name of a shipped scene"
            )
            sub.add_argument(
                "--set", dest="settings", metavar="KEY=VALUE", action="append", default=[],
                help="replace a key of the scene, as solve.elements=80 (repeatable)",
            )  # fmt: skip
        return sub

    run = command("run", _run, "solve a scene and write its result", scene=True)
    run.add_argument("--out", metavar="DIR", type=Path, help="result folder (default results/NAME)")
    run.add_argument("--quiet", action="store_true", help="no progress, no table")
    command("plan", _plan, "say what would be modelled, why, and what it would cost", scene=True)
    command("validate", _validate, "read a scene and say whether it is in order", scene=True)
    command("methods", _methods, "list the solution methods and their limits")
    command("scenes", _scenes, "list the shipped scenes")
    plot = command("plot", _plot, "draw the pictures of a result folder again")
    plot.add_argument("folder", metavar="DIR", type=Path)
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
    from impactfem.solving import solve  # noqa: PLC0415

    path, scene = _read(given)
    folder = given.out or Path("results") / (
        path.parent.name if path.stem == "scene" else path.stem
    )
    root = _rank() == 0
    progress = Progress(enabled=root and not given.quiet)
    for warning in plan(scene).warnings:
        progress.message(f"warning: {warning}")
    with progress.stages(4):
        result = solve(scene, progress=progress)
        progress.step("writing the result")
        _on_root(lambda: result.save(folder))
    if root and not given.quiet:
        print(summary_table(result.summary))
        print(f"\nResult and pictures: {folder}")
    if result.summary["status"] != "completed":
        _complain(
            f"{result.summary['status']}: {result.summary['active_set']['message']}; the result "
            f"is kept in {folder}. Remedy: courant = 1, a layered mesh, a shorter duration or "
            'method = "exact"'
        )
        return NOT_CONVERGED
    return DONE


def _plan(given: argparse.Namespace) -> int:
    from impactfem.planning import plan  # noqa: PLC0415
    from impactfem.report.table import plan_table  # noqa: PLC0415

    print(plan_table(plan(_read(given)[1])))
    return DONE


def _validate(given: argparse.Namespace) -> int:
    from impactfem.planning import plan  # noqa: PLC0415

    path, scene = _read(given)
    plan(scene)
    print(f"{path}: in order ({scene.title})")
    return DONE


def _methods(_: argparse.Namespace) -> int:
    from impactfem.report.table import table  # noqa: PLC0415
    from impactfem.solving import METHODS  # noqa: PLC0415

    print(table(list(METHODS.items())))
    return DONE


def _scenes(_: argparse.Namespace) -> int:
    from impactfem.report.table import table  # noqa: PLC0415
    from impactfem.scene import Scene  # noqa: PLC0415

    print(table([(name, Scene.from_toml(path).title) for name, path in shipped_scenes().items()]))
    return DONE


def _plot(given: argparse.Namespace) -> int:
    from impactfem.report.figures import draw_all, write_all  # noqa: PLC0415
    from impactfem.result import Result  # noqa: PLC0415
    from impactfem.result.store import replaced  # noqa: PLC0415

    result = Result.load(given.folder)
    with replaced(given.folder) as stage:
        names = [path.name for path in write_all(draw_all(result), stage)]
    if result.fields is None:
        _complain('no fields.vtkhdf: no pictures of the displacement; run with fields = ["vtkhdf"]')
    print("\n".join(str(given.folder / name) for name in names))
    return DONE


def _doctor(_: argparse.Namespace) -> int:
    from impactfem.doctor import examine  # noqa: PLC0415
    from impactfem.report.table import table  # noqa: PLC0415

    rows, faults = examine()
    print(table(rows))
    for fault in faults:
        _complain(fault)
    print("everything needed is there" if not faults else f"{len(faults)} faults")
    return FAILED if faults else DONE


def _complain(text: str) -> None:
    """One message on standard error, from rank 0."""
    if _rank() == 0:
        print(f"impactfem: {text}", file=sys.stderr)


def _rank() -> int:
    """Rank of this process as its launcher says it; MPI itself may not be installed."""
    return int(next((os.environ[v] for v in _RANK_VARIABLES if v in os.environ), "0"))


def _ranks() -> int:
    """Number of processes, 1 without MPI."""
    mpi = sys.modules.get("mpi4py.MPI")
    return int(mpi.COMM_WORLD.size) if mpi and mpi.Is_initialized() else 1


def _on_root(action: Callable[[], Any]) -> None:
    """Do something on rank 0 and have every rank share its error."""
    if _ranks() == 1:
        if _rank() == 0:
            action()
        return
    from impactfem.fem import MPI, on_root  # noqa: PLC0415

    def silent() -> None:
        action()

    on_root(MPI.COMM_WORLD, silent)


def _abort(code: int = FAILED) -> NoReturn:
    """End all ranks: the others may be waiting for this one."""
    import traceback  # noqa: PLC0415

    from impactfem.fem import MPI  # noqa: PLC0415

    if sys.exc_info()[0] is not None:
        traceback.print_exc()
    sys.stderr.flush()
    MPI.COMM_WORLD.Abort(code)
    raise SystemExit(code)


if __name__ == "__main__":
    sys.exit(main())
