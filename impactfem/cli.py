"""The command line: arguments, exit codes, and how a run ends; `commands` does the work."""

import argparse
import atexit
import contextlib
import gc
import io
import os
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from impactfem import commands
from impactfem.commands import BAD_INPUT, DONE, FAILED, NOT_TRUSTED
from impactfem.errors import (
    ConvergenceError,
    FolderError,
    ImpactError,
    MeshError,
    OutputError,
    SceneError,
)
from impactfem.extensions import load, load_installed
from impactfem.first_use import announce_to
from impactfem.processes import abort, complain, end_together, join, rank, ranks, say
from impactfem.signals import InterruptedRunError, end_if_deaf, kept_apart, listen


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    _prepare(alone=arguments is None)
    code, reason, patience = DONE, "", 5.0
    try:
        _check_present_folder()
        join()
        given = _parsed(arguments)
        with kept_apart():
            code = given.action(given)
    except SystemExit as end:  # argparse has said why
        code = int(end.code or DONE)
    except InterruptedRunError as error:
        reason = f"interrupted by {signal.Signals(error.number).name}; {error.kept}"
        code, patience = 128 + error.number, 1.0
    except ImpactError as error:
        code, reason = _code(error), str(error)
    except MemoryError as error:
        code, reason = FAILED, f"not enough memory ({error}); use fewer elements or time steps"
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


def _prepare(*, alone: bool) -> None:
    """Set what libraries look for before they are loaded, and what signals and streams do.

    Args:
        alone: Whether the process is ours.
    """
    # More threads than ranks slow every dense kernel down; set before NumPy loads.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    # PETSc would take SIGTERM, print pages about it and leave half-written files.
    options = os.environ.get("PETSC_OPTIONS", "").split()
    os.environ["PETSC_OPTIONS"] = " ".join([*options, "-no_signal_handler"])
    # And UCX, below MPI, SIGHUP: to wait for a debugger.
    os.environ.setdefault("UCX_DEBUG_SIGNO", "0")
    # Libraries make many objects that stay: collecting garbage takes a tenth of their loading.
    gc.set_threshold(50_000)
    # And Python would look through all of them once more as it ends.
    atexit.register(gc.freeze)
    _prepare_streams()
    listen()
    if alone:
        end_if_deaf()


def _check_present_folder() -> None:
    """Refuse a present folder that is gone: PETSc and Matplotlib would end in tracebacks.

    Raises:
        OutputError: It is gone, or may not be read.
    """
    try:
        Path.cwd()
    except OSError as error:
        raise OutputError(
            f"the present folder cannot be used ({error.strerror}); change to another one (cd)"
        ) from error


def _prepare_streams() -> None:
    """Let no unusual character and no closed stream end a run."""
    # Python has None for a stream that the shell closed with >&-.
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: PTH123, SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: PTH123, SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The arguments; only rank 0 says what is wrong with them, and what is compiled.

    Extensions are loaded with them.
    """
    with contextlib.ExitStack() as stack:
        if rank() != 0:
            null = stack.enter_context(open(os.devnull, "w"))  # noqa: PTH123
            stack.enter_context(contextlib.redirect_stdout(null))
            stack.enter_context(contextlib.redirect_stderr(null))
        given = _parser().parse_args(arguments)
    if rank() == 0 and not getattr(given, "quiet", False):
        announce_to(_announce)
    load_installed()
    for extension in given.extensions:
        load(extension)
    return given


def _code(error: ImpactError) -> int:
    if isinstance(error, SceneError | MeshError | FolderError):
        return BAD_INPUT
    return NOT_TRUSTED if isinstance(error, ConvergenceError) else FAILED


class _Version(argparse.Action):
    """Looks for the version when it is asked for: that takes as long as all of --help."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from impactfem import __version__  # noqa: PLC0415

        say(f"impactfem {__version__}")
        parser.exit()


def _folder(name: str) -> Path:
    """The folder that an argument names; an empty name, as of an unset variable, is none."""
    if not name:
        raise argparse.ArgumentTypeError('"" names no folder; "." is the present one')
    return Path(name)


def _tolerance(text: str) -> float:
    """A number from 0 on."""
    with contextlib.suppress(ValueError):
        if (value := float(text)) >= 0.0:
            return value
    raise argparse.ArgumentTypeError(f"{text} is no tolerance: give a number >= 0")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="impactfem",
        description="Non-smooth impact dynamics: give it a scene, it answers with displacement, "
        "contact force and energy, with their error and cost.",
        epilog="Exit codes: 0 done, 1 failed, 2 bad input, 3 not to be trusted (result kept and "
        "marked) or not the same (compare), 128 + signal interrupted.",
    )
    parser.add_argument(
        "--version", action=_Version, nargs=0, help="show the version of impactfem and exit"
    )
    parsers = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    def command(
        action: Callable[[argparse.Namespace], int], *, scene: str | int | None = 0
    ) -> argparse.ArgumentParser:
        text = str(action.__doc__).partition("\n")[0].rstrip(".")
        text = text[0].lower() + text[1:]
        sub = parsers.add_parser(action.__name__, help=text, description=text)
        sub.set_defaults(action=action)
        sub.add_argument(
            "--extension", dest="extensions", metavar="MODULE", action="append", default=[],
            help="file (.py) or module that registers bodies, obstacles, methods (repeatable)",
        )  # fmt: skip
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

    new = command(commands.new)
    new.add_argument("kind", metavar="KIND", nargs="?", help="kind, or name of a shipped scene")
    new.add_argument("--out", metavar="FILE", type=Path, help="scene file (default KIND.toml)")
    new.add_argument(
        "--schema", metavar="PATH",
        help="path or URL of the schema for editors (default: written beside the scene)",
    )  # fmt: skip
    run = command(commands.run, scene="?")
    run.add_argument(
        "--out", metavar="DIR", type=_folder, help="result folder (default results/NAME)"
    )
    run.add_argument(
        "--restart", metavar="DIR", type=_folder,
        help="continue the stopped run of a solid from its checkpoint in DIR (output.checkpoint)",
    )  # fmt: skip
    run.add_argument("--quiet", action="store_true", help="no progress, no table")
    plan = command(commands.plan, scene=None)
    plan.add_argument("--json", action="store_true", help="print the plan as JSON")
    command(commands.validate, scene=None)
    kinematics = command(commands.kinematics, scene=None)
    kinematics.add_argument(
        "--out", metavar="DIR", type=_folder,
        help="folder of kinematics.json and kinematics.png (default results/NAME_kinematics)",
    )  # fmt: skip
    _add_searches(command)
    trajectory = command(commands.trajectory, scene=None)
    trajectory.add_argument(
        "--out", metavar="DIR", type=_folder,
        help="folder of the motion and what follows (default results/NAME_trajectory)",
    )  # fmt: skip
    command(commands.methods)
    command(commands.scenes)
    schema = command(commands.schema)
    schema.add_argument("--out", metavar="FILE", type=Path, help="write it to a file")
    plot = command(commands.plot)
    plot.add_argument("folder", metavar="DIR", type=_folder)
    show = command(commands.show)
    show.add_argument("folder", metavar="DIR", type=_folder)
    show.add_argument(
        "--at", metavar="T", type=float, help="time [s] (default: that of the largest force)"
    )
    show.add_argument(
        "--field", metavar="NAME", help="field that colours tell (default: stress, or velocity)"
    )
    show.add_argument(
        "--out", metavar="FILE", type=Path, help="write a picture (.png) or a page (.html)"
    )
    _add_measures(command)
    bench = command(commands.bench)
    bench.add_argument(
        "scene", metavar="SCENE", nargs="?", help="scene file, or name of a shipped scene"
    )
    bench.add_argument("--hard", action="store_true", help="run the board of hard cases instead")
    bench.add_argument(
        "--schemes", action="store_true",
        help="measure order, stability and cost of textbook schemes instead",
    )  # fmt: skip
    bench.add_argument(
        "--methods", metavar="A,B", help="methods, with settings as dg@degree=1,fitted=true"
    )
    bench.add_argument("--sizes", metavar="N,M",
        help="numbers of elements along the body, of steps for points, rods and beams (default "
        "20,40,80 for bars, 8,16 for solids, 1000,4000,16000 steps)",
    )  # fmt: skip
    bench.add_argument("--repeats", metavar="N", type=int, default=3, help="runs of each size")
    bench.add_argument("--out", metavar="DIR", type=_folder, help="folder for tables and pictures")
    command(commands.doctor)
    return parser


def _add_searches(command: Callable[..., argparse.ArgumentParser]) -> None:
    """Commands of what varies in a scene."""
    for action, what in (
        (commands.gradient, "gradient.json (default results/NAME_gradient)"),
        (commands.identify, "answer, search and report (default results/NAME_identified)"),
        (commands.optimise, "answer, search and report (default results/NAME_optimised)"),
    ):
        sub = command(action, scene=None)
        sub.add_argument("--out", metavar="DIR", type=_folder, help=f"folder of {what}")
        if action is not commands.gradient:
            sub.add_argument(
                "--restart", metavar="DIR", type=_folder,
                help="go on with the interrupted search in DIR, to the same answer bit by bit",
            )  # fmt: skip


def _add_measures(command: Callable[..., argparse.ArgumentParser]) -> None:
    """Commands of what is made of results."""
    spectrum = command(commands.spectrum)
    spectrum.add_argument("folder", metavar="DIR", type=_folder, help="result folder")
    spectrum.add_argument(
        "--column", metavar="COL", required=True, help="column of history.csv, as tip.ax"
    )
    spectrum.add_argument("--fft", action="store_true", help="amplitudes only")
    spectrum.add_argument(
        "--srs", action="store_true", help="shock response spectrum only (of accelerations)"
    )
    spectrum.add_argument(
        "--q", metavar="Q", type=float, help="quality factor of its oscillators (default 10)"
    )
    spectrum.add_argument(
        "--modes", metavar="BODY", help="tell the natural frequencies of a body beside"
    )
    spectrum.add_argument(
        "--out", metavar="DIR", type=_folder, help="folder of the tables (default DIR_spectrum)"
    )
    sweep = command(commands.sweep, scene=None)
    sweep.add_argument(
        "--vary", metavar="KEY=A:B:N", action="append", required=True,
        help="N values from A to B of a key, or key=v1,v2,v3 (repeatable: all combinations)",
    )  # fmt: skip
    sweep.add_argument(
        "--continue", dest="continued", action="store_true",
        help="let each run start where the last one ended, through the values and back again",
    )  # fmt: skip
    sweep.add_argument("--jobs", metavar="N", type=int, default=2, help="processes (default 2)")
    sweep.add_argument(
        "--figure", dest="figures", metavar="NAME", action="append", default=[],
        help="place in summary.json, as contact.impulse, or COL.max, .min, .last (repeatable)",
    )  # fmt: skip
    sweep.add_argument(
        "--section", metavar="COL", help='column seen once in a period, or "impacts": their phases'
    )
    sweep.add_argument("--period", metavar="T", type=float, default=0.0, help="of it [s]")
    sweep.add_argument(
        "--after", metavar="T", type=float, default=0.0, help="time [s] the motion has to settle"
    )
    sweep.add_argument(
        "--out", metavar="DIR", type=_folder,
        help="folder (default results/NAME_sweep); the same command goes on with what it keeps",
    )  # fmt: skip
    compare = command(commands.compare)
    compare.add_argument("one", metavar="DIR", type=_folder, help="result folder")
    compare.add_argument("other", metavar="DIR", type=_folder, help="another one")
    compare.add_argument(
        "--tolerance", metavar="T", type=_tolerance, default=1e-9,
        help="relative difference beyond which the exit code is 3 (default 1e-9)",
    )  # fmt: skip


def _announce(text: str) -> None:
    """Say on standard error what the run is waiting for, above a progress bar if there is one."""
    from impactfem.log import Progress  # noqa: PLC0415

    Progress(enabled=True).message(text)


if __name__ == "__main__":
    sys.exit(main())
