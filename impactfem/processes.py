"""The processes of a run: which one prints, and how all end together."""

import os
import sys
import time
import traceback
from collections.abc import Callable
from typing import Any, NoReturn

from impactfem.errors import OutputError, plain
from impactfem.signals import listen

# As launchers set them before MPI is loaded: Hydra (MPICH), Open MPI, PMIx, Intel MPI, Slurm.
_RANK = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "PMIX_RANK", "MPI_LOCALRANKID", "SLURM_PROCID")
_SIZE = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE")


def rank() -> int:
    """Rank of this process as its launcher says it; MPI itself may not be installed."""
    return _number(_RANK, 0)


def launched() -> bool:
    """Whether a launcher started this process as one of several."""
    return rank() > 0 or _number(_SIZE, 1) > 1


def _number(names: tuple[str, ...], default: int) -> int:
    """The first of the environment variables that holds an integer."""
    values = (os.environ.get(name, "") for name in names)
    return next((int(value) for value in values if value.isdecimal()), default)


def ranks() -> int:
    """Number of processes that MPI joins, 1 as long as it is not loaded."""
    mpi = sys.modules.get("mpi4py.MPI")
    return int(mpi.COMM_WORLD.size) if mpi and mpi.Is_initialized() else 1


def join() -> None:
    """Load MPI if a launcher started several processes, so that they can end together."""
    if not launched():
        return
    try:
        from mpi4py import MPI  # noqa: F401, PLC0415  (absent where only closed forms are used)
    except ImportError:
        return
    listen()
    if ranks() == 1:
        complain(
            f"started as {_number(_SIZE, 1)} processes, but MPI knows one: mpirun belongs to "
            "another MPI than mpi4py; use the mpirun that `impactfem doctor` names"
        )


def say(text: str) -> None:
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


def on_root(action: Callable[[], Any]) -> None:
    """Do something on rank 0 and have every rank share its error."""
    if ranks() == 1:
        if rank() == 0:
            action()
        return
    from impactfem.fem import MPI, on_root  # noqa: PLC0415

    def silent() -> None:
        action()

    on_root(MPI.COMM_WORLD, silent)


def complain(text: str) -> None:
    """One message on standard error, from rank 0."""
    if rank() == 0:
        print(f"impactfem: {plain(text)}", file=sys.stderr, flush=True)


def end_together(code: int, reason: str, patience: float = 5.0) -> None:
    """Wait until every rank has failed too: the first to leave would take the others along.

    Args:
        code: Exit code.
        reason: What a rank that failed alone says.
        patience: Seconds after which a rank that failed alone ends the others, which wait for it.
    """
    if ranks() == 1:
        return
    request = sys.modules["mpi4py.MPI"].COMM_WORLD.Ibarrier()
    limit = time.monotonic() + patience
    while not request.Test():
        if time.monotonic() > limit:
            print(f"impactfem: rank {rank()} alone: {plain(reason)}", file=sys.stderr)
            abort(code)
        time.sleep(0.01)


def abort(code: int) -> NoReturn:
    """End all ranks now: the others may be waiting for this one."""
    if sys.exc_info()[0] is not None:
        sys.stderr.write(traceback.format_exc())
    sys.stderr.flush()
    time.sleep(0.5)  # launchers drop what they have not passed on when a rank aborts
    sys.modules["mpi4py.MPI"].COMM_WORLD.Abort(code)
    raise SystemExit(code)
